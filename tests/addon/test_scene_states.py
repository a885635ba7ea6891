"""A walk through the states that a file may be in: each is read as the view shows it, plays, or is refused.

One row a state, each with the one outcome that is meant. What a state does in depth is tested where it is handled.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import bmesh
import bpy
import numpy as np
import pytest

from .runs import current_action, datablocks, set_quick
from .shapes import add_cube
from .test_file_state import BENT, HIDING, enter_edit_mode, in_collection, refused, synthesize, worst_joint


class State(NamedTuple):
    """What is done to the room, and what must come of it: a function of `oncue` and `core` that looks."""

    make: Callable[[], object]
    outcome: Callable


# --- outcomes ---------------------------------------------------------------------------------------------------------


def read(oncue):
    """The corners of the scene's triangles, world, metres, the task and the notes, as a run would have them."""
    bpy.context.view_layer.update()
    before = datablocks()
    request, notes = oncue("bridge.session").read_request(bpy.context)
    assert datablocks() == before
    return request.positions[request.triangles], request, notes


def with_box(at=(0.0, -2.0, 0.5), size=(1.0, 1.0, 1.0), noted=None):
    """The box is an obstacle where the view shows it, `size` wide about `at`."""

    def look(oncue, core):
        corners, request, notes = read(oncue)
        own = corners[[request.names[owner] in {"Box", "Instance", "Other"} for owner in request.owners]]
        assert len(own), request.names
        low, high = own.reshape(-1, 3).min(axis=0), own.reshape(-1, 3).max(axis=0)
        assert np.allclose((low + high) / 2, at, atol=1e-4)
        assert np.allclose(high - low, size, atol=1e-4)
        assert_said(notes, noted)

    return look


def without_box(oncue, core):
    _, request, notes = read(oncue)
    assert not {"Box", "Instance"} & set(request.names)
    assert notes == []


def task(check, noted=None):
    """The task that is read, by a function that looks at it."""

    def look(oncue, core):
        _, request, notes = read(oncue)
        check(request.task)
        assert_said(notes, noted)

    return look


def plays(noted=None):
    """A run makes an action in which each joint is where the motion has it, whatever the state of the character."""

    def look(oncue, core):
        bpy.context.view_layer.update()
        # With a key on every frame a joint that is off is moved by something else.
        bpy.context.scene.oncue.every_frame = True
        synthesize()
        assert worst_joint(oncue, core) < 1e-3
        report = oncue("bridge.session").current_report(bpy.context.scene)
        assert_said([(note["object"], note["reason"]) for note in report["extension"]["skipped_objects"]], noted)

    return look


def says_no(words):
    """One sentence before the run, and nothing has changed."""

    def look(oncue, core):
        bpy.context.view_layer.update()
        refused(words)

    return look


def assert_said(notes, words):
    told = " ".join(said for _, said in notes)
    assert words in told if words else notes == [], notes


# --- states -----------------------------------------------------------------------------------------------------------


def box():
    return bpy.data.objects["Box"]


def start():
    return bpy.data.objects["Start"]


def character():
    return bpy.context.scene.oncue.character


def raised(thing, by=2.0):
    """Its mesh is edited, and the mode is not left."""
    enter_edit_mode(thing)
    mesh = bmesh.from_edit_mesh(thing.data)
    for vertex in mesh.verts:
        vertex.co.z += by
    bmesh.update_edit_mesh(thing.data)


def with_array(thing):
    made = thing.modifiers.new("Array", "ARRAY")
    made.count, made.use_relative_offset, made.use_constant_offset = 2, False, True
    made.constant_offset_displace = (0, 0, 1)
    made.show_in_editmode = False


def shared_mesh():
    other = bpy.data.objects.new("Other", box().data)
    other.location = (0, -2, 1.5)
    bpy.context.scene.collection.objects.link(other)


def edited_curve():
    bpy.data.objects.remove(box())
    curve = bpy.data.curves.new("Box", "CURVE")
    curve.dimensions, curve.extrude = "3D", 0.5
    spline = curve.splines.new("POLY")
    spline.points.add(1)
    spline.points[0].co, spline.points[1].co = (-0.5, 0, 0, 1), (0.5, 0, 0, 1)
    made = bpy.data.objects.new("Box", curve)
    made.location = (0, -2, 0.5)
    bpy.context.scene.collection.objects.link(made)
    enter_edit_mode(made)


def library(tmp, *names):
    """These objects, as they lie in another file."""
    path = str(tmp / "kit.blend")
    bpy.data.libraries.write(path, {bpy.data.objects[name] for name in names})
    for name in names:
        bpy.data.objects.remove(bpy.data.objects[name])
    with bpy.data.libraries.load(path, link=True) as (_, into):
        into.objects = list(names)
    for thing in into.objects:
        bpy.context.scene.collection.objects.link(thing)
    return into.objects


def linked(name):
    return lambda tmp: library(tmp, name)


def overridden(name):
    def make(tmp):
        (thing,) = library(tmp, name)
        thing.override_create(remap_local_usages=True)

    return make


def linked_scene(tmp):
    path = str(tmp / "scene.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path, copy=True)
    with bpy.data.libraries.load(path, link=True) as (_, into):
        into.scenes = [bpy.context.scene.name]
    bpy.context.window.scene = into.scenes[0]


def moved_character(tmp, override):
    """The character comes from another file; overridden, it can be edited or not."""
    (thing,) = library(tmp, character().name)
    bpy.context.scene.oncue.character = thing
    if override:
        made = thing.override_create(remap_local_usages=True)
        made.override_library.is_system_override = override == "system"
        bpy.context.scene.oncue.character = made


def instanced():
    kit, empty = bpy.data.collections.new("Kit"), bpy.data.objects.new("Instance", None)
    bpy.context.scene.collection.objects.unlink(box())
    kit.objects.link(box())
    empty.instance_type, empty.instance_collection = "COLLECTION", kit
    bpy.context.scene.collection.objects.link(empty)
    bpy.context.view_layer.update()
    return empty


def hidden(thing, way):
    if way == "own eye":
        thing.hide_set(True)
    elif way == "own monitor":
        thing.hide_viewport = True
    else:
        HIDING[way](*in_collection("Set", thing))


def shown_alone(*names):
    """The view goes into local view on these objects. There is a window's screen without a window too."""
    window = bpy.context.window_manager.windows[0]
    area = next(area for area in window.screen.areas if area.type == "VIEW_3D")
    region = next(region for region in area.regions if region.type == "WINDOW")
    for thing in bpy.context.view_layer.objects:
        thing.select_set(thing.name in names)
    return {"window": window, "area": area, "region": region}


def cart(still=False):
    """Something that goes along X, or stands."""
    made = add_cube("Cart", location=(30, 0, 0))
    for frame, x in ((1, 30.0), (100, 30.0 if still else 31.0)):
        made.location.x = x
        made.keyframe_insert("location", frame=frame)
    bpy.context.scene.frame_set(1)
    return made


def on(thing, carrier, how):
    if how == "parent":
        thing.parent = carrier
        thing.matrix_parent_inverse = carrier.matrix_world.inverted()
    else:
        made = thing.constraints.new("CHILD_OF")
        made.target = carrier
        made.inverse_matrix = carrier.matrix_world.inverted()


def keyed_start(frames):
    there = start().location.x
    for frame, x in frames:
        start().location.x = there + x
        start().keyframe_insert("location", frame=frame)
    bpy.context.scene.frame_set(1)


def driven_start():
    there = start().location.x
    start().driver_add("location", 0).driver.expression = f"{there} + (frame - 1) * 0.01"


def turned(mode):
    for bone in character().pose.bones:
        bone.rotation_mode = mode


def tweaked():
    data = character().animation_data
    track = data.nla_tracks.new()
    strip = track.strips.new("Take", 1, data.action)
    data.action = None
    data.nla_tracks.active = track
    track.select = strip.select = True
    data.use_tweak_mode = True


def two_slots():
    other = character().copy()
    other.name = "Other Character"
    bpy.context.scene.collection.objects.link(other)
    action = current_action()
    other.animation_data.action = action
    if hasattr(other.animation_data, "action_slot"):
        other.animation_data.action_slot = action.slots.new(id_type="OBJECT", name="Other")


def chosen_anew():
    """Of a renamed character."""
    action = current_action()
    character().name = "Anna"
    character().animation_data.action = None
    character().animation_data.action = action


def linked_action(tmp):
    path = str(tmp / "take.blend")
    action = current_action()
    bpy.data.libraries.write(path, {action})
    character().animation_data.action = None
    bpy.data.actions.remove(action)
    with bpy.data.libraries.load(path, link=True) as (names, into):
        into.actions = list(names.actions)
    character().animation_data.action = into.actions[0]


def elsewhere(exclude):
    """The character lies in a collection of its own."""
    _, layer = in_collection("Elsewhere", character())
    layer.exclude = exclude


def other_layer():
    """Another view layer is looked at, which leaves the character's collection out."""
    in_collection("Elsewhere", character())
    made = bpy.context.scene.view_layers.new("Second")
    bpy.context.window.view_layer = made
    made.layer_collection.children["Elsewhere"].exclude = True


def without_skin():
    bpy.data.objects.remove(next(child for child in character().children if child.type == "MESH"))


def without_bones():
    bpy.data.objects.remove(character())


def doubled():
    for thing in bpy.context.view_layer.objects:
        thing.select_set(thing == character() or thing.parent == character())
    bpy.context.view_layer.objects.active = character()
    bpy.ops.object.duplicate()


def rate(fps, base=1.0):
    bpy.context.scene.render.fps, bpy.context.scene.render.fps_base = fps, base


def shot(first, last, preview=None, chosen=None):
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = first, last
    if preview:
        scene.use_preview_range = True
        scene.frame_preview_start, scene.frame_preview_end = preview
    if chosen is not None:
        scene.oncue.start_frame = chosen
    scene.frame_set(first + 3)


def begins(at, frame_start):
    def look(oncue, core):
        scene = bpy.context.scene
        first, last = synthesize().frame_range
        assert (first, scene.frame_start, scene.frame_end) == (at, frame_start, max(last, scene.frame_end))
        assert scene.frame_end >= last

    return look


def starts_at(x):
    return lambda asked: np.testing.assert_allclose(asked["start"]["position"][0], x, atol=1e-4)


NO_START = says_no("There is no Start cue")
ANIMATED = "Start is animated: it was read as it stands at frame 1, where the motion begins."
START_X = 0.4

#: What there is of the room alone, in reading.
SCENE = {
    # Meshes in edit mode, with modifiers too.
    "a mesh in edit mode": State(lambda: raised(box()), with_box((0, -2, 2.5))),
    "its modifier does not show in edit mode": State(
        lambda: (with_array(box()), raised(box())), with_box((0, -2, 3.0), (1, 1, 2))
    ),
    "a mesh in edit mode that another object shares": State(
        lambda: (shared_mesh(), raised(box())), with_box((0, -2, 3.0), (1, 1, 2))
    ),
    "a mesh in sculpt mode": State(
        lambda: (enter_edit_mode(box()), bpy.ops.object.mode_set(mode="SCULPT")), with_box()
    ),
    "a curve in edit mode": State(edited_curve, with_box((0, -2, 0.5), (1, 0, 1))),
    # Linked data and overrides.
    "a linked mesh": State(linked("Box"), with_box()),
    "an override of a linked mesh": State(overridden("Box"), with_box()),
    "a linked cue": State(linked("Start"), task(starts_at(START_X))),
    "a linked scene": State(linked_scene, says_no("is linked from .*: work in a scene of this file")),
    # What the view hides and what it shows.
    **{
        f"a mesh hidden: {way}": State(lambda way=way: hidden(box(), way), without_box)
        for way in ("own eye", "own monitor", *HIDING)
    },
    **{
        f"an instance hidden: {way}": State(lambda way=way: hidden(instanced(), way), without_box)
        for way in ("own eye", "own monitor", *HIDING)
    },
    **{
        f"a cue hidden: {way}": State(lambda way=way: hidden(start(), way), NO_START)
        for way in ("own eye", "own monitor", *HIDING)
    },
    "an instance": State(instanced, with_box()),
    "a mesh shown as wire": State(lambda: setattr(box(), "display_type", "WIRE"), without_box),
    "a mesh shown as bounds": State(lambda: setattr(box(), "display_type", "BOUNDS"), without_box),
    "a mesh that renders do not show": State(lambda: setattr(box(), "hide_render", True), with_box()),
    "a mesh that cannot be selected": State(lambda: setattr(box(), "hide_select", True), with_box()),
    "a collection that cannot be selected": State(
        lambda: setattr(in_collection("Set", box())[0], "hide_select", True), with_box()
    ),
    # Cues that move.
    "a keyed cue": State(lambda: keyed_start([(1, 0.0), (50, 1.0)]), task(starts_at(START_X), ANIMATED)),
    "a cue whose keys all say the same": State(lambda: keyed_start([(1, 0.0), (50, 0.0)]), task(starts_at(START_X))),
    "a driven cue": State(driven_start, task(starts_at(START_X), ANIMATED)),
    "a cue on a moving parent": State(lambda: on(start(), cart(), "parent"), task(starts_at(START_X), ANIMATED)),
    "a cue on a moving constraint": State(
        lambda: on(start(), cart(), "constraint"), task(starts_at(START_X), ANIMATED)
    ),
    "a cue on a parent that stands": State(lambda: on(start(), cart(still=True), "parent"), task(starts_at(START_X))),
    "a cue at a place that is none": State(lambda: setattr(start(), "location", (math.nan, 0, 0)), says_no("Start")),
    "a cue of no size": State(lambda: setattr(start(), "scale", (0, 0, 0)), says_no("Start faces straight up or down")),
    # Time.
    "stretched time": State(
        lambda: setattr(bpy.context.scene.render, "frame_map_new", 200), says_no("stretched from 100 to 200")
    ),
    "a frame in a hundred seconds": State(lambda: rate(1, 100.0), says_no("0.01 frames a second")),
    "a thousand times too many frames": State(lambda: rate(30_000), says_no("30000 frames a second")),
    "a broken rate": State(lambda: rate(24, 1.001), task(starts_at(START_X))),
}

#: What there is of a character that has a take.
CHARACTER = {
    "in edit mode": State(lambda: enter_edit_mode(character()), says_no("is in edit mode")),
    "a strip open in tweak mode": State(tweaked, says_no("tweak mode")),
    **{f"bones that turn by {mode}": State(lambda mode=mode: turned(mode), plays()) for mode in ("XYZ", "AXIS_ANGLE")},
    **{
        state: State(lambda bend=bend: bend(character()), says_no(f"Oncue Character .*{words}.*Reset Character"))
        for state, (bend, words) in BENT.items()
    },
    # Linked.
    "from another file": State(lambda tmp: moved_character(tmp, None), says_no("linked from .*library override")),
    "an override that only scripts may edit": State(lambda tmp: moved_character(tmp, "system"), plays()),
    "an override": State(lambda tmp: moved_character(tmp, "own"), plays()),
    "a linked take": State(linked_action, plays()),
    # Where it stands, and on what.
    "moved and turned": State(lambda: setattr(character(), "location", (3, 1, 0)), plays()),
    "on a parent that stands": State(lambda: on(character(), cart(still=True), "parent"), plays()),
    "on a constraint that stands": State(lambda: on(character(), cart(still=True), "constraint"), plays()),
    "on a moving parent": State(lambda: on(character(), cart(), "parent"), says_no("itself is moved")),
    "on a moving constraint": State(lambda: on(character(), cart(), "constraint"), says_no("itself is moved")),
    # What is seen of it.
    "hidden by its eye": State(lambda: character().hide_set(True), plays("Oncue Character is hidden")),
    "in a collection of its own": State(lambda: elsewhere(False), plays()),
    "in an excluded collection": State(lambda: elsewhere(True), says_no("lies in no collection that the view layer")),
    "on another view layer": State(other_layer, says_no("lies in no collection that the view layer Second")),
    # Halves and doubles.
    "without its skin": State(without_skin, plays()),
    "a skin without its bones": State(without_bones, plays()),
    "duplicated": State(doubled, plays()),
    # Slots.
    "an action of two slots": State(two_slots, plays()),
    "renamed, its take chosen anew": State(chosen_anew, plays()),
}

#: When the motion begins, and what becomes of the shot's range.
SHOTS = {
    "a shot from 1001": State(lambda: shot(1001, 1200), begins(1001, 1001)),
    "a shot that is too short": State(lambda: shot(1001, 1010), begins(1001, 1001)),
    "a preview range": State(lambda: shot(1001, 1200, preview=(1050, 1100)), begins(1050, 1001)),
    "a frame that was chosen": State(lambda: shot(1001, 1200, chosen=900), begins(900, 1001)),
}


@pytest.fixture
def room(fixtures, core):
    """A small task with a box beside the way, ready to run."""
    fixtures.stool_alone()
    set_quick(bpy.context.scene)
    add_cube("Box", location=(0, -2, 0.5))
    return bpy.context


def walk(state, oncue, core, tmp_path):
    if state.make.__code__.co_argcount and not state.make.__defaults__:
        state.make(tmp_path)
    else:
        state.make()
    try:
        state.outcome(oncue, core)
    finally:
        if bpy.context.mode != "OBJECT":
            bpy.ops.object.mode_set(mode="OBJECT")


@pytest.mark.parametrize("state", SCENE)
def test_the_scene(room, oncue, core, tmp_path, state):
    walk(SCENE[state], oncue, core, tmp_path)


@pytest.mark.parametrize("state", CHARACTER)
def test_the_character(room, oncue, core, tmp_path, state):
    synthesize()
    walk(CHARACTER[state], oncue, core, tmp_path)


@pytest.mark.parametrize("state", SHOTS)
def test_the_shot(room, oncue, core, tmp_path, state):
    walk(SHOTS[state], oncue, core, tmp_path)


def test_local_view_hides_nothing_from_a_run_and_is_told(room, oncue):
    """It is a way of looking at some objects while working; the file is the same without it."""
    plain, _, notes = read(oncue)
    assert notes == []
    view = shown_alone("Stool", "Sit")
    with bpy.context.temp_override(**view):
        bpy.ops.view3d.localview()
        bpy.context.view_layer.update()
        try:
            seen, _, notes = read(oncue)
            # The cue that is there moves, though it does not show.
            bpy.ops.oncue.place_cue(kind="start")
            assert len([thing for thing in bpy.data.objects if thing.get("oncue_cue") == "start"]) == 1
        finally:
            bpy.ops.view3d.localview()
    assert np.array_equal(seen, plain)
    ((_, said),) = notes
    assert "count, though this view does not show them (local view" in said
