# SPDX-License-Identifier: GPL-3.0-or-later
"""Where one would sit on a chair, and facing where: from its selected faces, or from the whole object."""

from __future__ import annotations

import math
from dataclasses import dataclass

import bmesh
import bpy
import numpy as np
from mathutils import Vector

from ..errors import SceneError
from .cue_objects import PELVIS_OVER_SEAT, yaw_from_heading
from .edit_mode import copies_outside
from .what_counts import Furniture, furniture_on_ray

#: Seats lie between these heights over the object's foot, metres.
SEAT_HEIGHTS = (0.25, 0.85)
#: How far modifiers may raise or lower a seat, metres.
MODIFIED = 0.3
#: Directions that are tried for the facing, and how far is looked, metres.
DIRECTIONS, REACH = 24, 1.5
#: Heights over the seat at which a back, an arm or a wall would be met, metres.
FEELERS = (0.12, 0.25, 0.40)
#: Who sits on a bench sits across it: where nothing else tells the front, metres of free view that this is worth.
ACROSS = 0.05


@dataclass(frozen=True)
class Seat:
    """The pelvis joint's target (scene units, world) and the facing (radians from -Y about +Z)."""

    pelvis: Vector
    yaw: float


def seat_of_selection(context: bpy.types.Context, metres_per_unit: float = 1.0) -> Seat:
    """The seat on the selected faces in edit mode, else on the active mesh object. Raises SceneError."""
    chair = context.active_object
    if chair is None or chair.type != "MESH" or not (chair.select_get() or context.mode == "EDIT_MESH"):
        raise SceneError("Select the chair, or its seat's face in edit mode, and press again.")
    if Furniture(context).is_of_person(chair):
        raise SceneError(f"{chair.name} belongs to a character: select what it is to sit on, and press again.")
    if context.mode == "EDIT_MESH":
        center, edge = _selected_faces(chair)
        with copies_outside(context) as copies:
            shown = next((copy for copy, thing in copies.items() if thing == chair), chair)
            center = _as_modified(context, shown, center, metres_per_unit)
    else:
        center, edge = _flattest_part(context, chair, metres_per_unit)
    heading = _facing(context, center, edge, metres_per_unit, ACROSS)
    pelvis = center + Vector((0.0, 0.0, PELVIS_OVER_SEAT / metres_per_unit))
    return Seat(pelvis, yaw_from_heading(heading))


def surface_below(context: bpy.types.Context, place: Vector, metres_per_unit: float = 1.0) -> Vector:
    """The surface that a plumb line from just over `place` meets, or `place` itself where there is none."""
    unit = 1.0 / metres_per_unit
    origin, down = Vector(place) + Vector((0.0, 0.0, 0.3 * unit)), Vector((0.0, 0.0, -1.0))
    return furniture_on_ray(context, Furniture(context), origin, down, 4.0 * unit) or Vector(place)


def seat_below(context: bpy.types.Context, place: Vector, metres_per_unit: float = 1.0) -> Seat:
    """The seat under `place`, facing where there is room."""
    surface = surface_below(context, place, metres_per_unit)
    heading = _facing(context, surface, Vector((1.0, 0.0, 0.0)), metres_per_unit)
    return Seat(surface + Vector((0.0, 0.0, PELVIS_OVER_SEAT / metres_per_unit)), yaw_from_heading(heading))


def _selected_faces(chair: bpy.types.Object) -> tuple[Vector, Vector]:
    """Middle of the selected faces and the direction of their longest edge, world."""
    mesh = bmesh.from_edit_mesh(chair.data)
    faces = [face for face in mesh.faces if face.select]
    if not faces:
        raise SceneError(f"No face of {chair.name} is selected: select the seat's face and press again.")
    matrix = chair.matrix_world
    middle, area = Vector(), 0.0
    edges = []
    for face in faces:
        corners = [matrix @ vertex.co for vertex in face.verts]
        for a, b, c in zip([corners[0]] * (len(corners) - 2), corners[1:], corners[2:], strict=False):
            size = (b - a).cross(c - a).length / 2
            middle += (a + b + c) / 3 * size
            area += size
        edges += [b - a for a, b in zip(corners, corners[1:] + corners[:1], strict=True)]
    if area <= 0.0:
        raise SceneError(f"The selected faces of {chair.name} have no area: select the seat's face.")
    return middle / area, max(edges, key=lambda edge: Vector((edge.x, edge.y)).length)


def _as_modified(context: bpy.types.Context, chair: bpy.types.Object, place: Vector, metres_per_unit: float) -> Vector:
    """A place on the faces that are edited, raised or lowered to where modifiers put the surface."""
    evaluated, inverse = chair.evaluated_get(context.evaluated_depsgraph_get()), chair.matrix_world.inverted_safe()
    reach = MODIFIED / metres_per_unit
    heights = _surfaces_below(
        evaluated, inverse, chair.matrix_world, place.x, place.y, place.z + reach, place.z - reach
    )
    nearest = min(heights, key=lambda z: abs(z - place.z), default=place.z)
    return Vector((place.x, place.y, nearest))


def _flattest_part(
    context: bpy.types.Context, chair: bpy.types.Object, metres_per_unit: float
) -> tuple[Vector, Vector]:
    """Middle of the largest level patch at seat height, felt from above, and that of the object's own directions X and
    Y along which the patch is longer."""
    evaluated = chair.evaluated_get(context.evaluated_depsgraph_get())
    corners = np.array([chair.matrix_world @ Vector(corner) for corner in evaluated.bound_box])
    low, high = corners.min(axis=0), corners.max(axis=0)
    unit = 1.0 / metres_per_unit
    bottom, top = low[2] + SEAT_HEIGHTS[0] * unit, low[2] + SEAT_HEIGHTS[1] * unit
    inverse = chair.matrix_world.inverted_safe()
    hits = []
    for x in np.linspace(low[0], high[0], 26)[1:-1]:
        for y in np.linspace(low[1], high[1], 26)[1:-1]:
            # From under the ceiling of the seat heights: what lies above (arms, a back) is felt by its side.
            for z in _surfaces_below(evaluated, inverse, chair.matrix_world, x, y, high[2] + unit, bottom):
                if z <= top:
                    hits.append((x, y, z))
                    break
    if not hits:
        raise SceneError(
            f"{chair.name} has no level surface between {SEAT_HEIGHTS[0]:.2f} and {SEAT_HEIGHTS[1]:.2f} m up: "
            "select the seat's face in edit mode."
        )
    hits = np.array(hits)
    # The seat is the height at which most of the felt points lie together.
    votes = [(np.abs(hits[:, 2] - z) < 0.03 * unit).sum() for z in hits[:, 2]]
    patch = hits[np.abs(hits[:, 2] - hits[int(np.argmax(votes)), 2]) < 0.03 * unit]
    middle = Vector(
        (
            (patch[:, 0].min() + patch[:, 0].max()) / 2,
            (patch[:, 1].min() + patch[:, 1].max()) / 2,
            np.median(patch[:, 2]),
        )
    )
    axes = [chair.matrix_world.to_3x3() @ Vector(axis) for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))]
    return middle, max(axes, key=lambda axis: np.ptp(patch @ np.array(axis.normalized())))


def _surfaces_below(evaluated, inverse, matrix, x: float, y: float, start: float, bottom: float):
    """Heights at which a plumb line meets upward faces of the object, from above."""
    down = (inverse.to_3x3() @ Vector((0.0, 0.0, -1.0))).normalized()
    z = start
    for _ in range(8):
        hit, location, normal, _ = evaluated.ray_cast(inverse @ Vector((x, y, z)), down)
        if not hit:
            return
        world = matrix @ location
        if world.z < bottom:
            return
        if (inverse.to_3x3().transposed() @ normal).normalized().z > 0.8:
            yield world.z
        z = world.z - 1e-4


def _facing(
    context: bpy.types.Context, seat: Vector, edge: Vector, metres_per_unit: float, across: float = 0.0
) -> float:
    """Heading (radians from +X) away from the chair's back and towards free space, along the seat's edges if near.

    `across`: what it is worth, metres of free view, to face across the edge.
    """
    headings, furniture = np.arange(DIRECTIONS) * (math.tau / DIRECTIONS), Furniture(context)
    free = np.array([_free_distance(context, furniture, seat, heading, metres_per_unit) for heading in headings])
    behind = np.roll(free, DIRECTIONS // 2)
    # A wide free view in front, and something close behind to lean on.
    view = sum(np.roll(free, shift) for shift in (-2, -1, 0, 1, 2)) / 5
    along = math.atan2(edge.y, edge.x)
    score = view + 0.8 * np.clip(0.7 - behind, 0.0, 0.7) + across * np.abs(np.sin(headings - along))
    best = float(headings[int(np.argmax(score))])
    snapped = min((along + k * math.pi / 2 for k in range(4)), key=lambda a: abs(math.remainder(a - best, math.tau)))
    return snapped if abs(math.remainder(snapped - best, math.tau)) < math.radians(25) else best


def _free_distance(
    context: bpy.types.Context, furniture: Furniture, seat: Vector, heading: float, metres_per_unit: float
) -> float:
    """Metres to the first thing in a direction, felt at the heights of a seated trunk."""
    unit = 1.0 / metres_per_unit
    direction = Vector((math.cos(heading), math.sin(heading), 0.0))
    nearest = REACH
    for height in FEELERS:
        origin = seat + Vector((0.0, 0.0, height * unit))
        met = furniture_on_ray(context, furniture, origin, direction, REACH * unit)
        if met is not None:
            nearest = min(nearest, (met - origin).length * metres_per_unit)
    return nearest
