"""The armature, the mannequin and the keys."""

import bpy
import numpy as np
import pytest
from mathutils import Vector

from .shapes import add_cube


@pytest.fixture
def armature(oncue):
    return oncue("bridge.armature")


@pytest.fixture
def writer(oncue):
    return oncue("bridge.action_writer")


@pytest.fixture
def motions(oncue):
    return oncue("motion")


@pytest.fixture
def skeleton(core):
    return core.skeleton()


@pytest.fixture
def motion(motions):
    """A wild motion: every joint turns, the root travels."""
    random, frames = np.random.default_rng(3), 45
    turns = np.cumsum(random.normal(0, 0.08, (frames, 22, 4)), axis=0) + random.normal(0, 1, (22, 4))
    rotations = turns / np.linalg.norm(turns, axis=-1, keepdims=True)
    positions = np.array([1.0, -2.0, 0.9]) + np.cumsum(random.normal(0, 0.05, (frames, 3)), axis=0)
    return motions.Motion(positions.astype(np.float32), rotations.astype(np.float32), 30.0)


def rotation_matrix(q):
    w, x, y, z = np.moveaxis(q / np.linalg.norm(q, axis=-1, keepdims=True), -1, 0)
    return np.stack(
        [
            np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)], -1),
            np.stack([2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)], -1),
            np.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], -1),
        ],
        -2,
    )


def forward_kinematics(skeleton, motion):
    """Joint positions in the world, (frames, joints, 3): the core's definition in numpy."""
    local = rotation_matrix(motion.rotations.astype(float))
    turns, positions = local.copy(), np.empty((*local.shape[:2], 3))
    positions[:, 0] = motion.root_positions
    for joint, parent in enumerate(skeleton["parents"]):
        if joint == 0:
            continue
        turns[:, joint] = turns[:, parent] @ local[:, joint]
        positions[:, joint] = positions[:, parent] + turns[:, parent] @ np.asarray(
            skeleton["joint_offsets"][joint], float
        )
    return positions


def evaluated_heads(character, names, frames):
    heads = []
    for frame in frames:
        bpy.context.scene.frame_set(int(frame))
        posed = character.evaluated_get(bpy.context.evaluated_depsgraph_get())
        heads.append([posed.matrix_world @ posed.pose.bones[name].head for name in names])
    return np.array(heads)


def evaluated_palm(character, side, frame):
    """Where a hand grips: 8 cm along it from the wrist, and 2 cm before the palm, which faces down at rest."""
    bpy.context.scene.frame_set(int(frame))
    posed = character.evaluated_get(bpy.context.evaluated_depsgraph_get())
    hand = posed.pose.bones[f"{side}Hand"]
    turned = hand.matrix.to_3x3() @ hand.bone.matrix_local.to_3x3().inverted()
    along = 0.08 if side == "Left" else -0.08
    return posed.matrix_world @ (hand.head + turned @ Vector((along, 0.0, -0.02)))


def write(writer, character, skeleton, motion, **options):
    options = {"name": "Take", "start_frame": 1, **options}
    return writer.write_action(bpy.context, character, list(skeleton["names"]), motion, **options)


def test_bones_are_the_joints_in_a_t_pose(armature, skeleton):
    character = armature.make_character(bpy.context, skeleton)
    assert [bone.name for bone in character.data.bones] == list(skeleton["names"])
    for joint, (name, parent) in enumerate(zip(skeleton["names"], skeleton["parents"], strict=True)):
        bone = character.data.bones[name]
        assert np.allclose(bone.head_local, armature.rest_positions(skeleton)[joint], atol=1e-6)
        assert bone.length > 0.02
        assert (bone.parent.name if bone.parent else None) == (skeleton["names"][parent] if joint else None)


@pytest.mark.parametrize("frame_rate", [30, 24, 60])
def test_blenders_bones_stand_where_the_cores_joints_do(
    context, armature, writer, motions, skeleton, motion, frame_rate
):
    context.scene.render.fps = frame_rate
    character = armature.make_character(context, skeleton)
    write(writer, character, skeleton, motion, start_frame=10)
    expected = forward_kinematics(skeleton, motions.resample(motion, frame_rate))
    heads = evaluated_heads(character, skeleton["names"], 10 + np.arange(len(expected)))
    assert np.abs(heads - expected).max() < 1e-3
    # And at 30 Hz these are the core's own frames.
    core_frames = forward_kinematics(skeleton, motion)
    assert np.abs(heads[0] - core_frames[0]).max() < 1e-4
    assert np.abs(heads[-1] - core_frames[-1]).max() < 1e-4


def test_the_motion_stays_in_the_world_when_the_armature_was_moved(context, armature, writer, skeleton, motion):
    context.scene.render.fps = 30
    character = armature.make_character(context, skeleton)
    character.location, character.rotation_euler, character.scale = (4, -1, 0.3), (0.1, 0.2, 1.1), (1.0, 1.0, 1.0)
    context.view_layer.update()
    write(writer, character, skeleton, motion)
    heads = evaluated_heads(character, skeleton["names"], 1 + np.arange(45))
    assert np.abs(heads - forward_kinematics(skeleton, motion)).max() < 1e-3


def test_in_a_scene_of_centimetres_the_figure_is_a_hundred_times_larger(context, armature, writer, skeleton, motion):
    context.scene.render.fps = 30
    character = armature.make_character(context, skeleton, 0.01)
    write(writer, character, skeleton, motion, metres_per_unit=0.01)
    heads = evaluated_heads(character, skeleton["names"], 1 + np.arange(45))
    assert np.abs(heads - 100 * forward_kinematics(skeleton, motion)).max() < 0.1


def test_quaternion_channels_do_not_jump(writer, oncue, motions, context, armature, skeleton, motion):
    flipped = motion.rotations.copy()
    flipped[::3] *= -1.0
    character = armature.make_character(context, skeleton)
    action = write(writer, character, skeleton, motions.Motion(motion.root_positions, flipped, 30.0))
    curves = oncue("bridge.compat").action_curves(action)
    for name in skeleton["names"]:
        channels = []
        for curve in (c for c in curves if c.data_path == f'pose.bones["{name}"].rotation_quaternion'):
            values = np.empty(len(curve.keyframe_points) * 2, dtype=np.float32)
            curve.keyframe_points.foreach_get("co", values)
            channels.append(values[1::2])
        assert len(channels) == 4
        rotations = np.stack(channels, axis=1)
        assert (np.sum(rotations[1:] * rotations[:-1], axis=1) > -1e-6).all()


def test_slerp_halves_a_quarter_turn_and_goes_the_short_way(oncue):
    quaternions = oncue("quaternions")
    quarter = np.array([np.cos(np.pi / 4), 0, 0, np.sin(np.pi / 4)])
    none = np.array([1.0, 0, 0, 0])
    half = quaternions.slerp(none, quarter, np.array(0.5))
    assert half == pytest.approx([np.cos(np.pi / 8), 0, 0, np.sin(np.pi / 8)])
    assert abs(quaternions.slerp(none, -quarter, np.array(0.5)) @ half) == pytest.approx(1.0)
    assert quaternions.slerp(none, none, np.array(0.3)) == pytest.approx(none)


def test_resampling_keeps_the_ends_and_the_duration(motions, motion):
    for rate in (24, 25, 29.97, 60, 12):
        there = motions.resample(motion, rate)
        assert np.allclose(there.root_positions[0], motion.root_positions[0])
        assert np.allclose(there.root_positions[-1], motion.root_positions[-1], atol=1e-6)
        assert abs((len(there.root_positions) - 1) / rate - 44 / 30) <= 1 / rate


def test_takes_are_kept_and_the_range_grows_at_its_end_alone(context, armature, writer, skeleton, motion):
    context.scene.render.fps = 30
    context.scene.frame_start, context.scene.frame_end = 20, 30
    character = armature.make_character(context, skeleton)
    first = write(writer, character, skeleton, motion, start_frame=5)
    second = write(writer, character, skeleton, motion, start_frame=5)
    assert first is not second
    assert first.use_fake_user
    assert character.animation_data.action == second
    assert tuple(second.frame_range) == (5, 49)
    assert (context.scene.frame_start, context.scene.frame_end) == (20, 49)


def test_the_character_is_found_again_unless_its_rest_pose_was_changed(context, armature, skeleton):
    assert armature.find_character(context.scene, skeleton) is None
    character = armature.make_character(context, skeleton)
    assert armature.find_character(context.scene, skeleton) == character
    context.view_layer.objects.active = character
    bpy.ops.object.mode_set(mode="EDIT")
    character.data.edit_bones["LeftLeg"].head.x += 0.05
    bpy.ops.object.mode_set(mode="OBJECT")
    assert armature.find_character(context.scene, skeleton) is None


def test_making_the_character_leaves_mode_and_selection(context, armature, skeleton):
    cube = add_cube()
    context.view_layer.objects.active = cube
    cube.select_set(True)
    bpy.ops.object.mode_set(mode="EDIT")
    armature.make_character(context, skeleton)
    assert context.view_layer.objects.active == cube
    assert cube.mode == "EDIT"
    bpy.ops.object.mode_set(mode="OBJECT")
    assert [o.name for o in context.selected_objects] == ["Cube"]


# --- the mannequin ---------------------------------------------------------------------------------------------------


@pytest.fixture
def surface(oncue, armature, skeleton):
    return oncue("body_shape").mannequin(list(skeleton["names"]), armature.rest_positions(skeleton))


def test_the_mannequin_is_a_person_in_size(surface):
    vertices = np.concatenate(surface.vertices)
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    assert -0.002 < low[2] < 0.005
    assert 1.74 < high[2] < 1.86
    # The span of the arms is about the height.
    assert high[0] - low[0] == pytest.approx(high[2], rel=0.06)
    assert high[0] == pytest.approx(-low[0], abs=1e-6)


def test_every_vertex_has_its_whole_weight(surface, skeleton):
    total = np.zeros(sum(len(v) for v in surface.vertices))
    for bone, (indices, weights) in surface.weights.items():
        assert bone in skeleton["names"]
        np.add.at(total, indices, weights)
    assert np.allclose(total, 1.0)


def test_every_part_is_closed_and_looks_outward(surface):
    vertices = np.concatenate(surface.vertices)
    edges = {}
    for face in surface.faces:
        for a, b in zip(face, face[1:] + face[:1], strict=True):
            edges[(a, b)] = edges.get((a, b), 0) + 1
    assert all(count == 1 and (b, a) in edges for (a, b), count in edges.items())
    start = 0
    for part in surface.vertices:
        end, inside = start + len(part), vertices[start : start + len(part)].mean(axis=0)
        volume = 0.0
        for face in surface.faces:
            if start <= face[0] < end:
                points = vertices[list(face)] - inside
                for k in range(1, len(face) - 1):
                    volume += np.dot(points[0], np.cross(points[k], points[k + 1])) / 6
        assert volume > 1e-7
        start = end


def test_the_mannequin_goes_with_the_bones(context, armature, writer, skeleton, motion):
    context.scene.render.fps = 30
    character = armature.make_character(context, skeleton)
    body = next(o for o in character.children if o.type == "MESH")
    write(writer, character, skeleton, motion)
    context.scene.frame_set(20)
    head = character.evaluated_get(context.evaluated_depsgraph_get()).pose.bones["Head"].head
    mesh = body.evaluated_get(context.evaluated_depsgraph_get()).data
    group = body.vertex_groups["Head"].index
    of_head = [v.co for v in mesh.vertices if any(g.group == group and g.weight > 0.99 for g in v.groups)]
    distances = [(co - head).length for co in of_head]
    assert max(distances) < 0.25
    assert min(distances) > 0.01
