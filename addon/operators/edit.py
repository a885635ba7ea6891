# SPDX-License-Identifier: GPL-3.0-or-later
"""Editing a take: pins, and solving it again."""

from __future__ import annotations

import bpy
from bpy.props import BoolProperty, IntProperty

from .. import native
from ..bridge import pins, session, solved
from ..bridge.puppet import is_own_skeleton
from ..errors import SceneError
from ..job_operator import JobOperator
from ..pipeline import EditOutcome, Steps, edit_steps
from .button import Button
from .synthesize import library_cache


class ONCUE_OT_pin(Button, bpy.types.Operator):
    """Pin the selected bones where they are now, so that Re-solve leaves them there"""

    bl_idname = "oncue.pin"
    bl_label = "Pin"

    over_range: BoolProperty(
        name="Over a Range", description="Ask for the frames", default=False, options={"SKIP_SAVE", "HIDDEN"}
    )
    first_frame: IntProperty(name="First Frame", description="From when on the bones stay there", options={"SKIP_SAVE"})
    last_frame: IntProperty(name="Last Frame", description="Until when the bones stay there", options={"SKIP_SAVE"})
    position: BoolProperty(name="Place", description="Hold where the bones are", default=True)
    rotation: BoolProperty(name="Turn", description="Hold how the bones are turned", default=True)

    @classmethod
    def description(cls, _context, properties) -> str:
        when = "over a range of frames" if properties.over_range else "at the current frame"
        return f"Pin the selected bones where they are now, {when}, so that Re-solve leaves them there"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if context.mode != "POSE" or context.active_object != context.scene.oncue.character:
            return cls.cannot("Select bones of the character in pose mode")
        return True

    def invoke(self, context: bpy.types.Context, _event) -> set[str]:
        if not self.over_range:
            return self.execute(context)
        now = context.scene.frame_current
        self.first_frame, self.last_frame = now, now + 30
        return context.window_manager.invoke_props_dialog(self)

    def act(self, context: bpy.types.Context) -> None:
        character = context.active_object
        if not is_own_skeleton(character, native.core.skeleton()):
            raise SceneError(
                f"{character.name} is a rig of your own, and pins hold bones of Oncue's character alone: key the bone."
            )
        now = context.scene.frame_current
        if not self.properties.is_property_set("first_frame"):
            self.first_frame = now
        if not self.properties.is_property_set("last_frame"):
            self.last_frame = self.first_frame
        pins.pin_bones(
            context,
            context.active_object,
            self.first_frame,
            self.last_frame,
            position=self.position,
            rotation=self.rotation,
            within=solved.motion_frames(pins.action_of(context.active_object)),
        )


class ONCUE_OT_remove_pins(Button, bpy.types.Operator):
    """Take all pins of this take out; keys stay keys, and Re-solve may change them again"""

    bl_idname = "oncue.remove_pins"
    bl_label = "Remove All Pins"

    def act(self, context: bpy.types.Context) -> None:
        pins.remove_pins(context.scene.oncue.character)


class ONCUE_OT_remove_pin(Button, bpy.types.Operator):
    """Take this pin out; a key stays a key, and Re-solve may change it again"""

    bl_idname = "oncue.remove_pin"
    bl_label = "Remove Pin"

    index: IntProperty(name="Pin", description="Its place in the list", min=0, options={"SKIP_SAVE"})

    def act(self, context: bpy.types.Context) -> None:
        pins.remove_pin(context.scene.oncue.character, self.index)


class ONCUE_OT_resolve(JobOperator, bpy.types.Operator):
    """Fit the motion around what you keyed and pinned: that stays, the frames around adapt. Esc cancels"""

    bl_idname = "oncue.resolve"
    bl_label = "Re-solve"
    bl_options = {"REGISTER", "UNDO"}
    title = "Re-solving"

    def begin(self, context: bpy.types.Context) -> Steps[EditOutcome]:
        self._request, self._take, self._said = session.read_edit(context)
        return edit_steps(self._request, library_cache)

    def finish(self, context: bpy.types.Context, value: EditOutcome) -> None:
        touched = session.write_edit(context, self._request, self._take, value, self._said)
        if touched is None:
            self.say({"INFO"}, "The motion already fits: nothing has changed.")
        else:
            self.say({"INFO"}, f"Frames {touched[0]} to {touched[1]} were adapted.")


register, unregister = bpy.utils.register_classes_factory(
    (ONCUE_OT_pin, ONCUE_OT_remove_pin, ONCUE_OT_remove_pins, ONCUE_OT_resolve)
)
