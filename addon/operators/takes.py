# SPDX-License-Identifier: GPL-3.0-or-later
"""The list of takes, and several at once: seeds that differ as takes do."""

from __future__ import annotations

from dataclasses import dataclass, replace

import bpy
from bpy.props import IntProperty, StringProperty

from .. import native
from ..bridge import session, takes
from ..bridge.action_writer import fit_end
from ..bridge.policies import policy_cache
from ..errors import SceneError
from ..job_operator import JobOperator, handle
from ..pipeline import Outcome, Request, Steps, synthesis_steps
from .button import Button
from .synthesize import KEPT, Made, earlier, library_cache, unwritten

#: More takes are made by batch runs.
MOST_VARIATIONS = 32


class TakeButton(Button):
    """Mixin of the buttons of one take of the scene's character."""

    bl_options = {"REGISTER", "UNDO", "INTERNAL"}

    name: StringProperty(name="Take", description="The take's action", options={"SKIP_SAVE", "HIDDEN"})

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not takes.takes_of(context.scene.oncue.character):
            return cls.cannot("The character has no takes yet")
        return True

    def act(self, context: bpy.types.Context) -> None:
        character = context.scene.oncue.character
        # Without a name it is the one that is played.
        played = session.current_action(context.scene)
        name = self.name or (played.name if played else "")
        self.treat(character, takes.take_named(character, name))
        fit_end_to_played(context.scene)
        handle.forget()

    def treat(self, character: bpy.types.Object, take: bpy.types.Action) -> None:
        raise NotImplementedError


class ONCUE_OT_play_take(TakeButton, bpy.types.Operator):
    """Have the character play this take; the others stay as they are"""

    bl_idname = "oncue.play_take"
    bl_label = "Play Take"

    def treat(self, character: bpy.types.Object, take: bpy.types.Action) -> None:
        takes.play_take(character, take)


class ONCUE_OT_discard_take(TakeButton, bpy.types.Operator):
    """Throw this take away, with its keys"""

    bl_idname = "oncue.discard_take"
    bl_label = "Discard Take"

    def treat(self, character: bpy.types.Object, take: bpy.types.Action) -> None:
        takes.discard_take(character, take)


class ONCUE_OT_copy_take(TakeButton, bpy.types.Operator):
    """Make a copy of this take to work on, and play it"""

    bl_idname = "oncue.copy_take"
    bl_label = "Copy Take"

    def treat(self, character: bpy.types.Object, take: bpy.types.Action) -> None:
        takes.copy_take(character, take)


class ONCUE_OT_push_take(TakeButton, bpy.types.Operator):
    """Put this take into the NLA, where it lies in time"""

    bl_idname = "oncue.push_take"
    bl_label = "Push Take to NLA"

    def treat(self, character: bpy.types.Object, take: bpy.types.Action) -> None:
        takes.push_take(character, take)


def fit_end_to_played(scene: bpy.types.Scene) -> None:
    """Has the scene end with the take that is played."""
    played = session.current_action(scene)
    if played is not None and played.use_frame_range:
        fit_end(scene, int(played.frame_end))


@dataclass
class Several:
    """The motions of several seeds, and what is said of those that could not be made."""

    made: list[Made]
    refused: list[str]

    def write(self, context: bpy.types.Context, operator: bpy.types.Operator) -> None:
        """Writes each as a take, and has the character play the one of which least is wrong. Raises SceneError."""
        written = [session.write_outcome(context, made.request, made.outcome, made.skipped) for made in self.made]
        problems = [session.report_of(action)["problems"] for action in written]
        best = min(range(len(written)), key=lambda k: len(problems[k]))
        takes.play_take(context.scene.oncue.character, written[best])
        fit_end_to_played(context.scene)
        good = sum(not found for found in problems)
        operator.say(
            {"INFO"}, f"Oncue made {len(written)} takes, {good} without a problem; {written[best].name} plays."
        )
        for said in dict.fromkeys(self.refused):
            operator.say({"WARNING"}, said)


class ONCUE_OT_variations(JobOperator, bpy.types.Operator):
    """Make several takes of the same cues, each by a seed of its own, and play the one of which least is wrong. Esc \
cancels"""

    bl_idname = "oncue.variations"
    bl_label = "Variations"
    bl_options = {"REGISTER", "UNDO"}
    title = "Making variations"

    count: IntProperty(
        name="Takes",
        description="How many seeds, from that of the settings on; 0 for the number in the settings",
        default=0,
        min=0,
        max=MOST_VARIATIONS,
        options={"SKIP_SAVE"},
    )

    def begin(self, context: bpy.types.Context) -> Steps[Several]:
        request, skipped = session.read_request(context)
        count = self.count or context.scene.oncue.variations
        return _several(request, skipped, count, policy_cache(context))

    def finish(self, context: bpy.types.Context, value: Several) -> None:
        value.write(context, self)
        unwritten.forget()

    def keep(self, context: bpy.types.Context, value: Several) -> str:
        unwritten.keep(context.scene, value)
        return KEPT


def _several(request: Request, skipped: list[tuple[str, str]], count: int, policies) -> Steps[Several]:
    """The motions of `count` seeds. Raises what the last of them was refused for where none could be made."""
    several = Several([], [])
    last: Exception | None = None
    for seed in range(request.seed, request.seed + count):
        own = replace(request, seed=seed)
        try:
            outcome: Outcome = yield from synthesis_steps(own, library_cache, policies, earlier)
        except native.expected_errors() as error:
            if native.is_cancelled(error):
                raise
            last = error
            several.refused.append(native.sentence(error))
            continue
        several.made.append(Made(own, outcome, skipped))
    if last is not None and not several.made:
        raise last
    if not several.made:
        raise SceneError("No takes were asked for.")
    return several


CLASSES = (
    *(ONCUE_OT_play_take, ONCUE_OT_discard_take, ONCUE_OT_copy_take, ONCUE_OT_push_take),
    ONCUE_OT_variations,
)


register, unregister = bpy.utils.register_classes_factory(CLASSES)
