"""The log file that the preferences name."""

import logging

import bpy
import pytest

from .runs import set_quick


@pytest.fixture
def choose(oncue):
    """Names the log file in the preferences; afterwards there is none."""
    preferences = oncue("bridge.user_preferences")
    if preferences.get(bpy.context) is None:
        pytest.skip("the extension is not installed, and has no preferences")

    def name(path):
        # Got anew each time: those of before an unregister are gone, and Blender crashes on them.
        preferences.get(bpy.context).log_file = str(path)

    yield name
    name("")


def test_a_run_is_written_to_the_file_until_it_is_no_longer_named(fixtures, choose, core, tmp_path):
    path = tmp_path / "oncue.log"
    path.write_text("an earlier line\n")
    choose(path)
    fixtures.stool_alone()
    set_quick(bpy.context.scene)
    bpy.ops.oncue.synthesize()
    lines = path.read_text().splitlines()
    assert lines[0] == "an earlier line"
    assert f"Blender {bpy.app.version_string}, " in lines[1]
    assert sum(" Indexing the scene: " in line for line in lines) == 1
    assert any("'action_type': 'sit'" in line for line in lines)
    choose("")
    bpy.ops.oncue.synthesize()
    assert path.read_text().splitlines() == lines
    assert logging.getLogger("oncue").level == logging.NOTSET


def test_a_refusal_and_a_bug_are_in_the_log(oncue, fixtures, choose, core, tmp_path, monkeypatch):
    path = tmp_path / "oncue.log"
    choose(path)
    fixtures.stool_alone()
    set_quick(bpy.context.scene)
    start = bpy.data.objects["Start"]
    start.hide_viewport = True
    with pytest.raises(RuntimeError, match="no Start cue"):
        bpy.ops.oncue.synthesize()
    assert " ERROR   There is no Start cue" in path.read_text().splitlines()[-1]
    start.hide_viewport = False
    monkeypatch.setattr(oncue("bridge.session"), "read_task", lambda *_: 1 / 0)
    with pytest.raises(RuntimeError, match="ZeroDivisionError"):
        bpy.ops.oncue.synthesize()
    text = path.read_text()
    assert text.count("Oncue ran into a bug of its own.") == 1
    assert "Traceback" in text
    # The traceback, then what the artist is told.
    traceback, _, told = text.partition("ZeroDivisionError: division by zero\n")
    assert traceback
    assert "Synthesizing ended by an error of Oncue's own (ZeroDivisionError: division by zero)." in told


def test_the_extension_goes_and_comes_with_its_log(oncue, choose, tmp_path):
    path = tmp_path / "oncue.log"
    choose(path)
    oncue.package.unregister()
    logging.getLogger("oncue").error("unheard")
    oncue.package.register()
    logging.getLogger("oncue").error("heard")
    assert "unheard" not in path.read_text()
    assert "heard" in path.read_text()


def test_a_file_that_cannot_be_written_is_told(oncue, choose, tmp_path):
    choose(tmp_path)
    assert str(tmp_path) in oncue("log").log_file.fault
    choose("")
    assert oncue("log").log_file.fault == ""
