# SPDX-License-Identifier: GPL-3.0-or-later
"""One mixin and one handle for every long task: modal with a timer in the window, blocking in the background.

A task reads the file when it begins and writes it when it ends. Between the two nothing in the file changes, so a
cancelled run leaves it as it was, and saving meanwhile is safe. Esc, undo and loading another file end the task at
once: the core works on arrays of its own and stops within moments by itself. Only disabling the extension waits for
that.
"""

from __future__ import annotations

import logging
import traceback
from collections.abc import Callable

import bpy
from bpy.app.handlers import persistent

from . import log, native
from .bridge import session
from .errors import CharacterError, EdgeError, ScaleError, SceneError
from .pipeline import Run, Steps, run_blocking
from .speaking import AT_WORK, Speaking

#: Seconds between two looks at the work.
TICK = 0.05
CANCELLED = "Cancelled; the file is as it was."
#: How long it is said that a run was stopped, seconds.
STOPPED_NOTE_LASTS = 10.0
#: How long unregister waits for the core, seconds; it stops within some tenths.
STOP_WAIT = 10.0


class Notice:
    """What the panel says until the file changes."""

    def __init__(self) -> None:
        self.message = ""
        #: Whether it tells a failure; what somebody stopped did not fail.
        self.failed = False
        #: The refusal, where a button helps, else None.
        self.error: SceneError | None = None
        #: What the artist saw when it was said, and the refusal's words where it is of a state of the character.
        self._said_of: object = None
        self._of_character = ""

    def say(self, message: str, *, failed: bool = False, error: SceneError | None = None) -> None:
        """Shows a message until the file changes; that something was stopped goes by itself too."""
        self.message, self.failed, self.error = message, failed, error
        if error is not None:
            # It is asked for its kind and its figures; what it was raised from would keep a whole run's arrays.
            error.__traceback__ = error.__cause__ = error.__context__ = None
        # What interrupts a run may be changing the file just now: then it is looked at afterwards.
        self._said_of = session.what_is_seen(bpy.context) if failed else None
        told = str(error) if isinstance(error, CharacterError) else ""
        self._of_character = told if told and session.still_hindered(bpy.context, told) else ""
        if message and not failed and not bpy.app.background:
            bpy.app.timers.register(self._forgetting(message), first_interval=STOPPED_NOTE_LASTS)

    def forget(self) -> None:
        self.say("")

    def forget_outdated(self) -> None:
        """Takes the message away where the artist has changed something since it was said."""
        if not self.message:
            return
        seen = session.what_is_seen(bpy.context)
        if self._said_of is None:
            self._said_of = seen
        elif self._said_of != seen or (self._of_character and not self._still_hindered()):
            self.forget()
            redraw_sidebars(bpy.context)

    def _still_hindered(self) -> bool:
        return session.still_hindered(bpy.context, self._of_character)

    def _forgetting(self, message: str) -> Callable[[], None]:
        """What a timer calls later: that something was stopped is no news any more."""

        def forget() -> None:
            if self.message == message and not self.failed:
                self.forget()
                redraw_sidebars(bpy.context)

        return forget


class JobHandle(Notice):
    """The task at work, if any, and what the last one ended with: that message is the notice."""

    def __init__(self) -> None:
        super().__init__()
        self.run: Run | None = None
        self.title = ""
        #: The scene that has to be shown before what the run gave can be written; empty while none has.
        self.awaited = ""
        #: What is said where the artist stops the task.
        self.stopped_note = CANCELLED
        self._timer, self._window_manager = None, None
        #: Cancelled runs whose threads may still be at work.
        self._leaving: list[Run] = []

    def start(self, context: bpy.types.Context, title: str, run: Run, stopped_note: str = CANCELLED) -> None:
        self.forget()
        self.run, self.title = run, title
        self.stopped_note = stopped_note
        self._window_manager = context.window_manager
        self._timer = context.window_manager.event_timer_add(TICK, window=context.window)

    def end(self) -> None:
        """Lets the task go; a timer of its own is removed."""
        if self._timer is not None:
            self._window_manager.event_timer_remove(self._timer)
        self.run, self._timer, self._window_manager = None, None, None
        self.awaited = ""
        self.stopped_note = CANCELLED

    def stop(self, why: str) -> None:
        """Cancels the task and lets it go at once; its threads stop by themselves."""
        if self.run is None:
            return
        self.run.cancel()
        self._leaving = [run for run in (*self._leaving, self.run) if not run.poll()]
        self.end()
        self.say(why)

    def stop_and_wait(self, why: str) -> None:
        """Cancels the task and returns once the core has stopped."""
        self.stop(why)
        for run in self._leaving:
            run.wait(STOP_WAIT)
        self._leaving.clear()


handle = JobHandle()


class JobOperator(Speaking):
    """Mixin of a Blender operator. Its class gives `title`, `begin` and `finish`, and may `keep` what it made."""

    title = "Working"
    #: What is said where the artist stops it.
    stopped_note = CANCELLED

    def begin(self, context: bpy.types.Context) -> Steps[object]:
        """Reads the file and gives the steps of the task. Raises one of `native.expected_errors()`."""
        raise NotImplementedError

    def finish(self, context: bpy.types.Context, value: object) -> None:
        """Writes what the steps gave."""
        raise NotImplementedError

    def keep(self, _context: bpy.types.Context, _value: object) -> str:
        """Keeps what could not be written; what is said of it, as the end of a sentence. Empty where it is lost."""
        return ""

    @classmethod
    def poll(cls, _context: bpy.types.Context) -> bool:
        if handle.run is not None:
            return cls.cannot(AT_WORK)
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        """The blocking way: to the end in one go."""
        try:
            with log.bugs():
                value = run_blocking(self.begin(context))
        except Exception as error:
            return self._refused(error)
        ended = self._write(context, value)
        if ended == {"FINISHED"}:
            handle.forget()
        return ended

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        if bpy.app.background or context.window is None:
            return self.execute(context)
        if handle.run is not None:
            self.say({"WARNING"}, "Oncue is already at work.")
            return {"CANCELLED"}
        try:
            with log.bugs():
                run = Run(self.begin(context))
            run.poll()
        except Exception as error:
            return self._refused(error)
        self._scene, self._run = context.scene.session_uid, run
        handle.start(context, self.title, run, self.stopped_note)
        context.window_manager.modal_handler_add(self)
        redraw_sidebars(context)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        # Who presses Esc while the scene plays wants that to stop, and the run to go on.
        if event.type == "ESC" and event.value == "PRESS" and self._run is handle.run and not is_playing(context):
            handle.stop(self.stopped_note)
        run = self._run
        if run is not handle.run:  # ended here, or from elsewhere
            redraw_sidebars(context)
            self.say({"INFO"}, handle.message or self.stopped_note)
            return {"CANCELLED"}
        if event.type == "TIMER":
            redraw_sidebars(context)
            if run.poll() and self._may_end(context, run):
                return self._end(context, run)
        return {"PASS_THROUGH"}

    def cancel(self, _context: bpy.types.Context) -> None:
        """Blender ends the operator itself, for instance when the window closes."""
        if self._run is handle.run:
            handle.stop("The run was stopped.")

    def _may_end(self, context: bpy.types.Context, run: Run) -> bool:
        """Whether the scene that the run was begun in is shown, or nothing is to be written into it."""
        scene = session.scene_of(self._scene)
        shown = scene is None or scene == context.scene or run.failed
        handle.awaited = "" if shown else scene.name
        return shown

    def _end(self, context: bpy.types.Context, run: Run) -> set[str]:
        handle.end()
        try:
            with log.bugs():
                value = run.result()
                if session.scene_of(self._scene) is None:
                    raise SceneError("The scene was deleted meanwhile, and there is nowhere to write the result.")
            return self._write(context, value)
        except Exception as error:
            return self._refused(error)
        finally:
            redraw_sidebars(context)

    def _write(self, context: bpy.types.Context, value: object) -> set[str]:
        """Writes what the steps gave, or keeps it where that is refused: the file may have changed since they began."""
        try:
            with log.bugs():
                self.finish(context, value)
        except Exception as error:
            return self._refused(error, self.keep(context, value))
        return {"FINISHED"}

    def _refused(self, error: Exception, kept: str = "") -> set[str]:
        """Says why it ended: in one sentence, whatever it was. What is a bug is told to the console in full.

        `kept`: what it says besides of what was made.
        """
        failed = not native.is_cancelled(error)
        if not failed:
            message = self.stopped_note
        elif isinstance(error, native.expected_errors()):
            message = native.sentence(error)
        else:
            traceback.print_exception(error)
            why = native.bug_sentence(error)
            message = f"{self.title} ended by {why} The file is as it was; the console tells more."
        if kept:
            message = f"{message.rstrip('.')}; {kept}"
        helped = error if isinstance(error, CharacterError | EdgeError | ScaleError) else None
        handle.say(message, failed=failed, error=helped)
        log.logger.log(logging.ERROR if failed else logging.INFO, message)
        self.say({"ERROR" if failed else "INFO"}, message)
        return {"CANCELLED"}


class ONCUE_OT_cancel(bpy.types.Operator):
    """Stop the run; the file stays as it was (Esc)"""

    bl_idname = "oncue.cancel"
    bl_label = "Cancel"
    bl_options = {"INTERNAL"}

    @classmethod
    def poll(cls, _context: bpy.types.Context) -> bool:
        return handle.run is not None

    def execute(self, _context: bpy.types.Context) -> set[str]:
        handle.stop(handle.stopped_note)
        return {"FINISHED"}


def is_playing(context: bpy.types.Context) -> bool:
    """Whether the animation plays in any window."""
    return any(window.screen.is_animation_playing for window in context.window_manager.windows)


def redraw_sidebars(context: bpy.types.Context) -> None:
    """The sidebars only: the view itself has nothing new to show."""
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                for region in area.regions:
                    if region.type == "UI":
                        region.tag_redraw()


def redraw_views(context: bpy.types.Context) -> None:
    """The views, and the sidebars in them."""
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                area.tag_redraw()


@persistent
def _forget_outdated(*_) -> None:
    handle.forget_outdated()


@persistent
def _stop_for_load(*_) -> None:
    handle.stop("The run was stopped because another file was opened.")


@persistent
def _stop_for_undo(*_) -> None:
    handle.stop("The run was stopped because of an undo or redo.")


def register() -> None:
    bpy.utils.register_class(ONCUE_OT_cancel)
    bpy.app.handlers.load_pre.append(_stop_for_load)
    bpy.app.handlers.undo_pre.append(_stop_for_undo)
    bpy.app.handlers.redo_pre.append(_stop_for_undo)
    bpy.app.handlers.depsgraph_update_post.append(_forget_outdated)


def unregister() -> None:
    handle.stop_and_wait("The run was stopped because Oncue was disabled.")
    for handlers, ours in (
        (bpy.app.handlers.load_pre, _stop_for_load),
        (bpy.app.handlers.undo_pre, _stop_for_undo),
        (bpy.app.handlers.redo_pre, _stop_for_undo),
        (bpy.app.handlers.depsgraph_update_post, _forget_outdated),
    ):
        if ours in handlers:
            handlers.remove(ours)
    bpy.utils.unregister_class(ONCUE_OT_cancel)
