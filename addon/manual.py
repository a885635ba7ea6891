# SPDX-License-Identifier: GPL-3.0-or-later
"""*Online Manual* in the context menus of Oncue's buttons and settings: the page that comes with the extension."""

from __future__ import annotations

import re
from pathlib import Path

import bpy

PAGE = Path(__file__).with_name("manual.html")
#: What Blender calls an operator and a setting, by which the page is asked.
NAMES = ("bpy.ops.oncue.{}", "bpy.types.oncuesettings.{}")


def manual_map() -> tuple[str, tuple[tuple[str, str], ...]]:
    """Where the page lies, and (name of Blender's, place on the page) of all that it tells of."""
    places = re.findall(r'<dt id="(\w+)"', PAGE.read_text(encoding="utf-8"))
    return PAGE.as_uri(), tuple((name.format(place), f"#{place}") for place in places for name in NAMES)


def register() -> None:
    bpy.utils.register_manual_map(manual_map)


def unregister() -> None:
    bpy.utils.unregister_manual_map(manual_map)
