# SPDX-License-Identifier: GPL-3.0-or-later
"""Few keys for a motion: which bones share them, how near they keep to it, and when they lie in any case.

The curves themselves are fitted by the core, which knows bones and tolerances, but no person.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from . import native
from .quaternions import to_matrix

Numbers = NDArray[np.float64]
Marks = NDArray[np.bool_]

#: Bones that share their key frames, each limb after those that it hangs on.
LIMBS = (
    ("Hips",),
    ("Spine", "Spine1", "Spine2", "Neck", "Head"),
    *((f"{side}Shoulder", f"{side}Arm", f"{side}ForeArm", f"{side}Hand") for side in ("Left", "Right")),
    *((f"{side}UpLeg", f"{side}Leg", f"{side}Foot", f"{side}Toe") for side in ("Left", "Right")),
)
#: The bones that stand where a foot is planted, by the columns of a motion's contacts.
FEET = (("LeftFoot", "LeftToe"), ("RightFoot", "RightToe"))
#: How far hands and feet may be from the motion where the artist has not said it, millimetres.
TOLERANCE_MM = 3.0
#: Beside it, how far a joint may be turned from its own, degrees.
TURN = 1.0
#: Shares of these for what carries limbs: its errors add to theirs, and it has few curves.
PLACES = {
    "Hips": 1.0 / 3.0,
    "Spine2": 2.0 / 3.0,
    "Neck": 2.0 / 3.0,
    **dict.fromkeys(("LeftHand", "RightHand", *FEET[0], *FEET[1]), 1.0),
}
TURNS = {"Hips": 0.1, "Spine": 0.3, "Spine1": 0.3, "Spine2": 0.3}
#: How far what stands may drift from a frame to the next beyond what it does in the motion, of a place's tolerance.
DRIFT = 0.6
#: A contact of more than this is planted.
PLANTED = 0.75


@dataclass(frozen=True)
class Rest:
    """The rest pose of bones, parents before children: each in its parent's rest frame."""

    names: list[str]
    #: -1 for none.
    parents: list[int]
    #: Armature space, shape (bones, 3).
    offsets: Numbers
    #: Quaternions, w first, shape (bones, 4).
    rotations: Numbers
    #: How many of its units are a metre.
    units_per_metre: float


@dataclass(frozen=True)
class Channels:
    """What the curves of bones are to play or do play, at equal steps of time."""

    #: The first bone's location in its rest frame, shape (times, 3).
    locations: Numbers
    #: Quaternions, w first, with signs that do not jump, shape (times, bones, 4).
    rotations: Numbers


@dataclass(frozen=True)
class BoneKeys:
    """The new keys of a bone: channels w, x, y, z, and of the first bone its location after them."""

    #: Counted from the motion's first, ascending.
    frames: NDArray[np.int64]
    #: Shape (keys, channels).
    values: Numbers
    #: How fast they change before and after each key, a frame; NaN where the curve there stays or there is none.
    before: Numbers
    after: Numbers


def limbs_of(rest: Rest) -> list[list[int]]:
    """The bones of each limb; one that no limb names goes with its parent, and with the first limb without one."""
    where = {bone: k for k, limb in enumerate(LIMBS) for bone in limb}
    found: list[int] = []
    for bone, parent in zip(rest.names, rest.parents, strict=True):
        found.append(where.get(bone, found[parent] if parent >= 0 else 0))
    limbs = [[bone for bone, limb in enumerate(found) if limb == k] for k in range(len(LIMBS))]
    return [limb for limb in limbs if limb]


def places_of(rest: Rest, channels: Channels) -> Numbers:
    """Where the bones' heads are, armature space, shape (times, bones, 3)."""
    turns: list[Numbers] = []
    heads: list[Numbers] = []
    for bone, parent in enumerate(rest.parents):
        own = channels.rotations[:, bone] / np.linalg.norm(channels.rotations[:, bone], axis=1, keepdims=True)
        before = np.broadcast_to(to_matrix(rest.rotations[bone]), (len(own), 3, 3))
        head = np.broadcast_to(rest.offsets[bone], (len(own), 3))
        if parent >= 0:
            before, head = turns[parent] @ before, heads[parent] + (turns[parent] @ head[..., None])[..., 0]
        if bone == 0:
            head = head + (before @ channels.locations[..., None])[..., 0]
        heads.append(head)
        turns.append(before @ to_matrix(own))
    found: Numbers = np.stack(heads, axis=1)
    return found


def planted_frames(contacts: NDArray[np.float32], core_rate: float, scene_rate: float, count: int) -> Marks:
    """Whether each foot is planted at each frame of the scene, shape (count, 2): at both of the core's beside it."""
    if not len(contacts):
        return np.zeros((count, 2), dtype=bool)
    times = np.minimum(np.arange(count) * (core_rate / scene_rate), len(contacts) - 1.0)
    near = [contacts[np.clip(whole(times).astype(int), 0, len(contacts) - 1)] for whole in (_down, _up)]
    marks: Marks = (near[0] > PLANTED) & (near[1] > PLANTED)
    return marks


def _down(times: Numbers) -> Numbers:
    return np.floor(times + 1e-6)


def _up(times: Numbers) -> Numbers:
    return np.ceil(times - 1e-6)


def fit(
    rest: Rest,
    wanted: Channels,
    planted: Marks,
    tolerance_mm: float,
    played: Channels | None = None,
    stays: Marks | None = None,
    *,
    as_one: bool = False,
    own: dict[str, tuple[float, float]] | None = None,
) -> list[BoneKeys]:
    """The new keys of each bone for one pose a frame, no further from it than the tolerance at frames and between them.

    `planted` (frames, 2): whether left and right foot stand. Where `stays` (frames, bones) says so, the curves stay
    from a frame to the next as `played` has them at every half frame. `as_one`: all bones share their keys. `own`: of
    bones that are no person's, by how many tolerances their heads may be off and they may be turned.
    """
    count = len(wanted.locations)
    metres = tolerance_mm / 1000.0
    degrees = TURN * tolerance_mm / TOLERANCE_MM
    shares = [(own or {}).get(name, (PLACES.get(name, math.inf), TURNS.get(name, 1.0))) for name in rest.names]
    tolerances = np.array(
        [(place * metres * rest.units_per_metre, math.radians(turn * degrees)) for place, turn in shares]
    ).reshape(-1, 2)
    stands = np.zeros((count, len(rest.names)), dtype=bool)
    keyed: dict[str, list[int]] = {}
    for side, bones in enumerate(FEET):
        steady = planted[:-1, side] & planted[1:, side]
        # A foot comes down on the first planted frame and goes up on the last.
        turns = np.flatnonzero(planted[1:, side] != planted[:-1, side])
        for bone in bones:
            keyed[bone] = [int(frame) + int(planted[frame + 1, side]) for frame in turns]
            if bone in rest.names:
                stands[:-1, rest.names.index(bone)] = steady
    limbs = []
    for limb in [list(range(len(rest.names)))] if as_one else limbs_of(rest):
        frames = {frame for bone in limb for frame in keyed.get(rest.names[bone], [])}
        limbs.append((limb, sorted(frames)))
    fitted = native.core.fit_keys(
        rest.parents,
        rest.offsets,
        rest.rotations,
        limbs,
        tolerances,
        stands,
        DRIFT * metres * rest.units_per_metre,
        np.ascontiguousarray(wanted.locations, dtype=np.float64),
        np.ascontiguousarray(wanted.rotations, dtype=np.float64),
        None if played is None else np.ascontiguousarray(played.locations, dtype=np.float64),
        None if played is None else np.ascontiguousarray(played.rotations, dtype=np.float64),
        stays,
    )
    return [BoneKeys(*keys) for keys in fitted]
