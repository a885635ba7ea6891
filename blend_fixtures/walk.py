# SPDX-License-Identifier: GPL-3.0-or-later
"""The keyed motion of a file, as the pictures need it: where the body is at each frame, and which moments tell most."""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass, field
from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from addon.bridge.hand_reader import HAND
from addon.bridge.names import ACTS_KEY, CHARACTER_KEY, CUE_KEY, FIRST_FRAME_KEY, LAST_FRAME_KEY

#: The joints that must be seen for a posture to be judged.
JOINTS = (
    *("Hips", "Spine2", "Head", "LeftArm", "RightArm", "LeftHand", "RightHand"),
    *("LeftLeg", "RightLeg", "LeftFoot", "RightFoot", "LeftToe", "RightToe"),
)
#: The pelvis is on its way down once it is this much lower than it walks, metres.
GOING_DOWN = 0.03
#: What a strip of pictures can be about: the first steps, half the way, the turn before the seat, the way down.
MOMENTS = ("start", "middle", "turn", "seat")
#: How far before that the turn towards the seat is looked for, seconds.
TURN_WITHIN = 2.5


@dataclass
class Walk:
    """The motion frame by frame, in the world."""

    character: bpy.types.Object
    bodies: list[bpy.types.Object]
    frames: np.ndarray
    #: Shape (frames, joints, 3), in the order of `JOINTS`.
    joints: np.ndarray
    #: Where the pelvis faces on the floor at each frame, unit vectors (frames, 2).
    facings: np.ndarray
    floor: float
    frame_rate: float
    #: (hand, first, last) of each hand cue, indices of the frames.
    hands: list[tuple[str, int, int]] = field(default_factory=list)

    @property
    def roots(self) -> np.ndarray:
        return self.at("Hips")

    @property
    def heads(self) -> np.ndarray:
        return self.at("Head")

    def at(self, joint: str) -> np.ndarray:
        """A joint's way, shape (frames, 3)."""
        return self.joints[:, JOINTS.index(joint)]

    def way(self) -> np.ndarray:
        """How much the figure has moved up to each frame."""
        step = np.linalg.norm(np.diff(self.roots, axis=0), axis=1) + np.linalg.norm(np.diff(self.heads, axis=0), axis=1)
        return np.concatenate([[0.0], np.cumsum(step + 1e-5)])

    def moments(self, count: int, apart: float = 0.0) -> np.ndarray:
        """Frames that share the motion evenly between them, first and last included.

        With `apart`, none but the last shows the figure within that many metres of where it ends.
        """
        way = self.way()
        away = np.linalg.norm(self.roots[:, :2] - self.roots[-1, :2], axis=1) >= apart
        last = int(np.flatnonzero(away)[-1]) if apart and away.any() else len(way) - 1
        parts = np.linspace(0.0, way[last], count - 1 if apart else count)
        chosen = [int(np.abs(way - part).argmin()) for part in parts]
        return self.frames[sorted({*chosen, len(way) - 1})]

    def telling(self) -> list[tuple[str, int]]:
        """(what it shows, index of the frame): the start, the walk, the turn, half-way down and the end.

        Where a hand follows a cue, what it does takes the seat's place.
        """
        heights, way, last = self.roots[:, 2], self.way(), len(self.frames) - 1
        if self.hands:
            _, first, end = self.hands[0]
            walked = int(np.abs(way[: first + 1] - 0.5 * way[first]).argmin())
            holds = [("taking hold", first), ("half-way", (first + end) // 2), ("letting go", end)]
            return [("start", 0), ("walking", walked), *holds, ("end", last)]
        low, high = heights[-1], float(np.median(heights[: max(last // 2, 1)]))
        if high - low < 4 * GOING_DOWN:  # ends standing
            parts = [int(np.abs(way - part * way[-1]).argmin()) for part in (0.25, 0.5, 0.75, 0.92)]
            return [("start", 0), *(("walking", part) for part in parts), ("end", last)]
        down = int(np.flatnonzero(heights > high - GOING_DOWN)[-1])
        half = down + int(np.abs(heights[down:] - (high + low) / 2).argmin())
        first = max(down - round(TURN_WITHIN * self.frame_rate), 1)
        turning = self._turning()[first : down + 1]
        turn = first + int(turning.argmax()) if len(turning) else down
        walked = [int(np.abs(way[: turn + 1] - part * way[turn]).argmin()) for part in (0.33, 0.67)]
        walks = [("walking", index) for index in walked]
        return [("start", 0), *walks, ("turning", turn), ("half-way down", half), ("end", last)]

    def about(self, moment: str | int, seconds: float) -> tuple[float, float]:
        """The first and the last index of so many seconds about one of the `MOMENTS`, or about a frame."""
        last, length = len(self.frames) - 1, seconds * self.frame_rate
        if isinstance(moment, int):
            first = min(max(moment - self.frames[0] - length / 2, 0.0), max(last - length, 0.0))
            return first, min(first + length, last)
        if moment == "start":
            return 0.0, min(length, last)
        telling = dict(self.telling())
        if moment == "middle":
            middle = int(np.abs(self.way() - 0.5 * self.way()[-1]).argmin())
        else:
            middle = telling.get("turning" if moment == "turn" else "half-way down", last // 2)
        first = min(max(middle - length / 2, 0.0), max(last - length, 0.0))
        return first, min(first + length, last)

    def _turning(self) -> np.ndarray:
        """How fast the pelvis turns at each frame, radians a frame, over a fifth of a second."""
        yaw = np.unwrap(np.arctan2(self.facings[:, 1], self.facings[:, 0]))
        width = max(round(self.frame_rate / 5), 1)
        return np.convolve(np.abs(np.gradient(yaw)), np.ones(width) / width, mode="same")


def read_walk(scene: bpy.types.Scene, person: str | None = None) -> Walk:
    """The motion of the scene's character, or of that of the person whose start has this name.

    Raises SystemExit when there is none.
    """
    found = [o for o in scene.objects if o.type == "ARMATURE" and o.get(CHARACTER_KEY)]
    found = [o for o in found if o.animation_data and o.animation_data.action]
    if not found:
        raise SystemExit("The file has no character with an action: run a synthesis first.")
    if person is not None:
        start = scene.objects.get(person)
        found = [o for o in found if start is not None and start.get(ACTS_KEY) == o]
        if not found:
            raise SystemExit(f"Nobody who moves starts at {person}.")
    return _walk_of(scene, found[0])


def read_walks(scene: bpy.types.Scene) -> list[Walk]:
    """The motions of all people, by their starts' names; of one alone its own. Raises SystemExit when there is none."""
    starts = sorted(o.name for o in scene.objects if o.get(CUE_KEY) == "start" and o.get(ACTS_KEY))
    return [read_walk(scene, name) for name in starts] or [read_walk(scene)]


def together(walks: list[Walk]) -> Walk:
    """One after the other, as if they were one: what a camera is to see of all."""
    first = walks[0]
    joined = {name: np.concatenate([getattr(walk, name) for walk in walks]) for name in ("frames", "joints", "facings")}
    return Walk(first.character, first.bodies, **joined, floor=first.floor, frame_rate=first.frame_rate)


def _walk_of(scene: bpy.types.Scene, character: bpy.types.Object) -> Walk:
    first, last = character.animation_data.action.frame_range
    frames = np.arange(int(first), int(last) + 1)
    joints, facings = [], []
    for frame in frames:
        scene.frame_set(int(frame))
        posed = character.evaluated_get(bpy.context.evaluated_depsgraph_get())
        world, bones = posed.matrix_world, posed.pose.bones
        joints.append([world @ bones[name].head for name in JOINTS])
        across = world.to_3x3() @ (bones["LeftUpLeg"].head - bones["RightUpLeg"].head)
        facings.append(Vector((across.y, -across.x)).normalized())
    bodies = [o for o in scene.objects if o.type == "MESH" and o.get(CHARACTER_KEY)]
    starts = [o.matrix_world.translation.z for o in scene.objects if o.get(CUE_KEY) == "start"]
    joints = np.array(joints)
    toes = joints[:, [JOINTS.index("LeftToe"), JOINTS.index("RightToe")], 2]
    floor = starts[0] if starts else float(toes.min(initial=math.inf)) - 0.025
    rate = scene.render.fps / scene.render.fps_base
    hands = [
        (
            HAND[o[CUE_KEY]],
            *(int(np.clip(o[key] - frames[0], 0, len(frames) - 1)) for key in (FIRST_FRAME_KEY, LAST_FRAME_KEY)),
        )
        for o in scene.objects
        if o.get(CUE_KEY) in HAND and not o.hide_get()
    ]
    return Walk(character, bodies, frames, joints, np.array(facings), floor, rate, hands)
