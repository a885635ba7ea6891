"""What other programs get: a take that goes out and comes back has hands and feet where they were."""

import bpy
import numpy as np
import pytest
from people import make_person

from .runs import set_quick

SAMPLES = 9
#: Where a bone may come back, metres.
NEAR = 0.005


@pytest.fixture
def stool(fixtures, core):
    """A small task, ready to run."""
    fixtures.stool_alone()
    set_quick(bpy.context.scene)
    return bpy.context


def fbx(path):
    bpy.ops.export_scene.fbx(
        filepath=str(path), use_selection=True, add_leaf_bones=False, bake_anim_simplify_factor=0.0
    )


def fbx_back(path):
    bpy.ops.import_scene.fbx(filepath=str(path))


def gltf(path):
    bpy.ops.export_scene.gltf(filepath=str(path), use_selection=True, export_animation_mode="ACTIVE_ACTIONS")


def gltf_back(path):
    bpy.ops.import_scene.gltf(filepath=str(path))


def usd(path):
    bpy.ops.wm.usd_export(filepath=str(path), selected_objects_only=True, export_animation=True, export_armatures=True)


def usd_back(path):
    bpy.ops.wm.usd_import(filepath=str(path))


WAYS = {"fbx": (fbx, fbx_back), "glb": (gltf, gltf_back), "usdc": (usd, usd_back)}


def heads(armature, names, frames):
    """Where bones are at frames, world, (frames, bones, 3)."""
    scene, found = bpy.context.scene, []
    for frame in frames:
        whole = int(np.floor(frame))
        scene.frame_set(whole, subframe=float(frame - whole))
        posed = armature.evaluated_get(bpy.context.evaluated_depsgraph_get())
        found.append([posed.matrix_world @ posed.pose.bones[name].head for name in names])
    return np.array(found)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("own", [False, True], ids=["Oncue's", "own rig"])
def test_a_take_comes_back(stool, oncue, tmp_path, way, own):
    scene = stool.scene
    scene.render.fps = 24
    if own:
        scene.oncue.character = make_person("mixamo", 1.7)
        stool.view_layer.update()
    assert bpy.ops.oncue.synthesize() == {"FINISHED"}
    character = scene.oncue.character
    action = oncue("bridge.session").current_action(scene)
    first, last = (int(frame) for frame in action.frame_range)
    scene.frame_start, scene.frame_end = first, last
    joints = oncue("bridge.own_rig").recognized(character)["joints"] if own else None
    names = [joints[name] if own else name for name in ("LeftHand", "RightHand", "LeftFoot", "RightFoot", "Hips")]
    times = np.linspace(first, last, SAMPLES).round()
    before = heads(character, names, times)
    skin = next(oncue("bridge.own_rig").skins(character))
    for thing in scene.objects:
        thing.select_set(thing in (character, skin))
    stool.view_layer.objects.active = character
    path, (out, back) = tmp_path / f"take.{way}", WAYS[way]
    out(path)
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    bpy.context.scene.render.fps = 24
    back(path)
    armature = next(thing for thing in bpy.data.objects if thing.type == "ARMATURE")
    assert bpy.context.scene.render.fps == 24
    found = [next(b.name for b in armature.data.bones if plain(b.name) == plain(name)) for name in names]
    played = armature.animation_data.action.frame_range
    # Importers begin where they like; as long as it was it has to be.
    assert played[1] - played[0] == pytest.approx(last - first, abs=1.01)
    shift = played[0] - first
    after = heads(armature, found, times + shift)
    assert np.linalg.norm(after - before, axis=2).max() < NEAR


def plain(name):
    """A bone's name as far as all formats keep it."""
    return "".join(c for c in name if c.isalnum()).lower()


def test_a_take_as_bvh_comes_back(stool, oncue, core, tmp_path):
    """The core reads its own capture of what the character plays: a walk is a walk, as long as it was."""
    assert bpy.ops.oncue.synthesize() == {"FINISHED"}
    character = stool.scene.oncue.character
    stool.view_layer.objects.active = character
    path = tmp_path / "take.bvh"
    assert bpy.ops.oncue.add_action(filepath=str(path)) == {"FINISHED"}
    before = heads(character, ["LeftHand", "RightFoot", "Hips"], np.arange(1, 60, 7))
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    bpy.ops.import_anim.bvh(filepath=str(path), global_scale=0.01, axis_forward="Y", axis_up="Z", update_scene_fps=True)
    armature = next(thing for thing in bpy.data.objects if thing.type == "ARMATURE")
    after = heads(armature, ["LeftHand", "RightFoot", "Hips"], np.arange(1, 60, 7))
    assert np.linalg.norm(after - before, axis=2).max() < NEAR
