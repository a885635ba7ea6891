# SPDX-License-Identifier: GPL-3.0-or-later
"""Doors, lids and drawers that a hand opens: which way they go, where they are taken hold of, what the core is told."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import bpy
import numpy as np
from mathutils import Matrix, Quaternion, Vector

from ..errors import SceneError
from .moving_reader import simplified
from .names import AMOUNT_KEY, AXIS_KEY, CARRIED_IN_KEY, CUE_KEY, HAND_KEY, OPENS_KEY, OVER_KEY
from .scene_time import may_move
from .shown_cues import person_of
from .things import WHICH_HANDS

AXES = ("X", "Y", "Z")
HINGE, SLIDE = OPENS = ("hinge", "slide")
#: Constraints that say how far something goes, and move nothing.
LIMITS = {"LIMIT_ROTATION", "LIMIT_LOCATION"}
#: An origin that is no farther than this part of a leaf's breadth from its edge is at its hinge.
AT_THE_EDGE = 0.12
#: A range smaller than this is none, radians or units.
LOCKED = 1e-4
#: How far what does not say so is opened: degrees, and metres or a part of its depth.
USUAL_TURN, USUAL_WAY, PART_OF_DEPTH = 90.0, 0.35, 0.8
#: A handle stands out from its leaf by so much, metres, and is smaller than this part of it.
STANDS_OUT, SMALLER = 0.012, 0.5
#: Where there is none, a hand comes so near to the edge, and so high over the floor, metres.
FROM_THE_EDGE, HANDLE_HEIGHT = 0.07, 1.0
#: Fingers lift a lid: the palm is so far beyond its edge, and so far over it, metres.
FINGERS, OVER = 0.06, 0.03
#: Who opens something keeps so far from all that it sweeps, metres, at these heights over the floor.
CLEAR, HEIGHTS = 0.24, (0.25, 0.60, 0.95, 1.30)
#: So many places of its way are looked at; how far away one likes the handle, metres, and what more or less counts.
LOOKS, HANDY, LEADS_COUNT = 16, 0.50, 0.6
#: What it counts to stand behind what one pulls, by metres.
BEHIND_COUNTS = 0.5
#: What stands taller than this, metres, turns about no level line: its origin is on the floor, as a cupboard's.
TALL = 1.0
#: A hinge is upright within this of the vertical: its cosine.
UPRIGHT = 0.7


@dataclass(frozen=True)
class Opens:
    """Which way a leaf goes: about, or along, an axis of its own through its origin, by degrees or metres."""

    how: str
    #: Its place in `AXES`.
    axis: int
    amount: float


@dataclass(frozen=True)
class Leaf:
    """What is opened: an object, and the meshes that hang on it, in the object's own frame but for its size, metres."""

    thing: bpy.types.Object
    place: Vector
    turn: Quaternion
    positions: np.ndarray
    triangles: np.ndarray
    metres_per_unit: float

    @property
    def low(self) -> np.ndarray:
        return self.positions.min(axis=0)

    @property
    def high(self) -> np.ndarray:
        return self.positions.max(axis=0)

    def axis(self, axis: int) -> Vector:
        """One of its own axes in the world."""
        return self.turn @ Vector([float(k == axis) for k in range(3)])

    def in_world(self, own) -> Vector:
        """A place of its own, metres, in the world, metres."""
        return self.place + self.turn @ Vector(own)

    def own(self, place: Vector) -> Vector:
        """The reverse."""
        return self.turn.inverted() @ (place - self.place)

    def opened(self, opens: Opens, share: float, place: Vector) -> Vector:
        """Where a place of it, world, metres, is after a share of its way."""
        if opens.how == SLIDE:
            return place + self.axis(opens.axis) * opens.amount * share
        turn = Quaternion(self.axis(opens.axis), math.radians(opens.amount) * share)
        return self.place + turn @ (place - self.place)


def read_mesh(cue: bpy.types.Object, thing: bpy.types.Object, depsgraph, metres_per_unit: float) -> Leaf:
    """A leaf as it stands now; without a `depsgraph` the corners of its boxes stand for its mesh.

    Raises SceneError where it has none, or cannot be keyed.
    """
    check_leaf(cue, thing)
    seen = thing.evaluated_get(depsgraph) if depsgraph is not None else thing
    place, turn, _ = seen.matrix_world.decompose()
    into = (Matrix.Translation(place) @ turn.to_matrix().to_4x4()).inverted()
    positions, triangles, count = [], [], 0
    for one in [thing, *thing.children_recursive]:
        if one.type not in {"MESH", "CURVE", "SURFACE", "FONT"} or one.get(CUE_KEY) is not None:
            continue
        if depsgraph is None:
            corners = np.array([into @ (one.matrix_world @ Vector(corner)) for corner in one.bound_box])
            positions.append(corners * metres_per_unit)
            triangles.append(np.zeros((1, 3), dtype=np.int32))
            count += len(corners)
            continue
        evaluated = one.evaluated_get(depsgraph)
        mesh = evaluated.to_mesh()
        mesh.calc_loop_triangles()
        corners = np.empty(len(mesh.vertices) * 3, dtype=np.float32)
        mesh.vertices.foreach_get("co", corners)
        faces = np.empty(len(mesh.loop_triangles) * 3, dtype=np.int32)
        mesh.loop_triangles.foreach_get("vertices", faces)
        matrix = np.array(into @ evaluated.matrix_world)
        own = corners.reshape(-1, 3).astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]
        positions.append(own * metres_per_unit)
        triangles.append(faces.reshape(-1, 3) + count)
        count += len(own)
        evaluated.to_mesh_clear()
    if not count or not sum(map(len, triangles)):
        raise SceneError(f"{cue.name} opens {thing.name}, which has no faces: choose the door's leaf, lid or drawer.")
    corners, faces = np.concatenate(positions), np.concatenate(triangles)
    kept, faces = simplified(corners, faces)
    return Leaf(thing, place * metres_per_unit, turn, corners[kept], faces, metres_per_unit)


def check_leaf(cue: bpy.types.Object, thing: bpy.types.Object) -> None:
    """Raises SceneError for a leaf that cannot be keyed: linked, or moved by something else than its limits."""
    if not thing.is_editable:
        raise SceneError(f"{cue.name} opens {thing.name}, which is linked and cannot get keys: make it local.")
    if any(thing.delta_location) or any(thing.delta_rotation_euler):
        raise SceneError(f"{cue.name} opens {thing.name}, which has delta transforms: apply them to its own first.")
    data = thing.animation_data
    own = data is not None and data.action is not None and CARRIED_IN_KEY in data.action
    limits = [constraint for constraint in thing.constraints if constraint.type in LIMITS and not constraint.mute]
    live = [constraint for constraint in thing.constraints if not constraint.mute and constraint.influence > 0.0]
    hangs = thing.parent is not None and may_move(thing.parent)
    if len(live) > len(limits) or hangs or (not live and may_move(thing, own_action=not own)):
        raise SceneError(
            f"{cue.name} opens {thing.name}, which moves by itself: take its keys, drivers and constraints but limits "
            "off, or have a hand cue follow it."
        )


# --- which way it goes ------------------------------------------------------------------------------------------------


def hinge_of(
    cue: bpy.types.Object, leaf: Leaf, come_from: Vector, how: str | None = None, axis: int | None = None
) -> Opens:
    """Which way a leaf opens, as far as it is opened usually: by its limits and locks, else by where its origin lies.

    `come_from`: where the person comes from, world, metres. `how`, `axis`: what is known already. Raises SceneError.
    """
    limited = _limited(leaf) if how is None and axis is None else None
    if limited is not None:
        how, axis, far = limited
    else:
        far = None
        how = how or HINGE
    if axis is None and how == SLIDE:
        way = leaf.turn.inverted() @ _level(come_from - leaf.in_world(0.5 * (leaf.low + leaf.high)))
        axis = max(range(3), key=lambda k: abs(way[k]))
    if axis is None:
        axis = _edge(leaf)
    if axis is None:
        start = person_of(bpy.context, cue)
        person = start.name if start is not None else "the person"
        raise SceneError(
            f"{cue.name} has {person} open {leaf.thing.name}, and it is unknown about which line: set its origin at "
            "the hinge (Object, Set Origin), lock or limit all of its turns but one, or choose an axis for the cue."
        )
    return _outwards(leaf, Opens(how, axis, 0.0), come_from, far)


def _limited(leaf: Leaf) -> tuple[str, int, tuple[float, float] | None] | None:
    """What locks and limits leave free where that is one axis: the kind, the axis, and how far it goes either way from
    where it is, radians or metres."""
    thing = leaf.thing
    # What turns by quaternions, as what is imported from glTF does, keeps no angles of its own.
    turned = thing.rotation_euler if len(thing.rotation_mode) == 3 else thing.matrix_basis.to_euler()
    for how, kind, locks in (
        (HINGE, "LIMIT_ROTATION", thing.lock_rotation),
        (SLIDE, "LIMIT_LOCATION", thing.lock_location),
    ):
        limits = [one for one in thing.constraints if one.type == kind and not one.mute and one.influence > 0.0]
        ranges: list[tuple[float, float] | None] = [(0.0, 0.0) if locked else None for locked in locks]
        for limit in limits:
            for k, axis in enumerate("xyz"):
                if kind == "LIMIT_ROTATION":
                    used = getattr(limit, f"use_limit_{axis}")
                else:
                    used = getattr(limit, f"use_min_{axis}") and getattr(limit, f"use_max_{axis}")
                if used and ranges[k] is None:
                    now = (turned if kind == "LIMIT_ROTATION" else thing.location)[k]
                    ranges[k] = (getattr(limit, f"min_{axis}") - now, getattr(limit, f"max_{axis}") - now)
        free = [k for k, span in enumerate(ranges) if span is None or span[1] - span[0] > LOCKED]
        if len(free) == 1:
            unit = leaf.metres_per_unit if how == SLIDE else 1.0
            far = ranges[free[0]]
            return how, free[0], (far[0] * unit, far[1] * unit) if far is not None else None
    return None


def _edge(leaf: Leaf) -> int | None:
    """The own axis along the edge on which its origin lies; at a corner the upright one, else the longer."""
    size = leaf.high - leaf.low
    thinnest = int(np.argmin(size))
    found = []
    for axis in (k for k in range(3) if k != thinnest):
        (other,) = (k for k in range(3) if k not in (axis, thinnest))
        if abs(leaf.axis(other).z) > UPRIGHT and size[other] > TALL:
            continue
        near = min(abs(leaf.low[other]), abs(leaf.high[other]))
        if near <= AT_THE_EDGE * size[other]:
            found.append(axis)
    return max(found, key=lambda k: (abs(leaf.axis(k).z) > UPRIGHT, size[k]), default=None)


def _outwards(leaf: Leaf, opens: Opens, come_from: Vector, far: tuple[float, float] | None) -> Opens:
    """The same as far as it usually goes: towards who comes, and lids up."""
    size = leaf.high - leaf.low
    usual = USUAL_TURN if opens.how == HINGE else min(USUAL_WAY, PART_OF_DEPTH * float(size[opens.axis]))
    grip = grip_of(leaf, opens, come_from)
    way = leaf.opened(replace(opens, amount=usual / 8.0), 1.0, grip) - grip
    out = way.dot(_level(come_from - grip)) if _comes_out(leaf, opens) else way.z
    if far is not None:
        # As far as it can, to the side where there is more room.
        end = max(far, key=abs)
        usual = math.degrees(end) if opens.how == HINGE else end
        if abs(min(far, key=abs)) < LOCKED:
            return replace(opens, amount=usual)
        usual = abs(usual)
    return replace(opens, amount=usual if out > 0.0 else -usual)


def _comes_out(leaf: Leaf, opens: Opens) -> bool:
    """Whether it comes towards a person, and not up."""
    return opens.how == SLIDE or abs(leaf.axis(opens.axis).z) > UPRIGHT


def _level(way: Vector) -> Vector:
    return Vector((way.x, way.y, 0.0)).normalized()


def grip_of(leaf: Leaf, opens: Opens, come_from: Vector) -> Vector:
    """Where a hand takes hold of a leaf, world, metres: what stands out of it towards who comes, else near its edge."""
    low, high = leaf.low, leaf.high
    size, middle = high - low, 0.5 * (low + high)
    thin = opens.axis if opens.how == SLIDE else int(np.argmin(size))
    to_person = leaf.turn.inverted() @ _level(come_from - leaf.in_world(middle))
    out = 1.0 if to_person[thin] > 0.0 else -1.0
    across = [k for k in range(3) if k != thin]
    if _comes_out(leaf, opens):
        front = leaf.positions[:, thin] * out
        outermost = leaf.positions[front > front.max() - STANDS_OUT]
        spread = np.ptp(outermost, axis=0)
        if all(spread[k] < SMALLER * size[k] for k in across):
            grip = 0.5 * (outermost.min(axis=0) + outermost.max(axis=0))
            grip[thin] = front.max() * out
            return leaf.in_world(grip)
    grip = middle.copy()
    if opens.how == HINGE:
        (other,) = (k for k in across if k != opens.axis) if opens.axis in across else (across[0],)
        far = high if abs(high[other]) > abs(low[other]) else low
        inwards = min(FROM_THE_EDGE, 0.2 * size[other]) if _comes_out(leaf, opens) else -FINGERS
        grip[other] = far[other] - inwards * math.copysign(1.0, far[other])
        if abs(leaf.axis(opens.axis).z) > UPRIGHT:
            up = 1.0 if leaf.axis(opens.axis).z > 0.0 else -1.0
            base = min(leaf.in_world(low).z, leaf.in_world(high).z)
            height = min(max(HANDLE_HEIGHT - base, 0.1 * size[opens.axis]), 0.9 * size[opens.axis])
            grip[opens.axis] = low[opens.axis] + height if up > 0.0 else high[opens.axis] - height
    if _comes_out(leaf, opens):
        grip[thin] = (high if out > 0.0 else low)[thin]
        return leaf.in_world(grip)
    return leaf.in_world(grip) + Vector((0.0, 0.0, OVER))


# --- where to stand ---------------------------------------------------------------------------------------------------


def leads_from(leaf: Leaf, opens: Opens, grip: Vector, come_from: Vector) -> Callable[[Vector], float | None]:
    """What it counts, metres, to lead a leaf from a place on the floor (world, metres); None for places that it sweeps
    or that are not before it.
    """
    shares = [k / LOOKS for k in range(LOOKS + 1)]
    half, middle = Vector(0.5 * (leaf.high - leaf.low)), Vector(0.5 * (leaf.high + leaf.low))
    led = shares if opens.how == SLIDE or not _comes_out(leaf, opens) else [s for s in shares if s <= 0.6]
    handles = [leaf.opened(opens, share, grip) for share in led]
    onwards = [(leaf.opened(opens, share + 0.01, grip) - leaf.opened(opens, share, grip)).normalized() for share in led]
    is_pulled = _comes_out(leaf, opens) and onwards[0].dot(come_from - grip) > 0.0
    # Of what stands upright the side on which one comes.
    thin = int(np.argmin(leaf.high - leaf.low))
    face = leaf.axis(thin) * math.copysign(1.0, leaf.axis(thin).dot(come_from - grip))

    def counts(spot: Vector) -> float | None:
        if opens.how == HINGE and _comes_out(leaf, opens) and (spot - grip).dot(face) < 0.0:
            return None
        for share in shares:
            for height in HEIGHTS:
                # As if the body went the other way round and the leaf stayed.
                there = leaf.own(
                    leaf.opened(replace(opens, amount=-opens.amount), share, spot + Vector((0, 0, height)))
                )
                over = [max(abs(there[k] - middle[k]) - half[k], 0.0) for k in range(3)]
                if Vector(over).length < CLEAR:
                    return None
        ways = [abs((handle - spot).xy.length - HANDY) for handle in handles]
        # An arm that has to come round the edge is in the leaf's way.
        behind = [max((handle - spot).dot(way), 0.0) for handle, way in zip(handles, onwards, strict=True) if is_pulled]
        return (LEADS_COUNT * sum(ways) + BEHIND_COUNTS * sum(behind)) / len(ways)

    return counts


# --- what the core is told --------------------------------------------------------------------------------------------


def write_opens(cue: bpy.types.Object, opens: Opens) -> None:
    """Has a cue say which way it opens, for the artist to change."""
    cue[OPENS_KEY], cue[AXIS_KEY], cue[AMOUNT_KEY], cue[OVER_KEY] = opens.how, AXES[opens.axis], opens.amount, 0.0
    unit = "Degrees about" if opens.how == HINGE else "Metres along"
    cue.id_properties_ui(AMOUNT_KEY).update(
        description=f"{unit} the axis; negative the other way, or to close it again"
    )
    cue.id_properties_ui(OVER_KEY).update(
        min=0.0, soft_max=10.0, max=60.0, description="Seconds that it takes; 0: as long as people take"
    )


def said_by(cue: bpy.types.Object, leaf: Leaf, come_from: Vector) -> Opens:
    """Which way a cue opens a leaf. Raises SceneError for what it cannot mean."""
    how, axis, amount = (cue.get(key) for key in (OPENS_KEY, AXIS_KEY, AMOUNT_KEY))
    if how is None and axis is None and amount is None:
        return hinge_of(cue, leaf, come_from)
    if how not in OPENS or axis not in AXES:
        raise SceneError(
            f"{cue.name} does not say whether {leaf.thing.name} turns (hinge) or slides (slide), and about or along "
            "which of X, Y and Z: place it again."
        )
    if not isinstance(amount, int | float) or isinstance(amount, bool) or not math.isfinite(amount):
        raise SceneError(f"{cue.name} does not say how far {leaf.thing.name} is opened: give it a number.")
    return Opens(how, AXES.index(axis), float(amount))


def leaf_told(leaf: Leaf, opens: Opens) -> dict:
    """A leaf as the core takes it."""
    along = [float(k == opens.axis) for k in range(3)]
    hung = (
        {"by": "slide", "direction": along}
        if opens.how == SLIDE
        else {"by": "hinge", "point": [0.0, 0.0, 0.0], "axis": along}
    )
    return {
        "name": leaf.thing.name,
        "position": list(leaf.place),
        "rotation": list(leaf.turn),
        "hung": hung,
        "positions": leaf.positions.tolist(),
        "triangles": leaf.triangles.tolist(),
    }


def read_open(cue: bpy.types.Object, leaf: Leaf, opens: Opens, metres_per_unit: float) -> dict:
    """An Open cue as the core takes it: where it stands on the leaf is where that is taken hold of."""
    hand = cue.get(HAND_KEY)
    if hand not in WHICH_HANDS:
        raise SceneError(f"{cue.name} does not say which hand opens {leaf.thing.name}: place it again.")
    grip = leaf.own(cue.matrix_world.translation * metres_per_unit)
    by = {"metres": opens.amount} if opens.how == SLIDE else {"degrees": opens.amount}
    over = cue.get(OVER_KEY)
    lasts = {"over_seconds": float(over)} if isinstance(over, int | float) and over > 0.0 else {}
    thing = leaf.thing.name
    return {"does": "open", "name": cue.name, "thing": thing, "hand": hand, "by": by, "grip": list(grip), **lasts}
