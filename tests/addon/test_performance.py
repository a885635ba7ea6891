"""Several Sit and Stop cues: their order, and one motion that meets them all."""

import bpy
import numpy as np
import pytest
from mathutils import Quaternion

from .runs import current_action, datablocks
from .shapes import add_cube, add_floor


@pytest.fixture
def objects(oncue):
    return oncue("bridge.cue_objects")


@pytest.fixture
def read(oncue):
    return lambda: oncue("bridge.cue_reader").read_task(bpy.context)


@pytest.fixture
def room(objects):
    """A floor and a bench; the person starts before it, sits down, gets up and stops aside."""
    add_floor()
    add_cube("Bench", (0.0, 1.6, 0.225), (1.6, 0.5, 0.45))
    objects.make_cue(bpy.context, "start", (0.3, -1.6, 0), 3.0)
    sit = objects.make_cue(bpy.context, "sit", (0.0, 1.5, 0.55), 0.0)
    stop = objects.make_cue(bpy.context, "stop", (-1.2, -1.0, 0), 0.0, name="Aside")
    objects.number_steps([sit, stop])
    sit["oncue_hold_seconds"] = 1.0
    bpy.context.scene.oncue.start_frame = 11
    bpy.context.scene.render.fps = 30
    return sit, stop


def names(task):
    return [step["cue"]["name"] for step in task["steps"]]


def test_cues_are_played_by_their_numbers_and_then_by_name(objects, read):
    objects.make_cue(bpy.context, "start", (0, 0, 0), 0.0)
    made = {name: objects.make_cue(bpy.context, "stop", (1, 0, 0), 0.0, name=name) for name in "DCBA"}
    assert names(read()) == ["A", "B", "C", "D"]
    made["D"]["oncue_step"], made["B"]["oncue_step"] = 1, 2
    assert names(read()) == ["D", "B", "A", "C"]
    # A number that is none is no number, and a hidden cue waits.
    made["D"]["oncue_step"] = "first"
    made["B"].hide_set(True)
    bpy.context.view_layer.update()
    assert names(read()) == ["A", "C", "D"]


def test_each_cue_has_its_own_feet_and_its_own_stay(objects, read):
    objects.make_cue(bpy.context, "start", (0, 0, 0), 0.0)
    one = objects.make_cue(bpy.context, "sit", (1, 0, 0.5), 0.0, name="One")
    objects.make_cue(bpy.context, "stop", (2, 0, 0), 0.0, name="Two")
    objects.make_cue(bpy.context, "left_foot", (1.1, 0, 0), 0.0, parent=one)
    # One without a parent belongs to nobody where there are several.
    objects.make_cue(bpy.context, "right_foot", (0.9, 0, 0), 0.0)
    one["oncue_hold_seconds"] = 2.5
    first, second = read()["steps"]
    assert first["hold_seconds"] == 2.5
    assert second["hold_seconds"] is None
    assert first["cue"]["feet"][0] == pytest.approx([1.1, 0, 0])
    assert (first["cue"]["feet"][1], second["cue"]["feet"]) == (None, [None, None])


def test_then_adds_a_cue_and_the_arrows_move_it(oncue, objects, read):
    add_floor()
    cursor = bpy.context.scene.cursor
    for kind, place, then in (("start", 0.0, False), ("stop", 1.0, False), ("stop", 2.0, True), ("stop", 2.5, True)):
        cursor.location = (place, 0, 0)
        assert bpy.ops.oncue.place_cue(kind=kind, then=then) == {"FINISHED"}
    assert names(read()) == ["Stop", "Stop.001", "Stop.002"]
    assert [step["cue"]["position"][0] for step in read()["steps"]] == pytest.approx([1.0, 2.0, 2.5])
    # Who goes on from one stop to the next faces the way that was gone.
    assert read()["steps"][2]["cue"]["yaw"] == pytest.approx(np.pi / 2, abs=1e-3)
    assert bpy.ops.oncue.move_step(cue="Stop.002", by=-1) == {"FINISHED"}
    assert names(read()) == ["Stop", "Stop.002", "Stop.001"]
    bpy.ops.oncue.move_step(cue="Stop", by=9)
    assert names(read()) == ["Stop.002", "Stop.001", "Stop"]
    with pytest.raises(RuntimeError, match="Nowhere"):
        bpy.ops.oncue.move_step(cue="Nowhere")
    # The plain button moves the one that is worked on, and makes it a sit or a stop.
    assert bpy.ops.oncue.select_cue(cue="Stop.001") == {"FINISHED"}
    assert bpy.context.active_object.name == "Stop.001"
    cursor.location = (-2.0, 0, 0)
    bpy.ops.oncue.place_cue(kind="stop")
    assert [step["cue"]["position"][0] for step in read()["steps"]] == pytest.approx([2.5, -2.0, 1.0])
    assert oncue("bridge.shown_cues").step_of(bpy.data.objects["Stop.001"]) == 2


def test_one_motion_meets_them_all(oncue, core, room):
    session, panels = oncue("bridge.session"), oncue("panels")
    assert bpy.ops.oncue.synthesize() == {"FINISHED"}
    action, scene = current_action(), bpy.context.scene
    report = session.report_of(action)
    assert report["success"], report["problems"]
    assert [cue["cue"] for cue in report["cues"]] == ["Sit", "Aside"]
    assert action.name.startswith("Sit on Bench and 1 more")
    # What the report says is what Blender shows, at the markers too.
    character = scene.oncue.character
    markers = {marker.name: marker.frame for marker in action.pose_markers}
    assert markers == {cue["cue"]: 11 + cue["frame"] for cue in report["cues"]}
    assert session.frames_of_cues(bpy.context) == markers
    for cue, place in zip(report["cues"], room, strict=True):
        scene.frame_set(markers[cue["cue"]])
        posed = character.evaluated_get(bpy.context.evaluated_depsgraph_get())
        away = (posed.matrix_world @ posed.pose.bones["Hips"].head) - place.location
        if cue["action_type"] == "stop":
            away.z = 0.0
        assert 100 * away.length == pytest.approx(cue["pelvis_cm"], abs=0.1)
        assert cue["pelvis_cm"] < 10.0
    lines = [line for line, _ in panels.result_lines(report)]
    assert "Sit: met" in lines
    assert "Aside: met" in lines
    assert session.belongs_to_cues(bpy.context, report)

    # Re-solve measures all of it again.
    scene.frame_set(40)
    bone = character.pose.bones["Head"]
    bone.rotation_quaternion = bone.rotation_quaternion @ Quaternion((1, 0, 0), 0.1)
    bone.keyframe_insert("rotation_quaternion")
    assert bpy.ops.oncue.resolve() == {"FINISHED"}
    again = session.report_of(action)
    assert [cue["cue"] for cue in again["cues"]] == ["Sit", "Aside"]
    assert again["cues"] == report["cues"]
    assert again["steps"] == report["steps"]

    # Another order, or a longer stay, is another performance.
    room[0]["oncue_hold_seconds"] = 2.0
    assert not session.belongs_to_cues(bpy.context, again)
    room[0]["oncue_hold_seconds"] = 1.0
    assert session.belongs_to_cues(bpy.context, again)
    bpy.ops.oncue.move_step(cue="Aside", by=-1)
    assert not session.belongs_to_cues(bpy.context, again)
    assert session.frames_of_cues(bpy.context) == {}


def test_a_moved_cue_leaves_what_lies_before_it(oncue, core, room):
    session = oncue("bridge.session")

    def solved():
        bpy.ops.oncue.synthesize()
        action = current_action()
        return oncue("bridge.solved").solved_of(action).motion, session.report_of(action)

    before, report = solved()
    room[1].location.x += 0.3
    bpy.context.view_layer.update()
    after, moved = solved()
    seam = report["steps"][1]["first_frame"]
    assert moved["steps"][1]["first_frame"] == seam
    assert np.array_equal(before.rotations[: seam + 1], after.rotations[: seam + 1])
    assert not np.array_equal(before.root_positions[-1], after.root_positions[-1])
    # As if nothing had been made before.
    oncue("operators.synthesize").earlier.performed = None
    assert np.array_equal(solved()[0].rotations, after.rotations)


def test_waypoints_belong_to_the_cue_that_they_lead_to(oncue, objects, read):
    add_floor()
    cursor = bpy.context.scene.cursor

    def place(kind, x, then=False):
        cursor.location = (x, 0, 0)
        assert bpy.ops.oncue.place_cue(kind=kind, then=then) == {"FINISHED"}

    def order():
        return [cue.name for cue in oncue("bridge.shown_cues").played_cues(bpy.context)]

    place("start", -3.0)
    place("stop", 0.0)
    # Before the cue that is selected, then after the pass that is.
    place("pass", -2.0)
    place("pass", -1.0)
    assert order() == ["Pass", "Pass.001", "Stop"]
    task = read()
    assert "steps" not in task
    assert [(p["name"], p["position"][0]) for p in task["passes"]] == [("Pass", -2.0), ("Pass.001", -1.0)]
    assert task["cue"]["name"] == "Stop"
    place("stop", 3.0, then=True)
    place("pass", 2.0)
    first, second = read()["steps"]
    beside = [(text, place.x) for text, place, _ in oncue("overlay").numbers(bpy.context)]
    assert beside == [("1", -2.0), ("2", -1.0), ("3", 0.0), ("4", 2.0), ("5", 3.0)]
    assert [p["name"] for p in first["passes"]] == ["Pass", "Pass.001"]
    assert [p["name"] for p in second["passes"]] == ["Pass.002"]
    bpy.ops.oncue.move_step(cue="Pass.002", by=-1)
    first, second = read()["steps"]
    assert [p["name"] for p in first["passes"]] == ["Pass", "Pass.001", "Pass.002"]
    assert "passes" not in second
    # One that nothing follows leads nowhere.
    bpy.ops.oncue.move_step(cue="Pass.001", by=9)
    with pytest.raises(oncue("errors").SceneError, match=r"Pass\.001 is a Pass cue that nothing follows"):
        read()
    bpy.data.objects["Pass.001"].hide_set(True)
    bpy.context.view_layer.update()
    assert [p["name"] for p in read()["steps"][0]["passes"]] == ["Pass", "Pass.002"]
    # Nobody turns the start to where it does not go first.
    forward = oncue("bridge.cue_objects").forward_of(bpy.data.objects["Start"].matrix_world)
    assert forward.x == pytest.approx(1.0, abs=1e-3)


def test_a_walk_passes_its_waypoint(oncue, core, room):
    session, panels = oncue("bridge.session"), oncue("panels")
    _, stop = room
    room[0].hide_set(True)
    bpy.context.view_layer.objects.active = stop
    bpy.context.scene.cursor.location = (1.2, -0.2, 0)
    assert bpy.ops.oncue.place_cue(kind="pass") == {"FINISHED"}
    with pytest.raises(oncue("errors").SceneError, match=r"Follow Cues plays no Pass cue, and there is Pass"):
        session.read_request(bpy.context, hands=False)
    assert bpy.ops.oncue.synthesize() == {"FINISHED"}
    action, scene = current_action(), bpy.context.scene
    report = session.report_of(action)
    assert report["success"], report["problems"]
    assert [(cue["cue"], cue["action_type"]) for cue in report["cues"]] == [("Pass", "pass"), ("Aside", "stop")]
    passed, met = report["cues"]
    markers = {marker.name: marker.frame for marker in action.pose_markers}
    assert markers == {"Pass": 11 + passed["frame"], "Aside": 11 + met["frame"]}
    assert session.frames_of_cues(bpy.context) == markers
    scene.frame_set(markers["Pass"])
    character = scene.oncue.character
    posed = character.evaluated_get(bpy.context.evaluated_depsgraph_get())
    away = (posed.matrix_world @ posed.pose.bones["Hips"].head) - bpy.data.objects["Pass"].location
    assert 100 * away.xy.length == pytest.approx(passed["pelvis_cm"], abs=0.1)
    assert passed["pelvis_cm"] < 15.0
    lines = [line for line, _ in panels.result_lines(report)]
    assert lines[:2] == ["Pass: met", f"    Passed {passed['pelvis_cm']:.1f} cm away"]
    # Re-solve measures it again.
    scene.frame_set(markers["Pass"])
    bone = character.pose.bones["Head"]
    bone.rotation_quaternion = bone.rotation_quaternion @ Quaternion((1, 0, 0), 0.1)
    bone.keyframe_insert("rotation_quaternion")
    assert bpy.ops.oncue.resolve() == {"FINISHED"}
    again = session.report_of(action)["cues"]
    assert [(cue["cue"], cue["frame"], cue["met"]) for cue in again] == [
        ("Pass", passed["frame"], True),
        ("Aside", met["frame"], True),
    ]
    assert again[0]["pelvis_cm"] == pytest.approx(passed["pelvis_cm"], abs=0.01)
    # A waypoint that is moved makes it another walk.
    assert session.belongs_to_cues(bpy.context, report)
    bpy.data.objects["Pass"].location.x += 0.1
    bpy.context.view_layer.update()
    assert not session.belongs_to_cues(bpy.context, report)
    bpy.data.objects["Pass"].hide_set(True)
    bpy.context.view_layer.update()
    assert not session.belongs_to_cues(bpy.context, report)


def test_a_waypoint_in_the_furniture_is_named(objects, room):
    before_it = objects.make_cue(bpy.context, "pass", (0.0, 1.6, 0.0), 0.0, name="Through")
    objects.number_steps([before_it, *room])
    before = datablocks()
    with pytest.raises(RuntimeError, match="Pass cue ‘Through’ stands inside furniture"):
        bpy.ops.oncue.synthesize()
    assert datablocks() == before


def test_what_plays_one_cue_says_so(oncue, objects, room):
    with pytest.raises(oncue("errors").SceneError, match=r"Follow Cues plays one.*there are 2"):
        oncue("bridge.session").read_request(bpy.context, hands=False)
    objects.place_hand(bpy.context, "left_hand", 30, 40, 1.0)
    before = datablocks()
    with pytest.raises(RuntimeError, match=r"Left Hand.*there are 2"):
        bpy.ops.oncue.synthesize()
    assert datablocks() == before


def test_a_cue_that_cannot_be_met_is_named_before_anything_is_made(room):
    room[1].location = (0.0, 1.6, 0.0)
    bpy.context.view_layer.update()
    before = datablocks()
    with pytest.raises(RuntimeError, match="Aside"):
        bpy.ops.oncue.synthesize()
    assert datablocks() == before
