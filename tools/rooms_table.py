"""Runs the main job on real rooms and objects through Blender, and writes a table and a contact sheet of each task.

`python -m nox -s rooms` makes the tables of docs/rooms: the rooms with the starter library alone, and with ACCAD's
captures, which lack sits and get the starter's; and the objects that a hand opens. Rooms, objects and captures are
those of `../shared/data`, or of `$ONCUE_SHARED/data`.

For each task: `blend_fixtures/make_fixtures.py` makes the scene, `addon/batch.py` synthesizes,
`blend_fixtures/render.py` draws.
"""

from __future__ import annotations

import argparse
import csv
import datetime
import json
import os
import platform
import subprocess
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from PIL import Image

ROOT = Path(__file__).resolve().parents[1]
DATA = Path(os.environ.get("ONCUE_SHARED", ROOT.parent / "shared")) / "data"
#: Two scanned rooms and a modelled flat.
TASKS = ("quest_living_room", "quest_meeting_room", "sh3d_Studio:1", "sh3d_Studio:2")
TABLES = ("starter", "accad", "objects")
#: Exit statuses of batch.py with a motion: the cue was met, or missed.
WRITTEN = (0, 3)
#: What counts as met, centimetres and degrees.
NEAR, TURNED = 10.0, 20.0
SHEET_WIDTH = 2000


@dataclass(frozen=True)
class Task:
    """One row of a table: the scene's name, what it is called, and the words that make it."""

    name: str
    label: str
    make: tuple[str, ...]


@dataclass(frozen=True)
class Table:
    """One library over some tasks."""

    name: str
    title: str
    tasks: list[Task]
    #: Heading → what stands under it, from a report.
    columns: dict[str, Callable[[dict[str, Any]], str]]
    library: tuple[str, ...] = ()


@dataclass(frozen=True)
class Row:
    """What one task came to; `figures` is its report, or None where there is no motion."""

    task: str
    sheet: Path
    seconds: float
    figures: dict[str, Any] | None
    problem: str

    @property
    def met(self) -> bool:
        """The cue, and by the hand all that it followed."""
        if self.figures is None:
            return False
        cue, hands = self.figures["cues"][0], hands_of(self.figures)
        near = cue["pelvis_cm"] <= NEAR and abs(cue["facing_degrees"]) <= TURNED
        expected = len(self.figures["task"].get("manipulations", []))
        return near and len(hands) >= expected and all(hand["met"] for hand in hands)


def hands_of(report: dict[str, Any]) -> list[dict[str, Any]]:
    """What is left of the hands' paths."""
    constraints = (report.get("edited") or {}).get("constraints", [])
    return [found for found in constraints if found["joint"].endswith("Hand")]


def hand_cm(report: dict[str, Any], which: str) -> str:
    found = [hand[which] for hand in hands_of(report)]
    return f"{max(found):.2f}" if found else ""


ROOM_COLUMNS = {
    "updates": lambda r: str(r["updates"]),
    "pelvis cm": lambda r: f"{r['cues'][0]['pelvis_cm']:.1f}",
    "facing °": lambda r: f"{r['cues'][0]['facing_degrees']:.1f}",
    "contact cm": lambda r: f"{r['foot']['contact_cm']:.2f}",
    "skate cm/frame": lambda r: f"{r['foot']['skate_cm']:.3f}",
    "sole low cm/frame": lambda r: f"{r['foot']['low_skate_cm']:.2f}",
    "penetration %": lambda r: f"{r['penetration']['percent']:.1f}",
    "whole body %": lambda r: f"{r['penetration']['whole_body_percent']:.1f}",
    "path m": lambda r: f"{r['path_m']:.1f}",
    "shortest m": lambda r: f"{r['shortest_path_m']:.1f}",
}
OBJECT_COLUMNS = {
    "hand's way s": lambda r: f"{len(r['task']['manipulations'][0]['path']) / 30:.1f}",
    "hand off, mean cm": lambda r: hand_cm(r, "mean_cm"),
    "hand off, max cm": lambda r: hand_cm(r, "max_cm"),
    "editing s": lambda r: f"{r['edited']['seconds']:.1f}" if r["edited"] else "",
    **{name: ROOM_COLUMNS[name] for name in ("pelvis cm", "facing °", "contact cm", "skate cm/frame", "whole body %")},
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--python", required=True, help="a Python with bpy and oncue_core")
    parser.add_argument("--rooms", type=Path, default=DATA / "rooms", help="rooms.tsv and the rooms' GLB files")
    parser.add_argument("--objects", type=Path, default=DATA / "objects", help="objects.tsv and the objects' GLB files")
    parser.add_argument("--accad", type=Path, default=DATA / "mocap" / "accad", help="ACCAD's .bvh files")
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "rooms", help="for the tables and the sheets")
    parser.add_argument("--table", nargs="+", choices=TABLES, default=TABLES)
    parser.add_argument("--task", nargs="+", default=TASKS, metavar="ROOM[:N]", help="rooms; `all` for every one")
    parser.add_argument("--seed", default="1")
    parser.add_argument("--no-sheets", action="store_true")
    parser.add_argument("--keep", action="store_true", help="keep the motions of an earlier call, draw them anew")
    options = parser.parse_args()
    for file in (options.rooms / "rooms.tsv", options.objects / "objects.tsv", options.accad):
        if not file.exists():
            parser.error(f"{file} is not there: name it, or set ONCUE_SHARED")
    rooms, objects = room_tasks(options.rooms, options.task), object_tasks(options.objects)
    captures = (str(options.accad),)
    tables = {
        "starter": Table("starter", "The starter library alone", rooms, ROOM_COLUMNS),
        "accad": Table("accad", "ACCAD's captures with the starter library's sits", rooms, ROOM_COLUMNS, captures),
        "objects": Table("objects", "What a hand opens", objects, OBJECT_COLUMNS),
    }
    options.out.mkdir(parents=True, exist_ok=True)
    for table in (tables[name] for name in options.table):
        rows: list[Row] = []
        for task in table.tasks:
            rows.append(run(options, table, task))
            (options.out / f"{table.name}.md").write_text(markdown(options, table, rows), encoding="utf-8")
            print(f"{table.name}: {' | '.join(cells(table, rows[-1]))}", flush=True)


def rows_of(table: Path) -> list[dict[str, str]]:
    with table.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file, delimiter="\t"))


def room_tasks(folder: Path, wanted: list[str]) -> list[Task]:
    table, tasks = folder / "rooms.tsv", []
    for row in rows_of(table):
        room, number = row["room"], row["task"]
        if "all" in wanted or room in wanted or f"{room}:{number}" in wanted:
            make = ("--room", str(folder / f"{room}.glb"), "--tasks", str(table))
            tasks.append(Task(f"{room}-{number}", f"{room} {number}", make))
    return tasks


def object_tasks(folder: Path) -> list[Task]:
    table = folder / "objects.tsv"
    return [
        Task(part, part.replace("_", " "), ("--object", str(folder / row["file"]), "--tasks", str(table)))
        for row in rows_of(table)
        for part in [row["moving_node"]]
    ]


def run(options: argparse.Namespace, table: Table, task: Task) -> Row:
    """Makes one task's scene, motion and sheet."""
    work = ROOT / "out" / "rooms"
    scene, result = work / "scenes" / f"{task.name}.blend", work / table.name / f"{task.name}.blend"
    report, clock, sheet = result.with_suffix(".json"), result.with_suffix(".seconds"), result.with_suffix(".png")
    published = options.out / f"{table.name}-{task.name}.jpg"
    if not scene.exists():
        checked(quietly(options, "blend_fixtures/make_fixtures.py", *task.make, "--out", str(scene.parent)))
    if not (options.keep and report.exists()):
        library = ["--library", *table.library] if table.library else []
        files = [str(scene), "--out", str(result), "--report", str(report)]
        began = time.monotonic()
        status, said = quietly(options, "addon/batch.py", *files, "--seed", options.seed, *library)
        clock.parent.mkdir(parents=True, exist_ok=True)
        clock.write_text(f"{time.monotonic() - began:.1f}")
        if status not in WRITTEN:
            return Row(task.label, published, float(clock.read_text()), None, said.strip().splitlines()[-1])
    figures = json.loads(report.read_text())
    if not options.no_sheets:
        checked(quietly(options, "blend_fixtures/render.py", str(result), "--sheet", str(sheet)))
        with Image.open(sheet) as image:
            height = round(image.height * SHEET_WIDTH / image.width)
            image.convert("RGB").resize((SHEET_WIDTH, height)).save(published, quality=80)
    problem = " ".join(figures["problems"])
    return Row(task.label, published, float(clock.read_text()), figures, problem)


def quietly(options: argparse.Namespace, script: str, *arguments: str) -> tuple[int, str]:
    """The exit status and the words of one of the repository's scripts."""
    command = [options.python, str(ROOT / script), *arguments]
    # A user folder of its own each time: no policy that an earlier task left is played.
    with tempfile.TemporaryDirectory() as folder:
        environment = {**os.environ, "BLENDER_USER_RESOURCES": folder}
        done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, env=environment, check=False)
    return done.returncode, done.stdout + done.stderr


def checked(outcome: tuple[int, str]) -> None:
    """Ends with the words of a script that failed."""
    if outcome[0]:
        raise SystemExit(outcome[1][-2000:])


def cells(table: Table, row: Row) -> list[str]:
    name = f"[{row.task}]({row.sheet.name})" if row.sheet.exists() else row.task
    figures = [show(row.figures) if row.figures else "" for show in table.columns.values()]
    return [name, f"{row.seconds:.0f}", *figures, row.problem]


def markdown(options: argparse.Namespace, table: Table, rows: list[Row]) -> str:
    percent = [row.figures["penetration"]["percent"] for row in rows if row.figures]
    headings = ["task", "seconds", *table.columns, "what went wrong"]
    # Folders are left out: where they lie on this machine is nobody's business.
    command = f"--table {table.name}" + ("" if options.seed == "1" else f" --seed {options.seed}")
    lines = [
        f"# {table.title}",
        "",
        f"{datetime.date.today()}, {os.cpu_count()} cores ({platform.machine()}), seed {options.seed}: "
        f"{sum(row.met for row in rows)} of {len(rows)} tasks end within {NEAR:.0f} cm and {TURNED:.0f}° of the cue, "
        f"the hand within 1 cm of its path where there is one; mean penetration "
        f"{sum(percent) / max(1, len(percent)):.2f} % of the frames.",
        "",
        "| " + " | ".join(headings) + " |",
        "|" + "---|" * len(headings),
        *["| " + " | ".join(cells(table, row)) + " |" for row in rows],
        "",
        "Seconds are those of the whole batch command, Blender's start included. Contact and penetration are the",
        "paper's measures; `sole low` is the speed of every foot within 1 cm of the floor, whatever its label;",
        "`whole body` counts any crossing of any limb, the torso, the head or the feet outside the seat's.",
        "",
        f"Made by `python -m nox -s rooms -- {command}`.",
        "",
    ]
    return "\n".join(lines)


if __name__ == "__main__":
    main()
