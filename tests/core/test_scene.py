"""Scenes in: what is accepted, what is copied, what is refused and in which words."""

import math

import numpy as np
import oncue_core
import pytest
from oncue_core import InputError

from .geometry import box, joined, room_with_a_bench, sit_on_the_bench


def test_a_room_is_indexed():
    scene = oncue_core.index_scene(*room_with_a_bench()).result()
    assert scene.triangle_count == 24
    low, high = scene.bounds
    assert low == pytest.approx((-3, -3, -0.1))
    assert high == pytest.approx((3, 3, 0.45))
    assert scene.floor_height == pytest.approx(0, abs=1e-4)


def test_any_strides_are_read_as_numpy_reads_them():
    positions, triangles = room_with_a_bench()
    wide = np.zeros((2 * len(positions), 5), dtype=np.float32)
    wide[::2, 1:4] = positions
    view = wide[::2, 1:4]
    assert not view.flags.c_contiguous
    scene = oncue_core.index_scene(view, np.asfortranarray(triangles)).result()
    assert scene.bounds == oncue_core.index_scene(positions, triangles).result().bounds


def test_arrays_are_copied_before_the_call_returns():
    positions, triangles = box((0, 0, 0), (1, 1, 1))
    job = oncue_core.index_scene(positions, triangles)
    positions += 100
    triangles[:] = 0
    assert job.result().bounds[1] == (1, 1, 1)


POSITIONS, TRIANGLES = box((0, 0, 0), (1, 1, 1))


@pytest.mark.parametrize(
    ("positions", "triangles", "sentence"),
    [
        (POSITIONS.astype(np.float64), TRIANGLES, r"positions must be .*float32.*float64 of shape \(8, 3\)"),
        (POSITIONS.astype(">f4"), TRIANGLES, "positions must be an array of float32"),
        (POSITIONS[:, :2], TRIANGLES, r"float32 of shape \(8, 2\)"),
        (POSITIONS.ravel(), TRIANGLES, r"float32 of shape \(24\)"),
        (POSITIONS.tolist(), TRIANGLES, "of type <class 'list'>"),
        (POSITIONS, TRIANGLES.astype(np.int32), "triangles must be an array of uint32.* int32"),
        (POSITIONS, None, "NoneType"),
    ],
)
def test_wrong_arrays_are_refused_at_once(positions, triangles, sentence):
    with pytest.raises(InputError, match=sentence):
        oncue_core.index_scene(positions, triangles)


@pytest.mark.parametrize(
    ("positions", "triangles"),
    [
        (np.empty((0, 3), np.float32), np.empty((0, 3), np.uint32)),
        (POSITIONS, TRIANGLES[:0]),
        (POSITIONS, np.array([[0, 1, 8]], np.uint32)),
        (POSITIONS, np.array([[0, 1, 2**32 - 1]], np.uint32)),
        (np.full_like(POSITIONS, np.nan), TRIANGLES),
        (np.full_like(POSITIONS, np.inf), TRIANGLES),
        (np.zeros_like(POSITIONS), TRIANGLES),
    ],
)
def test_meshes_that_are_none_end_in_a_sentence(positions, triangles):
    job = oncue_core.index_scene(positions, triangles)
    with pytest.raises(InputError, match=r"^[A-Z].*\.$"):
        job.result()


def test_settings_change_the_index():
    scene = oncue_core.index_scene(*room_with_a_bench(), {"floor_height": -0.05}).result()
    assert scene.floor_height == pytest.approx(-0.05)


@pytest.mark.parametrize(
    ("settings", "named"),
    [
        ({"cel_size": 0.05}, "cel_size"),
        ({"cell_size": "small"}, "cell_size"),
        ({"cell_size": float("nan")}, "scene settings"),
        ({"cell_size": {1, 2}}, "scene settings"),
        ({"max_cells": -1}, "max_cells"),
    ],
)
def test_a_wrong_setting_is_named(settings, named):
    with pytest.raises(InputError, match=named):
        oncue_core.index_scene(POSITIONS, TRIANGLES, settings)


def test_a_task_that_can_be_met_passes(bench_scene, bench_task):
    oncue_core.check_task(bench_scene, bench_task)


def test_a_seat_in_the_air_is_named(bench_scene, bench_task):
    bench_task["cue"] |= {"name": "Armchair", "position": [0.0, 0.0, 0.6]}
    with pytest.raises(InputError, match="Armchair"):
        oncue_core.check_task(bench_scene, bench_task)


@pytest.mark.parametrize(
    ("part", "change", "named"),
    [
        ("cue", {"action_type": "dance"}, "cue.action_type.*dance"),
        ("cue", {"colour": "red"}, "colour"),
        ("cue", {"position": [0.0, 1.0]}, "cue.position"),
        ("cue", {"feet": [[0.0, 1.0, 0.0]]}, "cue.feet"),
        ("start", {"yaw": "north"}, "start.yaw"),
        ("start", {"yaw": float("inf")}, "task"),
    ],
)
def test_a_wrong_task_names_its_field(bench_scene, bench_task, part, change, named):
    bench_task[part] |= change
    with pytest.raises(InputError, match=named):
        oncue_core.check_task(bench_scene, bench_task)


def test_a_missing_part_is_named(bench_scene, bench_task):
    del bench_task["cue"]
    with pytest.raises(InputError, match="cue"):
        oncue_core.check_task(bench_scene, bench_task)


def test_a_task_is_indexed_on_the_level_that_carries_its_start():
    bench, garden = room_with_a_bench(), box((-9, -9, -1), (9, 9, -0.5))
    positions, triangles = joined(bench, garden)
    task = sit_on_the_bench()
    without = oncue_core.index_scene(positions, triangles).result()
    assert without.floor_height == pytest.approx(-0.5)
    with pytest.raises(InputError, match=r"stands 0\.50 m over the scene's walkable floor"):
        oncue_core.check_task(without, task)
    scene = oncue_core.index_scene(positions, triangles, None, task).result()
    assert scene.floor_height == pytest.approx(0.0)
    assert scene.fingerprint != without.fingerprint
    oncue_core.check_task(scene, task)
    with pytest.raises(InputError, match="task"):
        oncue_core.index_scene(positions, triangles, None, {"start": 3})


def test_a_cue_in_the_middle_of_a_bed_has_an_edge():
    positions, triangles = joined(box((-4, -4, -0.1), (4, 4, 0)), box((-1, -1, 0), (1, 1, 0.5)))
    task = {
        "start": {"name": "Start", "position": [-3.0, 0.0, 0.0], "yaw": 1.5},
        "cue": {"name": "Sit", "action_type": "sit", "position": [0.0, 0.0, 0.6], "yaw": math.radians(-90)},
    }
    scene = oncue_core.index_scene(positions, triangles, None, task).result()
    with pytest.raises(oncue_core.EdgeError, match=r"The nearest edge to sit on is 0\.[78]\d m away") as said:
        oncue_core.check_task(scene, task)
    # In its own direction, a seat's depth from the rim, as high as before.
    assert said.value.place == pytest.approx((-0.78, 0.0, 0.6), abs=0.05)
    assert said.value.yaw == pytest.approx(math.radians(-90), abs=1e-3)
    oncue_core.check_task(scene, {**task, "cue": {**task["cue"], "position": list(said.value.place)}})
