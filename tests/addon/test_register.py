"""Enabling and disabling, once, twice and when something fails."""

import bpy
import pytest


def ours():
    """Names of Blender's classes, handlers and properties that are the extension's."""
    classes = [name for name in dir(bpy.types) if name.startswith("ONCUE_")]
    handlers = [
        function.__name__
        for event in dir(bpy.app.handlers)
        if isinstance(getattr(bpy.app.handlers, event), list)
        for function in getattr(bpy.app.handlers, event)
        if "oncue" in function.__module__ or function.__module__.startswith("addon")
    ]
    return classes, handlers, hasattr(bpy.types.Scene, "oncue")


def test_register_and_unregister_twice(oncue):
    before = ours()
    assert len(before[0]) > 10
    assert len(before[1]) > 3
    assert before[2]
    oncue.package.register()
    assert ours() == before
    oncue.package.unregister()
    assert ours() == ([], [], False)
    oncue.package.unregister()
    oncue.package.register()
    assert ours() == before


def test_a_failure_leaves_nothing_behind(oncue, monkeypatch):
    oncue.package.unregister()
    try:
        with monkeypatch.context() as patch:
            patch.setattr(oncue("panels"), "register", lambda: 1 / 0)
            with pytest.raises(ZeroDivisionError):
                oncue.package.register()
        assert ours() == ([], [], False)
    finally:
        oncue.package.register()


def test_settings_survive_saving(context, tmp_path):
    settings = context.scene.oncue
    settings.seed, settings.start_frame, settings.preset = 7, 101, "paper"
    settings.library_paths.add().path = "/mocap"
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    assert bpy.context.scene.oncue.seed == 1
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "a.blend"))
    settings = bpy.context.scene.oncue
    assert (settings.seed, settings.start_frame, settings.preset) == (7, 101, "paper")
    assert settings.library_paths[0].path == "/mocap"


def test_without_the_core_the_extension_says_what_is_missing(oncue, context, monkeypatch):
    native = oncue("native")
    monkeypatch.setattr(native, "MISSING", "Oncue's core could not be loaded (test).")
    monkeypatch.setattr(native, "core", native._Missing())
    with pytest.raises(oncue("errors").SceneError, match="could not be loaded"):
        native.core.skeleton()
    assert native.preset_names() == ["default"]
    assert native.expected_errors() == (oncue("errors").SceneError, OSError)
    with pytest.raises(RuntimeError, match="core could not be loaded"):
        bpy.ops.oncue.synthesize()
