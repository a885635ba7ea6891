"""The core's log as records of Python's `logging`."""

import logging
import re
import subprocess
import sys
import textwrap
import threading
import time

import oncue_core
import pytest
from oncue_core import Library

from .geometry import room_with_a_bench, sit_on_the_bench, terrain

STAGE = re.compile(r"(.+): \d+\.\d\d s$")
#: Too little to walk well, enough to pass through every stage.
QUICK = {
    "ppo": {"prior": False, "updates": 1, "tuples": 1024, "policy_layers": [32], "value_layers": [32]},
    "kept": {"rollouts": 8, "rounds": 1, "more_rounds": 0},
    "editor": {"fit": False},
}


def stages(records):
    """Names of the stages that ended, in order."""
    found = [STAGE.match(record.getMessage()) for record in records if record.levelno == logging.INFO]
    return [match[1] for match in found if match]


def hand_over():
    """Takes along what no job was asked for."""
    oncue_core.index_scene(*room_with_a_bench()).result()


def test_a_run_logs_each_stage_once_and_in_order(caplog):
    hand_over()
    with caplog.at_level(logging.DEBUG, logger="oncue"):
        scene = oncue_core.index_scene(*room_with_a_bench()).result()
        library = Library.starter()
        synthesis = oncue_core.synthesize(scene, library, sit_on_the_bench(), QUICK, 1).result()
    expected = [
        *("Indexing the scene", "Making the starter library", "Preparing the motion library", "Checking the cues"),
        *("Playing the policy", "Optimizing", "Choosing the best motion", "Bringing to life", "Measuring"),
    ]
    assert stages(caplog.records) == expected
    begun = [r.getMessage() for r in caplog.records if r.levelno == logging.DEBUG]
    assert begun == [f"{name} …" for name in expected]
    assert {record.name for record in caplog.records} == {"oncue"}
    # What is said is true: the seconds are those of the report.
    said = next(r.getMessage() for r in caplog.records if r.getMessage().startswith("Optimizing: "))
    assert float(said.split()[1]) == pytest.approx(synthesis.report["seconds"]["optimize"], abs=0.05)


def test_a_record_tells_when_and_where_it_was_written(caplog):
    hand_over()
    with caplog.at_level(logging.INFO, logger="oncue"):
        job = oncue_core.index_scene(*room_with_a_bench())
        time.sleep(1.0)
        asked = time.time()
        job.result()
    (record,) = caplog.records
    assert record.created < asked - 0.1
    assert 0 <= record.msecs < 1000
    assert record.pathname.endswith("progress.rs")
    assert record.lineno > 0


def test_nothing_is_said_that_nobody_wants(caplog):
    with caplog.at_level(logging.WARNING, logger="oncue"):
        hand_over()
    assert not caplog.records


def test_captures_that_are_left_out_are_warned_of(tmp_path, caplog):
    # A percent sign or a brace in a name is no format.
    (tmp_path / "100%s {broken}.bvh").write_text("HIERARCHY nothing")
    (tmp_path / "empty.bvh").write_text("")
    with caplog.at_level(logging.WARNING, logger="oncue"), pytest.raises(oncue_core.InputError) as refused:
        oncue_core.build_library([tmp_path]).result()
    said = [record.getMessage() for record in caplog.records]
    assert len(said) == 3
    for name, line in zip(("100%s {broken}.bvh", "empty.bvh"), said, strict=False):
        assert line.startswith(f"{tmp_path / name} is left out: "), line
    assert said[2] == str(refused.value)


def test_a_cancelled_job_says_where_it_was(caplog):
    hand_over()
    with caplog.at_level(logging.INFO, logger="oncue"):
        job = oncue_core.index_scene(*terrain(300))
        job.cancel()
        with pytest.raises(oncue_core.Cancelled):
            job.result()
    said = [record.getMessage() for record in caplog.records]
    assert stages(caplog.records) == ["Indexing the scene"]
    assert said[-1] == "Cancelled."


def test_a_filter_that_raises_is_heard(caplog):
    hand_over()

    def refuse(_record):
        raise LookupError("from the filter")

    logger = logging.getLogger("oncue")
    logger.addFilter(refuse)
    try:
        with caplog.at_level(logging.INFO, logger="oncue"), pytest.raises(LookupError, match="from the filter"):
            hand_over()
    finally:
        logger.removeFilter(refuse)
    hand_over()


def test_a_handler_may_ask_the_job_itself():
    """As a handler that shows the progress would: it is called while the log is handed over."""
    jobs, seen = [], []

    class Asking(logging.Handler):
        def emit(self, record):
            seen.append((record.getMessage(), jobs[-1].progress()["stage"], jobs[-1].done()))

    logger, handler = logging.getLogger("oncue"), Asking()
    hand_over()
    logger.addHandler(handler)
    logger.setLevel(logging.INFO)
    try:
        jobs.append(oncue_core.index_scene(*terrain(100)))
        jobs[-1].result()
    finally:
        logger.removeHandler(handler)
        logger.setLevel(logging.NOTSET)
    ((message, stage, done),) = seen
    assert message.startswith("Indexing the scene: ")
    assert stage == "Indexing the scene"
    assert done


def test_a_job_ends_though_the_interpreter_is_held():
    """No thread of the core waits for the interpreter: the work ends while a thread of Python never lets go of it."""
    code = """
        import logging, sys, time
        import oncue_core
        from tests.core.geometry import terrain

        logging.basicConfig(level=logging.DEBUG, stream=sys.stdout, format="%(message)s")
        oncue_core.index_scene(*terrain(100)).result()
        job = oncue_core.index_scene(*terrain(100))
        sys.setswitchinterval(1000)
        began = time.monotonic()
        # Pure Python that never blocks and is never asked to let go.
        while time.monotonic() - began < 3:
            pass
        sys.setswitchinterval(0.005)
        print("done" if job.done() else "held up")
        oncue_core.index_scene(*terrain(400))
        print("over", flush=True)
    """
    # The last job is at work when Python goes, and that neither holds nor breaks the exit.
    command = [sys.executable, "-c", textwrap.dedent(code)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert "done" in lines
    assert lines[-1] == "over"


def test_many_threads_that_ask_lose_and_double_nothing(caplog):
    hand_over()
    scene = terrain(40)
    with caplog.at_level(logging.INFO, logger="oncue"):
        jobs = [oncue_core.index_scene(*scene) for _ in range(20)]

        def ask():
            for job in jobs:
                assert job.wait(60)
                job.progress()

        threads = [threading.Thread(target=ask) for _ in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(60)
        assert not any(thread.is_alive() for thread in threads)
    assert stages(caplog.records) == ["Indexing the scene"] * 20
