"""What is evaluated on: real rooms and their seats where they are there, else rooms made by rule; and the libraries."""

from __future__ import annotations

import csv
import functools
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import oncue_core
import trimesh

#: The pelvis of a stop cue: the root's height in the rest pose, metres.
STANDING = 0.993


@dataclass(frozen=True)
class Scene:
    """A scene with the tasks that its table gives."""

    name: str
    index: oncue_core.SceneIndex
    tasks: tuple[oncue_core.Task, ...]


def yaw_of(heading_degrees: float) -> float:
    """The yaw of someone who faces the heading (0: +X, counter-clockwise); at yaw 0 one faces -Y."""
    return math.remainder(math.radians(heading_degrees) + math.pi / 2, 2 * math.pi)


def read_table(folder: Path) -> dict[str, list[oncue_core.Task]]:
    """The tasks of each room in `folder`/rooms.tsv."""
    rooms: dict[str, list[oncue_core.Task]] = {}
    with (folder / "rooms.tsv").open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file, delimiter="\t"):
            place = {axis: float(row[f"start_{axis}"]) for axis in "xyz"}
            pelvis = [float(row[f"pelvis_{axis}"]) for axis in "xyz"]
            task: oncue_core.Task = {
                "start": {
                    "name": "Start",
                    "position": list(place.values()),
                    "yaw": yaw_of(float(row["start_heading_deg"])),
                },
                "cue": {
                    "name": f"{row['seat_object']} {row['task']}",
                    "action_type": "sit",
                    "position": pelvis,
                    "yaw": yaw_of(float(row["facing_heading_deg"])),
                },
            }
            rooms.setdefault(row["room"], []).append(task)
    return rooms


def read_glb(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Positions float32 (n, 3), world, metres, Z up, and triangles uint32 (m, 3)."""
    mesh = trimesh.load(path, force="mesh", process=False)
    x, y, z = np.asarray(mesh.vertices, dtype=np.float32).T
    # glTF is Y up.
    return np.ascontiguousarray(np.stack([x, -z, y], axis=1)), np.asarray(mesh.faces, dtype=np.uint32)


class Rooms:
    """The scenes, indexed when they are first asked for."""

    def __init__(self, shared: Path | None) -> None:
        self.folder = shared / "data" / "rooms" if shared else None
        self.real = self.folder is not None and (self.folder / "rooms.tsv").is_file()
        self._tables = read_table(self.folder) if self.real else {}

    @property
    def names(self) -> list[str]:
        return list(self._tables) if self.real else [f"practice room {seed}" for seed in range(4)]

    @functools.lru_cache(maxsize=2)  # noqa: B019  the rooms live as long as the run
    def scene(self, name: str) -> Scene:
        if self.real:
            positions, triangles = read_glb(self.folder / f"{name}.glb")
            return Scene(name, oncue_core.index_scene(positions, triangles).result(), tuple(self._tables[name]))
        positions, triangles, cues = oncue_core.practice_room(int(name.split()[-1]))
        index = oncue_core.index_scene(positions, triangles).result()
        tasks = []
        for cue in cues:
            if cue["action_type"] == "sit" and (start := random_start(index, cue, np.random.default_rng(1))):
                tasks.append({"start": start, "cue": cue})
        return Scene(name, index, tuple(tasks))


def random_start(index: oncue_core.SceneIndex, cue: oncue_core.ActionCue, rng: np.random.Generator):
    """A start from which the cue can be reached, facing anywhere; None where 400 draws find none."""
    low, high = np.array(index.bounds)
    for _ in range(400):
        xy = rng.uniform(low[:2], high[:2])
        start: oncue_core.InitialState = {
            "name": "Start",
            "position": [float(xy[0]), float(xy[1]), index.floor_height],
            "yaw": float(rng.uniform(-math.pi, math.pi)),
        }
        try:
            oncue_core.check_task(index, {"start": start, "cue": cue})
        except oncue_core.InputError:
            continue
        return start
    return None


def read_libraries(shared: Path | None) -> dict[str, oncue_core.Library]:
    """The libraries by name: ACCAD's captures with the starter's sits where they are there, and the starter alone."""
    libraries = {}
    captures = shared / "data" / "mocap" / "accad" if shared else None
    if captures and captures.is_dir():
        libraries["ACCAD"] = oncue_core.build_library([captures]).result()[0]
    libraries["starter"] = oncue_core.build_library([]).result()[0]
    return libraries


def read_clips(shared: Path | None) -> dict[str, oncue_core.Library]:
    """What motions stand beside: ACCAD's captures alone where they are there, and what the starter makes by rule."""
    clips = {}
    captures = shared / "data" / "mocap" / "accad" if shared else None
    if captures and captures.is_dir():
        alone = {"starter": "none", "mirror": False}
        clips["ACCAD, captured"] = oncue_core.build_library([captures], alone).result()[0]
    clips["starter, made by rule"] = oncue_core.Library.starter()
    return clips
