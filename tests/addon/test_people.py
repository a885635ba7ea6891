"""Several people in one shot: whose cue is whose, and who is written onto which character."""

import json

import bpy
import numpy as np
import pytest

from .shapes import add_cube, add_floor


@pytest.fixture
def objects(oncue):
    return oncue("bridge.cue_objects")


@pytest.fixture
def two(objects):
    """A floor, and two people whose straight ways cross; each stops on the other side."""
    add_floor()
    context = bpy.context
    made = []
    for place, to in (((-2.0, 0.0, 0), (1.6, 0.0, 0)), ((0.0, -2.0, 0), (0.0, 1.4, 0))):
        yaw = objects.yaw_from_heading(np.arctan2(to[1] - place[1], to[0] - place[0]))
        start = objects.make_cue(context, "start", place, yaw)
        stop = objects.make_cue(context, "stop", to, yaw)
        stop["oncue_person"] = start
        made += [start, stop]
    context.scene.oncue.start_frame = 11
    context.scene.render.fps = 30
    return made


def place(kind, x, y, then=False):
    bpy.context.scene.cursor.location = (x, y, 0)
    assert bpy.ops.oncue.place_cue(kind=kind, then=then) == {"FINISHED"}
    return bpy.context.active_object


def test_new_cues_are_of_the_person_who_is_worked_on(oncue, objects):
    shown, reader = oncue("bridge.shown_cues"), oncue("bridge.cue_reader")
    add_floor()
    ann, first = place("start", -2.0, 0.0), place("stop", 0.0, 1.0)
    # Alone nothing needs to be said of whose a cue is.
    assert "oncue_person" not in first
    assert "steps" not in reader.read_task(bpy.context)
    bpy.context.scene.cursor.location = (0.0, -2.0, 0)
    assert bpy.ops.oncue.add_person() == {"FINISHED"}
    ben = bpy.context.active_object
    assert (ben["oncue_cue"], first["oncue_person"], first.name) == ("start", ann, "Stop")
    with pytest.raises(RuntimeError, match=r"Start\.001 has no Sit or Stop cue of its own"):
        bpy.ops.oncue.synthesize()
    second, third = place("stop", 1.0, 0.0), place("stop", 1.5, 1.0, then=True)
    assert second["oncue_person"] == third["oncue_person"] == ben
    # The one that is worked on moves, and stays whose it is.
    bpy.ops.oncue.select_cue(cue=first.name)
    assert place("stop", 0.2, 1.2) == first
    assert shown.end_cues(bpy.context, ann) == [first]
    assert shown.end_cues(bpy.context, ben) == [second, third]
    bpy.ops.oncue.move_step(cue=third.name, by=-1)
    assert shown.end_cues(bpy.context, ben) == [third, second]
    assert [text for text, _, _ in oncue("overlay").numbers(bpy.context)] == ["1", "2"]

    # Other names make no difference, a copy of a cue is the same person's, and who is hidden waits with all cues.
    ben.name = "Ben"
    copy = second.copy()
    bpy.context.scene.collection.objects.link(copy)
    bpy.context.view_layer.update()
    task = reader.read_task(bpy.context, start=ben)
    assert [step["cue"]["name"] for step in task["steps"]] == [third.name, second.name, copy.name]
    ben.hide_set(True)
    bpy.context.view_layer.update()
    assert reader.read_task(bpy.context)["cue"]["name"] == first.name
    ben.hide_set(False)
    bpy.context.view_layer.update()

    # Follow Cues and Variations are for one.
    with pytest.raises(RuntimeError, match="There are 2 Start cues"):
        bpy.ops.oncue.variations()
    with pytest.raises(oncue("errors").SceneError, match="There are 2 Start cues"):
        oncue("bridge.session").read_request(bpy.context, hands=False)


def test_cues_of_nobody_are_named(oncue, two):
    stray = oncue("bridge.cue_objects").make_cue(bpy.context, "stop", (1, 1, 0), 0.0, name="Stray")
    with pytest.raises(RuntimeError, match="Stray is a cue of nobody, and 2 people start"):
        bpy.ops.oncue.synthesize()
    for thing in bpy.context.view_layer.objects:
        thing.select_set(thing in (stray, two[2]))
    bpy.context.view_layer.objects.active = stray
    with pytest.raises(RuntimeError, match="last the Start cue"):
        bpy.ops.oncue.give_to_person()
    bpy.context.view_layer.objects.active = two[2]
    assert bpy.ops.oncue.give_to_person() == {"FINISHED"}
    assert stray["oncue_person"] == two[2]
    # Whose start is deleted has nobody, until another one is alone.
    bpy.data.objects.remove(stray)
    extra = oncue("bridge.cue_objects").make_cue(bpy.context, "start", (1.5, 1.5, 0), 0.0, name="Extra")
    two[3]["oncue_person"] = extra
    bpy.context.scene.collection.objects.link(two[3]) if not two[3].users_collection else None
    bpy.data.objects.remove(extra)
    bpy.context.view_layer.update()
    with pytest.raises(RuntimeError, match=r"Stop\.001 is a cue of nobody"):
        bpy.ops.oncue.synthesize()


def test_two_who_start_at_one_place_are_named(core, two):
    two[2].location = (-2.0, 0.2, 0)
    bpy.context.view_layer.update()
    with pytest.raises(RuntimeError, match=r"‘Start’ and ‘Start\.001’ are 20 cm apart"):
        bpy.ops.oncue.synthesize()


def test_each_person_acts_on_a_character_of_their_own(oncue, core, two, tmp_path):
    session, panels, people = oncue("bridge.session"), oncue("panels"), oncue("bridge.people")
    context, scene = bpy.context, bpy.context.scene
    assert bpy.ops.oncue.synthesize() == {"FINISHED"}
    cast = people.cast(context)
    assert [person.start for person in cast] == [two[0], two[2]]
    characters = [person.character for person in cast]
    assert characters[0] != characters[1]
    assert scene.oncue.character == characters[0]
    actions = [session.action_of(character) for character in characters]
    reports = [session.report_of(action) for action in actions]
    for start, stop, character, action, report in zip(two[::2], two[1::2], characters, actions, reports, strict=True):
        assert report["success"], report["problems"]
        assert (report["extension"]["person"], report["others"]["percent"]) == (start.name, 0.0)
        assert action["oncue_take_of"] == character
        assert {marker.name for marker in action.pose_markers} == {stop.name}
        scene.frame_set(int(action.frame_end))
        posed = character.evaluated_get(context.evaluated_depsgraph_get())
        away = (posed.matrix_world @ posed.pose.bones["Hips"].head) - stop.location
        assert away.xy.length < 0.1
        assert session.belongs_to_cues(context, report)
    assert scene.frame_end >= max(action.frame_end for action in actions)
    frames = session.frames_of_cues(context)
    assert set(frames) == {two[1].name, two[3].name}
    # Nobody is in anybody on any frame: the pelvises are well apart.
    for frame in range(11, int(max(action.frame_end for action in actions)) + 1):
        scene.frame_set(frame)
        graph = context.evaluated_depsgraph_get()
        hips = [
            one.evaluated_get(graph).matrix_world @ one.evaluated_get(graph).pose.bones["Hips"].head
            for one in characters
        ]
        assert (hips[0] - hips[1]).length > 0.3, frame
    # Takes and figures are those of who is chosen.
    assert bpy.ops.oncue.choose_person(start=two[2].name) == {"FINISHED"}
    assert scene.oncue.character == characters[1]
    assert f"{two[3].name}: met" in [line for line, _ in panels.result_lines(session.current_report(scene))]

    # Again: the same people, the same motion, another take each.
    assert bpy.ops.oncue.synthesize() == {"FINISHED"}
    assert [person.character for person in people.cast(context)] == characters
    assert scene.oncue.character == characters[1]
    solved = oncue("bridge.solved").solved_of
    for character, before in zip(characters, actions, strict=True):
        after = session.action_of(character)
        assert after != before
        assert np.array_equal(solved(after).motion.rotations, solved(before).motion.rotations)

    # One report of all.
    told = session.shot_report(reports, [("Extra", "Why not.")], 1)
    assert [one["extension"]["person"] for one in told["people"]] == ["Start", "Start.001", "Extra"]
    assert (told["success"], told["problems"]) == (False, ["Extra: Why not."])
    assert [(cue["person"], cue["cue"]) for cue in told["cues"]] == [("Start", "Stop"), ("Start.001", "Stop.001")]
    json.dumps(told)


def test_batch_plays_all(oncue, core, two, tmp_path):
    add_cube("Wall", (0.0, 3.0, 1.0), (4.0, 0.1, 2.0))
    out, report = tmp_path / "out.blend", tmp_path / "report.json"
    status = oncue("command_line").main(["--out", str(out), "--report", str(report), "--seed", "1"])
    told = json.loads(report.read_text(encoding="utf-8"))
    assert (status, told["success"], len(told["people"])) == (0, True, 2)
