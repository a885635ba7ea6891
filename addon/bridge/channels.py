# SPDX-License-Identifier: GPL-3.0-or-later
"""The channels of a bone: which place and turn it, by whichever mode it turns, and what their curves are called."""

from __future__ import annotations

import numpy as np
from mathutils import Euler, Quaternion

from ..key_fit import BoneKeys
from .curves import Keys

LOCATION, ROTATION, ANGLES = "location", "rotation_quaternion", "rotation_euler"
#: Over which part of a frame it is told how fast angles change.
STEP = 0.05

#: The keys of one curve, by its bone, channel and axis.
CurveKeys = tuple[tuple[str, str, int], Keys]


def rotation_values(rotation_mode: str, quaternions: np.ndarray) -> tuple[str, np.ndarray]:
    """The channel that turns a bone of this mode, and its values (frames, axes) for quaternions (frames, 4)."""
    if rotation_mode == "QUATERNION":
        return ROTATION, quaternions
    if rotation_mode == "AXIS_ANGLE":
        length = np.linalg.norm(quaternions[:, 1:], axis=1, keepdims=True)
        axes = np.where(length > 1e-9, quaternions[:, 1:] / np.maximum(length, 1e-9), (0.0, 1.0, 0.0))
        return "rotation_axis_angle", np.hstack([2.0 * np.arctan2(length, quaternions[:, :1]), axes])
    angles: list[Euler] = []
    for quaternion in quaternions:
        turn = Quaternion(quaternion)
        # Of the angles that turn alike those that are nearest to the frame before.
        angles.append(turn.to_euler(rotation_mode, angles[-1]) if angles else turn.to_euler(rotation_mode))
    return ANGLES, np.array(angles, dtype=np.float64).reshape(-1, 3)


def angle_keys(keys: BoneKeys, angles: np.ndarray, rotation_mode: str, most: float) -> BoneKeys | None:
    """Keys of quaternions as keys of the angles that turn alike: `angles` (frames, 3) as `rotation_values` gives them.
    None where the curves of these would turn by more than `most`, radians, otherwise than the quaternions' do."""
    values = angles[keys.frames]

    def slopes(fast: np.ndarray) -> np.ndarray:
        found = np.full(values.shape, np.nan)
        for k in np.flatnonzero(np.isfinite(fast[:, :4]).all(axis=1)):
            near = Euler(values[k], rotation_mode)
            ahead, behind = (
                Quaternion(keys.values[k, :4] + step * fast[k, :4]).normalized().to_euler(rotation_mode, near)
                for step in (STEP, -STEP)
            )
            found[k] = (np.array(ahead) - np.array(behind)) / (2.0 * STEP)
        return found

    made = BoneKeys(keys.frames, values, slopes(keys.before), slopes(keys.after))
    for k, span in enumerate(np.diff(keys.frames)):
        turns, seen = (_between(one, k, int(span)) for one in (keys, made))
        for turn, angle in zip(turns[:, :4], seen, strict=True):
            other = Euler(angle, rotation_mode).to_quaternion()
            if abs(Quaternion(turn).normalized().dot(other)) < np.cos(most / 2.0):
                return None
    return made


def _between(keys: BoneKeys, k: int, span: int) -> np.ndarray:
    """What the curves of keys play at the half frames between one and the next."""
    t = np.arange(1, 2 * span)[:, None] / (2.0 * span)
    first, last = keys.values[k], keys.values[k + 1]
    handles = first + keys.after[k] * span / 3.0, last - keys.before[k + 1] * span / 3.0
    r = 1.0 - t
    played: np.ndarray = r**3 * first + 3.0 * r * r * t * handles[0] + 3.0 * r * t * t * handles[1] + t**3 * last
    return played


def data_path(bone: str, channel: str) -> str:
    return f'pose.bones["{bone}"].{channel}'
