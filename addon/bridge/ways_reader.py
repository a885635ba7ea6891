# SPDX-License-Identifier: GPL-3.0-or-later
"""What the ways of people are found by: the scene, starts and cues as they stand now."""

from __future__ import annotations

from dataclasses import replace

import bpy

from .. import native
from ..pipeline import Request
from . import armature, file_state, own_seats, people
from .cue_reader import check_nobodys, read_task
from .puppet import puppet_of
from .scene_reader import read_scene
from .session import overrides_of


def read_ways(context: bpy.types.Context, before: list[Request] | None = None) -> list[Request]:
    """One request a person, without what a motion needs besides; what moves is taken as it stands now.

    With `before` the meshes are those of that reading. Goes through no frames. Raises SceneError.
    """
    native.require()
    scene, settings = context.scene, context.scene.oncue
    file_state.check_scene(scene)
    found = people.cast(context)
    if found:
        check_nobodys(context)
        starts = [(person.start, person.character) for person in found]
    else:
        starts = [(None, armature.find_character(scene, native.core.skeleton()))]
    puppets = [puppet_of(character, scene) for _, character in starts]
    tasks = [read_task(context, settings.scene_scale, start=start) for start, _ in starts]
    if before is None:
        meshes = read_scene(
            context,
            exclude=settings.exclude,
            metres_per_unit=puppets[0].metres_per_unit,
            scale_confirmed=settings.scale_confirmed,
            cast=tuple(character for _, character in starts if character is not None),
        )
        whole = Request(meshes.positions, meshes.triangles, tasks[0], size=puppets[0].size)
    else:
        whole = before[0]
    whole = replace(whole, preset=settings.preset, overrides=overrides_of(settings))
    return [
        replace(whole, task=own_seats.for_body(context, task, puppet), person=start.name if start else "")
        for (start, _), puppet, task in zip(starts, puppets, tasks, strict=True)
    ]
