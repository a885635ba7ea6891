# SPDX-License-Identifier: GPL-3.0-or-later
"""What a hand opens (doors, lids, drawers), read from a table, and where one stands or sits to do it. Knows no Blender.

A table has a row a moving part: joint (hinge or slide), axis with the sign that a positive value opens, origin, range,
contact point and where that ends. Objects stand on z = 0 and face -Y. Metres.
"""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

#: Objects no taller than this stand on a table and are opened seated, metres.
ON_A_TABLE, TABLE = 0.08, 0.74
#: How far from the middle of the hand's way the body stands or sits, metres.
AN_ARM_AWAY = 0.42
#: The share of its range to which a door is pulled by who stands before it.
PULLED = 0.55
#: The stool of who sits, and how high the pelvis joint is over a seat.
SEAT, PELVIS_OVER_SEAT = 0.45, 0.10
#: The table: its middle on the floor, and its width and depth.
TABLE_PLACE, TABLE_SIZE = (0.0, 0.05), (1.2, 0.6)


@dataclass(frozen=True)
class Opening:
    """A part of an object that opens."""

    file: str
    object: str
    part: str
    slides: bool
    axis: np.ndarray
    origin: np.ndarray
    contact: np.ndarray
    #: The opened joint's value: degrees, or metres where it slides.
    most: float
    #: Height of what the object stands on.
    lift: float

    @property
    def seated(self) -> bool:
        return self.lift > 0.0

    @property
    def swings(self) -> bool:
        """Whether it turns about an upright hinge."""
        return not self.slides and abs(self.axis[2]) > 0.5

    def by_hand(self) -> Opening:
        """Opened no farther than who stands before it pulls.

        Beyond that the face that the hand holds turns away from the person, who would let go or walk along.
        """
        return replace(self, most=self.most * PULLED) if self.swings else self

    def held(self, values: np.ndarray) -> np.ndarray:
        """Where the contact point is at values of the joint, (n, 3)."""
        values = np.asarray(values, dtype=float)[:, None]
        if self.slides:
            return self.contact + self.axis * values
        # Rodrigues' rotation of the arm about the axis.
        arm, angle = self.contact - self.origin, np.radians(values)
        along = self.axis * (self.axis @ arm)
        turned = np.cos(angle) * (arm - along) + np.sin(angle) * np.cross(self.axis, arm)
        return self.origin + along + turned

    @cached_property
    def _way(self) -> np.ndarray:
        return self.held(np.linspace(0.0, self.most, 13))

    def stand(self) -> tuple[np.ndarray, float]:
        """Where on the floor one stands or sits and the heading, radians from +X: before the middle of the hand's way,
        clear of a leaf that swings out."""
        middle = self._way.mean(axis=0)
        if self.seated:
            # Room for the knees before the table: who sits down comes from the side.
            return np.array([middle[0], self._way[:, 1].min() - 0.50, 0.0]), math.pi / 2
        away = np.array([0.0, -1.0, 0.0])
        if self.swings:
            away = (middle - self.origin) * (1.0, 1.0, 0.0)
            away /= np.linalg.norm(away)
        reach = ((self._way - self.origin) @ away).max() - (middle - self.origin) @ away
        place = middle + away * max(AN_ARM_AWAY, reach + 0.22 if self.swings else 0.0)
        return place * (1.0, 1.0, 0.0), math.atan2(-away[1], -away[0])

    def begin(self) -> np.ndarray:
        """Where on the floor one sets out: behind where one stands, or beside where one sits."""
        place, heading = self.stand()
        if self.seated:
            return place + np.array([1.0, -1.0, 0.0])
        return place - 1.4 * np.array([math.cos(heading), math.sin(heading), 0.0])


def read_openings(table: Path, name: str | None = None) -> list[Opening]:
    """The parts of the table, or of its object `name`. Raises SystemExit with a sentence when there are none."""
    with table.open(encoding="utf-8", newline="") as file:
        rows = [row for row in csv.DictReader(file, delimiter="\t") if name in (None, row["object"])]
    if not rows:
        raise SystemExit(f"{table} has no row of an object named {name}.")
    return [_opening(row) for row in rows]


def _opening(row: dict[str, str]) -> Opening:
    def vector(column: str) -> np.ndarray:
        return np.array([float(word) for word in row[column].split()])

    lift = TABLE if vector("size_xyz_m")[2] < ON_A_TABLE else 0.0
    raised = np.array([0.0, 0.0, lift])
    return Opening(
        file=row["file"],
        object=row["object"],
        part=row["moving_node"],
        slides=row["joint"] == "slide",
        axis=vector("axis_xyz"),
        origin=vector("origin_xyz") + raised,
        contact=vector("contact_xyz") + raised,
        most=float(row["range_max"]),
        lift=lift,
    )
