"""Draws motions as an animator looks at them: docs/motion.md with its contact sheets and a short video.

`python3 -m nox -s sheets` makes all; `-- --only start chair` some of the pictures alone. Rooms and seats are made by
rule (`blend_fixtures/make_fixtures.py`), the library is the starter's, so that everybody gets the same.
"""

from __future__ import annotations

import argparse
import datetime
import json
import os
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path

from PIL import Image

ROOT = Path(__file__).resolve().parents[1]
#: Exit statuses of batch.py with a motion: the cue was met, or missed.
WRITTEN = (0, 3)
#: Colours of a sheet, and the most that it may take, bytes.
COLOURS, SHEET_BYTES = 64, 150_000
#: The video: its scene, its size, every which frame, and the most that it may take, bytes.
VIDEO_SCENE, VIDEO_SIZE, VIDEO_STEP, VIDEO_BYTES = "demo_room", "480x360", 2, 1_500_000
VIDEO = "video"


@dataclass(frozen=True)
class Sheet:
    """One contact sheet: what it is called, its scene, what of the motion it is about, and its words."""

    name: str
    scene: str
    moment: str
    words: str


SHEETS = (
    Sheet("start", "demo_room", "start", "A start: from standing to the first steps."),
    Sheet("passage", "gap_55", "middle", "A narrow passage: 55 cm between two cupboards."),
    Sheet("turn", "demo_room", "turn", "A turn before a seat."),
    Sheet("chair", "seat_chair", "seat", "A chair, 45 cm high."),
    Sheet("sofa", "seat_sofa", "seat", "A sofa, 43 cm high."),
    Sheet("armchair", "seat_armchair", "seat", "An armchair, 40 cm high, 60 cm between its arms."),
    Sheet("bench", "seat_bench", "seat", "A bench without a back, 45 cm high."),
    Sheet("low-stool", "seat_low_stool", "seat", "A low stool, 30 cm high."),
    Sheet("bar-stool", "seat_bar_stool", "seat", "A bar stool, 72 cm high."),
)


class Studio:
    """Makes motions and draws them, each scene once."""

    def __init__(self, python: str, work: Path, seed: int) -> None:
        self._python, self._work, self._seed = python, work, seed

    def motion(self, scene: str) -> tuple[Path, dict]:
        """The file with the scene's motion, and its report."""
        made, out, report = (self._work / f"{scene}{ending}" for ending in (".blend", "-moved.blend", ".json"))
        if not out.is_file():
            self._run("blend_fixtures/make_fixtures.py", "--out", str(self._work), "--only", scene)
            words = [str(made), "--out", str(out), "--report", str(report), "--seed", str(self._seed)]
            self._run("addon/batch.py", *words, allowed=WRITTEN)
        return out, json.loads(report.read_text(encoding="utf-8"))

    def draw(self, blend: Path, *words: str) -> None:
        self._run("blend_fixtures/render.py", str(blend), *words)

    def _run(self, *words: str, allowed: tuple[int, ...] = (0,)) -> None:
        # A user folder of its own each time: no policy that an earlier task left is played.
        with tempfile.TemporaryDirectory() as folder:
            own = {**os.environ, "BLENDER_USER_RESOURCES": folder}
            command = [self._python, *words]
            done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, env=own, check=False)
        if done.returncode not in allowed:
            raise SystemExit((done.stdout + done.stderr)[-2000:])


def save_sheet(drawn: Path, out: Path) -> None:
    """As an indexed PNG, of fewer colours where it would be too large."""
    picture, colours = Image.open(drawn).convert("RGB"), COLOURS
    while colours >= 8:
        indexed = picture.quantize(colours, dither=Image.Dither.NONE)
        indexed.save(out, optimize=True)
        if out.stat().st_size <= SHEET_BYTES:
            return
        colours //= 2
    raise SystemExit(f"{out.name} takes {out.stat().st_size} bytes, more than {SHEET_BYTES}.")


def save_video(frames: list[Path], out: Path, milliseconds: int) -> None:
    """As an animated WebP, of a lower quality where it would be too large."""
    first, *others = [Image.open(frame).convert("RGB") for frame in frames]
    for quality in (70, 50, 30, 15):
        first.save(out, save_all=True, append_images=others, duration=milliseconds, loop=0, quality=quality, method=4)
        if out.stat().st_size <= VIDEO_BYTES:
            return
    raise SystemExit(f"{out.name} takes {out.stat().st_size} bytes, more than {VIDEO_BYTES}.")


def told(report: dict) -> str:
    """What the report says of the motion, in a sentence or more."""
    if not report["problems"]:
        return "Its report has no problems."
    return "Its report says: " + " ".join(report["problems"])


def page(reports: dict[str, dict], seed: int) -> str:
    """docs/motion.md."""
    today = datetime.date.today().isoformat()
    parts = [
        "# Motion, drawn",
        f"{today}. Made by `python3 -m nox -s sheets -- --seed {seed}`: rooms and seats made by rule, the starter "
        "library, edited as an artist gets them. A picture every fifth of a second, from one side, at a person's "
        "height; the times are those of the motion.",
        "![A walk through the demo room, and a sit](pictures/motion.webp)",
    ]
    for sheet in SHEETS:
        parts.append(f"**{sheet.words}** {told(reports[sheet.scene])}")
        parts.append(f"![{sheet.words}](pictures/motion-{sheet.name}.png)")
    return "\n\n".join(parts) + "\n"


def main() -> None:
    names = [sheet.name for sheet in SHEETS]
    parser = argparse.ArgumentParser(prog="motion_sheets", description=__doc__.splitlines()[0])
    parser.add_argument("--python", type=Path, required=True, help="a Python with bpy and oncue_core")
    parser.add_argument("--docs", type=Path, default=ROOT / "docs")
    parser.add_argument("--work", type=Path, help="where motions are kept, so that a run that was cut off goes on")
    parser.add_argument("--only", nargs="+", choices=[*names, VIDEO], help="these pictures alone, without the page")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    wanted, pictures = options.only or [*names, VIDEO], options.docs / "pictures"
    pictures.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        work = options.work or Path(folder)
        studio, reports = Studio(str(options.python.absolute()), work, options.seed), {}
        for sheet in [sheet for sheet in SHEETS if sheet.name in wanted]:
            blend, reports[sheet.scene] = studio.motion(sheet.scene)
            drawn, out = work / "strip.png", pictures / f"motion-{sheet.name}.png"
            studio.draw(blend, "--strip", str(drawn), "--moment", sheet.moment)
            save_sheet(drawn, out)
            print(f"{out.name}: {out.stat().st_size / 1e3:.0f} kB. {told(reports[sheet.scene])}", flush=True)
        if VIDEO in wanted:
            blend, _ = studio.motion(VIDEO_SCENE)
            frames, out = work / "frames", pictures / "motion.webp"
            words = ("--frames", str(frames), "--size", VIDEO_SIZE, "--step", str(VIDEO_STEP))
            studio.draw(blend, *words)
            save_video(sorted(frames.glob("*.png")), out, round(1000 * VIDEO_STEP / 30))
            print(f"{out.name}: {out.stat().st_size / 1e3:.0f} kB", flush=True)
    if not options.only:
        (options.docs / "motion.md").write_text(page(reports, options.seed), encoding="utf-8")


if __name__ == "__main__":
    main()
