# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a person stands to reach something: near before it, free of furniture, on the side from which one comes."""

from __future__ import annotations

import math
from collections.abc import Callable

import bpy
from mathutils import Vector

from .what_counts import Furniture, furniture_on_ray

#: A hand reaches well so far from the pelvis, as seen from above, metres; the first is best.
REACHES = (0.45, 0.40, 0.50, 0.56, 0.62)
#: Who is as near as this to what is reached for, as seen from above, stands there already, metres.
WITHIN_REACH = 0.75
#: Places on a ring, and how much an angle of a half turn counts against metres of a worse distance.
PLACES, TURN_COUNTS = 24, 0.35
#: A body, and knees that bend, are free where nothing is nearer than this at these heights over the floor, metres.
GIRTH, HEIGHTS = 0.30, (0.25, 0.60, 0.95, 1.40)
#: The floor is looked for from so far over it, and is no step, metres.
OVER_FLOOR, NO_STEP = 1.0, 0.05
#: Directions into which a place is to be free.
AROUND = 12


def stand_before(
    context: bpy.types.Context,
    place: Vector,
    come_from: Vector,
    metres_per_unit: float,
    reaches: tuple[float, ...] = REACHES,
    counts: Callable[[Vector], float | None] | None = None,
) -> tuple[Vector, Vector] | None:
    """A place on the floor of `come_from` from which a hand reaches `place`, and the direction to it; None where none
    is free. Scene units.

    `reaches`: how far from it, metres, the best first. `counts`: what else counts against a place (world, metres),
    metres, or None for one that cannot be.
    """
    unit, furniture = 1.0 / metres_per_unit, Furniture(context)
    back = Vector((come_from.x - place.x, come_from.y - place.y))
    begin = math.atan2(back.y, back.x)
    best: tuple[float, Vector] | None = None
    for reach in reaches:
        for k in range(PLACES):
            turn = math.remainder(math.tau * k / PLACES, math.tau)
            cost = abs(reach - reaches[0]) + TURN_COUNTS * abs(turn) / math.pi
            if best is not None and cost >= best[0]:
                continue
            way = Vector((math.cos(begin + turn), math.sin(begin + turn), 0.0))
            spot = Vector((place.x, place.y, come_from.z)) + way * reach * unit
            more = counts(spot * metres_per_unit) if counts is not None else 0.0
            if more is None or (best is not None and cost + more >= best[0]):
                continue
            cost += more
            if _is_free(context, furniture, spot, unit):
                best = cost, spot
    if best is None:
        return None
    ahead = Vector((place.x, place.y, best[1].z)) - best[1]
    return best[1], ahead.normalized()


def _is_free(context: bpy.types.Context, furniture: Furniture, spot: Vector, unit: float) -> bool:
    above = spot + Vector((0.0, 0.0, OVER_FLOOR * unit))
    floor = furniture_on_ray(context, furniture, above, Vector((0.0, 0.0, -1.0)), (OVER_FLOOR + NO_STEP) * unit)
    if floor is None or abs(floor.z - spot.z) > NO_STEP * unit:
        return False
    ways = [Vector((math.cos(t), math.sin(t), 0.0)) for t in (math.tau * k / AROUND for k in range(AROUND))]
    return not any(
        furniture_on_ray(context, furniture, spot + Vector((0.0, 0.0, height * unit)), way, GIRTH * unit)
        for height in HEIGHTS
        for way in ways
    )
