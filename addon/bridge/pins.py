# SPDX-License-Identifier: GPL-3.0-or-later
"""Pins: bones that Re-solve is to leave where they are. They belong to the action and are kept on it as JSON."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass

import bpy

from ..errors import SceneError
from . import compat
from .names import PINS_KEY


@dataclass(frozen=True)
class Pin:
    """One bone over a range of the scene's frames, first and last included.

    A pin is a nail: it holds the place and the turn that the bone had when it was pinned. A kept key has neither: it
    stands for what the artist keyed at that frame, which the action itself holds.
    """

    bone: str
    first_frame: int
    last_frame: int
    #: World, scene units; None where the place is free.
    position: tuple[float, float, float] | None = None
    #: World, w first; None where the turn is free.
    rotation: tuple[float, float, float, float] | None = None

    @property
    def is_key(self) -> bool:
        return self.position is None and self.rotation is None

    @property
    def title(self) -> str:
        """What a list shows: the bone, what is held, and when."""
        held = {(True, True): "place and turn", (True, False): "place", (False, True): "turn", (False, False): "key"}
        what = held[self.position is not None, self.rotation is not None]
        last = f" to {self.last_frame}" if self.last_frame != self.first_frame else ""
        return f"{self.bone}: {what}, {self.first_frame}{last}"


def read_pins(action: bpy.types.Action | None) -> list[Pin]:
    """The pins of an action, by frame and bone; those of a text that is none are gone."""
    text = action.get(PINS_KEY) if action else None
    try:
        entries = json.loads(text) if text else []
        pins = [Pin(**entry) for entry in entries]
        if not all(map(_is_sound, pins)):
            return []
        return sorted(pins, key=lambda pin: (pin.first_frame, pin.last_frame, pin.bone))
    except (TypeError, ValueError):
        return []


def _is_sound(pin: Pin) -> bool:
    """Whether a pin that was read from a file is one."""
    numbers = [(pin.position, 3), (pin.rotation, 4)]
    return (
        isinstance(pin.bone, str)
        and isinstance(pin.first_frame, int)
        and isinstance(pin.last_frame, int)
        and all(held is None or (len(held) == size and all(map(math.isfinite, held))) for held, size in numbers)
    )


def write_pins(action: bpy.types.Action, pins: list[Pin]) -> None:
    if pins:
        action[PINS_KEY] = json.dumps([asdict(pin) for pin in pins])
    elif PINS_KEY in action:
        del action[PINS_KEY]


def pin_bones(
    context: bpy.types.Context,
    character: bpy.types.Object,
    first_frame: int,
    last_frame: int,
    *,
    position: bool,
    rotation: bool,
    within: tuple[int, int] | None = None,
) -> list[Pin]:
    """Pins the character's selected bones as they stand at the current frame, over the range; gives the new pins.

    `within`: first and last frame of the motion, which the artist's own keys may pass; else those of the action.

    A pin of the same bone over the same frames gives way. Raises SceneError where nothing is selected, the range lies
    outside the action, or the character has no action.
    """
    action = editable_action_of(character)
    if last_frame < first_frame:
        raise SceneError(f"The pin would end at frame {last_frame}, before it begins at {first_frame}: swap them.")
    begin, end = within or (int(frame) for frame in action.frame_range)
    if first_frame < begin or last_frame > end:
        raise SceneError(
            f"Frames {first_frame} to {last_frame} are not within the motion's, {begin} to {end}: choose others."
        )
    if not (position or rotation):
        raise SceneError("A pin must hold the place, the turn or both.")
    chosen = [bone.name for bone in character.pose.bones if compat.is_selected(bone)]
    if not chosen:
        raise SceneError(f"No bone of {character.name} is selected: select in pose mode what is to be pinned.")
    made = []
    evaluated = character.evaluated_get(context.evaluated_depsgraph_get())
    for name in chosen:
        matrix = evaluated.matrix_world @ evaluated.pose.bones[name].matrix
        place, turn, _ = matrix.decompose()
        # Rotations are those of the joint, which the bone's rest pose does not turn.
        joint = turn @ evaluated.data.bones[name].matrix_local.to_quaternion().inverted()
        made.append(
            Pin(
                name,
                first_frame,
                last_frame,
                tuple(place) if position else None,
                tuple(joint) if rotation else None,
            )
        )
    there = {(pin.bone, pin.first_frame, pin.last_frame) for pin in made}
    others = [p for p in read_pins(action) if p.is_key or (p.bone, p.first_frame, p.last_frame) not in there]
    write_pins(action, others + made)
    return made


def remove_pin(character: bpy.types.Object, index: int) -> None:
    """Takes one pin out, by its place in `read_pins`."""
    action = editable_action_of(character)
    pins = read_pins(action)
    if 0 <= index < len(pins):
        write_pins(action, pins[:index] + pins[index + 1 :])


def remove_pins(character: bpy.types.Object) -> None:
    """Takes all pins and kept keys out."""
    write_pins(editable_action_of(character), [])


def action_of(character: bpy.types.Object | None) -> bpy.types.Action:
    """The action that the character plays. Raises SceneError where there is none."""
    data = character.animation_data if character else None
    if not data or not data.action:
        raise SceneError("The character has no motion yet: press Synthesize first.")
    return data.action


def editable_action_of(character: bpy.types.Object | None) -> bpy.types.Action:
    """`action_of`, to be changed. Raises SceneError where it is linked, since a change would be lost with the file."""
    action = action_of(character)
    if not action.is_editable:
        raise SceneError(f"{action.name} is linked and cannot be changed: make it local first (Object, Relations).")
    return action
