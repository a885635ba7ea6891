# SPDX-License-Identifier: GPL-3.0-or-later
"""A take: an action together with the motion that the core gave for it, so that what the artist did stands out.

The run writes keys itself, so a key alone tells nothing: the artist's is what differs from what the run wrote. Re-solve
takes that (and the pins) as constraints, and writes back only what the core changed.
"""

from __future__ import annotations

from dataclasses import replace

import bpy
import numpy as np

from ..errors import SceneError
from ..key_fit import FEET, Channels, places_of
from ..motion import Motion, resample
from ..quaternions import CONJUGATE, multiply
from . import compat, own_rig, rigify, root_motion
from .action_writer import Space
from .channels import data_path
from .control_groups import QUATERNIONS, turned_otherwise
from .curves import read_places
from .every_frame import EveryFrame
from .few_keys import FewKeys
from .pins import Pin, read_pins, write_pins
from .puppet import puppet_of
from .root_motion import OBJECT, PLACE, CarriedSpace
from .scene_time import frame_rate
from .solved import columns_of, curves_of, keep_solved, motion_frames, rows_of, solved_of

#: A key that is larger is a slip, scene units or a quaternion's.
LARGEST_KEY = 1e6
#: A quaternion that is shorter turns nothing.
NO_LENGTH = 1e-6
#: The least share of a take's keys that must be the run's own.
LEAST_OF_RUN = 0.5
#: What moves the armature object, and with it the whole take.
OBJECT_CHANNELS = ("location", "rotation_", "scale", "delta_")
#: What a bone's channel is at rest, of those that Oncue does not key: Blender's key (I) sets them along with the turn.
AT_REST = {"location": 0.0, "scale": 1.0, "rotation_euler": 0.0}
#: As far from that a channel is still at rest.
NEARLY_AT_REST = 1e-6
#: What a bone of an own rig turns (1 − |q · q'|), and its first one moves, scene units, by less has not changed.
SAME_TURN, SAME_PLACE = 1e-9, 1e-6
#: A foot is where the motion has it, but for this.
FOOT_OFF_CM = 1.0
#: A body is of the same size, as a share of it.
SAME_SIZE = 1e-4
#: A frame of the scene this near to one of the core's is that frame.
ON_FRAME = 1e-6


class Take:
    """An action of the character as it is now, beside what was written. Raises SceneError where they do not fit."""

    def __init__(self, scene: bpy.types.Scene, character: bpy.types.Object, action: bpy.types.Action, skeleton: dict):
        self.action, self.skeleton, self._character = action, skeleton, character
        self.solved = solved_of(action)
        puppet = replace(puppet_of(character, scene), ik=self.solved.ik)
        if puppet.rig is not None and abs(puppet.metres_per_unit / self.solved.metres_per_unit - 1.0) > SAME_SIZE:
            raise SceneError(f"{character.name} is of another size than when {action.name} was made: synthesize again.")
        puppet = replace(puppet, scene_scale=self.solved.metres_per_unit * puppet.size)
        self._size = puppet.size
        self._space: Space = puppet.space(self.solved.matrix_world, own_rig.holds_of_action(action, puppet.size))
        #: What carries the body along its way.
        self._root = root_motion.of_take(puppet, self.solved)
        if self.solved.way is not None:
            self._space = CarriedSpace(self._space, character, self.solved.way)
        self._columns = columns_of(self._space)
        #: The bones that are keyed, and groups of controls.
        self.names = self._columns.names
        self._ik = self.solved.ik if puppet.is_control_rig else None
        if self.solved.keys.shape[1] != self._columns.width:
            raise SceneError(f"{character.name} has other bones than when {action.name} was made: synthesize again.")
        self._check(scene, character)
        self.pins = read_pins(action)
        #: The motion at the scene's frames: what was written, but for what the artist holds.
        self._sampled = rows_of(self._space, resample(self.solved.motion, self.solved.scene_rate))
        self._check_values()
        self.keys = self._read(scene.oncue.key_tolerance)
        self._check_keys()

    def _check(self, scene: bpy.types.Scene, character: bpy.types.Object) -> None:
        rate = frame_rate(scene)
        if abs(rate - self.solved.scene_rate) > 1e-6:
            raise SceneError(
                f"{self.action.name} was made at {self.solved.scene_rate:g} frames a second and the scene runs at "
                f"{rate:g}: set the frame rate back, or synthesize again."
            )
        if self._root is not None:
            root_motion.check_way(self._root, self.solved, self.action, curves_of(self.action, character))
        stands = np.array(character.matrix_world)
        if self.solved.root != OBJECT and not np.allclose(stands, self.solved.matrix_world, atol=1e-5):
            raise SceneError(
                f"{character.name} itself was moved since {self.action.name} was made: move it back, and its "
                f"{self.names[0]} bone instead."
            )
        for bone, mode in turned_otherwise(character, list(self._columns.channels())):
            if mode == QUATERNIONS:
                raise SceneError(
                    f"{bone} does not turn by quaternions, in which Re-solve works: set the bones of {character.name} "
                    "to the Rotation Mode Quaternion (WXYZ), and synthesize again where that changes the take."
                )
            raise SceneError(
                f"{bone} does not turn by angles, as Rigify has made it, and Re-solve reads its angle: set it to the "
                "Rotation Mode ZXY Euler, and synthesize again where that changes the take."
            )
        if self._ik is not None:
            self._check_switches(character)
        self._check_curves(character)

    def _check_switches(self, character: bpy.types.Object) -> None:
        """Raises SceneError where a rig is switched to other controls than those that were written."""
        curves = curves_of(self.action, character)
        for switch in rigify.switches_of(character, self._ik):
            keys = read_places(curves.get((switch.data_path, 0)))
            if len(keys) and np.abs(keys[:, 1] - switch.value).max() > NEARLY_AT_REST:
                raise SceneError(
                    f"{switch.data_path} of {self.action.name} is keyed otherwise than it was written, and Re-solve "
                    "reads the controls that were: take these keys out, or synthesize again."
                )

    def _check_curves(self, character: bpy.types.Object) -> None:
        """Raises SceneError where the curves do not play what their keys say, or others play along."""
        columns = list(self._columns.channels())
        own = {(data_path(bone, channel), axis) for bone, channel, axis in columns}
        bones = tuple(dict.fromkeys(f'pose.bones["{bone}"].' for bone, _, _ in columns))
        carrying = () if self._root is None else self._root.paths()
        for curve in compat.action_curves(self.action, character):
            title = f"{curve.data_path}[{curve.array_index}] of {self.action.name}"
            if (curve.data_path, curve.array_index) not in own:
                if curve.data_path.startswith(carrying):
                    continue
                if curve.data_path.startswith(bones) and _stays_at_rest(curve):
                    continue
                if curve.data_path.startswith((*bones, *OBJECT_CHANNELS)):
                    raise SceneError(f"{title} is keyed, which Re-solve does not know of: delete that channel.")
                continue
            if curve.mute or (curve.group is not None and curve.group.mute):
                raise SceneError(f"{title} is muted, so that its keys do not play: unmute it.")
            if curve.lock or (curve.group is not None and curve.group.lock):
                raise SceneError(f"{title} is locked: unlock it, so that Re-solve can write its keys.")
            # Among few keys what a modifier does is seen as what the artist did.
            if self.solved.written is None and any(not modifier.mute for modifier in curve.modifiers):
                raise SceneError(f"{title} has a modifier: bake it into keys, mute it or take it out.")

    def _read(self, tolerance_mm: float) -> EveryFrame | FewKeys:
        """The keys as they stand now, and what plays."""
        curves = curves_of(self.action, self._character)
        if self.solved.written is None:
            return EveryFrame(self.solved, self._columns, curves, self._character, self.pins)
        return FewKeys(self.solved, self._columns, curves, self._character, self.pins, self._space.rest(), tolerance_mm)

    def _check_values(self) -> None:
        """Raises SceneError where a key is no number."""
        for curve in curves_of(self.action, self._character).values():
            keys = read_places(curve)
            # Not a number is not smaller either.
            broken = keys[~(np.abs(keys[:, 1::2]) < LARGEST_KEY).all(axis=1)]
            if len(broken):
                raise SceneError(
                    f"{curve.data_path} of {self.action.name} has a key of {broken[0, 1]:g} at frame {broken[0, 0]:g}, "
                    "where no bone can be: delete it."
                )

    def _check_keys(self) -> None:
        """Raises SceneError where a rotation is none, or the keys as a whole were moved in time or thinned out."""
        name = self.action.name
        self.keys.check(name)
        for bone, first in self._columns.turns():
            lengths = np.linalg.norm(self.keys.shown[:, first : first + 4], axis=1)
            (nowhere,) = np.nonzero(lengths < NO_LENGTH)
            if len(nowhere):
                frame = nowhere[0] + self.solved.start_frame
                raise SceneError(
                    f"{bone} of {name} has a rotation of no length at frame {frame}, which is none: delete its keys "
                    "there."
                )
        if self.keys.share_of_run() < LEAST_OF_RUN:
            raise SceneError(
                f"Most keys of {name} are no longer those of the run, as if they were moved in time or thinned "
                "out, so no motion is left to adapt: undo that, or keep the take without Re-solve."
            )

    # --- what the artist did ------------------------------------------------------------------------------------------

    def is_as(self, other: Take) -> bool:
        """Whether the keys and pins are still those of an earlier look."""
        return self.keys.is_as(other.keys) and self.pins == other.pins

    def artist_keys(self) -> dict[int, set[int]]:
        """Joint → indices of the scene frames at which it is the artist's: changed since, or kept from before."""
        return self.keys.artist_keys()

    def gaps(self) -> dict[int, set[int]]:
        """Joint → indices of the scene frames at which the artist took its key out: what plays there instead stays."""
        return self.keys.gaps()

    def _check_nothing_lies_outside(self) -> None:
        """Raises SceneError where the artist has keyed before or after the motion, where there is none to adapt."""
        first, last = motion_frames(self.action)
        for curve in curves_of(self.action, self._character).values():
            frames = read_places(curve)[:, 0]
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
            keyed = [bone for bone, frames in artist.items() if frame in frames]
            for core_frame, away, root, turns in self._postures(frame, keyed):
                for joint in dict.fromkeys(joint for bone in keyed for joint in self._shows(bone)):
                    # Of two keys beside one of the core's frames the nearer one counts.
                    if away > nearest.get((joint, core_frame), np.inf) - ON_FRAME:
                        continue
                    nearest[joint, core_frame] = away
                    rotations[core_frame, joint] = turns[joint]
                    if joint == 0:
                        positions[core_frame] = root
        joints = list(self.skeleton["names"])
        keys = [{"joint": joints[joint], "frame": frame} for joint, frame in sorted(nearest)]
        posed = Motion(positions.astype(np.float32), rotations.astype(np.float32), motion.frame_rate)
        return posed, keys, pins

    def _shows(self, joint: int) -> list[int]:
        """The core's joints that a bone or a group of controls moves; what only carries the others moves the root."""
        bones = self._space.joints
        if joint < len(bones):
            return [max(bones[joint], 0)]
        names = list(self.skeleton["names"])
        return [names.index(name) for name in self._columns.groups[joint - len(bones)].shows]

    def _postures(self, frame: int, keyed: list[int]):
        """The artist's posture of a scene frame at the core's frames beside it: (frame, distance, root, rotations).

        Between two of the core's frames both are asked for, each turned by as much as the artist turned the frame.
        """
        posed = self.solved.keys[frame].astype(np.float64)
        for joint in keyed:
            columns = self._columns.of(joint)
            posed[columns] = self.keys.shown[frame, columns]
        mine, core = self._posture(posed, frame), self.solved.motion
        # The scene's last frame may lie beyond the core's last, and shows it.
        time = min(frame * core.frame_rate / self.solved.scene_rate, len(core) - 1.0)
        on_frame = abs(time - round(time)) < ON_FRAME
        if on_frame and self._space.is_exact:
            yield round(time), 0.0, mine.root_positions[0], mine.rotations[0]
            return
        base = self._posture(self._sampled[frame], frame)
        for core_frame in (round(time),) if on_frame else (int(time), int(time) + 1):
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
            if not self._space.is_exact:
                raise SceneError(
                    f"{pin.bone} of {self._character.name} is pinned, and pins hold bones of Oncue's own character "
                    "alone: take the pin out, and key the bone."
                )
            if self.solved.root == PLACE:
                raise SceneError(
                    f"{pin.bone} of {self._character.name} is pinned, and {self.action.name} plays in place, where no "
                    "bone stands in the scene: take the pin out, and key the bone."
                )
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

        All other keys stay as they are, bit for bit, and so do the artist's, which are kept for the next time too.
        """
        before, kept, held = self.solved.motion, self.artist_keys(), self._held()
        self._keep_keys(kept)
        same = np.array_equal(motion.root_positions, before.root_positions)
        if same and np.array_equal(motion.rotations, before.rotations):
            self._keep(motion, contacts)
            return None
        values = rows_of(self._space, resample(motion, self.solved.scene_rate))
        changed = None if self._space.is_exact else self._changed(values)
        touched = self.keys.write(motion, values, contacts, held, changed)
        self._keep(motion, contacts)
        return None if touched is None else tuple(frame + self.solved.start_frame for frame in touched)

    def feet_off(self, motion: Motion) -> list[str]:
        """Sentences about feet that what was written leaves elsewhere than an edited motion has them: the artist's
        curves over them stay as they are, between the core's frames too. To be asked once it is written."""
        rows = [rows_of(self._space, resample(motion, self.solved.scene_rate)), solved_of(self.action).keys]
        (wanted, to_be), (shown, are) = (self._feet(played.astype(np.float64)) for played in rows)
        assert wanted == shown
        said = []
        for name, off in zip(wanted, 100.0 * self._size * np.linalg.norm(to_be - are, axis=2).T, strict=True):
            frame = int(np.argmax(off))
            if off[frame] > FOOT_OFF_CM:
                said.append(
                    f"{name} is {off[frame]:.1f} cm from where it should stand at frame "
                    f"{frame + self.solved.start_frame}, since your keys over it stay as they are: key it there too, "
                    "or synthesize with Key Every Frame."
                )
        return said

    def _feet(self, rows: np.ndarray) -> tuple[list[str], np.ndarray]:
        """Feet and toes, by their bones or controls, and where rows of columns have them, the core's metres, (frames,
        these, 3)."""
        rest = self._space.rest()
        locations, rotations, beside = self._columns.split(rows)
        places = places_of(rest, Channels(locations, rotations)) / rest.units_per_metre
        there = [rest.names.index(bone) for side in FEET for bone in side if bone in rest.names]
        names, found = [self.names[bone] for bone in there], [places[:, there]]
        for group, values in zip(self._columns.groups, beside, strict=True):
            if group.shows[-1:] in [(bone,) for side in FEET for bone in side] and len(group.columns) > 4:
                names.append(group.name)
                found.append(values[:, None, :3] / rest.units_per_metre)
        return names, np.concatenate(found, axis=1)

    def _changed(self, values: np.ndarray) -> np.ndarray:
        """Whether each bone is to play otherwise at each frame than before, (frames, bones): on a rig of other
        proportions a joint that was moved may move others' bones."""
        (places, now, beside), (were, before, others) = (self._columns.split(v) for v in (values, self._sampled))
        changed = np.abs(np.sum(now * before, axis=2)) < 1.0 - SAME_TURN
        changed[:, 0] |= np.abs(places - were).max(axis=1) > SAME_PLACE
        groups = [np.abs(a - b).max(axis=1) > SAME_PLACE for a, b in zip(beside, others, strict=True)]
        return np.column_stack([changed, *groups])

    def _keep(self, motion: Motion, contacts: np.ndarray) -> None:
        keep_solved(self.action, self.keys.kept(replace(self.solved, motion=motion, contacts=contacts)))

    def _keep_keys(self, keys: dict[int, set[int]]) -> None:
        kept = [
            Pin(self.names[joint], frame + self.solved.start_frame, frame + self.solved.start_frame)
            for joint, frames in keys.items()
            for frame in frames
        ]
        write_pins(self.action, [pin for pin in self.pins if not pin.is_key] + _joined(kept))

    def _posture(self, row: np.ndarray, frame: int) -> Motion:
        """One row of channels as a motion of one frame of the scene's; quaternions need no unit length, as in
        Blender."""
        places, rotations, beside = self._columns.split(row[None])
        rotations = rotations / np.maximum(np.linalg.norm(rotations, axis=-1, keepdims=True), 1e-9)
        return self._space.at(frame).motion(places, rotations, self.solved.scene_rate, beside)


def _joined(pins: list[Pin]) -> list[Pin]:
    """Kept keys with those of neighbouring frames of one bone as one entry."""
    joined: list[Pin] = []
    for pin in sorted(pins, key=lambda pin: (pin.bone, pin.first_frame)):
        if joined and joined[-1].bone == pin.bone and joined[-1].last_frame >= pin.first_frame - 1:
            joined[-1] = replace(joined[-1], last_frame=max(joined[-1].last_frame, pin.last_frame))
        else:
            joined.append(pin)
    return joined


def _stays_at_rest(curve: bpy.types.FCurve) -> bool:
    """Whether a bone's curve plays nothing: all its keys, and their handles, are what the channel is at rest."""
    rest = AT_REST.get(curve.data_path.rpartition(".")[2])
    if rest is None or any(not modifier.mute for modifier in curve.modifiers):
        return False
    return bool((np.abs(read_places(curve)[:, 1::2] - rest) <= NEARLY_AT_REST).all())
