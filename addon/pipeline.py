# SPDX-License-Identifier: GPL-3.0-or-later
"""The main job without Blender, in reading order: library, scene index, synthesis.

A run is a generator of the core's jobs: whoever drives it (a timer in the window, a loop in the background)
polls the job that it stands at, and the same steps give the same motion for the same seed.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Generic, Protocol, TypeAlias, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from .errors import EdgeError, SceneError
from .foreign_captures import Converted, SecondBlender, belongs_to, convert_steps, foreign_files, is_foreign
from .log import logger
from .motion import Motion
from .moving import Mesh, Thing, by_object, joined, nothing_met, stands
from .native import core, expected_errors, is_cancelled
from .policy_cache import PolicyCache
from .scene_frames import CORE_RATE, told_in_scene_frames

#: Ending of a library file that Oncue wrote.
LIBRARY_SUFFIX = ".oncue"
#: Endings of a motion manifold's file, and of a training that is under way.
MANIFOLD_SUFFIX, CHECKPOINT_SUFFIX = ".oncueman", ".oncueckp"
#: Every training from the panel has the same seed: a checkpoint goes on only with its own.
MANIFOLD_SEED = 0

T = TypeVar("T")
T_co = TypeVar("T_co", covariant=True)


class Work(Protocol):
    """Something at work that is waited for: a job of the core, or a second Blender."""

    def done(self) -> bool: ...
    def wait(self, timeout_s: float) -> bool: ...
    def cancel(self) -> None: ...
    def progress(self) -> core.ProgressSnapshot: ...


#: Yields the work that it waits for, and gives a `T` at its end.
Steps: TypeAlias = Generator[Work, None, T]
#: What each motion capture file gave, and why the rest of it was left out.
Captures: TypeAlias = "list[core.Capture]"


@dataclass(frozen=True)
class LibraryChoice:
    """Where the motion comes from: mocap files, folders and library files, and what the starter adds."""

    paths: tuple[str, ...] = ()
    #: "all", "missing" (what the files lack) or "none".
    starter: str = "missing"
    #: A mapping file for all the captures (docs/captures.md); empty for those that lie beside them.
    mapping: str = ""
    #: What reads the captures that are no .bvh files.
    blender: SecondBlender | None = field(default=None, compare=False)

    def told(self) -> dict[str, object]:
        """What a report says of it."""
        return {"paths": list(self.paths), "starter": self.starter, "mapping": self.mapping}


#: What is asked for: one cue, or several that are met one after the other.
Asked: TypeAlias = "core.Task | core.Performance"


def performance_of(asked: Asked) -> core.Performance | None:
    """What is asked for where it is several cues."""
    return cast("core.Performance", asked) if "steps" in asked else None


def task_of(asked: Asked) -> core.Task:
    """What is asked for where it is one cue."""
    return cast("core.Task", asked)


def cues_of(asked: Asked) -> list[core.ActionCue]:
    """The cues that are asked for, in order."""
    several = performance_of(asked)
    return [step["cue"] for step in several["steps"]] if several else [task_of(asked)["cue"]]


def passes_of(asked: Asked) -> list[list[core.PassCue]]:
    """The waypoints on the way to each of these cues."""
    several = performance_of(asked)
    return [step.get("passes", []) for step in several["steps"]] if several else [task_of(asked).get("passes", [])]


def times_of(asked: Asked) -> list[float | None]:
    """When each of these cues is to be met, seconds from the motion's first frame; None where no time is asked for."""
    several = performance_of(asked)
    return [step.get("at_seconds") for step in several["steps"]] if several else [None]


def hands_of(asked: Asked) -> list[core.ManipulationCue]:
    """The hands' cues that are asked for."""
    several = performance_of(asked)
    given = several["steps"] if several else [task_of(asked)]
    return [hand for one in given for hand in one.get("manipulations", [])]


@dataclass(frozen=True)
class Request:
    """All that a run needs, read from the file before it starts."""

    #: Scene triangles, world, metres: float32 (n, 3) and uint32 (m, 3).
    positions: NDArray[np.float32]
    triangles: NDArray[np.uint32]
    task: Asked
    library: LibraryChoice = LibraryChoice()
    preset: str = "default"
    seed: int = 0
    #: Settings that depart from the preset, nested as the preset's.
    overrides: core.Settings = field(default_factory=dict)
    #: File of the manifold that seat and hands are fitted along; empty for the one that ships.
    manifold: str = ""
    #: The scene's frame at which the motion begins, and the scene's frames a second.
    start_frame: int = 0
    scene_rate: float = CORE_RATE
    #: What moves in the scene by itself; not among the triangles.
    moving: tuple[Thing, ...] = ()
    #: The object of each triangle, by its place in `names`.
    owners: NDArray[np.uint32] = field(default_factory=lambda: np.empty(0, np.uint32))
    names: tuple[str, ...] = ()
    #: How many times as large as the core's body the person is. All of the above is in the measure of that body: metres
    #: of which it is 1.8 tall, and its seconds (`body_size`).
    size: float = 1.0
    #: The task in the scene's own metres and seconds; None where it is the same.
    asked: Asked | None = None
    #: Of several people whose it is: the name of their start.
    person: str = ""


@dataclass(frozen=True)
class EditRequest:
    """A motion of the core with the artist's keys in it, and what it is to meet."""

    motion: Motion
    #: Left and right foot, (frames, 2).
    contacts: NDArray[np.float32]
    #: What stays exactly as it is in the motion.
    keys: list[core.Key]
    constraints: list[core.Constraint]
    #: World height of the floor, metres.
    floor: float
    #: Scene triangles as a `Request` has them, which a seated body is kept out of; none where there are none.
    positions: NDArray[np.float32] = field(default_factory=lambda: np.empty((0, 3), np.float32))
    triangles: NDArray[np.uint32] = field(default_factory=lambda: np.empty((0, 3), np.uint32))
    preset: str = "default"
    overrides: core.Settings = field(default_factory=dict)
    manifold: str = ""
    #: As of a `Request`.
    start_frame: int = 0
    scene_rate: float = CORE_RATE
    moving: tuple[Thing, ...] = ()
    owners: NDArray[np.uint32] = field(default_factory=lambda: np.empty(0, np.uint32))
    names: tuple[str, ...] = ()
    size: float = 1.0
    #: What the motion was made for; None where nobody knows any more.
    task: Asked | None = None
    #: When what happens, for each cue that was played: frames of the motion.
    moments: list[core.Moments] = field(default_factory=list)
    #: What the motion was made of, and its checksum; None where nobody knows any more.
    library: LibraryChoice | None = None
    library_checksum: str = ""


@dataclass(frozen=True)
class Outcome:
    """What a run gives: the core's synthesis, and what the artist should know about its input."""

    synthesis: core.Synthesis | core.Performed
    #: Seconds of each step.
    seconds: dict[str, float]
    captures: Captures = field(default_factory=list)
    #: How the motion gets past what moves, and the core's frames that the person waits before it begins.
    passing: core.Passing = field(default_factory=nothing_met)
    #: Of the report, with what moves where it stands on each frame; None where nothing does.
    penetration: core.PenetrationFigures | None = None

    def begins(self, request: Request) -> int:
        """The scene's frame at which the motion begins."""
        return request.start_frame + round(self.passing["wait"] * request.scene_rate / CORE_RATE)


@dataclass(frozen=True)
class EditOutcome:
    """What an edit gives: the core's edited motion, and how it looks now."""

    edited: core.EditedMotion
    #: None where nobody knows any more what the motion was made for.
    measured: core.Measured | None
    passing: core.Passing = field(default_factory=nothing_met)


#: (path, time of the last change in ns, bytes) of each file of a library.
FileStates: TypeAlias = tuple[tuple[str, int, int], ...]
LibraryKey: TypeAlias = tuple[LibraryChoice, FileStates]
BuiltLibrary: TypeAlias = "tuple[core.Library, Captures]"


class LibraryCache:
    """The library built last, kept until its files change."""

    def __init__(self) -> None:
        self._key: LibraryKey | None = None
        self._built: BuiltLibrary | None = None

    def get(self, key: LibraryKey) -> BuiltLibrary | None:
        return self._built if key == self._key else None

    def put(self, key: LibraryKey, built: BuiltLibrary) -> None:
        self._key, self._built = key, built

    def captures_of(self, choice: LibraryChoice) -> Captures | None:
        """What the files of a choice gave when it was built last, or None where another one was."""
        return self._built[1] if self._key and self._built and self._key[0] == choice else None


class Earlier:
    """The performance that was made last, of which the next one takes what follows from the same."""

    def __init__(self) -> None:
        self.performed: core.Performed | None = None
        #: And the people who were made last.
        self.people: list[core.Performed] = []


def synthesis_steps(
    request: Request, cache: LibraryCache, policies: PolicyCache | None = None, earlier: Earlier | None = None
) -> Steps[Outcome]:
    """The whole run. A policy that was optimized is kept in `policies`, and played where the prior fails."""
    earlier = earlier or Earlier()
    seconds: dict[str, float] = {}
    _log_request(request)
    manifold = read_manifold(request.manifold)
    settings = merged(core.default_settings(request.preset), request.overrides)
    with _timed(seconds, "library"):
        library, captures = yield from library_steps(request.library, cache)
    made: list[tuple[core.Synthesis | core.Performed, core.Passing]] = []
    refused: Exception | None = None
    stays = None
    if request.moving and len(request.triangles):
        # What moves is elsewhere by the time at which a motion planned about it is there.
        with _timed(seconds, "scene_index"):
            still = request.positions, request.triangles
            stays = yield from finish(core.index_scene(*still, settings["scene"], request.task))
    for positions, triangles in _scenes(request):
        with _timed(seconds, "scene_index"):
            scene = yield from finish(core.index_scene(positions, triangles, settings["scene"], request.task))
        try:
            with (
                _timed(seconds, "synthesis"),
                told_in_scene_frames(request.start_frame, request.scene_rate, request.size),
            ):
                kept = policies.find(scene, library) if policies else None
                asked = (settings, request.seed, kept, manifold)
                synthesis: core.Synthesis | core.Performed
                if several := performance_of(request.task):
                    perform = core.perform(scene, library, several, *asked, earlier.performed)
                    synthesis = earlier.performed = yield from finish(perform)
                else:
                    job = core.synthesize(scene, library, task_of(request.task), *asked, stays)
                    synthesis = yield from finish(job)
        except SceneError as error:
            # As things stand otherwise there may be a way.
            refused = refused or error
            continue
        # Of use for the next task wherever the cue is met, whatever else there is to say of the motion.
        optimized = synthesis.report["updates"] and all_met(synthesis.report)
        if policies and optimized and isinstance(synthesis, core.Synthesis):
            policies.keep(scene, library, synthesis.policy)
        with _timed(seconds, "moving"):
            made.append((synthesis, (yield from _passing_steps(request, synthesis))))
        if synthesis.report["success"] and not made[-1][1]["meetings"]:
            break
    if refused is not None and not made:
        raise _because_it_moves(refused, request)
    synthesis, passing = min(made, key=_shortfall)
    penetration = None
    if stays is not None:
        seen = (request.task, moments_of(synthesis.report), stays, settings)
        with _timed(seconds, "moving"):
            looks = _looks(synthesis, request.moving, passing["wait"], *seen)
            penetration = (yield from looks)["penetration"]
    return Outcome(synthesis, seconds, captures, passing, penetration)


def shot_steps(
    requests: list[Request], cache: LibraryCache, policies: PolicyCache | None = None, earlier: Earlier | None = None
) -> Steps[list[Outcome | Exception]]:
    """The whole run of a shot: what each person's request gives, or why it gives nothing.

    All play in the first one's scene, on one clock. Raises where nothing can be made of any.
    """
    first, earlier = requests[0], earlier or Earlier()
    if len(requests) == 1:
        return [(yield from synthesis_steps(first, cache, policies, earlier))]
    seconds: dict[str, float] = {}
    for request in requests:
        _log_request(request)
    manifold = read_manifold(first.manifold)
    settings = merged(core.default_settings(first.preset), first.overrides)
    with _timed(seconds, "library"):
        library, captures = yield from library_steps(first.library, cache)
    asked = [several for request in requests if (several := performance_of(request.task))]
    stays = None
    if first.moving and len(first.triangles):
        with _timed(seconds, "scene_index"):
            still = first.positions, first.triangles
            stays = yield from finish(core.index_scene(*still, settings["scene"], asked))
    shots: list[list[tuple[core.Performed, core.Passing] | core.OncueError]] = []
    refused: Exception | None = None
    for positions, triangles in _scenes(first):
        with _timed(seconds, "scene_index"):
            scene = yield from finish(core.index_scene(positions, triangles, settings["scene"], asked))
        try:
            with (
                _timed(seconds, "synthesis"),
                told_in_scene_frames(first.start_frame, first.scene_rate, first.size),
            ):
                kept = policies.find(scene, library) if policies else None
                given = (settings, first.seed, kept, manifold, earlier.people)
                people = yield from finish(core.perform_together(scene, library, asked, *given))
        except SceneError as error:
            refused = refused or error
            continue
        earlier.people = [one for one in people if isinstance(one, core.Performed)]
        shot: list[tuple[core.Performed, core.Passing] | core.OncueError] = []
        with _timed(seconds, "moving"):
            for one, request in zip(people, requests, strict=True):
                if isinstance(one, core.Performed):
                    # Who waited for what moves would meet the others at another time.
                    floor = request.task["start"]["position"][2]
                    shot.append((one, (yield from _past(first.moving, one, floor, False, 0))))
                else:
                    shot.append(one)
        shots.append(shot)
        if not any(_lacks(one) for one in shot):
            break
    if refused is not None and not shots:
        raise _because_it_moves(refused, first)
    outcomes: list[Outcome | Exception] = []
    for made, request in zip(min(shots, key=lambda shot: sum(map(_lacks, shot))), requests, strict=True):
        if isinstance(made, core.OncueError):
            outcomes.append(made)
            continue
        performed, passing = made
        penetration = None
        if stays is not None:
            looks = _looks(performed, request.moving, 0, request.task, moments_of(performed.report), stays, settings)
            penetration = (yield from looks)["penetration"]
        outcomes.append(Outcome(performed, seconds, captures, passing, penetration))
    return outcomes


def _lacks(one: tuple[core.Performed, core.Passing] | core.OncueError) -> bool:
    """Whether there is something wrong with what was made of a person."""
    return isinstance(one, core.OncueError) or not one[0].report["success"] or bool(one[1]["meetings"])


#: A motion as the core gives it.
Made: TypeAlias = "core.Synthesis | core.Performed | core.EditedMotion"
#: A person waits no longer for a way to be free, the core's frames: 20 s.
MOST_WAIT = 600


def _scenes(request: Request) -> Iterator[Mesh]:
    """The scene to plan in; where things move, in each of the ways in which they may stand."""
    still = request.positions, request.triangles
    if not request.moving:
        yield still
    else:
        yield from (joined([still, mesh]) for mesh in stands(request.moving))


def moments_of(report: core.Report) -> list[core.Moments]:
    """When what happens in a motion, for each cue that was played."""
    if steps := report.get("steps"):
        return [{name: step.get(name) for name in ("stood_at", "action_from", "complete")} for step in steps]  # type: ignore[misc]
    # Its waypoints come before.
    complete = report["cues"][-1]["frame"] if report["cues"] else 0
    return [{"complete": complete, "action_from": report["action_from"]}]


def _passing_steps(request: Request, synthesis: core.Synthesis | core.Performed) -> Steps[core.Passing]:
    """How a motion gets past what moves. A hand that holds something on its way keeps its frames: then nobody waits."""
    hands = bool(hands_of(request.task))
    floor = request.task["start"]["position"][2]
    # Nor does who is to be somewhere at a time.
    bound = hands or any(at is not None for at in times_of(request.task))
    return (yield from _past(request.moving, synthesis, floor, hands, 0 if bound else MOST_WAIT))


def _looks(
    made: Made,
    moving: tuple[Thing, ...],
    wait: int,
    task: Asked,
    moments: list[core.Moments],
    stays: core.SceneIndex | None,
    settings: core.Settings,
    library: core.Library | None = None,
) -> Steps[core.Measured]:
    """What can be seen of a motion among what stays and what moves."""
    objects = [one for thing in moving for one in thing.for_core()]
    places, turns, contacts = _arrays(made)
    if several := performance_of(task):
        job = core.measure_performance(
            places, turns, contacts, several, moments, stays, settings, objects, wait, library
        )
    else:
        complete, begins = (moments[0]["complete"], moments[0].get("action_from")) if moments else (0, None)
        job = core.measure_motion(
            places, turns, contacts, task_of(task), complete, begins, stays, settings, objects, wait, library
        )
    return (yield from finish(job))


def _past(moving: tuple[Thing, ...], made: Made, floor: float, hands: bool, most_wait: int) -> Steps[core.Passing]:
    """How a motion gets past what moves; with `hands` the arms may touch it."""
    if not moving:
        return nothing_met()
    objects = [one for thing in moving for one in thing.for_core()]
    return by_object((yield from finish(core.pass_moving(*_arrays(made), objects, floor, hands, most_wait))))


def _arrays(
    made: Made,
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
    return np.asarray(made.root_positions), np.asarray(made.rotations), np.asarray(made.contacts)


def _shortfall(made: tuple[core.Synthesis | core.Performed, core.Passing]) -> tuple[bool, int]:
    """What a motion lacks: its cue first, then the frames in which it runs into something."""
    synthesis, passing = made
    return not all_met(synthesis.report), sum(meeting["frames"] for meeting in passing["meetings"])


def _because_it_moves(error: Exception, request: Request) -> Exception:
    """What the scene was refused for, with what moves in it."""
    if not request.moving:
        return error
    found = list(dict.fromkeys(thing.name for thing in request.moving))
    names = ", ".join(f"‘{name}’" for name in found[:3])
    more = f" and {len(found) - 3} more" if len(found) > 3 else ""
    said = f"{error} What moves ({names}{more}) was taken as it stands at the first frame, and elsewhere too."
    return EdgeError(said, error.place, error.yaw) if isinstance(error, EdgeError) else SceneError(said)


def all_met(report: core.Report) -> bool:
    """Whether every cue was met; there is none where the action was not completed."""
    return bool(report["cues"]) and all(cue["met"] for cue in report["cues"])


def _log_request(request: Request) -> None:
    asked, library = request.task, request.library
    logger.info("%d triangles, preset %s, seed %d", len(request.triangles), request.preset, request.seed)
    logger.info("Library %s, starter %s; manifold %s", library.paths, library.starter, request.manifold or "that ships")
    hands = [cue["name"] for cue in hands_of(asked)]
    logger.info("Start %s, cues %s, hands %s, overrides %s", asked["start"], cues_of(asked), hands, request.overrides)
    logger.info("Waypoints %s", passes_of(asked))


def edit_steps(request: EditRequest, cache: LibraryCache) -> Steps[EditOutcome]:
    """Solves an artist's edit, and measures what came of it."""
    manifold = read_manifold(request.manifold)
    settings = merged(core.default_settings(request.preset), request.overrides)
    on_floor = {"floor_height": request.floor, **_given(settings["scene"])}
    still = request.positions, request.triangles
    stays = scene = (yield from finish(core.index_scene(*still, on_floor))) if len(request.triangles) else None
    if request.moving:
        # Who sits at the end sits on what stands there by then.
        last = [(thing.at(len(request.contacts)), thing.triangles) for thing in request.moving]
        scene = yield from finish(core.index_scene(*joined([still, *last]), on_floor))
    with told_in_scene_frames(request.start_frame, request.scene_rate, request.size):
        edited = yield from finish(
            core.edit_motion(
                request.motion.root_positions,
                request.motion.rotations,
                request.contacts,
                keys=request.keys,
                constraints=request.constraints,
                floor=request.floor,
                scene=scene,
                settings=settings,
                manifold=manifold,
            )
        )
    measured = None
    if request.task is not None:
        library = yield from _library_of(request, cache)
        seen = (request.task, request.moments, stays, settings, library)
        measured = yield from _looks(edited, request.moving, 0, *seen)
    hands = bool(request.task and hands_of(request.task))
    return EditOutcome(edited, measured, (yield from _past(request.moving, edited, request.floor, hands, 0)))


def _library_of(request: EditRequest, cache: LibraryCache) -> Steps[core.Library | None]:
    """What the motion was made of; None where it is gone or has changed, which is no reason to refuse an edit."""
    if request.library is None:
        return None
    try:
        library, _ = yield from library_steps(request.library, cache)
    except expected_errors() as error:
        if is_cancelled(error):
            raise
        logger.info("Nothing is said of the distance from known poses: %s", error)
        return None
    return library if library.checksum == request.library_checksum else None


def _given(settings: core.Settings) -> core.Settings:
    """The settings that have a value."""
    return {name: value for name, value in settings.items() if value is not None}


def read_manifold(path: str) -> core.Manifold | None:
    """The manifold of a file, or None for the one that ships. Raises what `native.expected_errors` names."""
    if not path:
        return None
    if not Path(path).is_file():
        raise SceneError(f"The motion manifold {path} is not there any more: choose another file, or leave it empty.")
    return core.Manifold.read(path)


def manifold_steps(choice: LibraryChoice, cache: LibraryCache, passes: int, path: str) -> Steps[core.Manifold]:
    """Trains a manifold on the library of a choice and writes it to `path`; gives it.

    After each pass the training is kept beside it, so that a cancelled one goes on where it was.
    """
    if not choice.paths:
        raise SceneError(
            "Add your own motion capture to the library first: the manifold that ships knows the starter library."
        )
    library, _ = yield from library_steps(choice, cache)
    checkpoint = checkpoint_of(path)
    manifold = yield from finish(core.train_manifold(library, {"epochs": passes}, MANIFOLD_SEED, str(checkpoint)))
    manifold.write(path)
    checkpoint.unlink(missing_ok=True)
    return manifold


def checkpoint_of(path: str) -> Path:
    """Where the training of a manifold is kept while it is under way."""
    return Path(path).with_suffix(CHECKPOINT_SUFFIX)


def merged(settings: core.Settings, overrides: core.Settings, where: str = "") -> core.Settings:
    """The settings with what `overrides` names replaced.

    Raises SceneError for a name that there is not, and for a group that is given as something else.
    """
    out = dict(settings)
    for name, value in overrides.items():
        if name not in settings:
            raise SceneError(f"There is no setting {where}{name}; choose one of {', '.join(sorted(settings))}.")
        if isinstance(settings[name], dict):
            if not isinstance(value, dict):
                raise SceneError(f"The setting {where}{name} is a group: give it as an object, not as {value!r}.")
            value = merged(settings[name], value, f"{where}{name}.")
        out[name] = value
    return out


def library_steps(choice: LibraryChoice, cache: LibraryCache) -> Steps[BuiltLibrary]:
    """The motion library of a choice, and what each of its captures gave."""
    key = (choice, _state_of_files(choice.paths, choice.mapping))
    built = cache.get(key)
    if built is None:
        finished = [path for path in choice.paths if _is_library_file(path)]
        mocap = [path for path in choice.paths if path not in finished]
        library: core.Library | None = None
        captures: Captures = []
        if mocap or not finished or choice.starter == "all":
            if not choice.paths and choice.starter == "none":
                raise SceneError("The motion library is empty: add mocap files, or let the starter library in.")
            foreign = foreign_files(mocap)
            converted = yield from convert_steps(foreign, choice.blender)
            readable = _readable(mocap, foreign, converted)
            starter = choice.starter if mocap else "all"
            asked: core.Settings = {"starter": starter, "sources": converted.sources}
            if choice.mapping:
                asked["mapping"] = choice.mapping
            library, captures = yield from finish(core.build_library(readable, asked))
            captures = [*captures, *converted.left_out]
        for path in finished:
            _check_kind(path)
            read = core.Library.read(path)
            library = read if library is None else library.merged(read)
        assert library is not None  # read or built: there are files of the one kind or the other
        built = (library, captures)
        cache.put(key, built)
    return built


def _readable(mocap: list[str], foreign: list[Path], converted: Converted) -> list[str]:
    """What the core reads of files and folders, and of what was made of others. Raises SceneError for nothing."""
    readable = [*(path for path in mocap if not _is_all_foreign(path)), *converted.sources]
    if mocap and not readable:
        first = converted.left_out[0]
        raise SceneError(
            f"None of the {len(foreign)} motion capture files could be used; {Path(first['file']).name}: "
            f"{first['reason']}"
        )
    return readable


def _is_all_foreign(path: str) -> bool:
    """Whether a file, or all captures of a folder, are of another format. A folder of none is the core's to refuse."""
    there = Path(path)
    if not there.is_dir():
        return is_foreign(there)
    return bool(foreign_files([path])) and not any(file.suffix.lower() == ".bvh" for file in there.rglob("*"))


def finish(job: core.Job[T]) -> Steps[T]:
    """The result of a job of the core, once it is done."""
    while not job.done():
        yield job
    return job.result()


def _is_library_file(path: str) -> bool:
    file = Path(path)
    return file.is_file() and file.suffix.lower() != ".bvh" and not is_foreign(file)


def _check_kind(path: str) -> None:
    """Raises SceneError for a file that is neither a capture nor of Oncue, whatever it is."""
    with Path(path).open("rb") as file:
        begins = file.read(5)
    if begins != b"ONCUE":
        raise SceneError(
            f"{path} is no capture that can be read: give .bvh, .fbx, .glb or .gltf files, folders of them, or Oncue's "
            "own motion libraries."
        )


def _state_of_files(paths: tuple[str, ...], mapping: str) -> FileStates:
    """Changes when a file of the library changes. Raises SceneError for a path that is gone."""
    state = []
    if mapping:
        if not Path(mapping).is_file():
            raise SceneError(f"The mapping file {mapping} is not there any more: choose another, or leave it empty.")
        paths = (*paths, mapping)
    for path in map(Path, paths):
        if not path.exists():
            raise SceneError(
                f"The motion library {path} is not there any more: remove it from the list or bring it back."
            )
        files = sorted(path.rglob("*")) if path.is_dir() else [path, *belongs_to(path)]
        state += [(str(f), f.stat().st_mtime_ns, f.stat().st_size) for f in files if f.is_file()]
    return tuple(state)


class _timed:
    """Writes the seconds that its block took; those of a block that comes again add up."""

    def __init__(self, seconds: dict[str, float], name: str) -> None:
        self._seconds, self._name = seconds, name

    def __enter__(self) -> None:
        self._began = time.perf_counter()

    def __exit__(self, *_: object) -> None:
        spent = time.perf_counter() - self._began
        self._seconds[self._name] = self._seconds.get(self._name, 0.0) + spent


# --- driving the steps -----------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Progress:
    """What a watcher sees at one moment."""

    stage: str = "Starting"
    #: Share of the stage, 0..1.
    fraction: float = 0.0
    update: int = 0
    reward: float = 0.0
    success_rate: float = 0.0
    elapsed_s: float = 0.0
    #: Estimate for the stage; None while there is too little to go by.
    remaining_s: float | None = None


class Run(Generic[T_co]):
    """Drives steps to their end. Cancel is a request that stays until the work has really stopped."""

    def __init__(self, steps: Steps[T_co]) -> None:
        self._steps = steps
        #: What the steps stand at.
        self._job: Work | None = None
        #: What they gave, once they have.
        self._given: tuple[T_co] | None = None
        self._error: Exception | None = None
        self._finished, self._cancelled = False, False
        self._began = self._stage_began = time.perf_counter()
        self._stage = ""

    @property
    def finished(self) -> bool:
        return self._finished

    def poll(self) -> bool:
        """Goes on where a job is done; whether everything is finished. Returns at once."""
        while not self._finished:
            if self._job is not None and not self._job.done():
                return False
            if self._cancelled:
                self._steps.close()
                self._finished = True
                break
            try:
                self._job = next(self._steps)
            except StopIteration as stop:
                self._given, self._finished = (stop.value,), True
            except Exception as error:  # kept for result(), which raises it where it is shown
                self._error, self._finished = error, True
        return True

    def wait(self, timeout_s: float) -> bool:
        """Polls for at most `timeout_s` seconds; whether everything is finished."""
        deadline = time.perf_counter() + timeout_s
        while not self.poll():
            left = deadline - time.perf_counter()
            if left <= 0.0:
                return False
            assert self._job is not None  # what poll waits for
            self._job.wait(min(left, 0.1))
        return True

    def cancel(self) -> None:
        self._cancelled = True
        if self._job is not None:
            self._job.cancel()

    @property
    def cancelled(self) -> bool:
        return self._cancelled

    def result(self) -> T_co:
        """The steps' value. Raises what they raised; Cancelled when a cancel was asked for, even too late.

        RuntimeError before the end.
        """
        if self._error is not None:
            raise self._error
        if self._cancelled:
            raise core.Cancelled("Cancelled.")
        if self._given is None:
            raise RuntimeError("The run has not finished yet.")
        return self._given[0]

    @property
    def failed(self) -> bool:
        """Whether it is finished and there is nothing to write."""
        return self._finished and (self._error is not None or self._cancelled)

    def progress(self) -> Progress:
        now = time.perf_counter()
        if self._job is None or self._finished:
            return Progress(elapsed_s=now - self._began)
        seen = self._job.progress()
        # A job that has only begun has no stage yet: it is still that of the one before.
        stage = seen["stage"] or self._stage or Progress.stage
        if stage != self._stage:
            self._stage, self._stage_began = stage, now
        # The core counts what it has done, which may be more than it meant to do.
        fraction, taken = min(max(0.0, float(seen["fraction"])), 1.0), now - self._stage_began
        remaining = taken * (1.0 - fraction) / fraction if fraction > 0.03 and taken > 1.0 else None
        return Progress(
            stage=stage,
            fraction=fraction,
            update=int(seen["update"]),
            reward=float(seen["reward"]),
            success_rate=float(seen["success_rate"]),
            elapsed_s=now - self._began,
            remaining_s=remaining,
        )


def run_blocking(steps: Steps[T], watch: Callable[[Progress], None] | None = None, every_s: float = 0.25) -> T:
    """Runs the steps to their end, showing the progress to `watch` now and then; gives or raises what they do."""
    run = Run(steps)
    try:
        while not run.wait(every_s):
            if watch:
                watch(run.progress())
    except BaseException:  # an interrupt must not leave the core's threads at work
        run.cancel()
        run.wait(5.0)
        raise
    return run.result()
