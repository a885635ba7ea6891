# SPDX-License-Identifier: GPL-3.0-or-later
"""The visible cues of the scene → the core's task: g_init and φ_A (LAMA, section 3.1)."""

from __future__ import annotations

import math

import bpy
from mathutils import Vector

from ..errors import SceneError
from ..scene_frames import CORE_RATE
from .cue_objects import forward_of
from .leaves import leaf_told, read_mesh, read_open, said_by
from .names import AT_FRAME_KEY, CUE_KEY, HOLD_KEY
from .scene_time import current_frame_kept, frame_rate, may_move, moving, show
from .shown_cues import (
    FEET,
    LOOK,
    OPEN,
    ORDERED,
    PASS,
    PLAYED,
    TAKE,
    THINGS,
    end_cues,
    ordered_cues,
    person_of,
    visible_cues,
)
from .things import read_put, read_take, read_thing, thing_of

#: Longer nobody stays, seconds.
LONGEST_HOLD = 600.0
#: A facing steeper than this says nothing about a direction on the floor: sine of 80°.
STEEPEST = math.sin(math.radians(80.0))


def read_task(
    context: bpy.types.Context,
    metres_per_unit: float = 1.0,
    *,
    as_drawn: bool = False,
    start: bpy.types.Object | None = None,
) -> dict:
    """The task as the core takes it, of several sit and stop cues, or one that is to be reached at a time, the
    performance: metres, radians, seconds from the motion's first frame.

    Raises SceneError naming the cue that is missing, too many, or leads nowhere. `as_drawn`: as the view shows it now,
    without evaluating anything. `start`: of several people's, whose performance it is, of however many cues.
    """
    several = start is not None
    start = start or _only_one(
        visible_cues(context, "start"),
        "There is no Start cue: place one where the character begins (Oncue tab, Start).",
        "There are {count} Start cues ({names}): hide or delete all but one.",
    )
    ends = end_cues(context, start)
    if not ends and several:
        raise SceneError(
            f"{start.name} has no Sit or Stop cue of its own: select it and place one (Oncue tab, Sit or Stop), "
            "or hide it."
        )
    if not ends:
        raise SceneError(
            "There is no Sit or Stop cue: place one where the character is to end (Oncue tab, Sit or Stop)."
        )
    depsgraph = None if as_drawn else context.evaluated_depsgraph_get()
    begins = {"name": start.name, **_placement(start, depsgraph, metres_per_unit)}
    steps: list[dict] = []
    passes: list[dict] = []
    things: dict[str, dict] = {}
    leaves: dict[str, dict] = {}
    looks: list[dict] = []
    comes = 0
    alone = len(ends) == 1 and not several
    times = _times_of(context, ends)
    for cue in ordered_cues(context, start):
        if cue[CUE_KEY] == LOOK:
            holds = {"hold_seconds": seconds} if (seconds := _hold_of(cue)) else {}
            path = [_position(cue, depsgraph, metres_per_unit)]
            looks.append({"name": cue.name, "path": path, "after": comes, **holds})
            continue
        if cue[CUE_KEY] in THINGS:
            _read_thing(cue, depsgraph, metres_per_unit, steps, leaves if cue[CUE_KEY] == OPEN else things)
            continue
        comes += 1
        if cue[CUE_KEY] == PASS:
            passes.append({"name": cue.name, "position": _position(cue, depsgraph, metres_per_unit)})
            continue
        asked = {
            "name": cue.name,
            "action_type": cue[CUE_KEY],
            **_placement(cue, depsgraph, metres_per_unit),
            "feet": [_foot(context, depsgraph, kind, cue, alone, metres_per_unit) for kind in FEET],
        }
        # They are passed on the way to the next cue at which the person stays.
        at = {"at_seconds": times[cue.name]} if cue.name in times else {}
        steps.append({"cue": asked, "hold_seconds": _hold_of(cue), **at, **({"passes": passes} if passes else {})})
        passes = []
    if passes:
        raise SceneError(
            f"{passes[-1]['name']} is a Pass cue that nothing follows: place a Sit or Stop cue after it, or move it up "
            "in the list."
        )
    if len(steps) == 1 and not several and not times and not looks and not things and not leaves:
        return {"start": begins, **{name: part for name, part in steps[0].items() if name != "hold_seconds"}}
    besides = {"things": list(things.values()), "leaves": list(leaves.values()), "looks": looks}
    return {"start": begins, "steps": steps, **{name: part for name, part in besides.items() if part}}


def _read_thing(cue: bpy.types.Object, depsgraph, metres_per_unit: float, steps: list[dict], things: dict) -> None:
    """Has a thing be taken, put down or opened at the last of the steps; `things` has each that is by its name."""
    if not steps:
        raise SceneError(
            f"{cue.name} comes before any Sit or Stop cue, and things are taken, put down and opened where the person "
            "stays: place a Stop cue before it, or move it down in the list."
        )
    thing = thing_of(cue)
    if cue[CUE_KEY] == OPEN:
        leaf = read_mesh(cue, thing, depsgraph, metres_per_unit)
        opens = said_by(cue, leaf, Vector(steps[-1]["cue"]["position"]))
        told = leaf_told(leaf, opens)
        known = things.setdefault(thing.name, told)
        if known["hung"] != told["hung"]:
            raise SceneError(
                f"{cue.name} opens {thing.name} about or along another axis than a cue before it: give both the same."
            )
        read = read_open(cue, leaf, opens, metres_per_unit)
    elif cue[CUE_KEY] == TAKE:
        if thing.name not in things:
            things[thing.name] = read_thing(cue, thing, depsgraph, metres_per_unit)
        read = read_take(cue, thing, depsgraph, metres_per_unit)
    else:
        read = read_put(cue, thing, _placement(cue, depsgraph, metres_per_unit))
    steps[-1].setdefault("things", []).append(read)


def hold_seconds(context: bpy.types.Context) -> float | None:
    """How long the visible sit or stop cue asks the person to stay; none where it does not say. Raises SceneError.

    Of several each has its own, in the performance.
    """
    ends = end_cues(context)
    return _hold_of(ends[0]) if len(ends) == 1 else None


def _times_of(context: bpy.types.Context, ends: list[bpy.types.Object]) -> dict[str, float]:
    """When cues are to be reached, seconds from the motion's first frame, by name; none of those that do not say.

    Raises SceneError for frames that run backwards.
    """
    scene, begins = context.scene, context.scene.oncue.start_frame
    times: dict[str, float] = {}
    before: tuple[str, float] | None = None
    for cue in ends:
        frame = cue.get(AT_FRAME_KEY)
        if frame is None:
            continue
        if not isinstance(frame, int | float) or isinstance(frame, bool) or not math.isfinite(frame):
            raise SceneError(f"{cue.name} is to be reached on a frame that is no number: give it one, or none.")
        if frame <= begins:
            raise SceneError(
                f"{cue.name} is to be reached on frame {frame:g}, and the motion begins on frame {begins}: give it a "
                "later frame."
            )
        if before is not None and frame <= before[1]:
            raise SceneError(
                f"{cue.name} is to be reached on frame {frame:g}, and {before[0]} before it on frame {before[1]:g}: "
                "give it a later frame, or change their order."
            )
        before = cue.name, frame
        times[cue.name] = (frame - begins) / frame_rate(scene)
    return times


def _hold_of(cue: bpy.types.Object) -> float | None:
    """How long a cue asks the person to stay; none where it does not say. Raises SceneError."""
    seconds = cue.get(HOLD_KEY)
    if seconds is None:
        return None
    if not isinstance(seconds, int | float) or not 0.0 <= seconds <= LONGEST_HOLD:
        raise SceneError(f"{cue.name} asks the person to stay for {seconds} s: give 0 to {LONGEST_HOLD:.0f}.")
    return float(seconds)


def at_first_frame(
    context: bpy.types.Context,
    task: dict,
    first_frame: int,
    metres_per_unit: float = 1.0,
    start: bpy.types.Object | None = None,
) -> tuple[dict, list[tuple[str, str]]]:
    """A task that was just read, with its cues as they stand at `first_frame` where some move by themselves; and (cue,
    sentence) of each of these.

    Where the playhead stands then makes no difference. It may go through the frames. `start`: as of `read_task`.
    """
    shown = visible_cues(context, "start", *PLAYED, *THINGS, *FEET)
    if start is not None:
        own = [start, *ordered_cues(context, start)]
        shown = [cue for cue in shown if cue in own or cue.parent in own]
    animated = [cue for cue in shown if may_move(cue)]
    moved = moving(context, animated, first_frame) if animated else []
    if not moved:
        return task, []
    scene = context.scene
    if (scene.frame_current, scene.frame_subframe) != (first_frame, 0.0):
        with current_frame_kept(scene):
            scene.frame_set(first_frame)
            task = read_task(context, metres_per_unit, start=start)
    said = "{} is animated: it was read as it stands at frame {}, where the motion begins."
    # What is taken or opened goes as the take has it that plays, and its cue with it.
    own = [cue for cue in moved if cue[CUE_KEY] not in (TAKE, OPEN)]
    return task, [(cue.name, said.format(cue.name, first_frame)) for cue in own]


def with_moving_looks(
    context: bpy.types.Context,
    task: dict,
    first_frame: int,
    metres_per_unit: float = 1.0,
    rate: float | None = None,
) -> dict:
    """A task that was just read, with the way of each look cue that moves: a place a frame (30 Hz) from `first_frame`
    to the scene's end, after which it is taken to stay. `rate`: the scene's frames in a second of the core's.

    Goes through the frames and comes back. Raises SceneError for a place that is not a number.
    """
    named = {look["name"] for look in task.get("looks", [])}
    moved = [cue for cue in visible_cues(context, LOOK) if cue.name in named and may_move(cue)]
    if not moved:
        return task
    scene = context.scene
    per_frame = (frame_rate(scene) if rate is None else rate) / CORE_RATE
    frames = min(max(math.ceil((scene.frame_end - first_frame) / per_frame), 0), round(LONGEST_HOLD * CORE_RATE)) + 1
    paths: dict[str, list] = {cue.name: [] for cue in moved}
    with current_frame_kept(scene):
        for frame in range(frames):
            show(scene, first_frame + frame * per_frame)
            depsgraph = context.evaluated_depsgraph_get()
            for cue in moved:
                paths[cue.name].append(_position(cue, depsgraph, metres_per_unit))
    looks = [{**look, "path": paths.get(look["name"], look["path"])} for look in task["looks"]]
    return {**task, "looks": looks}


def check_nobodys(context: bpy.types.Context) -> None:
    """Raises SceneError for a cue of nobody, where several people start."""
    starts = visible_cues(context, "start")
    for cue in visible_cues(context, *ORDERED):
        if person_of(context, cue, starts) is None:
            raise SceneError(
                f"{cue.name} is a cue of nobody, and {len(starts)} people start: select it, and last the Start cue "
                "of its person, and press Give to Person, or hide it."
            )


def _only_one(cues: list[bpy.types.Object], none: str, many: str) -> bpy.types.Object:
    if not cues:
        raise SceneError(none)
    if len(cues) > 1:
        raise SceneError(many.format(count=len(cues), names=", ".join(c.name for c in cues)))
    return cues[0]


def _foot(
    context, depsgraph, kind: str, cue: bpy.types.Object, alone: bool, metres_per_unit: float
) -> list[float] | None:
    """The foot cue that belongs to `cue`: its child, or, where it is `alone`, one without a parent."""
    feet = [foot for foot in visible_cues(context, kind) if foot.parent == cue or (alone and foot.parent is None)]
    feet = [foot for foot in feet if foot.parent == cue] or feet
    if not feet:
        return None
    if len(feet) > 1:
        names = ", ".join(foot.name for foot in feet)
        raise SceneError(f"{cue.name} has {len(feet)} cues for one foot ({names}): keep one.")
    return _position(feet[0], depsgraph, metres_per_unit)


def _placement(cue: bpy.types.Object, depsgraph, metres_per_unit: float) -> dict:
    forward = forward_of(_matrix(cue, depsgraph))
    if not forward.length > 0.5 or abs(forward.z) > STEEPEST:
        raise SceneError(
            f"{cue.name} faces straight up or down, or has no size: turn it so that its -Y axis lies level."
        )
    return {
        "position": _position(cue, depsgraph, metres_per_unit),
        "yaw": math.remainder(math.atan2(forward.y, forward.x) + math.pi / 2, math.tau),
    }


def _matrix(cue: bpy.types.Object, depsgraph):
    return (cue.evaluated_get(depsgraph) if depsgraph is not None else cue).matrix_world


def _position(cue: bpy.types.Object, depsgraph, metres_per_unit: float) -> list[float]:
    position = [c * metres_per_unit for c in _matrix(cue, depsgraph).translation]
    if not all(math.isfinite(c) for c in position):
        raise SceneError(f"{cue.name} stands at a place that is not a number: reset its location.")
    return position
