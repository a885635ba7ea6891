# SPDX-License-Identifier: GPL-3.0-or-later
"""Who gets the motion: Oncue's own character, or an armature of the artist's, and how large that is."""

from __future__ import annotations

from dataclasses import dataclass

import bpy

from .. import native
from ..body_size import clock
from ..rig import Hold, Rig
from . import own_rig, rigify, rigify_ik
from .action_writer import BoneSpace, Space
from .armature import find_character, misfit
from .rig_space import RigSpace
from .scene_time import frame_rate
from .shown_cues import visible_cues


@dataclass(frozen=True)
class Puppet:
    """An armature, or the one that is still to be made, and its measure beside the core's body."""

    #: None where Oncue's own is still to be made.
    character: bpy.types.Object | None
    #: None for Oncue's own skeleton.
    rig: Rig | None
    #: How many times as large as the core's body.
    size: float
    #: Metres for a unit of the scene.
    scene_scale: float
    #: Which limbs of a Rigify rig are moved by their IK controls.
    ik: tuple[str, ...] = ()

    @property
    def bones(self) -> list[str]:
        """The bones that are keyed, the one that carries the others first."""
        if self.rig is None:
            return list(native.core.skeleton()["names"])
        return self.space().bones

    @property
    def is_control_rig(self) -> bool:
        """Whether controls are keyed that other bones follow."""
        return self.rig is not None and self.character is not None and rigify.is_rigify(self.character)

    @property
    def metres_per_unit(self) -> float:
        """The core's metres for a unit of the scene: the scene is as much smaller as the body is larger."""
        return self.scene_scale / self.size

    def frame_rate(self, scene: bpy.types.Scene) -> float:
        """The scene's frames in a second of the body's."""
        return frame_rate(scene) * clock(self.size)

    def space(self, matrix_world=None, holds: tuple[Hold, ...] = ()) -> Space:
        """The way to the channels of its bones. `matrix_world`: where the armature object stands, else as it does;
        `holds`: hands that are exactly where the body's are."""
        assert self.character is not None  # made by now
        if self.rig is None:
            return BoneSpace(self.character, self.bones, self.metres_per_unit, matrix_world)
        if self.is_control_rig:
            return rigify.ControlSpace(self.character, self.rig, self.metres_per_unit, matrix_world, holds, self.ik)
        return RigSpace(self.character, self.rig, self.metres_per_unit, matrix_world, holds)


def puppet_of(character: bpy.types.Object | None, scene: bpy.types.Scene) -> Puppet:
    """What a run moves. Raises SceneError where an armature is nobody's, or of no person's size."""
    scale = scene.oncue.scene_scale
    skeleton = native.core.skeleton()
    if character is None or is_own_skeleton(character, skeleton):
        return Puppet(character, None, 1.0, scale)
    rig = own_rig.rig_of(character, skeleton)
    ik = rigify_ik.asked(scene.oncue) if rigify.is_rigify(character) else ()
    return Puppet(character, rig, own_rig.size_of(character, rig, scale), scale, ik)


def is_own_skeleton(character: bpy.types.Object, skeleton: dict) -> bool:
    """Whether an armature is the core's own skeleton, joint for joint."""
    return misfit(character, skeleton) is None


def who_acts(context: bpy.types.Context) -> str:
    """One line about who would get the motion now."""
    scene, skeleton = context.scene, native.core.skeleton()
    if len(visible_cues(context, "start")) > 1:
        return "Each person acts by a character of their own"
    character = find_character(scene, skeleton)
    if character is None:
        person = next(own_rig.people(context.view_layer), None)
        return "A new mannequin acts" if person is None else f"A new mannequin acts, {person.name} stays as it is"
    if is_own_skeleton(character, skeleton):
        return (
            f"{character.name} acts, Oncue's mannequin" if scene.oncue.character is None else "Oncue's mannequin acts"
        )
    return "Your own rig acts"
