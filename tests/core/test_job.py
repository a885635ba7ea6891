"""The handle of running work: progress, waiting, cancelling, letting go."""

import gc
import threading
import time

import oncue_core
import pytest
from oncue_core import Cancelled, InputError

from .geometry import room_with_a_bench, terrain


@pytest.fixture(scope="module")
def large():
    """Half a million triangles: indexing them takes long enough to be interrupted."""
    return terrain(500)


def test_a_result_is_the_same_object_each_time():
    job = oncue_core.index_scene(*room_with_a_bench())
    assert job.wait(60)
    assert job.done()
    assert job.result() is job.result()


def test_an_error_is_raised_each_time():
    positions, triangles = room_with_a_bench()
    job = oncue_core.index_scene(positions, triangles[:0])
    for _ in range(2):
        with pytest.raises(InputError):
            job.result()


def test_progress_is_a_plain_dict(large):
    job = oncue_core.index_scene(*large)
    seen = job.progress()
    assert set(seen) == {"stage", "fraction", "update", "reward", "success_rate"}
    job.result()
    assert job.progress()["stage"] == "Indexing the scene"
    assert job.progress()["fraction"] == 1.0


def test_a_cancelled_job_raises_cancelled(large):
    job = oncue_core.index_scene(*large)
    job.cancel()
    asked = time.monotonic()
    assert job.wait(30)
    with pytest.raises(Cancelled):
        job.result()
    # The target is 0.2 s; a machine under load gets ten times as much.
    assert time.monotonic() - asked < 2


def test_cancelling_after_the_end_changes_nothing():
    job = oncue_core.index_scene(*room_with_a_bench())
    scene = job.result()
    job.cancel()
    assert job.result() is scene


def test_waiting_lets_other_threads_run(large):
    job = oncue_core.index_scene(*large)
    ticks = []
    stop = threading.Event()

    def tick():
        while not stop.is_set():
            ticks.append(time.monotonic())
            time.sleep(0.001)

    ticker = threading.Thread(target=tick)
    ticker.start()
    began = time.monotonic()
    job.result()
    ended = time.monotonic()
    stop.set()
    ticker.join()
    assert sum(began < at < ended for at in ticks) >= 5


@pytest.mark.parametrize("timeout", [0, 0.0, -1, float("nan"), float("-inf")])
def test_a_wait_of_no_time_returns_at_once(timeout):
    job = oncue_core.index_scene(*room_with_a_bench())
    job.result()
    assert job.wait(timeout)


def test_letting_go_does_not_wait(large):
    started = time.monotonic()
    for _ in range(5):
        job = oncue_core.index_scene(*large)
        del job
        gc.collect()
    # Were the jobs waited for, this would take five times their length.
    whole = time.monotonic()
    oncue_core.index_scene(*large).result()
    assert whole - started < 5 * (time.monotonic() - whole)


def test_one_job_asked_from_many_threads_gives_one_result():
    job = oncue_core.index_scene(*terrain(100))
    results = []
    threads = [threading.Thread(target=lambda: results.append(job.result())) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60)
    assert len(results) == 8
    assert len({id(result) for result in results}) == 1


def test_a_job_is_made_by_the_core_alone():
    with pytest.raises(TypeError):
        oncue_core.Job()
