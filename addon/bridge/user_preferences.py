# SPDX-License-Identifier: GPL-3.0-or-later
"""What the user chose in the preferences of the extension."""

from __future__ import annotations

from pathlib import Path

import bpy

#: The extension's own name.
PACKAGE = __package__.rpartition(".")[0]


def get(context: bpy.types.Context) -> bpy.types.AddonPreferences | None:
    """The preferences, or None when the extension runs from its source folder."""
    entry = context.preferences.addons.get(PACKAGE)
    return entry.preferences if entry else None


def folder(name: str) -> Path:
    """Where the extension keeps something of its own for this user; it need not be there yet."""
    try:
        return Path(bpy.utils.extension_path_user(PACKAGE, path=name))
    except ValueError:  # not installed as an extension
        return Path(bpy.utils.user_resource("DATAFILES", path="oncue")) / name
