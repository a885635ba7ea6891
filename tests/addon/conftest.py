"""Oncue in Blender's Python module: the installed extension where ONCUE_EXTENSION names its archive, else the source.

Every test begins with an empty file.
"""

import importlib
import os
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[2]
# What makes scenes and people for tests and pictures.
sys.path.insert(0, str(ROOT / "blend_fixtures"))
# Preferences and extensions of the tests' own; Blender reads this when it is imported.
os.environ.setdefault("BLENDER_USER_RESOURCES", tempfile.mkdtemp(prefix="oncue-blender-"))

import pytest  # noqa: E402

bpy = pytest.importorskip("bpy", reason="these tests need Blender's Python module")


class Oncue:
    """The registered package, and its modules by their names."""

    def __init__(self, package) -> None:
        self.package = package

    def __call__(self, name: str):
        return importlib.import_module(f"{self.package.__name__}.{name}")


@pytest.fixture(scope="session")
def oncue():
    """The registered extension: `oncue("bridge.session")` is that module."""
    archive = os.environ.get("ONCUE_EXTENSION")
    if archive:
        bpy.ops.extensions.package_install_files(
            filepath=archive, repo="user_default", enable_on_install=True, overwrite=True
        )
        package = sys.modules["bl_ext.user_default.oncue"]
    else:
        sys.path.insert(0, str(ROOT))
        package = importlib.import_module("addon")
        package.register()
    yield Oncue(package)
    # Some Blenders crash or hang at exit while classes and handlers are registered.
    package.unregister()


@pytest.fixture
def core(oncue):
    """The compiled core."""
    return oncue("native").core


@pytest.fixture(autouse=True)
def context(oncue):
    """A fresh, empty file."""
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    oncue("job_operator").handle.forget()
    return bpy.context


@pytest.fixture(scope="session")
def fixtures():
    """The module that makes the task scenes."""
    sys.path.insert(0, str(ROOT / "blend_fixtures"))
    return importlib.import_module("make_fixtures")


EXIT_STATUS = pytest.StashKey[int]()


def pytest_sessionfinish(session, exitstatus):
    session.config.stash[EXIT_STATUS] = int(exitstatus)


@pytest.hookimpl(trylast=True)
def pytest_unconfigure(config):
    """Ends the process as the tests did: Blender 4.2's module can crash while Python takes it down after them."""
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(config.stash.get(EXIT_STATUS, 1))
