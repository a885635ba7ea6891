"""Has rigs of other programs sit down in real rooms, and measures in Blender what was written on them.

`python -m nox -s rigs` makes docs/rigs.md: ten rigs, each at another height in each task, and Oncue's own character
beside them. Rooms are those of `../shared/data`, or of `$ONCUE_SHARED/data`.
"""

from __future__ import annotations

import argparse
import datetime
import os
import platform
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from make_fixtures import room_rows, room_task  # noqa: E402
from people import RIGS, make_person, make_rigify  # noqa: E402

import addon  # noqa: E402
from addon import native, pipeline  # noqa: E402
from addon.bridge import compat, own_rig, session  # noqa: E402

DATA = Path(os.environ.get("ONCUE_SHARED", ROOT.parent / "shared")) / "data" / "rooms"
TASKS = (
    *(("quest_living_room", "2"), ("quest_meeting_room", "1"), ("quest_office_small", "2")),
    *(("sh3d_Studio", "2"), ("sh3d_3BedroomApartment", "2"), ("sh3d_1BedroomApartmentWithRoundWall", "2")),
)
HEIGHTS = (1.2, 1.5, 1.75, 1.95)
OWN = "Oncue's own"
#: Rigs of Rigify, and by which controls their legs and arms have their keys.
RIGIFY = {"rigify by FK": ("FK", "FK"), "rigify by IK": ("IK", "FK")}
#: A foot is planted on a frame of the scene where it is at both of the core's beside it.
PLANTED = 0.9
#: Frames at the end in which the person sits.
SEATED = 10


@dataclass
class Row:
    """What was measured of one run."""

    rig: str
    height: float
    task: str
    met: bool
    problems: list[str]
    #: The middle of the hip joints from where the cue has it in proportion, centimetres.
    hips_cm: float
    #: Heights of the lowest of planted soles over the floor, millimetres.
    soles_mm: np.ndarray
    #: How far the balls of planted feet move to the next frame, millimetres.
    drift_mm: np.ndarray
    #: Keys written, and how many every frame would have.
    keys: tuple[int, int]
    write_s: float


def main(arguments: list[str]) -> None:
    parser = argparse.ArgumentParser(prog="rigs_table", description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "rigs.md", help="the page to write")
    parser.add_argument("--rigs", nargs="+", help="these rigs only")
    options = parser.parse_args(arguments)
    addon.register()
    cache, rows = pipeline.LibraryCache(), []
    kinds = [*RIGS, *RIGIFY, OWN]
    for kind in options.rigs or kinds:
        for n, (room, number) in enumerate(TASKS):
            height = HEIGHTS[(kinds.index(kind) + n) % len(HEIGHTS)]
            row = run(kind, height, room, number, cache)
            rows.append(row)
            print(line(row), flush=True)
    options.out.write_text(page(rows), encoding="utf-8")
    addon.unregister()


def run(kind: str, height: float, room: str, number: str, cache: pipeline.LibraryCache) -> Row:
    """One task on one rig, written and measured."""
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    task = next(row for row in room_rows(DATA / "rooms.tsv", room) if row["task"] == number)
    room_task(DATA / f"{room}.glb", task)
    scene = bpy.context.scene
    if kind == OWN:
        height = 1.8
    else:
        scene.oncue.character = make_rigify(height) if kind in RIGIFY else make_person(kind, height)
        scene.oncue.rig_legs, scene.oncue.rig_arms = RIGIFY.get(kind, ("IK", "FK"))
    bpy.context.view_layer.update()
    request, notes = session.read_request(bpy.context)
    outcome = pipeline.run_blocking(pipeline.synthesis_steps(request, cache))
    began = time.perf_counter()
    action = session.write_outcome(bpy.context, request, outcome, notes)
    seconds = time.perf_counter() - began
    report = session.report_of(action)
    soles, drift, hips = measured(scene, action, request, outcome)
    wanted = np.array(request.task["cue"]["position"]) * request.size - (0.0, 0.0, 0.02 * request.size)
    curves = compat.action_curves(action, scene.oncue.character)
    frames = int(action.frame_range[1] - action.frame_range[0]) + 1
    return Row(
        kind,
        height,
        f"{room} {number}",
        all(cue["met"] for cue in report["cues"]) and bool(report["cues"]),
        report["problems"],
        100.0 * float(np.linalg.norm(hips - wanted)),
        soles,
        drift,
        (sum(len(curve.keyframe_points) for curve in curves), frames * len(curves)),
        seconds,
    )


def measured(scene: bpy.types.Scene, action: bpy.types.Action, request, outcome) -> tuple:
    """Planted soles' heights and drift, millimetres, and where the hips are at the end, metres."""
    character = scene.oncue.character
    joints = {name: name for name in native.core.skeleton()["names"]}
    if not own_rig_is_cores(character):
        joints = own_rig.recognized(character)["joints"]
    skin = next(own_rig.skins(character))
    feet = [corners_of(skin, joints, side, ("Foot", "Toe")) for side in ("Left", "Right")]
    balls = [corners_of(skin, joints, side, ("Toe",)) or feet[k] for k, side in enumerate(("Left", "Right"))]
    contacts = np.asarray(outcome.synthesis.contacts)
    floor = float(request.task["start"]["position"][2]) * request.size
    lows, places, hips = [], [], []
    first, last = (int(frame) for frame in action.frame_range)
    for frame in range(first, last + 1):
        scene.frame_set(frame)
        graph = bpy.context.evaluated_depsgraph_get()
        seen = skin.evaluated_get(graph)
        mesh = seen.to_mesh()
        corners = np.empty(len(mesh.vertices) * 3, dtype=np.float32)
        mesh.vertices.foreach_get("co", corners)
        seen.to_mesh_clear()
        world = np.array(seen.matrix_world)
        corners = corners.reshape(-1, 3) @ world[:3, :3].T + world[:3, 3]
        lows.append([corners[foot, 2].min() - floor for foot in feet])
        places.append([corners[ball].mean(axis=0) for ball in balls])
        if frame > last - SEATED:
            posed = character.evaluated_get(graph)
            legs = [posed.pose.bones[joints[f"{side}UpLeg"]].head for side in ("Left", "Right")]
            hips.append(np.mean([np.array(posed.matrix_world @ leg) for leg in legs], axis=0))
    lows, places = np.array(lows), np.array(places)
    times = np.arange(len(lows)) * 30.0 / request.scene_rate
    beside = [np.clip(whole(times).astype(int), 0, len(contacts) - 1) for whole in (np.floor, np.ceil)]
    stands = (contacts[beside[0]] > PLANTED) & (contacts[beside[1]] > PLANTED)
    both = stands[1:] & stands[:-1]
    drift = np.linalg.norm(np.diff(places, axis=0), axis=2)
    return 1000.0 * lows[stands], 1000.0 * drift[both], np.mean(hips, axis=0)


def own_rig_is_cores(character: bpy.types.Object) -> bool:
    return bool(character.get("oncue_character"))


def corners_of(skin: bpy.types.Object, joints: dict[str, str], side: str, parts: tuple[str, ...]) -> list[int]:
    """The corners of a skin that some bones of a foot carry."""
    names = {joints.get(side + part) for part in parts} - {None}
    names |= {name.replace("ORG-", "DEF-", 1) for name in names}
    groups = {group.index for group in skin.vertex_groups if group.name in names}
    return [v.index for v in skin.data.vertices if any(g.group in groups and g.weight > 0.5 for g in v.groups)]


def line(row: Row) -> str:
    low, high = np.percentile(row.soles_mm, [5, 95])
    return (
        f"| {row.rig} | {row.height:.2f} | {row.task} | {'met' if row.met else 'missed'} | {row.hips_cm:.1f} "
        f"| {low:.1f} to {high:.1f} | {row.soles_mm.min():.1f} | {np.percentile(row.drift_mm, 99):.1f} "
        f"| {row.keys[0]} ({100.0 * row.keys[0] / row.keys[1]:.0f} %) | {row.write_s:.2f} | {' '.join(row.problems)} |"
    )


HEADS = (
    *("rig", "height m", "task", "cue", "hips off cm", "planted soles mm (90 %)", "lowest mm"),
    *("drift mm a frame (99 %)", "keys", "written s", "problems"),
)


def summary(rows: list[Row]) -> str:
    soles, drift = (np.concatenate([getattr(row, name) for row in rows]) for name in ("soles_mm", "drift_mm"))
    met, sound = sum(row.met for row in rows), sum(not row.problems for row in rows)
    return (
        f"Of {len(rows)} runs {met} met their cue and {sound} have no problem; planted soles lie within "
        f"{np.percentile(soles, 5):.1f} and {np.percentile(soles, 95):.1f} mm of the floor in nine of ten frames "
        f"(lowest {soles.min():.1f}) and move by {np.percentile(drift, 99):.1f} mm a frame at the 99th percentile."
    )


def page(rows: list[Row]) -> str:
    by_ik = [row for row in rows if RIGIFY.get(row.rig, ("", ""))[0] == "IK"]
    others = [row for row in rows if row.rig != OWN and row not in by_ik]
    blender = ".".join(map(str, bpy.app.version))
    made = f"{datetime.date.today()}, {os.cpu_count()} cores, {platform.machine()}, Blender {blender}"
    return "\n".join(
        [
            "# Rigs of other programs",
            "",
            f"{made}. Made by `python3 -m nox -s rigs`.",
            "",
            "Ten rigs, nine made by rule as their programs name and build them (`blend_fixtures/people.py`) and one",
            "that Rigify has generated, sit down in real rooms with the starter library, seed 1, each at another",
            "height; beside them Oncue's own character, 1.8 m. Measured on the skins and bones that Blender evaluates,",
            "on each frame of what was written with few keys. *Hips off*: the middle of the hip joints from where the",
            "cue has it for a body of that size. *Soles*: the lowest of a foot over the start's floor while planted.",
            "The rig of Rigify sits down twice: by FK, and with its legs on their IK controls.",
            "",
            *([summary(others)] if others else []),
            *(["", f"With legs by IK: {summary(by_ik)}"] if by_ik else []),
            "",
            f"| {' | '.join(HEADS)} |",
            "|" + "---|" * len(HEADS),
            *(line(row) for row in rows),
            "",
        ]
    )


if __name__ == "__main__":
    main(sys.argv[1:])
