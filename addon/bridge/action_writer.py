# SPDX-License-Identifier: GPL-3.0-or-later
"""Motion of the core → a new action of the character: few keys of Bézier curves, or one on every frame of the scene."""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterator, Sequence
from typing import Protocol

import bpy
import numpy as np

from .. import quaternions
from ..errors import SceneError
from ..key_fit import TOLERANCE_MM, TURN, BoneKeys, Channels, Rest, fit, planted_frames
from ..motion import Motion, resample
from ..quaternions import CONJUGATE, multiply
from . import compat
from .armature import rest_of, rest_rotations
from .bones import keyed_channels, put_to_rest
from .channels import ANGLES, LOCATION, ROTATION, CurveKeys, angle_keys, data_path, rotation_values
from .control_groups import Group, keys_of
from .curves import every_frame, fitted, write_keys
from .names import REPORT_KEY
from .scene_time import frame_rate

#: First and last frame of a scene that nobody has set.
FACTORY_RANGE = (1, 250)
#: By how much few keys of angles may play otherwise than those of quaternions, a share of the tolerance of a turn.
ANGLES_OFF = 0.25


class Space(Protocol):
    """The way between the core's arrays and the channels of some armature's bones."""

    #: The bones that are keyed: the first one's location, and rotations of all.
    bones: list[str]
    #: The core's joint that each shows; −1 for a first one that only carries the others.
    joints: list[int]
    #: Controls that are keyed beside these.
    groups: list[Group]
    #: Whether `motion` is the exact inverse of `channels`: the rig's proportions are the core's.
    is_exact: bool

    def channels(self, motion: Motion) -> tuple[np.ndarray, np.ndarray]: ...
    def motion(
        self,
        locations: np.ndarray,
        rotations: np.ndarray,
        frame_rate: float,
        beside: Sequence[np.ndarray] = (),
        way: np.ndarray | None = None,
    ) -> Motion: ...
    def rest(self) -> Rest: ...
    def at(self, frame: int) -> Space: ...
    def beside(self, motion: Motion, way: np.ndarray | None = None) -> list[np.ndarray]:
        """What each of `groups` plays, (frames, its columns). `way`, (frames, 4, 4): what carries all of the body,
        armature space."""
        ...


class Root(Protocol):
    """What carries the body along its way."""

    def write(
        self, curves: compat.CurveSet, space: Space, sampled: Motion, start_frame: int, tolerance_mm: float | None
    ) -> Space: ...


class BoneSpace:
    """The way between the core's arrays and the channels of the character's bones.

    Pose space of Blender: a bone's matrix is its parent's times its rest offset times its own rotation, so a
    parent-relative rotation r becomes B⁻¹ r B with the bone's rest rotation B. The root is taken into the
    armature object's space first, so that the motion stays in the world wherever the object stands: `matrix_world`
    says where, or else the object does.
    """

    def __init__(
        self, character: bpy.types.Object, names: list[str], metres_per_unit: float, matrix_world=None
    ) -> None:
        #: As of a `Space`.
        self.bones, self.joints, self.is_exact = list(names), list(range(len(names))), True
        self.groups: list[Group] = []
        self._character, self._matrix_world = character, matrix_world
        rest = rest_rotations(character, names)
        self._rest_root = rest[0]
        self._into = np.array([quaternions.from_matrix(matrix) for matrix in rest])
        self._metres = metres_per_unit
        world = np.array(character.matrix_world if matrix_world is None else matrix_world, dtype=np.float64)
        self._to_world = world
        self._spin = quaternions.from_matrix(world[:3, :3] / np.cbrt(np.linalg.det(world[:3, :3])))
        self._root_head = np.array(character.data.bones[names[0]].head_local, dtype=np.float64)

    def channels(self, motion: Motion) -> tuple[np.ndarray, np.ndarray]:
        """A motion as root locations (frames, 3) and quaternions (frames, joints, 4) in each bone's rest frame."""
        to_object = np.linalg.inv(self._to_world)
        positions = motion.root_positions.astype(np.float64) / self._metres
        positions = positions @ to_object[:3, :3].T + to_object[:3, 3]
        locations = (positions - self._root_head) @ self._rest_root
        rotations = motion.rotations.astype(np.float64).copy()
        rotations[:, 0] = multiply(self._spin * CONJUGATE, rotations[:, 0])
        rotations = multiply(multiply(self._into * CONJUGATE, rotations), self._into)
        return locations, quaternions.continuous(rotations)

    def motion(self, locations: np.ndarray, rotations: np.ndarray, frame_rate: float, _beside=(), _way=None) -> Motion:
        """The inverse of `channels`."""
        positions = locations @ self._rest_root.T + self._root_head
        positions = (positions @ self._to_world[:3, :3].T + self._to_world[:3, 3]) * self._metres
        turned = multiply(multiply(self._into, rotations), self._into * CONJUGATE)
        turned[:, 0] = multiply(self._spin, turned[:, 0])
        return Motion(positions, turned, frame_rate)

    def at(self, _frame: int) -> BoneSpace:
        """The same for motions of one frame of a take."""
        return self

    def rest(self) -> Rest:
        """How the bones hang on each other."""
        return rest_of(self._character, self.bones, self._metres, self._matrix_world)

    def beside(self, _motion: Motion, _way: np.ndarray | None = None) -> list[np.ndarray]:
        """None: all that is keyed are its bones."""
        return []


def write_action(
    context: bpy.types.Context,
    character: bpy.types.Object,
    names: list[str],
    motion: Motion,
    *,
    name: str,
    start_frame: int,
    metres_per_unit: float = 1.0,
    report: dict | None = None,
    contacts: np.ndarray | None = None,
    tolerance_mm: float | None = None,
    space: Space | None = None,
    root: Root | None = None,
) -> bpy.types.Action:
    """Writes `motion` into a new action of `character` and has the scene's frame range end no earlier.

    Every frame is keyed, or with `tolerance_mm` as few as keep hands and feet that near to the motion; `contacts`
    (frames, 2) says where these stand. `space` is the way to the bones of another rig than Oncue's own skeleton;
    `root` carries the body along its way, or else its first bone does.
    Earlier actions stay in the file: each keeps a fake user. What they moved of the skeleton's bones, and of those
    that shape it along with them, and this one does not goes back to rest.
    """
    space, sampled = _sampled(context, character, names, motion, metres_per_unit, space)
    names, before = space.bones, keyed_channels(character)
    action = bpy.data.actions.new(name)
    action.use_fake_user = True
    curves = compat.CurveSet(action, character)
    if root is not None:
        space = root.write(curves, space, sampled, start_frame, tolerance_mm)
    channels = Channels(*space.channels(sampled))
    stands = np.zeros((0, 2), dtype=np.float32) if contacts is None else contacts
    planted = planted_frames(stands, motion.frame_rate, frame_rate(context.scene), len(sampled))
    if tolerance_mm is None:
        keys = _every_frame(character, names, channels, start_frame)
    else:
        few = fit(space.rest(), channels, planted, tolerance_mm)
        keys = _few(character, names, channels, few, tolerance_mm, start_frame)
    units = space.rest().units_per_metre
    beside = (
        keys_of(character, group, values, planted, tolerance_mm, units, start_frame)
        for group, values in zip(space.groups, space.beside(sampled), strict=True)
    )
    for (bone, channel, axis), written in itertools.chain(keys, *beside):
        write_keys(curves.new(data_path(bone, channel), axis, bone), written)
    _keep_previous(character)
    if report is not None:
        action[REPORT_KEY] = json.dumps(report)
    compat.assign_action(character, action, curves)
    put_to_rest([character.pose.bones[bone] for bone in names], before)
    _show_frames(context.scene, action, start_frame, len(sampled))
    return action


def rewrite_action(
    context: bpy.types.Context,
    character: bpy.types.Object,
    action: bpy.types.Action,
    names: list[str],
    motion: Motion,
    *,
    start_frame: int,
    metres_per_unit: float = 1.0,
) -> None:
    """Writes `motion` over the keys of an action that `write_action` has made for this character: one on every frame.

    Raises SceneError for another one.
    """
    space, sampled = _sampled(context, character, names, motion, metres_per_unit)
    channels = Channels(*space.channels(sampled))
    curves = {(curve.data_path, curve.array_index): curve for curve in compat.action_curves(action, character)}
    keys = _every_frame(character, names, channels, start_frame)
    there = [(curves.get((data_path(bone, channel), axis)), written) for (bone, channel, axis), written in keys]
    if any(curve is None for curve, _ in there):
        raise SceneError(f"{action.name} lacks channels of the character: synthesize the motion again.")
    for curve, written in there:
        write_keys(curve, written)
    _show_frames(context.scene, action, start_frame, len(sampled))


def _sampled(
    context, character, names: list[str], motion: Motion, metres_per_unit: float, space: Space | None = None
) -> tuple[Space, Motion]:
    """The way into the bones' channels as the character stands now, and a motion at the scene's frames."""
    context.view_layer.update()
    return space or BoneSpace(character, names, metres_per_unit), resample(motion, frame_rate(context.scene))


def _every_frame(
    character: bpy.types.Object, names: list[str], channels: Channels, start_frame: int
) -> Iterator[CurveKeys]:
    """A key at each frame, in each bone's own rotation mode."""
    frames = start_frame + np.arange(len(channels.locations), dtype=np.float64)
    for axis in range(3):
        yield (names[0], LOCATION, axis), every_frame(frames, channels.locations[:, axis])
    for joint, bone in enumerate(names):
        mode = character.pose.bones[bone].rotation_mode
        channel, values = rotation_values(mode, channels.rotations[:, joint])
        for axis in range(values.shape[1]):
            yield (bone, channel, axis), every_frame(frames, values[:, axis])


def _few(
    character: bpy.types.Object,
    names: list[str],
    channels: Channels,
    few: list[BoneKeys],
    tolerance_mm: float,
    start_frame: int,
) -> Iterator[CurveKeys]:
    """The fitted keys; a bone that does not turn by quaternions has them as angles, or else one on every frame."""
    frames = start_frame + np.arange(len(channels.locations), dtype=np.float64)
    most = ANGLES_OFF * np.radians(TURN * tolerance_mm / TOLERANCE_MM)
    for axis in range(3):
        yield (names[0], LOCATION, axis), fitted(few[0], 4 + axis, start_frame)
    for joint, bone in enumerate(names):
        mode = character.pose.bones[bone].rotation_mode
        channel, values = rotation_values(mode, channels.rotations[:, joint])
        keys: BoneKeys | None = few[joint]
        if channel != ROTATION:
            keys = angle_keys(few[joint], values, mode, most) if channel == ANGLES else None
        for axis in range(values.shape[1]):
            yield (
                (bone, channel, axis),
                every_frame(frames, values[:, axis]) if keys is None else fitted(keys, axis, start_frame),
            )


def _show_frames(scene: bpy.types.Scene, action: bpy.types.Action, first: int, count: int) -> None:
    """Has the action say which frames are its motion's, and the scene end no earlier.

    An end that an earlier take made is moved back too, as far as the artist's own. Where the shot begins is the
    artist's alone.
    """
    if not count:
        return
    last = first + count - 1
    action.use_frame_range = True
    action.frame_start, action.frame_end = first, last
    fit_end(scene, last)


def fit_end(scene: bpy.types.Scene, last: int) -> None:
    """Has the scene end no earlier than a take's last frame, and no later than the artist had it and this asks for."""
    settings = scene.oncue
    if scene.frame_end != settings.fitted_end:
        settings.shot_end = 0 if _is_nobodys_shot(scene, last) else scene.frame_end
    end = max(settings.shot_end, last)
    settings.fitted_end = end if end != settings.shot_end else -1
    scene.frame_end = end


def _is_nobodys_shot(scene: bpy.types.Scene, last: int) -> bool:
    """Whether the frame range is as Blender begins with it, and nothing else in the scene is animated after `last`."""
    if (scene.frame_start, scene.frame_end) != FACTORY_RANGE:
        return False
    others = [o.animation_data for o in scene.objects if o != scene.oncue.character and o.animation_data is not None]
    return all(data.action is None or data.action.frame_range[1] <= last for data in others) and not any(
        len(data.drivers) or len(data.nla_tracks) for data in others
    )


def _keep_previous(character: bpy.types.Object) -> None:
    data = character.animation_data
    if data and data.action:
        data.action.use_fake_user = True
