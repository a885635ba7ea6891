"""The button in the real program, pressed with the mouse: one run to its end, and others that are cut short.

Esc, undo, saving, opening a file and disabling the extension come while it runs, by the keyboard.

Needs ONCUE_EXTENSION (the extension's archive) and root, for a Debian with Blender; see blender_root.py.
The screenshots are in out/window/.
"""

import json
import os
import shutil
import subprocess
import time
from pathlib import Path

import pytest

from .blender_root import Unavailable, blender_root

ROOT = Path(__file__).parents[2]
PICTURES = ROOT / "out" / "window"
WIDTH, HEIGHT, DISPLAY = 1280, 800, ":77"
#: The theme's colour of the buttons, see in_blender.py, as the screen shows it.
BUTTON_COLOR = (13, 107, 158)
#: Pixels from one row of the sidebar to the next, and a bit.
STATUS_ROW = 30
#: From the key to the end of the run, seconds. The promise is 0.2 s; this allows for a loaded machine.
ESCAPES_WITHIN = 2.0
#: What the operator itself may take of that, seconds.
ANSWERS_WITHIN = 0.1
#: From scratch and never content: still at work, on any machine, when the test has done what it does meanwhile.
ENDLESS = {"ppo": {"prior": False, "updates": 1000, "tuples": 30000, "solved": 1.1}}
#: As that, but over after some seconds more.
LONG = {
    "ppo": {"prior": False, "updates": 16, "tuples": 12000, "solved": 1.1},
    "kept": {"rollouts": 64, "rounds": 1, "more_rounds": 0},
}


class Desktop:
    """An X server without a screen, Blender on it, and the mouse and keyboard."""

    def __init__(self, root: Path) -> None:
        self.root, self.processes = root, []
        self.state = root / "tmp/oncue-window/state.jsonl"

    def command(self, *words: str) -> list[str]:
        environment = [f"DISPLAY={DISPLAY}", "LIBGL_ALWAYS_SOFTWARE=1", "HOME=/root"]
        environment.append("BLENDER_USER_RESOURCES=/tmp/oncue-window/resources")
        return ["chroot", str(self.root), "env", *environment, *words]

    def do(self, *words: str, timeout: float = 120) -> str:
        done = subprocess.run(self.command(*words), capture_output=True, text=True, timeout=timeout, check=False)
        assert done.returncode == 0, f"{' '.join(words)}\n{done.stdout[-2000:]}\n{done.stderr[-2000:]}"
        return done.stdout

    def start(self, *words: str) -> subprocess.Popen:
        log = (PICTURES / f"{words[0]}.log").open("w")
        process = subprocess.Popen(self.command(*words), stdout=log, stderr=log, start_new_session=True)
        self.processes.append(process)
        return process

    def stop(self) -> None:
        for process in reversed(self.processes):
            process.terminate()
        for process in reversed(self.processes):
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait(10)

    # --- seeing and touching ------------------------------------------------------------------------------------------

    def screenshot(self, name: str) -> None:
        self.do("import", "-window", "root", f"/tmp/oncue-window/{name}.png")
        shutil.copy2(self.root / f"tmp/oncue-window/{name}.png", PICTURES / f"{name}.png")

    def button(self) -> tuple[int, int]:
        """The middle of the tallest button, which is Synthesize."""
        return self._middle(max(self._buttons(), key=len))

    def follow_button(self) -> tuple[int, int]:
        """The middle of the one below it, which is Follow Cues."""
        buttons = self._buttons()
        return self._middle(buttons[buttons.index(max(buttons, key=len)) + 1])

    def message_button(self) -> tuple[int, int]:
        """The middle of the button beside what is said, which stands below Synthesize and Follow Cues."""
        buttons = self._buttons()
        return self._middle(buttons[buttons.index(max(buttons, key=len)) + 2])

    def below(self) -> set[tuple[int, int]]:
        """The first and last row of each button below that."""
        buttons = self._buttons()
        top = max(buttons, key=len)[-1][0] + 2 * STATUS_ROW
        return {(button[0][0], button[-1][0]) for button in buttons if button[0][0] > top}

    @staticmethod
    def _middle(button: list[tuple[int, int, int]]) -> tuple[int, int]:
        y, first, last = button[len(button) // 2]
        return (first + last) // 2, y

    def _buttons(self) -> list[list[tuple[int, int, int]]]:
        """The sidebar's buttons from above, each as its rows (y, first x, last x)."""
        # The one under the mouse is lit and has another colour, and its tooltip lies over the next.
        self.do("xdotool", "mousemove", str(WIDTH // 3), str(HEIGHT // 2), "sleep", "0.5")
        self.do("import", "-window", "root", "-depth", "8", "rgb:/tmp/oncue-window/screen.rgb")
        pixels = (self.root / "tmp/oncue-window/screen.rgb").read_bytes()
        rows: list[tuple[int, int, int]] = []
        for y in range(HEIGHT):
            line = pixels[y * WIDTH * 3 : (y + 1) * WIDTH * 3]
            xs = [
                x
                for x in range(WIDTH // 2, WIDTH)
                if all(abs(line[3 * x + c] - BUTTON_COLOR[c]) < 12 for c in range(3))
            ]
            if len(xs) > 60:
                rows.append((y, xs[0], xs[-1]))
        blocks: list[list[tuple[int, int, int]]] = []
        for row in rows:
            if blocks and row[0] == blocks[-1][-1][0] + 1:
                blocks[-1].append(row)
            else:
                blocks.append([row])
        assert blocks, "no button of the theme's colour is on the screen"
        return blocks

    def click(self, x: int, y: int) -> None:
        # Blender looks at where the mouse was before: it must come from somewhere.
        self.do("xdotool", "mousemove", str(x - 6), str(y - 3), "sleep", "0.2", "mousemove", str(x), str(y))
        self.do("xdotool", "sleep", "0.3", "click", "1")

    def key(self, name: str) -> float:
        """Presses a key over the middle of the view; when."""
        self.do("xdotool", "mousemove", str(WIDTH // 3), str(HEIGHT // 2), "sleep", "0.2")
        pressed = time.time()
        self.do("xdotool", "key", name)
        return pressed

    def states(self) -> list[dict]:
        if not self.state.exists():
            return []
        return [json.loads(line) for line in self.state.read_text().splitlines() if line.endswith("}")]

    def write(self, line: str) -> None:
        """Types a line into Blender's Python console, which takes the view's place for it."""
        self.key("shift+F4")
        self.do("xdotool", "sleep", "0.5", "type", "--delay", "15", line)
        self.do("xdotool", "sleep", "0.3", "key", "Return", "sleep", "0.3")
        self.key("shift+F5")

    def forget_policies(self) -> None:
        """So that the next run optimizes: a policy that was kept would be played."""
        for kept in (self.root / "tmp/oncue-window/resources").rglob("*.oncuepolicy"):
            kept.unlink()

    def start_a_run(self, budget: dict) -> dict:
        """Presses Synthesize with these settings and waits until it optimizes; the state before."""
        self.forget_policies()
        overrides = json.dumps(budget)
        asked = self.state.with_name("overrides.asked")
        asked.write_text(overrides)
        asked.rename(self.state.with_name("overrides.json"))
        since = time.time()
        before = self.until("the settings", lambda s: s.get("overrides") == overrides, timeout=20, since=since)
        assert not before["at_work"]
        x, y = self.button()
        pressed = time.time()
        self.click(x, y)
        self.until("the run", lambda s: s["at_work"] and s["stage"] == "Optimizing", since=pressed)
        return before

    def until(self, what: str, test, timeout: float = 120.0, since: float = 0.0) -> dict:
        """The first state written after `since` that passes `test`."""
        deadline = time.monotonic() + timeout
        while time.monotonic() < deadline:
            for state in self.states():
                if state["time"] > since and test(state):
                    return state
            assert all(p.poll() is None for p in self.processes), "Blender or the X server ended"
            time.sleep(0.1)
        raise AssertionError(f"{what} did not come; last seen: {self.states()[-1:]}")


@pytest.fixture(scope="module")
def desktop():
    archive = os.environ.get("ONCUE_EXTENSION")
    if not archive:
        pytest.skip("ONCUE_EXTENSION does not name the extension's archive")
    try:
        root = blender_root()
    except Unavailable as reason:
        pytest.fail(f"no real Blender here: {reason}")
    PICTURES.mkdir(parents=True, exist_ok=True)
    work = root / "tmp/oncue-window"
    shutil.rmtree(work, ignore_errors=True)
    work.mkdir(parents=True)
    for folder in ("addon", "blend_fixtures", "tests/window"):
        target = work / "sources" / Path(folder).name
        shutil.copytree(ROOT / folder, target, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy2(archive, work / "oncue.zip")

    here = Desktop(root)
    inside = "/tmp/oncue-window"
    install = ["--command", "extension", "install-file", "-r", "user_default", "--enable", f"{inside}/oncue.zip"]
    here.do("blender", *install)
    script = f"{inside}/sources/window/in_blender.py"
    made = ["--", "make", "demo_room", f"{inside}/scene.blend"]
    here.do("blender", "-b", "--python-exit-code", "1", "-P", script, *made)
    try:
        here.start("Xvfb", DISPLAY, "-screen", "0", f"{WIDTH}x{HEIGHT}x24", "+extension", "GLX", "-noreset")
        time.sleep(2)
        here.start("openbox")
        geometry = ["--window-geometry", "0", "0", str(WIDTH), str(HEIGHT)]
        here.start("blender", *geometry, f"{inside}/scene.blend", "-P", script)
        here.until("the sidebar", lambda s: s["tab"] == "Oncue", timeout=180)
        time.sleep(2)
        yield here
    finally:
        here.stop()


@pytest.fixture(autouse=True)
def at_rest(desktop):
    """A test that failed leaves no run behind for the next."""
    yield
    if desktop.states()[-1]["at_work"]:
        pressed = desktop.key("Escape")
        desktop.until("rest", lambda s: not s["at_work"], timeout=20, since=pressed)


def test_the_button_with_the_mouse(desktop):
    desktop.screenshot("window-ready")
    before = desktop.states()[-1]
    assert before["actions"] == []

    # One run to its end, with progress on the way.
    desktop.click(*desktop.button())
    began = desktop.until("the run", lambda s: s["at_work"])
    desktop.until("progress", lambda s: s["at_work"] and s["stage"] == "Optimizing" and s["fraction"] > 0.0)
    desktop.screenshot("window-progress")
    done = desktop.until("the result", lambda s: not s["at_work"] and s["actions"], timeout=600, since=began["time"])
    assert done["message"] == ""
    assert done["objects"] == before["objects"] + 2
    assert done["frame_end"] > before["frame_end"]
    working = [s for s in desktop.states() if s["at_work"]]
    assert len({s["stage"] for s in working}) >= 3
    print(f"longest gap between two ticks of the window while it ran: {max(s['gap'] for s in working):.2f} s")

    # It is one undo step.
    pressed = desktop.key("ctrl+z")
    undone = desktop.until("the undo", lambda s: not s["actions"], timeout=20, since=pressed)
    assert undone["objects"] == before["objects"]
    pressed = desktop.key("ctrl+shift+z")
    desktop.until("the redo", lambda s: s["actions"] == done["actions"], timeout=20, since=pressed)
    desktop.key("shift+Right")  # to the last frame
    time.sleep(3)
    desktop.screenshot("window-result")


def test_without_the_window_the_keys_are_the_same(desktop):
    """`blender -b` with batch.py as the README has it, against what the button has just made."""
    pressed = [s["keys"] for s in desktop.states() if s["keys"]]
    assert pressed, "the button's run comes first"
    inside = "/tmp/oncue-window"
    # Both from where the button's run began.
    desktop.forget_policies()
    batch = ["--python-exit-code", "1", "-P", f"{inside}/sources/addon/batch.py", "--"]
    written = ["--out", f"{inside}/batch/out.blend", "--report", f"{inside}/batch/out.json", "--seed", "1"]
    said = desktop.do("blender", "-b", f"{inside}/scene.blend", *batch, *written, timeout=600)
    assert "Optimizing" in said
    report = json.loads((desktop.root / "tmp/oncue-window/batch/out.json").read_text())
    assert report["success"] is True
    script = f"{inside}/sources/window/in_blender.py"
    said = desktop.do("blender", "-b", f"{inside}/batch/out.blend", "-P", script, "--", "keys")
    assert f"keys {pressed[0]}" in said.splitlines()


def test_without_the_window_a_failure_has_a_status(desktop):
    inside = "/tmp/oncue-window"
    batch = ["--python-exit-code", "1", "-P", f"{inside}/sources/addon/batch.py", "--"]
    out = f"{inside}/oncue.zip/out.blend"  # in a folder that is a file
    command = desktop.command("blender", "-b", f"{inside}/scene.blend", *batch, "--out", out)
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 1
    assert f"Oncue: {out} cannot be written" in done.stderr
    assert "Traceback" not in done.stderr


def unchanged(before: dict, after: dict) -> bool:
    return all(after[what] == before[what] for what in ("actions", "objects", "frame_end"))


def test_escape_cancels_and_leaves_the_file_as_it_was(desktop):
    before = desktop.start_a_run(ENDLESS)
    escaped = desktop.key("Escape")
    stopped = desktop.until("the cancel", lambda s: not s["at_work"], timeout=20, since=escaped)
    presses = [json.loads(line) for line in desktop.state.with_name("presses.jsonl").read_text().splitlines()]
    press = next(p for p in presses if p["key"] == "ESC" and p["time"] > escaped)
    # The very event ended it, and nothing was waited for.
    assert not press["at_work"]
    assert press["took"] < ANSWERS_WITHIN
    late = press["time"] + press["took"] - escaped
    print(f"the run was over {late:.3f} s after Esc, of which the operator took {press['took'] * 1e3:.1f} ms")
    assert late < ESCAPES_WITHIN
    assert "as it was" in stopped["message"]
    assert unchanged(before, stopped)
    time.sleep(1)
    desktop.screenshot("window-cancelled")


def test_an_undo_stops_the_run_and_undoes(desktop):
    before = desktop.start_a_run(ENDLESS)
    assert before["actions"], "the button's run comes first"
    assert before["frame"] > 1, "the last step was the jump to the last frame"
    pressed = desktop.key("ctrl+z")
    undone = desktop.until("the undo", lambda s: not s["at_work"] and s["frame"] == 1, timeout=20, since=pressed)
    assert "undo" in undone["message"]
    assert unchanged(before, undone)
    pressed = desktop.key("ctrl+z")
    desktop.until("the undo of the first run", lambda s: not s["actions"], timeout=20, since=pressed)
    pressed = desktop.key("ctrl+shift+z")
    desktop.until("the redo", lambda s: s["actions"] == before["actions"], timeout=20, since=pressed)


def test_saving_does_not_disturb_the_run(desktop):
    desktop.start_a_run(LONG)
    pressed = desktop.key("ctrl+s")
    desktop.until("the saved file", lambda s: s["file"], timeout=20, since=pressed)
    assert desktop.states()[-1]["at_work"]
    before = len(desktop.states()[-1]["actions"])
    desktop.until("the result", lambda s: not s["at_work"] and len(s["actions"]) > before, timeout=600, since=pressed)


def test_opening_a_file_stops_the_run(desktop):
    before = desktop.start_a_run(ENDLESS)
    pressed = time.time()
    desktop.write("bpy.ops.wm.revert_mainfile()")
    opened = desktop.until("the end of the run", lambda s: s["enabled"] and not s["at_work"], since=pressed)
    assert "another file" in opened["message"]
    assert opened["file"]
    # As it was saved: without the run that came after it.
    assert len(opened["actions"]) == len(before["actions"]) - 1
    time.sleep(2)
    assert unchanged(opened, desktop.states()[-1])


def test_a_motion_that_could_not_be_written_is_written_by_its_button(desktop):
    below = desktop.below()
    before = desktop.start_a_run(LONG)
    began = time.time()
    # A rate at which no motion can be shown, set while it is at work.
    desktop.write("C.scene.render.fps=1")
    assert desktop.states()[-1]["at_work"]
    kept = desktop.until("the refusal", lambda s: not s["at_work"], timeout=600, since=began)
    assert "at 1 frames a second" in kept["message"]
    assert "the motion is kept: press Write Motion" in kept["message"]
    assert unchanged(before, kept)
    assert kept["unwritten"]
    # What is refused also stands in a window of its own over the sidebar, which takes the next key.
    desktop.key("Escape")
    time.sleep(1)
    desktop.screenshot("window-kept")
    # What is said has pushed nothing from its place.
    assert below
    assert below <= desktop.below()
    desktop.write("C.scene.render.fps=24")
    time.sleep(1)
    pressed = time.time()
    desktop.click(*desktop.message_button())
    written = desktop.until("the motion", lambda s: len(s["actions"]) > len(before["actions"]), since=pressed)
    assert written["message"] == ""
    assert not written["at_work"]
    assert written["keys"] not in ("", before["keys"])
    # It is one undo step, and the button has gone with what it was for.
    time.sleep(1)
    desktop.screenshot("window-written")
    assert not desktop.states()[-1]["unwritten"]
    pressed = desktop.key("ctrl+z")
    desktop.until("the undo", lambda s: s["actions"] == before["actions"], timeout=20, since=pressed)
    pressed = desktop.key("ctrl+shift+z")
    desktop.until("the redo", lambda s: s["actions"] == written["actions"], timeout=20, since=pressed)


def test_disabling_the_extension_stops_the_run(desktop):
    desktop.start_a_run(ENDLESS)
    pressed = time.time()
    desktop.write("bpy.ops.preferences.addon_disable(module='bl_ext.user_default.oncue')")
    desktop.until("the disabling", lambda s: not s["enabled"], timeout=30, since=pressed)
    time.sleep(2)
    desktop.screenshot("window-disabled")
    pressed = time.time()
    desktop.write("bpy.ops.preferences.addon_enable(module='bl_ext.user_default.oncue')")
    enabled = desktop.until("the enabling", lambda s: s["enabled"], timeout=30, since=pressed)
    assert enabled["actions"]
    assert not enabled["at_work"]


def follow(desktop) -> dict:
    """Presses Follow Cues with the start cue selected; the state then."""
    select = "[o.select_set(o.name=='Start') for o in C.view_layer.objects]"
    desktop.write(f"C.scene.oncue.overrides=''; {select}")
    time.sleep(1)
    pressed = time.time()
    desktop.click(*desktop.follow_button())
    return desktop.until("the following", lambda s: s["following"], timeout=30, since=pressed)


def drag(desktop, pixels: int) -> float:
    """Drags the selection over the floor, without letting go of it; when it began."""
    began = desktop.key("g")
    desktop.do("xdotool", "key", "shift+z")
    # Without a graphics card a picture alone takes some tenths of a second.
    for step in range(1, 11):
        x = WIDTH // 3 + pixels * step // 10
        desktop.do("xdotool", "mousemove", str(x), str(HEIGHT // 2), "sleep", "0.6")
    return began


def test_the_motion_follows_a_cue_that_is_dragged(desktop):
    before = follow(desktop)
    assert before["keys"], "the button's run comes first"
    began = drag(desktop, 90)
    # Blender's own operator has the mouse, and the keys change all the same.
    dragging = [s for s in desktop.states() if s["time"] > began and s["dragged"]]
    assert len({tuple(s["start"]) for s in dragging}) > 3
    assert len({s["keys"] for s in dragging} - {before["keys"]}) > 1
    assert dragging[-1]["actions"] == before["actions"]
    desktop.screenshot("window-following")
    let_go = time.time()
    desktop.do("xdotool", "click", "1")
    rested = desktop.until("the rest", lambda s: s["following"] and s["said"][0] == "Met", since=let_go)
    assert rested["keys"] not in {s["keys"] for s in dragging}
    time.sleep(1)
    desktop.screenshot("window-followed")
    times = [s["said"][0] for s in dragging if s["said"][0].endswith(" ms")]
    print(f"{len({s['keys'] for s in dragging})} motions in one drag; {times[-1]}")

    # The drag is one undo step, which ends the following.
    pressed = desktop.key("ctrl+z")
    undone = desktop.until("the undo", lambda s: not s["following"], timeout=20, since=pressed)
    assert undone["start"] == before["start"]
    assert "undo" in undone["said"][0]
    assert undone["actions"] == before["actions"]


def test_a_drag_that_is_called_off_is_followed_back(desktop):
    before = follow(desktop)
    began = drag(desktop, 60)
    dragging = [s for s in desktop.states() if s["time"] > began and s["dragged"]]
    assert len({s["keys"] for s in dragging} - {before["keys"]}) > 1
    escaped = time.time()
    desktop.do("xdotool", "key", "Escape")
    back = desktop.until("the end", lambda s: not s["dragged"] and s["said"][0] == "Met", since=escaped)
    assert back["start"] == before["start"]
    assert back["following"]
    # Nothing of it was an undo step: the step before is Follow Cues itself.
    pressed = desktop.key("ctrl+z")
    undone = desktop.until("the undo", lambda s: not s["following"], timeout=20, since=pressed)
    assert len(undone["actions"]) <= len(before["actions"])
    # The program still stands, and plays.
    desktop.key("shift+Right")
    time.sleep(2)
    desktop.until("a frame", lambda s: s["frame"] > 1, timeout=20, since=pressed)
    desktop.key("shift+Left")


def test_cues_and_pins_of_every_kind_are_drawn(desktop):
    pressed = time.time()
    objects = desktop.states()[-1]["objects"]
    place = "bpy.ops.oncue.place_{}='{}')"
    desktop.write(
        "; ".join(
            [
                *(place.format("foot(side", side) for side in ("left", "right")),
                "C.scene.cursor.location=(2.3,2.6,0.8)",
                *(place.format("hand(kind", kind) for kind in ("left_hand", "both_hands")),
                "C.view_layer.objects.active=C.scene.oncue.character",
                "bpy.ops.object.mode_set(mode='POSE')",
                "bpy.ops.pose.select_all(action='SELECT')",
                "bpy.ops.oncue.pin(first_frame=100,last_frame=120)",
            ]
        )
    )
    desktop.until("the cues", lambda s: s["objects"] == objects + 4, timeout=30, since=pressed)
    time.sleep(1)
    desktop.screenshot("window-cues")


def test_nothing_was_said_that_should_not_be(desktop):
    """Panels and overlays draw in every state above; what goes wrong in there only shows in the program's words."""
    said = (PICTURES / "blender.log").read_text()
    assert "Traceback" not in said, said[-3000:]
