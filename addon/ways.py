# SPDX-License-Identifier: GPL-3.0-or-later
"""The ways that people would walk, found before anything is run: what the view draws while cues are placed.

Nothing is played. The scene is read and indexed once, and each place of a cue after that takes some hundredths of a
second. Whoever drives this tells what moved and calls `tick` over and over; reading the file is the `Host`'s. Knows no
Blender.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from .live import SAME_LEVEL
from .log import logger
from .native import core, expected_errors, sentence
from .pipeline import Request, Run, Steps, finish, merged

#: Seconds without a change of what stands about after which it is read anew.
REST = 0.5
#: A scene of more triangles is read anew by the button alone.
LARGE = 300_000
CHANGED = "What stands about has changed since the ways were found: press Show Ways twice to look again."


class Host(Protocol):
    """Reads the file. What it raises of `native.expected_errors()` is shown."""

    def read(self, before: list[Request] | None) -> list[Request]:
        """What the ways are found by, as it stands now: one entry a person.

        With `before` the meshes are those of that reading; quick.
        """


@dataclass(frozen=True)
class Way:
    """The way to one cue, the scene's metres; `path` is empty where none begins."""

    #: Whose it is, from 0.
    person: int
    path: tuple[tuple[float, ...], ...]
    #: Where it would fail; None where all is well.
    fails_at: tuple[float, ...] | None = None


@dataclass(frozen=True)
class Indexed:
    """A scene as it was indexed, and for which start's floor and settings."""

    of: Request
    settings: core.Settings
    scene: core.SceneIndex

    def serves(self, request: Request, settings: core.Settings) -> bool:
        heights = [float(one.task["start"]["position"][2]) for one in (self.of, request)]
        same = self.of.positions is request.positions and self.settings == settings
        return same and abs(heights[0] - heights[1]) < SAME_LEVEL


def ways_steps(requests: list[Request], before: Indexed | None = None) -> Steps[tuple[Indexed, core.Ways]]:
    """The ways of all people, in a scene that was indexed before where it is the same."""
    first, asked = requests[0], [request.task for request in requests]
    task = asked[0] if len(asked) == 1 else asked
    settings = merged(core.default_settings(first.preset), first.overrides)["scene"]

    def index() -> Steps[Indexed]:
        job = core.index_scene(first.positions, first.triangles, settings, task)  # type: ignore[arg-type]
        return Indexed(first, settings, (yield from finish(job)))

    indexed = before if before is not None and before.serves(first, settings) else (yield from index())
    ways = yield from finish(core.find_ways(indexed.scene, task))  # type: ignore[arg-type]
    if indexed is before and any(step["problem"] for person in ways["people"] for step in person["steps"]):
        # Of a scene that is very wide only what lies about the cues is indexed, and these may have left it.
        indexed = yield from index()
        ways = yield from finish(core.find_ways(indexed.scene, task))  # type: ignore[arg-type]
    return indexed, ways


class Finder:
    """Decides what is looked for next, one run at a time, and has what was found last."""

    def __init__(self, host: Host, clock: Callable[[], float] = time.perf_counter) -> None:
        self._host, self._clock = host, clock
        self._cues_moved = self._meshes_moved = True
        #: When what stands about changed last; long ago at first, so that it is read at once.
        self._since = -REST
        self._requests: list[Request] | None = None
        self._indexed: Indexed | None = None
        self._run: Run[tuple[Indexed, core.Ways]] | None = None
        #: What is drawn and said.
        self.ways: list[Way] = []
        self.said: list[str] = []

    def cues_changed(self) -> None:
        self._cues_moved = True

    def meshes_changed(self) -> None:
        if self._requests is not None and len(self._requests[0].triangles) > LARGE:
            if CHANGED not in self.said:
                self.said = [*self.said, CHANGED]
            return
        self._meshes_moved, self._since = True, self._clock()

    @property
    def idle(self) -> bool:
        """Whether nothing is looked for, nor waits to be."""
        return self._run is None and not self._cues_moved and not self._meshes_moved

    def tick(self) -> bool:
        """One look; whether what is drawn or said is new."""
        if self._run is not None:
            return self._run.poll() and self._take()
        rests = self._clock() - self._since >= REST
        if not (self._cues_moved or (self._meshes_moved and rests)):
            return False
        reads_all = self._meshes_moved and rests
        self._cues_moved = False
        try:
            self._requests = self._host.read(None if reads_all else self._requests)
            self._meshes_moved = self._meshes_moved and not reads_all
            self._run = Run(ways_steps(self._requests, self._indexed))
            return self._run.poll() and self._take()
        except expected_errors() as error:
            # Nothing to find a way by, as without a start.
            self._meshes_moved = False
            self._requests = None
            return self._show([], [sentence(error)])

    def stop(self) -> None:
        if self._run is not None:
            self._run.cancel()
            self._run = None

    def _take(self) -> bool:
        run, requests = self._run, self._requests
        assert run is not None
        assert requests is not None
        self._run = None
        try:
            self._indexed, found = run.result()
        except expected_errors() as error:
            logger.info("The ways were not found: %s", error)
            return self._show([], [sentence(error)])
        ways, said = [], []
        for number, (person, request) in enumerate(zip(found["people"], requests, strict=True)):
            for step in person["steps"]:
                path = tuple(tuple(c * request.size for c in point) for point in step["path"])
                at = step["fails_at"]
                ways.append(Way(number, path, None if at is None else tuple(c * request.size for c in at)))
                if step["problem"]:
                    said.append(f"{request.person}: {step['problem']}" if request.person else step["problem"])
        return self._show(ways, [*said, *found["problems"]])

    def _show(self, ways: list[Way], said: list[str]) -> bool:
        is_new = (ways, said) != (self.ways, self.said)
        self.ways, self.said = ways, said
        return is_new
