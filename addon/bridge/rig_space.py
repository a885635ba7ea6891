# SPDX-License-Identifier: GPL-3.0-or-later
"""The way between the core's motion and the channels of a rig's own bones."""

from __future__ import annotations

import bpy
import numpy as np

from ..key_fit import Rest
from ..motion import Motion
from ..rig import Hold, Rig
from .armature import rest_of
from .control_groups import Group


class RigSpace:
    """As `BoneSpace` is for the core's own skeleton: keys lie on the bones that carry the body."""

    def __init__(
        self,
        character: bpy.types.Object,
        rig: Rig,
        metres_per_unit: float,
        matrix_world=None,
        holds: tuple[Hold, ...] = (),
    ) -> None:
        """`metres_per_unit`: of the core, so that the rig is as large as its body."""
        self.bones, self.joints, self.is_exact = rig.bones, rig.joints, False
        self.groups: list[Group] = []
        self._character, self._matrix_world = character, matrix_world
        self._rig, self._metres, self._holds = rig, metres_per_unit, holds
        world = character.matrix_world if matrix_world is None else matrix_world
        self._to_world = np.array(world, dtype=np.float64)

    def channels(self, motion: Motion) -> tuple[np.ndarray, np.ndarray]:
        """A motion as locations of the first bone (frames, 3) and quaternions (frames, bones, 4)."""
        return self._rig.channels(motion, self._to_world, self._metres, self._holds)

    def motion(self, locations: np.ndarray, rotations: np.ndarray, frame_rate: float, _beside=(), _way=None) -> Motion:
        """The inverse of `channels`, but for the proportions."""
        return self._rig.motion(locations, rotations, frame_rate, self._to_world, self._metres)

    def at(self, _frame: int) -> RigSpace:
        """The same for motions of one frame of a take."""
        return self

    def beside(self, _motion: Motion, _way: np.ndarray | None = None) -> list[np.ndarray]:
        """None: all that is keyed are its bones."""
        return []

    def rest(self) -> Rest:
        """How the bones hang on each other."""
        return self._hung(None)

    def _hung(self, over: list[str | None] | None) -> Rest:
        """The same, each on the bone that `over` says, under the names of the joints that they show."""
        joints = self._rig.joint_names
        shown = zip(self.joints, self.bones, strict=True)
        labels = [joints[joint] if joint >= 0 else bone for joint, bone in shown]
        return rest_of(self._character, self.bones, self._metres, self._matrix_world, over, labels)
