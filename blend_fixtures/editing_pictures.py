# SPDX-License-Identifier: GPL-3.0-or-later
"""The editor's contact sheets, as the paper's figure 9: pairs of pictures, the same moment from the same camera.

    python blend_fixtures/editing_pictures.py openings --data DATA --work FOLDER --out sheet.jpg
        what a hand opens: Oncue's edit, and plain inverse kinematics of arm and spine
    python blend_fixtures/editing_pictures.py seats --data DATA --work FOLDER --out sheet.jpg
        seats of the rooms: fitted to the cue as its table has it, and to one that the controller did not aim at

DATA holds `objects/objects.tsv` and `rooms/rooms.tsv`. Needs oncue_core beside the bpy module.
"""

from __future__ import annotations

import argparse
import os
import sys
from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np

sys.path[:0] = [str(Path(__file__).resolve().parent), str(Path(__file__).resolve().parents[1])]

import make_fixtures  # noqa: E402
from articulated import object_task  # noqa: E402
from cameras import BODY, Sight  # noqa: E402
from openings import read_openings  # noqa: E402
from render import SHEET_SIZE, aim, draw, prepare, read_pixels, stamp, write_pixels  # noqa: E402
from walk import read_walk  # noqa: E402

import addon  # noqa: E402
from addon import pipeline  # noqa: E402
from addon.bridge import session  # noqa: E402

#: The parts that are shown, and the seats: room and task.
PARTS = ("door_leaf", "chest_drawer_1", "chest_drawer_4", "laptop_lid", "toilet_cc0_lid", "oven_door")
SEATS = (
    *(("quest_living_room", "1"), ("quest_living_room", "3"), ("quest_meeting_room", "1")),
    *(("quest_office_small", "2"), ("sh3d_Studio", "2"), ("sh3d_Studio", "4")),
    *(("sh3d_2BedroomApartment", "1"), ("sh3d_3BedroomApartment", "3"), ("sh3d_1BedroomApartmentWithRoundWall", "3")),
)
#: What is asked of a seat beside what its table asks: metres ahead and to the left, and radians.
MOVED, TURNED = (0.06, 0.05), 0.2
#: Pairs side by side in a sheet.
PAIRS = {"openings": 2, "seats": 3}


def outcome_of(request: pipeline.Request) -> pipeline.Outcome:
    return pipeline.run_blocking(pipeline.synthesis_steps(request, CACHE))


CACHE = pipeline.LibraryCache()


class Edited:
    """A synthesis whose motion another editor has changed."""

    def __init__(self, synthesis, edited) -> None:
        self.root_positions, self.rotations, self.contacts = edited.root_positions, edited.rotations, edited.contacts
        self.frame_rate, self.report = synthesis.frame_rate, synthesis.report


def opening_actions(core) -> list[tuple[str, bpy.types.Action]]:
    """The hand's way by either method, from the same motion."""
    context = bpy.context
    request, skipped = session.read_request(context)
    task = dict(request.task)
    (cue,) = task.pop("manipulations")
    cue = {**cue, "path": np.asarray(cue["path"]).tolist()}
    plain = replace(request, task=task)
    before = outcome_of(plain)
    motion = (before.synthesis.root_positions, before.synthesis.rotations, before.synthesis.contacts)
    floor = float(task["start"]["position"][2])
    scene = core.index_scene(request.positions, request.triangles).result()
    ours = core.edit_motion(*motion, manipulations=[cue], scene=scene, floor=floor).result()
    theirs = core.plain_ik(*motion, cue, floor).result()
    actions = []
    for name, edited in (("Oncue", ours), ("plain IK", theirs)):
        off = edited.figures["constraints"][0]["max_cm"]
        outcome = replace(before, synthesis=Edited(before.synthesis, edited))
        action = session.write_outcome(context, request, outcome, skipped)
        actions.append((f"{name}: off by {off:.1f} cm at most", action))
    return actions


def seat_actions() -> list[tuple[str, bpy.types.Action]]:
    """The controller's motion towards the cue, fitted to it, and to the cue moved and turned."""
    context = bpy.context
    request, skipped = session.read_request(context)
    before = outcome_of(replace(request, overrides={"editor": {"fit": False}}))
    made, task, core = before.synthesis, dict(request.task), pipeline.native.core
    yaw, (ahead, left) = float(task["cue"]["yaw"]), MOVED
    shift = np.array([np.sin(yaw) * ahead + np.cos(yaw) * left, -np.cos(yaw) * ahead + np.sin(yaw) * left, 0.0])
    cue = {**task["cue"], "position": (np.array(task["cue"]["position"]) + shift).tolist(), "yaw": yaw + TURNED}
    scene, floor = core.index_scene(request.positions, request.triangles).result(), task["start"]["position"][2]
    motion = (made.root_positions, made.rotations, made.contacts)
    actions = []
    for name, wish in (("as it is", task["cue"]), ("cue moved", cue)):
        edited = core.fit_seat(*motion, wish, made.report["cues"][0]["frame"], scene, float(floor)).result()
        seat = edited.figures["seat"]
        outcome = replace(before, synthesis=Edited(made, edited))
        action = session.write_outcome(context, request, outcome, skipped)
        height = wish["position"][2] - floor - 0.10
        actions.append((f"{name}: {height:.2f} m, off by {seat['pelvis_cm']:.1f} cm", action))
    return actions


def pair(kind: str, actions: list[tuple[str, bpy.types.Action]], title: str, cell: Path) -> np.ndarray:
    """The same moment of the two actions, side by side, seen by the camera that sees the first best."""
    scene = bpy.context.scene
    character = scene.oncue.character
    prepare(scene, SHEET_SIZE)
    pictures, view, frame = [], None, 0
    for note, action in actions:
        character.animation_data.action = action
        walk = read_walk(scene)
        if view is None:
            index = len(walk.frames) - 1
            if kind == "openings":
                _, first, last = walk.hands[0]
                # Near the end of the way, where it has led farthest.
                index = first + round(0.9 * (last - first))
            frame = int(walk.frames[index])
            scene.frame_set(frame)
            view = Sight(walk).best(BODY, index)
        scene.frame_set(frame if kind == "openings" else int(walk.frames[-1]))
        aim(scene.camera, view)
        stamp(scene, f"{title}, {note}")
        draw(scene, cell)
        pictures.append(read_pixels(cell))
    return np.concatenate(pictures, axis=1)


def main(arguments: list[str]) -> None:
    parser = argparse.ArgumentParser(prog="editing_pictures", description=__doc__.splitlines()[0])
    parser.add_argument("kind", choices=sorted(PAIRS))
    parser.add_argument("--data", type=Path, required=True, help="objects/ and rooms/ with their tables")
    parser.add_argument("--work", type=Path, required=True, help="a folder for what is drawn in between")
    parser.add_argument("--out", type=Path, required=True, help="the sheet")
    options = parser.parse_args(arguments)
    addon.register()
    core = pipeline.native.core
    options.work.mkdir(parents=True, exist_ok=True)
    cell, pairs = options.work / "cell.png", []
    if options.kind == "openings":
        objects = options.data / "objects"
        for opening in (o.by_hand() for o in read_openings(objects / "objects.tsv") if o.part in PARTS):
            object_task(make_fixtures.new_scene(), objects / opening.file, opening)
            pairs.append(pair("openings", opening_actions(core), opening.part.replace("_", " "), cell))
            print(f"drew {opening.part}", flush=True)
    else:
        rooms = options.data / "rooms"
        for room, number in SEATS:
            (row,) = (r for r in make_fixtures.room_rows(rooms / "rooms.tsv", room) if r["task"] == number)
            make_fixtures.room_task(rooms / f"{room}.glb", row)
            pairs.append(pair("seats", seat_actions(), row["seat_object"], cell))
            print(f"drew {room} {number}", flush=True)
    across = PAIRS[options.kind]
    pairs += [np.zeros_like(pairs[0])] * (-len(pairs) % across)
    # Blender's pictures begin at the bottom.
    rows = [np.concatenate(pairs[k : k + across], axis=1) for k in range(0, len(pairs), across)]
    write_pixels(options.out, np.concatenate(rows[::-1], axis=0))
    print(f"wrote {options.out}", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
    # Blender's module can crash or hang while Python takes it down; what was asked for is written.
    sys.stdout.flush()
    os._exit(0)
