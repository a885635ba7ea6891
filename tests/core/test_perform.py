"""Performances from Python: what they take, what they give, and what is kept of an earlier one."""

import copy

import numpy as np
import oncue_core
import pytest
from oncue_core import InputError, Library, Report

from .geometry import box, sit_on_the_bench
from .test_types import faults


def up_and_away() -> dict:
    """Sits down on the bench for a second, gets up and stops in the room."""
    task = sit_on_the_bench()
    stop = {"name": "Away", "action_type": "stop", "position": [-0.8, -1.2, 0.0], "yaw": 0.0}
    return {"start": task["start"], "steps": [{"cue": task["cue"], "hold_seconds": 1.0}, {"cue": stop}]}


@pytest.fixture(scope="module")
def library() -> Library:
    return Library.starter()


@pytest.fixture(scope="module")
def performed(bench_scene, library):
    return oncue_core.perform(bench_scene, library, up_and_away(), seed=2).result()


def test_one_motion_meets_every_cue(performed):
    report = performed.report
    assert report["success"], report["problems"]
    assert not list(faults(report, Report))
    frames = report["frames"]
    assert performed.root_positions.shape == (frames, 3)
    assert performed.rotations.shape == (frames, 22, 4)
    assert performed.contacts.shape == (frames, 2)
    assert performed.frame_rate == 30
    assert [cue["cue"] for cue in report["cues"]] == ["Sit", "Away"] == [step["cue"] for step in report["steps"]]
    sit, stop = report["steps"]
    assert sit["complete"] == report["cues"][0]["frame"] <= stop["first_frame"] < stop["stood_at"] < stop["complete"]
    seated = performed.root_positions[sit["complete"]]
    assert np.linalg.norm(seated - up_and_away()["steps"][0]["cue"]["position"]) < 0.01
    assert np.linalg.norm(performed.root_positions[-1, :2] - [-0.8, -1.2]) < 0.1
    # Nobody jumps from one step to the next.
    steps = np.linalg.norm(np.diff(performed.root_positions, axis=0), axis=1)
    assert steps.max() < 0.08
    assert steps[stop["first_frame"]] < 0.01


def test_any_motion_is_measured_for_a_performance(bench_scene, library, performed):
    arrays = (performed.root_positions, performed.rotations, performed.contacts)
    moments = [
        {name: step[name] for name in ("stood_at", "action_from", "complete")} for step in performed.report["steps"]
    ]
    measured = oncue_core.measure_performance(*arrays, up_and_away(), moments, bench_scene, library=library).result()
    for name in ("cues", "foot", "penetration", "body"):
        assert measured[name] == performed.report[name], name
    # Were the bench never taken, thighs and pelvis would be in it.
    assert measured["problems"] == []
    late = [{**moments[0], "action_from": None}, moments[1]]
    in_bench = oncue_core.measure_performance(*arrays, up_and_away(), late, bench_scene).result()
    assert in_bench["penetration"]["whole_body_percent"] > measured["penetration"]["whole_body_percent"] + 2


def test_what_was_made_before_is_taken_from_an_earlier_one(bench_scene, library, performed):
    moved = copy.deepcopy(up_and_away())
    moved["steps"][1]["cue"]["position"][0] = -0.5
    again = oncue_core.perform(bench_scene, library, moved, seed=2, earlier=performed).result()
    seam = again.report["steps"][1]["first_frame"]
    assert seam == performed.report["steps"][1]["first_frame"]
    assert np.array_equal(again.rotations[: seam + 1], performed.rotations[: seam + 1])
    assert np.linalg.norm(again.root_positions[-1, :2] - [-0.5, -1.2]) < 0.1
    # Of another seed nothing is the same.
    other = oncue_core.perform(bench_scene, library, up_and_away(), seed=3, earlier=performed).result()
    assert not np.array_equal(other.rotations[:30], performed.rotations[:30])


def test_waypoints_are_passed_on_the_way(bench_scene, library):
    task = up_and_away()
    task["steps"][1]["passes"] = [{"name": "By", "position": [0.9, -0.4, 0.0]}]
    performed = oncue_core.perform(bench_scene, library, task, seed=2).result()
    report = performed.report
    assert not list(faults(report, Report))
    assert [(cue["cue"], cue["action_type"]) for cue in report["cues"]] == [
        ("Sit", "sit"),
        ("By", "pass"),
        ("Away", "stop"),
    ]
    by = report["cues"][1]
    away = np.linalg.norm(performed.root_positions[by["frame"], :2] - [0.9, -0.4])
    assert by["met"]
    assert 100 * away == pytest.approx(by["pelvis_cm"], abs=0.01)
    assert away < 0.15
    task["steps"][1]["passes"][0]["position"] = [9.0, 0.0, 0.0]
    with pytest.raises(InputError, match="Pass cue ‘By’ lies outside the scene"):
        oncue_core.perform(bench_scene, library, task).result()
    task["steps"][1]["passes"][0]["yaw"] = 0.0
    with pytest.raises(InputError, match="unknown field"):
        oncue_core.perform(bench_scene, library, task)


def test_what_makes_no_performance_is_told(bench_scene, library):
    with pytest.raises(InputError, match="steps"):
        oncue_core.perform(bench_scene, library, {"start": up_and_away()["start"]})
    nowhere = {**up_and_away(), "steps": []}
    with pytest.raises(InputError, match="no cue to go to"):
        oncue_core.perform(bench_scene, library, nowhere).result()
    with pytest.raises(InputError, match="unknown field"):
        oncue_core.perform(bench_scene, library, {**up_and_away(), "cue": {}})


def test_a_thing_is_taken_and_put_down(bench_scene, library):
    """Of a hook before the stop, and a hand's breadth to the side."""
    task = up_and_away()
    cup = {"name": "Cup", "position": [-0.9, -1.65, 0.9], "rotation": [1.0, 0.0, 0.0, 0.0]}
    task["things"] = [{**cup, "low": [-0.04, -0.04, 0.0], "high": [0.04, 0.04, 0.1]}]
    take = {"does": "take", "name": "Take", "thing": "Cup", "hand": "right", "grip": [0.0, 0.0, 0.07]}
    put = {"does": "put", "name": "Put", "thing": "Cup", "position": [-1.0, -1.6, 0.95]}
    task["steps"][1]["things"] = [take, put]
    performed = oncue_core.perform(bench_scene, library, task, seed=2).result()
    report = performed.report
    assert report["success"], report["problems"]
    assert not list(faults(report, Report))
    (told,), (thing,) = report["things"], performed.things
    assert (thing["name"], thing["first_frame"]) == ("Cup", told["taken"])
    frames = told["placed"] - told["taken"] + 1
    assert thing["positions"].shape == (frames, 3)
    assert thing["rotations"].shape == (frames, 4)
    assert thing["positions"].dtype == np.float32
    assert np.allclose(thing["positions"][0], cup["position"], atol=1e-4)
    assert np.linalg.norm(thing["positions"][-1] - put["position"]) < 0.01
    assert told["put_cm"] < 1
    # Without them nothing is taken, and the step is the same.
    free = oncue_core.perform(bench_scene, library, up_and_away(), seed=2, earlier=performed).result()
    assert free.things == []
    assert "things" not in free.report
    met = report["steps"][1]["complete"]
    assert met == free.report["steps"][1]["complete"]
    assert np.array_equal(free.rotations[: met - 10], performed.rotations[: met - 10])
    wrong = {**task, "steps": [task["steps"][0], {**task["steps"][1], "things": [put]}]}
    with pytest.raises(InputError, match=r"‘Put’ has ‘.*’ put ‘Cup’ down, which is in no hand by then"):
        oncue_core.perform(bench_scene, library, wrong).result()
    with pytest.raises(InputError, match="unknown field"):
        oncue_core.perform(
            bench_scene, library, {**task, "things": [{**cup, "low": [0] * 3, "high": [1] * 3, "kg": 1}]}
        )


def test_a_cupboard_is_opened(bench_scene, library):
    """Its door of 40 cm before the stop, the hinge on the person's left."""
    task = up_and_away()
    corners, faces = box((-0.4, -0.01, -0.3), (0.0, 0.01, 0.3))
    door = {"name": "Door", "position": [-0.45, -1.69, 1.0], "rotation": [1.0, 0.0, 0.0, 0.0]}
    hinge = {"by": "hinge", "point": [0.0, 0.0, 0.0], "axis": [0.0, 0.0, -1.0]}
    task["leaves"] = [{**door, "hung": hinge, "positions": corners.tolist(), "triangles": faces.tolist()}]
    opens = {"does": "open", "name": "Open", "thing": "Door", "hand": "left", "by": {"degrees": 80.0}}
    opens["grip"] = [-0.35, 0.04, 0.0]
    task["steps"][1]["things"] = [opens]
    performed = oncue_core.perform(bench_scene, library, task, seed=2).result()
    report = performed.report
    assert report["success"], report["problems"]
    assert not list(faults(report, Report))
    (told,), (leaf,) = report["opened"], performed.things
    assert (leaf["name"], leaf["first_frame"]) == ("Door", told["taken"] + 6)
    assert leaf["positions"] == pytest.approx(np.tile(door["position"], (len(leaf["positions"]), 1)), abs=1e-5)
    # 80° about −Z: half of that is in the quaternion.
    assert leaf["rotations"][-1] == pytest.approx([np.cos(np.radians(40)), 0, 0, -np.sin(np.radians(40))], abs=1e-5)
    assert told["handle_cm"] < 1
    assert told["body_cm"] == 0
    # Two people have no door opened, and a door has to say which way it goes.
    other = {"start": {"name": "Ben", "position": [2.0, -2.0, 0.0], "yaw": 0.0}}
    other["steps"] = [{"cue": {"name": "There", "action_type": "stop", "position": [2.0, -1.0, 0.0], "yaw": 0.0}}]
    with pytest.raises(InputError, match="‘Open’ opens ‘Door’, which is for one person alone"):
        oncue_core.perform_together(bench_scene, library, [task, other]).result()
    task["leaves"][0]["hung"] = {**hinge, "axis": [0.0, 0.0, 0.0]}
    with pytest.raises(InputError, match="‘Open’ has ‘Start’ open ‘Door’, and which way that opens is unknown"):
        oncue_core.perform(bench_scene, library, task).result()
