"""The motion manifold: trained on a library, kept in a file, and every way that can go wrong."""

import time

import oncue_core
import pytest
from oncue_core import Cancelled, DataFileError, InputError, Library, Manifold

from .bvh import stepping

SMALL = {"channels": 16, "epochs": 3, "stride": 40, "test_share": 0.2, "validation_share": 0.2}


@pytest.fixture(scope="module")
def library(tmp_path_factory) -> Library:
    folder = tmp_path_factory.mktemp("mocap")
    for number in range(5):
        (folder / f"walk {number}.bvh").write_text(stepping(speed=0.6 + 0.2 * number))
    return oncue_core.build_library([folder], {"starter": "none"}).result()[0]


@pytest.fixture(scope="module")
def manifold(library) -> Manifold:
    return oncue_core.train_manifold(library, SMALL, seed=1).result()


def test_a_library_gives_a_manifold_with_its_figures(library, manifold):
    figures = manifold.figures
    assert manifold.channels == 16
    assert figures["library"] == library.checksum
    assert figures["settings"]["channels"] == 16
    assert figures["settings"]["noise"] == pytest.approx(0.01)
    assert figures["clips"] == [6, 2, 2], "a clip and its mirrored copy stay together"
    assert [point["epoch"] for point in figures["curve"]] == [1, 2, 3]
    assert all(point["loss"] > 0 for point in figures["curve"])
    assert figures["test"]["windows"] == figures["test_mocap"]["windows"] > 0
    assert figures["test_augmented"]["joint_error_cm"] > figures["test"]["joint_error_cm"]
    assert 0 < figures["test"]["joint_error_cm"] < 10
    assert 0 <= figures["test"]["contact_accuracy"] <= 1


def test_the_shipped_manifold_tells_its_data_and_its_errors():
    figures = Manifold.shipped().figures
    assert "CC BY 3.0" in figures["settings"]["origin"]
    assert "mocap.cs.cmu.edu" in figures["settings"]["origin"]
    for part in ("test", "test_mocap"):
        assert figures[part]["joint_error_cm"] < 2
        assert figures[part]["rotation_error_degrees"] < 3


def test_what_is_written_is_read(manifold, tmp_path):
    path = tmp_path / "own.oncueman"
    manifold.write(path)
    back = Manifold.read(str(path))
    assert back.figures == manifold.figures
    back.write(tmp_path / "again.oncueman")
    assert (tmp_path / "again.oncueman").read_bytes() == path.read_bytes()


def test_one_seed_gives_one_file(library, manifold, tmp_path):
    for name, seed in [("same", 1), ("other", 2)]:
        oncue_core.train_manifold(library, SMALL, seed).result().write(tmp_path / name)
    manifold.write(tmp_path / "first")
    assert (tmp_path / "same").read_bytes() == (tmp_path / "first").read_bytes()
    assert (tmp_path / "other").read_bytes() != (tmp_path / "first").read_bytes()


def test_a_checkpoint_goes_on_where_it_was(library, manifold, tmp_path):
    checkpoint = tmp_path / "training.oncueckp"
    job = oncue_core.train_manifold(library, {**SMALL, "epochs": 10_000}, 1, checkpoint)
    while not checkpoint.exists():
        assert not job.wait(0.01)
    job.cancel()
    with pytest.raises(Cancelled):
        job.result()
    with pytest.raises(DataFileError, match="another library, seed or settings"):
        oncue_core.train_manifold(library, SMALL, 1, checkpoint).result()
    checkpoint.unlink()
    oncue_core.train_manifold(library, SMALL, 1, checkpoint).result()
    resumed = oncue_core.train_manifold(library, SMALL, 1, checkpoint).result()
    assert resumed.figures == manifold.figures


def test_cancelling_answers_at_once(library):
    job = oncue_core.train_manifold(library, {"epochs": 10_000})
    while "Training" not in job.progress()["stage"]:
        time.sleep(0.01)
    job.cancel()
    assert job.wait(5)
    with pytest.raises(Cancelled):
        job.result()


def test_damage_is_a_sentence(manifold, tmp_path):
    path = tmp_path / "own.oncueman"
    manifold.write(path)
    whole = path.read_bytes()
    path.write_bytes(whole[:-100])
    with pytest.raises(DataFileError, match="damaged or cut off; train the manifold again"):
        Manifold.read(path)
    path.write_bytes(b"a picture, say")
    with pytest.raises(DataFileError, match="not an Oncue motion manifold"):
        Manifold.read(path)
    with pytest.raises(OSError, match="nowhere"):
        Manifold.read("/nowhere/at/all")


@pytest.mark.parametrize(
    ("settings", "sentence"),
    [({"channel": 3}, "channel"), ({"channels": "many"}, "channels: invalid type")],
)
def test_unknown_settings_are_refused_at_once(library, settings, sentence):
    with pytest.raises(InputError, match=sentence):
        oncue_core.train_manifold(library, settings)


def test_impossible_settings_are_refused(library):
    with pytest.raises(InputError, match=r"manifold\.batch is 40; it must be a multiple of 16"):
        oncue_core.train_manifold(library, {"batch": 40}).result()
    empty, _ = oncue_core.build_library([], {"starter": "none"}).result()
    with pytest.raises(InputError, match="at least three of 40 frames, and this library has 0"):
        oncue_core.train_manifold(empty).result()
