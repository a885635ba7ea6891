# SPDX-License-Identifier: GPL-3.0-or-later
"""Hand cues → φ_M = {q_j^t}: where the hands are to be, frame by frame (LAMA, section 3.1 and supplementary).

What a hand holds plays at its frames of the scene, however long the motion becomes for it: the core puts a path on the
very frames it is given for, and holds the body still before, meanwhile and after.

A hand cue is an empty. Its way is whatever Blender evaluates: its own keys, drivers, constraints, the hinge that it
hangs on, the vertex that it is parented to.
"""

from __future__ import annotations

import math

import bpy
import numpy as np

from ..errors import SceneError
from ..scene_frames import CORE_RATE
from .names import CUE_KEY, FIRST_FRAME_KEY, LAST_FRAME_KEY
from .scene_time import current_frame_kept, frame_rate, show
from .shown_cues import HANDS, visible_cues

#: Kind of the cue → the hand that follows it.
HAND = {"left_hand": "left", "right_hand": "right", "both_hands": "both"}
#: Longer ranges are a slip of the keyboard, seconds.
LONGEST = 120.0


def read_manipulations(
    context: bpy.types.Context, start_frame: int, metres_per_unit: float = 1.0, rate: float | None = None
) -> list[dict]:
    """One entry a visible hand cue: its name, the hand, the first core frame (30 Hz from `start_frame` on) and the
    path from there: a point a frame, world, metres. `rate`: the scene's frames in a second of the core's, where that
    is another than the scene's own.

    Goes through the frames and comes back to the current one. Raises SceneError naming the cue whose range or place
    is amiss.
    """
    cues = visible_cues(context, *HANDS)
    if not cues:
        return []
    scene = context.scene
    rate = frame_rate(scene) if rate is None else rate
    spans = {cue.name: core_frames(scene, cue, start_frame, rate) for cue in cues}
    paths: dict[str, list] = {cue.name: [] for cue in cues}
    per_frame = rate / CORE_RATE
    with current_frame_kept(scene):
        for core_frame in sorted({frame for span in spans.values() for frame in span}):
            show(scene, start_frame + core_frame * per_frame)
            depsgraph = context.evaluated_depsgraph_get()
            for cue in cues:
                if core_frame in spans[cue.name]:
                    paths[cue.name].append(cue.evaluated_get(depsgraph).matrix_world.translation[:])
    manipulations = []
    for cue in cues:
        path = np.array(paths[cue.name], dtype=np.float64) * metres_per_unit
        if not np.isfinite(path).all():
            raise SceneError(f"{cue.name} stands at a place that is not a number: look at its keys and constraints.")
        begin = spans[cue.name].start
        manipulations.append(
            {"name": cue.name, "hand": HAND[cue[CUE_KEY]], "first_frame": begin, "path": path.tolist()}
        )
    return manipulations


def give_hands(task: dict, manipulations: list[dict]) -> None:
    """Puts hands' cues into a task: among several cues each is followed at the one that its path begins nearest to."""
    for hand in manipulations:
        x, y, _ = hand["path"][0]
        beside = [(math.dist(step["cue"]["position"][:2], (x, y)), step) for step in task.get("steps", [])]
        one = min(beside, key=lambda found: found[0])[1] if beside else task
        one.setdefault("manipulations", []).append(hand)


def core_frames(scene: bpy.types.Scene, cue: bpy.types.Object, start_frame: int, rate: float | None = None) -> range:
    """The frames of the core that a hand cue's range needs: between them lies every frame of the range.

    Where the rates do not divide, a frame of the scene is between two of the core's: the hand is on its path at both.
    Raises SceneError for a range that is none.
    """
    first, last = cue.get(FIRST_FRAME_KEY), cue.get(LAST_FRAME_KEY)
    if not isinstance(first, int | float) or not isinstance(last, int | float):
        raise SceneError(f"{cue.name} does not say from which frame to which the hand follows it: place it again.")
    if last < first:
        raise SceneError(f"{cue.name} ends at frame {last:g}, before it begins at {first:g}: swap them.")
    if first < start_frame:
        raise SceneError(
            f"{cue.name} begins at frame {first:g}, before the motion's first frame {start_frame}: move its range."
        )
    rate = frame_rate(scene) if rate is None else rate
    if last - first > LONGEST * rate:
        raise SceneError(f"{cue.name} lasts {(last - first) / rate:.0f} s, more than {LONGEST:.0f}: shorten its range.")
    from_core, to_core = ((frame - start_frame) * CORE_RATE / rate for frame in (first, last))
    return range(math.floor(from_core + 1e-6), math.ceil(to_core - 1e-6) + 1)
