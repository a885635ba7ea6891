# SPDX-License-Identifier: GPL-3.0-or-later
"""What differs between Blender 4.2 and 5.2. Nothing else in the extension asks for the version."""

from __future__ import annotations

import bpy

#: Blender 4.4 put action slots between an action and what it moves.
SLOTTED_ACTIONS = bpy.app.version >= (4, 4, 0)
#: Blender 5.0 removed `action.fcurves` and gave `fcurves.new` its `group_name`.
CHANNELBAG_GROUP_NAMES = bpy.app.version >= (5, 0, 0)
#: Blender 5.0 moved the selection from the bone to the pose bone.
SELECTED_POSE_BONES = bpy.app.version >= (5, 0, 0)
#: Blender 5.0 asks for the media type before the file format.
MEDIA_TYPES = bpy.app.version >= (5, 0, 0)

#: From 4.5 on a path property says itself that it may begin with `//`.
RELATIVE_PATHS = {"PATH_SUPPORTS_BLEND_RELATIVE"} if bpy.app.version >= (4, 5, 0) else set()

BLENDER_VERSION = bpy.app.version_string


class CurveSet:
    """The F-curves of one action for one object."""

    def __init__(self, action: bpy.types.Action, owner: bpy.types.Object) -> None:
        self.slot = None
        if SLOTTED_ACTIONS:
            self.slot = action.slots.new(id_type="OBJECT", name=owner.name)
            strip = action.layers.new("Oncue").strips.new(type="KEYFRAME")
            self._holder = strip.channelbag(self.slot, ensure=True)
        else:
            self._holder = action

    def new(self, data_path: str, index: int, group: str) -> bpy.types.FCurve:
        """A new F-curve for one channel, shown under `group`."""
        if not SLOTTED_ACTIONS:
            return self._holder.fcurves.new(data_path, index=index, action_group=group)
        if CHANNELBAG_GROUP_NAMES:
            return self._holder.fcurves.new(data_path, index=index, group_name=group)
        curve = self._holder.fcurves.new(data_path, index=index)
        curve.group = self._holder.groups.get(group) or self._holder.groups.new(group)
        return curve


def assign_action(owner: bpy.types.Object, action: bpy.types.Action, curves: CurveSet) -> None:
    """Makes `action` the one that moves `owner`, through its slot where there are slots.

    The view layer of a freshly linked object must have been updated: 4.5 and 5.0 crash otherwise.
    """
    data = owner.animation_data or owner.animation_data_create()
    data.action = action
    if curves.slot is not None:
        data.action_slot = curves.slot


def replace_action(owner: bpy.types.Object, action: bpy.types.Action) -> None:
    """Makes `action`, which has the slots of the one that moves `owner`, take its place."""
    data = owner.animation_data
    slot = data.action_slot.identifier if SLOTTED_ACTIONS and data.action_slot else None
    data.action = action
    if SLOTTED_ACTIONS:
        data.action_slot = next((s for s in action.slots if s.identifier == slot), action.slots[0])


def played_slot(owner: bpy.types.Object, action: bpy.types.Action):
    """The slot through which an action moves `owner`, or would: its own, its namesake's, or the only one for objects.

    A renamed object plays nothing of an action that is chosen anew, for whose slot has the old name. None without any.
    """
    data = owner.animation_data
    if data is not None and data.action == action and data.action_slot is not None:
        return data.action_slot
    fitting = [slot for slot in action.slots if slot.target_id_type in {"OBJECT", "UNSPECIFIED"}]
    namesakes = [slot for slot in fitting if slot.name_display == owner.name]
    chosen = namesakes or fitting
    return chosen[0] if len(chosen) == 1 else None


def play_slot(owner: bpy.types.Object) -> None:
    """Has `owner` play its action where it has one, but no slot of it."""
    data = owner.animation_data
    if SLOTTED_ACTIONS and data is not None and data.action is not None and data.action_slot is None:
        slot = played_slot(owner, data.action)
        if slot is not None:
            data.action_slot = slot


def action_curves(action: bpy.types.Action, owner: bpy.types.Object | None = None) -> list[bpy.types.FCurve]:
    """The F-curves of an action that move `owner`; without one all of them, whichever slot they belong to."""
    return [curve for holder in _holders(action, owner) for curve in holder.fcurves]


def object_slots(action: bpy.types.Action) -> list:
    """The slots of an action through which objects can play it; one that is None before there were slots."""
    if not SLOTTED_ACTIONS:
        return [None] if action.id_root in {"OBJECT", "UNSPECIFIED"} or not action.id_root else []
    return [slot for slot in action.slots if slot.target_id_type in {"OBJECT", "UNSPECIFIED"}]


def slot_curves(action: bpy.types.Action, slot) -> list[bpy.types.FCurve]:
    """The F-curves of one of an action's `object_slots`."""
    if slot is None:
        return list(action.fcurves)
    bags = [bag for layer in action.layers for strip in layer.strips for bag in strip.channelbags]
    return [curve for bag in bags if bag.slot_handle == slot.handle for curve in bag.fcurves]


def play(owner: bpy.types.Object, action: bpy.types.Action, slot) -> None:
    """Has `owner`, which has animation data, play an action through one of its `object_slots`."""
    owner.animation_data.action = action
    if slot is not None:
        owner.animation_data.action_slot = slot


def remove_curve(action: bpy.types.Action, owner: bpy.types.Object, curve: bpy.types.FCurve) -> None:
    """Takes an F-curve that moves `owner` out of an action."""
    for holder in _holders(action, owner):
        if any(other == curve for other in holder.fcurves):
            holder.fcurves.remove(curve)
            return


def _holders(action: bpy.types.Action, owner: bpy.types.Object | None) -> list:
    """What holds the F-curves of `owner`, or all: the channelbags, before there were slots the action itself."""
    if not SLOTTED_ACTIONS:
        return [action]
    slot = played_slot(owner, action) if owner is not None else None
    return [
        bag
        for layer in action.layers
        for strip in layer.strips
        for bag in strip.channelbags
        if owner is None or (slot is not None and bag.slot_handle == slot.handle)
    ]


def data_paths(action: bpy.types.Action) -> set[str]:
    """What the F-curves of an action move, of all its slots."""
    return {curve.data_path for curve in action_curves(action)}


def is_selected(bone: bpy.types.PoseBone) -> bool:
    return bone.select if SELECTED_POSE_BONES else bone.bone.select


def select_bone(bone: bpy.types.PoseBone, selected: bool) -> None:
    if SELECTED_POSE_BONES:
        bone.select = selected
    else:
        bone.bone.select = selected


def use_png(image_settings: bpy.types.ImageFormatSettings) -> None:
    """Still pictures, 8 bit RGB."""
    if MEDIA_TYPES:
        image_settings.media_type = "IMAGE"
    image_settings.file_format = "PNG"
    image_settings.color_mode = "RGB"


def use_video(render: bpy.types.RenderSettings) -> None:
    """H264 in an .mp4."""
    if MEDIA_TYPES:
        render.image_settings.media_type = "VIDEO"
    render.image_settings.file_format = "FFMPEG"
    render.ffmpeg.format = "MPEG4"
    render.ffmpeg.codec = "H264"
    render.ffmpeg.constant_rate_factor = "MEDIUM"
