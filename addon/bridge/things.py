# SPDX-License-Identifier: GPL-3.0-or-later
"""Things that are taken, carried and put down: read for a run, and keyed along with the take that moves them."""

from __future__ import annotations

import bpy
import numpy as np
from mathutils import Matrix, Quaternion, Vector

from .. import quaternions
from ..errors import SceneError
from ..motion import Motion, resample
from . import compat
from .channels import rotation_values
from .curves import every_frame, write_keys
from .names import CARRIED_IN_KEY, GIVEN_YAW_KEY, HAND_KEY, REST_KEY, THING_KEY
from .scene_time import frame_rate, may_move

#: What a hand cue of a thing may say of hands.
WHICH_HANDS = ("left", "right", "both")
#: A Put cue within this of the yaw that it was given was not turned, radians.
UNTURNED = 1e-3


def thing_of(cue: bpy.types.Object) -> bpy.types.Object:
    """What a Take or Put cue is about. Raises SceneError where that is gone."""
    thing = cue.get(THING_KEY)
    if not isinstance(thing, bpy.types.Object) or bpy.context.scene.objects.get(thing.name) != thing:
        raise SceneError(f"{cue.name} is about a thing that is not there any more: delete it, or place it again.")
    return thing


def check_thing(cue: bpy.types.Object, thing: bpy.types.Object) -> None:
    """Raises SceneError for a thing that cannot be keyed: linked, or moved by something else."""
    if not thing.is_editable:
        raise SceneError(f"{cue.name} takes {thing.name}, which is linked and cannot get keys: make it local.")
    data = thing.animation_data
    own = data is not None and data.action is not None and CARRIED_IN_KEY in data.action
    if any(thing.delta_location) or any(thing.delta_rotation_euler):
        raise SceneError(f"{cue.name} takes {thing.name}, which has delta transforms: apply them to its own first.")
    live = [constraint for constraint in thing.constraints if not constraint.mute and constraint.influence > 0.0]
    if live or may_move(thing, own_action=not own):
        raise SceneError(
            f"{cue.name} takes {thing.name}, which moves by itself: take its keys, drivers and constraints off first."
        )


def read_thing(cue: bpy.types.Object, thing: bpy.types.Object, depsgraph, metres_per_unit: float) -> dict:
    """A thing as the core takes it: where it stands, and its box in its own frame, metres."""
    check_thing(cue, thing)
    place, turn = _placement(thing, depsgraph)
    into = (Matrix.Translation(place) @ turn.to_matrix().to_4x4()).inverted()
    meshes = [one for one in [thing, *thing.children_recursive] if one.type in {"MESH", "CURVE", "SURFACE", "FONT"}]
    corners = []
    for mesh in meshes:
        seen = mesh.evaluated_get(depsgraph) if depsgraph is not None else mesh
        corners += [into @ (seen.matrix_world @ Vector(corner)) for corner in seen.bound_box]
    if not corners:
        raise SceneError(f"{cue.name} takes {thing.name}, which has no mesh to take hold of: choose one that has.")
    box = np.array(corners, dtype=np.float64) * metres_per_unit
    return {
        "name": thing.name,
        "position": [c * metres_per_unit for c in place],
        "rotation": list(turn),
        "low": box.min(axis=0).tolist(),
        "high": box.max(axis=0).tolist(),
    }


def read_take(cue: bpy.types.Object, thing: bpy.types.Object, depsgraph, metres_per_unit: float) -> dict:
    """A Take cue as the core takes it: where it stands in the thing's frame is where that is gripped."""
    hand = cue.get(HAND_KEY)
    if hand not in WHICH_HANDS:
        raise SceneError(f"{cue.name} does not say which hand takes {thing.name}: place it again.")
    place, turn = _placement(thing, depsgraph)
    at = (cue.evaluated_get(depsgraph) if depsgraph is not None else cue).matrix_world.translation
    grip = turn.inverted() @ (at - place)
    return {
        "does": "take",
        "name": cue.name,
        "thing": thing.name,
        "hand": hand,
        "grip": [c * metres_per_unit for c in grip],
    }


def read_put(cue: bpy.types.Object, thing: bpy.types.Object, placement: dict) -> dict:
    """A Put cue as the core takes it; one that nobody has turned puts the thing down as it comes."""
    given, yaw = cue.get(GIVEN_YAW_KEY), placement["yaw"]
    as_it_comes = isinstance(given, float) and abs(np.remainder(yaw - given + np.pi, 2 * np.pi) - np.pi) < UNTURNED
    asked = {} if as_it_comes else {"yaw": yaw}
    return {"does": "put", "name": cue.name, "thing": thing.name, "position": placement["position"], **asked}


def _placement(thing: bpy.types.Object, depsgraph) -> tuple[Vector, Quaternion]:
    place, turn, _ = (thing.evaluated_get(depsgraph) if depsgraph is not None else thing).matrix_world.decompose()
    return place, turn


# --- keys -------------------------------------------------------------------------------------------------------------


def write_things(
    context: bpy.types.Context,
    take: bpy.types.Action,
    carried: list[dict],
    frames: int,
    rate: float,
    begins: int,
    metres_per_unit: float,
) -> None:
    """Keys on the things that a take's person carries, each in an action of its own that belongs to the take.

    `carried`: the core's, in the measure of its body, of a motion of so many `frames` at `rate` that begins on the
    scene's frame `begins`.
    """
    for name in dict.fromkeys(one["name"] for one in carried):
        thing = context.scene.objects[name]
        release(thing)
        context.view_layer.update()
        rest, basis = thing.matrix_world.copy(), thing.matrix_basis.copy()
        positions, rotations, span = _whole([one for one in carried if one["name"] == name], frames)
        sampled = resample(Motion(positions / metres_per_unit, rotations[:, None], rate), frame_rate(context.scene))
        scale = len(sampled) / max(frames, 1)
        first, last = int(np.floor(span[0] * scale)), min(int(np.ceil(span[1] * scale)), len(sampled) - 1)
        # Before it is taken it stands as it stood: one key at the motion's begin, and each frame from then on.
        kept = np.unique(np.r_[0, np.arange(first, last + 1)])
        locations, turns = _channels(thing, rest, sampled, kept)
        action = bpy.data.actions.new(f"{thing.name} in {take.name}")
        action.use_fake_user = True
        action[THING_KEY], action[CARRIED_IN_KEY], action[REST_KEY] = thing, take, [c for row in basis for c in row]
        curves = compat.CurveSet(action, thing)
        channel, values = rotation_values(thing.rotation_mode, turns)
        for path, columns in (("location", locations), (channel, values)):
            for axis in range(columns.shape[1]):
                write_keys(
                    curves.new(path, axis, thing.name), every_frame(begins + kept.astype(float), columns[:, axis])
                )
        compat.assign_action(thing, action, curves)


def _whole(tracks: list[dict], frames: int) -> tuple[np.ndarray, np.ndarray, tuple[int, int]]:
    """Where a thing that is taken once or several times is on each frame of the motion, and between which it moves."""
    tracks = sorted(tracks, key=lambda track: track["first_frame"])
    positions = np.tile(np.asarray(tracks[0]["positions"][0], dtype=np.float64), (frames, 1))
    rotations = np.tile(np.asarray(tracks[0]["rotations"][0], dtype=np.float64), (frames, 1))
    for track in tracks:
        first = track["first_frame"]
        end = min(first + len(track["positions"]), frames)
        positions[first:end], rotations[first:end] = (
            track["positions"][: end - first],
            track["rotations"][: end - first],
        )
        positions[end:], rotations[end:] = positions[end - 1], rotations[end - 1]
    rotations = quaternions.continuous(rotations[:, None])[:, 0]
    return positions, rotations, (tracks[0]["first_frame"], end)


def _channels(
    thing: bpy.types.Object, rest: Matrix, sampled: Motion, kept: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The object's own location and rotation (quaternions) that have it stand so in the world on these frames."""

    def stands(frame: int) -> Matrix:
        turn = Quaternion(sampled.rotations[frame, 0]).to_matrix().to_4x4()
        return Matrix.Translation(sampled.root_positions[frame]) @ turn

    first = stands(0).inverted()
    # What parents and deltas make of its own channels stays as it is: it does not move by itself.
    hangs = rest @ thing.matrix_basis.inverted()
    locations, turns = [], []
    for frame in kept.tolist():
        location, turn, _ = (hangs.inverted() @ stands(frame) @ first @ rest).decompose()
        locations.append(location[:])
        turns.append(turn[:])
    turned = quaternions.continuous(np.array(turns, dtype=np.float64)[:, None])[:, 0]
    return np.array(locations, dtype=np.float64), turned


def carried_in(take: bpy.types.Action) -> list[bpy.types.Action]:
    """The actions of the things that are carried in a take."""
    return [action for action in bpy.data.actions if action.get(CARRIED_IN_KEY) == take]


def release(thing: bpy.types.Object) -> None:
    """Has a thing stand as it stood before it was taken, playing no take's keys."""
    data = thing.animation_data
    action = data.action if data else None
    if action is None or CARRIED_IN_KEY not in action:
        return
    data.action = None
    rest = action.get(REST_KEY)
    if rest is not None and len(rest) == 16:
        thing.matrix_basis = Matrix([rest[4 * row : 4 * row + 4] for row in range(4)])


def play_things(take: bpy.types.Action | None, before: bpy.types.Action | None) -> None:
    """Has the things of a take be carried, and those of the take that was played before stand as they stood."""
    for action in carried_in(before) if before is not None else []:
        release_all(action)
    for action in carried_in(take) if take is not None else []:
        thing = action.get(THING_KEY)
        if isinstance(thing, bpy.types.Object) and thing.is_editable:
            release(thing)
            data = thing.animation_data or thing.animation_data_create()
            data.action = action
            compat.play_slot(thing)


def release_all(action: bpy.types.Action) -> None:
    """The same of every thing that plays these keys."""
    for thing in bpy.data.objects:
        if thing.animation_data is not None and thing.animation_data.action == action:
            release(thing)


def discard_things(take: bpy.types.Action) -> None:
    """Takes the keys of a take's things out of the file; they stand as they stood before."""
    for action in carried_in(take):
        release_all(action)
        bpy.data.actions.remove(action)


def copy_things(take: bpy.types.Action, copy: bpy.types.Action) -> None:
    """Gives a copy of a take copies of its things' keys."""
    for action in carried_in(take):
        own = action.copy()
        own.use_fake_user = True
        own[CARRIED_IN_KEY] = copy
