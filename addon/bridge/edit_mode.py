# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes in edit mode and in sculpt mode, as they will be once it is left."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import bpy

from .what_counts import things_of


@contextmanager
def copies_outside(context: bpy.types.Context) -> Iterator[dict[bpy.types.Object, bpy.types.Object]]:
    """While the block runs, each object whose modifiers its mode does not show has a copy outside of it beside it.

    Gives copy → object. Some modifiers never show in edit mode, and nothing says which. The edited mesh itself needs no
    copy: `to_mesh` gives it.
    """
    copies: dict[bpy.types.Object, bpy.types.Object] = {}
    meshes: dict[bpy.types.Mesh, bpy.types.Mesh] = {}
    try:
        for thing in things_of(context.view_layer):
            if thing.type != "MESH" or not _is_simplified(thing):
                continue
            if thing.data not in meshes:
                if thing.data.is_editmode:
                    thing.update_from_editmode()
                else:  # what was sculpted is kept beside the mesh until then
                    bpy.ops.ed.flush_edits()
                meshes[thing.data] = thing.data.copy()
            copy = thing.copy()
            copies[copy] = thing
            copy.data = meshes[thing.data]
            context.scene.collection.objects.link(copy)
        if copies:
            context.view_layer.update()
        yield copies
    finally:
        for copy in copies:
            bpy.data.objects.remove(copy)
        for mesh in meshes.values():
            bpy.data.meshes.remove(mesh)
        if copies:
            context.view_layer.update()


def _is_simplified(thing: bpy.types.Object) -> bool:
    """Whether its mode shows another mesh than what comes of it afterwards."""
    shown = [modifier for modifier in thing.modifiers if modifier.show_viewport]
    if thing.mode == "SCULPT":
        return bool(shown) or thing.use_dynamic_topology_sculpting
    return thing.data.is_editmode and any(not modifier.show_in_editmode for modifier in shown)
