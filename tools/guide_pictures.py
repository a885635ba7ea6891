"""The pictures of docs/guide, made in the real program: its window on an X server without a screen, at the buttons.

`python3 -m nox -s guide` makes all; `-- --only seats-edge` some of them. The scenes are those of `nox -s examples`.
What a window adds nothing to is drawn by `blend_fixtures/render.py`. Needs ONCUE_EXTENSION (the extension's archive)
and root, for a Debian with Blender; see tests/window/blender_root.py.
"""

from __future__ import annotations

import argparse
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from PIL import Image

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from tests.window.blender_root import Unavailable, blender_root  # noqa: E402

PICTURES = ROOT / "docs" / "guide" / "pictures"
WIDTH, HEIGHT, DISPLAY = 1120, 740, ":78"
#: Where the work is done, within the Debian.
INSIDE = "/tmp/oncue-guide"
#: Exit statuses of batch.py with a motion: the cue was met, or missed.
WRITTEN = (0, 3)
#: Seconds until a window shows what it is to show.
PATIENCE = 300.0
#: Colours of a picture, fewer where it would be too large, and the most that it may take, bytes. A quarter of them are
#: those that are farthest apart: cues are small, and theirs are to be seen.
COLOURS, PICTURE_BYTES = (256, 192, 128, 96), 150_000
#: How wide drawn pictures are, pixels.
DRAWN_WIDTH = 840


@dataclass(frozen=True)
class Shot:
    """One picture: its name, its scene, and whether that plays its motion already."""

    name: str
    scene: str
    solved: bool = False


#: Those of the window; guide_in_blender.py says what is done for each.
WINDOWS = (
    Shot("first-shot-cues", "first-shot"),
    Shot("first-shot-result", "first-shot", solved=True),
    Shot("first-shot-takes", "first-shot"),
    Shot("seats-face", "seats"),
    Shot("seats-edge", "seats"),
    Shot("several-cues-list", "several-cues", solved=True),
    Shot("own-rig-bones", "own-rig", solved=True),
    Shot("hands-and-doors-cue", "hands-and-doors", solved=True),
    Shot("editing-keys-pins", "first-shot", solved=True),
    Shot("captures-list", "first-shot"),
    Shot("troubleshooting-scale", "first-shot"),
    Shot("settings-panel", "first-shot"),
)
#: Those that are drawn: the way on the floor, and the person at several moments.
DRAWN = (
    Shot("several-cues-way", "several-cues", solved=True),
    Shot("hands-and-doors-way", "hands-and-doors", solved=True),
)
#: The same scene by other seeds, one below the other: of each how the person sits down, in cells of a strip.
SEEDS, SEEDS_SCENE, SEEDS_PICTURE = (1, 2, 3), "seats", "batch-seeds"
SEEDS_CELLS, CELL = 6, (160, 250)


class Program:
    """The real Blender within the Debian, and the files that it works on."""

    def __init__(self, root: Path, archive: Path, *, go_on: bool) -> None:
        self._root = root
        self.folder = root / INSIDE.lstrip("/")
        shutil.rmtree(self.folder / "sources" if go_on else self.folder, ignore_errors=True)
        (self.folder / "captures").mkdir(parents=True, exist_ok=True)
        for folder in ("addon", "blend_fixtures", "tools"):
            ignored = shutil.ignore_patterns("__pycache__")
            shutil.copytree(ROOT / folder, self.folder / "sources" / folder, ignore=ignored)
        shutil.copy2(archive, self.folder / "oncue.zip")
        install = ["--command", "extension", "install-file", "-r", "user_default", "--enable", f"{INSIDE}/oncue.zip"]
        self.do("blender", *install)

    def command(self, *words: str) -> list[str]:
        environment = [f"DISPLAY={DISPLAY}", "LIBGL_ALWAYS_SOFTWARE=1", "HOME=/root"]
        environment.append(f"BLENDER_USER_RESOURCES={INSIDE}/resources")
        return ["chroot", str(self._root), "env", *environment, *words]

    def do(self, *words: str, allowed: tuple[int, ...] = (0,)) -> None:
        done = subprocess.run(self.command(*words), capture_output=True, text=True, check=False)
        if done.returncode not in allowed:
            raise SystemExit(f"{' '.join(words)}\n{(done.stdout + done.stderr)[-3000:]}")

    def script(self, *words: str) -> None:
        """Has guide_in_blender.py make something without a window."""
        command = ["-b", "--python-exit-code", "1", "-P", f"{INSIDE}/sources/tools/guide_in_blender.py", "--"]
        self.do("blender", *command, *words)

    @contextmanager
    def started(self, *words: str) -> Iterator[subprocess.Popen]:
        with (self.folder / f"{words[0]}.log").open("w") as log:
            process = subprocess.Popen(self.command(*words), stdout=log, stderr=log, start_new_session=True)
        try:
            yield process
        finally:
            process.send_signal(signal.SIGTERM)
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait(10)

    def scene(self, name: str) -> str:
        """The example, made here: a newer Blender's file is not opened by this one."""
        made = self.folder / f"{name}.blend"
        if not made.exists():
            self.script("example", name, f"{INSIDE}/{name}.blend")
        return f"{INSIDE}/{name}.blend"

    def motion(self, name: str, seed: int = 1) -> str:
        """The example with the motion that it asks for."""
        out = self.folder / f"{name}-{seed}.blend"
        if not out.exists():
            # A policy that an earlier task left is not played.
            for kept in (self.folder / "resources").rglob("*.oncuepolicy"):
                kept.unlink()
            batch = ["--python-exit-code", "1", "-P", f"{INSIDE}/sources/addon/batch.py", "--"]
            written = ["--out", f"{INSIDE}/{out.name}", "--seed", str(seed)]
            self.do("blender", "-b", self.scene(name), *batch, *written, allowed=WRITTEN)
        return f"{INSIDE}/{out.name}"

    def capture_walk(self) -> None:
        """A folder with a capture, and with a file that is none."""
        self.script("walk", f"{INSIDE}/captures/walk.bvh")
        (self.folder / "captures" / "empty.bvh").write_text("")

    def photograph(self, shot: Shot) -> Path:
        """The window in the state that the picture shows."""
        scene = self.motion(shot.scene) if shot.solved else self.scene(shot.scene)
        ready, taken = self.folder / "ready", self.folder / f"{shot.name}.png"
        ready.unlink(missing_ok=True)
        geometry = ["--window-geometry", "0", "0", str(WIDTH), str(HEIGHT)]
        script = ["-P", f"{INSIDE}/sources/tools/guide_in_blender.py", "--", shot.name]
        with self.started("blender", *geometry, scene, *script) as blender:
            until = time.monotonic() + PATIENCE
            while not ready.exists():
                if blender.poll() is not None or time.monotonic() > until:
                    said = (self.folder / "blender.log").read_text()
                    raise SystemExit(f"{shot.name} did not come.\n{said[-3000:]}")
                time.sleep(0.2)
            self.do("import", "-window", "root", f"{INSIDE}/{taken.name}")
        said = (self.folder / "blender.log").read_text()
        if "Traceback" in said:
            raise SystemExit(f"{shot.name}\n{said[-3000:]}")
        return taken


def drawn(python: str, blend: Path, *words: str) -> None:
    """What render.py draws of a motion, by Blender's module."""
    command = [python, "blend_fixtures/render.py", str(blend), *words]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, check=False)
    if done.returncode:
        raise SystemExit((done.stdout + done.stderr)[-2000:])


def save_indexed(picture: Path, out: Path) -> None:
    """As an indexed PNG."""
    image = Image.open(picture).convert("RGB")
    for colours in COLOURS:
        usual = image.quantize(colours - colours // 4, method=Image.Quantize.MEDIANCUT)
        apart = image.quantize(colours // 4, method=Image.Quantize.MAXCOVERAGE)
        palette = Image.new("P", (1, 1))
        palette.putpalette([*(usual.getpalette() or []), *(apart.getpalette() or [])])
        image.quantize(palette=palette, dither=Image.Dither.NONE).save(out, optimize=True)
        if out.stat().st_size <= PICTURE_BYTES:
            return
    raise SystemExit(f"{out.name} takes {out.stat().st_size} bytes, more than {PICTURE_BYTES}.")


def smaller(picture: Path, width: int) -> Image.Image:
    image = Image.open(picture).convert("RGB")
    return image.resize((width, round(image.height * width / image.width)), Image.Resampling.LANCZOS)


def last_cells(strip: Path) -> Image.Image:
    """The last pictures of a strip."""
    image = Image.open(strip).convert("RGB")
    return image.crop((image.width - SEEDS_CELLS * CELL[0], image.height - CELL[1], image.width, image.height))


def below(pictures: list[Image.Image]) -> Image.Image:
    made = Image.new("RGB", (pictures[0].width, sum(picture.height for picture in pictures)))
    y = 0
    for picture in pictures:
        made.paste(picture, (0, y))
        y += picture.height
    return made


def main() -> None:
    names = [*(shot.name for shot in (*WINDOWS, *DRAWN)), SEEDS_PICTURE]
    parser = argparse.ArgumentParser(prog="guide_pictures", description=__doc__.splitlines()[0])
    parser.add_argument("--python", required=True, help="a Python with bpy, which draws")
    parser.add_argument("--only", nargs="+", choices=names, help="these pictures alone")
    parser.add_argument("--go-on", action="store_true", help="with the motions that an earlier run has made")
    options = parser.parse_args()
    wanted, archive = options.only or names, os.environ.get("ONCUE_EXTENSION")
    if not archive:
        raise SystemExit("ONCUE_EXTENSION does not name the extension's archive.")
    try:
        program = Program(blender_root(), Path(archive), go_on=options.go_on)
    except Unavailable as reason:
        raise SystemExit(f"There is no real Blender here: {reason}.") from reason
    PICTURES.mkdir(parents=True, exist_ok=True)

    def keep(picture: Path, name: str) -> None:
        out = PICTURES / f"{name}.png"
        save_indexed(picture, out)
        print(f"{out.name}: {out.stat().st_size / 1e3:.0f} kB", flush=True)

    shots = [shot for shot in WINDOWS if shot.name in wanted]
    if shots:
        program.capture_walk()
        with program.started("Xvfb", DISPLAY, "-screen", "0", f"{WIDTH}x{HEIGHT}x24", "+extension", "GLX", "-noreset"):
            time.sleep(2)
            for shot in shots:
                keep(program.photograph(shot), shot.name)
    with tempfile.TemporaryDirectory() as folder:
        picture, smallish = Path(folder) / "drawn.png", Path(folder) / "small.png"
        for shot in [shot for shot in DRAWN if shot.name in wanted]:
            drawn(options.python, program.folder / Path(program.motion(shot.scene)).name, "--picture", str(picture))
            smaller(picture, DRAWN_WIDTH).save(smallish)
            keep(smallish, shot.name)
        if SEEDS_PICTURE in wanted:
            parts = []
            for seed in SEEDS:
                blend = program.folder / Path(program.motion(SEEDS_SCENE, seed)).name
                drawn(options.python, blend, "--strip", str(picture), "--moment", "seat")
                parts.append(last_cells(picture))
            below(parts).save(smallish)
            keep(smallish, SEEDS_PICTURE)


if __name__ == "__main__":
    main()
