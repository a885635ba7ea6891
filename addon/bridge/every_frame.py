# SPDX-License-Identifier: GPL-3.0-or-later
"""A take with a key on every frame: what the artist keyed in it, and how an edited motion is written back."""

from __future__ import annotations

from dataclasses import replace

import bpy
import numpy as np

from ..errors import SceneError
from ..motion import Motion
from .curves import read_places
from .pins import Pin
from .solved import Columns, Curves, Solved

#: A key that differs by less from what was written is what was written: the file keeps single precision.
SAME = 2e-6
#: How far from a whole frame a key may be to lie on it.
ON_FRAME = 1e-3


class EveryFrame:
    """Keys that differ from what was written are the artist's; where one was taken out, what plays there stays."""

    def __init__(
        self,
        solved: Solved,
        columns: Columns,
        curves: Curves,
        character: bpy.types.Object,
        pins: list[Pin],
    ) -> None:
        self.solved, self.columns, self.names, self._pins = solved, columns, columns.names, pins
        self._character = character
        self._curves = columns.curves(curves)
        #: What stands there now, NaN where a key is missing.
        self.now = self._read()
        #: The same with what plays where a key is missing.
        self.shown = self._played()

    def is_as(self, other: object) -> bool:
        """Whether all keys are still those of an earlier look."""
        return isinstance(other, EveryFrame) and np.array_equal(self.now, other.now, equal_nan=True)

    def check(self, name: str) -> None:
        """Raises SceneError where the keys of the action of this name were moved in time."""
        for curve in filter(None, self._curves):
            times = read_places(curve)[:, 0]
            between = times[np.abs(times - np.rint(times)) >= ON_FRAME]
            if len(between):
                raise SceneError(
                    f"{name} has keys between frames (the first at {between[0]:.2f}), as moving or scaling "
                    "in time leaves them, and Re-solve works on whole frames: undo that, or snap them (Shift S)."
                )

    def share_of_run(self) -> float:
        """The share of what was written that is still there."""
        return float((np.abs(self.now - self.solved.keys) <= SAME).mean())

    def artist_keys(self) -> dict[int, set[int]]:
        """Joint → indices of the scene frames at which its key is the artist's: changed since, or kept from before."""
        differs = np.abs(self.now - self.solved.keys) > SAME
        found: dict[int, set[int]] = {}
        for joint in range(len(self.names)):
            frames = np.flatnonzero(differs[:, self.columns.of(joint)].any(axis=1))
            if len(frames):
                found[joint] = set(frames.tolist())
        for pin in self._pins:
            if pin.is_key and pin.bone in self.names:
                kept = range(pin.first_frame - self.solved.start_frame, pin.last_frame - self.solved.start_frame + 1)
                here = {k for k in kept if 0 <= k < len(self.now)}
                joint = self.names.index(pin.bone)
                found[joint] = found.get(joint, set()) | {k for k in here if self._is_keyed(k, joint)}
        return {joint: frames for joint, frames in found.items() if frames}

    def gaps(self) -> dict[int, set[int]]:
        """Joint → indices of the scene frames at which the artist took its key out: what plays there instead stays.

        A key of the artist's own that is taken out is no wish any more, and may be filled.
        """
        own = [pin for pin in self._pins if pin.is_key]
        found: dict[int, set[int]] = {}
        for joint, bone in enumerate(self.names):
            missing = np.flatnonzero(np.isnan(self.now[:, self.columns.of(joint)]).any(axis=1))
            kept = [(p.first_frame, p.last_frame) for p in own if p.bone == bone]
            frames = {
                int(frame)
                for frame in missing
                if not any(first <= frame + self.solved.start_frame <= last for first, last in kept)
            }
            if frames:
                found[joint] = frames
        return found

    def _is_keyed(self, frame: int, joint: int) -> bool:
        return bool(np.isfinite(self.now[frame, self.columns.of(joint)]).all())

    def write(
        self, motion: Motion, values: np.ndarray, _contacts, held: dict[int, set[int]], _changed=None
    ) -> tuple[int, int] | None:
        """Writes what an edited motion has changed, `values` (frames, columns), but where joints are held.

        Gives the first and the last frame that it touched, or None where no frame of the scene has changed. Keys that
        the artist took out stay out.
        """
        before = self.solved.motion
        changed = np.flatnonzero(
            (motion.root_positions != before.root_positions).any(axis=1)
            | (motion.rotations != before.rotations).any(axis=(1, 2))
        )
        times = np.arange(len(self.solved.keys)) * (before.frame_rate / self.solved.scene_rate)
        touched = np.flatnonzero((times > changed[0] - 1 + 1e-6) & (times < changed[-1] + 1 - 1e-6))
        if not len(touched):
            return None
        free = np.zeros(values.shape, dtype=bool)
        free[touched] = True
        for joint, frames in held.items():
            free[np.ix_(sorted(frames), self.columns.of(joint))] = False
        self._write(signed(values, self.solved.keys, self.columns), free)
        return int(touched[0]), int(touched[-1])

    def _write(self, values: np.ndarray, free: np.ndarray) -> None:
        for column, curve in enumerate(self._curves):
            if curve is None:
                continue
            points, pairs = curve.keyframe_points, np.ascontiguousarray(read_places(curve)[:, :2])
            frames = self._frames_of(pairs)
            inside = (frames >= 0) & free[np.clip(frames, 0, len(free) - 1), column]
            pairs[inside, 1] = values[frames[inside], column]
            points.foreach_set("co", pairs.ravel())
            for frame in sorted(set(np.flatnonzero(free[:, column]).tolist()) - set(frames.tolist())):
                value = float(values[frame, column])
                added = points.insert(frame + self.solved.start_frame, value, options={"FAST"})
                added.interpolation = "LINEAR"
            curve.update()

    def kept(self, solved: Solved) -> Solved:
        """A take's motion with the keys that stand in the curves now."""
        now = self._read()
        return replace(solved, keys=np.where(np.isfinite(now), now, self.solved.keys))

    def _frames_of(self, pairs: np.ndarray) -> np.ndarray:
        """Which frame of the motion each key lies on; -1 between frames and outside of the motion."""
        frames = np.rint(pairs[:, 0]).astype(int) - self.solved.start_frame
        on = np.abs(pairs[:, 0] - np.rint(pairs[:, 0])) < ON_FRAME
        return np.where(on & (frames >= 0) & (frames < len(self.solved.keys)), frames, -1)

    def _read(self) -> np.ndarray:
        now = np.full(self.solved.keys.shape, np.nan, dtype=np.float32)
        for column, curve in enumerate(self._curves):
            pairs = read_places(curve)[:, :2]
            frames = self._frames_of(pairs)
            now[frames[frames >= 0], column] = pairs[frames >= 0, 1]
        return now

    def _played(self) -> np.ndarray:
        """`now` with what plays at the frames that have no key: what lies between others, or the bone's own posture."""
        played = self.now.copy()
        for column, (bone, channel, axis) in enumerate(self.columns.channels()):
            missing, curve = np.flatnonzero(np.isnan(played[:, column])), self._curves[column]
            if curve is None or not len(curve.keyframe_points):
                played[missing, column] = getattr(self._character.pose.bones[bone], channel)[axis]
                continue
            for frame in missing:
                played[frame, column] = curve.evaluate(frame + self.solved.start_frame)
        return played


def signed(values: np.ndarray, like: np.ndarray, columns: Columns) -> np.ndarray:
    """Rows (frames, columns) with their quaternions' signs as others have them, so that none jumps at the seams."""
    out = values.copy()
    for _, first in columns.turns():
        quaternion = slice(first, first + 4)
        sign = np.sum(values[:, quaternion] * like[:, quaternion], axis=1, keepdims=True)
        out[:, quaternion] *= np.where(sign < 0.0, -1.0, 1.0)
    return out
