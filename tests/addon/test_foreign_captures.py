"""Captures in Blender's own formats: actions of the open file, .fbx and .glb, read by a second Blender as .bvh."""

import json
import math
import os
import sys
from pathlib import Path

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from .runs import datablocks
from .test_batch import batch
from .test_character import forward_kinematics

#: Joints may be so far from where the artist saw them, metres.
OFF = 0.01
LIMBS = ("Hips", "Head", "LeftArm", "LeftHand", "RightHand", "LeftLeg", "LeftFoot", "RightFoot", "LeftToe")
#: Frames that are compared, of a scene at 30 a second.
LOOKED_AT = range(1, 230, 17)


@pytest.fixture
def walker(oncue, context, core):
    """Makes a character that walks for nearly eight seconds."""
    starter = core.Library.starter()
    clip = starter.clip(starter.clip_names.index("walk 1.00 m/s"))
    motion = oncue("motion").Motion(np.asarray(clip["root_positions"]), np.asarray(clip["rotations"]), 30.0)

    def make(name="Walk"):
        skeleton = core.skeleton()
        context.scene.render.fps = 30
        made = oncue("bridge.armature").make_character(context, skeleton, 1.0)
        where = {"start_frame": 1, "metres_per_unit": 1.0}
        names = list(skeleton["names"])
        oncue("bridge.action_writer").write_action(context, made, names, motion, name=name, report={}, **where)
        return made

    return make


def fresh():
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)


def places(armature, names=LIMBS, frames=LOOKED_AT):
    """Where joints are in the world, (frames, joints, 3)."""
    scene, seen = bpy.context.scene, []
    for frame in frames:
        scene.frame_set(frame)
        evaluated = armature.evaluated_get(bpy.context.evaluated_depsgraph_get())
        seen.append([tuple(evaluated.matrix_world @ evaluated.pose.bones[name].head) for name in names])
    return np.array(seen)


def read_back(text, rate):
    """Where the joints of a .bvh are, read by Blender's own importer: another reader than ours."""
    fresh()
    bpy.context.scene.render.fps = rate
    path = Path(os.environ["BLENDER_USER_RESOURCES"]) / "read_back.bvh"
    path.write_text(text)
    bpy.ops.import_anim.bvh(filepath=str(path), global_scale=0.01, axis_forward="Y", axis_up="Z")
    path.unlink()
    return bpy.context.object


def converted(oncue, *files):
    """What the second Blender makes of files."""
    foreign = oncue("foreign_captures")
    steps = foreign.convert_steps(list(map(Path, files)), oncue("bridge.second_blender").second_blender())
    return oncue("pipeline").run_blocking(steps)


def off(seen, expected):
    return float(np.linalg.norm(seen - expected, axis=2).max())


def frames_of(rate):
    """The frames of a .bvh at `rate` that are looked at at 30."""
    return [1 + (frame - 1) * rate // 30 for frame in LOOKED_AT]


TURNED = Matrix.Rotation(math.radians(90), 4, "X")

#: What is exported how, and where a joint then is that was at p.
EXPORTS = {
    "fbx": ({}, lambda p: p),
    "fbx with Z up": ({"axis_up": "Z", "axis_forward": "Y"}, lambda p: p),
    "fbx in hundredths": ({"global_scale": 0.01}, lambda p: 0.01 * p),
    "fbx of another unit": ({"apply_scale_options": "FBX_SCALE_ALL"}, lambda p: p),
    "fbx with bones along X": ({"primary_bone_axis": "X", "secondary_bone_axis": "Y"}, lambda p: p),
    "glb": ({}, lambda p: p),
    # What was up is then taken for forward.
    "glb with Z up": ({"export_yup": False}, lambda p: np.stack([p[..., 0], -p[..., 2], p[..., 1]], axis=-1)),
}


@pytest.mark.parametrize("export", EXPORTS)
def test_what_blender_exported_comes_back(oncue, core, walker, tmp_path, export):
    settings, moved = EXPORTS[export]
    suffix = export.split()[0]
    expected = moved(places(walker()))
    path = tmp_path / f"walk.{suffix}"
    operator = bpy.ops.export_scene.fbx if suffix == "fbx" else bpy.ops.export_scene.gltf
    operator(filepath=str(path), **settings)
    (file, source), *others = converted(oncue, path).sources.items()
    assert not others
    assert source["file"] == str(path)
    assert "Walk" in source["action"]
    text = Path(file).read_text()
    rate = round(1 / float(text.split("Frame Time:")[1].split()[0]))
    size = 0.01 if export == "fbx in hundredths" else 1.0
    read = read_back(text, rate)
    assert off(places(read, frames=frames_of(rate)), expected) < OFF * size
    # All the way to a clip it shows what it showed.
    library = {"starter": "none", "mirror": False}
    _, (capture,) = core.build_library([file], {**library, "sources": {file: source}}).result()
    assert (capture["file"], capture["action"]) == (str(path), source["action"])
    assert capture["clip"] == f"walk {source['action']}"
    assert capture["seconds"]["walk"] > 4


@pytest.mark.skipif(os.name == "nt", reason="links take an administrator there")
def test_what_is_reached_in_two_ways_is_read_once(oncue, tmp_path):
    files = oncue("foreign_captures").foreign_files
    inner = tmp_path / "inner"
    inner.mkdir()
    (inner / "take.fbx").write_bytes(b"")
    (inner / "up").symlink_to(tmp_path)
    (tmp_path / "other.fbx").symlink_to(inner / "take.fbx")
    assert files([str(inner), str(tmp_path), str(inner / "take.fbx")]) == [inner / "take.fbx"]
    assert files([str(tmp_path / "gone.fbx")]) == [tmp_path / "gone.fbx"]
    assert files([str(inner / "take.fbx"), str(inner / "take.bvh")]) == [inner / "take.fbx"]


@pytest.mark.parametrize("suffix", [".fbx", ".glb"])
@pytest.mark.parametrize("name", ["B3_Walk", "B11_WalkTurnLeft135", "B23_SideStepRight"])
def test_a_real_capture_gives_the_same_through_blenders_formats(oncue, core, shared_data, tmp_path, name, suffix):
    """Needs the shared captures. Actor's own proportions and a rest that is no T-pose."""
    pipeline, second = oncue("pipeline"), oncue("bridge.second_blender")
    own = shared_data / "mocap" / "accad" / f"Male1_{name}.bvh"
    bpy.context.scene.render.fps = 30
    bpy.ops.import_anim.bvh(filepath=str(own), global_scale=0.01)
    path = tmp_path / f"capture{suffix}"
    (bpy.ops.export_scene.fbx if suffix == ".fbx" else bpy.ops.export_scene.gltf)(filepath=str(path))
    gave, heads, contacts = [], [], []
    for file in (own, path):
        choice = pipeline.LibraryChoice((str(file),), "none", "", second.second_blender())
        library, (capture,) = pipeline.run_blocking(pipeline.library_steps(choice, pipeline.LibraryCache()))
        clip = library.clip(0)
        motion = oncue("motion").Motion(np.asarray(clip["root_positions"]), np.asarray(clip["rotations"]), 30.0)
        assert (capture["notes"], capture["reason"]) == ([], None)
        gave.append(capture["seconds"])
        heads.append(forward_kinematics(core.skeleton(), motion))
        contacts.append(np.asarray(clip["contacts"]))
    # A frame near a label's bound may fall to its other side.
    assert gave[1] == pytest.approx(gave[0], abs=0.1)
    assert gave[0]["walk"] > 0.5
    assert heads[1].shape == heads[0].shape
    # Where it lies in the file is not compared, but how it goes from its own first frame on.
    away = [seen - seen[:1, :1] for seen in heads]
    assert off(*away) < OFF
    assert (contacts[1] == contacts[0]).mean() > 0.98


def test_the_artists_file_is_as_it_was(oncue, context, walker, tmp_path):
    character = walker()
    path = tmp_path / "walk.glb"
    bpy.ops.export_scene.gltf(filepath=str(path))
    context.view_layer.objects.active = character
    bpy.ops.object.mode_set(mode="POSE")
    context.scene.frame_set(17)
    character.pose.bones["LeftArm"].rotation_quaternion = (0.5, 0.5, 0.5, 0.5)
    settings = context.scene.oncue
    settings.library_paths.add().path = str(path)
    settings.starter = "NONE"

    def state():
        bones = [tuple(bone.rotation_quaternion) for bone in character.pose.bones]
        playing = (character.animation_data.action, [thing.select_get() for thing in context.view_layer.objects])
        where = (context.scene.name, context.scene.frame_current, context.mode, context.view_layer.objects.active)
        return datablocks(), bones, playing, where, context.scene.render.fps, len(bpy.data.libraries)

    before = state()
    assert bpy.ops.oncue.read_library() == {"FINISHED"}
    assert state() == before
    # So for an action of its own, but that it is now in the library.
    written = tmp_path / "own.bvh"
    assert bpy.ops.oncue.add_action(filepath=str(written)) == {"FINISHED"}
    assert state() == before
    assert [item.path for item in settings.library_paths] == [str(path), str(written)]


def test_an_armature_that_is_scaled_turned_and_parented(oncue, context, walker, tmp_path):
    character = walker()
    # As imported characters often are: the object a hundredth of its bones, under an empty that moves.
    character.data.transform(Matrix.Scale(100.0, 4))
    character.scale = (0.01,) * 3
    for curve in oncue("bridge.compat").action_curves(character.animation_data.action):
        if curve.data_path.endswith(".location"):
            for key in curve.keyframe_points:
                key.co.y *= 100.0
    cart = bpy.data.objects.new("Cart", None)
    context.scene.collection.objects.link(cart)
    character.parent = cart
    cart.rotation_euler = (0.0, 0.0, 0.7)
    cart.location = (0.0, 0.0, 0.0)
    cart.keyframe_insert("location", frame=1)
    cart.location = (3.0, -1.0, 0.5)
    cart.keyframe_insert("location", frame=240)
    expected = places(character)
    assert np.ptp(expected[..., 2]) < 3.0
    context.view_layer.objects.active = character
    assert bpy.ops.oncue.add_action(filepath=str(tmp_path / "own.bvh")) == {"FINISHED"}
    assert off(places(read_back((tmp_path / "own.bvh").read_text(), 30)), expected) < 1e-4


def test_what_the_evaluated_armature_shows_is_captured(context, walker, tmp_path):
    """A constraint and a driver, which no key shows."""
    character = walker()
    target = bpy.data.objects.new("Target", None)
    target.location = (0.4, -3.0, 1.9)
    context.scene.collection.objects.link(target)
    reach = character.pose.bones["LeftHand"].constraints.new("IK")
    reach.target, reach.chain_count = target, 3
    driver = character.pose.bones["Head"].driver_add("scale", 1).driver
    driver.type = "SUM"
    variable = driver.variables.new()
    variable.targets[0].id, variable.targets[0].data_path = target, "location.x"
    # A bone that is stretched takes its child along: the child's place is in the file.
    character.pose.bones["LeftUpLeg"].scale = (1.0, 1.3, 1.0)
    expected = places(character)
    context.view_layer.objects.active = character
    assert bpy.ops.oncue.add_action(filepath=str(tmp_path / "own.bvh")) == {"FINISHED"}
    seen = places(read_back((tmp_path / "own.bvh").read_text(), 30))
    assert off(seen, expected) < 1e-4
    assert off(expected[:, :1], expected[:, 3:4]) < 3.0


def test_every_action_of_an_armature(oncue, context, core, walker, tmp_path):
    character = walker()
    data = character.animation_data
    other = data.action.copy()
    other.name = "Walk/again"
    context.view_layer.objects.active = character
    assert bpy.ops.oncue.add_action(filepath=str(tmp_path / "own.bvh"), every=True) == {"FINISHED"}
    names = sorted(Path(item.path).name for item in context.scene.oncue.library_paths)
    assert names == ["own Walk.bvh", "own Walk_again.bvh"]
    first, second = ((tmp_path / name).read_text() for name in names)
    assert first == second
    # An action that moves other bones is none of its.
    stranger = bpy.data.actions.new("Stranger")
    thing = bpy.data.objects.new("Thing", None)
    context.scene.collection.objects.link(thing)
    thing.animation_data_create().action = stranger
    thing.keyframe_insert("location", frame=1)
    takes = oncue("bridge.armature_motion").armature_actions(character)
    assert sorted(take.name for take in takes) == ["Walk", "Walk/again"]


@pytest.mark.skipif(bpy.app.version < (4, 4), reason="actions have no slots")
def test_slots_are_taken_apart(oncue, context, walker):
    """One action moves two characters: each is captured by its own slot."""
    first, second = walker("First"), walker("Second")
    action = first.animation_data.action
    slot = action.slots.new(id_type="OBJECT", name=second.name)
    bag = action.layers[0].strips[0].channelbag(slot, ensure=True)
    compat = oncue("bridge.compat")
    for curve in compat.action_curves(second.animation_data.action, second):
        new = bag.fcurves.new(curve.data_path, index=curve.array_index)
        for key in curve.keyframe_points:
            new.keyframe_points.insert(key.co.x, key.co.y + (1.0 if curve.data_path.endswith("location") else 0.0))
    second.animation_data.action = action
    second.animation_data.action_slot = slot
    motions = oncue("bridge.armature_motion")
    for armature in (first, second):
        expected = places(armature, frames=[1, 60])
        (take,) = [one for one in motions.armature_actions(armature) if one.action == action]
        assert take.slot.name_display == armature.name
        seen = motions.bone_motion(context.scene, take)
        index = [seen.names.index(name) for name in LIMBS]
        assert off(seen.heads[[0, 59]][:, index], expected) < 1e-4


def test_of_a_rig_what_carries_the_body_is_read(oncue, context, walker):
    """Neither its controls nor the bones of its mechanics, but for those in which limbs meet."""
    rig = walker()
    context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    bones = rig.data.edit_bones
    over = {name: bones.new(name) for name in ("root", "MCH-hips", "control", "MCH-foot")}
    for bone in over.values():
        bone.tail, bone.use_deform = (0, 0, 0.2), False
    bones["Hips"].parent = over["root"]
    # The thighs hang from a bone that carries nothing, as in many rigs; so does a foot, alone.
    over["MCH-hips"].parent, over["control"].parent = bones["Hips"], over["root"]
    bones["LeftUpLeg"].parent = bones["RightUpLeg"].parent = over["MCH-hips"]
    over["MCH-foot"].parent = bones["LeftLeg"]
    bones["LeftFoot"].parent = over["MCH-foot"]
    bpy.ops.object.mode_set(mode="OBJECT")
    motions = oncue("bridge.armature_motion")
    (take,) = motions.armature_actions(rig)
    read = motions.bone_motion(context.scene, take)
    carrying = {bone.name for bone in rig.data.bones if bone.use_deform}
    assert set(read.names) == carrying | {"MCH-hips"}
    parent = {name: read.names[up] if up >= 0 else None for name, up in zip(read.names, read.parents, strict=True)}
    assert parent["Hips"] is None
    assert parent["MCH-hips"] == "Hips"
    assert parent["LeftUpLeg"] == parent["RightUpLeg"] == "MCH-hips"
    assert parent["LeftFoot"] == "LeftLeg"
    assert all(up < own for own, up in enumerate(read.parents))
    # Where few bones carry anything all of them are the skeleton.
    for bone in rig.data.bones:
        bone.use_deform = bone.name == "Hips"
    assert len(motions.bone_motion(context.scene, take).names) == len(rig.data.bones)


def test_an_armature_without_legs_is_named(oncue, context, core, tmp_path):
    data = bpy.data.armatures.new("Crane")
    crane = bpy.data.objects.new("Crane", data)
    context.scene.collection.objects.link(crane)
    context.view_layer.objects.active = crane
    bpy.ops.object.mode_set(mode="EDIT")
    bone = data.edit_bones.new("Arm")
    bone.tail = (0, 0, 1)
    bpy.ops.object.mode_set(mode="OBJECT")
    crane.pose.bones["Arm"].keyframe_insert("rotation_quaternion", frame=1)
    crane.pose.bones["Arm"].rotation_quaternion = (0.7, 0.7, 0, 0)
    crane.pose.bones["Arm"].keyframe_insert("rotation_quaternion", frame=40)
    path = tmp_path / "crane.glb"
    bpy.ops.export_scene.gltf(filepath=str(path))
    context.scene.oncue.library_paths.add().path = str(path)
    context.scene.oncue.starter = "NONE"
    with pytest.raises(RuntimeError, match=r"None of the 1 .*; crane\.glb: no joint was recognised as LeftUpLeg"):
        bpy.ops.oncue.read_library()


def test_what_gives_nothing_is_named(oncue, context, core, walker, tmp_path):
    walker()
    bpy.ops.export_scene.gltf(filepath=str(tmp_path / "walk.glb"))
    fresh()
    bpy.ops.mesh.primitive_cube_add()
    bpy.ops.export_scene.gltf(filepath=str(tmp_path / "cube.glb"))
    (tmp_path / "deep").mkdir()
    (tmp_path / "deep" / "text.fbx").write_text("no fbx")
    (tmp_path / "torn.glb").write_bytes((tmp_path / "walk.glb").read_bytes()[:3000])
    made = converted(oncue, *sorted(tmp_path.rglob("*.*")))
    assert [source["file"] for source in made.sources.values()] == [str(tmp_path / "walk.glb")]
    reasons = {Path(capture["file"]).name: capture["reason"] for capture in made.left_out}
    assert reasons["cube.glb"] == "it holds no armature."
    assert reasons["text.fbx"].startswith("Blender could not import it: ")
    assert reasons["torn.glb"].startswith(("Blender could not import it: ", "Blender could not read it: "))
    assert all("\n" not in reason and reason.endswith(".") for reason in reasons.values())
    # A folder that holds nothing is not passed over because another one holds such files.
    (tmp_path / "empty").mkdir()
    settings = bpy.context.scene.oncue
    for path in (tmp_path / "walk.glb", tmp_path / "empty"):
        settings.library_paths.add().path = str(path)
    with pytest.raises(RuntimeError, match=r"empty holds no \.bvh files"):
        bpy.ops.oncue.read_library()
    settings.library_paths.clear()
    # A folder of such files alone is refused as one of bad .bvh files is.
    (tmp_path / "walk.glb").unlink()
    settings.library_paths.add().path = str(tmp_path)
    with pytest.raises(RuntimeError, match=r"None of the 3 motion capture files could be used; cube\.glb: it holds"):
        bpy.ops.oncue.read_library()


@pytest.mark.parametrize("what", ["gone", "cut off", "a folder", "no glTF", "no picture", "a space in its name"])
def test_the_files_of_a_gltf_are_named(oncue, walker, tmp_path, what):
    walker()
    made = bpy.data.materials.new("Skin")
    made.use_nodes = True
    shown = made.node_tree.nodes.new("ShaderNodeTexImage")
    shown.image = bpy.data.images.new("Weave", 4, 4)
    made.node_tree.links.new(shown.outputs[0], made.node_tree.nodes["Principled BSDF"].inputs["Base Color"])
    for mesh in bpy.data.meshes:
        mesh.materials.clear()
        mesh.materials.append(made)
    name = "one walk" if what == "a space in its name" else "walk"
    file, numbers, picture = (tmp_path / end for end in (f"{name}.gltf", f"{name}.bin", "Weave.png"))
    bpy.ops.export_scene.gltf(filepath=str(file), export_format="GLTF_SEPARATE")
    assert numbers.is_file()
    assert picture.is_file()
    kept, size = numbers.read_bytes(), numbers.stat().st_size
    if what in ("gone", "a folder", "a space in its name"):
        numbers.unlink()
    if what == "a folder":
        numbers.mkdir()
    elif what == "cut off":
        numbers.write_bytes(kept[:1000])
    elif what == "no glTF":
        file.write_text("[]")
    elif what == "no picture":
        picture.unlink()
    read = converted(oncue, file)
    if what == "no picture":
        assert len(read.sources) == 1
        assert not read.left_out
        return
    assert not read.sources
    (left_out,) = read.left_out
    said = {
        "cut off": f"its file walk.bin is cut off: it has 1000 of {size} bytes.",
        "no glTF": "it is no glTF file, or damaged (AttributeError: 'list' object has no attribute 'get').",
        "a space in its name": "its file one%20walk.bin, which holds its numbers, is not beside it: put it there.",
    }
    beside = "its file walk.bin, which holds its numbers, is not beside it: put it there."
    assert left_out["reason"] == said.get(what, beside)
    # Blender knows a .glb by what it begins with.
    if what == "no glTF":
        bpy.ops.export_scene.gltf(filepath=str(tmp_path / "other.glb"))
        (tmp_path / "other.glb").replace(file)
        assert len(converted(oncue, file).sources) == 1
    # Once it is there the file is read, though it is the same.
    if what in ("cut off", "gone", "a space in its name"):
        numbers.write_bytes(kept)
        again = converted(oncue, file)
        assert len(again.sources) == 1
        assert not again.left_out


def test_what_an_importer_says_is_told_without_where_it_happened(oncue):
    last_line = oncue("bridge.imported_captures").last_line
    told = "Error: Python: Traceback (most recent call last):\n  File\nValueError: too short\nLocation: /x/ops.py:109\n"
    assert last_line(RuntimeError(told)) == "ValueError: too short"


def test_the_panel_names_file_and_action(oncue, context, core, walker, tmp_path):
    walker()
    path = tmp_path / "walk.glb"
    bpy.ops.export_scene.gltf(filepath=str(path))
    # A mapping file lies beside the capture, whatever was made of it.
    (tmp_path / "walk.oncue.json").write_text('{"labels": [{"label": "other", "first": 0, "end": 100}]}')
    context.scene.oncue.library_paths.add().path = str(tmp_path)
    context.scene.oncue.starter = "NONE"
    assert bpy.ops.oncue.read_library() == {"FINISHED"}
    cache, session = oncue("operators.synthesize").library_cache, oncue("bridge.session")
    (capture,) = cache.captures_of(session.library_choice(context.scene))
    line = oncue("panels").capture_line(capture)
    assert line.startswith("walk.glb ‘Walk"), line
    assert "walk" in line.split(":")[1]
    assert "its mapping file says so" in capture["reason"]


def test_a_file_is_read_once(oncue, core, walker, tmp_path, monkeypatch):
    walker()
    path = tmp_path / "walk.glb"
    bpy.ops.export_scene.gltf(filepath=str(path))
    foreign = oncue("foreign_captures")
    started = []
    popen = foreign.subprocess.Popen
    monkeypatch.setattr(foreign.subprocess, "Popen", lambda *a, **k: started.append(a) or popen(*a, **k))
    first = converted(oncue, path)
    again = converted(oncue, path)
    assert first == again
    assert len(started) == 1
    # Another file of that name is read anew, and so is one whose captures are gone.
    os.utime(path, ns=(1, 1))
    anew = converted(oncue, path)
    assert len(started) == 2
    assert list(anew.sources) != list(first.sources)
    Path(next(iter(anew.sources))).unlink()
    assert converted(oncue, path) == anew
    assert len(started) == 3
    # What is too much goes, that which is in use stays.
    monkeypatch.setattr(foreign, "KEPT_BYTES", 0)
    assert converted(oncue, path) == anew
    assert [kept.name for kept in oncue("bridge.second_blender").second_blender().folder.iterdir()] == [
        Path(next(iter(anew.sources))).parent.name
    ]


def fake_blender(oncue, tmp_path, body):
    """A second Blender that is none: `body` runs with the request as `asked`."""
    script = tmp_path / "blender.py"
    script.write_text(
        "import json, os, sys, time\nfrom pathlib import Path\n"
        "asked = json.loads(Path(sys.argv[-1]).read_text())\n" + body
    )
    return oncue("foreign_captures").SecondBlender((sys.executable, str(script)), "1", tmp_path / "kept")


def test_a_blender_that_crashes_or_hangs_takes_only_its_file(oncue, tmp_path, monkeypatch):
    foreign, run = oncue("foreign_captures"), oncue("pipeline").run_blocking
    body = """
for entry in asked:
    if entry["file"].endswith("crash.fbx"):
        os._exit(11)
    if entry["file"].endswith("hang.fbx"):
        time.sleep(1000)
    folder = Path(entry["folder"])
    (folder / "0.bvh").write_text("HIERARCHY")
    (folder / "takes.json").write_text('{"takes": [{"file": "0.bvh", "action": "A"}], "left_out": []}')
"""
    files = [tmp_path / name for name in ("a.fbx", "crash.fbx", "hang.fbx", "z.fbx")]
    for file in files:
        file.write_text("")
    monkeypatch.setattr(foreign, "PATIENCE", 1.5)
    made = run(foreign.convert_steps(files, fake_blender(oncue, tmp_path, body)))
    assert [Path(source["file"]).name for source in made.sources.values()] == ["a.fbx", "z.fbx"]
    reasons = {Path(capture["file"]).name: capture["reason"] for capture in made.left_out}
    assert reasons["crash.fbx"] == "Blender ended while it read it (status 11)."
    assert reasons["hang.fbx"].startswith("Blender took longer than ")
    assert not list((tmp_path / "kept").glob("*.part"))


def test_a_blender_that_does_not_start_or_is_not_there(oncue, tmp_path):
    foreign, run, refused = oncue("foreign_captures"), oncue("pipeline").run_blocking, oncue("errors").SceneError
    file = tmp_path / "walk.fbx"
    file.write_text("")
    gone = foreign.SecondBlender((str(tmp_path / "no blender"),), "1", tmp_path / "kept")
    with pytest.raises(refused, match=r"which reads walk\.fbx, does not start"):
        run(foreign.convert_steps([file], gone))
    with pytest.raises(refused, match=r"walk\.fbx can only be read within Blender"):
        run(foreign.convert_steps([file], None))


def test_a_cancelled_reading_ends_the_second_blender(oncue, tmp_path):
    foreign, pipeline = oncue("foreign_captures"), oncue("pipeline")
    file = tmp_path / "walk.fbx"
    file.write_text("")
    run = pipeline.Run(foreign.convert_steps([file], fake_blender(oncue, tmp_path, "time.sleep(1000)")))
    assert not run.wait(0.2)
    process = run._job._process
    assert run.progress().stage == "Reading captures in Blender"
    run.cancel()
    assert run.wait(5.0)
    assert process.poll() is not None
    with pytest.raises(oncue("native").core.Cancelled):
        run.result()
    assert not list((tmp_path / "kept").iterdir())


def test_an_importer_that_is_missing_is_named(oncue, tmp_path, monkeypatch):
    imported = oncue("bridge.imported_captures")
    monkeypatch.setattr(imported, "IMPORTERS", {".fbx": (("import_scene", "no_such_thing"), ("wm", "nor_this"))})
    with pytest.raises(oncue("errors").SceneError, match=r"this Blender has no importer for \.fbx files"):
        imported.import_file(tmp_path / "walk.fbx")


def test_batch_reads_them_too(oncue, core, walker, fixtures, tmp_path):
    walker()
    folder = tmp_path / "captures"
    folder.mkdir()
    bpy.ops.export_scene.gltf(filepath=str(folder / "walk.glb"))
    (folder / "bad.fbx").write_text("no fbx")
    fixtures.SCENES["stool"]()
    scene, out, report = (tmp_path / name for name in ("stool.blend", "out.blend", "out.json"))
    fixtures.save(scene)
    from .runs import QUICK

    given = ["--library", folder, "--overrides", json.dumps(QUICK), "--report", report]
    done = batch(scene, "--out", out, "--seed", 5, *given)
    assert done.returncode in {0, 3}, done.stderr
    extension = json.loads(report.read_text())["extension"]
    assert extension["library"] == {"paths": [str(folder)], "starter": "missing", "mapping": ""}
    captures = {Path(capture["file"]).name: capture for capture in extension["captures"]}
    assert captures["walk.glb"]["clip"].startswith("walk Walk")
    assert captures["bad.fbx"]["reason"].startswith("Blender could not import it")
    assert "bad.fbx could not be read" in done.stdout


# --- the text ---------------------------------------------------------------------------------------------------------


def test_a_text_worked_by_hand(oncue):
    """A bone of 1 m that points along X and turns a quarter about Z on its second frame, with a child at its end."""
    writer = oncue("mocap_writer")
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    still = np.eye(3)
    motion = writer.BoneMotion(
        ("Upper {1}", "Lower"),
        (-1, 0),
        np.array([[0.0, 0, 0], [1, 0, 0]]),
        np.array([[1.0, 0, 0], [1.5, 0, 0]]),
        np.array([still, still]),
        np.array([[[0.0, 0, 0], [1, 0, 0]], [[0, 0, 2], [0, 1, 2]]]),
        np.array([[still, still], [turn, turn]]),
        25.0,
    )
    lines = writer.bvh_text(motion).splitlines()
    assert lines[:4] == [
        "HIERARCHY",
        "ROOT Upper (1)",
        "{",
        "OFFSET 0.000000 0.000000 0.000000",
    ]
    assert "OFFSET 100.000000 0.000000 0.000000" in lines
    assert "OFFSET 50.000000 0.000000 0.000000" in lines
    # The child does not leave its place: it has no position.
    assert sum("position" in line for line in lines) == 1
    assert lines[-3:-2] == ["Frame Time: 0.040000000"]
    rows = [[float(word) for word in line.split()] for line in lines[-2:]]
    assert rows == [[0.0] * 9, [0, 0, 200, 90, 0, 0, 0, 0, 0]]


def test_bones_without_a_parent_get_one(oncue):
    writer = oncue("mocap_writer")
    still = np.broadcast_to(np.eye(3), (2, 2, 3, 3))
    heads = np.array([[[0.0, 0, 1], [0, 0, 2]], [[0, 0, 1], [0, 3, 2]]])
    motion = writer.BoneMotion(("Root", "b"), (-1, -1), heads[0], heads[0] + 0.1, still[0], heads, still, 30.0)
    lines = writer.bvh_text(motion).splitlines()
    assert [line for line in lines if line.startswith(("ROOT", "JOINT"))] == ["ROOT Root_", "JOINT Root", "JOINT b"]
    assert [float(word) for word in lines[-1].split()[-6:]] == [0, 300, 200, 0, 0, 0]


def test_any_turn_comes_back(oncue):
    """Also where the middle angle is a right one, and under a mirrored armature."""
    writer = oncue("mocap_writer")
    random = np.random.default_rng(5)
    turns = np.linalg.qr(random.normal(size=(50, 3, 3)))[0]
    turns *= np.linalg.det(turns)[:, None, None]
    for sign in (1, -1):
        turns[sign] = np.array(Matrix.Rotation(sign * math.pi / 2, 3, "X"))
    z, x, y = np.moveaxis(np.radians(writer._angles(turns)), -1, 0)
    for k in range(len(turns)):
        back = Matrix.Rotation(z[k], 3, "Z") @ Matrix.Rotation(x[k], 3, "X") @ Matrix.Rotation(y[k], 3, "Y")
        assert np.abs(np.array(back) - turns[k]).max() < 1e-5
    mirror = np.diag([-1.0, 1, 1])
    heads = np.zeros((50, 1, 3))
    rest = np.zeros((1, 3)), np.array([[0.0, 0, 1]])
    motion = writer.BoneMotion(("a",), (-1,), *rest, (mirror @ turns[:1]), heads, (mirror @ turns)[:, None], 30.0)
    assert "nan" not in writer.bvh_text(motion)
    local = writer._turned(mirror @ turns) @ np.swapaxes(writer._turned(mirror @ turns[:1]), -1, -2)
    assert np.linalg.det(local) == pytest.approx(1.0)
