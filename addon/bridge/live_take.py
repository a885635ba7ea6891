# SPDX-License-Identifier: GPL-3.0-or-later
"""The live take: the one action that is written over and over while the cues are followed.

It is made, and the character plays it, when the following begins, within an operator's undo step. Later only its keys
change, so that no step of the undo history is without it. Every frame is keyed, whatever the settings say: it is made
anew many times a second, and few keys are for what is edited.
"""

from __future__ import annotations

import json
import secrets

import bpy
import numpy as np

from .. import native
from ..errors import FollowingEnded, SceneError
from ..motion import Motion
from ..pipeline import Outcome, Request
from . import compat, file_state
from .action_writer import rewrite_action
from .bones import clear_channel, leftovers
from .channels import LOCATION, data_path, rotation_values
from .names import LIVE_KEY, PINS_KEY, REPORT_KEY, SOLVED_KEY
from .session import current_action, full_report, report_of
from .solved import Solved, keep_solved, solved_take
from .take import OBJECT_CHANNELS, Take

#: One posture of a bone.
IDLE = np.array([[1.0, 0.0, 0.0, 0.0]])


class LiveTake:
    """A copy of the take that the character plays; all other takes stay as they are."""

    def __init__(self, context: bpy.types.Context) -> None:
        """Raises SceneError where the character plays no take of Oncue's."""
        scene = context.scene
        played = current_action(scene)
        report = report_of(played)
        if report is None:
            raise SceneError("There is no motion to begin with: press Synthesize first.")
        # What an earlier following left, and nobody has changed, is gone on with.
        if file_state.check(context, scene.oncue.character).rig is not None:
            raise SceneError(
                f"Follow Cues moves Oncue's own character, and {scene.oncue.character.name} is a rig of yours: press "
                "Synthesize, or clear the Character field."
            )
        file_state.check_over_time(context, scene.oncue.character)
        compat.play_slot(scene.oncue.character)
        action = played if LIVE_KEY in played and _is_untouched(scene, played) else _copy(scene, played, report)
        self._token = action[LIVE_KEY] = secrets.token_hex(8)
        self._keys = _coordinates(action)
        #: What was written last and is not yet kept for Re-solve.
        self._solved: Solved | None = None

    def shows(self, task: dict) -> bool:
        """Whether the motion in it was made for this task, hands aside."""
        made_for = dict((report_of(self._action()) or {}).get("task", {}))
        made_for.pop("manipulations", None)
        return made_for == task

    def write(
        self,
        context: bpy.types.Context,
        request: Request,
        outcome: Outcome,
        skipped: list[tuple[str, str]],
        at_rest: bool,
    ) -> None:
        """Writes a motion in place of the one before. Raises FollowingEnded where that is the artist's by now."""
        scene, settings, synthesis = context.scene, context.scene.oncue, outcome.synthesis
        action, character = self._action(), settings.character
        if action is None:
            raise FollowingEnded("The live take was deleted.")
        if character is None or character.name not in scene.objects or character.animation_data is None:
            raise FollowingEnded("The character is gone.")
        if _coordinates(action) != self._keys:
            raise FollowingEnded(f"The keys of {action.name} were changed: it is a take of your own now.")
        names = list(native.core.skeleton()["names"])
        motion = Motion(
            np.asarray(synthesis.root_positions), np.asarray(synthesis.rotations), float(synthesis.frame_rate)
        )
        file_state.check_character(context, character)
        placed = {"start_frame": request.start_frame, "metres_per_unit": settings.scene_scale}
        rewrite_action(context, character, action, names, motion, **placed)
        if character.animation_data.action != action:  # a full run came between
            _play(character, action)
        action[REPORT_KEY] = json.dumps(full_report(request, outcome, skipped))
        action.pop(SOLVED_KEY, None)
        self._keys = _coordinates(action)
        self._solved = solved_take(scene, character, names, motion, np.asarray(synthesis.contacts), **placed)
        if at_rest:
            self.keep()

    def keep(self) -> None:
        """Keeps on the take what Re-solve asks for; packing it takes too long while a cue is dragged."""
        action = self._action()
        if action is not None and self._solved is not None:
            keep_solved(action, self._solved)
        self._solved = None

    def _action(self) -> bpy.types.Action | None:
        return next((action for action in bpy.data.actions if action.get(LIVE_KEY) == self._token), None)


def _copy(scene: bpy.types.Scene, played: bpy.types.Action, report: dict) -> bpy.types.Action:
    action = played.copy()
    action.name = f"{report.get('extension', {}).get('title', 'Cue')} live"
    action.pop(PINS_KEY, None)
    action.use_fake_user = True
    _play(scene.oncue.character, action)
    _play_keys_alone(scene.oncue.character, action)
    return action


def _play_keys_alone(character: bpy.types.Object, action: bpy.types.Action) -> None:
    """Has the skeleton's curves play the keys that will be written into them, and nothing else move its bones."""
    names = list(native.core.skeleton()["names"])
    own = {data_path(names[0], LOCATION)}
    own |= {data_path(name, rotation_values(character.pose.bones[name].rotation_mode, IDLE)[0]) for name in names}
    bones = tuple(data_path(name, "") for name in names)
    for curve in compat.action_curves(action, character):
        if curve.data_path in own:
            curve.mute = curve.lock = False
            if curve.group is not None:
                curve.group.mute = curve.group.lock = False
            for modifier in list(curve.modifiers):
                curve.modifiers.remove(modifier)
        elif curve.data_path.startswith((*bones, *OBJECT_CHANNELS)):
            compat.remove_curve(action, character, curve)
    for bone, channel, _ in list(leftovers([character.pose.bones[name] for name in names])):
        clear_channel(bone, channel)


def _play(character: bpy.types.Object, action: bpy.types.Action) -> None:
    character.animation_data.action.use_fake_user = True
    compat.replace_action(character, action)


def _is_untouched(scene: bpy.types.Scene, action: bpy.types.Action) -> bool:
    try:
        take = Take(scene, scene.oncue.character, action, native.core.skeleton())
    except SceneError:
        return False
    return not take.artist_keys() and not take.pins


def _coordinates(action: bpy.types.Action) -> list[tuple[str, int, bytes]]:
    """Every key of an action, bit for bit."""
    found = []
    for curve in compat.action_curves(action):
        coordinates = np.empty(len(curve.keyframe_points) * 2, dtype=np.float32)
        curve.keyframe_points.foreach_get("co", coordinates)
        found.append((curve.data_path, curve.array_index, coordinates.tobytes()))
    return found
