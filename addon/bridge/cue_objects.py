# SPDX-License-Identifier: GPL-3.0-or-later
"""Cues as empties: made here for the buttons, for scripts and for the fixtures."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import bpy  # before bmesh: the bpy module brings it

# isort: split
import bmesh
from mathutils import Matrix, Vector

from ..errors import SceneError
from . import compat
from .leaves import grip_of, hinge_of, leads_from, read_mesh, write_opens
from .names import (
    AT_FRAME_KEY,
    CHARACTER_KEY,
    CUE_KEY,
    FIRST_FRAME_KEY,
    GIVEN_YAW_KEY,
    HAND_KEY,
    HOLD_KEY,
    LAST_FRAME_KEY,
    PERSON_KEY,
    STEP_KEY,
    THING_KEY,
    oncue_collection,
)
from .scene_time import may_move
from .shown_cues import (
    ENDS,
    LOOK,
    OPEN,
    ORDERED,
    PASS,
    PUT,
    TAKE,
    end_cues,
    ordered_cues,
    person_of,
    played_cues,
    several_starts,
    visible_cues,
    worked_on,
)
from .stand_finder import REACHES, stand_before, stands_before
from .things import read_thing, thing_of
from .what_counts import is_shown, things_of

#: Kind → name, empty's shape, its size in metres, its colour (sRGB with alpha, as viewports show it).
KINDS = {
    "start": ("Start", "ARROWS", 0.25, (0.25, 0.75, 0.35, 1.0)),
    "sit": ("Sit", "SPHERE", 0.10, (0.95, 0.55, 0.15, 1.0)),
    "stop": ("Stop", "ARROWS", 0.25, (0.85, 0.25, 0.25, 1.0)),
    "pass": ("Pass", "PLAIN_AXES", 0.15, (0.90, 0.80, 0.20, 1.0)),
    "take": ("Take", "SPHERE", 0.03, (0.95, 0.45, 0.70, 1.0)),
    "put": ("Put", "CIRCLE", 0.10, (0.95, 0.45, 0.70, 1.0)),
    "open": ("Open", "SPHERE", 0.03, (0.95, 0.75, 0.45, 1.0)),
    "look": ("Look", "CIRCLE", 0.08, (0.35, 0.85, 0.75, 1.0)),
    "left_foot": ("Left Foot", "CUBE", 0.04, (0.30, 0.60, 0.95, 1.0)),
    "right_foot": ("Right Foot", "CUBE", 0.04, (0.75, 0.45, 0.95, 1.0)),
    "left_hand": ("Left Hand", "SPHERE", 0.03, (0.30, 0.60, 0.95, 1.0)),
    "right_hand": ("Right Hand", "SPHERE", 0.03, (0.75, 0.45, 0.95, 1.0)),
    "both_hands": ("Both Hands", "SPHERE", 0.03, (0.20, 0.80, 0.80, 1.0)),
}
#: A start within this of the yaw that it was given was not turned, radians.
UNTURNED = 1e-3
#: What is opened is stood before farther away, too, where it comes towards one, metres.
FARTHER = (*REACHES, 0.70, 0.78)
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
    # Two feet and two hands lie side by side: their names tell them apart.
    cue.show_name = kind not in ("start", *ENDS, PASS, LOOK)
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


def place_cue(
    context: bpy.types.Context, kind: str, position, yaw: float, metres_per_unit: float, *, then: bool = False
) -> bpy.types.Object:
    """Moves the visible cue of this kind there, or makes one; selects it.

    A sit and a stop take each other's place; of several the active one moves, else the last. With `then` another one is
    made, which is played after those that are there. A pass is always another one: see `_pass_comes`. Of several people
    it is about the one who is worked on.
    """
    label, shape, size, color = KINDS[kind]
    person = worked_on(context)
    starts = [person] if person else visible_cues(context, "start")
    there = starts if kind == "start" else end_cues(context, person)
    if kind == PASS or (then and kind != "start"):
        ordered = ordered_cues(context, person)
        at = _pass_comes(context, ordered) if kind == PASS else len(ordered)
        cue = _put_in_order(context, kind, position, yaw, metres_per_unit, ordered, at)
    elif there:
        cue = active_of(context, there)
        if not cue.is_editable:
            raise SceneError(f"{cue.name} is linked and cannot be moved: hide it, and press again.")
        if cue[CUE_KEY] != kind:
            cue[CUE_KEY], cue.color = kind, color
            cue.empty_display_type, cue.empty_display_size = shape, size / metres_per_unit
            if cue.name.split(".")[0] in {"Sit", "Stop"}:
                cue.name = label
        cue.matrix_world = Matrix.Translation(position) @ Matrix.Rotation(yaw, 4, "Z")
    else:
        cue = make_cue(context, kind, position, yaw, metres_per_unit=metres_per_unit)
    if kind == "start":
        cue[GIVEN_YAW_KEY] = yaw
    else:
        if person is not None:
            cue[PERSON_KEY] = person
        if kind != PASS and HOLD_KEY not in cue:
            cue[HOLD_KEY] = 1.0
            cue.id_properties_ui(HOLD_KEY).update(
                min=0.0, soft_max=60.0, max=600.0, description="Seconds that the person stays there"
            )
        context.view_layer.update()
        _turn_start(context)
    _select(context, cue)
    return cue


def _put_in_order(
    context: bpy.types.Context, kind: str, position, yaw: float, metres_per_unit: float, ordered: list, at: int
) -> bpy.types.Object:
    """Another cue, which comes after so many of a person's. Raises SceneError where one that moves on is linked."""
    number_steps(ordered[:at])
    number_steps(ordered[at:], at + 2)
    cue = make_cue(context, kind, position, yaw, metres_per_unit=metres_per_unit)
    cue[STEP_KEY] = at + 1
    return cue


def place_look(context: bpy.types.Context, metres_per_unit: float) -> bpy.types.Object:
    """Another look cue, after the active cue in the order, else last; selects it.

    On the middle of the active object while it is selected, along with which it goes; else at the 3D cursor.
    """
    person = worked_on(context)
    ordered = ordered_cues(context, person)
    active = context.active_object
    at = ordered.index(active) + 1 if active in ordered else len(ordered)
    is_seen = active is not None and active.select_get() and not (active.get(CUE_KEY) or active.get(CHARACTER_KEY))
    place = middle_of(active) if is_seen else context.scene.cursor.location.copy()
    cue = _put_in_order(context, LOOK, place, 0.0, metres_per_unit, ordered, at)
    if is_seen:
        hang_on(context, cue, active)
    if person is not None:
        cue[PERSON_KEY] = person
    cue[HOLD_KEY] = 0.0
    cue.id_properties_ui(HOLD_KEY).update(
        min=0.0,
        soft_max=60.0,
        max=600.0,
        description="Seconds that the person looks there; 0: until the next cue in the list is reached",
    )
    _select(context, cue)
    return cue


def hang_on(context: bpy.types.Context, cue: bpy.types.Object, thing: bpy.types.Object) -> None:
    """Has a cue go along with an object, from where it is."""
    cue.parent = thing
    cue.matrix_parent_inverse = thing.matrix_world.inverted_safe()
    context.view_layer.update()


def middle_of(thing: bpy.types.Object) -> Vector:
    """The middle of an object's bounds, world."""
    corners = [thing.matrix_world @ Vector(corner) for corner in thing.bound_box]
    return sum(corners, Vector()) / len(corners)


def add_person(context: bpy.types.Context, position, metres_per_unit: float) -> bpy.types.Object:
    """Another start, with no cues yet; selects it. Cues that were the only person's stay that one's.

    Raises SceneError where one of them is linked.
    """
    starts = visible_cues(context, "start")
    if len(starts) == 1:
        give_to_person(ordered_cues(context), starts[0])
    yaw = starts[-1].matrix_world.to_euler().z if starts else 0.0
    start = make_cue(context, "start", position, yaw, metres_per_unit=metres_per_unit)
    start[GIVEN_YAW_KEY] = yaw
    _select(context, start)
    return start


def give_to_person(cues: list[bpy.types.Object], start: bpy.types.Object) -> None:
    """Has these cues be of the person who starts there. Raises SceneError where one is linked."""
    for cue in cues:
        if cue.get(PERSON_KEY) == start:
            continue
        if not cue.is_editable:
            raise SceneError(f"{cue.name} is linked and cannot be given to a person: hide it, and press again.")
        cue[PERSON_KEY] = start


def given_cues(context: bpy.types.Context) -> tuple[list[bpy.types.Object], bpy.types.Object]:
    """The selected cues and the start that is active, to which they are to be given. Raises SceneError."""
    start, cues = context.active_object, visible_cues(context, *ORDERED)
    chosen = [cue for cue in cues if cue.select_get()]
    if start is None or start.get(CUE_KEY) != "start" or not chosen:
        raise SceneError(
            "Select Sit, Stop, Pass and Look cues, and last the Start cue of the person whose they are to be."
        )
    return chosen, start


def _pass_comes(context: bpy.types.Context, played: list[bpy.types.Object]) -> int:
    """Where in the order a new pass cue comes: after the active one if that is a pass, before it if the person stays
    there, else before the last.
    """
    ends = [at for at, cue in enumerate(played) if cue[CUE_KEY] in ENDS]
    if context.active_object in played:
        at = played.index(context.active_object)
        return at if at in ends else at + 1
    return ends[-1] if ends else len(played)


def active_of(context: bpy.types.Context, cues: list[bpy.types.Object]) -> bpy.types.Object:
    """The one of these that the artist works on, else the last."""
    return context.active_object if context.active_object in cues else cues[-1]


def number_steps(played: list[bpy.types.Object], first: int = 1) -> None:
    """Has these cues played in this order, from the number `first` on. Raises SceneError where one is linked."""
    for number, cue in enumerate(played, first):
        if cue.get(STEP_KEY) == number:
            continue
        if not cue.is_editable:
            raise SceneError(f"{cue.name} is linked and cannot get a number: hide it, and press again.")
        cue[STEP_KEY] = number


def move_end_cue(context: bpy.types.Context, position, yaw: float, metres_per_unit: float) -> bpy.types.Object:
    """Moves a visible sit or stop cue and its feet, of several that which is nearest.

    Raises SceneError where there is none, or keys hold it.
    """
    ends = end_cues(context)
    if not ends:
        raise SceneError("There is no Sit or Stop cue any more.")
    cue = min(ends, key=lambda end: (end.matrix_world.translation - Vector(position)).length)
    if may_move(cue):
        raise SceneError(f"{cue.name} is animated, so that it would not stay there: move its keys instead.")
    _select(context, cue)
    return place_cue(context, cue[CUE_KEY], position, yaw, metres_per_unit)


def _turn_start(context: bpy.types.Context) -> None:
    """Turns the start towards the end cue, unless somebody has turned it."""
    for start in things_of(context.view_layer):
        if start.get(CUE_KEY) != "start" or not is_shown(start, context.view_layer) or not start.is_editable:
            continue
        forward = forward_of(start.matrix_world)
        given, now = start.get(GIVEN_YAW_KEY), yaw_from_heading(math.atan2(forward.y, forward.x))
        if isinstance(given, float) and abs(math.remainder(now - given, math.tau)) < UNTURNED:
            place = start.matrix_world.translation
            start[GIVEN_YAW_KEY] = yaw = facing_on_the_way(context, "start", place, person=start)
            start.matrix_world = Matrix.Translation(place) @ Matrix.Rotation(yaw, 4, "Z")


def place_foot(context: bpy.types.Context, side: str, metres_per_unit: float) -> bpy.types.Object:
    """A foot cue in front of the visible sit or stop cue, on the start's floor. Raises SceneError without a cue."""
    kind = f"{side}_foot"
    ends = end_cues(context)
    if not ends:
        raise SceneError("Place a Sit or Stop cue first: the feet belong to it.")
    cue, unit = active_of(context, ends), 1.0 / metres_per_unit
    for child in cue.children:
        if child.get(CUE_KEY) == kind:
            _select(context, child)
            return child
    forward = forward_of(cue.matrix_world)
    left = Vector((-forward.y, forward.x, 0.0))
    ahead, aside = (0.42 if cue[CUE_KEY] == "sit" else 0.0), (0.10 if side == "left" else -0.10)
    place = cue.matrix_world.translation + (forward * ahead + left * aside) * unit
    starts = [o for o in things_of(context.view_layer) if o.get(CUE_KEY) == "start" and is_shown(o, context.view_layer)]
    if starts:
        place.z = starts[0].matrix_world.translation.z
    elif cue[CUE_KEY] == "sit":
        place.z -= 0.55 * unit
    yaw = math.atan2(forward.y, forward.x) + math.pi / 2
    foot = make_cue(context, kind, place, yaw, parent=cue, metres_per_unit=metres_per_unit)
    _select(context, foot)
    return foot


def place_hand(
    context: bpy.types.Context, kind: str, first_frame: int, last_frame: int, metres_per_unit: float
) -> bpy.types.Object:
    """A hand cue of `kind` that goes along with what it is placed on; selects it.

    In edit mode that is the selected vertex, wherever modifiers, shape keys and hinges take it; else the active object
    while it is selected, from the 3D cursor on. Raises SceneError where not exactly one vertex is selected.
    """
    owner, place, vertex = _hold(context)
    cue = make_cue(context, kind, place, 0.0, metres_per_unit=metres_per_unit)
    cue[FIRST_FRAME_KEY], cue[LAST_FRAME_KEY] = first_frame, last_frame
    cue.id_properties_ui(FIRST_FRAME_KEY).update(description="The frame at which the hand is there first")
    cue.id_properties_ui(LAST_FRAME_KEY).update(description="The frame at which the hand lets go")
    if vertex is not None:
        cue.parent, cue.parent_type, cue.parent_vertices[0] = owner, "VERTEX", vertex
        cue.location = (0.0, 0.0, 0.0)
    elif owner is not None:
        cue.parent = owner
        cue.matrix_parent_inverse = owner.matrix_world.inverted_safe()
    context.view_layer.update()
    _select(context, cue)
    return cue


def _hold(context: bpy.types.Context) -> tuple[bpy.types.Object | None, Vector, int | None]:
    """What a hand cue is placed on: the object, the place in the world, and the vertex in edit mode."""
    active = context.active_object
    if context.mode == "EDIT_MESH":
        chosen = [vertex for vertex in bmesh.from_edit_mesh(active.data).verts if vertex.select]
        if len(chosen) != 1:
            raise SceneError(
                f"{len(chosen)} vertices of {active.name} are selected: select the one that the hand is to hold."
            )
        return active, active.matrix_world @ chosen[0].co, chosen[0].index
    held = active is not None and active.select_get() and not (active.get(CUE_KEY) or active.get(CHARACTER_KEY))
    return active if held else None, context.scene.cursor.location.copy(), None


def place_take(context: bpy.types.Context, hand: str, metres_per_unit: float) -> bpy.types.Object:
    """A cue that has the active object taken by a hand, after all cues that are there, at its middle; selects it.

    Raises SceneError where no thing is selected, or it cannot be carried.
    """
    thing = context.active_object
    if thing is None or not thing.select_get() or thing.get(CUE_KEY) or thing.get(CHARACTER_KEY):
        raise SceneError("Select the thing that is to be taken, and press again.")
    cue = _place_thing(context, TAKE, thing, thing.matrix_world.translation, 0.0, metres_per_unit)
    cue[HAND_KEY] = hand
    try:
        box = read_thing(cue, thing, None, 1.0)
    except SceneError:
        bpy.data.objects.remove(cue)
        raise
    middle = [0.5 * (low + high) for low, high in zip(box["low"], box["high"], strict=True)]
    place, turn, _ = thing.matrix_world.decompose()
    cue.location = place + turn @ Vector(middle)
    hang_on(context, cue, thing)
    return _with_a_stand(context, cue, metres_per_unit)


def place_put(context: bpy.types.Context, place, metres_per_unit: float) -> bpy.types.Object:
    """A cue that has the thing that was taken last put down at `place`, after all cues that are there; selects it.

    Raises SceneError where none is in a hand by then.
    """
    held: list[bpy.types.Object] = []
    for cue in ordered_cues(context, worked_on(context)):
        if cue[CUE_KEY] == TAKE:
            held.append(thing_of(cue))
        elif cue[CUE_KEY] == PUT and thing_of(cue) in held:
            held.remove(thing_of(cue))
    if not held:
        raise SceneError(
            "Nothing is in a hand by then that could be put down: select a thing, and have it taken first."
        )
    forward = forward_of(held[-1].matrix_world)
    yaw = yaw_from_heading(math.atan2(forward.y, forward.x))
    cue = _place_thing(context, PUT, held[-1], place, yaw, metres_per_unit)
    cue[GIVEN_YAW_KEY] = yaw
    return _with_a_stand(context, cue, metres_per_unit)


def place_open(
    context: bpy.types.Context, hand: str, how: str | None, axis: int | None, amount: float, metres_per_unit: float
) -> bpy.types.Object:
    """A cue that has the active object opened by a hand, after all cues that are there, at its handle; selects it.

    `how`, `axis`, `amount`: which way it opens and how far, where that is not to be found; 0 for as far as usual. Where
    the object's own origin is at no hinge, and that of the empty on which it hangs is, that is opened. Raises
    SceneError.
    """
    thing = context.active_object
    if thing is None or not thing.select_get() or thing.get(CUE_KEY) or thing.get(CHARACTER_KEY):
        raise SceneError("Select what is to be opened (the door's leaf, the lid, the drawer), and press again.")
    standing = _who_stands(context, None)
    if not standing:
        raise SceneError("Place the Start cue first: from there Oncue finds where to stand.")
    come_from = standing[-1].matrix_world.translation * metres_per_unit
    cue = _place_thing(context, OPEN, thing, thing.matrix_world.translation, 0.0, metres_per_unit)
    cue[HAND_KEY] = hand
    depsgraph = context.evaluated_depsgraph_get()
    try:
        leaf = read_mesh(cue, thing, depsgraph, metres_per_unit)
        try:
            opens = hinge_of(cue, leaf, come_from, how, axis)
        except SceneError:
            hinge = thing.parent
            if hinge is None or hinge.type != "EMPTY" or hinge.get(CUE_KEY):
                raise
            leaf = read_mesh(cue, hinge, depsgraph, metres_per_unit)
            opens = hinge_of(cue, leaf, come_from, how, axis)
            cue[THING_KEY] = hinge
    except SceneError:
        bpy.data.objects.remove(cue)
        raise
    opens = replace(opens, amount=amount) if amount else opens
    grip = grip_of(leaf, opens, come_from)
    cue.location = grip / metres_per_unit
    write_opens(cue, opens)
    hang_on(context, cue, leaf.thing)
    leads = leads_from(leaf, opens, grip, come_from)
    return _with_a_stand(context, cue, metres_per_unit, FARTHER, leads)


def _with_a_stand(
    context: bpy.types.Context,
    cue: bpy.types.Object,
    metres_per_unit: float,
    reaches: tuple[float, ...] = REACHES,
    counts: Callable[[Vector], float | None] | None = None,
) -> bpy.types.Object:
    """A Take, Put or Open cue that was placed, with a place to stand for it (as of `stand_before`), selected. Raises
    SceneError without one; the cue is gone then.
    """
    try:
        _stand_for(context, cue, metres_per_unit, reaches, counts)
    except SceneError:
        bpy.data.objects.remove(cue)
        raise
    _select(context, cue)
    return cue


def _who_stands(context: bpy.types.Context, cue: bpy.types.Object | None) -> list[bpy.types.Object]:
    """The Stop cues before a cue, or before all that come, else the start: where who comes there may have stood."""
    before = [one for one in ordered_cues(context, worked_on(context)) if one != cue]
    starts = [worked_on(context)] if worked_on(context) else visible_cues(context, "start")
    return [one for one in before if one[CUE_KEY] == "stop"] or starts


def _stand_for(
    context: bpy.types.Context,
    cue: bpy.types.Object,
    metres_per_unit: float,
    reaches: tuple[float, ...],
    counts: Callable[[Vector], float | None] | None,
) -> None:
    """Where no Sit or Stop cue before a Take, Put or Open cue is within reach of it, has the person stop where one is.

    Raises SceneError where nobody could stand.
    """
    before = [one for one in ordered_cues(context, worked_on(context)) if one != cue]
    there = [one for one in before if one[CUE_KEY] in ENDS]
    place, unit = cue.matrix_world.translation, 1.0 / metres_per_unit
    if there and stands_before(there[-1].matrix_world, place, unit):
        return
    starts = [worked_on(context)] if worked_on(context) else visible_cues(context, "start")
    standing = _who_stands(context, cue)
    if not standing:
        raise SceneError("Place the Start cue first: from there Oncue finds where to stand.")
    floor = (starts or standing)[0].matrix_world.translation.z
    come_from = (there or standing)[-1].matrix_world.translation.copy()
    come_from.z = floor
    found = stand_before(context, place, come_from, metres_per_unit, reaches, counts)
    if found is None:
        raise SceneError(
            f"Nobody can stand within reach of {cue.name}: place a Sit or Stop cue from which a hand gets there, and "
            "press again."
        )
    spot, ahead = found
    yaw = yaw_from_heading(math.atan2(ahead.y, ahead.x))
    stop = place_cue(context, "stop", spot, yaw, metres_per_unit, then=True)
    # It comes before what it is for.
    number_steps([*before, stop, cue])


def _place_thing(
    context: bpy.types.Context, kind: str, thing: bpy.types.Object, place, yaw: float, metres_per_unit: float
) -> bpy.types.Object:
    person = worked_on(context)
    ordered = ordered_cues(context, person)
    number_steps(ordered)
    cue = make_cue(context, kind, place, yaw, name=f"{KINDS[kind][0]} {thing.name}", metres_per_unit=metres_per_unit)
    cue[THING_KEY], cue[STEP_KEY] = thing, len(ordered) + 1
    if person is not None:
        cue[PERSON_KEY] = person
    return cue


def animated_range(thing: bpy.types.Object | None) -> tuple[int, int] | None:
    """The frames over which an object, or the nearest of its parents that is animated, has keys that move it."""
    while thing is not None:
        action = thing.animation_data.action if thing.animation_data else None
        if action is not None:
            ranges = [curve.range() for curve in compat.action_curves(action, thing) if len(curve.keyframe_points)]
            first, last = min((r[0] for r in ranges), default=0.0), max((r[1] for r in ranges), default=0.0)
            if last > first:
                return int(first), int(last)
        thing = thing.parent
    return None


def facing_on_the_way(
    context: bpy.types.Context,
    kind: str,
    place: Vector,
    then: bool = False,
    person: bpy.types.Object | None = None,
) -> float:
    """A first guess of a standing cue's yaw: a start looks towards the first cue, a stop away from where one comes.

    That is the start, or with `then` the last cue; of several people those of `person`, else of who is worked on.
    """
    person = (person or worked_on(context)) if several_starts(context) else None
    played, starts = played_cues(context, person), [person] if person else visible_cues(context, "start")
    others = played[:1] if kind == "start" else played[-1:] if then else starts[:1]
    for other in others:
        way = other.matrix_world.translation - Vector(place)
        if way.xy.length > 1e-3:
            way = way if kind == "start" else -way
            return yaw_from_heading(math.atan2(way.y, way.x))
    return 0.0


def be_here(context: bpy.types.Context, name: str, frame: int) -> None:
    """Has a sit or stop cue be reached on a frame, or whenever it comes to it where it has one. Raises SceneError."""
    cue = next((cue for cue in end_cues(context) if cue.name == name), None)
    if cue is None:
        raise SceneError(f"There is no Sit or Stop cue {name} any more.")
    if not cue.is_editable:
        raise SceneError(f"{cue.name} is linked and cannot get a frame: hide it, and press again.")
    if AT_FRAME_KEY in cue:
        del cue[AT_FRAME_KEY]
        return
    cue[AT_FRAME_KEY] = frame
    cue.id_properties_ui(AT_FRAME_KEY).update(description="The frame of the scene on which the person is to be here")


def select_cue(context: bpy.types.Context, name: str) -> None:
    """Selects a cue by its name. Raises SceneError where it is not shown any more."""
    cue = next((cue for cue in visible_cues(context, *KINDS) if cue.name == name), None)
    if cue is None:
        raise SceneError(f"There is no cue {name} any more.")
    _select(context, cue)


def _select(context: bpy.types.Context, cue: bpy.types.Object) -> None:
    starts = several_starts(context)
    person = cue if cue in starts else person_of(context, cue, starts) if starts else None
    if person is not None and context.scene.is_editable:
        # Whom the artist goes on working on once a thing, or nothing, is selected.
        context.scene[PERSON_KEY] = person
    if context.mode != "OBJECT":
        return
    for other in things_of(context.view_layer):
        other.select_set(other == cue)
    context.view_layer.objects.active = cue
