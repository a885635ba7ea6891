# SPDX-License-Identifier: GPL-3.0-or-later
"""Preferences of the extension."""

from __future__ import annotations

import bpy
from bpy.props import FloatVectorProperty, StringProperty

from . import native


class OncuePreferences(bpy.types.AddonPreferences):
    bl_idname = __package__

    mocap_folder: StringProperty(
        name="Mocap Folder",
        description="Where the file browser opens for motion capture",
        subtype="DIR_PATH",
        default="",
    )
    ghost_color: FloatVectorProperty(
        name="Seated Figure",
        description="Colour of the figure drawn at a sit cue",
        subtype="COLOR",
        size=4,
        min=0.0,
        max=1.0,
        default=(0.95, 0.55, 0.15, 0.9),
    )

    def draw(self, _context) -> None:
        layout = self.layout
        layout.use_property_split = True
        layout.prop(self, "mocap_folder")
        layout.prop(self, "ghost_color")
        layout.label(
            text=native.MISSING or f"Core {native.core.__version__}", icon="ERROR" if native.MISSING else "CHECKMARK"
        )


def get(context: bpy.types.Context) -> OncuePreferences | None:
    """The preferences, or None when the extension runs from its source folder."""
    entry = context.preferences.addons.get(__package__)
    return entry.preferences if entry else None


register, unregister = bpy.utils.register_classes_factory((OncuePreferences,))
