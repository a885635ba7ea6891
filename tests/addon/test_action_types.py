"""Whoever must know an action type knows all that the core has."""

from typing import get_args, get_type_hints

import bpy
import oncue_core
import pytest


@pytest.mark.parametrize("action_type", oncue_core.cue_types())
def test_every_cue_of_the_core_can_be_placed_and_seen(oncue, action_type):
    kinds = oncue("bridge.cue_objects").KINDS
    assert action_type in kinds
    assert action_type in oncue("bridge.shown_cues").ENDS
    assert action_type in oncue("panels").CUE_ICONS
    items = bpy.ops.oncue.place_cue.get_rna_type().properties["kind"].enum_items
    assert action_type in [item.identifier for item in items]


def test_the_types_of_a_cue_are_those_of_the_core():
    literal = get_type_hints(oncue_core.ActionCue)["action_type"]
    assert list(get_args(literal)) == oncue_core.cue_types()
