# SPDX-License-Identifier: GPL-3.0-or-later
"""Motion of the core → a new action of the character: location and rotation keys at the scene's frame rate."""

from __future__ import annotations

import json
from typing import Protocol

import bpy
import numpy as np
from mathutils import Euler, Quaternion

from .. import quaternions
from ..errors import SceneError
from ..motion import Motion, resample
from ..quaternions import CONJUGATE, multiply
from . import compat
from .armature import rest_rotations
from .bones import clear_channel, leftovers
from .names import REPORT_KEY

#: Value of 'LINEAR' in a keyframe's `interpolation`; every frame is keyed, so nothing lies between.
LINEAR = 1
#: First and last frame of a scene that nobody has set.
FACTORY_RANGE = (1, 250)
LOCATION, ROTATION = "location", "rotation_quaternion"


class Space(Protocol):
    """The way between the core's arrays and the channels of some armature's bones."""

    #: The bones that are keyed: the first one's location, and rotations of all.
    bones: list[str]
    #: The core's joint that each shows; −1 for a first one that only carries the others.
    joints: list[int]

    def channels(self, motion: Motion) -> tuple[np.ndarray, np.ndarray]: ...
    def motion(self, locations: np.ndarray, rotations: np.ndarray, frame_rate: float) -> Motion: ...


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
        rest = rest_rotations(character, names)
        #: The bones that are keyed, the root first, and the core's joint that each shows.
        self.bones, self.joints = list(names), list(range(len(names)))
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

    def motion(self, locations: np.ndarray, rotations: np.ndarray, frame_rate: float) -> Motion:
        """The inverse of `channels`."""
        positions = locations @ self._rest_root.T + self._root_head
        positions = (positions @ self._to_world[:3, :3].T + self._to_world[:3, 3]) * self._metres
        turned = multiply(multiply(self._into, rotations), self._into * CONJUGATE)
        turned[:, 0] = multiply(self._spin, turned[:, 0])
        return Motion(positions, turned, frame_rate)


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
    space: Space | None = None,
) -> bpy.types.Action:
    """Writes `motion` into a new action of `character` and has the scene's frame range end no earlier.

    `space` is the way to the bones of a rig other than Oncue's own skeleton, whose bones `names` are. Earlier actions
    stay in the file: each keeps a fake user. What they moved of these bones and this one does not goes back to rest.
    """
    space = space or BoneSpace(character, names, metres_per_unit)
    frames, channels = _sampled(context, character, space, motion, start_frame)
    _keep_previous(character)
    action = bpy.data.actions.new(name)
    action.use_fake_user = True
    curves = compat.CurveSet(action, character)
    for (bone, channel, axis), values in channels:
        _write_curve(curves.new(data_path(bone, channel), axis, bone), frames, values)
    if report is not None:
        action[REPORT_KEY] = json.dumps(report)
    compat.assign_action(character, action, curves)
    for bone, channel, _ in list(leftovers([character.pose.bones[bone] for bone in names])):
        clear_channel(bone, channel)
    _show_frames(context.scene, frames)
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
    space: Space | None = None,
) -> None:
    """Writes `motion` over the keys of an action that `write_action` has made for this character.

    Raises SceneError for another one.
    """
    space = space or BoneSpace(character, names, metres_per_unit)
    frames, channels = _sampled(context, character, space, motion, start_frame)
    curves = {(curve.data_path, curve.array_index): curve for curve in compat.action_curves(action, character)}
    there = [(curves.get((data_path(bone, channel), axis)), values) for (bone, channel, axis), values in channels]
    if any(curve is None for curve, _ in there):
        raise SceneError(f"{action.name} lacks channels of the character: synthesize the motion again.")
    for curve, values in there:
        if len(curve.keyframe_points) != len(frames):
            curve.keyframe_points.clear()
        _write_curve(curve, frames, values)
    _show_frames(context.scene, frames)


def _sampled(context, character, space: Space, motion: Motion, start_frame: int):
    """The frames of the scene that a motion takes, and ((bone, channel, axis), values) of each of its curves."""
    sampled = resample(motion, context.scene.render.fps / context.scene.render.fps_base)
    context.view_layer.update()
    names, (locations, rotations) = space.bones, space.channels(sampled)
    frames = start_frame + np.arange(len(locations), dtype=np.float32)
    channels = [((names[0], LOCATION, axis), locations[:, axis]) for axis in range(3)]
    for joint, bone in enumerate(names):
        channel, values = rotation_values(character.pose.bones[bone].rotation_mode, rotations[:, joint])
        channels += [((bone, channel, axis), values[:, axis]) for axis in range(values.shape[1])]
    return frames, channels


def rotation_values(rotation_mode: str, quaternions: np.ndarray) -> tuple[str, np.ndarray]:
    """The channel that turns a bone of this mode, and its values (frames, axes) for quaternions (frames, 4)."""
    if rotation_mode == "QUATERNION":
        return ROTATION, quaternions
    if rotation_mode == "AXIS_ANGLE":
        length = np.linalg.norm(quaternions[:, 1:], axis=1, keepdims=True)
        axes = np.where(length > 1e-9, quaternions[:, 1:] / np.maximum(length, 1e-9), (0.0, 1.0, 0.0))
        return "rotation_axis_angle", np.hstack([2.0 * np.arctan2(length, quaternions[:, :1]), axes])
    angles: list[Euler] = []
    for quaternion in quaternions:
        turn = Quaternion(quaternion)
        # Of the angles that turn alike those that are nearest to the frame before.
        angles.append(turn.to_euler(rotation_mode, angles[-1]) if angles else turn.to_euler(rotation_mode))
    return "rotation_euler", np.array(angles, dtype=np.float64).reshape(-1, 3)


def _show_frames(scene: bpy.types.Scene, frames: np.ndarray) -> None:
    """Has the scene end no earlier than the motion; an end that an earlier take made is moved back too, as far as the
    artist's own. Where the shot begins is the artist's alone."""
    if not len(frames):
        return
    settings, last = scene.oncue, int(frames[-1])
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


def data_path(bone: str, channel: str) -> str:
    return f'pose.bones["{bone}"].{channel}'


def _keep_previous(character: bpy.types.Object) -> None:
    data = character.animation_data
    if data and data.action:
        data.action.use_fake_user = True


def _write_curve(curve: bpy.types.FCurve, frames: np.ndarray, values: np.ndarray) -> None:
    """The keys of a curve, which has as many already or none."""
    points = curve.keyframe_points
    points.add(len(frames) - len(points))
    coordinates = np.empty((len(frames), 2), dtype=np.float32)
    coordinates[:, 0], coordinates[:, 1] = frames, values
    points.foreach_set("co", coordinates.ravel())
    points.foreach_set("interpolation", np.full(len(frames), LINEAR, dtype=np.int32))
    curve.update()
