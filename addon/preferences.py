# SPDX-License-Identifier: GPL-3.0-or-later
"""Preferences of the extension."""

from __future__ import annotations

import bpy
from bpy.props import FloatVectorProperty, IntProperty, StringProperty

from . import log, native
from .bridge import user_preferences
from .bridge.compat import BLENDER_VERSION
from .bridge.policies import policy_cache


def _keep_log(chosen: OncuePreferences, _context) -> None:
    log.log_file.open(bpy.path.abspath(chosen.log_file), blender=BLENDER_VERSION)


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

    policy_limit: IntProperty(
        name="Kept Policies",
        description="Megabytes of optimized policies that are kept for scenes that were hard; the oldest go first",
        min=0,
        max=10_000,
        default=200,
        subtype="NONE",
    )

    log_file: StringProperty(
        name="Log File",
        description="Where Oncue writes what it does, to be sent along with a question; empty for nowhere",
        subtype="FILE_PATH",
        default="",
        update=_keep_log,
    )

    def draw(self, context) -> None:
        layout = self.layout
        layout.use_property_split = True
        layout.prop(self, "mocap_folder")
        layout.prop(self, "ghost_color")
        layout.prop(self, "policy_limit")
        layout.prop(self, "log_file")
        if log.log_file.fault:
            layout.label(text=log.log_file.fault, icon="ERROR")
        entries = policy_cache(context).entries()
        for entry in entries:
            row = layout.row()
            row.label(text=f"{entry.describe()}, {entry.bytes / 1e6:.1f} MB", icon="FILE_CACHE")
            row.operator("oncue.clear_policies", text="", icon="X").file = entry.path.name
        if entries:
            layout.operator("oncue.clear_policies", icon="TRASH")
        layout.operator("oncue.open_guide", icon="HELP")
        layout.label(
            text=native.MISSING or f"Core {native.core.__version__}", icon="ERROR" if native.MISSING else "CHECKMARK"
        )


def register() -> None:
    bpy.utils.register_class(OncuePreferences)
    chosen = user_preferences.get(bpy.context)
    if chosen and chosen.log_file:
        _keep_log(chosen, bpy.context)


def unregister() -> None:
    log.log_file.close()
    bpy.utils.unregister_class(OncuePreferences)
