"""The button, by its blocking path: the same code as in the window, without the window."""

from types import SimpleNamespace

import bpy
import numpy as np
import pytest

from .runs import current_action, datablocks, keys_of, set_quick
from .shapes import add_cube, add_floor, add_mesh, add_terrain


@pytest.fixture
def stool(fixtures):
    """A small task, ready to run; the file as it is before the run."""
    fixtures.stool_alone()
    set_quick(bpy.context.scene)
    return bpy.context


def test_the_main_job(stool, oncue, core):
    context = stool
    context.scene.oncue.start_frame = 11
    assert bpy.ops.oncue.synthesize() == {"FINISHED"}
    character, action = context.scene.oncue.character, current_action()
    report = oncue("bridge.session").report_of(action)
    first, last = action.frame_range
    assert first == 11
    assert last - first + 1 == report["frames"]
    assert context.scene.frame_end == last

    # What the report says is what Blender shows.
    depsgraph = context.evaluated_depsgraph_get
    context.scene.frame_set(11)
    hips = (
        character.evaluated_get(depsgraph()).matrix_world @ character.evaluated_get(depsgraph()).pose.bones["Hips"].head
    )
    assert np.hypot(hips.x - 0.4, hips.y - 2.2) < 0.15
    cue = report["cues"][0]
    context.scene.frame_set(11 + cue["frame"])
    posed = character.evaluated_get(depsgraph())
    hips = posed.matrix_world @ posed.pose.bones["Hips"].head
    assert 100 * (hips - bpy.data.objects["Sit"].location).length == pytest.approx(cue["pelvis_cm"], abs=0.1)
    assert report["extension"]["scene_triangles"] > 100
    lines = [line for line, _ in oncue("panels").result_lines(report)]
    assert lines[0].startswith("Sit: ")
    assert any(line.startswith("Clipping") for line in lines)
    assert any("Pelvis" in line for line in lines)

    # Once more: the same seed is the same motion, on the same character, beside the first take.
    keys = keys_of(oncue, action)
    assert bpy.ops.oncue.synthesize() == {"FINISHED"}
    assert context.scene.oncue.character == character
    assert current_action() != action
    assert action.use_fake_user
    assert keys_of(oncue, current_action()) == keys
    assert len(keys) == 3 + 4 * 22


def test_the_slider_of_liveliness_is_a_setting_of_the_core(stool, oncue, core):
    session, settings = oncue("bridge.session"), stool.scene.oncue
    assert session.overrides_of(settings) == session.read_overrides(settings.overrides)
    settings.overrides = '{"kept": {"takes": 1}}'
    settings.liveliness = 0.25
    assert session.overrides_of(settings) == {"kept": {"takes": 1, "liveliness": 0.25}}
    merged = oncue("pipeline").merged(core.default_settings("default"), session.overrides_of(settings))
    assert merged["kept"]["liveliness"] == 0.25
    # What is written there comes first.
    settings.overrides = '{"kept": {"liveliness": -1}}'
    assert session.overrides_of(settings) == {"kept": {"liveliness": -1}}


def test_a_run_that_cannot_be_leaves_the_file_as_it_was(fixtures, core):
    fixtures.enclosed_seat()
    set_quick(bpy.context.scene)
    before = datablocks()
    with pytest.raises(RuntimeError, match="Sit"):
        bpy.ops.oncue.synthesize()
    assert datablocks() == before


@pytest.mark.parametrize("stage", ["building", "indexing", "synthesizing"])
def test_a_cancelled_run_leaves_the_file_as_it_was(stool, oncue, core, monkeypatch, stage):
    """The artist's cancel arrives while the stage is at work; the operator ends as cancelled, nothing is written."""
    before, frames = datablocks(), stool.scene.frame_end
    call = {"building": "build_library", "indexing": "index_scene", "synthesizing": "synthesize"}[stage]
    real = getattr(core, call)

    def cancelled_at_once(*arguments):
        job = real(*arguments)
        job.cancel()
        return job

    oncue("operators.synthesize").library_cache.put(None, None)
    monkeypatch.setattr(core, call, cancelled_at_once)
    assert bpy.ops.oncue.synthesize() == {"CANCELLED"}
    assert "as it was" in oncue("job_operator").handle.message
    assert datablocks() == before
    assert stool.scene.frame_end == frames


def refused(words):
    before = datablocks()
    with pytest.raises(RuntimeError, match=words):
        bpy.ops.oncue.synthesize()
    assert datablocks() == before


def test_bad_scenes_are_sentences(stool, core):
    scene = stool.scene
    start, sit = bpy.data.objects["Start"], bpy.data.objects["Sit"]
    start.hide_set(True)
    refused("no Start cue")
    start.hide_set(False)
    sit.hide_set(True)
    refused("no Sit or Stop cue")
    sit.hide_set(False)
    for thing in scene.objects:
        if thing.type == "MESH":
            thing.hide_viewport = True
    refused("no visible mesh")


@pytest.mark.parametrize(
    ("place", "words"),
    [((0.0, 0.0, -0.6), "Sit"), ((0.0, 0.0, 3.0), "Sit"), ((float("nan"), 0.0, 0.5), "Sit")],
    ids=["under the floor", "in the air", "nowhere"],
)
def test_a_cue_in_a_bad_place_is_named(stool, core, place, words):
    bpy.data.objects["Sit"].location = place
    stool.view_layer.update()
    refused(words)


def test_a_sit_inside_a_wall_is_named(stool, fixtures, core):
    fixtures.f.Piece("Pillar").box((-0.5, -0.5, 0), (0.5, 0.5, 2.2), "plaster").link(stool.scene)
    stool.view_layer.update()
    refused("Sit")


@pytest.mark.parametrize(("height", "words"), [(-1.0, "Start.*no floor under it"), (1.5, "Start.*1.50 m over")])
def test_a_start_off_the_floor_is_named(stool, core, height, words):
    bpy.data.objects["Start"].location.z = height
    stool.view_layer.update()
    refused(words)


def test_a_broken_mesh_is_named_in_the_result(stool, oncue, core):
    add_mesh("Broken Lamp", [(0, 0, 0), (float("nan"), 0, 0), (0, 1, 0)], [(0, 1, 2)])
    assert bpy.ops.oncue.synthesize() == {"FINISHED"}
    session = oncue("bridge.session")
    problems = session.problems_of(session.current_report(stool.scene))
    assert any("Broken Lamp has vertices that are not numbers" in problem for problem in problems)


def test_a_scene_in_centimetres_is_said_and_the_scale_offered(stool, oncue, core):
    for thing in stool.scene.objects:
        if thing.type == "MESH":
            thing.scale = (100, 100, 100)
        thing.location *= 100
    stool.view_layer.update()
    assert "oncue.set_scene_scale" not in buttons(oncue)
    refused("centimetres")
    assert buttons(oncue).count("oncue.set_scene_scale") == 3
    bpy.ops.oncue.set_scene_scale(scale=0.01)
    assert not oncue("job_operator").handle.failed
    assert "oncue.set_scene_scale" not in buttons(oncue)
    assert bpy.ops.oncue.synthesize() == {"FINISHED"}
    character = stool.scene.oncue.character
    assert character.dimensions.z == pytest.approx(180, rel=0.2)


def test_the_scale_is_offered_for_the_kind_of_error_and_not_for_its_words(stool, oncue, core):
    stool.scene.collection.objects.link(bpy.data.objects["Start"].copy())
    bpy.data.objects["Sit"].name = "Set Scene Scale"
    refused("Set Scene Scale is a cue of nobody")
    assert "Set Scene Scale" in oncue("job_operator").handle.message
    assert "oncue.synthesize" in buttons(oncue)
    assert "oncue.set_scene_scale" not in buttons(oncue)


class Layout:
    """Stands for Blender's layout, which there is in a window only: notes the buttons."""

    def __init__(self):
        self.buttons = []

    def operator(self, name, **_look):
        self.buttons.append(name)
        return SimpleNamespace()

    def row(self, **_look):
        return self

    column = box = row

    def label(self, **_look):
        pass

    def prop(self, *_of, **_look):
        pass


def buttons(oncue):
    """What the panel offers beside its message, by identifier."""
    layout = Layout()
    for panel in (oncue("panels").ONCUE_PT_synthesize, oncue("panels").ONCUE_PT_messages):
        panel.draw(SimpleNamespace(layout=layout), bpy.context)
    return layout.buttons


def test_five_million_triangles(stool, oncue, core):
    """A floor as sculpting programs give it."""
    add_terrain(1582, 6.0, bumps=0.004, location=(-3, -3, 0))
    bpy.data.objects["Floor"].hide_viewport = True
    stool.view_layer.update()
    assert bpy.ops.oncue.synthesize() == {"FINISHED"}
    report = oncue("bridge.session").current_report(stool.scene)
    assert report["extension"]["scene_triangles"] > 4_990_000
    print({step: round(seconds, 1) for step, seconds in report["extension"]["seconds"].items()})


def test_a_start_inside_furniture_is_named(stool, fixtures, core):
    fixtures.f.Piece("Cupboard", (0.4, 2.2, 0)).box((-0.6, -0.4, 0), (0.6, 0.4, 2), "oak").link(stool.scene)
    stool.view_layer.update()
    refused("Start")


def test_a_library_that_vanished_is_named(stool, core, tmp_path):
    stool.scene.oncue.library_paths.add().path = str(tmp_path / "gone")
    refused("gone is not there any more")


@pytest.mark.parametrize("name", ["walk.c3d", "walk.zip", "walk.usda", "walk.oncue.json", "walk"])
def test_a_library_of_another_kind_is_named(stool, core, tmp_path, name):
    (tmp_path / name).write_bytes(b"" if name == "walk" else b"no capture at all")
    stool.scene.oncue.library_paths.add().path = str(tmp_path / name)
    refused(f"{name} is no capture that can be read: give .bvh, .fbx, .glb or .gltf files")


def test_a_mapping_file_that_is_put_beside_a_capture_is_read(stool, oncue, core, tmp_path):
    starter = core.Library.starter()
    path, mapping = tmp_path / "walk.bvh", tmp_path / "walk.oncue.json"
    starter.write_bvh(starter.clip_names.index("walk 1.00 m/s"), str(path))
    stool.scene.oncue.library_paths.add().path = str(path)
    assert bpy.ops.oncue.read_library() == {"FINISHED"}
    for beside in (mapping, tmp_path / "oncue.json"):
        beside.write_text('{"exclude": true}')
        with pytest.raises(RuntimeError, match="its mapping file excludes it"):
            bpy.ops.oncue.read_library()
        beside.unlink()
        assert bpy.ops.oncue.read_library() == {"FINISHED"}


def test_a_relative_library_of_an_unsaved_file_is_named(stool, core):
    stool.scene.oncue.library_paths.add().path = "//mocap"
    refused("never saved")


def test_overrides_must_be_settings(stool, core):
    stool.scene.oncue.overrides = "{oops"
    refused("not JSON")
    stool.scene.oncue.overrides = '{"ppo": {"upppdates": 3}}'
    refused(r"no setting ppo\.upppdates")


def test_the_library_list(context, tmp_path):
    folder = tmp_path / "mocap"
    folder.mkdir()
    files = [{"name": "a.bvh"}, {"name": "b.bvh"}]
    bpy.ops.oncue.add_library(directory=str(folder), files=files)
    bpy.ops.oncue.add_library(directory=str(folder), folder=True)
    bpy.ops.oncue.add_library(directory=str(folder), folder=True)
    paths = [item.path for item in context.scene.oncue.library_paths]
    assert paths == [str(folder / "a.bvh"), str(folder / "b.bvh"), str(folder)]
    context.scene.oncue.library_index = 0
    bpy.ops.oncue.remove_library()
    assert [item.path for item in context.scene.oncue.library_paths] == paths[1:]


def test_saving_the_library(context, oncue, core, tmp_path):
    path = tmp_path / "starter.oncue"
    assert bpy.ops.oncue.save_library(filepath=str(path)) == {"FINISHED"}
    assert core.Library.read(str(path)).clip_count > 100
    with pytest.raises(RuntimeError, match="nowhere"):
        bpy.ops.oncue.save_library(filepath="/nowhere/starter.oncue")


def test_excluding_objects(context, oncue):
    add_floor()
    cube = add_cube("Curtain")
    for thing in context.view_layer.objects:
        thing.select_set(thing == cube)
    bpy.ops.oncue.toggle_exclude()
    assert len(oncue("bridge.scene_reader").read_scene(context).triangles) == 2
    bpy.ops.oncue.toggle_exclude()
    assert len(oncue("bridge.scene_reader").read_scene(context).triangles) == 14
