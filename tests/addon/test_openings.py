"""Doors, lids and drawers that a hand opens: found, stood before, read, keyed with the take, and gone with it."""

import math

import bpy
import numpy as np
import pytest
from mathutils import Matrix, Quaternion, Vector

from .runs import current_action
from .shapes import add_cube, add_floor
from .test_character import evaluated_palm
from .test_things import at, pick, read

HINGE = (-0.45, 0.02)


def hung(name, low, high, origin):
    """A box whose object's origin is at a place."""
    middle, size = (np.add(low, high) / 2, np.subtract(high, low))
    thing = add_cube(name, tuple(middle), (1, 1, 1))
    thing.data.transform(Matrix.Translation(Vector(middle) - Vector(origin)) @ Matrix.Diagonal((*size, 1.0)))
    thing.location = origin
    bpy.context.view_layer.update()
    return thing


@pytest.fixture
def objects(oncue):
    return oncue("bridge.cue_objects")


@pytest.fixture
def door(objects):
    """A wall with a doorway across the room, its door closed, with a handle; the person comes from this side."""
    scene = bpy.context.scene
    scene.render.fps, scene.oncue.start_frame = 24, 11
    add_floor(4.0)
    add_cube("Left Wall", (-1.73, 0.05, 1.2), (2.54, 0.1, 2.4))
    add_cube("Right Wall", (1.73, 0.05, 1.2), (2.54, 0.1, 2.4))
    leaf = hung("Door", (-0.45, 0.0, 0.01), (0.45, 0.04, 2.05), (*HINGE, 0.0))
    handle = add_cube("Handle", (0.36, -0.03, 1.02), (0.10, 0.06, 0.03))
    handle.parent, handle.matrix_parent_inverse = leaf, leaf.matrix_world.inverted()
    objects.make_cue(bpy.context, "start", (0.8, -2.6, 0), 2.8)
    pick(leaf)
    assert bpy.ops.oncue.place_open(hand="left") == {"FINISHED"}
    beyond = objects.make_cue(bpy.context, "stop", (0.0, 2.2, 0), math.pi, name="Beyond")
    beyond["oncue_step"] = 3
    return leaf


def test_which_way_a_door_opens_and_where_to_stand_is_found(oncue, door):
    cue = bpy.data.objects["Open Door"]
    # About the edge on which its origin lies, upright, towards who comes; a hand takes hold of what stands out there.
    assert (cue["oncue_opens"], cue["oncue_axis"], cue["oncue_amount"]) == ("hinge", "Z", -90.0)
    assert cue.matrix_world.translation[:] == pytest.approx((0.36, -0.06, 1.02), abs=1e-3)
    # Within reach of that, on this side, and out of where it swings.
    order = [one.name for one in oncue("bridge.shown_cues").ordered_cues(bpy.context)]
    assert order == ["Stop", "Open Door", "Beyond"]
    stand = bpy.data.objects["Stop"].matrix_world.translation
    assert (stand - cue.matrix_world.translation).xy.length < 0.80
    assert stand.y < -0.2
    assert math.hypot(stand.x - HINGE[0], stand.y - HINGE[1]) > 0.9 + 0.2
    task = read(oncue)
    (leaf,) = task["leaves"]
    assert leaf["hung"] == {"by": "hinge", "point": [0, 0, 0], "axis": [0, 0, 1]}
    assert leaf["position"] == pytest.approx([*HINGE, 0.0], abs=1e-6)
    assert len(leaf["positions"]) == 16
    assert len(leaf["triangles"]) == 24
    (opens,) = task["steps"][0]["things"]
    assert (opens["does"], opens["hand"], opens["by"]) == ("open", "left", {"degrees": -90.0})
    assert opens["grip"] == pytest.approx([0.81, -0.08, 1.02], abs=1e-3)
    # It is no part of the scene, in which it is in the way as it stands by then.
    request, _ = oncue("bridge.session").read_request(bpy.context)
    assert not {"Door", "Handle"} & set(request.names)


def test_a_door_whose_origin_is_on_the_floor_is_no_drawbridge(oncue, objects):
    """As of models whose parts all have their origin in the middle of the floor under them."""
    add_floor(4.0)
    leaf = hung("Door", (-0.45, 0.0, 0.01), (0.45, 0.04, 2.05), (0.0, 0.02, 0.0))
    objects.make_cue(bpy.context, "start", (0.8, -2.6, 0), 2.8)
    pick(leaf)
    with pytest.raises(RuntimeError, match="it is unknown about which line: set its origin at the hinge"):
        bpy.ops.oncue.place_open(hand="left")
    # An empty at the hinge, on which it hangs, says it.
    hinge = bpy.data.objects.new("Hinge", None)
    hinge.location = (*HINGE, 0.0)
    bpy.context.scene.collection.objects.link(hinge)
    bpy.context.view_layer.update()
    objects.hang_on(bpy.context, leaf, hinge)
    assert bpy.ops.oncue.place_open(hand="left") == {"FINISHED"}
    cue = bpy.data.objects["Open Door"]
    assert (cue["oncue_axis"], cue["oncue_amount"], cue["oncue_thing"]) == ("Z", -90.0, hinge)
    # A flap of an oven's size turns about its lower edge all the same.
    flap = hung("Flap", (1.0, 1.0, 0.3), (1.6, 1.03, 0.7), (1.3, 1.015, 0.3))
    pick(flap)
    assert bpy.ops.oncue.place_open(hand="right") == {"FINISHED"}
    assert bpy.data.objects["Open Flap"]["oncue_axis"] == "X"


def test_a_door_is_opened_by_the_hand_and_walked_through(oncue, door):
    session, before = oncue("bridge.session"), at(door, 11)
    assert bpy.ops.oncue.synthesize() == {"FINISHED"}
    take = current_action()
    report = session.report_of(take)
    assert report["success"], report["problems"]
    (told,) = report["opened"]
    assert told["handle_cm"] < 1.0
    assert told["arm_cm"] < 1.0
    assert told["body_cm"] < 1.0
    assert "positions" not in report["task"]["leaves"][0]
    character = bpy.context.scene.oncue.character
    taken, let_go, opened = (math.ceil(11 + told[name] * 24 / 30) for name in ("taken", "let_go", "opened"))
    # Closed until the hand has it, then a quarter turn, its hinge where it was.
    assert at(door, taken - 1) == pytest.approx(before, abs=1e-5)
    stands = at(door, opened + 5)
    assert stands[:3, 0] == pytest.approx((0, -1, 0), abs=1e-3)
    assert stands[:3, 3] == pytest.approx(before[:3, 3], abs=1e-4)
    for frame in range(taken, let_go):
        grip = at(door, frame) @ np.array([0.81, -0.08, 1.02, 1.0])
        palm = np.array(evaluated_palm(character, "Left", frame))
        assert np.linalg.norm(palm - grip[:3]) < 0.012, frame
    # Through it, with the door's keys in the take's own.
    bpy.context.scene.frame_set(int(take.frame_range[1]))
    assert (character.matrix_world @ character.pose.bones["Hips"].head).y > 2.0
    assert session.belongs_to_cues(bpy.context, report)
    keyed = door.animation_data.action
    assert keyed.name.startswith("Door in ")
    # From a frame on which it stands open it is read as it stands at first.
    bpy.context.scene.frame_set(opened + 5)
    request, notes = session.read_request(bpy.context)
    assert request.task["leaves"][0]["rotation"] == pytest.approx([1, 0, 0, 0], abs=1e-6)
    assert not [name for name, _ in notes if "Door" in name]
    assert bpy.ops.oncue.discard_take(name=take.name) == {"FINISHED"}
    assert at(door, opened + 5) == pytest.approx(before, abs=1e-6)
    assert len(bpy.data.actions) == 0


def test_limits_locks_and_parents_say_which_way(oncue, objects):
    add_floor(4.0)
    objects.make_cue(bpy.context, "start", (0.5, -2.5, 0), 2.8)

    def placed(thing, **how):
        pick(thing)
        assert bpy.ops.oncue.place_open(hand="right", **how) == {"FINISHED"}
        cue = bpy.data.objects[f"Open {(how.get('parent') or thing).name}"]
        told = cue["oncue_opens"], cue["oncue_axis"], cue["oncue_amount"]
        for one in [one for one in bpy.data.objects if one.get("oncue_cue") in ("open", "stop")]:
            bpy.data.objects.remove(one)
        bpy.data.objects.remove(thing)
        return told

    # A limit that leaves one axis a range, to the end of it.
    leaf = hung("Gate", (-0.45, 0.0, 0.0), (0.45, 0.04, 1.2), (0.0, 0.02, 0.6))
    limit = leaf.constraints.new("LIMIT_ROTATION")
    limit.use_limit_x = limit.use_limit_y = limit.use_limit_z = True
    limit.max_z = math.radians(110.0)
    assert placed(leaf) == ("hinge", "Z", pytest.approx(110.0))
    # What turns by quaternions and is ajar goes on from there.
    leaf = hung("Gate", (-0.45, 0.0, 0.0), (0.45, 0.04, 1.2), (0.0, 0.02, 0.6))
    leaf.rotation_mode = "QUATERNION"
    leaf.rotation_quaternion = Quaternion((0.0, 0.0, 1.0), math.radians(20.0))
    limit = leaf.constraints.new("LIMIT_ROTATION")
    limit.use_limit_x = limit.use_limit_y = limit.use_limit_z = True
    limit.max_z = math.radians(110.0)
    bpy.context.view_layer.update()
    assert placed(leaf) == ("hinge", "Z", pytest.approx(90.0))
    # A location of which one axis is not locked: a drawer, towards who comes.
    drawer = hung("Drawer", (-0.3, 0.0, 0.6), (0.3, 0.5, 0.8), (0.0, 0.25, 0.7))
    drawer.lock_rotation = (True, True, True)
    drawer.lock_location = (True, False, True)
    assert placed(drawer) == ("slide", "Y", pytest.approx(-0.35))
    # The same where the artist says so.
    drawer = hung("Drawer", (-0.3, 0.0, 0.6), (0.3, 0.3, 0.8), (0.0, 0.15, 0.7))
    assert placed(drawer, how="slide") == ("slide", "Y", pytest.approx(-0.24))
    # A lid whose origin lies along its back goes up.
    lid = hung("Lid", (-0.4, 0.0, 0.5), (0.4, 0.5, 0.54), (0.0, 0.5, 0.52))
    assert placed(lid) == ("hinge", "X", pytest.approx(-90.0))
    assert placed(hung("Gate", (-0.45, 0.0, 0.0), (0.45, 0.04, 1.2), (0.0, 0.02, 0.6)), axis="Z")[:2] == ("hinge", "Z")


def test_a_leaf_on_an_empty_at_its_hinge_turns_with_it(oncue, objects):
    add_floor(4.0)
    objects.make_cue(bpy.context, "start", (0.5, -2.5, 0), 2.8)
    leaf = hung("Leaf", (-0.45, 0.0, 0.0), (0.45, 0.04, 2.0), (0.0, 0.02, 1.0))
    empty = bpy.data.objects.new("Pivot", None)
    bpy.context.scene.collection.objects.link(empty)
    empty.location = (-0.45, 0.02, 0.0)
    bpy.context.view_layer.update()
    leaf.parent, leaf.matrix_parent_inverse = empty, empty.matrix_world.inverted()
    bpy.context.view_layer.update()
    pick(leaf)
    assert bpy.ops.oncue.place_open(hand="right") == {"FINISHED"}
    cue = bpy.data.objects["Open Leaf"]
    assert cue["oncue_thing"] == empty
    assert (cue["oncue_axis"], cue["oncue_amount"]) == ("Z", -90.0)


def test_what_cannot_be_opened_is_a_sentence_and_leaves_the_file(oncue, objects, door):
    def refused(words):
        with pytest.raises(oncue("errors").SceneError, match=words):
            read(oncue)

    cue = bpy.data.objects["Open Door"]
    number = cue["oncue_step"]
    cue["oncue_step"] = 0
    refused("Open Door comes before any Sit or Stop cue")
    cue["oncue_step"] = number
    cue["oncue_axis"] = "W"
    refused("Open Door does not say whether Door turns")
    cue["oncue_axis"], cue["oncue_amount"] = "Z", "far"
    refused("Open Door does not say how far Door is opened")
    cue["oncue_amount"] = 400.0
    with pytest.raises(RuntimeError, match="‘Open Door’ has ‘Start’ open ‘Door’ by 400°"):
        bpy.ops.oncue.synthesize()
    cue["oncue_amount"] = -90.0
    # Who stands where it swings.
    stop = bpy.data.objects["Stop"]
    stop.location = (0.1, -0.6, 0)
    with pytest.raises(RuntimeError, match="‘Start’ would stand in the way of ‘Door’"):
        bpy.ops.oncue.synthesize()
    door.keyframe_insert("rotation_euler", frame=1)
    door.rotation_euler.z = 1.0
    door.keyframe_insert("rotation_euler", frame=40)
    refused("Open Door opens Door, which moves by itself")
    # A leaf whose origin is nowhere near an edge.
    pick(add_cube("Panel", (2.0, -1.0, 1.0), (0.9, 0.04, 2.0)))
    before = {thing.name for thing in bpy.data.objects}
    with pytest.raises(RuntimeError, match="Open Panel has Start open Panel, and it is unknown about which line"):
        bpy.ops.oncue.place_open(hand="left")
    assert {thing.name for thing in bpy.data.objects} == before
    pick(bpy.data.objects["Open Door"])
    with pytest.raises(RuntimeError, match="Select what is to be opened"):
        bpy.ops.oncue.place_open(hand="left")


def test_real_doors_are_found(oncue, objects, shared_data):
    """Which way what the table has as hinges opens, and where a hand takes hold of it, by the objects alone."""
    table = shared_data / "objects" / "objects.tsv"
    rows = [line.split("\t") for line in table.read_text(encoding="utf-8").splitlines()]
    head, rows = rows[0], rows[1:]
    found = [dict(zip(head, row, strict=True)) for row in rows]
    doors = [row for row in found if row["object"] in ("door", "frontDoor", "fridge", "wardrobe", "laptop")]
    assert len(doors) == 6
    for row in doors:
        bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
        add_floor(4.0)
        objects.make_cue(bpy.context, "start", (0.3, -3.0, 0), 2.8)
        bpy.ops.import_scene.gltf(filepath=str(table.with_name(row["file"])))
        pick(bpy.data.objects[row["moving_node"]])
        assert bpy.ops.oncue.place_open(hand="right") == {"FINISHED"}
        cue = bpy.data.objects[f"Open {row['moving_node']}"]
        axis = Vector(map(float, row["axis_xyz"].split()))
        along = Vector([float(k == cue["oncue_axis"]) for k in "XYZ"]) * cue["oncue_amount"]
        assert axis.angle(along) < 0.01, row["moving_node"]
        contact = Vector(map(float, row["contact_xyz"].split()))
        assert (cue.matrix_world.translation - contact).length < 0.10, row["moving_node"]


def test_a_real_fridge_is_opened(oncue, objects, shared_data):
    """Lower than a door, so that knees bend; the hand lets go of it as it swings."""
    add_floor(4.0)
    objects.make_cue(bpy.context, "start", (-0.9, -2.6, 0), 2.8)
    bpy.ops.import_scene.gltf(filepath=str(shared_data / "objects" / "fridge.glb"))
    pick(bpy.data.objects["fridge_door"])
    assert bpy.ops.oncue.place_open(hand="right") == {"FINISHED"}
    bpy.context.scene.frame_set(1)
    assert bpy.ops.oncue.synthesize() == {"FINISHED"}
    report = oncue("bridge.session").report_of(current_action())
    assert report["success"], report["problems"]
    (told,) = report["opened"]
    assert 0.4 <= told["led"] <= 1.0
    assert told["handle_cm"] < 1.0
    assert max(told["arm_cm"], told["body_cm"]) < 1.0
    stands = at(bpy.data.objects["fridge_door"], math.ceil(told["opened"] * 24 / 30) + 2)
    assert stands[:3, 0] == pytest.approx((0, 1, 0), abs=1e-3)
