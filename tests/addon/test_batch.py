"""`batch.py` in a Blender of its own: results, exit statuses and sentences."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import bpy
import pytest

from .runs import QUICK, current_action, forget_policies, keys_of, set_quick

ROOT = Path(__file__).parents[2]


def batch(*arguments, timeout=500):
    """The finished process; it uses the installed extension where the tests do."""
    command = [sys.executable, str(ROOT / "addon" / "batch.py"), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=timeout, env=os.environ, check=False)


@pytest.fixture
def scene_file(fixtures, tmp_path):
    def make(name):
        fixtures.SCENES[name]()
        path = tmp_path / f"{name}.blend"
        fixtures.save(path)
        return path

    return make


def test_the_same_keys_as_the_button(scene_file, oncue, core, tmp_path):
    scene = scene_file("stool")
    out, report = tmp_path / "out" / "out.blend", tmp_path / "out" / "out.json"
    # Both from where nothing was kept: a policy of an earlier test or of the first would be played.
    forget_policies()
    done = batch(scene, "--out", out, "--report", report, "--seed", 5, "--overrides", json.dumps(QUICK))
    assert done.returncode in {0, 3}, done.stderr
    written = json.loads(report.read_text())
    assert done.returncode == (0 if written["success"] else 3)
    assert written["seed"] == 5
    assert re.search(r"Oncue: +\d+ s  \w.* \d+ %", done.stdout), done.stdout

    bpy.ops.wm.open_mainfile(filepath=str(scene))
    set_quick(bpy.context.scene)
    bpy.context.scene.oncue.seed = 5
    forget_policies()
    bpy.ops.oncue.synthesize()
    pressed = keys_of(oncue, current_action())
    bpy.ops.wm.open_mainfile(filepath=str(out))
    assert keys_of(oncue, current_action()) == pressed
    assert len(pressed) == 91


def test_the_log_tells_what_was_done(scene_file, core, tmp_path):
    log, out = tmp_path / "logs" / "run.log", tmp_path / "out.blend"
    log.parent.mkdir()
    log.write_text("of another run\n")
    given = ["--out", out, "--seed", 5, "--overrides", json.dumps(QUICK), "--log", log, "--verbose"]
    done = batch(scene_file("stool"), *given)
    assert done.returncode in {0, 3}, done.stderr
    lines = log.read_text().splitlines()
    assert all(re.match(r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d\.\d{3} [A-Z]+ +\S", line) for line in lines), lines
    said = [line[24:].split(None, 1)[1] for line in lines]
    assert f"Blender {bpy.app.version_string}, " in said[0]
    assert f"core {core.__version__}, " in said[0]
    assert "--seed 5" in said[1]
    ended = [line.split(":")[0] for line in said if re.search(r": \d+\.\d\d s$", line)]
    assert ended.index("Indexing the scene") < ended.index("Checking the cues") < ended.index("Measuring")
    # The same on stderr.
    assert set(lines[1:]) <= set(done.stderr.splitlines())


def test_a_failure_is_in_the_log(scene_file, core, tmp_path):
    log = tmp_path / "run.log"
    done = batch(scene_file("enclosed_seat"), "--out", tmp_path / "out.blend", "--log", log)
    failed(done, None, "Sit")
    sentence = done.stderr.split("Oncue: ")[1].strip()
    last = log.read_text().splitlines()[-1]
    assert " ERROR " in last
    assert last.endswith(sentence)


def failed(done, report, words):
    """One sentence, status 1, and the same sentence in the report."""
    assert done.returncode == 1, done.stdout + done.stderr
    sentences = [line for line in done.stderr.splitlines() if line.startswith("Oncue: ")]
    assert len(sentences) == 1, done.stderr
    assert words in sentences[0]
    assert "Traceback" not in done.stderr
    if report:
        said = json.loads(report.read_text())
        assert said["success"] is False
        assert words in said["problems"][0]


def test_an_enclosed_seat_is_named(scene_file, core, tmp_path):
    report = tmp_path / "out.json"
    done = batch(scene_file("enclosed_seat"), "--out", tmp_path / "out.blend", "--report", report)
    failed(done, report, "Sit")
    assert not (tmp_path / "out.blend").exists()


def test_a_place_that_cannot_be_written_is_found_before_the_work(scene_file, tmp_path):
    in_the_way = tmp_path / "file"
    in_the_way.write_text("")
    done = batch(scene_file("stool"), "--out", in_the_way / "out.blend")
    failed(done, None, "cannot be written")
    assert "reading" not in done.stdout


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="no file system that nobody can write to")
def test_a_read_only_place_is_found_before_the_work(scene_file, tmp_path):
    scene = scene_file("stool")
    failed(batch(scene, "--out", "/proc/out.blend"), None, "/proc/out.blend cannot be written")
    failed(batch(scene, "--out", tmp_path / "out.blend", "--report", "/proc/out.json"), None, "/proc/out.json cannot")


def test_missing_things_are_named(scene_file, tmp_path):
    out = tmp_path / "out.blend"
    failed(batch(tmp_path / "no.blend", "--out", out), None, "no.blend is not there")
    scene = scene_file("stool")
    failed(batch(scene, "--out", out, "--library", tmp_path / "gone"), None, "gone")
    failed(batch(scene, "--out", out, "--preset", "best"), None, "best")
    broken = tmp_path / "broken.blend"
    broken.write_bytes(b"nothing like a blend file")
    failed(batch(broken, "--out", out), None, "broken.blend")
