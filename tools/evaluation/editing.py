"""Section 4.3's editor: seats that are fitted, and what a hand opens, beside plain inverse kinematics (figure 9)."""

from __future__ import annotations

import hashlib
import math
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import oncue_core

from blend_fixtures.openings import (
    PELVIS_OVER_SEAT,
    SEAT,
    TABLE,
    TABLE_PLACE,
    TABLE_SIZE,
    Opening,
    read_openings,
)

from .experiments import UNEDITED, Bench, Row
from .scenes import read_glb, yaw_of

#: A controller that stops farther from its cue than this has not arrived, metres.
ARRIVED = 0.2
#: Seconds in which a part is opened.
TAKES = 2.0
#: Our editor, its finishing pass alone, and what the paper compares with.
METHODS = {"Oncue": {}, "without the manifold": {"editor": {"manifold": False}}, "plain IK": None}
#: What is asked of each seat: as the table has it; the feet elsewhere; and a cue that the controller did not aim at.
WISHES = ("as given", "feet placed", "moved")


def seats(bench: Bench) -> Iterator[Row]:
    """Every seat of the rooms, fitted to each of the wishes after the controller."""
    library = next(iter(bench.libraries))
    for name in bench.rooms.names[: 2 if bench.quick else None]:
        scene = bench.rooms.scene(name)
        for number, task in enumerate(scene.tasks[: 1 if bench.quick else None], 1):
            key = bench.key("seats", library, scene=scene.index.fingerprint, task=task)

            def make(scene=scene, task=task):
                return _seat_rows(scene.index, bench.libraries[library], task, bench.seed)

            for row in bench.store.get(key, make):
                bench.say(f"seat, {name} {number}, {row['wish']}: {_said(row)}")
                yield {"room": name, "task": number, **row}


def _seat_rows(scene, library, task, seed) -> list[Row]:
    """The three fits of one seat; one row with a `problem` where the controller does not get there."""
    try:
        made = oncue_core.synthesize(scene, library, task, UNEDITED, seed).result()
    except oncue_core.InputError as error:
        return [{"wish": WISHES[0], "problem": str(error)}]
    cues = made.report["cues"]
    complete = cues[0]["frame"] if cues else len(made.root_positions) - 1
    if np.linalg.norm(made.root_positions[complete] - task["cue"]["position"]) > ARRIVED:
        return [{"wish": WISHES[0], "problem": "The controller does not get there.", "arrived": False}]
    floor, before = float(task["start"]["position"][2]), (made.root_positions, made.rotations, made.contacts)
    rows = []
    for wish in WISHES:
        cue = wished(task["cue"], wish, floor)
        began = time.perf_counter()
        try:
            done = oncue_core.fit_seat(*before, cue, complete, scene, floor).result()
        except oncue_core.InputError as error:
            rows.append({"wish": wish, "problem": str(error)})
            continue
        seconds = time.perf_counter() - began
        span = (done.figures["first_frame"], done.figures["end_frame"])
        now = oncue_core.motion_figures(done.root_positions, done.rotations, done.contacts, *span, floor)
        was = oncue_core.motion_figures(*before, *span, floor)
        seat = done.figures["seat"]
        feet = [miss for miss in seat["feet_cm"] if miss is not None]
        rows.append(
            {
                "wish": wish,
                "problem": "",
                "seconds": seconds,
                "seat_m": float(cue["position"][2]) - floor - PELVIS_OVER_SEAT,
                "pelvis_cm": seat["pelvis_cm"],
                "pelvis_before_cm": done.figures["seat_before"]["pelvis_cm"],
                "facing_degrees": seat["facing_degrees"],
                "feet_cm": max(feet) if feet else None,
                "hanging": any(seat["hanging"]),
                "thigh_cm": seat["thigh_cm"],
                "back_cm": seat["back_cm"],
                **_smooth(now),
                "skate_before_cm": was["foot"]["skate_cm"],
                "acceleration_before": was["smoothness"]["largest_acceleration"],
            }
        )
    return rows


def wished(cue: oncue_core.ActionCue, wish: str, floor: float) -> oncue_core.ActionCue:
    """The cue with what is asked of the seat."""
    yaw = float(cue["yaw"])
    turn = np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])
    place = np.array(cue["position"], dtype=float)

    def at(left: float, ahead: float, height: float) -> list[float]:
        return [*(place[:2] + turn @ (left, -ahead)), height]

    if wish == "feet placed":
        return {**cue, "feet": [at(0.20, 0.42, floor), at(-0.10, 0.30, floor)]}
    if wish == "moved":
        return {**cue, "position": at(0.05, 0.06, place[2] + 0.04), "yaw": yaw + 0.2}
    return cue


def openings(bench: Bench, objects: Path) -> Iterator[Row]:
    """Every part of the objects, opened by each method from the same motion of the controller."""
    library = next(iter(bench.libraries))
    found = [opening.by_hand() for opening in read_openings(objects / "objects.tsv")]
    for opening in found[:3] if bench.quick else found:
        mesh = hashlib.sha256((objects / opening.file).read_bytes()).hexdigest()
        task, cue = opening_task(opening), hand_cue(opening)
        key = bench.key("openings", library, part=opening.part, mesh=mesh, task=task, cue=cue)

        def make(opening=opening):
            return _opening_rows(objects, opening, bench.libraries[library], bench.seed)

        for row in bench.store.get(key, make):
            bench.say(f"{opening.part}, {row['method']}: {_said(row)}")
            yield {"part": opening.part, **row}


def _opening_rows(objects: Path, opening: Opening, library, seed) -> list[Row]:
    scene, task = opening_scene(objects, opening), opening_task(opening)
    made = oncue_core.synthesize(scene, library, task, UNEDITED, seed).result()
    motion = (made.root_positions, made.rotations, made.contacts)
    if opening.seated:
        fitted = oncue_core.fit_seat(*motion, task["cue"], made.report["cues"][0]["frame"], scene).result()
        motion = (fitted.root_positions, fitted.rotations, fitted.contacts)
    cue = hand_cue(opening)
    rows = []
    for method, settings in METHODS.items():
        began = time.perf_counter()
        try:
            if settings is None:
                done = oncue_core.plain_ik(*motion, cue).result()
            else:
                done = oncue_core.edit_motion(*motion, manipulations=[cue], scene=scene, settings=settings).result()
        except oncue_core.InputError as error:
            rows.append({"method": method, "problem": str(error)})
            continue
        seconds = time.perf_counter() - began
        (hand,) = done.figures["constraints"]
        arrays = (done.root_positions, done.rotations, done.contacts)
        figures = oncue_core.motion_figures(*arrays, done.figures["first_frame"], done.figures["end_frame"])
        row = {
            "method": method,
            "problem": "",
            "seconds": seconds,
            "mean_cm": hand["mean_cm"],
            "max_cm": hand["max_cm"],
        }
        rows.append({**row, "manifold_cm": figures["manifold_cm"], **_smooth(figures)})
    return rows


def hand_cue(opening: Opening) -> oncue_core.ManipulationCue:
    """The right hand on the part while it opens with the least jerk; as soon as the person is there."""
    t = np.linspace(0.0, 1.0, round(30 * TAKES))
    path = opening.held(opening.most * t**3 * (10 - 15 * t + 6 * t**2))
    return {"name": opening.part, "hand": "right", "path": path.tolist()}


def opening_task(opening: Opening) -> oncue_core.Task:
    """Walks up to the object and stands, or sits down, before it."""
    (place, heading), begin = opening.stand(), opening.begin()
    way = place - begin
    kind, height = ("sit", SEAT + PELVIS_OVER_SEAT) if opening.seated else ("stop", 0.0)
    return {
        "start": {
            "name": "Start",
            "position": begin.tolist(),
            "yaw": yaw_of(math.degrees(math.atan2(way[1], way[0]))),
        },
        "cue": {
            "name": kind.title(),
            "action_type": kind,
            "position": [place[0], place[1], height],
            "yaw": yaw_of(math.degrees(heading)),
        },
    }


def opening_scene(objects: Path, opening: Opening) -> oncue_core.SceneIndex:
    """The closed object on a floor, with table and stool where it is opened seated."""
    positions, triangles = read_glb(objects / opening.file)
    parts = [(positions + np.float32([0, 0, opening.lift]), triangles), _box((-3, -3, -0.1), (3, 3, 0))]
    if opening.seated:
        (x, y), (width, depth) = TABLE_PLACE, TABLE_SIZE
        low, high = (x - width / 2, y - depth / 2), (x + width / 2, y + depth / 2)
        parts.append(_box((*low, TABLE - 0.04), (*high, TABLE)))
        legs = ((a, b) for a in (low[0], high[0] - 0.05) for b in (low[1], high[1] - 0.05))
        parts += [_box((a, b, 0), (a + 0.05, b + 0.05, TABLE)) for a, b in legs]
        (x, y, _), _ = opening.stand()
        parts.append(_box((x - 0.17, y - 0.17, SEAT - 0.05), (x + 0.17, y + 0.17, SEAT)))
    vertices, faces, count = [], [], 0
    for places, corners in parts:
        vertices.append(places)
        faces.append(corners + np.uint32(count))
        count += len(places)
    return oncue_core.index_scene(np.concatenate(vertices), np.concatenate(faces)).result()


def _box(low, high) -> tuple[np.ndarray, np.ndarray]:
    ends = np.array([low, high], dtype=np.float32)
    corners = np.array([[ends[i, 0], ends[j, 1], ends[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    squares = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    halves = [half for a, b, c, d in squares for half in ((a, b, c), (a, c, d))]
    return corners.astype(np.float32), np.array(halves, dtype=np.uint32)


def _smooth(figures: dict[str, Any]) -> Row:
    return {
        "acceleration": figures["smoothness"]["largest_acceleration"],
        "jerk": figures["smoothness"]["mean_jerk"],
        "skate_cm": figures["foot"]["skate_cm"],
        "worst_skate_cm": figures["foot"]["worst_skate_cm"],
    }


def _said(row: Row) -> str:
    if row["problem"]:
        return row["problem"]
    if "method" in row:
        return f"hand off by {row['max_cm']:.2f} cm at most, {row['seconds']:.1f} s"
    return f"pelvis off by {row['pelvis_cm']:.2f} cm, {row['seconds']:.1f} s"


def missed(rows: list[Row]) -> list[Row]:
    """Those of our edits that do not arrive: a centimetre and three degrees are allowed."""
    out = []
    for row in rows:
        if row.get("method", "Oncue") != "Oncue" or not row.get("arrived", True):
            continue
        centimetres = [row.get("max_cm"), row.get("pelvis_cm"), row.get("feet_cm")]
        far = any(miss is not None and miss > 1.0 for miss in centimetres) or row.get("facing_degrees", 0.0) > 3.0
        if row["problem"] or far:
            out.append(row)
    return out
