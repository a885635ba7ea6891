# SPDX-License-Identifier: GPL-3.0-or-later
"""Motion as arrays, and the same at another frame rate."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .quaternions import slerp


@dataclass(frozen=True)
class Motion:
    """M = {m_t} as arrays, metres and quaternions w first, at `frame_rate`."""

    #: World, shape (frames, 3).
    root_positions: np.ndarray
    #: Shape (frames, joints, 4); the root's in the world, the others relative to their parent.
    rotations: np.ndarray
    frame_rate: float

    def __len__(self) -> int:
        return len(self.root_positions)


def resample(motion: Motion, frame_rate: float) -> Motion:
    """The motion at another frame rate: positions interpolated linearly, rotations along the shortest arc.

    The last sample is the last posture, held where the rates do not divide.
    """
    frames = len(motion)
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
