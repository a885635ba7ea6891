"""The file as the artist sees it: what every state of it gives, by the button; handled, or refused before the run."""

import bmesh
import bpy
import numpy as np
import pytest
from mathutils import Quaternion, Vector

from .runs import current_action, datablocks, keys_of, set_quick
from .shapes import add_cube
from .test_character import evaluated_heads, forward_kinematics


@pytest.fixture
def stool(fixtures, core):
    """A small task, ready to run; with a key on every frame, so that a joint that is off is moved by something else."""
    fixtures.stool_alone()
    set_quick(bpy.context.scene)
    bpy.context.scene.oncue.every_frame = True
    return bpy.context


@pytest.fixture
def character(stool):
    """The character after a first take."""
    bpy.ops.oncue.synthesize()
    return stool.scene.oncue.character


def synthesize():
    assert bpy.ops.oncue.synthesize() == {"FINISHED"}
    return current_action()


def refused(words):
    """Refused in one sentence, and nothing in the file has changed."""
    before = datablocks()
    with pytest.raises(RuntimeError, match=words) as error:
        bpy.ops.oncue.synthesize()
    assert datablocks() == before
    assert len([line for line in str(error.value).splitlines() if line.startswith("Error: ")]) == 1


def triangles(oncue):
    return oncue("bridge.session").current_report(bpy.context.scene)["extension"]["scene_triangles"]


def worst_joint(oncue, core):
    """How far a joint is from where the core's motion has it, on every tenth frame, metres."""
    scene, skeleton = bpy.context.scene, core.skeleton()
    solved = oncue("bridge.solved").solved_of(current_action())
    motion = oncue("motion").resample(solved.motion, oncue("bridge.scene_time").frame_rate(scene))
    expected = forward_kinematics(skeleton, motion)[::10]
    shown = evaluated_heads(
        scene.oncue.character, skeleton["names"], scene.oncue.start_frame + 10 * np.arange(len(expected))
    )
    return np.abs(shown - expected).max()


def enter_edit_mode(thing):
    bpy.context.view_layer.objects.active = thing
    bpy.ops.object.mode_set(mode="EDIT")


# --- meshes in edit mode ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "modifier", [None, "BEVEL", "ARRAY", "TRIANGULATE", "DISPLACE", "REMESH", "DECIMATE", "BOOLEAN", "MULTIRES"]
)
def test_a_mesh_in_edit_mode_is_read_as_it_is_edited(context, oncue, modifier):
    read = oncue("bridge.scene_reader").read_scene
    add_cube("Table")
    box = add_cube("Box", location=(3, 0, 0))
    if modifier:
        made = box.modifiers.new("Modifier", modifier)
        if modifier == "BOOLEAN":
            made.object = add_cube("Hole", location=(3, 0, 0.5), size=0.6)
            made.object.display_type = "WIRE"
    context.view_layer.update()
    before = read(context)
    enter_edit_mode(box)
    mesh = bmesh.from_edit_mesh(box.data)
    for vertex in mesh.verts:
        vertex.co.z += 2.0
    bmesh.update_edit_mesh(box.data)
    things = datablocks()
    edited = read(context)
    assert context.mode == "EDIT_MESH"
    assert datablocks() == things
    if modifier != "BOOLEAN":
        assert edited.positions[:, 2].max() == pytest.approx(before.positions[:, 2].max() + 2.0)
    bpy.ops.object.mode_set(mode="OBJECT")
    after = read(context)
    assert np.array_equal(edited.triangles, after.triangles)
    assert np.allclose(edited.positions, after.positions, atol=1e-6)


@pytest.mark.parametrize("modifier", [None, "MULTIRES", "SUBSURF", "ARRAY", "dynamic topology"])
def test_a_mesh_that_is_sculpted_is_read_as_it_will_be(context, oncue, modifier):
    read = oncue("bridge.scene_reader").read_scene
    add_cube("Table")
    box = add_cube("Box", location=(3, 0, 0))
    context.view_layer.objects.active = box
    if modifier == "MULTIRES":
        box.modifiers.new("Modifier", modifier)
        for _ in range(2):
            bpy.ops.object.multires_subdivide(modifier="Modifier")
    elif modifier and modifier.isupper():
        box.modifiers.new("Modifier", modifier)
    context.view_layer.update()
    before = read(context)
    bpy.ops.object.mode_set(mode="SCULPT")
    if modifier == "dynamic topology":
        bpy.ops.sculpt.dynamic_topology_toggle()
    things = datablocks()
    sculpted = read(context)
    assert (context.mode, datablocks()) == ("SCULPT", things)
    assert len(sculpted.triangles) == len(before.triangles)
    # Sculpting with dynamic topology cuts faces into triangles in its own way.
    if modifier != "dynamic topology":
        assert np.array_equal(sculpted.triangles, before.triangles)
    assert np.allclose(sculpted.positions, before.positions, atol=1e-5)


def test_who_shares_the_edited_mesh_is_read_too(context, oncue):
    box = add_cube("Box")
    other = bpy.data.objects.new("Other", box.data)
    other.location.x = 5
    context.scene.collection.objects.link(other)
    enter_edit_mode(box)
    assert len(oncue("bridge.scene_reader").read_scene(context).triangles) == 24


@pytest.mark.parametrize("modifier", [None, "BEVEL"])
def test_the_first_use_as_the_readme_has_it(stool, oncue, modifier):
    """The seat's face is selected in edit mode, and Synthesize pressed there."""
    seat = next(thing for thing in stool.scene.objects if thing.type == "MESH" and thing.name != "Floor")
    bpy.data.objects.remove(bpy.data.objects["Sit"])
    if modifier:
        seat.modifiers.new("Modifier", modifier).width = 0.01
    seat.select_set(True)
    enter_edit_mode(seat)
    bpy.ops.mesh.select_mode(type="FACE")
    mesh = bmesh.from_edit_mesh(seat.data)
    top = max(face.calc_center_median().z for face in mesh.faces)
    for face in mesh.faces:
        face.select_set(face.normal.z > 0.9 and face.calc_center_median().z > top - 1e-4)
    bmesh.update_edit_mesh(seat.data)
    assert bpy.ops.oncue.sit_on_selection() == {"FINISHED"}
    synthesize()
    assert stool.mode == "EDIT_MESH"
    assert triangles(oncue) > 100


def test_a_seat_is_where_its_modifiers_put_it(context, fixtures):
    """The face that is selected is the cage's; a person sits on what the view shows."""
    fixtures.f.floor(context.scene, (-3, -3), (3, 3))
    bench = add_cube("Bench", location=(0, 2, 0.2), scale=(1.6, 0.4, 0.4))
    raised = bench.modifiers.new("Cushion", "DISPLACE")
    raised.direction, raised.mid_level, raised.strength = "Z", 0.0, 0.25
    context.view_layer.update()
    shown = bench.evaluated_get(context.evaluated_depsgraph_get()).data
    assert max((bench.matrix_world @ v.co).z for v in shown.vertices) == pytest.approx(0.5, abs=1e-3)
    assert not raised.show_in_editmode
    enter_edit_mode(bench)
    bpy.ops.mesh.select_mode(type="FACE")
    mesh = bmesh.from_edit_mesh(bench.data)
    for face in mesh.faces:
        face.select_set(face.normal.z > 0.9)
    bmesh.update_edit_mesh(bench.data)
    bpy.ops.oncue.sit_on_selection()
    assert bpy.data.objects["Sit"].location.z == pytest.approx(0.6, abs=1e-3)
    assert not raised.show_in_editmode


# --- what the view hides ----------------------------------------------------------------------------------------------


def in_collection(name, *things):
    made = bpy.data.collections.new(name)
    bpy.context.scene.collection.children.link(made)
    for thing in things:
        for collection in list(thing.users_collection):
            collection.objects.unlink(thing)
        made.objects.link(thing)
    bpy.context.view_layer.update()
    return made, bpy.context.view_layer.layer_collection.children[name]


HIDING = {
    "eye": lambda collection, layer: setattr(layer, "hide_viewport", True),
    "monitor": lambda collection, layer: setattr(collection, "hide_viewport", True),
    "excluded": lambda collection, layer: setattr(layer, "exclude", True),
}


@pytest.mark.parametrize("way", HIDING)
def test_what_a_collection_hides_is_neither_obstacle_nor_cue(context, oncue, way):
    add_cube("Table")
    instance = bpy.data.objects.new("Instance", None)
    instance.instance_type, instance.instance_collection = "COLLECTION", bpy.data.collections.new("Kit")
    piece = add_cube("Piece")
    instance.instance_collection.objects.link(piece)
    context.scene.collection.objects.unlink(piece)
    context.scene.collection.objects.link(instance)
    cue = oncue("bridge.cue_objects").make_cue(context, "start", (0, 0, 0), 0.0)
    collection, layer = in_collection("Set", add_cube("Box"), instance, cue)
    read, cues = oncue("bridge.scene_reader").read_scene, oncue("bridge.shown_cues").visible_cues
    assert len(read(context).triangles) == 36
    assert cues(context, "start") == [cue]
    HIDING[way](collection, layer)
    context.view_layer.update()
    assert len(read(context).triangles) == 12
    assert cues(context, "start") == []


# --- what belongs to a person -----------------------------------------------------------------------------------------


def own_skin(character):
    """A mesh as *Parent with Automatic Weights* leaves it."""
    skin = add_cube("Own Skin", location=(0, 0, 0.9))
    skin.parent = character
    skin.modifiers.new("Armature", "ARMATURE").object = character
    return skin


def deformed_only(character):
    skin = add_cube("Own Skin", location=(0, 0, 0.9))
    skin.modifiers.new("Armature", "ARMATURE").object = character


def prop_on_a_bone(character):
    cup = add_cube("Cup", size=0.1)
    cup.parent, cup.parent_type, cup.parent_bone = character, "BONE", "RightHand"


def hair_on_the_skin(character):
    hair = add_cube("Hair", size=0.3)
    hair.parent = own_skin(character)


def bag_by_constraint(character):
    constraint = add_cube("Bag", size=0.3).constraints.new("CHILD_OF")
    constraint.target, constraint.subtarget = character, "Spine2"


def instance_in_the_hand(character):
    kit, piece = bpy.data.collections.new("Kit"), add_cube("Piece")
    kit.objects.link(piece)
    bpy.context.scene.collection.objects.unlink(piece)
    holder = bpy.data.objects.new("Holder", None)
    holder.instance_type, holder.instance_collection = "COLLECTION", kit
    holder.parent, holder.parent_type, holder.parent_bone = character, "BONE", "LeftHand"
    bpy.context.scene.collection.objects.link(holder)


@pytest.mark.parametrize(
    "dress",
    [own_skin, deformed_only, prop_on_a_bone, hair_on_the_skin, bag_by_constraint, instance_in_the_hand],
    ids=lambda make: make.__name__,
)
def test_what_a_person_wears_or_holds_is_no_furniture(character, oncue, dress):
    before = triangles(oncue)
    keys = keys_of(oncue, current_action())
    dress(character)
    bpy.context.view_layer.update()
    synthesize()
    assert triangles(oncue) == before
    assert keys_of(oncue, current_action()) == keys


def test_hanging_in_a_circle_ends(context, oncue):
    a, b = add_cube("A"), add_cube("B")
    for one, other in ((a, b), (b, a)):
        one.modifiers.new("Armature", "ARMATURE")
        one.constraints.new("COPY_LOCATION").target = other
    assert len(oncue("bridge.scene_reader").read_scene(context).triangles) == 24


def test_a_seat_is_found_while_somebody_sits_on_it(stool, oncue, fixtures):
    """The rays for the facing go through the person, its skin and what it holds."""
    chair = fixtures.f.chair(stool.scene, (1.5, 1.5, 0), 0.6)
    stool.view_layer.update()

    def press():
        stool.view_layer.objects.active = chair
        chair.select_set(True)
        assert bpy.ops.oncue.sit_on_selection() == {"FINISHED"}
        cue = next(thing for thing in stool.scene.objects if thing.get("oncue_cue") == "sit")
        return np.array(cue.matrix_world)

    empty = press()
    person = oncue("bridge.armature").make_character(stool, oncue("native").core.skeleton())
    person.location, person.rotation_euler.z = (1.5, 1.4, -0.4), 0.6
    own_skin(person).location = (0, 0, 0.9)
    prop_on_a_bone(person)
    stool.view_layer.update()
    assert np.allclose(press(), empty, atol=1e-5)
    skin = next(thing for thing in person.children if thing.type == "MESH")
    stool.view_layer.objects.active = skin
    skin.select_set(True)
    with pytest.raises(RuntimeError, match="belongs to a character"):
        bpy.ops.oncue.sit_on_selection()


# --- the character's animation ----------------------------------------------------------------------------------------


def test_tweak_mode_is_said_before_the_run(character):
    data = character.animation_data
    track = data.nla_tracks.new()
    strip = track.strips.new("Take", 1, data.action)
    data.action = None
    data.nla_tracks.active = track
    track.select = strip.select = True
    data.use_tweak_mode = True
    refused("tweak mode")
    assert bpy.ops.oncue.reset_character() == {"FINISHED"}
    synthesize()


def solo(character):
    track = character.animation_data.nla_tracks.new()
    track.strips.new("Take", 1, character.animation_data.action)
    track.is_solo = True


def scaled_in_a_strip(character):
    action = bpy.data.actions.new("Big Head")
    before, data = character.animation_data.action, character.animation_data
    data.action = action
    character.pose.bones["Head"].scale = (2, 2, 2)
    character.pose.bones["Head"].keyframe_insert("scale", frame=1)
    character.pose.bones["Head"].scale = (1, 1, 1)
    data.nla_tracks.new().strips.new("Big", 1, action)
    data.action = before


def driver(character):
    character.pose.bones["Head"].driver_add("rotation_quaternion", 1)


def constraint(character):
    character.pose.bones["LeftHand"].constraints.new("LIMIT_ROTATION").name = "Stiff"


def bone(character, name, parent=None, over=None):
    """Gives the armature another bone: on one that is there, or over one."""
    bpy.context.view_layer.objects.active = character
    bpy.ops.object.mode_set(mode="EDIT")
    bones = character.data.edit_bones
    made = bones.new(name)
    made.head = bones[parent].tail if parent else (0, 0, 0)
    made.tail = made.head + Vector((0, 0, 0.2))
    made.parent = bones[parent] if parent else None
    if over:
        bones[over].parent = made
    bpy.ops.object.mode_set(mode="OBJECT")
    return character.pose.bones[name]


def aim(place):
    target = bpy.data.objects.new("Aim", None)
    target.location = place
    bpy.context.scene.collection.objects.link(target)
    return target


def constraint_over_the_hips(character):
    bone(character, "Master", over="Hips").constraints.new("COPY_LOCATION").target = aim((1, 1, 0))


def driver_over_the_hips(character):
    bone(character, "Master", over="Hips").driver_add("location", 0).driver.expression = "1.0"


def strip_over_the_hips(character):
    master = bone(character, "Master", over="Hips")
    data, before = character.animation_data, character.animation_data.action
    data.action = bpy.data.actions.new("Carried")
    master.rotation_mode = "XYZ"
    master.rotation_euler.x = 1.0
    master.keyframe_insert("rotation_euler", frame=1)
    master.rotation_euler.x = 0.0
    data.nla_tracks.new().strips.new("Carried", 1, data.action)
    data.action = before


def chain_of_another_bone(character):
    bent = bone(character, "Glove", parent="LeftHand").constraints.new("IK")
    bent.target, bent.chain_count = aim((0.5, -1, 1.5)), 4


def driven_influence(character):
    bent = character.pose.bones["Head"].constraints.new("COPY_ROTATION")
    bent.target, bent.subtarget, bent.influence = character, "Hips", 0.0
    bent.driver_add("influence").driver.expression = "frame > 20"


def driven_mute(character):
    bent = character.pose.bones["Head"].constraints.new("LIMIT_ROTATION")
    bent.mute = True
    bent.driver_add("mute").driver.expression = "frame < 20"


BENT = {
    "over the hips": (constraint_over_the_hips, r"constraint on Master \(Copy Location\)"),
    "driven over the hips": (driver_over_the_hips, "driver on .*Master"),
    "strip over the hips": (strip_over_the_hips, "moved or scaled bones in its NLA strip Carried"),
    "another bone's chain": (chain_of_another_bone, r"constraint on Glove \(IK\)"),
    "driven influence": (driven_influence, r"constraint on Head \(Copy Rotation\)"),
    "driven mute": (driven_mute, r"constraint on Head \(Limit Rotation\)"),
    "influence": (lambda c: setattr(c.animation_data, "action_influence", 0.5), "0.5"),
    "blend": (lambda c: setattr(c.animation_data, "action_blend_type", "ADD"), "Add"),
    "solo": (solo, "solo"),
    "strip": (scaled_in_a_strip, "moved or scaled bones in its NLA strip Big"),
    "driver": (driver, "driver on .*Head"),
    "constraint": (constraint, r"constraint on LeftHand \(Stiff\)"),
    "rest": (lambda c: setattr(c.data, "pose_position", "REST"), "rest position"),
    "moved bone": (lambda c: setattr(c.pose.bones["LeftLeg"], "location", (0, 0.1, 0)), "LeftLeg, that was moved"),
    "scaled bone": (lambda c: setattr(c.pose.bones["Spine"], "scale", (1, 1.2, 1)), "Spine, that was scaled"),
    "no rotation": (
        lambda c: setattr(c.data.bones["Head"], "use_inherit_rotation", False),
        "Head, that does not inherit",
    ),
    "no local location": (
        lambda c: setattr(c.data.bones["Hips"], "use_local_location", False),
        "Local Location is off",
    ),
    "small": (lambda c: setattr(c, "scale", (0.7, 0.7, 0.7)), "scaled to 0.7"),
    "tall": (lambda c: setattr(c, "scale", (1, 1, 1.2)), "scaled unevenly"),
    "mirrored": (lambda c: setattr(c, "scale", (-1, 1, 1)), "mirrored"),
    "nowhere": (lambda c: setattr(c, "location", (float("nan"), 0, 0)), "not a number"),
}


@pytest.mark.parametrize("state", BENT)
def test_a_character_that_would_play_it_otherwise_is_named(character, oncue, core, state):
    bend, words = BENT[state]
    bend(character)
    bpy.context.view_layer.update()
    refused(f"Oncue Character .*{words}.*Reset Character")
    # The way out that the sentence names.
    assert bpy.ops.oncue.reset_character() == {"FINISHED"}
    synthesize()
    assert bpy.context.scene.oncue.character == character
    assert worst_joint(oncue, core) < 1e-3


@pytest.mark.parametrize("state", ["edit mode", "excluded"])
def test_what_cannot_be_reset_offers_no_reset(character, oncue, state):
    if state == "edit mode":
        enter_edit_mode(character)
    else:
        bpy.context.scene.collection.children["Oncue"].objects.unlink(character)
        other = bpy.data.collections.new("Elsewhere")
        bpy.context.scene.collection.children.link(other)
        other.objects.link(character)
        bpy.context.view_layer.layer_collection.children["Elsewhere"].exclude = True
    refused("Oncue Character (is in edit mode|lies in no collection)")
    assert oncue("job_operator").handle.error is None


def test_settings_that_change_nothing_are_no_hindrance(character, oncue, core):
    for bone, how in zip(character.data.bones, ("NONE", "ALIGNED", "AVERAGE", "NONE_LEGACY"), strict=False):
        bone.inherit_scale = how
    for bone in character.pose.bones:
        bone.lock_rotation = bone.lock_location = (True, True, True)
    character.pose.bones["Head"].constraints.new("LIMIT_ROTATION").mute = True
    synthesize()
    assert worst_joint(oncue, core) < 1e-3


def test_what_bends_no_bone_of_the_skeleton_is_no_hindrance(character, oncue, core):
    bone(character, "Hat", parent="Head").constraints.new("COPY_LOCATION").target = aim((0, 0, 3))
    far = bone(character, "Feather", parent="Hat").constraints.new("IK")
    far.target, far.chain_count = aim((0, 0, 4)), 2
    bone(character, "Mark").constraints.new("COPY_LOCATION").target = aim((2, 0, 0))
    synthesize()
    assert worst_joint(oncue, core) < 1e-3


def test_a_muted_track_and_one_under_the_motion_are_no_hindrance(character, oncue, core):
    data = character.animation_data
    for mute in (False, True):
        track = data.nla_tracks.new()
        track.strips.new("Take", 1, data.action)
        track.mute = mute
    synthesize()
    assert worst_joint(oncue, core) < 1e-3


@pytest.mark.parametrize("mode", ["XYZ", "ZYX", "AXIS_ANGLE", "mixed"])
def test_bones_get_keys_of_the_kind_that_they_turn_by(character, oncue, core, mode):
    modes = ["XYZ", "QUATERNION", "AXIS_ANGLE", "YXZ"]
    for index, bone in enumerate(character.pose.bones):
        bone.rotation_mode = modes[index % 4] if mode == "mixed" else mode
    synthesize()
    assert worst_joint(oncue, core) < 1e-3
    with pytest.raises(RuntimeError, match="does not turn by quaternions"):
        bpy.ops.oncue.resolve()


@pytest.mark.parametrize("mode", ["XYZ", "ZXY", "AXIS_ANGLE"])
def test_a_whole_turn_has_no_jump_in_it(oncue, mode):
    """Three turns about Z in steps of 6°: the angle grows by a step each time, or axis and angle say the same."""
    half = np.radians(np.arange(0.0, 1080.0, 6.0)) / 2.0
    turns = np.stack([np.cos(half), 0 * half, 0 * half, np.sin(half)], axis=1)
    channel, values = oncue("bridge.channels").rotation_values(mode, turns)
    if mode == "AXIS_ANGLE":
        assert channel == "rotation_axis_angle"
        shown = np.array([Quaternion(axis, angle) for angle, *axis in values])
        assert np.abs(np.sum(shown * turns, axis=1)) == pytest.approx(1.0, abs=1e-6)
        assert np.degrees(np.abs(np.diff(values[:, 0]))).max() < 6.1
    else:
        assert channel == "rotation_euler"
        assert np.degrees(np.diff(values[:, 2])) == pytest.approx(6.0, abs=1e-3)


def test_what_an_older_take_moved_goes_back_to_rest(character, oncue, core):
    """A key on a channel that Oncue does not write belongs to its take; the next one is without it."""
    arm = character.pose.bones["LeftArm"]
    arm.scale = (1.5, 1.5, 1.5)
    arm.keyframe_insert("scale", frame=1)
    first = current_action()
    synthesize()
    assert tuple(arm.scale) == (1.0, 1.0, 1.0)
    assert worst_joint(oncue, core) < 1e-3
    assert any(curve.data_path.endswith('["LeftArm"].scale') for curve in oncue("bridge.compat").action_curves(first))


# --- where the character stands ---------------------------------------------------------------------------------------


def test_a_character_on_a_parent_that_stands_still_walks_in_the_world(character, oncue, core):
    cart = add_cube("Cart", location=(3, -2, 0))
    cart.rotation_euler.z = 0.8
    character.parent = cart
    character.constraints.new("COPY_LOCATION").target = add_cube("Mark", location=(-1, 4, 0.2))
    bpy.context.view_layer.update()
    synthesize()
    assert worst_joint(oncue, core) < 1e-3


@pytest.mark.parametrize("way", ["parent", "constraint", "strip", "there and back"])
def test_a_character_that_is_carried_away_is_named(character, oncue, core, way):
    cart = add_cube("Cart", location=(3, -2, 0))
    goes = ((1, 3.0), (60, 5.0)) if way != "there and back" else ((1, 3.0), (110, 3.0), (130, 5.0), (150, 3.0))
    for frame, x in goes:
        cart.location.x = x
        cart.keyframe_insert("location", frame=frame)
    if way in ("parent", "there and back"):
        character.parent = cart
    elif way == "constraint":
        character.constraints.new("COPY_LOCATION").target = cart
    else:
        character.animation_data.nla_tracks.new().strips.new("Ride", 1, cart.animation_data.action)
        if hasattr(character.animation_data, "action_slot"):
            strip = character.animation_data.nla_tracks[0].strips[0]
            strip.action_slot = cart.animation_data.action.slots[0]
    bpy.context.view_layer.update()
    frame = bpy.context.scene.frame_current
    refused("Oncue Character itself is moved")
    assert bpy.context.scene.frame_current == frame
    bpy.ops.oncue.reset_character()
    synthesize()
    assert worst_joint(oncue, core) < 1e-3


# --- which character --------------------------------------------------------------------------------------------------


def test_an_armature_of_another_skeleton_is_not_passed_over(character, stool):
    enter_edit_mode(character)
    character.data.edit_bones["LeftLeg"].head.x += 0.02
    bpy.ops.object.mode_set(mode="OBJECT")
    # Another skeleton than Oncue's: a rig like any other, whose knees are where they are now.
    synthesize()
    assert stool.scene.oncue.character == character
    own = bpy.data.objects.new("Metarig", bpy.data.armatures.new("Metarig"))
    stool.scene.collection.objects.link(own)
    stool.scene.oncue.character = own
    refused("Metarig was not recognised as a person: it has no bones")
    stool.scene.oncue.character = None
    synthesize()
    assert stool.scene.oncue.character not in (own, character)


def test_bones_whose_skin_was_deleted_get_another(character, stool):
    bpy.data.objects.remove(next(child for child in character.children if child.type == "MESH"))
    synthesize()
    assert [child.type for child in character.children] == ["MESH"]
    assert stool.scene.oncue.character == character


def rigid_parts(character):
    for bone in ("Head", "Hips", "LeftHand", "RightHand"):
        part = add_cube(f"{bone} Part", size=0.2)
        part.parent, part.parent_type, part.parent_bone = character, "BONE", bone


@pytest.mark.parametrize(("dress", "enough"), [(own_skin, True), (rigid_parts, True), (prop_on_a_bone, False)])
def test_ones_own_skin_is_skin_enough_and_a_cup_is_none(character, dress, enough):
    bpy.data.objects.remove(next(child for child in character.children if child.type == "MESH"))
    dress(character)
    children = set(character.children)
    synthesize()
    assert (set(character.children) == children) == enough


def test_a_mesh_that_only_carries_the_key_is_nobodys_skin(stool):
    """Scripts give the key to what is to be no obstacle."""
    marked = add_cube("Ghost", location=(9, 9, 0))
    marked["oncue_character"] = True
    synthesize()
    assert marked.parent is None
    assert len(marked.modifiers) == 0
    assert tuple(marked.location) == (9, 9, 0)


def test_a_skin_whose_bones_were_deleted_gets_others(character, stool):
    skin = next(child for child in character.children if child.type == "MESH")
    bpy.data.objects.remove(character)
    stool.view_layer.update()
    synthesize()
    new = stool.scene.oncue.character
    assert skin.parent == new
    assert [m.object for m in skin.modifiers] == [new]
    assert len([thing for thing in stool.scene.objects if thing.get("oncue_character")]) == 2


def test_a_duplicated_character_is_let_be(character, stool, oncue, core):
    for thing in stool.view_layer.objects:
        thing.select_set(thing == character or thing.parent == character)
    stool.view_layer.objects.active = character
    bpy.ops.object.duplicate()
    copy = stool.view_layer.objects.active
    before = copy.animation_data.action
    synthesize()
    assert stool.scene.oncue.character == character
    assert copy.animation_data.action == before
    assert worst_joint(oncue, core) < 1e-3


def test_a_character_that_the_view_layer_excludes_is_named(character, stool):
    stool.view_layer.layer_collection.children["Oncue"].exclude = True
    cues = [thing for thing in bpy.data.objects if thing.get("oncue_cue")]
    for cue in cues:
        stool.scene.collection.objects.link(cue)
    stool.view_layer.update()
    refused("lies in no collection that the view layer")
    stool.scene.oncue.character = None
    stool.view_layer.layer_collection.children["Oncue"].exclude = False
    synthesize()
    assert stool.scene.oncue.character == character


def test_a_linked_character_is_named_and_an_override_is_moved(character, stool, oncue, core, tmp_path):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "character.blend"), copy=True)
    skin = next(child for child in character.children if child.type == "MESH")
    for thing in (character, skin):
        bpy.data.objects.remove(thing)
    with bpy.data.libraries.load(str(tmp_path / "character.blend"), link=True) as (_, into):
        into.objects = ["Oncue Character"]
    linked = into.objects[0]
    stool.scene.collection.objects.link(linked)
    stool.scene.oncue.character = linked
    stool.view_layer.update()
    refused("Oncue Character is linked from .*library override")
    override = linked.override_create(remap_local_usages=True)
    override.override_library.is_system_override = False
    stool.scene.oncue.character = override
    stool.view_layer.update()
    synthesize()
    assert stool.scene.oncue.character == override
    assert worst_joint(oncue, core) < 1e-3


# --- slots ------------------------------------------------------------------------------------------------------------


@pytest.mark.skipif(bpy.app.version < (4, 4, 0), reason="actions have no slots")
def test_only_the_characters_own_slot_is_read_and_written(character, stool, oncue):
    action = current_action()
    other = character.copy()
    stool.scene.collection.objects.link(other)
    stool.view_layer.update()
    other.animation_data.action = action
    other.animation_data.action_slot = action.slots.new(id_type="OBJECT", name="Other")
    hips = other.pose.bones["Hips"]
    for frame in range(1, 90):
        hips.rotation_quaternion = (0.6, 0.0, 0.8, 0.0)
        hips.keyframe_insert("rotation_quaternion", frame=frame)
        hips.keyframe_insert("location", frame=frame)
    curves = oncue("bridge.compat").action_curves
    before = [[tuple(point.co) for point in curve.keyframe_points] for curve in curves(action, other)]
    assert before
    with pytest.raises(RuntimeError, match="Nothing was keyed or pinned"):
        bpy.ops.oncue.resolve()
    stool.scene.frame_set(40)
    arm = character.pose.bones["LeftArm"]
    arm.rotation_quaternion = arm.rotation_quaternion @ Quaternion((0.98, 0.2, 0.0, 0.0))
    arm.keyframe_insert("rotation_quaternion", frame=40)
    assert bpy.ops.oncue.resolve() == {"FINISHED"}
    assert [[tuple(point.co) for point in curve.keyframe_points] for curve in curves(action, other)] == before


@pytest.mark.skipif(bpy.app.version < (4, 4, 0), reason="actions have no slots")
def test_a_take_is_found_after_the_character_was_renamed(character, oncue, core):
    first = current_action()
    synthesize()
    character.name = "Anna"
    data = character.animation_data
    data.action = None
    data.action = first
    if data.action_slot is None:
        assert len(oncue("bridge.compat").action_curves(first, character)) == 91
    with pytest.raises(RuntimeError, match="Nothing was keyed or pinned"):
        bpy.ops.oncue.resolve()
    assert data.action_slot is not None
    assert worst_joint(oncue, core) < 1e-3


def test_a_doors_range_is_that_of_its_own_keys(context, oncue):
    door = add_cube("Door")
    key = door.shape_key_add(name="Basis") and door.shape_key_add(name="Bend")
    for frame in (10, 40):
        door.rotation_euler.z = frame / 40
        door.keyframe_insert("rotation_euler", frame=frame)
    key.keyframe_insert("value", frame=1)
    key.keyframe_insert("value", frame=200)
    if bpy.app.version >= (4, 4, 0):
        keys = door.data.shape_keys.animation_data
        keys.action = door.animation_data.action
        keys.action_slot = keys.action.slots.new(id_type="KEY", name="Bend")
        key.keyframe_insert("value", frame=1)
        key.keyframe_insert("value", frame=200)
    assert oncue("bridge.cue_objects").animated_range(door) == (10, 40)


# --- time -------------------------------------------------------------------------------------------------------------


def test_stretched_time_and_impossible_rates_are_named(stool):
    stool.scene.render.frame_map_new = 200
    refused("stretched from 100 to 200")
    stool.scene.render.frame_map_new = 100
    stool.scene.render.fps, stool.scene.render.fps_base = 1, 100.0
    refused("0.01 frames a second")
    stool.scene.render.fps, stool.scene.render.fps_base = 24, 1.001
    synthesize()


def test_a_shot_begins_where_it_begins(stool):
    scene = stool.scene
    scene.frame_start, scene.frame_end = 1001, 1010
    scene.frame_set(1001)
    first, last = synthesize().frame_range
    assert first == 1001
    assert (scene.frame_start, scene.frame_end) == (1001, last)
    scene.use_preview_range = True
    scene.frame_preview_start, scene.frame_preview_end = 1005, 1009
    assert synthesize().frame_range[0] == 1005
    assert (scene.frame_preview_start, scene.frame_preview_end) == (1005, 1009)
    # What the artist chose comes first, and the range is not widened backwards for it.
    scene.oncue.start_frame = 900
    assert synthesize().frame_range[0] == 900
    assert scene.frame_start == 1001
    scene.oncue.starts_with_shot = True
    scene.use_preview_range = False
    assert scene.oncue.start_frame == 1001


@pytest.fixture
def show(oncue, stool):
    """Has the scene hold a motion of so many frames from frame 1 on."""
    writer = oncue("bridge.action_writer")
    action = bpy.data.actions.new("Shown")
    return lambda count: writer._show_frames(stool.scene, action, 1, count)


def test_an_end_that_a_take_made_is_moved_back(stool, show):
    scene = stool.scene
    scene.frame_start, scene.frame_end = 1, 100
    show(289)
    assert scene.frame_end == 289
    show(167)
    assert scene.frame_end == 167
    # Never before the artist's own, which is taken up whenever it is set.
    show(80)
    assert scene.frame_end == 100
    show(289)
    scene.frame_end = 200
    show(150)
    assert scene.frame_end == 200


def test_a_range_that_nobody_set_fits_the_take(stool, show):
    scene = stool.scene
    scene.frame_start, scene.frame_end = 1, 250
    show(182)
    assert scene.frame_end == 182
    show(120)
    assert scene.frame_end == 120
    scene.frame_end = 250
    ball = add_cube("Ball")
    for frame in (1, 250):
        ball.keyframe_insert("location", frame=frame)
    show(182)
    assert scene.frame_end == 250


def test_a_first_frame_is_kept_with_the_file(stool, tmp_path):
    stool.scene.oncue.start_frame = 77
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "shot.blend"))
    assert bpy.context.scene.oncue.start_frame == 77
    bpy.context.scene.oncue.starts_with_shot = True
    bpy.context.scene.frame_start = 12
    assert bpy.context.scene.oncue.start_frame == 12


# --- cues that move ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("way", ["keys", "parent", "driver"])
def test_a_cue_that_moves_is_read_where_the_motion_begins(stool, oncue, way):
    scene, session, start = stool.scene, oncue("bridge.session"), bpy.data.objects["Start"]
    there = list(start.location)
    mover = start if way == "keys" else add_cube("Cart", location=(50, 0, 0))
    if way == "driver":
        curve = start.driver_add("location", 0)
        curve.driver.expression = f"{there[0]} + (frame - 5) * 0.01"
    else:
        at = mover.location.x
        for frame, x in ((5, at), (105, at + 1.0)):
            mover.location.x = x
            mover.keyframe_insert("location", frame=frame)
        if way == "parent":
            scene.frame_set(5)
            start.parent = mover
            start.matrix_parent_inverse = mover.matrix_world.inverted()
    scene.frame_start = 5
    for playhead in (5, 60):
        scene.frame_set(playhead)
        request, notes = session.read_request(stool)
        assert request.task["start"]["position"][0] == pytest.approx(there[0], abs=1e-4)
        assert [text for name, text in notes if name == "Start"] == [
            "Start is animated: it was read as it stands at frame 5, where the motion begins."
        ]
        assert scene.frame_current == playhead


def test_what_was_moved_and_not_keyed_is_read_where_it_is_seen(stool, oncue):
    """Going through the frames for a cue that moves puts it back; the meshes have been read before."""
    door = add_cube("Door", location=(10, 0, 0))
    for frame in (1, 100):
        door.keyframe_insert("location", frame=frame)
    start = bpy.data.objects["Start"]
    for frame, x in ((1, start.location.x), (100, start.location.x + 1)):
        start.location.x = x
        start.keyframe_insert("location", frame=frame)
    stool.scene.frame_set(1)
    door.location.x = 12.0
    request, notes = oncue("bridge.session").read_request(stool)
    assert notes
    assert request.positions[:, 0].max() == pytest.approx(12.5)


def test_an_unkeyed_place_of_a_cue_is_what_counts(stool, oncue):
    """With a key or without: one that says the same in every frame moves nothing."""
    bpy.data.objects["Start"].keyframe_insert("location", frame=1)
    bpy.data.objects["Start"].location.x += 0.3
    request, notes = oncue("bridge.session").read_request(stool)
    assert request.task["start"]["position"][0] == pytest.approx(bpy.data.objects["Start"].location.x, abs=1e-6)
    assert notes == []
