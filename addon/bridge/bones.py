# SPDX-License-Identifier: GPL-3.0-or-later
"""The channels of the skeleton's bones that Oncue does not key, and what else moves them."""

from __future__ import annotations

from collections.abc import Iterator

import bpy
from mathutils import Matrix, Vector

from . import compat

#: How far a bone may be from its rest place, scale or rotation to be at rest.
AT_REST = 1e-4
#: What a bone has besides the rotation that Oncue keys; the root's location is keyed too.
UNKEYED = ("location", "scale")
#: What moves a bone.
MOVING = ("location", "rotation_", "scale")


def leftovers(bones: list[bpy.types.PoseBone]) -> Iterator[tuple[bpy.types.PoseBone, str, str]]:
    """(bone, channel, what was done to it) of the channels that no motion keys and that are not at rest.

    `bones` are the skeleton's, root first; bones over the root carry it, and must be at rest as a whole.
    """
    for bone in [*bones[0].parent_recursive, *bones]:
        over = bone not in bones
        if (over or bone != bones[0]) and bone.location.length > AT_REST:
            yield bone, "location", "moved"
        if (bone.scale - Vector((1.0, 1.0, 1.0))).length > AT_REST:
            yield bone, "scale", "scaled"
        if over and abs(bone.matrix_basis.to_quaternion().w) < 1.0 - AT_REST:
            yield bone, "rotation", "turned"


def clear_channel(bone: bpy.types.PoseBone, channel: str) -> None:
    """Puts one channel of a bone to rest."""
    if channel == "location":
        bone.location = (0.0, 0.0, 0.0)
    elif channel == "scale":
        bone.scale = (1.0, 1.0, 1.0)
    else:
        bone.matrix_basis = Matrix.Translation(bone.location) @ Matrix.Diagonal((*bone.scale, 1.0))


def carriers(bones: list[bpy.types.PoseBone]) -> list[str]:
    """The names of the bones over the skeleton, which carry it."""
    return [bone.name for bone in bones[0].parent_recursive]


def unwritten(paths: set[str], names: list[str], over: list[str]) -> set[tuple[str, str]]:
    """(bone, channel) of the skeleton's, and of the bones' over it, that Oncue's actions do not key."""
    found = {
        (bone, path.rpartition(".")[2])
        for bone in over
        for path in paths
        if path.startswith(tuple(f'pose.bones["{bone}"].{channel}' for channel in MOVING))
    }
    for bone in names:
        for channel in UNKEYED:
            if f'pose.bones["{bone}"].{channel}' in paths and not (bone == names[0] and channel == "location"):
                found.add((bone, channel))
    return found


def keyed_channels(character: bpy.types.Object) -> set[tuple[str, str]]:
    """(bone, channel) of all that the action which the character plays moves."""
    data = character.animation_data
    if data is None or data.action is None:
        return set()
    found = set()
    for curve in compat.action_curves(data.action, character):
        bone, _, channel = curve.data_path.removeprefix('pose.bones["').rpartition('"].')
        found.add((bone, channel))
    return found


def bending_constraints(bones: list[bpy.types.PoseBone]) -> Iterator[tuple[bpy.types.PoseBone, bpy.types.Constraint]]:
    """(bone, constraint) of those that bend the skeleton or what carries it, the other bones' chains among them.

    `bones` are the skeleton's, root first.
    """
    own = {bone.name for bone in [*bones[0].parent_recursive, *bones]}
    data = bones[0].id_data.animation_data
    driven = {driver.data_path for driver in data.drivers if not driver.mute} if data is not None else set()
    for bone in bones[0].id_data.pose.bones:
        for constraint in bone.constraints:
            if own.isdisjoint(_reached(bone, constraint)):
                continue
            path = f'{bone.path_from_id()}.constraints["{bpy.utils.escape_identifier(constraint.name)}"].'
            acts = constraint.influence > 0.0 or f"{path}influence" in driven
            if f"{path}mute" in driven or (acts and not constraint.mute):
                yield bone, constraint


def _reached(bone: bpy.types.PoseBone, constraint: bpy.types.Constraint) -> set[str]:
    """The names of the bones that a constraint of `bone` bends."""
    if constraint.type not in {"IK", "SPLINE_IK"} or constraint.target is None:
        return {bone.name}
    count = constraint.chain_count
    return {one.name for one in [bone, *bone.parent_recursive][: count or None]}


def driven_bones(data: bpy.types.AnimData, names: list[str]) -> list[bpy.types.FCurve]:
    """The drivers that place, turn or scale the named bones."""
    paths = tuple(f'pose.bones["{bone}"].{channel}' for bone in names for channel in MOVING)
    return [driver for driver in data.drivers if driver.data_path.startswith(paths)]
