# SPDX-License-Identifier: GPL-3.0-or-later
"""The text of a .bvh file from where the bones of any armature are, frame by frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: A joint that stays within this share of the skeleton's size of its place in its parent has no position channels.
STAYS = 1e-4
#: In a metre: what most programs expect a .bvh to be in, and digits enough for small scenes.
CENTIMETRES = 100.0
#: Of the joint over all others, where several bones have no parent.
ROOT_NAME = "Root"


@dataclass(frozen=True)
class BoneMotion:
    """Bones over time in one space, whatever its unit: Z is up where the person stands upright."""

    #: Parents before children; −1 for one without.
    names: tuple[str, ...]
    parents: tuple[int, ...]
    #: At rest: where each bone begins and ends, (bones, 3), and how it is turned, (bones, 3, 3).
    rest_heads: Array
    rest_tails: Array
    rest_turns: Array
    #: On each frame: (frames, bones, 3) and (frames, bones, 3, 3). Neither has to be free of scale.
    heads: Array
    turns: Array
    #: Frames a second.
    rate: float


def bvh_text(motion: BoneMotion) -> str:
    """The motion as a .bvh: at rest all joints are unturned, as the bones are at rest.

    A reflection, as of a mirrored armature, is kept in the places of the joints.
    """
    motion = _with_one_root(motion)
    parents = motion.parents
    # How each bone is turned from its rest: what reflects or scales the armature is on both sides.
    turns = _turned(motion.turns) @ np.swapaxes(_turned(motion.rest_turns), -1, -2)
    offsets = motion.rest_heads.copy()
    places, local = motion.heads.copy(), turns.copy()
    for bone, parent in enumerate(parents):
        if parent < 0:
            offsets[bone] = 0.0
            continue
        offsets[bone] -= motion.rest_heads[parent]
        back = np.swapaxes(turns[:, parent], -1, -2)
        places[:, bone] = (back @ (motion.heads[:, bone] - motion.heads[:, parent])[..., None])[..., 0]
        local[:, bone] = back @ turns[:, bone]
    size = float(np.ptp(motion.rest_heads, axis=0).max()) or 1.0
    moves = [
        parent < 0 or bool(np.abs(places[:, bone] - offsets[bone]).max() > STAYS * size)
        for bone, parent in enumerate(parents)
    ]
    head, order = _hierarchy(motion, offsets, moves)
    angles = _angles(local)
    columns = [
        np.concatenate([CENTIMETRES * places[:, bone], angles[:, bone]], axis=1) if moves[bone] else angles[:, bone]
        for bone in order
    ]
    rows = [" ".join(f"{value:.6f}" for value in row) for row in np.concatenate(columns, axis=1).tolist()]
    return "\n".join([*head, "MOTION", f"Frames: {len(rows)}", f"Frame Time: {1.0 / motion.rate:.9f}", *rows, ""])


def _with_one_root(motion: BoneMotion) -> BoneMotion:
    """The motion with one bone over all, at the origin, where several have no parent: the format knows one root."""
    if sum(parent < 0 for parent in motion.parents) == 1:
        return motion
    frames = len(motion.heads)
    name = ROOT_NAME
    while name in motion.names:
        name += "_"
    return BoneMotion(
        (name, *motion.names),
        (-1, *(parent + 1 for parent in motion.parents)),
        np.concatenate([np.zeros((1, 3)), motion.rest_heads]),
        np.concatenate([np.zeros((1, 3)), motion.rest_tails]),
        np.concatenate([np.eye(3)[None], motion.rest_turns]),
        np.concatenate([np.zeros((frames, 1, 3)), motion.heads], axis=1),
        np.concatenate([np.broadcast_to(np.eye(3), (frames, 1, 3, 3)), motion.turns], axis=1),
        motion.rate,
    )


def _turned(matrices: Array) -> Array:
    """The turn that is nearest to each matrix, a reflection where the matrix reflects."""
    left, _, right = np.linalg.svd(matrices)
    return np.asarray(left @ right)


def _angles(turns: Array) -> Array:
    """About Z, X and Y, degrees: the turn is Z·X·Y."""
    x = np.arcsin(np.clip(turns[..., 2, 1], -1.0, 1.0))
    z = np.arctan2(-turns[..., 0, 1], turns[..., 1, 1])
    y = np.arctan2(-turns[..., 2, 0], turns[..., 2, 2])
    # Where the middle angle is a right one the outer two turn about the same axis.
    poles = np.hypot(turns[..., 0, 1], turns[..., 1, 1]) < 1e-9
    z = np.where(poles, np.arctan2(turns[..., 1, 0], turns[..., 0, 0]), z)
    y = np.where(poles, 0.0, y)
    return np.asarray(np.degrees(np.stack([z, x, y], axis=-1)))


def _hierarchy(motion: BoneMotion, offsets: Array, moves: list[bool]) -> tuple[list[str], list[int]]:
    """The lines of the HIERARCHY, and the bones in its order."""
    lines, order = ["HIERARCHY"], []
    children: list[list[int]] = [[] for _ in motion.parents]
    for child, parent in enumerate(motion.parents):
        if parent >= 0:
            children[parent].append(child)
    # Bones to open, None where one is closed: deep armatures would be too deep for a function that calls itself.
    todo: list[int | None] = [motion.parents.index(-1)]
    depth = 0
    while todo:
        bone = todo.pop()
        if bone is None:
            depth -= 1
            lines.append("}")
            continue
        order.append(bone)
        rotations = "Zrotation Xrotation Yrotation"
        channels = f"6 Xposition Yposition Zposition {rotations}" if moves[bone] else f"3 {rotations}"
        lines += [
            f"{'JOINT' if depth else 'ROOT'} {_one_line(motion.names[bone])}",
            "{",
            f"OFFSET {_numbers(offsets[bone])}",
            f"CHANNELS {channels}",
        ]
        if not children[bone]:
            end = motion.rest_tails[bone] - motion.rest_heads[bone]
            lines += ["End Site", "{", f"OFFSET {_numbers(end)}", "}"]
        depth += 1
        todo.append(None)
        todo += reversed(children[bone])
    return lines, order


def _numbers(vector: Array) -> str:
    return " ".join(f"{value:.6f}" for value in (CENTIMETRES * vector).tolist())


def _one_line(name: str) -> str:
    """A name without what would end its line or open its joint."""
    return " ".join(name.replace("{", "(").replace("}", ")").split()) or "_"
