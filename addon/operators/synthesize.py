# SPDX-License-Identifier: GPL-3.0-or-later
"""Synthesize: the main job."""

from __future__ import annotations

import bpy

from ..bridge import session
from ..bridge.policies import policy_cache
from ..job_operator import JobOperator
from ..pipeline import LibraryCache, Outcome, Steps, synthesis_steps

#: The library stays in memory between presses.
library_cache = LibraryCache()


class ONCUE_OT_synthesize(JobOperator, bpy.types.Operator):
    """Make a person walk from the Start cue to the Sit or Stop cue, as a new action. Esc cancels"""

    bl_idname = "oncue.synthesize"
    bl_label = "Synthesize"
    bl_options = {"REGISTER", "UNDO"}
    title = "Synthesizing"

    def begin(self, context: bpy.types.Context) -> Steps[Outcome]:
        self._request, self._skipped = session.read_request(context)
        return synthesis_steps(self._request, library_cache, policy_cache(context))

    def finish(self, context: bpy.types.Context, value: Outcome) -> None:
        action = session.write_outcome(context, self._request, value, self._skipped)
        problems = session.problems_of(session.report_of(action))
        for problem in problems:
            self.report({"WARNING"}, problem)
        if not problems:
            self.report({"INFO"}, f"Oncue made the action {action.name}.")


register, unregister = bpy.utils.register_classes_factory((ONCUE_OT_synthesize,))
