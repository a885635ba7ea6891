"""Runs: their steps, cancel at every stage, and what interrupts them from outside."""

import time
import types

import bpy
import numpy as np
import pytest

#: A fifth of a second is the aim; machines are loaded.
STOPS_WITHIN = 5.0


@pytest.fixture
def pipeline(oncue):
    return oncue("pipeline")


@pytest.fixture
def job_operator(oncue):
    module = oncue("job_operator")
    yield module
    module.handle.stop_and_wait("")


def big_scene(side=600):
    """Enough triangles that indexing them takes a while: positions and triangles of a rough floor."""
    xs, ys = np.meshgrid(np.linspace(-4, 4, side), np.linspace(-4, 4, side))
    zs = 0.02 * np.sin(9 * xs) * np.cos(7 * ys)
    positions = np.stack([xs.ravel(), ys.ravel(), zs.ravel()], axis=1).astype(np.float32)
    corner = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).ravel()
    a = np.stack([corner, corner + 1, corner + side], axis=1)
    b = np.stack([corner + 1, corner + side + 1, corner + side], axis=1)
    return positions, np.concatenate([a, b]).astype(np.uint32)


@pytest.fixture
def request_of(pipeline):
    positions, triangles = big_scene()
    task = {
        "start": {"name": "Start", "position": [0, -3, 0.05], "yaw": 3.14},
        "cue": {"name": "Stop", "action_type": "stop", "position": [0, 3, 0.05], "yaw": 3.14, "feet": [None, None]},
    }
    return pipeline.Request(positions, triangles, task, pipeline.LibraryChoice(), "default", 1)


def test_steps_run_in_order_and_give_their_value(pipeline, core):
    def steps():
        library, skipped = yield from pipeline.library_steps(pipeline.LibraryChoice(), pipeline.LibraryCache())
        return library.clip_count, skipped

    clips, skipped = pipeline.run_blocking(steps())
    assert clips > 10
    assert skipped == []


def test_the_library_is_built_once(pipeline, core):
    cache, choice = pipeline.LibraryCache(), pipeline.LibraryChoice()
    first, _ = pipeline.run_blocking(pipeline.library_steps(choice, cache))
    second, _ = pipeline.run_blocking(pipeline.library_steps(choice, cache))
    assert first is second


def test_a_library_file_round_trips(pipeline, core, tmp_path):
    cache = pipeline.LibraryCache()
    starter, _ = pipeline.run_blocking(pipeline.library_steps(pipeline.LibraryChoice(), cache))
    path = tmp_path / f"library{pipeline.LIBRARY_SUFFIX}"
    starter.write(str(path))
    choice = pipeline.LibraryChoice((str(path),), "none")
    read, _ = pipeline.run_blocking(pipeline.library_steps(choice, cache))
    assert read.checksum == starter.checksum


def test_a_vanished_folder_is_named(pipeline, oncue, core):
    choice = pipeline.LibraryChoice(("/nowhere/mocap",))
    with pytest.raises(oncue("errors").SceneError, match="/nowhere/mocap is not there"):
        pipeline.run_blocking(pipeline.library_steps(choice, pipeline.LibraryCache()))


def test_an_unreadable_folder_is_a_sentence(pipeline, oncue, core, tmp_path):
    (tmp_path / "broken.bvh").write_bytes(b"\x00\xff not a motion" * 40)
    choice = pipeline.LibraryChoice((str(tmp_path),), "none")
    with pytest.raises(oncue("native").expected_errors()) as refused:
        pipeline.run_blocking(pipeline.library_steps(choice, pipeline.LibraryCache()))
    assert str(tmp_path) in str(refused.value) or "broken.bvh" in str(refused.value)


def test_an_empty_choice_is_a_sentence(pipeline, oncue, core):
    with pytest.raises(oncue("errors").SceneError, match="library is empty"):
        pipeline.run_blocking(pipeline.library_steps(pipeline.LibraryChoice((), "none"), pipeline.LibraryCache()))


@pytest.mark.parametrize("stage", [0, 1, 2])
def test_cancel_at_each_stage_stops_at_once(pipeline, core, request_of, stage):
    """Stage 0 builds the library, 1 indexes the scene, 2 optimizes."""
    jobs = []

    def watched():
        steps = pipeline.synthesis_steps(request_of, pipeline.LibraryCache())
        try:
            job = next(steps)
            while True:
                if not jobs or jobs[-1] is not job:
                    jobs.append(job)
                yield job
                job = next(steps)
        except StopIteration as stop:
            return stop.value

    run = pipeline.Run(watched())
    deadline = time.monotonic() + 120
    while len(jobs) <= stage and not run.poll() and time.monotonic() < deadline:
        time.sleep(0.002)
    assert len(jobs) == stage + 1, "the stage was not reached"
    run.cancel()
    began = time.monotonic()
    assert run.wait(STOPS_WITHIN)
    assert time.monotonic() - began < STOPS_WITHIN
    with pytest.raises(core.Cancelled):
        run.result()
    assert all(job.done() for job in jobs)
    assert len(jobs) == stage + 1


def test_cancel_after_the_end_is_still_a_cancel(pipeline, core):
    run = pipeline.Run(pipeline.library_steps(pipeline.LibraryChoice(), pipeline.LibraryCache()))
    run.wait(60)
    run.cancel()
    with pytest.raises(core.Cancelled):
        run.result()


def test_a_bug_keeps_its_traceback(pipeline, core):
    def steps():
        yield from pipeline.library_steps(pipeline.LibraryChoice(), pipeline.LibraryCache())
        raise ZeroDivisionError("a bug")

    with pytest.raises(ZeroDivisionError) as caught:
        pipeline.run_blocking(steps())
    assert caught.traceback[-1].name == "steps"


def test_an_interrupt_stops_the_core(pipeline, core, request_of):
    seen = []

    def interrupt(progress):
        seen.append(progress)
        raise KeyboardInterrupt

    steps = pipeline.synthesis_steps(request_of, pipeline.LibraryCache())
    with pytest.raises(KeyboardInterrupt):
        pipeline.run_blocking(steps, interrupt, every_s=0.01)
    assert seen


# --- what interrupts a run in the window ------------------------------------------------------------------------------


@pytest.fixture
def running(pipeline, job_operator, core, request_of):
    """A run at work, as the button's modal operator holds it."""
    run = pipeline.Run(pipeline.synthesis_steps(request_of, pipeline.LibraryCache()))
    run.poll()
    job_operator.handle.run, job_operator.handle.message = run, ""
    assert not run.finished
    return run


def test_pressing_twice_is_refused(running):
    with pytest.raises(RuntimeError, match="at work"):
        bpy.ops.oncue.synthesize()
    assert not running.cancelled


def test_opening_another_file_stops_the_run(running, job_operator):
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    assert running.cancelled
    assert job_operator.handle.run is None
    assert "another file" in job_operator.handle.message


@pytest.mark.parametrize("event", ["undo_pre", "redo_pre"])
def test_undo_stops_the_run(running, job_operator, event):
    for function in list(getattr(bpy.app.handlers, event)):
        function(bpy.context.scene)
    assert running.cancelled
    assert job_operator.handle.run is None
    assert "undo" in job_operator.handle.message


def test_saving_does_not_disturb_the_run(running, tmp_path):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "meanwhile.blend"), copy=True)
    assert not running.cancelled


def test_the_cancel_button_lets_the_run_go_at_once(running, job_operator):
    assert bpy.ops.oncue.cancel() == {"FINISHED"}
    assert job_operator.handle.run is None
    assert "as it was" in job_operator.handle.message
    assert running.cancelled
    assert running.wait(STOPS_WITHIN)
    with pytest.raises(RuntimeError):
        bpy.ops.oncue.cancel()


def test_escape_ends_the_operator_with_the_very_event(running, job_operator, context, monkeypatch):
    """Whether or not the core has stopped: it is never waited for."""
    monkeypatch.setattr(type(running), "wait", lambda *_: pytest.fail("waited"))
    said = []

    class Operator(job_operator.JobOperator):
        _run = running

        def report(self, _kind, text):
            said.append(text)

    def happens(kind, value="NOTHING"):
        return Operator().modal(context, types.SimpleNamespace(type=kind, value=value))

    assert happens("TIMER") == {"PASS_THROUGH"}
    assert happens("ESC", "RELEASE") == {"PASS_THROUGH"}
    assert happens("ESC", "PRESS") == {"CANCELLED"}
    assert running.cancelled
    assert job_operator.handle.run is None
    assert said == ["Cancelled; the file is as it was."]


def test_disabling_the_extension_stops_the_run(running, oncue):
    oncue.package.unregister()
    try:
        assert running.finished
    finally:
        oncue.package.register()


def test_progress_says_where_it_is(running):
    time.sleep(0.05)
    progress = running.progress()
    assert progress.stage
    assert 0.0 <= progress.fraction <= 1.0
    assert progress.elapsed_s > 0.0
