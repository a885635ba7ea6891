"""Plays whole shots through the batch command, and writes docs/shots.md: what each came to, with pictures.

`python -m nox -s shots` plays those of `blend_fixtures/shots.tsv`: several cues each, one to three people, in the rooms
of `../shared/data/rooms`, or of `$ONCUE_SHARED/data/rooms`. For each `blend_fixtures/make_fixtures.py` makes the scene,
`addon/batch.py` synthesizes, `blend_fixtures/render.py` draws. Beside them one person goes to one cue in each room.
"""

from __future__ import annotations

import argparse
import datetime
import json
import os
import platform
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from PIL import Image

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "blend_fixtures"))

from shots import COLUMNS, ENDS, OPEN, PUT, Row, Shot, read_shots  # noqa: E402

ROOMS = Path(os.environ.get("ONCUE_SHARED", ROOT.parent / "shared")) / "data" / "rooms"
TABLE = ROOT / "blend_fixtures" / "shots.tsv"
#: Exit statuses of batch.py with a motion: all is well, or something is not.
WRITTEN = (0, 3)
#: What counts as met: of a stop and a sit centimetres and degrees, of a pass centimetres, of what hands do centimetres.
NEAR_CM, TURNED, PASSED_CM, HELD_CM = 1.0, 3.0, 15.0, 1.0
#: The shots that are drawn, and how wide.
DRAWN, DRAWN_WIDTH = ("quest_living_room-greeting", "sh3d_Studio-laptop", "sh3d_2BedroomApartment-door"), 1600
#: The video's shot, its size, every which frame, and the most that it may take, bytes.
FILMED, VIDEO_SIZE, VIDEO_STEP, VIDEO_BYTES = "quest_living_room-greeting", (360, 270), 6, 1_500_000


@dataclass(frozen=True)
class Played:
    """What a shot came to; `report` is None where there is no motion."""

    shot: Shot
    seconds: float
    report: dict[str, Any] | None
    refused: str = ""

    @property
    def people(self) -> list[dict[str, Any]]:
        """The reports of those who moved."""
        if self.report is None:
            return []
        return [one for one in self.report.get("people", [self.report]) if "cues" in one]

    @property
    def cues(self) -> dict[str, dict[str, Any]]:
        return {cue["cue"]: cue for one in self.people for cue in one["cues"]}

    def is_met(self, row: Row) -> bool:
        cue = self.cues.get(row.name)
        if cue is None:
            return False
        if row.kind not in ENDS:
            return cue["pelvis_cm"] <= PASSED_CM
        return cue["pelvis_cm"] <= NEAR_CM and abs(cue["facing_degrees"]) <= TURNED

    def held_cm(self, row: Row) -> float | None:
        """How far a palm gets from where it grips or leads something, or a thing stands from where it was put."""
        things = [thing for one in self.people for thing in one.get("things", [])]
        if row.kind == OPEN:
            found = [
                leaf["handle_cm"] for one in self.people for leaf in one.get("opened", []) if leaf["open"] == row.name
            ]
        elif row.kind == PUT:
            found = [thing["put_cm"] for thing in things if thing["put"] == row.name]
        else:
            found = [thing["grip_cm"] for thing in things if thing["take"] == row.name]
        return found[0] if found else None

    def is_done(self, row: Row) -> bool:
        off = self.held_cm(row)
        return off is not None and off <= HELD_CM

    @property
    def missed(self) -> list[str]:
        """Each cue that was not met, and by how much."""
        said = [f"{row.name} (not done)" for row in self.shot.done if not self.is_done(row)]
        for row in (row for row in self.shot.cues if not self.is_met(row)):
            cue = self.cues.get(row.name)
            by = f"{cue['pelvis_cm']:.1f} cm, {cue['facing_degrees']:.1f}°" if cue else "not played"
            said.append(f"{row.name} ({by})")
        return said

    def worst(self, kinds: tuple[str, ...], figure: str) -> float | None:
        found = [self.cues[row.name] for row in self.shot.cues if row.kind in kinds and row.name in self.cues]
        return max((abs(cue[figure]) for cue in found), default=None)

    def percent(self, *path: str) -> float:
        """The mean share over the people, of each one's frames."""
        shares = []
        for figures in self.people:
            for name in path:
                figures = figures.get(name) or {}
            shares.append(float(figures or 0.0))
        return sum(shares) / max(1, len(shares))

    @property
    def deepest_cm(self) -> float:
        found = [one["body"]["scene"]["deepest_cm"] for one in self.people]
        return max(found, default=0.0)

    @property
    def lasts(self) -> float:
        return max((one["frames"] / 30.0 for one in self.people), default=0.0)

    @property
    def problems(self) -> list[str]:
        return [self.refused] if self.report is None else list(self.report["problems"])


def main() -> None:
    parser = argparse.ArgumentParser(prog="shots_table", description=__doc__.splitlines()[0])
    parser.add_argument("--python", required=True, help="a Python with bpy and oncue_core")
    parser.add_argument("--rooms", type=Path, default=ROOMS, help="the rooms' GLB files")
    parser.add_argument("--shots", type=Path, default=TABLE, help="the table of shots")
    parser.add_argument("--docs", type=Path, default=ROOT / "docs")
    parser.add_argument("--work", type=Path, default=ROOT / "out" / "shots", help="for scenes, motions and reports")
    parser.add_argument("--only", nargs="+", metavar="ROOM-SHOT", help="these shots, without the page")
    parser.add_argument("--seed", default="1")
    parser.add_argument("--keep", action="store_true", help="keep the motions of an earlier call")
    parser.add_argument("--there", action="store_true", help="play none: the page of what earlier calls have played")
    parser.add_argument("--no-pictures", action="store_true")
    options = parser.parse_args()
    shots = read_shots(options.shots)
    if lacking := sorted({shot.room for shot in shots if not (options.rooms / f"{shot.room}.glb").is_file()}):
        parser.error(f"{options.rooms / lacking[0]}.glb is not there: name the folder, or set ONCUE_SHARED")
    if options.only:
        shots = [shot for shot in shots if shot.file in options.only]
    options.work.mkdir(parents=True, exist_ok=True)
    played = play_all(options, shots, options.shots)
    if options.only:
        return
    alone = write_alone(shots, options.work / "alone.tsv")
    beside = {one.shot.room: one for one in play_all(options, read_shots(alone), alone)}
    if not options.no_pictures:
        draw(options)
    (options.docs / "shots.md").write_text(page(played, len(shots), beside, options.seed), encoding="utf-8")


def play_all(options: argparse.Namespace, shots: list[Shot], table: Path) -> list[Played]:
    """Each of them that is to be played, or was."""
    scenes = options.work / "scenes"
    if options.there:
        options.keep = True
        shots = [shot for shot in shots if (options.work / f"{shot.file}.seconds").exists()]
    else:
        make(options, shots, table, scenes)
    return [play(options, shot, scenes) for shot in shots]


def make(options: argparse.Namespace, shots: list[Shot], table: Path, scenes: Path) -> None:
    """The scene of each shot."""
    for room in dict.fromkeys(shot.room for shot in shots):
        words = ("--room", str(options.rooms / f"{room}.glb"), "--shots", str(table), "--out", str(scenes))
        checked(quietly(options, "blend_fixtures/make_fixtures.py", *words))


def write_alone(shots: list[Shot], path: Path) -> Path:
    """A table with one shot a room: the first person's start of its first shot, and the first cue where they stay."""
    lines = ["\t".join(COLUMNS)]
    for room in dict.fromkeys(shot.room for shot in shots):
        people = (person for shot in shots if shot.room == room for person in shot.people)
        start, cue = next((rows[0], row) for rows in people for row in rows if row.kind in ENDS)
        for row, step in ((start, 0), (cue, 1)):
            numbers = [row.x, row.y, row.z, row.heading, row.hold]
            cells = ["" if number is None else f"{number:g}" for number in numbers]
            lines.append("\t".join([room, "alone", row.person, str(step), row.kind, *cells, "", row.object]))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def play(options: argparse.Namespace, shot: Shot, scenes: Path) -> Played:
    """A shot's motion, as the batch command makes it."""
    out, report, clock = (options.work / f"{shot.file}{ending}" for ending in (".blend", ".json", ".seconds"))
    if not (options.keep and report.exists() and clock.exists()):
        files = [str(scenes / out.name), "--out", str(out), "--report", str(report)]
        began = time.monotonic()
        status, said = quietly(options, "addon/batch.py", *files, "--seed", options.seed)
        if status not in WRITTEN and not report.exists():
            raise SystemExit(said[-2000:])
        clock.write_text(f"{time.monotonic() - began:.1f}", encoding="utf-8")
    told, seconds = json.loads(report.read_text(encoding="utf-8")), float(clock.read_text(encoding="utf-8"))
    is_short = "cues" not in told
    one = Played(shot, seconds, None if is_short else told, " ".join(told["problems"]) if is_short else "")
    print(" | ".join(cells(one)), flush=True)
    return one


def draw(options: argparse.Namespace) -> None:
    """The pictures of the page that their motions are there for."""
    pictures = options.docs / "pictures"
    for name in (name for name in DRAWN if (options.work / f"{name}.blend").exists()):
        blend, drawn = options.work / f"{name}.blend", options.work / f"{name}.png"
        checked(quietly(options, "blend_fixtures/render.py", str(blend), "--story", str(drawn)))
        with Image.open(drawn) as image:
            height = round(image.height * DRAWN_WIDTH / image.width)
            image.convert("RGB").resize((DRAWN_WIDTH, height)).save(pictures / f"shots-{name}.jpg", quality=80)
    with tempfile.TemporaryDirectory() as folder:
        words = ("--film", folder, "--size", "{}x{}".format(*VIDEO_SIZE), "--step", str(VIDEO_STEP))
        checked(quietly(options, "blend_fixtures/render.py", str(options.work / f"{FILMED}.blend"), *words))
        frames = [Image.open(frame).convert("RGB") for frame in sorted(Path(folder).glob("*.png"))]
    out = pictures / "shots.webp"
    for quality in (60, 40, 20, 10):
        film = {"duration": round(1000 * VIDEO_STEP / 30), "loop": 0, "quality": quality, "method": 4}
        frames[0].save(out, save_all=True, append_images=frames[1:], **film)
        if out.stat().st_size <= VIDEO_BYTES:
            return
    raise SystemExit(f"{out.name} takes {out.stat().st_size} bytes, more than {VIDEO_BYTES}.")


def quietly(options: argparse.Namespace, script: str, *arguments: str) -> tuple[int, str]:
    """The exit status and the words of one of the repository's scripts."""
    # A user folder of its own each time: no policy that an earlier shot left is played.
    with tempfile.TemporaryDirectory() as folder:
        environment = {**os.environ, "BLENDER_USER_RESOURCES": folder}
        command = [options.python, str(ROOT / script), *arguments]
        done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, env=environment, check=False)
    return done.returncode, done.stdout + done.stderr


def checked(outcome: tuple[int, str]) -> None:
    """Ends with the words of a script that failed."""
    if outcome[0]:
        raise SystemExit(outcome[1][-2000:])


def shown(number: float | None, digits: int = 1) -> str:
    return "" if number is None else f"{number:.{digits}f}"


HEADINGS = (
    *("shot", "people", "cues met", "sit, stop: cm", "°", "pass: cm", "hand: cm", "in scene %", "deepest cm"),
    *("in itself %",),
    *("in others %", "lasts s", "made in s", "what is wrong"),
)


def cells(one: Played) -> list[str]:
    met = sum(map(one.is_met, one.shot.cues)) + sum(map(one.is_done, one.shot.done))
    held = [off for row in one.shot.done if (off := one.held_cm(row)) is not None]
    # What was missed is told by the page's own measure, all else by the report's.
    said = [*(f"missed: {name}" for name in one.missed), *one.problems]
    return [
        one.shot.file.replace("sh3d_", "").replace("quest_", ""),
        str(len(one.shot.people)),
        f"{met} of {len(one.shot.cues) + len(one.shot.done)}",
        shown(one.worst(ENDS, "pelvis_cm")),
        shown(one.worst(ENDS, "facing_degrees")),
        shown(one.worst(("pass",), "pelvis_cm")),
        shown(max(held, default=None), 2),
        shown(one.percent("body", "scene", "over_1_cm_percent"), 2),
        shown(one.deepest_cm),
        shown(one.percent("body", "own_body", "percent"), 2),
        shown(one.percent("others", "percent"), 2) if len(one.shot.people) > 1 else "",
        shown(one.lasts),
        shown(one.seconds, 0),
        " ".join(said),
    ]


def page(played: list[Played], asked: int, beside: dict[str, Played], seed: str) -> str:
    """docs/shots.md."""
    cues = [(one, row) for one in played for row in one.shot.cues]
    ends = [one.is_met(row) for one, row in cues if row.kind in ENDS]
    passes = [one.is_met(row) for one, row in cues if row.kind not in ENDS]
    hands = [one.is_done(row) for one in played for row in one.shot.done]
    several = [one for one in played if len(one.shot.people) > 1]
    with_things = [one for one in played if one.shot.done]
    fine = [one for one in played if one.report and one.report["success"] and not one.missed]
    today = datetime.date.today().isoformat()
    # What else the machine does shows in the seconds.
    made = (
        f"{today}, {os.cpu_count()} cores ({platform.machine()}; load {os.getloadavg()[2]:.0f}), seed {seed}, the "
        "starter library."
    )
    lines = [
        "# Shots, played",
        "",
        f"{made} Made by `python3 -m nox -s shots`: the shots of `blend_fixtures/shots.tsv` in the rooms of "
        "`../shared/data/rooms`, each through `batch.py` in a Blender of its own, with nothing kept from before.",
        "",
        f"{len(played)} of {asked} shots, {len(several)} of them of two or three people, {len(with_things)} with "
        f"things that are carried or opened: {sum(ends)} of {len(ends)} sits and stops are met within {NEAR_CM:.0f} cm "
        f"and {TURNED:.0f}°, {sum(passes)} of {len(passes)} waypoints within {PASSED_CM:.0f} cm, {sum(hands)} of "
        f"{len(hands)} times a thing is taken, put down or opened within {HELD_CM:.0f} cm; in {len(fine)} shots every "
        "cue is met and nothing else is wrong.",
        "",
        f"![{FILMED}](pictures/shots.webp)",
        "",
        "*cm* and *°* are those of the worst cue; *hand*: how far a palm gets from where it grips or leads something,",
        "or a thing stands from where it was to be put. *In scene*, *in itself*, *in others*: frames with a limb",
        "deeper than 1 cm there, the mean over the people; *deepest*: in the scene. *Made in*: the whole command, with",
        "Blender's start and the library.",
        "",
        "| " + " | ".join(HEADINGS) + " |",
        "|" + "---|" * len(HEADINGS),
        *("| " + " | ".join(cells(one)) + " |" for one in played),
        "",
        "## Beside a single cue",
        "",
        "The first person of a room's first shot alone, to the first cue where they stay; and what a cue of the room's",
        "shots takes (waypoints are no cues of their own here).",
        "",
        "| room | one cue s | shots s | a cue of theirs s |",
        "|---|---|---|---|",
    ]
    for room, single in beside.items():
        own = [one for one in played if one.shot.room == room]
        stays = sum(row.kind in ENDS for one in own for row in one.shot.cues)
        took = sum(one.seconds for one in own)
        lines.append(f"| {room} | {single.seconds:.0f} | {took:.0f} | {took / max(1, stays):.0f} |")
    drawn = {one.shot.file for one in played}
    for name in (name for name in DRAWN if name in drawn):
        lines += ["", f"**{name}**", "", f"![{name}](pictures/shots-{name}.jpg)"]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()
