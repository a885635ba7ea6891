"""The main job from Python: what it takes, what it gives, and that a seed is a motion."""

import hashlib
import json
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import oncue_core
import pytest
from oncue_core import Cancelled, InputError, Library

from .geometry import room_with_a_bench, sit_on_the_bench

#: One small update and a few motions to choose from: too little to walk well, enough to pass through every part.
QUICK = {
    "ppo": {
        "prior": False,
        "updates": 1,
        "tuples": 1024,
        "vary_start": 0.0,
        "policy_layers": [32],
        "value_layers": [32],
    },
    "kept": {"rollouts": 8, "rounds": 1, "more_rounds": 0},
}


@pytest.fixture(scope="session")
def starter() -> Library:
    return Library.starter()


def run(scene, library, task, seed=1):
    return oncue_core.synthesize(scene, library, task, QUICK, seed).result()


def bench_run():
    """Everything from nothing, as a process of its own does it."""
    scene = oncue_core.index_scene(*room_with_a_bench()).result()
    return run(scene, Library.starter(), sit_on_the_bench())


@pytest.fixture(scope="module")
def synthesis():
    return bench_run()


def fingerprint(synthesis) -> str:
    arrays = (synthesis.root_positions, synthesis.rotations, synthesis.contacts)
    return hashlib.sha256(b"".join(array.tobytes() for array in arrays)).hexdigest()


def test_the_starter_library_is_long_procedural_and_always_the_same(starter):
    summary = starter.summary()
    rows = {row["label"]: row for row in summary["rows"]}
    assert all(row["mocap_seconds"] == row["mirrored_seconds"] == 0 for row in rows.values())
    assert sum(row["procedural_seconds"] for row in rows.values()) >= 600
    for label in ("walk", "idle", "sit", "seated_idle", "stand_up", "stop"):
        assert rows[label]["procedural_seconds"] > 5, label
    assert Library.starter().checksum == starter.checksum
    assert oncue_core.build_library([]).result()[0].checksum == starter.checksum


def test_a_motion_has_the_shapes_and_kinds_it_promises(synthesis):
    frames = len(synthesis.root_positions)
    assert frames == synthesis.report["frames"] > 10
    assert synthesis.root_positions.shape == (frames, 3)
    assert synthesis.rotations.shape == (frames, 22, 4)
    assert synthesis.contacts.shape == (frames, 2)
    for array in (synthesis.root_positions, synthesis.rotations, synthesis.contacts):
        assert array.dtype == np.float32
        assert np.isfinite(array).all()
    assert np.abs(np.linalg.norm(synthesis.rotations, axis=2) - 1).max() < 1e-4
    assert set(np.unique(synthesis.contacts)) <= {0.0, 0.5, 1.0}
    assert synthesis.frame_rate == 30


def test_it_begins_at_the_start_and_faces_as_asked(synthesis):
    assert synthesis.root_positions[0, :2] == pytest.approx([0.0, -1.5], abs=0.02)
    w, z = synthesis.rotations[0, 0, 0], synthesis.rotations[0, 0, 3]
    turn = 2 * np.arctan2(z, w) - 3.0
    assert abs((turn + np.pi) % (2 * np.pi) - np.pi) < 0.1


def test_the_motion_is_continuous(synthesis):
    steps = np.linalg.norm(np.diff(synthesis.root_positions, axis=0), axis=1)
    assert steps.max() < 0.12, "no one walks faster than 3.6 m/s"
    cosines = np.abs(np.einsum("fjk,fjk->fj", synthesis.rotations[1:], synthesis.rotations[:-1]))
    assert np.degrees(2 * np.arccos(np.clip(cosines, 0, 1))).max() < 40, "no joint pops"


def test_the_report_is_plain_and_whole(synthesis, starter):
    report = json.loads(json.dumps(synthesis.report))
    assert report["library_checksum"] == starter.checksum
    assert report["seed"] == 1
    assert report["version"] == oncue_core.__version__
    assert report["settings"]["kept"]["rollouts"] == 8
    assert report["updates"] == len(report["curve"]) == 1
    assert report["success"] == (not report["problems"])
    (cue,) = report["cues"]
    assert cue["cue"] == "Sit"
    assert cue["met"] == (cue["pelvis_cm"] <= 10 and cue["facing_degrees"] <= 20)


def test_every_field_of_the_report_is_documented(synthesis):
    page = (Path(__file__).parents[2] / "docs" / "report.md").read_text(encoding="utf-8")
    fields = [*synthesis.report]
    for part in ("foot", "penetration", "speed"):
        fields += synthesis.report[part]
    fields += synthesis.report["cues"][0]
    fields += synthesis.report["curve"][0]
    assert [field for field in fields if f"`{field}`" not in page] == []


def test_the_residual_is_that_of_the_motion(synthesis):
    (cue,) = synthesis.report["cues"]
    distance = np.linalg.norm(synthesis.root_positions[cue["frame"]] - [0.0, 1.95, 0.53])
    assert cue["pelvis_cm"] == pytest.approx(100 * distance, abs=0.1)


@pytest.mark.parametrize("threads", ["1", "2", "3"])
def test_one_seed_is_one_motion_on_any_number_of_threads(synthesis, threads):
    root = Path(__file__).parents[2]
    done = subprocess.run(
        [sys.executable, "-c", "from tests.core.test_synthesis import *; print(fingerprint(bench_run()))"],
        cwd=root,
        env={**os.environ, "RAYON_NUM_THREADS": threads, "PYTHONPATH": str(root)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.strip() == fingerprint(synthesis)


def test_another_seed_is_another_motion(synthesis, bench_scene, bench_task, starter):
    assert fingerprint(run(bench_scene, starter, bench_task, seed=2)) != fingerprint(synthesis)


def test_a_seat_that_is_none_is_named_before_anything_is_optimized(bench_scene, bench_task, starter):
    bench_task["cue"] |= {"name": "Armchair", "position": [0.0, 0.0, 0.6]}
    job = oncue_core.synthesize(bench_scene, starter, bench_task)
    with pytest.raises(InputError, match="Armchair"):
        job.result()
    assert job.progress()["stage"] == "Checking the cues"


def test_an_empty_library_is_named(bench_scene, bench_task):
    empty = oncue_core.build_library([], {"starter": "none"}).result()[0]
    assert empty.clip_count == 0
    with pytest.raises(InputError, match="librar"):
        oncue_core.synthesize(bench_scene, empty, bench_task, QUICK).result()


@pytest.mark.parametrize("stage", ["Preparing the motion library", "Playing the policy", "Optimizing"])
def test_cancel_is_seen_at_every_stage(bench_scene, bench_task, starter, stage):
    # Far too much of each, so that none is over before it is cancelled; a library that nobody has prepared yet.
    library = Library.starter() if stage.startswith("Preparing") else starter
    settings = {"kept": {"rollouts": 100_000}} if stage.startswith("Playing") else {"ppo": {"prior": False}}
    job = oncue_core.synthesize(bench_scene, library, bench_task, settings)
    try:
        while job.progress()["stage"] != stage and not job.done():
            time.sleep(0.001)
        assert not job.done()
        time.sleep(0.02)
        job.cancel()
        asked = time.monotonic()
        with pytest.raises(Cancelled):
            job.result()
        # The target is 0.2 s; a machine under load gets ten times as much.
        assert time.monotonic() - asked < 2
    finally:
        job.cancel()


def test_presets_are_whole_and_are_taken_back(bench_scene, bench_task, starter):
    assert oncue_core.presets()[0] == "default"
    paper = oncue_core.default_settings("paper")
    assert paper != oncue_core.default_settings()
    assert paper["ppo"]["tuples"] == 30_000
    for name in oncue_core.presets():
        job = oncue_core.synthesize(bench_scene, starter, bench_task, oncue_core.default_settings(name))
        job.cancel()
        job.wait(10)


def test_an_unknown_preset_names_those_that_are_there():
    with pytest.raises(InputError, match=r"fastest.*default"):
        oncue_core.default_settings("fastest")


@pytest.mark.parametrize(
    ("settings", "named"),
    [
        ({"ppo": {"tupels": 1}}, "ppo.*tupels"),
        ({"reward": {"sigma_root": None}}, "reward.sigma_root"),
        ({"signal": {"future_form": "line"}}, "signal.future_form.*line"),
    ],
)
def test_a_wrong_setting_is_named_with_its_path(bench_scene, bench_task, starter, settings, named):
    with pytest.raises(InputError, match=named):
        oncue_core.synthesize(bench_scene, starter, bench_task, settings)
