# SPDX-License-Identifier: GPL-3.0-or-later
"""What carries a body along its way: its hips, a root bone under them, the armature object, or nothing at all.

The way is that of the first keyed bone over the floor, and the heading of the hips. What carries it gets its curves
first; the body then gets channels under which it is, on each frame, where it is in any case, however near those curves
are to the way. In place nothing carries it, and the body is where it would be if something did.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Euler, Matrix

from .. import quaternions
from ..errors import SceneError
from ..key_fit import BoneKeys, Channels, Rest, fit
from ..motion import Motion
from . import compat
from .action_writer import Space
from .channels import LOCATION, ROTATION, data_path, rotation_values
from .curves import every_frame, fitted, played, write_keys
from .puppet import Puppet
from .solved import Curves, Solved, solved_of

HIPS, BONE, OBJECT, PLACE = "HIPS", "BONE", "OBJECT", "PLACE"
#: How far the curves of what carries may be from the way, as a share of a hand's tolerance: the body makes up for it.
LOOSE = 3.0
#: What plays differs from what was written by less, armature units and entries of a matrix.
SAME_WAY = 1e-4


class CarriedSpace:
    """The way to channels of a body that something carries: as `inner` says, but for the first bone."""

    def __init__(self, inner: Space, character: bpy.types.Object, way: np.ndarray) -> None:
        """`way` (frames, 4, 4): what carries the first bone's rest place on each frame, armature space."""
        self.inner, self.bones, self.joints, self.is_exact = inner, inner.bones, inner.joints, inner.is_exact
        self.groups = inner.groups
        self.way, self._character = way, character
        self._rest = np.array(character.data.bones[inner.bones[0]].matrix_local, dtype=np.float64)

    def channels(self, motion: Motion) -> tuple[np.ndarray, np.ndarray]:
        """As of a `Space`, for a motion at the frames of the way."""
        return self._carried(*self.inner.channels(motion), np.linalg.inv(self.way))

    def motion(
        self,
        locations: np.ndarray,
        rotations: np.ndarray,
        frame_rate: float,
        beside: Sequence[np.ndarray] = (),
        _way=None,
    ) -> Motion:
        """The inverse of `channels` as far as that of `inner` is."""
        return self.inner.motion(*self._carried(locations, rotations, self.way), frame_rate, beside, self.way)

    def at(self, frame: int) -> CarriedSpace:
        """The same for motions of this one frame."""
        return CarriedSpace(self.inner, self._character, self.way[frame : frame + 1])

    def rest(self) -> Rest:
        return self.inner.rest()

    def beside(self, motion: Motion, _way: np.ndarray | None = None) -> list[np.ndarray]:
        """As of a `Space`, of controls that the same carries."""
        return self.inner.beside(motion, self.way)

    def _carried(self, locations: np.ndarray, rotations: np.ndarray, by: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        basis = _posed(locations, rotations[:, 0])
        basis = np.linalg.inv(self._rest) @ by @ self._rest @ basis
        turned = np.concatenate([quaternions.from_matrix(basis[:, :3, :3])[:, None], rotations[:, 1:]], axis=1)
        return basis[:, :3, 3], quaternions.continuous(turned)


@dataclass
class RootMotion:
    """What carries a character in a take that is being written."""

    character: bpy.types.Object
    kind: str
    #: The root bone, where it is that.
    bone: str
    #: The body at rest: its left, back and up, columns in armature space, and how high its soles are along up.
    axes: np.ndarray
    floor: float
    #: How high the floor is that the motion begins on, scene units.
    scene_floor: float
    #: Where the armature object stands, (4, 4).
    matrix_world: np.ndarray
    #: The way to the body's channels, once it is written.
    carried: CarriedSpace | None = None

    def write(
        self,
        curves: compat.CurveSet,
        space: Space,
        sampled: Motion,
        start_frame: int,
        tolerance_mm: float | None,
    ) -> CarriedSpace:
        """Writes the curves of what carries a motion at the scene's frames; the way to the body's channels then."""
        way = self._way(space, sampled)
        if self.kind != PLACE:
            way = self._written(curves, way, start_frame, tolerance_mm, space.rest().units_per_metre)
        self.carried = CarriedSpace(space, self.character, way)
        return self.carried

    def _way(self, space: Space, sampled: Motion) -> np.ndarray:
        """What takes the body's rest place along the floor as it goes and faces, armature space, (frames, 4, 4)."""
        locations, rotations = space.channels(sampled)
        rest = np.array(self.character.data.bones[space.bones[0]].matrix_local, dtype=np.float64)
        scale = np.cbrt(np.linalg.det(self.matrix_world[:3, :3]))
        spin = self.matrix_world[:3, :3] / scale
        up = spin.T @ np.array([0.0, 0.0, 1.0])
        places = (rest @ _posed(locations, rotations[:, 0]))[:, :3, 3]
        ahead = quaternions.to_matrix(sampled.rotations[:, 0]) @ np.array([0.0, -1.0, 0.0]) @ spin
        at_rest = -self.axes[:, 1]
        yaw = np.unwrap(np.arctan2(ahead @ np.cross(up, at_rest), ahead @ at_rest))
        turns = quaternions.to_matrix(np.column_stack([np.cos(yaw / 2.0), np.sin(yaw / 2.0)[:, None] * up]))
        level = np.eye(3) - np.outer(up, up)
        higher = (self.scene_floor - self.matrix_world[2, 3]) / scale - self.floor
        way = np.tile(np.eye(4), (len(sampled), 1, 1))
        way[:, :3, :3] = turns
        way[:, :3, 3] = places @ level - (turns @ (level @ rest[:3, 3])) + higher * up
        return way

    def _written(
        self, curves: compat.CurveSet, way: np.ndarray, start: int, tolerance_mm: float | None, units: float
    ) -> np.ndarray:
        """Writes a way, and gives it as its curves play it at the frames."""
        basis, mode, group = self._basis(way), self._mode(), self.bone or "Object Transforms"
        locations = basis[:, :3, 3]
        scale = np.cbrt(np.linalg.det(basis[0, :3, :3]))
        turns = quaternions.continuous(quaternions.from_matrix(basis[:, :3, :3] / scale)[:, None])
        channel, values = rotation_values(mode, turns[:, 0])
        if tolerance_mm is None:
            frames = start + np.arange(len(way), dtype=np.float64)
            keys = [every_frame(frames, column) for column in (*locations.T, *values.T)]
        else:
            one = Rest(["Hips"], [-1], np.zeros((1, 3)), np.array([[1.0, 0.0, 0.0, 0.0]]), units * scale)
            stands = np.zeros((len(way), 2), dtype=bool)
            few = fit(one, Channels(locations, turns), stands, LOOSE * tolerance_mm)[0]
            keys = [fitted(few, 4 + axis, start) for axis in range(3)]
            turning = few if channel == ROTATION else _at_frames(values, few.frames)
            keys += [fitted(turning, axis, start) for axis in range(values.shape[1])]
        paths = [(LOCATION, axis) for axis in range(3)] + [(channel, axis) for axis in range(values.shape[1])]
        made: Curves = {}
        for (name, axis), written in zip(paths, keys, strict=True):
            path = data_path(self.bone, name) if self.kind == BONE else name
            made[path, axis] = curves.new(path, axis, group)
            write_keys(made[path, axis], written)
        return self.played(made, start, len(way))

    def played(self, curves: Curves, start: int, count: int) -> np.ndarray:
        """The way as curves play it at frames from `start` on, armature space, (count, 4, 4). Raises KeyError where one
        lacks."""
        times = start + np.arange(count, dtype=np.float64)
        prefix = data_path(self.bone, "") if self.kind == BONE else ""
        mode = self._mode()
        channel = rotation_values(mode, np.array([[1.0, 0.0, 0.0, 0.0]]))[0]
        width = 3 if channel == "rotation_euler" else 4

        def read(name: str, axes: int) -> np.ndarray:
            return np.stack([played(curves[prefix + name, axis], times) for axis in range(axes)], axis=1).astype(float)

        turned = read(channel, width)
        if channel == ROTATION:
            turns = quaternions.to_matrix(turned / np.linalg.norm(turned, axis=1, keepdims=True))
        elif channel == "rotation_euler":
            turns = np.array([Euler(row, mode).to_matrix() for row in turned], dtype=np.float64)
        else:
            turns = np.array([Matrix.Rotation(row[0], 3, row[1:]) for row in turned], dtype=np.float64)
        basis = np.tile(np.eye(4), (count, 1, 1))
        basis[:, :3, :3], basis[:, :3, 3] = turns, read(LOCATION, 3)
        if self.kind == BONE:
            rest = self._rest()
            return rest @ basis @ np.linalg.inv(rest)
        basis[:, :3, :3] *= np.array(self.character.scale, dtype=np.float64)
        return np.linalg.inv(self.matrix_world) @ basis

    def paths(self) -> tuple[str, ...]:
        """What the paths of its curves begin with."""
        if self.kind == BONE:
            return (data_path(self.bone, LOCATION), data_path(self.bone, "rotation_"))
        return (LOCATION, "rotation_") if self.kind == OBJECT else ()

    def _basis(self, way: np.ndarray) -> np.ndarray:
        if self.kind == BONE:
            rest = self._rest()
            return np.linalg.inv(rest) @ way @ rest
        return self.matrix_world @ way

    def _mode(self) -> str:
        carrier = self.character.pose.bones[self.bone] if self.kind == BONE else self.character
        return carrier.rotation_mode

    def _rest(self) -> np.ndarray:
        return np.array(self.character.data.bones[self.bone].matrix_local, dtype=np.float64)


def root_motion_of(puppet: Puppet, kind: str, scene_floor: float, matrix_world: np.ndarray) -> RootMotion | None:
    """What carries a character as it was asked for; None for its hips. Raises SceneError where nothing of it can."""
    character, rig = puppet.character, puppet.rig
    check(puppet, kind)
    if kind == HIPS or character is None:
        return None
    bone = root_bone(puppet) if kind == BONE else ""
    axes, floor = (np.eye(3), 0.0) if rig is None else (rig.axes, rig.floor)
    return RootMotion(character, kind, bone, axes, floor, scene_floor, matrix_world)


def check(puppet: Puppet, kind: str) -> None:
    """Raises SceneError where a character cannot be carried so."""
    character = puppet.character
    name = character.name if character is not None else "Oncue's mannequin"
    if kind == BONE and not root_bone(puppet):
        raise SceneError(
            f"{name} has no root bone at its feet under its hips, which could carry its way: choose another Root "
            "Motion in Oncue's settings."
        )
    if kind == OBJECT and character is not None:
        hung = [c for c in character.constraints if not c.mute and c.influence > 0.0]
        deltas = [*character.delta_location, *character.delta_rotation_euler]
        if character.parent is not None or hung or any(deltas):
            raise SceneError(
                f"{name} hangs on another object, or has a constraint or deltas, and cannot carry its own way: clear "
                "these, or choose another Root Motion in Oncue's settings."
            )


def root_bone(puppet: Puppet) -> str:
    """The bone at the feet that carries all of a rig; an empty name for none."""
    if puppet.rig is None or puppet.character is None:
        return ""
    bones = puppet.character.data.bones
    if puppet.is_control_rig:
        return "root" if "root" in bones else ""
    over = bones[puppet.bones[0]].parent_recursive
    return over[-1].name if over and puppet.rig.is_at_feet(np.array(over[-1].head_local)) else ""


def of_take(puppet: Puppet, solved: Solved) -> RootMotion | None:
    """What carries a character in a take that was written; None for its hips."""
    if solved.way is None or puppet.character is None:
        return None
    kind, _, bone = solved.root.partition(" ")
    return RootMotion(puppet.character, kind, bone, np.eye(3), 0.0, 0.0, solved.matrix_world)


def check_way(root: RootMotion, solved: Solved, action: bpy.types.Action, curves: Curves) -> None:
    """Raises SceneError where what carries a take plays otherwise than it was written."""
    if root.kind == PLACE or solved.way is None:
        return
    try:
        now = root.played(curves, solved.start_frame, len(solved.way))
        same = np.abs(now - solved.way).max(initial=0.0) < SAME_WAY * max(np.abs(solved.way).max(initial=0.0), 1.0)
    except KeyError:
        same = False
    if not same:
        if root.kind == BONE:
            raise SceneError(
                f"{action.name} has its way carried by the bone {root.bone} otherwise than it was written, and "
                "Re-solve adapts the body alone: undo that, or synthesize again."
            )
        raise SceneError(
            f"{action.name} has its way carried by the object otherwise than it was written, and Re-solve adapts the "
            "body alone: undo that, or synthesize again."
        )


def stand_of(character: bpy.types.Object) -> np.ndarray:
    """Where an armature object stands, (4, 4): where it stood before a take that moves it along, if it plays such."""
    data = character.animation_data
    if data is not None and data.action is not None and (before := moved_by(data.action)) is not None:
        return before
    return np.array(character.matrix_world, dtype=np.float64)


def moved_by(action: bpy.types.Action) -> np.ndarray | None:
    """Where the object stood that a take moves along, (4, 4); None for one that moves none."""
    try:
        solved = solved_of(action)
    except SceneError:
        return None
    return np.asarray(solved.matrix_world, dtype=np.float64) if solved.root == OBJECT else None


def _at_frames(values: np.ndarray, frames: np.ndarray) -> BoneKeys:
    """Keys of channels (frames, channels) at some frames, as fast there as they are."""
    slopes = np.gradient(values, axis=0) if len(values) > 1 else np.zeros_like(values)
    return BoneKeys(frames, values[frames], slopes[frames], slopes[frames])


def _posed(locations: np.ndarray, rotations: np.ndarray) -> np.ndarray:
    basis = np.tile(np.eye(4), (len(locations), 1, 1))
    basis[:, :3, :3], basis[:, :3, 3] = quaternions.to_matrix(rotations), locations
    return basis
