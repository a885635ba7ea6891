# SPDX-License-Identifier: GPL-3.0-or-later
"""Synthesize: the main job."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
from bpy.app.handlers import persistent

from .. import native
from ..bridge import session
from ..bridge.policies import policy_cache
from ..job_operator import JobOperator, handle
from ..pipeline import Earlier, LibraryCache, Outcome, Request, Steps, shot_steps
from .button import Button

#: The library stays in memory between presses.
library_cache = LibraryCache()
#: And so does the last performance, of which the next one takes what lies before a cue that was moved.
earlier = Earlier()
KEPT = "the motion is kept: press Write Motion once that is done."


@dataclass
class Made:
    """A motion that was made, and all that it takes to write it."""

    request: Request
    outcome: Outcome
    skipped: list[tuple[str, str]]

    def write(self, context: bpy.types.Context, operator: bpy.types.Operator) -> None:
        """Writes it as a new action, and has the operator tell what came of it. Raises SceneError."""
        action = session.write_outcome(context, self.request, self.outcome, self.skipped)
        problems = session.problems_of(session.report_of(action))
        for problem in problems:
            operator.say({"WARNING"}, problem)
        if not problems:
            operator.say({"INFO"}, f"Oncue made the action {action.name}.")


@dataclass
class Shot:
    """The motions of several people, and (person, sentence) of those who could not be made."""

    made: list[Made]
    refused: list[tuple[str, str]]

    def write(self, context: bpy.types.Context, operator: bpy.types.Operator) -> None:
        """Writes each onto its person's character, and has the operator tell what came of it. Raises SceneError."""
        actions = session.write_shot(context, [(made.request, made.outcome, made.skipped) for made in self.made])
        problems = [
            (made.request.person, problem)
            for made, action in zip(self.made, actions, strict=True)
            for problem in session.problems_of(session.report_of(action))
        ]
        for person, problem in dict.fromkeys([*problems, *self.refused]):
            operator.say({"WARNING"}, f"{person}: {problem}")
        if not problems and not self.refused:
            operator.say({"INFO"}, f"Oncue made a shot of {len(actions)} people.")


class Unwritten:
    """The motion that could be made and not be written, as the file was by then, until it is or another one is made."""

    def __init__(self) -> None:
        self._made: Made | Shot | None = None
        self._scene = 0

    def keep(self, scene: bpy.types.Scene, made: Made | Shot) -> None:
        self._made, self._scene = made, scene.session_uid

    def forget(self) -> None:
        self._made, self._scene = None, 0

    def of(self, scene: bpy.types.Scene) -> Made | Shot | None:
        """The motion that waits for this scene, if any."""
        return self._made if self._scene == scene.session_uid else None


unwritten = Unwritten()


class ONCUE_OT_synthesize(JobOperator, bpy.types.Operator):
    """Make a person walk from the Start cue to the Sit or Stop cue, or from cue to cue, as a new action. Esc cancels"""

    bl_idname = "oncue.synthesize"
    bl_label = "Synthesize"
    bl_options = {"REGISTER", "UNDO"}
    title = "Synthesizing"

    def begin(self, context: bpy.types.Context) -> Steps[list[Outcome | Exception]]:
        self._requests, self._skipped = session.read_shot(context)
        return shot_steps(self._requests, library_cache, policy_cache(context), earlier)

    def finish(self, context: bpy.types.Context, value: list[Outcome | Exception]) -> None:
        self._made(value).write(context, self)
        unwritten.forget()

    def keep(self, context: bpy.types.Context, value: list[Outcome | Exception]) -> str:
        unwritten.keep(context.scene, self._made(value))
        return KEPT

    def _made(self, value: list[Outcome | Exception]) -> Made | Shot:
        pairs = list(zip(self._requests, value, strict=True))
        made = [Made(request, one, self._skipped) for request, one in pairs if isinstance(one, Outcome)]
        refused = [(request.person, native.sentence(one)) for request, one in pairs if isinstance(one, Exception)]
        return made[0] if len(pairs) == 1 else Shot(made, refused)


class ONCUE_OT_write_motion(Button, bpy.types.Operator):
    """Write the motion that was made and could not be written, as a new action"""

    bl_idname = "oncue.write_motion"
    bl_label = "Write Motion"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if handle.run is not None:
            return cls.cannot(AT_WORK)
        if unwritten.of(context.scene) is None:
            return cls.cannot("No motion waits to be written")
        return True

    def act(self, context: bpy.types.Context) -> None:
        made = unwritten.of(context.scene)
        if made is not None:
            made.write(context, self)
            unwritten.forget()
            handle.forget()


@persistent
def _forget_with_its_file(*_) -> None:
    unwritten.forget()


CLASSES = (ONCUE_OT_synthesize, ONCUE_OT_write_motion)


def register() -> None:
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.app.handlers.load_pre.append(_forget_with_its_file)


def unregister() -> None:
    unwritten.forget()
    if _forget_with_its_file in bpy.app.handlers.load_pre:
        bpy.app.handlers.load_pre.remove(_forget_with_its_file)
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
