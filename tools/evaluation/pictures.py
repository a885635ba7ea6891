"""The editor's pictures, drawn by Blender's Python module (`blend_fixtures/editing_pictures.py`)."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
#: Of what a hand opens, and of the seats.
OPENINGS, SEATS = "editing-openings.jpg", "editing-seats.jpg"


def draw(python: str, data: Path, work: Path, out: Path, say: Callable[[str], None]) -> None:
    """Both pictures into `out`. Raises SystemExit with the script's last words where it fails."""
    out.mkdir(parents=True, exist_ok=True)
    for kind, name in (("openings", OPENINGS), ("seats", SEATS)):
        command = [python, str(ROOT / "blend_fixtures" / "editing_pictures.py"), kind, "--data", str(data)]
        command += ["--out", str(out / name), "--work", str(work / "scenes")]
        done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, check=False)
        if done.returncode:
            raise SystemExit((done.stdout + done.stderr)[-2000:])
        say(f"drew {name}")
