# SPDX-License-Identifier: GPL-3.0-or-later
"""The keys of F-curves as arrays: read with all that belongs to them, and written at once."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np

from ..key_fit import BoneKeys

#: Values of a keyframe's `interpolation`, of its handles' types and of its own type, which are the same from 4.2 on.
LINEAR, BEZIER = 1, 2
FREE, ALIGNED = 0, 3
KEYFRAME, GENERATED = 0, 5
#: Numbers of a key: where it and its two handles are.
PLACES = ("co", "handle_left", "handle_right")
#: What else belongs to a key.
KINDS = ("interpolation", "handle_left_type", "handle_right_type", "type", "easing")
MARKS = ("select_control_point", "select_left_handle", "select_right_handle")
EASES = ("amplitude", "back", "period")
#: Slopes that differ by less are one, channel a frame.
SAME_SLOPE = 1e-9
#: Handles that Blender still moves after as many looks are let go.
MOST_LOOKS = 4
#: Keys nearer to each other in time are at one frame; as near to a whole frame a key is on it.
ON_FRAME = 1e-3


@dataclass
class Keys:
    """All keys of one curve, by time."""

    #: Frame and value of the key, of its left and of its right handle, float32, shape (keys, 6).
    places: np.ndarray
    #: `KINDS` by their numbers, shape (keys, 5).
    kinds: np.ndarray
    #: `MARKS`, shape (keys, 3).
    marks: np.ndarray
    #: `EASES`, shape (keys, 3).
    eases: np.ndarray

    def __len__(self) -> int:
        return len(self.places)

    @property
    def times(self) -> np.ndarray:
        return self.places[:, 0]

    def chosen(self, mask: np.ndarray) -> Keys:
        return Keys(self.places[mask], self.kinds[mask], self.marks[mask], self.eases[mask])

    def with_others(self, others: Keys) -> Keys:
        """These and other keys, by time."""
        parts = [
            np.concatenate([getattr(self, name), getattr(others, name)])
            for name in ("places", "kinds", "marks", "eases")
        ]
        order = np.argsort(parts[0][:, 0], kind="stable")
        return Keys(*(part[order] for part in parts))


def read_places(curve: bpy.types.FCurve | None) -> np.ndarray:
    """Where the keys and handles of a curve are, float32, shape (keys, 6); none for no curve."""
    if curve is None:
        return np.empty((0, 6), dtype=np.float32)
    return np.hstack([_read(curve, name, np.float32, 2) for name in PLACES])


def read_keys(curve: bpy.types.FCurve) -> Keys:
    return Keys(
        read_places(curve),
        np.stack([_read(curve, name, np.int32) for name in KINDS], axis=1),
        np.stack([_read(curve, name, bool) for name in MARKS], axis=1),
        np.stack([_read(curve, name, np.float32) for name in EASES], axis=1),
    )


def write_keys(curve: bpy.types.FCurve, keys: Keys) -> None:
    """Has a curve have these keys and no others."""
    points = curve.keyframe_points
    if len(points) != len(keys):
        points.clear()
        points.add(len(keys))
    for k, name in enumerate(KINDS):
        points.foreach_set(name, np.ascontiguousarray(keys.kinds[:, k]))
    for k, name in enumerate(MARKS):
        points.foreach_set(name, np.ascontiguousarray(keys.marks[:, k]))
    for k, name in enumerate(EASES):
        points.foreach_set(name, np.ascontiguousarray(keys.eases[:, k]))
    for k, name in enumerate(PLACES):
        points.foreach_set(name, np.ascontiguousarray(keys.places[:, 2 * k : 2 * k + 2]).ravel())
    curve.update()
    _settle(curve)


def _settle(curve: bpy.types.FCurve) -> None:
    """Has the handles of a curve stay as they are when Blender looks at them again, which aligns and rounds anew."""
    before = read_places(curve)
    for _ in range(MOST_LOOKS):
        curve.update()
        after = read_places(curve)
        moved = (before != after).any(axis=1)
        if not moved.any():
            return
        before = after
    kinds = [_read(curve, name, np.int32) for name in KINDS[1:3]]
    for name, kind in zip(KINDS[1:3], kinds, strict=True):
        kind[moved & (kind == ALIGNED)] = FREE
        curve.keyframe_points.foreach_set(name, kind)
    curve.update()


def _read(curve: bpy.types.FCurve, name: str, kind, width: int = 1) -> np.ndarray:
    values = np.empty(len(curve.keyframe_points) * width, dtype=kind)
    curve.keyframe_points.foreach_get(name, values)
    return values.reshape(-1, width) if width > 1 else values


def every_frame(frames: np.ndarray, values: np.ndarray) -> Keys:
    """A key at each frame, with straight lines between them."""
    places = np.empty((len(frames), 6), dtype=np.float32)
    places[:, 0::2] = frames[:, None] + np.array([0.0, -1.0 / 3.0, 1.0 / 3.0])
    places[:, 1::2] = values[:, None]
    return _generated(places, LINEAR, np.full(len(frames), FREE))


def fitted(keys: BoneKeys, channel: int, start_frame: int) -> Keys:
    """The keys of one channel of a bone. Where a curve stays, or there is none, a handle lies level."""
    times = keys.frames.astype(np.float64)
    spans = np.diff(times, prepend=times[:1] - 1.0, append=times[-1:] + 1.0) if len(times) else np.zeros(1)
    value, before, after = (array[:, channel] for array in (keys.values, keys.before, keys.after))
    places = np.empty((len(times), 6))
    places[:, 0], places[:, 1] = times, value
    places[:, 2], places[:, 3] = times - spans[:-1] / 3.0, value - np.nan_to_num(before) * spans[:-1] / 3.0
    places[:, 4], places[:, 5] = times + spans[1:] / 3.0, value + np.nan_to_num(after) * spans[1:] / 3.0
    places[:, 0::2] += start_frame
    # The whole bone's handles, so that its channels are alike to the hand.
    smooth = (np.abs(keys.before - keys.after) <= SAME_SLOPE).all(axis=1)
    return _generated(places.astype(np.float32), BEZIER, np.where(smooth, ALIGNED, FREE))


def _generated(places: np.ndarray, interpolation: int, handles: np.ndarray) -> Keys:
    count = len(places)
    kinds = np.zeros((count, len(KINDS)), dtype=np.int32)
    kinds[:, 0], kinds[:, 1], kinds[:, 2], kinds[:, 3] = interpolation, handles, handles, GENERATED
    eases = np.tile(np.array([0.8, 1.70158, 4.1], dtype=np.float32), (count, 1))
    return Keys(places, kinds, np.zeros((count, len(MARKS)), dtype=bool), eases)


def played(curve: bpy.types.FCurve, times: np.ndarray) -> np.ndarray:
    """What a curve plays at these times, its modifiers included, float32."""
    return np.fromiter(map(curve.evaluate, times.tolist()), dtype=np.float32, count=len(times))
