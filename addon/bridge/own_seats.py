# SPDX-License-Identifier: GPL-3.0-or-later
"""A task in the measure of a body of another size: its pelvis lies as much lower over the seat as it is smaller."""

from __future__ import annotations

import bpy
from mathutils import Vector

from ..body_size import scaled
from .puppet import Puppet
from .what_counts import Furniture, furniture_on_ray

#: A seat is looked for so far under a sit cue, metres; it begins so far over it, for cues that lie in their seat.
UNDER, OVER = 0.35, 0.02


def for_body(context: bpy.types.Context, task: dict, puppet: Puppet) -> dict:
    """A task or performance of the scene as the core's body sees it.

    A sit cue stands as high over its seat as the pelvis of Oncue's own character; another body's lies in proportion.
    """
    if puppet.size == 1.0:
        return task
    steps = [{**step, "cue": _seated(context, step["cue"], puppet)} for step in task.get("steps", [])]
    seated = {**task, "steps": steps} if steps else {**task, "cue": _seated(context, task["cue"], puppet)}
    return scaled(seated, 1.0 / puppet.size)


def _seated(context: bpy.types.Context, cue: dict, puppet: Puppet) -> dict:
    if cue["action_type"] != "sit":
        return cue
    x, y, z = cue["position"]
    unit = puppet.scene_scale
    above = Vector((x, y, z + OVER)) / unit
    found = furniture_on_ray(context, Furniture(context), above, Vector((0.0, 0.0, -1.0)), (UNDER + OVER) / unit)
    if found is None:
        return cue
    seat = found.z * unit
    return {**cue, "position": [x, y, seat + (z - seat) * puppet.size]}
