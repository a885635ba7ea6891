# SPDX-License-Identifier: GPL-3.0-or-later
"""Sentences in the language of the interface: turned into it where they are shown, and English everywhere before.

Reports, the log and what `batch.py` says are the same for everybody. A sentence that holds names and numbers is found
by its template, in which `{}` stands for each of them; a language has them in its file, where `{0}` and `{1}` change
their order.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Callable, Iterable

#: A value that is shorter is a name or a number, and no sentence of its own.
SHORTEST_INNER = 24


class Speaker:
    """Turns what is said into another language."""

    def __init__(self) -> None:
        self._templates: tuple[tuple[str, re.Pattern[str]], ...] = ()
        self._translate: Callable[[str], str] = lambda text: text
        self._match = functools.lru_cache(maxsize=512)(self._find)

    def learn(self, english: Iterable[str], translate: Callable[[str], str]) -> None:
        """From now on says what `translate` makes of the sentences and templates `english`."""
        templates = [text for text in english if "{}" in text]
        # The one that says most itself goes first: a sentence fits those that say less, too.
        templates.sort(key=lambda text: (-len(text.replace("{}", "")), text))
        self._templates = tuple((text, _pattern(text)) for text in templates)
        self._translate = translate
        self._match.cache_clear()

    def forget(self) -> None:
        self.learn((), lambda text: text)

    def told(self, sentence: str) -> str:
        """The sentence in the language of the interface, or as it is where that has no words for it."""
        said = self._translate(sentence)
        if said != sentence or not self._templates:
            return said
        found = self._match(sentence)
        if found is None:
            return sentence
        template, values = found
        said = self._translate(template)
        return sentence if said == template else said.format(*map(self._inner, values))

    def _inner(self, value: str) -> str:
        """A value that may be a sentence itself, with its full stop or without."""
        if len(value) < SHORTEST_INNER:
            return value
        said = self.told(value)
        if said == value and not value.endswith("."):
            said = self.told(f"{value}.").removesuffix(".")
        return said

    def _find(self, sentence: str) -> tuple[str, tuple[str, ...]] | None:
        for template, pattern in self._templates:
            if match := pattern.fullmatch(sentence):
                return template, match.groups()
        return None


def _pattern(template: str) -> re.Pattern[str]:
    return re.compile("(.+?)".join(map(re.escape, template.split("{}"))), re.DOTALL)


speaker = Speaker()
told = speaker.told
