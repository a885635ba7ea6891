"""Policies from Python: what ships, what is kept, what is tested from everywhere; and the extension's cache of them."""

import importlib
import importlib.util
import os
import struct
import sys
from pathlib import Path

import oncue_core
import pytest
from oncue_core import DataFileError, InputError, Library, Policy

ROOT = Path(__file__).parents[2]
QUICK = {"ppo": {"updates": 2, "tuples": 512, "solved": 1.1}, "kept": {"rollouts": 16, "rounds": 0, "more_rounds": 0}}


@pytest.fixture(scope="module")
def starter() -> Library:
    return Library.starter()


@pytest.fixture(scope="module")
def optimized(bench_scene, starter):
    task = {
        "start": {"name": "Start", "position": [0.0, -1.2, 0.0], "yaw": 0.0},
        "cue": {"name": "Stop", "action_type": "stop", "position": [0.3, 0.4, 0.99], "yaw": 0.5},
    }
    return oncue_core.optimize_policy(bench_scene, starter, [task], QUICK, 1, Policy.prior()).result()


def test_the_prior_says_that_it_belongs_to_no_scene(bench_scene, starter):
    origin = Policy.prior().origin
    assert origin["scene"] == ""
    assert origin["generalized"]
    assert origin["updates"] > 0
    assert not origin["cues"]
    assert not Policy.prior().belongs_to(bench_scene, starter.checksum)


def test_a_policy_is_optimized_kept_and_read(bench_scene, starter, optimized, tmp_path):
    policy, curve = optimized
    assert [point["update"] for point in curve] == [0, 1]
    assert all(point["success_rate"] is None for point in curve)
    assert policy.belongs_to(bench_scene, starter.checksum)
    path = tmp_path / "a.oncuepolicy"
    policy.write(path)
    assert Policy.read(path).origin == policy.origin
    path.write_bytes(path.read_bytes()[:-9])
    with pytest.raises(DataFileError, match="damaged"):
        Policy.read(path)
    with pytest.raises(FileNotFoundError):
        Policy.read(tmp_path / "none.oncuepolicy")
    with pytest.raises(InputError, match="no cue"):
        oncue_core.optimize_policy(bench_scene, starter, [], QUICK).result()


def test_robustness_counts_starts(bench_scene, starter, bench_task):
    figures = oncue_core.robustness(
        bench_scene, starter, Policy.prior(), bench_task, None, {"spacing": 1.0, "trials": 2, "needed": 1}
    ).result()
    met = [start["met"] for start in figures["starts"]]
    assert len(met) > 3
    assert all(0 <= m <= 2 for m in met)
    assert figures["ratio"] == pytest.approx(sum(m >= 1 for m in met) / len(met))
    # A grid of no width has no end.
    for spacing in (0.0, 1e30):
        with pytest.raises(InputError, match=r"robustness\.spacing"):
            oncue_core.robustness(bench_scene, starter, Policy.prior(), bench_task, None, {"spacing": spacing}).result()
    paper = oncue_core.default_settings("paper")
    with pytest.raises(InputError, match="other settings"):
        oncue_core.robustness(bench_scene, starter, Policy.prior(), bench_task, paper).result()


@pytest.fixture
def cache_class():
    """The extension's cache, which knows no Blender."""
    name = "addon_without_blender"
    package = importlib.util.module_from_spec(importlib.util.spec_from_loader(name, loader=None, is_package=True))
    package.__path__ = [str(ROOT / "addon")]
    sys.modules[name] = package
    yield importlib.import_module(f"{name}.policy_cache").PolicyCache
    for module in [m for m in sys.modules if m.startswith(name)]:
        del sys.modules[module]


def test_the_cache_finds_only_what_belongs_and_stays_small(cache_class, bench_scene, starter, optimized, tmp_path):
    policy, _ = optimized
    folder = tmp_path / "policies"
    cache = cache_class(folder, 10_000_000)
    assert cache.find(bench_scene, starter) is None
    assert cache.entries() == []
    assert cache.keep(bench_scene, starter, policy)
    assert cache.find(bench_scene, starter).origin == policy.origin
    (entry,) = cache.entries()
    assert "Stop" in entry.describe()
    assert entry.bytes > 10_000
    # Another scene has none, and a file that was copied to its place is not taken for its own.
    positions, triangles, _ = oncue_core.practice_room(1)
    other = oncue_core.index_scene(positions, triangles).result()
    assert cache.find(other, starter) is None
    entry.path.rename(cache._path(other, starter))
    assert cache.find(other, starter) is None
    # A damaged file is gone after it was looked at.
    cache.keep(bench_scene, starter, policy)
    path = cache._path(bench_scene, starter)
    path.write_bytes(b"no policy")
    assert "damaged" in next(e for e in cache.entries() if e.path == path).describe()
    assert cache.find(bench_scene, starter) is None
    assert not path.exists()
    # The oldest goes first, the newest stays whatever the limit.
    small = cache_class(folder, 1)
    os.utime(cache._path(other, starter), (1, 1))
    small.keep(bench_scene, starter, policy)
    assert [e.path for e in small.entries()] == [path]
    assert small.clear() == 1
    assert small.entries() == []


def test_a_folder_that_cannot_be_written_keeps_nothing(cache_class, bench_scene, starter, optimized, tmp_path):
    (tmp_path / "file").write_text("in the way")
    cache = cache_class(tmp_path / "file" / "policies", 1_000_000)
    assert not cache.keep(bench_scene, starter, optimized[0])
    assert cache.entries() == []
    assert cache.clear() == 0
    with pytest.raises(OSError, match="file"):
        optimized[0].write(tmp_path / "file" / "x.oncuepolicy")


def test_only_what_is_damaged_is_deleted(cache_class, bench_scene, starter, optimized, tmp_path):
    policy, _ = optimized
    cache = cache_class(tmp_path / "policies", 10_000_000)
    assert cache.keep(bench_scene, starter, policy)
    path = cache._path(bench_scene, starter)
    whole = path.read_bytes()
    version = struct.unpack_from("<I", whole, 8)[0]
    for made_by, word, stays in ((version + 1, "newer", True), (0, "older", False)):
        path.write_bytes(whole[:8] + struct.pack("<I", made_by) + whole[12:])
        with pytest.raises(DataFileError, match=f"made by an? {word} Oncue"):
            Policy.read(path)
        (entry,) = cache.entries()
        assert entry.describe().endswith(f"made by a{'n' if word == 'older' else ''} {word} Oncue")
        assert cache.find(bench_scene, starter) is None
        assert path.exists()
        # A newer Oncue will want it again; an older one's place is taken.
        assert cache.keep(bench_scene, starter, policy) is not stays
        assert (path.read_bytes() == whole) is not stays
    # What is no file of ours is looked at and left, and so is a folder in its place.
    path.unlink()
    path.mkdir()
    assert cache.find(bench_scene, starter) is None
    assert not cache.keep(bench_scene, starter, policy)
    assert cache.entries() == []
    assert path.is_dir()


def test_a_cache_that_cannot_be_written_is_played_from(
    cache_class, bench_scene, starter, optimized, tmp_path, monkeypatch
):
    cache = cache_class(tmp_path, 10_000_000)
    assert cache.keep(bench_scene, starter, optimized[0])
    refused = PermissionError(30, "Read-only file system")

    def refuse(*_arguments, **_named):
        raise refused

    monkeypatch.setattr(Path, "touch", refuse)
    monkeypatch.setattr(Path, "unlink", refuse)
    assert cache.find(bench_scene, starter) is not None
    cache._path(bench_scene, starter).write_bytes(b"no policy")
    assert cache.find(bench_scene, starter) is None
    assert cache.clear() == 0


def test_halves_that_were_left_are_cleared_and_gone_files_are_no_harm(
    cache_class, bench_scene, starter, optimized, tmp_path, monkeypatch
):
    old, new = tmp_path / "a.oncuepolicy.1-0.part", tmp_path / "b.oncuepolicy.2-0.part"
    for part in (old, new):
        part.write_bytes(b"half")
    os.utime(old, (1, 1))
    cache = cache_class(tmp_path, 10_000_000)
    assert cache.keep(bench_scene, starter, optimized[0])
    assert not old.exists()
    assert new.exists()
    # Another Blender takes a file away between the listing and the look at it.
    real = Path.stat

    def vanishing(self, **named):
        if self.suffix == ".oncuepolicy":
            raise FileNotFoundError(2, "gone", str(self))
        return real(self, **named)

    monkeypatch.setattr(Path, "stat", vanishing)
    assert cache.entries() == []
    assert cache.clear() == 0
