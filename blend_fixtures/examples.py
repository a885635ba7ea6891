# SPDX-License-Identifier: GPL-3.0-or-later
"""The scenes that the artist's guide (docs/guide) speaks of, each ready for Synthesize; everything is built in code.

    python blend_fixtures/examples.py --out DIR [--only NAME …]

A file is named after the page that it belongs to. Metres, 30 frames a second. Runs on the bpy module (4.2 to 5.2) and
needs no Oncue core.
"""

from __future__ import annotations

import argparse
import math
import sys
from pathlib import Path

import bpy
import numpy as np

sys.path[:0] = [str(Path(__file__).resolve().parent), str(Path(__file__).resolve().parents[1])]

import furniture as f  # noqa: E402
from articulated import opened_by_hand  # noqa: E402
from make_fixtures import living_room, new_scene, save  # noqa: E402
from openings import Opening  # noqa: E402
from people import make_person  # noqa: E402

from addon import properties  # noqa: E402
from addon.bridge.cue_objects import PELVIS_OVER_SEAT, place_cue, yaw_from_heading  # noqa: E402

#: The cupboard whose door is opened: how wide, deep and high, metres; its front is at y = 0.
CUPBOARD = (0.90, 0.40, 1.60)
#: How thick its boards are, how far its door opens, degrees, and where the handle is: from the door's free edge, before
#: the front, and over the floor.
BOARD, OPENS, HANDLE = 0.02, 100.0, (0.05, 0.045, 1.02)


def cue(kind: str, x: float, y: float, heading_deg: float, seat: float | None = None, *, then: bool = False):
    """A cue as its button makes it; `seat` is the height of what a sit cue is over."""
    height = 0.0 if seat is None else seat + PELVIS_OVER_SEAT
    place = (x, y, height)
    return place_cue(bpy.context, kind, place, yaw_from_heading(math.radians(heading_deg)), 1.0, then=then)


def first_shot() -> None:
    """A living room: from the door round the pouf and the low table, down on the sofa."""
    living_room(new_scene())
    cue("start", 0.75, 0.75, 80)
    cue("sit", 3.02, 3.98, -90, 0.43)


def seats() -> None:
    """A chair, an armchair, a sofa, a bench, a bar stool and a bed; the cue is on the armchair."""
    scene = new_scene()
    f.floor(scene, (0, 0), (8.0, 5.0))
    f.walls(scene, (0, 0), (8.0, 5.0))
    f.chair(scene, (1.0, 4.2, 0), 0.0)
    f.armchair(scene, (2.4, 4.2, 0), 0.0)
    f.sofa(scene, (4.4, 4.2, 0), 0.0)
    f.bench(scene, (1.3, 2.2, 0))
    f.stool(scene, (3.0, 2.2, 0), 0.72, "Bar Stool")
    f.bed(scene, (6.9, 3.8, 0), 0.0)
    cue("start", 2.2, 0.7, 90)
    cue("sit", 2.4, 4.14, -90, 0.40)


def several_cues() -> None:
    """The living room: down on the sofa, up again, past the desk, and to a stop before the shelf."""
    living_room(new_scene())
    cue("start", 0.75, 0.75, 80)
    cue("sit", 3.02, 3.98, -90, 0.43)
    cue("stop", 0.85, 2.9, 180, then=True)
    cue("pass", 1.55, 1.9, 0)


def own_rig() -> None:
    """A rig that is named and built as Mixamo's are, 1.7 m tall, chosen as Character, beside a bench."""
    scene = new_scene()
    f.floor(scene, (-3, -4), (3, 2))
    f.bench(scene, (0, 0, 0))
    f.plant(scene, (1.6, 0.3, 0))
    person = make_person("mixamo", 1.7)
    for part in person.children:
        part.data.materials.append(f.material("mustard"))
    cue("start", 1.6, -2.6, 120)
    cue("sit", 0.0, 0.0, -90, 0.45)
    scene.oncue.character = person


def hands_and_doors() -> None:
    """A cupboard whose door opens by its keys, and a hand that holds the handle meanwhile."""
    scene = new_scene()
    f.floor(scene, (-3, -3), (3, 3))
    opened_by_hand(scene, _cupboard(scene).by_hand())


def _cupboard(scene: bpy.types.Scene) -> Opening:
    """A cupboard with two doors, and how its left one opens."""
    width, depth, height = CUPBOARD
    half = width / 2
    body = f.Piece("Cupboard").box((-half, depth - BOARD, 0.0), (half, depth, height), "oak")
    for x in (-half, half - BOARD):
        body.box((x, BOARD, 0.0), (x + BOARD, depth, height), "oak")
    for z in (0.06, 0.55, 1.05, height - BOARD):
        body.box((-half, BOARD, z), (half, depth, z + BOARD), "oak")
    body.box((0.0, 0.0, 0.06), (half, BOARD, height), "walnut")
    body.link(scene)
    aside, before, up = HANDLE
    door = f.Piece("Cupboard Door").box((-half, 0.0, 0.06), (-0.004, BOARD, height), "walnut")
    door.box((-aside - 0.01, -before, up - 0.08), (-aside + 0.01, 0.0, up + 0.08), "metal")
    door.link(scene)
    return Opening(
        file="",
        object="Cupboard",
        part="Cupboard Door",
        slides=False,
        axis=np.array((0.0, 0.0, -1.0)),
        origin=np.array((-half, 0.0, 0.0)),
        contact=np.array((-aside, -before, up)),
        most=OPENS,
        lift=0.0,
    )


#: File → scene.
EXAMPLES = {
    "first-shot": first_shot,
    "seats": seats,
    "several-cues": several_cues,
    "own-rig": own_rig,
    "hands-and-doors": hands_and_doors,
}


def main(arguments: list[str]) -> None:
    parser = argparse.ArgumentParser(prog="examples", description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, required=True, help="folder to write to")
    parser.add_argument("--only", nargs="+", choices=sorted(EXAMPLES), help="these scenes only")
    options = parser.parse_args(arguments)
    # What a scene remembers of Oncue is kept with it.
    properties.register()
    for name in options.only or EXAMPLES:
        EXAMPLES[name]()
        save(options.out / f"{name}.blend")
    properties.unregister()


if __name__ == "__main__":
    main(sys.argv[1:])
