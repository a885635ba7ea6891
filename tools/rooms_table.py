"""Runs the main job on tasks of a rooms.tsv through Blender, and writes a table and a contact sheet of each task.

`python -m nox -s rooms` makes both tables of docs/rooms: with the starter library alone, and with ACCAD's captures,
which lack sits and get the starter's. The rooms and the captures are those of `../shared/data`, or of
`$ONCUE_SHARED/data`, or of the folders that are named.

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
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from PIL import Image

ROOT = Path(__file__).resolve().parents[1]
DATA = Path(os.environ.get("ONCUE_SHARED", ROOT.parent / "shared")) / "data"
#: Two scanned rooms and a modelled flat.
TASKS = ("quest_living_room", "quest_meeting_room", "sh3d_Studio:1", "sh3d_Studio:2")
#: Exit statuses of batch.py with a motion: the cue was met, or missed.
WRITTEN = (0, 3)
#: What counts as met, centimetres and degrees.
NEAR, TURNED = 10.0, 20.0
SHEET_WIDTH = 2000


@dataclass(frozen=True)
class Table:
    """One library over all tasks."""

    name: str
    title: str
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
        cue = self.figures["cues"][0] if self.figures else None
        return cue is not None and cue["pelvis_cm"] <= NEAR and abs(cue["facing_degrees"]) <= TURNED


#: Heading → what stands under it, from a report.
COLUMNS = {
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


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--python", required=True, help="a Python with bpy and oncue_core")
    parser.add_argument("--rooms", type=Path, default=DATA / "rooms", help="rooms.tsv and the rooms' GLB files")
    parser.add_argument("--accad", type=Path, default=DATA / "mocap" / "accad", help="ACCAD's .bvh files")
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "rooms", help="for the tables and the sheets")
    parser.add_argument("--table", nargs="+", choices=["starter", "accad"], default=["starter", "accad"])
    parser.add_argument("--task", nargs="+", default=TASKS, metavar="ROOM[:N]", help="`all` for every one")
    parser.add_argument("--seed", default="1")
    parser.add_argument("--no-sheets", action="store_true")
    parser.add_argument("--keep", action="store_true", help="keep the motions of an earlier call, draw them anew")
    options = parser.parse_args()
    for folder in (options.rooms / "rooms.tsv", *([options.accad] if "accad" in options.table else [])):
        if not folder.exists():
            parser.error(f"{folder} is not there: name it, or set ONCUE_SHARED")
    tables = {
        "starter": Table("starter", "The starter library alone"),
        "accad": Table("accad", "ACCAD's captures with the starter library's sits", (str(options.accad),)),
    }
    options.out.mkdir(parents=True, exist_ok=True)
    for table in (tables[name] for name in options.table):
        rows: list[Row] = []
        for room, task in tasks(options.rooms / "rooms.tsv", options.task):
            rows.append(run(options, table, room, task))
            (options.out / f"{table.name}.md").write_text(markdown(options, table, rows), encoding="utf-8")
            print(f"{table.name}: {' | '.join(cells(rows[-1]))}", flush=True)


def tasks(table: Path, wanted: list[str]) -> list[tuple[str, str]]:
    with table.open(newline="", encoding="utf-8") as file:
        every = [(row["room"], row["task"]) for row in csv.DictReader(file, delimiter="\t")]
    return [(r, t) for r, t in every if "all" in wanted or r in wanted or f"{r}:{t}" in wanted]


def run(options: argparse.Namespace, table: Table, room: str, task: str) -> Row:
    """Makes one task's scene, motion and sheet."""
    work = ROOT / "out" / "rooms"
    scene, result = work / "scenes" / f"{room}-{task}.blend", work / table.name / f"{room}-{task}.blend"
    report, clock, sheet = result.with_suffix(".json"), result.with_suffix(".seconds"), result.with_suffix(".png")
    published = options.out / f"{table.name}-{room}-{task}.jpg"
    if not scene.exists():
        rooms = ["--room", str(options.rooms / f"{room}.glb"), "--tasks", str(options.rooms / "rooms.tsv")]
        checked(quietly(options, "blend_fixtures/make_fixtures.py", *rooms, "--out", str(scene.parent)))
    if not (options.keep and report.exists()):
        library = ["--library", *table.library] if table.library else []
        files = [str(scene), "--out", str(result), "--report", str(report)]
        began = time.monotonic()
        status, said = quietly(options, "addon/batch.py", *files, "--seed", options.seed, *library)
        clock.parent.mkdir(parents=True, exist_ok=True)
        clock.write_text(f"{time.monotonic() - began:.1f}")
        if status not in WRITTEN:
            return Row(f"{room} {task}", published, float(clock.read_text()), None, said.strip().splitlines()[-1])
    figures = json.loads(report.read_text())
    if not options.no_sheets:
        checked(quietly(options, "blend_fixtures/render.py", str(result), "--sheet", str(sheet)))
        with Image.open(sheet) as image:
            height = round(image.height * SHEET_WIDTH / image.width)
            image.convert("RGB").resize((SHEET_WIDTH, height)).save(published, quality=80)
    problem = " ".join(figures["problems"])
    return Row(f"{room} {task}", published, float(clock.read_text()), figures, problem)


def quietly(options: argparse.Namespace, script: str, *arguments: str) -> tuple[int, str]:
    """The exit status and the words of one of the repository's scripts."""
    command = [options.python, str(ROOT / script), *arguments]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, check=False)
    return done.returncode, done.stdout + done.stderr


def checked(outcome: tuple[int, str]) -> None:
    """Ends with the words of a script that failed."""
    if outcome[0]:
        raise SystemExit(outcome[1][-2000:])


def cells(row: Row) -> list[str]:
    name = f"[{row.task}]({row.sheet.name})" if row.sheet.exists() else row.task
    figures = [show(row.figures) if row.figures else "" for show in COLUMNS.values()]
    return [name, f"{row.seconds:.0f}", *figures, row.problem]


def markdown(options: argparse.Namespace, table: Table, rows: list[Row]) -> str:
    percent = [row.figures["penetration"]["percent"] for row in rows if row.figures]
    headings = ["task", "seconds", *COLUMNS, "what went wrong"]
    # Folders are left out: where they lie on this machine is nobody's business.
    command = f"--table {table.name}" + ("" if options.seed == "1" else f" --seed {options.seed}")
    lines = [
        f"# {table.title}",
        "",
        f"{datetime.date.today()}, {os.cpu_count()} cores ({platform.machine()}), seed {options.seed}: "
        f"{sum(row.met for row in rows)} of {len(rows)} tasks end seated within {NEAR:.0f} cm and {TURNED:.0f}° of the "
        f"cue; mean penetration {sum(percent) / max(1, len(percent)):.2f} % of the frames.",
        "",
        "| " + " | ".join(headings) + " |",
        "|" + "---|" * len(headings),
        *["| " + " | ".join(cells(row)) + " |" for row in rows],
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
