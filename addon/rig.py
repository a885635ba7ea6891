# SPDX-License-Identifier: GPL-3.0-or-later
"""The core's motion on a rig of another build: any humanoid's bones, lengths, rest pose and axes.

The core moves one body. A rig of another size gets the motion of that body in a scene measured by the rig's own legs
(`Rig.unit`), so that what it walks round, sits on and reaches is met at its own size. What is left are proportions,
and they are settled here: bones turn as the joints they stand for, twist included; the hips go where the legs are as
straight as the body's; the balls of the feet stand where the body's stand, and nothing of a sole is lower; hands that
hold something or lie on the thighs are where the body's are.

Rest poses differ, so nothing is copied bone by bone. Each joint of the core has at rest a frame: a limb's bone and
hinge, a foot's heading on the floor, the trunk's left and up. `_aligned` turns the rig's rest into that, and what a
joint turns by from there, its bone turns by.

All of it is in the armature's space and units; `unit` says how many of these the core's metre takes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from . import quaternions
from .errors import SceneError
from .motion import Motion
from .native import core

Array = NDArray[np.float64]

#: Heights of persons that motion is made for, as the core's body is tall, which is 1.8 m: a child of two, and a giant.
SMALLEST, LARGEST = 0.45, 1.6
#: How far the direction up may be off an axis of the armature to be meant as that axis.
NEARLY = np.cos(np.radians(25.0))
#: Of feet of which bones alone are known, as the core's are: heel and tip of the toes from the ankle, shares of the
#: leg's length down to it; and the ball of a foot without toes, the core's metres.
HEEL, TIP, BALL_AHEAD = 0.06 / 0.888, 0.20 / 0.888, 0.13
#: Legs reach no further than this share of their length: a knee is never quite straight.
LONGEST_REACH = 0.9995
#: The hips sink for a foot that is out of reach over this time before and after, seconds.
SINK_S = 0.15
#: Palms nearer to a thigh than the first lie on it, farther than the second do not, the core's metres; of thighs that
#: are lifted from hanging by these angles.
ON_THIGH, OFF_THIGH = 0.13, 0.24
HANGING, SEATED = np.radians(35.0), np.radians(60.0)
#: A hand comes to what it holds, and leaves it, in this time, seconds.
EASE_S = 0.3
#: Pelvis and lower spine lean by no more than this for the shoulders to be where the body's are.
MOST_LEAN = np.radians(20.0)
STILL = np.array([1.0, 0.0, 0.0, 0.0])
#: The core's joints between hips and chest, and where they lie along the spine.
SPINE = ("Spine", "Spine1", "Spine2")
#: Where legs and arms begin.
LIMBS = ("LeftUpLeg", "RightUpLeg", "LeftArm", "RightArm")
SIDES = ("Left", "Right")
#: A hand ("left", "right", "both") that holds something, from which to which second.
Hold = tuple[str, float, float]


@dataclass(frozen=True)
class RestRig:
    """The bones of an armature at rest, parents before children, armature space."""

    names: tuple[str, ...]
    #: Place of each bone's parent, −1 for none.
    parents: tuple[int, ...]
    #: Rest matrices, (bones, 4, 4), without scale.
    matrices: Array
    #: Where the bones end, (bones, 3).
    tails: Array
    #: Whether a bone begins at its parent's end for good, and can only turn.
    connected: tuple[bool, ...]


@dataclass(frozen=True)
class Sole:
    """What of a foot's mesh is lowest, furthest back and furthest forward at rest, along the armature's axes of the
    body (left, back, up): armature units."""

    low: float
    back: float
    front: float
    #: How far forward what does not go with the toes reaches, as a hard shoe does.
    stiff: float


class Rig:
    """A rig at rest beside the core's body at rest, and the way between their motions."""

    def __init__(
        self,
        name: str,
        rest: RestRig,
        mapping: core.RigMapping,
        skeleton: core.Skeleton,
        soles: dict[str, Sole] | None = None,
    ) -> None:
        """Raises SceneError that begins with the armature's `name`, where its bones at rest are nobody's."""
        self.name, self.rest, self.mapping = name, rest, mapping
        self._index = {name: k for k, name in enumerate(rest.names)}
        self._joints = {name: k for k, name in enumerate(skeleton["names"])}
        self._parents = list(skeleton["parents"])
        self._offsets = np.asarray(skeleton["joint_offsets"], dtype=np.float64)
        self._bone = {joint: self._index[bone] for joint, bone in mapping["joints"].items() if joint not in SPINE}
        self._spine = [self._index[name] for name in mapping["spine"]]
        self._bone["Hips"] = self._carries_all(self._bone["Hips"])
        #: Columns: left, back and up of the body in armature space.
        self.axes = self._axes()
        self._heads = rest.matrices[:, :3, 3]
        self._hip = self._middle("LeftUpLeg", "RightUpLeg")
        self._soles = {side: self._sole_of(side, (soles or {}).get(side)) for side in SIDES}
        #: How high the soles are at rest along the body's up, armature units.
        self.floor = float(np.mean([sole.low for sole in self._soles.values()]))
        #: Armature units that the core's metre takes: legs of the same length.
        self.unit = float((self._hip @ self.axes[:, 2] - self.floor) / self._core_hip_height(skeleton))
        if not self.unit > 0.0:
            raise SceneError(f"{name} has its hips under its feet at rest: it must stand in its rest position.")
        self._skeleton = skeleton
        self._carrier = self._find_carrier()
        self._turned = self._aligned()
        self.bones, self.joints = self._keyed()
        self._chain = self._chain_of(self.bones)
        self._feet = {side: self._foot(side) for side in SIDES}

    @property
    def joint_names(self) -> list[str]:
        """The core's joints, in their order."""
        return list(self._joints)

    def is_at_feet(self, place: Array) -> bool:
        """Whether a place at rest, armature space, is nearer to the soles' height than to the hips'."""
        height = float(place @ self.axes[:, 2]) - self.floor
        return height < 0.5 * (float(self._hip @ self.axes[:, 2]) - self.floor)

    # --- the rig at rest ----------------------------------------------------------------------------------------------

    def _carries_all(self, hips: int) -> int:
        """The bone from which legs and arms hang: the hips', or the nearest over it where the trunk begins there."""
        limbs = [self._bone[joint] for joint in LIMBS if joint in self._bone]
        while hips >= 0 and not all(self._is_over(hips, limb) for limb in limbs):
            hips = self.rest.parents[hips]
        if hips < 0:
            raise SceneError(f"{self.name} has no bone that carries both its legs and its arms.")
        return hips

    def _is_over(self, bone: int, below: int) -> bool:
        while below >= 0 and below != bone:
            below = self.rest.parents[below]
        return below == bone

    def head(self, joint: str) -> Array | None:
        """Where the bone of a joint begins at rest, armature space; None where the rig has none."""
        bone = self._bone.get(joint)
        return None if bone is None else self.rest.matrices[bone, :3, 3]

    def _need(self, joint: str) -> Array:
        head = self.head(joint)
        if head is None:
            raise SceneError(f"{self.name} has no bone for {joint}: name one in Oncue's settings, at its bones.")
        return head

    def _middle(self, left: str, right: str) -> Array:
        return (self._need(left) + self._need(right)) / 2.0

    def _axes(self) -> Array:
        """Left, back and up of the body at rest. Up is an axis of the armature where it nearly is one."""
        left = self._need("LeftUpLeg") - self._need("RightUpLeg")
        shoulders = (self._need("LeftArm") + self._need("RightArm")) / 2.0
        up = shoulders - (self._need("LeftFoot") + self._need("RightFoot")) / 2.0
        if not (np.linalg.norm(left) > 0.0 and np.linalg.norm(up) > 0.0):
            raise SceneError(f"{self.name} has its hips, feet and shoulders in one place at rest.")
        up = up / np.linalg.norm(up)
        nearest = int(np.argmax(np.abs(up)))
        if abs(up[nearest]) > NEARLY:
            up = np.eye(3)[nearest] * np.sign(up[nearest])
        left = left - up * (left @ up)
        length = np.linalg.norm(left)
        if not length > 0.0:
            raise SceneError(f"{self.name} has its hips one over the other at rest.")
        left = left / length
        nearest = int(np.argmax(np.abs(left)))
        if abs(left[nearest]) > NEARLY:
            snapped = np.eye(3)[nearest] * np.sign(left[nearest])
            if abs(snapped @ up) < 0.5:
                left = snapped
        return np.stack([left, np.cross(up, left), up], axis=1)

    def _core_hip_height(self, skeleton: core.Skeleton) -> float:
        return float(skeleton["rest_hips_height"] + self._offsets[self._joints["LeftUpLeg"], 2])

    def _sole_of(self, side: str, seen: Sole | None) -> Sole:
        """The sole of a foot: of its mesh, or by what bones alone tell."""
        if seen is not None:
            return seen
        ankle = self._need(f"{side}Foot") @ self.axes
        toe = self.head(f"{side}Toe")
        ahead = self.rest.tails[self._bone[f"{side}Foot"]] if toe is None else toe
        leg = float((self._hip @ self.axes)[2] - ankle[2])
        lowest = min(float(ankle[2]), float(ahead @ self.axes[:, 2]))
        # A rig stands at its origin as a rule; one that does not has its toes a little over the floor.
        floor = 0.0 if -0.01 * leg < lowest < 0.14 * leg else lowest - 0.026 * leg
        return Sole(floor, float(ankle[1]) + HEEL * leg, float(ankle[1]) - TIP * leg, float(ankle[1]))

    def _find_carrier(self) -> int:
        """The bone that carries the body about: the hips', or the first over it that is not fixed to its parent."""
        bone = self._bone["Hips"]
        while self.rest.connected[bone] and self.rest.parents[bone] >= 0:
            bone = self.rest.parents[bone]
        return bone

    def _keyed(self) -> tuple[list[str], list[int]]:
        """The bones that get keys, the carrier first and parents before children, and the core's joint that each
        shows; −1 for a carrier that only carries."""
        shown = {bone: self._joints[joint] for joint, bone in self._bone.items()}
        for k, bone in enumerate(self._spine):
            share = (k + 1) / len(self._spine)
            shown.setdefault(bone, self._joints[SPINE[max(round(3.0 * share), 1) - 1]])
        order = sorted(shown)
        if self._carrier in order:
            order.remove(self._carrier)
        keyed = [self._carrier, *order]
        return [self.rest.names[k] for k in keyed], [shown.get(k, -1) for k in keyed]

    def _chain_of(self, bones: list[str]) -> list[int]:
        """All bones whose pose decides where `bones` are, parents before children."""
        found: set[int] = set()
        for name in bones:
            bone = self._index[name]
            while bone >= 0 and bone not in found:
                found.add(bone)
                bone = self.rest.parents[bone]
        return sorted(found)

    # --- the rest poses beside each other -----------------------------------------------------------------------------

    def _aligned(self) -> dict[int, Array]:
        """Of each bone that shows a joint: its rotation in the frame of its joint, which is the core's world where the
        core's body is at rest. A bone's rotation is then its joint's times this."""
        own = self.axes.T @ self.rest.matrices[:, :3, :3]
        turned = {bone: own[bone] for bone in [*self._bone.values(), *self._spine]}
        for side, out in zip(SIDES, (1.0, -1.0), strict=True):
            arm = [self.head(f"{side}{part}") for part in ("Arm", "ForeArm", "Hand")]
            leg = [self.head(f"{side}{part}") for part in ("UpLeg", "Leg", "Foot")]
            if arm[2] is None:
                arm[2] = self.rest.tails[self._bone[f"{side}ForeArm"]]
            arms = self._straight(arm, np.array([out, 0.0, 0.0]), np.array([0.0, 0.0, -out]), f"{side} arm")
            legs = self._straight(leg, np.array([0.0, 0.0, -1.0]), np.array([1.0, 0.0, 0.0]), f"{side} leg")
            for joint, turn in (("Arm", arms[0]), ("ForeArm", arms[1]), ("Hand", arms[1])):
                bone = self._bone.get(f"{side}{joint}")
                if bone is not None:
                    turned[bone] = turn @ own[bone]
            for joint, turn in (("UpLeg", legs[0]), ("Leg", legs[1])):
                turned[self._bone[f"{side}{joint}"]] = turn @ own[self._bone[f"{side}{joint}"]]
            heading = self._heading(side)
            for joint in ("Foot", "Toe"):
                bone = self._bone.get(f"{side}{joint}")
                if bone is not None:
                    turned[bone] = heading @ own[bone]
        return turned

    def _straight(self, heads: list[Array | None], along: Array, hinge: Array, limb: str) -> tuple[Array, Array]:
        """What turns the two bones of a limb from the rig's rest into the core's, in the body's axes: their directions
        exactly; and the hinge, which a limb that is bent at rest shows, and a straight one has where the core's is
        after the shortest turn."""
        a, b, c = ((self.axes.T @ head) if head is not None else np.zeros(3) for head in heads)
        upper, lower = b - a, c - b
        if not (np.linalg.norm(upper) > 0.0 and np.linalg.norm(lower) > 0.0):
            raise SceneError(f"{self.name} has a bone without length in its {limb.lower()}.")
        upper, lower = upper / np.linalg.norm(upper), lower / np.linalg.norm(lower)
        turns = [_swing(upper, along), _swing(lower, along)]
        bend = np.cross(upper, lower)
        # By 5° or less nobody bends a limb to show its hinge; backwards it shows none.
        if np.linalg.norm(bend) > np.sin(np.radians(5.0)):
            bend = bend / np.linalg.norm(bend)
            for k, turn in enumerate(turns):
                seen = turn @ bend
                angle = float(np.arctan2(along @ np.cross(seen, hinge), seen @ hinge))
                if abs(angle) < np.radians(100.0):
                    turns[k] = _about(along, angle) @ turn
        return turns[0], turns[1]

    def _heading(self, side: str) -> Array:
        """What turns a foot at rest so that it points straight forward, flat as it was."""
        bone = self._bone[f"{side}Foot"]
        toe = self.head(f"{side}Toe")
        way = ((self.rest.tails[bone] if toe is None else toe) - self._need(f"{side}Foot")) @ self.axes
        if np.hypot(way[0], way[1]) < 1e-6 * self._hip_scale():
            return np.eye(3)
        angle = float(np.arctan2(way[0], -way[1]))
        return _about(np.array([0.0, 0.0, 1.0]), -angle) if abs(angle) < np.radians(80.0) else np.eye(3)

    def _hip_scale(self) -> float:
        return float(np.linalg.norm(self._hip - self._need("LeftFoot")))

    def _foot(self, side: str) -> dict[str, Array]:
        """Places of a foot at rest in the frame of its joint, which points straight forward: heel, ball on the floor,
        the tip of a hard sole and the toe's joint from the ankle, the tip from the toe's joint; armature units."""
        turn, sole = self._heading(side), self._soles[side]
        ankle = self._need(f"{side}Foot") @ self.axes
        toe = self.head(f"{side}Toe")
        if toe is None:
            forward = np.array([0.0, -BALL_AHEAD * self.unit, 0.0])
            joint = turn.T @ forward
            joint[2] = sole.low + 0.025 * self.unit - ankle[2]
        else:
            joint = toe @ self.axes - ankle
        heel = np.array([0.0, max(sole.back - ankle[1], 0.0), sole.low - ankle[2]])
        tip = np.array([0.0, min(sole.front - ankle[1] - joint[1], 0.0), sole.low - ankle[2] - joint[2]])
        ball = np.array([joint[0], joint[1], sole.low - ankle[2]])
        stiff = np.array([0.0, min(sole.stiff - ankle[1], joint[1]), sole.low - ankle[2]])
        # Heel and tips lie on the foot's own line.
        on_line = {"heel": _forward(turn, heel), "stiff": _forward(turn, stiff), "tip": _forward(turn, tip)}
        return {**on_line, "ball": turn @ ball, "toe": turn @ joint}

    # --- the core's body on the rig -----------------------------------------------------------------------------------

    def channels(
        self, motion: Motion, to_world: Array, metres_per_unit: float, holds: tuple[Hold, ...] = ()
    ) -> tuple[Array, Array]:
        """A motion of the core as locations of the first of `bones`, (frames, 3), and rotations of all, (frames, bones,
        4), in each bone's rest frame.

        `to_world`: the armature object's matrix; `metres_per_unit`: the core's metres for a unit of the scene. `holds`:
        hands ("left", "right", "both") that are exactly where the body's are, from and to which second.
        """
        posed, heads, before = self._pose(motion, to_world, metres_per_unit, holds)
        basis = [np.swapaxes(before[bone], -1, -2) @ posed[bone] for bone in (self._index[b] for b in self.bones)]
        rotations = quaternions.continuous(np.moveaxis(quaternions.from_matrix(np.stack(basis)), 0, 1))
        return self._location(heads, before), rotations

    def matrices(
        self, motion: Motion, to_world: Array, metres_per_unit: float, holds: tuple[Hold, ...] = ()
    ) -> dict[str, Array]:
        """Where each bone of the chain is, armature space, (frames, 4, 4); arguments as of `channels`."""
        posed, heads, _ = self._pose(motion, to_world, metres_per_unit, holds)
        found = {}
        for bone in self._chain:
            matrices = np.tile(np.eye(4), (len(motion), 1, 1))
            matrices[:, :3, :3], matrices[:, :3, 3] = posed[bone], heads[bone]
            found[self.rest.names[bone]] = matrices
        return found

    def _pose(
        self, motion: Motion, to_world: Array, metres_per_unit: float, holds: tuple[Hold, ...]
    ) -> tuple[dict[int, Array], dict[int, Array], dict[int, Array]]:
        """Rotations and heads of the chain's bones, and rotations before their own."""
        turns, places, up = self._posed(motion, to_world, metres_per_unit)
        wanted = self._wanted(turns)
        self._lean_alike(turns, wanted)
        ankles = {side: self._ankle(side, turns, places, up) for side in SIDES}
        hips = self._hips(ankles, places, up, motion.frame_rate, wanted)
        for side in SIDES:
            self._place_leg(side, turns, ankles[side], hips, wanted)
        posed, heads, _ = self._forward(wanted, hips)
        for side in SIDES:
            share = self._held(side, turns, places, motion.frame_rate, holds)
            if share.any():
                self._place_arm(side, turns, places, share, wanted, posed, heads)
        return self._forward(wanted, hips)

    def motion(
        self, locations: Array, rotations: Array, frame_rate: float, to_world: Array, metres_per_unit: float
    ) -> Motion:
        """What `channels` gives as a motion of the core's body: the inverse but for the proportions, so that a bone
        that turned by something turns its joint by the same."""
        basis = np.moveaxis(quaternions.to_matrix(rotations), 1, 0)
        own = {self._index[bone]: basis[k] for k, bone in enumerate(self.bones)}
        frames = len(locations)
        posed: dict[int, Array] = {}
        heads: dict[int, Array] = {}
        for bone in self._chain:
            before, head = self._before(bone, posed, heads, frames)
            if bone == self._carrier:
                head = head + _turned(before, locations)
            posed[bone] = before @ own[bone] if bone in own else before
            heads[bone] = head
        return self._of_pose(posed, heads, frame_rate, to_world, metres_per_unit)

    def motion_of_matrices(
        self, matrices: dict[str, Array], frame_rate: float, to_world: Array, metres_per_unit: float
    ) -> Motion:
        """The same from where some of the chain's bones are, as `matrices` gives it; the others are carried along."""
        frames = len(next(iter(matrices.values())))
        posed: dict[int, Array] = {}
        heads: dict[int, Array] = {}
        for bone in self._chain:
            seen = matrices.get(self.rest.names[bone])
            if seen is not None:
                posed[bone], heads[bone] = seen[:, :3, :3], seen[:, :3, 3]
            else:
                posed[bone], heads[bone] = self._before(bone, posed, heads, frames)
        return self._of_pose(posed, heads, frame_rate, to_world, metres_per_unit)

    def _of_pose(
        self,
        posed: dict[int, Array],
        heads: dict[int, Array],
        frame_rate: float,
        to_world: Array,
        metres_per_unit: float,
    ) -> Motion:
        turns = self._turns_of(posed, len(next(iter(heads.values()))))
        hips = heads[self._bone["Hips"]]
        middle = hips + _turned(posed[self._bone["Hips"]], self._from_hips(self._hip))
        below = self._offsets[[self._joints["LeftUpLeg"], self._joints["RightUpLeg"]]].mean(axis=0)
        root = middle - _turned(turns[:, 0], below) * self.unit
        world = np.asarray(to_world, dtype=np.float64)
        spin = _without_scale(world)
        turns = spin @ turns
        local = turns.copy()
        for joint, parent in enumerate(self._parents):
            if parent >= 0:
                local[:, joint] = np.swapaxes(turns[:, parent], -1, -2) @ turns[:, joint]
        positions = (root @ world[:3, :3].T + world[:3, 3]) * metres_per_unit
        return Motion(positions, quaternions.continuous(quaternions.from_matrix(local)), frame_rate)

    def _posed(self, motion: Motion, to_world: Array, metres_per_unit: float) -> tuple[Array, Array, Array]:
        """Rotations (frames, joints, 3, 3) and places (frames, joints, 3) of the core's joints in armature space, and
        the world's up there."""
        world = np.asarray(to_world, dtype=np.float64)
        spin = _without_scale(world)
        local = quaternions.to_matrix(motion.rotations)
        back = np.linalg.inv(world)
        turns, places = np.empty_like(local), np.empty(local.shape[:3])
        for joint, parent in enumerate(self._parents):
            if parent < 0:
                turns[:, joint] = spin.T @ local[:, joint]
                scene = motion.root_positions.astype(np.float64) / metres_per_unit
                places[:, joint] = scene @ back[:3, :3].T + back[:3, 3]
            else:
                turns[:, joint] = turns[:, parent] @ local[:, joint]
                step = _turned(turns[:, parent], self._offsets[joint]) * self.unit
                places[:, joint] = places[:, parent] + step
        return turns, places, spin.T @ np.array([0.0, 0.0, 1.0])

    def _wanted(self, turns: Array) -> dict[int, Array]:
        """The rotation of each bone that shows a joint, armature space, (frames, 3, 3)."""
        wanted = {bone: turns[:, self._joints[joint]] @ self._turned[bone] for joint, bone in self._bone.items()}
        curve = np.stack([turns[:, self._joints[joint]] for joint in ("Hips", *SPINE)], axis=1)
        along = quaternions.from_matrix(curve)
        for k, bone in enumerate(self._spine):
            at = 3.0 * (k + 1) / len(self._spine)
            i = min(int(at), 2)
            turn = quaternions.slerp(along[:, i], along[:, i + 1], np.full(len(turns), at - i))
            wanted[bone] = quaternions.to_matrix(turn) @ self._turned[bone]
        return wanted

    def _lean_alike(self, turns: Array, wanted: dict[int, Array]) -> None:
        """Leans pelvis and lower spine so that the shoulders are over the hips as the body's are, whose spine may bend
        elsewhere; the chest keeps its turn as far as that is enough."""
        trunk = list(dict.fromkeys([self._bone["Hips"], *self._spine]))
        # Along the rig's trunk, each part in the frame of the bone that carries it.
        heads = [self._hip, *(self._heads[bone] for bone in trunk[1:]), self._middle("LeftArm", "RightArm")]
        parts = [
            _turned(wanted[bone], self.rest.matrices[bone, :3, :3].T @ (heads[k + 1] - heads[k]))
            for k, bone in enumerate(trunk)
        ]
        lower, upper = np.sum(parts[:-1], axis=0) + np.zeros((len(turns), 3)), parts[-1]
        at_rest, body = self.axes.T @ (heads[-1] - heads[0]), self._body_trunk()
        middle = turns[:, self._joints["Spine1"]]
        line = np.sum([_turned(turns[:, joint], way) for joint, way in body.items()], axis=0)
        line = line / np.linalg.norm(line, axis=1, keepdims=True)
        body_at_rest = np.sum(list(body.values()), axis=0)
        unlike = _swing(body_at_rest / np.linalg.norm(body_at_rest), at_rest / np.linalg.norm(at_rest))
        line = _turned(middle @ unlike, _turned(np.swapaxes(middle, -1, -2), line))
        if len(trunk) > 1:
            along = np.sum(line * upper, axis=1)
            room = along**2 + np.sum(lower * lower, axis=1) - np.sum(upper * upper, axis=1)
            far = along + np.sqrt(np.maximum(room, 0.0))
            lean = _at_most(_swings(lower, far[:, None] * line - upper), MOST_LEAN)
            for bone in trunk[:-1]:
                wanted[bone] = lean @ wanted[bone]
            lower = _turned(lean, lower)
        rest = _swings(lower + upper, line)
        for bone in trunk:
            wanted[bone] = rest @ wanted[bone]

    def _body_trunk(self) -> dict[int, Array]:
        """The core's trunk from the middle of its hips to that of its shoulders: its parts by the joint that carries
        each, metres."""
        joints, offset = self._joints, self._offsets
        hips = (offset[joints["LeftUpLeg"]] + offset[joints["RightUpLeg"]]) / 2.0
        arms = [offset[joints[f"{side}Shoulder"]] + offset[joints[f"{side}Arm"]] for side in SIDES]
        ways = [
            offset[joints["Spine"]] - hips,
            *(offset[joints[name]] for name in SPINE[1:]),
            (arms[0] + arms[1]) / 2.0,
        ]
        return dict(zip((joints[name] for name in ("Hips", *SPINE)), ways, strict=True))

    def _turns_of(self, posed: dict[int, Array], frames: int) -> Array:
        """The rotations of the core's joints, armature space, of a posed rig: the inverse of `_wanted`."""
        turns = np.empty((frames, len(self._parents), 3, 3))
        shown = {joint: posed[bone] @ self._turned[bone].T for joint, bone in self._bone.items()}
        curve = [shown["Hips"], *(posed[bone] @ self._turned[bone].T for bone in self._spine)]
        along = quaternions.from_matrix(np.stack(curve, axis=1))
        for joint, name in enumerate(self._joints):
            if name in SPINE:
                at = (len(curve) - 1) * (SPINE.index(name) + 1) / 3.0
                i = min(int(at), max(len(curve) - 2, 0))
                part = np.full(frames, at - i)
                here = along[:, i] if len(curve) == 1 else quaternions.slerp(along[:, i], along[:, i + 1], part)
                turns[:, joint] = quaternions.to_matrix(here)
            elif name in shown:
                turns[:, joint] = shown[name]
            else:
                turns[:, joint] = turns[:, self._parents[joint]]
        return turns

    def _hips(
        self, ankles: dict[str, Array], places: Array, up: Array, frame_rate: float, wanted: dict[int, Array]
    ) -> Array:
        """Where the middle of the hip joints goes, (frames, 3): where the body's is, and lower where a foot would else
        be out of reach."""
        body = self._joints
        middle = (places[:, body["LeftUpLeg"]] + places[:, body["RightUpLeg"]]) / 2.0
        sink = np.zeros(len(places))
        for side in SIDES:
            hip = middle + self._hip_offset(side, wanted)
            way = hip - ankles[side]
            height = way @ up
            level = np.linalg.norm(way - height[:, None] * up, axis=1)
            reach = LONGEST_REACH * sum(self._lengths(side, ("UpLeg", "Leg", "Foot")))
            highest = np.sqrt(np.maximum(reach**2 - level**2, 0.0))
            sink = np.maximum(sink, np.maximum(height - highest, 0.0))
        lowered: Array = middle - _eased(sink, SINK_S * frame_rate)[:, None] * up
        return lowered

    def _hip_offset(self, side: str, wanted: dict[int, Array]) -> Array:
        """From the middle of the hips to a hip joint, (frames, 3)."""
        rest = self._from_hips(self._need(f"{side}UpLeg")) - self._from_hips(self._hip)
        return _turned(wanted[self._bone["Hips"]], rest)

    def _from_hips(self, place: Array) -> Array:
        """A place at rest as seen from the hips' bone."""
        bone = self._bone["Hips"]
        seen: Array = self.rest.matrices[bone, :3, :3].T @ (place - self._heads[bone])
        return seen

    def _ankle(self, side: str, turns: Array, places: Array, up: Array) -> Array:
        """Where an ankle goes, (frames, 3): the ball over the body's ball, and the lowest of the sole as high as the
        body's lowest."""
        foot, toe = turns[:, self._joints[f"{side}Foot"]], turns[:, self._joints[f"{side}Toe"]]
        skeleton, unit = self._skeleton, self.unit
        down, ahead = -float(skeleton["ankle_height"]), self._offsets[self._joints[f"{side}Toe"]]
        ankle = places[:, self._joints[f"{side}Foot"]]
        ball = ankle + _turned(foot, np.array([ahead[0], ahead[1], down])) * unit
        heel = ankle + _turned(foot, np.array([0.0, float(skeleton["heel_length"]), down])) * unit
        end = np.array([0.0, -float(skeleton["toe_length"]), -float(skeleton["toe_height"])])
        tip = places[:, self._joints[f"{side}Toe"]] + _turned(toe, end) * unit
        lowest = np.min([point @ up for point in (ball, heel, tip)], axis=0)
        own = self._feet[side]
        of_foot = {name: _turned(foot, own[name]) for name in ("heel", "ball", "stiff", "toe")}
        # A foot without toes is one block.
        of_tip = of_foot["toe"] + _turned(toe if f"{side}Toe" in self._bone else foot, own["tip"])
        under = np.min([point @ up for point in (*(of_foot[p] for p in ("heel", "ball", "stiff")), of_tip)], axis=0)
        level = ball - of_foot["ball"]
        placed: Array = level + (lowest - under - level @ up)[:, None] * up
        return placed

    def _lengths(self, side: str, joints: tuple[str, str, str]) -> tuple[float, float]:
        a, b, c = (self.head(f"{side}{joint}") for joint in joints)
        assert a is not None
        assert b is not None
        if c is None:
            c = self.rest.tails[self._bone[f"{side}{joints[1]}"]]
        return float(np.linalg.norm(b - a)), float(np.linalg.norm(c - b))

    def _place_leg(self, side: str, turns: Array, ankle: Array, hips: Array, wanted: dict[int, Array]) -> None:
        """Turns thigh and shin so that the ankle is where it is to be; the foot keeps its turn in the world."""
        hip = hips + self._hip_offset(side, wanted)
        thigh, shin = self._joints[f"{side}UpLeg"], self._joints[f"{side}Leg"]
        hinge = turns[:, thigh] @ np.array([1.0, 0.0, 0.0])
        upper, lower = _two_bones(ankle - hip, hinge, *self._lengths(side, ("UpLeg", "Leg", "Foot")))
        down = np.array([0.0, 0.0, -1.0])
        for joint, name, way in ((thigh, "UpLeg", upper), (shin, "Leg", lower)):
            bone = self._bone[f"{side}{name}"]
            wanted[bone] = _swings(turns[:, joint] @ down, way) @ wanted[bone]

    def _held(self, side: str, turns: Array, places: Array, frame_rate: float, holds: tuple[Hold, ...]) -> Array:
        """How far a hand is to be where the body's is, 0 to 1, (frames,): it holds something, or lies on a thigh."""
        times = np.arange(len(turns)) / frame_rate
        share = np.zeros(len(turns))
        for hand, first, last in holds:
            if hand in (side.lower(), "both"):
                off = np.maximum(np.maximum(first - times, times - last), 0.0)
                share = np.maximum(share, _smooth(1.0 - off / EASE_S))
        palm = places[:, self._joints[f"{side}Hand"]]
        for other in SIDES:
            hip, knee = places[:, self._joints[f"{other}UpLeg"]], places[:, self._joints[f"{other}Leg"]]
            way = knee - hip
            along = np.clip(np.sum((palm - hip) * way, axis=1) / np.sum(way * way, axis=1), 0.0, 1.0)
            off = np.linalg.norm(palm - hip - along[:, None] * way, axis=1) / self.unit
            near = _smooth((OFF_THIGH - off) / (OFF_THIGH - ON_THIGH))
            trunk = turns[:, self._joints["Hips"]] @ np.array([0.0, 0.0, -1.0])
            lifted = np.arccos(np.clip(np.sum(way * trunk, axis=1) / np.linalg.norm(way, axis=1), -1.0, 1.0))
            share = np.maximum(share, near * _smooth((lifted - HANGING) / (SEATED - HANGING)))
        return share

    def _place_arm(
        self,
        side: str,
        turns: Array,
        places: Array,
        share: Array,
        wanted: dict[int, Array],
        posed: dict[int, Array],
        heads: dict[int, Array],
    ) -> None:
        """Turns upper arm and forearm towards where the body's wrist is, by `share`; the hand keeps its turn."""
        hand = self._bone.get(f"{side}Hand")
        if hand is None:
            return
        upper_bone, lower_bone = self._bone[f"{side}Arm"], self._bone[f"{side}ForeArm"]
        out = 1.0 if side == "Left" else -1.0
        shoulder, elbow, wrist = heads[upper_bone], heads[lower_bone], heads[hand]
        hinge = turns[:, self._joints[f"{side}Arm"]] @ np.array([0.0, 0.0, -out])
        target = places[:, self._joints[f"{side}Hand"]] - shoulder
        upper, lower = _two_bones(target, hinge, *self._lengths(side, ("Arm", "ForeArm", "Hand")))
        still = np.broadcast_to(np.eye(3), (len(turns), 3, 3))
        for bone, now, way in ((upper_bone, elbow - shoulder, upper), (lower_bone, wrist - elbow, lower)):
            turn = quaternions.slerp(quaternions.from_matrix(still), quaternions.from_matrix(_swings(now, way)), share)
            wanted[bone] = quaternions.to_matrix(turn) @ wanted[bone]

    # --- the rig's own chain ------------------------------------------------------------------------------------------

    def _before(self, bone: int, posed: dict[int, Array], heads: dict[int, Array], frames: int) -> tuple[Array, Array]:
        """Rotation and head of a bone as its parent carries it, before its own channels; armature space."""
        rest, parent = self.rest.matrices[bone], self.rest.parents[bone]
        if parent < 0:
            return np.broadcast_to(rest[:3, :3], (frames, 3, 3)), np.broadcast_to(rest[:3, 3], (frames, 3))
        over = self.rest.matrices[parent]
        turn = posed[parent] @ (over[:3, :3].T @ rest[:3, :3])
        step = over[:3, :3].T @ (rest[:3, 3] - over[:3, 3])
        return turn, heads[parent] + _turned(posed[parent], step)

    def _forward(
        self, wanted: dict[int, Array], hips: Array
    ) -> tuple[dict[int, Array], dict[int, Array], dict[int, Array]]:
        """Rotations and heads of the chain's bones, and rotations before their own, with the bones turned as wanted and
        the middle of the hips at `hips`."""
        frames = len(hips)
        posed: dict[int, Array] = {}
        heads: dict[int, Array] = {}
        before: dict[int, Array] = {}
        for bone in self._chain:
            before[bone], heads[bone] = self._before(bone, posed, heads, frames)
            posed[bone] = wanted.get(bone, before[bone])
        pelvis = self._bone["Hips"]
        at = hips - _turned(posed[pelvis], self._from_hips(self._hip))
        moved = at - heads[pelvis]
        carried = {self._carrier}
        for bone in self._chain:
            if bone in carried or self.rest.parents[bone] in carried:
                carried.add(bone)
                heads[bone] = heads[bone] + moved
        return posed, heads, before

    def _location(self, heads: dict[int, Array], before: dict[int, Array]) -> Array:
        """The carrier's location channel: nothing over it is turned or moved."""
        away = heads[self._carrier] - self._heads[self._carrier]
        return _turned(np.swapaxes(before[self._carrier], -1, -2), away)


# --- turns -----------------------------------------------------------------------------------------------------------


def _without_scale(matrix: Array) -> Array:
    """The rotation of an evenly scaled matrix (4, 4)."""
    rotation: Array = matrix[:3, :3] / np.cbrt(np.linalg.det(matrix[:3, :3]))
    return rotation


def _turned(turns: Array, ways: Array) -> Array:
    """One way (3,), or one for each frame (frames, 3), turned by each rotation (frames, 3, 3)."""
    turned: Array = (turns @ ways[..., None])[..., 0]
    return turned


def _about(axis: Array, angle: float) -> Array:
    """The rotation about an axis of unit length."""
    half = angle / 2.0
    return quaternions.to_matrix(np.array([np.cos(half), *(np.sin(half) * axis)]))


def _swing(start: Array, end: Array) -> Array:
    """The shortest rotation from one direction to another, both of unit length."""
    turn: Array = _swings(start[None], end[None])[0]
    return turn


def _swings(start: Array, end: Array) -> Array:
    """The same for (frames, 3) of any length, (frames, 3, 3)."""
    a = start / np.linalg.norm(start, axis=1, keepdims=True)
    b = end / np.linalg.norm(end, axis=1, keepdims=True)
    w = 1.0 + np.sum(a * b, axis=1, keepdims=True)
    axis = np.cross(a, b)
    # Opposite directions turn about anything across them.
    across = np.cross(a, np.where(np.abs(a[:, :1]) < 0.7, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]]))
    opposite = w < 1e-9
    turn = np.where(opposite, np.hstack([np.zeros_like(w), across]), np.hstack([w, axis]))
    return quaternions.to_matrix(turn / np.linalg.norm(turn, axis=1, keepdims=True))


def _at_most(turns: Array, angle: float) -> Array:
    """Rotations (frames, 3, 3), each by no more than an angle."""
    along = quaternions.from_matrix(turns)
    by = 2.0 * np.arccos(np.clip(np.abs(along[:, 0]), 0.0, 1.0))
    share = np.minimum(angle / np.maximum(by, 1e-12), 1.0)
    return quaternions.to_matrix(quaternions.slerp(np.broadcast_to(STILL, along.shape), along, share))


def _two_bones(way: Array, hinge: Array, upper: float, lower: float) -> tuple[Array, Array]:
    """The directions (frames, 3) of two bones that reach from the origin along `way`, bent about `hinge` so that the
    first turns against it; as far as they reach."""
    far = np.linalg.norm(way, axis=1, keepdims=True)
    along = way / np.maximum(far, 1e-12)
    reach = np.clip(far, abs(upper - lower) * 1.001 + 1e-9, (upper + lower) * LONGEST_REACH)
    axis = hinge - along * np.sum(hinge * along, axis=1, keepdims=True)
    axis = axis / np.maximum(np.linalg.norm(axis, axis=1, keepdims=True), 1e-12)
    cosine = np.clip((upper**2 + reach**2 - lower**2) / (2.0 * upper * reach), -1.0, 1.0)
    sine = np.sqrt(1.0 - cosine**2)
    first = along * cosine - np.cross(axis, along) * sine
    second = along * reach - first * upper
    return first, second / np.linalg.norm(second, axis=1, keepdims=True)


def _forward(turn: Array, place: Array) -> Array:
    """A place of a foot on its own line: as far ahead or behind and as high, and not aside."""
    turned = turn @ place
    return np.array([0.0, place[1], turned[2]])


def _smooth(share: Array) -> Array:
    share = np.clip(share, 0.0, 1.0)
    eased: Array = share * share * (3.0 - 2.0 * share)
    return eased


def _eased(values: Array, frames: float) -> Array:
    """At no frame less than `values`, and smooth: the largest of the neighbourhood, then a mean over as much."""
    half = max(round(frames), 1)
    if not values.any():
        return values
    padded = np.pad(values, 2 * half, mode="edge")
    largest = np.max(np.lib.stride_tricks.sliding_window_view(padded, 2 * half + 1), axis=1)
    window = np.hanning(2 * half + 3)[1:-1]
    eased: Array = np.convolve(largest, window / window.sum(), mode="valid")
    return eased
