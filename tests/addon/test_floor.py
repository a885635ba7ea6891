"""The floor is the level under the start, whatever else is level; and what is said where it is not the cue's."""

import math

import bmesh
import bpy
import pytest

from .shapes import add_cube


def box(name, size, place):
    return add_cube(name, place, size)


def sky(radius):
    mesh = bpy.data.meshes.new("Sky")
    bm = bmesh.new()
    bmesh.ops.create_uvsphere(bm, u_segments=32, v_segments=16, radius=radius)
    bm.to_mesh(mesh)
    bm.free()
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("Sky", mesh))


def room(oncue, z=0.0):
    """A floor of 7 × 6 m at height `z`, a stool, a start before it and a cue on it."""
    box("Floor", (7, 6, 0.1), (0, 0, z - 0.05))
    box("Stool", (0.45, 0.45, 0.45), (1.5, 0, z + 0.225))
    cues = oncue("bridge.cue_objects")
    start = cues.make_cue(bpy.context, "start", (-2, 0, z), math.radians(90))
    return start, cues.make_cue(bpy.context, "sit", (1.5, -0.02, z + 0.55), 0.0)


def indexed(oncue, core):
    """The scene as a run would index it, and its task."""
    bpy.context.view_layer.update()
    request, _ = oncue("bridge.session").read_request(bpy.context)
    return core.index_scene(request.positions, request.triangles, None, request.task).result(), request.task


LARGER = {
    "garden 0.3 m lower": lambda: box("Garden", (12, 12, 0.02), (0, 0, -0.31)),
    "garden 0.15 m lower": lambda: box("Garden", (12, 12, 0.02), (0, 0, -0.16)),
    "storey below": lambda: box("Below", (10, 8, 0.1), (0, 0, -3.05)),
    "roof": lambda: box("Roof", (12, 12, 0.2), (0, 0, 3.0)),
    "sky of 8 m": lambda: sky(8),
    "sky of 25 m": lambda: sky(25),
    "sky of 500 m": lambda: sky(500),
    "ground 100 m wide": lambda: box("Ground", (100, 100, 0.02), (0, 0, -0.11)),
    "ground box under the house": lambda: box("Ground", (20, 20, 4), (0, 0, -2.1)),
    "rug": lambda: box("Rug", (3, 3, 0.02), (-2, 0, 0.01)),
    "podium beside the way": lambda: box("Podium", (7, 1.2, 0.16), (0, 2.3, 0.08)),
}


@pytest.mark.parametrize("what", LARGER)
def test_a_larger_surface_is_not_taken_for_the_floor(oncue, core, what):
    room(oncue)
    LARGER[what]()
    scene, task = indexed(oncue, core)
    assert scene.floor_height == pytest.approx(0.0, abs=1e-3)
    core.check_task(scene, task)


def test_an_upper_storey_is_walked_on(oncue, core):
    box("Below", (12, 12, 0.1), (0, 0, -0.05))
    start, _ = room(oncue, z=4.37)
    scene, task = indexed(oncue, core)
    assert scene.floor_height == pytest.approx(4.37, abs=1e-3)
    core.check_task(scene, task)
    start.location.z = 0.0
    scene, task = indexed(oncue, core)
    assert scene.floor_height == pytest.approx(0.0, abs=1e-3)
    with pytest.raises(core.InputError, match=r"on another level.*at z = 4.37 m, that of the start at z = 0.00 m"):
        core.check_task(scene, task)


def test_a_motion_is_made_over_a_lower_garden(oncue):
    room(oncue)
    LARGER["garden 0.3 m lower"]()
    assert bpy.ops.oncue.synthesize() == {"FINISHED"}
    report = oncue("bridge.session").current_report(bpy.context.scene)
    assert report["success"], report["problems"]


def test_a_bed_is_sat_on_at_its_edge(oncue, core):
    box("Floor", (7, 6, 0.1), (0, 0, -0.05))
    box("Bed", (2.0, 2.2, 0.5), (1.5, 0, 0.25))
    cues = oncue("bridge.cue_objects")
    cues.make_cue(bpy.context, "start", (-2, 0, 0), 0.0)
    sit = cues.make_cue(bpy.context, "sit", (1.5, 0, 0.6), math.radians(-90))
    scene, task = indexed(oncue, core)
    with pytest.raises(
        core.InputError, match=r"The nearest edge to sit on is 0\.[78]\d m away: move it to x = "
    ) as said:
        core.check_task(scene, task)
    # There it can be done.
    words = str(said.value).split()
    sit.location.x = float(words[words.index("x") + 2])
    sit.location.y = float(words[words.index("y") + 2])
    core.check_task(*indexed(oncue, core))
