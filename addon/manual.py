# SPDX-License-Identifier: GPL-3.0-or-later
"""*Online Manual* in the context menus of Oncue's buttons and settings, and the guide: pages that come with it."""

from __future__ import annotations

import re
from pathlib import Path

import bpy

from .errors import SceneError

PAGE = Path(__file__).with_name("manual.html")
#: The guide in the archive, made of docs/guide by tools/guide_pages.py; without an archive that itself is shown.
GUIDE, SOURCES = Path(__file__).with_name("guide"), Path(__file__).parents[1] / "docs" / "guide"
#: The page that lists the others.
INDEX = "index"
#: What Blender calls an operator and a setting, by which the page is asked.
NAMES = ("bpy.ops.oncue.{}", "bpy.types.oncuesettings.{}")


def manual_map() -> tuple[str, tuple[tuple[str, str], ...]]:
    """Where the page lies, and (name of Blender's, place on the page) of all that it tells of."""
    places = re.findall(r'<dt id="(\w+)"', PAGE.read_text(encoding="utf-8"))
    return PAGE.as_uri(), tuple((name.format(place), f"#{place}") for place in places for name in NAMES)


def guide_page(name: str) -> Path:
    """The file of a page of the guide. Raises SceneError where it is not there."""
    pages = (GUIDE / f"{name}.html", SOURCES / f"{'README' if name == INDEX else name}.md")
    found = next((page for page in pages if page.is_file()), None)
    if found is None:
        raise SceneError(f"The guide's page {name} is not there: install Oncue again.")
    return found


def register() -> None:
    bpy.utils.register_manual_map(manual_map)


def unregister() -> None:
    bpy.utils.unregister_manual_map(manual_map)
