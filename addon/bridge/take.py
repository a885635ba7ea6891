# SPDX-License-Identifier: GPL-3.0-or-later
"""A take: an action together with the motion that the core gave for it, so that the artist's own keys stand out.

Every frame is keyed by the run, so a key alone tells nothing: the artist's keys are those that differ from what the
run wrote. Re-solve takes them (and the pins) as constraints, and writes back only the frames that the core changed.
"""

from __future__ import annotations

import base64
import io
import zipfile
import zlib
from dataclasses import dataclass, replace

import bpy
import numpy as np

from ..errors import SceneError
from ..motion import Motion, resample
from ..quaternions import CONJUGATE, multiply
from . import compat
from .action_writer import LOCATION, ROTATION, BoneSpace, data_path
from .armature import misfit
from .names import SOLVED_KEY
from .pins import Pin, read_pins, write_pins
from .scene_time import frame_rate

#: A key that differs by less from what was written is what was written: the file keeps single precision.
SAME = 2e-6
#: More is no motion, bytes: an hour of one takes 200 million.
LARGEST_TAKE = 500_000_000
#: A key that is larger is a slip, scene units or a quaternion's.
LARGEST_KEY = 1e6
#: A quaternion that is shorter turns nothing.
NO_LENGTH = 1e-6
#: The least share of a take's keys that must be the run's own.
LEAST_OF_RUN = 0.5
#: What moves the armature object, and with it the whole take.
OBJECT_CHANNELS = ("location", "rotation_", "scale", "delta_")
#: A frame of the scene this near to one of the core's is that frame.
ON_FRAME = 1e-6


@dataclass(frozen=True)
class Solved:
    """What the core gave last for an action, and what was written of it."""

    #: 30 Hz, world, metres.
    motion: Motion
    #: Left and right foot, (frames, 2).
    contacts: np.ndarray
    start_frame: int
    #: Frames a second of the keys.
    scene_rate: float
    metres_per_unit: float
    #: The armature object's world matrix then, (4, 4).
    matrix_world: np.ndarray
    #: The values of the keys then: (scene frames, 3 + 4 · joints), the root's location and the joints' quaternions.
    keys: np.ndarray


def solved_take(
    scene: bpy.types.Scene,
    character: bpy.types.Object,
    names: list[str],
    motion: Motion,
    contacts: np.ndarray,
    *,
    start_frame: int,
    metres_per_unit: float,
) -> Solved:
    """What `write_action` has just written for a motion of the core."""
    rate = frame_rate(scene)
    keys = flat(*BoneSpace(character, names, metres_per_unit).channels(resample(motion, rate)))
    return Solved(motion, contacts, start_frame, rate, metres_per_unit, np.array(character.matrix_world), keys)


def keep_solved(action: bpy.types.Action, solved: Solved) -> None:
    """Keeps it on the action, packed; motion and keys in single precision, as the core and Blender have them."""
    packed = io.BytesIO()
    np.savez_compressed(
        packed,
        root_positions=solved.motion.root_positions.astype(np.float32),
        rotations=solved.motion.rotations.astype(np.float32),
        contacts=solved.contacts.astype(np.float32),
        scale=np.array([solved.motion.frame_rate, solved.start_frame, solved.scene_rate, solved.metres_per_unit]),
        matrix_world=solved.matrix_world,
        keys=solved.keys.astype(np.float32),
    )
    # As text: a property of bytes that is set once more keeps the old length in some Blenders.
    action[SOLVED_KEY] = base64.b85encode(packed.getvalue()).decode("ascii")


def solved_of(action: bpy.types.Action) -> Solved:
    """Raises SceneError for an action that no run of Oncue has made."""
    packed = action.get(SOLVED_KEY)
    if not isinstance(packed, str):
        raise SceneError(f"{action.name} was not made by Oncue: Re-solve knows nothing of how it was before your keys.")
    try:
        file = io.BytesIO(base64.b85decode(packed))
        with zipfile.ZipFile(file) as zipped:
            if sum(entry.file_size for entry in zipped.infolist()) > LARGEST_TAKE:
                raise ValueError("it is larger than any motion")
        with np.load(file, allow_pickle=False) as kept:
            core_rate, start_frame, scene_rate, metres_per_unit = kept["scale"].tolist()
            motion = Motion(kept["root_positions"], kept["rotations"], core_rate)
            contacts, matrix_world, keys = kept["contacts"], kept["matrix_world"], kept["keys"]
        solved = Solved(motion, contacts, int(start_frame), scene_rate, metres_per_unit, matrix_world, keys)
        _check_shapes(solved)
        return solved
    except (OSError, ValueError, TypeError, KeyError, EOFError, OverflowError, zipfile.BadZipFile, zlib.error) as error:
        raise SceneError(f"What {action.name} keeps of its motion is damaged: synthesize it again.") from error


def _check_shapes(solved: Solved) -> None:
    """Raises ValueError where the arrays of a take are not those of one motion."""
    frames, joints = solved.motion.rotations.shape[:2]
    shapes = [solved.motion.root_positions.shape, solved.motion.rotations.shape, solved.contacts.shape]
    arrays = (solved.motion.root_positions, solved.motion.rotations, solved.contacts, solved.keys, solved.matrix_world)
    rates = (solved.motion.frame_rate, solved.scene_rate, solved.metres_per_unit)
    if (
        shapes != [(frames, 3), (frames, joints, 4), (frames, 2)]
        or solved.keys.ndim != 2
        or solved.keys.shape[1] != 3 + 4 * joints
        or solved.matrix_world.shape != (4, 4)
        or not all(np.isfinite(array).all() for array in arrays)
        or not min(rates) > 0.0
    ):
        raise ValueError("its arrays are not those of one motion")


def motion_frames(action: bpy.types.Action) -> tuple[int, int] | None:
    """First and last frame of the scene that the motion of a run takes, or None for an action that is no take."""
    if SOLVED_KEY not in action:
        return None
    solved = solved_of(action)
    return solved.start_frame, solved.start_frame + len(solved.keys) - 1


class Take:
    """An action of the character as it is now, beside what was written. Raises SceneError where they do not fit."""

    def __init__(self, scene: bpy.types.Scene, character: bpy.types.Object, action: bpy.types.Action, skeleton: dict):
        if misfit(character, skeleton) is not None:
            raise SceneError(
                f"{character.name} is a rig of your own, and Re-solve works on Oncue's character alone: edit the keys "
                "as you do those of any take."
            )
        self.action, self.skeleton, self._character = action, skeleton, character
        self.names = list(skeleton["names"])
        self.solved = solved_of(action)
        self._check(scene, character)
        self.pins = read_pins(action)
        self._space = BoneSpace(character, self.names, self.solved.metres_per_unit, self.solved.matrix_world)
        #: The motion at the scene's frames: what was written, but for the keys that the artist holds.
        self._sampled = flat(*self._space.channels(resample(self.solved.motion, self.solved.scene_rate)))
        self.written = self.solved.keys
        #: What stands there now, NaN where a key is missing.
        self.now = self._read()
        self._check_timing()
        #: The same with what plays where a key is missing.
        self._shown = self._played()

    def _check(self, scene: bpy.types.Scene, character: bpy.types.Object) -> None:
        rate = frame_rate(scene)
        if abs(rate - self.solved.scene_rate) > 1e-6:
            raise SceneError(
                f"{self.action.name} was made at {self.solved.scene_rate:g} frames a second and the scene runs at "
                f"{rate:g}: set the frame rate back, or synthesize again."
            )
        if not np.allclose(np.array(character.matrix_world), self.solved.matrix_world, atol=1e-5):
            raise SceneError(
                f"{character.name} itself was moved since {self.action.name} was made: move it back, and its Hips bone "
                "instead."
            )
        turned = [b for b in character.pose.bones if b.name in self.names and b.rotation_mode != "QUATERNION"]
        if turned:
            raise SceneError(
                f"{turned[0].name} does not turn by quaternions, in which Re-solve works: set the bones of "
                f"{character.name} to the Rotation Mode Quaternion (WXYZ), and "
                "synthesize again where that changes the take."
            )
        self._check_curves(character)

    def _check_curves(self, character: bpy.types.Object) -> None:
        """Raises SceneError where the curves do not play what their keys say, or others play along."""
        own = {(data_path(bone, channel), axis) for bone, channel, axis in self._channels()}
        bones = tuple(f'pose.bones["{bone}"].' for bone in self.names)
        for curve in compat.action_curves(self.action, character):
            title = f"{curve.data_path}[{curve.array_index}] of {self.action.name}"
            if (curve.data_path, curve.array_index) not in own:
                if curve.data_path.startswith((*bones, *OBJECT_CHANNELS)):
                    raise SceneError(f"{title} is keyed, which Re-solve does not know of: delete that channel.")
                continue
            if curve.mute or (curve.group is not None and curve.group.mute):
                raise SceneError(f"{title} is muted, so that its keys do not play: unmute it.")
            if curve.lock or (curve.group is not None and curve.group.lock):
                raise SceneError(f"{title} is locked: unlock it, so that Re-solve can write its keys.")
            if any(not modifier.mute for modifier in curve.modifiers):
                raise SceneError(f"{title} has a modifier: bake it into keys, mute it or take it out.")

    def _check_timing(self) -> None:
        """Raises SceneError where a key is no number, or the keys as a whole were moved in time or thinned out."""
        name = self.action.name
        for curve in self._curves().values():
            keys = _coordinates(curve)
            # Not a number is not smaller either.
            broken = keys[~(np.abs(keys[:, 1]) < LARGEST_KEY)]
            if len(broken):
                raise SceneError(
                    f"{curve.data_path} of {name} has a key of {broken[0, 1]:g} at frame {broken[0, 0]:g}, where no "
                    "bone can be: delete it."
                )
            between = keys[np.abs(keys[:, 0] - np.rint(keys[:, 0])) >= 1e-3]
            if len(between):
                raise SceneError(
                    f"{name} has keys between frames (the first at {between[0, 0]:.2f}), as moving or scaling "
                    "in time leaves them, and Re-solve works on whole frames: undo that, or snap them (Shift S)."
                )
        for joint, bone in enumerate(self.names):
            lengths = np.linalg.norm(self.now[:, self._columns(joint)][:, -4:], axis=1)
            (nowhere,) = np.nonzero(lengths < NO_LENGTH)
            if len(nowhere):
                frame = nowhere[0] + self.solved.start_frame
                raise SceneError(
                    f"{bone} of {name} has a rotation of no length at frame {frame}, which is none: delete its keys "
                    "there."
                )
        same = np.abs(self.now - self.written) <= SAME
        if same.mean() < LEAST_OF_RUN:
            raise SceneError(
                f"Most keys of {name} are no longer those of the run, as if they were moved in time or thinned "
                "out, so no motion is left to adapt: undo that, or keep the take without Re-solve."
            )

    # --- what the artist did ------------------------------------------------------------------------------------------

    def is_as(self, other: Take) -> bool:
        """Whether the keys and pins are still those of an earlier look."""
        return np.array_equal(self.now, other.now, equal_nan=True) and self.pins == other.pins

    def artist_keys(self) -> dict[int, set[int]]:
        """Joint → indices of the scene frames at which its key is the artist's: changed since, or kept from before."""
        differs = np.abs(self.now - self.written) > SAME
        found: dict[int, set[int]] = {}
        for joint in range(len(self.names)):
            frames = np.flatnonzero(differs[:, self._columns(joint)].any(axis=1))
            if len(frames):
                found[joint] = set(frames.tolist())
        for pin in self.pins:
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
        own = [pin for pin in self.pins if pin.is_key]
        found: dict[int, set[int]] = {}
        for joint, bone in enumerate(self.names):
            missing = np.flatnonzero(np.isnan(self.now[:, self._columns(joint)]).any(axis=1))
            kept = [(p.first_frame, p.last_frame) for p in own if p.bone == bone]
            frames = {
                int(frame)
                for frame in missing
                if not any(first <= frame + self.solved.start_frame <= last for first, last in kept)
            }
            if frames:
                found[joint] = frames
        return found

    def _check_nothing_lies_outside(self) -> None:
        """Raises SceneError where the artist has keyed before or after the motion, where there is none to adapt."""
        first, last = motion_frames(self.action)
        for curve in self._curves().values():
            frames = _coordinates(curve)[:, 0]
            outside = frames[(frames < first) | (frames > last)]
            if len(outside):
                raise SceneError(
                    f"{self.action.name} was keyed at frame {outside[0]:g} alone, outside of its motion's frames "
                    f"{first} to {last}: pose a bone and key it within these, and press again."
                )

    def _held(self) -> dict[int, set[int]]:
        """Joint → indices of the scene frames at which it stays as it is shown."""
        keys, gaps = self.artist_keys(), self.gaps()
        return {joint: keys.get(joint, set()) | gaps.get(joint, set()) for joint in sorted({*keys, *gaps})}

    def _is_keyed(self, frame: int, joint: int) -> bool:
        return bool(np.isfinite(self.now[frame, self._columns(joint)]).all())

    def edit(self) -> tuple[Motion, list[dict], list[dict]]:
        """What Re-solve asks of the core, at 30 Hz: the motion with the artist's keys in it, {"joint", "frame"} of each
        of these, and the pins as constraints. Raises SceneError where nothing was keyed or pinned.
        """
        artist, motion = self._held(), self.solved.motion
        pins = self._of_pins()
        if not artist and not pins:
            self._check_nothing_lies_outside()
            raise SceneError(
                "Nothing was keyed or pinned since the last solve: pose a bone and key it, or pin one, and press again."
            )
        positions, rotations = motion.root_positions.astype(np.float64), motion.rotations.astype(np.float64)
        nearest: dict[tuple[int, int], float] = {}
        for frame in sorted({frame for frames in artist.values() for frame in frames}):
            keyed = [joint for joint, frames in artist.items() if frame in frames]
            for core_frame, away, root, turns in self._postures(frame, keyed):
                for joint in keyed:
                    # Of two keys beside one of the core's frames the nearer one counts.
                    if away > nearest.get((joint, core_frame), np.inf) - ON_FRAME:
                        continue
                    nearest[joint, core_frame] = away
                    rotations[core_frame, joint] = turns[joint]
                    if joint == 0:
                        positions[core_frame] = root
        keys = [{"joint": self.names[joint], "frame": frame} for joint, frame in sorted(nearest)]
        posed = Motion(positions.astype(np.float32), rotations.astype(np.float32), motion.frame_rate)
        return posed, keys, pins

    def _postures(self, frame: int, keyed: list[int]):
        """The artist's posture of a scene frame at the core's frames beside it: (frame, distance, root, rotations).

        Between two of the core's frames both are asked for, each turned by as much as the artist turned the frame.
        """
        posed = self.written[frame].astype(np.float64)
        for joint in keyed:
            columns = self._columns(joint)
            posed[columns] = self._shown[frame, columns]
        mine, core = self._posture(posed), self.solved.motion
        # The scene's last frame may lie beyond the core's last, and shows it.
        time = min(frame * core.frame_rate / self.solved.scene_rate, len(core) - 1.0)
        if abs(time - round(time)) < ON_FRAME:
            yield round(time), 0.0, mine.root_positions[0], mine.rotations[0]
            return
        base = self._posture(self._sampled[frame])
        for core_frame in (int(time), int(time) + 1):
            if core_frame >= len(core):
                continue
            turn = multiply(base.rotations[0] * CONJUGATE, mine.rotations[0])
            root = core.root_positions[core_frame] + mine.root_positions[0] - base.root_positions[0]
            yield core_frame, abs(time - core_frame), root, multiply(core.rotations[core_frame], turn)

    def _of_pins(self) -> list[dict]:
        found = []
        for pin in self.pins:
            if pin.is_key or pin.bone not in self.names:
                continue
            step, end = self.solved.motion.frame_rate / self.solved.scene_rate, len(self.solved.motion) - 1.0
            first, last = (min((f - self.solved.start_frame) * step, end) for f in (pin.first_frame, pin.last_frame))
            begin = round(first) if first == last else int(np.ceil(first - ON_FRAME))
            count = max(int(np.floor(last + ON_FRAME)) - begin, 0) + 1
            made = {"name": f"Pin of {pin.bone}", "joint": pin.bone, "first_frame": begin}
            if pin.position is not None:
                made["positions"] = [[c * self.solved.metres_per_unit for c in pin.position]] * count
            if pin.rotation is not None:
                made["rotations"] = [list(pin.rotation)] * count
            found.append(made)
        return found

    # --- back into the action -----------------------------------------------------------------------------------------

    def write(self, motion: Motion, contacts: np.ndarray) -> tuple[int, int] | None:
        """Writes an edited motion (30 Hz, as long as the one before) into the action; the scene's frames it touched.

        All other keys stay as they are, bit for bit, and so do the artist's, which are kept for the next time too. Keys
        that the artist took out stay out.
        """
        keys, held = self.artist_keys(), self._held()
        before = self.solved.motion
        changed = np.flatnonzero(
            (motion.root_positions != before.root_positions).any(axis=1)
            | (motion.rotations != before.rotations).any(axis=(1, 2))
        )
        self._keep_keys(keys)
        if not len(changed):
            self._keep(motion, contacts)
            return None
        step = before.frame_rate / self.solved.scene_rate
        times = np.arange(len(self.written)) * step
        touched = np.flatnonzero((times > changed[0] - 1 + ON_FRAME) & (times < changed[-1] + 1 - ON_FRAME))
        values = flat(*self._space.channels(resample(motion, self.solved.scene_rate)))
        free = np.zeros(values.shape, dtype=bool)
        free[touched] = True
        for joint, frames in held.items():
            free[np.ix_(sorted(frames), self._columns(joint))] = False
        self._write(values, free)
        self._keep(motion, contacts)
        return int(touched[0]) + self.solved.start_frame, int(touched[-1]) + self.solved.start_frame

    def _keep(self, motion: Motion, contacts: np.ndarray) -> None:
        now = self._read()
        keys = np.where(np.isfinite(now), now, self.written)
        keep_solved(self.action, replace(self.solved, motion=motion, contacts=contacts, keys=keys))

    def _keep_keys(self, keys: dict[int, set[int]]) -> None:
        kept = [
            Pin(self.names[joint], frame + self.solved.start_frame, frame + self.solved.start_frame)
            for joint, frames in keys.items()
            for frame in frames
        ]
        write_pins(self.action, [pin for pin in self.pins if not pin.is_key] + _joined(kept))

    def _write(self, values: np.ndarray, free: np.ndarray) -> None:
        curves = self._curves()
        for column, (bone, channel, axis) in enumerate(self._channels()):
            curve = curves.get((data_path(bone, channel), axis))
            if curve is None:
                continue
            points, pairs = curve.keyframe_points, _coordinates(curve)
            frames = self._frames_of(pairs)
            inside = (frames >= 0) & free[np.clip(frames, 0, len(free) - 1), column]
            pairs[inside, 1] = self._signed(values, column)[frames[inside]]
            points.foreach_set("co", pairs.ravel())
            for frame in sorted(set(np.flatnonzero(free[:, column]).tolist()) - set(frames.tolist())):
                value = float(self._signed(values, column)[frame])
                added = points.insert(frame + self.solved.start_frame, value, options={"FAST"})
                added.interpolation = "LINEAR"
            curve.update()

    def _signed(self, values: np.ndarray, column: int) -> np.ndarray:
        """A column with its quaternions' signs as they were written, so that no channel jumps at the seams."""
        if column < 3:
            return values[:, column]
        quaternion = slice(3 + (column - 3) // 4 * 4, 3 + (column - 3) // 4 * 4 + 4)
        sign = np.sum(values[:, quaternion] * self.written[:, quaternion], axis=1)
        return values[:, column] * np.where(sign < 0.0, -1.0, 1.0)

    # --- channels -----------------------------------------------------------------------------------------------------

    def _channels(self):
        """(bone, channel, axis) of each column."""
        yield from ((self.names[0], LOCATION, axis) for axis in range(3))
        yield from ((bone, ROTATION, axis) for bone in self.names for axis in range(4))

    def _columns(self, joint: int) -> list[int]:
        """The columns of a joint; the root's has its location too."""
        own = list(range(3 + 4 * joint, 7 + 4 * joint))
        return [0, 1, 2, *own] if joint == 0 else own

    def _posture(self, row: np.ndarray) -> Motion:
        """One row of channels as a motion of one frame; quaternions need no unit length, as in Blender."""
        rotations = row[3:].reshape(1, -1, 4)
        rotations = rotations / np.maximum(np.linalg.norm(rotations, axis=-1, keepdims=True), 1e-9)
        return self._space.motion(row[None, :3], rotations, self.solved.scene_rate)

    def _curves(self) -> dict[tuple[str, int], bpy.types.FCurve]:
        return {
            (curve.data_path, curve.array_index): curve for curve in compat.action_curves(self.action, self._character)
        }

    def _frames_of(self, pairs: np.ndarray) -> np.ndarray:
        """Which frame of the motion each key lies on; -1 between frames and outside of the motion."""
        frames = np.rint(pairs[:, 0]).astype(int) - self.solved.start_frame
        on = (np.abs(pairs[:, 0] - np.rint(pairs[:, 0])) < 1e-3) & (frames >= 0) & (frames < len(self.written))
        return np.where(on, frames, -1)

    def _read(self) -> np.ndarray:
        now = np.full(self.written.shape, np.nan, dtype=np.float32)
        curves = self._curves()
        for column, (bone, channel, axis) in enumerate(self._channels()):
            curve = curves.get((data_path(bone, channel), axis))
            if curve is None:
                continue
            pairs = _coordinates(curve)
            frames = self._frames_of(pairs)
            now[frames[frames >= 0], column] = pairs[frames >= 0, 1]
        return now

    def _played(self) -> np.ndarray:
        """`now` with what plays at the frames that have no key: what lies between others, or the bone's own posture."""
        played, curves = self.now.copy(), self._curves()
        for column, (bone, channel, axis) in enumerate(self._channels()):
            missing = np.flatnonzero(np.isnan(played[:, column]))
            curve = curves.get((data_path(bone, channel), axis))
            if curve is None or not len(curve.keyframe_points):
                played[missing, column] = getattr(self._character.pose.bones[bone], channel)[axis]
                continue
            for frame in missing:
                played[frame, column] = curve.evaluate(frame + self.solved.start_frame)
        return played


def _coordinates(curve: bpy.types.FCurve) -> np.ndarray:
    """(frame, value) of each key, shape (keys, 2)."""
    coordinates = np.empty(len(curve.keyframe_points) * 2, dtype=np.float32)
    curve.keyframe_points.foreach_get("co", coordinates)
    return coordinates.reshape(-1, 2)


def flat(locations: np.ndarray, rotations: np.ndarray) -> np.ndarray:
    """The channels side by side, as `Solved.keys` has them."""
    return np.concatenate([locations, rotations.reshape(len(rotations), -1)], axis=1)


def _joined(pins: list[Pin]) -> list[Pin]:
    """Kept keys with those of neighbouring frames of one bone as one entry."""
    joined: list[Pin] = []
    for pin in sorted(pins, key=lambda pin: (pin.bone, pin.first_frame)):
        if joined and joined[-1].bone == pin.bone and joined[-1].last_frame >= pin.first_frame - 1:
            joined[-1] = replace(joined[-1], last_frame=max(joined[-1].last_frame, pin.last_frame))
        else:
            joined.append(pin)
    return joined
