# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene's time: its rate, its current frame, and what moves in it by itself."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager

import bpy
import numpy as np

from . import compat

#: Frames that are looked at to see whether a thing moves, seconds after the first.
LOOKED_AT = (0.0, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0)
#: How far the entries of a world matrix may differ for a thing that stands still.
STANDS_STILL = 1e-4


def show(scene: bpy.types.Scene, frame: float) -> None:
    """Goes to a frame that may lie between two."""
    whole = math.floor(frame + 1e-6)
    scene.frame_set(whole, subframe=min(max(frame - whole, 0.0), 0.999999))


def frame_rate(scene: bpy.types.Scene) -> float:
    return scene.render.fps / scene.render.fps_base


@contextmanager
def current_frame_kept(scene: bpy.types.Scene) -> Iterator[None]:
    """Afterwards the scene stands at the frame at which it stood before."""
    frame, subframe = scene.frame_current, scene.frame_subframe
    try:
        yield
    finally:
        scene.frame_set(frame, subframe=subframe)


def may_move(thing: bpy.types.Object, *, own_action: bool = True) -> bool:
    """Whether something animates where an object stands: itself, what it hangs on, or constraints. Cheap; may be wrong
    only where it says yes."""
    seen = set()
    todo = [(thing, own_action)]
    while todo:
        one, with_action = todo.pop()
        if one in seen:
            continue
        seen.add(one)
        data = one.animation_data
        if data is not None:
            tracks = data.use_nla and any(not track.mute and len(track.strips) for track in data.nla_tracks)
            played = compat.action_curves(data.action, one) if with_action and data.action is not None else []
            if tracks or len(data.drivers) or any(map(_varies, played)):
                return True
        constraints = [c for c in one.constraints if not c.mute and c.influence > 0.0]
        targets = [getattr(c, "target", None) for c in constraints]
        if any(target is None for target in targets):
            return True
        if one.parent is not None and one.parent_type in {"VERTEX", "VERTEX_3"}:
            return True
        todo += [(other, True) for other in [one.parent, *targets] if other is not None]
    return False


def _varies(curve: bpy.types.FCurve) -> bool:
    values = [point.co.y for point in curve.keyframe_points]
    return bool(curve.modifiers) or (len(values) > 1 and max(values) - min(values) > 1e-6)


def moving(context: bpy.types.Context, things: list[bpy.types.Object], first_frame: int) -> list[bpy.types.Object]:
    """Those of `things` that stand elsewhere at some of the frames looked at than at the first.

    Goes through the frames and comes back to the current one.
    """
    scene, seen = context.scene, []
    with current_frame_kept(scene):
        for seconds in LOOKED_AT:
            scene.frame_set(first_frame + math.floor(seconds * frame_rate(scene)))
            depsgraph = context.evaluated_depsgraph_get()
            seen.append([np.array(thing.evaluated_get(depsgraph).matrix_world) for thing in things])
    return [
        thing
        for k, thing in enumerate(things)
        if any(not np.allclose(places[k], seen[0][k], atol=STANDS_STILL) for places in seen)
    ]
