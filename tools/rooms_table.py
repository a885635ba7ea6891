"""Runs the main job on tasks of a rooms.tsv through Blender, and writes the table and a contact sheet of each.

`python -m nox -s rooms -- --rooms FOLDER --out docs/rooms --title TITLE [--task ROOM:N …] [--library PATH …]`

For each task: `blend_fixtures/make_fixtures.py` makes the scene, `addon/batch.py` synthesizes,
`blend_fixtures/render.py` draws. A task whose report is already in the work folder is not run again.
"""

from __future__ import annotations

import argparse
import csv
import datetime
import json
import os
import platform
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from PIL import Image

ROOT = Path(__file__).resolve().parents[1]

HEADINGS = [
    "task", "seconds", "updates", "pelvis cm", "facing °", "contact cm", "skate cm/frame", "sole low cm/frame",
    "penetration %", "whole body %", "path m", "shortest m", "what went wrong",
]  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--python", required=True, help="a Python with bpy and oncue_core")
    parser.add_argument("--rooms", type=Path, required=True, help="a folder with rooms.tsv and the rooms' GLB files")
    parser.add_argument("--out", type=Path, required=True, help="where the table and the sheets go")
    parser.add_argument("--title", default="The starter library alone")
    parser.add_argument("--task", nargs="+", default=[], metavar="ROOM[:N]")
    parser.add_argument("--library", nargs="+", default=[])
    parser.add_argument("--seed", default="1")
    parser.add_argument("--no-sheets", action="store_true")
    options = parser.parse_args()
    name = options.title.lower().replace(" ", "-")
    work = ROOT / "out" / "rooms" / name
    work.mkdir(parents=True, exist_ok=True)
    options.out.mkdir(parents=True, exist_ok=True)
    rows = []
    for room, task in tasks(options.rooms / "rooms.tsv", options.task):
        rows.append(run(options, work, room, task))
        write_table(options, name, rows)
        print(" | ".join(rows[-1]), flush=True)


def tasks(table: Path, wanted: list[str]) -> list[tuple[str, str]]:
    with table.open(newline="", encoding="utf-8") as file:
        every = [(row["room"], row["task"]) for row in csv.DictReader(file, delimiter="\t")]
    return [(r, t) for r, t in every if not wanted or r in wanted or f"{r}:{t}" in wanted]


def run(options: argparse.Namespace, work: Path, room: str, task: str) -> list[str]:
    scene, result = work / "scenes" / f"{room}-{task}.blend", work / f"{room}-{task}.blend"
    report = result.with_suffix(".json")
    call = [options.python, str(ROOT / "blend_fixtures/make_fixtures.py")]
    if not scene.exists():
        glb, table = options.rooms / f"{room}.glb", options.rooms / "rooms.tsv"
        quietly([*call, "--room", str(glb), "--tasks", str(table), "--out", str(scene.parent)])
    seconds = ""
    if not report.exists():
        library = ["--library", *options.library] if options.library else []
        begun = time.monotonic()
        code, said = quietly(
            [options.python, str(ROOT / "addon/batch.py"), str(scene), "--out", str(result), "--report", str(report),
             "--seed", options.seed, *library]
        )  # fmt: skip
        seconds = f"{time.monotonic() - begun:.0f}"
        if code not in (0, 3):
            return [f"{room} {task}", seconds, *[""] * (len(HEADINGS) - 3), said.strip().splitlines()[-1]]
        (work / f"{room}-{task}.seconds").write_text(seconds)
    figures: dict[str, Any] = json.loads(report.read_text())
    sheet = options.out / f"{work.name}-{room}-{task}.jpg"
    if not options.no_sheets and not sheet.exists():
        png = work / f"{room}-{task}.png"
        quietly([options.python, str(ROOT / "blend_fixtures/render.py"), str(result), "--sheet", str(png)])
        with Image.open(png) as image:
            image.convert("RGB").resize((1680, round(image.height * 1680 / image.width))).save(sheet, quality=82)
    seconds = (work / f"{room}-{task}.seconds").read_text()
    cue, foot, penetration = figures["cues"][0], figures["foot"], figures["penetration"]
    return [
        f"[{room} {task}]({sheet.name})", seconds, str(figures["updates"]), f"{cue['pelvis_cm']:.1f}",
        f"{cue['facing_degrees']:.1f}", f"{foot['contact_cm']:.2f}", f"{foot['skate_cm']:.3f}",
        f"{foot['low_skate_cm']:.2f}", f"{penetration['percent']:.1f}", f"{penetration['whole_body_percent']:.1f}",
        f"{figures['path_m']:.1f}", f"{figures['shortest_path_m']:.1f}", " ".join(figures["problems"]),
    ]  # fmt: skip


def quietly(command: list[str]) -> tuple[int, str]:
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT)
    return done.returncode, done.stdout + done.stderr


def write_table(options: argparse.Namespace, name: str, rows: list[list[str]]) -> None:
    met = [row for row in rows if row[3] and float(row[3]) < 10 and float(row[4]) < 20 and not row[-1]]
    mean = sum(float(row[8]) for row in rows if row[8]) / max(1, sum(bool(row[8]) for row in rows))
    # Folders by their names: where they lie on this machine is nobody's business.
    said = [Path(word).name if "/" in word else f"'{word}'" if " " in word else word for word in sys.argv[3:]]
    lines = [
        f"# {options.title}",
        "",
        f"{datetime.date.today()}, {os.cpu_count()} cores ({platform.machine()}), seed {options.seed}: "
        f"{len(met)} of {len(rows)} tasks end seated within 10 cm and 20° of the cue; "
        f"mean penetration {mean:.2f} % of the frames.",
        "",
        "| " + " | ".join(HEADINGS) + " |",
        "|" + "---|" * len(HEADINGS),
        *["| " + " | ".join(row) + " |" for row in rows],
        "",
        "Seconds are those of the whole batch command, Blender's start included. Contact and penetration are the",
        "paper's measures; `sole low` is the speed of every foot within 1 cm of the floor, whatever its label;",
        "`whole body` counts any crossing of any limb, the torso, the head or the feet outside the seat's.",
        "",
        f"Made by `python -m nox -s rooms -- {' '.join(said)}`.",
        "",
    ]
    (options.out / f"{name}.md").write_text("\n".join(lines), encoding="utf-8")


if __name__ == "__main__":
    main()
