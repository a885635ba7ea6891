# SPDX-License-Identifier: GPL-3.0-or-later
"""Furniture and rooms made of rounded boxes, in metres, with the proportions of real pieces.

Every piece stands with its foot's middle at `at` and faces -Y turned by `yaw` (radians about +Z).
"""

from __future__ import annotations

import math

import bpy  # before bmesh: the bpy module brings it

# isort: split
import bmesh
from mathutils import Matrix, Vector

COLORS = {
    "plaster": (0.78, 0.75, 0.70),
    "floor": (0.50, 0.36, 0.24),
    "oak": (0.58, 0.40, 0.23),
    "walnut": (0.24, 0.14, 0.08),
    "fabric": (0.20, 0.33, 0.38),
    "cushion": (0.26, 0.41, 0.47),
    "mustard": (0.70, 0.45, 0.12),
    "rug": (0.60, 0.55, 0.48),
    "metal": (0.15, 0.15, 0.16),
    "paper": (0.85, 0.82, 0.74),
    "leaf": (0.13, 0.30, 0.12),
    "clay": (0.55, 0.26, 0.16),
    "red": (0.50, 0.10, 0.09),
}


class Piece:
    """One mesh object under construction: boxes, cylinders and blobs, each with its colour."""

    def __init__(self, name: str, at=(0.0, 0.0, 0.0), yaw: float = 0.0) -> None:
        self.name, self.mesh, self.colors = name, bmesh.new(), []
        self.place = Matrix.Translation(Vector(at)) @ Matrix.Rotation(yaw, 4, "Z")

    def box(self, low, high, color: str, round_by: float = 0.0) -> Piece:
        """A box from corner `low` to corner `high`, its edges rounded by `round_by` metres."""
        low, high = Vector(low), Vector(high)
        made = bmesh.ops.create_cube(self.mesh, size=1.0)
        bmesh.ops.scale(self.mesh, vec=high - low, verts=made["verts"])
        bmesh.ops.translate(self.mesh, vec=(low + high) / 2, verts=made["verts"])
        faces = {face for vertex in made["verts"] for face in vertex.link_faces}
        if round_by > 0.0:
            edges = {edge for face in faces for edge in face.edges}
            bevel = bmesh.ops.bevel(
                self.mesh, geom=list(edges), offset=round_by, segments=3, affect="EDGES", profile=0.5
            )
            faces = {face for face in faces if face.is_valid} | set(bevel["faces"])
        return self._color(faces, color)

    def leg(self, x: float, y: float, top: float, color: str, half: float = 0.02) -> Piece:
        return self.box((x - half, y - half, 0.0), (x + half, y + half, top), color)

    def cylinder(
        self, middle, radius: float, low: float, high: float, color: str, top_radius: float | None = None
    ) -> Piece:
        made = bmesh.ops.create_cone(
            self.mesh,
            cap_ends=True,
            segments=24,
            radius1=radius,
            radius2=radius if top_radius is None else top_radius,
            depth=high - low,
        )
        bmesh.ops.translate(self.mesh, vec=(middle[0], middle[1], (low + high) / 2), verts=made["verts"])
        return self._color({face for vertex in made["verts"] for face in vertex.link_faces}, color)

    def blob(self, middle, radii, color: str) -> Piece:
        made = bmesh.ops.create_icosphere(self.mesh, subdivisions=2, radius=1.0)
        bmesh.ops.scale(self.mesh, vec=radii, verts=made["verts"])
        bmesh.ops.translate(self.mesh, vec=middle, verts=made["verts"])
        return self._color({face for vertex in made["verts"] for face in vertex.link_faces}, color)

    def _color(self, faces, color: str) -> Piece:
        if color not in self.colors:
            self.colors.append(color)
        for face in faces:
            face.material_index = self.colors.index(color)
        return self

    def link(self, scene: bpy.types.Scene) -> bpy.types.Object:
        bmesh.ops.recalc_face_normals(self.mesh, faces=self.mesh.faces)
        data = bpy.data.meshes.new(self.name)
        self.mesh.to_mesh(data)
        self.mesh.free()
        for color in self.colors:
            data.materials.append(material(color))
        made = bpy.data.objects.new(self.name, data)
        made.matrix_world = self.place
        scene.collection.objects.link(made)
        return made


def material(color: str) -> bpy.types.Material:
    """The material of a colour of COLORS, one for all pieces of a file."""
    made = bpy.data.materials.get(color)
    if made is None:
        made = bpy.data.materials.new(color)
        if made.node_tree is None:  # before Blender 5.0
            made.use_nodes = True
        shader = next(node for node in made.node_tree.nodes if node.type == "BSDF_PRINCIPLED")
        shader.inputs["Base Color"].default_value = (*COLORS[color], 1.0)
        shader.inputs["Roughness"].default_value = 0.7
        made.diffuse_color = (*COLORS[color], 1.0)
    return made


# --- rooms -----------------------------------------------------------------------------------------------------------


def floor(scene, low, high, color: str = "floor") -> bpy.types.Object:
    return Piece("Floor").box((low[0], low[1], -0.1), (high[0], high[1], 0.0), color).link(scene)


def walls(scene, low, high, height: float = 2.5, thick: float = 0.1) -> None:
    (x0, y0), (x1, y1) = low, high
    for name, a, b in (
        ("Wall South", (x0 - thick, y0 - thick), (x1 + thick, y0)),
        ("Wall North", (x0 - thick, y1), (x1 + thick, y1 + thick)),
        ("Wall West", (x0 - thick, y0), (x0, y1)),
        ("Wall East", (x1, y0), (x1 + thick, y1)),
    ):
        Piece(name).box((*a, 0.0), (*b, height), "plaster").link(scene)


# --- seats (the seat's height is a piece's own) ----------------------------------------------------------------------


def chair(scene, at, yaw: float, name: str = "Chair", seat: float = 0.45) -> bpy.types.Object:
    """A dining chair: 0.44 m wide, 0.44 m deep, back to 0.90 m, open under the seat."""
    piece = Piece(name, at, yaw)
    for x in (-0.19, 0.19):
        piece.leg(x, -0.19, seat - 0.04, "walnut").leg(x, 0.19, seat - 0.04, "walnut")
        piece.box((x - 0.02, 0.17, seat - 0.04), (x + 0.02, 0.21, seat + 0.45), "walnut")
    piece.box((-0.22, -0.22, seat - 0.04), (0.22, 0.22, seat), "oak", 0.012)
    piece.box((-0.21, 0.18, seat + 0.22), (0.21, 0.21, seat + 0.45), "oak", 0.010)
    return piece.link(scene)


def stool(scene, at, seat: float = 0.44, name: str = "Stool") -> bpy.types.Object:
    piece = Piece(name, at).cylinder((0, 0), 0.17, seat - 0.04, seat, "oak")
    for k in range(4):
        angle = math.pi / 4 + k * math.pi / 2
        piece.leg(0.11 * math.cos(angle), 0.11 * math.sin(angle), seat - 0.04, "walnut", 0.016)
    return piece.link(scene)


def sofa(scene, at, yaw: float, width: float = 2.1, seat: float = 0.43, name: str = "Sofa") -> bpy.types.Object:
    """A sofa 0.92 m deep: the seat 0.62 m deep in front of the back, arms of 0.18 m."""
    half, piece = width / 2, Piece(name, at, yaw)
    piece.box((-half, -0.44, 0.06), (half, 0.46, 0.28), "fabric", 0.02)
    piece.box((-half, 0.22, 0.28), (half, 0.46, 0.82), "fabric", 0.05)
    for side in (-1, 1):
        inner, outer = sorted((side * half, side * (half - 0.18)))
        piece.box((inner, -0.44, 0.28), (outer, 0.22, 0.60), "fabric", 0.05)
    cushions, inside = max(1, round((width - 0.36) / 0.7)), width - 0.36
    for k in range(cushions):
        left = -inside / 2 + k * inside / cushions
        piece.box((left + 0.004, -0.46, 0.28), (left + inside / cushions - 0.004, 0.20, seat), "cushion", 0.035)
        piece.box((left + 0.02, 0.12, seat), (left + inside / cushions - 0.02, 0.26, 0.80), "cushion", 0.05)
    for x in (-half + 0.08, half - 0.08):
        piece.leg(x, -0.36, 0.07, "walnut").leg(x, 0.38, 0.07, "walnut")
    return piece.link(scene)


def armchair(scene, at, yaw: float, name: str = "Armchair") -> bpy.types.Object:
    """A sofa for one: the seat 0.40 m high, 0.60 m between the arms."""
    return sofa(scene, at, yaw, 0.96, 0.40, name)


def bench(scene, at, width: float = 1.4, seat: float = 0.45, name: str = "Bench") -> bpy.types.Object:
    """A bench without a back, 0.36 m deep."""
    half, piece = width / 2, Piece(name, at)
    piece.box((-half, -0.18, seat - 0.05), (half, 0.18, seat), "oak", 0.01)
    for x in (-half + 0.1, half - 0.1):
        piece.leg(x, -0.13, seat - 0.05, "walnut", 0.025).leg(x, 0.13, seat - 0.05, "walnut", 0.025)
    return piece.link(scene)


def bed(scene, at, yaw: float, name: str = "Bed") -> bpy.types.Object:
    """A bed 1.6 m wide and 2.0 m long, its mattress 0.50 m high, the headboard behind."""
    piece = Piece(name, at, yaw).box((-0.82, -1.0, 0.10), (0.82, 1.0, 0.30), "oak", 0.01)
    piece.box((-0.80, -0.99, 0.30), (0.80, 0.99, 0.50), "paper", 0.05)
    for x in (-0.42, 0.42):
        piece.box((x - 0.33, 0.52, 0.50), (x + 0.33, 0.94, 0.60), "cushion", 0.045)
    for x in (-0.74, 0.74):
        piece.leg(x, -0.92, 0.11, "walnut", 0.03).leg(x, 0.92, 0.11, "walnut", 0.03)
    return piece.box((-0.85, 1.0, 0.0), (0.85, 1.05, 1.05), "oak", 0.01).link(scene)


def pouf(scene, at, name: str = "Pouf") -> bpy.types.Object:
    return Piece(name, at).box((-0.25, -0.25, 0.0), (0.25, 0.25, 0.40), "mustard", 0.07).link(scene)


# --- other furniture -------------------------------------------------------------------------------------------------


def table(scene, at, size, height: float, name: str, color: str = "oak") -> bpy.types.Object:
    x, y = size[0] / 2, size[1] / 2
    piece = Piece(name, at).box((-x, -y, height - 0.035), (x, y, height), color, 0.008)
    for side_x in (-1, 1):
        for side_y in (-1, 1):
            piece.leg(side_x * (x - 0.05), side_y * (y - 0.05), height - 0.03, "walnut", 0.022)
    return piece.link(scene)


def shelf(scene, at, yaw: float, name: str = "Shelf") -> bpy.types.Object:
    """A bookcase 1.0 m wide, 0.30 m deep, 1.9 m high, with books."""
    piece = Piece(name, at, yaw)
    for x in (-0.5, 0.48):
        piece.box((x, -0.15, 0.0), (x + 0.02, 0.15, 1.9), "oak")
    piece.box((-0.5, 0.13, 0.0), (0.5, 0.15, 1.9), "oak")
    for level in range(6):
        z = 0.04 + level * 0.366
        piece.box((-0.48, -0.15, z), (0.48, 0.13, z + 0.02), "oak")
        if level == 5:
            continue
        x, k = -0.46, level * 7
        while x < 0.36 - 0.08 * (level % 3):
            wide, tall = 0.025 + 0.012 * ((k * 5) % 4), 0.20 + 0.018 * ((k * 3) % 6)
            color = ("red", "paper", "fabric", "mustard", "walnut")[k % 5]
            piece.box((x, -0.10, z + 0.02), (x + wide, 0.10, z + 0.02 + tall), color)
            x, k = x + wide + 0.003, k + 1
    return piece.link(scene)


def plant(scene, at, name: str = "Plant") -> bpy.types.Object:
    piece = Piece(name, at).cylinder((0, 0), 0.13, 0.0, 0.30, "clay", 0.17)
    piece.cylinder((0, 0), 0.02, 0.28, 0.75, "walnut")
    for k in range(9):
        angle, height = k * 2.4, 0.65 + 0.09 * k
        out = 0.20 - 0.012 * k
        piece.blob((out * math.cos(angle), out * math.sin(angle), height), (0.13, 0.13, 0.10), "leaf")
    return piece.link(scene)


def lamp(scene, at, name: str = "Lamp") -> bpy.types.Object:
    piece = Piece(name, at).cylinder((0, 0), 0.15, 0.0, 0.02, "metal").cylinder((0, 0), 0.012, 0.02, 1.45, "metal")
    return piece.cylinder((0, 0), 0.20, 1.40, 1.68, "paper", 0.13).link(scene)


def desk_things(scene, at, yaw: float, name: str = "Screen") -> bpy.types.Object:
    """A screen and a keyboard on a desk top at z = at[2]."""
    piece = Piece(name, at, yaw).box((-0.10, -0.02, 0.0), (0.10, 0.10, 0.012), "metal")
    piece.box((-0.02, 0.05, 0.0), (0.02, 0.07, 0.2), "metal").box(
        (-0.31, 0.03, 0.12), (0.31, 0.055, 0.48), "metal", 0.006
    )
    return piece.box((-0.22, -0.28, 0.0), (0.22, -0.14, 0.018), "paper", 0.005).link(scene)


def rug(scene, low, high, name: str = "Rug") -> bpy.types.Object:
    return Piece(name).box((*low, 0.0), (*high, 0.008), "rug").link(scene)
