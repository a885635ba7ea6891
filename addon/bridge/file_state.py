# SPDX-License-Identifier: GPL-3.0-or-later
"""The one look at the file before a run: is what is read what the artist sees, and will what is written play so?

Whatever stands between the two is named here, with the way out, before anything is read; the button, `batch.py`,
Re-solve and Follow Cues all come through. What can be read as it is needs no refusal and is no business of this file:
meshes in edit mode and what the view hides (`scene_reader`), slots (`compat`), how bones turn and where the character
stands (`action_writer`).
"""

from __future__ import annotations

from collections.abc import Iterator

import bpy
import numpy as np

from .. import native
from ..errors import CharacterError, SceneError
from . import compat, own_rig
from .bones import (
    bending_constraints,
    carriers,
    driven_bones,
    helpers,
    is_keyed,
    keyed_channels,
    leftovers,
    unwritten,
)
from .puppet import Puppet, is_own_skeleton, puppet_of
from .scene_time import frame_rate, may_move, moving
from .what_counts import is_shown, things_of

#: Frames a second at which a motion can be shown: below, a step has hardly a frame; above is a slip of the keyboard.
SLOWEST, FASTEST = 4.0, 1000.0
#: How far the character's scale may be from a person's size.
SCALE_TOLERANCE = 1e-3
RESET = "or press Reset Character"


def check(context: bpy.types.Context, character: bpy.types.Object | None) -> Puppet:
    """Who gets the motion. Raises SceneError where the scene, CharacterError where the character would not show the
    motion as it is made.

    `character` is None where one is still to be made. It stays at the current frame: `check_over_time` does not.
    """
    check_scene(context.scene)
    context.view_layer.update()
    return puppet_of(None, context.scene) if character is None else check_character(context, character)


def check_over_time(context: bpy.types.Context, character: bpy.types.Object | None) -> None:
    """Raises CharacterError where the object itself is moved in the frames that the motion takes.

    It may go through the frames, which loses places that were not keyed: what the view shows is to be read before.
    """
    if character is None or not may_move(character, own_action=False):
        return
    if moving(context, [character], context.scene.oncue.start_frame):
        said = (
            f"{character.name} itself is moved by its parent, a constraint, a driver or an NLA strip, and the motion "
            f"with it: clear these, {RESET}"
        )
        if is_own_skeleton(character, native.core.skeleton()):
            raise CharacterError(f"{said}.")
        raise SceneError(f"{_without_reset(said)}.")


def remarks(context: bpy.types.Context, character: bpy.types.Object | None) -> Iterator[tuple[str, str]]:
    """(object, sentence) of what hinders no run but has the artist see something else than was read or is made."""
    if character is None:
        yield from _rigs_that_stay(context)
    if character is not None and not is_shown(character, context.view_layer):
        yield (
            character.name,
            f"{character.name} is hidden, so that its motion does not show: show it (Alt H, or its collection's eye).",
        )
    if context.area is None or context.area.type != "VIEW_3D":
        return
    shown = [thing for thing in things_of(context.view_layer) if is_shown(thing, context.view_layer)]
    # Without being told another one it asks the view that the mouse is in.
    hidden = [thing for thing in shown if not thing.visible_get(view_layer=context.view_layer)]
    if hidden:
        more = f" and {len(hidden) - 1} more" if len(hidden) > 1 else ""
        yield (
            hidden[0].name,
            f"{hidden[0].name}{more} count, though this view does not show them (local view, local collections or "
            "object types).",
        )


def _rigs_that_stay(context: bpy.types.Context) -> Iterator[tuple[str, str]]:
    """The people of the scene that nobody chose, where a character is made beside them."""
    for thing in own_rig.people(context.view_layer):
        yield (
            thing.name,
            f"{thing.name} has a person's bones and stays as it is: choose it as Character to have it act.",
        )


# --- the scene --------------------------------------------------------------------------------------------------------


def check_scene(scene: bpy.types.Scene) -> None:
    """Raises SceneError where a motion cannot be shown in the scene's time, or the scene cannot be written."""
    if scene.library is not None:
        raise SceneError(
            f"The scene {scene.name} is linked from {scene.library.filepath}: work in a scene of this file."
        )
    rate = frame_rate(scene)
    if not SLOWEST <= rate <= FASTEST:
        bound = f"{SLOWEST:g} or more" if rate < SLOWEST else f"{FASTEST:g} or less"
        raise SceneError(
            f"The scene runs at {rate:g} frames a second, at which no motion can be shown: set its Frame Rate (Output "
            f"properties) to {bound}."
        )
    render = scene.render
    if render.frame_map_old != render.frame_map_new:
        raise SceneError(
            f"The scene's time is stretched from {render.frame_map_old} to {render.frame_map_new} frames, and keys "
            "would play at other frames than they stand on: set both to 100 (Output properties, Time Stretching)."
        )


# --- the character ----------------------------------------------------------------------------------------------------


def check_character(context: bpy.types.Context, character: bpy.types.Object) -> Puppet:
    """The character with its measure. Raises SceneError where it can take no action, or is a rig of the artist's that
    would not play one as made; CharacterError where Oncue's own would not, which can be reset."""
    for said in _refusals(context, character):
        raise SceneError(f"{character.name} {said}.")
    own = is_own_skeleton(character, native.core.skeleton())
    scale = context.scene.oncue.scene_scale
    if own:
        for said in [*_hindrances(character, list(native.core.skeleton()["names"])), scale_fault(character, scale)]:
            if said:
                raise CharacterError(f"{character.name} {said}.")
        return puppet_of(character, context.scene)
    if said := scale_fault(character, scale, any_size=True):
        raise SceneError(f"{character.name} {_without_reset(said)}.")
    puppet = puppet_of(character, context.scene)
    if puppet.is_control_rig:
        # What hangs on its controls by constraints is the rig's own business; whether it follows is seen afterwards.
        for said in _state_hindrances(character, puppet.bones, []):
            raise SceneError(f"{character.name} {_without_reset(said)}.")
        return puppet
    for bone, constraint in bending_constraints([character.pose.bones[name] for name in puppet.bones]):
        raise SceneError(
            f"{character.name} has bones that follow others ({bone.name}, by its constraint {constraint.name}), and "
            "motion is put on bones that nothing else moves: choose a skeleton without controls as Character, such as "
            "the metarig of a Rigify rig, or mute the constraint."
        )
    for said in _hindrances(character, puppet.bones):
        raise SceneError(f"{character.name} {_without_reset(said)}.")
    return puppet


def _without_reset(said: str) -> str:
    """What is said of a rig of the artist's own, which is not Oncue's to reset."""
    return said.removesuffix(f", {RESET}")


def _refusals(context: bpy.types.Context, character: bpy.types.Object) -> Iterator[str]:
    """Why nothing can be written on it, each the rest of a sentence that begins with the character's name."""
    if character.library is not None:
        yield (
            f"is linked from {character.library.filepath} and cannot get an action: make a library override of it, or "
            "clear the Character field"
        )
    if context.view_layer.objects.get(character.name) != character:
        yield (
            f"lies in no collection that the view layer {context.view_layer.name} shows: include its collection, or "
            "clear the Character field"
        )
    if character.mode == "EDIT":
        yield "is in edit mode, in which it shows no motion: leave edit mode (Tab)"


def _hindrances(character: bpy.types.Object, names: list[str]) -> Iterator[str]:
    """What can be reset, each the rest of a sentence that begins with the character's name."""
    bones = [character.pose.bones[bone] for bone in names]
    yield from _state_hindrances(character, names, [bone.name for bone in helpers(bones)[0]])
    for bone, constraint in bending_constraints(bones):
        yield f"has a constraint on {bone.name} ({constraint.name}), which would bend the motion: mute it, {RESET}"
    for bone in bones:
        if not bone.bone.use_inherit_rotation:
            yield f"has a bone, {bone.name}, that does not inherit its parent's rotation: let it, {RESET}"
    keyed = keyed_channels(character)
    for bone, channel, fault in leftovers(bones):
        if not is_keyed(keyed, bone, channel):
            yield (
                f"has a bone, {bone.name}, that was {fault} without a key, and would be so in every take: clear it in "
                f"pose mode (Alt G, Alt R, Alt S), {RESET}"
            )


def _state_hindrances(character: bpy.types.Object, names: list[str], between: list[str]) -> Iterator[str]:
    """The same of what keeps the named bones' keys from playing, and of the bones `between` them in their place."""
    if character.data.pose_position == "REST":
        yield f"shows its rest position: set it to Pose Position (armature properties), {RESET}"
    bones = [character.pose.bones[bone] for bone in names]
    yield from _animation_hindrances(character.animation_data, names, [*carriers(bones), *between])
    if not bones[0].bone.use_local_location:
        yield f"has a bone, {names[0]}, whose location is not its own (Local Location is off): set it, {RESET}"


def _animation_hindrances(data: bpy.types.AnimData | None, names: list[str], over: list[str]) -> Iterator[str]:
    """Of the skeleton's bones and those `over` some of it."""
    if data is None:
        return
    if data.use_tweak_mode:
        yield (
            "has a strip open in tweak mode, in which it takes no other action: leave it (Tab in the NLA editor), "
            f"{RESET}"
        )
    if data.action_influence != 1.0 or data.action_blend_type != "REPLACE":
        yield (
            f"plays its action by {data.action_influence:g} in the mode {data.action_blend_type.title()}: set "
            f"Influence to 1 and Blending to Replace (NLA editor, Action), {RESET}"
        )
    tracks = [track for track in data.nla_tracks if not track.mute] if data.use_nla else []
    for track in tracks:
        if track.is_solo:
            yield f"plays its NLA track {track.name} solo, and nothing else: take its star away, {RESET}"
    for track in tracks:
        for strip in track.strips:
            if not strip.mute and strip.action is not None and unwritten(compat.data_paths(strip.action), names, over):
                yield (
                    f"has moved or scaled bones in its NLA strip {strip.name}, which would play on under the motion: "
                    f"mute the track {track.name}, {RESET}"
                )
    for driver in driven_bones(data, [*names, *over]):
        if not driver.mute:
            yield f"has a driver on {driver.data_path}, which would overrule the motion: mute or delete it, {RESET}"


def scale_fault(character: bpy.types.Object, metres_per_unit: float, *, any_size: bool = False) -> str | None:
    """What is amiss with the size that the character has in the world: the rest of a sentence, or None. With `any_size`
    it may be of another than Oncue's own has, as long as it is evenly scaled."""
    world = np.array(character.matrix_world, dtype=np.float64)
    if not np.isfinite(world).all():
        return f"stands at a place that is not a number: clear its location, rotation and scale, {RESET}"
    matrix = world[:3, :3] * metres_per_unit
    wanted = 1.0 / metres_per_unit
    back = (
        f"set its scale to {wanted:g}" + (", and that of its parents to 1" if character.parent else "") + f", {RESET}"
        if not any_size
        else "give it, and its parents, the same scale along all three axes"
    )
    if np.linalg.det(matrix) < 0.0:
        return f"is mirrored, and a mirrored person has its sides exchanged: {back}"
    sizes = np.linalg.norm(matrix, axis=0)
    square = matrix.T @ matrix - np.diag(sizes**2)
    # Of a rig that is scaled by 0.01 a thousandth is as much as of one in metres.
    whole = max(float(sizes.mean()), 1e-12) if any_size else 1.0
    if np.ptp(sizes) > SCALE_TOLERANCE * whole or np.abs(square).max() > SCALE_TOLERANCE * whole**2:
        return f"is scaled unevenly ({', '.join(f'{size:.3g}' for size in sizes)}): {back}"
    if not any_size and abs(sizes.mean() - 1.0) > SCALE_TOLERANCE:
        return f"is scaled to {sizes.mean():.3g} of a person's size, for which the motion is made: {back}"
    return None
