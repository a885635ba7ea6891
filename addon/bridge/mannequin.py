# SPDX-License-Identifier: GPL-3.0-or-later
"""The mannequin's mesh object: surface, vertex groups and two plain materials."""

from __future__ import annotations

import bpy
import numpy as np

from ..body_shape import mannequin

#: Name, colour (linear RGB), roughness; in the order of the surface's material indices.
MATERIALS = (
    ("Oncue Mannequin", (0.62, 0.56, 0.49), 0.55),
    ("Oncue Mannequin Joints", (0.16, 0.17, 0.19), 0.6),
)


def make(skeleton: dict, positions: np.ndarray) -> bpy.types.Object:
    """A mesh object over the rest pose, metres, weighted to the bones of the same names; not linked yet."""
    surface = mannequin(list(skeleton["names"]), positions)
    mesh = bpy.data.meshes.new("Oncue Mannequin")
    mesh.from_pydata(np.concatenate(surface.vertices), [], surface.faces)
    for name, color, roughness in MATERIALS:
        mesh.materials.append(_material(name, color, roughness))
    mesh.polygons.foreach_set("material_index", np.array(surface.materials, dtype=np.int32))
    mesh.polygons.foreach_set("use_smooth", np.ones(len(mesh.polygons), dtype=bool))
    mesh.update()
    body = bpy.data.objects.new("Oncue Mannequin", mesh)
    for bone, (indices, weights) in surface.weights.items():
        group = body.vertex_groups.new(name=bone)
        for index, weight in zip(indices, weights, strict=True):
            group.add([index], weight, "REPLACE")
    return body


def _material(name: str, color: tuple[float, float, float], roughness: float) -> bpy.types.Material:
    material = bpy.data.materials.get(name)
    if material is None:
        material = bpy.data.materials.new(name)
        if material.node_tree is None:  # before Blender 5.0
            material.use_nodes = True
        shader = next(node for node in material.node_tree.nodes if node.type == "BSDF_PRINCIPLED")
        shader.inputs["Base Color"].default_value = (*color, 1.0)
        shader.inputs["Roughness"].default_value = roughness
    material.diffuse_color = (*color, 1.0)
    material.roughness = roughness
    return material
