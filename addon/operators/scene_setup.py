# SPDX-License-Identifier: GPL-3.0-or-later
"""What the scene means to the character: its scale, and what can be walked through."""

from __future__ import annotations

import bpy
from bpy.props import FloatProperty

from ..bridge import session
from ..bridge.names import EXCLUDE_KEY
from ..job_operator import handle
from .button import Button


class ONCUE_OT_set_scene_scale(Button, bpy.types.Operator):
    """Say how many metres a scene unit is; nothing in the scene changes"""

    bl_idname = "oncue.set_scene_scale"
    bl_label = "Set Scene Scale"

    scale: FloatProperty(
        name="Metres per Unit",
        description="1 for a scene in metres, 0.01 for centimetres",
        default=1.0,
        min=1e-4,
        max=1e4,
        options={"SKIP_SAVE"},
    )

    def act(self, context: bpy.types.Context) -> None:
        context.scene.oncue.scene_scale = self.scale
        handle.forget()


class ONCUE_OT_toggle_exclude(Button, bpy.types.Operator):
    """Let the character walk through the selected objects, or no longer"""

    bl_idname = "oncue.toggle_exclude"
    bl_label = "Exclude Selected"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return bool(context.selected_objects)

    def act(self, context: bpy.types.Context) -> None:
        chosen = context.selected_objects
        exclude = not all(thing.get(EXCLUDE_KEY) for thing in chosen)
        for thing in chosen:
            if exclude:
                thing[EXCLUDE_KEY] = True
            elif EXCLUDE_KEY in thing:
                del thing[EXCLUDE_KEY]
        names = ", ".join(thing.name for thing in chosen)
        self.say({"INFO"}, f"The character walks through {names}." if exclude else f"The character minds {names}.")


class ONCUE_OT_reset_character(Button, bpy.types.Operator):
    """Put the character back into the state in which it plays a motion as it is made: constraints and drivers muted, \
stray bones at rest, a person's size, at the same place"""

    bl_idname = "oncue.reset_character"
    bl_label = "Reset Character"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if context.scene.oncue.character is None:
            return cls.cannot("The scene has no character yet")
        return True

    def act(self, context: bpy.types.Context) -> None:
        session.reset_character(context)
        handle.forget()


CLASSES = (ONCUE_OT_set_scene_scale, ONCUE_OT_toggle_exclude, ONCUE_OT_reset_character)


register, unregister = bpy.utils.register_classes_factory(CLASSES)
