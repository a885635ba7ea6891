# SPDX-License-Identifier: GPL-3.0-or-later
"""What an action keeps of its motion: what the core gave for it, and which keys were written of that."""

from __future__ import annotations

import base64
import io
import zipfile
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, replace

import bpy
import numpy as np

from ..errors import SceneError
from ..motion import Motion, resample
from . import compat
from .action_writer import BoneSpace, Space
from .channels import LOCATION, ROTATION, data_path
from .control_groups import Group
from .curves import played, read_places
from .names import SOLVED_KEY
from .rigify_ik import ARMS, LEGS
from .scene_time import frame_rate

#: More is no motion, bytes: an hour of one takes 200 million.
LARGEST_TAKE = 500_000_000
#: The form of what is kept: the first, which says no number, has a key on every frame, the second few keys, the third
#: a body that something carries along its way, and the fourth limbs that are moved by IK controls.
FEW, CARRIED, FORM = 2, 3, 4
#: Numbers of a written key: of itself and of its two handles frame and value, and whether it is the artist's own.
OF_A_KEY = 7

#: An F-curve by its data path and axis.
Curves = dict[tuple[str, int], bpy.types.FCurve]


@dataclass(frozen=True)
class Solved:
    """What the core gave last for an action, and what was written of it."""

    #: World, metres of the core's; 30 frames in a second of the body's.
    motion: Motion
    #: Left and right foot, (frames, 2).
    contacts: np.ndarray
    start_frame: int
    #: Frames a second of the keys.
    scene_rate: float
    metres_per_unit: float
    #: The armature object's world matrix then, (4, 4).
    matrix_world: np.ndarray
    #: What played then: (scene frames, columns).
    keys: np.ndarray
    #: The keys of each of these columns then, (keys, OF_A_KEY); None where every frame was keyed.
    written: list[np.ndarray] | None = None
    #: What carries the body, "BONE name", "OBJECT" or "PLACE", and where that takes it on each of the scene's frames,
    #: armature space, (scene frames, 4, 4); None where its first bone goes all the way itself.
    root: str = ""
    way: np.ndarray | None = None
    #: The limbs of a Rigify rig that are moved by their IK controls.
    ik: tuple[str, ...] = ()


@dataclass(frozen=True)
class Columns:
    """What each column of a take's keys is: the location of the first of its bones, the rotations of all, and after
    these what groups of controls beside them play."""

    bones: list[str]
    groups: list[Group]

    @property
    def names(self) -> list[str]:
        """By which name each bone and each group is known: its joints, of which some functions speak."""
        return [*self.bones, *(group.name for group in self.groups)]

    @property
    def width(self) -> int:
        return 3 + 4 * len(self.bones) + sum(len(group.columns) for group in self.groups)

    def channels(self) -> Iterator[tuple[str, str, int]]:
        """(bone, channel, axis) of each column."""
        yield from ((self.bones[0], LOCATION, axis) for axis in range(3))
        yield from ((bone, ROTATION, axis) for bone in self.bones for axis in range(4))
        for group in self.groups:
            yield from group.columns

    def of(self, joint: int) -> list[int]:
        """The columns of a joint; the root's has its location too."""
        if joint < len(self.bones):
            own = list(range(3 + 4 * joint, 7 + 4 * joint))
            return [0, 1, 2, *own] if joint == 0 else own
        before = self.groups[: joint - len(self.bones)]
        first = 3 + 4 * len(self.bones) + sum(len(group.columns) for group in before)
        return list(range(first, first + len(self.groups[len(before)].columns)))

    def turns(self) -> list[tuple[str, int]]:
        """Each bone that turns by quaternions, and the first of its four columns."""
        return [
            (bone, k) for k, (bone, channel, axis) in enumerate(self.channels()) if (channel, axis) == (ROTATION, 0)
        ]

    def curves(self, curves: Curves) -> list[bpy.types.FCurve | None]:
        """The curve of each column."""
        return [curves.get((data_path(bone, channel), axis)) for bone, channel, axis in self.channels()]

    def split(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray, list[np.ndarray]]:
        """Rows (frames, columns) as locations (frames, 3), rotations (frames, bones, 4), and what each group plays."""
        end = 3 + 4 * len(self.bones)
        beside = [rows[:, self.of(len(self.bones) + k)] for k in range(len(self.groups))]
        return rows[:, :3], rows[:, 3:end].reshape(len(rows), -1, 4), beside


def columns_of(space: Space) -> Columns:
    return Columns(space.bones, space.groups)


def rows_of(space: Space, motion: Motion) -> np.ndarray:
    """What plays a motion, (frames, columns), as `Solved.keys` has it."""
    locations, rotations = space.channels(motion)
    return np.hstack([locations, rotations.reshape(len(rotations), -1), *space.beside(motion)])


def curves_of(action: bpy.types.Action, character: bpy.types.Object) -> Curves:
    return {(curve.data_path, curve.array_index): curve for curve in compat.action_curves(action, character)}


def solved_take(
    scene: bpy.types.Scene,
    character: bpy.types.Object,
    names: list[str],
    motion: Motion,
    contacts: np.ndarray,
    *,
    start_frame: int,
    metres_per_unit: float,
    few: bpy.types.Action | None = None,
    space: Space | None = None,
    matrix_world: np.ndarray | None = None,
) -> Solved:
    """What `write_action` has just written for a motion of the core: on every frame, or few keys into an action, of a
    character that stands where `matrix_world` says, or else as it does."""
    rate = frame_rate(scene)
    space = space or BoneSpace(character, names, metres_per_unit)
    keys = rows_of(space, resample(motion, rate))
    world = np.array(character.matrix_world) if matrix_world is None else matrix_world
    solved = Solved(motion, contacts, start_frame, rate, metres_per_unit, world, keys)
    return solved if few is None else with_written(solved, curves_of(few, character), columns_of(space), {})


def with_written(solved: Solved, curves: Curves, columns: Columns, own: dict[int, set[tuple[float, float]]]) -> Solved:
    """The same with the few keys that stand in the curves now; `own`: the artist's, by column frame and value."""
    times = solved.start_frame + np.arange(len(solved.keys), dtype=np.float64)
    keys, written = solved.keys.astype(np.float32), []
    for column, curve in enumerate(columns.curves(curves)):
        places = read_places(curve)
        if curve is not None:
            keys[:, column] = played(curve, times)
        mine = [(float(row[0]), float(row[1])) in own.get(column, ()) for row in places]
        written.append(np.column_stack([places, np.array(mine, dtype=np.float32)]).reshape(-1, OF_A_KEY))
    return replace(solved, keys=keys, written=written)


def keep_solved(action: bpy.types.Action, solved: Solved) -> None:
    """Keeps it on the action, packed; motion and keys in single precision, as the core and Blender have them."""
    arrays = {
        "root_positions": solved.motion.root_positions.astype(np.float32),
        "rotations": solved.motion.rotations.astype(np.float32),
        "contacts": solved.contacts.astype(np.float32),
        "scale": np.array([solved.motion.frame_rate, solved.start_frame, solved.scene_rate, solved.metres_per_unit]),
        "matrix_world": solved.matrix_world,
        "keys": solved.keys.astype(np.float32),
    }
    # Takes of the first form have none of these: every frame of theirs is keyed.
    if solved.way is not None:
        arrays["form"] = np.array(CARRIED)
        arrays["root"], arrays["way"] = np.array(solved.root), solved.way
    elif solved.written is not None:
        arrays["form"] = np.array(FEW)
    if solved.ik:
        arrays["form"], arrays["ik"] = np.array(FORM), np.array(" ".join(solved.ik))
    if solved.written is not None:
        arrays["counts"] = np.array([len(column) for column in solved.written], dtype=np.int64)
        arrays["written"] = np.concatenate(solved.written).astype(np.float32)
    packed = io.BytesIO()
    np.savez_compressed(packed, **arrays)
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
            form = int(kept["form"]) if "form" in kept else 1
            if form > FORM:
                raise SceneError(
                    f"{action.name} is a take of a newer Oncue, which this one cannot read: update it, or synthesize "
                    "again."
                )
            few = form == FEW or (form >= CARRIED and "counts" in kept)
            written = _columns(kept["counts"], kept["written"]) if few else None
            carried = form == CARRIED or (form == FORM and "way" in kept)
            root, way = (str(kept["root"]), kept["way"]) if carried else ("", None)
            ik = tuple(str(kept["ik"]).split()) if form == FORM else ()
        solved = Solved(
            motion,
            contacts,
            int(start_frame),
            scene_rate,
            metres_per_unit,
            matrix_world,
            keys,
            written,
            root,
            way,
            ik,
        )
        _check_shapes(solved)
        return solved
    except (OSError, ValueError, TypeError, KeyError, EOFError, OverflowError, zipfile.BadZipFile, zlib.error) as error:
        raise SceneError(f"What {action.name} keeps of its motion is damaged: synthesize it again.") from error


def _columns(counts: np.ndarray, written: np.ndarray) -> list[np.ndarray]:
    """The written keys column by column. Raises ValueError where their numbers do not fit."""
    whole = counts.ndim == 1 and counts.dtype.kind in "iu" and (counts >= 0).all()
    if not whole or written.ndim != 2 or written.shape != (counts.sum(), OF_A_KEY) or written.dtype.kind != "f":
        raise ValueError("its keys are not as many as it says")
    return np.split(written, np.cumsum(counts)[:-1])


def _check_shapes(solved: Solved) -> None:
    """Raises ValueError where the arrays of a take are not those of one motion."""
    frames, joints = solved.motion.rotations.shape[:2]
    shapes = [solved.motion.root_positions.shape, solved.motion.rotations.shape, solved.contacts.shape]
    arrays = [solved.motion.root_positions, solved.motion.rotations, solved.contacts, solved.keys, solved.matrix_world]
    arrays += solved.written or []
    arrays += [] if solved.way is None else [solved.way]
    rates = (solved.motion.frame_rate, solved.scene_rate, solved.metres_per_unit)
    if (
        shapes != [(frames, 3), (frames, joints, 4), (frames, 2)]
        or solved.keys.ndim != 2
        or (not solved.ik and solved.keys.shape[1] % 4 != 3)
        or not set(solved.ik) <= {ARMS, LEGS}
        or solved.matrix_world.shape != (4, 4)
        or (solved.way is not None and solved.way.shape != (len(solved.keys), 4, 4))
        or (solved.written is not None and len(solved.written) != solved.keys.shape[1])
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
