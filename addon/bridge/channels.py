# SPDX-License-Identifier: GPL-3.0-or-later
"""The channels of a bone: which place and turn it, by whichever mode it turns, and what their curves are called."""

from __future__ import annotations

import numpy as np
from mathutils import Euler, Quaternion

from .curves import Keys

LOCATION, ROTATION = "location", "rotation_quaternion"

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
    return "rotation_euler", np.array(angles, dtype=np.float64).reshape(-1, 3)


def data_path(bone: str, channel: str) -> str:
    return f'pose.bones["{bone}"].{channel}'
