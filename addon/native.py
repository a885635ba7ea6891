# SPDX-License-Identifier: GPL-3.0-or-later
"""The one file that faces the compiled core."""

from __future__ import annotations

from types import ModuleType
from typing import NoReturn

from .errors import SceneError

__all__ = ["MISSING", "core", "expected_errors", "is_cancelled", "preset_names", "require", "sentence"]


class _Missing:
    """Stands where the core could not be loaded: whatever is asked of it, it says so."""

    def __getattr__(self, _name: str) -> NoReturn:
        raise SceneError(MISSING)


#: Why the core could not be loaded; empty where it was.
MISSING = ""
try:
    import oncue_core as core
except ImportError as error:  # the extension still loads, and says what is missing
    MISSING = f"Oncue's core could not be loaded ({error}): install the extension's archive for this platform."
    core = _Missing()  # type: ignore[assignment]  # no module, but nothing of the module's is ever got from it


def require() -> ModuleType:
    """The core. Raises SceneError where it could not be loaded, before anything else is asked or read."""
    if MISSING:
        raise SceneError(MISSING)
    return core


def expected_errors() -> tuple[type[BaseException], ...]:
    """What a run may raise that is no bug: its text is a sentence for the artist."""
    return (SceneError, OSError) if MISSING else (SceneError, OSError, core.OncueError)


def sentence(error: BaseException) -> str:
    """What an expected error says to the artist."""
    if isinstance(error, OSError) and error.filename:
        return f"{error.filename}: {error.strerror or error}."
    return str(error)


def bug_sentence(error: BaseException) -> str:
    """What is said of an error that nobody expected, as the end of a sentence."""
    lines = str(error).strip().splitlines()
    said = f": {lines[-1][:200].rstrip('.')}" if lines else ""
    return f"an error of Oncue's own ({type(error).__name__}{said})."


def is_cancelled(error: BaseException) -> bool:
    return not MISSING and isinstance(error, core.Cancelled)


def preset_names() -> list[str]:
    return ["default"] if MISSING else core.presets()
