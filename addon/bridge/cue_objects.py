# SPDX-License-Identifier: GPL-3.0-or-later
"""Cues as empties: made here for the buttons, for scripts and for the fixtures."""

from __future__ import annotations

import math

import bpy
from mathutils import Matrix, Vector

from .names import CUE_KEY, oncue_collection

#: Kind → name, empty's shape, its size in metres, its colour (sRGB with alpha, as viewports show it).
KINDS = {
    "start": ("Start", "ARROWS", 0.25, (0.25, 0.75, 0.35, 1.0)),
    "sit": ("Sit", "SPHERE", 0.10, (0.95, 0.55, 0.15, 1.0)),
    "stop": ("Stop", "ARROWS", 0.25, (0.85, 0.25, 0.25, 1.0)),
    "left_foot": ("Left Foot", "CUBE", 0.04, (0.30, 0.60, 0.95, 1.0)),
    "right_foot": ("Right Foot", "CUBE", 0.04, (0.75, 0.45, 0.95, 1.0)),
}
#: The pelvis joint of a seated person over the seat, metres.
PELVIS_OVER_SEAT = 0.10


def make_cue(
    context: bpy.types.Context,
    kind: str,
    position,
    yaw: float,
    *,
    name: str | None = None,
    parent: bpy.types.Object | None = None,
    metres_per_unit: float = 1.0,
) -> bpy.types.Object:
    """An empty that Oncue reads as a cue.

    `position` is in scene units: for a start, a stop or a foot the floor, for a sit the pelvis joint's target.
    `yaw` in radians turns the facing from -Y about +Z. A foot cue belongs to its `parent`, a sit or stop cue.
    """
    label, shape, size, color = KINDS[kind]
    cue = bpy.data.objects.new(name or label, None)
    cue[CUE_KEY] = kind
    cue.empty_display_type = shape
    cue.empty_display_size = size / metres_per_unit
    cue.color = color
    cue.show_in_front = True
    cue.rotation_euler = (0.0, 0.0, yaw)
    cue.location = position
    oncue_collection(context).objects.link(cue)
    if parent is not None:
        cue.parent = parent
        cue.matrix_parent_inverse = parent.matrix_world.inverted_safe()
    context.view_layer.update()
    return cue


def yaw_from_heading(heading: float) -> float:
    """The yaw of a person whose forward direction has the angle `heading` from +X, radians."""
    return math.remainder(heading + math.pi / 2, math.tau)


def forward_of(matrix: Matrix) -> Vector:
    """Where an empty faces: its local -Y in the world, unit length (zero for a collapsed scale)."""
    return (matrix.to_3x3() @ Vector((0.0, -1.0, 0.0))).normalized()
