# SPDX-License-Identifier: GPL-3.0-or-later
"""A scene in the measure of the body that moves in it, and what is said of that in the scene's own.

The core moves one body, 1.8 m tall. Who is `size` times as large gets the motion of that body in a scene that is as
much smaller, and a clock that runs slower by the square root: pendulums do, and legs that walk (Froude's number). So a
child takes more steps, and a giant fewer, at speeds that go with the square root of the leg.
"""

from __future__ import annotations

import re
from functools import partial
from typing import Any

#: Fields of a report that are lengths, speeds and times; accelerations, angles and shares are the same at any size.
_LENGTH = re.compile(r"(_cm|_m|^place|^position|^feet|^path|^positions|^grip|^low|^high|^point|^metres)$")
_SPEED = re.compile(r"_c?m_per_s$")
_TIME = re.compile(r"(_s|^hold_seconds|^at_seconds|^over_seconds|^at)$")
#: Speeds that have no unit in their name.
_SPEEDS = {"walking", "fastest"}
#: Parts of a report that are none of the motion's.
_ASIDE = {"settings", "seconds", "curve", "extension", "task"}
#: “12 cm”, “0.35 m”; “3.5 s”; “at 1.20, -0.50, 0.66”.
_LENGTHS = re.compile(r"(?<![\w.])(-?\d+(?:\.\d+)?)( c?m)(?![\w/])")
_SECONDS = re.compile(r"(?<![\w.])(-?\d+(?:\.\d+)?)( s)(?!\w)")
_PLACES = re.compile(r"(?<= at )(-?\d+\.\d+), (-?\d+\.\d+), (-?\d+\.\d+)")


def clock(size: float) -> float:
    """Seconds of the scene that a second of the body's takes."""
    return float(size**0.5)


def scaled(asked: Any, size: float) -> Any:
    """A task, a performance or a part of a report with its lengths and times as many times as large as `size` says."""
    return asked if size == 1.0 else _scaled(asked, size, 1.0)


def _scaled(value: Any, size: float, factor: float) -> Any:
    if isinstance(value, dict):
        return {name: _scaled(one, size, _factor(name, one, size)) for name, one in value.items()}
    if isinstance(value, list | tuple):
        return [_scaled(one, size, factor) for one in value]
    if isinstance(value, float | int) and not isinstance(value, bool) and factor != 1.0:
        return value * factor
    return value


def _factor(name: str, value: object, size: float) -> float:
    if isinstance(value, str) or value is None:
        return 1.0
    if _SPEED.search(name) or (name in _SPEEDS and isinstance(value, float)):
        return clock(size)
    if _TIME.search(name):
        return clock(size)
    return size if _LENGTH.search(name) else 1.0


def report_in_scene(report: dict[str, Any], size: float) -> dict[str, Any]:
    """A report of the core in the scene's metres and seconds, its sentences too."""
    if size == 1.0:
        return report
    own = {name: value for name, value in report.items() if name not in _ASIDE}
    told = {**report, **_scaled(own, size, 1.0)}
    if "problems" in told:
        told["problems"] = [sentence_in_scene(problem, size) for problem in told["problems"]]
    edited = told.get("edited")
    if isinstance(edited, dict) and "problems" in edited:
        told["edited"] = {**edited, "problems": [sentence_in_scene(problem, size) for problem in edited["problems"]]}
    return told


def sentence_in_scene(sentence: str, size: float) -> str:
    """A sentence of the core with its lengths, places and times in the scene's metres and seconds."""
    if size == 1.0:
        return sentence

    def times(factor: float, match: re.Match[str]) -> str:
        decimals = len(match[1].partition(".")[2])
        return f"{float(match[1]) * factor:.{decimals}f}{match[2]}"

    def place(match: re.Match[str]) -> str:
        return ", ".join(f"{float(number) * size:.2f}" for number in match.groups())

    told = _LENGTHS.sub(partial(times, size), sentence)
    return _PLACES.sub(place, _SECONDS.sub(partial(times, clock(size)), told))
