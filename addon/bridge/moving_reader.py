# SPDX-License-Identifier: GPL-3.0-or-later
"""What moves in the scene by itself: each rigid mesh, and where it stands on each frame of the shot."""

from __future__ import annotations

import bpy
import numpy as np

from .. import quaternions
from ..moving import MovingThing
from ..scene_frames import CORE_RATE
from .scene_reader import Movable, SceneMeshes, instance_key
from .scene_time import STANDS_STILL, current_frame_kept, frame_rate, show

#: Nothing is looked at for longer, seconds: after that everything stands where it stood last.
LONGEST = 30.0
#: The shot is looked at for so long after its last frame, seconds: a motion may outlast it.
BEYOND = 10.0
#: Frames of the core between two glances, by which a thing is taken for still.
GLANCE = 6
#: How far a pose may be from a turn and a shift of the mesh as it was read.
RIGID = 1e-3

Notes = list[tuple[str, str]]


def read_moving(
    context: bpy.types.Context, meshes: SceneMeshes, start_frame: int, metres_per_unit: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, tuple[MovingThing, ...], Notes]:
    """The scene's positions, triangles and their owners without what moves, what moves, and (object, sentence) of what
    moves otherwise than a solid thing does and was read as it stands at the first frame.

    Goes through the frames and comes back to the current one.
    """
    if not meshes.movable:
        return meshes.positions, meshes.triangles, meshes.owners, (), []
    places = _matrices(context, meshes.movable, start_frame)
    moving, gone, notes = [], [], []
    positions = meshes.positions.copy()
    for thing, matrices in zip(meshes.movable, places, strict=True):
        poses = _since_read(thing, matrices, metres_per_unit)
        if poses is None:
            notes.append((thing.name, f"{thing.name} has no size, or comes and goes: it was read as it is now."))
            continue
        still = np.abs(poses - poses[0]).max() <= STANDS_STILL
        rigid = _is_rigid(poses @ np.linalg.inv(poses[0]))
        if still or not rigid:
            if np.abs(poses[0] - np.eye(4)).max() > STANDS_STILL:
                # Where it stands as the shot begins, wherever the playhead is.
                part = slice(thing.first_vertex, thing.end_vertex)
                positions[part] = positions[part] @ poses[0, :3, :3].T + poses[0, :3, 3]
            if not still:
                said = f"{thing.name} changes its size over time: it was read as it is at frame {start_frame}."
                notes.append((thing.name, said))
            continue
        gone.append(thing)
        moving.append(_moving_thing(meshes, thing, poses))
    keep = np.ones(len(meshes.triangles), dtype=bool)
    for thing in gone:
        keep[thing.first_triangle : thing.end_triangle] = False
    return positions, meshes.triangles[keep], meshes.owners[keep], tuple(moving), notes


def _matrices(context: bpy.types.Context, things: list[Movable], start_frame: int) -> np.ndarray:
    """The world matrix of each thing on each frame of the core, (things, frames, 4, 4); NaN where it is not there."""
    scene = context.scene
    per_frame = frame_rate(scene) / CORE_RATE
    seconds = min(max(scene.frame_end - start_frame, 0) / frame_rate(scene) + BEYOND, LONGEST)
    frames = int(seconds * CORE_RATE) + 1
    index = {thing.key: k for k, thing in enumerate(things)}

    def looked_at(chosen: range) -> np.ndarray:
        places = np.full((len(things), len(chosen), 4, 4), np.nan)
        for i, frame in enumerate(chosen):
            show(scene, start_frame + frame * per_frame)
            for instance in context.evaluated_depsgraph_get().object_instances:
                k = index.get(instance_key(instance.object.original, instance))
                if k is not None:
                    places[k, i] = instance.matrix_world
        return places

    with current_frame_kept(scene):
        # Most of what might move does not.
        glances = looked_at(range(0, frames, GLANCE))
        return looked_at(range(frames)) if np.ptp(glances, axis=1).max() > STANDS_STILL else glances


def _since_read(thing: Movable, matrices: np.ndarray, metres_per_unit: float) -> np.ndarray | None:
    """What takes the mesh from where it was read to where it stands on each frame, metres; None where nothing does."""
    if not np.isfinite(matrices).all() or abs(np.linalg.det(thing.matrix[:3, :3])) < 1e-12:
        return None
    poses = matrices @ np.linalg.inv(thing.matrix)
    poses[:, :3, 3] *= metres_per_unit
    return poses


def _is_rigid(poses: np.ndarray) -> bool:
    turns = poses[:, :3, :3]
    return bool(np.abs(turns.transpose(0, 2, 1) @ turns - np.eye(3)).max() < RIGID)


def _moving_thing(meshes: SceneMeshes, thing: Movable, poses: np.ndarray) -> MovingThing:
    """The mesh as it stands on the first frame, and its poses from there until it stands still for good."""
    local = meshes.positions[thing.first_vertex : thing.end_vertex]
    positions = (local @ poses[0, :3, :3].T + poses[0, :3, 3]).astype(np.float32)
    triangles = meshes.triangles[thing.first_triangle : thing.end_triangle] - np.uint32(thing.first_vertex)
    since_first = poses @ np.linalg.inv(poses[0])
    moves = np.abs(np.diff(since_first, axis=0)).max(axis=(1, 2)) > STANDS_STILL / 10
    last = int(np.flatnonzero(moves)[-1]) + 2
    since_first = since_first[:last]
    turns = [quaternions.from_matrix(pose[:3, :3]) for pose in since_first]
    translations = np.ascontiguousarray(since_first[:, :3, 3], dtype=np.float32)
    return MovingThing(thing.name, positions, triangles, translations, np.array(turns, dtype=np.float32))
