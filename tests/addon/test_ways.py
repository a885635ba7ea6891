"""Show Ways: what is drawn before anything is run, how it follows the cues, and what is said of a way that fails."""

import time

import bpy
import pytest

from .shapes import add_cube, add_floor


@pytest.fixture
def objects(oncue):
    return oncue("bridge.cue_objects")


@pytest.fixture
def walk(objects):
    """A floor, a start, a waypoint and a stop."""
    add_floor()
    cues = [
        objects.make_cue(bpy.context, kind, place, 0.0)
        for kind, place in (("start", (0, -2, 0)), ("pass", (1.5, 0, 0)), ("stop", (0, 2, 0)))
    ]
    for number, cue in enumerate(cues[1:], 1):
        cue["oncue_step"] = number
    return cues


@pytest.fixture
def showing(oncue):
    found = oncue("operators.ways").showing
    assert bpy.ops.oncue.show_ways() == {"FINISHED"}
    assert found.on
    yield found
    found.stop()


def settled(showing, timeout_s=20.0):
    """The ways and the sentences once nothing more is looked for."""
    ends = time.perf_counter() + timeout_s
    while True:
        showing.tick()
        if showing.finder.idle:
            return showing.ways(bpy.context.scene), showing.said(bpy.context.scene)
        assert time.perf_counter() < ends, "it goes on looking"
        time.sleep(0.005)


def flat(point):
    return pytest.approx(point, abs=0.06)


def moved(showing, cue, place):
    cue.location = place
    bpy.context.view_layer.update()
    showing.updated(bpy.context.scene, bpy.context.evaluated_depsgraph_get())
    return settled(showing)


def test_ways_lead_through_the_cues_and_follow_them(oncue, core, walk, showing):
    (way,), said = settled(showing)
    assert said == []
    assert (way.person, way.fails_at) == (0, None)
    assert (way.path[0], way.path[-1]) == (flat((0, -2, 0)), flat((0, 2, 0)))
    assert any(point == flat((1.5, 0, 0)) for point in way.path)
    # Nothing is written, and nobody moves.
    assert not bpy.data.actions
    assert not bpy.data.armatures
    read = showing.finder._requests[0].positions
    (way,), said = moved(showing, walk[2], (1, 2, 0))
    assert said == []
    assert way.path[-1] == flat((1, 2, 0))
    # The scene was not read again for that.
    assert showing.finder._requests[0].positions is read
    lines = oncue("overlay").way_lines(bpy.context)
    assert len(lines) == 1
    assert tuple(lines[0][1][-1][1])[:2] == flat((1, 2))
    # Nor does anything happen while all rests.
    assert showing.tick() == oncue("operators.ways").IDLE_TICK
    assert bpy.ops.oncue.show_ways() == {"FINISHED"}
    assert not showing.on
    assert oncue("overlay").way_lines(bpy.context) == []


def test_a_way_that_fails_is_marked_and_told(oncue, core, walk, showing):
    settled(showing)
    add_cube("Wall", (0, 1, 1), (12, 0.2, 2))
    bpy.context.view_layer.update()
    showing.updated(bpy.context.scene, bpy.context.evaluated_depsgraph_get())
    (way,), said = settled(showing)
    assert len(said) == 1
    assert "‘Stop’ cannot be reached from pass cue ‘Pass’" in said[0]
    # It ends before the wall.
    assert 0.3 < way.fails_at[1] < 0.9
    assert way.path[0] == flat((0, -2, 0))
    overlay = oncue("overlay")
    colors = {color for color, _ in overlay.way_lines(bpy.context)}
    assert colors == {overlay.FAILS_COLOR}
    # On this side there is a way again.
    (way,), said = moved(showing, walk[2], (-1, 0, 0))
    assert (said, way.fails_at) == ([], None)
    bpy.data.objects["Wall"].hide_set(True)
    walk[0].hide_set(True)
    bpy.context.view_layer.update()
    showing.finder.cues_changed()
    ways, said = settled(showing)
    assert ways == []
    assert said[0].startswith("There is no Start cue")


def test_each_person_has_ways(oncue, core, objects, walk, showing):
    ben = objects.make_cue(bpy.context, "start", (2.5, -2, 0), 0.0, name="Ben")
    stop = objects.make_cue(bpy.context, "stop", (2.5, 2, 0), 0.0)
    walk[1]["oncue_person"] = walk[2]["oncue_person"] = walk[0]
    stop["oncue_person"] = ben
    bpy.context.view_layer.update()
    showing.finder.cues_changed()
    ways, said = settled(showing)
    assert said == []
    assert sorted((way.person, round(way.path[-1][0], 1)) for way in ways) == [(0, 2.5), (1, 0.0)]
    # Where two people do not fit together is said too, by the names.
    ways, said = moved(showing, stop, (0.2, 2, 0))
    assert len(said) == 1
    assert "Ben" in said[0]
    assert "two people need 45 cm" in said[0]


def test_a_scene_in_centimetres_has_its_ways_in_centimetres(oncue, core, objects, showing):
    context = bpy.context
    context.scene.oncue.scene_scale = 0.01
    floor = add_floor()
    floor.scale = (100, 100, 100)
    objects.make_cue(context, "start", (0, -200, 0), 0.0)
    objects.make_cue(context, "stop", (0, 200, 0), 0.0)
    context.view_layer.update()
    showing.finder.cues_changed()
    (way,), said = settled(showing)
    assert said == []
    assert way.path[-1] == flat((0, 2, 0))
    (_, lines), *_ = oncue("overlay").way_lines(context)
    assert tuple(lines[-1][1])[:2] == pytest.approx((0, 200), abs=6)


def test_another_file_ends_it(oncue, walk, showing):
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    assert not showing.on


def test_the_frame_that_is_asked_for_stands_at_the_cue(oncue, objects, walk):
    numbers = oncue("overlay").numbers
    assert [text for text, _, _ in numbers(bpy.context)] == ["1", "2"]
    walk[2]["oncue_at_frame"] = 240
    assert [text for text, _, _ in numbers(bpy.context)] == ["1", "2  @ 240"]
    walk[1].hide_set(True)
    assert [text for text, _, _ in numbers(bpy.context)] == ["@ 240"]
