# SPDX-License-Identifier: GPL-3.0-or-later
"""Show Ways: the ways that people would walk are drawn in the view, and follow the cues.

A handler notes what moved, a timer has the ways found. The toggle is no property of the file: opening another file ends
it.
"""

from __future__ import annotations

import bpy
from bpy.app.handlers import persistent

from ..bridge.names import CUE_KEY
from ..bridge.ways_reader import read_ways
from ..bridge.what_counts import Furniture
from ..job_operator import handle, redraw_views
from ..pipeline import Request
from ..ways import Finder, Way
from .button import Button

#: Seconds between two looks: while ways are awaited, and else.
BUSY_TICK, IDLE_TICK = 0.02, 0.1


class Showing:
    """The ways that are shown, if any: the `Host` of their finder, and what Blender tells it."""

    def __init__(self) -> None:
        self.finder: Finder | None = None
        self._scene = ""

    @property
    def on(self) -> bool:
        return self.finder is not None

    def ways(self, scene: bpy.types.Scene) -> list[Way]:
        """What is drawn in a scene."""
        return self.finder.ways if self.finder is not None and scene.name == self._scene else []

    def said(self, scene: bpy.types.Scene) -> list[str]:
        """Why ways would fail, in a scene."""
        return self.finder.said if self.finder is not None and scene.name == self._scene else []

    def start(self, context: bpy.types.Context) -> None:
        self.stop()
        self.finder, self._scene = Finder(self), context.scene.name
        if not bpy.app.background and not bpy.app.timers.is_registered(_tick):
            bpy.app.timers.register(_tick)

    def stop(self) -> None:
        if self.finder is not None:
            self.finder.stop()
            self.finder = None
        if bpy.app.timers.is_registered(_tick):
            bpy.app.timers.unregister(_tick)

    def tick(self) -> float | None:
        """One look; the seconds to the next, or None when it is over. Raises what is a bug, and ends then too."""
        if self.finder is None:
            return None
        # A run has the cores for itself, and nothing is read while Blender renders.
        if handle.run is not None or bpy.app.is_job_running("RENDER") or bpy.context.scene.name != self._scene:
            return IDLE_TICK
        try:
            if self.finder.tick():
                redraw_views(bpy.context)
        except BaseException:
            self.stop()
            raise
        return IDLE_TICK if self.finder.idle else BUSY_TICK

    def read(self, before: list[Request] | None) -> list[Request]:
        return read_ways(bpy.context, before)

    def updated(self, scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
        """Sorts what the depsgraph evaluated: a cue, the scene, or neither."""
        if self.finder is None or scene.name != self._scene:
            return
        screen = bpy.context.screen
        if screen is not None and screen.is_animation_playing:
            return
        furniture = Furniture(bpy.context)
        for update in depsgraph.updates:
            thing = update.id
            if isinstance(thing, bpy.types.Scene | bpy.types.Collection):
                # Something was hidden, deleted, linked, or a setting changed.
                self.finder.cues_changed()
                self.finder.meshes_changed()
            elif not isinstance(thing, bpy.types.Object) or not (
                update.is_updated_transform or update.is_updated_geometry
            ):
                continue
            elif thing.get(CUE_KEY) is not None:
                self.finder.cues_changed()
            elif not furniture.is_of_person(thing.original) and (thing.type == "MESH" or thing.instance_type != "NONE"):
                self.finder.meshes_changed()


showing = Showing()


class ONCUE_OT_show_ways(Button, bpy.types.Operator):
    """Draw the ways that people would walk from cue to cue, and where one would fail. Press again to end it"""

    bl_idname = "oncue.show_ways"
    bl_label = "Show Ways"
    bl_options = {"REGISTER"}

    def act(self, context: bpy.types.Context) -> None:
        if showing.on:
            showing.stop()
        else:
            showing.start(context)
        redraw_views(context)


def _tick() -> float | None:
    return showing.tick()


@persistent
def _updated(scene, depsgraph) -> None:
    showing.updated(scene, depsgraph)


@persistent
def _stop(*_) -> None:
    showing.stop()


HANDLERS = (("depsgraph_update_post", _updated), ("load_pre", _stop))


def register() -> None:
    bpy.utils.register_class(ONCUE_OT_show_ways)
    for name, ours in HANDLERS:
        getattr(bpy.app.handlers, name).append(ours)


def unregister() -> None:
    showing.stop()
    for name, ours in HANDLERS:
        handlers = getattr(bpy.app.handlers, name)
        if ours in handlers:
            handlers.remove(ours)
    bpy.utils.unregister_class(ONCUE_OT_show_ways)
