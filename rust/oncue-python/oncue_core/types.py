"""The plain dicts that go in and come out."""

from typing import TypedDict

import numpy as np
from numpy.typing import NDArray


class ProgressSnapshot(TypedDict):
    """What a job has got to. `reward` and `success_rate` are those of the last update."""

    stage: str
    fraction: float
    update: int
    reward: float
    success_rate: float


class BoxNode(TypedDict):
    """A box that moves with a joint, axis-aligned in the joint's rest frame, metres."""

    limb: str
    joint: str
    center: tuple[float, float, float]
    half_extents: tuple[float, float, float]


class Skeleton(TypedDict):
    """The unified skeleton. `joint_offsets` (22, 3): from the parent's joint, metres; the root's is its rest place."""

    names: list[str]
    parents: list[int]
    joint_offsets: NDArray[np.float32]
    boxes: list[BoxNode]
    rest_hips_height: float
    ankle_height: float
    toe_height: float
    toe_length: float
    heel_length: float
