# SPDX-License-Identifier: GPL-3.0-or-later
"""One mixin for every operator that tells something: in the language of the interface."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .sentences import told

AT_WORK = "Oncue is at work: wait for it, or press Esc to cancel"


class Speaking:
    """Mixin of an operator."""

    if TYPE_CHECKING:  # Blender's own

        def report(self, kind: set[str], sentence: str) -> None: ...
        @classmethod
        def poll_message_set(cls, why: str) -> None: ...

    def say(self, kind: set[str], sentence: str) -> None:
        """Reports a sentence."""
        self.report(kind, told(sentence))

    @classmethod
    def cannot(cls, why: str) -> bool:
        """What a poll gives where the button cannot be pressed, and its tooltip says."""
        cls.poll_message_set(told(why))
        return False
