# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a person stands to reach something: near before it, free of furniture, on the side from which one comes."""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable

import bpy
from mathutils import Matrix, Vector

from .what_counts import Furniture, furniture_on_ray

#: A hand reaches well so far from the pelvis, as seen from above, metres; the first is best.
REACHES = (0.45, 0.40, 0.50, 0.56, 0.62)
#: Who is as near as this to what is reached for, as seen from above, metres, and has it no farther to a side, the
#: cosine, stands there already; and whoever has it this near, metres.
WITHIN_REACH, AHEAD, AT_HAND = 0.75, 0.25, 0.30
#: Places on a ring, and how much an angle of a half turn counts against metres of a worse distance.
PLACES, TURN_COUNTS = 24, 0.35
#: A body, and knees that bend, are free where nothing is nearer than this at these heights over the floor, metres.
GIRTH, HEIGHTS = 0.30, (0.25, 0.60, 0.95, 1.40)
#: Table tops lie between these heights: none is so near either, as seen from under a hanging cupboard.
TOPS, UNDER_CUPBOARDS = (0.11, 0.22), 1.40
#: The floor is looked for from so far over it, and is no step, metres.
OVER_FLOOR, NO_STEP = 1.0, 0.05
#: Directions into which a place is to be free.
AROUND = 12
#: Ways are looked for over squares of this size, metres, with nothing over the floor in one, nor between two at these
#: heights; to within this of where one comes from, and over no more squares than this.
SQUARE, BETWEEN, CAME, SQUARES = 0.15, (0.30, 1.10), 0.60, 6000


def stands_before(stand: Matrix, place: Vector, unit: float) -> bool:
    """Whether who is at a stop or sit cue has a place before them and within reach. `unit`: a metre in scene units."""
    way = Vector((place - stand.translation).xy)
    ahead = Vector((stand.to_3x3() @ Vector((0.0, -1.0, 0.0))).xy).normalized()
    is_ahead = way.length <= AT_HAND * unit or way.dot(ahead) >= AHEAD * way.length
    return way.length <= WITHIN_REACH * unit and is_ahead


def stand_before(
    context: bpy.types.Context,
    place: Vector,
    come_from: Vector,
    metres_per_unit: float,
    reaches: tuple[float, ...] = REACHES,
    counts: Callable[[Vector], float | None] | None = None,
) -> tuple[Vector, Vector] | None:
    """A place on the floor of `come_from` from which a hand reaches `place`, and the direction to it; None where none
    is free, or nobody gets there. Scene units.

    `reaches`: how far from it, metres, the best first. `counts`: what else counts against a place (world, metres),
    metres, or None for one that cannot be.
    """
    unit, furniture = 1.0 / metres_per_unit, Furniture(context)
    back = Vector((come_from.x - place.x, come_from.y - place.y))
    begin = math.atan2(back.y, back.x)
    spots: list[tuple[float, int, Vector]] = []
    for reach in reaches:
        for k in range(PLACES):
            turn = math.remainder(math.tau * k / PLACES, math.tau)
            cost = abs(reach - reaches[0]) + TURN_COUNTS * abs(turn) / math.pi
            way = Vector((math.cos(begin + turn), math.sin(begin + turn), 0.0))
            spot = Vector((place.x, place.y, come_from.z)) + way * reach * unit
            more = counts(spot * metres_per_unit) if counts is not None else 0.0
            if more is not None:
                spots.append((cost + more, len(spots), spot))
    for _, _, spot in sorted(spots):
        if _is_free(context, furniture, spot, unit) and _is_reached(context, furniture, spot, come_from, unit):
            return spot, (Vector((place.x, place.y, spot.z)) - spot).normalized()
    return None


def _is_reached(context: bpy.types.Context, furniture: Furniture, spot: Vector, come_from: Vector, unit: float) -> bool:
    """Whether a way leads over the floor to a spot, or may: what is farther away than can be looked at is left to the
    run, which knows the whole scene.
    """
    size, down = SQUARE * unit, Vector((0.0, 0.0, -1.0))
    corners = [
        Vector((x, y, UNDER_CUPBOARDS * unit)) for x in (-0.5 * size, 0.5 * size) for y in (-0.5 * size, 0.5 * size)
    ]

    def middle(square: tuple[int, int]) -> Vector:
        return spot + Vector((square[0] * size, square[1] * size, 0.0))

    def is_floor(square: tuple[int, int]) -> bool:
        for corner in corners:
            found = furniture_on_ray(
                context, furniture, middle(square) + corner, down, (UNDER_CUPBOARDS + NO_STEP) * unit
            )
            if found is None or abs(found.z - spot.z) > NO_STEP * unit:
                return False
        return True

    def is_between(square: tuple[int, int], to: tuple[int, int]) -> bool:
        way = (middle(to) - middle(square)).normalized()
        begins = [middle(square) + Vector((0.0, 0.0, height * unit)) for height in BETWEEN]
        return any(furniture_on_ray(context, furniture, begin, way, size) for begin in begins)

    def is_behind(square: tuple[int, int]) -> bool:
        """Whether a wall is between it and where one comes from, which may be a seat."""
        way = Vector((come_from - middle(square)).xy).to_3d()
        begin = middle(square) + Vector((0.0, 0.0, BETWEEN[-1] * unit))
        return way.length > 0.0 and bool(furniture_on_ray(context, furniture, begin, way.normalized(), way.length))

    seen, queue = {(0, 0)}, [(0.0, 0.0, (0, 0))]
    while queue and len(seen) < SQUARES:
        _, gone, at = heapq.heappop(queue)
        if (middle(at) - come_from).xy.length <= CAME * unit and not is_behind(at):
            return True
        for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1)):
            to = at[0] + x, at[1] + y
            if to in seen:
                continue
            seen.add(to)
            if is_floor(to) and not is_between(at, to):
                left = (middle(to) - come_from).xy.length
                heapq.heappush(queue, (gone + size + left, gone + size, to))
    return bool(queue)


def _is_free(context: bpy.types.Context, furniture: Furniture, spot: Vector, unit: float) -> bool:
    above = spot + Vector((0.0, 0.0, OVER_FLOOR * unit))
    floor = furniture_on_ray(context, furniture, above, Vector((0.0, 0.0, -1.0)), (OVER_FLOOR + NO_STEP) * unit)
    if floor is None or abs(floor.z - spot.z) > NO_STEP * unit:
        return False
    ways = [Vector((math.cos(t), math.sin(t), 0.0)) for t in (math.tau * k / AROUND for k in range(AROUND))]
    sideways = [(spot + Vector((0.0, 0.0, height * unit)), way, GIRTH) for height in HEIGHTS for way in ways]
    down, over = Vector((0.0, 0.0, -1.0)), Vector((0.0, 0.0, UNDER_CUPBOARDS * unit))
    tops = [(spot + way * far * unit + over, down, UNDER_CUPBOARDS - NO_STEP) for far in TOPS for way in ways]
    return not any(
        furniture_on_ray(context, furniture, begin, way, far * unit) for begin, way, far in (*sideways, *tops)
    )
