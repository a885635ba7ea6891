"""The artist's keys and pins → constraints, and an edited motion → the touched keys only."""

import dataclasses
import json

import bpy
import numpy as np
import pytest
from mathutils import Quaternion, Vector

from .runs import keys_of, set_quick
from .test_character import evaluated_heads, evaluated_palm, forward_kinematics

FRAMES = 61
START = 11


@pytest.fixture
def take_module(oncue):
    return oncue("bridge.take")


@pytest.fixture
def skeleton(core):
    return core.skeleton()


@pytest.fixture
def motion(oncue, skeleton):
    """A stroll: the root goes along +X and every joint sways."""
    random = np.random.default_rng(5)
    times = np.arange(FRAMES)[:, None, None] / 30.0
    swing = 0.2 * np.sin(2.0 * times + random.uniform(0, 6, (1, 22, 3)))
    rotations = np.concatenate([np.sqrt(1.0 - np.sum(swing**2, axis=-1, keepdims=True)), swing], axis=-1)
    positions = np.stack([times[:, 0, 0], 0.0 * times[:, 0, 0], 0.93 + 0.0 * times[:, 0, 0]], axis=1)
    return oncue("motion").Motion(positions.astype(np.float32), rotations.astype(np.float32), 30.0)


@pytest.fixture
def made(oncue, context, skeleton, motion, take_module):
    """Makes the character with the motion as its action, as a run leaves it: (character, action)."""

    def make(rate=30, scale=1.0):
        context.scene.render.fps = rate
        context.scene.oncue.scene_scale = scale
        character = oncue("bridge.armature").make_character(context, skeleton, scale)
        action = oncue("bridge.action_writer").write_action(
            context,
            character,
            list(skeleton["names"]),
            motion,
            name="Stroll",
            start_frame=START,
            metres_per_unit=scale,
        )
        solved = oncue("bridge.solved").solved_take(
            context.scene,
            character,
            list(skeleton["names"]),
            motion,
            np.ones((FRAMES, 2)),
            start_frame=START,
            metres_per_unit=scale,
        )
        oncue("bridge.solved").keep_solved(action, solved)
        context.scene.oncue.character = character
        return character, action

    return make


@pytest.fixture
def take_of(context, take_module, skeleton):
    return lambda character: take_module.Take(context.scene, character, character.animation_data.action, skeleton)


def turn(character, bone, frame, angle, axis=0):
    """Keys a bone as an artist does: shown at the frame, turned on from there, keyed."""
    bpy.context.scene.frame_set(frame)
    posed = character.pose.bones[bone]
    more = [0.0, 0.0, 0.0]
    more[axis] = np.sin(angle / 2)
    posed.rotation_quaternion = posed.rotation_quaternion @ Quaternion((np.cos(angle / 2), *more))
    posed.keyframe_insert("rotation_quaternion", frame=frame)


def select(oncue, character, *names):
    bpy.context.view_layer.objects.active = character
    bpy.ops.object.mode_set(mode="POSE")
    for bone in character.pose.bones:
        oncue("bridge.compat").select_bone(bone, bone.name in names)


# --- what the artist did ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("rate", [24, 30, 60])
def test_nothing_was_keyed_yet(oncue, made, take_of, rate):
    character, _ = made(rate)
    assert take_of(character).artist_keys() == {}
    with pytest.raises(oncue("errors").SceneError, match="Nothing was keyed or pinned"):
        take_of(character).edit()


def test_what_is_kept_survives_saving(oncue, made, take_of, motion, context, tmp_path):
    character, _ = made()
    turn(character, "LeftArm", START + 20, 0.5)
    name = character.name
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "take.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "take.blend"))
    take = take_of(bpy.data.objects[name])
    assert np.array_equal(take.solved.motion.rotations, motion.rotations)
    assert take.artist_keys() == {take.names.index("LeftArm"): {20}}


def test_a_keyed_joint_is_in_the_motion_and_named(made, take_of, motion, skeleton, context):
    character, _ = made()
    frame = START + 20
    turn(character, "LeftForeArm", frame, 0.7)
    posed, keys, constraints = take_of(character).edit()
    assert keys == [{"joint": "LeftForeArm", "frame": 20}]
    assert constraints == []
    # The core's forward kinematics of the keyed frame is what Blender shows.
    heads = evaluated_heads(character, skeleton["names"], [frame])
    assert np.abs(heads[0] - forward_kinematics(skeleton, posed)[20]).max() < 1e-4
    hand = skeleton["names"].index("LeftHand")
    assert np.linalg.norm(heads[0, hand] - forward_kinematics(skeleton, motion)[20, hand]) > 0.05
    # All else is the motion before.
    changed = (posed.rotations != motion.rotations).any(axis=2)
    assert changed.sum() == 1
    assert np.array_equal(posed.root_positions, motion.root_positions)


@pytest.mark.parametrize("frame", [START - 5, START + FRAMES + 40])
def test_a_key_outside_of_the_motion_is_named(oncue, made, take_of, frame):
    character, _ = made()
    turn(character, "LeftForeArm", frame, 0.7)
    last = START + FRAMES - 1
    words = rf"keyed at frame {frame} alone, outside of its motion's frames {START} to {last}: pose a bone"
    with pytest.raises(oncue("errors").SceneError, match=words):
        take_of(character).edit()
    turn(character, "LeftForeArm", START + 20, 0.7)
    assert len(take_of(character).edit()[1]) == 1


def test_a_rotation_of_no_length_is_named_with_the_scenes_frame(oncue, made, take_of):
    character, action = made()
    for curve in oncue("bridge.compat").action_curves(action):
        if curve.data_path == 'pose.bones["LeftArm"].rotation_quaternion':
            curve.keyframe_points[20].co.y = 0.0
    words = rf"LeftArm of Stroll has a rotation of no length at frame {START + 20}, which is none"
    with pytest.raises(oncue("errors").SceneError, match=words):
        take_of(character).edit()


@pytest.mark.parametrize("scale", [1.0, 0.01])
def test_a_moved_root_is_told_in_metres(made, take_of, motion, skeleton, scale):
    character, _ = made(scale=scale)
    frame = START + 30
    bpy.context.scene.frame_set(frame)
    hips = character.pose.bones["Hips"]
    rest = character.data.bones["Hips"].matrix_local.to_3x3()
    # A decimetre to the left of the walker, whatever the unit: pose space is the armature's, which is scaled.
    hips.location = hips.location + rest.inverted() @ Vector((0.0, 0.1, 0.0))
    hips.keyframe_insert("location", frame=frame)
    posed, keys, _ = take_of(character).edit()
    assert keys == [{"joint": "Hips", "frame": 30}]
    expected = motion.root_positions[30] + np.array([0.0, 0.1, 0.0])
    assert posed.root_positions[30] == pytest.approx(expected, abs=1e-4)
    assert np.abs(posed.rotations - motion.rotations).max() < 1e-5


def test_every_keyed_frame_is_named(made, take_of):
    character, _ = made()
    for frame in (20, 21, 40):
        turn(character, "Head", START + frame, 0.4)
    turn(character, "Neck", START + 21, 0.1)
    assert take_of(character).edit()[1] == [
        {"joint": "Neck", "frame": 21},
        *({"joint": "Head", "frame": frame} for frame in (20, 21, 40)),
    ]


def test_between_the_cores_frames_both_are_turned(made, take_of, motion, skeleton):
    """At 24 frames a second the fifth key lies between two of the core's frames."""
    character, _ = made(rate=24)
    angle = 0.6
    turn(character, "Head", START + 5, angle)
    posed, keys, _ = take_of(character).edit()
    assert keys == [{"joint": "Head", "frame": 6}, {"joint": "Head", "frame": 7}]
    head = skeleton["names"].index("Head")
    for frame in (6, 7):
        before, after = (m.rotations[frame, head].astype(float) for m in (motion, posed))
        difference = quaternion_product(before * [1, -1, -1, -1], after)
        assert 2 * np.arcsin(np.linalg.norm(difference[1:])) == pytest.approx(angle, abs=1e-3)


def test_at_sixty_frames_a_second_the_key_on_the_cores_frame_counts(oncue, made, take_of, skeleton):
    character, _ = made(rate=60)
    turn(character, "Head", START + 21, 0.9)
    turn(character, "Head", START + 20, 0.3)
    posed, keys, _ = take_of(character).edit()
    assert keys == [{"joint": "Head", "frame": 10}, {"joint": "Head", "frame": 11}]
    heads = evaluated_heads(character, ["Head"], [START + 20])
    expected = forward_kinematics(skeleton, posed)[10, skeleton["names"].index("Head")]
    assert np.abs(heads[0, 0] - expected).max() < 1e-4


@pytest.mark.parametrize("what", ["key", "pin"])
def test_the_last_frame_may_be_keyed_and_pinned_at_any_rate(oncue, made, take_of, context, what):
    """At 23.976 frames a second the scene's last frame lies beyond the core's, of which it shows the last."""
    context.scene.render.fps_base = 1.001
    character, action = made(24)
    last = round(action.frame_range[1])
    assert (last - START) * 30 / (24 / 1.001) > FRAMES - 1
    if what == "key":
        turn(character, "LeftArm", last, 0.5)
        _, keys, _ = take_of(character).edit()
        assert keys == [{"joint": "LeftArm", "frame": FRAMES - 1}]
    else:
        context.scene.frame_set(last)
        select(oncue, character, "LeftArm")
        bpy.ops.oncue.pin()
        _, _, ((pin),) = take_of(character).edit()
        assert (pin["first_frame"], len(pin["positions"])) == (FRAMES - 1, 1)


def quaternion_product(a, b):
    w = a[0] * b[0] - a[1:] @ b[1:]
    return np.array([w, *(a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:]))])


def take_out(character, bone, frames):
    for frame in frames:
        character.pose.bones[bone].keyframe_delete("rotation_quaternion", frame=START + frame)


def test_what_plays_where_a_key_was_taken_out_stays(oncue, made, take_of, skeleton):
    """Between its neighbours, whatever frames the core has."""
    character, _ = made()
    take_out(character, "LeftArm", range(28, 32))
    take = take_of(character)
    arm = take.names.index("LeftArm")
    assert (take.artist_keys(), take.gaps()) == ({}, {arm: {28, 29, 30, 31}})
    posed, keys, _ = take.edit()
    assert keys == [{"joint": "LeftArm", "frame": frame} for frame in range(28, 32)]
    shown = evaluated_heads(character, skeleton["names"], [START + 30])
    assert np.abs(forward_kinematics(skeleton, posed)[30] - shown[0]).max() < 1e-4
    # Its own posture where nothing is left of a channel.
    take_out(character, "LeftHand", range(FRAMES))
    character.pose.bones["LeftHand"].rotation_quaternion = (0.8, 0.6, 0.0, 0.0)
    take = take_of(character)
    hand = take.names.index("LeftHand")
    assert take.gaps()[hand] == set(range(FRAMES))
    posed, _, _ = take.edit()
    shown = evaluated_heads(character, skeleton["names"], [START + 3])
    assert np.abs(forward_kinematics(skeleton, posed)[3] - shown[0]).max() < 1e-4


def test_an_own_key_that_was_taken_out_is_no_wish_any_more(oncue, made, take_of, motion, skeleton):
    character, action = made()
    pins = oncue("bridge.pins")
    pins.write_pins(action, [pins.Pin("LeftArm", START + 30, START + 30)])
    take_out(character, "LeftArm", [30])
    take = take_of(character)
    assert (take.artist_keys(), take.gaps()) == ({}, {})
    take.write(edited(oncue, motion, skeleton["names"].index("LeftArm"), 20, 40), np.ones((FRAMES, 2)))
    assert np.isfinite(take_of(character).keys.now).all()


def test_what_does_not_fit_is_a_sentence(oncue, made, take_of, context):
    refused = oncue("errors").SceneError
    character, action = made()
    context.scene.render.fps = 25
    with pytest.raises(refused, match="made at 30 frames a second and the scene runs at 25"):
        take_of(character)
    context.scene.render.fps = 30
    character.location.x = 1.0
    context.view_layer.update()
    with pytest.raises(refused, match="Oncue Character itself was moved since Stroll was made"):
        take_of(character)
    character.location.x = 0.0
    context.view_layer.update()
    character.pose.bones["Neck"].rotation_mode = "XYZ"
    with pytest.raises(refused, match="Neck does not turn by quaternions"):
        take_of(character)
    character.pose.bones["Neck"].rotation_mode = "QUATERNION"
    action["oncue_solved"] = action["oncue_solved"][:100]
    with pytest.raises(refused, match="Stroll keeps of its motion is damaged"):
        take_of(character)
    del action["oncue_solved"]
    with pytest.raises(refused, match="Stroll was not made by Oncue"):
        take_of(character)


# --- pins -------------------------------------------------------------------------------------------------------------


def test_a_pin_holds_the_bone_where_it_is(oncue, made, take_of, context, motion, skeleton):
    character, action = made()
    select(oncue, character, "LeftFoot")
    context.scene.frame_set(START + 15)
    assert bpy.ops.oncue.pin(first_frame=START + 10, last_frame=START + 20) == {"FINISHED"}
    (pin,) = oncue("bridge.pins").read_pins(action)
    assert pin.title == f"LeftFoot: place and turn, {START + 10} to {START + 20}"
    (constraint,) = take_of(character).edit()[2]
    assert (constraint["name"], constraint["joint"], constraint["first_frame"]) == ("Pin of LeftFoot", "LeftFoot", 10)
    assert len(constraint["positions"]) == len(constraint["rotations"]) == 11
    foot = skeleton["names"].index("LeftFoot")
    expected = forward_kinematics(skeleton, motion)[15, foot]
    assert np.abs(np.array(constraint["positions"]) - expected).max() < 1e-4
    # And its turn in the world is that of the joint: the product from the root down.
    world, joint, chain = np.array([1.0, 0, 0, 0]), foot, []
    while joint is not None and joint >= 0:
        chain.insert(0, joint)
        joint = skeleton["parents"][joint] if joint else None
    for joint in chain:
        world = quaternion_product(world, motion.rotations[15, joint].astype(float))
    assert abs(np.dot(constraint["rotations"][3], world)) == pytest.approx(1.0, abs=1e-5)


def test_a_pin_at_the_current_frame(oncue, made, take_of, context):
    character, action = made(rate=24)
    select(oncue, character, "LeftHand", "RightHand")
    context.scene.frame_set(START + 4)
    bpy.ops.oncue.pin(rotation=False)
    pins = oncue("bridge.pins").read_pins(action)
    assert [pin.title for pin in pins] == [f"LeftHand: place, {START + 4}", f"RightHand: place, {START + 4}"]
    left, _ = take_of(character).edit()[2]
    assert (left["first_frame"], len(left["positions"]), left.get("rotations")) == (5, 1, None)
    # Once more takes its place; removing one leaves the other.
    bpy.ops.oncue.pin(position=False, rotation=True)
    assert len(oncue("bridge.pins").read_pins(action)) == 2
    bpy.ops.oncue.remove_pin(index=0)
    assert [pin.bone for pin in oncue("bridge.pins").read_pins(action)] == ["RightHand"]
    bpy.ops.oncue.remove_pin(index=0)
    assert "oncue_pins" not in action


def test_bad_pins_are_sentences(oncue, made, context):
    character, action = made()
    with pytest.raises(RuntimeError, match="in pose mode"):
        bpy.ops.oncue.pin()
    select(oncue, character)
    with pytest.raises(RuntimeError, match="No bone of Oncue Character is selected"):
        bpy.ops.oncue.pin(first_frame=START, last_frame=START)
    select(oncue, character, "Head")
    with pytest.raises(RuntimeError, match="Frames 11 to 900 are not within the motion's, 11 to 71"):
        bpy.ops.oncue.pin(first_frame=START, last_frame=900)
    with pytest.raises(RuntimeError, match="before it begins"):
        bpy.ops.oncue.pin(first_frame=START + 5, last_frame=START)
    with pytest.raises(RuntimeError, match="the place, the turn or both"):
        bpy.ops.oncue.pin(first_frame=START, last_frame=START, position=False, rotation=False)
    assert oncue("bridge.pins").read_pins(action) == []
    action["oncue_pins"] = json.dumps([{"bone": "Head"}])
    assert oncue("bridge.pins").read_pins(action) == []


# --- solved by the core -----------------------------------------------------------------------------------------------


@pytest.fixture
def sitting(oncue, context, core, fixtures):
    """A synthesized take of the stool's task: (character, action)."""
    fixtures.stool_alone()
    set_quick(bpy.context.scene)
    assert bpy.ops.oncue.synthesize() == {"FINISHED"}
    character = bpy.context.scene.oncue.character
    return character, character.animation_data.action


def unpacked(keys):
    return {channel: np.frombuffer(values, dtype=np.float32).reshape(-1, 2) for channel, values in keys.items()}


def key_at(keys, channel, frame):
    """The one key of a channel at a frame, bit for bit."""
    (key,) = keys[channel][keys[channel][:, 0] == frame]
    return key.tobytes()


def plays_of(oncue, action):
    """What each channel plays at each frame."""
    first, last = map(round, action.frame_range)
    return {
        (curve.data_path, curve.array_index): np.array([curve.evaluate(frame) for frame in range(first, last + 1)])
        for curve in oncue("bridge.compat").action_curves(action)
    }


def test_resolve_keeps_the_key_and_fits_the_frames_around(oncue, sitting, skeleton):
    character, action = sitting
    frame = round(action.frame_range[1]) - 20
    plays = plays_of(oncue, action)
    turn(character, "RightForeArm", frame, 0.6, axis=2)
    keyed = unpacked(keys_of(oncue, action))
    assert bpy.ops.oncue.resolve() == {"FINISHED"}
    after = unpacked(keys_of(oncue, action))
    assert character.animation_data.action == action
    own = sorted(channel for channel in keyed if "RightForeArm" in channel[0])
    for channel in own:
        assert key_at(after, channel, frame) == key_at(keyed, channel, frame)
    now, first = plays_of(oncue, action), round(action.frame_range[0])
    changed = np.zeros(len(now[own[0]]), dtype=bool)
    for channel, values in now.items():
        changed |= values != plays[channel]
    span, at = np.flatnonzero(changed), frame - first
    assert span[0] > 0
    assert span[0] < at < span[-1]
    assert span[-1] - span[0] < 100, "only the frames around adapt"
    # The arm comes and goes where it popped before: no frame turns by more than a fraction of the 0.6 that was keyed.
    forearm = np.stack([now[channel] for channel in own], axis=1)
    forearm /= np.linalg.norm(forearm, axis=1, keepdims=True)
    steps = 2 * np.arccos(np.clip(np.abs(np.sum(forearm[1:] * forearm[:-1], axis=1)), 0, 1))
    assert steps[at - 10 : at + 10].max() < 0.35
    lines = oncue("panels").result_lines(oncue("bridge.session").current_report(bpy.context.scene))
    assert any("RightForeArm" in line and icon == "CHECKMARK" for line, icon in lines)
    # A second solve finds the same key, and it still stays.
    assert bpy.ops.oncue.resolve() == {"FINISHED"}
    again = unpacked(keys_of(oncue, action))
    for channel in own:
        assert key_at(again, channel, frame) == key_at(keyed, channel, frame)


def test_resolve_holds_a_pinned_hand_in_place(oncue, sitting, context):
    character, action = sitting
    last = round(action.frame_range[1])
    context.scene.frame_set(last - 30)
    select(oncue, character, "LeftHand")
    bpy.ops.oncue.pin(first_frame=last - 45, last_frame=last - 15, rotation=False)
    pin = np.array(oncue("bridge.pins").read_pins(action)[0].position)
    assert bpy.ops.oncue.resolve() == {"FINISHED"}
    heads = evaluated_heads(character, ["LeftHand"], range(last - 45, last - 14))
    assert np.linalg.norm(heads[:, 0] - pin, axis=1).max() < 0.01


def test_the_report_is_of_the_motion_as_it_is_after_a_solve(oncue, sitting, core):
    """Whoever keys the person away from the seat is told so, and nothing of the take before."""
    character, action = sitting
    session = oncue("bridge.session")
    before = session.current_report(bpy.context.scene)
    assert before["cues"][0]["met"], before["problems"]
    last = round(action.frame_range[1])
    hips = character.pose.bones["Hips"]
    for frame in range(round(action.frame_range[0]) + round(before["cues"][0]["frame"] * 0.8) - 2, last + 1):
        bpy.context.scene.frame_set(frame)
        world = character.matrix_world @ hips.matrix
        world.translation.x += 0.4
        hips.matrix = character.matrix_world.inverted() @ world
        hips.keyframe_insert("location", frame=frame)
    assert bpy.ops.oncue.resolve() == {"FINISHED"}
    after = session.current_report(bpy.context.scene)
    assert after["cues"][0]["pelvis_cm"] == pytest.approx(before["cues"][0]["pelvis_cm"] + 40, abs=8)
    assert not after["success"]
    assert any("was missed by" in problem for problem in after["problems"])
    assert after["foot"] != before["foot"]
    shown = [line for line, _ in oncue("panels").result_lines(after)]
    assert shown[0] == "Sit: not met"
    # What was true of the run stays.
    assert (after["seed"], after["settings"]) == (before["seed"], before["settings"])
    assert after["body"]["pose_distance"] not in (None, before["body"]["pose_distance"])
    assert after["extension"]["captures"] == before["extension"]["captures"]


GONE = {
    "file": lambda told: told["library"].update(paths=["/nowhere/mocap"]),
    "word": lambda told: told["library"].update(starter=7),
    "all": lambda told: told.pop("library"),
}


@pytest.mark.parametrize("gone", GONE)
def test_a_library_that_is_gone_is_no_reason_to_refuse_an_edit(oncue, sitting, gone):
    character, action = sitting
    report = json.loads(action["oncue_report"])
    GONE[gone](report["extension"])
    action["oncue_report"] = json.dumps(report)
    turn(character, "RightForeArm", round(action.frame_range[1]) - 20, 0.6, axis=2)
    assert bpy.ops.oncue.resolve() == {"FINISHED"}
    after = oncue("bridge.session").current_report(bpy.context.scene)
    assert after["artist"]["constraints"]
    assert after["body"]["pose_distance"] is None


def test_a_library_that_has_changed_since_tells_nothing_of_the_motion(oncue, sitting, context):
    character, action = sitting
    report = json.loads(action["oncue_report"])
    report["library_checksum"] = "of another one"
    action["oncue_report"] = json.dumps(report)
    turn(character, "RightForeArm", round(action.frame_range[1]) - 20, 0.6, axis=2)
    assert bpy.ops.oncue.resolve() == {"FINISHED"}
    assert oncue("bridge.session").current_report(context.scene)["body"]["pose_distance"] is None


def test_what_cannot_be_resolved_is_a_sentence(oncue, sitting, context):
    character, action = sitting
    keys = keys_of(oncue, action)
    with pytest.raises(RuntimeError, match="Nothing was keyed or pinned"):
        bpy.ops.oncue.resolve()
    frame = round(action.frame_range[1]) - 20
    context.scene.frame_set(frame)
    select(oncue, character, "LeftHand")
    bpy.ops.oncue.pin()
    pins = oncue("bridge.pins")
    (pin,) = pins.read_pins(action)
    far = tuple(c + 3.0 for c in pin.position)
    pins.write_pins(action, [dataclasses.replace(pin, position=far)])
    with pytest.raises(RuntimeError, match="Pin of LeftHand"):
        bpy.ops.oncue.resolve()
    assert keys_of(oncue, action) == keys
    bpy.context.scene.oncue.character = None
    with pytest.raises(RuntimeError, match="no motion yet"):
        bpy.ops.oncue.resolve()


def test_keys_that_change_while_it_solves_are_not_overwritten(oncue, sitting, context, core):
    character, action = sitting
    frame = round(action.frame_range[1]) - 20
    turn(character, "Head", frame, 0.3)
    session, pipeline = oncue("bridge.session"), oncue("pipeline")
    request, take, said = session.read_edit(context)
    edited = pipeline.run_blocking(pipeline.edit_steps(request, pipeline.LibraryCache()))
    turn(character, "Neck", frame, 0.3)
    keys = keys_of(oncue, action)
    with pytest.raises(oncue("errors").SceneError, match="changed while it was solving"):
        session.write_edit(context, request, take, edited, said)
    assert keys_of(oncue, action) == keys
    # Nor is another action, which is played by then.
    other = action.copy()
    oncue("bridge.compat").replace_action(character, other)
    with pytest.raises(oncue("errors").SceneError, match="plays another action than the one that was solved"):
        session.write_edit(context, request, take, edited, said)
    assert keys_of(oncue, other) == keys


def test_a_hand_follows_its_cue_in_the_action(oncue, context, core, fixtures):
    """Synthesize with a hand cue on something that moves: the palm is where the cue is, frame by frame."""
    fixtures.stop_by_table()
    set_quick(context.scene)
    assert bpy.ops.oncue.synthesize() == {"FINISHED"}
    walk = context.scene.oncue.character.animation_data.action
    first = round(walk.frame_range[1]) - 10
    cue = oncue("bridge.cue_objects").place_hand(context, "right_hand", first, first + 30, 1.0)
    for frame, place in ((first, (0.0, 0.75, 1.0)), (first + 30, (0.15, 0.80, 1.15))):
        cue.location = place
        cue.keyframe_insert("location", frame=frame)
    assert bpy.ops.oncue.synthesize() == {"FINISHED"}
    character = context.scene.oncue.character
    for frame in range(first, first + 31, 5):
        assert (evaluated_palm(character, "Right", frame) - cue.matrix_world.translation).length < 0.01


# --- back into the action ---------------------------------------------------------------------------------------------


def edited(oncue, motion, joint, first, last):
    """The motion with one joint turned and the root raised over some frames, as the core would give it."""
    rotations, positions = motion.rotations.copy(), motion.root_positions.copy()
    half = 0.2
    for frame in range(first, last + 1):
        spin = np.array([np.cos(half), np.sin(half), 0, 0])
        rotations[frame, joint] = quaternion_product(rotations[frame, joint].astype(float), spin)
        positions[frame, 2] += 0.05
    return oncue("motion").Motion(positions, rotations, 30.0)


@pytest.mark.parametrize("rate", [24, 30, 60])
def test_only_the_touched_span_changes(oncue, made, take_of, motion, skeleton, rate):
    character, action = made(rate)
    before = keys_of(oncue, action)
    arm = skeleton["names"].index("RightArm")
    new = edited(oncue, motion, arm, 20, 30)
    first, last = take_of(character).write(new, np.ones((FRAMES, 2)))
    # The frames between the last that stays and the first that stays again.
    assert first == START + int(np.floor(19 * rate / 30)) + 1
    assert last == START + int(np.ceil(31 * rate / 30)) - 1
    after = keys_of(oncue, action)
    assert set(after) == set(before)
    for channel, keys in after.items():
        old, now = (np.frombuffer(k, dtype=np.float32).reshape(-1, 2) for k in (before[channel], keys))
        outside = (old[:, 0] < first) | (old[:, 0] > last)
        assert old[outside].tobytes() == now[outside].tobytes()
        assert np.array_equal(old[:, 0], now[:, 0])
    frames = START + np.arange(len(take_of(character).keys.now))
    expected = forward_kinematics(skeleton, oncue("motion").resample(new, rate))
    assert np.abs(evaluated_heads(character, skeleton["names"], frames) - expected).max() < 1e-4
    # What was written is what is kept: nothing looks like the artist's.
    assert take_of(character).artist_keys() == {}


def test_the_artists_keys_stay_and_are_kept_for_the_next_time(oncue, made, take_of, motion, skeleton):
    character, action = made()
    turn(character, "RightForeArm", START + 25, 0.9)
    path = ('pose.bones["RightForeArm"].rotation_quaternion', 2)
    keyed = np.frombuffer(keys_of(oncue, action)[path], dtype=np.float32).reshape(-1, 2)[25].copy()
    new = edited(oncue, motion, skeleton["names"].index("RightForeArm"), 20, 30)
    take_of(character).write(new, np.ones((FRAMES, 2)))
    now = np.frombuffer(keys_of(oncue, action)[path], dtype=np.float32).reshape(-1, 2)
    assert now[25].tobytes() == keyed.tobytes()
    assert now[24].tobytes() != keyed.tobytes()
    (pin,) = oncue("bridge.pins").read_pins(action)
    assert pin.title == f"RightForeArm: key, {START + 25}"
    again = take_of(character)
    assert again.artist_keys() == {again.names.index("RightForeArm"): {25}}
    assert again.edit()[1] == [{"joint": "RightForeArm", "frame": 25}]


def test_keys_that_were_taken_out_stay_out(oncue, made, take_of, motion, skeleton):
    """A take that somebody thinned out is not filled up again."""
    character, action = made()
    take_out(character, "RightArm", range(22, 28))
    before = keys_of(oncue, action)
    new = edited(oncue, motion, skeleton["names"].index("RightArm"), 20, 30)
    take_of(character).write(new, np.ones((FRAMES, 2)))
    for (path, axis), keys in keys_of(oncue, action).items():
        old, now = (np.frombuffer(k, dtype=np.float32).reshape(-1, 2) for k in (before[path, axis], keys))
        assert np.array_equal(old[:, 0], now[:, 0])
    assert take_of(character).gaps() == {skeleton["names"].index("RightArm"): set(range(22, 28))}


def test_an_unchanged_motion_changes_no_key(oncue, made, take_of, motion):
    character, action = made()
    before = keys_of(oncue, action)
    assert take_of(character).write(motion, np.ones((FRAMES, 2))) is None
    assert keys_of(oncue, action) == before
