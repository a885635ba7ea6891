# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes in edit mode, as they will be once it is left."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import bpy

from .what_counts import things_of


@contextmanager
def modifiers_as_outside(context: bpy.types.Context) -> Iterator[None]:
    """Within the block edit mode leaves no modifier out that object mode shows. Nothing is changed afterwards."""
    hidden = [
        modifier
        for thing in things_of(context.view_layer)
        if thing.type == "MESH" and thing.data.is_editmode
        for modifier in thing.modifiers
        if modifier.show_viewport and not modifier.show_in_editmode
    ]
    try:
        for modifier in hidden:
            modifier.show_in_editmode = True
        yield
    finally:
        for modifier in hidden:
            modifier.show_in_editmode = False
        if hidden:
            context.view_layer.update()
