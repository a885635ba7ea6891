# SPDX-License-Identifier: GPL-3.0-or-later
"""Which cues the view shows, and in which order they are played."""

from __future__ import annotations

import math

import bpy

from .names import CUE_KEY, STEP_KEY
from .what_counts import is_shown, things_of

ENDS = ("sit", "stop")
PASS = "pass"
#: What has a place in the order.
PLAYED = (*ENDS, PASS)
FEET = ("left_foot", "right_foot")
HANDS = ("left_hand", "right_hand", "both_hands")


def visible_cues(context: bpy.types.Context, *kinds: str) -> list[bpy.types.Object]:
    """The empties of these kinds that the viewport shows, by name. Hidden cues wait for another take."""
    return sorted(
        (o for o in things_of(context.view_layer) if o.get(CUE_KEY) in kinds and is_shown(o, context.view_layer)),
        key=lambda o: o.name,
    )


def played_cues(context: bpy.types.Context) -> list[bpy.types.Object]:
    """The visible sit, stop and pass cues in the order in which they are played: by their numbers, then by name."""
    return sorted(visible_cues(context, *PLAYED), key=lambda cue: (step_of(cue), cue.name))


def end_cues(context: bpy.types.Context) -> list[bpy.types.Object]:
    """Those of them at which the person stays: the sit and stop cues."""
    return [cue for cue in played_cues(context) if cue[CUE_KEY] != PASS]


def step_of(cue: bpy.types.Object) -> float:
    """A cue's number in the order of several; infinite where it has none."""
    number = cue.get(STEP_KEY)
    return float(number) if isinstance(number, int | float) and math.isfinite(number) else math.inf
