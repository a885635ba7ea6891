"""`python3 -m nox -s evaluate -- [--quick] [--only NAME …] [--shared FOLDER] [--out FOLDER] [--docs FOLDER]`

With `--only` the other sections of a page that is there stay as they are.

Resumable: what is in `--out` is not measured again. `--quick` measures a few tasks, and fails where fewer than asked
meet their cue: counts, no times.
"""

from __future__ import annotations

import argparse
import datetime
import os
import platform
import sys
from pathlib import Path

import oncue_core

from . import editing, experiments, eyes, naturalness, page, pictures, report
from .scenes import Rooms, read_clips, read_libraries
from .store import Store

NAMES = ("tasks", "sequences", "ablations", "robustness", "time", "editing", "naturalness", "eyes", "variation")


def main() -> int:
    parser = argparse.ArgumentParser(prog="evaluate", description=__doc__)
    parser.add_argument("--shared", type=Path, help="the folder with data/rooms and data/mocap")
    parser.add_argument("--out", type=Path, default=Path("out/evaluation"), help="where results are kept")
    parser.add_argument("--docs", type=Path, help="where evaluation.md and its pictures go (default: --out)")
    parser.add_argument("--blender", help="a Python with bpy and oncue_core, which draws the editor's pictures")
    parser.add_argument("--only", nargs="+", choices=NAMES, default=NAMES)
    parser.add_argument("--quick", action="store_true", help="a few tasks, under 5 minutes")
    parser.add_argument(
        "--tasks", type=int, help="of each room, for naturalness and eyes: the first so many (default: all)"
    )
    parser.add_argument("--rooms", nargs="+", help="for naturalness and eyes: these rooms alone (default: all)")
    parser.add_argument("--seeds", type=int, default=3, help="for eyes: so many motions of each task")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()

    shared = options.shared if options.shared and options.shared.is_dir() else None
    rooms = Rooms(shared)
    libraries = read_libraries(shared)
    if not rooms.real:
        print("The real rooms are absent; rooms made by rule take their place.", flush=True)
    if options.quick:
        libraries = {"starter": libraries["starter"]}
    bench = experiments.Bench(
        rooms,
        libraries,
        Store(options.out / "results"),
        options.seed,
        options.quick,
        lambda line: print(line, flush=True),
        options.tasks,
        options.rooms,
        2 if options.quick else options.seeds,
    )
    docs = options.docs or options.out
    drawn = docs / "pictures"
    sections, missed = [], []
    if "tasks" in options.only:
        rows = list(experiments.every_task(bench))
        missed += [row for row in report.reachable(rows) if not row["success"]]
        sections.append(report.tasks_section(rows, drawn))
    if "sequences" in options.only:
        rows = list(experiments.sequences(bench))
        missed += [row for row in report.reachable(rows) if not row["success"]]
        sections.append(report.sequences_section(rows, libraries, drawn))
    if "ablations" in options.only:
        sections.append(report.ablations_section(list(experiments.ablations(bench)), drawn))
    if "robustness" in options.only:
        sections.append(report.robustness_section(list(experiments.robustness(bench)), drawn))
    if "time" in options.only:
        sections.append(report.time_section(list(experiments.computation_time(bench))))
    if "editing" in options.only:
        seats = list(editing.seats(bench))
        objects = shared / "data" / "objects" if shared else None
        openings = list(editing.openings(bench, objects)) if objects and objects.is_dir() else []
        missed += [row for row in editing.missed(seats + openings) if not row.get("hanging")]
        if options.blender and shared and not options.quick:
            pictures.draw(options.blender, shared / "data", options.out, drawn, bench.say)
        sections.append(report.editing_section(seats, openings, drawn))
    if "naturalness" in options.only:
        sections.append(report.naturalness_section(list(naturalness.naturalness(bench))))
    if "eyes" in options.only:
        clips = {} if options.quick else {name: eyes.of_clips(library) for name, library in read_clips(shared).items()}
        sections.append(report.eyes_section(list(eyes.every_motion(bench)), clips))
    if "variation" in options.only:
        sections.append(report.variation_section(list(eyes.variation(bench))))
    docs.mkdir(parents=True, exist_ok=True)
    file = docs / "evaluation.md"
    if file.is_file() and options.only != NAMES:
        anew = [page.stamped(section, _made(options)) for section in sections]
        text = page.replaced(file.read_text(encoding="utf-8"), anew)
    else:
        text = "\n\n".join([_head(options), *sections]) + "\n"
    file.write_text(text, encoding="utf-8")
    print(f"wrote {file}")
    if options.quick and len(missed) > 1:
        print(f"{len(missed)} cues were missed", file=sys.stderr)
        return 1
    return 0


def _made(options: argparse.Namespace) -> str:
    """When, where and by which command."""
    today = datetime.date.today().isoformat()
    machine = f"{os.cpu_count()} cores, {platform.machine()}, Python {platform.python_version()}"
    words = "".join(f" --only {' '.join(options.only)}" if options.only != NAMES else "")
    words += f" --tasks {options.tasks}" if options.tasks else ""
    words += f" --rooms {' '.join(options.rooms)}" if options.rooms else ""
    words += f" --seeds {options.seeds}" if options.seeds != 3 else ""
    command = f"python3 -m nox -s evaluate --{' --quick' if options.quick else ''}{words} --seed {options.seed}"
    return f"{today}, {machine}, oncue {oncue_core.__version__}. Made by `{command}`"


def _head(options: argparse.Namespace) -> str:
    paper = "the paper's figures are those of Lee and Joo, ICCV 2023, on other rooms and motion capture."
    return f"# Evaluation\n\n{_made(options)}; {paper}"


if __name__ == "__main__":
    sys.exit(main())
