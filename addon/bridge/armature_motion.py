# SPDX-License-Identifier: GPL-3.0-or-later
"""The actions of any armature, each as the motion of its bones in the world."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass

import bpy
import numpy as np

from ..errors import SceneError
from ..mocap_writer import BoneMotion
from . import compat
from .scene_time import frame_rate

#: A key this near to a frame is on it.
ON_FRAME = 1e-3
#: Longer actions are nobody's take, frames.
MOST_FRAMES = 100_000
#: Fewer deforming bones are no body: then all bones are taken.
FEWEST_BONES = 10
BONE_PATH = re.compile(r'^pose\.bones\["((?:[^"\\]|\\.)*)"\]')


@dataclass(frozen=True)
class ArmatureAction:
    """An action that moves an armature, through one of its slots where there are slots."""

    armature: bpy.types.Object
    action: bpy.types.Action
    slot: object

    @property
    def name(self) -> str:
        """What it is called: the slot's name, too, where the action has several."""
        slots = len(self.action.slots) if compat.SLOTTED_ACTIONS else 0
        return f"{self.action.name} {self.slot.name_display}" if slots > 1 else self.action.name


def armature_actions(armature: bpy.types.Object) -> Iterator[ArmatureAction]:
    """The actions of the file that move the bones of an armature; not those that others alone play."""
    others = [thing for thing in bpy.data.objects if thing.type == "ARMATURE" and thing != armature]
    for action in bpy.data.actions:
        for slot in compat.object_slots(action):
            curves = compat.slot_curves(action, slot)
            paths = (BONE_PATH.match(curve.data_path) for curve in curves)
            moved = {bpy.utils.unescape_identifier(path[1]) for path in paths if path}
            known = moved & set(armature.pose.bones.keys())
            if len(known) * 2 <= len(moved) or _is_anothers(armature, others, action, slot):
                continue
            yield ArmatureAction(armature, action, slot)


def _is_anothers(armature: bpy.types.Object, others: list, action: bpy.types.Action, slot) -> bool:
    """Whether others play an action, or are named by its slot, and the armature is not."""
    if slot is not None and slot.name_display != armature.name and slot.name_display in {one.name for one in others}:
        return True
    return not _plays(armature, action) and any(_plays(one, action) for one in others)


def _plays(thing: bpy.types.Object, action: bpy.types.Action) -> bool:
    data = thing.animation_data
    return data is not None and (
        data.action == action or any(strip.action == action for track in data.nla_tracks for strip in track.strips)
    )


def bone_motion(scene: bpy.types.Scene, take: ArmatureAction) -> BoneMotion:
    """Where the bones are in the world while a take plays in `scene`, alone; the scene stays at its last frame.

    Changes what the armature plays. Raises SceneError for an action that has no length, or too much.
    """
    armature, action = take.armature, take.action
    first, last = _frames(take)
    if not first < last <= first + MOST_FRAMES:
        count = f"{last - first + 1} frame{'s' * (last != first)}"
        raise SceneError(f"its action ‘{take.name}’ has {count}; from 2 to {MOST_FRAMES} are read.")
    data = armature.animation_data_create() if armature.animation_data is None else armature.animation_data
    if data.action != action:
        # What the action does not key is at rest, whatever another one left there.
        for bone in armature.pose.bones:
            bone.matrix_basis.identity()
    armature.data.pose_position = "POSE"
    data.use_nla = False
    compat.play(armature, action, take.slot)
    _play_along(armature, action)
    bones = body_bones(armature)
    parents = parents_among(bones)
    layer = scene.view_layers[0]
    heads, turns = np.empty((last - first + 1, len(bones), 3)), np.empty((last - first + 1, len(bones), 3, 3))
    rest = None
    for row, frame in enumerate(range(first, last + 1)):
        scene.frame_set(frame)
        seen = armature.evaluated_get(layer.depsgraph)
        world = np.array(seen.matrix_world)
        rest = world if rest is None else rest
        posed = world @ np.array([seen.pose.bones[bone.name].matrix for bone in bones])
        heads[row], turns[row] = posed[:, :3, 3], posed[:, :3, :3]
    if not (np.isfinite(heads).all() and np.isfinite(turns).all()):
        raise SceneError(f"its action ‘{take.name}’ holds numbers that are not finite.")
    at_rest = rest @ np.array([bone.matrix_local for bone in bones])
    lengths = np.array([bone.length for bone in bones])[:, None]
    return BoneMotion(
        tuple(bone.name for bone in bones),
        parents,
        at_rest[:, :3, 3],
        at_rest[:, :3, 3] + at_rest[:, :3, 1] * lengths,
        at_rest[:, :3, :3],
        heads,
        turns,
        frame_rate(scene),
    )


def _frames(take: ArmatureAction) -> tuple[int, int]:
    """The first and the last whole frame of a take: of what the artist set, else of its keys."""
    if take.action.use_frame_range:
        first, last = take.action.frame_start, take.action.frame_end
    else:
        ranges = [curve.range() for curve in compat.slot_curves(take.action, take.slot)]
        first, last = min(low for low, _ in ranges), max(high for _, high in ranges)
    if not (math.isfinite(first) and math.isfinite(last)):
        return 0, 0
    return math.ceil(first - ON_FRAME), math.floor(last + ON_FRAME)


def _play_along(armature: bpy.types.Object, action: bpy.types.Action) -> None:
    """Has what the armature hangs on play the same action, where it has a slot for it."""
    thing = armature.parent
    while thing is not None:
        slot = next((slot for slot in compat.object_slots(action) if slot and slot.name_display == thing.name), None)
        if slot is not None and thing.animation_data is not None:
            thing.animation_data.use_nla = False
            compat.play(thing, action, slot)
        thing = thing.parent


def body_bones(armature: bpy.types.Object, also: set[str] = frozenset()) -> list[bpy.types.Bone]:
    """The bones that carry the body and those in which its limbs meet, or all where few carry anything: the others are
    the controls of a rig. Those named in `also` are among them. Parents before children.
    """
    bones = list(armature.data.bones)
    carrying = {bone.name for bone in bones if bone.use_deform}
    if len(carrying) < FEWEST_BONES:
        return bones
    carrying |= also
    leads = carrying | {up.name for bone in bones if bone.name in carrying for up in bone.parent_recursive}
    meets = {bone.name for bone in bones if sum(child.name in leads for child in bone.children) > 1}
    return [bone for bone in bones if bone.name in carrying or (bone.name in leads and bone.name in meets)]


def parents_among(bones: list[bpy.types.Bone]) -> tuple[int, ...]:
    """The nearest bone above each that is among them, −1 for none."""
    index = {bone.name: k for k, bone in enumerate(bones)}
    return tuple(next((index[up.name] for up in bone.parent_recursive if up.name in index), -1) for bone in bones)
