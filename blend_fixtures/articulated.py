# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects from outside that open (doors, lids, drawers), their hinge animated and a hand cue on what the hand holds."""

from __future__ import annotations

import math
import sys
from pathlib import Path

import bpy
from mathutils import Vector

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent)]

import furniture as f  # noqa: E402
from openings import PELVIS_OVER_SEAT, SEAT, TABLE, TABLE_PLACE, TABLE_SIZE, Opening  # noqa: E402

from addon.bridge.cue_objects import make_cue, place_hand, yaw_from_heading  # noqa: E402

#: When the part opens, frames of a scene at 30 frames a second: once the person stands, or sits, and for how long.
STANDING, SEATED, TAKES = 91, 151, 60


def object_task(scene: bpy.types.Scene, glb: Path, opening: Opening) -> bpy.types.Object:
    """Fills an empty scene with the object, its moving part animated, and the cues; gives the hand cue."""
    f.floor(scene, (-3, -3), (3, 3))
    bpy.ops.import_scene.gltf(filepath=str(glb))
    if opening.lift:
        f.table(scene, (*TABLE_PLACE, 0), TABLE_SIZE, TABLE, "Table")
    bpy.data.objects[opening.object].location.z += opening.lift
    bpy.context.view_layer.update()
    return opened_by_hand(scene, opening)


def opened_by_hand(scene: bpy.types.Scene, opening: Opening) -> bpy.types.Object:
    """Animates the part of an object that is in the scene, and places the cues of who opens it; gives the hand cue."""
    part = bpy.data.objects[opening.part]
    first = SEATED if opening.seated else STANDING
    _animate(scene, part, opening, first)
    _cues_before(scene, opening)
    _select(part)
    scene.cursor.location = opening.contact
    return place_hand(bpy.context, "right_hand", first, first + TAKES, 1.0)


def _animate(scene: bpy.types.Scene, part: bpy.types.Object, opening: Opening, first: int) -> None:
    """Hangs the part on an empty at its joint, and opens that from frame `first` on."""
    joint = bpy.data.objects.new(f"{part.name} joint", None)
    joint.empty_display_size, joint.location = 0.1, opening.origin
    scene.collection.objects.link(joint)
    bpy.context.view_layer.update()
    world = part.matrix_world.copy()
    part.parent = joint
    part.matrix_parent_inverse = joint.matrix_world.inverted()
    part.matrix_world = world
    joint.rotation_mode = "AXIS_ANGLE"
    for frame, value in ((first, 0.0), (first + TAKES, opening.most)):
        if opening.slides:
            joint.location = opening.origin + opening.axis * value
            joint.keyframe_insert("location", frame=frame)
        else:
            joint.rotation_axis_angle = (math.radians(value), *opening.axis)
            joint.keyframe_insert("rotation_axis_angle", frame=frame)
    scene.frame_end = first + TAKES
    scene.frame_set(1)


def _cues_before(scene: bpy.types.Scene, opening: Opening) -> None:
    """Start and end cue of who opens it."""
    place, heading = opening.stand()
    yaw = yaw_from_heading(heading)
    if opening.seated:
        f.stool(scene, Vector(place), SEAT)
        make_cue(bpy.context, "sit", (place[0], place[1], SEAT + PELVIS_OVER_SEAT), yaw)
    else:
        make_cue(bpy.context, "stop", tuple(place), yaw)
    begin = opening.begin()
    way = place - begin
    make_cue(bpy.context, "start", tuple(begin), yaw_from_heading(math.atan2(way[1], way[0])))


def _select(thing: bpy.types.Object) -> None:
    for other in bpy.context.view_layer.objects:
        other.select_set(other == thing)
    bpy.context.view_layer.objects.active = thing
