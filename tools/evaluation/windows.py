"""What a classifier sees of a motion: one-second windows, and how each joint moves in them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

Floats = NDArray[np.float64]

FRAME_RATE = 30
#: Frames of a window, and from one to the next.
WINDOW, STEP = 30, 15
#: Captured noise and rounding are no style: positions are low-passed by a Gaussian of this many frames.
SMOOTHING = 1.5
#: Slower than this a window is not one of walking, m/s.
WALKING = 0.4
#: Lower than this share of its height at rest the pelvis is on its way to a seat.
UPRIGHT = 0.85
#: A sit: from so long before the body is seated until so long after, seconds.
SIT = (2.0, 1.0)
#: Directions of the pelvis's frame: at rest a person faces -Y with the left at +X.
DIRECTIONS = {"forward": (0, -1, 0), "left": (1, 0, 0), "up": (0, 0, 1)}


def rotated(quaternions: Floats, vectors: Floats) -> Floats:
    """Vectors (…, 3) turned by unit quaternions (…, 4), w first."""
    w, axis = quaternions[..., :1], quaternions[..., 1:]
    twice = 2 * np.cross(axis, vectors)
    return vectors + w * twice + np.cross(axis, twice)


def product(a: Floats, b: Floats) -> Floats:
    """Quaternions (…, 4), w first: first `b`, then `a`."""
    w = a[..., :1] * b[..., :1] - np.sum(a[..., 1:] * b[..., 1:], axis=-1, keepdims=True)
    xyz = a[..., :1] * b[..., 1:] + b[..., :1] * a[..., 1:] + np.cross(a[..., 1:], b[..., 1:])
    return np.concatenate([w, xyz], axis=-1)


def joint_positions(root_positions: Floats, rotations: Floats, parents: Sequence[int], offsets: Floats) -> Floats:
    """Joints in the world (frames, joints, 3), metres, of a motion as a synthesis gives it."""
    positions = np.empty((*rotations.shape[:2], 3))
    turns = np.empty(rotations.shape)
    positions[:, 0], turns[:, 0] = root_positions, rotations[:, 0]
    for joint in range(1, len(parents)):
        parent = parents[joint]
        positions[:, joint] = positions[:, parent] + rotated(turns[:, parent], offsets[joint])
        turns[:, joint] = product(turns[:, parent], rotations[:, joint])
    return positions


class Body:
    """The skeleton that motions are on. `skeleton`: as `oncue_core.skeleton()` gives it."""

    def __init__(self, skeleton) -> None:
        self.parents = skeleton["parents"]
        self.offsets = np.asarray(skeleton["joint_offsets"], dtype=np.float64)
        self.hips_height = float(skeleton["rest_hips_height"])
        names = skeleton["names"]
        #: Toes are as much the capture's reading as the body's.
        self.seen = [joint for joint, name in enumerate(names) if "Toe" not in name]
        self.names = [f"{names[joint]}, {what} of speed" for joint in self.seen for what in ("mean", "largest", "sd")]
        # The pelvis is where its own frame is: its range there is always none.
        self.names += [f"{names[joint]}, range {side}" for joint in self.seen if joint for side in DIRECTIONS]

    def low_passed(self, root_positions, rotations) -> tuple[Floats, Floats]:
        """Joints (frames, joints, 3) in the world and in the pelvis's frame, metres."""
        rotations = np.asarray(rotations, dtype=np.float64)
        positions = joint_positions(np.asarray(root_positions, dtype=np.float64), rotations, self.parents, self.offsets)
        inverse = rotations[:, :1] * np.array([1, -1, -1, -1])
        own = rotated(np.broadcast_to(inverse, (*positions.shape[:2], 4)), positions - positions[:, :1])
        return gaussian_filter1d(positions, SMOOTHING, axis=0), gaussian_filter1d(own, SMOOTHING, axis=0)

    def features(self, world: Floats, own: Floats) -> Floats:
        """Of one window, in the order of `names`: speeds in cm/s, ranges in cm. Nothing tells where a joint is."""
        speeds = 100 * FRAME_RATE * np.linalg.norm(np.diff(world[:, self.seen], axis=0), axis=-1)
        style = np.stack([speeds.mean(axis=0), speeds.max(axis=0), speeds.std(axis=0)], axis=1)
        along = own[:, self.seen[1:]] @ np.array(list(DIRECTIONS.values()), dtype=np.float64).T
        return np.concatenate([style.ravel(), 100 * np.ptp(along, axis=0).ravel()])

    def walks(self, root_positions, rotations, spans: Iterable[tuple[int, int]], floor: float = 0.0) -> list[Floats]:
        """The features of every window within the spans (first frame, frame after the last) in which one walks."""
        world, own = self.low_passed(root_positions, rotations)
        found = []
        for first, end in spans:
            for start in range(first, end - WINDOW + 1, STEP):
                window = slice(start, start + WINDOW)
                hips = world[window, 0]
                speed = FRAME_RATE * np.linalg.norm(np.diff(hips[:, :2], axis=0), axis=1).mean()
                if speed > WALKING and hips[:, 2].min() - floor > UPRIGHT * self.hips_height:
                    found.append(self.features(world[window], own[window]))
        return found

    def sits(self, root_positions, rotations, seated: Iterable[int]) -> list[Floats]:
        """The features of the windows around each frame of `seated`, from which on one sits."""
        world, own = self.low_passed(root_positions, rotations)
        found = []
        for complete in seated:
            first = max(complete - round(SIT[0] * FRAME_RATE), 0)
            end = min(complete + round(SIT[1] * FRAME_RATE), len(world))
            for start in range(first, end - WINDOW + 1, STEP):
                window = slice(start, start + WINDOW)
                found.append(self.features(world[window], own[window]))
        return found
