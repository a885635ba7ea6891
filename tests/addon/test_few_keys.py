"""Takes of few keys: how near they are to the motion, what the artist does to them, and what Re-solve leaves of it."""

import base64
import io
import itertools
import json

import bpy
import numpy as np
import pytest
from mathutils import Quaternion

from .runs import current_action, set_quick
from .test_character import evaluated_heads, forward_kinematics
from .test_edit import FRAMES, START, edited, motion, select, turn  # noqa: F401

#: Hands, ankles, toes and hips: no further from the motion than this, metres.
WATCHED = ("Hips", "LeftHand", "RightHand", "LeftFoot", "LeftToe", "RightFoot", "RightToe")
TOLERANCE = 0.003
#: What two evaluations of the same motion differ by at most, metres.
ROUNDING = 2e-5
LIMBS = (
    ("Hips",),
    ("Spine", "Spine1", "Spine2", "Neck", "Head"),
    ("LeftShoulder", "LeftArm", "LeftForeArm", "LeftHand"),
    ("RightShoulder", "RightArm", "RightForeArm", "RightHand"),
    ("LeftUpLeg", "LeftLeg", "LeftFoot", "LeftToe"),
    ("RightUpLeg", "RightLeg", "RightFoot", "RightToe"),
)


@pytest.fixture
def skeleton(core):
    return core.skeleton()


@pytest.fixture(scope="session")
def take_file(tmp_path_factory):
    """Where the take is kept that the tests begin with."""
    return tmp_path_factory.mktemp("takes") / "stool.blend"


@pytest.fixture
def sitting(oncue, context, core, fixtures, take_file):
    """A synthesized take of the stool's task, made once: (character, action)."""
    if not take_file.exists():
        fixtures.stool_alone()
        set_quick(bpy.context.scene)
        assert bpy.ops.oncue.synthesize() == {"FINISHED"}
        bpy.ops.wm.save_as_mainfile(filepath=str(take_file))
    bpy.ops.wm.open_mainfile(filepath=str(take_file))
    character = bpy.context.scene.oncue.character
    return character, character.animation_data.action


@pytest.fixture
def take_of(oncue, skeleton):
    def take(character):
        return oncue("bridge.take").Take(bpy.context.scene, character, character.animation_data.action, skeleton)

    return take


def curves(oncue, action):
    return {(c.data_path, c.array_index): c for c in oncue("bridge.compat").action_curves(action)}


def of_bone(oncue, action, bone, channel="rotation_quaternion"):
    return [c for (path, _), c in sorted(curves(oncue, action).items()) if path == f'pose.bones["{bone}"].{channel}']


def frozen(oncue, action):
    """Each key of an action with all that belongs to it: (path, axis) → {frame: bytes}."""
    read = oncue("bridge.curves").read_places
    return {
        name: {float(row[0]): row.tobytes() for row in read(curve)} for name, curve in curves(oncue, action).items()
    }


def played(oncue, action, step=0.5):
    first, last = action.frame_range
    times = np.arange(first, last + step / 2, step)
    return times, {name: np.array([curve.evaluate(t) for t in times]) for name, curve in curves(oncue, action).items()}


def joints_of(take, bones):
    return {take.names.index(bone) for bone in bones}


def heads_at(character, names, times):
    out = []
    for time in times:
        bpy.context.scene.frame_set(int(np.floor(time)), subframe=float(time - np.floor(time)))
        posed = character.evaluated_get(bpy.context.evaluated_depsgraph_get())
        out.append([posed.matrix_world @ posed.pose.bones[name].head for name in names])
    return np.array(out)


def turns_at(character, names, frames):
    out = []
    for frame in frames:
        bpy.context.scene.frame_set(int(frame))
        posed = character.evaluated_get(bpy.context.evaluated_depsgraph_get())
        out.append([posed.pose.bones[name].matrix_basis.to_quaternion() for name in names])
    return np.array(out)


def dense_twin(oncue, action, character, skeleton):
    """The same motion with a key on every frame, played by the character; its action."""
    solved = oncue("bridge.solved").solved_of(action)
    return oncue("bridge.action_writer").write_action(
        bpy.context, character, list(skeleton["names"]), solved.motion, name="Dense", start_frame=solved.start_frame
    )


def play(oncue, character, action):
    oncue("bridge.compat").replace_action(character, action)


# --- what is written --------------------------------------------------------------------------------------------------


def test_a_take_has_few_keys_and_keeps_to_the_motion(oncue, sitting, skeleton):
    character, action = sitting
    names = list(skeleton["names"])
    first, last = map(int, action.frame_range)
    times = np.arange(first, last + 0.25, 0.5)
    written = curves(oncue, action)
    keys = sum(len(curve.keyframe_points) for curve in written.values())
    assert keys <= 0.12 * len(written) * (last - first + 1)
    few, few_turns = heads_at(character, WATCHED, times), turns_at(character, names, times[::2])
    dense_twin(oncue, action, character, skeleton)
    dense, dense_turns = heads_at(character, WATCHED, times), turns_at(character, names, times[::2])
    assert np.linalg.norm(few[::2] - dense[::2], axis=2).max() <= TOLERANCE + ROUNDING
    # Between frames the motion goes on as its frames do, and not in straight lines.
    line = dense[::2]
    line = np.concatenate([2 * line[:1] - line[1:2], line, 2 * line[-1:] - line[-2:-1]])
    between = (9 * (line[1:-2] + line[2:-1]) - line[:-3] - line[3:]) / 16
    assert np.linalg.norm(few[1::2] - between, axis=2).max() <= TOLERANCE + 3e-4
    apart = np.clip(np.abs(np.sum(few_turns * dense_turns, axis=-1)), 0.0, 1.0)
    assert np.degrees(2 * np.arccos(apart)).max() <= 1.02


def test_what_stands_does_not_drift(oncue, sitting, skeleton):
    character, action = sitting
    first, last = map(int, action.frame_range)
    frames = range(first, last + 1)
    solved = oncue("bridge.solved").solved_of(action)
    planted = oncue("key_fit").planted_frames(solved.contacts, 30.0, 30.0, len(frames))
    few = evaluated_heads(character, WATCHED, frames)
    dense_twin(oncue, action, character, skeleton)
    dense = evaluated_heads(character, WATCHED, frames)
    for side, bones in enumerate((("LeftFoot", "LeftToe"), ("RightFoot", "RightToe"))):
        steady = planted[1:, side] & planted[:-1, side]
        assert steady.sum() > 30
        for bone in bones:
            way = [np.linalg.norm(np.diff(heads[:, WATCHED.index(bone)], axis=0), axis=1) for heads in (few, dense)]
            assert (way[0] - way[1])[steady].max() <= 0.002


def test_a_limb_shares_its_keys_and_its_steps_have_some(oncue, sitting):
    _, action = sitting
    solved = oncue("bridge.solved").solved_of(action)
    frames = {}
    for limb in LIMBS:
        found = {
            tuple(point.co.x for point in curve.keyframe_points)
            for bone in limb
            for channel in ("rotation_quaternion", "location")
            for curve in of_bone(oncue, action, bone, channel)
        }
        assert len(found) == 1
        frames[limb] = {round(frame) - solved.start_frame for frame in found.pop()}
    planted = oncue("key_fit").planted_frames(solved.contacts, 30.0, 30.0, len(solved.keys))
    for side, limb in enumerate(LIMBS[-2:]):
        (turns,) = np.nonzero(planted[1:, side] != planted[:-1, side])
        assert len(turns) > 4
        for frame in turns:
            assert (frame + 1 if planted[frame + 1, side] else frame) in frames[limb]


def test_keys_are_bezier_and_typed_as_the_runs(oncue, sitting):
    _, action = sitting
    assert action.use_frame_range
    for curve in curves(oncue, action).values():
        assert curve.group.name == curve.data_path.split('"')[1]
        for point in curve.keyframe_points:
            assert (point.interpolation, point.type) == ("BEZIER", "GENERATED")
        points = curve.keyframe_points
        for here, after in itertools.pairwise(points):
            third = (after.co.x - here.co.x) / 3
            assert here.handle_right.x - here.co.x == pytest.approx(third, abs=1e-3)
            assert after.co.x - after.handle_left.x == pytest.approx(third, abs=1e-3)
    # Whatever Blender looks at anew stays as it is.
    before = frozen(oncue, action)
    for curve in curves(oncue, action).values():
        curve.update()
    assert frozen(oncue, action) == before


def test_a_nearer_tolerance_takes_more_keys_and_every_frame_stays_a_choice(oncue, sitting, context):
    _, action = sitting
    count = len(curves(oncue, action)['pose.bones["LeftFoot"].rotation_quaternion', 0].keyframe_points)
    context.scene.oncue.key_tolerance = 0.5
    assert bpy.ops.oncue.synthesize() == {"FINISHED"}
    finer = len(curves(oncue, current_action())['pose.bones["LeftFoot"].rotation_quaternion', 0].keyframe_points)
    assert finer > 1.2 * count
    context.scene.oncue.every_frame = True
    assert bpy.ops.oncue.synthesize() == {"FINISHED"}
    dense = current_action()
    first, last = dense.frame_range
    for curve in curves(oncue, dense).values():
        assert [point.co.x for point in curve.keyframe_points] == list(range(int(first), int(last) + 1))
        assert {point.interpolation for point in curve.keyframe_points} == {"LINEAR"}
    # Its form is that of the takes before there were few keys.
    assert oncue("bridge.solved").solved_of(dense).written is None


@pytest.mark.parametrize("rate", [24, 60])
def test_at_another_frame_rate(oncue, context, core, fixtures, skeleton, rate):
    fixtures.stool_alone()
    set_quick(bpy.context.scene)
    bpy.context.scene.render.fps = rate
    assert bpy.ops.oncue.synthesize() == {"FINISHED"}
    action = current_action()
    character = bpy.context.scene.oncue.character
    first, last = map(int, action.frame_range)
    few = evaluated_heads(character, WATCHED, range(first, last + 1))
    dense_twin(oncue, action, character, skeleton)
    dense = evaluated_heads(character, WATCHED, range(first, last + 1))
    assert np.linalg.norm(few - dense, axis=2).max() <= TOLERANCE + ROUNDING


def test_a_scene_of_centimetres_has_the_same_keys(oncue, context, skeleton, sitting):
    """The tolerance is the person's, whatever a unit is."""
    _, action = sitting
    solved = oncue("bridge.solved").solved_of(action)
    counts = {}
    for scale in (1.0, 0.01):
        bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
        bpy.context.scene.render.fps = 30
        made = oncue("bridge.armature").make_character(bpy.context, skeleton, scale)
        written = oncue("bridge.action_writer").write_action(
            bpy.context,
            made,
            list(skeleton["names"]),
            solved.motion,
            name="Take",
            start_frame=1,
            metres_per_unit=scale,
            contacts=solved.contacts,
            tolerance_mm=3.0,
        )
        counts[scale] = [len(curve.keyframe_points) for curve in curves(oncue, written).values()]
    assert np.abs(np.subtract(counts[1.0], counts[0.01])).max() <= 1


def test_a_bone_that_turns_by_angles_has_few_keys_where_angles_can_follow(oncue, context, skeleton, sitting):
    character, action = sitting
    solved, head = oncue("bridge.solved").solved_of(action), character.pose.bones["Head"]

    def written(mode, tolerance=3.0):
        head.rotation_mode = mode
        return oncue("bridge.action_writer").write_action(
            bpy.context,
            character,
            list(skeleton["names"]),
            solved.motion,
            name="Take",
            start_frame=1,
            tolerance_mm=tolerance,
        )

    def shown():
        times = np.arange(1.0, len(solved.keys), 0.5)
        found = []
        for time in times:
            context.scene.frame_set(int(time), subframe=time % 1.0)
            found.append(head.matrix_basis.to_quaternion())
        return np.array(found)

    written("QUATERNION")
    before = shown()
    counts = [len(curve.keyframe_points) for curve in of_bone(oncue, written("XYZ"), "Head", "rotation_euler")]
    assert len(set(counts)) == 1
    assert counts[0] < 60
    apart = np.abs(np.sum(before * shown(), axis=1)).clip(0.0, 1.0)
    assert np.degrees(2.0 * np.arccos(apart.min())) < 0.3
    # By an axis and an angle, which no handles can follow: on every frame.
    by_axis = of_bone(oncue, written("AXIS_ANGLE"), "Head", "rotation_axis_angle")
    assert [len(curve.keyframe_points) for curve in by_axis] == [len(solved.keys)] * 4


def test_angles_that_cannot_follow_are_keyed_on_every_frame(oncue):
    fit, channels = oncue("key_fit"), oncue("bridge.channels")

    def in_angles(axis, degrees):
        turns = np.array([Quaternion(axis, np.radians(degrees * k / 10.0)) for k in range(11)], dtype=np.float64)
        slopes = np.gradient(turns, axis=0, edge_order=2)
        keys = fit.BoneKeys(np.array([0, 10]), turns[[0, 10]], slopes[[0, 10]], slopes[[0, 10]])
        return channels.angle_keys(keys, channels.rotation_values("XYZ", turns)[1], "XYZ", np.radians(0.25))

    assert in_angles((1.0, 0.0, 0.0), 30.0) is not None
    assert in_angles((0.6, 0.6, 0.53), 150.0) is None


# --- an edited motion, without the core ------------------------------------------------------------------------------


@pytest.fixture
def stroll(oncue, context, skeleton, motion):  # noqa: F811
    """Makes the character with a stroll in few keys as its action: (character, action)."""

    def make(rate):
        context.scene.render.fps = rate
        character = oncue("bridge.armature").make_character(context, skeleton)
        context.scene.oncue.character = character
        names, placed = list(skeleton["names"]), {"start_frame": START, "metres_per_unit": 1.0}
        action = oncue("bridge.action_writer").write_action(
            context, character, names, motion, name="Stroll", tolerance_mm=3.0, **placed
        )
        solved = oncue("bridge.solved")
        contacts = np.zeros((FRAMES, 2))
        kept = solved.solved_take(context.scene, character, names, motion, contacts, few=action, **placed)
        solved.keep_solved(action, kept)
        return character, action

    return make


@pytest.mark.parametrize("rate", [24, 30, 60])
@pytest.mark.parametrize(("first", "last"), [(20, 30), (0, 12), (48, FRAMES - 1), (0, FRAMES - 1)])
def test_only_the_span_that_changed_is_fitted_anew(oncue, stroll, take_of, motion, skeleton, rate, first, last):  # noqa: F811
    character, action = stroll(rate)
    before, (times, shown) = frozen(oncue, action), played(oncue, action)
    new = edited(oncue, motion, skeleton["names"].index("RightArm"), first, last)
    low, high = take_of(character).write(new, np.ones((FRAMES, 2)))
    now, (_, plays) = frozen(oncue, action), played(oncue, action)
    assert low <= START + first * rate / 30 + 1
    assert high >= START + last * rate / 30 - 1
    for name, keys in before.items():
        outside = (times < low) | (times > high)
        # Between the seam's key and the first frame after it the curve is new.
        assert np.array_equal(plays[name][outside & (times % 1 == 0)], shown[name][outside & (times % 1 == 0)])
        for frame, key in keys.items():
            if frame < low - 1 or frame > high + 1:
                assert now[name][frame] == key
    frames = np.arange(action.frame_range[0], action.frame_range[1] + 1)
    expected = forward_kinematics(skeleton, oncue("motion").resample(new, rate))
    watched = [skeleton["names"].index(bone) for bone in WATCHED]
    heads = evaluated_heads(character, skeleton["names"], frames)
    away = np.linalg.norm(heads[:, watched] - expected[:, watched], axis=2)
    assert away.max() <= TOLERANCE + ROUNDING
    assert take_of(character).artist_keys() == {}


def test_what_no_frame_of_the_scene_shows_changes_nothing(oncue, stroll, take_of, motion, skeleton):  # noqa: F811
    """At 12 frames a second some of the core's frames lie between two of the scene's and touch neither."""
    character, action = stroll(12)
    before = frozen(oncue, action)
    new = edited(oncue, motion, skeleton["names"].index("RightArm"), 16, 16)
    assert take_of(character).write(new, np.ones((FRAMES, 2))) is None
    assert frozen(oncue, action) == before


def test_an_unchanged_motion_changes_no_key(oncue, stroll, take_of, motion):  # noqa: F811
    character, action = stroll(30)
    before = frozen(oncue, action)
    assert take_of(character).write(motion, np.ones((FRAMES, 2))) is None
    assert frozen(oncue, action) == before


# --- what the artist does ---------------------------------------------------------------------------------------------


def middle(action, share=0.6):
    first, last = action.frame_range
    return round(first + share * (last - first))


def keys_between(curve, first, last):
    return [point for point in curve.keyframe_points if first <= point.co.x <= last]


def a_key(oncue, action, bone, share=0.6):
    """The place of a key of a bone near the middle, and its frame."""
    frames = [point.co.x for point in of_bone(oncue, action, bone)[0].keyframe_points]
    at = int(np.argmin(np.abs(np.array(frames) - middle(action, share))))
    return at, round(frames[at])


def pin_something(oncue, character, bone="LeftHand", share=0.6):
    """Something else to solve for."""
    bpy.context.scene.frame_set(middle(character.animation_data.action, share))
    select(oncue, character, bone)
    assert bpy.ops.oncue.pin(rotation=False) == {"FINISHED"}
    bpy.ops.object.mode_set(mode="OBJECT")


def test_nothing_is_the_artists_yet_even_after_saving(oncue, sitting, take_of, tmp_path):
    character, _ = sitting
    assert take_of(character).artist_keys() == {}
    name = character.name
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "take.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "take.blend"))
    assert take_of(bpy.data.objects[name]).artist_keys() == {}
    with pytest.raises(RuntimeError, match="Nothing was keyed or pinned"):
        bpy.ops.oncue.resolve()


def test_a_new_key_holds_from_key_to_key_and_stays_bit_for_bit(oncue, sitting, take_of):
    character, action = sitting
    at, before = a_key(oncue, action, "RightForeArm")
    after = round(of_bone(oncue, action, "RightForeArm")[0].keyframe_points[at + 1].co.x)
    assert after - before > 2
    frame = (before + after) // 2
    untouched = frozen(oncue, action)
    turn(character, "RightForeArm", frame, 0.6, axis=2)
    take, start = take_of(character), int(action.frame_range[0])
    joint = take.names.index("RightForeArm")
    assert take.artist_keys() == {joint: set(range(before - start, after - start + 1))}
    keyed, (times, shown) = frozen(oncue, action), played(oncue, action)
    assert bpy.ops.oncue.resolve() == {"FINISHED"}
    now, (_, plays) = frozen(oncue, action), played(oncue, action)
    for axis in range(4):
        name = ('pose.bones["RightForeArm"].rotation_quaternion', axis)
        assert now[name][frame] == keyed[name][frame]
        inside = (times >= before) & (times <= after)
        assert np.array_equal(plays[name][inside], shown[name][inside])
        kinds = {point.co.x: point.type for point in curves(oncue, action)[name].keyframe_points}
        assert kinds[frame] == "KEYFRAME"
        assert kinds[kept_frame(untouched, now, name)] == "GENERATED"
    # Whatever is not between two keys around the change is as it was, to the bit.
    moved = np.zeros(len(times), dtype=bool)
    for name in plays:
        moved |= plays[name] != shown[name]
    low, high = times[moved].min(), times[moved].max()
    assert low > action.frame_range[0] + 30
    for name, keys in keyed.items():
        for key, stored in keys.items():
            if key < low - 1 or key > high + 1:
                assert now[name][key] == stored
    # And the next look finds the same.
    assert take_of(character).artist_keys() == {joint: set(range(before - start, after - start + 1))}
    again = frozen(oncue, action)
    assert bpy.ops.oncue.resolve() == {"FINISHED"}
    for axis in range(4):
        name = ('pose.bones["RightForeArm"].rotation_quaternion', axis)
        assert frozen(oncue, action)[name][frame] == again[name][frame]


def kept_frame(before, now, name):
    """A frame at which a curve has the key that it had before."""
    return next(frame for frame, key in before[name].items() if now[name].get(frame) == key)


def test_what_is_written_back_keeps_to_the_edited_motion(oncue, sitting, skeleton):
    character, action = sitting
    turn(character, "RightForeArm", middle(action), 0.6, axis=2)
    assert bpy.ops.oncue.resolve() == {"FINISHED"}
    first, last = map(int, action.frame_range)
    few = evaluated_heads(character, WATCHED, range(first, last + 1))
    keys = sum(len(curve.keyframe_points) for curve in curves(oncue, action).values())
    assert keys <= 0.15 * 91 * (last - first + 1)
    dense_twin(oncue, action, character, skeleton)
    dense = evaluated_heads(character, WATCHED, range(first, last + 1))
    assert np.linalg.norm(few - dense, axis=2).max() <= TOLERANCE + ROUNDING


MOVES = {
    "value": lambda point: setattr(point.co, "y", point.co.y + 0.08),
    "time": lambda point: setattr(point.co, "x", point.co.x + 2.0),
    "between frames": lambda point: setattr(point.co, "x", point.co.x + 0.5),
    "handle": lambda point: setattr(point.handle_right, "y", point.handle_right.y + 0.08),
}


@pytest.mark.parametrize("what", MOVES)
def test_a_moved_key_and_a_dragged_handle_are_the_artists(oncue, sitting, take_of, what):
    character, action = sitting
    at, _ = a_key(oncue, action, "LeftArm")
    for curve in of_bone(oncue, action, "LeftArm"):
        for point in curve.keyframe_points:
            point.handle_left_type = point.handle_right_type = "FREE"
        MOVES[what](curve.keyframe_points[at])
        curve.update()
    take = take_of(character)
    assert set(take.artist_keys()) == joints_of(take, ["LeftArm"])
    (frames,) = take.artist_keys().values()
    keyed = [float(point.co.x) for point in of_bone(oncue, action, "LeftArm")[0].keyframe_points]
    start = action.frame_range[0]
    # From the key before to the key after; only the handle's own side.
    assert min(frames) + start == keyed[at if what == "handle" else at - 1]
    assert max(frames) + start == keyed[at + 1]
    stored, (times, shown) = frozen(oncue, action), played(oncue, action)
    assert bpy.ops.oncue.resolve() == {"FINISHED"}
    now, (_, plays) = frozen(oncue, action), played(oncue, action)
    inside = (times >= keyed[at]) & (times <= keyed[at + 1])
    for axis in range(4):
        name = ('pose.bones["LeftArm"].rotation_quaternion', axis)
        if what != "handle":
            assert now[name][keyed[at]] == stored[name][keyed[at]]
            assert curves(oncue, action)[name].keyframe_points[list(now[name]).index(keyed[at])].type == "KEYFRAME"
        assert np.array_equal(plays[name][inside], shown[name][inside])
    assert set(take_of(character).artist_keys()) == joints_of(take, ["LeftArm"])


def test_where_keys_were_taken_out_what_plays_stays(oncue, sitting, take_of):
    character, action = sitting
    at, first = a_key(oncue, action, "LeftForeArm")
    last = round(of_bone(oncue, action, "LeftForeArm")[0].keyframe_points[at + 3].co.x)
    for curve in of_bone(oncue, action, "LeftForeArm"):
        for _ in range(2):
            curve.keyframe_points.remove(curve.keyframe_points[at + 1])
        curve.update()
    take, start = take_of(character), int(action.frame_range[0])
    joint = take.names.index("LeftForeArm")
    assert take.artist_keys() == {joint: set(range(first - start, last - start + 1))}
    times, shown = played(oncue, action)
    assert bpy.ops.oncue.resolve() == {"FINISHED"}
    _, plays = played(oncue, action)
    inside = (times >= first) & (times <= last)
    for axis in range(4):
        name = ('pose.bones["LeftForeArm"].rotation_quaternion', axis)
        assert np.array_equal(plays[name][inside], shown[name][inside])
        assert not [point for point in curves(oncue, action)[name].keyframe_points if first < point.co.x < last]


def test_a_decimated_bone_stays_as_it_plays(oncue, sitting, take_of):
    character, action = sitting
    for curve in of_bone(oncue, action, "Head"):
        for at in reversed(range(1, len(curve.keyframe_points) - 1, 2)):
            curve.keyframe_points.remove(curve.keyframe_points[at])
        curve.update()
    take = take_of(character)
    assert set(take.artist_keys()) == joints_of(take, ["Head"])
    stored = {name: keys for name, keys in frozen(oncue, action).items() if '"Head"' in name[0]}
    turn(character, "RightForeArm", middle(action), 0.6, axis=2)
    assert bpy.ops.oncue.resolve() == {"FINISHED"}
    now = frozen(oncue, action)
    held = take.artist_keys()[take.names.index("Head")]
    start = action.frame_range[0]
    for name, keys in stored.items():
        for frame, key in keys.items():
            if {frame - start - 1, frame - start, frame - start + 1} <= held:
                assert now[name][frame] == key


def test_a_take_that_was_thinned_out_as_a_whole_is_a_sentence(oncue, sitting):
    _, action = sitting
    for curve in curves(oncue, action).values():
        for at in reversed(range(1, len(curve.keyframe_points) - 1)):
            if at % 3:
                curve.keyframe_points.remove(curve.keyframe_points[at])
        curve.update()
    stored = frozen(oncue, action)
    with pytest.raises(RuntimeError, match="moved in time or thinned out"):
        bpy.ops.oncue.resolve()
    assert frozen(oncue, action) == stored


def test_a_take_that_was_moved_in_time_is_a_sentence(oncue, sitting):
    _, action = sitting
    for curve in curves(oncue, action).values():
        for point in curve.keyframe_points:
            point.co.x += 7.0
            point.handle_left.x += 7.0
            point.handle_right.x += 7.0
        curve.update()
    with pytest.raises(RuntimeError, match="moved in time or thinned out"):
        bpy.ops.oncue.resolve()


def test_a_modifier_is_what_the_artist_did(oncue, sitting, take_of):
    character, action = sitting
    first = middle(action)
    for curve in of_bone(oncue, action, "Head"):
        noise = curve.modifiers.new("NOISE")
        noise.strength, noise.scale = 0.1, 3.0
        noise.use_restricted_range, noise.frame_start, noise.frame_end = True, first, first + 20
    take = take_of(character)
    (joint,) = joints_of(take, ["Head"])
    frames, start = take.artist_keys()[joint], int(action.frame_range[0])
    assert set(take.artist_keys()) == {joint}
    assert set(range(first + 2 - start, first + 19 - start)) <= frames
    assert len(frames) < 80
    times, shown = played(oncue, action)
    turn(character, "RightForeArm", first + 5, 0.6, axis=2)
    assert bpy.ops.oncue.resolve() == {"FINISHED"}
    _, plays = played(oncue, action)
    inside = (times >= min(frames) + start) & (times <= max(frames) + start)
    for axis in range(4):
        name = ('pose.bones["Head"].rotation_quaternion', axis)
        assert len(curves(oncue, action)[name].modifiers) == 1
        assert np.array_equal(plays[name][inside], shown[name][inside])


def test_an_own_key_that_was_taken_out_is_no_wish_any_more(oncue, sitting, take_of):
    character, action = sitting
    frame = middle(action)
    while frame in [round(point.co.x) for point in of_bone(oncue, action, "RightForeArm")[0].keyframe_points]:
        frame += 1
    turn(character, "RightForeArm", frame, 0.6, axis=2)
    assert bpy.ops.oncue.resolve() == {"FINISHED"}
    (pin,) = oncue("bridge.pins").read_pins(action)
    assert pin.is_key
    assert pin.first_frame < frame < pin.last_frame
    bpy.context.scene.frame_set(frame)
    assert character.pose.bones["RightForeArm"].keyframe_delete("rotation_quaternion", frame=frame)
    take = take_of(character)
    assert take.artist_keys() == {}
    pin_something(oncue, character, "LeftHand")
    assert bpy.ops.oncue.resolve() == {"FINISHED"}
    assert not [pin for pin in oncue("bridge.pins").read_pins(action) if pin.is_key]
    # What the core had there plays again, and not what lay between the keys that were left.
    again = take_of(character)
    written, sampled = again.solved.keys, again._sampled
    joint = again.names.index("RightForeArm")
    columns = slice(3 + 4 * joint, 7 + 4 * joint)
    at = frame - int(action.frame_range[0])
    assert abs(np.dot(written[at, columns], sampled[at, columns])) > np.cos(np.radians(0.6))


def test_a_pin_alone_is_solved_for(oncue, sitting):
    character, action = sitting
    pin_something(oncue, character)
    pin = oncue("bridge.pins").read_pins(action)[0]
    assert bpy.ops.oncue.resolve() == {"FINISHED"}
    heads = evaluated_heads(character, ["LeftHand"], [pin.first_frame])
    assert np.linalg.norm(heads[0, 0] - np.array(pin.position)) < 0.01


def test_what_is_muted_or_locked_is_a_sentence(oncue, sitting):
    character, action = sitting
    turn(character, "Head", middle(action), 0.3)
    curve = of_bone(oncue, action, "Head")[1]
    curve.mute = True
    with pytest.raises(RuntimeError, match="is muted, so that its keys do not play"):
        bpy.ops.oncue.resolve()
    curve.mute, curve.lock = False, True
    with pytest.raises(RuntimeError, match="is locked"):
        bpy.ops.oncue.resolve()


def test_keys_and_handles_that_change_while_it_solves_are_not_overwritten(oncue, sitting):
    character, action = sitting
    turn(character, "Head", middle(action), 0.3)
    session, pipeline = oncue("bridge.session"), oncue("pipeline")
    request, take, said = session.read_edit(bpy.context)
    edited = pipeline.run_blocking(pipeline.edit_steps(request, pipeline.LibraryCache()))
    point = of_bone(oncue, action, "Neck")[0].keyframe_points[3]
    point.handle_left_type = point.handle_right_type = "FREE"
    point.handle_right.y += 0.05
    stored = frozen(oncue, action)
    with pytest.raises(oncue("errors").SceneError, match="changed while it was solving"):
        session.write_edit(bpy.context, request, take, edited, said)
    assert frozen(oncue, action) == stored


def test_a_deleted_channel_plays_the_bones_own_posture(oncue, sitting, take_of):
    character, action = sitting
    for curve in of_bone(oncue, action, "Neck"):
        oncue("bridge.compat").remove_curve(action, character, curve)
    character.pose.bones["Neck"].rotation_quaternion = Quaternion((0.9, 0.1, 0.0, 0.0)).normalized()
    take = take_of(character)
    (joint,) = joints_of(take, ["Neck"])
    assert take.artist_keys() == {joint: set(range(len(take.solved.keys)))}
    assert bpy.ops.oncue.resolve() == {"FINISHED"}
    assert of_bone(oncue, action, "Neck") == []


def test_an_old_take_solves_as_it_did(oncue, sitting, skeleton, take_of):
    """Every frame keyed, and kept without a word of which keys were written."""
    character, action = sitting
    solved = oncue("bridge.solved").solved_of(action)
    old = dense_twin(oncue, action, character, skeleton)
    placed = {"start_frame": solved.start_frame, "metres_per_unit": 1.0}
    names = list(skeleton["names"])
    kept = oncue("bridge.solved").solved_take(
        bpy.context.scene, character, names, solved.motion, solved.contacts, **placed
    )
    oncue("bridge.solved").keep_solved(old, kept)
    old["oncue_report"] = action["oncue_report"]
    frame = middle(old)
    turn(character, "RightForeArm", frame, 0.6, axis=2)
    take = take_of(character)
    assert take.artist_keys() == {take.names.index("RightForeArm"): {frame - int(old.frame_range[0])}}
    assert bpy.ops.oncue.resolve() == {"FINISHED"}
    for curve in curves(oncue, old).values():
        assert len(curve.keyframe_points) == len(solved.keys)
    assert oncue("bridge.solved").solved_of(old).written is None


def test_damage_to_the_written_keys_is_a_sentence(oncue, sitting):
    _, action = sitting
    solved = oncue("bridge.solved")
    with np.load(io.BytesIO(base64.b85decode(action["oncue_solved"]))) as kept:
        arrays = dict(kept)
    broken = (
        {"written": arrays["written"][:-1]},
        {"counts": arrays["counts"][:-1]},
        {"counts": -arrays["counts"]},
        {"counts": arrays["counts"].astype(float)},
        {"written": np.full_like(arrays["written"], np.nan)},
        {"counts": None},
        {"form": None, "keys": arrays["keys"][:, :-1]},
        {"form": np.array(3)},
        {"form": np.array(3), "root": np.array("PLACE"), "way": np.zeros((2, 4, 4))},
        {"form": np.array(4)},
        {"form": np.array(4), "ik": np.array("legs tails")},
    )
    for changed in broken:
        packed = io.BytesIO()
        both = {name: array for name, array in {**arrays, **changed}.items() if array is not None}
        np.savez_compressed(packed, **both)
        action["oncue_solved"] = base64.b85encode(packed.getvalue()).decode("ascii")
        with pytest.raises(oncue("errors").SceneError, match="keeps of its motion is damaged"):
            solved.solved_of(action)
    packed = io.BytesIO()
    np.savez_compressed(packed, **{**arrays, "form": np.array(5)})
    action["oncue_solved"] = base64.b85encode(packed.getvalue()).decode("ascii")
    with pytest.raises(oncue("errors").SceneError, match="is a take of a newer Oncue"):
        solved.solved_of(action)


def test_the_report_still_goes_with_the_take(oncue, sitting):
    character, action = sitting
    turn(character, "RightForeArm", middle(action), 0.6, axis=2)
    assert bpy.ops.oncue.resolve() == {"FINISHED"}
    report = json.loads(action["oncue_report"])
    assert report["artist"]["constraints"]
