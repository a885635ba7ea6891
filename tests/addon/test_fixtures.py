"""The task scenes: what they are made of, and rooms from outside."""

import csv
import math
import sys
from pathlib import Path

import bpy
import numpy as np
import pytest
from mathutils import Vector

ROOT = Path(__file__).parents[2]
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


@pytest.fixture
def hall(tmp_path):
    """A room file: a floor 4 cm up, a stool, and a bench that stands against a wall."""
    sys.path.insert(0, str(ROOT / "blend_fixtures"))
    import furniture as f

    scene = bpy.context.scene
    f.floor(scene, (-3, -3), (3, 3))
    f.stool(scene, (1, 1, 0), 0.44, "Stool")
    f.bench(scene, (0.0, 2.0, 0))
    f.Piece("Wall").box((-3, 2.3, 0), (3, 2.4, 2), "oak").link(scene)
    for thing in scene.objects:
        thing.location.z += 0.04
    path = tmp_path / "hall.glb"
    bpy.ops.export_scene.gltf(filepath=str(path))
    return path


def write_table(path, *rows):
    header = "room shot person step kind x y z heading_deg hold_s at_frame object"
    path.write_text("".join("\t".join(row.split("|")) + "\n" for row in (header.replace(" ", "|"), *rows)))
    return path


def test_a_shot_has_its_people_and_cues(fixtures, oncue, read, hall, tmp_path):
    """What the table leaves free is what a button would give."""
    table = write_table(
        tmp_path / "shots.tsv",
        "hall|meet|Ann||start|-2|-2",
        "hall|meet|Ann|5|stop|-2|1||||140",
        "hall|meet|Ann|9|sit|||||2.5|300|Stool",
        "hall|meet|Ann|7|look|||||||Bench",
        "hall|meet|Ann|12|look|1|2|1.5||2",
        "hall|meet|Ben||start|2|-2||180",
        "hall|meet|Ben|2|sit|0|2|||0",
        "hall|meet|Ben|1|pass|0|-1",
        "hall|meet|Ben|3|stop|0|-2|0.04|0",
        "attic|meet|Cid||start|0|0",
        "attic|meet|Cid|1|stop|1|0",
    )
    fixtures.main(["--room", str(hall), "--shots", str(table), "--out", str(tmp_path)])
    assert not (tmp_path / "attic-meet.blend").exists()
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "hall-meet.blend"))
    scene, reader = bpy.context.scene, oncue("bridge.cue_reader")
    starts = [scene.objects[name] for name in ("Ann", "Ben")]
    ann, ben = (reader.read_task(bpy.context, start=start) for start in starts)
    assert [task["start"]["position"] for task in (ann, ben)] == [
        pytest.approx([-2, -2, 0.04], abs=1e-5),
        pytest.approx([2, -2, 0.04], abs=1e-5),
    ]
    # Towards the first cue, +Y; and -X, as the table says.
    assert abs(ann["start"]["yaw"]) == pytest.approx(math.pi, abs=1e-5)
    assert ben["start"]["yaw"] == pytest.approx(math.radians(-90), abs=1e-5)
    stop, on_stool = ann["steps"]
    assert (stop["cue"]["name"], on_stool["cue"]["name"]) == ("Ann 5 Stop", "Ann 9 Sit")
    assert abs(stop["cue"]["yaw"]) == pytest.approx(math.pi, abs=1e-5)
    assert [step["at_seconds"] for step in (stop, on_stool)] == [pytest.approx(139 / 30), pytest.approx(299 / 30)]
    assert (stop["hold_seconds"], on_stool["hold_seconds"]) == (None, 2.5)
    assert on_stool["cue"]["position"] == pytest.approx([1, 1, 0.58], abs=0.02)
    bench, last = ann["looks"]
    assert (bench["name"], bench["after"], last["after"], last["hold_seconds"]) == ("Ann 7 Look", 1, 2, 2.0)
    assert bench["path"][0][:2] == pytest.approx([0, 2], abs=0.05)
    assert scene.objects["Ann 7 Look"].parent == scene.objects["Bench"]
    assert last["path"] == [pytest.approx([1, 2, 1.5])]
    on_bench, end = ben["steps"]
    assert [cue["position"] for cue in on_bench["passes"]] == [pytest.approx([0, -1, 0.04], abs=1e-5)]
    # Away from the wall, which stands behind the bench, and on its seat.
    assert on_bench["cue"]["position"] == pytest.approx([0, 2, 0.59], abs=0.03)
    assert abs(on_bench["cue"]["yaw"]) < math.radians(20)
    assert (on_bench["hold_seconds"], end["cue"]["yaw"]) == (0.0, pytest.approx(math.radians(90), abs=1e-5))


def test_one_person_of_a_shot_is_as_any_scene(fixtures, oncue, read, hall, tmp_path):
    table = write_table(tmp_path / "shots.tsv", "hall|a|Ann||start|-2|-2", "hall|a|Ann|1|sit|1|1|0.58|-90|||Stool:seat")
    (shot,) = fixtures.read_shots(table)
    fixtures.shot_scene(hall, table, shot)
    task = read()
    assert (task["start"]["name"], task["cue"]["name"]) == ("Ann", "Ann 1 Sit")
    assert task["cue"]["position"] == pytest.approx([1, 1, 0.58])
    assert oncue("bridge.session").read_shot(bpy.context)[0][0].person == ""


def test_a_shot_at_what_is_not_there_is_refused(fixtures, hall, tmp_path):
    rows = ("hall|a|Ann||start|-2|-2", "hall|a|Ann|1|sit|||||||Throne")
    with pytest.raises(SystemExit, match="line 3: nothing in hall is called Throne"):
        fixtures.main(["--room", str(hall), "--shots", str(write_table(tmp_path / "s.tsv", *rows)), "--out", "."])
    rows = (rows[0], rows[1].replace("Throne", "Wall"))
    with pytest.raises(SystemExit, match="line 3: Wall has no level surface"):
        fixtures.main(["--room", str(hall), "--shots", str(write_table(tmp_path / "s.tsv", *rows)), "--out", "."])
