"""Other characters, and meshes that change their shape, stand where they are on each frame: passed, or named."""

import math

import bpy
import numpy as np
import pytest
from mathutils import Quaternion, Vector

from .shapes import add_cube
from .test_moving import box, doorway, joints, request_of, run


def person(oncue, name, place, yaw=0.0):
    """A character beside the one that is synthesized for."""
    made = oncue("bridge.armature").make_character(bpy.context, oncue("native").core.skeleton())
    made.name = name
    made.location, made.rotation_euler.z = place, yaw
    arms_down(made)
    bpy.context.view_layer.update()
    return made


def arms_down(made):
    for side, sign in (("Left", 1), ("Right", -1)):
        bone = made.pose.bones[f"{side}Arm"]
        turn = bone.bone.matrix_local.to_quaternion()
        down = turn.inverted() @ Quaternion((0, 1, 0), sign * math.radians(75)) @ turn
        bone.rotation_quaternion = down


def walks(made, keys):
    """The hips go along world Y by so much from where the person stands, (frame, metres), with the legs swinging."""
    hips = made.pose.bones["Hips"]
    to_bone = (made.matrix_world @ hips.bone.matrix_local).to_3x3().inverted()
    for frame, y in keys:
        hips.location = to_bone @ Vector((0, y, 0))
        hips.keyframe_insert("location", frame=frame)
    for frame in range(keys[0][0], keys[-1][0] + 1, 10):
        for side, sign in (("Left", 1), ("Right", -1)):
            leg = made.pose.bones[f"{side}UpLeg"]
            leg.rotation_quaternion = Quaternion((1, 0, 0), sign * (-1) ** (frame // 10) * 0.3)
            leg.keyframe_insert("rotation_quaternion", frame=frame)


def own(oncue):
    """The character that is synthesized for, at the start."""
    made = person(oncue, "Own", (-2, 0, 0))
    bpy.context.scene.oncue.character = made
    return made


def skin_at(made, frame):
    """World corners of a character's skin on a frame of the scene."""
    whole = math.floor(frame + 1e-6)
    bpy.context.scene.frame_set(whole, subframe=max(frame - whole, 0.0))
    skin = next(child for child in made.children if child.type == "MESH")
    evaluated = skin.evaluated_get(bpy.context.evaluated_depsgraph_get())
    return np.array([evaluated.matrix_world @ v.co for v in evaluated.data.vertices])


def test_another_character_is_read_on_each_frame_and_the_own_is_not(oncue):
    doorway(oncue)
    walks(own(oncue), [(1, 0), (50, 1.0)])
    other = person(oncue, "Other", (-1, -2, 0))
    walks(other, [(1, 0), (50, 1.5)])
    request, notes = request_of(oncue, frame=30)
    assert notes == []
    (thing,) = request.moving
    assert thing.name == "Other"
    assert set(request.names) == {"Floor", "WallL", "WallR", "Stool", "Other"}
    assert not (request.owners == request.names.index("Other")).any()
    # 24 frames a second: the last key is on the core's frame 61.25.
    assert 61 <= thing.frames <= 64
    for frame in (0, 20, 41, 900):
        there, corners = thing.at(frame), skin_at(other, 1 + min(frame, 200) * 0.8)
        # The grid's cell is 3 cm wide, and a shape may be shown for two frames.
        assert np.allclose(there.min(axis=0), corners.min(axis=0), atol=0.07), frame
        assert np.allclose(there.max(axis=0), corners.max(axis=0), atol=0.07), frame


def test_it_makes_no_difference_where_the_playhead_stands(oncue):
    doorway(oncue)
    own(oncue)
    walks(person(oncue, "Other", (-1, -2, 0)), [(1, 0), (50, 1.5)])
    seen = []
    for frame in (1, 17, 200):
        request, _ = request_of(oncue, frame)
        assert bpy.context.scene.frame_current == frame
        (thing,) = request.moving
        seen.append((request.positions[request.triangles], *(thing.at(f) for f in (0, 10, 35, 80))))
    for other in seen[1:]:
        for a, b in zip(seen[0], other, strict=True):
            assert np.allclose(a, b, atol=1e-3)


def test_a_character_that_crosses_the_way_is_passed(oncue):
    """Who goes from one side of the straight way to the other, as the person is about to come there."""
    doorway(oncue)
    for name in ("WallL", "WallR"):
        bpy.data.objects.remove(bpy.data.objects[name])
    own(oncue)
    other = person(oncue, "Other", (-0.5, -2, 0))
    walks(other, [(1, 0), (40, 2.0), (70, 2.0), (100, 4.0)])
    report = run(oncue)
    assert report["extension"]["moving"]["objects"] == ["Other"]
    assert report["success"], report["problems"]
    scene = bpy.context.scene
    last = int(scene.oncue.character.animation_data.action.frame_range[1])
    for frame in range(1, last, 2):
        hips = joints(frame)["Hips"]
        skin = skin_at(other, frame)
        away = np.linalg.norm(skin - np.array(hips), axis=1).min()
        assert away > 0.08, frame


def test_a_character_that_does_not_leave_the_way_is_named(oncue):
    """Who comes through the wall into the doorway, when nobody can be through yet, and stays."""
    doorway(oncue)
    own(oncue)
    other = person(oncue, "Other", (-0.2, -2.6, 0), math.radians(90))
    walks(other, [(1, 0), (30, 2.6)])
    report = run(oncue)
    assert not report["success"]
    assert "‘Other’ moves, and the person runs into it on frames" in report["problems"][0], report["problems"]
    (meeting,) = report["extension"]["moving"]["meetings"]
    assert meeting["object"] == "Other"
    assert meeting["depth_cm"] > 3
    words = report["problems"][0].split()
    first, last = (int(words[words.index("frames") + k].strip(",")) for k in (1, 3))
    hips = joints((first + last) // 2)["Hips"]
    assert np.linalg.norm(np.array(hips)[:2] - (-0.2, 0)) < 0.8


@pytest.mark.parametrize("posed", ["at rest", "by keys that do not change", "before the shot"])
def test_a_character_that_stands_still_is_an_obstacle(oncue, posed):
    doorway(oncue)
    own(oncue)
    # With a shoulder to either side of the doorway.
    other = person(oncue, "Other", (-0.2, 0, 0), math.radians(90))
    if posed == "by keys that do not change":
        walks(other, [(1, 0)])
    elif posed == "before the shot":
        walks(other, [(1, -1.0), (10, 0.0)])
        bpy.context.scene.oncue.start_frame = 20
    request, notes = request_of(oncue)
    assert (request.moving, notes) == ((), [])
    of_other = request.owners == request.names.index("Other")
    middle = request.positions[request.triangles[of_other]].reshape(-1, 3).mean(axis=0)
    assert np.allclose(middle[:2], (-0.2, 0), atol=0.1), "where it stands as the shot begins"
    with pytest.raises(RuntimeError, match="cannot be reached"):
        bpy.ops.oncue.synthesize()


def test_what_the_own_character_holds_is_none_and_what_another_wears_is_its(oncue):
    doorway(oncue)
    mine, other = own(oncue), person(oncue, "Other", (-1, -2, 0))
    walks(other, [(1, 0), (50, 1.5)])
    for holder, name in ((mine, "Cup"), (other, "Hat")):
        prop = add_cube(name, size=0.1)
        prop.parent, prop.parent_type, prop.parent_bone = holder, "BONE", "Head"
    request, _ = request_of(oncue)
    assert [thing.name for thing in request.moving] == ["Other", "Other"]
    assert "Cup" not in request.names
    # With nobody chosen it is the first that is moved, and still only the other is in the way.
    bpy.context.scene.oncue.character = None
    first = oncue("bridge.armature").find_character(bpy.context.scene, oncue("native").core.skeleton())
    request, _ = request_of(oncue)
    assert first.name not in request.names


def blind(keys, drop=2.1):
    """A blind over the gap, rolled up, that comes down by a shape key: (frame, how far, 0 to 1)."""
    leaf = box("Blind", (0.06, 0.9, 0.1), (-0.2, 0, 2.15))
    leaf.shape_key_add(name="Basis")
    down = leaf.shape_key_add(name="Down")
    for corner in down.data:
        if corner.co.z < 0:
            corner.co.z -= drop / leaf.scale.z
    for frame, value in keys:
        down.value = value
        down.keyframe_insert("value", frame=frame)
    return leaf


def test_a_shape_key_that_shuts_the_way_is_named(oncue):
    doorway(oncue)
    blind([(1, 0), (20, 1)])
    request, notes = request_of(oncue)
    assert notes == []
    (thing,) = request.moving
    assert thing.name == "Blind"
    assert thing.at(0)[:, 2].min() == pytest.approx(2.1, abs=1e-3)
    assert thing.at(900)[:, 2].min() == pytest.approx(0.0, abs=1e-3)
    report = run(oncue)
    assert not report["success"]
    assert "‘Blind’ moves, and the person runs into it on frames" in report["problems"][0], report["problems"]


def test_a_shape_key_that_opens_the_way_is_waited_for(oncue):
    doorway(oncue)
    blind([(1, 1), (80, 1), (100, 0)])
    report = run(oncue)
    assert report["success"], report["problems"]
    assert report["extension"]["begins"] > 1
    through = [f for f in range(1, 400) if abs((hips := joints(f)["Hips"]).x + 0.2) < 0.1 and abs(hips.y) < 0.45]
    assert through
    assert through[0] > 90


def test_a_shape_key_that_is_keyed_and_stays_is_furniture_as_the_shot_begins(oncue):
    doorway(oncue)
    blind([(1, 0), (20, 1)])
    bpy.context.scene.oncue.start_frame = 30
    request, notes = request_of(oncue, frame=1)
    assert (request.moving, notes) == ((), [])
    of_blind = request.owners == request.names.index("Blind")
    assert request.positions[request.triangles[of_blind]][..., 2].min() == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize("how", ["modifier's keys", "driver", "nodes", "parent without a modifier"])
def test_what_deforms_otherwise_is_read_too(oncue, how):
    doorway(oncue)
    stool = bpy.data.objects["Stool"]
    if how == "nodes":
        tree = bpy.data.node_groups.new("Grow", "GeometryNodeTree")
        tree.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
        tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
        start, end = tree.nodes.new("NodeGroupInput"), tree.nodes.new("NodeGroupOutput")
        move, clock = tree.nodes.new("GeometryNodeTransform"), tree.nodes.new("GeometryNodeInputSceneTime")
        tree.links.new(start.outputs[0], move.inputs["Geometry"])
        tree.links.new(move.outputs[0], end.inputs[0])
        tree.links.new(clock.outputs["Seconds"], move.inputs["Translation"])
        stool.modifiers.new("Grow", "NODES").node_group = tree
    elif how == "parent without a modifier":
        armature = bpy.data.objects.new("Rig", bpy.data.armatures.new("Rig"))
        bpy.context.scene.collection.objects.link(armature)
        bpy.context.view_layer.objects.active = armature
        bpy.ops.object.mode_set(mode="EDIT")
        armature.data.edit_bones.new("Bone").tail = (0, 0, 1)
        bpy.ops.object.mode_set(mode="OBJECT")
        stool.vertex_groups.new(name="Bone").add(range(4), 1.0, "REPLACE")
        stool.parent, stool.parent_type = armature, "ARMATURE"
        for frame, y in ((1, 0.0), (50, 0.5)):
            armature.pose.bones["Bone"].location.y = y
            armature.pose.bones["Bone"].keyframe_insert("location", frame=frame)
    else:
        # A shear by a bend at the edge.
        bend = stool.modifiers.new("Bend", "SIMPLE_DEFORM")
        bend.deform_method, bend.angle = "STRETCH", 0.0
        if how == "driver":
            stool.driver_add('modifiers["Bend"].factor').driver.expression = "frame / 100"
        else:
            for frame, value in ((1, 0.0), (50, 1.0)):
                bend.factor = value
                bend.keyframe_insert("factor", frame=frame)
    request, notes = request_of(oncue)
    assert notes == []
    (thing,) = request.moving
    assert np.abs(thing.at(30) - thing.at(0)).max() > 0.05


def test_what_has_other_corners_on_other_frames_is_named_with_the_frame(oncue):
    doorway(oncue)
    stool = bpy.data.objects["Stool"]
    grows = stool.modifiers.new("Build", "BUILD")
    grows.frame_start, grows.frame_duration = 1, 50
    request, notes = request_of(oncue, frame=60)
    assert request.moving == ()
    assert [name for name, _ in notes] == ["Stool"]
    assert notes[0][1] == "Stool has another number of corners on other frames: it was read as it is at frame 60."


def metaball(name, place, **options):
    made = bpy.data.objects.new(name, bpy.data.metaballs.new(name))
    made.data.elements.new().radius = 0.6
    made.location = place
    bpy.context.scene.collection.objects.link(made)
    for key, value in options.items():
        setattr(made, key, value)
    return made


@pytest.mark.parametrize("who", ["member", "mother", "rig", "nobody", "others"])
def test_a_family_of_metaballs_is_named_where_one_of_it_moves(oncue, who):
    # Blender gives the mesh of all to the one without a number, whichever of them moves.
    doorway(oncue)
    rig = bpy.data.objects.new("Rig", None)
    bpy.context.scene.collection.objects.link(rig)
    mother = metaball("Goo", (1, 1.5, 0.3))
    member = metaball("Goo.001", (1.5, 1.5, 0.3), parent=rig)
    other = metaball("Slime.001", (0, 8, 0))
    moved = {"member": member, "mother": mother, "rig": rig, "others": other}.get(who)
    if moved is not None:
        for frame, x in ((1, moved.location.x), (60, moved.location.x + 0.7)):
            moved.location.x = x
            moved.keyframe_insert("location", frame=frame)
    request, notes = request_of(oncue)
    assert "Goo" in request.names
    if who in ("nobody", "others"):
        assert notes == []
        return
    assert request.moving == ()
    said = "Goo has another number of corners on other frames: it was read as it is at frame 1."
    assert [text for _, text in notes] == [said]


def test_a_family_of_metaballs_that_is_carried_is_followed(oncue):
    doorway(oncue)
    cart = bpy.data.objects.new("Cart", None)
    bpy.context.scene.collection.objects.link(cart)
    metaball("Goo", (1, 1.5, 0.3), parent=cart)
    metaball("Goo.001", (1.5, 1.5, 0.3), parent=cart)
    for frame, x in ((1, 0.0), (60, 0.7)):
        cart.location.x = x
        cart.keyframe_insert("location", frame=frame)
    request, notes = request_of(oncue)
    assert notes == []
    (thing,) = request.moving
    goes = thing.at(200) - thing.at(0)
    assert np.abs(goes - [0.7, 0, 0]).max() < 0.02


def test_what_is_too_fine_to_be_followed_is_named_with_the_frame(oncue, monkeypatch):
    doorway(oncue)
    blind([(1, 0), (20, 1)])
    monkeypatch.setattr(oncue("bridge.moving_reader"), "MOST_TRIANGLES", 100)
    request, notes = request_of(oncue, frame=20)
    assert request.moving == ()
    assert notes == [("Blind", "Blind moves and is too fine to be followed: it was read as it is at frame 1.")]
    of_blind = request.owners == request.names.index("Blind")
    assert request.positions[request.triangles[of_blind]][..., 2].min() == pytest.approx(2.1, abs=1e-3)


@pytest.mark.parametrize("how", ["cloth", "rigid body"])
def test_a_simulation_is_read_once_it_is_baked_and_named_before(oncue, how):
    doorway(oncue)
    scene = bpy.context.scene
    scene.frame_end = 30
    sheet = box("Sheet", (0.5, 0.5, 0.02), (1.5, 2, 1.8))
    if how == "cloth":
        sheet.modifiers.new("Cloth", "CLOTH").point_cache.frame_end = 30
    else:
        bpy.ops.rigidbody.world_add()
        scene.rigidbody_world.collection = bpy.data.collections.new("Bodies")
        scene.rigidbody_world.collection.objects.link(sheet)
        scene.rigidbody_world.point_cache.frame_end = 30
    request, notes = request_of(oncue)
    said = "Sheet is simulated and not baked, and may stand otherwise than it was read: bake it first."
    assert ("Sheet", said) in notes
    with bpy.context.temp_override(scene=scene):
        bpy.ops.ptcache.bake_all(bake=True)
    request, notes = request_of(oncue)
    assert notes == []
    (thing,) = request.moving
    assert thing.name == "Sheet"
    # It falls.
    assert thing.at(20)[:, 2].mean() < thing.at(0)[:, 2].mean() - 0.3


def emits(thing):
    thing.modifiers.new("Particles", "PARTICLE_SYSTEM")
    chosen = thing.particle_systems[0].settings
    chosen.render_type, chosen.instance_object = "OBJECT", add_cube("Crumb", size=0.05)


def is_wet(thing):
    made = thing.modifiers.new("Fluid", "FLUID")
    made.fluid_type = "DOMAIN"
    made.domain_settings.domain_type = "LIQUID"


def is_painted(thing):
    made = thing.modifiers.new("Paint", "DYNAMIC_PAINT")
    with bpy.context.temp_override(object=thing, active_object=thing):
        bpy.ops.dpaint.type_toggle(type="CANVAS")
    assert made.canvas_settings is not None


def is_simulated_by_nodes(thing):
    tree, inner = (bpy.data.node_groups.new(name, "GeometryNodeTree") for name in ("Outer", "Inner"))
    group = tree.nodes.new("GeometryNodeGroup")
    group.node_tree = inner
    begin, end = inner.nodes.new("GeometryNodeSimulationInput"), inner.nodes.new("GeometryNodeSimulationOutput")
    begin.pair_with_output(end)
    thing.modifiers.new("Nodes", "NODES").node_group = tree


@pytest.mark.parametrize(
    ("simulate", "words"),
    [
        (lambda thing: thing.modifiers.new("Soft", "SOFT_BODY"), "is simulated and not baked"),
        (emits, "is simulated and not baked"),
        (is_wet, "is simulated and not baked"),
        (is_painted, "is simulated and not baked"),
        (is_simulated_by_nodes, "is simulated by geometry nodes"),
        (lambda thing: thing.modifiers.new("Wave", "WAVE"), None),
        (lambda thing: setattr(thing.modifiers.new("Cloth", "CLOTH"), "show_viewport", False), None),
    ],
    ids=["soft body", "particles", "liquid", "paint", "nodes", "wave", "hidden cloth"],
)
def test_a_simulation_of_any_kind_is_named(oncue, simulate, words):
    """What only frames in their order show; what each frame shows by itself is read without a word."""
    thing = add_cube("Thing")
    fault = oncue("bridge.scene_time").simulation_fault
    assert fault(thing, bpy.context.scene) is None
    simulate(thing)
    said = fault(thing, bpy.context.scene)
    assert said is None if words is None else words in said


def test_where_nobody_goes_through_the_frames_it_is_said_what_may_move(oncue):
    doorway(oncue)
    own(oncue)
    read = oncue("bridge.session").read_request
    assert read(bpy.context, hands=False)[1] == []
    walks(person(oncue, "Other", (-1, -2, 0)), [(1, 0), (50, 1.5)])
    blind([(1, 0), (20, 1)])
    bpy.context.scene.frame_set(7)
    request, notes = read(bpy.context, hands=False)
    assert request.moving == ()
    assert [said for _, said in notes] == ["Other, Blind may move: taken as all stands at frame 7, on every frame."]


def test_a_fine_mesh_is_followed_by_fewer_corners(oncue):
    simplified, cell = oncue("bridge.moving_reader").simplified, oncue("bridge.moving_reader").CELL
    n = 80
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, n, endpoint=False), np.linspace(0.01, np.pi - 0.01, n))
    ball = np.stack([np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), np.cos(v)], axis=-1).reshape(-1, 3) * 0.4
    corner = np.arange(n * (n - 1)).reshape(n - 1, n)
    right = np.roll(corner, -1, axis=1)
    halves = [(corner, corner + n, right), (right, corner + n, right + n)]
    triangles = np.concatenate([np.stack(half, -1).reshape(-1, 3) for half in halves]).astype(np.uint32)
    kept, fewer = simplified(ball.astype(np.float32), triangles)
    assert len(fewer) < len(triangles) / 2
    assert fewer.max() < len(kept)
    # Every corner has one that stands for it within a cell's diagonal.
    apart = np.linalg.norm(ball[:, None] - ball[kept][None], axis=2).min(axis=1)
    assert apart.max() <= cell * math.sqrt(3)
    # Two sheets that lie on one another stay two.
    sheet = np.stack([*np.meshgrid(np.linspace(0, 1, n), np.linspace(0, 1, n)), np.zeros((n, n))], -1).reshape(-1, 3)
    rows = np.arange(n * n).reshape(n, n)
    a, b, c, d = (part.ravel() for part in (rows[:-1, :-1], rows[:-1, 1:], rows[1:, 1:], rows[1:, :-1]))
    up = np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)])
    both = np.concatenate([up, up[:, ::-1] + n * n]).astype(np.uint32)
    kept, fewer = simplified(np.concatenate([sheet, sheet + np.array([0, 0, 0.004])]).astype(np.float32), both)
    below = kept < n * n
    assert 0 < below.sum() < len(kept)
    assert (below[fewer].all(axis=1) | ~below[fewer].any(axis=1)).all()


def test_meetings_with_the_parts_of_one_are_one(oncue):
    def met(name, first, end, frames, depth, part):
        return {"object": name, "part": part, "first": first, "end": end, "frames": frames, "depth_cm": depth}

    parts = [met("A", 3, 6, 3, 4.0, "head"), met("B", 0, 5, 5, 1.0, "torso"), met("A", 6, 9, 3, 9.0, "leg")]
    passing = oncue("moving").by_object({"wait": 0, "meetings": parts, "percent": 10.0})
    merged = [met("A", 3, 9, 6, 9.0, "leg"), met("B", 0, 5, 5, 1.0, "torso")]
    assert passing == {"wait": 0, "meetings": merged, "percent": 10.0}
