# SPDX-License-Identifier: GPL-3.0-or-later
"""How this Blender starts a second one that reads captures for it."""

from __future__ import annotations

import sys
from pathlib import Path

import bpy

from ..foreign_captures import SecondBlender
from . import compat, user_preferences

SCRIPT = Path(__file__).resolve().parents[1] / "read_captures.py"


def second_blender() -> SecondBlender:
    """With factory settings, so that nothing of the user's comes between; it keeps its captures beside the policies."""
    quiet = ("--background", "--factory-startup", "--python", str(SCRIPT), "--")
    # As a module of Python, Blender has no program of its own.
    command = (bpy.app.binary_path, *quiet) if bpy.app.binary_path else (sys.executable, str(SCRIPT))
    return SecondBlender(command, compat.BLENDER_VERSION, user_preferences.folder("captures"))
