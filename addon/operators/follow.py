# SPDX-License-Identifier: GPL-3.0-or-later
"""Follow Cues: the motion follows while a cue is dragged.

A handler notes what moved; a timer, which goes on during Blender's own modal operators, plays and writes. The toggle is
no property of the file: opening another file or undoing ends the following.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import bpy
from bpy.app.handlers import persistent

from ..bridge import session
from ..bridge.live_take import LiveTake
from ..bridge.names import CUE_KEY
from ..bridge.policies import policy_cache
from ..bridge.what_counts import Furniture
from ..errors import FollowingEnded
from ..job_operator import STOP_WAIT, Notice, handle, redraw_sidebars
from ..live import Follower
from ..pipeline import Outcome, Request
from .button import Button
from .synthesize import library_cache

#: Seconds between two looks: while a motion is awaited, and else.
BUSY_TICK, IDLE_TICK = 0.005, 0.02
NEEDS_WINDOW = "Following needs Blender's window: nothing is dragged in the background"


class Following:
    """The following at work, if any: the `Host` of its follower, and what Blender tells it."""

    def __init__(self) -> None:
        self.follower: Follower | None = None
        #: Why the last one ended; empty where the artist ended it.
        self.notice = Notice()
        #: Blender renders or saves: nothing is written meanwhile.
        self.held = False
        self._scene, self._take = "", None
        self._skipped: list[tuple[str, str]] = []
        #: What our own writing moves is no news.
        self._writing = False
        self._saw_full_run = False

    @property
    def message(self) -> str:
        return self.notice.message

    @property
    def on(self) -> bool:
        return self.follower is not None

    def start(self, context: bpy.types.Context) -> None:
        """Begins in the context's scene. Raises SceneError where no take can be followed with."""
        self.stop("")
        self._take = LiveTake(context)
        self._scene, self._saw_full_run = context.scene.name, False
        self.notice.forget()
        self.follower = Follower(self, library_cache, policy_cache(context))
        if not bpy.app.background and not bpy.app.timers.is_registered(_tick):
            bpy.app.timers.register(_tick)

    def stop(self, why: str, *, keep: bool = True, wait_s: float = 0.0) -> None:
        """Ends it. `keep` completes the live take, which an undo or another file makes pointless."""
        if self.follower is None:
            return
        self.follower.stop(wait_s)
        if keep:
            self._take.keep()
        self.follower, self._take = None, None
        self.notice.say(why)
        if bpy.app.timers.is_registered(_tick):
            bpy.app.timers.unregister(_tick)

    def tick(self) -> float | None:
        """One look; the seconds to the next, or None when it is over. Raises what is a bug, and ends then too."""
        if self.follower is None:
            return None
        if self.held or bpy.app.is_job_running("RENDER"):
            return IDLE_TICK
        seen = self._shown()
        try:
            with self._context() as context:
                if context is None:
                    return IDLE_TICK
                self._tick(context)
        except FollowingEnded as ended:
            self.stop(str(ended))
        except BaseException:
            self.stop("Following ended by an error: see the console.")
            raise
        if self._shown() != seen:
            redraw_sidebars(bpy.context)
        if self.follower is None:
            return None
        return IDLE_TICK if self.follower.idle else BUSY_TICK

    def _tick(self, context: bpy.types.Context) -> None:
        if handle.run is not None:
            if not self._saw_full_run:
                self.follower.yield_to_full_run()
            self._saw_full_run = True
            return
        self._saw_full_run = False
        self.follower.tick()

    def _shown(self) -> tuple:
        follower = self.follower
        return (follower.line, follower.rested, follower.delay) if follower else ()

    @contextmanager
    def _context(self) -> Iterator[bpy.types.Context | None]:
        """The context of a window that shows the scene; None while none does. A timer has no window of its own."""
        windows = [w for w in bpy.context.window_manager.windows if w.scene.name == self._scene]
        if not windows:
            yield None
            return
        with bpy.context.temp_override(window=windows[0]):
            yield bpy.context

    # --- the follower's host ------------------------------------------------------------------------------------------

    def read_scene(self) -> Request:
        with self._unheard():
            request, self._skipped = session.read_request(bpy.context, hands=False)
        return request

    def read_task(self, request: Request) -> Request:
        return session.with_cues(bpy.context, request)

    def shows(self, request: Request) -> bool:
        return self._take.shows(request.task)

    def write(self, request: Request, outcome: Outcome, at_rest: bool) -> None:
        with self._unheard():
            self._take.write(bpy.context, request, outcome, self._skipped, at_rest)

    @contextmanager
    def _unheard(self) -> Iterator[None]:
        """What the block itself changes is no news; what moved until then is told before."""
        bpy.context.view_layer.update()
        self._writing = True
        try:
            yield
            bpy.context.view_layer.update()
        finally:
            self._writing = False

    # --- what Blender tells -------------------------------------------------------------------------------------------

    def updated(self, scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
        """Sorts what the depsgraph evaluated: a cue, the scene, or neither."""
        if self.follower is None:
            self.notice.forget_outdated()
            return
        if self._writing or scene.name != self._scene:
            return
        furniture = Furniture(bpy.context)
        for update in depsgraph.updates:
            thing = update.id
            if isinstance(thing, bpy.types.Scene | bpy.types.Collection):
                # Something was hidden, deleted, linked, or a setting changed.
                self.follower.cues_changed()
                self.follower.meshes_changed()
            elif not isinstance(thing, bpy.types.Object) or not (
                update.is_updated_transform or update.is_updated_geometry
            ):
                continue
            elif thing.get(CUE_KEY) is not None:
                self.follower.cues_changed()
            elif not furniture.is_of_person(thing.original) and (thing.type == "MESH" or thing.instance_type != "NONE"):
                self.follower.meshes_changed()


following = Following()


class ONCUE_OT_follow_cues(Button, bpy.types.Operator):
    """The motion follows while you drag a cue, in a live take of its own. Press again to end it"""

    bl_idname = "oncue.follow_cues"
    bl_label = "Follow Cues"
    bl_options = {"UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if bpy.app.background:
            return cls.cannot(NEEDS_WINDOW)
        if handle.run is not None:
            return cls.cannot(AT_WORK)
        if not following.on and session.current_report(context.scene) is None:
            return cls.cannot("There is no motion to begin with: press Synthesize first")
        return True

    def act(self, context: bpy.types.Context) -> None:
        if following.on:
            following.stop("")
        else:
            following.start(context)
        redraw_sidebars(context)


def _tick() -> float | None:
    return following.tick()


@persistent
def _updated(scene, depsgraph) -> None:
    following.updated(scene, depsgraph)


@persistent
def _stop_for_load(*_) -> None:
    following.stop("", keep=False)


@persistent
def _stop_for_undo(*_) -> None:
    following.stop("Following ended with the undo: press Follow Cues to go on.", keep=False)


@persistent
def _hold(*_) -> None:
    following.held = True


@persistent
def _release(*_) -> None:
    following.held = False


HANDLERS = (
    ("depsgraph_update_post", _updated),
    *(("load_pre", _stop_for_load), ("load_post", _release)),
    *(("undo_pre", _stop_for_undo), ("redo_pre", _stop_for_undo)),
    *(("render_init", _hold), ("render_complete", _release), ("render_cancel", _release)),
    *(("save_pre", _hold), ("save_post", _release), ("save_post_fail", _release)),
)


def register() -> None:
    bpy.utils.register_class(ONCUE_OT_follow_cues)
    for name, ours in HANDLERS:
        getattr(bpy.app.handlers, name).append(ours)


def unregister() -> None:
    following.stop("", wait_s=STOP_WAIT)
    for name, ours in HANDLERS:
        handlers = getattr(bpy.app.handlers, name)
        if ours in handlers:
            handlers.remove(ours)
    bpy.utils.unregister_class(ONCUE_OT_follow_cues)
