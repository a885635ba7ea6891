# SPDX-License-Identifier: GPL-3.0-or-later
"""A motion manifold of the artist's own: trained on the library that the panel lists."""

from __future__ import annotations

from pathlib import Path

import bpy
from bpy.props import StringProperty

from ..bridge import session
from ..files import check_writable
from ..job_operator import JobOperator
from ..native import core
from ..pipeline import MANIFOLD_SUFFIX, Steps, manifold_steps
from .synthesize import library_cache

#: Held-out clips come back within this where a manifold has learnt its library, centimetres.
LEARNT = 2.0


class ONCUE_OT_train_manifold(JobOperator, bpy.types.Operator):
    """Train a motion manifold on the library, in minutes. Esc stops it, and the next time it goes on from there"""

    bl_idname = "oncue.train_manifold"
    bl_label = "Train Manifold"
    title = "Training the manifold"
    stopped_note = "Stopped; train to the same file again, and it goes on after the last whole pass."

    filepath: StringProperty(description="The manifold's file to write", subtype="FILE_PATH", options={"SKIP_SAVE"})
    filter_glob: StringProperty(default=f"*{MANIFOLD_SUFFIX}", options={"HIDDEN"})

    def invoke(self, context: bpy.types.Context, event) -> set[str]:
        if self.filepath:
            return super().invoke(context, event)
        self.filepath = context.scene.oncue.manifold or f"own{MANIFOLD_SUFFIX}"
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def begin(self, context: bpy.types.Context) -> Steps[core.Manifold]:
        self._path = str(Path(bpy.path.abspath(self.filepath)).resolve().with_suffix(MANIFOLD_SUFFIX))
        check_writable(Path(self._path))
        choice, passes = session.library_choice(context.scene), context.scene.oncue.manifold_passes
        return manifold_steps(choice, library_cache, passes, self._path)

    def finish(self, context: bpy.types.Context, value: core.Manifold) -> None:
        context.scene.oncue.manifold = self._path
        errors = value.figures["test"]
        line = (
            f"{Path(self._path).name} gives held-out clips back within {errors['joint_error_cm']:.1f} cm "
            f"and {errors['rotation_error_degrees']:.1f}°"
        )
        if errors["joint_error_cm"] > LEARNT:
            self.say({"WARNING"}, f"{line}: more captures or more passes would hold edits nearer to your motion.")
        else:
            self.say({"INFO"}, f"{line}.")


register, unregister = bpy.utils.register_classes_factory((ONCUE_OT_train_manifold,))
