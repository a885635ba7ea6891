# SPDX-License-Identifier: GPL-3.0-or-later
"""Makes the .blend files that Oncue is shown and tested with; everything is built in code.

    python blend_fixtures/make_fixtures.py --out DIR [--only NAME …]
        the demo room and the small task scenes
    python blend_fixtures/make_fixtures.py --room ROOM.glb --tasks rooms.tsv --out DIR
        DIR/ROOM-TASK.blend for each row of that room in the table
    python blend_fixtures/make_fixtures.py --object DOOR.glb --tasks objects.tsv --out DIR
        DIR/PART.blend for each moving part of that object in the table, opened by hand

Metres; a heading is the angle of the forward direction from +X, degrees, counter-clockwise from above.
Runs on the bpy module (4.2 to 5.2) and needs no Oncue core.
"""

from __future__ import annotations

import argparse
import csv
import functools
import math
import sys
from pathlib import Path

import bpy
from mathutils import Vector

sys.path[:0] = [str(Path(__file__).resolve().parent), str(Path(__file__).resolve().parents[1])]

import furniture as f  # noqa: E402
from articulated import object_task  # noqa: E402
from openings import read_openings  # noqa: E402

from addon.bridge.cue_objects import PELVIS_OVER_SEAT, make_cue, yaw_from_heading  # noqa: E402

#: How far a room's corners may lie from the table's, metres: its figures have two decimals.
BOUNDS_TOLERANCE = 0.011


def new_scene(frame_rate: int = 30) -> bpy.types.Scene:
    """An empty file at `frame_rate`."""
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    scene = bpy.context.scene
    scene.render.fps, scene.frame_start, scene.frame_end = frame_rate, 1, 60
    return scene


def start(x: float, y: float, heading_deg: float, z: float = 0.0, **options) -> bpy.types.Object:
    return make_cue(bpy.context, "start", (x, y, z), yaw_from_heading(math.radians(heading_deg)), **options)


def sit(x: float, y: float, seat: float, heading_deg: float, **options) -> bpy.types.Object:
    """A sit cue over a seat of height `seat`."""
    place = (x, y, seat + PELVIS_OVER_SEAT)
    return make_cue(bpy.context, "sit", place, yaw_from_heading(math.radians(heading_deg)), **options)


def stop(x: float, y: float, heading_deg: float, **options) -> bpy.types.Object:
    return make_cue(bpy.context, "stop", (x, y, 0.0), yaw_from_heading(math.radians(heading_deg)), **options)


# --- scenes ----------------------------------------------------------------------------------------------------------


def living_room(scene: bpy.types.Scene) -> None:
    """A living room of 5.6 × 4.6 m, without cues."""
    f.floor(scene, (0, 0), (5.6, 4.6))
    f.walls(scene, (0, 0), (5.6, 4.6))
    f.rug(scene, (1.5, 1.9), (3.9, 3.5))
    f.sofa(scene, (2.55, 4.08, 0), 0.0)
    f.table(scene, (2.35, 2.72, 0), (1.1, 0.55), 0.42, "Low Table")
    f.pouf(scene, (2.75, 1.45, 0))
    f.table(scene, (5.22, 1.9, 0), (0.70, 1.5), 0.74, "Desk")
    f.desk_things(scene, (5.30, 1.9, 0.74), -math.pi / 2)
    f.chair(scene, (4.65, 1.75, 0), math.pi / 2 - 0.25, "Desk Chair")
    f.shelf(scene, (0.16, 2.9, 0), math.pi / 2)
    f.plant(scene, (5.15, 4.15, 0))
    f.lamp(scene, (3.95, 4.2, 0))
    f.stool(scene, (1.15, 4.15, 0), name="Side Stool")


def demo_room() -> None:
    """The living room: from the door round the pouf and the low table, down on the sofa."""
    living_room(new_scene())
    start(0.75, 0.75, 80)
    sit(3.02, 3.98, 0.43, -90)


def chair_row() -> None:
    """A row of four chairs side by side; the cue is on the second."""
    scene = new_scene()
    f.floor(scene, (-3, -4), (3, 2))
    for k in range(4):
        f.chair(scene, (-0.9 + 0.6 * k, 0, 0), 0.0, f"Chair {k + 1}")
    start(1.8, -2.6, 90)
    sit(-0.3, -0.02, 0.45, -90)


def gap_55() -> None:
    """Two cupboards with a gap of 55 cm between them; the chair stands behind it."""
    scene = new_scene()
    f.floor(scene, (-3, -4), (3, 3))
    for name, low, high in (("Cupboard Left", -2.8, -0.275), ("Cupboard Right", 0.275, 2.8)):
        f.Piece(name).box((low, -0.9, 0), (high, -0.4, 1.9), "oak").link(scene)
    f.chair(scene, (0.3, 1.4, 0), 0.0)
    start(0.5, -3.0, 120)
    sit(0.3, 1.38, 0.45, -90)


def gap_room() -> None:
    """Two walls of cupboards with a gap of 55 cm, the only way: arms have to turn aside (rust/oncue/tests/gap.rs)."""
    scene = new_scene()
    f.floor(scene, (-3, -4), (3, 3))
    for name, low, high in (("Cupboards Left", -3.0, -0.275), ("Cupboards Right", 0.275, 3.0)):
        f.Piece(name).box((low, -0.9, 0), (high, -0.4, 1.9), "oak").link(scene)
    start(0.5, -3.0, 59)
    stop(0.3, 1.4, 70.4)


def stool_alone() -> None:
    """A stool in the open, approached from behind."""
    scene = new_scene()
    f.floor(scene, (-3, -3), (3, 3))
    f.stool(scene, (0, 0, 0))
    start(0.4, 2.2, -90)
    sit(0, 0, 0.44, -90)


def enclosed_seat() -> None:
    """A chair inside four closed walls: nobody can get there."""
    scene = new_scene()
    f.floor(scene, (-3, -4), (3, 3))
    f.walls(scene, (-0.8, -0.9), (0.8, 0.7))
    f.chair(scene, (0, 0, 0), 0.0)
    start(0.0, -3.0, 90)
    sit(0, -0.02, 0.45, -90)


def stop_by_table() -> None:
    """A walk that ends standing beside a table, facing it."""
    scene = new_scene()
    f.floor(scene, (-3, -3), (3, 3))
    f.table(scene, (0, 1.2, 0), (1.4, 0.8), 0.74, "Table")
    f.pouf(scene, (0.1, -0.8, 0))
    start(0.0, -2.3, 90)
    stop(0.2, 0.45, 90)


def seat(which: str) -> None:
    """One seat in the open, come to from its front and to one side."""
    scene = new_scene()
    f.floor(scene, (-3, -4), (3, 2))
    height, ahead = SEATS[which]
    match which:
        case "chair":
            f.chair(scene, (0, 0, 0), 0.0)
        case "sofa":
            # In the middle of its right cushion.
            f.sofa(scene, (-0.435, 0, 0), 0.0)
        case "armchair":
            f.armchair(scene, (0, 0, 0), 0.0)
        case "bench":
            f.bench(scene, (0, 0, 0))
        case "bar stool" | "low stool":
            f.stool(scene, (0, 0, 0), height, which.capitalize())
    start(1.6, -2.4, 120)
    sit(0, ahead, height, -90)


#: Height of the seat, and how far along +Y the pelvis is over it, metres.
SEATS = {
    "chair": (0.45, -0.02),
    "sofa": (0.43, -0.06),
    "armchair": (0.40, -0.06),
    "bench": (0.45, 0.0),
    "bar stool": (0.72, 0.0),
    "low stool": (0.30, 0.0),
}

SCENES = {
    "demo_room": demo_room,
    "chair_row": chair_row,
    "gap_55": gap_55,
    "gap_room": gap_room,
    "stool": stool_alone,
    "enclosed_seat": enclosed_seat,
    "stop": stop_by_table,
    **{f"seat_{which.replace(' ', '_')}": functools.partial(seat, which) for which in SEATS},
}


# --- rooms from outside ----------------------------------------------------------------------------------------------


def room_rows(tasks: Path, room: str) -> list[dict[str, str]]:
    """The table's rows of one room. Raises SystemExit with a sentence when there are none."""
    with tasks.open(encoding="utf-8", newline="") as table:
        rows = [row for row in csv.DictReader(table, delimiter="\t") if row["room"] == room]
    if not rows:
        raise SystemExit(f"{tasks} has no row of a room named {room}.")
    return rows


def room_task(room: Path, row: dict[str, str]) -> None:
    """The room of a GLB file with the start and the sit cue of one row of the table."""
    scene = new_scene()
    bpy.ops.import_scene.gltf(filepath=str(room))
    bpy.context.view_layer.update()
    _assert_bounds(scene, row)
    number = {key: float(row[key]) for key in row if key.startswith(("start_", "pelvis_", "facing_"))}
    start(number["start_x"], number["start_y"], number["start_heading_deg"], number["start_z"])
    make_cue(
        bpy.context,
        "sit",
        (number["pelvis_x"], number["pelvis_y"], number["pelvis_z"]),
        yaw_from_heading(math.radians(number["facing_heading_deg"])),
    )


def _assert_bounds(scene: bpy.types.Scene, row: dict[str, str]) -> None:
    """The imported room lies where the table says, or nothing else in it would fit."""
    corners = [o.matrix_world @ Vector(c) for o in scene.objects if o.type == "MESH" for c in o.bound_box]
    for column, pick in (("bbox_min_xyz", min), ("bbox_max_xyz", max)):
        expected = [float(v) for v in row[column].split()]
        found = [pick(corner[axis] for corner in corners) for axis in range(3)]
        if any(abs(a - b) > BOUNDS_TOLERANCE for a, b in zip(expected, found, strict=True)):
            raise SystemExit(
                f"{row['room']}: {column} should be {expected}, the import gave {[round(v, 3) for v in found]}."
            )


# --- command line ----------------------------------------------------------------------------------------------------


def save(path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    bpy.ops.wm.save_as_mainfile(filepath=str(path.resolve()), check_existing=False, compress=True)
    print(f"wrote {path}")


def main(arguments: list[str]) -> None:
    parser = argparse.ArgumentParser(prog="make_fixtures", description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, required=True, help="folder to write to")
    parser.add_argument("--only", nargs="+", choices=sorted(SCENES), help="these scenes only")
    parser.add_argument("--room", type=Path, help="a room as GLB")
    parser.add_argument("--object", type=Path, help="an object with moving parts as GLB")
    parser.add_argument("--tasks", type=Path, help="the table of its tasks or parts, tab-separated")
    options = parser.parse_args(arguments)
    if (options.tasks is not None) != ((options.room or options.object) is not None):
        parser.error("--tasks belongs to --room or to --object")
    if options.room:
        for row in room_rows(options.tasks, options.room.stem):
            room_task(options.room, row)
            save(options.out / f"{options.room.stem}-{row['task']}.blend")
        return
    if options.object:
        for opening in read_openings(options.tasks, options.object.stem):
            object_task(new_scene(), options.object, opening)
            save(options.out / f"{opening.part}.blend")
        return
    for name in options.only or SCENES:
        SCENES[name]()
        save(options.out / f"{name}.blend")


if __name__ == "__main__":
    main(sys.argv[1:])
