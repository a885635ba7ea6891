# SPDX-License-Identifier: GPL-3.0-or-later
"""A rig that Rigify has generated from its human: the motion goes on its controls, not on the bones that follow them.

Of the bones that Rigify makes, those called ORG- lie as the metarig's did: they are the body that is moved. Each
control that gets keys goes with one of them, and hangs on another: so its channels follow from where these two are,
without asking Blender frame by frame. Arms and legs turn by their FK controls, the trunk by its FK spine; what a
control hangs on by another one's constraint is set aside by the rig's own switches, which are keyed with the take.
Whether the rig follows is looked at once it is written (`off_by`).
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import bpy
import numpy as np

from .. import quaternions
from ..key_fit import Rest
from ..motion import Motion
from ..rig import Array, Hold, RestRig, Rig
from . import rigify_ik
from .rig_space import RigSpace
from .rigify_ik import ARMS, LEGS, Switch

BODY = "ORG-"
#: Bones that only rigs of Rigify's human have.
TELLING = (
    "torso",
    "spine_fk.002",
    "spine_fk.003",
    "thigh_parent.L",
    "upper_arm_parent.L",
    "ORG-spine",
    "ORG-spine.003",
)
#: The trunk bends where the FK spine does; what lies below goes with the hips.
SPINE = ("ORG-spine.002", "ORG-spine.003")


@dataclass(frozen=True)
class Control:
    """A control, the bone of the body that it goes with, and the one it hangs on; None for the rig's root."""

    name: str
    goes_with: str
    hangs_on: str | None


def _limbs(side: str) -> list[Control]:
    arm, leg = [f"ORG-{bone}.{side}" for bone in ("shoulder", "upper_arm", "forearm", "hand")], []
    leg = [f"ORG-{bone}.{side}" for bone in ("thigh", "shin", "foot", "toe")]
    return [
        Control(f"shoulder.{side}", arm[0], "ORG-spine.003"),
        Control(f"upper_arm_fk.{side}", arm[1], arm[0]),
        Control(f"forearm_fk.{side}", arm[2], arm[1]),
        Control(f"hand_fk.{side}", arm[3], arm[2]),
        Control(f"thigh_fk.{side}", leg[0], "ORG-spine"),
        Control(f"shin_fk.{side}", leg[1], leg[0]),
        Control(f"foot_fk.{side}", leg[2], leg[1]),
        Control(f"toe_fk.{side}", leg[3], leg[2]),
    ]


CONTROLS = [
    Control("torso", "ORG-spine", None),
    Control("spine_fk.002", "ORG-spine.002", "ORG-spine"),
    Control("spine_fk.003", "ORG-spine.003", "ORG-spine.002"),
    Control("neck", "ORG-spine.004", "ORG-spine.003"),
    Control("head", "ORG-spine.006", "ORG-spine.004"),
    *_limbs("L"),
    *_limbs("R"),
]
#: What neck and head are switched to: they go with what carries them.
OF_THE_HEAD = (("torso", "neck_follow", 1.0), ("torso", "head_follow", 1.0))
#: The bones that have the switches of limbs.
MASTERS = {ARMS: "upper_arm_parent", LEGS: "thigh_parent"}


def switches_of(character: bpy.types.Object, ik: tuple[str, ...]) -> list[Switch]:
    """What is keyed so that a rig follows the controls that are written: `ik` says which limbs by IK, the others are
    moved by FK."""
    wanted = [*OF_THE_HEAD]
    for limb, master in MASTERS.items():
        for side in "LR":
            wanted += [(f"{master}.{side}", "FK_limb_follow", 0.0)]
            wanted += [] if limb in ik else [(f"{master}.{side}", "IK_FK", 1.0)]
    bones = character.pose.bones
    there = [
        Switch(bones[bone], f'["{name}"]', value, bone)
        for bone, name, value in wanted
        if bone in bones and name in bones[bone]
    ]
    return [*there, *rigify_ik.switches_of(character, ik)]


#: Other controls that bend the body: what was done by them is no part of a motion.
BENDING = re.compile(
    r"^(hips|chest|spine_fk|spine_fk\.001|tweak_spine.*|(thigh|upper_arm)_(parent|ik)\.[LR]|.+_tweak\..+"
    r"|(foot|hand)_ik_(pivot|wrist)\.[LR]|hand_ik_wrist\.[LR]|foot_spin_ik\.[LR])$"
)


def bending_controls(character: bpy.types.Object) -> list[str]:
    """The controls of a Rigify rig that bend its body beside those that a motion is written on."""
    return [bone.name for bone in character.data.bones if BENDING.match(bone.name)]


def is_rigify(character: bpy.types.Object) -> bool:
    """Whether an armature is what Rigify makes of a human."""
    return all(name in character.data.bones for name in TELLING)


def body_bones(character: bpy.types.Object) -> list[bpy.types.Bone]:
    """The bones of the body that the controls move, parents before children."""
    bones = [bone for bone in character.data.bones if bone.name.startswith(BODY)]
    spine = sorted((bone for bone in bones if bone.name.startswith("ORG-spine")), key=lambda bone: bone.name)
    return [*spine, *(bone for bone in bones if bone not in spine)]


def parents_of(bones: list[bpy.types.Bone]) -> tuple[int, ...]:
    """The place of each bone's parent in the body: up the spine, which hangs on its controls, and as the rig has it
    elsewhere."""
    index = {bone.name: k for k, bone in enumerate(bones)}
    spine = [bone.name for bone in bones if bone.name.startswith("ORG-spine")]
    found = []
    for bone in bones:
        if bone.name in spine:
            found.append(spine.index(bone.name) - 1)
        else:
            found.append(next((index[up.name] for up in bone.parent_recursive if up.name in index), -1))
    return tuple(found)


def rest_of(character: bpy.types.Object) -> RestRig:
    """The body at rest."""
    bones = body_bones(character)
    return RestRig(
        tuple(bone.name for bone in bones),
        parents_of(bones),
        np.array([bone.matrix_local for bone in bones], dtype=np.float64),
        np.array([bone.tail_local for bone in bones], dtype=np.float64),
        (False,) * len(bones),
    )


class ControlSpace(RigSpace):
    """The same for a Rigify rig: keys lie on the controls that the bones of the body follow."""

    def __init__(
        self,
        character: bpy.types.Object,
        rig: Rig,
        metres_per_unit: float,
        matrix_world=None,
        holds: tuple[Hold, ...] = (),
        ik: tuple[str, ...] = (),
    ) -> None:
        """`ik`: the limbs that are moved by their IK controls, as of `rigify_ik.asked`. Raises SceneError where the rig
        has none."""
        super().__init__(character, rig, metres_per_unit, matrix_world, holds)
        bones, aside = character.data.bones, rigify_ik.fk_controls(ik)
        self._controls = [
            control
            for control in CONTROLS
            if control.name in bones and control.goes_with in bones and control.name not in aside
        ]
        up = np.linalg.inv(self._to_world)[:3, :3] @ np.array([0.0, 0.0, 1.0])
        self._limbs = rigify_ik.limbs_of(character, ik, rig.axes[:, 2], up / np.linalg.norm(up))
        self.groups = [group for limb in self._limbs for group in limb.groups]
        self.bones = [control.name for control in self._controls]
        shown = {bone: joint for joint, bone in rig.mapping["joints"].items()}
        order = rig.joint_names
        self.joints = [order.index(shown[c.goes_with]) if c.goes_with in shown else -1 for c in self._controls]
        self._rest = {name: np.array(bones[name].matrix_local, dtype=np.float64) for name in self._named()}

    def _named(self) -> set[str]:
        hung = {control.hangs_on for control in self._controls if control.hangs_on}
        return {*self.bones, *(control.goes_with for control in self._controls), *hung}

    def channels(self, motion: Motion) -> tuple[np.ndarray, np.ndarray]:
        """A motion as locations of the torso (frames, 3) and quaternions of the controls (frames, controls, 4)."""
        body = self.wanted(motion)
        basis = [self._basis(control, body) for control in self._controls]
        rotations = quaternions.continuous(np.stack([quaternions.from_matrix(one[:, :3, :3]) for one in basis], axis=1))
        return basis[0][:, :3, 3], rotations

    def _basis(self, control: Control, body: dict[str, Array]) -> Array:
        """What a control is turned and moved by at its place, (frames, 4, 4)."""
        rest = self._rest[control.name]
        wanted = body[control.goes_with] @ (np.linalg.inv(self._rest[control.goes_with]) @ rest)
        if control.hangs_on is None:
            return np.linalg.inv(rest) @ wanted
        before = body[control.hangs_on] @ (np.linalg.inv(self._rest[control.hangs_on]) @ rest)
        return np.linalg.inv(before) @ wanted

    def rest(self) -> Rest:
        """How the controls hang on each other: each on the one that goes with what it hangs on."""
        going = {control.goes_with: control.name for control in self._controls}
        over = [None if control.hangs_on is None else going[control.hangs_on] for control in self._controls]
        return self._hung(over)

    def beside(self, motion: Motion, way: Array | None = None) -> list[Array]:
        """As of a `Space`."""
        body = self.wanted(motion) if self._limbs else {}
        return [values for limb in self._limbs for values in limb.values(body, way)]

    def wanted(self, motion: Motion) -> dict[str, Array]:
        """Where the bones of the body are to be, armature space, (frames, 4, 4)."""
        return self._rig.matrices(motion, self._to_world, self._metres, self._holds)

    def motion(
        self,
        locations: np.ndarray,
        rotations: np.ndarray,
        frame_rate: float,
        beside: Sequence[Array] = (),
        way: Array | None = None,
    ) -> Motion:
        """The inverse of `channels` and `beside`, but for the proportions."""
        turns = quaternions.to_matrix(rotations)
        body: dict[str, Array] = {}
        for k, control in enumerate(self._controls):
            basis = np.tile(np.eye(4), (len(locations), 1, 1))
            basis[:, :3, :3] = turns[:, k]
            if k == 0:
                basis[:, :3, 3] = locations
            rest = self._rest[control.name]
            before = np.tile(rest, (len(locations), 1, 1))
            if control.hangs_on is not None:
                before = body[control.hangs_on] @ (np.linalg.inv(self._rest[control.hangs_on]) @ rest)
            posed = before @ basis
            body[control.goes_with] = posed @ (np.linalg.inv(rest) @ self._rest[control.goes_with])
        left = iter(beside)
        for limb in self._limbs:
            body |= limb.bones([next(left) for _ in limb.groups], body, way)
        return self._rig.motion_of_matrices(body, frame_rate, self._to_world, self._metres)


#: A knee or an elbow that IK bends may be off by so many times as much as what it lies between: where a limb is nearly
#: straight, little makes it bend by much.
OF_THE_MIDDLE = 5.0


def off_by(
    context: bpy.types.Context,
    character: bpy.types.Object,
    wanted: dict[str, Array],
    ik: tuple[str, ...],
    first_frame: int,
) -> tuple[float, str, int]:
    """How far the body is from where it is to be, at the worst of some frames: scene units, bone, frame. `ik`: the
    limbs that are moved by IK, whose middle counts less."""
    scene, worst = context.scene, (0.0, "", first_frame)
    bones = [control.goes_with for control in CONTROLS if control.goes_with in wanted]
    middle = rigify_ik.middles(ik)
    count = len(wanted[bones[0]])
    now = (scene.frame_current, scene.frame_subframe)
    scale = float(np.cbrt(abs(np.linalg.det(np.array(character.matrix_world, dtype=np.float64)[:3, :3]))))
    for k in np.unique(np.linspace(0, count - 1, 6).astype(int)):
        scene.frame_set(first_frame + int(k))
        posed = character.evaluated_get(context.evaluated_depsgraph_get())
        for bone in bones:
            away = np.array(posed.pose.bones[bone].head, dtype=np.float64) - wanted[bone][k, :3, 3]
            counts = scale / (OF_THE_MIDDLE if bone in middle else 1.0)
            worst = max(worst, (float(np.linalg.norm(away)) * counts, bone, first_frame + int(k)))
    scene.frame_set(now[0], subframe=now[1])
    return worst


@contextmanager
def switched(character: bpy.types.Object, ik: tuple[str, ...], frame: int) -> Iterator[None]:
    """Keys the rig's switches at a frame in the action that it plays; where the block fails they are as before."""
    switches = switches_of(character, ik)
    before = [(switch, switch.now) for switch in switches]
    try:
        for switch in switches:
            # A property of whole numbers stays one.
            switch.set(type(switch.now)(switch.value))
            switch.owner.keyframe_insert(switch.path, frame=frame, group=switch.group)
        yield
    except BaseException:
        for switch, value in before:
            switch.set(value)
        raise
