# SPDX-License-Identifier: GPL-3.0-or-later
"""The mannequin's surface as arrays: lofted body parts over the rest pose, with their bones' weights.

A jointed figure of a person of 1.8 m: every limb is rigid on its bone and meets the next in a darker ball,
the trunk bends softly. Metres, armature space: T-pose, facing -Y, left hand at +X.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

BODY, JOINT = 0, 1
#: Corners of one loft ring.
SEGMENTS = 20
#: Rings that a loft gets between its first and last section.
RINGS = 14

#: Vertices (n, 3), and faces as indices of them.
Skin: TypeAlias = tuple[np.ndarray, list[tuple[int, ...]]]
#: A loft's section: center, half width, half depth.
Section: TypeAlias = tuple[ArrayLike, float, float]
#: A bone's name, or a vertex's {bone: weight}.
Bone: TypeAlias = str | Callable[[np.ndarray], dict[str, float]]
#: Rest places by joint.
Places: TypeAlias = dict[str, np.ndarray]


@dataclass
class Surface:
    """A mesh under construction; faces have three or four corners."""

    vertices: list[np.ndarray] = field(default_factory=list)
    faces: list[tuple[int, ...]] = field(default_factory=list)
    materials: list[int] = field(default_factory=list)
    #: Bone → (vertex indices, weights).
    weights: dict[str, tuple[list[int], list[float]]] = field(default_factory=dict)

    def add(self, vertices: np.ndarray, faces: list[tuple[int, ...]], material: int, bone: Bone) -> None:
        """Appends a part."""
        base = sum(len(v) for v in self.vertices)
        self.vertices.append(vertices)
        self.faces += [tuple(base + corner for corner in face) for face in faces]
        self.materials += [material] * len(faces)
        for index, vertex in enumerate(vertices):
            shares = {bone: 1.0} if isinstance(bone, str) else bone(vertex)
            for name, weight in shares.items():
                indices, values = self.weights.setdefault(name, ([], []))
                indices.append(base + index)
                values.append(weight)


def mannequin(names: list[str], positions: np.ndarray) -> Surface:
    """The whole body over the rest `positions` (joints, 3) of the joints `names`."""
    at = dict(zip(names, positions, strict=True))
    surface = Surface()
    _trunk(surface, at)
    _head(surface, at)
    for side, sign in (("Left", 1.0), ("Right", -1.0)):
        _arm(surface, at, side, sign)
        _hand(surface, at, side, sign)
        _leg(surface, at, side)
        _foot(surface, at, side)
    return surface


# --- parts -----------------------------------------------------------------------------------------------------------


def _trunk(surface: Surface, at: Places) -> None:
    hips, spine2, neck = at["Hips"], at["Spine2"], at["Neck"]
    y = spine2[1]
    # Height, half width, half depth, depth's middle; widths after the 50th percentile of adult men and women.
    sections = [
        (hips[2] - 0.090, 0.075, 0.070, 0.010),
        (hips[2] - 0.060, 0.132, 0.100, 0.012),
        (hips[2] - 0.015, 0.160, 0.116, 0.014),
        (hips[2] + 0.040, 0.157, 0.112, 0.012),
        (hips[2] + 0.110, 0.139, 0.098, y - 0.010),
        (hips[2] + 0.190, 0.134, 0.096, y - 0.012),
        (spine2[2] - 0.060, 0.150, 0.108, y - 0.012),
        (spine2[2] + 0.020, 0.168, 0.118, y - 0.014),
        (spine2[2] + 0.090, 0.170, 0.108, y - 0.008),
        (neck[2] - 0.040, 0.136, 0.082, y),
        (neck[2] - 0.005, 0.074, 0.064, y),
        (neck[2] + 0.020, 0.056, 0.056, y),
    ]
    chain = ["Hips", "Spine", "Spine1", "Spine2"]
    heights = [at[name][2] for name in chain]
    surface.add(
        *_loft(
            [((0.0, s[3], s[0]), s[1], s[2]) for s in sections], (1, 0, 0), (0, 1, 0), rings=26, power=2.5, segments=32
        ),
        BODY,
        lambda vertex: _blend(vertex[2], chain, heights),
    )
    top = at["Head"][2]
    throat = [
        ((0, y, neck[2] - 0.03), 0.056, 0.056),
        ((0, y - 0.008, neck[2] + 0.05), 0.050, 0.053),
        ((0, y - 0.014, top), 0.050, 0.056),
    ]
    surface.add(*_loft(throat, (1, 0, 0), (0, 1, 0)), JOINT, "Neck")


def _head(surface: Surface, at: Places) -> None:
    x, y, z = at["Head"]
    # Height over the joint, half width, half depth, depth's middle: chin, jaw, cheek, brow, crown.
    sections = [
        (-0.048, 0.022, 0.024, -0.062),
        (-0.030, 0.044, 0.050, -0.042),
        (0.000, 0.060, 0.078, -0.022),
        (0.045, 0.070, 0.092, -0.012),
        (0.085, 0.076, 0.098, -0.004),
        (0.120, 0.074, 0.094, 0.000),
        (0.148, 0.061, 0.077, 0.002),
        (0.166, 0.042, 0.053, 0.003),
        (0.174, 0.024, 0.030, 0.003),
    ]
    rings = [((x, y + s[3], z + s[0]), s[1], s[2]) for s in sections]
    surface.add(*_loft(rings, (1, 0, 0), (0, 1, 0), rings=22, cap=0.08), BODY, "Head")
    # A nose shows which way the face looks, even from far.
    nose = [
        ((x, y - 0.100, z + 0.062), 0.008, 0.008),
        ((x, y - 0.108, z + 0.040), 0.012, 0.014),
        ((x, y - 0.106, z + 0.026), 0.013, 0.012),
    ]
    surface.add(*_loft(nose, (1, 0, 0), (0, 1, 0), rings=6, segments=12), BODY, "Head")
    for sign in (1.0, -1.0):
        surface.add(*_ball((x + sign * 0.076, y + 0.006, z + 0.042), (0.009, 0.019, 0.031)), BODY, "Head")
        surface.add(*_ball((x + sign * 0.031, y - 0.090, z + 0.068), (0.012, 0.012, 0.008)), JOINT, "Head")


def _arm(surface: Surface, at: Places, side: str, sign: float) -> None:
    shoulder, elbow, wrist = at[f"{side}Arm"], at[f"{side}ForeArm"], at[f"{side}Hand"]
    collar = at[f"{side}Shoulder"]
    # The collar: from the breastbone's top to the shoulder, on the shoulder's own bone.
    surface.add(
        *_limb(collar, shoulder, [(0.0, 0.050, 0.052), (0.5, 0.052, 0.055), (0.9, 0.046, 0.050)], drop=-0.012),
        BODY,
        f"{side}Shoulder",
    )
    surface.add(*_ball(shoulder, (0.056, 0.056, 0.056)), JOINT, f"{side}Arm")
    surface.add(
        *_limb(
            shoulder, elbow, [(0.10, 0.050, 0.050), (0.30, 0.050, 0.049), (0.60, 0.044, 0.044), (0.88, 0.037, 0.038)]
        ),
        BODY,
        f"{side}Arm",
    )
    surface.add(*_ball(elbow, (0.039, 0.039, 0.039)), JOINT, f"{side}ForeArm")
    surface.add(
        *_limb(elbow, wrist, [(0.12, 0.037, 0.039), (0.30, 0.040, 0.042), (0.60, 0.033, 0.035), (0.94, 0.024, 0.030)]),
        BODY,
        f"{side}ForeArm",
    )
    surface.add(*_ball(wrist, (0.026, 0.029, 0.023)), JOINT, f"{side}Hand")


def _hand(surface: Surface, at: Places, side: str, sign: float) -> None:
    wrist, bone = at[f"{side}Hand"], f"{side}Hand"
    along = np.array([sign, 0.0, 0.0])
    palm = [
        (wrist + along * 0.022, 0.029, 0.016),
        (wrist + along * 0.050, 0.040, 0.017),
        (wrist + along * 0.085, 0.043, 0.015),
        (wrist + along * 0.098, 0.040, 0.012),
    ]
    surface.add(*_loft(palm, (0, 1, 0), (0, 0, 1), rings=8, power=2.6), BODY, bone)
    # Four fingers, the index towards -Y, slightly bent; and a thumb.
    for place, length in zip((-0.031, -0.010, 0.011, 0.031), (0.072, 0.080, 0.075, 0.060), strict=True):
        knuckle = wrist + along * 0.090 + np.array([0.0, place, 0.0])
        middle = knuckle + along * length * 0.55 + np.array([0.0, place * 0.10, -0.006])
        tip = knuckle + along * length * 0.95 + np.array([0.0, place * 0.16, -0.024])
        sections = [(knuckle, 0.0100, 0.0095), (middle, 0.0092, 0.0088), (tip, 0.0075, 0.0070)]
        surface.add(*_loft(sections, (0, 1, 0), (0, 0, 1), rings=7, segments=10), BODY, bone)
    root = wrist + along * 0.030 + np.array([0.0, -0.026, -0.004])
    bend = wrist + along * 0.070 + np.array([0.0, -0.054, -0.012])
    tip = wrist + along * 0.100 + np.array([0.0, -0.064, -0.018])
    across = np.array([0.55 * sign, 0.83, 0.0])
    thumb = [(root, 0.015, 0.014), (bend, 0.0115, 0.011), (tip, 0.009, 0.008)]
    surface.add(*_loft(thumb, across, (0, 0, 1), rings=7, segments=10), BODY, bone)


def _leg(surface: Surface, at: Places, side: str) -> None:
    hip, knee, ankle = at[f"{side}UpLeg"], at[f"{side}Leg"], at[f"{side}Foot"]
    surface.add(*_ball(hip + np.array([0.0, 0.004, 0.0]), (0.076, 0.084, 0.078)), JOINT, f"{side}UpLeg")
    # Share of the length, half width, half depth, how far the middle lies behind the bone.
    thigh = [
        (0.03, 0.074, 0.082, 0.006),
        (0.25, 0.073, 0.080, 0.0),
        (0.55, 0.063, 0.068, -0.002),
        (0.90, 0.050, 0.053, 0.0),
    ]
    surface.add(*_limb(hip, knee, thigh), BODY, f"{side}UpLeg")
    surface.add(*_ball(knee, (0.051, 0.053, 0.052)), JOINT, f"{side}Leg")
    shin = [
        (0.09, 0.048, 0.050, 0.002),
        (0.28, 0.051, 0.056, 0.012),
        (0.55, 0.042, 0.045, 0.008),
        (0.92, 0.031, 0.035, 0.002),
    ]
    surface.add(*_limb(knee, ankle, shin), BODY, f"{side}Leg")
    surface.add(*_ball(ankle, (0.034, 0.038, 0.036)), JOINT, f"{side}Foot")


def _foot(surface: Surface, at: Places, side: str) -> None:
    ankle, toe = at[f"{side}Foot"], at[f"{side}Toe"]
    x, sole = ankle[0], 0.0
    # Along the foot from the heel: y, half width, top's height over the sole.
    foot = [
        (ankle[1] + 0.056, 0.024, 0.046),
        (ankle[1] + 0.040, 0.033, 0.066),
        (ankle[1] + 0.000, 0.036, 0.090),
        (ankle[1] - 0.045, 0.038, 0.082),
        (ankle[1] - 0.090, 0.043, 0.062),
        (toe[1] + 0.004, 0.046, 0.048),
    ]
    surface.add(*_shoe(x, sole, foot), BODY, f"{side}Foot")
    surface.add(*_shoe(x, sole, [(toe[1] + 0.012, 0.044, 0.044), (toe[1] - 0.010, 0.046, 0.045)]), JOINT, f"{side}Toe")
    toes = [
        (toe[1] - 0.002, 0.046, 0.047),
        (toe[1] - 0.030, 0.044, 0.040),
        (toe[1] - 0.052, 0.036, 0.032),
        (toe[1] - 0.066, 0.022, 0.024),
    ]
    surface.add(*_shoe(x, sole, toes), BODY, f"{side}Toe")


# --- shapes ----------------------------------------------------------------------------------------------------------


def _shoe(x: float, sole: float, sections: list[tuple[float, float, float]]) -> Skin:
    """A loft along -Y that stands flat on the sole."""
    rings = [((x, y, sole + top / 2), half, top / 2) for y, half, top in sections]
    return _loft(rings, (1, 0, 0), (0, 0, 1), rings=12, power=3.2, cap=0.35)


def _limb(start: np.ndarray, end: np.ndarray, sections: Sequence[tuple[float, ...]], drop: float = 0.0) -> Skin:
    """A loft from joint to joint: (share of the length, half width, half depth[, how far behind the bone])."""
    along = end - start
    vertical = abs(along[2]) > abs(along[0])
    across, back = ((1, 0, 0), (0, 1, 0)) if vertical else ((0, 0, 1), (0, 1, 0))
    rings = []
    for share, width, depth, *behind in sections:
        center = start + along * share + np.array([0.0, behind[0] if behind else 0.0, drop])
        rings.append((center, width, depth))
    return _loft(rings, across, back)


def _loft(
    sections: Sequence[Section],
    across: ArrayLike,
    back: ArrayLike,
    *,
    rings: int = RINGS,
    segments: int = SEGMENTS,
    power: float = 2.0,
    cap: float = 0.5,
) -> Skin:
    """A smooth skin through sections (half width along `across`, half depth along `back`), ends rounded.

    `power` 2 gives ellipses, more gives rounder boxes; `cap` is an end's height over the section's smaller half.
    """
    across, back = np.asarray(across, float), np.asarray(back, float)
    table = np.array([[*np.asarray(center), width, depth] for center, width, depth in sections], dtype=float)
    knots = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(table[:, :3], axis=0), axis=1))])
    rows = _through(knots, table, np.linspace(0.0, knots[-1], rings))
    rows = np.concatenate([_cap(rows[0], rows[1], cap)[::-1], rows, _cap(rows[-1], rows[-2], cap)])

    turn = np.linspace(0.0, 2.0 * np.pi, segments, endpoint=False)
    c, s = np.cos(turn), np.sin(turn)
    c, s = np.sign(c) * np.abs(c) ** (2 / power), np.sign(s) * np.abs(s) ** (2 / power)
    body = rows[1:-1]
    vertices = (
        body[:, None, :3]
        + body[:, None, 3:4] * c[None, :, None] * across
        + body[:, None, 4:5] * s[None, :, None] * back
    ).reshape(-1, 3)
    first, last = len(vertices), len(vertices) + 1
    vertices = np.concatenate([vertices, rows[:1, :3], rows[-1:, :3]])
    faces: list[tuple[int, ...]] = []
    for ring in range(len(body) - 1):
        for k in range(segments):
            a, b = ring * segments + k, ring * segments + (k + 1) % segments
            faces.append((a, b, b + segments, a + segments))
    top = (len(body) - 1) * segments
    for k in range(segments):
        faces.append((first, (k + 1) % segments, k))
        faces.append((last, top + k, top + (k + 1) % segments))
    along = table[-1, :3] - table[0, :3]
    if np.dot(np.cross(across, back), along) < 0.0:
        faces = [face[::-1] for face in faces]
    return vertices, faces


def _cap(end: np.ndarray, inner: np.ndarray, cap: float, steps: int = 4) -> np.ndarray:
    """Rows that round an end off, from just outside it to its pole."""
    outward = end[:3] - inner[:3]
    outward = outward / max(np.linalg.norm(outward), 1e-9)
    height = cap * 2.0 * min(end[3], end[4])
    rows = []
    for step in range(1, steps + 1):
        angle = step / steps * np.pi / 2
        rows.append([*(end[:3] + outward * height * np.sin(angle)), end[3] * np.cos(angle), end[4] * np.cos(angle)])
    return np.array(rows)


def _ball(center: ArrayLike, radii: ArrayLike, segments: int = 16, rings: int = 10) -> Skin:
    center, radii = np.asarray(center, float), np.asarray(radii, float)
    heights = np.linspace(-np.pi / 2, np.pi / 2, rings + 1)[1:-1]
    turn = np.linspace(0.0, 2.0 * np.pi, segments, endpoint=False)
    shell = [(np.cos(h) * np.cos(t), np.cos(h) * np.sin(t), np.sin(h)) for h in heights for t in turn]
    vertices = center + np.array([*shell, (0, 0, -1), (0, 0, 1)]) * radii
    bottom, top, rows = len(shell), len(shell) + 1, len(heights)
    faces: list[tuple[int, ...]] = []
    for ring in range(rows - 1):
        for k in range(segments):
            a, b = ring * segments + k, ring * segments + (k + 1) % segments
            faces.append((a, b, b + segments, a + segments))
    for k in range(segments):
        faces.append((bottom, (k + 1) % segments, k))
        faces.append((top, (rows - 1) * segments + k, (rows - 1) * segments + (k + 1) % segments))
    return vertices, faces


def _through(knots: np.ndarray, table: np.ndarray, where: np.ndarray) -> np.ndarray:
    """Monotone cubic interpolation (Fritsch and Carlson 1980) of each column: no bulge that no section asked for."""
    step = np.diff(knots)
    slope = np.diff(table, axis=0) / step[:, None]
    tangent = np.zeros_like(table)
    tangent[0], tangent[-1] = slope[0], slope[-1]
    for k in range(1, len(knots) - 1):
        same = slope[k - 1] * slope[k] > 0.0
        w1, w2 = 2 * step[k] + step[k - 1], step[k] + 2 * step[k - 1]
        with np.errstate(divide="ignore", invalid="ignore"):
            harmonic = (w1 + w2) / (w1 / slope[k - 1] + w2 / slope[k])
        tangent[k] = np.where(same, harmonic, 0.0)
    index = np.clip(np.searchsorted(knots, where, side="right") - 1, 0, len(step) - 1)
    h = step[index][:, None]
    t = ((where - knots[index]) / step[index])[:, None]
    between: np.ndarray = (
        (2 * t**3 - 3 * t**2 + 1) * table[index]
        + (t**3 - 2 * t**2 + t) * h * tangent[index]
        + (-2 * t**3 + 3 * t**2) * table[index + 1]
        + (t**3 - t**2) * h * tangent[index + 1]
    )
    return between


def _blend(height: float, chain: list[str], heights: list[float]) -> dict[str, float]:
    """Weights along the trunk: each height belongs to the joints below it, softly over 6 cm."""
    width = 0.06
    shares, left = {}, 1.0
    for name, joint in zip(chain[1:][::-1], heights[1:][::-1], strict=True):
        above = float(np.clip((height - joint) / width + 0.5, 0.0, 1.0))
        above = above * above * (3.0 - 2.0 * above)
        if left * above > 0.0:
            shares[name] = left * above
        left *= 1.0 - above
    if left > 0.0:
        shares[chain[0]] = left
    return shares
