"""What an eye sees in the motions of every task, by each library and some seeds, and in clips; and how seeds differ."""

from __future__ import annotations

import functools
import hashlib
import itertools
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import oncue_core

from . import windows

if TYPE_CHECKING:
    from .experiments import Bench

Row = dict[str, Any]

#: An elbow or knee that is further beyond its limit than this is seen, degrees.
BEYOND = 6.0
HINGES = ("LeftForeArm", "RightForeArm", "LeftLeg", "RightLeg")
#: A gap as narrow as this turns arms rightly, cm.
NARROW = 70.0
#: Seeds whose end poses are compared.
VARIATION = 5
#: How the report begins to name a limb in the scene.
IN_SCENE = "deep in what stands"


@functools.cache
def _source() -> str:
    """Of what picks the figures: what was picked otherwise is picked anew."""
    return hashlib.sha256(Path(__file__).read_bytes()).hexdigest()[:20]


# --- one motion -----------------------------------------------------------------------------------


def seen(bench: Bench, library: str, scene, task, seed: int) -> Row:
    """What is seen in one motion, from the store where it is there; `problem` alone where there is none."""

    def make() -> Row:
        try:
            made = oncue_core.synthesize(scene.index, bench.libraries[library], task, {}, seed).result()
        except oncue_core.InputError as error:
            return {"problem": str(error)}
        return figures(made.report) | {"end": end_pose(made.root_positions, made.rotations)}

    key = bench.key("eyes", library, scene=scene.index.fingerprint, task=task, seed=seed, source=_source())
    return bench.store.get(key, make)


def figures(report: oncue_core.Report) -> Row:
    """Of a report what the tables ask for."""
    body, style = report["body"], report["style"]
    scene, distance = body["scene"], body["pose_distance"]
    hinges = [one["degrees"] for one in body["joint_limits"]["beyond"] if one["joint"] in HINGES]
    return {
        "problem": "",
        "met": bool(report["cues"]) and all(cue["met"] for cue in report["cues"]),
        "problems": report["problems"],
        "frames": report["frames"],
        "own_cm": body["own_body"]["deepest_cm"],
        "own_percent": body["own_body"]["percent"],
        "hinge_degrees": max(hinges, default=0.0),
        "arms_percent": arms_far(distance["beyond"], report["frames"]) if distance else None,
        "trunk_percent": distance["trunk_percent"] if distance else None,
        "scene_percent": scene["over_1_cm_percent"] if scene else None,
        "scene_cm": scene["deepest_cm"] if scene else None,
        "scene_named": any(IN_SCENE in words for words in report["problems"]),
        "feet": body["feet"],
        "style": {f"{group}.{row}": value for group, rows in style.items() for row, value in rows.items()},
    }


def arms_far(beyond: Sequence[oncue_core.FarPose], frames: int) -> float:
    """Share of the frames in which an arm is as no pose of the library has it and no narrow gap is near, percent."""
    arms = [one for one in beyond if one["part"] != "trunk" and (one["gap_cm"] is None or one["gap_cm"] >= NARROW)]
    found = {frame for one in arms for frame in range(one["first"], one["end"])}
    return 100 * len(found) / max(frames, 1)


def end_pose(root_positions, rotations) -> list[list[float]]:
    """The joints of the last frame, world, metres."""
    skeleton = oncue_core.skeleton()
    last = np.asarray(root_positions[-1:], dtype=float), np.asarray(rotations[-1:], dtype=float)
    offsets = np.asarray(skeleton["joint_offsets"], dtype=float)
    return windows.joint_positions(*last, skeleton["parents"], offsets)[0].tolist()


def tasks(bench: Bench) -> Iterator[tuple[Any, int, oncue_core.Task]]:
    """The rooms with the tasks that are asked for: scene, number, task."""
    for name in bench.rooms.names[: 2 if bench.quick else None]:
        if bench.only_rooms and name not in bench.only_rooms:
            continue
        scene = bench.rooms.scene(name)
        for number, task in enumerate(scene.tasks[: 1 if bench.quick else bench.most_tasks], 1):
            yield scene, number, task


def every_motion(bench: Bench) -> Iterator[Row]:
    """Every task with each library and seed."""
    for scene, number, task in tasks(bench):
        for library, seed in itertools.product(bench.libraries, range(1, bench.seeds + 1)):
            row = seen(bench, library, scene, task, seed)
            bench.say(f"{library}, {scene.name} {number}, seed {seed}: {_said(row)}")
            yield {"library": library, "room": scene.name, "task": number, "seed": seed, **row}


def variation(bench: Bench) -> Iterator[Row]:
    """Each task by several seeds: how near its two nearest end poses are, cm; motions that miss are left out."""
    seeds = 2 if bench.quick else VARIATION
    for scene, number, task in tasks(bench):
        for library in bench.libraries:
            rows = [seen(bench, library, scene, task, seed) for seed in range(1, seeds + 1)]
            ends = [np.array(row["end"]) for row in rows if row.get("met")]
            bench.say(f"{library}, {scene.name} {number}: {len(ends)} end poses")
            yield {
                "library": library,
                "room": scene.name,
                "task": number,
                "cue": task["cue"]["name"],
                "seeds": len(ends),
                "apart_cm": nearest_pair(ends),
                "seconds_apart": spread([row["frames"] / 30 for row in rows if row.get("met")]),
            }


def nearest_pair(poses: Sequence[np.ndarray]) -> float | None:
    """The least mean distance of the joints (joints, 3) between any two poses, cm."""
    pairs = itertools.combinations(poses, 2)
    return min((100 * float(np.linalg.norm(a - b, axis=1).mean()) for a, b in pairs), default=None)


def spread(values: Sequence[float]) -> float | None:
    """From the least to the largest."""
    return max(values) - min(values) if values else None


def _said(row: Row) -> str:
    if row["problem"]:
        return row["problem"]
    return (
        f"own body {row['own_cm']:.1f} cm, elbows and knees {row['hinge_degrees']:.0f}°, "
        f"arms {row['arms_percent']:.1f} %, scene {row['scene_percent']:.1f} %"
    )


# --- clips ----------------------------------------------------------------------------------------


def of_clips(library) -> Row:
    """The same of a library's own clips, mirrored copies left out: each clip is a motion on its own."""
    rows = []
    for number in range(library.clip_count):
        clip = library.clip(number)
        if clip["mirrored"]:
            continue
        motion, count = (clip["root_positions"], clip["rotations"], clip["contacts"]), len(clip["contacts"])
        body = oncue_core.motion_figures(*motion, 0, count)["body"]
        hinges = [one["degrees"] for one in body["joint_limits"]["beyond"] if one["joint"] in HINGES]
        rows.append({"own_percent": body["own_body"]["percent"], "hinge_degrees": max(hinges, default=0.0)})
    style = library.style_figures()
    flat = {f"{group}.{row}": value for group, values in style.items() for row, value in values.items()}
    return {"motions": rows, "feet": library.body_figures()["feet"], "style": flat}
