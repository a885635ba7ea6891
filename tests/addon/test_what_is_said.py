"""What the artist is told: while a run is at work, when it ends, and afterwards."""

import json
import math
import types
from unittest.mock import MagicMock

import bpy
import numpy as np
import pytest

from .runs import QUICK, current_action, datablocks, keys_of, set_quick
from .shapes import add_cube, add_floor
from .test_edit import FRAMES, START, made, motion, select, skeleton, take_module, take_of, turn  # noqa: F401


@pytest.fixture
def stool(fixtures, core):
    fixtures.stool_alone()
    set_quick(bpy.context.scene)
    return bpy.context


@pytest.fixture
def handle(oncue):
    return oncue("job_operator").handle


# --- progress ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("stage", "fraction", "shown"),
    [("Optimizing", 2.25, ("Optimizing", 1.0)), ("", -0.5, ("Starting", 0.0)), ("Check", math.nan, ("Check", 0.0))],
)
def test_progress_is_a_share_of_a_named_stage(oncue, monkeypatch, stage, fraction, shown):
    pipeline = oncue("pipeline")
    seen = {"stage": stage, "fraction": fraction, "update": 0, "reward": 0.0, "success_rate": 0.0}
    job = types.SimpleNamespace(progress=lambda: seen, done=lambda: False, wait=lambda _s: False, cancel=lambda: None)
    run = pipeline.Run(iter([job]))
    run.poll()
    run._stage_began -= 100.0
    run._stage = stage
    progress = run.progress()
    assert (progress.stage, progress.fraction) == shown
    assert progress.remaining_s is None or progress.remaining_s >= 0.0


def test_a_stage_without_a_name_goes_on_with_the_last(oncue):
    seen = {"stage": "Building", "fraction": 0.5, "update": 0, "reward": 0.0, "success_rate": 0.0}
    job = types.SimpleNamespace(progress=lambda: seen, done=lambda: False)
    run = oncue("pipeline").Run(iter([job]))
    run.poll()
    assert run.progress().stage == "Building"
    seen["stage"] = ""
    assert run.progress().stage == "Building"


# --- messages that go when they no longer hold ------------------------------------------------------------------------


def test_a_refusal_goes_once_the_file_has_changed(context, handle, core):
    add_floor()
    with pytest.raises(RuntimeError, match="no Start cue"):
        bpy.ops.oncue.synthesize()
    assert "no Start cue" in handle.message
    context.view_layer.update()
    bpy.data.objects["Floor"].select_set(True)
    context.view_layer.update()
    assert "no Start cue" in handle.message
    bpy.ops.oncue.place_cue(kind="start")
    context.view_layer.update()
    assert handle.message == ""


CHANGES = {
    "hidden": lambda thing: thing.hide_set(True),
    "moved": lambda thing: setattr(thing, "location", (1, 0, 0)),
    "deleted": lambda thing: bpy.data.objects.remove(thing),
}


@pytest.mark.parametrize("change", CHANGES)
def test_any_change_counts(context, handle, core, change):
    add_floor()
    cube = add_cube("Chair")
    with pytest.raises(RuntimeError, match="no Start cue"):
        bpy.ops.oncue.synthesize()
    CHANGES[change](cube)
    context.view_layer.update()
    add_cube("Something")  # what is hidden reaches the handler with the next change
    assert handle.message == ""


def test_that_a_run_was_stopped_goes_too(context, handle, oncue):
    cube = add_cube("Chair")
    handle.say("Cancelled; the file is as it was.")
    cube.location.x += 0.1
    context.view_layer.update()  # what was about to change when it was stopped
    assert handle.message
    cube.location.x += 0.1
    context.view_layer.update()
    assert handle.message == ""
    handle.say("Cancelled; the file is as it was.")
    later = handle._forgetting(handle.message)
    later()
    assert handle.message == ""
    handle.say("There is no Start cue.", failed=True)
    later()
    assert handle.message == "There is no Start cue."


def test_the_kind_of_a_refusal_offers_its_button(stool, handle, oncue):
    bpy.ops.oncue.synthesize()
    assert handle.error is None
    stool.scene.oncue.character.scale = (0.5, 0.5, 0.5)
    with pytest.raises(RuntimeError, match="Reset Character"):
        bpy.ops.oncue.synthesize()
    assert isinstance(handle.error, oncue("errors").CharacterError)
    assert handle.error.__traceback__ is None
    bpy.ops.oncue.reset_character()
    assert handle.message == ""


STATES = {
    "a constraint": (
        lambda c: c.pose.bones["LeftHand"].constraints.new("LIMIT_ROTATION"),
        lambda c: setattr(c.pose.bones["LeftHand"].constraints[0], "mute", True),
    ),
    "a moved bone": (
        lambda c: setattr(c.pose.bones["Spine"], "location", (0, 0.1, 0)),
        lambda c: setattr(c.pose.bones["Spine"], "location", (0, 0, 0)),
    ),
    "its rest position": (
        lambda c: setattr(c.data, "pose_position", "REST"),
        lambda c: setattr(c.data, "pose_position", "POSE"),
    ),
}


@pytest.mark.parametrize("state", STATES)
def test_a_refused_state_is_forgotten_once_it_is_mended(stool, handle, state):
    """Also where nothing stands elsewhere by that."""
    bpy.ops.oncue.synthesize()
    character = stool.scene.oncue.character
    spoil, mend = STATES[state]
    spoil(character)
    stool.view_layer.update()
    with pytest.raises(RuntimeError, match="Reset Character"):
        bpy.ops.oncue.synthesize()
    bpy.data.objects["Start"].select_set(True)
    character.data.display_type = "OCTAHEDRAL"
    stool.view_layer.update()
    assert "Reset Character" in handle.message
    mend(character)
    character.update_tag()
    character.data.update_tag()
    stool.view_layer.update()
    assert handle.message == ""


def test_the_rate_that_was_refused_is_one_that_can_be_mended(stool, handle):
    stool.scene.render.fps = 1
    with pytest.raises(RuntimeError, match="1 frames a second"):
        bpy.ops.oncue.synthesize()
    stool.scene.render.fps = 24
    handle.forget_outdated()
    assert handle.message == ""


def test_a_cue_in_the_middle_of_a_bed_is_moved_to_its_edge_on_request(context, handle, oncue, draw):
    set_quick(context.scene)
    add_cube("Floor", (0, 0, -0.05), (7, 6, 0.1))
    add_cube("Bed", (1.5, 0, 0.25), (2.0, 2.2, 0.5))
    cues = oncue("bridge.cue_objects")
    cues.make_cue(context, "start", (-2, 0, 0), math.radians(90))
    sit = cues.make_cue(context, "sit", (1.5, 0, 0.6), math.radians(-90))
    foot = cues.make_cue(context, "left_foot", (1.1, 0.1, 0), 0.0, parent=sit)
    away = foot.matrix_world.translation - sit.matrix_world.translation
    assert "oncue.move_to_edge" not in draw("messages").operators
    with pytest.raises(RuntimeError, match="The nearest edge to sit on is"):
        bpy.ops.oncue.synthesize()
    assert "oncue.move_to_edge" in draw("messages").operators
    assert bpy.ops.oncue.move_to_edge(place=handle.error.place, yaw=handle.error.yaw) == {"FINISHED"}
    assert handle.message == ""
    context.view_layer.update()
    assert sit.matrix_world.translation.x == pytest.approx(0.72, abs=0.05)
    # Its feet go along.
    now = foot.matrix_world.translation - sit.matrix_world.translation
    assert list(now) == pytest.approx(list(away), abs=1e-4)
    bpy.data.objects.remove(foot)
    assert bpy.ops.oncue.synthesize() == {"FINISHED"}
    # A cue that keys hold would not stay there.
    for frame, x in ((1, 1.5), (9, 1.6)):
        sit.location.x = x
        sit.keyframe_insert("location", frame=frame)
    with pytest.raises(RuntimeError, match=r"Sit is animated.*move its keys instead"):
        bpy.ops.oncue.move_to_edge(place=(0, 0, 0), yaw=0.0)
    bpy.data.objects.remove(sit)
    with pytest.raises(RuntimeError, match="no Sit or Stop cue any more"):
        bpy.ops.oncue.move_to_edge(place=(0, 0, 0), yaw=0.0)


def test_what_is_said_stands_below_every_button(oncue, stool, handle, draw):
    """It comes and goes; nothing is pushed from under the mouse by that."""
    panels = oncue("panels")
    order = {cls.bl_order: cls for cls in panels.CLASSES if hasattr(cls, "bl_order")}
    assert order[max(order)] is panels.ONCUE_PT_messages
    shown = {cls: draw(cls.__name__.removeprefix("ONCUE_PT_")) for _, cls in sorted(order.items())}
    bpy.data.objects["Start"].hide_set(True)
    with pytest.raises(RuntimeError, match="There is no Start cue"):
        bpy.ops.oncue.synthesize()
    bpy.data.objects["Start"].hide_set(False)
    for _, cls in sorted(order.items())[:-1]:
        now = draw(cls.__name__.removeprefix("ONCUE_PT_"))
        if cls is panels.ONCUE_PT_synthesize:
            # The same rows; what the last of them says is another thing.
            assert [call[0] for call in now.layout.mock_calls] == [call[0] for call in shown[cls].layout.mock_calls]
            assert "There is no Start cue" in now.labels[-1]
        else:
            assert now.layout.mock_calls == shown[cls].layout.mock_calls, cls
    assert any("There is no Start cue" in label for label in draw("messages").labels)
    # Blender puts panels without a header above all those that have one.
    headless = [cls for cls in order.values() if "HIDE_HEADER" in getattr(cls, "bl_options", ())]
    assert headless == [panels.ONCUE_PT_synthesize]


def test_the_buttons_rows_are_as_high_while_it_works(oncue, stool, handle, draw, monkeypatch):
    """Who acts, one of 1.6 rows, one below it and one of text, at work as at rest."""

    def rows():
        drawn = draw("synthesize").layout
        return len(drawn.operator.mock_calls) + len(drawn.progress.mock_calls), len(drawn.label.mock_calls)

    at_rest = rows()
    progress = oncue("pipeline").Progress("Optimizing", 0.5, 3, 1.0, 0.2, 12.0, 7.0)
    monkeypatch.setattr(handle, "run", types.SimpleNamespace(progress=lambda: progress, cancelled=False))
    assert rows() == at_rest == (2, 2)
    assert draw("synthesize").labels[1:] == ["12 s, about 7 s left"]
    assert draw("messages").labels == ["12 s, about 7 s left", "Update 3, success 20 %, reward 1.00"]


# --- a run whose scene is not shown any more --------------------------------------------------------------------------


def test_a_result_waits_for_its_scene(oncue, context, handle, monkeypatch):
    """Whoever looks at another scene when it is done, or has renamed its own, loses nothing."""
    job_operator, pipeline = oncue("job_operator"), oncue("pipeline")
    own, other = context.scene, bpy.data.scenes.new("Other")
    written, said = [], []

    class Operator(job_operator.JobOperator):
        def finish(self, context, value):
            written.append((context.scene.name, value))

        def report(self, _kind, text):
            said.append(text)

    def begin():
        def steps():
            return 7
            yield

        operator = Operator()
        operator._run, operator._scene = pipeline.Run(steps()), context.scene.session_uid
        monkeypatch.setattr(handle, "run", operator._run)
        return lambda: operator.modal(context, types.SimpleNamespace(type="TIMER", value="NOTHING"))

    tick = begin()
    context.window.scene = other
    assert tick() == tick() == {"PASS_THROUGH"}
    assert handle.awaited == own.name
    own.name = "Renamed"
    context.window.scene = own
    assert tick() == {"FINISHED"}
    assert written == [("Renamed", 7)]
    assert (handle.awaited, handle.run) == ("", None)
    # A scene that is gone is said.
    tick = begin()
    context.window.scene = other
    bpy.data.scenes.remove(own)
    assert tick() == {"CANCELLED"}
    assert "The scene was deleted meanwhile" in said[-1]
    assert len(written) == 1


def test_escape_ends_the_playback_first(oncue, context, handle, monkeypatch):
    job_operator = oncue("job_operator")
    run = types.SimpleNamespace(cancel=lambda: pytest.fail("cancelled"), poll=lambda: False)
    monkeypatch.setattr(handle, "run", run)

    class Operator(job_operator.JobOperator):
        _run = run

        def report(self, _kind, text):
            pytest.fail(text)

    monkeypatch.setattr(job_operator, "is_playing", lambda _context: True)
    escape = types.SimpleNamespace(type="ESC", value="PRESS")
    assert Operator().modal(context, escape) == {"PASS_THROUGH"}
    assert handle.run is run


# --- a result that cannot be written ----------------------------------------------------------------------------------


def enter_edit_mode(character):
    bpy.context.view_layer.objects.active = character
    bpy.ops.object.mode_set(mode="EDIT")


def leave_edit_mode(_character):
    bpy.ops.object.mode_set(mode="OBJECT")


#: What came meanwhile, the words that name it, and the way out that they tell.
MEANWHILE = {
    "edit mode": (enter_edit_mode, "is in edit mode.*leave edit mode", leave_edit_mode),
    "scaled": (
        lambda character: setattr(character, "scale", (0.5, 0.5, 0.5)),
        "scaled to 0.5.*Reset Character",
        lambda _character: bpy.ops.oncue.reset_character(),
    ),
    "rate": (
        lambda _character: setattr(bpy.context.scene.render, "fps", 1),
        "at 1 frames a second.*Frame Rate",
        lambda _character: setattr(bpy.context.scene.render, "fps", 30),
    ),
}


@pytest.fixture
def meanwhile(oncue, monkeypatch):
    """Has the artist do something while the run is at work: after it has read, before it writes."""
    job_operator, real = oncue("job_operator"), oncue("job_operator").run_blocking

    def have(act):
        def run(steps):
            value = real(steps)
            act(bpy.context.scene.oncue.character)
            bpy.context.view_layer.update()
            return value

        monkeypatch.setattr(job_operator, "run_blocking", run)
        return lambda: monkeypatch.setattr(job_operator, "run_blocking", real)

    return have


@pytest.mark.parametrize("state", MEANWHILE)
def test_what_cannot_be_written_is_kept_until_it_can(stool, handle, oncue, draw, meanwhile, state):
    spoil, words, mend = MEANWHILE[state]
    assert bpy.ops.oncue.synthesize() == {"FINISHED"}
    first, expected = current_action(), keys_of(oncue, current_action())
    before = datablocks()
    at_work = meanwhile(spoil)
    with pytest.raises(RuntimeError, match=f"{words}.*; the motion is kept: press Write Motion") as error:
        bpy.ops.oncue.synthesize()
    at_work()
    assert len([line for line in str(error.value).splitlines() if line.startswith("Error: ")]) == 1
    assert datablocks() == before
    assert current_action() == first
    assert "oncue.write_motion" in draw("synthesize").operators
    # As long as it is as it was refused, it is refused again, and nothing is lost by that.
    with pytest.raises(RuntimeError, match=words):
        bpy.ops.oncue.write_motion()
    mend(stool.scene.oncue.character)
    stool.view_layer.update()
    # What has changed since is the artist's: nothing is read anew.
    bpy.data.objects.remove(bpy.data.objects["Start"])
    assert bpy.ops.oncue.write_motion() == {"FINISHED"}
    assert current_action() != first
    assert keys_of(oncue, current_action()) == expected
    assert keys_of(oncue, first) == expected
    assert handle.message == ""
    assert "oncue.write_motion" not in draw("synthesize").operators
    assert not bpy.ops.oncue.write_motion.poll()


def test_a_motion_is_kept_where_the_character_was_deleted_by_then(stool, oncue, meanwhile):
    """Nothing is refused there: it gets a character of its own."""
    assert bpy.ops.oncue.synthesize() == {"FINISHED"}
    expected = keys_of(oncue, current_action())
    at_work = meanwhile(lambda character: bpy.data.objects.remove(character))
    assert bpy.ops.oncue.synthesize() == {"FINISHED"}
    at_work()
    assert keys_of(oncue, current_action()) == expected


def test_a_kept_motion_goes_with_its_file_and_its_scene(stool, oncue, meanwhile):
    unwritten = oncue("operators.synthesize").unwritten
    bpy.ops.oncue.synthesize()
    at_work = meanwhile(enter_edit_mode)
    with pytest.raises(RuntimeError, match="the motion is kept"):
        bpy.ops.oncue.synthesize()
    at_work()
    other = bpy.data.scenes.new("Other")
    assert unwritten.of(stool.scene) is not None
    assert unwritten.of(other) is None
    # Another one that was written takes its place.
    leave_edit_mode(None)
    kept = unwritten.of(stool.scene)
    assert bpy.ops.oncue.synthesize() == {"FINISHED"}
    assert unwritten.of(stool.scene) is None
    unwritten.keep(stool.scene, kept)
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    assert unwritten.of(bpy.context.scene) is None


def test_an_error_of_our_own_while_writing_loses_no_motion(stool, handle, oncue, monkeypatch):
    session = oncue("bridge.session")
    real = session.keep_solved
    monkeypatch.setattr(session, "keep_solved", fail)
    with pytest.raises(RuntimeError, match=r"an error of Oncue's own.*the motion is kept"):
        bpy.ops.oncue.synthesize()
    assert not bpy.data.actions
    monkeypatch.setattr(session, "keep_solved", real)
    assert bpy.ops.oncue.write_motion() == {"FINISHED"}
    assert len(keys_of(oncue, current_action())) > 60


# --- results ----------------------------------------------------------------------------------------------------------


def test_a_result_says_when_its_cues_have_gone(stool, oncue):
    bpy.ops.oncue.synthesize()
    session = oncue("bridge.session")

    def belongs():
        stool.view_layer.update()
        return session.belongs_to_cues(stool, session.current_report(stool.scene))

    sit, start = bpy.data.objects["Sit"], bpy.data.objects["Start"]
    assert belongs()
    for thing, change in ((sit, ("location", 0.1)), (start, ("rotation_euler", 0.1))):
        getattr(thing, change[0])[2] += change[1]
        assert not belongs()
        getattr(thing, change[0])[2] -= change[1]
        assert belongs()
    bpy.ops.oncue.place_foot(side="left")
    assert not belongs()
    bpy.data.objects.remove(bpy.data.objects["Left Foot"])
    assert belongs()
    start.hide_set(True)
    assert not belongs()


def test_a_result_says_when_its_hands_have_gone(stool, oncue):
    bpy.ops.oncue.synthesize()
    session = oncue("bridge.session")
    report = session.current_report(stool.scene)

    def belongs():
        stool.view_layer.update()
        return session.belongs_to_cues(stool, report)

    assert belongs()
    hand = oncue("bridge.cue_objects").place_hand(stool, "right_hand", 20, 40, 1.0)
    assert not belongs()
    report["task"]["manipulations"] = oncue("bridge.hand_reader").read_manipulations(stool, 1)
    assert belongs()
    hand["oncue_last_frame"] = 44
    assert not belongs()
    hand["oncue_last_frame"] = 40
    hand.location.z += 0.1
    assert not belongs()
    hand.location.z -= 0.1
    assert belongs()


@pytest.mark.parametrize(
    ("sit", "hands", "title"),
    [
        ("Sit", [], "Sit on Stool seed 1"),
        ("Sit.003", [], "Sit on Stool seed 1"),
        ("By the Window", [], "Sit at By the Window seed 1"),
        ("Sit", ["Right Hand"], "Sit on Stool with Right Hand seed 1"),
    ],
)
def test_a_take_is_called_by_what_happens(stool, oncue, sit, hands, title):
    session = oncue("bridge.session")
    bpy.data.objects["Sit"].name = sit
    request, _ = session.read_request(stool)
    request.task["manipulations"] = [{"name": name} for name in hands]
    assert f"{session.title_of(request)} seed 1" == title
    assert session.object_under(request, [0.0, 0.0, 0.54]) == "Stool"
    assert session.object_under(request, [1.5, 1.5, 0.1]) == "Floor"
    # Nothing lies beyond the floor, and nothing so far below.
    assert session.object_under(request, [9.0, 0.0, 0.5]) == session.object_under(request, [0.0, 0.0, 1.5]) == ""


def test_the_panel_tells_the_clipping_of_the_report(oncue):
    lines = oncue("panels")._clipping_lines(
        {"percent": 0.0, "whole_body_percent": 16.7, "parts_percent": {"torso": 16.7, "leg": 2.0}}
    )
    assert [line.strip() for line, _ in lines] == [
        "Clipping: legs or arms in 0.0 % of the frames",
        "any part in 16.7 %, most the torso (16.7 %)",
    ]
    lines = oncue("panels")._clipping_lines({"percent": 0.0, "whole_body_percent": 0.0, "parts_percent": {}})
    assert lines[1][0].strip() == "any part in 0.0 %"


# --- frames -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("core_says", "scene_says"),
    [
        # 24 frames a second from frame 1001 on: the core's frame 100 is 80 frames later.
        ("out of reach of the hand on frame 100; move", "out of reach of the hand on frame 1081; move"),
        ("asks for frames 0 to 100, and", "asks for frames 1001 to 1081, and"),
        ("jumps between frames 5 and 10.", "jumps between frames 1005 and 1009."),
        ("runs from frame 5 to 10.", "runs from frame 1005 to 1009."),
        ("2 s after the motion's last, 100;", "2 s after the motion's last, 1081;"),
        ("‘frame 100’ has 20 frames on frame 10", "‘frame 100’ has 20 frames on frame 1009"),
        ("The Hips turns by 90° a frame.", "The Hips turns by 90° a frame."),
    ],
)
def test_frames_are_the_scenes(oncue, core_says, scene_says):
    assert oncue("scene_frames").in_scene_frames(core_says, 1001, 24.0) == scene_says


def test_a_refused_pin_names_the_scenes_frames(oncue, made, context, core):  # noqa: F811
    character, action = made(rate=24)
    select(oncue, character, "LeftHand")
    context.scene.frame_set(START + 20)
    bpy.ops.oncue.pin()
    pins = oncue("bridge.pins")
    (pin,) = pins.read_pins(action)
    far = pins.Pin(pin.bone, START + 20, START + 20, tuple(c + 5.0 for c in pin.position))
    pins.write_pins(action, [far])
    with pytest.raises(RuntimeError, match=f"on frame {START + 20}"):
        bpy.ops.oncue.resolve()
    # No place of this world, but numbers all the same.
    pins.write_pins(action, [pins.Pin(pin.bone, START + 20, START + 20, (1e6, 0.0, 0.0))])
    with pytest.raises(RuntimeError, match=r"LeftHand.*a place 1000 km from the origin; nothing is placed farther"):
        bpy.ops.oncue.resolve()


# --- Re-solve ---------------------------------------------------------------------------------------------------------


def curve_of(oncue, action, bone="LeftArm", channel="rotation_quaternion", axis=1):
    path = f'pose.bones["{bone}"].{channel}'
    curves = oncue("bridge.compat").action_curves(action)
    return next(curve for curve in curves if (curve.data_path, curve.array_index) == (path, axis))


def scale_in_time(_oncue, character):
    for curve in _oncue("bridge.compat").action_curves(character.animation_data.action):
        for point in curve.keyframe_points:
            point.co.x *= 1.5


def move_in_time(oncue, character):
    for curve in oncue("bridge.compat").action_curves(character.animation_data.action):
        for point in curve.keyframe_points:
            point.co.x += 7.0


def decimate(oncue, character):
    for curve in oncue("bridge.compat").action_curves(character.animation_data.action):
        for k in reversed(range(1, len(curve.keyframe_points) - 1)):
            if k % 5:
                curve.keyframe_points.remove(curve.keyframe_points[k], fast=True)
        curve.update()


def scaled_arm(_oncue, character):
    character.pose.bones["LeftArm"].scale = (2, 2, 2)
    character.pose.bones["LeftArm"].keyframe_insert("scale", frame=START)


def spoil_key(value):
    return lambda o, c: setattr(curve_of(o, c.animation_data.action).keyframe_points[3].co, "y", value)


SPOILT = {
    "scaled": (scale_in_time, "keys between frames"),
    "moved": (move_in_time, "no longer those of the run"),
    "decimated": (decimate, "no longer those of the run"),
    "muted": (lambda o, c: setattr(curve_of(o, c.animation_data.action), "mute", True), "is muted"),
    "locked": (lambda o, c: setattr(curve_of(o, c.animation_data.action), "lock", True), "is locked"),
    "modifier": (lambda o, c: curve_of(o, c.animation_data.action).modifiers.new("NOISE"), "has a modifier"),
    "infinite": (spoil_key(math.inf), "a key of 3.4.* at frame 14"),
    "not a number": (spoil_key(math.nan), "a key of nan at frame 14"),
    "scale key": (scaled_arm, "LeftArm.*scale.* is keyed, which Re-solve does not know of"),
    "tweak": (lambda o, c: setattr(c.animation_data, "action_influence", 0.5), "0.5 in the mode Replace"),
}


@pytest.mark.parametrize("what", SPOILT)
def test_what_resolve_cannot_respect_is_refused_before_it_touches_anything(oncue, made, core, what):  # noqa: F811
    character, action = made()
    turn(character, "Head", START + 20, 0.4)
    spoil, words = SPOILT[what]
    spoil(oncue, character)
    keys = keys_of(oncue, action)
    with pytest.raises(RuntimeError, match=words):
        bpy.ops.oncue.resolve()
    assert keys_of(oncue, action) == keys


@pytest.mark.parametrize(("channel", "value"), [("location", (0, 0, 0)), ("scale", (1, 1, 1))])
def test_a_key_of_all_channels_as_blender_sets_it_hinders_nothing(oncue, made, core, channel, value):  # noqa: F811
    """I in pose mode keys place, turn and scale."""
    character, action = made()
    turn(character, "LeftArm", START + 20, 0.4)
    bone = character.pose.bones["LeftArm"]
    bone.keyframe_insert(channel, frame=START + 20)
    assert bpy.ops.oncue.resolve() == {"FINISHED"}
    assert [p.is_key for p in oncue("bridge.pins").read_pins(action)] == [True]
    assert tuple(getattr(bone, channel)) == value
    # One that plays something is no rest, were it between two keys alone.
    curve_of(oncue, action, channel=channel).keyframe_points[0].handle_right.y += 0.1
    turn(character, "LeftArm", START + 10, 0.2)
    with pytest.raises(RuntimeError, match="which Re-solve does not know of"):
        bpy.ops.oncue.resolve()


def test_a_pin_past_the_motion_is_refused_though_the_artists_keys_go_on(oncue, made):  # noqa: F811
    character, _ = made()
    turn(character, "Head", START + FRAMES + 100, 0.4)
    select(oncue, character, "LeftHand")
    with pytest.raises(RuntimeError, match=f"not within the motion's, {START} to {START + FRAMES - 1}"):
        bpy.ops.oncue.pin(first_frame=START + FRAMES + 59, last_frame=START + FRAMES + 60)


def test_all_pins_can_be_removed_together(oncue, made):  # noqa: F811
    character, action = made()
    select(oncue, character, "LeftHand", "RightHand")
    bpy.context.scene.frame_set(START + 4)
    bpy.ops.oncue.pin()
    assert len(oncue("bridge.pins").read_pins(action)) == 2
    assert bpy.ops.oncue.remove_pins() == {"FINISHED"}
    assert oncue("bridge.pins").read_pins(action) == []


@pytest.mark.parametrize(
    "text",
    [
        "[",
        "7",
        '[{"bone": 3, "first_frame": 1, "last_frame": 2}]',
        '[{"bone": "Head", "first_frame": "1", "last_frame": 2}]',
        '[{"bone": "Head", "first_frame": 1, "last_frame": 2, "position": [1, 2]}]',
        '[{"bone": "Head", "first_frame": 1, "last_frame": 2, "position": [1, 2, NaN]}]',
    ],
)
def test_pins_that_are_none_are_gone(oncue, made, text):  # noqa: F811
    _, action = made()
    action["oncue_pins"] = text
    assert oncue("bridge.pins").read_pins(action) == []


@pytest.mark.parametrize("text", ["[]", "null", "3", "{oops", '"text"'])
def test_a_report_that_is_none_is_none(oncue, made, text):  # noqa: F811
    _, action = made()
    action["oncue_report"] = text
    assert oncue("bridge.session").current_report(bpy.context.scene) is None


def test_what_a_take_keeps_is_not_unpacked_without_end(oncue, made, take_of, monkeypatch):  # noqa: F811
    character, _ = made()
    monkeypatch.setattr(oncue("bridge.solved"), "LARGEST_TAKE", 1000)
    with pytest.raises(oncue("errors").SceneError, match="damaged"):
        take_of(character)


# --- what fails leaves nothing behind ---------------------------------------------------------------------------------


def fail(*_, **__):
    raise KeyError("position")


def one_sentence(error):
    said = [line for line in str(error.value).splitlines() if line.startswith("Error: ")]
    assert len(said) == 1
    assert "KeyError: 'position'" in said[0]
    assert "Traceback" not in str(error.value)


@pytest.mark.parametrize("second", [False, True], ids=["first take", "second take"])
@pytest.mark.parametrize("where", ["read_scene", "write_action", "solved_take", "keep_solved"])
def test_an_error_of_our_own_is_a_sentence_and_leaves_the_file_as_it_was(
    stool, oncue, handle, monkeypatch, capsys, where, second
):
    if second:
        bpy.ops.oncue.synthesize()
    scene = stool.scene
    scene.frame_end = 5
    before, character = datablocks(), scene.oncue.character
    action = current_action() if second else None
    monkeypatch.setattr(oncue("bridge.session"), where, fail)
    with pytest.raises(RuntimeError, match="Synthesizing ended by an error") as error:
        bpy.ops.oncue.synthesize()
    one_sentence(error)
    assert handle.failed
    assert "Traceback" in capsys.readouterr().err
    assert datablocks() == before
    assert (scene.frame_end, scene.oncue.character) == (5, character)
    assert not second or current_action() == action
    monkeypatch.undo()
    assert bpy.ops.oncue.synthesize() == {"FINISHED"}


@pytest.mark.parametrize("where", ["keep_solved", "write_pins"])
def test_a_solve_that_fails_while_writing_leaves_the_take(oncue, made, core, monkeypatch, where):  # noqa: F811
    character, action = made()
    turn(character, "Head", START + 20, 0.4)
    keys, kept, before = keys_of(oncue, action), action["oncue_solved"], datablocks()
    monkeypatch.setattr(oncue("bridge.take"), where, fail)
    with pytest.raises(RuntimeError, match="Re-solving ended by an error") as error:
        bpy.ops.oncue.resolve()
    one_sentence(error)
    monkeypatch.undo()
    now = character.animation_data.action
    assert keys_of(oncue, now) == keys
    assert (now["oncue_solved"], now.name) == (kept, "Stroll")
    assert datablocks() == before
    assert bpy.ops.oncue.resolve() == {"FINISHED"}


def test_a_button_that_fails_says_so(context, oncue, monkeypatch):
    monkeypatch.setattr(oncue("bridge.seat_finder"), "surface_below", fail)
    with pytest.raises(RuntimeError, match="Place Cue ended by an error") as error:
        bpy.ops.oncue.place_cue(kind="start")
    one_sentence(error)


# --- settings and the command line ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        ('{"scene": {"floor_heigth": 0.0}}', "no setting scene.floor_heigth"),
        ('{"scene": 3}', "scene is a group"),
        ('{"scene": {"floor_height": NaN}}', "NaN is no number"),
        ('{"kept": {"rollouts": Infinity}}', "Infinity is no number"),
        ("[" * 100_000, "not JSON"),
    ],
)
def test_overrides_that_cannot_be_are_named(stool, overrides, words):
    stool.scene.oncue.overrides = overrides
    with pytest.raises(RuntimeError, match=words):
        bpy.ops.oncue.synthesize()


@pytest.mark.parametrize("how", ["synthesize", "follow"])
def test_the_scenes_own_settings_reach_its_index(stool, oncue, core, how):
    """The floor that the artist names is the floor, whatever lies under the start."""
    add_cube("Below", location=(0, 0, -3.05), scale=(30, 30, 0.1))
    session, pipeline, live = oncue("bridge.session"), oncue("pipeline"), oncue("live")
    for settings, expected in (({}, 0.0), ({"scene": {"floor_height": -3.0}}, -3.0)):
        stool.scene.oncue.overrides = json.dumps({**QUICK, **settings})
        if how == "follow":
            request, _ = session.read_request(stool)
            no_policies = types.SimpleNamespace(find=lambda *_: None)
            steps = live.world_steps(request, oncue("operators.synthesize").library_cache, no_policies, None)
            assert pipeline.run_blocking(steps).scene.floor_height == pytest.approx(expected, abs=1e-3)
        elif not settings:
            assert bpy.ops.oncue.synthesize() == {"FINISHED"}
        else:
            with pytest.raises(RuntimeError, match="over the scene's walkable floor"):
                bpy.ops.oncue.synthesize()


@pytest.fixture
def command(oncue, tmp_path, capsys):
    """`batch.py` in this process, on the file that is open: (exit status, sentences on stderr, report)."""

    def run(*arguments):
        report = tmp_path / "report.json"
        paths = ["--out", str(tmp_path / "out.blend"), "--report", str(report)]
        status = oncue("command_line").main([*paths, *map(str, arguments)])
        said = [line for line in capsys.readouterr().err.splitlines() if line.startswith("Oncue: ")]
        return status, said, json.loads(report.read_text()) if report.exists() else None

    return run


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--seed", -1), "--seed -1"),
        (("--seed", 2**31), "--seed 2147483648"),
        (("--start-frame", -5), "--start-frame -5"),
        (("--start-frame", 10**9), "--start-frame 1000000000"),
        (("--scene-scale", "nan"), "--scene-scale nan"),
        (("--scene-scale", 0), "--scene-scale 0.0"),
        (("--scene-scale", -1), "--scene-scale -1.0"),
        (("--scene-scale", "inf"), "--scene-scale inf"),
        (("--overrides", "{"), "not JSON"),
        (("--overrides", '{"ppo": {"updates": NaN}}'), "NaN is no number"),
    ],
)
def test_values_that_cannot_be_used_are_refused(stool, command, arguments, words):
    status, said, report = command(*arguments)
    assert status == 1
    assert len(said) == 1
    assert words in said[0]
    assert words in report["problems"][0]


def test_an_impossible_rate_is_refused(stool, command):
    stool.scene.render.fps, stool.scene.render.fps_base = 1, 100.0
    status, said, report = command()
    assert status == 1
    assert "0.01 frames a second" in said[0]
    assert report["success"] is False


def test_an_error_of_our_own_is_a_report_too(stool, command, oncue, monkeypatch):
    monkeypatch.setattr(oncue("bridge.session"), "keep_solved", fail)
    status, said, report = command()
    assert status == 1
    assert len(said) == 1
    assert "KeyError: 'position'" in said[0]
    assert "KeyError" in report["problems"][0]


def test_the_help_tells_the_exit_statuses(oncue):
    text = oncue("command_line").parser().format_help()
    for status in range(4):
        assert f"\n  {status}  " in text


# --- the panels -------------------------------------------------------------------------------------------------------


class Panel:
    """A panel's layout, and what it shows."""

    def __init__(self):
        self.layout = MagicMock()
        self.layout.panel.return_value = (self.layout, self.layout)
        for part in ("row", "column", "box"):
            getattr(self.layout, part).return_value = self.layout

    def draw(self, panel):
        if not hasattr(panel, "poll") or panel.poll(bpy.context):
            panel.draw(types.SimpleNamespace(layout=self.layout), bpy.context)
        return self

    @property
    def labels(self):
        return [call.kwargs.get("text", "") for call in self.layout.label.call_args_list]

    @property
    def operators(self):
        return [call.args[0] for call in self.layout.operator.call_args_list]


@pytest.fixture
def draw(oncue):
    panels = oncue("panels")
    return lambda name: Panel().draw(getattr(panels, f"ONCUE_PT_{name}"))


def test_every_panel_can_be_drawn_at_every_step(stool, oncue, draw):
    names = [cls.__name__.removeprefix("ONCUE_PT_") for cls in oncue("panels").CLASSES if "_PT_" in cls.__name__]
    for step in (lambda: None, bpy.ops.oncue.synthesize, lambda: bpy.data.objects.remove(bpy.data.objects["Sit"])):
        step()
        for name in names:
            draw(name)


def test_the_result_tells_that_it_is_of_other_cues(stool, draw):
    bpy.ops.oncue.synthesize()
    words = "The cues have changed since"
    assert not any(words in label for label in draw("results").labels)
    bpy.data.objects["Sit"].location.x += 0.2
    stool.view_layer.update()
    assert words in " ".join(draw("results").labels)


def test_a_report_that_somebody_changed_does_not_break_the_panel(stool, oncue, draw):
    bpy.ops.oncue.synthesize()
    for text in (
        '{"cues": 3}',
        '{"cues": [{"cue": 1}]}',
        '{"cues": [], "penetration": {}}',
        '{"cues": [], "task": {"cue": 1}}',
    ):
        current_action()["oncue_report"] = text
        draw("results")


def test_the_button_under_a_refusal(stool, draw, handle):
    bpy.ops.oncue.synthesize()
    assert "oncue.reset_character" not in draw("messages").operators
    stool.scene.oncue.character.scale = (0.5, 0.5, 0.5)
    with pytest.raises(RuntimeError):
        bpy.ops.oncue.synthesize()
    assert "oncue.reset_character" in draw("messages").operators


def test_pins_stand_below_the_button_and_fold_away(oncue, made, draw):  # noqa: F811
    _, action = made()
    pins = oncue("bridge.pins")
    pins.write_pins(action, [pins.Pin("Head", frame, frame) for frame in range(START, START + 2000)])
    drawn = draw("edit")
    assert drawn.operators.index("oncue.resolve") < drawn.operators.index("oncue.remove_pins")
    assert drawn.layout.panel.call_args.kwargs["default_closed"]
    assert len(drawn.labels) <= oncue("panels").LONGEST_LIST + 2


# --- finding the operators --------------------------------------------------------------------------------------------


class Layout:
    """Notes the operators that a menu shows."""

    operator_context = ""

    def __init__(self):
        self.shown = []

    def operator(self, name, **_):
        self.shown.append(name)
        return types.SimpleNamespace()

    def separator(self):
        pass


def test_every_operator_is_in_a_menu(oncue):
    """The search finds what a menu has."""
    menus, shown = oncue("operators.menus"), set()
    for menu in menus.CLASSES:
        layout = Layout()
        menu.draw(types.SimpleNamespace(layout=layout), bpy.context)
        shown |= set(layout.shown)
    #: What only its own row or a message offers.
    elsewhere = {"cancel", "remove_pin", "remove_library", "set_scene_scale", "clear_policies", "go_to_frame"}
    elsewhere |= {"move_to_edge", "move_step", "select_cue", "be_here", "choose_person", "name_bone", "play_take"}
    assert shown == {f"oncue.{name}" for name in dir(bpy.ops.oncue)} - {f"oncue.{name}" for name in elsewhere}
    for place, draw in menus.PLACES:
        assert draw in getattr(bpy.types, place).draw._draw_funcs


def test_everything_has_a_tooltip(oncue):
    lacking = []
    for name in dir(bpy.ops.oncue):
        operator = getattr(bpy.ops.oncue, name).get_rna_type()
        lacking += [] if operator.description else [name]
        for part in operator.properties:
            if part.identifier != "rna_type" and not part.is_hidden and not part.description:
                lacking.append(f"{name}.{part.identifier}")
            if part.type == "ENUM":
                lacking += [f"{name}.{part.identifier}.{i.identifier}" for i in part.enum_items if not i.description]
    settings = bpy.types.Scene.bl_rna.properties["oncue"].fixed_type
    own = [part for part in settings.properties if part.identifier not in ("rna_type", "name")]
    lacking += [f"settings.{part.identifier}" for part in own if not part.description]
    assert lacking == []


def test_frames_of_the_core_are_those_of_the_scene(oncue):
    """By hand: frame 30 of the core is a second in, 25 frames at 25 a second."""
    assert oncue("scene_frames").in_scene_frames("on frame 30", 10, 25.0) == "on frame 35"
    assert np.isclose(oncue("scene_frames").CORE_RATE, 30.0)
