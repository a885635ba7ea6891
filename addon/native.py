# SPDX-License-Identifier: GPL-3.0-or-later
"""The one file that faces the compiled core."""

from __future__ import annotations

try:
    import oncue_core as core
except ImportError as error:  # the extension still loads, and says what is missing
    core = None
    MISSING = f"Oncue's core could not be loaded ({error}): install the extension's archive for this platform."
else:
    MISSING = ""

from .errors import SceneError


def require():
    """The module `oncue_core`. Raises SceneError where it could not be loaded."""
    if core is None:
        raise SceneError(MISSING)
    return core


def expected_errors() -> tuple[type[BaseException], ...]:
    """What a run may raise that is no bug: its text is a sentence for the artist."""
    return (SceneError, OSError, core.OncueError) if core else (SceneError, OSError)


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
    return core is not None and isinstance(error, core.Cancelled)


def preset_names() -> list[str]:
    return list(core.presets()) if core else ["default"]
