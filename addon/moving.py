# SPDX-License-Identifier: GPL-3.0-or-later
"""What moves in the scene by itself, as arrays, and what is said of a motion that meets it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from . import quaternions
from .native import core
from .scene_frames import in_scene_frames

#: Things that stand nearer than this to where they stood are where they were, metres.
SAME_PLACE = 0.02
#: A place far from everything, where a shape is while another one is shown, metres.
AWAY = (0.0, 0.0, -1e4)
#: A mesh whose largest triangle is smaller is none, square metres.
NO_AREA = 1e-9
#: So many places of a thing that changes its shape are planned about at once.
MOST_PLACES = 60

Mesh = tuple[NDArray[np.float32], NDArray[np.uint32]]


@dataclass(frozen=True)
class MovingThing:
    """A rigid mesh as it stands on the motion's first frame, and what takes it from there to each frame (30 Hz)."""

    name: str
    #: World, metres: (n, 3) and (m, 3).
    positions: NDArray[np.float32]
    triangles: NDArray[np.uint32]
    #: (frames, 3), metres, and (frames, 4), w first.
    translations: NDArray[np.float32]
    rotations: NDArray[np.float32]

    def at(self, frame: int) -> NDArray[np.float32]:
        """Its positions on a frame; after the last as on the last."""
        frame = min(frame, len(self.translations) - 1)
        turn = quaternions.to_matrix(self.rotations[frame])
        placed: NDArray[np.float32] = (self.positions @ turn.T + self.translations[frame]).astype(np.float32)
        return placed

    @property
    def frames(self) -> int:
        """Frames until it stands still."""
        return len(self.translations)

    def places(self) -> Iterator[NDArray[np.float32]]:
        """The places that it comes to, a hand's breadth apart."""
        return _places(self)

    def for_core(self) -> list[core.MovingObject]:
        """The same for the core."""
        return [core.MovingObject(self.name, self.positions, self.triangles, self.translations, self.rotations)]


@dataclass(frozen=True)
class DeformingThing:
    """A mesh that changes its shape as it moves: a shape for every few frames, which goes along in between."""

    name: str
    #: World, metres: (shapes, n, 3), as the mesh is in the middle of the frames that it is shown for.
    shapes: NDArray[np.float32]
    #: (m, 3)
    triangles: NDArray[np.uint32]
    #: How many frames (30 Hz) each is shown for; the last stays.
    every: int
    #: (frames, 3), metres: how far the mesh's middle has gone since its frame's shape was taken.
    translations: NDArray[np.float32]

    def at(self, frame: int) -> NDArray[np.float32]:
        """Its positions on a frame; after the last as on the last."""
        frame = min(frame, self.frames - 1)
        placed: NDArray[np.float32] = self.shapes[frame // self.every] + self.translations[frame]
        return placed

    @property
    def frames(self) -> int:
        """Frames until it stands still."""
        return len(self.translations)

    def places(self) -> Iterator[NDArray[np.float32]]:
        """Places that it comes to, a hand's breadth apart or more."""
        found = list(_places(self))
        yield from found[:: -(-len(found) // MOST_PLACES)]

    def for_core(self) -> list[core.MovingObject]:
        """The same for the core, which knows rigid things: one for each shape, which is away on the others' frames."""
        objects = []
        for k, shape in enumerate(self.shapes):
            if not _has_area(shape, self.triangles):
                # Shrunk to nothing, nobody runs into it.
                continue
            first, end = k * self.every, min((k + 1) * self.every, self.frames)
            last = end == self.frames
            translations = np.tile(np.array(AWAY, dtype=np.float32), (end if last else end + 1, 1))
            translations[first:end] = self.translations[first:end]
            rotations = np.tile(np.array([1.0, 0.0, 0.0, 0.0], dtype=np.float32), (len(translations), 1))
            objects.append(core.MovingObject(self.name, shape, self.triangles, translations, rotations))
        return objects


def _has_area(positions: NDArray[np.float32], triangles: NDArray[np.uint32]) -> bool:
    a, b, c = (positions[triangles[:, k]].astype(np.float64) for k in range(3))
    return bool(np.linalg.norm(np.cross(b - a, c - a), axis=1).max(initial=0.0) > NO_AREA)


Thing: TypeAlias = MovingThing | DeformingThing


def nothing_met() -> core.Passing:
    """How a motion gets past what moves where nothing does."""
    return {"wait": 0, "meetings": [], "percent": 0.0}


def stands(things: tuple[Thing, ...]) -> Iterator[Mesh]:
    """Ways in which a motion may be planned about what moves: as all stands on the first frame, on the last, on the one
    on which it is farthest from both, and all places that it comes to at once. None comes twice.
    """
    last = max(thing.frames for thing in things) - 1
    seen: list[NDArray[np.float32]] = []
    for frame in (0, last, _farthest(things, last)):
        placed = np.concatenate([thing.at(frame) for thing in things])
        if all(np.abs(placed - other).max() > SAME_PLACE for other in seen):
            seen.append(placed)
            yield joined([(thing.at(frame), thing.triangles) for thing in things])
    yield joined([(places, thing.triangles) for thing in things for places in thing.places()])


def joined(meshes: list[Mesh]) -> Mesh:
    """All meshes as one."""
    starts = np.cumsum([0, *(len(positions) for positions, _ in meshes[:-1])])
    triangles = [corners + np.uint32(start) for start, (_, corners) in zip(starts, meshes, strict=True)]
    return np.concatenate([positions for positions, _ in meshes]), np.concatenate(triangles)


def _farthest(things: tuple[Thing, ...], last: int) -> int:
    """The frame on which the things are farthest from where they begin and end."""

    def away(frame: int) -> float:
        return sum(
            min(float(np.abs(thing.at(frame) - thing.at(other)).max()) for other in (0, last)) for thing in things
        )

    return max(range(0, last + 1, 5), key=away)


def _places(thing: Thing) -> Iterator[NDArray[np.float32]]:
    """The places that a thing comes to, a hand's breadth apart."""
    before = thing.at(0)
    yield before
    for frame in range(1, thing.frames):
        now = thing.at(frame)
        if np.abs(now - before).max() > 0.1:
            before = now
            yield now


def by_object(passing: core.Passing) -> core.Passing:
    """The same with one meeting an object, however many meshes, or shapes of one, it was given to the core as."""
    merged: dict[str, core.Meeting] = {}
    for meeting in passing["meetings"]:
        other = merged.get(meeting["object"])
        if other is None:
            merged[meeting["object"]] = meeting
            continue
        deeper = max(meeting, other, key=lambda one: one["depth_cm"])
        first, end = min(meeting["first"], other["first"]), max(meeting["end"], other["end"])
        frames = min(meeting["frames"] + other["frames"], end - first)
        merged[meeting["object"]] = {**deeper, "first": first, "end": end, "frames": frames}
    longest = sorted(merged.values(), key=lambda meeting: (-meeting["frames"], meeting["object"]))
    return {**passing, "meetings": longest}


def meeting_sentences(meetings: list[core.Meeting], start_frame: int, scene_rate: float) -> list[str]:
    """What is said of each object that the person runs into, with the scene's frames."""
    said = (
        "‘{object}’ moves, and the person runs into it on frames {first} to {last}, {depth:.0f} cm deep: let it be out "
        "of the way by then, or move a cue."
    )
    sentences = (said.format(**m, last=m["end"] - 1, depth=m["depth_cm"]) for m in meetings)
    return [in_scene_frames(sentence, start_frame, scene_rate) for sentence in sentences]
