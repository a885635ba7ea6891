"""Small meshes for the tests."""

import bpy


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


def volume(positions, triangles):
    """Signed volume of a closed mesh: positive when its faces look outward."""
    import numpy as np

    a, b, c = (positions[triangles[:, k]].astype(float) for k in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0)
