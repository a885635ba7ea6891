# SPDX-License-Identifier: GPL-3.0-or-later
"""Where to look at a figure from: camera places that rays say the body is seen from.

The near clipping plane is the cutaway: what is nearer to the camera than `see_from` (a wall, a ceiling, a lamp) is not
drawn, so a camera may stand behind it.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector
from mathutils.bvhtree import BVHTree

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent)]

from walk import JOINTS, Walk  # noqa: E402

from addon.bridge.scene_reader import read_scene  # noqa: E402

LENS = 40.0
#: Nearer to the end than this the picture of the whole way shows the last posture only, metres.
APART = 0.7
#: A joint lies inside the body: what is nearer to it than this does not hide it, metres.
FLESH = 0.12
#: The height over the floor that is in the middle of pictures taken alongside, metres.
MIDDLE = 0.90
#: Azimuths from the figure's facing that are tried, degrees; a view from the side shows feet, knees and back best.
AZIMUTHS = (-65, 65, -45, 45, -90, 90, -25, 25, -115, 115, 0, -140, 140, 180)
ELEVATIONS = (8, 22, 38, 55)
#: What a degree away from the first of each costs, in joints that are hidden.
AZIMUTH_COST, ELEVATION_COST, CUT_COST = 0.008, 0.022, 0.8


@dataclass(frozen=True)
class View:
    """A camera: its place, what it looks at, and from which distance on it sees."""

    place: Vector
    target: Vector
    see_from: float = 0.05
    #: The share of the wanted joints that can be seen.
    seen: float = 1.0


@dataclass(frozen=True)
class Shot:
    """What is to be seen: joints, the height of the target over their middle, how far off, and the room before them."""

    joints: tuple[str, ...]
    distance: float
    #: The figure's half depth that the cutaway must leave whole, metres.
    room: float


BODY = Shot(JOINTS, 3.3, 0.95)
FEET = Shot(("LeftFoot", "RightFoot", "LeftToe", "RightToe", "LeftLeg", "RightLeg"), 1.7, 0.7)
LEFT_HAND = Shot(("LeftHand", "LeftArm"), 1.5, 0.6)
RIGHT_HAND = Shot(("RightHand", "RightArm"), 1.5, 0.6)
SEAT = Shot(("Hips", "LeftHand", "RightHand", "LeftLeg", "RightLeg", "LeftFoot", "RightFoot"), 2.1, 0.8)


class Sight:
    """The scene as rays meet it, and the views of the figure in it."""

    def __init__(self, walk: Walk) -> None:
        self.walk = walk
        meshes = read_scene(bpy.context)
        self._tree = BVHTree.FromPolygons(meshes.positions.tolist(), meshes.triangles.tolist(), all_triangles=True)

    def hidden(self, point: Vector, towards: Vector, distance: float) -> Vector | None:
        """Where something hides a joint from a camera in the direction `towards`, or None."""
        place, _, _, _ = self._tree.ray_cast(point + towards * FLESH, towards, max(distance - FLESH, 0.0))
        return place

    def best(self, shot: Shot, index: int) -> View:
        """The view of this shot at a frame from which most of the joints are seen."""
        points = [Vector(p) for p in self.walk.joints[index, [JOINTS.index(name) for name in shot.joints]]]
        low = np.array(points).min(axis=0)
        high = np.array(points).max(axis=0)
        target = Vector((low + high) / 2)
        if shot is BODY:
            target.z = max(target.z, self.walk.floor + 0.55)
        near = slice(max(index - 10, 0), index + 10)
        facing = self.walk.facings[near].mean(axis=0)
        heading = math.atan2(facing[1], facing[0])
        best, least = None, math.inf
        for azimuth in AZIMUTHS:
            for elevation in ELEVATIONS:
                towards = _direction(heading + math.radians(azimuth), math.radians(elevation))
                for cut in (0.0, 1.0):
                    view, cost = self._try(points, target, towards, shot, cut)
                    cost += AZIMUTH_COST * abs(abs(azimuth) - 65) + ELEVATION_COST * (elevation - ELEVATIONS[0])
                    if cost < least:
                        best, least = view, cost
        return best

    def alongside(self, indices: list[int], distance: float) -> list[View]:
        """A view a frame, all so far off and from the side from which most of the body is seen over these frames."""
        shot = Shot(BODY.joints, distance, BODY.room)
        looked_at = [*indices[:: max(len(indices) // 9, 1)], indices[-1]]
        facing = self.walk.facings[indices[len(indices) // 2]]
        heading = math.atan2(facing[1], facing[0])

        def target(index: int) -> Vector:
            return Vector((*self.walk.roots[index][:2], self.walk.floor + MIDDLE))

        best, least = None, math.inf
        for azimuth in AZIMUTHS:
            for elevation in ELEVATIONS[:2]:
                towards = _direction(heading + math.radians(azimuth), math.radians(elevation))
                for cut in (0.0, 1.0):
                    cost = AZIMUTH_COST * abs(abs(azimuth) - 65) + ELEVATION_COST * (elevation - ELEVATIONS[0])
                    for index in looked_at:
                        points = [Vector(p) for p in self.walk.joints[index]]
                        cost += self._try(points, target(index), towards, shot, cut)[1] / len(looked_at)
                    if cost < least:
                        best, least = (towards, shot.distance - shot.room if cut else 0.05), cost
        towards, see_from = best
        return [View(target(index) + towards * distance, target(index), see_from) for index in indices]

    def _try(self, points, target, towards, shot, cut) -> tuple[View, float]:
        """A view and how many joints it hides; with `cut`, all that lies before the figure is left out."""
        place = target + towards * shot.distance
        see_from = shot.distance - shot.room if cut else 0.05
        hidden = 0
        for point in points:
            way = place - point
            # The clipping plane stands across the line of sight.
            reach = way.length * (1.0 - see_from / max(way.dot(towards), 1e-6))
            hidden += self.hidden(point, way.normalized(), reach) is not None
        # An uncut view through a wall that is close behind the camera is as good as one in the open.
        return View(place, target, see_from, 1.0 - hidden / len(points)), hidden + CUT_COST * cut

    def overview(self, aspect: float) -> View:
        """A view of the whole way, the last posture from the front or the side."""
        walk = self.walk
        low = np.append(walk.roots[:, :2].min(axis=0) - 0.55, walk.floor)
        high = np.append(walk.roots[:, :2].max(axis=0) + 0.55, walk.floor + 1.75)
        corners = np.array([(x, y, z) for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
        target = Vector((low + high) / 2)
        facing = math.atan2(walk.facings[-1][1], walk.facings[-1][0])
        points = [Vector(p) for p in (*walk.roots[::6], *walk.heads[::6], *walk.at("LeftFoot")[::6])]
        best, least = None, math.inf
        for turn in range(-180, 180, 15):
            azimuth = facing + math.radians(turn)
            for elevation in (40, 52):
                towards = _direction(azimuth, math.radians(elevation))
                place = target + towards * _distance(corners, target, towards, aspect)
                # Walls are cut away: only what is lower hides the figure.
                places = [self.hidden(point, towards, 8.0) for point in points]
                hidden = sum(1 for place in places if place and place.z < walk.floor + 1.4)
                cost = hidden + 4 * _in_front_of_the_end(walk, azimuth) + 2 * _lined_up(walk, azimuth)
                cost += 0.04 * max(abs(turn) - 40, 0) + 0.1 * (elevation - 40)
                if cost < least:
                    best, least = View(place, target, seen=1.0 - hidden / len(points)), cost
        return best


def _direction(azimuth: float, elevation: float) -> Vector:
    flat = math.cos(elevation)
    return Vector((math.cos(azimuth) * flat, math.sin(azimuth) * flat, math.sin(elevation)))


def _in_front_of_the_end(walk: Walk, azimuth: float) -> int:
    """How many postures on the way would cover the last one, seen from this azimuth."""
    towards = np.array([math.cos(azimuth), math.sin(azimuth)])
    away = walk.roots[::8, :2] - walk.roots[-1, :2]
    ahead, aside = away @ towards, np.abs(away @ np.array([-towards[1], towards[0]]))
    return int(((np.linalg.norm(away, axis=1) > APART) & (ahead > 0.0) & (ahead < 2.2) & (aside < 0.5)).sum())


def _lined_up(walk: Walk, azimuth: float) -> int:
    """How many of the shown postures stand one behind the other, seen from this azimuth."""
    places = walk.roots[walk.moments(8, apart=APART) - walk.frames[0], :2]
    aside = places @ np.array([-math.sin(azimuth), math.cos(azimuth)])
    return int((np.abs(np.diff(aside)) < 0.3).sum())


def _distance(corners: np.ndarray, target: Vector, towards: Vector, aspect: float) -> float:
    """How far the camera must stand for all corners to be in the picture."""
    half = math.atan(18.0 / LENS)
    tan_x, tan_y = math.tan(half), math.tan(half) / aspect
    back = np.array(towards)
    right = np.cross([0, 0, 1], back)
    right /= np.linalg.norm(right)
    up = np.cross(back, right)
    local = corners - np.array(target)
    depth = local @ back
    return 1.04 * float(max((np.abs(local @ right) / tan_x + depth).max(), (np.abs(local @ up) / tan_y + depth).max()))
