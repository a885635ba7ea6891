# SPDX-License-Identifier: GPL-3.0-or-later
"""The people of a shot: who starts where, and whose armature moves."""

from __future__ import annotations

from dataclasses import dataclass

import bpy

from .. import native
from ..errors import SceneError
from . import armature
from .names import ACTS_KEY, CUE_KEY
from .shown_cues import several_starts


@dataclass(frozen=True)
class Person:
    """One of several people."""

    start: bpy.types.Object
    #: None where Oncue's own is still to be made.
    character: bpy.types.Object | None


def cast(context: bpy.types.Context) -> list[Person]:
    """The people of the shot where several start, by their starts' names; none where one does, or nobody.

    A character that no start names, as that of a person who was alone, is the first one's who has none.
    """
    starts = several_starts(context)
    if not starts:
        return []
    # A copied start names the character of the one that it was copied from: of two the first keeps it.
    claims = {acts(context.scene, start): start for start in reversed(_all_starts(context.scene))}
    found = {start: character for character, start in claims.items() if character is not None}
    free = None if native.MISSING else armature.find_character(context.scene, native.core.skeleton())
    without = [start for start in starts if start not in found]
    if free is not None and free not in claims and without:
        found[without[0]] = free
    return [Person(start, found.get(start)) for start in starts]


def acts(scene: bpy.types.Scene, start: bpy.types.Object) -> bpy.types.Object | None:
    """The armature that a start names, where it is one of the scene's."""
    character = start.get(ACTS_KEY)
    if not isinstance(character, bpy.types.Object) or character.type != "ARMATURE":
        return None
    return character if scene.objects.get(character.name) == character else None


def person_named(context: bpy.types.Context, name: str) -> Person:
    """Raises SceneError where nobody of the shot starts at a cue of this name."""
    found = next((person for person in cast(context) if person.start.name == name), None)
    if found is None:
        raise SceneError(f"Nobody of several people starts at {name} any more: synthesize again.")
    return found


def choose_character(start: bpy.types.Object, character: bpy.types.Object) -> None:
    """Has the person who starts there act by this armature. Raises SceneError where the start is linked."""
    if not start.is_editable:
        raise SceneError(f"{start.name} is linked and cannot be given a character.")
    start[ACTS_KEY] = character


def _all_starts(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    return sorted((thing for thing in scene.objects if thing.get(CUE_KEY) == "start"), key=lambda thing: thing.name)
