# SPDX-License-Identifier: GPL-3.0-or-later
"""Shots as a table: who starts where, and what each does one thing after the other. Knows no Blender.

One row a cue, tab-separated, any number of rooms and shots in one file:

    room shot person step kind x y z heading_deg hold_s at_frame object

`kind` is start, pass, stop, sit or look; take, put or open, which are done at the stop or the sit before (where that is
out of reach, at a stop of their own); or thing. `x y z` is the pelvis joint's target of a sit, the place that is looked
at, where something is put down, a place on the upright hinge of what is opened, and the floor of all else; metres.
`heading_deg` is the angle of the forward direction from +X, counter-clockwise from above. `hold_s` is how long a person
stays at a stop or a sit, or looks, `at_frame` the frame of the scene on which a stop or a sit is to be reached. `step`
says in which order a person's cues are played; the start needs none. `object` names something in the room that the row
is about. A field that is empty is left free: the facing, and the height, are then those that the button would give; a
sit with an object and without x and y is where one sits on it, and a look then goes along with its middle; what is
opened without x and y opens as the button finds. What is put down is the object, or what was taken last.

A row of the kind thing has no person: its object is a GLB file, named as from the room's folder, which stands in the
room at `x y z` before anybody comes, its -Y towards `heading_deg`.

One column more may be there: `hand`, which is left, right (where it is empty) or both, of a take or an open. Lines that
begin with # are remarks.
"""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from pathlib import Path

COLUMNS = ("room", "shot", "person", "step", "kind", "x", "y", "z", "heading_deg", "hold_s", "at_frame", "object")
#: A column that need not be there.
HAND = "hand"
START, PASS, LOOK = "start", "pass", "look"
#: What a person stays at.
ENDS = ("stop", "sit")
#: What is done there with a thing, and the hands that may do it.
WITH_A_HAND = TAKE, OPEN = ("take", "open")
DONE = (TAKE, PUT, OPEN) = (TAKE, "put", OPEN)
HANDS = ("left", "right", "both")
#: What is brought into the room.
THING = "thing"
KINDS = (START, PASS, *ENDS, LOOK, *DONE, THING)

#: Frames on which something can be asked for: a motion begins on the first, and Blender has no later ones.
FRAMES = (2, 1_048_574)


@dataclass(frozen=True)
class Row:
    """One cue of one person; what is None is left free."""

    line: int
    room: str
    shot: str
    person: str
    kind: str
    #: Its place in the order; of a start 0 where the table does not say.
    step: int
    x: float | None
    y: float | None
    z: float | None
    #: Degrees from +X.
    heading: float | None
    hold: float | None
    at_frame: int | None
    object: str
    hand: str

    @property
    def is_come_to(self) -> bool:
        """Whether the body goes there."""
        return self.kind in (START, PASS, *ENDS)

    @property
    def name(self) -> str:
        """What the cue is called: a start as its person."""
        return self.person if self.kind == START else f"{self.person} {self.step} {self.kind.title()}"


@dataclass(frozen=True)
class Shot:
    """The people of one shot: each a start, and cues in the order in which they are played; and what is brought in."""

    room: str
    name: str
    people: tuple[tuple[Row, ...], ...]
    things: tuple[Row, ...] = ()

    @property
    def file(self) -> str:
        return f"{self.room}-{self.name}"

    @property
    def cues(self) -> list[Row]:
        """What the people come to; not what they look at or do there."""
        return [row for person in self.people for row in person[1:] if row.is_come_to]

    @property
    def done(self) -> list[Row]:
        """What the people do with things."""
        return [row for person in self.people for row in person if row.kind in DONE]


class BadTable(SystemExit):
    """A table that cannot be played: one sentence with the line that is to be changed."""


def read_shots(table: Path, room: str | None = None) -> list[Shot]:
    """The shots of the table, or those of a room, in its order. Raises BadTable; all rows are read, whatever the room.

    Raises BadTable as well where the table has no shot, or none of that room.
    """
    try:
        text = table.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise BadTable(f"{table} cannot be read: {error}.") from error
    grouped: dict[tuple[str, str], list[Row]] = {}
    for row in _rows(table, text):
        grouped.setdefault((row.room, row.shot), []).append(row)
    shots = [_shot(table, rows) for rows in grouped.values()]
    found = [shot for shot in shots if room in (None, shot.room)]
    if not found:
        raise BadTable(f"{table} has no shot" + (f" in a room named {room}." if room else "."))
    return found


def _rows(table: Path, text: str) -> list[Row]:
    # A remark, or an empty line, is still a line.
    lines = [(number, line) for number, line in enumerate(text.splitlines(), 1) if line.strip(" \t")]
    lines = [(number, line) for number, line in lines if not line.startswith("#")]
    parsed = csv.reader((line for _, line in lines), delimiter="\t", quoting=csv.QUOTE_NONE)
    cells = [(number, [cell.strip() for cell in row]) for (number, _), row in zip(lines, parsed, strict=True)]
    if not cells:
        raise BadTable(f"{table} has no shot.")
    (line, header), rows = cells[0], cells[1:]
    if lacks := [name for name in COLUMNS if name not in header]:
        raise BadTable(f"{table}, line {line}: the first line names the columns, and {lacks[0]} is not among them.")
    made = []
    for number, row in rows:
        if any(row[len(header) :]):
            raise BadTable(f"{table}, line {number}: there are {len(row)} fields, and {len(header)} columns.")
        # Editors take tabs off the end of a line.
        filled = row + [""] * (len(header) - len(row))
        made.append(_row(table, number, dict(zip(header, filled, strict=False))))
    return made


def _row(table: Path, line: int, cells: dict[str, str]) -> Row:
    def refused(why: str) -> BadTable:
        return BadTable(f"{table}, line {line}: {why}")

    def number(column: str) -> float | None:
        text = cells[column]
        try:
            value = float(text) if text else None
        except ValueError:
            raise refused(f"{column} is “{text}”, which is no number.") from None
        if value is not None and not math.isfinite(value):
            raise refused(f"{column} is “{text}”, which is no number.")
        return value

    def whole(column: str) -> int | None:
        value = number(column)
        if value is not None and value != int(value):
            raise refused(f"{column} is {value:g}, and is to be a whole number.")
        return None if value is None else int(value)

    kind, person = cells["kind"], cells["person"]
    if kind not in KINDS:
        raise refused(f"kind is “{kind}”, which a shot cannot have; give one of {', '.join(KINDS)}.")
    for column in ("room", "shot"):
        if not cells[column]:
            raise refused(f"{column} is empty: every row names it.")
    if bad := [name for name in (cells["room"], cells["shot"]) if "/" in name or "\\" in name]:
        raise refused(f"“{bad[0]}” becomes a file's name, and / and \\ cannot be in one.")
    if kind == THING and (person or cells["step"]):
        raise refused("a thing is nobody's, and there before anybody comes: leave person and step empty.")
    if not person and kind != THING:
        raise refused(f"this {kind} is of nobody: every row names its person.")
    step = whole("step")
    if step is None and kind not in (START, THING):
        raise refused(f"this {kind} has no step, which says when {person} does it.")
    x, y, object_name = number("x"), number("y"), cells["object"]
    of_object = {"sit": "to sit on", LOOK: "to look at", TAKE: "to take", OPEN: "to open"}.get(kind)
    if kind in (*WITH_A_HAND, THING) and not object_name:
        raise refused(f"this {kind} names no object.")
    on_object = of_object and object_name and x is None and y is None
    if (x is None or y is None) and not on_object:
        raise refused(f"this {kind} has no x and y" + (f", and names no object {of_object}." if of_object else "."))
    if kind == LOOK and x is not None and number("z") is None:
        raise refused("this look has no z: nobody could tell how high it is.")
    hold, at_frame = number("hold_s"), whole("at_frame")
    for column, value, having in (("hold_s", hold, (*ENDS, LOOK)), ("at_frame", at_frame, ENDS)):
        if value is not None and kind not in having:
            raise refused(f"a {kind} has no {column}: only {' and '.join(having)} have.")
    if hold is not None and not 0.0 <= hold <= 600.0:
        raise refused(f"hold_s is {hold:g}: give 0 to 600.")
    if at_frame is not None and not FRAMES[0] <= at_frame <= FRAMES[1]:
        raise refused(f"at_frame is {at_frame}, and the motion begins on frame 1: give {FRAMES[0]} to {FRAMES[1]}.")
    hand = cells.get(HAND, "")
    if hand and kind not in WITH_A_HAND:
        raise refused(f"a {kind} has no hand: only {' and '.join(WITH_A_HAND)} have.")
    if hand not in ("", *HANDS):
        raise refused(f"hand is “{hand}”: give {', '.join(HANDS)}, or none.")
    heading = None if kind in (PASS, LOOK, *WITH_A_HAND) else number("heading_deg")
    places = (x, y, number("z"), heading, hold, at_frame)
    return Row(line, cells["room"], cells["shot"], person, kind, step or 0, *places, object_name, hand)


def _shot(table: Path, rows: list[Row]) -> Shot:
    things = tuple(row for row in rows if row.kind == THING)
    rows = [row for row in rows if row.kind != THING]
    if not rows:
        raise BadTable(f"{table}, line {things[0].line}: nobody starts in shot {things[0].shot} of {things[0].room}.")
    starts: dict[str, Row] = {}
    for row in rows:
        if row.kind == START and (other := starts.setdefault(row.person, row)) is not row:
            raise BadTable(f"{table}, line {row.line}: {row.person} starts on line {other.line} already.")
    for row in rows:
        if row.person not in starts:
            raise BadTable(
                f"{table}, line {row.line}: nobody named {row.person} starts in shot {row.shot} of {row.room}."
            )
    people = []
    for person, start in starts.items():
        cues = sorted((row for row in rows if row.person == person and row is not start), key=lambda row: row.step)
        _check_order(table, start, cues)
        people.append((start, *cues))
    return Shot(rows[0].room, rows[0].shot, tuple(people), things)


def _check_order(table: Path, start: Row, cues: list[Row]) -> None:
    """Whether a person's cues, in order, can be played one after the other."""
    played = [row for row in cues if row.is_come_to]
    # What is out of reach is done at a stop of its own.
    if not played and not any(row.kind in DONE for row in cues):
        raise BadTable(f"{table}, line {start.line}: {start.person} starts and has nowhere to go.")
    if played and played[-1].kind == PASS and not any(row.kind in DONE for row in cues[cues.index(played[-1]) :]):
        raise BadTable(f"{table}, line {played[-1].line}: nothing follows this pass; give it a stop or a sit.")
    if cues[0].step < start.step:
        raise BadTable(f"{table}, line {cues[0].line}: step {cues[0].step} of {start.person} comes before the start.")
    timed: Row | None = None
    for before, row in zip([start, *cues], cues, strict=False):
        # A start that has no number of its own is before all.
        if row.step == before.step and (before is not start or row.step > 0):
            late, early = max(row.line, before.line), min(row.line, before.line)
            raise BadTable(f"{table}, line {late}: {row.person} has step {row.step} on line {early} already.")
        if row.at_frame is None:
            continue
        if timed is not None and row.at_frame <= (timed.at_frame or 0):
            raise BadTable(
                f"{table}, line {row.line}: at_frame {row.at_frame} of step {row.step} is not after {timed.at_frame}, "
                f"which step {timed.step} on line {timed.line} asks for."
            )
        timed = row
