"""Several Sit and Stop cues: their order, and one motion that meets them all."""

import bpy
import numpy as np
import pytest
from mathutils import Quaternion

from .runs import current_action, datablocks
from .shapes import add_cube, add_floor
from .test_character import evaluated_palm


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


def test_a_hand_that_is_asked_for_too_early_is_told_by_its_cue_and_person(oncue, objects, room):
    bpy.context.scene.cursor.location = (0.1, 1.0, 0.9)
    objects.place_hand(bpy.context, "left_hand", 30, 40, 1.0)
    assert bpy.ops.oncue.synthesize() == {"FINISHED"}
    report = oncue("bridge.session").report_of(current_action())
    met = report["cues"][0]["frame"] + 11
    said = f"‘Left Hand’ is out of reach on frame 30, and ‘Start’ is at ‘Sit’ on frame {met} only"
    assert [problem for problem in report["problems"] if said in problem], report["problems"]
    assert not report["success"]
    assert all(cue["met"] for cue in report["cues"])


def test_a_cue_that_cannot_be_met_is_named_before_anything_is_made(room):
    room[1].location = (0.0, 1.6, 0.0)
    bpy.context.view_layer.update()
    before = datablocks()
    with pytest.raises(RuntimeError, match="Aside"):
        bpy.ops.oncue.synthesize()
    assert datablocks() == before


def test_frames_become_times_of_the_motion(oncue, objects, read, room):
    session, scene = oncue("bridge.session"), bpy.context.scene
    sit, stop = room
    sit["oncue_at_frame"], stop["oncue_at_frame"] = 200, 320.0
    assert [step["at_seconds"] for step in read()["steps"]] == pytest.approx([189 / 30, 309 / 30])
    scene.render.fps = 24
    assert read()["steps"][0]["at_seconds"] == pytest.approx(189 / 24)
    # A body of another size has another clock.
    assert oncue("body_size").scaled(read(), 0.25)["steps"][0]["at_seconds"] == pytest.approx(189 / 48)
    said = oncue("body_size").sentence_in_scene("1.4 s after frame 20, 0.5 m off", 0.25)
    assert said == "0.7 s after frame 20, 0.1 m off"
    # A single cue at a time is a performance of one step, without one it is a task; Follow Cues plays none.
    sit.hide_set(True)
    bpy.context.view_layer.update()
    (step,) = read()["steps"]
    assert step["at_seconds"] == pytest.approx(309 / 24)
    with pytest.raises(oncue("errors").SceneError, match=r"Follow Cues plays no cue .* on a frame, as Aside is"):
        session.read_request(bpy.context, hands=False)
    # A hand goes with a time.
    scene.cursor.location = (-1.05, -1.45, 1.1)
    hand = objects.place_hand(bpy.context, "left_hand", 360, 370, 1.0)
    assert bpy.ops.oncue.synthesize() == {"FINISHED"}
    report = session.report_of(current_action())
    assert report["success"], report["problems"]
    assert abs(report["steps"][0]["late_s"]) < 0.02
    for frame in (360, 370):
        assert (evaluated_palm(scene.oncue.character, "Left", frame) - hand.matrix_world.translation).length < 0.01
    bpy.data.objects.remove(hand)
    del stop["oncue_at_frame"]
    assert "steps" not in read()


def test_frames_that_cannot_be_are_refused(oncue, read, room):
    sit, stop = room
    error = oncue("errors").SceneError
    sit["oncue_at_frame"] = 200
    for frame in (200, 150):
        stop["oncue_at_frame"] = frame
        with pytest.raises(error, match=rf"Aside is to be reached on frame {frame}, and Sit before it on frame 200"):
            read()
    for wrong in ("soon", True, float("nan"), float("inf")):
        stop["oncue_at_frame"] = wrong
        with pytest.raises(error, match="Aside is to be reached on a frame that is no number"):
            read()
    for frame in (11, 5, -40):
        sit["oncue_at_frame"] = frame
        with pytest.raises(error, match=f"Sit is to be reached on frame {frame}, and the motion begins on frame 11"):
            read()


def test_the_button_has_the_person_be_there_on_the_frame(oncue, core, room):
    session, panels, scene = oncue("bridge.session"), oncue("panels"), bpy.context.scene
    sit, stop = room
    assert bpy.ops.oncue.synthesize() == {"FINISHED"}
    free = session.frames_of_cues(bpy.context)
    # It begins with the frame on which the cue is met anyway.
    assert bpy.ops.oncue.be_here(cue="Aside") == {"FINISHED"}
    assert stop["oncue_at_frame"] == free["Aside"]
    assert not session.belongs_to_cues(bpy.context, session.report_of(current_action()))
    stop["oncue_at_frame"] = free["Aside"] + 75
    assert bpy.ops.oncue.synthesize() == {"FINISHED"}
    action = current_action()
    report = session.report_of(action)
    assert report["success"], report["problems"]
    assert session.frames_of_cues(bpy.context) == {"Sit": free["Sit"], "Aside": free["Aside"] + 75}
    assert {marker.name: marker.frame for marker in action.pose_markers}["Aside"] == free["Aside"] + 75
    assert report["steps"][1]["waits_s"] == pytest.approx(2.5)
    assert report["steps"][1]["late_s"] == pytest.approx(0.0, abs=0.02)
    assert [line for line, _ in panels.result_lines(report)].count("    On time") == 1
    # Where nobody can be so soon the motion is kept, and the scene's frames are told, after Re-solve too.
    assert bpy.ops.oncue.be_here(cue="Sit") == {"FINISHED"}
    sit["oncue_at_frame"] = free["Sit"] - 45
    assert bpy.ops.oncue.synthesize() == {"FINISHED"}
    late, action = session.report_of(current_action()), current_action()
    met = session.frames_of_cues(bpy.context)["Sit"]
    assert free["Sit"] - 45 < met < free["Sit"]
    said = f"‘Sit’ is reached on frame {met}, {(met - free['Sit'] + 45) / 30:.1f} s after frame {free['Sit'] - 45}"
    assert not late["success"]
    assert any(said in problem for problem in late["problems"])
    scene.frame_set(40)
    bone = scene.oncue.character.pose.bones["Head"]
    bone.rotation_quaternion = bone.rotation_quaternion @ Quaternion((1, 0, 0), 0.1)
    bone.keyframe_insert("rotation_quaternion")
    assert bpy.ops.oncue.resolve() == {"FINISHED"}
    again = session.report_of(action)
    assert not again["success"]
    assert any(said in problem for problem in again["problems"])
    # Pressed again it takes the frame off.
    assert bpy.ops.oncue.be_here(cue="Sit") == {"FINISHED"}
    assert "oncue_at_frame" not in sit
    with pytest.raises(RuntimeError, match="Nowhere"):
        bpy.ops.oncue.be_here(cue="Nowhere")
    # What nobody gets to in time, whatever they do, is refused before anything is made.
    stop["oncue_at_frame"] = 20
    before = datablocks()
    with pytest.raises(RuntimeError, match=r"‘Aside’ cannot be reached by frame 20: .* before frame \d+"):
        bpy.ops.oncue.synthesize()
    assert datablocks() == before


def test_a_hand_is_led_at_the_cue_that_it_is_nearest_to(oncue, room):
    """The seams hold, the hand is on its path on its frames of the scene, and the person stays for it."""
    session, scene = oncue("bridge.session"), bpy.context.scene
    place_hand = oncue("bridge.cue_objects").place_hand
    for other in bpy.context.view_layer.objects:
        other.select_set(False)
    scene.cursor.location = (-1.05, -1.45, 1.1)
    cue = place_hand(bpy.context, "left_hand", 600, 630, 1.0)
    request, _ = session.read_request(bpy.context)
    assert [len(step.get("manipulations", [])) for step in request.task["steps"]] == [0, 1]
    assert bpy.ops.oncue.synthesize() == {"FINISHED"}
    report = session.report_of(current_action())
    assert report["success"], report["problems"]
    (held,) = report["edited"]["constraints"]
    assert held["name"] == "Left Hand"
    assert held["met"]
    misses = [
        (evaluated_palm(scene.oncue.character, "Left", frame) - cue.matrix_world.translation).length
        for frame in range(600, 631)
    ]
    assert max(misses) < 0.01
    assert current_action().name.startswith("Sit on Bench and 1 more with Left Hand")
    assert session.belongs_to_cues(bpy.context, report)
    cue["oncue_last_frame"] = 640
    assert not session.belongs_to_cues(bpy.context, report)
