# SPDX-License-Identifier: GPL-3.0-or-later
"""What is drawn over the view: footprints, facing, a seated figure, hands, numbers and frames at the cues, the ways
that people would walk, and a mark at each pin.
"""

from __future__ import annotations

import math
from itertools import pairwise

import blf
import bpy
import gpu
from bpy_extras.view3d_utils import location_3d_to_region_2d
from gpu_extras.batch import batch_for_shader
from mathutils import Matrix, Vector

from .bridge import user_preferences
from .bridge.cue_objects import KINDS
from .bridge.names import AT_FRAME_KEY, CUE_KEY, HAND_KEY
from .bridge.pins import read_pins
from .bridge.session import current_action
from .bridge.shown_cues import FEET, HANDS, LOOK, PASS, PUT, TAKE, ordered_cues, several_starts, visible_cues
from .operators.ways import showing

Lines = list[tuple[Vector, Vector]]
LINE_WIDTH = 2.0
PIN_COLOR = (1.0, 0.85, 0.2, 1.0)
#: Blender's own font; how high a cue's number is in it, and how far aside of the cue, pixels.
FONT, NUMBER_SIZE, NUMBER_ASIDE = 0, 16, 8
#: Ways are drawn so far over the floor, metres, in a colour for each person in turn, and where one would fail in this.
OVER_FLOOR = 0.02
WAY_COLORS = ((0.35, 0.75, 1.0, 0.9), (1.0, 0.65, 0.25, 0.9), (0.65, 0.95, 0.4, 0.9), (0.9, 0.55, 0.95, 0.9))
FAILS_COLOR, FAILS_SIZE = (1.0, 0.2, 0.15, 1.0), 0.15
#: A waypoint is met within so many metres.
PASSED = 0.15
#: Sides of the body: the left lies at +X of who faces -Y.
LEFT, RIGHT = 1, -1
#: The left sole from above, metres from the ankle, its big toe towards -X.
SOLE = (
    *((0.010, 0.058), (0.034, 0.030), (0.036, -0.050), (0.050, -0.120), (0.046, -0.160), (0.022, -0.190)),
    *((-0.016, -0.208), (-0.038, -0.195), (-0.044, -0.135), (-0.024, -0.050), (-0.030, 0.030)),
)
#: The left hand upright from before, metres from the wrist: across towards +X, and up; its thumb towards -X.
PALM = (
    *((0.025, 0.0), (0.042, 0.09), (0.052, 0.15), (0.040, 0.152), (0.026, 0.10), (0.028, 0.175), (0.014, 0.177)),
    *((0.010, 0.105), (0.006, 0.185), (-0.008, 0.184), (-0.007, 0.105), (-0.018, 0.168), (-0.031, 0.164)),
    *((-0.026, 0.092), (-0.036, 0.070), (-0.066, 0.100), (-0.074, 0.090), (-0.048, 0.038), (-0.025, 0.0)),
)


def closed(points: list[Vector]) -> Lines:
    return list(zip(points, points[1:] + points[:1], strict=True))


def footprint(x: float, y: float, side: int) -> Lines:
    """The outline of a sole on z = 0, toes towards -Y, the ankle at (x, y)."""
    return closed([Vector((x + side * across, y + along, 0.005)) for across, along in SOLE])


def hand(x: float, side: int) -> Lines:
    """The outline of an open hand over the wrist at (x, 0, 0), its palm towards -Y."""
    return closed([Vector((x + side * across, 0.0, up)) for across, up in PALM])


def diamond(size: float = 0.03) -> Lines:
    """A mark around the origin."""
    ring = [Vector((size, 0, 0)), Vector((0, size, 0)), Vector((-size, 0, 0)), Vector((0, -size, 0))]
    ends = (Vector((0, 0, size)), Vector((0, 0, -size)))
    return closed(ring) + [(corner, end) for corner in ring for end in ends]


def arrow(start: float, length: float, z: float = 0.005) -> Lines:
    """An arrow along -Y on the plane z."""
    tip = Vector((0.0, -start - length, z))
    return [
        (Vector((0.0, -start, z)), tip),
        (tip, tip + Vector((0.06, 0.08, 0.0))),
        (tip, tip + Vector((-0.06, 0.08, 0.0))),
    ]


def passed() -> Lines:
    """A ring as wide as a waypoint is met, and a foot that leaves it behind."""
    around = [k * math.tau / 24 for k in range(24)]
    ring = [Vector((PASSED * math.cos(t), PASSED * math.sin(t), 0.005)) for t in around]
    return closed(ring) + footprint(0.0, 0.08, LEFT)


def standing() -> Lines:
    return footprint(0.10, 0.0, LEFT) + footprint(-0.10, 0.0, RIGHT) + arrow(0.30, 0.35)


def seated(floor: float) -> Lines:
    """A stick figure whose pelvis is the origin; its feet stand at z = `floor`."""
    lines: Lines = [(Vector((0, 0, 0)), Vector((0, 0.03, 0.50))), (Vector((0, 0.03, 0.50)), Vector((0, 0.0, 0.58)))]
    for side in (LEFT, RIGHT):
        hip, knee = Vector((0.095 * side, 0, -0.02)), Vector((0.11 * side, -0.44, -0.02))
        ankle = Vector((0.11 * side, -0.42, min(floor + 0.085, -0.1)))
        shoulder = Vector((0.17 * side, 0.03, 0.48))
        elbow, hand = Vector((0.20 * side, -0.02, 0.21)), Vector((0.14 * side, -0.24, 0.08))
        lines += [(Vector((0, 0, 0)), hip), (hip, knee), (knee, ankle)]
        lines += [(Vector((0, 0.03, 0.48)), shoulder), (shoulder, elbow), (elbow, hand)]
        sole = footprint(0.11 * side, -0.42, side)
        lines += [(a + Vector((0, 0, floor)), b + Vector((0, 0, floor))) for a, b in sole]
    around = [k * math.tau / 20 for k in range(20)]
    lines += closed([Vector((0.085 * math.cos(t), -0.005, 0.68 + 0.11 * math.sin(t))) for t in around])
    return lines + arrow(0.70, 0.25, floor + 0.005)


def cue_lines(context: bpy.types.Context, cue: bpy.types.Object) -> Lines:
    """What to draw for a cue, world space."""
    unit = 1.0 / context.scene.oncue.scene_scale
    place, turn, _ = cue.matrix_world.decompose()
    to_world = Matrix.Translation(place) @ turn.to_matrix().to_4x4() @ Matrix.Scale(unit, 4)
    kind = cue[CUE_KEY]
    if kind in FEET:
        lines = footprint(0.0, 0.0, LEFT if kind == "left_foot" else RIGHT)
    elif kind == "both_hands":
        lines = hand(0.08, LEFT) + hand(-0.08, RIGHT)
    elif kind in HANDS:
        lines = hand(0.0, LEFT if kind == "left_hand" else RIGHT)
    elif kind == "sit":
        starts = visible_cues(context, "start")
        floor = (starts[0].matrix_world.translation.z - place.z) / unit if starts else -0.55
        lines = seated(floor if -1.2 < floor < -0.15 else -0.55)
    elif kind == PASS:
        lines = passed()
    elif kind == TAKE:
        lines = {"left": hand(0.0, LEFT), "right": hand(0.0, RIGHT)}.get(
            cue.get(HAND_KEY), hand(0.08, LEFT) + hand(-0.08, RIGHT)
        )
    elif kind == PUT:
        lines = diamond(0.05) + arrow(0.05, 0.12)
    elif kind == LOOK:
        lines = diamond(0.06)
    else:
        lines = standing()
    return [(to_world @ a, to_world @ b) for a, b in lines]


def pin_lines(context: bpy.types.Context) -> Lines:
    """What to draw for the character's pins, world space."""
    places = [Vector(pin.position) for pin in read_pins(current_action(context.scene)) if pin.position]
    unit = 1.0 / context.scene.oncue.scene_scale
    mark = [(a * unit, b * unit) for a, b in diamond()]
    return [(place + a, place + b) for place in places for a, b in mark]


def way_lines(context: bpy.types.Context) -> list[tuple[tuple, Lines]]:
    """What to draw for the ways that are shown: colours and lines, world space."""
    unit = 1.0 / context.scene.oncue.scene_scale
    drawn: list[tuple[tuple, Lines]] = []
    for way in showing.ways(context.scene):
        color = WAY_COLORS[way.person % len(WAY_COLORS)] if way.fails_at is None else FAILS_COLOR
        points = [(Vector(point) + Vector((0.0, 0.0, OVER_FLOOR))) * unit for point in way.path]
        drawn.append((color, list(pairwise(points))))
        if way.fails_at is not None:
            place = (Vector(way.fails_at) + Vector((0.0, 0.0, OVER_FLOOR))) * unit
            across = [Vector((FAILS_SIZE * unit, side * FAILS_SIZE * unit, 0.0)) for side in (1, -1)]
            drawn.append((FAILS_COLOR, [(place - arm, place + arm) for arm in across]))
    return drawn


def numbers(context: bpy.types.Context) -> list[tuple[str, Vector, tuple]]:
    """What stands beside cues: of several the place in the order, and the frame on which one is asked for; where, world
    space, and the cue's colour."""
    found = []
    for played in (ordered_cues(context, start) for start in several_starts(context) or [None]):
        for number, cue in enumerate(played, 1):
            asked = cue.get(AT_FRAME_KEY)
            words = [str(number)] if len(played) > 1 else []
            words += [f"@ {asked:g}"] if isinstance(asked, int | float) else []
            if words and cue.visible_get():
                found.append(("  ".join(words), cue.matrix_world.translation, KINDS[cue[CUE_KEY]][3]))
    return found


def _is_shown(context: bpy.types.Context) -> bool:
    scene = context.scene
    if not scene or not hasattr(scene, "oncue") or not scene.oncue.show_cues:
        return False
    return not context.space_data or context.space_data.overlay.show_overlays


def _write() -> None:
    context = bpy.context
    if not _is_shown(context) or context.region_data is None:
        return
    scale = context.preferences.system.ui_scale
    blf.size(FONT, NUMBER_SIZE * scale)
    for text, place, color in numbers(context):
        at = location_3d_to_region_2d(context.region, context.region_data, place)
        if at is not None:
            blf.color(FONT, *color)
            blf.position(FONT, at.x + NUMBER_ASIDE * scale, at.y + NUMBER_ASIDE * scale, 0.0)
            blf.draw(FONT, text)


def _draw() -> None:
    context = bpy.context
    if not _is_shown(context):
        return
    known = user_preferences.get(context)
    shader = gpu.shader.from_builtin("POLYLINE_UNIFORM_COLOR")
    gpu.state.blend_set("ALPHA")
    gpu.state.depth_test_set("NONE")
    shader.bind()
    shader.uniform_float("viewportSize", gpu.state.viewport_get()[2:])
    shader.uniform_float("lineWidth", LINE_WIDTH * context.preferences.system.ui_scale)
    drawn = [(PIN_COLOR, pin_lines(context)), *way_lines(context)]
    # Of those that count, this view may hide some.
    for cue in (cue for cue in visible_cues(context, *KINDS) if cue.visible_get()):
        kind = cue[CUE_KEY]
        color = tuple(known.ghost_color) if known and kind == "sit" else KINDS[kind][3]
        drawn.append((color, cue_lines(context, cue)))
    for color, lines in drawn:
        if lines:
            points = [tuple(point) for line in lines for point in line]
            shader.uniform_float("color", color)
            batch_for_shader(shader, "LINES", {"pos": points}).draw(shader)
    gpu.state.blend_set("NONE")


_handles: list = []


def register() -> None:
    if not bpy.app.background:
        for draw, when in ((_draw, "POST_VIEW"), (_write, "POST_PIXEL")):
            _handles.append(bpy.types.SpaceView3D.draw_handler_add(draw, (), "WINDOW", when))


def unregister() -> None:
    while _handles:
        bpy.types.SpaceView3D.draw_handler_remove(_handles.pop(), "WINDOW")
