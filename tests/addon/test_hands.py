"""Hand cues → φ_M: whatever moves them, at the core's frame rate."""

import json
import math

import bmesh
import bpy
import numpy as np
import pytest

from .shapes import add_cube
from .test_character import evaluated_palm


@pytest.fixture
def read(oncue):
    reader = oncue("bridge.hand_reader")

    def read(start_frame=1, scale=1.0):
        found = reader.read_manipulations(bpy.context, start_frame, scale)
        json.dumps(found)  # the report keeps it
        return [{**entry, "path": np.array(entry["path"])} for entry in found]

    return read


@pytest.fixture
def hand(oncue, context):
    """A hand cue over frames 1 to 61, on the active object where one is selected."""
    place = oncue("bridge.cue_objects").place_hand
    return lambda kind="right_hand", first=1, last=61: place(context, kind, first, last, 1.0)


def key(thing, path, values):
    """Linear keys: {frame: value}."""
    for frame, value in values.items():
        setattr(thing, path, value)
        thing.keyframe_insert(path, frame=frame)


def linear(oncue, thing):
    for curve in oncue("bridge.compat").action_curves(thing.animation_data.action):
        for point in curve.keyframe_points:
            point.interpolation = "LINEAR"


def select_only(thing):
    for other in bpy.context.view_layer.objects:
        other.select_set(other == thing)
    bpy.context.view_layer.objects.active = thing


@pytest.mark.parametrize("rate", [24, 25, 30, 60])
def test_keys_are_read_at_thirty_frames_a_second(context, oncue, read, hand, rate):
    context.scene.render.fps = rate
    cue = hand(first=11, last=11 + 2 * rate)
    key(cue, "location", {11: (0, 0, 1), 11 + 2 * rate: (1, 0, 1)})
    linear(oncue, cue)
    (found,) = read(start_frame=11 - rate)
    assert (found["name"], found["hand"], found["first_frame"]) == ("Right Hand", "right", 30)
    # Two seconds from one second on, whatever the scene's rate.
    assert found["path"].shape == (61, 3)
    assert found["path"][:, 0] == pytest.approx(np.linspace(0, 1, 61), abs=1e-4)


def test_the_current_frame_is_kept(context, oncue, read, hand):
    cue = hand()
    key(cue, "location", {1: (0, 0, 1), 61: (1, 0, 1)})
    context.scene.frame_set(17, subframe=0.25)
    before = tuple(cue.location)
    read()
    assert (context.scene.frame_current, context.scene.frame_subframe) == (17, 0.25)
    assert tuple(cue.location) == pytest.approx(before)


def test_a_hinge_takes_the_cue_along(context, oncue, read, hand):
    """A door's leaf turns by 90° about its edge; the cue stands on its handle."""
    context.scene.render.fps = 30
    hinge = bpy.data.objects.new("Hinge", None)
    context.scene.collection.objects.link(hinge)
    leaf = add_cube("Leaf", location=(0.4, 0, 1), scale=(0.8, 0.04, 2))
    leaf.parent = hinge
    key(hinge, "rotation_euler", {1: (0, 0, 0), 61: (0, 0, math.pi / 2)})
    linear(oncue, hinge)
    context.scene.frame_set(1)
    select_only(leaf)
    context.scene.cursor.location = (0.7, -0.05, 1.0)
    cue = hand()
    assert cue.parent == leaf
    assert oncue("bridge.cue_objects").animated_range(cue) == (1, 61)
    (found,) = read()
    angles = np.linspace(0, math.pi / 2, 61)
    expected = np.stack(
        [
            0.7 * np.cos(angles) + 0.05 * np.sin(angles),
            0.7 * np.sin(angles) - 0.05 * np.cos(angles),
            np.ones(61),
        ],
        axis=1,
    )
    assert np.abs(found["path"] - expected).max() < 1e-4


def test_a_constraint_and_a_driver_move_it_too(context, oncue, read, hand):
    target = bpy.data.objects.new("Target", None)
    context.scene.collection.objects.link(target)
    curve = target.driver_add("location", 0)
    curve.driver.expression = "frame * 0.01"
    cue = hand(last=31)
    cue.constraints.new("COPY_LOCATION").target = target
    (found,) = read()
    # A hundredth a frame of the scene, at 24 frames a second.
    assert len(found["path"]) == 39
    assert found["path"][:, 0] == pytest.approx(0.01 + 0.008 * np.arange(39), abs=1e-4)


@pytest.mark.parametrize("with_modifier", [False, True])
def test_a_vertex_goes_where_shape_keys_and_modifiers_take_it(context, oncue, read, with_modifier):
    context.scene.render.fps = 30
    lid = add_cube("Lid", location=(1, 2, 0.5))
    lid.shape_key_add(name="Basis")
    opened = lid.shape_key_add(name="Open")
    for point in opened.data:
        point.co.z += 0.3
    key(opened, "value", {1: 0.0, 31: 1.0})
    linear(oncue, lid.data.shape_keys)
    raised = 0.0
    if with_modifier:
        modifier, raised = lid.modifiers.new("Raise", "DISPLACE"), 0.1
        modifier.direction, modifier.mid_level, modifier.strength = "Z", 0.0, raised
    context.scene.frame_set(1)
    select_only(lid)
    bpy.ops.object.mode_set(mode="EDIT")
    mesh = bmesh.from_edit_mesh(lid.data)
    mesh.verts.ensure_lookup_table()
    for vertex in mesh.verts:
        vertex.select_set(vertex.index == 7)
    bmesh.update_edit_mesh(lid.data)
    assert bpy.ops.oncue.place_hand(kind="left_hand", first_frame=1, last_frame=31) == {"FINISHED"}
    bpy.ops.object.mode_set(mode="OBJECT")
    (found,) = read()
    assert found["hand"] == "left"
    corner = np.array([1.5, 2.5, 1.0 + raised])
    assert found["path"][0] == pytest.approx(corner, abs=1e-4)
    assert found["path"][-1] == pytest.approx(corner + np.array([0, 0, 0.3]), abs=1e-4)
    assert len(found["path"]) == 31


def test_several_cues_and_centimetres(context, oncue, read, hand):
    context.scene.render.fps = 30
    first, second = hand("left_hand", 1, 5), hand("both_hands", 3, 9)
    first.location, second.location = (10, 20, 100), (30, 0, 90)
    hand("right_hand").hide_set(True)
    context.view_layer.update()
    both, left = read(scale=0.01)
    assert (left["first_frame"], len(left["path"]), left["hand"]) == (0, 5, "left")
    assert (both["first_frame"], len(both["path"]), both["hand"]) == (2, 7, "both")
    assert left["path"][2] == pytest.approx([0.1, 0.2, 1.0])


def test_bad_ranges_are_sentences(context, oncue, read, hand):
    cue = hand(first=10, last=20)

    def refused(words, **keys):
        for name, value in keys.items():
            cue[f"oncue_{name}"] = value
        with pytest.raises(oncue("errors").SceneError, match=words):
            read(start_frame=5)

    refused("Right Hand ends at frame 8, before it begins at 10", last_frame=8)
    refused("Right Hand begins at frame 3, before the motion's first frame 5", first_frame=3)
    refused("Right Hand lasts", first_frame=10, last_frame=1_000_000)
    refused("Right Hand does not say", last_frame="soon")
    cue["oncue_last_frame"] = 20
    cue.location.x = float("nan")
    context.view_layer.update()
    refused("Right Hand stands at a place that is not a number")


@pytest.mark.parametrize(
    ("rate", "frame", "core_frames"), [(60, 4, (1, 2)), (60, 5, (2,)), (24, 6, (6, 7)), (30, 4, (3,))]
)
def test_a_single_frame_is_the_cores_frames_beside_it(context, read, hand, rate, frame, core_frames):
    context.scene.render.fps = rate
    hand(first=frame, last=frame)
    (found,) = read()
    assert tuple(found["first_frame"] + np.arange(len(found["path"]))) == core_frames


def someone_still(core, frames=60):
    """Who stands with the arms hanging and the knees a little bent: root positions, rotations, contacts."""
    names = list(core.skeleton()["names"])
    root_positions = np.tile(np.float32([0, 0, 0.97]), (frames, 1))
    rotations = np.zeros((frames, len(names), 4), np.float32)
    rotations[..., 0] = 1
    # Of 2.3 cm less than the legs' length.
    knee = 2 * math.acos(1 - 0.023 / (2 * 0.444))
    turns = {"LeftArm": (1, 1.2), "RightArm": (1, -1.2)}
    for side in ("Left", "Right"):
        turns |= {f"{side}UpLeg": (0, -knee / 2), f"{side}Leg": (0, knee), f"{side}Foot": (0, -knee / 2)}
    for name, (axis, angle) in turns.items():
        rotations[:, names.index(name), 0] = math.cos(angle / 2)
        rotations[:, names.index(name), 1 + axis] = math.sin(angle / 2)
    return root_positions, rotations, np.ones((frames, 2), np.float32)


@pytest.mark.parametrize("rate", [24, 25, 30, 60])
@pytest.mark.parametrize(("begins_s", "lasts_s"), [(1.0, 1.0), (1.9, 1.3), (3.2, 0.9)])
def test_the_wrist_is_on_the_path_at_every_frame_of_the_range(
    context, oncue, core, read, hand, rate, begins_s, lasts_s
):
    """Within the motion of two seconds, over its end and after it."""
    start_frame = 37
    context.scene.render.fps = rate
    # An odd number of frames after the start: between two of the core's, but at its own rate.
    first = start_frame + (round(begins_s * rate) | 1)
    last = first + round(lasts_s * rate)
    cue = hand("left_hand", first, last)
    # It moves from before the range until after it, at a quarter of a metre a second.
    rise = 0.125 * (lasts_s + 2.0)
    key(cue, "location", {first - rate: (0.2, -0.35, 1.1 - rise), last + rate: (0.2, -0.35, 1.1 + rise)})
    linear(oncue, cue)
    still = someone_still(core)
    manipulations = [{**entry, "path": entry["path"].tolist()} for entry in read(start_frame)]
    edited = core.edit_motion(*still, manipulations=manipulations).result()
    assert len(edited.root_positions) > len(still[0])
    skeleton = core.skeleton()
    character = oncue("bridge.armature").make_character(context, skeleton, 1.0)
    oncue("bridge.action_writer").write_action(
        context,
        character,
        list(skeleton["names"]),
        oncue("motion").Motion(edited.root_positions, edited.rotations, 30.0),
        name="Reach",
        start_frame=start_frame,
        metres_per_unit=1.0,
    )
    misses = []
    for frame in range(first, last + 1):
        palm = evaluated_palm(character, "Left", frame)
        depsgraph = context.evaluated_depsgraph_get()
        misses.append((palm - cue.evaluated_get(depsgraph).matrix_world.translation).length)
    assert max(misses) < 1e-3
    # At the end the person stands as before.
    assert (edited.rotations[-1] == still[1][-1]).all()
    assert (edited.root_positions[-1] == still[0][-1]).all()


def test_the_button(context, oncue):
    context.scene.render.fps = 25
    context.scene.frame_set(40)
    context.scene.cursor.location = (1, 2, 3)
    assert bpy.ops.oncue.place_hand(kind="both_hands") == {"FINISHED"}
    cue = bpy.data.objects["Both Hands"]
    assert tuple(cue.location) == (1, 2, 3)
    # Two seconds from the current frame on, where nothing is animated.
    assert (cue["oncue_first_frame"], cue["oncue_last_frame"]) == (40, 90)
    # A cue does not hang on another.
    bpy.ops.oncue.place_hand(kind="left_hand")
    assert bpy.data.objects["Left Hand"].parent is None


def test_the_button_takes_the_range_of_the_hinge(context):
    drawer = add_cube("Drawer")
    key(drawer, "location", {12: (0, 0, 0), 48: (0, -0.4, 0)})
    select_only(drawer)
    bpy.ops.oncue.place_hand(kind="right_hand")
    cue = bpy.data.objects["Right Hand"]
    assert (cue["oncue_first_frame"], cue["oncue_last_frame"]) == (12, 48)


def test_no_single_vertex_is_a_sentence(context):
    cube = add_cube("Lid")
    select_only(cube)
    bpy.ops.object.mode_set(mode="EDIT")
    mesh = bmesh.from_edit_mesh(cube.data)
    for vertex in mesh.verts:
        vertex.select_set(True)
    with pytest.raises(RuntimeError, match="8 vertices of Lid are selected"):
        bpy.ops.oncue.place_hand(kind="left_hand")
    bpy.ops.object.mode_set(mode="OBJECT")
    assert not [o for o in context.scene.objects if o.get("oncue_cue")]
