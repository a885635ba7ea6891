# SPDX-License-Identifier: GPL-3.0-or-later
"""What Oncue's buttons, settings and tooltips say, in the languages that there is a file of in `languages/`.

A file is named by its language (`de.json`) and maps what is said in English to what is said in it: words, sentences,
and templates of sentences (`sentences.py`). What is left out stays English, as what the core says of a scene and a
motion does.
"""

from __future__ import annotations

import json
from pathlib import Path

import bpy

from .sentences import speaker

FOLDER = Path(__file__).with_name("languages")
#: Blender looks the label of an operator up in a context of its own, and all else in that of no context.
CONTEXTS = ("*", "Operator")


def messages() -> dict[str, dict[tuple[str, str], str]]:
    """Language → (context, what is said in English) → what is said in it."""
    catalogues = {file.stem: json.loads(file.read_text(encoding="utf-8")) for file in sorted(FOLDER.glob("*.json"))}
    return {
        language: {(context, english): said for english, said in catalogue.items() for context in CONTEXTS}
        for language, catalogue in catalogues.items()
    }


def register() -> None:
    known = messages()
    bpy.app.translations.register(__package__, known)
    english = {text for catalogue in known.values() for _, text in catalogue}
    speaker.learn(english, bpy.app.translations.pgettext_iface)


def unregister() -> None:
    speaker.forget()
    bpy.app.translations.unregister(__package__)
