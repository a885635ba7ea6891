"""A whole house with all that lies about it: each task in it is played, or refused in one true sentence."""

import math

import bmesh
import bpy
import pytest

from .runs import current_action
from .shapes import add_cube

#: Heights of the floors, metres.
GARDEN, GROUND, UPPER, ROOF = -0.3, 0.0, 2.9, 6.0
#: A low stage that one steps onto, and a podium of one step.
STAGE, PODIUM = 0.08, 0.18


def box(name, size, place):
    """A box of a size whose base is at a place."""
    return add_cube(name, (place[0], place[1], place[2] + size[2] / 2), size)


def wall(name, size, place, floor):
    box(f"{name} {floor}", (*size, 2.65), (*place, floor))


@pytest.fixture
def house(context, core):
    """Two storeys of 8 × 8 m, a stair, a garden 30 cm lower, a flat roof, a sky, and a ground box under all of it."""
    box("Ground", (40, 40, 3), (0, 0, GARDEN - 3))
    box("Floor", (8, 8, 0.28), (0, 0, -0.28))
    box("Upper Floor", (8, 8, 0.25), (0, 0, UPPER - 0.25))
    box("Roof", (9, 9, 0.2), (0, 0, ROOF - 0.2))
    for floor in (GROUND, UPPER):
        wall("North", (8, 0.2), (0, 3.9), floor)
        wall("East", (0.2, 8), (3.9, 0), floor)
        wall("West", (0.2, 8), (-3.9, 0), floor)
    wall("South", (8, 0.2), (0, -3.9), UPPER)
    # Downstairs with a door.
    wall("South West", (3.4, 0.2), (-2.3, -3.9), GROUND)
    wall("South East", (3.4, 0.2), (2.3, -3.9), GROUND)
    for step in range(16):
        box(f"Stair {step}", (1.0, 0.27, 0.05), (-3.2, -3.2 + 0.27 * step, (step + 1) * UPPER / 16 - 0.05))
    box("Rug", (2.4, 1.6, 0.015), (0, 0, GROUND))
    box("Stage", (2.2, 1.6, STAGE), (2.6, 2.9, GROUND))
    box("Podium", (2.0, 1.6, PODIUM), (-2.8, 2.9, GROUND))
    box("Sofa", (1.6, 0.7, 0.42), (-2.0, -1.2, GROUND))
    box("Bed", (1.6, 2.0, 0.5), (2.2, 2.4, UPPER))
    box("Chair", (0.45, 0.45, 0.45), (-2.5, 2.0, UPPER))
    box("Bench", (1.6, 0.5, 0.45), (0, -9, GARDEN))
    mesh, made = bpy.data.meshes.new("Sky"), bmesh.new()
    bmesh.ops.create_uvsphere(made, u_segments=32, v_segments=16, radius=60)
    made.to_mesh(mesh)
    made.free()
    context.scene.collection.objects.link(bpy.data.objects.new("Sky", mesh))
    return context


#: (place, degrees) of starts; (kind, place, degrees) of cues.
STARTS = {
    "downstairs": ((1.5, -2.5, GROUND), 90),
    "on the rug": ((0, 0, GROUND + 0.015), 0),
    "in the garden": ((2, -6, GARDEN), 0),
    "upstairs": ((-1, -2, UPPER), 0),
    "on the roof": ((-2, -2, ROOF), 0),
    "on the podium": ((-2.6, 2.7, PODIUM), 0),
    "in the air": ((0, -2, 1.2), 0),
    "under the floor": ((0, -2, GARDEN), 0),
}
CUES = {
    "sofa": ("sit", (-1.8, -0.95, GROUND + 0.52), 180),
    "the rug": ("stop", (0, 0, GROUND + 0.015), 0),
    "stage": ("stop", (2.4, 2.7, STAGE), 0),
    "podium": ("stop", (-2.8, 2.9, PODIUM), 0),
    "garden": ("stop", (-5, -7, GARDEN), 90),
    "bench": ("sit", (0, -8.85, GARDEN + 0.55), 180),
    "edge of the bed": ("sit", (1.5, 2.4, UPPER + 0.6), -90),
    "middle of the bed": ("sit", (2.2, 2.4, UPPER + 0.6), -90),
    "chair": ("sit", (-2.5, 1.9, UPPER + 0.55), 0),
    "roof": ("stop", (2, 2, ROOF), 0),
}


def at(z):
    # The rug is a floor too.
    return r"z = 0\.0[01] m" if z == GROUND else rf"z = {z:.2f} m"


def apart(there, here):
    where = f"the floor there is at {at(there)}, that of the start at {at(here)}"
    return f"stands on another level than start ‘Start’: {where}"


#: Empty where it is played; what it is refused for.
TASKS = {
    ("downstairs", "sofa"): "",
    ("downstairs", "the rug"): "",
    ("on the rug", "sofa"): "",
    ("in the garden", "bench"): "",
    ("in the garden", "garden"): "",
    ("upstairs", "edge of the bed"): "",
    ("upstairs", "chair"): "",
    ("on the roof", "roof"): "",
    ("upstairs", "middle of the bed"): r"nearest edge to sit on is 0\.6\d m away: move it to x = 1\.6",
    ("downstairs", "stage"): apart(STAGE, GROUND),
    ("downstairs", "podium"): apart(PODIUM, GROUND),
    ("on the podium", "sofa"): apart(GROUND, PODIUM),
    ("in the garden", "sofa"): apart(GROUND, GARDEN),
    ("downstairs", "chair"): apart(UPPER, GROUND),
    ("upstairs", "sofa"): apart(GROUND, UPPER),
    ("on the roof", "chair"): apart(UPPER, ROOF),
    ("in the air", "sofa"): r"Start ‘Start’ stands 1\.20 m over the nearest surface; lower it onto the floor\.",
    (
        "under the floor",
        "sofa",
    ): "Start ‘Start’ stands inside furniture or a wall; move it to a free place",
}


@pytest.mark.parametrize("task", TASKS, ids=lambda task: " to ".join(task))
def test_each_task_is_played_or_refused_in_one_sentence(house, oncue, core, task):
    refused = TASKS[task]
    cues = oncue("bridge.cue_objects")
    (place, degrees), (kind, goal, facing) = STARTS[task[0]], CUES[task[1]]
    cues.make_cue(house, "start", place, math.radians(degrees))
    cues.make_cue(house, kind, goal, math.radians(facing))
    house.view_layer.update()
    if refused:
        with pytest.raises(RuntimeError, match=refused) as error:
            bpy.ops.oncue.synthesize()
        assert len([line for line in str(error.value).splitlines() if line.startswith("Error: ")]) == 1
        assert not bpy.data.actions
        return
    assert bpy.ops.oncue.synthesize() == {"FINISHED"}
    report = oncue("bridge.session").current_report(house.scene)
    assert report["success"], report["problems"]
    assert report["cues"][0]["met"]
    # The feet are on the floor of the storey, from the first frame to the last.
    first, last = map(int, current_action().frame_range)
    character = house.scene.oncue.character
    for frame in range(first, last + 1, 10):
        house.scene.frame_set(frame)
        lowest = min((character.matrix_world @ character.pose.bones[f"{side}Toe"].tail).z for side in ("Left", "Right"))
        assert -0.05 < lowest - min(place[2], round(place[2], 1)) < 0.12, frame
