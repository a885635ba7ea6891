"""The types in `_native.pyi` are those of the compiled module."""

import os
import subprocess
import sys
from pathlib import Path

import oncue_core


def test_the_stub_matches_the_module(tmp_path):
    # Outside the repository, so that the installed package is compared and not its sources.
    command = [sys.executable, "-m", "mypy.stubtest", "--ignore-disjoint-bases", "oncue_core"]
    # Reading numpy's types takes mypy half a minute, once.
    cache = {**os.environ, "MYPY_CACHE_DIR": str(Path(__file__).parents[2] / ".mypy_cache")}
    done = subprocess.run(command, cwd=tmp_path, env=cache, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def test_everything_public_is_documented():
    for name in oncue_core.__all__:
        item = getattr(oncue_core, name)
        if callable(item):
            assert item.__doc__, name
        if isinstance(item, type):
            assert item.__module__.startswith("oncue_core")


def test_the_package_says_that_it_is_typed():
    assert (Path(oncue_core.__file__).parent / "py.typed").is_file()
