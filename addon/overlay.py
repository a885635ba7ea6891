# SPDX-License-Identifier: GPL-3.0-or-later
"""What is drawn over the view at each cue: footprints, the facing, and a seated figure at a sit cue."""

from __future__ import annotations

import math

import bpy
import gpu
from gpu_extras.batch import batch_for_shader
from mathutils import Matrix, Vector

from . import preferences
from .bridge.cue_objects import KINDS
from .bridge.cue_reader import ENDS, FEET, visible_cues
from .bridge.names import CUE_KEY

Lines = list[tuple[Vector, Vector]]
LINE_WIDTH = 2.0


def footprint(x: float, y: float, length: float = 0.26) -> Lines:
    """The outline of a sole on z = 0, toes towards -Y, the ankle at (x, y)."""
    half = [(0.030, 0.055), (0.036, 0.02), (0.034, -0.05), (0.047, -0.12), (0.044, -0.17), (0.022, -0.20)]
    scale = length / 0.26
    right = [Vector((x + w * scale, y + d * scale, 0.005)) for w, d in half]
    left = [Vector((x - w * scale, y + d * scale, 0.005)) for w, d in reversed(half)]
    outline = right + left
    return list(zip(outline, outline[1:] + outline[:1], strict=True))


def arrow(start: float, length: float, z: float = 0.005) -> Lines:
    """An arrow along -Y on the plane z."""
    tip = Vector((0.0, -start - length, z))
    return [
        (Vector((0.0, -start, z)), tip),
        (tip, tip + Vector((0.06, 0.08, 0.0))),
        (tip, tip + Vector((-0.06, 0.08, 0.0))),
    ]


def standing() -> Lines:
    return footprint(0.10, 0.0) + footprint(-0.10, 0.0) + arrow(0.30, 0.35)


def seated(floor: float) -> Lines:
    """A stick figure whose pelvis is the origin; its feet stand at z = `floor`."""
    lines: Lines = [(Vector((0, 0, 0)), Vector((0, 0.03, 0.50))), (Vector((0, 0.03, 0.50)), Vector((0, 0.0, 0.58)))]
    for side in (1, -1):
        hip, knee = Vector((0.095 * side, 0, -0.02)), Vector((0.11 * side, -0.44, -0.02))
        ankle = Vector((0.11 * side, -0.42, min(floor + 0.085, -0.1)))
        shoulder = Vector((0.17 * side, 0.03, 0.48))
        elbow, hand = Vector((0.20 * side, -0.02, 0.21)), Vector((0.14 * side, -0.24, 0.08))
        lines += [(Vector((0, 0, 0)), hip), (hip, knee), (knee, ankle)]
        lines += [(Vector((0, 0.03, 0.48)), shoulder), (shoulder, elbow), (elbow, hand)]
        lines += [(a + Vector((0, 0, floor)), b + Vector((0, 0, floor))) for a, b in footprint(0.11 * side, -0.42)]
    ring = [
        Vector((0.085 * math.cos(t), -0.005, 0.68 + 0.11 * math.sin(t))) for t in (k * math.tau / 20 for k in range(20))
    ]
    lines += list(zip(ring, ring[1:] + ring[:1], strict=True))
    return lines + arrow(0.70, 0.25, floor + 0.005)


def cue_lines(context: bpy.types.Context, cue: bpy.types.Object) -> Lines:
    """What to draw for a cue, world space."""
    unit = 1.0 / context.scene.oncue.scene_scale
    place, turn, _ = cue.matrix_world.decompose()
    to_world = Matrix.Translation(place) @ turn.to_matrix().to_4x4() @ Matrix.Scale(unit, 4)
    kind = cue[CUE_KEY]
    if kind in FEET:
        lines = footprint(0.0, 0.0)
    elif kind == "sit":
        starts = visible_cues(context, "start")
        floor = (starts[0].matrix_world.translation.z - place.z) / unit if starts else -0.55
        lines = seated(floor if -1.2 < floor < -0.15 else -0.55)
    else:
        lines = standing()
    return [(to_world @ a, to_world @ b) for a, b in lines]


def _draw() -> None:
    context = bpy.context
    scene = context.scene
    if not scene or not hasattr(scene, "oncue") or not scene.oncue.show_cues:
        return
    if context.space_data and not context.space_data.overlay.show_overlays:
        return
    known = preferences.get(context)
    shader = gpu.shader.from_builtin("POLYLINE_UNIFORM_COLOR")
    gpu.state.blend_set("ALPHA")
    gpu.state.depth_test_set("NONE")
    shader.bind()
    shader.uniform_float("viewportSize", gpu.state.viewport_get()[2:])
    shader.uniform_float("lineWidth", LINE_WIDTH * context.preferences.system.ui_scale)
    for cue in visible_cues(context, "start", *ENDS, *FEET):
        kind = cue[CUE_KEY]
        color = tuple(known.ghost_color) if known and kind == "sit" else KINDS[kind][3]
        points = [tuple(point) for line in cue_lines(context, cue) for point in line]
        shader.uniform_float("color", color)
        batch_for_shader(shader, "LINES", {"pos": points}).draw(shader)
    gpu.state.blend_set("NONE")


_handles: list = []


def register() -> None:
    if not bpy.app.background:
        _handles.append(bpy.types.SpaceView3D.draw_handler_add(_draw, (), "WINDOW", "POST_VIEW"))


def unregister() -> None:
    while _handles:
        bpy.types.SpaceView3D.draw_handler_remove(_handles.pop(), "WINDOW")
