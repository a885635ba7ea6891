"""Takes: made, played, copied, pushed and thrown away, and none of the artist's keys lost on the way."""

import bpy
import pytest

from .runs import current_action, datablocks, keys_of, set_quick


@pytest.fixture
def takes(oncue):
    return oncue("bridge.takes")


@pytest.fixture
def stool(fixtures, core):
    """A small task, ready to run."""
    fixtures.stool_alone()
    set_quick(bpy.context.scene)
    return bpy.context


@pytest.fixture
def two(stool):
    """Two takes of seeds 1 and 2; the second is played."""
    bpy.ops.oncue.synthesize()
    first = current_action()
    stool.scene.oncue.seed = 2
    bpy.ops.oncue.synthesize()
    return first, current_action()


def test_every_run_is_a_take_of_its_character(stool, takes, two):
    character = stool.scene.oncue.character
    assert takes.takes_of(character) == sorted(two, key=lambda take: take.name)
    assert takes.takes_of(None) == []
    other = bpy.data.objects.new("Other", bpy.data.armatures.new("Other"))
    stool.scene.collection.objects.link(other)
    assert takes.takes_of(other) == []
    # A new name of the character makes no difference.
    character.name = "Ada"
    assert len(takes.takes_of(character)) == 2


def test_playing_a_take_loses_no_key(stool, oncue, two):
    first, second = two
    curve = oncue("bridge.compat").action_curves(second)[5]
    curve.keyframe_points[10].co.y += 0.1
    curve.update()
    mine = keys_of(oncue, second)
    assert bpy.ops.oncue.play_take(name=first.name) == {"FINISHED"}
    assert current_action() == first
    stool.scene.frame_set(40)
    before = stool.scene.oncue.character.pose.bones["LeftArm"].matrix.copy()
    assert bpy.ops.oncue.play_take(name=second.name) == {"FINISHED"}
    assert keys_of(oncue, second) == mine
    stool.scene.frame_set(40)
    assert stool.scene.oncue.character.pose.bones["LeftArm"].matrix != before


def test_a_copy_is_worked_on_and_the_take_stays(stool, oncue, two):
    _, second = two
    there = keys_of(oncue, second)
    bpy.ops.oncue.copy_take()
    copy = current_action()
    assert copy != second
    assert keys_of(oncue, copy) == there
    curve = oncue("bridge.compat").action_curves(copy)[5]
    curve.keyframe_points[10].co.y += 0.1
    assert keys_of(oncue, second) == there
    # It is a take too, which can be solved again.
    assert oncue("bridge.session").report_of(copy) is not None
    bpy.ops.oncue.resolve()


def test_a_discarded_take_is_gone_and_another_one_plays(stool, two):
    first, second = two
    bpy.ops.oncue.discard_take(name=second.name)
    assert current_action() == first
    assert list(bpy.data.actions) == [first]
    bpy.ops.oncue.discard_take(name=first.name)
    assert current_action() is None
    assert len(bpy.data.actions) == 0


def test_a_pushed_take_plays_on_in_the_nla(stool, oncue, takes, two):
    first, second = two
    character = stool.scene.oncue.character
    stool.scene.frame_set(30)
    played = character.pose.bones["Hips"].matrix.copy()
    bpy.ops.oncue.push_take()
    assert current_action() is None
    strip = character.animation_data.nla_tracks[0].strips[0]
    assert (strip.action, strip.influence) == (second, 1.0)
    assert strip.frame_start == second.frame_range[0]
    stool.scene.frame_set(29)
    stool.scene.frame_set(30)
    shown = character.evaluated_get(stool.evaluated_depsgraph_get()).pose.bones["Hips"].matrix
    assert all(
        abs(a - b) < 1e-4 for row, other in zip(shown, played, strict=True) for a, b in zip(row, other, strict=True)
    )
    # What a strip plays is not thrown away; a second one lies on a track of its own.
    with pytest.raises(RuntimeError, match="is played by a strip of"):
        bpy.ops.oncue.discard_take(name=second.name)
    bpy.ops.oncue.push_take(name=first.name)
    assert [len(track.strips) for track in character.animation_data.nla_tracks] == [1, 1]


def test_variations_are_the_takes_of_their_seeds(stool, oncue, takes):
    assert bpy.ops.oncue.variations(count=3) == {"FINISHED"}
    session = oncue("bridge.session")
    found = takes.takes_of(stool.scene.oncue.character)
    reports = [session.report_of(take) for take in found]
    assert sorted(report["seed"] for report in reports) == [1, 2, 3]
    assert stool.scene.frame_end >= current_action().frame_end
    assert stool.scene.frame_end == max(current_action().frame_end, stool.scene.oncue.shot_end)
    best = min(len(report["problems"]) for report in reports)
    assert len(session.report_of(current_action())["problems"]) == best
    # Each is the motion that its seed gives alone.
    third = next(take for take in found if session.report_of(take)["seed"] == 3)
    keys = keys_of(oncue, third)
    stool.scene.oncue.seed = 3
    bpy.ops.oncue.synthesize()
    assert keys_of(oncue, current_action()) == keys


def test_what_cannot_be_made_makes_no_variations(stool):
    bpy.data.objects["Sit"].location = (50.0, 0.0, 0.4)
    before = datablocks()
    with pytest.raises(RuntimeError):
        bpy.ops.oncue.variations(count=2)
    assert datablocks() == before


def test_a_take_that_is_none_is_named(stool, two):
    with pytest.raises(RuntimeError, match="has no take Nothing"):
        bpy.ops.oncue.play_take(name="Nothing")


def test_in_tweak_mode_no_take_is_played(stool, two):
    first, _ = two
    bpy.ops.oncue.push_take()
    data = stool.scene.oncue.character.animation_data
    data.nla_tracks[0].strips[0].select = True
    data.use_tweak_mode = True
    with pytest.raises(RuntimeError, match="tweak mode"):
        bpy.ops.oncue.play_take(name=first.name)


def test_the_list_tells_how_long_and_how_far_off(oncue, two):
    line, icon = oncue("panels").take_line(oncue("bridge.session").report_of(two[0]))
    assert line.split(" ")[1] == "s,"
    assert line.endswith(" cm")
    assert icon in ("CHECKMARK", "ERROR")
    assert oncue("panels").take_line({"frames": "many"}) == ("", "ERROR")
    assert oncue("panels").take_line(None) == ("", "ERROR")
