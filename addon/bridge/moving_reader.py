# SPDX-License-Identifier: GPL-3.0-or-later
"""What moves in the scene by itself: each mesh, and where it stands, or how it is shaped, on each frame of the shot."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import bpy
import numpy as np

from .. import quaternions
from ..moving import DeformingThing, MovingThing, Thing
from ..scene_frames import CORE_RATE
from .scene_reader import Movable, SceneMeshes, corners_of, instance_key
from .scene_time import STANDS_STILL, current_frame_kept, frame_rate, show

#: Nothing is looked at for longer, seconds: after that everything stands where it stood last.
LONGEST = 30.0
#: The shot is looked at for so long after its last frame, seconds: a motion may outlast it.
BEYOND = 10.0
#: Frames of the core between two glances, by which a thing is taken for still.
GLANCE = 6
#: How far a pose may be from a turn and a shift of the mesh as it was read.
RIGID = 1e-3
#: A mesh that changes its shape by less keeps it, metres.
DEFORMS = 0.005
#: A shape that changes is taken anew on each frame of the core, of large meshes later, but no later than after so many.
SHOWN_AT_MOST = 15
#: All shapes of a mesh have no more triangles, and all frames that are looked at no more corners.
MOST_TRIANGLES, MOST_CORNERS = 6_000_000, 20_000_000
#: A mesh of more triangles is followed by one corner in each cell so wide, metres.
FINE, CELL = 6_000, 0.03

#: A matrix of a smaller determinant makes a thing flat or nothing.
NO_SIZE = 1e-12

Notes = list[tuple[str, str]]


def read_moving(
    context: bpy.types.Context,
    meshes: SceneMeshes,
    start_frame: int,
    metres_per_unit: float,
    rate: float | None = None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, tuple[Thing, ...], Notes]:
    """The scene's positions, triangles and their owners without what moves, what moves, and (object, sentence) of what
    changes in a way that cannot be followed and was read as it stands on one frame. `rate`: the scene's frames in a
    second of the core's, where that is another than the scene's own.

    Goes through the frames and comes back to the current one.
    """
    if not meshes.movable:
        return meshes.positions, meshes.triangles, meshes.owners, (), []
    positions = meshes.positions.copy()
    places, deformable = _look(context, meshes, start_frame, metres_per_unit, rate or frame_rate(context.scene))
    moving, gone, notes = [], [], []
    for thing, matrices, mesh in zip(meshes.movable, places, deformable, strict=True):
        part = slice(thing.first_vertex, thing.end_vertex)
        if mesh is not None and mesh.first is not None and not mesh.fault:
            # Its shape as the shot begins, wherever the playhead is.
            positions[part] = mesh.first
            thing = replace(thing, matrix=matrices[0])
            if mesh.deforms:
                moving.append(mesh.thing())
                gone.append(thing)
                continue
        elif mesh is not None and mesh.fault:
            said = f"{thing.name} {mesh.fault}: it was read as it is at frame "
            notes.append((thing.name, f"{said}{start_frame if mesh.first is not None else _current(context)}."))
            if mesh.first is not None:
                positions[part] = mesh.first
            continue
        poses = _since_read(thing, matrices, metres_per_unit)
        if poses is None:
            said = f"{thing.name} has no size, or comes and goes: it was read as it is at frame {_current(context)}."
            notes.append((thing.name, said))
            continue
        if np.abs(poses - poses[0]).max() <= STANDS_STILL:
            if np.abs(poses[0] - np.eye(4)).max() > STANDS_STILL:
                # Where it stands as the shot begins, wherever the playhead is.
                positions[part] = positions[part] @ poses[0, :3, :3].T + poses[0, :3, 3]
            continue
        corners, triangles = positions[part], _triangles(meshes, thing)
        if abs(np.linalg.det(poses[0])) > NO_SIZE and _is_rigid(poses @ np.linalg.inv(poses[0])):
            gone.append(thing)
            moving.append(_moving_thing(corners, triangles, thing.name, poses))
            continue
        # What changes its size is a shape that changes.
        resized = _Deformable.of_poses(thing, corners, triangles, poses, metres_per_unit)
        if resized.fault:
            positions[part] = resized.first
            notes.append((thing.name, f"{thing.name} {resized.fault}: it was read as it is at frame {start_frame}."))
            continue
        gone.append(thing)
        moving.append(resized.thing())
    keep = np.ones(len(meshes.triangles), dtype=bool)
    for thing in gone:
        keep[thing.first_triangle : thing.end_triangle] = False
    return positions, meshes.triangles[keep], meshes.owners[keep], tuple(moving), notes


def taken_as_it_stands(context: bpy.types.Context, meshes: SceneMeshes) -> Notes:
    """What is said where nobody goes through the frames: all that may move was read at the current one."""
    names = list(dict.fromkeys(thing.name for thing in meshes.movable))
    if not names:
        return []
    more = f" and {len(names) - 3} more" if len(names) > 3 else ""
    said = f"{', '.join(names[:3])}{more} may move: taken as all stands at frame {_current(context)}, on every frame."
    return [(names[0], said)]


def _current(context: bpy.types.Context) -> str:
    return f"{context.scene.frame_current_final:g}"


class _Deformable:
    """A mesh that may deform, as it is seen frame by frame."""

    def __init__(self, thing: Movable, triangles: np.ndarray, metres_per_unit: float) -> None:
        self._name, self._corners, self._triangles = thing.name, thing.end_vertex - thing.first_vertex, triangles
        self._metres_per_unit = metres_per_unit
        #: World, metres: as it is on the shot's first frame; None before it was seen there.
        self.first: np.ndarray | None = None
        #: What keeps it from being followed: the middle of a sentence, or empty.
        self.fault = ""
        #: Whether it was seen in another shape than its first.
        self.deforms = False
        self._first_local = np.empty((0, 3), dtype=np.float32)
        # What is followed, once it is known to deform.
        self._kept: np.ndarray | None = None
        self._every = 0
        self._seen: np.ndarray | None = None

    def glance(self, instance: bpy.types.DepsgraphObjectInstance) -> None:
        """Sees whether it deforms."""
        local = self._local(instance)
        if local is None:
            return
        if self.first is None:
            self.first, self._first_local = self._world(instance, local), local
        elif not self.deforms and np.abs(local - self._first_local).max() > DEFORMS / self._size(instance):
            self.deforms = np.abs(self._world(instance, local) - self.first).max() > DEFORMS

    @classmethod
    def of_poses(
        cls, thing: Movable, corners: np.ndarray, triangles: np.ndarray, poses: np.ndarray, metres_per_unit: float
    ) -> _Deformable:
        """One whose corners, world, metres, are taken by a pose to each frame; followed, or with a fault."""
        made = cls(thing, triangles, metres_per_unit)
        made.first = _taken(corners, poses[0])
        # Of its largest shape: as nothing it would be told by no corners.
        largest = _taken(corners, poses[int(np.argmax(np.abs(np.linalg.det(poses[:, :3, :3]))))])
        made.follow(len(poses), largest)
        if made._seen is not None:
            for frame, pose in enumerate(poses):
                made._seen[frame] = _taken(corners[made._kept], pose)
        return made

    def follow(self, frames: int, shape: np.ndarray | None = None) -> None:
        """Takes what is looked at on each of so many frames; `shape`: another than the first to choose corners by."""
        assert self.first is not None
        self._kept, self._triangles = simplified(self.first if shape is None else shape, self._triangles)
        self._every = math.ceil(frames * len(self._triangles) / MOST_TRIANGLES)
        if self._every > SHOWN_AT_MOST or frames * len(self._kept) > MOST_CORNERS:
            self.fault = "moves and is too fine to be followed"
            return
        self._seen = np.full((frames, len(self._kept), 3), np.nan, dtype=np.float32)

    def see(self, frame: int, instance: bpy.types.DepsgraphObjectInstance) -> None:
        """As it is on one of them."""
        local = self._local(instance)
        if local is not None and self._seen is not None:
            self._seen[frame] = self._world(instance, local[self._kept])

    def close(self) -> None:
        """Every frame that is followed was seen."""
        if self._seen is not None and not np.isfinite(self._seen).all():
            self.fault = "comes and goes, or has corners at places that are not numbers"

    def thing(self) -> DeformingThing:
        """What it is to the core, until it stands still for good."""
        assert self._seen is not None
        moves = np.abs(np.diff(self._seen, axis=0)).max(axis=(1, 2)) > STANDS_STILL
        last = int(np.flatnonzero(moves)[-1]) + 2 if moves.any() else 1
        seen = self._seen[:last]
        middles = seen.mean(axis=1)
        # Each shape is that of the middle of its frames, the last one that in which it stays.
        taken = np.minimum(np.arange(0, last, self._every) + self._every // 2, last - 1)
        taken[-1] = last - 1
        translations = middles - np.repeat(middles[taken], self._every, axis=0)[:last]
        shapes = np.ascontiguousarray(seen[taken])
        return DeformingThing(self._name, shapes, self._triangles, self._every, translations.astype(np.float32))

    def _local(self, instance: bpy.types.DepsgraphObjectInstance) -> np.ndarray | None:
        mesh = instance.object.data
        if mesh.is_editmode:
            self.fault = "may change its shape, which shows once you leave edit mode (Tab)"
            return None
        if len(mesh.vertices) != self._corners:
            self.fault = "has another number of corners on other frames"
            return None
        return corners_of(mesh)

    def _world(self, instance: bpy.types.DepsgraphObjectInstance, local: np.ndarray) -> np.ndarray:
        matrix = np.array(instance.matrix_world, dtype=np.float64)
        return ((local @ matrix[:3, :3].T + matrix[:3, 3]) * self._metres_per_unit).astype(np.float32)

    def _size(self, instance: bpy.types.DepsgraphObjectInstance) -> float:
        """Metres, at most, that a unit of the mesh is long."""
        matrix = np.array(instance.matrix_world, dtype=np.float64)[:3, :3]
        return max(float(np.linalg.norm(matrix, ord=2)) * self._metres_per_unit, 1e-9)


def _taken(corners: np.ndarray, pose: np.ndarray) -> np.ndarray:
    """Corners where a pose takes them."""
    return (corners @ pose[:3, :3].T + pose[:3, 3]).astype(np.float32)


def _triangles(meshes: SceneMeshes, thing: Movable) -> np.ndarray:
    """A thing's own triangles."""
    return meshes.triangles[thing.first_triangle : thing.end_triangle] - np.uint32(thing.first_vertex)


def _look(
    context: bpy.types.Context, meshes: SceneMeshes, start_frame: int, metres_per_unit: float, rate: float
) -> tuple[np.ndarray, list[_Deformable | None]]:
    """The world matrix of each thing on each frame of the core, (things, frames, 4, 4), NaN where it is not there; and
    what was seen of those that may deform."""
    scene, things = context.scene, meshes.movable
    per_frame = rate / CORE_RATE
    seconds = min(max(scene.frame_end - start_frame, 0) / rate + BEYOND, LONGEST)
    frames = int(seconds * CORE_RATE) + 1
    index = {thing.key: k for k, thing in enumerate(things)}
    deformable = [
        _Deformable(thing, _triangles(meshes, thing), metres_per_unit) if thing.may_deform else None for thing in things
    ]

    def instances(frame: int) -> Iterator[tuple[int, bpy.types.DepsgraphObjectInstance]]:
        show(scene, start_frame + frame * per_frame)
        for instance in context.evaluated_depsgraph_get().object_instances:
            k = index.get(instance_key(instance.object.original, instance))
            if k is not None:
                yield k, instance

    with current_frame_kept(scene):
        # Most of what might move does not.
        glances = np.full((len(things), len(range(0, frames, GLANCE)), 4, 4), np.nan)
        for i, frame in enumerate(range(0, frames, GLANCE)):
            for k, instance in instances(frame):
                glances[k, i] = instance.matrix_world
                if (mesh := deformable[k]) is not None and not mesh.fault and (i == 0 or mesh.first is not None):
                    mesh.glance(instance)
        followed = [mesh for mesh in deformable if mesh is not None and mesh.deforms and not mesh.fault]
        for mesh in followed:
            mesh.follow(frames)
        # Not a number is not smaller either.
        if not followed and (np.ptp(glances, axis=1) <= STANDS_STILL).all():
            return glances, deformable
        places = np.full((len(things), frames, 4, 4), np.nan)
        for frame in range(frames):
            for k, instance in instances(frame):
                places[k, frame] = instance.matrix_world
                if (mesh := deformable[k]) is not None and mesh.deforms and not mesh.fault:
                    mesh.see(frame, instance)
    for mesh in followed:
        mesh.close()
    return places, deformable


def _since_read(thing: Movable, matrices: np.ndarray, metres_per_unit: float) -> np.ndarray | None:
    """What takes the mesh from where it was read to where it stands on each frame, metres; None where nothing does."""
    if not np.isfinite(matrices).all() or abs(np.linalg.det(thing.matrix[:3, :3])) < NO_SIZE:
        return None
    poses = matrices @ np.linalg.inv(thing.matrix)
    poses[:, :3, 3] *= metres_per_unit
    return poses


def _is_rigid(poses: np.ndarray) -> bool:
    turns = poses[:, :3, :3]
    return bool(np.abs(turns.transpose(0, 2, 1) @ turns - np.eye(3)).max() < RIGID)


def _moving_thing(positions: np.ndarray, triangles: np.ndarray, name: str, poses: np.ndarray) -> MovingThing:
    """The mesh as it stands on the first frame, and its poses from there until it stands still for good."""
    positions = (positions @ poses[0, :3, :3].T + poses[0, :3, 3]).astype(np.float32)
    since_first = poses @ np.linalg.inv(poses[0])
    moves = np.abs(np.diff(since_first, axis=0)).max(axis=(1, 2)) > STANDS_STILL / 10
    last = int(np.flatnonzero(moves)[-1]) + 2
    since_first = since_first[:last]
    turns = [quaternions.from_matrix(pose[:3, :3]) for pose in since_first]
    translations = np.ascontiguousarray(since_first[:, :3, 3], dtype=np.float32)
    return MovingThing(name, positions, triangles, translations, np.array(turns, dtype=np.float32))


def simplified(positions: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Which corners of a fine mesh stand for all of it, and its triangles by their places among these.

    Of the corners that lie together in a cell of a grid and face the same way one stays: a hand that lies on the hip is
    not sewn to it.
    """
    if len(triangles) <= FINE:
        return np.arange(len(positions)), triangles
    a, b, c = (positions[triangles[:, k]].astype(np.float64) for k in range(3))
    normals = np.zeros((len(positions), 3))
    for k in range(3):
        np.add.at(normals, triangles[:, k], np.cross(b - a, c - a))
    cells = np.concatenate([np.floor(positions / CELL), normals > 0.0], axis=1).astype(np.int64)
    _, kept, inverse = np.unique(cells, axis=0, return_index=True, return_inverse=True)
    corners = inverse.reshape(-1)[triangles]
    flat = (corners[:, 0] == corners[:, 1]) | (corners[:, 1] == corners[:, 2]) | (corners[:, 2] == corners[:, 0])
    return kept, np.unique(corners[~flat], axis=0).astype(np.uint32)
