# SPDX-License-Identifier: GPL-3.0-or-later
"""Putting a character back into the state in which it plays a motion as it was made: what `file_state` asks for."""

from __future__ import annotations

import math

import bpy
from mathutils import Matrix

from . import compat
from .bones import (
    bending_constraints,
    carriers,
    clear_channel,
    driven_bones,
    is_keyed,
    keyed_channels,
    leftovers,
    unwritten,
)
from .file_state import scale_fault
from .scene_time import may_move


def reset_character(context: bpy.types.Context, character: bpy.types.Object, skeleton: dict) -> None:
    """Mutes rather than deletes, and keeps where the character stands and faces. Needs an editable object."""
    names = list(skeleton["names"])
    if character.mode == "EDIT" and context.active_object == character:
        bpy.ops.object.mode_set(mode="OBJECT")
    character.data.pose_position = "POSE"
    if character.animation_data is not None:
        _reset_animation(character.animation_data, names, carriers([character.pose.bones[names[0]]]))
    _reset_bones(character, names)
    context.view_layer.update()
    if scale_fault(character, context.scene.oncue.scene_scale) or may_move(character, own_action=False):
        _stand_freely(context, character)
    context.view_layer.update()


def _reset_animation(data: bpy.types.AnimData, names: list[str], over: list[str]) -> None:
    data.use_tweak_mode = False
    data.action_influence, data.action_blend_type = 1.0, "REPLACE"
    for track in data.nla_tracks:
        track.is_solo = False
        if any(strip.action and unwritten(compat.data_paths(strip.action), names, over) for strip in track.strips):
            track.mute = True
    for driver in driven_bones(data, [*names, *over]):
        driver.mute = True
    for driver in data.drivers:
        if ".constraints[" in driver.data_path and driver.data_path.endswith("].mute"):
            driver.mute = True


def _reset_bones(character: bpy.types.Object, names: list[str]) -> None:
    bones = [character.pose.bones[name] for name in names]
    keyed = keyed_channels(character)
    for bone in bones:
        bone.rotation_mode = "QUATERNION"
        bone.bone.use_inherit_rotation = bone.bone.use_local_location = True
    for _, constraint in bending_constraints(bones):
        constraint.mute = True
    for bone, channel, _ in leftovers(bones):
        if not is_keyed(keyed, bone, channel):
            clear_channel(bone, channel)


def _stand_freely(context: bpy.types.Context, character: bpy.types.Object) -> None:
    """A person's size at the same place, hanging on nothing."""
    place = character.matrix_world.translation.copy()
    forward = character.matrix_world.to_3x3().col[1]
    yaw = math.atan2(forward.y, forward.x) - math.pi / 2
    for constraint in character.constraints:
        constraint.mute = True
    data = character.animation_data
    if data is not None:
        for driver in data.drivers:
            if not driver.data_path.startswith("pose."):
                driver.mute = True
        for track in data.nla_tracks:
            if any(strip.action and _moves_object(strip.action) for strip in track.strips):
                track.mute = True
    character.parent = None
    if not all(math.isfinite(c) for c in (*place, yaw)):
        place, yaw = (0.0, 0.0, 0.0), 0.0
    character.matrix_world = (
        Matrix.Translation(place)
        @ Matrix.Rotation(yaw, 4, "Z")
        @ Matrix.Scale(1.0 / context.scene.oncue.scene_scale, 4)
    )


def _moves_object(action: bpy.types.Action) -> bool:
    return any(not path.startswith("pose.") for path in compat.data_paths(action))
