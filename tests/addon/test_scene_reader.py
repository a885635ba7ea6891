"""Evaluated meshes → triangles."""

import bpy
import numpy as np
import pytest

from .shapes import add_cube, add_floor, add_mesh, add_terrain, volume


@pytest.fixture
def read(oncue):
    reader = oncue("bridge.scene_reader")
    return lambda **options: reader.read_scene(bpy.context, **options)


def bounds(meshes):
    return meshes.positions.min(axis=0).tolist(), meshes.positions.max(axis=0).tolist()


def test_cube_is_twelve_triangles_in_world_metres(read):
    add_cube(location=(1, 2, 3), scale=(2, 1, 1))
    meshes = read()
    assert meshes.positions.dtype == np.float32
    assert meshes.triangles.dtype == np.uint32
    assert meshes.triangles.shape == (12, 3)
    assert bounds(meshes) == ([0.0, 1.5, 2.5], [2.0, 2.5, 3.5])
    assert volume(meshes.positions, meshes.triangles) == pytest.approx(2.0)


def test_modifiers_count(read):
    cube = add_cube()
    array = cube.modifiers.new("Array", "ARRAY")
    array.count, array.relative_offset_displace = 3, (2.0, 0, 0)
    meshes = read()
    assert len(meshes.triangles) == 36
    assert bounds(meshes)[1][0] == pytest.approx(4.5)


@pytest.mark.parametrize("scale", [(-1, 1, 1), (-2, -3, -0.5), (1, 0.2, 7)])
def test_mirrored_and_uneven_scales_keep_the_outside_outside(read, scale):
    add_cube(scale=scale)
    meshes = read()
    assert volume(meshes.positions, meshes.triangles) == pytest.approx(abs(np.prod(scale)), rel=1e-5)


def test_collection_instances_count_where_they_stand(read):
    hidden = bpy.data.collections.new("Kit")
    cube = add_cube()
    bpy.context.scene.collection.objects.unlink(cube)
    hidden.objects.link(cube)
    for x in (5, 8):
        empty = bpy.data.objects.new("Instance", None)
        empty.instance_type, empty.instance_collection = "COLLECTION", hidden
        empty.location.x = x
        bpy.context.scene.collection.objects.link(empty)
    bpy.context.view_layer.update()
    meshes = read()
    assert len(meshes.triangles) == 24
    assert bounds(meshes)[0][0] == pytest.approx(4.5)
    assert bounds(meshes)[1][0] == pytest.approx(8.5)


def test_instances_of_geometry_nodes_count(read):
    points = add_mesh("Points", [(0, 0, 0), (3, 0, 0), (0, 3, 0)], [(0, 1, 2)])
    cube = add_cube("Source", location=(0, 0, 50))
    tree = bpy.data.node_groups.new("Scatter", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    nodes, links = tree.nodes, tree.links
    source, target = nodes.new("NodeGroupInput"), nodes.new("NodeGroupOutput")
    scatter, info = nodes.new("GeometryNodeInstanceOnPoints"), nodes.new("GeometryNodeObjectInfo")
    info.inputs["Object"].default_value = cube
    links.new(source.outputs[0], scatter.inputs["Points"])
    links.new(info.outputs["Geometry"], scatter.inputs["Instance"])
    links.new(scatter.outputs[0], target.inputs[0])
    points.modifiers.new("Scatter", "NODES").node_group = tree
    bpy.context.view_layer.update()
    assert len(read().triangles) == 12 * 4


def test_curves_with_a_bevel_are_walls_too(read):
    curve = bpy.data.curves.new("Rail", "CURVE")
    curve.dimensions, curve.bevel_depth = "3D", 0.1
    spline = curve.splines.new("POLY")
    spline.points.add(1)
    spline.points[1].co = (2, 0, 0, 1)
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("Rail", curve))
    bpy.context.view_layer.update()
    assert bounds(read())[1][0] == pytest.approx(2.0, abs=0.11)


def test_what_the_artist_left_out_is_left_out(read, oncue):
    names = oncue("bridge.names")
    add_floor()
    add_cube("Hidden").hide_viewport = True
    add_cube("Eye").hide_set(True)
    add_cube("Cutter").display_type = "WIRE"
    add_cube("Ghost")[names.EXCLUDE_KEY] = True
    add_cube("Body")[names.CHARACTER_KEY] = True
    walk_through = bpy.data.collections.new("Walk Through")
    bpy.context.scene.collection.children.link(walk_through)
    curtain = add_cube("Curtain")
    bpy.context.scene.collection.objects.unlink(curtain)
    walk_through.objects.link(curtain)
    bpy.context.view_layer.update()
    assert len(read(exclude=walk_through).triangles) == 2
    assert len(read().triangles) == 14


def test_a_mesh_of_nans_is_named_and_left_out(read):
    add_floor()
    add_mesh("Broken Sofa", [(0, 0, 0), (float("nan"), 0, 0), (0, 1, 0)], [(0, 1, 2)])
    meshes = read()
    assert len(meshes.triangles) == 2
    assert [name for name, _ in meshes.skipped] == ["Broken Sofa"]
    assert "Broken Sofa" in meshes.skipped[0][1]


@pytest.mark.parametrize(
    ("corners", "words"),
    [
        ([(0, 0, 0), (1, 0, 0), (2, 0, 0)], "Broken Sofa has no area"),
        ([(0, 0, 0), (1e30, 0, 0), (0, 1, 0)], "Broken Sofa reaches farther than 100 km"),
    ],
)
def test_a_mesh_that_nothing_can_touch_is_named_and_left_out(read, oncue, corners, words):
    sofa = add_mesh("Broken Sofa", corners, [(0, 1, 2)])
    with pytest.raises(oncue("errors").SceneError, match=words):
        read()
    add_floor()
    meshes = read()
    assert len(meshes.triangles) == 2
    assert words in meshes.skipped[0][1]
    # A floor that is scaled to nothing has no area, one that is flattened has.
    bpy.data.objects.remove(sofa)
    floor = bpy.data.objects["Floor"]
    floor.scale = (1, 1, 0)
    bpy.context.view_layer.update()
    assert len(read().triangles) == 2
    floor.scale = (1, 0, 1)
    bpy.context.view_layer.update()
    with pytest.raises(oncue("errors").SceneError, match="Floor has no area"):
        read()


def test_no_meshes_is_a_sentence(read, oncue):
    with pytest.raises(oncue("errors").SceneError, match="no visible mesh"):
        read()


def test_a_scene_in_centimetres_is_recognised_and_can_be_scaled(read, oncue):
    add_cube("Room", scale=(560, 460, 250))
    with pytest.raises(oncue("errors").SceneError, match=r"560 units wide.*centimetres.*0\.01"):
        read(scale_confirmed=False)
    meshes = read(metres_per_unit=0.01, scale_confirmed=True)
    assert bounds(meshes)[1][0] == pytest.approx(2.8)
    assert len(read(scale_confirmed=True).triangles) == 12


def test_a_wide_ground_is_no_scene_in_centimetres(read, oncue):
    """What stands on it is as large as furniture; or, with nothing on it, the cues are some steps apart."""
    make, refused = oncue("bridge.cue_objects").make_cue, oncue("errors").ScaleError
    ground = add_cube("Ground", location=(0, 0, -0.5), scale=(100, 100, 1))
    with pytest.raises(refused):
        read(scale_confirmed=False)
    for cue, x in (("start", 0.0), ("stop", 5.0)):
        make(bpy.context, cue, (x, 0, 0), 0.0)
    assert len(read(scale_confirmed=False).triangles) == 12
    # The same in centimetres: the way is 5 m and the stool 45 cm.
    bpy.data.objects["Stop"].location.x = 500.0
    stool = add_cube("Stool", location=(50, 0, 22), scale=(45, 45, 45))
    ground.scale = (700, 600, 10)
    bpy.context.view_layer.update()
    with pytest.raises(refused, match="centimetres"):
        read(scale_confirmed=False)
    for thing in (stool, add_cube("Table", scale=(0.6, 0.6, 0.75))):
        thing.scale = (0.5, 0.5, 0.5)
    bpy.context.view_layer.update()
    assert len(read(scale_confirmed=False).triangles) == 36


def test_the_scale_that_is_set_counts_as_confirmed(context, oncue):
    assert not context.scene.oncue.scale_confirmed
    bpy.ops.oncue.set_scene_scale(scale=1.0)
    assert context.scene.oncue.scale_confirmed


def test_a_million_triangles_in_one_array(read):
    """The bulk path is taken: shapes and values, whatever the time."""
    add_terrain(708, 5.0)
    meshes = read()
    assert len(meshes.triangles) == 2 * 707**2
    a, b, c = (meshes.positions[meshes.triangles[:, k]] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
    assert area == pytest.approx(25.0, rel=1e-4)
