# SPDX-License-Identifier: GPL-3.0-or-later
"""The channels of the skeleton's bones that Oncue does not key, and what else moves them."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import bpy
from mathutils import Matrix, Vector

from . import compat, rigify

#: How far a bone may be from its rest place, scale or rotation to be at rest.
AT_REST = 1e-4
#: How far from a limb's line a bone may begin that twists with it, as a share of the limb's length.
ON_LINE = 0.05
#: What a bone has besides the rotation that Oncue keys; the root's location is keyed too.
UNKEYED = ("location", "scale")
#: What moves a bone.
MOVING = ("location", "rotation_", "scale")


def leftovers(bones: list[bpy.types.PoseBone]) -> Iterator[tuple[bpy.types.PoseBone, str, str]]:
    """(bone, channel, what was done to it) of the channels that no motion keys and that are not at rest.

    `bones` are the skeleton's, root first; bones over the root, and those in the chains between, carry others and must
    be at rest as a whole.
    """
    yield from unrest(bones[0].parent_recursive)
    for bone, channel, fault in unrest(bones):
        if channel == "scale" or (channel == "location" and bone != bones[0]):
            yield bone, channel, fault
    yield from unrest(helpers(bones)[0])


def helpers(bones: list[bpy.types.PoseBone]) -> tuple[list[bpy.types.PoseBone], list[bpy.types.PoseBone]]:
    """The bones that shape a body along with those that a motion writes, and are written by none: those in the chains
    between them, and those that hang on a limb's bone and lie on its line to the next one, as twists and the helpers of
    elbows and knees do. Fingers, faces, clothes and what is held are neither. Of a rig of controls the second are those
    that bend it beside the ones that are written, and the first are its own business.

    `bones` are the skeleton's, root first.
    """
    character = bones[0].id_data
    if rigify.is_rigify(character):
        return [], [character.pose.bones[name] for name in rigify.bending_controls(character)]
    written = {bone.name for bone in bones}
    between: dict[str, bpy.types.PoseBone] = {}
    below: dict[str, list[bpy.types.PoseBone]] = {}
    for bone in bones[1:]:
        chain = list(itertools.takewhile(lambda over: over.name not in written, bone.parent_recursive))
        if len(chain) == len(bone.parent_recursive):
            continue
        between.update((one.name, one) for one in chain)
        below.setdefault(bone.parent_recursive[len(chain)].name, []).append(bone)
    beside = []
    for bone in bones:
        # Where more than one limb begins none is meant.
        if len(ends := below.get(bone.name, [])) != 1:
            continue
        for one in bone.children_recursive:
            over = next((up for up in one.parent_recursive if up.name in written), None)
            if over == bone and one.name not in {*written, *between} and _is_on_line(one, bone, ends[0]):
                beside.append(one)
    return list(between.values()), beside


def _is_on_line(one: bpy.types.PoseBone, start: bpy.types.PoseBone, end: bpy.types.PoseBone) -> bool:
    """Whether a bone that carries the skin begins on the line between the beginnings of two others at rest."""
    way = end.bone.head_local - start.bone.head_local
    if not one.bone.use_deform or not way.length > 0.0:
        return False
    place = one.bone.head_local - start.bone.head_local
    along = min(max(place.dot(way) / way.length_squared, 0.0), 1.0)
    return (place - along * way).length < ON_LINE * way.length


def unrest(bones: list[bpy.types.PoseBone]) -> Iterator[tuple[bpy.types.PoseBone, str, str]]:
    """(bone, channel, what was done to it) of all channels of some bones that are not at rest."""
    for bone in bones:
        if bone.location.length > AT_REST:
            yield bone, "location", "moved"
        if (bone.scale - Vector((1.0, 1.0, 1.0))).length > AT_REST:
            yield bone, "scale", "scaled"
        if abs(bone.matrix_basis.to_quaternion().w) < 1.0 - AT_REST:
            yield bone, "rotation", "turned"


def clear_channel(bone: bpy.types.PoseBone, channel: str) -> None:
    """Puts one channel of a bone to rest."""
    if channel == "location":
        bone.location = (0.0, 0.0, 0.0)
    elif channel == "scale":
        bone.scale = (1.0, 1.0, 1.0)
    else:
        bone.matrix_basis = Matrix.Translation(bone.location) @ Matrix.Diagonal((*bone.scale, 1.0))


def put_to_rest(bones: list[bpy.types.PoseBone], before: set[tuple[str, str]]) -> None:
    """Puts to rest what another action has left of a skeleton that plays a new one, where that keys it not: what
    carries the skeleton, and of the bones that only shape it what that action has keyed (`before`, as `keyed_channels`
    gives it). What the artist has posed of these without a key stays.
    """
    now, shaping = keyed_channels(bones[0].id_data), helpers(bones)[1]
    for bone, channel, _ in [*leftovers(bones), *(one for one in unrest(shaping) if is_keyed(before, *one[:2]))]:
        if not is_keyed(now, bone, channel):
            clear_channel(bone, channel)


def is_keyed(channels: set[tuple[str, str]], bone: bpy.types.PoseBone, channel: str) -> bool:
    """Whether `channels`, as `keyed_channels` gives them, have one of `leftovers`, which knows one of all rotations."""
    return any(name == bone.name and keyed.startswith(channel) for name, keyed in channels)


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
