# SPDX-License-Identifier: GPL-3.0-or-later
"""The takes of a character: the actions that runs have made for it, which are played, kept, copied and thrown away."""

from __future__ import annotations

import bpy
import numpy as np
from mathutils import Matrix

from ..errors import SceneError
from . import compat
from .bones import keyed_channels, put_to_rest
from .names import REPORT_KEY, TAKE_OF_KEY
from .root_motion import stand_of
from .things import copy_things, discard_things, play_things

#: A strip of the NLA lies on a track of this name.
TRACK = "Oncue"


def takes_of(character: bpy.types.Object | None) -> list[bpy.types.Action]:
    """The takes that were made for a character, by name; those of an older Oncue, where one slot of theirs is its."""
    if character is None:
        return []
    return [action for action in bpy.data.actions if REPORT_KEY in action and _is_of(action, character)]


def _is_of(action: bpy.types.Action, character: bpy.types.Object) -> bool:
    if TAKE_OF_KEY in action:
        return action[TAKE_OF_KEY] == character
    return bool(compat.SLOTTED_ACTIONS) and compat.played_slot(character, action) is not None


def take_named(character: bpy.types.Object | None, name: str) -> bpy.types.Action:
    """Raises SceneError where the character has no such take."""
    action = bpy.data.actions.get(name)
    if action is None or action not in takes_of(character):
        whose = character.name if character is not None else "The scene"
        raise SceneError(f"{whose} has no take {name}: choose one of the list.")
    return action


def play_take(character: bpy.types.Object, action: bpy.types.Action | None) -> None:
    """Has the character play a take, or none; what it played stays in the file. Raises SceneError where it takes none.

    What the take does not key of its bones is at rest, whatever another one left there.
    """
    if not character.is_editable:
        raise SceneError(f"{character.name} is linked and cannot be changed: make a library override of it.")
    data = character.animation_data or character.animation_data_create()
    if data.use_tweak_mode:
        raise SceneError(
            f"{character.name} has a strip open in tweak mode, in which it takes no other action: leave it (Tab in the "
            "NLA editor)."
        )
    before, stood, played = keyed_channels(character), stand_of(character), data.action
    if data.action is not None:
        data.action.use_fake_user = True
    data.action = action
    if played != action:
        play_things(action, played)
    # Where the one before moved it along it stands again as it stood.
    if (stood != np.array(character.matrix_world)).any():
        character.matrix_world = Matrix(stood)
    if action is None:
        return
    compat.play_slot(character)
    names = {
        curve.data_path.split('"')[1] for curve in compat.action_curves(action, character) if '"' in curve.data_path
    }
    bones = [bone for bone in character.pose.bones if bone.name in names]
    if bones:
        put_to_rest(bones, before)


def discard_take(character: bpy.types.Object, action: bpy.types.Action) -> None:
    """Takes a take out of the file; a character that plays it plays the one before it in the list, or none.

    Raises SceneError where a strip still plays it, or it is linked.
    """
    if not action.is_editable:
        raise SceneError(f"{action.name} is linked and cannot be changed: make it local first (Object, Relations).")
    for thing in bpy.data.objects:
        data = thing.animation_data
        if data is not None and any(strip.action == action for track in data.nla_tracks for strip in track.strips):
            raise SceneError(f"{action.name} is played by a strip of {thing.name} in the NLA: delete that first.")
    data = character.animation_data
    if data is not None and data.action == action:
        takes = takes_of(character)
        others = [take for take in takes if take != action]
        before = takes.index(action) - 1
        play_take(character, others[max(before, 0)] if others else None)
    discard_things(action)
    bpy.data.actions.remove(action)


def copy_take(character: bpy.types.Object, action: bpy.types.Action) -> bpy.types.Action:
    """A copy of a take to work on, which the character plays."""
    copy = action.copy()
    copy.use_fake_user = True
    copy_things(action, copy)
    play_take(character, copy)
    return copy


def push_take(character: bpy.types.Object, action: bpy.types.Action) -> bpy.types.NlaStrip:
    """Puts a take into the NLA where it lies in time, with full influence, and has the character play no action over
    it. Raises SceneError where a strip lies there already."""
    data = character.animation_data or character.animation_data_create()
    slot = compat.played_slot(character, action) if compat.SLOTTED_ACTIONS else None
    begins = int(action.frame_range[0])
    tracks = [track for track in data.nla_tracks if track.name.split(".")[0] == TRACK]
    for track in tracks:
        if any(strip.frame_start < action.frame_range[1] and begins < strip.frame_end for strip in track.strips):
            continue
        break
    else:
        track = data.nla_tracks.new()
        track.name = TRACK
    play_take(character, None)
    # What is carried is keyed on the scene's own frames, where the strip lies.
    play_things(action, None)
    strip = track.strips.new(action.name, begins, action)
    if slot is not None:
        strip.action_slot = slot
    # A strip that Python makes may come with none.
    strip.influence = 1.0
    strip.blend_type, strip.extrapolation = "REPLACE", "HOLD"
    return strip
