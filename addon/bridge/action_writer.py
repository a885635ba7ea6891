# SPDX-License-Identifier: GPL-3.0-or-later
"""Motion of the core → a new action of the character: quaternion and location keys at the scene's frame rate."""

from __future__ import annotations

import json

import bpy
import numpy as np

from .. import quaternions
from ..motion import Motion, resample
from ..quaternions import CONJUGATE, multiply
from . import compat
from .armature import rest_rotations
from .names import REPORT_KEY

#: Value of 'LINEAR' in a keyframe's `interpolation`; every frame is keyed, so nothing lies between.
LINEAR = 1
LOCATION, ROTATION = "location", "rotation_quaternion"


class BoneSpace:
    """The way between the core's arrays and the channels of the character's bones.

    Pose space of Blender: a bone's matrix is its parent's times its rest offset times its own rotation, so a
    parent-relative rotation r becomes B⁻¹ r B with the bone's rest rotation B. The root is taken into the
    armature object's space first, so that the motion stays in the world wherever the object stands: `matrix_world`
    says where, or else the object does.
    """

    def __init__(
        self, character: bpy.types.Object, names: list[str], metres_per_unit: float, matrix_world=None
    ) -> None:
        rest = rest_rotations(character, names)
        self._rest_root = rest[0]
        self._into = np.array([quaternions.from_matrix(matrix) for matrix in rest])
        self._metres = metres_per_unit
        world = np.array(character.matrix_world if matrix_world is None else matrix_world, dtype=np.float64)
        self._to_world = world
        self._spin = quaternions.from_matrix(world[:3, :3] / np.cbrt(np.linalg.det(world[:3, :3])))
        self._root_head = np.array(character.data.bones[names[0]].head_local, dtype=np.float64)

    def channels(self, motion: Motion) -> tuple[np.ndarray, np.ndarray]:
        """A motion as root locations (frames, 3) and quaternions (frames, joints, 4) in each bone's rest frame."""
        to_object = np.linalg.inv(self._to_world)
        positions = motion.root_positions.astype(np.float64) / self._metres
        positions = positions @ to_object[:3, :3].T + to_object[:3, 3]
        locations = (positions - self._root_head) @ self._rest_root
        rotations = motion.rotations.astype(np.float64).copy()
        rotations[:, 0] = multiply(self._spin * CONJUGATE, rotations[:, 0])
        rotations = multiply(multiply(self._into * CONJUGATE, rotations), self._into)
        return locations, quaternions.continuous(rotations)

    def motion(self, locations: np.ndarray, rotations: np.ndarray, frame_rate: float) -> Motion:
        """The inverse of `channels`."""
        positions = locations @ self._rest_root.T + self._root_head
        positions = (positions @ self._to_world[:3, :3].T + self._to_world[:3, 3]) * self._metres
        turned = multiply(multiply(self._into, rotations), self._into * CONJUGATE)
        turned[:, 0] = multiply(self._spin, turned[:, 0])
        return Motion(positions, turned, frame_rate)


def write_action(
    context: bpy.types.Context,
    character: bpy.types.Object,
    names: list[str],
    motion: Motion,
    *,
    name: str,
    start_frame: int,
    metres_per_unit: float = 1.0,
    report: dict | None = None,
) -> bpy.types.Action:
    """Writes `motion` into a new action of `character` and lengthens the scene's frame range to hold it.

    Earlier actions stay in the file: each keeps a fake user.
    """
    scene = context.scene
    sampled = resample(motion, scene.render.fps / scene.render.fps_base)
    context.view_layer.update()
    locations, rotations = BoneSpace(character, names, metres_per_unit).channels(sampled)
    frames = start_frame + np.arange(len(locations), dtype=np.float32)

    _keep_previous(character)
    action = bpy.data.actions.new(name)
    action.use_fake_user = True
    curves = compat.CurveSet(action, character)
    for axis in range(3):
        _write_curve(curves, names[0], LOCATION, axis, frames, locations[:, axis])
    for joint, bone in enumerate(names):
        for axis in range(4):
            _write_curve(curves, bone, ROTATION, axis, frames, rotations[:, joint, axis])
    if report is not None:
        action[REPORT_KEY] = json.dumps(report)
    compat.assign_action(character, action, curves)
    scene.frame_start = min(scene.frame_start, start_frame)
    scene.frame_end = max(scene.frame_end, int(frames[-1])) if len(frames) else scene.frame_end
    return action


def data_path(bone: str, channel: str) -> str:
    return f'pose.bones["{bone}"].{channel}'


def _keep_previous(character: bpy.types.Object) -> None:
    data = character.animation_data
    if data and data.action:
        data.action.use_fake_user = True


def _write_curve(curves: compat.CurveSet, bone: str, channel: str, axis: int, frames, values) -> None:
    curve = curves.new(data_path(bone, channel), axis, bone)
    points = curve.keyframe_points
    points.add(len(frames))
    coordinates = np.empty((len(frames), 2), dtype=np.float32)
    coordinates[:, 0], coordinates[:, 1] = frames, values
    points.foreach_set("co", coordinates.ravel())
    points.foreach_set("interpolation", np.full(len(frames), LINEAR, dtype=np.int32))
    curve.update()
