"""Limbs of a Rigify rig by their IK controls: the skin's bones are where the motion has them, planted feet stay, and a
take is read back."""

from dataclasses import replace

import bpy
import numpy as np
import pytest
from people import make_person

from .test_own_rigs import chosen, cue, played, refused, rigify, stage, turned  # noqa: F401

LEG, ARM = ("thigh", "shin", "foot", "toe"), ("upper_arm", "forearm", "hand")
CHOICES = [("IK", "FK"), ("IK", "IK"), ("FK", "FK")]


def synthesized(context, oncue, rig, legs="IK", arms="FK", *, every_frame=False):
    settings = chosen(context, rig) and context.scene.oncue
    settings.rig_legs, settings.rig_arms, settings.every_frame = legs, arms, every_frame
    assert bpy.ops.oncue.synthesize() == {"FINISHED"}
    action, report = played(oncue, context.scene)
    assert report["success"], report["problems"]
    return action


def wanted_of(oncue, scene, rig, action):
    """Where the motion has the bones of the body, (frames, 4, 4), and its frames and contacts."""
    solved = oncue("bridge.solved").solved_of(action)
    puppet = oncue("bridge.puppet").puppet_of(rig, scene)
    motion = oncue("motion").resample(solved.motion, solved.scene_rate)
    planted = oncue("key_fit").planted_frames(solved.contacts, solved.motion.frame_rate, solved.scene_rate, len(motion))
    holds = oncue("bridge.own_rig").holds_of_action(action, puppet.size)
    return puppet.space(solved.matrix_world, holds).wanted(motion), solved.start_frame, planted


def at_rest(rig, bone):
    return np.array(rig.data.bones[bone].matrix_local, dtype=np.float64)


def posed(context, rig, bones, frames):
    """How bones are moved from their rest at some frames, armature space, bone → (frames, 4, 4)."""
    found = {bone: [] for bone in bones}
    for frame in frames:
        context.scene.frame_set(int(frame))
        seen = rig.evaluated_get(context.evaluated_depsgraph_get())
        for bone in bones:
            found[bone].append(np.array(seen.pose.bones[bone].matrix) @ np.linalg.inv(at_rest(rig, bone)))
    return {bone: np.array(matrices) for bone, matrices in found.items()}


def away(rig, bone, moved, wanted):
    """How far the head of a bone is from where it is to be, millimetres, and by how much it is turned, degrees."""
    body = f"ORG-{bone.split('-')[1]}"
    there = wanted[body] @ np.linalg.inv(at_rest(rig, body))
    head = np.append(at_rest(rig, body)[:3, 3], 1.0)
    far = 1000.0 * np.linalg.norm(((moved - there) @ head)[:, :3], axis=1)
    turn = moved[:, :3, :3] / np.cbrt(np.linalg.det(moved[:, :3, :3]))[:, None, None]
    cosine = (np.einsum("fij,fij->f", turn, there[:, :3, :3]) - 1.0) / 2.0
    return far, np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))


def names(kind, parts):
    return [f"{kind}-{part}.{side}" for part in parts for side in "LR"]


def curve_of(oncue, rig, action, path, axis=0):
    curves = oncue("bridge.compat").action_curves(action, rig)
    return next((curve for curve in curves if curve.data_path == path and curve.array_index == axis), None)


@pytest.mark.parametrize(("legs", "arms"), CHOICES)
def test_the_skins_bones_are_where_the_motion_has_them(rigify, stage, oncue, legs, arms):  # noqa: F811
    action = synthesized(stage, oncue, rigify, legs, arms, every_frame=True)
    wanted, start, _ = wanted_of(oncue, stage.scene, rigify, action)
    frames = np.arange(0, len(next(iter(wanted.values()))), 7)
    # Rigify has the first bone of a thigh and an upper arm not turn about itself: the body's own bone tells.
    bones = [*names("DEF", (*LEG[1:], *ARM[1:])), *names("ORG", (LEG[0], ARM[0]))]
    moved = posed(stage, rigify, bones, start + frames)
    there = {bone: matrices[frames] for bone, matrices in wanted.items()}
    for bone in bones:
        far, turn = away(rigify, bone, moved[bone], there)
        assert far.max() < 0.5, bone
        assert turn.max() < 1.0, bone


@pytest.mark.parametrize(("legs", "arms"), CHOICES)
def test_few_keys_leave_ends_and_middles_near(rigify, stage, oncue, legs, arms):  # noqa: F811
    action = synthesized(stage, oncue, rigify, legs, arms)
    wanted, start, planted = wanted_of(oncue, stage.scene, rigify, action)
    frames = np.arange(len(planted))
    bones = names("DEF", (*LEG[1:], *ARM[1:]))
    moved = posed(stage, rigify, bones, start + frames)
    for bone in bones:
        far, turn = away(rigify, bone, moved[bone], wanted)
        by_ik = legs if bone[4:-2] in LEG else arms
        middle = 15.0 if by_ik == "IK" else 6.0
        assert far.max() < (middle if bone[4:-2] in ("shin", "forearm") else 3.6), bone
        assert turn.max() < (4.0 if by_ik == "IK" else 3.0), bone
    # What stands does not slide: the ball of a planted foot, on the floor.
    for side, column in (("L", 0), ("R", 1)):
        ball = np.append(at_rest(rigify, f"DEF-toe.{side}")[:3, 3] * (1.0, 1.0, 0.0), 1.0)
        places = 1000.0 * (moved[f"DEF-toe.{side}"] @ ball)[:, :3]
        stands = planted[:-1, column] & planted[1:, column]
        step = np.linalg.norm(np.diff(places, axis=0), axis=1)[stands]
        assert np.quantile(step, 0.95) < 2.0


def test_fk_and_ik_show_one_skin(rigify, stage, oncue):  # noqa: F811
    bones = names("DEF", (*LEG, *ARM))
    action = synthesized(stage, oncue, rigify, "FK", "FK", every_frame=True)
    frames = np.arange(1, action.frame_range[1], 11)
    by_fk = posed(stage, rigify, bones, frames)
    synthesized(stage, oncue, rigify, "IK", "IK", every_frame=True)
    by_ik = posed(stage, rigify, bones, frames)
    for bone in bones:
        assert np.abs(by_fk[bone] - by_ik[bone]).max() < 0.03, bone


def test_only_what_is_switched_on_is_keyed(rigify, stage, oncue):  # noqa: F811
    def keyed(action):
        return {c.data_path.split('"')[1] for c in oncue("bridge.compat").action_curves(action, rigify)}

    action = synthesized(stage, oncue, rigify)
    found = keyed(action)
    assert {"foot_ik.L", "foot_heel_ik.R", "toe_ik.L", "thigh_ik_target.R", "torso", "upper_arm_fk.L"} <= found
    assert not {"thigh_fk.L", "foot_fk.R", "hand_ik.L"} & found
    master = 'pose.bones["thigh_parent.L"]'
    for name, value in (("IK_FK", 0.0), ("pole_vector", 1.0), ("IK_parent", 1.0), ("pole_parent", 3.0)):
        curve = curve_of(oncue, rigify, action, f'{master}["{name}"]')
        assert [point.co[1] for point in curve.keyframe_points] == [value]
    assert curve_of(oncue, rigify, action, f'{master}["IK_Stretch"]') is None
    assert rigify.pose.bones["upper_arm_parent.L"]["IK_FK"] == 1.0
    second = synthesized(stage, oncue, rigify, "FK", "IK")
    assert {"thigh_fk.L", "hand_ik.L", "upper_arm_ik_target.R"} <= keyed(second)
    assert not {"foot_ik.L", "upper_arm_fk.L"} & keyed(second)
    assert (rigify.pose.bones["thigh_parent.L"]["IK_FK"], rigify.pose.bones["upper_arm_parent.L"]["IK_FK"]) == (1, 0)
    # Each take plays by its own switches.
    assert bpy.ops.oncue.play_take(name=action.name) == {"FINISHED"}
    stage.scene.frame_set(40)
    assert rigify.evaluated_get(stage.evaluated_depsgraph_get()).pose.bones["thigh_parent.L"]["IK_FK"] == 0.0


def test_switching_to_fk_and_back_changes_nothing(rigify, stage, oncue):  # noqa: F811
    action = synthesized(stage, oncue, rigify)
    before = posed(stage, rigify, ["DEF-shin.L"], [60])["DEF-shin.L"]
    (point,) = curve_of(oncue, rigify, action, 'pose.bones["thigh_parent.L"]["IK_FK"]').keyframe_points
    point.co[1] = 1.0
    away_from = posed(stage, rigify, ["DEF-shin.L"], [61, 60])["DEF-shin.L"][1:]
    assert np.isfinite(away_from).all()
    assert not np.allclose(away_from, before, atol=1e-3)
    rigify.pose.bones["shoulder.L"].rotation_mode = rigify.pose.bones["shoulder.R"].rotation_mode = "QUATERNION"
    with pytest.raises(RuntimeError, match="is keyed otherwise than it was written, and Re-solve reads the controls"):
        bpy.ops.oncue.resolve()
    point.co[1] = 0.0
    assert np.allclose(posed(stage, rigify, ["DEF-shin.L"], [61, 60])["DEF-shin.L"][1:], before, atol=1e-6)


def test_the_control_of_a_planted_foot_stays(rigify, stage, oncue):  # noqa: F811
    action = synthesized(stage, oncue, rigify)
    _, start, planted = wanted_of(oncue, stage.scene, rigify, action)
    rolled, stands, standing = [], 0, 0
    for side, column in (("L", 0), ("R", 1)):
        control = f'pose.bones["foot_ik.{side}"]'
        paths = [(f"{control}.location", axis) for axis in range(3)]
        paths += [(f"{control}.rotation_quaternion", axis) for axis in range(4)]
        curves = [curve_of(oncue, rigify, action, *path) for path in paths]
        heel = curve_of(oncue, rigify, action, f'pose.bones["foot_heel_ik.{side}"].rotation_euler')
        values = np.array([[c.evaluate(start + k) for c in curves] for k in range(len(planted))])
        still = np.abs(np.diff(values, axis=0)).max(axis=1) < 1e-6
        on = planted[:-1, column] & planted[1:, column]
        stands, standing = stands + (still & on).sum(), standing + on.sum()
        rolled += [heel.evaluate(start + k) for k in np.flatnonzero(on & still)]
    assert standing > 60
    assert stands > 0.8 * standing
    # While it stays the foot rolls: the heel rises by more than ten degrees before the foot goes.
    assert max(rolled) > np.radians(10.0)


def test_ik_controls_are_read_as_fk_controls_are(rigify, stage, oncue):  # noqa: F811
    """Both are the same motion of the core."""
    action = synthesized(stage, oncue, rigify, "IK", "IK", every_frame=True)
    solved_module = oncue("bridge.solved")
    solved = solved_module.solved_of(action)
    motion = oncue("motion").resample(solved.motion, solved.scene_rate)
    read = []
    for ik in ((), ("legs", "arms")):
        space = replace(oncue("bridge.puppet").puppet_of(rigify, stage.scene), ik=ik).space(solved.matrix_world)
        rows = solved_module.columns_of(space).split(solved_module.rows_of(space, motion))
        read.append(space.motion(*rows[:2], solved.scene_rate, rows[2]))
    assert np.allclose(read[0].root_positions, read[1].root_positions, atol=1e-5)
    apart = 2.0 * np.arccos(np.clip(np.abs(np.sum(read[0].rotations * read[1].rotations, axis=2)), 0.0, 1.0))
    assert np.degrees(apart.max()) < 1.5


@pytest.fixture
def by_quaternions(rigify):  # noqa: F811
    for side in "LR":
        rigify.pose.bones[f"shoulder.{side}"].rotation_mode = "QUATERNION"
    return rigify


def all_keys(oncue, rig, action):
    curves = oncue("bridge.compat").action_curves(action, rig)
    return {(c.data_path, c.array_index): [tuple(p.co) for p in c.keyframe_points] for c in curves}


@pytest.mark.parametrize("every_frame", [False, True])
def test_resolve_adapts_a_foot_that_was_moved(by_quaternions, stage, oncue, every_frame):  # noqa: F811
    rig = by_quaternions
    action = synthesized(stage, oncue, rig, every_frame=every_frame)
    # The take's own limbs count, not what the next one is to have.
    stage.scene.oncue.rig_legs, stage.scene.oncue.rig_arms = "FK", "IK"
    _, start, planted = wanted_of(oncue, stage.scene, rig, action)
    # Amid a swing of the left foot, some time after the first step.
    swings = np.flatnonzero(~planted[:, 0] & (np.arange(len(planted)) > 50))
    frame = int(start + swings[len(swings[swings < swings[0] + 12]) // 2])
    before = all_keys(oncue, rig, action)
    stage.scene.frame_set(frame)
    foot = rig.pose.bones["foot_ik.L"]
    foot.location.z += 0.06
    mine = tuple(foot.location)
    foot.keyframe_insert("location", frame=frame)
    assert bpy.ops.oncue.resolve() == {"FINISHED"}
    stage.scene.frame_set(frame - 1)
    stage.scene.frame_set(frame)
    assert tuple(foot.location) == pytest.approx(mine, abs=1e-6)
    assert oncue("bridge.session").report_of(action)["artist"]
    # What plays, but for the foot where it is held, is what the core gave.
    there, _, _ = wanted_of(oncue, stage.scene, rig, action)
    frames = np.arange(0, len(planted), 4)
    moved = posed(stage, rig, ["DEF-foot.R", "DEF-hand.L"], start + frames)
    for bone, matrices in moved.items():
        far, _ = away(rig, bone, matrices, {body: all_of[frames] for body, all_of in there.items()})
        assert far.max() < 4.0, bone
    # The other foot's control stands where it stood.
    after = all_keys(oncue, rig, action)
    path = ('pose.bones["foot_ik.R"].location', 2)
    stays = planted[:, 1] & (np.arange(len(planted)) < 20)
    curve = curve_of(oncue, rig, action, *path)
    assert np.ptp([curve.evaluate(start + k) for k in np.flatnonzero(stays)]) < 0.004
    assert len(after[path]) < 2 * len(before[path])
    # Pressed again it keeps what is the artist's.
    bpy.ops.oncue.resolve()
    stage.scene.frame_set(frame)
    assert tuple(foot.location) == pytest.approx(mine, abs=1e-6)


def test_resolve_adapts_hips_over_ik_feet(by_quaternions, stage, oncue):  # noqa: F811
    rig = by_quaternions
    action = synthesized(stage, oncue, rig)
    _, start, planted = wanted_of(oncue, stage.scene, rig, action)
    frame = int(start + np.flatnonzero(planted.all(axis=1))[3])
    stage.scene.frame_set(frame)
    feet = posed(stage, rig, ["DEF-foot.L", "DEF-foot.R"], [frame])
    torso = rig.pose.bones["torso"]
    torso.location.z -= 0.05
    low = torso.location.z
    torso.keyframe_insert("location", frame=frame)
    assert bpy.ops.oncue.resolve() == {"FINISHED"}
    now = posed(stage, rig, ["DEF-foot.L", "DEF-foot.R"], [frame - 1, frame])
    assert torso.location.z == pytest.approx(low, abs=1e-6)
    # The feet's controls were written anew: what the core gave is what plays.
    wanted, _, _ = wanted_of(oncue, stage.scene, rig, action)
    frames = np.arange(0, len(planted), 4)
    moved = posed(stage, rig, names("DEF", ("foot", "toe")), start + frames)
    for bone, matrices in moved.items():
        far, _ = away(rig, bone, matrices, {body: there[frames] for body, there in wanted.items()})
        assert far.max() < 4.0, bone
    # Feet that stand keep to the floor.
    for bone, before in feet.items():
        head = np.append(at_rest(rig, bone)[:3, 3], 1.0)
        assert abs(((now[bone][1] - before[0]) @ head)[2]) < 0.01, bone


@pytest.mark.parametrize("kind", ["BONE", "OBJECT", "PLACE"])
def test_what_carries_the_body_carries_the_feet(rigify, stage, oncue, kind):  # noqa: F811
    def heads(times):
        found = []
        for time in times:
            stage.scene.frame_set(int(time))
            seen = rigify.evaluated_get(stage.evaluated_depsgraph_get())
            found.append(
                [seen.matrix_world @ seen.pose.bones[b].head for b in ("DEF-foot.L", "DEF-toe.R", "DEF-spine")]
            )
        return np.array(found)

    action = synthesized(stage, oncue, rigify)
    times = np.arange(1.0, action.frame_range[1], 20.0)
    there = heads(times)
    stage.scene.oncue.root_motion = kind
    synthesized(stage, oncue, rigify)
    now = heads(times)
    if kind == "PLACE":
        # On the spot the feet are as far from the hips as they are on the way.
        away_from = [np.linalg.norm(places[:, :2] - places[:, 2:], axis=2) for places in (there, now)]
        assert np.abs(away_from[0] - away_from[1]).max() < 0.01
        assert np.ptp(now[:, 2, 0]) < 0.5
    else:
        assert np.linalg.norm(now - there, axis=2).max() < 0.008


def test_a_rig_that_is_turned_and_scaled_is_followed_too(rigify, stage, oncue):  # noqa: F811
    rigify.location, rigify.rotation_euler, rigify.scale = (0.7, -1.5, 0.3), (0.0, 0.0, 1.1), (0.9, 0.9, 0.9)
    action = synthesized(stage, oncue, rigify, "IK", "IK")
    wanted, start, planted = wanted_of(oncue, stage.scene, rigify, action)
    frames = np.arange(0, len(planted), 9)
    moved = posed(stage, rigify, names("DEF", ("foot", "toe", "hand")), start + frames)
    for bone, matrices in moved.items():
        far, _ = away(rigify, bone, matrices, {body: there[frames] for body, there in wanted.items()})
        assert far.max() < 4.0, bone


class Layout:
    """Notes which settings a panel shows."""

    def __init__(self, shown):
        self.shown = shown

    def prop(self, _owner, name, **_):
        self.shown.append(name)

    def panel(self, *_args, **_options):
        return self, None

    def __getattr__(self, _name):
        return lambda *_args, **_options: Layout(self.shown)


def test_legs_and_arms_are_asked_for_a_rigify_rig_alone(rigify, stage, oncue):  # noqa: F811
    def shown():
        settings = []
        panel = type("Panel", (), {"layout": Layout(settings)})()
        oncue("panels").ONCUE_PT_settings.draw(panel, bpy.context)
        return {"rig_legs", "rig_arms"} & set(settings)

    assert shown() == set()
    chosen(stage, rigify)
    assert shown() == {"rig_legs", "rig_arms"}
    chosen(stage, make_person("unreal", 1.8))
    assert shown() == set()


def test_fingers_stay_as_they_were_posed(rigify, stage, oncue):  # noqa: F811
    finger = rigify.pose.bones["f_index.01_master.L"]
    finger.scale.y, finger.rotation_mode = 0.8, "XYZ"
    finger.rotation_euler.x = 0.3
    thumb = rigify.pose.bones["thumb.01_master.R"]
    thumb.keyframe_insert("scale", frame=1)
    before = [np.array(bone.matrix_basis) for bone in (finger, thumb)]
    action = synthesized(stage, oncue, rigify, "IK", "IK")
    stage.scene.frame_set(50)
    assert [np.allclose(b.matrix_basis, a) for b, a in zip((finger, thumb), before, strict=True)] == [True, True]
    curves = oncue("bridge.compat").action_curves(action, rigify)
    assert not [c.data_path for c in curves if "f_" in c.data_path or "thumb" in c.data_path or "palm" in c.data_path]


def test_a_rig_without_its_ik_controls_is_told_so(rigify, stage):  # noqa: F811
    chosen(stage, rigify)
    rigify.data.bones["foot_heel_ik.L"].name = "mine"
    assert "choose FK for its legs and arms" in refused("rig lacks IK controls as Rigify makes them")
    stage.scene.oncue.rig_legs = "FK"
    assert bpy.ops.oncue.synthesize() == {"FINISHED"}


def test_what_bends_an_ik_foot_beside_its_controls_goes_to_rest(rigify, stage, oncue):  # noqa: F811
    spin = rigify.pose.bones["foot_spin_ik.L"]
    spin.rotation_quaternion = (0.97, 0.0, 0.0, 0.243)
    spin.keyframe_insert("rotation_quaternion", frame=1)
    synthesized(stage, oncue, rigify)
    assert tuple(spin.rotation_quaternion) == pytest.approx((1.0, 0.0, 0.0, 0.0), abs=1e-6)
