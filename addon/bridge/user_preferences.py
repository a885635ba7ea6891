# SPDX-License-Identifier: GPL-3.0-or-later
"""What the user chose in the preferences of the extension."""

from __future__ import annotations

import bpy

#: The extension's own name.
PACKAGE = __package__.rpartition(".")[0]


def get(context: bpy.types.Context) -> bpy.types.AddonPreferences | None:
    """The preferences, or None when the extension runs from its source folder."""
    entry = context.preferences.addons.get(PACKAGE)
    return entry.preferences if entry else None
