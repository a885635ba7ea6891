# SPDX-License-Identifier: GPL-3.0-or-later
"""The main job from the command line: the open (or named) file's cues → a new file with the action, and a report."""

from __future__ import annotations

import argparse
import json
import math
import sys
import traceback
from pathlib import Path

import bpy

from . import log, native
from .bridge import compat, session
from .bridge.policies import policy_cache
from .errors import SceneError
from .files import check_writable, write_whole
from .pipeline import LibraryCache, Outcome, Progress, run_blocking, shot_steps
from .properties import LARGEST_INTEGER, LAST_FRAME, SCENE_SCALES

#: Exit statuses: done; no result; written, but a cue was not met or the motion has another problem. argparse has one of
#: its own for a command it cannot read.
DONE, FAILED, USAGE, NOT_MET = 0, 1, 2, 3
EXIT_STATUSES = f"""exit status:
  {DONE}  the file and the report are written, every cue is met and nothing else is wrong
  {FAILED}  there is no result: one sentence on stderr says why, and so does the report
  {USAGE}  the command line cannot be read: nothing was looked at
  {NOT_MET}  the file and the report are written, but a cue was not met, or a limb is in body or scene"""


def parser() -> argparse.ArgumentParser:
    made = argparse.ArgumentParser(
        prog="batch.py",
        description=__doc__,
        epilog=EXIT_STATUSES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    made.add_argument("blend", nargs="?", type=Path, help="the scene; without it the file that is open")
    made.add_argument("--out", type=Path, required=True, help="the .blend file to write")
    made.add_argument("--report", type=Path, help="the report to write, JSON")
    made.add_argument("--seed", type=int, help="the same seed gives the same motion (default: the scene's)")
    made.add_argument(
        "--library",
        nargs="+",
        metavar="FILE_OR_FOLDER",
        help=".bvh, .fbx, .glb and .gltf files, folders of them, library files (default: the scene's)",
    )
    made.add_argument("--starter", choices=["all", "missing", "none"], help="what the starter library adds")
    made.add_argument(
        "--mapping", type=Path, help="how the captures are to be read, docs/captures.md (default: the scene's)"
    )
    made.add_argument("--manifold", type=Path, help="a motion manifold of your own (default: the scene's)")
    made.add_argument("--preset", help="settings of the optimization (default: the scene's)")
    made.add_argument("--overrides", help="settings that depart from the preset, as a JSON object")
    made.add_argument("--start-frame", type=int, help="frame of the first key (default: the scene's first)")
    made.add_argument("--log", type=Path, help="what Oncue does goes to this file, to be sent along with a question")
    made.add_argument("--verbose", action="store_true", help="the same on stderr")
    made.add_argument("--scene-scale", type=float, help="metres per scene unit; 0.01 for centimetres")
    return made


def main(arguments: list[str]) -> int:
    """Runs the job and gives the exit status; every failure is one sentence on stderr."""
    options = parser().parse_args(arguments)
    report = None
    try:
        if options.report:
            check_writable(options.report)
            report = options.report
        check_writable(options.out)
        if options.log:
            check_writable(options.log)
        begin_log(options, arguments)
        if options.blend:
            open_file(options.blend)
        with log.bugs():
            return synthesize(options)
    except native.expected_errors() as error:
        log.logger.error(native.sentence(error))
        return failed(options, report, native.sentence(error))
    except Exception as error:
        # A bug: the whole story goes where the progress goes, and stands in the log.
        traceback.print_exception(error, file=sys.stdout)
        return failed(options, report, f"The run ended by {native.bug_sentence(error)}")
    except KeyboardInterrupt:
        print("Oncue: Cancelled.", file=sys.stderr, flush=True)
        return FAILED
    finally:
        log.log_file.close()


def begin_log(options: argparse.Namespace, arguments: list[str]) -> None:
    if options.verbose:
        log.to_stderr()
    if options.log:
        log.log_file.open(str(options.log), blender=compat.BLENDER_VERSION, append=False)
    log.logger.info("Arguments: %s", " ".join(arguments))


def failed(options: argparse.Namespace, report: Path | None, why: str) -> int:
    """Says why there is no result, on stderr and in the report."""
    print(f"Oncue: {why}", file=sys.stderr, flush=True)
    if report:
        try:
            write_json(report, {"success": False, "problems": [why], "seed": options.seed})
        except SceneError as error:
            print(f"Oncue: {error}", file=sys.stderr, flush=True)
    return FAILED


def synthesize(options: argparse.Namespace) -> int:
    context = bpy.context
    if not hasattr(context.scene, "oncue"):
        raise SceneError("Oncue is not enabled in this Blender.")
    apply_options(context.scene, options)
    print("Oncue: reading the scene", flush=True)
    requests, skipped = session.read_shot(context)
    outcomes = run_blocking(shot_steps(requests, LibraryCache(), policy_cache(context)), ProgressPrinter())
    pairs = list(zip(requests, outcomes, strict=True))
    made = [(request, one, skipped) for request, one in pairs if isinstance(one, Outcome)]
    if len(pairs) == 1:
        report = session.report_of(session.write_outcome(context, *made[0]))
    else:
        refused = [(request.person, native.sentence(one)) for request, one in pairs if isinstance(one, Exception)]
        reports = [session.report_of(action) for action in session.write_shot(context, made)]
        report = session.shot_report(reports, refused, requests[0].seed)
    save(options.out)
    if options.report:
        write_json(options.report, report)
    for problem in session.problems_of(report):
        log.logger.warning(problem)
        print(f"Oncue: {problem}", flush=True)
    for cue in report.get("cues", []):
        print(f"Oncue: {cue['cue']}: pelvis {cue['pelvis_cm']:.1f} cm, facing {cue['facing_degrees']:.1f}°", flush=True)
    print(f"Oncue: wrote {options.out}", flush=True)
    return DONE if report.get("success", True) else NOT_MET


def apply_options(scene: bpy.types.Scene, options: argparse.Namespace) -> None:
    settings = scene.oncue
    if options.seed is not None:
        settings.seed = within(options.seed, "--seed", 0, LARGEST_INTEGER)
    if options.library is not None:
        settings.library_paths.clear()
        for path in options.library:
            settings.library_paths.add().path = str(Path(path).resolve())
    if options.starter is not None:
        settings.starter = options.starter.upper()
    if options.mapping is not None:
        settings.mapping = str(options.mapping.resolve())
    if options.manifold is not None:
        settings.manifold = str(options.manifold.resolve())
    if options.preset is not None:
        if options.preset not in native.preset_names():
            raise SceneError(f"There is no preset {options.preset}; choose one of {', '.join(native.preset_names())}.")
        settings.preset = options.preset
    if options.overrides is not None:
        session.read_overrides(options.overrides)
        settings.overrides = options.overrides
    if options.start_frame is not None:
        settings.start_frame = within(options.start_frame, "--start-frame", 0, LAST_FRAME)
    if options.scene_scale is not None:
        settings.scene_scale = within(options.scene_scale, "--scene-scale", *SCENE_SCALES)


def within(value, name: str, smallest, largest):
    """The value. Raises SceneError where the scene's setting cannot have it: Blender would take the nearest one."""
    if not (math.isfinite(value) and smallest <= value <= largest):
        raise SceneError(f"{name} {value} cannot be used: give a number from {smallest} to {largest}.")
    return value


def open_file(path: Path) -> None:
    if not path.is_file():
        raise SceneError(f"{path} is not there.")
    try:
        bpy.ops.wm.open_mainfile(filepath=str(path.resolve()))
    except RuntimeError as error:
        raise SceneError(f"{path} cannot be opened: {str(error).strip()}") from error


def save(path: Path) -> None:
    try:
        bpy.ops.wm.save_as_mainfile(filepath=str(path.resolve()), check_existing=False, compress=True)
    except RuntimeError as error:
        raise SceneError(f"{path} cannot be written: {str(error).strip()}") from error


def write_json(path: Path, report: dict) -> None:
    """Writes it whole or not at all. Raises SceneError."""
    write_whole(path, json.dumps(report, indent=2, ensure_ascii=False) + "\n")


class ProgressPrinter:
    """Prints a line when the stage changes, and within it one every few seconds when something has moved."""

    def __init__(self, every_s: float = 5.0) -> None:
        self._every, self._stage, self._seen, self._printed = every_s, "", None, -1e9

    def __call__(self, progress: Progress) -> None:
        seen = (progress.stage, round(progress.fraction, 2), progress.update)
        waiting = progress.stage == self._stage and progress.elapsed_s - self._printed < self._every
        if waiting or seen == self._seen:
            return
        self._stage, self._seen, self._printed = progress.stage, seen, progress.elapsed_s
        line = f"Oncue: {progress.elapsed_s:5.0f} s  {progress.stage} {progress.fraction * 100:.0f} %"
        if progress.update:
            line += f"  update {progress.update}"
            line += f", success {progress.success_rate * 100:.0f} %, reward {progress.reward:.2f}"
        print(line, flush=True)
