"""The experiments. Each gives plain rows; `tables` and `plots` show them."""

from __future__ import annotations

import copy
import functools
import hashlib
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import oncue_core
from oncue_core import _native

from .scenes import Rooms, random_start
from .store import Store

Row = dict[str, Any]

#: All is measured after the controller, before the motion editor.
UNEDITED: dict[str, Any] = {"editor": {"fit": False}}

#: A controller as the paper has it at its end: no prior, the policy's mean alone. What is left shows the terms.
PLAIN = {"ppo": {"prior": False}, "kept": {"rollouts": 1, "rounds": 0, "more_rounds": 0}}

#: Section 4.3: each leaves out one part.
ABLATIONS: dict[str, dict[str, Any]] = {
    "whole": {},
    "without r_coli": {"reward": {"collision": False}},
    "without posture offset": {"signal": {"posture_offset": False}},
    "without smoothness": {"reward": {"transition_rate": 0.0, "velocity_rate": 0.0}},
}


@dataclass
class Bench:
    """What every experiment needs."""

    rooms: Rooms
    libraries: dict[str, oncue_core.Library]
    store: Store
    seed: int
    quick: bool
    say: Callable[[str], None]
    #: For naturalness and what an eye sees: the first so many tasks of these rooms; None for all.
    most_tasks: int | None = None
    only_rooms: list[str] | None = None
    #: For what an eye sees: so many motions of each task.
    seeds: int = 1

    def key(self, experiment: str, library: str, **what: Any) -> dict[str, Any]:
        from_what = {"experiment": experiment, "library": self.libraries[library].checksum, "seed": self.seed}
        return {**from_what, "core": core_fingerprint(), **what}


@functools.cache
def core_fingerprint() -> str:
    """Of the compiled core with the policy and the manifold in it: another build is measured anew."""
    return hashlib.sha256(Path(_native.__file__).read_bytes()).hexdigest()[:20]


def measured(bench: Bench, experiment: str, library: str, scene, task, settings: dict[str, Any]) -> Row:
    """The figures of one motion, from the store where they are there, with what they are of."""
    settings = merged(UNEDITED, settings)
    key = bench.key(experiment, library, scene=scene.index.fingerprint, task=task, settings=settings)
    run = functools.partial(synthesize, scene.index, bench.libraries[library], task, settings, bench.seed)
    row = bench.store.get(key, run)
    bench.say(f"{library}, {scene.name}, {task['cue']['name']}: {_short(row)}")
    return {"library": library, "room": scene.name, "cue": task["cue"]["name"], **row}


def merged(overrides: dict[str, Any], more: dict[str, Any]) -> dict[str, Any]:
    """Settings with what `more` names replaced."""
    out = copy.deepcopy(overrides)
    for name, value in more.items():
        out[name] = merged(out.get(name, {}), value) if isinstance(value, dict) else value
    return out


def synthesize(scene, library, task, settings, seed, policy=None) -> Row:
    """The figures of one motion; `problem` says in words why there is none, or what went wrong."""
    began = time.perf_counter()
    # Asked alone, so that settings that are refused do not count as a task that cannot be met.
    try:
        oncue_core.check_task(scene, task)
    except oncue_core.InputError as error:
        return {"problem": str(error), "unreachable": True, "success": False}
    report = oncue_core.synthesize(scene, library, task, settings, seed, policy).result().report
    cue = report["cues"][0] if report["cues"] else {"pelvis_cm": float("nan"), "facing_degrees": float("nan")}
    return {
        # The tables count cues that were met, as the paper's do; what a person would accept is asked for beside it.
        "success": bool(report["cues"]) and all(cue["met"] for cue in report["cues"]),
        "accepted": report["success"],
        "problem": " ".join(report["problems"]),
        "seconds": time.perf_counter() - began,
        "updates": report["updates"],
        "environment_steps": report["environment_steps"],
        "policy": report["policy_source"],
        "pelvis_cm": cue["pelvis_cm"],
        "facing_degrees": cue["facing_degrees"],
        "contact_cm": report["foot"]["contact_cm"],
        "skate_cm": report["foot"]["skate_cm"],
        "low_skate_cm": report["foot"]["low_skate_cm"],
        "penetration": report["penetration"]["percent"],
        "whole_body": report["penetration"]["whole_body_percent"],
        "parts": report["penetration"]["parts_percent"],
        "path_ratio": report["path_m"] / max(report["shortest_path_m"], 0.5),
        "joint_ratio": report["speed"]["joint_ratio"],
        "faster_turns": report["speed"]["faster_percent"],
        "acceleration_ratio": report["speed"]["acceleration_ratio"],
        "harder_percent": report["speed"]["harder_percent"],
        "walking": report["speed"]["walking"],
        "motion_seconds": report["frames"] / 30,
    }


def every_task(bench: Bench) -> Iterator[Row]:
    """Every task of the table, from nothing: a scene that was never seen, the policy that ships."""
    for name in bench.rooms.names[: 2 if bench.quick else None]:
        scene = bench.rooms.scene(name)
        for number, task in enumerate(scene.tasks[: 2 if bench.quick else None], 1):
            for library in bench.libraries:
                yield {"task": number, **measured(bench, "tasks", library, scene, task, {})}


def sequences(bench: Bench) -> Iterator[Row]:
    """Section 4.1: random starts towards the rooms' seats, after the controller."""
    for library in bench.libraries:
        for name in bench.rooms.names[: 2 if bench.quick else None]:
            scene = bench.rooms.scene(name)
            for number, task in enumerate(scene.tasks, 1):
                start = random_start(scene.index, task["cue"], np.random.default_rng([bench.seed, number]))
                if start is None or (bench.quick and number > 2):
                    continue
                drawn = {"start": start, "cue": task["cue"]}
                yield {"task": number, **measured(bench, "sequences", library, scene, drawn, {})}


def ablations(bench: Bench) -> Iterator[Row]:
    """Section 4.3: a policy from scratch for each task and variant; its mean is played."""
    library = next(iter(bench.libraries))
    for name in bench.rooms.names[: 1 if bench.quick else 4]:
        scene = bench.rooms.scene(name)
        for number, task in enumerate(scene.tasks[:1], 1):
            for variant, change in ABLATIONS.items():
                updates = {"ppo": {"updates": 2 if bench.quick else 12, "solved": 1.1}}
                settings = merged(merged(PLAIN, updates), change)
                row = measured(bench, "ablations", library, scene, task, settings)
                yield {"variant": variant, "task": number, **row}


def robustness(bench: Bench) -> Iterator[Row]:
    """Section 4.4: from how many starts a policy meets a cue: its own task's, generalized, and in unseen scenes."""
    library = next(iter(bench.libraries))
    first, *others = bench.rooms.names[:3] if not bench.quick else bench.rooms.names[:2]
    home = bench.rooms.scene(first)
    cues = home.tasks[: 2 if bench.quick else 4]
    test = {"spacing": 0.6 if bench.quick else 0.25}
    few = {"ppo": {"updates": 2, "solved": 1.1}} if bench.quick else {"ppo": {"updates": 12, "solved": 1.1}}
    own = merged(few, {"ppo": {"vary_start": 0.0}})
    for row in ("original", "generalized", "prior"):
        for number, task in enumerate(cues, 1):
            key = bench.key("robustness", library, row=row, scene=home.index.fingerprint, task=task, test=test, few=few)

            def make(row=row, task=task):
                policy = oncue_core.Policy.prior()
                lib = bench.libraries[library]
                if row == "original":
                    args = (home.index, lib, [cues[0]], own, bench.seed, None, False)
                    policy = oncue_core.optimize_policy(*args).result()[0]
                elif row == "generalized":
                    # Section 3.5, fine-tuned from the prior: random starts, the scene's cues.
                    args = (home.index, lib, list(cues), few, bench.seed, policy, True)
                    policy = oncue_core.optimize_policy(*args).result()[0]
                args = (home.index, lib, policy, task, {}, test, bench.seed)
                return oncue_core.robustness(*args).result()

            figures = bench.store.get(key, make)
            bench.say(
                f"{row}, {first}, cue {number}: {100 * figures['ratio']:.0f} % of {len(figures['starts'])} starts"
            )
            yield {"policy": row, "room": first, "task": number, "cue": task["cue"], **figures}
    for name in others:
        scene = bench.rooms.scene(name)
        for number, task in enumerate(scene.tasks[:2], 1):
            key = bench.key("robustness", library, row="unseen", scene=scene.index.fingerprint, task=task, test=test)

            def make(scene=scene, task=task):
                args = (scene.index, bench.libraries[library], oncue_core.Policy.prior(), task, {}, test, bench.seed)
                return oncue_core.robustness(*args).result()

            figures = bench.store.get(key, make)
            bench.say(
                f"unseen, {name}, cue {number}: {100 * figures['ratio']:.0f} % of {len(figures['starts'])} starts"
            )
            yield {"policy": "unseen scene", "room": name, "task": number, "cue": task["cue"], **figures}


def computation_time(bench: Bench) -> Iterator[Row]:
    """The supplementary's comparison: optimizing from scratch against inference with a policy that is there."""
    library = next(iter(bench.libraries))
    lib = bench.libraries[library]
    scene = bench.rooms.scene(bench.rooms.names[0])
    live = {"kept": {"rollouts": 16, "rounds": 0, "more_rounds": 0}}
    for number, task in enumerate(scene.tasks[: 2 if bench.quick else 5], 1):
        key = bench.key("time", library, scene=scene.index.fingerprint, task=task)

        def make(task=task):
            scratch = synthesize(scene.index, lib, task, merged(UNEDITED, {"ppo": {"prior": False}}), bench.seed)
            first = synthesize(scene.index, lib, task, UNEDITED, bench.seed)
            again = synthesize(scene.index, lib, task, merged(UNEDITED, live), bench.seed)
            return {
                "scratch_s": scratch.get("seconds"),
                "scratch_updates": scratch.get("updates"),
                "prior_s": first.get("seconds"),
                "inference_s": again.get("seconds"),
                "inference_success": again["success"] and again["updates"] == 0,
                "motion_s": again.get("motion_seconds"),
            }

        row = bench.store.get(key, make)
        bench.say(f"task {number}: scratch {row['scratch_s']:.1f} s, inference {row['inference_s']:.3f} s")
        yield {"room": scene.name, "task": number, **row}


def _short(row: Row) -> str:
    if "seconds" not in row:
        return row["problem"]
    return (
        f"{'met' if row['success'] else 'MISSED'} in {row['seconds']:.1f} s, {row['updates']} updates, "
        f"contact {row['contact_cm']:.1f} cm, penetration {row['penetration']:.1f} %, body {row['whole_body']:.1f} %"
    )
