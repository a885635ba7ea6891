# SPDX-License-Identifier: GPL-3.0-or-later
"""A take of few keys: which stretches the artist shaped, and how an edited motion is fitted around them."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np

from ..key_fit import BoneKeys, Channels, Rest, fit, limbs_of, planted_frames
from ..motion import Motion
from .curves import (
    BEZIER,
    FREE,
    GENERATED,
    KEYFRAME,
    ON_FRAME,
    Keys,
    fitted,
    played,
    read_keys,
    read_places,
    write_keys,
)
from .every_frame import SAME, signed
from .pins import Pin
from .solved import OF_A_KEY, Columns, Curves, Solved, with_written

#: How far a handle may be from where it was written, frames and channels, and be the same: Blender aligns and rounds.
SAME_HANDLE = 1e-4


@dataclass(frozen=True)
class Stretch:
    """Some of the frames of a joint, both ends included; its curves have a key at either where the motion goes on."""

    first: int
    last: int

    def frames(self) -> set[int]:
        return set(range(self.first, self.last + 1))


@dataclass(frozen=True)
class Compared:
    """The keys of a column, beside those that were written."""

    times: np.ndarray
    #: Which are new since, or have another value.
    fresh: np.ndarray
    #: Which are the artist's own: those, and the ones that were so already.
    own: np.ndarray
    #: Which have another left handle than was written, and which another right one.
    bent: tuple[np.ndarray, ...]


class FewKeys:
    """What plays otherwise than it was written is the artist's, from key to key, and the curves there stay."""

    def __init__(
        self,
        solved: Solved,
        columns: Columns,
        curves: Curves,
        character: bpy.types.Object,
        pins: list[Pin],
        rest: Rest,
        tolerance_mm: float,
    ) -> None:
        self.solved, self.columns, self.names, self._pins = solved, columns, columns.names, pins
        self._all, self._rest, self._tolerance_mm = curves, rest, tolerance_mm
        self._curves = columns.curves(curves)
        self._count = len(solved.keys)
        poses = [getattr(character.pose.bones[bone], channel)[axis] for bone, channel, axis in columns.channels()]
        #: What plays at every half frame of the motion, (times, columns); a bone's own posture where there is no curve.
        self._halves = self._played(np.array(poses, dtype=np.float32))
        #: The same at the frames.
        self.shown = self._halves[::2]
        self._places = [read_places(curve) for curve in self._curves]
        self._differs = np.abs(self.shown - solved.keys) > SAME
        self._written = solved.written or []
        self._keys = [self._compared(column) for column in range(len(self._curves))]
        self._released = self._find_released()
        self._shaped = [self._find_shaped(joint) for joint in range(len(self.names))]

    def is_as(self, other: object) -> bool:
        """Whether all that plays, and each key, are still those of an earlier look."""
        return (
            isinstance(other, FewKeys)
            and np.array_equal(self._halves, other._halves)
            and all(np.array_equal(a, b) for a, b in zip(self._places, other._places, strict=True))
        )

    def check(self, _name: str) -> None:
        """Keys may lie anywhere."""

    def share_of_run(self) -> float:
        """The share of what was written, joint by joint, that still plays so."""
        joints = [self._differs[:, self.columns.of(joint)].any(axis=1) for joint in range(len(self.names))]
        return 1.0 - float(np.mean(joints)) if self._count else 1.0

    def artist_keys(self) -> dict[int, set[int]]:
        """Joint → indices of the scene frames that the artist shaped, now or before: with the keys at both ends."""
        found = {
            joint: set[int]().union(*(s.frames() for s in self._shaped[joint])) for joint in range(len(self.names))
        }
        return {joint: frames for joint, frames in found.items() if frames}

    def gaps(self) -> dict[int, set[int]]:
        """None: what plays where a key was taken out is shaped by the artist."""
        return {}

    # --- what the artist did ------------------------------------------------------------------------------------------

    def _played(self, poses: np.ndarray) -> np.ndarray:
        times = self.solved.start_frame + np.arange(max(2 * self._count - 1, 0)) / 2.0
        out = np.tile(poses, (len(times), 1))
        for column, curve in enumerate(self._curves):
            if curve is not None and len(curve.keyframe_points):
                out[:, column] = played(curve, times)
        return out

    def _compared(self, column: int) -> Compared:
        """The keys of a column beside those that were written."""
        now, written = self._places[column], self._written[column]
        at = _nearest(now[:, 0], written[:, 0])
        like = written[np.maximum(at, 0)] if len(written) else np.zeros((len(now), OF_A_KEY), dtype=np.float32)
        away = np.where(at[:, None] >= 0, np.abs(now - like[:, :6]), np.inf)
        fresh = away[:, 1] > SAME
        bent = tuple(away[:, side : side + 2].max(axis=1, initial=0.0) > SAME_HANDLE for side in (2, 4))
        return Compared(now[:, 0].astype(np.float64), fresh, fresh | (like[:, 6] > 0.5), bent)

    def _common(self, joint: int) -> np.ndarray:
        """The times at which all of a joint's curves have a key, which are the ends of what can be told apart."""
        columns = [c for c in self.columns.of(joint) if self._curves[c] is not None]
        if not columns:
            return np.empty(0)
        times = self._places[columns[0]][:, 0]
        for column in columns[1:]:
            times = times[_nearest(times, self._places[column][:, 0]) >= 0]
        return times[np.abs(times - np.rint(times)) < ON_FRAME].astype(np.float64)

    def _find_released(self) -> list[tuple[Pin, Stretch]]:
        """Stretches that keys of the artist's shaped, all of which were taken out since: they are no wish any more."""
        found = []
        for pin in self._kept_pins():
            joint, stretch = self.names.index(pin.bone), self._stretch(pin)
            had = any(self._within(self._written[c], pin)[:, 6].max(initial=0.0) > 0.5 for c in self.columns.of(joint))
            has = any(len(self._within(self._places[c][self._keys[c].own], pin)) for c in self.columns.of(joint))
            if stretch is not None and had and not has:
                found.append((pin, stretch))
        return found

    def _kept_pins(self) -> list[Pin]:
        return [pin for pin in self._pins if pin.is_key and pin.bone in self.names]

    def _stretch(self, pin: Pin) -> Stretch | None:
        first, last = pin.first_frame - self.solved.start_frame, pin.last_frame - self.solved.start_frame
        first, last = max(first, 0), min(last, self._count - 1)
        return Stretch(first, last) if first <= last else None

    @staticmethod
    def _within(places: np.ndarray, pin: Pin) -> np.ndarray:
        times = places[:, 0]
        return places[(times >= pin.first_frame - ON_FRAME) & (times <= pin.last_frame + ON_FRAME)]

    def _find_shaped(self, joint: int) -> list[Stretch]:
        """What the artist shaped of a joint, from common key to common key."""
        if not self._count:
            return []
        start, end = float(self.solved.start_frame), float(self.solved.start_frame + self._count - 1)
        inner = [time for time in self._common(joint) if start + ON_FRAME < time < end - ON_FRAME]
        bounds = np.array([start, *inner, end]) if end > start else np.array([start, start])
        touched = np.zeros(len(bounds) - 1, dtype=bool)
        released = [stretch for pin, stretch in self._released if pin.bone == self.names[joint]]
        for column in self.columns.of(joint):
            keys = self._keys[column]
            _touch(touched, bounds, keys.times[keys.fresh])
            _touch(touched, bounds, keys.times[keys.bent[0]], (-1,))
            _touch(touched, bounds, keys.times[keys.bent[1]], (0,))
        different = np.flatnonzero(self._differs[:, self.columns.of(joint)].any(axis=1))
        _touch(touched, bounds, start + different)
        for pin in self._kept_pins():
            stretch = self._stretch(pin)
            if pin.bone == self.names[joint] and stretch is not None and (pin, stretch) not in self._released:
                over = (bounds[:-1] < start + stretch.last - ON_FRAME) & (bounds[1:] > start + stretch.first + ON_FRAME)
                touched |= over
        for stretch in released:
            touched &= ~(
                (bounds[:-1] >= start + stretch.first - ON_FRAME) & (bounds[1:] <= start + stretch.last + ON_FRAME)
            )
        found: list[Stretch] = []
        for k in np.flatnonzero(touched):
            first, last = round(bounds[k] - start), round(bounds[k + 1] - start)
            if found and found[-1].last == first:
                found[-1] = Stretch(found[-1].first, last)
            else:
                found.append(Stretch(first, last))
        return found

    # --- back into the curves -----------------------------------------------------------------------------------------

    def write(
        self,
        motion: Motion,
        values: np.ndarray,
        contacts: np.ndarray,
        held: dict[int, set[int]],
        changed: np.ndarray | None = None,
    ) -> tuple[int, int] | None:
        """Fits the curves of the limbs whose motion has changed to `values` (frames, columns): from a key before the
        change to one after it, around what is held there. Gives the first and the last frame between these keys, or
        None where no frame of the scene has changed.

        `changed` (frames, bones) says what has changed where a bone does not show a joint each.
        """
        changed = self._changed_frames(motion) if changed is None else changed
        for pin, stretch in self._released:
            changed[stretch.first : stretch.last + 1, self.names.index(pin.bone)] = True
        stays = np.ones((self._count, len(self.names)), dtype=bool)
        ends = []
        beside = [[joint] for joint in range(len(self.columns.bones), len(self.names))]
        for limb in [*limbs_of(self._rest), *beside]:
            for first, last in _runs(changed[:, limb].any(axis=1)):
                begin, end = self._around(limb, first, last, held)
                stays[begin:end, limb] = False
                inner = begin + (begin > 0), end - (end < self._count - 1)
                ends.append(inner)
                # What hangs on the limb made up for its errors, and has to do so for the new ones.
                changed[inner[0] : inner[1] + 1, self._below(limb)] = True
        for joint, frames in held.items():
            for first, last in _runs(np.isin(np.arange(self._count), list(frames))):
                stays[first:last, joint] = True
        self._name_own()
        if not ends:
            return None
        values = signed(values, self.shown, self.columns)
        for joint, frames in held.items():
            # The core's frames lie between, and what is held plays as it does.
            within = np.ix_(sorted(frames), self.columns.of(joint))
            values[within] = self.shown[within]
        planted = planted_frames(contacts, motion.frame_rate, self.solved.scene_rate, self._count)
        bones = len(self.columns.bones)
        wanted, played = (Channels(*self.columns.split(rows.astype(np.float64))[:2]) for rows in (values, self._halves))
        new = fit(self._rest, wanted, planted, self._tolerance_mm, played, stays[:, :bones])
        for joint, keys in enumerate(new):
            # A location's columns come first here, and last among a bone's channels.
            channels = range(4) if joint else (4, 5, 6, 0, 1, 2, 3)
            self._write(joint, [(keys, channel) for channel in channels], stays[:, joint])
        for joint, group in enumerate(self.columns.groups, bones):
            if not stays[:, joint].all():
                own, units = self.columns.of(joint), self._rest.units_per_metre
                rows = values[:, own].astype(np.float64), self._halves[:, own]
                few = group.fit(rows[0], planted, self._tolerance_mm, units, rows[1], stays[:, joint])
                self._write(joint, few, stays[:, joint])
        return min(first for first, _ in ends), max(last for _, last in ends)

    def _below(self, limb: list[int]) -> list[int]:
        """The joints of other limbs that hang on this one."""
        below: list[int] = []
        for joint, parent in enumerate(self._rest.parents):
            if joint not in limb and (parent in limb or parent in below):
                below.append(joint)
        return below

    def _changed_frames(self, motion: Motion) -> np.ndarray:
        """Whether each joint has changed at each frame of the scene, which lies at or between two of the core's."""
        before = self.solved.motion
        differs = (motion.rotations != before.rotations).any(axis=2)
        differs[:, 0] |= (motion.root_positions != before.root_positions).any(axis=1)
        times = np.minimum(np.arange(self._count) * (before.frame_rate / self.solved.scene_rate), len(before) - 1.0)
        sides = np.floor(times + 1e-6).astype(int), np.ceil(times - 1e-6).astype(int)
        changed: np.ndarray = differs[sides[0]] | differs[sides[1]]
        return changed

    def _around(self, limb: list[int], first: int, last: int, held: dict[int, set[int]]) -> tuple[int, int]:
        """The frames before and after a change at which the whole limb has keys; else the motion's ends."""
        keyed = np.ones(self._count, dtype=bool)
        for joint in limb:
            common = np.rint(self._common(joint) - self.solved.start_frame).astype(int)
            here = np.zeros(self._count, dtype=bool)
            here[common[(common >= 0) & (common < self._count)]] = True
            # Within what is held no key of this bone is needed.
            inside = held.get(joint, set())
            here[[k for k in inside if k - 1 in inside and k + 1 in inside]] = True
            keyed &= here
        before, after = np.flatnonzero(keyed[:first]), np.flatnonzero(keyed[last + 1 :])
        return (int(before[-1]) if len(before) else 0), (int(after[0]) + last + 1 if len(after) else self._count - 1)

    def _write(self, joint: int, few: list[tuple[BoneKeys, int]], stays: np.ndarray) -> None:
        """Has a joint's curves have its new keys, each channel of some, where they do not stay, and at the ends of that
        its new handles."""
        start = self.solved.start_frame
        free = [(start + first, start + last + 1) for first, last in _runs(~stays[:-1])]
        for column, (new, channel) in zip(self.columns.of(joint), few, strict=True):
            curve = self._curves[column]
            if curve is None or not len(new.frames):
                continue
            keys, fresh = read_keys(curve), fitted(new, channel, start)
            inside = np.zeros(len(keys), dtype=bool)
            for first, last in free:
                # A seam's key stays; at the motion's own ends there is none.
                low = first - 1.0 if first == start else first
                high = last + 1.0 if last == start + self._count - 1 else last
                inside |= (keys.times > low + ON_FRAME) & (keys.times < high - ON_FRAME)
            keys = keys.chosen(~inside)
            at = _nearest(fresh.times, keys.times)
            for k in np.flatnonzero(at >= 0):
                _take_handles(keys, int(at[k]), fresh, int(k), new)
            write_keys(curve, keys.with_others(fresh.chosen(at < 0)))

    def _name_own(self) -> None:
        """What the artist moved of the run's keys is no longer typed as the run's."""
        for column, curve in enumerate(self._curves):
            own = self._keys[column].times[self._keys[column].own]
            if curve is None or not len(own):
                continue
            points = curve.keyframe_points
            kinds = np.empty(len(points), dtype=np.int32)
            points.foreach_get("type", kinds)
            mine = (_nearest(read_places(curve)[:, 0], own) >= 0) & (kinds == GENERATED)
            kinds[mine] = KEYFRAME
            points.foreach_set("type", kinds)

    def kept(self, solved: Solved) -> Solved:
        """A take's motion with the keys that stand in the curves now, and which of them are the artist's."""
        own = {
            column: {(float(row[0]), float(row[1])) for row in self._places[column][self._keys[column].own]}
            for column in range(len(self._curves))
        }
        return with_written(solved, self._all, self.columns, own)


def _nearest(times: np.ndarray, others: np.ndarray) -> np.ndarray:
    """For each time the place among others, ascending, of the one that is the same, or -1."""
    if not len(others):
        return np.full(len(times), -1)
    right = np.clip(np.searchsorted(others, times), 0, len(others) - 1)
    left = np.maximum(right - 1, 0)
    best = np.where(np.abs(others[left] - times) < np.abs(others[right] - times), left, right)
    return np.where(np.abs(others[best] - times) < ON_FRAME, best, -1)


def _touch(touched: np.ndarray, bounds: np.ndarray, times: np.ndarray, sides: tuple[int, ...] = (-1, 0)) -> None:
    """Marks the stretches between bounds within which times lie.

    At a bound those before it (-1) and after it (0) that are asked for.
    """
    on = _nearest(times, bounds)
    within = np.searchsorted(bounds, times[on < 0]) - 1
    touched[within[(within >= 0) & (within < len(touched))]] = True
    for side in sides:
        beside = on[on >= 0] + side
        touched[beside[(beside >= 0) & (beside < len(touched))]] = True


def _runs(marks: np.ndarray) -> list[tuple[int, int]]:
    """First and last of each row of marks that are set."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], marks, [False]]).astype(np.int8)))
    return [(int(first), int(last) - 1) for first, last in zip(edges[::2], edges[1::2], strict=True)]


def _take_handles(keys: Keys, at: int, fresh: Keys, k: int, new: BoneKeys) -> None:
    """Gives a key that stays the handle of a new one on the side that is new."""
    before, after = not np.isnan(new.before[k]).any(), not np.isnan(new.after[k]).any()
    if before:
        keys.places[at, 2:4] = fresh.places[k, 2:4]
    if after:
        keys.places[at, 4:6] = fresh.places[k, 4:6]
        keys.kinds[at, 0] = BEZIER
    # An aligned or automatic handle would turn the one that stays.
    keys.kinds[at, 1:3] = FREE
