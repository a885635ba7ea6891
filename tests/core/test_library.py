"""Motion libraries: built from files, kept in a file, joined; and every way a file can be wrong."""

import math
import sys
import time
from pathlib import Path

import numpy as np
import oncue_core
import pytest
from oncue_core import Cancelled, DataFileError, InputError, Library

from .bvh import stepping

MOCAP_ONLY = {"starter": "none"}


@pytest.fixture(scope="module")
def mocap_folder(tmp_path_factory):
    """Two captures and two files that are none."""
    folder = tmp_path_factory.mktemp("mocap")
    (folder / "brisk.bvh").write_text(stepping(speed=1.2))
    (folder / "deeper").mkdir()
    (folder / "deeper" / "slow.bvh").write_text(stepping(speed=0.6))
    (folder / "empty.bvh").write_bytes(b"")
    (folder / "noise.bvh").write_bytes(bytes(range(256)) * 40)
    return folder


@pytest.fixture(scope="module")
def library(mocap_folder) -> Library:
    return oncue_core.build_library([mocap_folder], MOCAP_ONLY).result()[0]


def test_a_folder_becomes_a_library(mocap_folder):
    library, captures = oncue_core.build_library([str(mocap_folder)], MOCAP_ONLY).result()
    assert library.clip_count == 4, "two captures and their mirrored copies"
    assert 4 * 80 <= library.frame_count <= 4 * 91
    files = {Path(capture["file"]).name: capture for capture in captures}
    assert list(files) == ["brisk.bvh", "slow.bvh", "empty.bvh", "noise.bvh"]
    for name in ("empty.bvh", "noise.bvh"):
        assert files[name]["clip"] is None
        assert files[name]["seconds"] == {}
        assert len(files[name]["reason"]) > 10
    for name, clip in (("brisk.bvh", "brisk"), ("slow.bvh", "slow")):
        assert files[name]["clip"] == clip
        frames = library.frame_count / 4
        assert sum(files[name]["seconds"].values()) == pytest.approx(frames / 30, abs=0.1)
        assert files[name]["notes"] == []


def test_what_the_captures_lack_is_the_starters(mocap_folder):
    library, _ = oncue_core.build_library([mocap_folder]).result()
    rows = {row["label"]: row for row in library.summary()["rows"]}
    made = {row["label"]: row for row in Library.starter().summary()["rows"]}
    # A few metres straight on are not enough to walk by.
    assert rows["walk"]["mocap_seconds"] > 0
    assert "m were walked" in rows["walk"]["shortfall"]
    assert rows["sit"]["shortfall"] == "none was captured"
    assert rows["walk"]["procedural_seconds"] == made["walk"]["procedural_seconds"]
    assert rows["other"]["shortfall"] is None


def test_the_summary_counts_every_frame_once(library):
    summary = library.summary()
    assert (summary["clips"], summary["frames"]) == (library.clip_count, library.frame_count)
    rows = {row["label"]: row for row in summary["rows"]}
    assert set(rows) == {"walk", "idle", "sit", "seated_idle", "stand_up", "stop", "other"}
    seconds = sum(row["mocap_seconds"] + row["mirrored_seconds"] for row in rows.values())
    assert 1 < seconds <= library.frame_count / 30 + 1e-3
    for row in rows.values():
        assert row["mocap_seconds"] == pytest.approx(row["mirrored_seconds"])
        assert row["procedural_seconds"] == 0


def test_a_clip_goes_out_as_a_bvh_and_comes_back(library, tmp_path):
    assert library.clip_names == ["brisk", "brisk (mirrored)", "slow", "slow (mirrored)"]
    for number, speed in ((0, 1.2), (2, 0.6)):
        library.write_bvh(number, tmp_path / "walk.bvh")
        text = (tmp_path / "walk.bvh").read_text()
        assert text.startswith("HIERARCHY\nROOT Hips\n{\n\tOFFSET 0.000000")
        rows = [[float(v) for v in line.split()] for line in text.partition("Frame Time:")[2].splitlines()[1:]]
        # Centimetres, Y up: it walks as fast as the capture, at the height of our body's hips.
        path = math.dist(rows[0][0:3:2], rows[-1][0:3:2])
        assert path / 100 / ((len(rows) - 1) / 30) == pytest.approx(speed, rel=0.05)
        assert 85 < rows[0][1] < 105
        again, captures = oncue_core.build_library([tmp_path], {**MOCAP_ONLY, "mirror": False}).result()
        assert [capture["reason"] for capture in captures if capture["clip"] is None] == []
        assert again.clip_names == ["walk"]
        assert again.frame_count == len(rows)
        # Rewritten from what was read of it, it is the same file but for what the calibration measures anew.
        again.write_bvh(0, tmp_path / "walk.bvh")
        rewritten = (tmp_path / "walk.bvh").read_text().partition("Frame Time:")[2].splitlines()[1:]
        for row, line in zip(rows, rewritten, strict=True):
            heights = float(line.split()[1]) - row[1]
            assert abs(heights) < 1.5, "centimetres"


def test_a_clip_comes_as_arrays_with_what_happens_in_it(library):
    counted = 0
    for number, name in enumerate(library.clip_names):
        clip = library.clip(number)
        frames = len(clip["root_positions"])
        counted += frames
        assert (clip["name"], clip["source"]) == (name, "mocap")
        assert clip["mirrored"] == name.endswith("(mirrored)")
        assert clip["root_positions"].shape == (frames, 3)
        assert clip["rotations"].shape == (frames, 22, 4)
        assert clip["contacts"].shape == (frames, 2)
        assert np.linalg.norm(clip["rotations"], axis=-1) == pytest.approx(1, abs=1e-4)
        # Metres a second at 30 Hz, as the captures were made.
        path = np.linalg.norm(np.diff(clip["root_positions"][:, :2], axis=0), axis=1).sum()
        assert path * 30 / (frames - 1) == pytest.approx(1.2 if "brisk" in name else 0.6, rel=0.05)
        ends = [0, *(part["end"] for part in clip["segments"])]
        for part, before in zip(clip["segments"], ends, strict=False):
            assert before <= part["first"] <= part["complete"] < part["end"] <= frames
    assert counted == library.frame_count
    made = Library.starter()
    labels = {part["label"] for k in range(made.clip_count) for part in made.clip(k)["segments"]}
    assert {"walk", "sit", "seated_idle", "stand_up"} <= labels
    assert {made.clip(k)["source"] for k in range(made.clip_count)} == {"procedural"}


def test_clips_that_are_not_there_cannot_be_had(library, tmp_path):
    with pytest.raises(InputError, match="4 clips; none has the number 4"):
        library.write_bvh(4, tmp_path / "none.bvh")
    with pytest.raises(InputError, match="4 clips; none has the number 4"):
        library.clip(4)
    with pytest.raises(OSError, match="nowhere"):
        library.write_bvh(0, tmp_path / "nowhere" / "walk.bvh")
    assert list(tmp_path.iterdir()) == []


def test_mirrored_copies_can_be_left_out(mocap_folder):
    library, _ = oncue_core.build_library([mocap_folder], {**MOCAP_ONLY, "mirror": False}).result()
    assert library.clip_count == 2


def test_the_same_files_give_the_same_library(mocap_folder, library):
    again, _ = oncue_core.build_library([mocap_folder], MOCAP_ONLY).result()
    assert again.checksum == library.checksum
    assert len(again.checksum) == 64


def test_a_written_library_reads_the_same(library, tmp_path):
    path = tmp_path / "walks.oncue"
    library.write(path)
    read = Library.read(str(path))
    assert read.checksum == library.checksum
    assert read.summary() == library.summary()
    assert [entry.name for entry in tmp_path.iterdir()] == ["walks.oncue"], "nothing else is left behind"


def test_joined_libraries_hold_both(mocap_folder, library):
    one, _ = oncue_core.build_library([mocap_folder / "brisk.bvh"], MOCAP_ONLY).result()
    both = one.merged(library)
    assert both.clip_count == one.clip_count + library.clip_count
    assert both.frame_count == one.frame_count + library.frame_count
    assert both.checksum not in (one.checksum, library.checksum)


def damaged(data: bytes) -> bytes:
    middle = len(data) // 2
    return data[:middle] + bytes([data[middle] ^ 1]) + data[middle + 1 :]


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (damaged, "damaged"),
        (lambda data: data[:-1], "damaged"),
        (lambda data: data[:20], "damaged|not an Oncue"),
        (lambda data: b"", "not an Oncue"),
        (lambda data: b"PK\x03\x04" + data, "not an Oncue"),
    ],
)
def test_a_wrong_library_file_is_refused_by_name(library, tmp_path, change, reason):
    path = tmp_path / "walks.oncue"
    library.write(path)
    path.write_bytes(change(path.read_bytes()))
    with pytest.raises(DataFileError, match=reason) as caught:
        Library.read(path)
    assert "walks.oncue" in str(caught.value)


def test_a_missing_library_is_pythons_own_error(tmp_path):
    with pytest.raises(FileNotFoundError) as caught:
        Library.read(tmp_path / "gone.oncue")
    assert caught.value.filename == str(tmp_path / "gone.oncue")
    assert caught.value.errno == 2
    assert "os error" not in str(caught.value)


def test_a_place_that_cannot_be_written_is_pythons_own_error(library, tmp_path):
    with pytest.raises(FileNotFoundError):
        library.write(tmp_path / "no such folder" / "walks.oncue")
    (tmp_path / "folder").mkdir()
    # As Python's own `open` says it: Windows has no word for a folder that is in the way.
    with pytest.raises(PermissionError if sys.platform == "win32" else IsADirectoryError) as caught:
        library.write(tmp_path / "folder")
    assert caught.value.filename == str(tmp_path / "folder")
    assert not caught.value.strerror.endswith(".")
    assert [entry.name for entry in tmp_path.iterdir()] == ["folder"]


def test_a_vanished_folder_is_named(tmp_path):
    with pytest.raises(FileNotFoundError, match="vanished"):
        oncue_core.build_library([tmp_path / "vanished"]).result()


def test_a_folder_without_captures_is_named(tmp_path):
    with pytest.raises(InputError, match=tmp_path.name):
        oncue_core.build_library([tmp_path]).result()


def test_nothing_but_unreadable_files_is_an_error(mocap_folder):
    with pytest.raises(InputError, match=r"empty\.bvh"):
        oncue_core.build_library([mocap_folder / "empty.bvh"], MOCAP_ONLY).result()


@pytest.mark.parametrize(
    ("settings", "named"),
    [({"mirrored": True}, "mirrored"), ({"starter": "some"}, "starter.*some"), ({"mirror": 1}, "mirror")],
)
def test_a_wrong_setting_is_named_at_once(settings, named):
    with pytest.raises(InputError, match=named):
        oncue_core.build_library([], settings)


def test_building_from_real_captures_can_be_cancelled(shared_data):
    job = oncue_core.build_library([shared_data / "mocap"], MOCAP_ONLY)
    while job.progress()["stage"] != "Reading motion capture" and not job.done():
        time.sleep(0.001)
    job.cancel()
    asked = time.monotonic()
    with pytest.raises(Cancelled):
        job.result()
    # The target is 0.2 s; a machine under load gets ten times as much.
    assert time.monotonic() - asked < 2
