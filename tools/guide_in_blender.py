"""What runs inside the real Blender for the guide's pictures: brings the window into the state that a picture shows.

`blender -b -P guide_in_blender.py -- example NAME FILE.blend` makes one of the guide's scenes, `-- walk FILE.bvh`
writes a capture of the starter library's; with a window and the name of a picture it sets that up, and says in READY
that it can be taken. Everything is done by the buttons' own operators.
"""

from __future__ import annotations

import contextlib
import importlib
import math
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import bpy
from mathutils import Euler, Vector

FOLDER = Path("/tmp/oncue-guide")
#: Written once the window shows what the picture is to show.
READY = FOLDER / "ready"
#: Seconds that a window is given to draw what has changed.
SETTLES = 1.0
#: What a picture sets up: changes things, and yields the seconds to wait before it goes on.
Steps = Iterator[float]


def extension(name: str):
    return importlib.import_module(f"bl_ext.user_default.oncue.{name}")


# --- the window -------------------------------------------------------------------------------------------------------


def window() -> bpy.types.Window:
    return bpy.context.window_manager.windows[0]


def area(kind: str) -> bpy.types.Area:
    return max((a for a in window().screen.areas if a.type == kind), key=lambda a: a.width * a.height)


def region(kind: str) -> bpy.types.Region:
    return next(r for r in area("VIEW_3D").regions if r.type == kind)


def over_view(kind: str = "WINDOW"):
    """The context of an operator that is called over the 3D view."""
    return bpy.context.temp_override(window=window(), area=area("VIEW_3D"), region=region(kind))


def only_view() -> None:
    """Closes all but the 3D view and the timeline, which take their room."""
    for kind in ("PROPERTIES", "OUTLINER"):
        with bpy.context.temp_override(window=window(), area=area(kind)):
            bpy.ops.screen.area_close()


def show(*opened: str) -> None:
    """The sidebar at the tab Oncue, of its panels and boxes only these open."""
    panels = extension("panels")
    for cls in reversed(panels.CLASSES):
        if issubclass(cls, bpy.types.Panel):
            bpy.utils.unregister_class(cls)
    for cls in panels.CLASSES:
        if not issubclass(cls, bpy.types.Panel):
            continue
        kept = set(getattr(cls, "bl_options", ())) - {"DEFAULT_CLOSED"}
        # A panel is as its options say when it is drawn first.
        cls.bl_options = kept if cls.bl_label in opened or "HIDE_HEADER" in kept else kept | {"DEFAULT_CLOSED"}
        cls.draw = _opening(cls.draw, opened)
        bpy.utils.register_class(cls)
    area("VIEW_3D").spaces.active.show_region_ui = True


def _opening(draw: Callable, opened: tuple[str, ...]) -> Callable:
    """The panel's own drawing, with the boxes of these names open."""

    class Layout:
        def __init__(self, layout) -> None:
            object.__setattr__(self, "_layout", layout)

        def __getattr__(self, name):
            return getattr(self._layout, name)

        def __setattr__(self, name, value) -> None:
            setattr(self._layout, name, value)

        def panel(self, name, default_closed=False):
            return self._layout.panel(name, default_closed=name not in opened)

    class Panel:
        def __init__(self, panel) -> None:
            self.layout = Layout(panel.layout)

    return lambda self, context: draw(Panel(self), context)


def look(at, away: float, down: float, turned: float) -> None:
    """Turns the view to a place of the scene: metres away, degrees down from level, degrees about +Z from +Y."""
    space = area("VIEW_3D").spaces.active
    space.shading.type, space.shading.color_type = "SOLID", "MATERIAL"
    space.overlay.show_cursor = False
    space.overlay.show_floor = space.overlay.show_axis_x = space.overlay.show_axis_y = False
    space.overlay.show_relationship_lines = False
    space.show_gizmo_navigate = False
    view = space.region_3d
    view.view_perspective = "PERSP"
    view.view_rotation = Euler((math.radians(90.0 - down), 0.0, math.radians(turned))).to_quaternion()
    view.view_location, view.view_distance = Vector(at), away


def without_walls() -> None:
    """Hides the walls, of which one stands before the view."""
    for thing in bpy.context.view_layer.objects:
        thing.hide_set(thing.hide_get() or thing.name.startswith("Wall"))


def scroll(pixels: int) -> Steps:
    """Shows what lies farther down in the sidebar, once that is drawn."""
    yield SETTLES
    with over_view("UI"):
        bpy.ops.view2d.pan(deltax=0, deltay=-pixels)


def select(*names: str) -> None:
    for thing in bpy.context.view_layer.objects:
        thing.select_set(thing.name in names)
    bpy.context.view_layer.objects.active = bpy.data.objects[names[0]] if names else None


def press(name: str, **options) -> None:
    """Presses a button over the view and waits for it; what it refuses stands in the panel."""
    with over_view():
        try:
            getattr(bpy.ops.oncue, name)(**options)
        except RuntimeError as refused:
            print(refused)


# --- the pictures -----------------------------------------------------------------------------------------------------


def first_shot_cues() -> Steps:
    show("Cues", "Motion Library")
    look((3.0, 2.3, 0.4), 8.5, 58, 12)
    select("Sit")
    yield SETTLES


def first_shot_result() -> Steps:
    show("Cues", "Result", "Edit")
    look((3.0, 2.3, 0.4), 8.5, 58, 12)
    bpy.context.scene.frame_set(bpy.context.scene.frame_end)
    select()
    yield SETTLES


def first_shot_takes() -> Steps:
    show("Takes")
    look((3.0, 3.4, 0.6), 4.6, 18, 24)
    press("variations", count=3)
    without_walls()
    bpy.context.scene.frame_set(bpy.context.scene.frame_end)
    select()
    yield SETTLES


def seats_face() -> Steps:
    show("Cues")
    look((1.15, 4.0, 0.55), 3.2, 26, 30)
    select("Chair")
    with over_view():
        bpy.ops.object.mode_set(mode="EDIT")
        bpy.ops.mesh.select_mode(type="FACE")
        bpy.ops.mesh.select_all(action="DESELECT")
    import bmesh

    mesh = bmesh.from_edit_mesh(bpy.context.object.data)
    seat = max((face for face in mesh.faces if face.normal.z > 0.99), key=lambda face: face.calc_area())
    seat.select = True
    bmesh.update_edit_mesh(bpy.context.object.data)
    press("sit_on_selection")
    without_walls()
    yield SETTLES


def seats_edge() -> Steps:
    show("Messages")
    look((6.6, 3.2, 0.5), 5.4, 48, 16)
    bpy.context.scene.cursor.location = (6.9, 3.6, 0.5)
    press("place_cue", kind="sit")
    press("synthesize")
    yield SETTLES


def several_cues_list() -> Steps:
    show("Cues", "Result")
    look((3.0, 2.3, 0.4), 8.5, 58, 12)
    select("Pass")
    yield SETTLES


def own_rig_bones() -> Steps:
    show("Settings", "oncue_bones")
    look((0.4, -0.2, 0.7), 3.9, 16, 34)
    bpy.context.scene.frame_set(bpy.context.scene.frame_end)
    select(bpy.context.scene.oncue.character.name)
    yield SETTLES


def hands_and_doors_cue() -> Steps:
    show("Cues", "oncue_limbs", "Result")
    look((0.1, -0.4, 0.85), 3.9, 20, -52)
    bpy.context.scene.frame_set(121)
    select("Right Hand")
    yield SETTLES


def editing_keys_pins() -> Steps:
    show("Edit", "oncue_pins", "Result")
    look((3.0, 3.5, 0.6), 3.6, 20, 28)
    scene = bpy.context.scene
    character = scene.oncue.character
    select(character.name)
    with over_view():
        bpy.ops.object.mode_set(mode="POSE")
    scene.frame_set(scene.frame_end - 20)
    _select_bone(character, "RightHand")
    press("pin", first_frame=scene.frame_end - 20, last_frame=scene.frame_end)
    _select_bone(character, "Head")
    head = character.pose.bones["Head"]
    turn = Euler((0.0, 0.0, math.radians(25.0))).to_quaternion()
    head.rotation_quaternion = head.rotation_quaternion @ turn
    head.keyframe_insert("rotation_quaternion", frame=scene.frame_current)
    press("resolve")
    yield SETTLES


def _select_bone(character: bpy.types.Object, name: str) -> None:
    for bone in character.data.bones:
        bone.select = bone.name == name
    character.data.bones.active = character.data.bones[name]


def captures_list() -> Steps:
    show("Motion Library", "oncue_captures")
    look((3.0, 2.3, 0.4), 8.5, 58, 12)
    press("add_library", directory=f"{FOLDER}/captures", folder=True)
    press("read_library")
    select()
    yield SETTLES


def troubleshooting_scale() -> Steps:
    show("Messages")
    for thing in bpy.context.scene.objects:
        thing.location *= 100.0
        if thing.type == "MESH":
            thing.scale *= 100.0
    look((300, 230, 40), 850, 58, 12)
    area("VIEW_3D").spaces.active.clip_end = 10_000.0
    press("synthesize")
    select()
    yield SETTLES


def settings_panel() -> Steps:
    show("Settings")
    look((3.0, 2.3, 0.4), 8.5, 58, 12)
    select()
    yield SETTLES


#: Picture → what sets it up.
PICTURES: dict[str, Callable[[], Steps]] = {
    "first-shot-cues": first_shot_cues,
    "first-shot-result": first_shot_result,
    "first-shot-takes": first_shot_takes,
    "seats-face": seats_face,
    "seats-edge": seats_edge,
    "several-cues-list": several_cues_list,
    "own-rig-bones": own_rig_bones,
    "hands-and-doors-cue": hands_and_doors_cue,
    "editing-keys-pins": editing_keys_pins,
    "captures-list": captures_list,
    "troubleshooting-scale": troubleshooting_scale,
    "settings-panel": settings_panel,
}


#: How far down the sidebar is scrolled, pixels, where what is shown lies below others.
SCROLLED = {"own-rig-bones": 420, "settings-panel": 120}


def set_up(name: str) -> None:
    """Goes through a picture's steps by a timer, since the window draws between two of its ticks only."""

    def steps() -> Steps:
        only_view()
        yield SETTLES
        yield from PICTURES[name]()
        sidebar = region("UI")
        while sidebar.active_panel_category != "Oncue":
            # The tabs are there once the sidebar was drawn.
            with contextlib.suppress(TypeError):
                sidebar.active_panel_category = "Oncue"
            area("VIEW_3D").tag_redraw()
            yield SETTLES
        yield from scroll(SCROLLED.get(name, 0))
        yield SETTLES
        READY.write_text(name)

    going = steps()
    bpy.app.timers.register(lambda: next(going, None), first_interval=SETTLES)


def make_example(name: str, path: str) -> None:
    sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "blend_fixtures"))
    examples = importlib.import_module("examples")
    examples.EXAMPLES[name]()
    examples.save(Path(path))


def write_walk(path: str) -> None:
    starter = extension("native").core.Library.starter()
    starter.write_bvh(starter.clip_names.index("walk 1.00 m/s"), path)


if __name__ == "__main__":
    rest = sys.argv[sys.argv.index("--") + 1 :]
    if rest[0] == "example":
        make_example(*rest[1:])
    elif rest[0] == "walk":
        write_walk(rest[1])
    else:
        set_up(rest[0])
