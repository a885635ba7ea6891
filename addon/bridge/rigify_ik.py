# SPDX-License-Identifier: GPL-3.0-or-later
"""Limbs of a Rigify rig that are moved by their IK controls: what foot, hand and pole play for a body that is moved.

Rigify's foot hangs on its control by way of a roll: turned one way by the heel's control it rolls over the ball, with
the toes where they are, turned the other way over the heel. So what a foot does is told in three parts: how far it has
rolled, which is how far the toes are bent; where it would be had it not rolled, which is its control's; and what of the
toes' own turn is left. A foot that stands while its heel rises is then a control that stays.

All of it follows from where the body is, in closed form, but for one thing: Blender's IK solver shortens a leg that may
stretch though it reaches. The constraint that a pole steers is therefore keyed not to stretch, as the take's own.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import bpy
import numpy as np

from .. import quaternions
from ..errors import SceneError
from ..key_fit import TOLERANCE_MM, TURN, BoneKeys, Channels, Marks, Rest, fit
from ..rig import Array
from .channels import ANGLES, LOCATION, ROTATION
from .control_groups import Group

LEGS, ARMS = "legs", "arms"
#: What a scene says of limbs that are moved by IK.
IK = "IK"
#: A pole may be that much farther from its place than a hand, as it is farther from the joint that it turns.
POLE_NEAR = 3.0
#: A hand is held nearer than one on an FK arm: where an arm is nearly straight, its elbow bends by much for little.
HAND_NEAR = 0.5
#: A limb that is bent by less, a share of its length, shows no direction of its own; by more than the second it does.
STRAIGHT, BENT = 0.01, 0.04
#: How near to its place the control of a planted foot may be to stay, in tolerances; over how many frames it goes to
#: where it stays; and over fewer it does not.
STANDS, EASED, SHORTEST = 2.0 / 3.0, 4, 3
#: A foot's roll is held to a share of the tolerance of a turn, since it has another pivot either way.
ROLL = 0.5
#: What a channel does by less is nothing.
SAME = 1e-6


@dataclass(frozen=True)
class Switch:
    """A property of a rig and what a take keys it to."""

    owner: bpy.types.PoseBone | bpy.types.Constraint
    #: As in a data path: `["IK_FK"]`, or `use_stretch`.
    path: str
    value: float
    #: The bone under which its curve is shown.
    group: str

    @property
    def data_path(self) -> str:
        """Of its curve."""
        path = self.owner.path_from_id()
        return path + self.path if self.path.startswith("[") else f"{path}.{self.path}"

    @property
    def now(self):
        return self.owner[self.path[2:-2]] if self.path.startswith("[") else getattr(self.owner, self.path)

    def set(self, value) -> None:
        if self.path.startswith("["):
            self.owner[self.path[2:-2]] = value
        else:
            setattr(self.owner, self.path, value)


def asked(settings) -> tuple[str, ...]:
    """Which limbs of a Rigify rig a scene's settings would have moved by IK."""
    return tuple(limb for limb, choice in ((LEGS, settings.rig_legs), (ARMS, settings.rig_arms)) if choice == IK)


def fk_controls(limbs: tuple[str, ...]) -> set[str]:
    """The FK controls that are not written where these limbs are moved by IK."""
    parts = [part for limb in limbs for part in (_PARTS[limb].upper, _PARTS[limb].lower, _PARTS[limb].end)]
    return {f"{part}_fk.{side}" for part in [*parts, *(["toe"] if LEGS in limbs else [])] for side in "LR"}


def middles(limbs: tuple[str, ...]) -> set[str]:
    """The bones of the body that begin at the knees and elbows of these limbs."""
    return {f"ORG-{parts.lower}.{side}" for limb, parts in _PARTS.items() if limb in limbs for side in "LR"}


def limbs_of(character: bpy.types.Object, limbs: tuple[str, ...], upright: Array, up: Array) -> list[Limb]:
    """The limbs that are moved by IK. Up at rest, and the world's up, armature space. Raises SceneError where the rig
    has no controls for them."""
    return [
        Limb(character, _PARTS[limb], side, _Leg(character, side, upright, up) if limb == LEGS else None)
        for limb in _PARTS
        for side in ("LR" if limb in limbs else "")
    ]


def switches_of(character: bpy.types.Object, limbs: tuple[str, ...]) -> list[Switch]:
    """What is keyed so that a rig follows the IK controls of these limbs."""
    found = []
    for limb, parts in _PARTS.items():
        for side in "LR" if limb in limbs else "":
            master = _bone(character, f"{parts.upper}_parent.{side}")
            parents = {
                "IK_parent": (f"MCH-{parts.end}_ik.parent.{side}", "root"),
                "pole_parent": (f"MCH-{parts.upper}_ik_target.parent.{side}", parts.over_of(side)),
            }
            values = {"IK_FK": 0.0, "pole_vector": 1.0}
            values |= {name: _place_among_parents(character, *of) for name, of in parents.items()}
            found += [Switch(master, f'["{name}"]', value, master.name) for name, value in values.items()]
            heel = character.pose.bones.get(f"{parts.end}_heel_ik.{side}")
            if heel is not None and "Toe_Roll" in heel:
                found.append(Switch(heel, '["Toe_Roll"]', 0.0, heel.name))
            found += [
                Switch(constraint, "use_stretch", 0.0, master.name)
                for constraint in _bone(character, f"MCH-{parts.lower}_ik.{side}").constraints
                if constraint.type == "IK" and constraint.pole_target is not None
            ]
    return found


@dataclass(frozen=True)
class _Parts:
    """The names of a limb's parts, and the bone that carries its pole."""

    upper: str
    lower: str
    end: str
    over: str
    #: The core's joints that they show.
    joints: tuple[str, str, str]

    def over_of(self, side: str) -> str:
        return f"{self.over}.{side}" if self.over == "ORG-shoulder" else self.over


_PARTS = {
    LEGS: _Parts("thigh", "shin", "foot", "ORG-spine", ("UpLeg", "Leg", "Foot")),
    ARMS: _Parts("upper_arm", "forearm", "hand", "ORG-shoulder", ("Arm", "ForeArm", "Hand")),
}


class Limb:
    """A limb that is moved by IK: its end, for a leg with a roll and toes, and its pole."""

    def __init__(self, character: bpy.types.Object, parts: _Parts, side: str, leg: _Leg | None) -> None:
        self._bones = [f"ORG-{part}.{side}" for part in (parts.upper, parts.lower, parts.end)]
        self._over = parts.over_of(side)
        self._rest = {bone: _rest(character, bone) for bone in (self._over, *self._bones)}
        self._pole = Pole(character, parts, side, self._rest)
        self._ends = [Foot(leg), Toes(leg)] if leg is not None else [Hand(character, side)]
        self.groups: list[Group] = [*self._ends, self._pole]

    def values(self, body: dict[str, Array], way: Array | None) -> list[Array]:
        """What the groups play for a body, armature space, each (frames, columns). `way`: what carries the body on each
        frame, as of a `CarriedSpace`."""
        return [controls.values(body, way) for controls in (*self._ends, self._pole)]

    def bones(self, values: list[Array], body: dict[str, Array], way: Array | None) -> dict[str, Array]:
        """The inverse: where the limb's bones are upon a body that has what they hang on."""
        found: dict[str, Array] = {}
        for end, played in zip(self._ends, values, strict=False):
            found |= end.placed(played, way, values[0])
        upper, lower, end = self._bones
        at_rest = [self._rest[bone][:3, 3] for bone in self._bones]
        over = body[self._over] @ np.linalg.inv(self._rest[self._over])
        begin = over[:, :3, :3] @ at_rest[0] + over[:, :3, 3]
        lengths = np.linalg.norm(at_rest[1] - at_rest[0]), np.linalg.norm(at_rest[2] - at_rest[1])
        to_end = found[end][:, :3, 3] - begin
        along = _unit(to_end)
        far = np.clip(np.linalg.norm(to_end, axis=1), abs(lengths[0] - lengths[1]), sum(lengths))
        bend = _unit(_across(self._pole.place(values[-1], over) - begin, along))
        first = (far**2 + lengths[0] ** 2 - lengths[1] ** 2) / (2.0 * np.maximum(far, 1e-12))
        aside = np.sqrt(np.maximum(lengths[0] ** 2 - first**2, 0.0))
        middle = begin + along * first[:, None] + bend * aside[:, None]
        hinge = np.cross(along, bend)
        hinge_at_rest = np.cross(at_rest[2] - at_rest[0], self._pole.at_rest - at_rest[0])
        for bone, head, way_of, at in (
            (upper, begin, middle - begin, at_rest[1] - at_rest[0]),
            (lower, middle, begin + along * far[:, None] - middle, at_rest[2] - at_rest[1]),
        ):
            turned = _frames(way_of, hinge) @ np.swapaxes(_frames(at[None], hinge_at_rest[None]), 1, 2)
            found[bone] = np.tile(np.eye(4), (len(head), 1, 1))
            found[bone][:, :3, :3], found[bone][:, :3, 3] = turned @ self._rest[bone][:3, :3], head
        return found


class Pole:
    """The pole of a leg or an arm: in the limb's plane, where the knee or elbow points, carried by hips or shoulder."""

    def __init__(self, character: bpy.types.Object, parts: _Parts, side: str, rest: dict[str, Array]) -> None:
        self.name = f"{parts.upper}_ik_target.{side}"
        self._limb = [f"ORG-{part}.{side}" for part in (parts.upper, parts.lower, parts.end)]
        self._over, self._rest, self._own = parts.over_of(side), rest, _rest(character, self.name)
        self.at_rest = self._own[:3, 3]
        self._turn = _channel_turn(character, self.name)
        self.columns, self.still = [(self.name, LOCATION, axis) for axis in range(3)], []
        self.shows = tuple(_SIDES[side] + joint for joint in parts.joints[:2])

    def values(self, body: dict[str, Array], _way: Array | None) -> Array:
        ends = [body[bone][:, :3, 3] for bone in self._limb]
        at_rest = [self._rest[bone][:3, 3] for bone in self._limb]
        far = np.linalg.norm(self.at_rest - at_rest[1])
        length = np.linalg.norm(at_rest[1] - at_rest[0]) + np.linalg.norm(at_rest[2] - at_rest[1])
        along = _unit(ends[2] - ends[0])
        bend = _across(ends[1] - ends[0], along)
        # A straight limb points where its upper bone has the way to the pole.
        upper = body[self._limb[0]] @ np.linalg.inv(self._rest[self._limb[0]])
        pointed = _unit(_across(upper[:, :3, :3] @ (self.at_rest - at_rest[1]), along))
        bent = np.clip((np.linalg.norm(bend, axis=1) / length - STRAIGHT) / (BENT - STRAIGHT), 0.0, 1.0)
        place = ends[1] + _unit(_unit(bend) * bent[:, None] + pointed * (1.0 - bent)[:, None]) * far
        own = np.linalg.inv(body[self._over] @ np.linalg.inv(self._rest[self._over]) @ self._own)
        return ((own[:, :3, :3] @ place[..., None])[..., 0] + own[:, :3, 3]) @ self._turn.T

    def place(self, values: Array, over: Array) -> Array:
        """Where it is, armature space, as what it hangs on is moved from its rest, (frames, 3)."""
        carried = over @ self._own
        return (carried[:, :3, :3] @ (values @ self._turn)[..., None])[..., 0] + carried[:, :3, 3]

    def turns(self, _values: Array) -> dict[str, Array]:
        return {}

    def fit(
        self,
        values: Array,
        planted: Marks,
        tolerance_mm: float,
        units_per_metre: float,
        played: Array | None = None,
        stays: Marks | None = None,
    ) -> list[tuple[BoneKeys, int]]:
        def channels(values: Array) -> Channels:
            return Channels(values, np.tile(np.array(_STILL), (len(values), 1, 1)))

        own = {self.name: (POLE_NEAR, 1.0)}
        keys = _fit_one(self.name, channels, values, planted, tolerance_mm, units_per_metre, played, stays, own)
        return [(keys, 4 + axis) for axis in range(3)]


class Hand:
    """The IK control of a hand, which hangs on the rig's root."""

    def __init__(self, character: bpy.types.Object, side: str) -> None:
        self.name, self._end = f"hand_ik.{side}", f"ORG-hand.{side}"
        self.shows = tuple(_SIDES[side] + joint for joint in _PARTS[ARMS].joints)
        self._rest, self._at_rest = _rest(character, self.name), _rest(character, self._end)
        self._turn = _channel_turn(character, self.name)
        self.columns, self.still = _placed(self.name), []

    def values(self, body: dict[str, Array], way: Array | None) -> Array:
        return _of_control(self._rest, self._turn, body[self._end] @ np.linalg.inv(self._at_rest), way)

    def placed(self, values: Array, way: Array | None, _of_limb: Array) -> dict[str, Array]:
        return {self._end: _by_control(self._rest, self._turn, values, way) @ self._at_rest}

    def turns(self, values: Array) -> dict[str, Array]:
        return {self.name: values[:, 3:7]}

    def fit(
        self,
        values: Array,
        planted: Marks,
        tolerance_mm: float,
        units_per_metre: float,
        played: Array | None = None,
        stays: Marks | None = None,
    ) -> list[tuple[BoneKeys, int]]:
        def channels(values: Array) -> Channels:
            return Channels(values[:, :3], values[:, None, 3:7])

        own = {self.name: (HAND_NEAR, 1.0)}
        keys = _fit_one(self.name, channels, values, planted, tolerance_mm, units_per_metre, played, stays, own)
        return [(keys, channel) for channel in _CONTROL]


class _Leg:
    """What of a leg its foot's and its toes' controls both need to know."""

    def __init__(self, character: bpy.types.Object, side: str, upright: Array, up: Array) -> None:
        self.side, self.control, self.heel, self._up = side, f"foot_ik.{side}", f"foot_heel_ik.{side}", up
        toes = next((n for n in (f"toe_ik.{side}", f"toe.{side}") if n in character.data.bones), None)
        roll = _bone(character, f"MCH-foot_roll.{side}").parent_recursive
        back = next((bone for bone in roll if _rolls_back(bone, self.heel)), None)
        if toes is None or back is None:
            raise _lacking(character, f"the roll and the toes of {self.control}")
        self.toes = toes
        # About which axis of theirs these roll.
        self.axis = 0 if next(c.use_x for c in back.constraints if c.type == "COPY_ROTATION") else 2
        self.foot, self.toe = f"ORG-foot.{side}", f"ORG-toe.{side}"
        names = {"control": self.control, "toes": toes, "foot": self.foot, "toe": self.toe}
        self.rest = {key: _rest(character, name) for key, name in names.items()}
        self.rest |= {"ball": _rest(character, roll[0].name), "back": _rest(character, back.name)}
        self.turn = _channel_turn(character, self.control)
        ahead = self.rest["ball"][:3, 3] - self.rest["foot"][:3, 3]
        self._ahead = _unit((ahead - upright * (ahead @ upright))[None])[0]

    def moved(self, body: dict[str, Array]) -> tuple[Array, Array, Array]:
        """How foot and toes are moved from their rest, (frames, 4, 4), and by how much the foot has rolled, radians:
        over the ball by what its toes bend, over the heel by what it points up."""
        foot = body[self.foot] @ np.linalg.inv(self.rest["foot"])
        toe = body[self.toe] @ np.linalg.inv(self.rest["toe"])
        ball = self.rest["ball"]
        bent = quaternions.from_matrix((np.linalg.inv(ball) @ np.linalg.inv(toe) @ foot @ ball)[:, :3, :3])
        bent = bent * np.where(bent[:, :1] < 0.0, -1.0, 1.0)
        over = 2.0 * np.arctan2(bent[:, 1 + self.axis], bent[:, 0])
        rises = np.arcsin(np.clip(foot[:, :3, :3] @ self._ahead @ self._up, -1.0, 1.0))
        return foot, toe, np.maximum(over, 0.0) - np.maximum(rises, 0.0)

    def rolled(self, flat: Array, angle: Array) -> Array:
        """How a foot is moved that its control has moved and that has rolled: over the ball by an angle that is not
        negative, over the heel by one that is."""
        return flat @ self._roll(angle)

    def unrolled(self, foot: Array, angle: Array) -> Array:
        """The inverse: how its control has moved it."""
        return foot @ np.linalg.inv(self._roll(angle))

    def _roll(self, angle: Array) -> Array:
        pivots = np.where((angle >= 0.0)[:, None, None], self.rest["ball"], self.rest["back"])
        turns = np.tile(np.eye(4), (len(angle), 1, 1))
        turns[:, :3, :3] = quaternions.to_matrix(self.turns_by(angle))
        return pivots @ turns @ np.linalg.inv(pivots)

    def carrying(self, flat: Array, foot: Array, angle: Array) -> Array:
        """What the toes' control hangs on, as it is moved from its rest: the foot before it rolls over the ball."""
        return np.where((angle >= 0.0)[:, None, None], flat, foot)

    def turns_by(self, angle: Array) -> Array:
        turns = np.zeros((len(angle), 4))
        turns[:, 0], turns[:, 1 + self.axis] = np.cos(angle / 2.0), np.sin(angle / 2.0)
        return turns


class Foot:
    """The IK control of a foot, which hangs on the rig's root, and the heel's that rolls it."""

    def __init__(self, leg: _Leg) -> None:
        self._leg, self.name = leg, leg.control
        self.shows = tuple(_SIDES[leg.side] + joint for joint in _PARTS[LEGS].joints)
        self.columns = [*_placed(self.name), (leg.heel, ANGLES, leg.axis)]
        self.still = [(leg.heel, ANGLES, axis) for axis in range(3) if axis != leg.axis]

    def values(self, body: dict[str, Array], way: Array | None) -> Array:
        foot, _, angle = self._leg.moved(body)
        flat = self._leg.unrolled(foot, angle)
        control = _of_control(self._leg.rest["control"], self._leg.turn, flat, way)
        return np.hstack([control, angle[:, None]])

    def placed(self, values: Array, way: Array | None, _of_limb: Array) -> dict[str, Array]:
        flat = _by_control(self._leg.rest["control"], self._leg.turn, values[:, :7], way)
        return {self._leg.foot: self._leg.rolled(flat, values[:, 7]) @ self._leg.rest["foot"]}

    def turns(self, values: Array) -> dict[str, Array]:
        return {self.name: values[:, 3:7], self._leg.heel: self._leg.turns_by(values[:, 7])}

    def fit(
        self,
        values: Array,
        planted: Marks,
        tolerance_mm: float,
        units_per_metre: float,
        played: Array | None = None,
        stays: Marks | None = None,
    ) -> list[tuple[BoneKeys, int]]:
        """A foot that stands has a control that stays."""
        side = "LR".index(self._leg.side)
        near = STANDS * tolerance_mm / 1000.0 * units_per_metre, np.radians(STANDS * TURN * tolerance_mm / TOLERANCE_MM)
        fixed = np.zeros(len(values), dtype=bool)
        if stays is not None and played is not None:
            fixed = stays | np.concatenate([[False], stays[:-1]])
            values = np.where(fixed[:, None], played[::2], values)
        values, stands = stood(values, planted[:, side], fixed, *near)
        planted = np.where(np.arange(2) == side, stands[:, None], False)
        few = fit(
            self._tree(units_per_metre),
            self._channels(values),
            planted,
            tolerance_mm,
            None if played is None else self._channels(played),
            None if stays is None else np.repeat(stays[:, None], 5, axis=1),
            as_one=True,
            own={self._leg.heel: (np.inf, ROLL), "ball": (np.inf, ROLL)},
        )
        control, roll = _turned_keys(few[0], self._leg.turn), self._angles(*few[1:3])
        found = [(_level(control, channel, values[:, k]), channel) for k, channel in enumerate(_CONTROL)]
        return [*found, (_level(roll, 0, values[:, 7]), 0)]

    def _tree(self, units_per_metre: float) -> Rest:
        """What keys are fitted to: the control, the roll over the heel on it, that over the ball on this, which carries
        the ankle, and the ball of the toes on the first roll."""
        leg, said = self._leg, _SIDES[self._leg.side]
        names = [self.name, leg.heel, "ball", f"{said}Foot", f"{said}Toe"]
        frames = [leg.rest[key] for key in ("control", "back", "ball", "foot", "toes")]
        parents = [-1, 0, 1, 2, 1]
        own = [frames[0], *(np.linalg.inv(frames[p]) @ frames[k] for k, p in enumerate(parents) if p >= 0)]
        turns = np.array([quaternions.from_matrix(frame[:3, :3]) for frame in own])
        return Rest(names, parents, np.array([frame[:3, 3] for frame in own]), turns, units_per_metre)

    def _channels(self, values: Array) -> Channels:
        """The columns as the channels of that tree."""
        values = values.astype(np.float64)
        angle, still = values[:, 7], np.tile(np.array(_STILL), (len(values), 1))
        rolls = [self._leg.turns_by(np.minimum(angle, 0.0)), self._leg.turns_by(np.maximum(angle, 0.0))]
        return Channels(values[:, :3] @ self._leg.turn, np.stack([values[:, 3:7], *rolls, still, still], axis=1))

    def _angles(self, back: BoneKeys, ball: BoneKeys) -> BoneKeys:
        """The keys of the roll as one angle, as fast at each key as both turns are."""
        at = 1 + self._leg.axis

        def angle(turns: Array) -> Array:
            return 2.0 * np.arctan2(turns[:, at], turns[:, 0])[:, None]

        def speed(turns: Array, slopes: Array) -> Array:
            return 2.0 * (turns[:, 0] * slopes[:, at] - turns[:, at] * slopes[:, 0])[:, None]

        return BoneKeys(
            back.frames,
            angle(back.values) + angle(ball.values),
            speed(back.values, back.before) + speed(ball.values, ball.before),
            speed(back.values, back.after) + speed(ball.values, ball.after),
        )


class Toes:
    """The IK control of the toes, which have little left to do on a foot that rolls: their keys are their own."""

    def __init__(self, leg: _Leg) -> None:
        self._leg, self.name = leg, leg.toes
        self.columns, self.still = [(leg.toes, ROTATION, axis) for axis in range(4)], []
        self.shows = (f"{_SIDES[leg.side]}Toe",)

    def values(self, body: dict[str, Array], _way: Array | None) -> Array:
        leg = self._leg
        foot, toe, angle = leg.moved(body)
        carried = leg.carrying(leg.unrolled(foot, angle), foot, angle) @ leg.rest["toes"]
        left = quaternions.from_matrix((np.linalg.inv(carried) @ toe @ leg.rest["toes"])[:, :3, :3])
        return quaternions.continuous(left[:, None])[:, 0]

    def placed(self, values: Array, way: Array | None, of_foot: Array) -> dict[str, Array]:
        leg, angle = self._leg, of_foot[:, 7]
        flat = _by_control(leg.rest["control"], leg.turn, of_foot[:, :7], way)
        own = np.tile(np.eye(4), (len(values), 1, 1))
        own[:, :3, :3] = quaternions.to_matrix(values / np.linalg.norm(values, axis=1, keepdims=True))
        carried = leg.carrying(flat, leg.rolled(flat, angle), angle)
        return {leg.toe: carried @ leg.rest["toes"] @ own @ np.linalg.inv(leg.rest["toes"]) @ leg.rest["toe"]}

    def turns(self, values: Array) -> dict[str, Array]:
        return {self.name: values}

    def fit(
        self,
        values: Array,
        planted: Marks,
        tolerance_mm: float,
        units_per_metre: float,
        played: Array | None = None,
        stays: Marks | None = None,
    ) -> list[tuple[BoneKeys, int]]:
        def channels(values: Array) -> Channels:
            return Channels(np.zeros((len(values), 3)), values[:, None])

        keys = _fit_one(self.name, channels, values, planted, tolerance_mm, units_per_metre, played, stays)
        return [(_level(keys, axis, values[:, axis]), axis) for axis in range(4)]


_STILL = (1.0, 0.0, 0.0, 0.0)
_SIDES = {"L": "Left", "R": "Right"}
#: The channels of fitted keys in the order of a control's columns: its location, and its turn.
_CONTROL = (4, 5, 6, 0, 1, 2, 3)


def stood(values: Array, planted: Marks, fixed: Marks, near: float, turn: float) -> tuple[Array, Marks]:
    """A control's columns (frames, 7 or more), location and turn first, with what it hardly does while its foot is
    planted taken out, and when it stays: a place that is `near` and a turn by no more than `turn`, radians, to what it
    does there, from the first to the last frame for which that is so. It goes to these and on over `EASED` frames.

    `fixed`: frames at which it is as it is."""
    values, stands = values.copy(), np.zeros(len(values), dtype=bool)
    marks = np.flatnonzero(np.diff(np.concatenate([[False], planted, [False]]).astype(np.int8)))
    spans = []
    for first, end in zip(marks[::2], marks[1::2], strict=True):
        while end - first >= SHORTEST:
            seen = values[first:end, :7]
            middle = (seen.min(axis=0) + seen.max(axis=0)) / 2.0
            if fixed[first:end].any():
                middle = seen[int(np.argmax(fixed[first:end]))].copy()
            middle[3:] /= np.linalg.norm(middle[3:])
            away = np.linalg.norm(seen[:, :3] - middle[:3], axis=1) / near
            away = np.maximum(away, 2.0 * np.linalg.norm(seen[:, 3:] - middle[3:], axis=1) / turn)
            if away.max() <= 1.0:
                spans.append((first, end, middle))
                break
            # Feet come down and go up at the ends.
            first, end = (first + 1, end) if away[0] > away[-1] else (first, end - 1)
    for k, (first, end, middle) in enumerate(spans):
        before = max(first - EASED, spans[k - 1][1] if k else 0)
        after = min(end + EASED, spans[k + 1][0] if k + 1 < len(spans) else len(values))
        for frames, edge in ((np.arange(before, first), first), (np.arange(after - 1, end - 1, -1), end - 1)):
            share = (np.arange(len(frames)) + 1.0) / (len(frames) + 1.0)
            eased = share * share * (3.0 - 2.0 * share)
            values[frames, :7] += np.where(fixed[frames], 0.0, eased)[:, None] * (middle - values[edge, :7])
        values[first:end, :7] = np.where(fixed[first:end, None], values[first:end, :7], middle)
        stands[first:end] = True
    values[:, 3:7] /= np.linalg.norm(values[:, 3:7], axis=1, keepdims=True)
    return values, stands


def _level(keys: BoneKeys, channel: int, values: Array) -> BoneKeys:
    """Keys of a channel whose curve lies level from one to the next where it is to stay the same."""
    before, after = keys.before.copy(), keys.after.copy()
    for k, (first, last) in enumerate(zip(keys.frames, keys.frames[1:], strict=False)):
        if np.ptp(values[first : last + 1]) < SAME and not np.isnan(after[k, channel]):
            after[k, channel] = before[k + 1, channel] = 0.0
    return BoneKeys(keys.frames, keys.values, before, after)


def _of_control(rest: Array, turn: Array, moved: Array, way: Array | None) -> Array:
    """The columns of a control that hangs on the root, as it is moved from its rest, (frames, 4, 4)."""
    basis = np.linalg.inv(rest) @ (moved if way is None else np.linalg.inv(way) @ moved) @ rest
    turns = quaternions.continuous(quaternions.from_matrix(basis[:, :3, :3])[:, None])[:, 0]
    return np.hstack([basis[:, :3, 3] @ turn.T, turns])


def _by_control(rest: Array, turn: Array, values: Array, way: Array | None) -> Array:
    """The inverse: how a control has moved what goes with it, (frames, 4, 4)."""
    basis = np.tile(np.eye(4), (len(values), 1, 1))
    basis[:, :3, :3] = quaternions.to_matrix(values[:, 3:7] / np.linalg.norm(values[:, 3:7], axis=1, keepdims=True))
    basis[:, :3, 3] = values[:, :3] @ turn
    moved: Array = rest @ basis @ np.linalg.inv(rest)
    return moved if way is None else way @ moved


def _fit_one(
    name: str,
    channels: Callable[[Array], Channels],
    values: Array,
    planted: Marks,
    tolerance_mm: float,
    units_per_metre: float,
    played: Array | None,
    stays: Marks | None,
    own: dict[str, tuple[float, float]] | None = None,
) -> BoneKeys:
    """Few keys for one bone that hangs on nothing which is fitted along."""
    rest = Rest([name], [-1], np.zeros((1, 3)), np.array([_STILL]), units_per_metre)
    kept = (None, None) if played is None or stays is None else (channels(played.astype(np.float64)), stays[:, None])
    return fit(rest, channels(values), planted, tolerance_mm, *kept, own=own)[0]


def _frames(along: Array, hinge: Array) -> Array:
    """Rotations (frames, 3, 3) whose first axis lies along ways, and whose third is their hinge, both (frames, 3)."""
    first, third = _unit(along), _unit(_across(hinge, _unit(along)))
    return np.stack([first, np.cross(third, first), third], axis=2)


def _turned_keys(keys: BoneKeys, turn: Array) -> BoneKeys:
    """Keys whose location is told along other axes."""

    def turned(channels: Array) -> Array:
        return np.hstack([channels[:, :4], channels[:, 4:] @ turn.T])

    return BoneKeys(keys.frames, turned(keys.values), turned(keys.before), turned(keys.after))


def _placed(name: str) -> list[tuple[str, str, int]]:
    return [*((name, LOCATION, axis) for axis in range(3)), *((name, ROTATION, axis) for axis in range(4))]


def _channel_turn(character: bpy.types.Object, name: str) -> Array:
    """What takes a place in a bone's rest frame to its location channels: those of a bone without Local Location lie
    along the axes of what it hangs on."""
    bone = _bone(character, name).bone
    if bone.use_local_location:
        return np.eye(3)
    over = np.eye(3) if bone.parent is None else _rest(character, bone.parent.name)[:3, :3]
    turn: Array = over.T @ _rest(character, name)[:3, :3]
    return turn


def _place_among_parents(character: bpy.types.Object, bone: str, parent: str) -> int:
    """The number by which a rig's switch of parents has one of them."""
    constraint = next((one for one in _bone(character, bone).constraints if one.type == "ARMATURE"), None)
    names = [] if constraint is None else [target.subtarget for target in constraint.targets]
    if parent not in names:
        raise _lacking(character, f"{bone} under {parent}")
    return names.index(parent) + 1


def _rolls_back(bone: bpy.types.PoseBone, heel: str) -> bool:
    """Whether a bone of a foot's roll turns about the heel: it goes along with the heel's control about one axis that
    is not its own length."""
    return any(
        one.type == "COPY_ROTATION" and one.subtarget == heel and one.owner_space == "LOCAL" and not one.use_y
        for one in bone.constraints
    )


def _bone(character: bpy.types.Object, name: str) -> bpy.types.PoseBone:
    bone = character.pose.bones.get(name)
    if bone is None:
        raise _lacking(character, name)
    return bone


def _lacking(character: bpy.types.Object, what: str) -> SceneError:
    return SceneError(
        f"{character.name} lacks IK controls as Rigify makes them ({what}): choose FK for its legs and arms in Oncue's "
        "settings."
    )


def _rest(character: bpy.types.Object, name: str) -> Array:
    return np.array(_bone(character, name).bone.matrix_local, dtype=np.float64)


def _unit(ways: Array) -> Array:
    """Ways (frames, 3) of unit length; those without length stay so."""
    found: Array = ways / np.maximum(np.linalg.norm(ways, axis=1, keepdims=True), 1e-12)
    return found


def _across(ways: Array, along: Array) -> Array:
    """What of ways (frames, 3) lies across others of unit length."""
    found: Array = ways - along * np.sum(ways * along, axis=1, keepdims=True)
    return found
