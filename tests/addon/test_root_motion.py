"""What carries the body along its way: hips, root bone, object, or nothing; the body is where it is in any case."""

import math

import bpy
import numpy as np
import pytest
from mathutils import Euler, Quaternion, Vector
from people import make_person, make_rigify

from .test_own_rigs import chosen, played, refused, skin_of, stage  # noqa: F401

#: The joints that are looked at.
JOINTS = ("Hips", "Head", *(side + part for side in ("Left", "Right") for part in ("Hand", "UpLeg", "Foot")))


def heads(scene, person, bones, times):
    """Where bones begin in the world at some times, (times, bones, 3)."""
    found = []
    for time in times:
        scene.frame_set(math.floor(time), subframe=time - math.floor(time))
        posed = person.evaluated_get(bpy.context.evaluated_depsgraph_get())
        found.append([posed.matrix_world @ posed.pose.bones[bone].head for bone in bones])
    return np.array(found)


def take(oncue, scene, kind):
    scene.oncue.root_motion = kind
    assert bpy.ops.oncue.synthesize() == {"FINISHED"}
    action, report = played(oncue, scene)
    assert report["success"], report["problems"]
    return action


def standing_aside(person):
    person.location, person.rotation_euler = (0.7, -1.5, 0.3), Euler((0.0, 0.0, 1.1))
    bpy.context.view_layer.update()
    return person


@pytest.fixture
def bones_of(oncue):
    def find(person):
        joints = oncue("bridge.own_rig").recognized(person)["joints"]
        return [joints[name] for name in JOINTS if name in joints]

    return find


@pytest.mark.parametrize(("kind", "few"), [("BONE", True), ("BONE", False), ("OBJECT", True), ("OBJECT", False)])
def test_the_body_is_where_it_is_without(stage, oncue, bones_of, kind, few):  # noqa: F811
    person = chosen(stage, standing_aside(make_person("unreal", 1.6)))
    stage.scene.oncue.every_frame = not few
    bones, before = bones_of(person), np.array(person.matrix_world)
    action = take(oncue, stage.scene, "HIPS")
    # Between the frames, too, at which nothing but the curves says what plays.
    times = np.arange(1.0, action.frame_range[1], 3.5)
    there = heads(stage.scene, person, bones, times)
    carried = take(oncue, stage.scene, kind)
    now = heads(stage.scene, person, bones, times)
    # Either's few keys are within 3 mm of the motion.
    whole = times == np.round(times)
    bound = 0.006 if few else 0.0005
    assert np.linalg.norm(now - there, axis=2)[whole].max() < bound
    assert np.linalg.norm(now - there, axis=2).max() < max(bound, 0.002)
    # What carries goes along the floor under the hips, and turns about the vertical alone.
    carrier = heads(stage.scene, person, ["root"], times)[:, 0]
    hips = now[:, bones.index("pelvis")]
    away = (person.data.bones["root"].head_local - person.data.bones["pelvis"].head_local).xy.length
    assert np.linalg.norm((carrier - hips)[:, :2], axis=1) == pytest.approx(away, abs=0.005)
    assert carrier[:, 2] == pytest.approx(person.data.bones["root"].head_local.z, abs=0.002)
    # It ends facing as the cue does, along -X.
    stage.scene.frame_set(int(carried.frame_range[1]))
    posed = person.evaluated_get(stage.evaluated_depsgraph_get())
    ahead = posed.matrix_world @ posed.pose.bones["root"].matrix @ person.data.bones["root"].matrix_local.inverted()
    ahead = ahead.to_3x3() @ Vector((0.0, -1.0, 0.0))
    assert abs(ahead[2]) < 1e-3
    assert ahead[0] < -0.9
    # Another take finds the object where it stood.
    assert bpy.ops.oncue.play_take(name=action.name) == {"FINISHED"}
    stage.scene.frame_set(20)
    assert np.allclose(person.matrix_world, before, atol=1e-5)
    assert np.linalg.norm(heads(stage.scene, person, bones, times) - there, axis=2).max() < 1e-4


def test_few_keys_are_few_on_what_carries_too(stage, oncue):  # noqa: F811
    for kind, name in (("unreal", "BONE"), ("mixamo", "OBJECT")):
        person = chosen(stage, make_person(kind, 1.7))
        action = take(oncue, stage.scene, name)
        paths = ('pose.bones["root"]', "location", "rotation")
        curves = [c for c in oncue("bridge.compat").action_curves(action, person) if c.data_path.startswith(paths)]
        assert len(curves) in (6, 7)
        frames = action.frame_range[1] - action.frame_range[0]
        assert max(len(curve.keyframe_points) for curve in curves) < 0.3 * frames
        for thing in (skin_of(person), person):
            bpy.data.objects.remove(thing)


def test_in_place_nothing_goes_and_the_way_is_kept(stage, oncue, bones_of):  # noqa: F811
    person = chosen(stage, make_person("unreal", 1.6))
    bones = bones_of(person)
    action = take(oncue, stage.scene, "HIPS")
    times = np.arange(1.0, action.frame_range[1], 5.0)
    there = heads(stage.scene, person, bones, times)
    action = take(oncue, stage.scene, "PLACE")
    now = heads(stage.scene, person, bones, times)
    hips = now[:, bones.index("pelvis")]
    assert np.ptp(hips[:, :2], axis=0).max() < 0.02
    assert np.ptp(there[:, bones.index("pelvis"), 0]) > 1.0
    way = oncue("bridge.solved").solved_of(action).way[(times - 1.0).astype(int)]
    composed = np.einsum("tij,tbj->tbi", way[:, :3, :3], now) + way[:, None, :3, 3]
    assert np.linalg.norm(composed - there, axis=2).max() < 0.006


@pytest.mark.parametrize(("kind", "few"), [("BONE", True), ("OBJECT", False), ("PLACE", True)])
def test_resolve_reads_the_way_back(stage, oncue, bones_of, kind, few):  # noqa: F811
    person = chosen(stage, make_person("unreal", 1.6))
    stage.scene.oncue.every_frame = not few
    take(oncue, stage.scene, kind)
    bones = bones_of(person)
    feet = [bones.index("foot_l"), bones.index("foot_r")]
    times = np.arange(50.0, 70.0, 2.0)
    before = heads(stage.scene, person, bones, times)
    stage.scene.frame_set(60)
    arm = person.pose.bones["upperarm_l"]
    arm.rotation_quaternion = arm.rotation_quaternion @ Quaternion((1.0, 0.0, 0.0), 0.6)
    arm.keyframe_insert("rotation_quaternion")
    mine = np.array(arm.rotation_quaternion)
    assert bpy.ops.oncue.resolve() == {"FINISHED"}
    after = heads(stage.scene, person, bones, times)
    assert np.linalg.norm(after - before, axis=2)[:, feet].max() < 0.02
    stage.scene.frame_set(60)
    assert np.allclose(arm.rotation_quaternion, mine, atol=1e-6)
    # And once more: what it kept is still the take's.
    stage.scene.frame_set(40)
    arm.keyframe_insert("rotation_quaternion")
    assert bpy.ops.oncue.resolve() == {"FINISHED"}


def test_resolve_says_that_what_carries_was_changed(stage, oncue):  # noqa: F811
    person = chosen(stage, make_person("unreal", 1.6))
    take(oncue, stage.scene, "BONE")
    stage.scene.frame_set(60)
    root, arm = person.pose.bones["root"], person.pose.bones["upperarm_l"]
    root.location.x += 0.3
    root.keyframe_insert("location")
    arm.rotation_quaternion = arm.rotation_quaternion @ Quaternion((1.0, 0.0, 0.0), 0.6)
    arm.keyframe_insert("rotation_quaternion")
    with pytest.raises(RuntimeError, match="carried by the bone root otherwise than it was written"):
        bpy.ops.oncue.resolve()


def test_what_cannot_carry_is_told_before_the_run(stage):  # noqa: F811
    person = chosen(stage, make_person("mixamo", 1.6))
    stage.scene.oncue.root_motion = "BONE"
    refused("mixamo has no root bone at its feet")
    stage.scene.oncue.root_motion = "OBJECT"
    person.delta_location.x = 0.1
    refused("mixamo hangs on another object, or has a constraint or deltas")


def test_oncues_own_character_is_carried_by_its_object(stage, oncue):  # noqa: F811
    action = take(oncue, stage.scene, "HIPS")
    person = stage.scene.oncue.character
    bones = ["Hips", "LeftFoot", "RightHand", "Head"]
    times = np.arange(1.0, action.frame_range[1], 7.0)
    there = heads(stage.scene, person, bones, times)
    take(oncue, stage.scene, "OBJECT")
    assert np.linalg.norm(heads(stage.scene, person, bones, times) - there, axis=2).max() < 0.006
    assert abs(person.matrix_world.translation.z) < 0.01


def test_a_rigify_rigs_root_carries_it(stage, oncue):  # noqa: F811
    rig = make_rigify(1.8)
    chosen(stage, rig)
    bones = ["DEF-spine", "DEF-foot.L", "DEF-hand.R"]
    action = take(oncue, stage.scene, "HIPS")
    times = np.arange(1.0, action.frame_range[1], 20.0)
    there = heads(stage.scene, rig, bones, times)
    take(oncue, stage.scene, "BONE")
    assert np.linalg.norm(heads(stage.scene, rig, bones, times) - there, axis=2).max() < 0.006
    assert np.ptp(heads(stage.scene, rig, ["root"], times)[:, 0, 0]) > 1.0
