# SPDX-License-Identifier: GPL-3.0-or-later
"""Following the cues: while the artist drags one, the policy that is there plays a motion for each of its places.

Nothing is optimized. Library, scene index and kept policy stay in memory, so a motion takes some hundredths of a
second; once the cues rest, the best of many rollouts takes its place. Whoever drives this tells what moved and calls
`tick` over and over; reading the file and writing the motion is the `Host`'s. Knows no Blender.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from . import native
from .native import core
from .pipeline import (
    Asked,
    Captures,
    LibraryCache,
    Outcome,
    Request,
    Run,
    Steps,
    T,
    all_met,
    finish,
    library_steps,
    merged,
    read_manifold,
    task_of,
)
from .policy_cache import PolicyCache
from .scene_frames import in_scene_frames, told_in_scene_frames

#: Seconds without a change after which things are taken to rest.
REST = 0.5
#: While a cue moves: the best of a few rollouts. The editor stays as it is: it takes a third of their time.
MOVING: core.Settings = {"kept": {"rollouts": 16, "rounds": 0, "more_rounds": 0}, "ppo": {"updates": 0}}
#: At rest: what Synthesize gives where it need not optimize, but no long search where it would.
AT_REST: core.Settings = {"kept": {"more_rounds": 0}, "ppo": {"updates": 0}}

NO_POLICY = "There is no policy to play in this scene yet: press Synthesize once."
MISSED = "Not met here: press Synthesize."


class Host(Protocol):
    """Reads the file and writes into it. What it raises of `native.expected_errors()` is shown."""

    def read_scene(self) -> Request:
        """Everything, as Synthesize would read it."""

    def read_task(self, request: Request) -> Request:
        """`request` with the cues and settings as they are now; quick."""

    def shows(self, request: Request) -> bool:
        """Whether the motion that is there was made for this task."""

    def write(self, request: Request, outcome: Outcome, at_rest: bool) -> None:
        """Writes the motion in place of the one before."""


@dataclass(frozen=True)
class World:
    """What stays in memory: the scene as it was read and indexed, the library, and the policy kept for both."""

    request: Request
    library: core.Library
    captures: Captures
    scene: core.SceneIndex
    kept: core.Policy | None
    #: What seat and hands are fitted along; None for the one that ships.
    manifold: core.Manifold | None = None


def world_steps(request: Request, cache: LibraryCache, policies: PolicyCache, before: World | None) -> Steps[World]:
    """The world of a request; the scene of the one before is taken over where its triangles are the same."""
    manifold = read_manifold(request.manifold)
    library, captures = yield from library_steps(request.library, cache)
    if before is not None and _same_scene(request, before.request):
        scene = before.scene
    else:
        settings = merged(core.default_settings(request.preset), request.overrides)["scene"]
        scene = yield from finish(core.index_scene(request.positions, request.triangles, settings, request.task))
    return World(request, library, captures, scene, policies.find(scene, library), manifold)


def play_steps(world: World, request: Request, overrides: core.Settings) -> Steps[Outcome]:
    """The motion of the policy that is there; `overrides` come after the request's own."""
    began = time.perf_counter()
    settings = merged(merged(core.default_settings(request.preset), request.overrides), overrides)
    with told_in_scene_frames(request.start_frame, request.scene_rate):
        job = core.synthesize(
            world.scene, world.library, task_of(request.task), settings, request.seed, world.kept, world.manifold
        )
        synthesis = yield from finish(job)
    return Outcome(synthesis, {"synthesis": time.perf_counter() - began}, world.captures)


#: Starts whose heights differ by less stand on one floor, metres.
SAME_LEVEL = 0.05


def _same_scene(a: Request, b: Request) -> bool:
    settings = [(request.preset, request.overrides.get("scene")) for request in (a, b)]
    same = np.array_equal(a.positions, b.positions) and np.array_equal(a.triangles, b.triangles)
    # On other stairs it is another floor that is walked on; a rug is none.
    heights = [request.task["start"]["position"][2] for request in (a, b)]
    return same and settings[0] == settings[1] and abs(heights[0] - heights[1]) < SAME_LEVEL


class Follower:
    """Decides what is run next, one run at a time."""

    def __init__(
        self, host: Host, cache: LibraryCache, policies: PolicyCache, clock: Callable[[], float] = time.perf_counter
    ) -> None:
        self._host, self._cache, self._policies, self._clock = host, cache, policies, clock
        self._world: World | None = None
        #: When the cues changed first, of the changes that no run has taken up; None without any.
        self._cues_since: float | None = None
        #: When the cues and the meshes changed last; the meshes' is None once they were read.
        self._cues_at = clock()
        self._meshes_at: float | None = -np.inf
        #: The request played last, and whether a run at rest is still to come for it.
        self._played: Request | None = None
        self._unrested = False
        self._run: Run[object] | None = None
        #: Does with the run's value what it was begun for; raises what the run raised.
        self._finish: Callable[[], None] = lambda: None
        self._run_at_rest = False
        #: Cancelled runs whose threads may still be at work.
        self._leaving: list[Run[object]] = []
        #: What the artist should know, empty while all is well; whether the motion shown is the one at rest.
        self.line, self.rested = "", False
        #: Seconds from a cue's move to the written motion, the last time.
        self.delay: float | None = None

    # --- what happened ------------------------------------------------------------------------------------------------

    def cues_changed(self) -> None:
        """A cue may have moved. Cheap: whether it did is looked at in the next tick."""
        self._cues_at = self._clock()
        if self._cues_since is None:
            self._cues_since = self._cues_at

    def meshes_changed(self) -> None:
        """The scene may have changed; it is read again once it rests."""
        self._meshes_at = self._clock()

    def yield_to_full_run(self) -> None:
        """Somebody synthesizes: what the cues ask for now is in good hands, and a better policy may come of it."""
        self._drop()
        self._cues_since, self._unrested, self.line = None, False, ""
        self._meshes_at = -np.inf
        if self._world is not None:
            try:
                self._played = self._host.read_task(self._world.request)
            except native.expected_errors() as error:
                self.line = native.sentence(error)

    # --- the work -----------------------------------------------------------------------------------------------------

    def tick(self) -> None:
        """Goes on as far as it can without waiting."""
        if self._run is not None:
            if self._run_at_rest and self._cues_since is not None:
                self._drop()
                self._unrested = True
            elif not self._run.poll():
                return
            else:
                self._end()
        self._begin()

    def stop(self, wait_s: float = 0.0) -> None:
        """Cancels what is at work; waits for its threads for at most `wait_s` seconds."""
        self._drop()
        for run in self._leaving:
            run.wait(wait_s)
        self._leaving.clear()

    @property
    def idle(self) -> bool:
        """Whether nothing is at work or due."""
        due = self._cues_since is not None or self._meshes_at is not None or self._unrested
        return self._run is None and not due

    def _begin(self) -> None:
        now = self._clock()
        try:
            if self._meshes_at is not None and now - self._meshes_at >= REST:
                self._meshes_at = None
                request = self._host.read_scene()
                self._start(world_steps(request, self._cache, self._policies, self._world), self._set_world)
            elif self._world is None:
                return
            elif self._cues_since is not None:
                self._play_moved(self._world, self._cues_since)
            elif self._unrested and self._played is not None and now - self._cues_at >= REST:
                self._unrested = False
                self._play(self._world, self._played, AT_REST, None)
        except native.expected_errors() as error:
            self._refused(error)

    def _set_world(self, world: World) -> None:
        before, self._world = self._world, world
        if before is None and self._host.shows(world.request):
            self._played = world.request
        elif before is None or before.scene is not world.scene or before.library is not world.library:
            self._played = None
            self.cues_changed()

    def _play_moved(self, world: World, since: float) -> None:
        self._cues_since = None
        request = self._host.read_task(world.request)
        if self._played is None or _asked(request) != _asked(self._played):
            self._played, self.rested = request, False
            self._play(world, request, MOVING, since)

    def _play(self, world: World, request: Request, overrides: core.Settings, since: float | None) -> None:
        """`since`: when the cue moved; None for the run at rest."""

        def done(outcome: Outcome) -> None:
            report = outcome.synthesis.report
            if report["policy_source"] == "scratch":
                self.line = NO_POLICY
                return
            at_rest = since is None
            self._host.write(request, outcome, at_rest)
            self.rested, self._unrested = at_rest, not at_rest
            if since is not None:
                self.delay = self._clock() - since
            # Of a few rollouts none may meet the cue where one of many does.
            told = [in_scene_frames(said, request.start_frame, request.scene_rate) for said in report["problems"][:1]]
            missed = [] if all_met(report) else [MISSED]
            self.line = " ".join([*missed, *told]) if at_rest else ""

        self._start(play_steps(world, request, overrides), done, at_rest=since is None)

    def _start(self, steps: Steps[T], done: Callable[[T], None], at_rest: bool = False) -> None:
        run = Run(steps)
        self._run, self._finish, self._run_at_rest = run, lambda: done(run.result()), at_rest
        run.poll()

    def _end(self) -> None:
        self._run = None
        try:
            self._finish()
        except native.expected_errors() as error:
            self._refused(error)

    def _refused(self, error: BaseException) -> None:
        self.line, self._unrested = native.sentence(error), False

    def _drop(self) -> None:
        """Lets the run go at once; its threads stop by themselves."""
        if self._run is None:
            return
        self._run.cancel()
        self._leaving = [run for run in (*self._leaving, self._run) if not run.poll()]
        self._run = None


def _asked(request: Request) -> tuple[Asked, str, int, core.Settings]:
    """All of a request but the scene and the library."""
    return request.task, request.preset, request.seed, request.overrides
