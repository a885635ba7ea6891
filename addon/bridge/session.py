# SPDX-License-Identifier: GPL-3.0-or-later
"""The two ends of a run: everything read from the file before it, everything written after it.

The button, `batch.py` and scripts all come through here, so that one seed gives one motion everywhere.
"""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix

from .. import native
from ..body_size import clock, report_in_scene, scaled, sentence_in_scene
from ..errors import SceneError
from ..motion import Motion, resample
from ..moving import meeting_sentences
from ..pipeline import (
    EditOutcome,
    EditRequest,
    LibraryChoice,
    Outcome,
    Request,
    cues_of,
    hands_of,
    moments_of,
    passes_of,
    times_of,
)
from ..scene_frames import CORE_RATE, in_scene_frames
from . import armature, character_reset, compat, file_state, own_rig, own_seats, people, pins, rigify, root_motion
from .action_writer import fit_end, write_action
from .all_or_nothing import all_or_nothing, kept_if_it_fails
from .cue_reader import at_first_frame, check_nobodys, hold_seconds, read_task, with_moving_looks
from .hand_reader import core_frames, give_hands, read_manipulations
from .moving_reader import read_moving, taken_as_it_stands
from .names import ACTS_KEY, CHARACTER_KEY, LIVE_KEY, REPORT_KEY, TAKE_OF_KEY
from .puppet import Puppet, is_own_skeleton, puppet_of
from .scene_reader import read_scene
from .scene_time import frame_rate, may_move
from .second_blender import second_blender
from .shown_cues import FEET, HANDS, ORDERED, visible_cues
from .solved import keep_solved, solved_take
from .take import Take
from .things import play_things, write_things
from .what_counts import things_of

#: A place that is no farther from a triangle lies on it, metres.
ON_SURFACE = 0.003
#: The seat under a cue is looked for so far down, metres.
UNDER_PELVIS = 0.35
#: A cue that has moved or turned by less is where it was, metres and radians.
SAME_PLACE = 1e-3
#: A body that follows its controls is where it is to be, but for this.
FOLLOWS_CM = 0.5
#: A body is of the same size, in sizes of the core's.
SAME_SIZE = 1e-4


def library_choice(scene: bpy.types.Scene) -> LibraryChoice:
    """What the scene's list names, absolute; `//` is the .blend file's folder."""
    paths = []
    for item in scene.oncue.library_paths:
        if not item.path.strip():
            continue
        if item.path.startswith("//") and not bpy.data.filepath:
            raise SceneError(f"{item.path} is relative to a file that was never saved: save it, or add the path again.")
        paths.append(str(Path(bpy.path.abspath(item.path)).resolve()))
    return LibraryChoice(tuple(paths), scene.oncue.starter.lower(), mapping_path(scene), second_blender())


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
    native.require()
    settings = context.scene.oncue
    character = armature.find_character(context.scene, native.core.skeleton())
    armature.check_chosen(context.scene)
    puppet = file_state.check(context, character)
    root_motion.check(puppet, settings.root_motion)
    task, notes, manipulations, moving = read_task(context, settings.scene_scale), [], [], ()
    if not hands:
        _one_cue(task)
    library = library_choice(context.scene)
    meshes = read_scene(
        context,
        exclude=settings.exclude,
        metres_per_unit=puppet.metres_per_unit,
        scale_confirmed=settings.scale_confirmed,
    )
    positions, triangles, owners = meshes.positions, meshes.triangles, meshes.owners
    # What goes through the frames comes last: what was moved and not keyed is back at its keys afterwards.
    if hands:
        file_state.check_over_time(context, character)
        task, notes = at_first_frame(context, task, settings.start_frame, settings.scene_scale)
        rate = puppet.frame_rate(context.scene)
        task = with_moving_looks(context, task, settings.start_frame, settings.scene_scale, rate)
        manipulations = read_manipulations(context, settings.start_frame, settings.scene_scale, rate)
        positions, triangles, owners, moving, said = read_moving(
            context, meshes, settings.start_frame, puppet.metres_per_unit, rate
        )
        notes = [*notes, *said]
    else:
        notes = taken_as_it_stands(context, meshes)
    if manipulations:
        give_hands(task, manipulations)
    request = Request(
        positions,
        triangles,
        own_seats.for_body(context, task, puppet),
        library,
        settings.preset,
        settings.seed,
        wishes_of(context, puppet.size),
        manifold_path(context.scene),
        settings.start_frame,
        puppet.frame_rate(context.scene),
        moving,
        owners,
        tuple(meshes.names),
        puppet.size,
        task,
    )
    notes = [*notes, *file_state.remarks(context, character)]
    if puppet.rig is not None and (said := own_rig.girth_remark(character, puppet.rig)):
        notes.append((character.name, said))
    if puppet.rig is not None and (said := own_rig.turning_remark(character, puppet.bones)):
        notes.append((character.name, said))
    return request, [*meshes.skipped, *notes]


def read_shot(context: bpy.types.Context) -> tuple[list[Request], list[tuple[str, str]]]:
    """The same of each of several people who start, by their starts' names; of one alone what `read_request` gives.

    They play in one scene, without one another. Raises SceneError; changes nothing.
    """
    native.require()
    found = people.cast(context)
    if not found:
        request, notes = read_request(context)
        return [request], notes
    settings = context.scene.oncue
    scale, first_frame = settings.scene_scale, settings.start_frame
    armature.check_chosen(context.scene)
    check_nobodys(context)
    puppets = [file_state.check(context, person.character) for person in found]
    size, sizes = puppets[0].size, [puppet.size for puppet in puppets]
    if max(sizes) - min(sizes) > SAME_SIZE:
        raise SceneError(
            f"The characters of {found[0].start.name} and the others are of different sizes ({min(sizes):.2f} to "
            f"{max(sizes):.2f} times Oncue's own), and people in one shot are of one size: hide the starts of those "
            "who are not."
        )
    if hands := visible_cues(context, *HANDS):
        raise SceneError(
            f"Hands follow their cues ({', '.join(hand.name for hand in hands)}) where one person starts, and "
            f"{len(found)} do: hide the hand cues, or all Start cues but one."
        )
    tasks = [read_task(context, scale, start=person.start) for person in found]
    if opened := [leaf["name"] for task in tasks for leaf in task.get("leaves", [])]:
        raise SceneError(
            f"Hands open {', '.join(opened)} where one person starts, and {len(found)} do: hide the Open cues, or all "
            "Start cues but one."
        )
    library = library_choice(context.scene)
    characters = tuple(person.character for person in found if person.character is not None)
    meshes = read_scene(
        context,
        exclude=settings.exclude,
        metres_per_unit=puppets[0].metres_per_unit,
        scale_confirmed=settings.scale_confirmed,
        cast=characters,
    )
    notes: list[tuple[str, str]] = []
    rate = puppets[0].frame_rate(context.scene)
    for at, person in enumerate(found):
        file_state.check_over_time(context, person.character)
        tasks[at], said = at_first_frame(context, tasks[at], first_frame, scale, person.start)
        tasks[at] = with_moving_looks(context, tasks[at], first_frame, scale, rate)
        notes += said
    positions, triangles, owners, moving, said = read_moving(
        context, meshes, first_frame, puppets[0].metres_per_unit, rate
    )
    requests = [
        Request(
            positions,
            triangles,
            own_seats.for_body(context, task, puppet),
            library,
            settings.preset,
            settings.seed,
            overrides_of(settings),
            manifold_path(context.scene),
            first_frame,
            rate,
            moving,
            owners,
            tuple(meshes.names),
            size,
            task,
            person.start.name,
        )
        for person, puppet, task in zip(found, puppets, tasks, strict=True)
    ]
    notes += said
    for person, puppet in zip(found, puppets, strict=True):
        notes += file_state.remarks(context, person.character)
        if puppet.rig is not None and (remark := own_rig.girth_remark(person.character, puppet.rig)):
            notes.append((person.character.name, remark))
    return requests, list(dict.fromkeys([*meshes.skipped, *notes]))


def with_cues(context: bpy.types.Context, request: Request) -> Request:
    """A request with the cues and settings as they are now, hands aside, and its scene as it was. Raises SceneError."""
    settings = context.scene.oncue
    file_state.check_scene(context.scene)
    puppet = puppet_of(settings.character, context.scene)
    task = _one_cue(read_task(context, settings.scene_scale))
    return replace(
        request,
        task=own_seats.for_body(context, task, puppet),
        preset=settings.preset,
        seed=settings.seed,
        overrides=wishes_of(context, puppet.size),
        start_frame=settings.start_frame,
        scene_rate=puppet.frame_rate(context.scene),
        asked=task,
    )


def _one_cue(task: dict) -> dict:
    """A task that cues can be followed for. Raises SceneError for several, for times, waypoints, things and looks."""
    if things := task.get("things"):
        raise SceneError(
            f"Follow Cues has nothing taken, and {things[0]['name']} is: hide the Take and Put cues, or press "
            "Synthesize."
        )
    if leaves := task.get("leaves"):
        raise SceneError(
            f"Follow Cues has nothing opened, and {leaves[0]['name']} is: hide the Open cues, or press Synthesize."
        )
    if looks := task.get("looks"):
        raise SceneError(
            f"Follow Cues plays no Look cue, and there is {looks[0]['name']}: hide it, or press Synthesize."
        )
    if "steps" in task and len(task["steps"]) == 1:
        timed = cues_of(task)[0]["name"]
        raise SceneError(
            f"Follow Cues plays no cue that is to be reached on a frame, as {timed} is: take that off, or press "
            "Synthesize."
        )
    if "steps" in task:
        raise SceneError(
            f"Follow Cues plays one Sit or Stop cue, and there are {len(task['steps'])}: hide all but one, or press "
            "Synthesize."
        )
    if passes := task.get("passes"):
        raise SceneError(
            f"Follow Cues plays no Pass cue, and there is {passes[0]['name']}: hide it, or press Synthesize."
        )
    return task


def read_edit(context: bpy.types.Context) -> tuple[EditRequest, Take, list[tuple[str, str]]]:
    """What Re-solve needs, the take as it is before, and (object, reason) of what cannot be read as it moves. Raises
    SceneError; changes nothing but the slot played.
    """
    core, settings = native.core, context.scene.oncue
    action = pins.editable_action_of(settings.character)
    puppet = file_state.check(context, settings.character)
    # A renamed character plays nothing of a take that is chosen anew until it is told which slot is its own.
    compat.play_slot(settings.character)
    take = Take(context.scene, settings.character, action, core.skeleton())
    motion, keys, constraints = take.edit()
    report = report_of(action) or {}
    task, moments = _made_for(report)
    library, library_checksum = _made_of(report)
    request = EditRequest(
        motion,
        take.solved.contacts,
        keys,
        constraints,
        floor_of(report, motion, core.skeleton()),
        preset=settings.preset,
        overrides=overrides_of(settings),
        manifold=manifold_path(context.scene),
        start_frame=take.solved.start_frame,
        scene_rate=puppet.frame_rate(context.scene),
        size=puppet.size,
        task=task,
        moments=moments,
        library=library,
        library_checksum=library_checksum,
    )
    try:
        meshes = read_scene(context, exclude=settings.exclude, metres_per_unit=puppet.metres_per_unit)
    except SceneError:  # an edit needs nothing to walk on
        meshes = None
    file_state.check_over_time(context, settings.character)
    if meshes is None:
        return request, take, []
    rate = puppet.frame_rate(context.scene)
    read = read_moving(context, meshes, take.solved.start_frame, puppet.metres_per_unit, rate)
    positions, triangles, owners, moving, said = read
    seen = {"positions": positions, "triangles": triangles, "owners": owners, "names": tuple(meshes.names)}
    return replace(request, **seen, moving=moving), take, [*meshes.skipped, *said]


def _made_for(report: dict) -> tuple[dict | None, list[dict]]:
    """What the motion of a report was asked for, and when what happens in it."""
    try:
        # What the core was asked for is in the measure of its body.
        body = report.get("extension", {}).get("body")
        task, moments = body["task"] if body else report["task"], moments_of({"action_from": None, **report})
        return task, [{name: None if at is None else int(at) for name, at in one.items()} for one in moments]
    except (LookupError, TypeError, ValueError, AttributeError):
        return None, []


def _made_of(report: dict) -> tuple[LibraryChoice | None, str]:
    """The library of a report and its checksum; None where somebody changed what it says."""
    try:
        told, checksum = report["extension"]["library"], report["library_checksum"]
        paths, starter, mapping = told["paths"], told["starter"], told["mapping"]
    except (LookupError, TypeError):
        return None, ""
    if not isinstance(paths, list) or not all(isinstance(word, str) for word in (*paths, starter, mapping, checksum)):
        return None, ""
    return LibraryChoice(tuple(paths), starter, mapping, second_blender()), checksum


def scene_of(session_uid: int) -> bpy.types.Scene | None:
    """The scene that is known by this number while the file is open, whatever it is called; None once it is deleted."""
    return next((scene for scene in bpy.data.scenes if scene.session_uid == session_uid), None)


def reset_character(context: bpy.types.Context) -> None:
    """Resets the scene's character. Raises SceneError where it is the artist's own or cannot be edited."""
    skeleton = native.core.skeleton()
    character = armature.find_character(context.scene, skeleton)
    if character is None:
        raise SceneError("The scene has no character yet: Synthesize makes one.")
    if not is_own_skeleton(character, skeleton):
        raise SceneError(f"{character.name} is a rig of your own, which Oncue does not reset.")
    if not character.is_editable:
        raise SceneError(f"{character.name} is linked and cannot be changed: make a library override of it.")
    character_reset.reset_character(context, character, skeleton)


def floor_of(report: dict, motion: Motion, skeleton: dict) -> float:
    """The floor that a take's person started on, world, metres."""
    body = report.get("extension", {}).get("body")
    start = (body["task"] if body else report.get("task", {})).get("start")
    return float(start["position"][2] if start else motion.root_positions[0, 2] - skeleton["rest_hips_height"])


def write_edit(
    context: bpy.types.Context,
    request: EditRequest,
    take: Take,
    outcome: EditOutcome,
    skipped: list[tuple[str, str]],
) -> tuple[int, int] | None:
    """Writes an edited motion back; the scene's frames it touched. Raises SceneError if the keys changed meanwhile."""
    settings, edited = context.scene.oncue, outcome.edited
    action = pins.action_of(settings.character)
    if action != take.action:
        raise SceneError(
            f"{settings.character.name} plays another action than the one that was solved: choose that again, and "
            "press Re-solve again."
        )
    now = Take(context.scene, settings.character, action, native.core.skeleton())
    if not now.is_as(take):
        raise SceneError("The keys were changed while it was solving: press Re-solve again.")
    motion = motion_of(edited, request.size)
    with kept_if_it_fails(action):
        touched = now.write(motion, np.asarray(edited.contacts))
        report = report_of(action)
        if report is not None:
            edited = edited_report(report, request, outcome, skipped)
            if off := now.feet_off(motion):
                edited = {**edited, "success": False, "problems": [*edited.get("problems", []), *off]}
            action[REPORT_KEY] = json.dumps(edited)
    return touched


def edited_report(report: dict, request: EditRequest, outcome: EditOutcome, skipped: list[tuple[str, str]]) -> dict:
    """A report with what is true of the motion after an edit."""
    report = {**report, "artist": scaled(outcome.edited.figures, request.size)}
    if outcome.measured is None:
        return report
    seen = {name: value for name, value in outcome.measured.items() if value is not None}
    # Other people of the shot are by now among what moves.
    kept = {name: value for name, value in report.items() if name not in {*outcome.measured, "others"}}
    extension = {**report.get("extension", {}), "skipped_objects": _skipped(skipped)}
    told = _told({**seen, "extension": extension}, request, outcome.passing, request.start_frame)
    return {**kept, **report_in_scene(seen, request.size), **told}


def what_is_seen(context: bpy.types.Context) -> object:
    """Something that differs once the artist has changed what a run reads: places, what is shown, settings."""
    settings = context.scene.oncue
    things = [
        (thing.name, thing.visible_get(), np.array(thing.matrix_world, dtype=np.float32).tobytes())
        for thing in things_of(context.view_layer)
    ]
    render = context.scene.render
    time = (render.fps, render.fps_base, render.frame_map_old, render.frame_map_new, settings.start_frame)
    chosen = (settings.seed, time, settings.preset, settings.overrides, settings.scene_scale, settings.mapping)
    paths = tuple(item.path for item in settings.library_paths)
    named = (settings.manifold, settings.starter, settings.character, settings.exclude, context.mode)
    return hash((context.scene.name, tuple(things), chosen, paths, named))


def still_hindered(context: bpy.types.Context, words: str) -> bool:
    """Whether the scene's character is still in the state that was told in these words."""
    character = context.scene.oncue.character
    try:
        if character is not None:
            file_state.check_character(context, character)
    except (SceneError, LookupError) as error:
        return str(error) == words
    return False


def overrides_of(settings) -> dict:
    """What departs from the preset; what is written comes before the slider. Raises SceneError."""
    overrides = read_overrides(settings.overrides)
    kept = overrides.get("kept", {})
    if settings.liveliness and isinstance(kept, dict):
        overrides["kept"] = {"liveliness": round(settings.liveliness, 3), **kept}
    return overrides


def wishes_of(context: bpy.types.Context, size: float = 1.0) -> dict:
    """The same with how long the cue asks a person, `size` times as large as the core's body, to stay; what is written
    comes before it. Raises SceneError."""
    overrides, seconds = overrides_of(context.scene.oncue), hold_seconds(context)
    synthesizer = overrides.get("synthesizer", {})
    if seconds is not None and isinstance(synthesizer, dict):
        overrides["synthesizer"] = {"hold_seconds": seconds / clock(size), **synthesizer}
    return overrides


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
    person = people.person_named(context, request.person) if request.person else None
    character = person.character if person else armature.find_character(scene, skeleton)
    # The artist may have changed it since the run began.
    puppet = file_state.check(context, character)
    if abs(puppet.size - request.size) > SAME_SIZE:
        raise SceneError(
            f"{character.name if character else 'The character'} is of another size than when the run began: "
            "synthesize again."
        )
    motion = motion_of(synthesis, request.size)
    # Who waits at the start stands there as the motion begins.
    begins = outcome.begins(request)
    placed = {"start_frame": begins, "metres_per_unit": puppet.metres_per_unit}
    contacts, few = np.asarray(synthesis.contacts), not settings.every_frame
    with all_or_nothing(context):
        if character is None:
            character = armature.make_character(context, skeleton, settings.scene_scale)
            puppet = replace(puppet, character=character)
        elif puppet.rig is None and character.get(CHARACTER_KEY):
            armature.give_skin(context, character, skeleton)
        settings.character = character
        if person is not None and people.acts(scene, person.start) != character:
            person.start[ACTS_KEY] = character
        context.view_layer.update()
        stands = root_motion.stand_of(character)
        space = puppet.space(stands, own_rig.holds_of(request.task, request.size))
        played = action_of(character)
        floor = float(request.task["start"]["position"][2]) / puppet.metres_per_unit
        root = root_motion.root_motion_of(puppet, settings.root_motion, floor, stands)
        action = write_action(
            context,
            character,
            puppet.bones,
            motion,
            name=f"{title_of(request)} seed {request.seed}",
            report=full_report(request, outcome, skipped),
            space=space,
            root=root,
            contacts=contacts,
            tolerance_mm=settings.key_tolerance if few else None,
            **placed,
        )
        if (stands != np.array(character.matrix_world)).any():
            character.matrix_world = Matrix(stands)
        if puppet.is_control_rig:
            _have_controls_followed(context, puppet, space, motion, begins, root)
        action[TAKE_OF_KEY] = character
        mark_cues(action, report_of(action), request.scene_rate)
        play_things(None, played)
        write_things(
            context,
            action,
            getattr(synthesis, "things", []),
            len(motion),
            motion.frame_rate,
            begins,
            puppet.metres_per_unit,
        )
        written = action if few else None
        kept = {"few": written, "space": space if root is None else root.carried, "matrix_world": stands}
        solved = solved_take(scene, character, puppet.bones, motion, contacts, **kept, **placed)
        if root is not None:
            solved = replace(solved, root=f"{root.kind} {root.bone}".strip(), way=root.carried.way)
        keep_solved(action, replace(solved, ik=puppet.ik))
    return action


def write_shot(
    context: bpy.types.Context, made: list[tuple[Request, Outcome, list[tuple[str, str]]]]
) -> list[bpy.types.Action]:
    """The actions of several people, each on its own character; the scene ends no earlier than the last of them.

    Whom the artist has chosen stays chosen. Raises SceneError, before anything is written, where a character cannot
    take its motion now.
    """
    scene, settings = context.scene, context.scene.oncue
    chosen = settings.character
    for request, _, _ in made:
        file_state.check(context, people.person_named(context, request.person).character)
    actions, characters = [], []
    for request, outcome, skipped in made:
        actions.append(write_outcome(context, request, outcome, skipped))
        characters.append(settings.character)
    if actions:
        settings.character = chosen if chosen in characters else characters[0]
        fit_end(scene, max(int(action.frame_end) for action in actions))
    return actions


def shot_report(reports: list[dict], refused: list[tuple[str, str]], seed: int) -> dict:
    """One report of several people: `people` has each one's own."""
    said = [(report["extension"]["person"], problem) for report in reports for problem in problems_of(report)]
    alone = [{"success": False, "problems": [why], "extension": {"person": person}} for person, why in refused]
    return {
        "success": all(report["success"] for report in reports) and not refused,
        "problems": [f"{person}: {problem}" for person, problem in [*said, *refused]],
        "seed": seed,
        "cues": [{"person": report["extension"]["person"], **cue} for report in reports for cue in report["cues"]],
        "people": [*reports, *alone],
    }


def _have_controls_followed(
    context: bpy.types.Context,
    puppet: Puppet,
    space: rigify.ControlSpace,
    motion: Motion,
    begins: int,
    root: root_motion.RootMotion | None,
) -> None:
    """Has a rig of controls follow the keys that were just written. Raises SceneError where it does not."""
    character = puppet.character
    wanted = space.wanted(resample(motion, frame_rate(context.scene)))
    if root is not None and root.kind != root_motion.BONE:
        # The armature itself goes along, or nothing does.
        wanted = {bone: np.linalg.inv(root.carried.way) @ matrices for bone, matrices in wanted.items()}
    with rigify.switched(character, puppet.ik, begins):
        away, bone, frame = rigify.off_by(context, character, wanted, puppet.ik, begins)
        centimetres = 100.0 * away * puppet.scene_scale
        if centimetres > FOLLOWS_CM:
            raise SceneError(
                f"{character.name} does not follow its controls as a rig of Rigify's human does: its bone {bone} is "
                f"{centimetres:.1f} cm off at frame {frame}. Are controls moved, or constraints added? Clear them in "
                "pose mode, or choose the metarig."
            )


def motion_of(made: object, size: float) -> Motion:
    """What the core gave, a synthesis or an edited motion, by the clock of a body of this size."""
    rate = float(getattr(made, "frame_rate", CORE_RATE)) / clock(size)
    return Motion(np.asarray(made.root_positions), np.asarray(made.rotations), rate)


def cue_frames(report: dict, scene_rate: float) -> dict[str, int]:
    """On which of the scene's frames each of several cues is met, by name; none for the motion of one cue."""
    begins, cues = report.get("extension", {}).get("begins", 0), report.get("cues") or []
    several = len(cues) > 1 or bool(report.get("steps"))
    return {cue["cue"]: round(begins + cue["frame"] * scene_rate / CORE_RATE) for cue in cues if several}


def mark_cues(action: bpy.types.Action, report: dict | None, scene_rate: float) -> None:
    """Marks where each of several cues is met."""
    for name, frame in cue_frames(report or {}, scene_rate).items():
        action.pose_markers.new(name).frame = frame


def full_report(request: Request, outcome: Outcome, skipped: list[tuple[str, str]]) -> dict:
    """The core's report with what only Blender's side knows."""
    report, begins = outcome.synthesis.report, outcome.begins(request)
    if outcome.penetration is not None:
        report = {**report, "penetration": outcome.penetration}
    extension = {
        "blender_version": compat.BLENDER_VERSION,
        "preset": request.preset,
        "overrides": request.overrides,
        "manifold": request.manifold,
        "library": request.library.told(),
        "title": title_of(request),
        "scene_triangles": len(request.triangles) + sum(len(thing.triangles) for thing in request.moving),
        "begins": begins,
        **({"person": request.person} if request.person else {}),
        "skipped_objects": _skipped(skipped),
        "captures": outcome.captures,
        "skipped_files": [
            {"file": capture["file"], "reason": capture["reason"] or ""}
            for capture in outcome.captures
            if not capture["clip"]
        ],
        "seconds": outcome.seconds,
    }
    if request.size != 1.0:
        extension["body"] = {"size": request.size, "task": _without_meshes(request.task)}
    told = _told({**report, "extension": extension}, request, outcome.passing, begins)
    asked = request.task if request.asked is None else request.asked
    return {**report_in_scene(report, request.size), "task": _without_meshes(asked), **told}


def _without_meshes(asked: dict) -> dict:
    """What was asked for, without the meshes of what is opened: the scene has these, and a report is read by people."""
    leaves = [
        {name: part for name, part in leaf.items() if name not in ("positions", "triangles")}
        for leaf in asked.get("leaves", [])
    ]
    return {**asked, "leaves": leaves} if leaves else asked


def _skipped(skipped: list[tuple[str, str]]) -> list[dict]:
    return [{"object": name, "reason": reason} for name, reason in skipped]


def _told(report: dict, request: Request | EditRequest, passing: dict, begins: int) -> dict:
    """What of a report of the core names the scene's objects, metres and frames, with what moves in it."""
    named = with_objects(report["problems"], request, report)
    told = [in_scene_frames(problem, begins, request.scene_rate) for problem in named]
    meetings = meeting_sentences(passing["meetings"], begins, request.scene_rate)
    problems = [sentence_in_scene(problem, request.size) for problem in [*meetings, *told]]
    objects = list(dict.fromkeys(thing.name for thing in request.moving))
    return {
        "success": not problems,
        "problems": problems,
        "extension": {
            **report["extension"],
            "deepest": scaled(deepest_touch(request, report, passing, begins), request.size),
            "moving": {"objects": objects, **scaled(passing, request.size)},
        },
    }


def deepest_touch(request: Request | EditRequest, report: dict, passing: dict, begins: int) -> dict | None:
    """Which part of the body is deepest in which object, on which of the scene's frames; None where none is deep."""
    touches = ((report.get("body") or {}).get("scene") or {}).get("touches") or []
    named = [{**touch, "object": object_at(request, touch["place"])} for touch in touches[:1]]
    deepest = max([*named, *passing["meetings"]], key=lambda touch: touch["depth_cm"], default=None)
    if deepest is None:
        return None
    frame = round(begins + deepest["frame"] * request.scene_rate / CORE_RATE)
    return {**{name: deepest[name] for name in ("part", "object", "depth_cm")}, "frame": frame}


def with_objects(problems: list[str], request: Request | EditRequest, report: dict) -> list[str]:
    """The core's sentences, which know places alone, with the objects that stand there."""
    touches = ((report.get("body") or {}).get("scene") or {}).get("touches") or []
    out = list(problems)
    for touch in touches:
        place = "what stands at {:.2f}, {:.2f}, {:.2f}".format(*touch["place"])
        if any(place in problem for problem in out) and (name := object_at(request, touch["place"])):
            out = [problem.replace(place, f"‘{name}’") for problem in out]
    return out


def object_at(request: Request | EditRequest, place: list[float]) -> str:
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


def title_of(request: Request) -> str:
    """What happens in a motion, as its action is called: where the person sits or stops, and with which hands."""
    cues, hands = cues_of(request.task), [hand["name"] for hand in hands_of(request.task)]
    cue = cues[0]
    kind, name = cue["action_type"].title(), cue["name"].split(".")[0]
    where = f" at {name}" if name not in {"Sit", "Stop"} else ""
    if not where and kind == "Sit" and (seat := object_under(request, cue["position"])):
        where = f" on {seat}"
    more = f" and {len(cues) - 1} more" if len(cues) > 1 else ""
    return f"{kind}{where}{more}" + (f" with {' and '.join(hands)}" if hands else "")


def object_under(request: Request | EditRequest, place: list[float]) -> str:
    """The object whose surface lies under a place, no farther than a seat under the pelvis; else an empty name."""
    x, y, z = place
    if not len(request.triangles) or not len(request.owners):
        return ""
    # One direction first: most triangles of a large scene are gone by that.
    across = request.positions[:, 0][request.triangles]
    near = np.flatnonzero((across.min(axis=1) <= x) & (x <= across.max(axis=1)))
    corners = request.positions[request.triangles[near]].astype(np.float64)
    low, high = corners.min(axis=1), corners.max(axis=1)
    kept = (low[:, 1] <= y) & (y <= high[:, 1]) & (low[:, 2] <= z) & (high[:, 2] >= z - UNDER_PELVIS)
    near, (a, b, c) = near[kept], (corners[kept, k] for k in range(3))
    normals = np.cross(b - a, c - a)
    level = np.abs(normals[:, 2]) > 1e-12
    near, a, b, c, normals = (part[level] for part in (near, a, b, c, normals))
    over = a[:, 2] - (normals[:, 0] * (x - a[:, 0]) + normals[:, 1] * (y - a[:, 1])) / normals[:, 2]
    sides = [
        (q[:, 0] - p[:, 0]) * (y - p[:, 1]) - (q[:, 1] - p[:, 1]) * (x - p[:, 0]) for p, q in ((a, b), (b, c), (c, a))
    ]
    inside = (np.stack(sides) * np.sign(normals[:, 2]) >= 0.0).all(axis=0) & (z - UNDER_PELVIS <= over) & (over <= z)
    if not inside.any():
        return ""
    return request.names[request.owners[near[inside][int(np.argmax(over[inside]))]]]


def report_of(action: bpy.types.Action | None) -> dict | None:
    """The report that was kept with a take, or None."""
    text = action.get(REPORT_KEY) if action else None
    try:
        report = json.loads(text) if text else None
    except (TypeError, ValueError):
        return None
    return report if isinstance(report, dict) else None


def frames_of_cues(context: bpy.types.Context) -> dict[str, int]:
    """On which frame each cue is met in the performances that the characters play, by name; none for another one."""
    characters = [person.character for person in people.cast(context)] or [context.scene.oncue.character]
    frames: dict[str, int] = {}
    for character in characters:
        report = report_of(action_of(character))
        try:
            if report and belongs_to_cues(context, report):
                frames |= cue_frames(report, frame_rate(context.scene) * clock(body_size_of(report)))
        except (LookupError, TypeError, ValueError, AttributeError):
            continue
    return frames


def body_size_of(report: dict) -> float:
    """How many times as large as the core's the body was for which a report was made."""
    return float((report.get("extension", {}).get("body") or {}).get("size", 1.0))


def current_report(scene: bpy.types.Scene) -> dict | None:
    """The report of the action that the scene's character plays."""
    return report_of(current_action(scene))


def current_action(scene: bpy.types.Scene) -> bpy.types.Action | None:
    """The action that the scene's character plays."""
    return action_of(scene.oncue.character)


def action_of(character: bpy.types.Object | None) -> bpy.types.Action | None:
    """The action that a character plays."""
    data = character.animation_data if character else None
    return data.action if data else None


def belongs_to_cues(context: bpy.types.Context, report: dict) -> bool:
    """Whether the cues stand where they stood when the motion of a report was made; those that move aside."""
    made_for = report.get("task")
    if not isinstance(made_for, dict):
        return True
    settings, name = context.scene.oncue, (report.get("extension") or {}).get("person")
    start = next((one for one in visible_cues(context, "start") if one.name == name), None) if name else None
    try:
        now = read_task(context, settings.scene_scale, as_drawn=True, start=start)
    except SceneError:
        return False
    animated = any(may_move(cue) for cue in visible_cues(context, "start", *ORDERED, *FEET))
    here = animated or _are_same_cues(now, made_for)
    # Hands are no part of what is made while the cues are followed.
    live = LIVE_KEY in (current_action(context.scene) or {})
    return here and (live or _are_same_hands(context, report))


def _are_same_hands(context: bpy.types.Context, report: dict) -> bool:
    """Whether the hand cues of a report are there, at their frames, and those that do not move at their places."""
    scene, scale = context.scene, context.scene.oncue.scene_scale
    made_for = {hand["name"]: hand for hand in hands_of(report["task"])}
    cues = visible_cues(context, *HANDS)
    if {cue.name for cue in cues} != set(made_for):
        return False
    begins = report.get("extension", {}).get("begins", scene.oncue.start_frame)
    for cue in cues:
        path, first = made_for[cue.name]["path"], made_for[cue.name]["first_frame"]
        try:
            frames = core_frames(scene, cue, begins, frame_rate(scene) * clock(body_size_of(report)))
        except SceneError:
            return False
        if (frames.start, len(frames)) != (first, len(path)):
            return False
        if not may_move(cue) and not np.allclose(
            np.array(cue.matrix_world.translation) * scale, path[0], atol=SAME_PLACE
        ):
            return False
    return True


def _are_same_cues(now: dict, before: dict) -> bool:
    """Whether start and cues are as they were, and in the same order."""
    try:
        pairs = list(zip([now["start"], *cues_of(now)], [before.get("start"), *cues_of(before)], strict=True))
    except (LookupError, TypeError, ValueError):
        return False
    holds = [[step.get("hold_seconds") for step in asked.get("steps", [])] for asked in (now, before)]
    places = [[[cue.get("position") for cue in passes] for passes in passes_of(asked)] for asked in (now, before)]
    if times_of(now) != times_of(before):
        return False
    if not _are_same_things(now, before) or not _are_same_looks(now, before):
        return False
    if holds[0] != holds[1] or [len(part) for part in places[0]] != [len(part) for part in places[1]]:
        return False
    passed = zip(*([place for part in parts for place in part] for parts in places), strict=True)
    same_passes = all(np.allclose(one, other, atol=SAME_PLACE) for one, other in passed)
    return same_passes and all(_is_same_cue(one, other) for one, other in pairs)


def _are_same_things(now: dict, before: dict) -> bool:
    """Whether the same is taken by the same hands, put down at the same places and opened as far; where it stood at
    first aside.
    """

    def asked(task: dict) -> list[tuple]:
        things = [(at, cue) for at, step in enumerate(task.get("steps", [])) for cue in step.get("things", [])]
        asked = [(at, cue["does"], cue["thing"], cue.get("hand"), "yaw" in cue) for at, cue in things]
        opened = [(cue.get("by"), cue.get("over_seconds")) for _, cue in things]
        return [*asked, *opened, *(leaf["hung"] for leaf in task.get("leaves", []))]

    def places(task: dict) -> list[float]:
        things = [cue for step in task.get("steps", []) for cue in step.get("things", [])]
        return [c for cue in things for c in (*(cue.get("grip") or cue["position"]), cue.get("yaw", 0.0))]

    return asked(now) == asked(before) and np.allclose(places(now), places(before), atol=SAME_PLACE)


def _are_same_looks(now: dict, before: dict) -> bool:
    """Whether what is looked at is where it was at first, after the same cues and for as long."""
    looks = [asked.get("looks", []) for asked in (now, before)]
    told = [[(look["name"], look["after"], look.get("hold_seconds")) for look in part] for part in looks]
    places = [[look["path"][0] for look in part] for part in looks]
    return told[0] == told[1] and np.allclose(*places, atol=SAME_PLACE)


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
