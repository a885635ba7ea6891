"""Things that are taken, carried and put down: read, keyed with the take, and gone with it."""

import math

import bpy
import numpy as np
import pytest

from .runs import current_action, datablocks
from .shapes import add_cube, add_floor
from .test_character import evaluated_palm


@pytest.fixture
def objects(oncue):
    return oncue("bridge.cue_objects")


@pytest.fixture
def room(objects):
    """A table of 0.75 m with a cup, and a low one; the person carries the cup from one to the other."""
    scene = bpy.context.scene
    scene.render.fps, scene.oncue.start_frame = 24, 11
    add_floor()
    add_cube("Table", (1.85, -0.2, 0.375), (0.7, 1.6, 0.75))
    add_cube("Low", (-2.0, -0.2, 0.225), (0.8, 1.6, 0.45))
    cup = add_cube("Cup", (1.62, -0.2, 0.80), (0.08, 0.08, 0.10))
    objects.make_cue(bpy.context, "start", (0.0, -1.5, 0), 2.5)
    table = objects.make_cue(bpy.context, "stop", (1.15, -0.2, 0), math.pi / 2, name="At Table")
    objects.number_steps([table])
    pick(cup)
    assert bpy.ops.oncue.place_take(hand="right") == {"FINISHED"}
    low = objects.make_cue(bpy.context, "stop", (-1.2, -0.2, 0), -math.pi / 2, name="At Low")
    low["oncue_step"] = 3
    scene.cursor.location = (-1.8, -0.15, 0.6)
    assert bpy.ops.oncue.place_put() == {"FINISHED"}
    return cup


def pick(thing):
    for other in bpy.context.view_layer.objects:
        other.select_set(other == thing)
    bpy.context.view_layer.objects.active = thing


def read(oncue):
    return oncue("bridge.cue_reader").read_task(bpy.context)


def at(thing, frame):
    bpy.context.scene.frame_set(frame)
    return np.array(thing.evaluated_get(bpy.context.evaluated_depsgraph_get()).matrix_world)


def test_cues_of_things_are_read_in_their_order(oncue, room):
    task = read(oncue)
    take, put = (step["things"] for step in task["steps"])
    assert [cue["name"] for cue in (*take, *put)] == ["Take Cup", "Put Cup"]
    assert (take[0]["does"], take[0]["hand"], put[0]["does"]) == ("take", "right", "put")
    # Gripped in the middle, and put on the table under the cursor, turned as it comes.
    assert take[0]["grip"] == pytest.approx([0, 0, 0], abs=1e-6)
    assert put[0]["position"] == pytest.approx([-1.8, -0.15, 0.45], abs=1e-5)
    assert "yaw" not in put[0]
    (thing,) = task["things"]
    assert thing["position"] == pytest.approx([1.62, -0.2, 0.80])
    assert thing["low"] == pytest.approx([-0.04, -0.04, -0.05], abs=1e-6)
    assert thing["high"] == pytest.approx([0.04, 0.04, 0.05], abs=1e-6)
    # In centimetres it is the same, and the cup is in nobody's way.
    bpy.data.objects["Put Cup"].rotation_euler.z += 0.5
    bpy.context.view_layer.update()
    assert read(oncue)["steps"][1]["things"][0]["yaw"] == pytest.approx(0.5)
    request, _ = oncue("bridge.session").read_request(bpy.context)
    assert "Cup" not in request.names
    # A turned thing is measured in its own frame.
    room.rotation_euler.z = 0.7
    bpy.context.view_layer.update()
    (thing,) = read(oncue)["things"]
    assert thing["high"] == pytest.approx([0.04, 0.04, 0.05], abs=1e-6)
    assert thing["rotation"] == pytest.approx([math.cos(0.35), 0, 0, math.sin(0.35)], abs=1e-6)


def test_what_is_carried_has_keys_that_come_and_go_with_the_take(oncue, room):
    session, before = oncue("bridge.session"), np.array(room.matrix_world)
    assert bpy.ops.oncue.synthesize() == {"FINISHED"}
    take = current_action()
    report = session.report_of(take)
    assert report["success"], report["problems"]
    (told,) = report["things"]
    character = bpy.context.scene.oncue.character
    scene = [11 + frame * 24 / 30 for frame in (told["taken"], told["placed"])]
    taken, placed = math.floor(scene[0]), math.ceil(scene[1])
    # It stands as it stood until it is taken, then where it is put, to a centimetre.
    assert at(room, 11) == pytest.approx(before, abs=1e-6)
    assert at(room, taken) == pytest.approx(before, abs=1e-4)
    stands = at(room, placed + 30)
    assert np.linalg.norm(stands[:3, 3] - [-1.8, -0.15, 0.50]) < 0.01
    assert stands[2, 2] == pytest.approx(0.10, abs=1e-3)
    # In between the palm has it where it gripped it.
    grips = []
    for frame in range(taken + 8, placed):
        palm = np.append(np.array(evaluated_palm(character, "Right", frame)), 1.0)
        held = at(room, frame)
        turn = held[:3, :3] / np.linalg.norm(held[:3, :3], axis=0)
        grips.append(turn.T @ (palm[:3] - held[:3, 3]))
    assert np.linalg.norm(np.array(grips) - grips[0], axis=1).max() < 0.015
    assert session.belongs_to_cues(bpy.context, report)
    keyed = room.animation_data.action
    assert keyed.name.startswith("Cup in ")

    # Once more, from another frame in the middle: it is read as it stands at first, and no remark is made of it.
    bpy.context.scene.frame_set(placed + 5)
    request, notes = session.read_request(bpy.context)
    assert request.task["things"][0]["position"] == pytest.approx([1.62, -0.2, 0.80], abs=1e-5)
    assert not [name for name, _ in notes if "Cup" in name]
    assert bpy.ops.oncue.synthesize() == {"FINISHED"}
    again = current_action()
    assert room.animation_data.action not in {keyed, None}
    assert len(bpy.data.actions) == 4

    # Another take is another's keys; a thing of no take stands as it stood.
    assert bpy.ops.oncue.play_take(name=take.name) == {"FINISHED"}
    assert room.animation_data.action == keyed
    assert bpy.ops.oncue.copy_take() == {"FINISHED"}
    assert room.animation_data.action not in {keyed, None}
    assert at(room, placed + 30)[:3, 3] == pytest.approx(stands[:3, 3], abs=1e-5)
    for name in (again.name, take.name, current_action().name):
        assert bpy.ops.oncue.discard_take(name=name) == {"FINISHED"}
    assert room.animation_data is None or room.animation_data.action is None
    assert len(bpy.data.actions) == 0
    assert at(room, placed + 30) == pytest.approx(before, abs=1e-6)


def test_what_cannot_be_taken_is_a_sentence_and_leaves_the_file(oncue, objects, room):
    def refused(words):
        with pytest.raises(oncue("errors").SceneError, match=words):
            read(oncue)

    take, put = bpy.data.objects["Take Cup"], bpy.data.objects["Put Cup"]
    take["oncue_step"] = 0
    refused("Take Cup comes before any Sit or Stop cue")
    take["oncue_step"] = 2
    take["oncue_hand"] = "third"
    refused("Take Cup does not say which hand takes Cup")
    take["oncue_hand"] = "right"
    room.keyframe_insert("location", frame=1)
    room.location.x += 1
    room.keyframe_insert("location", frame=40)
    bpy.context.view_layer.update()
    refused("Take Cup takes Cup, which moves by itself")
    room.animation_data_clear()
    # What the core sees before anything is played.
    room.scale = (1.2, 0.9, 0.9)
    before = datablocks()
    with pytest.raises(RuntimeError, match="‘Cup’ is too big for ‘Take Cup’"):
        bpy.ops.oncue.synthesize()
    room.scale = (0.08, 0.08, 0.10)
    put.hide_set(True)
    second = add_cube("Second", (1.7, 0.2, 0.80), (0.08, 0.08, 0.10))
    pick(second)
    bpy.ops.oncue.place_take(hand="both")
    with pytest.raises(RuntimeError, match="the right hand carries ‘Cup’"):
        bpy.ops.oncue.synthesize()
    bpy.data.objects.remove(bpy.data.objects["Take Second"])
    bpy.data.objects.remove(second)
    assert {kind: before[kind] for kind in ("actions", "armatures")} == {
        kind: datablocks()[kind] for kind in ("actions", "armatures")
    }
    bpy.data.objects.remove(room)
    refused("Take Cup is about a thing that is not there any more")


def test_buttons_want_a_thing(room):
    pick(bpy.data.objects["Put Cup"])
    with pytest.raises(RuntimeError, match="Select the thing that is to be taken"):
        bpy.ops.oncue.place_take(hand="left")
    with pytest.raises(RuntimeError, match="Nothing is in a hand by then"):
        bpy.ops.oncue.place_put()
    empty = bpy.data.objects.new("Nothing", None)
    bpy.context.scene.collection.objects.link(empty)
    pick(empty)
    with pytest.raises(RuntimeError, match="has no mesh to take hold of"):
        bpy.ops.oncue.place_take(hand="left")
    assert "Take Nothing" not in bpy.data.objects


def test_looks_and_things_share_the_order(oncue, room):
    """A look after the Take cue begins as the table is reached: things are no cues that the body comes to."""
    bpy.context.view_layer.objects.active = bpy.data.objects["Take Cup"]
    room.select_set(False)
    bpy.context.scene.cursor.location = (-3.4, 0.6, 1.5)
    assert bpy.ops.oncue.place_look() == {"FINISHED"}
    order = [cue.name for cue in oncue("bridge.shown_cues").ordered_cues(bpy.context)]
    assert order == ["At Table", "Take Cup", "Look", "At Low", "Put Cup"]
    task = read(oncue)
    assert [len(step["things"]) for step in task["steps"]] == [1, 1]
    assert (task["looks"][0]["after"], [thing["name"] for thing in task["things"]]) == (1, ["Cup"])


def test_where_to_stand_is_found(oncue, objects):
    """Before the cup on the table and on this side of it, then before the shelf; where there is no room, a sentence."""
    shown = oncue("bridge.shown_cues")
    add_floor()
    add_cube("Table", (1.85, -0.2, 0.375), (0.7, 1.6, 0.75))
    add_cube("Shelf", (-2.6, 0.0, 0.5), (0.4, 1.0, 1.0))
    cup = add_cube("Cup", (1.62, -0.2, 0.80), (0.08, 0.08, 0.10))
    pick(cup)
    with pytest.raises(RuntimeError, match="Place the Start cue first"):
        bpy.ops.oncue.place_take(hand="right")
    assert "Take Cup" not in bpy.data.objects
    objects.make_cue(bpy.context, "start", (0.0, -1.5, 0), 2.5)
    pick(cup)
    assert bpy.ops.oncue.place_take(hand="right") == {"FINISHED"}
    bpy.context.scene.cursor.location = (-2.5, 0.1, 1.2)
    assert bpy.ops.oncue.place_put() == {"FINISHED"}
    order = [cue.name for cue in shown.ordered_cues(bpy.context)]
    assert order == ["Stop", "Take Cup", "Stop.001", "Put Cup"]
    for name, thing in (("Stop", "Take Cup"), ("Stop.001", "Put Cup")):
        stop, what = bpy.data.objects[name], bpy.data.objects[thing]
        way = what.matrix_world.translation - stop.matrix_world.translation
        assert 0.39 < way.xy.length < 0.63
        assert stop.matrix_world.translation.z == pytest.approx(0.0, abs=1e-6)
        ahead = objects.forward_of(stop.matrix_world)
        assert ahead.xy.angle(way.xy) < 0.01
        assert 1.5 - 0.24 > stop.location.x > -2.4 + 0.24
    # Within reach of a stop no other is made.
    assert bpy.ops.oncue.synthesize() == {"FINISHED"}
    report = oncue("bridge.session").report_of(current_action())
    assert report["success"], report["problems"]
    assert report["things"][0]["put_cm"] < 1
    # Walls all around: nobody stands there.
    bpy.data.objects.remove(bpy.data.objects["Put Cup"])
    for x, y, sx, sy in ((1.0, -0.2, 0.1, 3.0), (1.6, 0.7, 1.4, 0.1), (1.6, -1.1, 1.4, 0.1), (2.3, -0.2, 0.1, 3.0)):
        add_cube("Wall", (x, y, 1.0), (sx, sy, 2.0))
    add_cube("Crate", (1.3, -0.2, 0.3), (0.4, 1.6, 0.6))
    bpy.context.scene.cursor.location = (1.7, 0.1, 1.2)
    with pytest.raises(RuntimeError, match="Nobody can stand within reach of Put Cup"):
        bpy.ops.oncue.place_put()
    assert "Put Cup" not in bpy.data.objects


def test_a_real_laptop_is_carried_in_both_hands(oncue, objects, shared_data):
    """An empty with two meshes, from the table to the low one, from where one finds to stand."""
    add_floor()
    add_cube("Table", (1.85, -0.2, 0.375), (0.7, 1.6, 0.75))
    add_cube("Low", (-2.0, -0.2, 0.225), (0.8, 1.6, 0.45))
    bpy.ops.import_scene.gltf(filepath=str(shared_data / "objects" / "laptop.glb"))
    laptop = bpy.data.objects["laptop"]
    assert laptop.type == "EMPTY"
    box = oncue("bridge.things").read_thing(laptop, laptop, None, 1.0)
    assert sorted(np.subtract(box["high"], box["low"])) == pytest.approx([0.016, 0.228, 0.325], abs=2e-3)
    middle = 0.5 * (np.array(box["low"]) + box["high"])
    laptop.location = (1.72 - middle[0], -0.2 - middle[1], 0.752 - box["low"][2])
    bpy.context.view_layer.update()
    objects.make_cue(bpy.context, "start", (0.0, -1.5, 0), 2.5)
    pick(laptop)
    assert bpy.ops.oncue.place_take(hand="both") == {"FINISHED"}
    bpy.context.scene.cursor.location = (-1.8, -0.15, 0.6)
    assert bpy.ops.oncue.place_put() == {"FINISHED"}
    assert bpy.ops.oncue.synthesize() == {"FINISHED"}
    take = current_action()
    report = oncue("bridge.session").report_of(take)
    assert report["success"], report["problems"]
    (told,) = report["things"]
    assert told["put_cm"] < 1
    assert told["in_body_cm"] < 1
    # What hangs on it goes with it.
    lid = at(bpy.data.objects["laptop_lid"], int(take.frame_end))
    assert np.linalg.norm(lid[:2, 3] - [-1.8, -0.15]) < 0.25
    assert 0.44 < lid[2, 3] < 0.52


def test_one_of_several_people_carries(oncue, room, objects):
    scene, starts = bpy.context.scene, oncue("bridge.people")
    scene.cursor.location = (0.5, 2.0, 0.0)
    assert bpy.ops.oncue.add_person() == {"FINISHED"}
    ann, ben = bpy.data.objects["Start"], bpy.context.active_object
    stop = objects.make_cue(bpy.context, "stop", (-1.5, 2.0, 0.0), -math.pi / 2, name="Beyond")
    stop["oncue_person"], stop["oncue_step"] = ben, 1
    # Whose cue it is stays as the thing is selected: that person's who was chosen, or whose cue is selected along.
    spoon = add_cube("Spoon", (1.62, 0.1, 0.77), (0.03, 0.15, 0.03))
    for person, chosen in ((ann, "Start"), (ben, ben.name)):
        assert bpy.ops.oncue.choose_person(start=chosen) == {"FINISHED"}
        pick(spoon)
        assert oncue("bridge.shown_cues").worked_on(bpy.context) == person
    ann.select_set(True)
    assert bpy.ops.oncue.place_take(hand="left") == {"FINISHED"}
    # A cue of nobody is selected as any other, and says nothing of whom one works on.
    nobodys = objects.make_cue(bpy.context, "stop", (2.0, 2.0, 0.0), 0.0, name="Nobody's")
    assert bpy.ops.oncue.select_cue(cue=nobodys.name) == {"FINISHED"}
    assert scene["oncue_person"] == ann
    bpy.data.objects.remove(nobodys)
    take = bpy.data.objects["Take Spoon"]
    assert take["oncue_person"] == ann
    bpy.data.objects.remove(take)

    assert bpy.ops.oncue.synthesize() == {"FINISHED"}
    report = oncue("bridge.session").report_of
    carried, other = (report(person.character.animation_data.action) for person in starts.cast(bpy.context))
    assert carried["success"], carried["problems"]
    assert other["success"], other["problems"]
    (figures,) = carried["things"]
    assert figures["put_cm"] < 1.0
    assert figures["in_others_cm"] == 0.0
    assert "things" not in other
    stands = [at(room, frame)[:3, 3] for frame in (11, scene.frame_end)]
    assert stands[0] == pytest.approx([1.62, -0.2, 0.80], abs=1e-4)
    assert stands[1] == pytest.approx([-1.8, -0.15, 0.50], abs=0.01)


def stand_for(objects, thing):
    """Where the stop cue is placed that has a thing within reach."""
    pick(thing)
    assert bpy.ops.oncue.place_take(hand="right") == {"FINISHED"}
    return bpy.data.objects["Stop"].matrix_world.translation


def test_nobody_is_placed_in_a_table_top(objects):
    """Legs and what stands on it are far from its edge: it is thinner than what looks about sees."""
    add_floor()
    add_cube("Top", (1.85, -0.2, 0.735), (0.7, 1.6, 0.03))
    objects.make_cue(bpy.context, "start", (-1.0, -0.2, 0), math.pi / 2)
    stand = stand_for(objects, add_cube("Cup", (1.72, -0.2, 0.80), (0.08, 0.08, 0.10)))
    assert stand.x < 1.5 - 0.2
    assert (stand.xy - bpy.data.objects["Take Cup"].matrix_world.translation.xy).length < 0.63


def test_nobody_is_placed_where_no_way_leads(objects):
    """A cup on a sill between two rooms: this side of the wall, whichever is nearer, and a closed one not at all."""
    add_floor()
    add_cube("Wall", (1.0, 0.0, 1.25), (0.1, 20.0, 2.5))
    objects.make_cue(bpy.context, "start", (-1.0, 0.0, 0), math.pi / 2)
    stand = stand_for(objects, add_cube("Cup", (1.12, 0.0, 0.80), (0.08, 0.08, 0.10)))
    assert stand.x < 0.9
    pick(add_cube("Beyond", (2.5, 0.0, 0.80), (0.08, 0.08, 0.10)))
    with pytest.raises(RuntimeError, match="Nobody can stand within reach of Take Beyond"):
        bpy.ops.oncue.place_take(hand="left")
    # With a door in the wall there is a way.
    wall = bpy.data.objects["Wall"]
    wall.scale.y *= 0.2
    bpy.context.view_layer.update()
    pick(bpy.data.objects["Beyond"])
    assert bpy.ops.oncue.place_take(hand="left") == {"FINISHED"}


def test_who_has_it_behind_them_turns_first(oncue, objects):
    add_floor()
    objects.make_cue(bpy.context, "start", (-2.0, 0.0, 0), math.pi / 2)
    stop = objects.make_cue(bpy.context, "stop", (0.0, 0.0, 0), math.pi / 2, name="Here")
    stop["oncue_step"] = 1
    ahead, behind = (
        add_cube(name, (x, 0.1, 0.9), (0.08, 0.08, 0.10)) for name, x in (("Ahead", 0.5), ("Behind", -0.5))
    )
    for thing, hand in ((ahead, "left"), (behind, "right")):
        pick(thing)
        assert bpy.ops.oncue.place_take(hand=hand) == {"FINISHED"}
    order = [cue.name for cue in oncue("bridge.shown_cues").ordered_cues(bpy.context)]
    assert order == ["Here", "Take Ahead", "Stop", "Take Behind"]
