# SPDX-License-Identifier: GPL-3.0-or-later
"""Controls beside the chain of bones that a motion is written on, in groups that share their keys, and their curves."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

import bpy
import numpy as np

from ..key_fit import BoneKeys, Marks, Numbers
from .channels import ANGLES, LOCATION, ROTATION, CurveKeys, rotation_values
from .curves import every_frame, fitted

#: Ways to turn, as Blender calls them.
QUATERNIONS, EULER = "QUATERNION", "ZXY"


class Group(Protocol):
    """Controls that share their keys. What they play are numbers for each frame: values, (frames, columns)."""

    #: The first of them, by which they are called.
    name: str
    #: (bone, channel, axis) of each column.
    columns: list[tuple[str, str, int]]
    #: The same of channels that lie at rest.
    still: list[tuple[str, str, int]]
    #: The core's joints that they move.
    shows: tuple[str, ...]

    def turns(self, values: Numbers) -> dict[str, Numbers]:
        """The rotations of its bones, quaternions (frames, 4)."""
        ...

    def fit(
        self,
        values: Numbers,
        planted: Marks,
        tolerance_mm: float,
        units_per_metre: float,
        played: Numbers | None = None,
        stays: Marks | None = None,
    ) -> list[tuple[BoneKeys, int]]:
        """Few keys for each column, and which channel of these it is; arguments as of `key_fit.fit`."""
        ...


def keys_of(
    character: bpy.types.Object,
    group: Group,
    values: Numbers,
    planted: Marks,
    tolerance_mm: float | None,
    units_per_metre: float,
    start_frame: int,
) -> Iterator[CurveKeys]:
    """The keys of a group's columns, few with a tolerance, or else one on every frame. A bone that turns in another way
    than its columns do is keyed on every frame in its own."""
    frames = start_frame + np.arange(len(values), dtype=np.float64)
    other = {bone for bone, _ in turned_otherwise(character, group.columns)}
    for bone, turns in group.turns(values).items():
        if bone in other:
            channel, seen = rotation_values(character.pose.bones[bone].rotation_mode, turns)
            yield from (((bone, channel, axis), every_frame(frames, seen[:, axis])) for axis in range(seen.shape[1]))
    if tolerance_mm is None:
        keys = [every_frame(frames, values[:, k]) for k in range(len(group.columns))]
    else:
        few = group.fit(values, planted, tolerance_mm, units_per_metre)
        keys = [fitted(of_bone, channel, start_frame) for of_bone, channel in few]
    for (bone, channel, axis), written in zip(group.columns, keys, strict=True):
        if channel == LOCATION or bone not in other:
            yield (bone, channel, axis), written
    yield from ((column, every_frame(frames[:1], np.zeros(1))) for column in group.still if column[0] not in other)


def turned_otherwise(character: bpy.types.Object, columns: list[tuple[str, str, int]]) -> Iterator[tuple[str, str]]:
    """The bones that do not turn in the way of their columns, and the mode in which they would."""
    for bone, channel in dict.fromkeys((bone, channel) for bone, channel, _ in columns):
        mode = character.pose.bones[bone].rotation_mode
        if channel == ROTATION and mode != QUATERNIONS:
            yield bone, QUATERNIONS
        if channel == ANGLES and mode in (QUATERNIONS, "AXIS_ANGLE"):
            yield bone, EULER
