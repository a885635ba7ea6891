# SPDX-License-Identifier: GPL-3.0-or-later
"""Writing that leaves nothing behind where it fails."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import bpy

from . import compat
from .things import play_things, release_all

#: Kinds of datablocks that a run makes, what uses others first.
KINDS = ("objects", "meshes", "armatures", "actions", "collections", "materials")


@contextmanager
def all_or_nothing(context: bpy.types.Context) -> Iterator[None]:
    """Where the block fails, takes out what it made and has the scene's character play and show what it did before."""
    scene, settings = context.scene, context.scene.oncue
    there = {kind: {item.as_pointer() for item in getattr(bpy.data, kind)} for kind in KINDS}
    character = settings.character
    played = _played(character)
    kept = bool(played and played[0] and played[0].use_fake_user)
    numbers = (scene.frame_end, settings.shot_end, settings.fitted_end)
    try:
        yield
    except BaseException:
        settings.character = character
        _play(character, played)
        for action in [one for one in bpy.data.actions if one.as_pointer() not in there["actions"]]:
            release_all(action)
        play_things(played[0] if played else None, None)
        if played and played[0]:
            played[0].use_fake_user = kept
        scene.frame_end, settings.shot_end, settings.fitted_end = numbers
        for kind in KINDS:
            made = [item for item in getattr(bpy.data, kind) if item.as_pointer() not in there[kind]]
            bpy.data.batch_remove(made)
        raise


@contextmanager
def kept_if_it_fails(action: bpy.types.Action) -> Iterator[None]:
    """Where the block fails, everything that used the action has it as it was before."""
    name, kept = action.name, action.copy()
    try:
        yield
    except BaseException:
        kept.use_fake_user = action.use_fake_user
        action.user_remap(kept)
        bpy.data.actions.remove(action)
        kept.name = name
        raise
    bpy.data.actions.remove(kept)


def _played(character: bpy.types.Object | None) -> tuple | None:
    data = character.animation_data if character else None
    if data is None:
        return None
    return data.action, data.action_slot if compat.SLOTTED_ACTIONS else None


def _play(character: bpy.types.Object | None, played: tuple | None) -> None:
    if character is None or _played(character) == played:
        return
    if played is None:
        character.animation_data_clear()
        return
    character.animation_data.action = played[0]
    if played[1] is not None:
        character.animation_data.action_slot = played[1]
