"""Look cues: where they come in the order, what is read of them, and a motion that looks."""

import bpy
import numpy as np
import pytest
from mathutils import Vector

from .runs import current_action
from .shapes import add_cube, add_floor


@pytest.fixture
def objects(oncue):
    return oncue("bridge.cue_objects")


@pytest.fixture
def read(oncue):
    return lambda start=None: oncue("bridge.cue_reader").read_task(bpy.context, start=start)


def place(kind, x, y, then=False):
    bpy.context.scene.cursor.location = (x, y, 0)
    assert bpy.ops.oncue.place_cue(kind=kind, then=then) == {"FINISHED"}
    return bpy.context.active_object


def look(x, y, z, on=None):
    """A look cue after the active cue, or on an object."""
    context = bpy.context
    context.scene.cursor.location = (x, y, z)
    if on is not None:
        for other in context.view_layer.objects:
            other.select_set(other == on)
        context.view_layer.objects.active = on
    assert bpy.ops.oncue.place_look() == {"FINISHED"}
    return context.active_object


@pytest.fixture
def walk(oncue):
    """A floor, a start, and two stops."""
    add_floor()
    return [place("start", 0, -2), place("stop", 0, 0), place("stop", 1.5, 1.5, then=True)]


def test_a_look_comes_after_what_is_selected(oncue, objects, read, walk):
    assert "looks" not in read()
    bpy.ops.oncue.select_cue(cue=walk[1].name)
    first = look(2, 0, 1.5)
    last = look(-2, 0, 1.5, on=add_cube("Lamp", (-2, 0, 1), (0.3, 0.3, 0.4)))
    assert [cue["oncue_step"] for cue in (walk[1], first, walk[2], last)] == [1, 2, 3, 4]
    assert last.parent == bpy.data.objects["Lamp"]
    task = read()
    assert [(one["name"], one["after"]) for one in task["looks"]] == [("Look", 1), ("Look.001", 2)]
    assert task["looks"][0]["path"] == [pytest.approx([2, 0, 1.5])]
    # The object's middle, wherever it goes.
    bpy.data.objects["Lamp"].location.x = -3
    bpy.context.view_layer.update()
    assert read()["looks"][1]["path"] == [pytest.approx([-3, 0, 1])]
    # 0 is until the next cue.
    assert "hold_seconds" not in task["looks"][0]
    first["oncue_hold_seconds"] = 2.5
    assert read()["looks"][0]["hold_seconds"] == 2.5
    bpy.ops.oncue.move_step(cue=first.name, by=-1)
    assert read()["looks"][0]["after"] == 0
    assert [text for text, _, _ in oncue("overlay").numbers(bpy.context)] == ["1", "2", "3", "4"]
    assert all(oncue("overlay").cue_lines(bpy.context, cue) for cue in (first, last))
    # A waypoint before it counts.
    bpy.ops.oncue.select_cue(cue=walk[1].name)
    place("pass", 0, -1)
    assert [one["after"] for one in read()["looks"]] == [0, 3]


def test_one_cue_and_a_look_are_a_performance(oncue, read):
    add_floor()
    place("start", 0, -2)
    place("stop", 0, 0)
    look(2, 0, 1.5)
    assert [len(read()[name]) for name in ("steps", "looks")] == [1, 1]
    with pytest.raises(oncue("errors").SceneError, match="Follow Cues plays no Look cue, and there is Look"):
        oncue("bridge.session").read_request(bpy.context, hands=False)


def test_of_several_people_each_has_looks(oncue, objects, read, walk):
    bpy.ops.oncue.select_cue(cue=walk[2].name)
    one = look(2, 0, 1.5)
    bpy.context.scene.cursor.location = (2, -2, 0)
    bpy.ops.oncue.add_person()
    ben = bpy.context.active_object
    assert one["oncue_person"] == walk[0]
    place("stop", 2, 1)
    other = look(-2, 0, 1.5)
    assert other["oncue_person"] == ben
    assert [[look["name"] for look in read(start)["looks"]] for start in (walk[0], ben)] == [["Look"], ["Look.001"]]


def test_what_moves_is_looked_at_where_it_is(oncue, objects, read, walk):
    lamp = add_cube("Lamp", (-2, 0, 1.5), (0.3, 0.3, 0.3))
    lamp.keyframe_insert("location", frame=1)
    lamp.location.x = 2
    lamp.keyframe_insert("location", frame=61)
    bpy.context.scene.frame_end = 90
    look(0, 0, 0, on=lamp)
    bpy.context.scene.frame_set(61)
    (request,), notes = oncue("bridge.session").read_shot(bpy.context)
    path = np.array(request.task["looks"][0]["path"])
    rate = bpy.context.scene.render.fps / bpy.context.scene.render.fps_base
    assert len(path) == int(np.ceil(89 * 30 / rate)) + 1
    assert path[0] == pytest.approx([-2, 0, 1.5], abs=1e-4)
    assert path[-1] == pytest.approx([2, 0, 1.5], abs=1e-4)
    # It is no cue that is read where it stands at first.
    assert not any(name == "Look" for name, _ in notes)
    assert bpy.context.scene.frame_current == 61


def facing(character, frame):
    """Where the head is and faces on a frame, world."""
    bpy.context.scene.frame_set(frame)
    head = character.evaluated_get(bpy.context.evaluated_depsgraph_get()).pose.bones["Head"]
    turned = (character.matrix_world @ head.matrix).to_3x3()
    rest = character.data.bones["Head"].matrix_local.to_3x3().inverted()
    return character.matrix_world @ head.head, (turned @ rest @ Vector((0, -1, 0))).normalized()


def test_a_motion_looks_there_and_the_report_says_for_how_long(oncue, core, walk):
    bpy.context.scene.render.fps = 30
    walk[1]["oncue_hold_seconds"] = 3.0
    bpy.ops.oncue.synthesize()
    plain = oncue("bridge.solved").solved_of(current_action()).motion
    bpy.ops.oncue.select_cue(cue=walk[1].name)
    there = look(-2.0, 0.8, 1.4)
    there["oncue_hold_seconds"] = 3.0
    session = oncue("bridge.session")
    assert not session.belongs_to_cues(bpy.context, session.current_report(bpy.context.scene))
    assert bpy.ops.oncue.synthesize() == {"FINISHED"}
    report = session.current_report(bpy.context.scene)
    assert session.belongs_to_cues(bpy.context, report)
    assert report["success"], report["problems"]
    (told,) = report["looks"]
    assert told["end"] - told["first"] == 90
    assert told["first"] == report["cues"][0]["frame"]
    assert told["met"] > 30
    assert told["met"] + told["turning"] + told["behind"] + told["held"] == 90
    # Feet, pelvis and way are to the bit what they are without.
    looked = oncue("bridge.solved").solved_of(current_action()).motion
    assert np.array_equal(looked.root_positions, plain.root_positions)
    assert np.array_equal(looked.rotations[: told["first"]], plain.rotations[: told["first"]])
    assert not np.array_equal(looked.rotations, plain.rotations)
    character = bpy.context.scene.oncue.character
    head, forward = facing(character, bpy.context.scene.oncue.start_frame + told["first"] + 75)
    eyes = head + Vector((0, 0, 0.09))
    assert forward.angle(there.matrix_world.translation - eyes) < np.radians(6.0)
    lines = [line for line, _ in oncue("panels").result_lines(report)]
    assert any(line.startswith("Look: looked at for") for line in lines)
    # What lies behind is said, and is no success.
    there.location = (0.0, -2.5, 1.5)
    bpy.context.view_layer.update()
    bpy.ops.oncue.synthesize()
    report = session.current_report(bpy.context.scene)
    assert report["looks"][0]["behind"] > 60
    assert not report["success"]
    assert any("it lies behind the person" in problem for problem in report["problems"])
