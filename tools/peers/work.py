"""What every peer needs: the arrays that a bench of ours wrote, and a table with its figures beside the peer's."""

from __future__ import annotations

import argparse
import json
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np


class Work:
    """The folder that a bench wrote: `NAME.f32` and `NAME.u32`, and in `facts.json` shapes and our own figures."""

    def __init__(self, description: str | None) -> None:
        parser = argparse.ArgumentParser(description=description)
        parser.add_argument("folder", type=Path)
        self.folder: Path = parser.parse_args().folder
        self.facts: dict[str, Any] = json.loads((self.folder / "facts.json").read_text())

    def floats(self, name: str) -> np.ndarray:
        return np.fromfile(self.folder / f"{name}.f32", np.float32)

    def counts(self, name: str) -> np.ndarray:
        return np.fromfile(self.folder / f"{name}.u32", np.uint32)


def seconds(work: Callable[[], Any], times: int = 1) -> float:
    """The shortest of `times` runs."""
    laps = []
    for _ in range(times):
        begun = time.perf_counter()
        work()
        laps.append(time.perf_counter() - begun)
    return min(laps)


def table(title: str, unit: str, rows: list[tuple[str, float]], notes: list[str]) -> None:
    """Prints a figure a line, each with what it is of the first, which is ours."""
    print(f"\n  {title}")
    ours = rows[0][1]
    for name, figure in rows:
        print(f"    {name:<44} {figure:12.4g} {unit:<10} {figure / ours:8.2f} x")
    load, cores = os.getloadavg()[0], os.cpu_count()
    if load > (cores or 1) + 0.5:
        notes = [*notes, f"a busy machine: {load:.1f} processes on {cores} cores, so times say little"]
    for note in notes:
        print(f"    {note}")
    print(flush=True)
