"""The table of what an eye sees: each figure as it was, of people, as it is asked for, of our motions and of clips."""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from .eyes import BEYOND, NARROW

Row = dict[str, Any]

#: An arm that is far from every pose for a larger share of the frames is seen, percent.
OFTEN = 2.0
#: A body that is in the scene for a larger share of the frames is seen, percent.
LONG = 3.0


class Line(NamedTuple):
    """One line of the table: what it is called, what it was, what people do and what is asked, in words."""

    name: str
    before: str
    people: str
    asked: str
    #: Of the motions of one library.
    motions: Callable[[list[Row]], str]
    #: Of a library's clips, as `of_clips` gives them; None where clips have nothing of the kind.
    clips: Callable[[Row], str] | None


def counted(is_so: Callable[[Row], bool]) -> Callable[[list[Row]], str]:
    return lambda rows: f"{sum(map(is_so, rows))} of {len(rows)}"


def worded(value: float | None, digits: int = 1) -> str:
    if value is None or math.isnan(value):
        return "–"
    # No negative zero.
    return f"{round(value, digits) + 0.0:.{digits}f}".replace("-", "−")


def middle(values: Sequence[float | None]) -> float | None:
    there = [value for value in values if value is not None]
    return statistics.median(there) if there else None


def percentile(values: Sequence[float | None], share: float) -> float | None:
    there = [value for value in values if value is not None]
    return float(np.quantile(there, share)) if there else None


def scene_depth(rows: list[Row]) -> str:
    shares = [row["scene_percent"] for row in rows]
    return f"{statistics.fmean(shares):.1f} / {max(shares):.1f}" if shares else "–"


def unnamed(rows: list[Row]) -> str:
    """Motions that are deeper for long, and how many of them the report names."""
    deep = [row for row in rows if row["scene_percent"] > LONG]
    return f"{len(deep)} of {len(rows)}, {sum(row['scene_named'] for row in deep)} named"


def pooled(count: str, share: Sequence[str]) -> Callable[[list[Row]], str]:
    """A share of stances or steps over all motions together; the count and the share by their names in `feet`."""

    def of(rows: list[Row]) -> str:
        group, name = share
        parts = [(row["feet"][group][count], row["feet"][group][name] or 0.0) for row in rows]
        total = sum(number for number, _ in parts)
        return worded(sum(number * value for number, value in parts) / total if total else None)

    return of


def feet_line(group: str, name: str, inner: str | None = None) -> Callable[[Row], float | None]:
    """A figure of `feet`; those of motions without a stance or step are none."""

    def of(row: Row) -> float | None:
        figures = row["feet"][group]
        if not figures["stances" if group == "flat" else "steps"]:
            return None
        return figures[name][inner] if inner else figures[name]

    return of


def _feet(name: str, before: str, people: str, asked: str, of: Callable[[Row], float | None]) -> Line:
    return Line(
        name, before, people, asked, lambda rows: worded(middle([of(row) for row in rows])), lambda c: worded(of(c))
    )


def _style(name: str, row: str, before: str, people: str, asked: str = "", digits: int = 1) -> Line:
    return Line(
        name,
        before,
        people,
        asked,
        lambda rows: worded(middle([one["style"][row] for one in rows]), digits),
        lambda clips: worded(clips["style"][row], digits),
    )


def _turn_p95(rows: list[Row]) -> str:
    return worded(percentile([row["style"]["way.fastest_turn_degrees_per_s"] for row in rows], 0.95), 0)


LINES = [
    Line("cue met, motions", "", "", "all", counted(lambda row: row["met"]), None),
    Line("no problem in the report, motions", "", "", "", counted(lambda row: not row["problems"]), None),
    Line(
        "own body over 1 cm, motions",
        "13 of 35",
        "",
        "0",
        counted(lambda row: row["own_percent"] > 0),
        lambda clips: counted(lambda row: row["own_percent"] > 0)(clips["motions"]),
    ),
    Line(
        f"elbow or knee beyond its limit by {BEYOND:.0f}°, motions",
        "15 of 35",
        "",
        "0",
        counted(lambda row: row["hinge_degrees"] > BEYOND),
        lambda clips: counted(lambda row: row["hinge_degrees"] > BEYOND)(clips["motions"]),
    ),
    Line(
        f"arm over 20° from every pose of the library in > {OFTEN:.0f} %, no gap under {NARROW:.0f} cm near, motions",
        "4 of 35",
        "",
        "0",
        counted(lambda row: row["arms_percent"] > OFTEN),
        None,
    ),
    Line(
        f"the same of the trunk in > {OFTEN:.0f} %, any gap, motions",
        "",
        "",
        "",
        counted(lambda row: row["trunk_percent"] > OFTEN),
        None,
    ),
    Line(
        "scene deeper than 1 cm, whole body, % of frames, mean / worst",
        "1.8 / 21",
        "",
        "≤ 0.5 / ≤ 3",
        scene_depth,
        None,
    ),
    Line(f"in over {LONG:.0f} % of frames, motions; named by their report", "", "", "all named", unnamed, None),
    Line(
        "flat foot swivels over 15°, % of stances",
        "20–26",
        "0 (9)",
        "≤ 2",
        pooled("stances", ("flat", "swivelled_percent")),
        lambda clips: worded(clips["feet"]["flat"]["swivelled_percent"]),
    ),
    Line(
        "a foot turned out over 50° or in over 35°, % of frames, mean",
        "",
        "",
        "",
        lambda rows: worded(statistics.fmean(row["feet"]["turned"]["percent"] for row in rows), 2),
        lambda clips: worded(clips["feet"]["turned"]["percent"], 2),
    ),
    _feet("heel drift while flat, cm", "2.6–2.9", "1.4 (2.1)", "≤ 1.5", feet_line("flat", "heel_drift_cm", "median")),
    _feet("ball drift while flat, cm", "", "", "", feet_line("flat", "ball_drift_cm", "median")),
    Line(
        "heel first at landing, %",
        "54",
        "86 (100)",
        "≥ 85",
        pooled("steps", ("steps", "heel_first_percent")),
        lambda clips: worded(clips["feet"]["steps"]["heel_first_percent"]),
    ),
    _feet("toe up at strike, °", "5.5", "13.8 (12.8)", "≥ 11", feet_line("steps", "toe_up_degrees")),
    _feet("heel up at push-off, °", "42", "44 (39)", "", feet_line("steps", "heel_up_degrees")),
    _feet("toe clearance late in the swing, cm", "2.6", "3.7", "", feet_line("steps", "toe_clearance_cm")),
    _style("walking speed, m/s", "walking.speed_m_per_s", "0.84", "1.03 (0.60)", "1.0 where there is room", 2),
    _style("its variation", "way.speed_variation", "0.29", "0.23 (0.17)", "≤ 0.23", 2),
    _style("fastest turn of the pelvis, °/s", "way.fastest_turn_degrees_per_s", "165", "93–106 (99)", digits=0),
    Line("the same, 95th percentile of motions", "", "", "≤ 110", _turn_p95, None),
    _style("turn in the last 2.5 s before sitting, °", "descent.turn_before_degrees", "117", "(68)", digits=0),
    _style("near still before sitting, s", "descent.still_before_s", "0.27", "(0.00)", "0", 2),
    _style("pelvis shifts before the first step, cm", "start.weight_shift_cm", "0.0", "3.5–6.4 (−0.3)", "3.5–6.4"),
    _style("for how long, s", "start.shift_s", "", "", "0.3–0.5", 2),
    _style("descent, s", "descent.descent_s", "0.87", "(1.43)", "1.0–1.6", 2),
    _style("peak lean of the trunk going down, °", "descent.lean_degrees", "30", "(65)", "45–70", 0),
    _style("trunk leans before the pelvis sinks, s", "descent.lean_leads_s", "", "", digits=2),
    _style("way down behind the pelvis at peak lean, %", "descent.sunk_at_lean_percent", "", "", digits=0),
    _style("lean as the seat is reached, °", "descent.lean_at_seat_degrees", "", "", digits=0),
    _style("upper arm lifted while sitting down, °", "descent.upper_arm_degrees", "", "", digits=0),
    _style("fastest sink, m/s", "descent.fastest_sink_m_per_s", "0.61", "(0.45)", digits=2),
    _style("feet move while sitting down, cm", "descent.feet_move_cm", "0.0", "(6.5)"),
    _style("pelvis turns while sitting down, °", "descent.pelvis_turns_degrees", "0.5", "(17)"),
    _style("trunk once seated, ° (negative leans back)", "seated.trunk_degrees", "−4.7", "(−25)"),
    _style("feet fore and aft seated, cm", "seated.feet_fore_aft_cm", "1.9", "(10)"),
    _style("ankles apart, cm", "seated.ankles_apart_cm", "19", "(31)", "20–35", 0),
    _style("knees apart, cm", "seated.knees_apart_cm", "26", "(37)", "25–45", 0),
    _style("wrists once seated, cm/s", "seated.wrists_cm_per_s", "1.6", "(9.5)"),
    _style("head", "seated.head_cm_per_s", "4.7", "(7.2)"),
    _style("knees", "seated.knees_cm_per_s", "0.3", "(2.1)"),
    _style("shoulders against pelvis while walking, ° range", "walking.shoulders_degrees", "21", "15 (26)", "14–20", 0),
    _style("wrist swings fore and aft, cm", "walking.wrist_fore_aft_cm", "38", "28–40 (21)", "as people's", 0),
    _style("wrist's range sideways, cm", "walking.wrist_sideways_cm", "11–12.5", "4.4–5.7", "as people's"),
    _style("neck's range sideways, cm", "walking.neck_sideways_cm", "", "4.9", "4–5"),
    _style("head bob, cm", "walking.head_bob_cm", "", "1.2", "1–1.5"),
    _style("head pitch while walking, °", "walking.head_pitch_degrees", "−8", "−17 (−30)", "−15", 0),
    _style("head leads a turn by, °", "way.head_leads_degrees", "16", "8 (1)", digits=0),
    _style("getting up, s", "rising.rise_s", "", "", digits=2),
    _style("peak lean of the trunk getting up, °", "rising.lean_degrees", "", "", digits=0),
]


def lines(rows: Iterable[Row], clips: dict[str, Row]) -> tuple[list[str], list[list[str]]]:
    """Header and lines: motions of each library, as they were, of people and as asked for; then clips by their name."""
    made = [row for row in rows if not row["problem"]]
    libraries = list(dict.fromkeys(row["library"] for row in made))
    header = [
        "",
        "before",
        "people",
        "asked",
        *(f"motions, {name}" for name in libraries),
        *(f"clips, {name}" for name in clips),
    ]
    body = []
    for line in LINES:
        ours = [line.motions([row for row in made if row["library"] == name]) for name in libraries]
        theirs = [line.clips(held) if line.clips else "" for held in clips.values()]
        body.append([line.name, line.before, line.people, line.asked, *ours, *theirs])
    return header, body


def shows(row: Row) -> bool:
    """Whether there is something to see in a motion that should not be there."""
    return (
        bool(row["problems"])
        or row["own_percent"] > 0
        or row["hinge_degrees"] > BEYOND
        or row["arms_percent"] > OFTEN
        or row["scene_percent"] > LONG
    )
