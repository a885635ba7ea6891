"""What moves in the scene by itself stands where it is on each frame: waited for, gone round, passed, or named."""

import math

import bpy
import numpy as np
import pytest
from mathutils import Quaternion

from .shapes import add_cube

DOOR = 0.9


def box(name, size, place):
    return add_cube(name, place, size)


def doorway(oncue):
    """A room of 7 × 6 m in two halves, the only way between them a gap of 0.9 m at the middle; a stool behind it."""
    box("Floor", (7, 6, 0.1), (0, 0, -0.05))
    box("WallL", (0.1, 2.55, 2.2), (-0.2, -1.725, 1.1))
    box("WallR", (0.1, 2.55, 2.2), (-0.2, 1.725, 1.1))
    box("Stool", (0.45, 0.45, 0.45), (1.5, 0, 0.225))
    cues = oncue("bridge.cue_objects")
    cues.make_cue(bpy.context, "start", (-2, 0, 0), math.radians(90))
    cues.make_cue(bpy.context, "sit", (1.5, -0.02, 0.55), 0.0)


def door(keys, name="Door"):
    """A door in the gap with its hinge at one side; `keys`: (frame, degrees) that it is open."""
    leaf = box(name, (0.06, DOOR, 2.1), (-0.2, -0.45, 1.05))
    corners = np.array([v.co for v in leaf.data.vertices])
    corners[:, 1] = corners[:, 1] + 0.5
    for vertex, corner in zip(leaf.data.vertices, corners, strict=True):
        vertex.co = corner
    for frame, degrees in keys:
        leaf.rotation_euler = (0, 0, math.radians(-degrees))
        leaf.keyframe_insert("rotation_euler", frame=frame)
    return leaf


def request_of(oncue, frame=1):
    bpy.context.scene.frame_set(frame)
    request, notes = oncue("bridge.session").read_request(bpy.context)
    return request, notes


def run(oncue):
    """The report of a run."""
    assert bpy.ops.oncue.synthesize() == {"FINISHED"}
    return oncue("bridge.session").current_report(bpy.context.scene)


def joints(frame):
    scene = bpy.context.scene
    scene.frame_set(frame)
    character = scene.oncue.character.evaluated_get(bpy.context.evaluated_depsgraph_get())
    return {bone.name: character.matrix_world @ bone.head for bone in character.pose.bones}


def test_what_moves_is_read_with_its_places_and_nothing_else_is(oncue):
    doorway(oncue)
    leaf = door([(1, 90), (31, 0)])
    request, notes = request_of(oncue)
    assert [thing.name for thing in request.moving] == ["Door"]
    assert notes == []
    (thing,) = request.moving
    # 24 frames a second: shut at 1.25 s, core frame 37.5.
    assert 37 <= len(thing.translations) <= 40
    corners = np.array([leaf.matrix_world @ v.co for v in leaf.data.vertices])
    assert np.allclose(thing.at(0), corners, atol=1e-5)
    bpy.context.scene.frame_set(500)
    corners = np.array([leaf.matrix_world @ v.co for v in leaf.data.vertices])
    assert np.allclose(thing.at(900), corners, atol=1e-4)
    bpy.context.scene.frame_set(13)
    corners = np.array([leaf.matrix_world @ v.co for v in leaf.data.vertices])
    assert np.allclose(thing.at(15), corners, atol=1e-3)


def path():
    """A straight line that what hangs on it goes along in a second and a quarter."""
    curve = bpy.data.curves.new("Path", "CURVE")
    curve.dimensions, curve.use_path, curve.path_duration = "3D", True, 100
    line = curve.splines.new("POLY")
    line.points.add(1)
    line.points[1].co = (1.5, 0, 0, 1)
    for frame, share in ((1, 0), (31, 100)):
        curve.eval_time = share
        curve.keyframe_insert("eval_time", frame=frame)
    thing = bpy.data.objects.new("Path", curve)
    bpy.context.scene.collection.objects.link(thing)
    return thing


def rig(target):
    """An armature without keys, whose bone a constraint moves."""
    thing = bpy.data.objects.new("Rig", bpy.data.armatures.new("Rig"))
    bpy.context.scene.collection.objects.link(thing)
    bpy.context.view_layer.objects.active = thing
    bpy.ops.object.mode_set(mode="EDIT")
    thing.data.edit_bones.new("Hinge").tail = (0, 0, 1)
    bpy.ops.object.mode_set(mode="OBJECT")
    thing.pose.bones["Hinge"].constraints.new("COPY_LOCATION").target = target
    return thing


@pytest.mark.parametrize("how", ["keys", "driver", "parent", "constraint", "path", "parent path", "bone"])
def test_it_makes_no_difference_where_the_playhead_stands(oncue, how):
    doorway(oncue)
    if how == "keys":
        door([(1, 90), (31, 0)])
    else:
        leaf = door([])
        mover = bpy.data.objects.new("Mover", None)
        bpy.context.scene.collection.objects.link(mover)
        for frame, x in ((1, 0.0), (31, 1.5)):
            mover.location.x = x
            mover.keyframe_insert("location", frame=frame)
        if how == "parent":
            leaf.parent = mover
        elif how == "constraint":
            leaf.constraints.new("COPY_LOCATION").target = mover
        elif how == "path":
            leaf.constraints.new("FOLLOW_PATH").target = path()
        elif how == "parent path":
            leaf.parent = path()
        elif how == "bone":
            leaf.parent, leaf.parent_type, leaf.parent_bone = rig(mover), "BONE", "Hinge"
        else:
            driver = leaf.driver_add("location", 0).driver
            driver.expression = "frame / 20"
    scene = bpy.context.scene
    seen = []
    for frame in (1, 17, 200):
        request, _ = request_of(oncue, frame)
        assert scene.frame_current == frame
        (thing,) = request.moving
        seen.append((request.positions[request.triangles], *(thing.at(f) for f in (0, 10, 35, 80))))
    for other in seen[1:]:
        for a, b in zip(seen[0], other, strict=True):
            assert np.allclose(a, b, atol=1e-4)


def test_what_is_keyed_and_stands_still_is_furniture(oncue):
    doorway(oncue)
    plain, _ = request_of(oncue)
    stool = bpy.data.objects["Stool"]
    for frame in (1, 50):
        stool.keyframe_insert("location", frame=frame)
    stool.driver_add("rotation_euler", 2).driver.expression = "0"
    request, notes = request_of(oncue)
    assert request.moving == ()
    assert notes == []
    assert np.array_equal(request.positions, plain.positions)
    assert np.array_equal(request.triangles, plain.triangles)


def test_what_moved_before_the_shot_stands_where_it_came_to(oncue):
    doorway(oncue)
    door([(1, 90), (31, 0)])
    bpy.context.scene.oncue.start_frame = 40
    request, _ = request_of(oncue, frame=5)
    assert request.moving == ()
    corners = request.positions[np.unique(request.triangles)]
    assert np.isclose(corners[:, 1], 0.45, atol=1e-5).any(), "shut"


def test_what_changes_its_size_is_followed(oncue):
    doorway(oncue)
    stool = bpy.data.objects["Stool"]
    # From nothing to twice its size: 24 frames a second, the core's frame 30 is the scene's 25.
    for frame, size in ((1, 0.0), (49, 0.9)):
        stool.scale = (size, size, size)
        stool.keyframe_insert("scale", frame=frame)
    stool.location.z = 0.0
    for playhead in (30, 49):
        request, notes = request_of(oncue, frame=playhead)
        assert notes == []
        (thing,) = request.moving
        assert thing.name == "Stool"
        for frame in (0, 30, 45, 900):
            bpy.context.scene.frame_set(1 + min(round(frame * 0.8), 200))
            corners = np.array([stool.matrix_world @ v.co for v in stool.data.vertices])
            assert np.allclose(np.ptp(thing.at(frame), axis=0), np.ptp(corners, axis=0), atol=0.03), frame
    # While it is nothing the core knows nothing of it, and takes the rest: somebody stands in it.
    objects = thing.for_core()
    assert 0 < len(objects) < len(thing.shapes)
    place = np.array([[1.5, 0.0, 0.95]] * 60, dtype=np.float32)
    turns = np.tile(np.array([1, 0, 0, 0], dtype=np.float32), (60, 22, 1))
    job = oncue("native").core.pass_moving(place, turns, np.ones((60, 2), np.float32), objects, 0.0)
    passing = oncue("moving").by_object(job.result())
    (meeting,) = passing["meetings"]
    assert meeting["object"] == "Stool"
    assert 0 < meeting["first"] < meeting["frame"], "it has to grow first"


def test_what_comes_and_goes_is_named_with_the_frame(oncue):
    doorway(oncue)
    stool = bpy.data.objects["Stool"]
    for frame, hidden in ((1, False), (20, True)):
        stool.hide_viewport = hidden
        stool.keyframe_insert("hide_viewport", frame=frame)
    stool.location.x = 1.6
    stool.keyframe_insert("location", frame=30)
    request, notes = request_of(oncue, frame=5)
    assert request.moving == ()
    assert [said for name, said in notes if name == "Stool"] == [
        "Stool has no size, or comes and goes: it was read as it is at frame 5."
    ]


def test_a_door_that_shuts_is_named_with_its_frames(oncue):
    doorway(oncue)
    door([(1, 90), (30, 0)])
    report = run(oncue)
    assert not report["success"]
    assert "‘Door’ moves, and the person runs into it on frames" in report["problems"][0], report["problems"]
    (meeting,) = report["extension"]["moving"]["meetings"]
    # The figures are of where things stand on each frame: nothing of what was planned about is left in them.
    assert meeting["frames"] / report["frames"] == pytest.approx(report["extension"]["moving"]["percent"] / 100)
    assert report["penetration"]["whole_body_percent"] > 2.0
    deepest = report["extension"]["deepest"]
    assert (deepest["object"], deepest["depth_cm"]) == ("Door", meeting["depth_cm"])
    lines = [line for line, _ in oncue("panels").result_lines(report)]
    assert any("in what moves (Door)" in line for line in lines)
    words = report["problems"][0].split()
    first, last = (int(words[words.index("frames") + k].strip(",")) for k in (1, 3))
    place = joints((first + last) // 2)["Hips"]
    assert max(abs(place.x + 0.2), abs(place.y)) < 0.6, "there it is in the doorway"
    assert meeting["depth_cm"] > 5


def test_a_door_that_opens_is_walked_through_after_it_has_opened(oncue):
    doorway(oncue)
    leaf = door([(1, 0), (80, 0), (100, 90)])
    report = run(oncue)
    assert report["success"], report["problems"]
    # It is measured in what is there at the frame: the leaf that stands beside the way, and not all that it swept.
    assert report["penetration"]["whole_body_percent"] == 0.0
    assert report["body"]["scene"]["touches"] == []
    assert report["extension"]["deepest"] is None
    begins = report["extension"]["begins"]
    assert begins > bpy.context.scene.oncue.start_frame
    # In the doorway only once the door is open.
    through = [f for f in range(1, 400) if abs((hips := joints(f)["Hips"]).x + 0.2) < 0.1 and abs(hips.y) < 0.45]
    assert through
    assert through[0] > 85
    bpy.context.scene.frame_set(through[0])
    assert leaf.rotation_euler.z < math.radians(-30)
    # Who waits stands at the start.
    assert (joints(1)["Hips"] - joints(begins)["Hips"]).length < 1e-4


def test_a_thing_that_crosses_the_way_is_passed(oncue):
    """A block that goes to and fro on the straight way to the stool: waited for or gone round."""
    doorway(oncue)
    for name in ("WallL", "WallR"):
        bpy.data.objects.remove(bpy.data.objects[name])
    block = box("Cart", (0.6, 0.6, 1.0), (-0.5, -2.0, 0.5))
    for frame, y in ((1, -2.0), (40, 0.0), (70, 0.0), (100, 2.0)):
        block.location.y = y
        block.keyframe_insert("location", frame=frame)
    report = run(oncue)
    assert report["success"], report["problems"]
    scene = bpy.context.scene
    last = int(scene.oncue.character.animation_data.action.frame_range[1])
    for frame in range(1, last, 2):
        hips = joints(frame)["Hips"]
        away = max(abs(hips.x - block.location.x), abs(hips.y - block.location.y))
        assert away > 0.3, frame


def test_where_no_way_ever_opens_it_is_said_what_moves(oncue):
    doorway(oncue)
    leaf = door([(1, 0), (50, 0)])
    for frame, z in ((1, 0.0), (50, 0.02)):
        leaf.location.z = 1.05 + z
        leaf.keyframe_insert("location", frame=frame)
    with pytest.raises(RuntimeError, match=r"cannot be reached.*What moves \(‘Door’\) was taken as it stands"):
        bpy.ops.oncue.synthesize()


def test_resolve_measures_what_moves_at_its_frames(oncue):
    """A door that shuts on who has been let through: what is said of the take before and after a hand is moved."""
    doorway(oncue)
    leaf = door([(1, 90), (2000, 90)])
    leaf.keyframe_insert("location", frame=1)
    report = run(oncue)
    assert report["success"], report["problems"]
    # Now it shuts as the person comes through.
    scene = bpy.context.scene
    character = scene.oncue.character
    last = int(character.animation_data.action.frame_range[1])
    through = next(f for f in range(1, last) if abs(joints(f)["Hips"].x + 0.2) < 0.05)
    leaf.animation_data_clear()
    for frame, degrees in ((through - 20, 90), (through, 0)):
        leaf.rotation_euler = (0, 0, math.radians(-degrees))
        leaf.keyframe_insert("rotation_euler", frame=frame)
    scene.frame_set(last)
    head = character.pose.bones["Head"]
    head.rotation_quaternion = head.rotation_quaternion @ Quaternion((0.98, 0.2, 0, 0))
    head.keyframe_insert("rotation_quaternion", frame=last)
    scene.frame_set(7)
    assert bpy.ops.oncue.resolve() == {"FINISHED"}
    assert scene.frame_current == 7
    report = oncue("bridge.session").current_report(scene)
    assert "‘Door’ moves, and the person runs into it on frames" in report["problems"][0]
    assert not report["success"]
    assert report["extension"]["moving"]["objects"] == ["Door"]
    assert report["extension"]["deepest"]["object"] == "Door"
    assert through - 20 < report["extension"]["deepest"]["frame"] < through + 20
