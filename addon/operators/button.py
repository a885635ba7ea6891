# SPDX-License-Identifier: GPL-3.0-or-later
"""One mixin for every button that changes the file at once."""

from __future__ import annotations

import traceback

import bpy

from .. import native
from ..speaking import Speaking


class Button(Speaking):
    """Mixin of an operator that is one undo step. Its class gives `act`; what that refuses is shown as a sentence."""

    bl_options = {"REGISTER", "UNDO"}

    def act(self, context: bpy.types.Context) -> None:
        """Changes the file. Raises SceneError, before anything was changed."""
        raise NotImplementedError

    def execute(self, context: bpy.types.Context) -> set[str]:
        try:
            self.act(context)
        except native.expected_errors() as error:
            self.say({"ERROR"}, native.sentence(error))
            return {"CANCELLED"}
        except Exception as error:
            traceback.print_exception(error)
            self.say({"ERROR"}, f"{self.bl_label} ended by {native.bug_sentence(error)} The console tells more.")
            return {"CANCELLED"}
        return {"FINISHED"}
