# SPDX-License-Identifier: GPL-3.0-or-later
"""Kept policies in the preferences: thrown away on demand."""

from __future__ import annotations

import bpy
from bpy.props import StringProperty

from ..bridge.policies import policy_cache
from .button import Button


class ONCUE_OT_clear_policies(Button, bpy.types.Operator):
    """Throw kept policies away; a scene that needed one optimizes it anew"""

    bl_idname = "oncue.clear_policies"
    bl_label = "Delete Kept Policies"
    bl_options = {"INTERNAL"}

    file: StringProperty(name="File", description="One policy's file name; empty for all", options={"SKIP_SAVE"})

    def act(self, context: bpy.types.Context) -> None:
        count = policy_cache(context).clear(self.file)
        self.say({"INFO"}, "1 kept policy deleted." if count == 1 else f"{count} kept policies deleted.")


register, unregister = bpy.utils.register_classes_factory((ONCUE_OT_clear_policies,))
