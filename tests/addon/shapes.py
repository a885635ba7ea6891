"""Small meshes for the tests."""

import bpy
import numpy as np


def add_mesh(name, vertices, faces, location=(0, 0, 0), scale=(1, 1, 1)):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(vertices, [], faces)
    thing = bpy.data.objects.new(name, mesh)
    thing.location, thing.scale = location, scale
    bpy.context.scene.collection.objects.link(thing)
    bpy.context.view_layer.update()
    return thing


def add_cube(name="Cube", location=(0, 0, 0), scale=(1, 1, 1), size=1.0):
    h = size / 2
    corners = [(x, y, z) for x in (-h, h) for y in (-h, h) for z in (-h, h)]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return add_mesh(name, corners, faces, location, scale)


def add_floor(size=3.0):
    s = size
    return add_mesh("Floor", [(-s, -s, 0), (s, -s, 0), (s, s, 0), (-s, s, 0)], [(0, 1, 2, 3)])


def add_terrain(side, size, bumps=0.0, location=(0, 0, 0)):
    """A grid of `side` × `side` vertices over [0, size]², two triangles a cell; `bumps` metres high."""
    xs, ys = np.meshgrid(np.linspace(0, size, side), np.linspace(0, size, side))
    positions = np.stack([xs, ys, bumps * np.sin(40 * xs) * np.sin(37 * ys)], axis=-1).astype(np.float32)
    corner = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).ravel()
    quads = np.stack([corner, corner + 1, corner + side + 1, corner + side], axis=1).astype(np.int32)
    mesh = bpy.data.meshes.new("Terrain")
    mesh.vertices.add(side * side)
    mesh.vertices.foreach_set("co", positions.ravel())
    mesh.loops.add(quads.size)
    mesh.loops.foreach_set("vertex_index", quads.ravel())
    mesh.polygons.add(len(quads))
    mesh.polygons.foreach_set("loop_start", np.arange(0, quads.size, 4, dtype=np.int32))
    mesh.update(calc_edges=True)
    thing = bpy.data.objects.new("Terrain", mesh)
    thing.location = location
    bpy.context.scene.collection.objects.link(thing)
    bpy.context.view_layer.update()
    return thing


def volume(positions, triangles):
    """Signed volume of a closed mesh: positive when its faces look outward."""
    a, b, c = (positions[triangles[:, k]].astype(float) for k in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0)
