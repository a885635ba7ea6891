# SPDX-License-Identifier: GPL-3.0-or-later
"""Motion of the core → a new action of the character: quaternion and location keys at the scene's frame rate."""

from __future__ import annotations

import json
from dataclasses import dataclass

import bpy
import numpy as np

from . import compat
from .armature import rest_rotations
from .names import REPORT_KEY

#: Value of 'LINEAR' in a keyframe's `interpolation`; every frame is keyed, so nothing lies between.
LINEAR = 1


@dataclass(frozen=True)
class Motion:
    """M = {m_t} as arrays, metres and quaternions w first, at `frame_rate`."""

    #: World, shape (frames, 3).
    root_positions: np.ndarray
    #: Shape (frames, joints, 4); the root's in the world, the others relative to their parent.
    rotations: np.ndarray
    frame_rate: float


def resample(motion: Motion, frame_rate: float) -> Motion:
    """The motion at another frame rate: positions interpolated linearly, rotations along the shortest arc.

    The last sample is the last posture, held where the rates do not divide.
    """
    frames = len(motion.root_positions)
    if frames == 0 or abs(frame_rate - motion.frame_rate) < 1e-9:
        return motion
    count = int(np.ceil((frames - 1) / motion.frame_rate * frame_rate - 1e-6)) + 1
    times = np.minimum(np.arange(count) * (motion.frame_rate / frame_rate), frames - 1)
    first = np.minimum(times.astype(int), max(frames - 2, 0))
    second = np.minimum(first + 1, frames - 1)
    part = times - first
    positions = motion.root_positions.astype(np.float64)
    rotations = motion.rotations.astype(np.float64)
    return Motion(
        positions[first] + (positions[second] - positions[first]) * part[:, None],
        slerp(rotations[first], rotations[second], part[:, None]),
        frame_rate,
    )


def slerp(a: np.ndarray, b: np.ndarray, part: np.ndarray) -> np.ndarray:
    """Spherical interpolation of quaternions (…, 4), by the shorter way; `part` in 0..1 broadcasts over (…)."""
    dot = np.sum(a * b, axis=-1)
    b = np.where(dot[..., None] < 0.0, -b, b)
    angle = np.arccos(np.clip(np.abs(dot), 0.0, 1.0))
    sine = np.sin(angle)
    near = sine < 1e-6
    safe = np.where(near, 1.0, sine)
    weight_a = np.where(near, 1.0 - part, np.sin((1.0 - part) * angle) / safe)
    weight_b = np.where(near, part, np.sin(part * angle) / safe)
    out = weight_a[..., None] * a + weight_b[..., None] * b
    return out / np.linalg.norm(out, axis=-1, keepdims=True)


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
    rotations[:, 0] = _multiply(matrix_to_quaternion(spin), rotations[:, 0])
    for joint in range(len(names)):
        b = matrix_to_quaternion(rest[joint])
        rotations[:, joint] = _multiply(_multiply(b * [1, -1, -1, -1], rotations[:, joint]), b)
    return locations, continuous(rotations)


def continuous(rotations: np.ndarray) -> np.ndarray:
    """The same rotations with signs chosen so that no quaternion channel jumps from one frame to the next."""
    out = rotations.copy()
    if len(out):
        out[0] *= np.where(out[0, :, :1] < 0.0, -1.0, 1.0)
        flips = np.sum(out[1:] * out[:-1], axis=-1) < 0.0
        # Each flip turns all the frames after it.
        sign = np.where(np.logical_xor.accumulate(flips, axis=0), -1.0, 1.0)
        out[1:] *= sign[..., None]
    return out


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


def matrix_to_quaternion(matrix: np.ndarray) -> np.ndarray:
    """Quaternion (w, x, y, z) of a rotation matrix (3, 3)."""
    m = matrix
    k = np.array(
        [
            [m[0, 0] + m[1, 1] + m[2, 2], m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]],
            [0.0, m[0, 0] - m[1, 1] - m[2, 2], m[0, 1] + m[1, 0], m[0, 2] + m[2, 0]],
            [0.0, 0.0, m[1, 1] - m[0, 0] - m[2, 2], m[1, 2] + m[2, 1]],
            [0.0, 0.0, 0.0, m[2, 2] - m[0, 0] - m[1, 1]],
        ]
    )
    # Bar-Itzhack 2000: the quaternion is the eigenvector of the largest eigenvalue; eigh reads the upper triangle.
    _, vectors = np.linalg.eigh(k / 3.0, UPLO="U")
    quaternion = vectors[:, -1]
    return quaternion if quaternion[0] >= 0.0 else -quaternion


def _multiply(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Hamilton product of quaternions (…, 4), w first."""
    aw, ax, ay, az = np.moveaxis(np.asarray(a), -1, 0)
    bw, bx, by, bz = np.moveaxis(np.asarray(b), -1, 0)
    return np.stack(
        [
            aw * bw - ax * bx - ay * by - az * bz,
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
        ],
        axis=-1,
    )
