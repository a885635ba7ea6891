"""What the panel tells of captures and of clipping, and where its buttons lead."""

import types
from pathlib import Path

import bpy
import numpy as np
import pytest

from .shapes import add_cube


@pytest.fixture
def captures(core, tmp_path):
    """A folder of a walk and a file that is none."""
    folder = tmp_path / "captures"
    folder.mkdir()
    starter = core.Library.starter()
    walk = next(i for i, name in enumerate(starter.clip_names) if name.startswith("walk"))
    starter.write_bvh(walk, str(folder / "walk.bvh"))
    (folder / "notes.bvh").write_text("no motion at all")
    return folder


class Layout:
    """Takes what a panel draws."""

    def __init__(self, drawn=None):
        self.drawn = drawn if drawn is not None else []

    def __getattr__(self, name):
        def draw(*arguments, **named):
            self.drawn.append((name, arguments, named))
            if name == "panel":
                return Layout(self.drawn), Layout(self.drawn)
            if name == "operator":
                return types.SimpleNamespace()
            return Layout(self.drawn)

        return draw

    @property
    def texts(self):
        return [named["text"] for name, _, named in self.drawn if name == "label" and "text" in named]


def test_the_panel_lists_what_each_file_gave(oncue, context, captures):
    panels, scene = oncue("panels"), context.scene
    scene.oncue.library_paths.add().path = str(captures)
    scene.oncue.starter = "NONE"
    before = Layout()
    panels._draw_captures(context, before)
    assert before.texts == []
    assert bpy.ops.oncue.read_library() == {"FINISHED"}
    layout = Layout()
    panels._draw_captures(context, layout)
    assert layout.texts[0] == "2 Captures, 1 Left Out"
    # What wants something done comes first, with its reason.
    assert layout.texts[1] == "notes.bvh: nothing"
    assert any("ROOT" in text or "HIERARCHY" in text or "not" in text for text in layout.texts[2:])
    (walk,) = (text for text in layout.texts if text.startswith("walk.bvh: "))
    assert " s" in walk
    # With another choice it says nothing of these.
    scene.oncue.starter = "ALL"
    after = Layout()
    panels._draw_captures(context, after)
    assert after.texts == []


def test_a_mapping_file_is_chosen_in_the_panel_and_by_batch(oncue, context, captures, tmp_path):
    pipeline, session = oncue("pipeline"), oncue("bridge.session")
    settings = context.scene.oncue
    settings.library_paths.add().path = str(captures / "walk.bvh")
    settings.starter = "NONE"
    labels = tmp_path / "labels.json"
    options = oncue("command_line").parser().parse_args(["--out", "x.blend", "--mapping", str(labels)])
    oncue("command_line").apply_options(context.scene, options)
    assert settings.mapping == str(labels)
    choice = session.library_choice(context.scene)
    assert choice.mapping == str(labels)
    with pytest.raises(oncue("errors").SceneError, match=r"mapping file .*labels\.json is not there any more"):
        pipeline.run_blocking(pipeline.library_steps(choice, pipeline.LibraryCache()))
    labels.write_text("{no json")
    with pytest.raises(oncue("native").core.InputError, match=r"labels\.json"):
        pipeline.run_blocking(pipeline.library_steps(choice, pipeline.LibraryCache()))
    # A file that is changed is read anew.
    cache = pipeline.LibraryCache()
    labels.write_text("{}")
    first, _ = pipeline.run_blocking(pipeline.library_steps(choice, cache))
    again, _ = pipeline.run_blocking(pipeline.library_steps(choice, cache))
    labels.write_text("{ }")
    anew, _ = pipeline.run_blocking(pipeline.library_steps(choice, cache))
    assert first is again
    assert anew is not first
    assert anew.checksum == first.checksum


@pytest.fixture
def request_(oncue, context):
    """The request of a room with a table and a stool."""
    add_cube("Floor", (0, 0, -0.05), (7, 6, 0.1))
    add_cube("Table", (0, 1.2, 0.375), (0.6, 0.6, 0.75))
    add_cube("Stool", (1.5, 0, 0.225), (0.45, 0.45, 0.45))
    cues = oncue("bridge.cue_objects")
    cues.make_cue(context, "start", (-2, 0, 0), 1.57)
    cues.make_cue(context, "sit", (1.5, -0.02, 0.55), 0.0)
    return oncue("bridge.session").read_request(context)[0]


def test_a_place_on_a_surface_names_its_object(oncue, request_):
    object_at = oncue("bridge.session").object_at
    assert object_at(request_, [0.1, 1.3, 0.75]) == "Table"
    assert object_at(request_, [1.5, 0.225, 0.2]) == "Stool"
    assert object_at(request_, [2.0, -1.0, 0.0]) == "Floor"
    assert object_at(request_, [2.0, -1.0, 0.4]) == ""


def test_the_deepest_touch_is_told_with_its_object_and_frame(oncue, context, request_):
    session, panels = oncue("bridge.session"), oncue("panels")
    touch = {"part": "left_shin", "frame": 60, "depth_cm": 4.21, "place": [0.3, 1.2, 0.5]}
    report = {"body": {"scene": {"touches": [touch, {**touch, "place": [1.5, 0, 0.45]}]}}}
    # 60 frames at 30 Hz are 48 of 24.
    past = oncue("moving").nothing_met()
    deepest = session.deepest_touch(request_, report, past, 11)
    assert deepest == {"part": "left_shin", "object": "Table", "depth_cm": 4.21, "frame": 59}
    line = panels.deepest_line({"extension": {"deepest": deepest}})
    assert line == ("    Deepest: left shin 4.2 cm in Table", 59)
    assert bpy.ops.oncue.go_to_frame(frame=line[1]) == {"FINISHED"}
    assert context.scene.frame_current == 59
    for empty in ({}, {"body": None}, {"body": {"scene": {"touches": []}}}):
        assert session.deepest_touch(request_, empty, past, 1) is None
    # What moves is a thing like others: the deeper one is told.
    for depth, expected in ((9.0, "Cart"), (2.0, "Table")):
        met = {"object": "Cart", "part": "trunk", "first": 3, "end": 9, "frames": 6, "depth_cm": depth, "frame": 5}
        deepest = session.deepest_touch(request_, report, {**past, "meetings": [met]}, 11)
        assert deepest["object"] == expected
    assert session.deepest_touch(request_, {}, {**past, "meetings": [met]}, 11) == {
        **{"part": "trunk", "object": "Cart", "depth_cm": 2.0},
        "frame": 15,
    }
    assert panels.deepest_line({}) is None
    assert panels.deepest_line({"extension": {"deepest": None}}) is None


def test_a_touch_is_told_with_its_object(oncue, request_):
    session = oncue("bridge.session")
    touch = {"part": "left_hand", "frame": 60, "depth_cm": 4.2, "place": [0.3, 1.2, 0.5]}
    report = {"body": {"scene": {"touches": [touch, {**touch, "place": [9.0, 9.0, 9.0]}]}}}
    said = "The left hand is 4 cm deep in what stands at 0.30, 1.20, 0.50 (frames 60 to 66)."
    elsewhere = "The left hand is 4 cm deep in what stands at 9.00, 9.00, 9.00 (frames 60 to 66)."
    expected = ["The left hand is 4 cm deep in ‘Table’ (frames 60 to 66).", elsewhere, "Cue 'A' was missed."]
    assert session.with_objects([said, elsewhere, "Cue 'A' was missed."], request_, report) == expected
    assert session.with_objects(["Cue 'A' was missed."], request_, {"body": None}) == ["Cue 'A' was missed."]


def test_each_triangle_has_its_object(request_):
    owners = np.bincount(request_.owners, minlength=len(request_.names))
    assert request_.names == ("Floor", "Table", "Stool")
    assert owners.tolist() == [12, 12, 12]


def test_a_run_reports_its_captures(oncue, context, request_, captures):
    settings = context.scene.oncue
    settings.library_paths.add().path = str(captures)
    assert bpy.ops.oncue.synthesize() == {"FINISHED"}
    extension = oncue("bridge.session").current_report(context.scene)["extension"]
    assert [Path(c["file"]).name for c in extension["captures"]] == ["notes.bvh", "walk.bvh"]
    assert [Path(c["file"]).name for c in extension["skipped_files"]] == ["notes.bvh"]
    assert extension["skipped_files"][0]["reason"]
