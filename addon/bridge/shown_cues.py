# SPDX-License-Identifier: GPL-3.0-or-later
"""Which cues the view shows, whose they are, and in which order they are played."""

from __future__ import annotations

import math

import bpy

from .names import CUE_KEY, PERSON_KEY, STEP_KEY
from .what_counts import is_shown, things_of

ENDS = ("sit", "stop")
PASS = "pass"
#: What is done with a thing at the last sit or stop cue before it.
THINGS = TAKE, PUT, OPEN = ("take", "put", "open")
LOOK = "look"
#: What the body comes to, and what has a place in the order besides.
PLAYED = (*ENDS, PASS)
ORDERED = (*PLAYED, *THINGS, LOOK)
FEET = ("left_foot", "right_foot")
HANDS = ("left_hand", "right_hand", "both_hands")


def visible_cues(context: bpy.types.Context, *kinds: str) -> list[bpy.types.Object]:
    """The empties of these kinds that the viewport shows, by name. Hidden cues wait for another take."""
    return sorted(
        (o for o in things_of(context.view_layer) if o.get(CUE_KEY) in kinds and is_shown(o, context.view_layer)),
        key=lambda o: o.name,
    )


def ordered_cues(context: bpy.types.Context, start: bpy.types.Object | None = None) -> list[bpy.types.Object]:
    """The visible sit, stop, pass, take, put, open and look cues in their order: by their numbers, then by name.

    Those of the person who starts at `start`; else all but those of people whose start is hidden: these wait with it.
    """
    starts = visible_cues(context, "start")
    cues = [(cue, person_of(context, cue, starts)) for cue in visible_cues(context, *ORDERED)]
    own = [cue for cue, person in cues if (person == start if start else person is None or person in starts)]
    return sorted(own, key=lambda cue: (step_of(cue), cue.name))


def played_cues(context: bpy.types.Context, start: bpy.types.Object | None = None) -> list[bpy.types.Object]:
    """Those of them that the body comes to: the sit, stop and pass cues."""
    return [cue for cue in ordered_cues(context, start) if cue[CUE_KEY] in PLAYED]


def end_cues(context: bpy.types.Context, start: bpy.types.Object | None = None) -> list[bpy.types.Object]:
    """Those of them at which the person stays: the sit and stop cues."""
    return [cue for cue in played_cues(context, start) if cue[CUE_KEY] in ENDS]


def person_of(
    context: bpy.types.Context, cue: bpy.types.Object, starts: list[bpy.types.Object] | None = None
) -> bpy.types.Object | None:
    """The start of the person whose a cue is, hidden or not: the one that it names, else the only one (`starts`: those
    that are shown). None where it is nobody's, as after its start was deleted.
    """
    person = cue.get(PERSON_KEY)
    is_there = isinstance(person, bpy.types.Object) and context.scene.objects.get(person.name) == person
    if is_there and person.get(CUE_KEY) == "start":
        return person
    starts = visible_cues(context, "start") if starts is None else starts
    return starts[0] if len(starts) == 1 else None


def several_starts(context: bpy.types.Context) -> list[bpy.types.Object]:
    """The starts that the view shows where several people start, by name; none where one does, or nobody."""
    starts = visible_cues(context, "start")
    return starts if len(starts) > 1 else []


def worked_on(context: bpy.types.Context) -> bpy.types.Object | None:
    """Of several starts that of the person whom the artist works on: of the active start or cue, else of another that
    is selected, else the one who was worked on before, else the last.
    """
    starts = several_starts(context)
    if not starts:
        return None
    # Who has a thing taken or opened makes that the active object.
    selected = [one for one in things_of(context.view_layer) if one.get(CUE_KEY) is not None and one.select_get()]
    before = context.scene.get(PERSON_KEY)
    for one in (context.active_object, *selected, before if isinstance(before, bpy.types.Object) else None):
        if one is None:
            continue
        person = one if one in starts else person_of(context, one, starts)
        if person in starts:
            return person
    return starts[-1]


def step_of(cue: bpy.types.Object) -> float:
    """A cue's number in the order of several; infinite where it has none."""
    number = cue.get(STEP_KEY)
    return float(number) if isinstance(number, int | float) and math.isfinite(number) else math.inf
