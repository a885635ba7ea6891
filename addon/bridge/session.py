# SPDX-License-Identifier: GPL-3.0-or-later
"""The two ends of a run: everything read from the file before it, everything written after it.

The button, `batch.py` and scripts all come through here, so that one seed gives one motion everywhere.
"""

from __future__ import annotations

import json
import math
from dataclasses import asdict, replace
from pathlib import Path

import bpy
import numpy as np

from .. import native
from ..errors import SceneError
from ..motion import Motion
from ..moving import meeting_sentences
from ..pipeline import EditRequest, LibraryChoice, Outcome, Request
from ..scene_frames import CORE_RATE, in_scene_frames
from . import armature, character_reset, compat, file_state, pins
from .action_writer import write_action
from .all_or_nothing import all_or_nothing, kept_if_it_fails
from .cue_reader import ENDS, FEET, at_first_frame, read_task, visible_cues
from .hand_reader import read_manipulations
from .moving_reader import read_moving, taken_as_it_stands
from .names import CHARACTER_KEY, REPORT_KEY
from .scene_reader import read_scene
from .scene_time import frame_rate, may_move
from .take import Take, keep_solved, solved_take
from .what_counts import things_of

#: A place that is no farther from a triangle lies on it, metres.
ON_SURFACE = 0.003
#: A cue that has moved or turned by less is where it was, metres and radians.
SAME_PLACE = 1e-3


def library_choice(scene: bpy.types.Scene) -> LibraryChoice:
    """What the scene's list names, absolute; `//` is the .blend file's folder."""
    paths = []
    for item in scene.oncue.library_paths:
        if not item.path.strip():
            continue
        if item.path.startswith("//") and not bpy.data.filepath:
            raise SceneError(f"{item.path} is relative to a file that was never saved: save it, or add the path again.")
        paths.append(str(Path(bpy.path.abspath(item.path)).resolve()))
    return LibraryChoice(tuple(paths), scene.oncue.starter.lower(), mapping_path(scene))


def mapping_path(scene: bpy.types.Scene) -> str:
    """The captures' mapping file that the scene names, absolute; empty for none. Raises SceneError."""
    path = scene.oncue.mapping.strip()
    if path.startswith("//") and not bpy.data.filepath:
        raise SceneError(f"{path} is relative to a file that was never saved: save it, or choose the mapping again.")
    return str(Path(bpy.path.abspath(path)).resolve()) if path else ""


def manifold_path(scene: bpy.types.Scene) -> str:
    """The file that the scene names, absolute; empty for the manifold that ships. Raises SceneError."""
    path = scene.oncue.manifold.strip()
    if path.startswith("//") and not bpy.data.filepath:
        raise SceneError(f"{path} is relative to a file that was never saved: save it, or choose the manifold again.")
    return str(Path(bpy.path.abspath(path)).resolve()) if path else ""


def read_request(context: bpy.types.Context, *, hands: bool = True) -> tuple[Request, list[tuple[str, str]]]:
    """All that the run needs, and (object, reason) of the meshes left out and of the cues that move by themselves.

    Without `hands` the hand cues are left out, and all else for which it goes through the frames. Raises SceneError;
    changes nothing.
    """
    native.check_loaded()
    settings, skeleton = context.scene.oncue, native.core.skeleton()
    character = armature.character_of(context.scene, skeleton)
    file_state.check(context, character, skeleton)
    task, notes, manipulations, moving = read_task(context, settings.scene_scale), [], [], ()
    library = library_choice(context.scene)
    meshes = read_scene(
        context,
        exclude=settings.exclude,
        metres_per_unit=settings.scene_scale,
        scale_confirmed=settings.scale_confirmed,
    )
    positions, triangles, owners = meshes.positions, meshes.triangles, meshes.owners
    # What goes through the frames comes last: what was moved and not keyed is back at its keys afterwards.
    if hands:
        file_state.check_over_time(context, character)
        task, notes = at_first_frame(context, task, settings.start_frame, settings.scene_scale)
        manipulations = read_manipulations(context, settings.start_frame, settings.scene_scale)
        positions, triangles, owners, moving, said = read_moving(
            context, meshes, settings.start_frame, settings.scene_scale
        )
        notes = [*notes, *said]
    else:
        notes = taken_as_it_stands(context, meshes)
    if manipulations:
        task["manipulations"] = manipulations
    overrides = read_overrides(settings.overrides)
    request = Request(
        positions,
        triangles,
        task,
        library,
        settings.preset,
        settings.seed,
        overrides,
        manifold_path(context.scene),
        settings.start_frame,
        frame_rate(context.scene),
        moving,
        owners,
        tuple(meshes.names),
    )
    return request, [*meshes.skipped, *notes]


def with_cues(context: bpy.types.Context, request: Request) -> Request:
    """A request with the cues and settings as they are now, hands aside, and its scene as it was. Raises SceneError."""
    settings = context.scene.oncue
    file_state.check_scene(context.scene)
    task, overrides = read_task(context, settings.scene_scale), read_overrides(settings.overrides)
    return replace(
        request,
        task=task,
        preset=settings.preset,
        seed=settings.seed,
        overrides=overrides,
        start_frame=settings.start_frame,
        scene_rate=frame_rate(context.scene),
    )


def read_edit(context: bpy.types.Context) -> tuple[EditRequest, Take]:
    """What Re-solve needs, and the take as it is before. Raises SceneError; changes nothing but the slot played."""
    core, settings = native.core, context.scene.oncue
    action = pins.editable_action_of(settings.character)
    file_state.check(context, settings.character, core.skeleton())
    # A renamed character plays nothing of a take that is chosen anew until it is told which slot is its own.
    compat.play_slot(settings.character)
    take = Take(context.scene, settings.character, action, core.skeleton())
    motion, keys, constraints = take.edit()
    report = report_of(action) or {}
    try:
        meshes = read_scene(context, exclude=settings.exclude, metres_per_unit=settings.scene_scale)
        positions, triangles = meshes.positions, meshes.triangles
    except SceneError:  # an edit needs nothing to walk on
        positions = triangles = None
    file_state.check_over_time(context, settings.character)
    request = EditRequest(
        motion,
        take.solved.contacts,
        keys,
        constraints,
        floor_of(report, motion, core.skeleton()),
        positions,
        triangles,
        settings.preset,
        read_overrides(settings.overrides),
        manifold_path(context.scene),
        take.solved.start_frame,
        take.solved.scene_rate,
    )
    return request, take


def reset_character(context: bpy.types.Context) -> None:
    """Resets the scene's character. Raises SceneError where it has another skeleton or cannot be edited."""
    skeleton = native.core.skeleton()
    character = armature.character_of(context.scene, skeleton)
    if character is None:
        raise SceneError("The scene has no character yet: Synthesize makes one.")
    if not character.is_editable:
        raise SceneError(f"{character.name} is linked and cannot be changed: make a library override of it.")
    character_reset.reset_character(context, character, skeleton)


def floor_of(report: dict, motion: Motion, skeleton: dict) -> float:
    """The floor that a take's person started on, world, metres."""
    start = report.get("task", {}).get("start")
    return float(start["position"][2] if start else motion.root_positions[0, 2] - skeleton["rest_hips_height"])


def write_edit(context: bpy.types.Context, take: Take, edited: object) -> tuple[int, int] | None:
    """Writes an edited motion back; the scene's frames it touched. Raises SceneError if the keys changed meanwhile."""
    settings = context.scene.oncue
    action = pins.action_of(settings.character)
    now = Take(context.scene, settings.character, action, native.core.skeleton())
    if action != take.action or not now.is_as(take):
        raise SceneError("The keys were changed while it was solving: press Re-solve again.")
    motion = Motion(np.asarray(edited.root_positions), np.asarray(edited.rotations), take.solved.motion.frame_rate)
    with kept_if_it_fails(action):
        touched = now.write(motion, np.asarray(edited.contacts))
        report = report_of(action)
        if report is not None:
            action[REPORT_KEY] = json.dumps({**report, "artist": edited.figures})
    return touched


def what_is_seen(context: bpy.types.Context) -> object:
    """Something that differs once the artist has changed what a run reads: places, what is shown, settings."""
    settings = context.scene.oncue
    things = [
        (thing.name, thing.visible_get(), np.array(thing.matrix_world, dtype=np.float32).tobytes())
        for thing in things_of(context.view_layer)
    ]
    chosen = (settings.seed, settings.start_frame, settings.preset, settings.overrides, settings.scene_scale)
    paths = tuple(item.path for item in settings.library_paths)
    named = (settings.manifold, settings.starter, settings.character, settings.exclude, context.mode)
    return hash((context.scene.name, tuple(things), chosen, paths, named))


def read_overrides(text: str) -> dict:
    """Settings that depart from the preset. Raises SceneError where the text is no JSON object."""
    try:
        overrides = json.loads(text, parse_constant=_refuse_constant) if text.strip() else {}
    except (ValueError, RecursionError) as error:
        raise SceneError(f"The overrides in the settings are not JSON: {error}.") from error
    if not isinstance(overrides, dict):
        raise SceneError('The overrides in the settings must be a JSON object such as {"ppo": {"updates": 10}}.')
    return overrides


def _refuse_constant(word: str) -> None:
    raise ValueError(f"{word} is no number that a setting can have")


def write_outcome(
    context: bpy.types.Context, request: Request, outcome: Outcome, skipped: list[tuple[str, str]]
) -> bpy.types.Action:
    """The character and its new action. The report goes with the action: each take keeps its own.

    Where anything fails the file is left as it was. Raises SceneError where the character cannot take the motion now.
    """
    scene, settings, skeleton, synthesis = (
        context.scene,
        context.scene.oncue,
        native.core.skeleton(),
        outcome.synthesis,
    )
    character, names = armature.character_of(scene, skeleton), list(skeleton["names"])
    # The artist may have changed it since the run began.
    file_state.check(context, character, skeleton)
    motion = Motion(np.asarray(synthesis.root_positions), np.asarray(synthesis.rotations), float(synthesis.frame_rate))
    # Who waits at the start stands there as the motion begins.
    begins = outcome.begins(request)
    placed = {"start_frame": begins, "metres_per_unit": settings.scene_scale}
    with all_or_nothing(context):
        if character is None:
            character = armature.make_character(context, skeleton, settings.scene_scale)
        elif character.get(CHARACTER_KEY):
            armature.give_skin(context, character, skeleton)
        settings.character = character
        action = write_action(
            context,
            character,
            names,
            motion,
            name=f"{request.task['cue']['name']} seed {request.seed}",
            report=full_report(request, outcome, skipped),
            **placed,
        )
        contacts = np.asarray(synthesis.contacts)
        keep_solved(action, solved_take(scene, character, names, motion, contacts, **placed))
    return action


def full_report(request: Request, outcome: Outcome, skipped: list[tuple[str, str]]) -> dict:
    """The core's report with what only Blender's side knows."""
    report, begins = outcome.synthesis.report, outcome.begins(request)
    named = with_objects(report["problems"], request, report)
    told = [in_scene_frames(problem, begins, request.scene_rate) for problem in named]
    meetings = meeting_sentences(outcome.passing["meetings"], begins, request.scene_rate)
    return {
        **report,
        "success": report["success"] and not meetings,
        "problems": [*meetings, *told],
        "task": request.task,
        "extension": {
            "blender_version": compat.BLENDER_VERSION,
            "preset": request.preset,
            "overrides": request.overrides,
            "manifold": request.manifold,
            "library": {**asdict(request.library), "paths": list(request.library.paths)},
            "scene_triangles": len(request.triangles) + sum(len(thing.triangles) for thing in request.moving),
            "begins": begins,
            "deepest": deepest_touch(request, report, begins),
            "moving": {"objects": list(dict.fromkeys(thing.name for thing in request.moving)), **outcome.passing},
            "skipped_objects": [{"object": name, "reason": reason} for name, reason in skipped],
            "captures": outcome.captures,
            "skipped_files": [
                {"file": capture["file"], "reason": capture["reason"] or ""}
                for capture in outcome.captures
                if not capture["clip"]
            ],
            "seconds": outcome.seconds,
        },
    }


def deepest_touch(request: Request, report: dict, begins: int) -> dict | None:
    """Which part of the body is deepest in which object, on which of the scene's frames; None where none is deep."""
    touches = ((report.get("body") or {}).get("scene") or {}).get("touches") or []
    if not touches:
        return None
    touch = touches[0]
    return {
        "part": touch["part"],
        "object": object_at(request, touch["place"]),
        "depth_cm": touch["depth_cm"],
        "frame": round(begins + touch["frame"] * request.scene_rate / CORE_RATE),
    }


def with_objects(problems: list[str], request: Request, report: dict) -> list[str]:
    """The core's sentences, which know places alone, with the objects that stand there."""
    touches = ((report.get("body") or {}).get("scene") or {}).get("touches") or []
    out = list(problems)
    for touch in touches:
        place = "what stands at {:.2f}, {:.2f}, {:.2f}".format(*touch["place"])
        if any(place in problem for problem in out) and (name := object_at(request, touch["place"])):
            out = [problem.replace(place, f"‘{name}’") for problem in out]
    return out


def object_at(request: Request, place: list[float]) -> str:
    """The object on whose surface a place lies, or an empty name where it is none that stands still."""
    point = np.asarray(place, dtype=np.float64)
    corners = request.positions[request.triangles]
    low, high = corners.min(axis=1), corners.max(axis=1)
    near = np.flatnonzero(((low - ON_SURFACE <= point) & (point <= high + ON_SURFACE)).all(axis=1))
    if not len(near) or not len(request.owners):
        return ""
    a, b, c = (corners[near, k].astype(np.float64) for k in range(3))
    normals = np.cross(b - a, c - a)
    off = np.abs(((point - a) * normals).sum(axis=1)) / np.maximum(np.linalg.norm(normals, axis=1), 1e-12)
    best = int(np.argmin(off))
    return request.names[request.owners[near[best]]] if off[best] <= ON_SURFACE else ""


def report_of(action: bpy.types.Action | None) -> dict | None:
    """The report that was kept with a take, or None."""
    text = action.get(REPORT_KEY) if action else None
    try:
        report = json.loads(text) if text else None
    except (TypeError, ValueError):
        return None
    return report if isinstance(report, dict) else None


def current_report(scene: bpy.types.Scene) -> dict | None:
    """The report of the action that the scene's character plays."""
    return report_of(current_action(scene))


def current_action(scene: bpy.types.Scene) -> bpy.types.Action | None:
    """The action that the scene's character plays."""
    character = scene.oncue.character
    data = character.animation_data if character else None
    return data.action if data else None


def belongs_to_cues(context: bpy.types.Context, report: dict) -> bool:
    """Whether the cues stand where they stood when the motion of a report was made; hands and cues that move aside."""
    made_for = report.get("task")
    if not isinstance(made_for, dict):
        return True
    settings = context.scene.oncue
    try:
        now = read_task(context, settings.scene_scale, as_drawn=True)
    except SceneError:
        return False
    animated = any(may_move(cue) for cue in visible_cues(context, "start", *ENDS, *FEET))
    return animated or all(_is_same_cue(now[kind], made_for.get(kind)) for kind in ("start", "cue"))


def _is_same_cue(now: dict, before: object) -> bool:
    if not isinstance(before, dict) or now.get("action_type") != before.get("action_type"):
        return False
    places = [[cue.get("position"), *(cue.get("feet") or [])] for cue in (now, before)]
    if [place is None for place in places[0]] != [place is None for place in places[1]]:
        return False
    near = all(np.allclose(a, b, atol=SAME_PLACE) for a, b in zip(*places, strict=True) if a is not None)
    return near and abs(math.remainder(now["yaw"] - before["yaw"], math.tau)) < SAME_PLACE


def problems_of(report: dict) -> list[str]:
    """In words what went wrong or was left out; empty when nothing was."""
    extension = report.get("extension", {})
    notes = [note["reason"] for note in extension.get("skipped_objects", [])]
    files = extension.get("skipped_files", [])
    if files:
        first = files[0]
        more = f" and {len(files) - 1} more" if len(files) > 1 else ""
        notes.append(f"{Path(first['file']).name}{more} could not be read: {first['reason']}")
    return [*report.get("problems", []), *notes]
