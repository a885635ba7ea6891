# SPDX-License-Identifier: GPL-3.0-or-later
"""Rotations as arrays of quaternions (…, 4), w first."""

from __future__ import annotations

import numpy as np

#: Multiplied with a unit quaternion it gives the inverse.
CONJUGATE = np.array([1.0, -1.0, -1.0, -1.0])


def multiply(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Hamilton product: first `b`, then `a`."""
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


def slerp(a: np.ndarray, b: np.ndarray, part: np.ndarray) -> np.ndarray:
    """Spherical interpolation by the shorter way; `part` in 0..1 broadcasts over (…)."""
    dot = np.sum(a * b, axis=-1)
    b = np.where(dot[..., None] < 0.0, -b, b)
    angle = np.arccos(np.clip(np.abs(dot), 0.0, 1.0))
    sine = np.sin(angle)
    near = sine < 1e-6
    safe = np.where(near, 1.0, sine)
    weight_a = np.where(near, 1.0 - part, np.sin((1.0 - part) * angle) / safe)
    weight_b = np.where(near, part, np.sin(part * angle) / safe)
    out = weight_a[..., None] * a + weight_b[..., None] * b
    unit: np.ndarray = out / np.linalg.norm(out, axis=-1, keepdims=True)
    return unit


def continuous(rotations: np.ndarray) -> np.ndarray:
    """The same rotations (frames, joints, 4) with signs chosen so that no channel jumps from one frame to the next."""
    out = rotations.copy()
    if len(out):
        out[0] *= np.where(out[0, :, :1] < 0.0, -1.0, 1.0)
        flips = np.sum(out[1:] * out[:-1], axis=-1) < 0.0
        # Each flip turns all the frames after it.
        sign = np.where(np.logical_xor.accumulate(flips, axis=0), -1.0, 1.0)
        out[1:] *= sign[..., None]
    return out


def to_matrix(quaternions: np.ndarray) -> np.ndarray:
    """The rotation matrices (…, 3, 3) of unit quaternions (…, 4)."""
    w, x, y, z = np.moveaxis(np.asarray(quaternions, dtype=np.float64), -1, 0)
    rows = [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def from_matrix(matrices: np.ndarray) -> np.ndarray:
    """The quaternions (…, 4) of rotation matrices (…, 3, 3), with w ≥ 0."""
    m = np.asarray(matrices, dtype=np.float64)
    k = np.zeros((*m.shape[:-2], 4, 4))
    k[..., 0, 0] = m[..., 0, 0] + m[..., 1, 1] + m[..., 2, 2]
    k[..., 0, 1] = m[..., 2, 1] - m[..., 1, 2]
    k[..., 0, 2] = m[..., 0, 2] - m[..., 2, 0]
    k[..., 0, 3] = m[..., 1, 0] - m[..., 0, 1]
    k[..., 1, 1] = m[..., 0, 0] - m[..., 1, 1] - m[..., 2, 2]
    k[..., 1, 2] = m[..., 0, 1] + m[..., 1, 0]
    k[..., 1, 3] = m[..., 0, 2] + m[..., 2, 0]
    k[..., 2, 2] = m[..., 1, 1] - m[..., 0, 0] - m[..., 2, 2]
    k[..., 2, 3] = m[..., 1, 2] + m[..., 2, 1]
    k[..., 3, 3] = m[..., 2, 2] - m[..., 0, 0] - m[..., 1, 1]
    # Bar-Itzhack 2000: the quaternion is the eigenvector of the largest eigenvalue; eigh reads the upper triangle.
    _, vectors = np.linalg.eigh(k / 3.0, UPLO="U")
    quaternions: np.ndarray = vectors[..., -1]
    return np.where(quaternions[..., :1] >= 0.0, quaternions, -quaternions)
