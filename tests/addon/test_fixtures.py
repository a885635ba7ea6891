"""The task scenes: what they are made of, and rooms from outside."""

import csv
import math

import bpy
import numpy as np
import pytest
from mathutils import Vector

SEATS = [f"seat_{seat}" for seat in ("chair", "sofa", "armchair", "bench", "bar_stool", "low_stool")]


@pytest.fixture
def read(oncue):
    return lambda: oncue("bridge.cue_reader").read_task(bpy.context)


@pytest.mark.parametrize(
    "name", ["demo_room", "chair_row", "gap_55", "gap_room", "stool", "enclosed_seat", "stop", *SEATS]
)
def test_each_scene_has_a_task_and_something_to_walk_on(fixtures, oncue, read, name):
    fixtures.SCENES[name]()
    task = read()
    meshes = oncue("bridge.scene_reader").read_scene(bpy.context, scale_confirmed=False)
    assert meshes.skipped == []
    low = meshes.positions.min(axis=0)
    assert low[2] == pytest.approx(-0.1, abs=1e-6)
    assert task["start"]["position"][2] == 0.0


@pytest.mark.parametrize("name", ["demo_room", "chair_row", "gap_55", "stool", "enclosed_seat", *SEATS])
def test_a_sit_cue_is_a_decimetre_over_its_seat(fixtures, context, read, name):
    fixtures.SCENES[name]()
    pelvis = Vector(read()["cue"]["position"])
    hit, place, *_ = context.scene.ray_cast(context.evaluated_depsgraph_get(), pelvis, Vector((0, 0, -1)))
    assert hit
    assert pelvis.z - place.z == pytest.approx(0.10, abs=0.012)


def test_the_core_accepts_what_can_be_done_and_names_what_cannot(fixtures, oncue, core, context, read):
    def check(name):
        fixtures.SCENES[name]()
        meshes = oncue("bridge.scene_reader").read_scene(bpy.context)
        core.check_task(core.index_scene(meshes.positions, meshes.triangles).result(), read())

    for name in ("demo_room", "chair_row", "gap_55", "gap_room", "stool", "stop", *SEATS):
        check(name)
    with pytest.raises(core.InputError, match="Sit"):
        check("enclosed_seat")


def test_a_room_from_outside_has_its_cues_where_the_table_says(fixtures, read, shared_data):
    room = shared_data / "rooms" / "sh3d_Studio.glb"
    rows = fixtures.room_rows(shared_data / "rooms" / "rooms.tsv", "sh3d_Studio")
    assert [row["task"] for row in rows] == ["1", "2", "3", "4", "5"]
    fixtures.room_task(room, rows[1])
    task = read()
    assert task["start"]["position"] == pytest.approx([4.70, -2.60, 0.0])
    # Facing +Y: the rest pose turned round.
    assert abs(task["start"]["yaw"]) == pytest.approx(math.pi, abs=1e-5)
    assert task["cue"]["position"] == pytest.approx([3.79, -1.28, 0.54])
    # Facing -X: the rest pose turned by -90°.
    assert task["cue"]["yaw"] == pytest.approx(math.radians(-90), abs=1e-5)


OBJECTS = ("door", "laptop", "chest", "toilet_cc0", "trashcan_bullet", "wardrobe")


@pytest.mark.parametrize("name", OBJECTS)
def test_the_hand_follows_what_opens(fixtures, oncue, context, read, shared_data, name):
    """Hinges and slides of real objects: the cue's way is as long as the table says, and ends where it says."""
    folder = shared_data / "objects"
    with (folder / "objects.tsv").open(encoding="utf-8", newline="") as table:
        rows = [row for row in csv.DictReader(table, delimiter="\t") if row["object"] == name]
    openings = fixtures.read_openings(folder / "objects.tsv", name)
    assert [opening.part for opening in openings] == [row["moving_node"] for row in rows]
    for row, opening in zip(rows, openings, strict=True):
        fixtures.object_task(fixtures.new_scene(), folder / f"{name}.glb", opening)
        (hand,) = oncue("bridge.hand_reader").read_manipulations(bpy.context, 1)
        path = np.array(hand["path"])
        assert (hand["first_frame"], len(path)) == (150 if name == "laptop" else 90, 61)
        lift = path[0] - [float(c) for c in row["contact_xyz"].split()]
        assert lift[:2] == pytest.approx([0, 0], abs=1e-4)
        assert lift[2] == pytest.approx(0.74 if name == "laptop" else 0.0, abs=1e-4)
        # The table has three decimals.
        assert path[-1] - lift == pytest.approx([float(c) for c in row["contact_open_xyz"].split()], abs=2e-3)
        steps = np.linalg.norm(np.diff(path, axis=0), axis=1)
        # Without Blender it is the same way.
        assert opening.held([0.0, opening.most]) == pytest.approx(path[[0, -1]], abs=1e-4)
        assert steps.sum() == pytest.approx(float(row["contact_path_m"]), rel=5e-3)
        # And the core takes the walk up to it.
        assert read()["cue"]["action_type"] == ("sit" if name == "laptop" else "stop")


def test_a_room_that_lies_elsewhere_is_refused(fixtures, shared_data):
    rows = fixtures.room_rows(shared_data / "rooms" / "rooms.tsv", "sh3d_Studio")
    row = {**rows[0], "bbox_max_xyz": "7.49 0.17 2.60"}
    with pytest.raises(SystemExit, match="bbox_max_xyz"):
        fixtures.room_task(shared_data / "rooms" / "sh3d_Studio.glb", row)


def test_an_unknown_room_is_refused(fixtures, shared_data):
    with pytest.raises(SystemExit, match="no row"):
        fixtures.room_rows(shared_data / "rooms" / "rooms.tsv", "castle")
