# SPDX-License-Identifier: GPL-3.0-or-later
"""Motion of the core → a new action of the character: quaternion and location keys at the scene's frame rate."""

from __future__ import annotations

import json

import bpy
import numpy as np

from .. import quaternions
from ..motion import Motion, resample
from . import compat
from .armature import rest_rotations
from .names import REPORT_KEY

#: Value of 'LINEAR' in a keyframe's `interpolation`; every frame is keyed, so nothing lies between.
LINEAR = 1


def bone_channels(character: bpy.types.Object, names: list[str], motion: Motion, metres_per_unit: float):
    """The motion in each bone's own rest frame: root locations (frames, 3) and quaternions (frames, joints, 4).

    Pose space of Blender: a bone's matrix is its parent's times its rest offset times its own rotation, so a
    parent-relative rotation r becomes B⁻¹ r B with the bone's rest rotation B. The root is taken into the
    armature object's space first, so that the motion stays in the world wherever the object stands.
    """
    rest = rest_rotations(character, names)
    to_object = np.array(character.matrix_world.inverted_safe(), dtype=np.float64)
    spin = to_object[:3, :3] / np.cbrt(np.linalg.det(to_object[:3, :3]))
    positions = motion.root_positions.astype(np.float64) / metres_per_unit
    positions = positions @ to_object[:3, :3].T + to_object[:3, 3]
    root_rest = np.array(character.data.bones[names[0]].head_local, dtype=np.float64)
    locations = (positions - root_rest) @ rest[0]

    rotations = motion.rotations.astype(np.float64).copy()
    rotations[:, 0] = quaternions.multiply(quaternions.from_matrix(spin), rotations[:, 0])
    into = np.array([quaternions.from_matrix(matrix) for matrix in rest])
    rotations = quaternions.multiply(quaternions.multiply(into * quaternions.CONJUGATE, rotations), into)
    return locations, quaternions.continuous(rotations)


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
    locations, rotations = bone_channels(character, names, sampled, metres_per_unit)
    frames = start_frame + np.arange(len(locations), dtype=np.float32)

    context.view_layer.update()
    _keep_previous(character)
    action = bpy.data.actions.new(name)
    action.use_fake_user = True
    curves = compat.CurveSet(action, character)
    for axis in range(3):
        _write_curve(curves, names[0], "location", axis, frames, locations[:, axis])
    for joint, bone in enumerate(names):
        for axis in range(4):
            _write_curve(curves, bone, "rotation_quaternion", axis, frames, rotations[:, joint, axis])
    if report is not None:
        action[REPORT_KEY] = json.dumps(report)
    compat.assign_action(character, action, curves)
    scene.frame_start = min(scene.frame_start, start_frame)
    scene.frame_end = max(scene.frame_end, int(frames[-1])) if len(frames) else scene.frame_end
    return action


def _keep_previous(character: bpy.types.Object) -> None:
    data = character.animation_data
    if data and data.action:
        data.action.use_fake_user = True


def _write_curve(curves: compat.CurveSet, bone: str, channel: str, axis: int, frames, values) -> None:
    curve = curves.new(f'pose.bones["{bone}"].{channel}', axis, bone)
    points = curve.keyframe_points
    points.add(len(frames))
    coordinates = np.empty((len(frames), 2), dtype=np.float32)
    coordinates[:, 0], coordinates[:, 1] = frames, values
    points.foreach_set("co", coordinates.ravel())
    points.foreach_set("interpolation", np.full(len(frames), LINEAR, dtype=np.int32))
    curve.update()
