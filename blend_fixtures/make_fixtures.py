# SPDX-License-Identifier: GPL-3.0-or-later
"""Makes the .blend files that Oncue is shown and tested with; everything is built in code.

    python blend_fixtures/make_fixtures.py --out DIR [--only NAME …]
        the demo room and the small task scenes
    python blend_fixtures/make_fixtures.py --room ROOM.glb --tasks rooms.tsv --out DIR
        DIR/ROOM-TASK.blend for each row of that room in the table
    python blend_fixtures/make_fixtures.py --object DOOR.glb --tasks objects.tsv --out DIR
        DIR/PART.blend for each moving part of that object in the table, opened by hand
    python blend_fixtures/make_fixtures.py --room ROOM.glb --shots shots.tsv --out DIR
        DIR/ROOM-SHOT.blend for each shot of that room in the table: people, and their cues one after the other
        (`shots.py` has the columns)

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
from mathutils import Matrix, Vector

sys.path[:0] = [str(Path(__file__).resolve().parent), str(Path(__file__).resolve().parents[1])]

import furniture as f  # noqa: E402
from articulated import object_task  # noqa: E402
from openings import read_openings  # noqa: E402
from shots import DONE, LOOK, OPEN, PUT, TAKE, WITH_A_HAND, BadTable, Row, Shot, read_shots  # noqa: E402

from addon.bridge.cue_objects import (  # noqa: E402
    PELVIS_OVER_SEAT,
    hang_on,
    make_cue,
    middle_of,
    place_open,
    place_put,
    place_take,
    yaw_from_heading,
)
from addon.bridge.names import AT_FRAME_KEY, HOLD_KEY, PERSON_KEY, STEP_KEY, THING_KEY  # noqa: E402
from addon.bridge.seat_finder import Seat, seat_below, seat_of_selection, surface_below  # noqa: E402
from addon.bridge.shown_cues import end_cues, ordered_cues  # noqa: E402
from addon.errors import SceneError  # noqa: E402

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


# --- shots -----------------------------------------------------------------------------------------------------------

#: From so far over the floor a seat, or the floor itself, is looked for where its height is left free, metres.
FROM_ABOVE = 1.0


def shot_scene(room: Path, table: Path, shot: Shot) -> None:
    """The room of a GLB file with the people of a shot, their cues and things. Raises BadTable naming the line."""
    scene = new_scene()
    bpy.ops.import_scene.gltf(filepath=str(room))
    for row in shot.things:
        bring_in(table, room.parent, row)
    bpy.context.view_layer.update()
    placed = [_places(table, scene, rows) for rows in shot.people]
    # All of them first: with several people it is known then whose cues are placed.
    starts = [_cue(scene, rows, places, 0) for rows, places in zip(shot.people, placed, strict=True)]
    for start_cue, rows, places in zip(starts, shot.people, placed, strict=True):
        for at, row in enumerate(rows[1:], 1):
            if row.kind in DONE:
                _do(table, scene, row, places[at][0], start_cue)
                continue
            cue = _cue(scene, rows, places, at)
            if len(starts) > 1:
                cue[PERSON_KEY] = start_cue
            cue[STEP_KEY] = len(ordered_cues(bpy.context, start_cue))
            if row.kind == LOOK and row.x is None:
                hang_on(bpy.context, cue, scene.objects[row.object.split(":")[0]])
            if row.hold is not None:
                cue[HOLD_KEY] = row.hold
            if row.at_frame is not None:
                cue[AT_FRAME_KEY] = row.at_frame


def _cue(
    scene: bpy.types.Scene, rows: tuple[Row, ...], places: list[tuple[Vector, float | None]], at: int
) -> bpy.types.Object:
    """The cue of a person's row at its place. Where the table leaves that free it faces as one comes there, and the
    start what comes first.
    """
    place, heading = places[at]
    if heading is None:
        there = [k for k, row in enumerate(rows) if row.is_come_to]
        other = next((k for k in there if k > 0), 1) if at == 0 else max(k for k in there if k < at)
        way = places[other][0] - place if at == 0 else place - places[other][0]
        heading = math.atan2(way.y, way.x)
    return make_cue(bpy.context, rows[at].kind, place, yaw_from_heading(heading), name=rows[at].name)


def bring_in(table: Path, folder: Path, row: Row) -> None:
    """What a thing's file holds, at its place. Raises BadTable where there is no such file, or nothing in it."""
    file = folder / row.object
    if not file.is_file():
        raise BadTable(f"{table}, line {row.line}: there is no file {row.object} beside the room.")
    before = set(bpy.data.objects)
    bpy.ops.import_scene.gltf(filepath=str(file))
    yaw = yaw_from_heading(math.radians(-90.0 if row.heading is None else row.heading))
    placed = Matrix.Translation((row.x, row.y, row.z or 0.0)) @ Matrix.Rotation(yaw, 4, "Z")
    for thing in set(bpy.data.objects) - before:
        if thing.parent is None:
            thing.matrix_world = placed @ thing.matrix_world


def _do(table: Path, scene: bpy.types.Scene, row: Row, place: Vector, start_cue: bpy.types.Object) -> None:
    """What is done with a thing, by what the sidebar's buttons do; its cue is called as its row."""
    thing = scene.objects.get(row.object)
    if row.kind == OPEN and row.x is not None:
        hinge = bpy.data.objects.new(f"{row.object} hinge", None)
        hinge.location, hinge.empty_display_size = place, 0.1
        scene.collection.objects.link(hinge)
        bpy.context.view_layer.update()
        hang_on(bpy.context, thing, hinge)
    for other in scene.objects:
        other.select_set(other in (thing, start_cue))
    bpy.context.view_layer.objects.active = thing or start_cue
    stops = end_cues(bpy.context, start_cue)
    try:
        if row.kind == TAKE:
            cue = place_take(bpy.context, row.hand or "right", 1.0)
        elif row.kind == OPEN:
            cue = place_open(bpy.context, row.hand or "right", None, None, 0.0, 1.0)
        else:
            cue = place_put(bpy.context, place, 1.0)
    except SceneError as error:
        raise BadTable(f"{table}, line {row.line}: {error}") from error
    cue.name = row.name
    for added in end_cues(bpy.context, start_cue):
        if added not in stops:
            added.name = f"{row.name} Stop"
    if row.kind == PUT and thing is not None:
        cue[THING_KEY] = thing
    if row.kind == PUT and row.heading is not None:
        cue.rotation_euler.z = yaw_from_heading(math.radians(row.heading))


def _places(table: Path, scene: bpy.types.Scene, rows: tuple[Row, ...]) -> list[tuple[Vector, float | None]]:
    """Where each cue of a person stands, and its heading in radians; None where it is free."""
    found: list[tuple[Vector, float | None]] = []
    floor = None
    for row in rows:
        thing = scene.objects.get(row.object.split(":")[0]) if row.object else None
        if row.object and thing is None:
            raise BadTable(f"{table}, line {row.line}: nothing in {row.room} is called {row.object}.")
        heading = None if row.heading is None else math.radians(row.heading)
        place = Vector((row.x or 0.0, row.y or 0.0, FROM_ABOVE + (floor or 0.0) if row.z is None else row.z))
        if row.kind == "sit" and (row.x is None or row.z is None or heading is None):
            seat = _seat(table, row, place, thing)
            place = seat.pelvis.copy() if row.x is None or row.z is None else place
            heading = seat.yaw - math.pi / 2 if heading is None else heading
            place.z = place.z if row.z is None else row.z
        elif row.kind in (LOOK, *WITH_A_HAND):
            place = middle_of(thing) if row.x is None and thing is not None else place
        elif row.kind == PUT:
            # On what is there, not on the floor.
            place = surface_below(bpy.context, place) if row.z is None else place
        elif row.z is None:
            # On the floor that one starts on; a start stands on what is there.
            place.z = surface_below(bpy.context, place).z if floor is None else floor
        floor = place.z if floor is None else floor
        found.append((place, heading))
    return found


def _seat(table: Path, row: Row, place: Vector, thing: bpy.types.Object | None) -> Seat:
    """The seat that the button would find, on the object or under the place."""
    if row.x is not None or thing is None:
        return seat_below(bpy.context, place)
    thing.select_set(True)
    bpy.context.view_layer.objects.active = thing
    try:
        return seat_of_selection(bpy.context)
    except SceneError as error:
        raise BadTable(f"{table}, line {row.line}: {error}") from error
    finally:
        thing.select_set(False)


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
    parser.add_argument("--shots", type=Path, help="the table of its shots, tab-separated")
    options = parser.parse_args(arguments)
    if options.shots:
        if not options.room or options.tasks or options.object:
            parser.error("--shots belongs to --room, without --tasks")
        for shot in read_shots(options.shots, options.room.stem):
            shot_scene(options.room, options.shots, shot)
            save(options.out / f"{shot.file}.blend")
        return
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
