"""The guide from within Blender: its button, and the scenes that it speaks of."""

import importlib
import math
import types
from pathlib import Path
from unittest.mock import MagicMock
from urllib.parse import unquote, urlsplit

import bpy
import pytest

#: Example → how many cues it has, and what it ends with.
EXAMPLES = {
    "first-shot": (2, "sit"),
    "seats": (2, "sit"),
    "several-cues": (4, "stop"),
    "own-rig": (2, "sit"),
    "hands-and-doors": (3, "stop"),
}


@pytest.fixture
def opened(oncue, monkeypatch):
    """The addresses that the browser was asked for."""
    import webbrowser

    found = []
    monkeypatch.setattr(webbrowser, "open", found.append)
    return found


@pytest.fixture
def examples(oncue, fixtures):
    return importlib.import_module("examples").EXAMPLES


def test_the_button_opens_a_page_that_is_there(oncue, opened):
    assert bpy.ops.oncue.open_guide() == {"FINISHED"}
    assert bpy.ops.oncue.open_guide(page="seats") == {"FINISHED"}
    manual = oncue("manual")
    assert opened == [manual.guide_page(name).as_uri() for name in (manual.INDEX, "seats")]
    assert all(Path(unquote(urlsplit(url).path)).is_file() for url in opened)


def test_a_page_that_is_not_there_is_said(oncue, opened):
    with pytest.raises(RuntimeError, match="The guide's page nothing is not there"):
        bpy.ops.oncue.open_guide(page="nothing")
    assert opened == []


def test_every_panel_with_a_head_has_a_button_that_opens_its_page(oncue):
    panels, manual = oncue("panels"), oncue("manual")
    asked = set()
    for cls in panels.CLASSES:
        if not issubclass(cls, bpy.types.Panel):
            continue
        button, layout = types.SimpleNamespace(page=""), MagicMock()
        layout.operator.return_value = button
        cls.draw_header_preset(types.SimpleNamespace(layout=layout, guide=cls.guide), bpy.context)
        if "HIDE_HEADER" in getattr(cls, "bl_options", ()):
            assert not layout.operator.called
            continue
        assert layout.operator.call_args.args == ("oncue.open_guide",)
        assert manual.guide_page(button.page).is_file()
        asked.add(button.page)
    assert len(asked) > 3


@pytest.mark.parametrize("name", EXAMPLES)
def test_an_example_is_ready(examples, oncue, core, name):
    """All that a run looks at before it begins: what is read, that it can be done, and that nothing is remarked."""
    examples[name]()
    request, notes = oncue("bridge.session").read_request(bpy.context)
    settings = core.default_settings("default")["scene"]
    scene = core.index_scene(request.positions, request.triangles, settings, request.task).result()
    asked = request.task.get("steps") or [request.task]
    core.check_task(
        scene, {"start": request.task["start"], **{k: v for k, v in asked[0].items() if k != "hold_seconds"}}
    )
    assert notes == []
    cues = oncue("bridge.shown_cues").visible_cues(bpy.context, *oncue("bridge.cue_objects").KINDS)
    count, last = EXAMPLES[name]
    assert (len(cues), asked[-1]["cue"]["action_type"]) == (count, last)


def test_there_is_an_example_for_each_name(examples):
    assert set(examples) == set(EXAMPLES)


@pytest.mark.parametrize("turned", [0.0, 0.6])
@pytest.mark.parametrize("by", ["object", "face"])
def test_who_sits_on_the_bench_faces_across_it(examples, core, turned, by):
    examples["seats"]()
    bench = bpy.data.objects["Bench"]
    bench.rotation_euler.z = turned
    for thing in bpy.context.view_layer.objects:
        thing.select_set(thing == bench)
    bpy.context.view_layer.objects.active = bench
    if by == "face":
        top = max(bench.data.polygons, key=lambda face: (round(face.normal.z, 3), face.area))
        bench.data.polygons.foreach_set("select", [face == top for face in bench.data.polygons])
        bpy.ops.object.mode_set(mode="EDIT")
    assert bpy.ops.oncue.sit_on_selection() == {"FINISHED"}
    off = (bpy.data.objects["Sit"].rotation_euler.z - turned) % math.pi
    assert min(off, math.pi - off) < 1e-3


def test_the_example_of_an_own_rig_acts_as_it_is(examples, oncue, core):
    examples["own-rig"]()
    rig = bpy.context.scene.oncue.character
    assert bpy.ops.oncue.synthesize() == {"FINISHED"}
    assert bpy.context.scene.oncue.character == rig
    assert oncue("bridge.session").report_of(rig.animation_data.action)["success"] is True


def test_the_example_of_a_door_holds_its_handle(examples, oncue, core):
    examples["hands-and-doors"]()
    door = bpy.data.objects["Cupboard Door"]
    turns = []
    for frame in (91, 151):
        bpy.context.scene.frame_set(frame)
        turns.append(door.matrix_world.to_euler().z)
    # It opens towards who stands before it.
    assert turns[1] - turns[0] < -0.8
    (hand,) = oncue("bridge.hand_reader").read_manipulations(bpy.context, 1)
    assert (hand["first_frame"], len(hand["path"])) == (90, 61)
