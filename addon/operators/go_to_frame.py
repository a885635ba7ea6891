# SPDX-License-Identifier: GPL-3.0-or-later
"""From a figure of the report to the frame that it is about."""

from __future__ import annotations

import bpy
from bpy.props import IntProperty

from ..properties import LAST_FRAME
from .button import Button


class ONCUE_OT_go_to_frame(Button, bpy.types.Operator):
    """Show the frame that this is about"""

    bl_idname = "oncue.go_to_frame"
    bl_label = "Go to Frame"
    bl_options = {"INTERNAL", "UNDO"}

    frame: IntProperty(name="Frame", description="The scene's frame to show", min=0, max=LAST_FRAME)

    def act(self, context: bpy.types.Context) -> None:
        context.scene.frame_set(self.frame)


register, unregister = bpy.utils.register_classes_factory((ONCUE_OT_go_to_frame,))
