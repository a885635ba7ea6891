"""Empties → the core's task; and placing them."""

import math

import bmesh
import bpy
import pytest
from mathutils import Vector

from .shapes import add_cube, add_floor


@pytest.fixture
def objects(oncue):
    return oncue("bridge.cue_objects")


@pytest.fixture
def read(oncue):
    return lambda scale=1.0: oncue("bridge.cue_reader").read_task(bpy.context, scale)


@pytest.fixture
def refused(oncue, read):
    def check(words):
        with pytest.raises(oncue("errors").SceneError, match=words):
            read()

    return check


def test_the_task_of_a_start_and_a_sit(objects, read):
    objects.make_cue(bpy.context, "start", (1, 2, 0), 0.0)
    sit = objects.make_cue(bpy.context, "sit", (3, 4, 0.55), objects.yaw_from_heading(math.radians(-178)))
    objects.make_cue(bpy.context, "left_foot", (3.5, 4.1, 0), 0.0, parent=sit)
    task = read()
    assert task["start"] == {"name": "Start", "position": [1, 2, 0], "yaw": 0.0}
    cue = task["cue"]
    assert (cue["name"], cue["action_type"]) == ("Sit", "sit")
    assert cue["position"] == pytest.approx([3, 4, 0.55])
    # A heading of -178° is a yaw of -88°.
    assert cue["yaw"] == pytest.approx(math.radians(-88), abs=1e-6)
    assert cue["feet"][0] == pytest.approx([3.5, 4.1, 0])
    assert cue["feet"][1] is None


@pytest.mark.parametrize("yaw", [0.0, 0.5, 1.5, 3.0, -2.0])
def test_facing_is_the_local_minus_y_whatever_the_scale_and_the_tilt(objects, read, yaw):
    objects.make_cue(bpy.context, "start", (0, 0, 0), 0.3)
    cue = objects.make_cue(bpy.context, "stop", (0, 0, 0), yaw)
    cue.scale = (2.0, 0.1, 5.0)
    cue.rotation_euler.x = 0.4
    bpy.context.view_layer.update()
    assert read()["cue"]["yaw"] == pytest.approx(yaw, abs=1e-5)


def test_a_parent_moves_its_cues(objects, read):
    objects.make_cue(bpy.context, "start", (0, 0, 0), 0.0)
    sofa = add_cube("Sofa")
    cue = objects.make_cue(bpy.context, "sit", (0, 0, 0.5), 0.0)
    cue.parent = sofa
    sofa.location, sofa.rotation_euler.z = (5, 0, 0), math.pi / 2
    bpy.context.view_layer.update()
    assert read()["cue"]["position"] == pytest.approx([5, 0, 0.5])
    assert read()["cue"]["yaw"] == pytest.approx(math.pi / 2)


def test_a_scene_in_centimetres_gives_metres(objects, read):
    objects.make_cue(bpy.context, "start", (100, 200, 0), 0.0)
    objects.make_cue(bpy.context, "stop", (300, 0, 0), 0.0)
    assert read(0.01)["start"]["position"] == pytest.approx([1, 2, 0])


def test_missing_and_double_cues_are_named(objects, refused):
    refused("no Start cue")
    objects.make_cue(bpy.context, "start", (0, 0, 0), 0.0)
    refused("no Sit or Stop cue")
    objects.make_cue(bpy.context, "start", (1, 0, 0), 0.0, name="Other Start")
    refused("2 Start cues.*Other Start.*Start")


def test_hidden_cues_wait(objects, read):
    objects.make_cue(bpy.context, "start", (0, 0, 0), 0.0)
    objects.make_cue(bpy.context, "sit", (1, 0, 0), 0.0, name="Armchair").hide_set(True)
    objects.make_cue(bpy.context, "stop", (2, 0, 0), 0.0, name="Window")
    assert read()["cue"]["name"] == "Window"


def test_a_cue_that_faces_the_sky_is_named(objects, refused):
    objects.make_cue(bpy.context, "start", (0, 0, 0), 0.0)
    cue = objects.make_cue(bpy.context, "sit", (1, 0, 0), 0.0)
    cue.rotation_euler.x = math.pi / 2
    bpy.context.view_layer.update()
    refused("Sit faces straight up")


def test_a_cue_of_no_size_is_named(objects, refused):
    objects.make_cue(bpy.context, "start", (0, 0, 0), 0.0)
    objects.make_cue(bpy.context, "sit", (1, 0, 0), 0.0).scale = (0, 0, 0)
    bpy.context.view_layer.update()
    refused("Sit.*no size")


# --- the buttons -----------------------------------------------------------------------------------------------------


def test_start_and_stop_stand_on_the_floor_under_the_cursor(context):
    add_floor()
    context.scene.cursor.location = (1.0, 0.5, 0.2)
    assert bpy.ops.oncue.place_cue(kind="start") == {"FINISHED"}
    assert tuple(bpy.data.objects["Start"].location) == pytest.approx((1.0, 0.5, 0.0))
    context.scene.cursor.location = (-1.0, 0.5, 0.2)
    bpy.ops.oncue.place_cue(kind="stop")
    stop = bpy.data.objects["Stop"]
    # Away from the start: towards -X.
    assert (stop.matrix_world.to_3x3() @ Vector((0, -1, 0))).x == pytest.approx(-1.0)


def test_the_start_turns_towards_the_cue_until_the_artist_turns_it(context):
    add_floor()
    start_facing = lambda: bpy.data.objects["Start"].matrix_world.to_3x3() @ Vector((0, -1, 0))  # noqa: E731
    bpy.ops.oncue.place_cue(kind="start")
    assert start_facing().y == pytest.approx(-1.0)
    for place in ((2.0, 0.0, 0.0), (0.0, 2.0, 0.0)):
        context.scene.cursor.location = place
        bpy.ops.oncue.place_cue(kind="stop")
        context.view_layer.update()
        assert start_facing() @ Vector(place).normalized() == pytest.approx(1.0, abs=1e-5)
    bpy.data.objects["Start"].rotation_euler.z += 0.5
    context.view_layer.update()
    turned = start_facing()
    context.scene.cursor.location = (-2.0, 0.0, 0.0)
    bpy.ops.oncue.place_cue(kind="sit")
    context.view_layer.update()
    assert start_facing() @ turned == pytest.approx(1.0, abs=1e-5)


def test_pressing_again_moves_the_cue(context):
    add_floor()
    bpy.ops.oncue.place_cue(kind="sit")
    context.scene.cursor.location = (2.0, 0.0, 0.0)
    bpy.ops.oncue.place_cue(kind="stop")
    cues = [o for o in context.scene.objects if o.get("oncue_cue")]
    assert [(o["oncue_cue"], round(o.location.x, 3)) for o in cues] == [("stop", 2.0)]


def test_a_cue_says_how_long_the_person_stays(context, oncue, core):
    add_floor()
    session, settings = oncue("bridge.session"), context.scene.oncue
    bpy.ops.oncue.place_cue(kind="start")
    assert session.wishes_of(context) == {}
    bpy.ops.oncue.place_cue(kind="stop")
    stop = bpy.data.objects["Stop"]
    assert session.wishes_of(context) == {"synthesizer": {"hold_seconds": 1.0}}
    stop["oncue_hold_seconds"] = 12
    assert session.wishes_of(context) == {"synthesizer": {"hold_seconds": 12.0}}
    merged = oncue("pipeline").merged(core.default_settings("default"), session.wishes_of(context))
    assert merged["synthesizer"]["hold_seconds"] == 12.0
    # What is written comes first; another place for the cue, and another kind of it, is as long as before.
    settings.overrides = '{"synthesizer": {"hold_seconds": 3, "life": 0}}'
    assert session.wishes_of(context) == {"synthesizer": {"hold_seconds": 3, "life": 0}}
    settings.overrides = ""
    bpy.ops.oncue.place_cue(kind="sit")
    assert (stop["oncue_cue"], stop["oncue_hold_seconds"]) == ("sit", 12)
    for wrong in (-1.0, 601.0, float("nan"), "long"):
        stop["oncue_hold_seconds"] = wrong
        with pytest.raises(oncue("errors").SceneError, match="stay for"):
            session.wishes_of(context)
    # One that a script made and that does not say leaves it to the settings.
    del stop["oncue_hold_seconds"]
    assert session.wishes_of(context) == {}


@pytest.mark.parametrize("yaw", [0.0, 0.7, math.pi / 2, math.pi, -2.2])
def test_sitting_on_a_chair_faces_away_from_its_back(context, fixtures, yaw):
    fixtures.f.floor(context.scene, (-3, -3), (3, 3))
    chair = fixtures.f.chair(context.scene, (0.4, -0.3, 0), yaw)
    context.view_layer.update()
    context.view_layer.objects.active = chair
    chair.select_set(True)
    assert bpy.ops.oncue.sit_on_selection() == {"FINISHED"}
    cue = next(o for o in context.scene.objects if o.get("oncue_cue") == "sit")
    assert cue.matrix_world.translation.z == pytest.approx(0.55, abs=0.01)
    assert (cue.matrix_world.translation.xy - chair.location.xy).length < 0.06
    forward = cue.matrix_world.to_3x3() @ Vector((0, -1, 0))
    expected = Vector((math.sin(yaw), -math.cos(yaw), 0))
    assert forward.angle(expected) < math.radians(8)


def test_sitting_on_a_selected_face(context, fixtures):
    fixtures.f.floor(context.scene, (-3, -3), (3, 3))
    bench = add_cube("Bench", location=(0, 2, 0.225), scale=(1.6, 0.4, 0.45))
    add_cube("Wall", location=(0, 2.3, 1), scale=(6, 0.1, 2))
    context.view_layer.objects.active = bench
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_mode(type="FACE")
    mesh = bmesh.from_edit_mesh(bench.data)
    for face in mesh.faces:
        face.select_set(face.normal.z > 0.9)
    bmesh.update_edit_mesh(bench.data)
    assert bpy.ops.oncue.sit_on_selection() == {"FINISHED"}
    assert context.mode == "EDIT_MESH"
    bpy.ops.object.mode_set(mode="OBJECT")
    cue = next(o for o in context.scene.objects if o.get("oncue_cue") == "sit")
    assert tuple(cue.matrix_world.translation) == pytest.approx((0, 2, 0.55), abs=1e-4)
    assert (cue.matrix_world.to_3x3() @ Vector((0, -1, 0))).y < -0.9


def test_nothing_selected_is_a_sentence(context):
    with pytest.raises(RuntimeError, match="Select the chair"):
        bpy.ops.oncue.sit_on_selection()


def test_feet_stand_before_the_seat(context, fixtures, read):
    fixtures.stool_alone()
    assert bpy.ops.oncue.place_foot(side="left") == {"FINISHED"}
    assert bpy.ops.oncue.place_foot(side="right") == {"FINISHED"}
    left, right = read()["cue"]["feet"]
    # The stool's cue faces -Y, so the left foot is at +X.
    assert left == pytest.approx([0.10, -0.42, 0.0], abs=1e-4)
    assert right == pytest.approx([-0.10, -0.42, 0.0], abs=1e-4)
