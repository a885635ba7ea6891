"""What runs inside the real Blender: makes the scene, opens the sidebar, writes down what it sees ten times a second.

`blender -b -P in_blender.py -- make SCENE FILE` makes a task scene, `blender -b FILE -P in_blender.py -- keys` prints
the checksum of the character's keys; with a window and no arguments it watches.
"""

import hashlib
import json
import sys
import time
from pathlib import Path

import bpy

HERE = Path(__file__).resolve().parent
STATE = Path("/tmp/oncue-window/state.jsonl")
#: A line for each key press that the running operator was handed.
PRESSES = STATE.with_name("presses.jsonl")
#: A colour that nothing else in the window has, for finding the buttons: red, green, blue of 0..1.
BUTTON_COLOR = (0.05, 0.42, 0.62, 1.0)
#: Settings that the test asks for while Blender runs; taken up and removed by the next tick.
OVERRIDES = STATE.with_name("overrides.json")
#: From scratch and content with nothing less than every update, so that a fast machine too is seen at work.
BUDGET = {
    "ppo": {"prior": False, "updates": 8, "tuples": 12000, "solved": 1.1},
    "kept": {"rollouts": 64, "rounds": 1, "more_rounds": 0},
}


def extension(name):
    import importlib

    return importlib.import_module(f"bl_ext.user_default.oncue.{name}")


def make(name, path):
    sys.path.insert(0, str(HERE.parent / "blend_fixtures"))
    import make_fixtures

    make_fixtures.SCENES[name]()
    bpy.context.scene.oncue.overrides = json.dumps(BUDGET)
    make_fixtures.save(Path(path))


def keys():
    """Checksum of every channel and key of the action that the character plays; empty without one."""
    character = bpy.context.scene.oncue.character
    data = character.animation_data if character else None
    if not data or not data.action:
        return ""
    digest = hashlib.sha256()
    for curve in sorted(
        extension("bridge.compat").action_curves(data.action), key=lambda c: (c.data_path, c.array_index)
    ):
        values = [0.0] * (2 * len(curve.keyframe_points))
        curve.keyframe_points.foreach_get("co", values)
        digest.update(f"{curve.data_path} {curve.array_index} {values!r}".encode())
    return digest.hexdigest()


def open_sidebar():
    """The 3D view over the whole window, its sidebar on Oncue, buttons in a colour of their own."""
    window = bpy.context.window_manager.windows[0]
    area = max((a for a in window.screen.areas if a.type == "VIEW_3D"), key=lambda a: a.width * a.height)
    space = area.spaces.active
    space.show_region_ui = True
    space.shading.type, space.shading.color_type = "SOLID", "MATERIAL"
    theme = bpy.context.preferences.themes[0].user_interface.wcol_tool
    theme.inner, theme.inner_sel = BUTTON_COLOR, BUTTON_COLOR
    theme.show_shaded = False
    view = next(r for r in area.regions if r.type == "WINDOW")
    with bpy.context.temp_override(window=window, area=area, region=view):
        bpy.ops.view3d.view_all(center=False)
    from mathutils import Euler

    space.region_3d.view_rotation = Euler((0.70, 0.0, 0.42)).to_quaternion()
    return next(r for r in area.regions if r.type == "UI")


def note_presses():
    """Writes down when the running operator was handed a key, how long it took and whether a run was left after it."""
    module, presses = extension("job_operator"), PRESSES.open("w", buffering=1)
    modal = module.JobOperator.modal

    def noted(self, context, event):
        came, pressed = time.time(), event.type if event.value == "PRESS" else ""
        answer = modal(self, context, event)
        if pressed and "MOUSE" not in pressed:
            line = {"time": came, "took": time.time() - came, "key": pressed, "at_work": module.handle.run is not None}
            presses.write(json.dumps(line) + "\n")
        return answer

    module.JobOperator.modal = noted


def watch():
    STATE.parent.mkdir(parents=True, exist_ok=True)
    state = STATE.open("w", buffering=1)
    note_presses()
    sidebar, last = None, time.time()

    @bpy.app.handlers.persistent
    def look_again(*_):
        nonlocal sidebar
        sidebar = None

    # Another file brings windows of its own.
    bpy.app.handlers.load_pre.append(look_again)

    def tick():
        nonlocal sidebar, last
        now = time.time()
        if not hasattr(bpy.types.Scene, "oncue"):
            state.write(json.dumps({"time": now, "enabled": False, "tab": "", "at_work": False, "keys": ""}) + "\n")
            return 0.1
        if sidebar is None:
            sidebar = open_sidebar()
            return 0.5
        if sidebar.active_panel_category != "Oncue":
            try:
                sidebar.active_panel_category = "Oncue"
            except TypeError:  # the tabs are there once the sidebar was drawn
                return 0.2
            sidebar.tag_redraw()
        if OVERRIDES.exists():
            bpy.context.scene.oncue.overrides = OVERRIDES.read_text()
            OVERRIDES.unlink()
        handle = extension("job_operator").handle
        run = handle.run
        progress = run.progress() if run else None
        line = {
            "time": now,
            "enabled": True,
            "file": bpy.data.filepath if not bpy.data.is_dirty else "",
            "gap": now - last,
            "at_work": run is not None,
            "stage": progress.stage if progress else "",
            "fraction": progress.fraction if progress else 0.0,
            "message": handle.message,
            "unwritten": extension("operators.synthesize").unwritten.of(bpy.context.scene) is not None,
            "following": extension("operators.follow").following.on,
            "overrides": bpy.context.scene.oncue.overrides,
            "said": list(extension("panels").following_line(bpy.context)),
            "dragged": [operator.bl_idname for operator in bpy.context.window_manager.windows[0].modal_operators],
            "keys": keys() if run is None else "",
            "tab": sidebar.active_panel_category,
            "actions": sorted(a.name for a in bpy.data.actions),
            "objects": len(bpy.data.objects),
            "start": list(bpy.data.objects["Start"].location),
            "frame_end": bpy.context.scene.frame_end,
            "frame": bpy.context.scene.frame_current,
        }
        state.write(json.dumps(line) + "\n")
        last = now
        return 0.1

    bpy.app.timers.register(tick, persistent=True)


if __name__ == "__main__":
    rest = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else []
    if rest[:1] == ["make"]:
        make(*rest[1:])
    elif rest[:1] == ["keys"]:
        print("keys", keys())
    else:
        watch()
