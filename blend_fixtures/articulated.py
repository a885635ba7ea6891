# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects from outside that open (doors, lids, drawers), their hinge animated and a hand cue on what the hand holds.

A table has a row a moving part: joint (hinge or slide), axis with the sign that a positive value opens, origin, range,
contact point and where that ends. Objects stand on z = 0 and face -Y.
"""

from __future__ import annotations

import csv
import math
import sys
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix, Quaternion, Vector

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent)]

import furniture as f  # noqa: E402

from addon.bridge.cue_objects import PELVIS_OVER_SEAT, make_cue, place_hand, yaw_from_heading  # noqa: E402

#: When the part opens, frames of a scene at 30 frames a second: once the person stands, or sits, and for how long.
STANDING, SEATED, TAKES = 91, 151, 60
#: Objects no taller than this stand on a table and are opened seated, metres.
ON_A_TABLE, TABLE = 0.08, 0.74
#: How far from the middle of the hand's way the body stands or sits, metres.
AN_ARM_AWAY = 0.42


def object_rows(table: Path, name: str) -> list[dict[str, str]]:
    """The table's rows of one object. Raises SystemExit with a sentence when there are none."""
    with table.open(encoding="utf-8", newline="") as file:
        rows = [row for row in csv.DictReader(file, delimiter="\t") if row["object"] == name]
    if not rows:
        raise SystemExit(f"{table} has no row of an object named {name}.")
    return rows


def object_task(scene: bpy.types.Scene, glb: Path, row: dict[str, str]) -> bpy.types.Object:
    """Fills an empty scene with the object, its moving part animated, and the cues; gives the hand cue."""
    f.floor(scene, (-3, -3), (3, 3))
    bpy.ops.import_scene.gltf(filepath=str(glb))
    whole = bpy.data.objects[row["object"]]
    height = _numbers(row["size_xyz_m"])[2]
    lift = TABLE if height < ON_A_TABLE else 0.0
    if lift:
        f.table(scene, (0, 0.05, 0), (1.2, 0.6), TABLE, "Table")
    whole.location.z += lift
    bpy.context.view_layer.update()
    part = bpy.data.objects[row["moving_node"]]
    raised = Vector((0.0, 0.0, lift))
    axis, origin = Vector(_numbers(row["axis_xyz"])), Vector(_numbers(row["origin_xyz"])) + raised
    contact = Vector(_numbers(row["contact_xyz"])) + raised
    first = SEATED if lift else STANDING
    _animate(scene, part, row, axis, origin, first)

    opening = np.linspace(0.0, float(row["range_max"]), 13)
    path = np.array([_motion(row, axis, origin, value) @ contact for value in opening])
    _cues_before(scene, path, origin, row["joint"] == "hinge" and abs(axis.z) > 0.5, bool(lift))
    _select(part)
    scene.cursor.location = contact
    return place_hand(bpy.context, "right_hand", first, first + TAKES, 1.0)


def _numbers(text: str) -> list[float]:
    return [float(word) for word in text.split()]


def _motion(row: dict[str, str], axis: Vector, origin: Vector, value: float) -> Matrix:
    """What the joint does to the world at a value of its range."""
    if row["joint"] == "slide":
        return Matrix.Translation(axis * value)
    turn = Quaternion(axis, math.radians(value)).to_matrix().to_4x4()
    return Matrix.Translation(origin) @ turn @ Matrix.Translation(-origin)


def _animate(
    scene: bpy.types.Scene, part: bpy.types.Object, row: dict[str, str], axis: Vector, origin: Vector, first: int
) -> None:
    """Hangs the part on an empty at its joint, and opens that from frame `first` on."""
    joint = bpy.data.objects.new(f"{part.name} joint", None)
    joint.empty_display_size, joint.location = 0.1, origin
    scene.collection.objects.link(joint)
    bpy.context.view_layer.update()
    world = part.matrix_world.copy()
    part.parent = joint
    part.matrix_parent_inverse = joint.matrix_world.inverted()
    part.matrix_world = world
    joint.rotation_mode = "AXIS_ANGLE"
    for frame, value in ((first, 0.0), (first + TAKES, float(row["range_max"]))):
        if row["joint"] == "slide":
            joint.location = origin + axis * value
            joint.keyframe_insert("location", frame=frame)
        else:
            joint.rotation_axis_angle = (math.radians(value), *axis)
            joint.keyframe_insert("rotation_axis_angle", frame=frame)
    scene.frame_end = first + TAKES
    scene.frame_set(1)


def _cues_before(scene: bpy.types.Scene, path: np.ndarray, origin: Vector, swings: bool, seated: bool) -> None:
    """Start and end cue of who opens it: before the middle of the hand's way, clear of a leaf that swings out."""
    middle = Vector(path.mean(axis=0))
    away = Vector((middle.x - origin.x, middle.y - origin.y, 0.0)).normalized() if swings else Vector((0.0, -1.0, 0.0))
    reach = max((Vector(point) - origin).xy.dot(away.xy) for point in path) - (middle - origin).xy.dot(away.xy)
    place = middle + away * max(AN_ARM_AWAY, reach + 0.22 if swings else 0.0)
    yaw = yaw_from_heading(math.atan2(-away.y, -away.x))
    if seated:
        seat = 0.45
        # Room for the knees before the table: who sits down comes from the side.
        place = Vector((middle.x, path[:, 1].min() - 0.50, 0.0))
        f.stool(scene, place, seat)
        make_cue(bpy.context, "sit", (place.x, place.y, seat + PELVIS_OVER_SEAT), yaw)
        begin = Vector((place.x + 1.0, place.y - 1.0, 0.0))
    else:
        make_cue(bpy.context, "stop", (place.x, place.y, 0.0), yaw)
        begin = place + away * 1.4
    way = place - begin
    make_cue(bpy.context, "start", (begin.x, begin.y, 0.0), yaw_from_heading(math.atan2(way.y, way.x)))


def _select(thing: bpy.types.Object) -> None:
    for other in bpy.context.view_layer.objects:
        other.select_set(other == thing)
    bpy.context.view_layer.objects.active = thing
