"""Follow Cues: what is run when, and the live take, driven tick by tick as the timer drives them in the window."""

import time
import types

import bpy
import numpy as np
import pytest

from .runs import current_action, keys_of
from .shapes import add_cube

#: Generous: machines are loaded. The figures themselves are printed.
LIMIT = 60.0


# --- what is run when, with a clock and runs of the test's own --------------------------------------------------------


class Clock:
    now = 100.0

    def __call__(self):
        return self.now


class Job:
    """A job of the core that is done when the test says so."""

    def __init__(self, log, name):
        self.name, self.finished, self.cancelled = name, False, False
        log.append(self)

    def done(self):
        return self.finished or self.cancelled

    def wait(self, _timeout_s):
        return self.done()

    def cancel(self):
        self.cancelled = True


class FakeHost:
    """A file with one number for a task and one for a scene."""

    def __init__(self, pipeline, errors):
        self.make = lambda task, scene: pipeline.Request(
            np.full((3, 3), scene, np.float32), np.zeros((1, 3), np.uint32), {"x": task}
        )
        self.refusal = errors.SceneError("There is no Start cue.")
        self.task, self.scene, self.shown, self.refuses, self.written = 0, 0, 0, False, []

    def read_scene(self):
        return self.make(self.task, self.scene)

    def read_task(self, request):
        if self.refuses:
            raise self.refusal
        return self.make(self.task, request.positions[0, 0])

    def shows(self, request):
        return request.task == {"x": self.shown}

    def write(self, request, _outcome, at_rest):
        self.written.append((request.task["x"], at_rest))


@pytest.fixture
def logic(oncue, monkeypatch):
    """A follower with a scene that is indexed, and everything around it."""
    live, jobs, clock = oncue("live"), [], Clock()
    report = {"policy_source": "prior", "success": True, "problems": [], "cues": [{"met": True}]}

    def world_steps(request, _cache, _policies, before):
        same = before is not None and np.array_equal(request.positions, before.request.positions)
        job = Job(jobs, "world")
        while not job.finished:
            yield job
        return live.World(request, "library", [], before.scene if same else object(), None)

    def play_steps(_world, request, overrides):
        job = Job(jobs, "rest" if overrides is live.AT_REST else "move")
        while not job.finished:
            yield job
        return types.SimpleNamespace(synthesis=types.SimpleNamespace(report=report), request=request)

    monkeypatch.setattr(live, "world_steps", world_steps)
    monkeypatch.setattr(live, "play_steps", play_steps)
    host = FakeHost(oncue("pipeline"), oncue("errors"))
    follower = live.Follower(host, None, None, clock)
    follower.tick()
    made = types.SimpleNamespace(follower=follower, host=host, jobs=jobs, clock=clock, report=report, live=live)

    def finish():
        """The job at work ends, and the follower looks."""
        jobs[-1].finished = True
        follower.tick()

    def move(task):
        host.task = task
        follower.cues_changed()
        follower.tick()

    def names():
        return [job.name for job in jobs]

    made.finish, made.move, made.names = finish, move, names
    finish()
    return made


def test_nothing_is_played_before_a_cue_moves(logic):
    for _ in range(20):
        logic.clock.now += 1.0
        logic.follower.tick()
    assert logic.names() == ["world"]
    assert logic.follower.idle
    assert logic.host.written == []


def test_a_motion_made_for_other_cues_is_played_at_once(oncue, logic):
    logic.host.shown = 7
    follower = logic.live.Follower(logic.host, None, None, logic.clock)
    follower.tick()
    logic.jobs[-1].finished = True
    follower.tick()
    assert logic.names() == ["world", "world", "move"]


def test_a_move_plays_the_latest_place_and_then_rests(logic):
    logic.move(1)
    for task in (2, 3, 4):  # while the first is played
        logic.move(task)
    assert logic.names() == ["world", "move"]
    logic.clock.now += 0.25
    logic.finish()
    assert logic.host.written == [(1, False)]
    assert logic.follower.delay == pytest.approx(0.25)
    logic.finish()
    assert logic.host.written == [(1, False), (4, False)]
    logic.follower.tick()
    assert logic.names() == ["world", "move", "move"]
    assert not logic.follower.rested
    logic.clock.now += logic.live.REST
    logic.follower.tick()
    assert logic.names()[3:] == ["rest"]
    logic.finish()
    assert logic.host.written[2:] == [(4, True)]
    assert logic.follower.rested
    assert logic.follower.idle


def test_a_touch_without_a_move_plays_nothing(logic):
    logic.follower.cues_changed()
    logic.follower.tick()
    assert logic.names() == ["world"]
    assert logic.follower.idle


def test_a_move_cuts_the_run_at_rest_short(logic):
    logic.move(1)
    logic.finish()
    logic.clock.now += 1.0
    logic.follower.tick()
    logic.move(2)
    assert logic.names() == ["world", "move", "rest", "move"]
    assert logic.jobs[2].cancelled
    assert not logic.jobs[1].cancelled
    logic.finish()
    assert logic.host.written == [(1, False), (2, False)]


def test_a_touch_only_delays_the_run_at_rest(logic):
    logic.move(1)
    logic.finish()
    logic.clock.now += 1.0
    logic.follower.tick()
    logic.follower.cues_changed()
    logic.follower.tick()
    assert logic.jobs[2].cancelled
    logic.clock.now += 1.0
    logic.follower.tick()
    assert logic.names() == ["world", "move", "rest", "rest"]


def test_a_missed_cue_is_offered_a_full_run_once_it_rests(logic):
    missed = "Cue 'Sit' was missed by 30 cm and 5°."
    logic.report.update(success=False, problems=[missed], cues=[{"met": False}])
    logic.move(1)
    logic.finish()
    assert logic.follower.line == ""
    logic.clock.now += 1.0
    logic.follower.tick()
    logic.finish()
    assert logic.follower.line == f"Not met here: press Synthesize. {missed}"
    # What else is wrong with a motion that meets its cue is told as it is.
    touch = "The left hand is 4 cm deep in the pelvis (frames 20 to 23)."
    for place, problems in ((2, [touch]), (3, [])):
        logic.report.update(success=not problems, problems=problems, cues=[{"met": True}])
        logic.move(place)
        logic.finish()
        logic.clock.now += 1.0
        logic.follower.tick()
        logic.finish()
        assert logic.follower.line == "".join(problems)


def test_nothing_is_written_of_a_policy_from_scratch(logic):
    logic.report["policy_source"] = "scratch"
    logic.move(1)
    logic.finish()
    assert logic.host.written == []
    assert "press Synthesize once" in logic.follower.line
    logic.clock.now += 1.0
    logic.follower.tick()
    assert logic.follower.idle


def test_what_cannot_be_read_is_a_line_and_following_goes_on(logic):
    logic.host.refuses = True
    logic.move(1)
    assert logic.follower.line == "There is no Start cue."
    assert logic.follower.idle
    logic.host.refuses = False
    logic.move(2)
    logic.finish()
    assert logic.host.written == [(2, False)]
    assert logic.follower.line == ""


def test_a_scene_is_read_again_once_it_rests(logic):
    for k in range(3):
        logic.host.scene = k
        logic.follower.meshes_changed()
        logic.follower.tick()
        logic.clock.now += 0.1
    assert logic.names() == ["world"]
    logic.move(1)  # in the scene as it was
    logic.finish()
    logic.clock.now += 1.0
    logic.follower.tick()
    logic.finish()
    assert logic.names() == ["world", "move", "world", "move"]
    logic.finish()
    assert logic.host.written == [(1, False), (1, False)]


def test_the_same_scene_plays_nothing_again(logic):
    logic.follower.meshes_changed()
    logic.clock.now += 1.0
    logic.follower.tick()
    logic.finish()
    assert logic.names() == ["world", "world"]
    assert logic.follower.idle


def test_a_full_run_answers_what_was_asked(logic):
    logic.move(1)
    logic.follower.yield_to_full_run()
    assert logic.jobs[1].cancelled
    logic.follower.tick()
    logic.finish()  # the policy is looked for again
    logic.clock.now += 1.0
    logic.follower.tick()
    assert logic.names() == ["world", "move", "world"]
    assert logic.host.written == []
    logic.move(2)
    logic.finish()
    assert logic.host.written == [(2, False)]


def test_stopping_cancels(logic):
    logic.move(1)
    logic.follower.stop()
    assert logic.jobs[1].cancelled


# --- in a file --------------------------------------------------------------------------------------------------------


@pytest.fixture
def following(oncue):
    one = oncue("operators.follow").following
    yield one
    one.stop("", keep=False, wait_s=10.0)
    one.held = False


class Drag:
    """A task with its take, followed; cues that are dragged as the artist does."""

    def __init__(self, oncue, following):
        self.oncue, self.following = oncue, following
        assert bpy.ops.oncue.synthesize() == {"FINISHED"}
        self.take = current_action()
        self.taken = keys_of(oncue, self.take)
        self.times = []
        following.start(bpy.context)

    @property
    def follower(self):
        return self.following.follower

    @property
    def live(self):
        return next(a for a in bpy.data.actions if "oncue_live" in a)

    def until(self, what, test):
        deadline = time.monotonic() + LIMIT
        while time.monotonic() < deadline:
            wait = self.following.tick()
            if test():
                return
            assert wait is not None, f"following ended: {self.following.message}"
            time.sleep(wait)
        raise AssertionError(f"{what} did not come: {self.follower.line}")

    def rest(self):
        """Until nothing is left to do, with time for what is not seen yet."""
        for _ in range(2):
            self.until("the rest", lambda: self.follower.idle)
            time.sleep(0.05)

    def move(self, name, **by):
        """Moves a cue and waits until the motion has followed."""
        cue, before = bpy.data.objects[name], keys_of(self.oncue, self.live)
        for axis, way in by.items():
            setattr(cue.location, axis, getattr(cue.location, axis) + way)
        bpy.context.view_layer.update()
        began = time.perf_counter()
        self.until("the motion", lambda: keys_of(self.oncue, self.live) != before)
        self.times.append(time.perf_counter() - began)

    def hips(self, frame):
        scene = bpy.context.scene
        scene.frame_set(frame)
        posed = scene.oncue.character.evaluated_get(bpy.context.evaluated_depsgraph_get())
        return posed.matrix_world @ posed.pose.bones["Hips"].head

    def misses(self):
        """Horizontal distance of the pelvis from the start in the first frame, and from the end cue in the last."""
        first, last = (int(frame) for frame in current_action().frame_range)
        ends = ((first, "Start"), (last, "Sit" if "Sit" in bpy.data.objects else "Stop"))
        return [(self.hips(frame) - bpy.data.objects[cue].location).to_2d().length for frame, cue in ends]


@pytest.fixture
def drag(fixtures, oncue, core, following):
    fixtures.stop_by_table()
    return Drag(oncue, following)


@pytest.fixture
def seated_drag(fixtures, oncue, core, following):
    fixtures.demo_room()
    return Drag(oncue, following)


def test_the_motion_follows_a_dragged_cue(seated_drag, oncue):
    drag = seated_drag
    drag.rest()
    assert current_action() == drag.live
    assert keys_of(oncue, drag.live) == drag.taken, "nothing moved yet"
    for step in (-0.05, -0.10, -0.15, -0.10):
        drag.move("Sit", x=step)
        assert max(drag.misses()) < 0.12
    for step in (0.10, 0.10):
        drag.move("Start", x=step)
        assert max(drag.misses()) < 0.12
    print(f"from the cue's move to the written keys: {', '.join(f'{1000 * t:.0f}' for t in drag.times)} ms")
    assert [a.name for a in bpy.data.actions] == ["Sit on Sofa live", drag.take.name]
    assert keys_of(oncue, drag.take) == drag.taken
    assert drag.take.use_fake_user


def test_at_rest_it_is_the_motion_of_synthesize(drag, oncue):
    drag.move("Stop", x=-0.2)
    moving = keys_of(oncue, drag.live)
    drag.rest()
    assert drag.follower.rested
    assert oncue("panels").following_line(bpy.context) == ("Met", "CHECKMARK")
    at_rest = keys_of(oncue, drag.live)
    report = oncue("bridge.session").report_of(drag.live)
    assert report["cues"][0]["met"]
    assert report["updates"] == 0
    drag.following.stop("")
    # What is followed has a key on every frame, and so has this to be compared with it.
    bpy.context.scene.oncue.every_frame = True
    bpy.ops.oncue.synthesize()
    assert keys_of(oncue, current_action()) == at_rest != moving
    # Else Synthesize writes few, as ever.
    bpy.context.scene.oncue.every_frame = False
    bpy.ops.oncue.synthesize()
    count = {action: sum(map(len, keys_of(oncue, action).values())) for action in (current_action(), drag.live)}
    assert count[current_action()] < 0.15 * count[drag.live]


def test_hands_are_left_to_synthesize(drag, oncue, fixtures):
    """Their ways are read by going through the frames, which would let go of what is dragged."""
    hand = fixtures.make_cue(bpy.context, "left_hand", (0.3, 0.5, 1.0), 0.0)
    hand["oncue_first_frame"], hand["oncue_last_frame"] = 60, 70
    frames, note = [], lambda *_: frames.append(0)
    bpy.app.handlers.frame_change_pre.append(note)
    try:
        drag.move("Stop", x=-0.1)
        drag.rest()
    finally:
        bpy.app.handlers.frame_change_pre.remove(note)
    assert frames == []
    assert oncue("panels").following_line(bpy.context)[0] == "Met but for the hands: press Synthesize"


def test_the_live_take_can_be_solved_again_at_rest_and_after_the_end(drag, oncue):
    take, solved, errors = oncue("bridge.take"), oncue("bridge.solved"), oncue("errors")
    drag.move("Stop", x=-0.1)
    with pytest.raises(errors.SceneError):
        solved.solved_of(drag.live)
    drag.rest()
    skeleton = oncue("native").core.skeleton()
    character = bpy.context.scene.oncue.character
    assert take.Take(bpy.context.scene, character, drag.live, skeleton).artist_keys() == {}
    drag.move("Stop", x=-0.1)
    drag.following.stop("")
    assert take.Take(bpy.context.scene, character, drag.live, skeleton).artist_keys() == {}


def test_it_goes_on_with_its_take_until_the_artist_keys_it(drag, oncue, context):
    drag.move("Stop", x=-0.1)
    drag.following.stop("")
    drag.following.start(bpy.context)
    drag.move("Stop", x=0.1)
    assert len(bpy.data.actions) == 2
    drag.following.stop("")

    live = drag.live
    curve = oncue("bridge.compat").action_curves(live)[0]
    curve.keyframe_points[20].co.y += 0.1
    edited = keys_of(oncue, live)
    drag.following.start(bpy.context)
    assert len(bpy.data.actions) == 3
    assert current_action() != live
    bpy.data.objects["Stop"].location.x -= 0.1
    bpy.context.view_layer.update()
    drag.rest()
    assert keys_of(oncue, live) == edited
    assert keys_of(oncue, current_action()) != edited


def test_a_key_of_the_artist_ends_the_following(drag, oncue):
    drag.move("Stop", x=-0.1)
    oncue("bridge.compat").action_curves(drag.live)[5].keyframe_points[3].co.y += 0.2
    keyed = keys_of(oncue, drag.live)
    bpy.data.objects["Stop"].location.x += 0.2
    bpy.context.view_layer.update()
    deadline = time.monotonic() + LIMIT
    while drag.following.on and time.monotonic() < deadline:
        drag.following.tick()
        time.sleep(0.005)
    assert drag.following.message == "The keys of Stop live were changed: it is a take of your own now."
    assert drag.following.tick() is None
    assert keys_of(oncue, drag.live) == keyed


def test_a_take_that_would_play_otherwise_is_followed_in_a_clean_copy(drag, oncue):
    """Muted, locked and modified curves and keyed scales are the artist's in the take, and not in the live one."""
    drag.following.stop("")
    character, curves = bpy.context.scene.oncue.character, oncue("bridge.compat").action_curves
    oncue("bridge.compat").replace_action(character, drag.take)
    muted, locked, modified = curves(drag.take)[5:8]
    muted.mute = locked.lock = True
    modified.modifiers.new("NOISE")
    character.pose.bones["Head"].scale = (2, 2, 2)
    character.pose.bones["Head"].keyframe_insert("scale", frame=1)
    count = len(curves(drag.take))
    drag.following.start(bpy.context)
    live = current_action()
    assert live != drag.take
    assert len(curves(live, character)) == 91
    assert not any(curve.mute or curve.lock or len(curve.modifiers) for curve in curves(live))
    assert (len(curves(drag.take)), muted.mute, locked.lock, len(modified.modifiers)) == (count, True, True, 1)
    bpy.data.objects["Stop"].location.x += 0.1
    bpy.context.view_layer.update()
    drag.rest()
    assert max(drag.misses()) < 0.2
    assert tuple(character.pose.bones["Head"].scale) == (1.0, 1.0, 1.0)


def test_what_the_person_carries_is_no_news(drag):
    """Its skin and props move with every motion that is written."""
    cup = add_cube("Cup", size=0.1)
    cup.parent, cup.parent_type, cup.parent_bone = bpy.context.scene.oncue.character, "BONE", "RightHand"
    drag.rest()
    cup.location.x += 0.1
    bpy.context.view_layer.update()
    assert drag.follower._meshes_at is None
    cup.parent = None
    bpy.context.view_layer.update()
    assert drag.follower._meshes_at is not None


def test_a_character_that_is_bent_meanwhile_is_a_line(drag, oncue):
    drag.rest()
    before = keys_of(oncue, drag.live)
    bpy.context.scene.oncue.character.scale = (0.7, 0.7, 0.7)
    bpy.data.objects["Stop"].location.x += 0.1
    bpy.context.view_layer.update()
    drag.until("the line", lambda: "scaled to 0.7" in drag.follower.line)
    assert keys_of(oncue, drag.live) == before


def test_why_it_ended_is_said_until_something_changes(drag):
    drag.following.stop("Following ended with the undo: press Follow Cues to go on.")
    bpy.context.view_layer.update()
    stop = bpy.data.objects["Stop"]
    assert drag.following.message
    for _ in range(2):
        stop.location.x += 0.1
        bpy.context.view_layer.update()
    assert drag.following.message == ""


@pytest.mark.parametrize("gone", ["action", "character"])
def test_what_is_deleted_ends_the_following(drag, gone):
    if gone == "action":
        bpy.data.actions.remove(drag.live)
    else:
        bpy.data.objects.remove(bpy.context.scene.oncue.character)
    bpy.data.objects["Stop"].location.x -= 0.2
    bpy.context.view_layer.update()
    deadline = time.monotonic() + LIMIT
    while drag.following.on and time.monotonic() < deadline:
        drag.following.tick()
        time.sleep(0.005)
    assert ("deleted" if gone == "action" else "gone") in drag.following.message


def test_a_cue_in_the_table_is_a_line(drag, oncue):
    drag.rest()
    before = keys_of(oncue, drag.live)
    bpy.data.objects["Stop"].location.y += 0.75
    bpy.context.view_layer.update()
    drag.until("the line", lambda: drag.follower.line)
    assert "Stop" in drag.follower.line
    assert oncue("panels").following_line(bpy.context) == (drag.follower.line, "ERROR")
    drag.rest()
    assert keys_of(oncue, drag.live) == before
    drag.move("Stop", y=-0.85)
    assert drag.follower.line == ""


def test_two_starts_are_a_line(drag, fixtures):
    drag.rest()
    extra = fixtures.start(1.0, -2.0, 0)
    drag.until("the line", lambda: "2 Start cues" in drag.follower.line)
    bpy.data.objects.remove(extra)
    drag.move("Start", x=0.2)
    assert drag.follower.line == ""


def test_the_scene_is_indexed_again_only_when_it_changed(drag, oncue, core, monkeypatch):
    drag.rest()
    indexed, real = [], core.index_scene
    monkeypatch.setattr(core, "index_scene", lambda *given: indexed.append(0) or real(*given))
    drag.move("Stop", x=-0.2)
    drag.rest()
    assert indexed == []
    before = keys_of(oncue, drag.live)
    bpy.data.objects["Table"].location.y += 0.4
    bpy.context.view_layer.update()
    drag.until("the new scene", lambda: indexed)
    drag.rest()
    assert len(indexed) == 1
    assert drag.follower.rested
    # The table's old place is free now.
    drag.move("Stop", y=0.25)
    assert drag.follower.line == ""
    assert keys_of(oncue, drag.live) != before
    # Hidden is gone, as for Synthesize.
    bpy.data.objects["Table"].hide_viewport = True
    bpy.context.view_layer.update()
    drag.until("the scene without the table", lambda: len(indexed) == 2)


def test_what_the_character_carries_does_not_set_it_off_again(drag, monkeypatch):
    character = bpy.context.scene.oncue.character
    bag = add_cube("Bag", size=0.2)
    bag.parent, bag.parent_type, bag.parent_bone = character, "BONE", "LeftHand"
    bpy.context.view_layer.update()
    drag.rest()
    written, real = [], drag.following.write
    monkeypatch.setattr(drag.following, "write", lambda *given: written.append(given[2]) or real(*given))
    drag.move("Start", x=0.1)
    drag.rest()
    for _ in range(150):
        drag.following.tick()
        time.sleep(0.01)
    assert written == [False, True]


@pytest.mark.parametrize(("begins", "ends"), [("render_init", "render_complete"), ("save_pre", "save_post")])
def test_nothing_is_written_while_it_renders_or_saves(drag, oncue, begins, ends):
    def happens(event):
        for function in list(getattr(bpy.app.handlers, event)):
            function(bpy.context.scene)

    drag.rest()
    before = keys_of(oncue, drag.live)
    happens(begins)
    bpy.data.objects["Stop"].location.x -= 0.2
    bpy.context.view_layer.update()
    for _ in range(100):
        drag.following.tick()
        time.sleep(0.01)
    assert keys_of(oncue, drag.live) == before
    happens(ends)
    drag.until("the motion", lambda: keys_of(oncue, drag.live) != before)


def test_saving_does_not_end_it(drag, tmp_path):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "meanwhile.blend"), copy=True)
    drag.move("Stop", x=-0.1)


@pytest.mark.parametrize("event", ["undo_pre", "redo_pre"])
def test_an_undo_ends_it(drag, event):
    bpy.data.objects["Stop"].location.x -= 0.1
    bpy.context.view_layer.update()
    drag.following.tick()
    for function in list(getattr(bpy.app.handlers, event)):
        function(bpy.context.scene)
    assert not drag.following.on
    assert "undo" in drag.following.message
    assert drag.following.tick() is None


def test_another_file_ends_it(drag):
    bpy.data.objects["Stop"].location.x -= 0.1
    bpy.context.view_layer.update()
    drag.following.tick()
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    assert not drag.following.on
    assert drag.following.tick() is None


def test_the_handlers_survive_another_file_and_go_with_the_extension(drag, oncue):
    ours = oncue("operators.follow").HANDLERS
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    assert all(function in getattr(bpy.app.handlers, name) for name, function in ours)
    oncue.package.unregister()
    try:
        assert not any(function in getattr(bpy.app.handlers, name) for name, function in ours)
    finally:
        oncue.package.register()


def test_disabling_the_extension_ends_it(drag, oncue):
    drag.rest()
    oncue.package.unregister()
    try:
        assert not drag.following.on
    finally:
        oncue.package.register()


def test_a_full_run_goes_first_and_following_goes_on(drag, oncue):
    drag.move("Stop", x=-0.1)
    live = keys_of(oncue, drag.live)
    handle = oncue("job_operator").handle
    handle.run = object()  # a run at work in the window
    try:
        drag.following.tick()
        assert drag.follower.idle or drag.follower._run is None
    finally:
        handle.run = None
    bpy.ops.oncue.synthesize()
    second = current_action()
    kept = keys_of(oncue, second)
    drag.rest()
    assert current_action() == second, "the new take is shown"
    assert keys_of(oncue, drag.live) == live
    drag.move("Stop", x=-0.1)
    assert current_action() == drag.live
    assert keys_of(oncue, second) == kept
    assert second.use_fake_user
    assert len(bpy.data.actions) == 3


def test_another_scene_is_left_alone(drag, oncue):
    drag.rest()
    before = keys_of(oncue, drag.live)
    first = bpy.context.scene
    bpy.context.window.scene = bpy.data.scenes.new("Other")
    bpy.data.objects["Stop"].location.x -= 0.2
    first.view_layers[0].update()
    for _ in range(100):
        drag.following.tick()
        time.sleep(0.005)
    assert keys_of(oncue, drag.live) == before
    bpy.context.window.scene = first
    drag.until("the motion", lambda: keys_of(oncue, drag.live) != before)


def test_without_a_take_there_is_nothing_to_follow_with(fixtures, oncue, following):
    fixtures.stop_by_table()
    with pytest.raises(oncue("errors").SceneError, match="press Synthesize first"):
        following.start(bpy.context)
    assert not following.on


def test_in_the_background_the_button_says_that_it_needs_the_window(drag):
    assert bpy.app.background
    with pytest.raises(RuntimeError, match="needs Blender's window"):
        bpy.ops.oncue.follow_cues()
