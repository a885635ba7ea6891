# SPDX-License-Identifier: GPL-3.0-or-later
"""What is found out of files before any work."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

from .errors import SceneError


def check_writable(path: Path) -> None:
    """Finds out before the work that `path` cannot be written. Raises SceneError; leaves nothing behind."""
    folder = path.resolve().parent
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
        if path.exists():
            with path.open("ab"):
                pass
    except OSError as error:
        raise SceneError(f"{path} cannot be written: {error.strerror}.") from error


def write_whole(path: Path, text: str) -> None:
    """Writes a file whole or not at all. Raises SceneError."""
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        part.write_text(text, encoding="utf-8")
        part.replace(path)
    except OSError as error:
        part.unlink(missing_ok=True)
        raise SceneError(f"{path} cannot be written: {error.strerror}.") from error
