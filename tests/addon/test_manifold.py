"""A manifold of the artist's own: trained from the panel, chosen by the scene, and used by everything that edits."""

import json
import math
import time

import bpy
import numpy as np
import pytest

from ..core.bvh import stepping
from .runs import QUICK, current_action, forget_policies, keys_of, set_quick
from .test_batch import batch, failed


@pytest.fixture(scope="module")
def captures(tmp_path_factory):
    """A folder of five short walks, as an artist would have them."""
    folder = tmp_path_factory.mktemp("captures")
    for number in range(5):
        (folder / f"walk {number}.bvh").write_text(stepping(speed=0.6 + 0.2 * number))
    return folder


@pytest.fixture(scope="module")
def own(captures, tmp_path_factory, oncue):
    """The file of a manifold that one pass has made."""
    pipeline = oncue("pipeline")
    path = tmp_path_factory.mktemp("manifold") / "own.oncueman"
    choice = pipeline.LibraryChoice((str(captures),), "none")
    pipeline.run_blocking(pipeline.manifold_steps(choice, pipeline.LibraryCache(), 1, str(path)))
    return path


def list_captures(scene, folder, passes=1):
    scene.oncue.library_paths.add().path = str(folder)
    scene.oncue.starter = "NONE"
    scene.oncue.manifold_passes = passes


def test_the_button_trains_and_chooses_the_file(context, oncue, core, captures, tmp_path):
    scene = context.scene
    list_captures(scene, captures)
    assert bpy.ops.oncue.train_manifold(filepath=str(tmp_path / "mine")) == {"FINISHED"}
    path = tmp_path / "mine.oncueman"
    assert scene.oncue.manifold == str(path)
    figures = core.Manifold.read(path).figures
    assert figures["settings"]["epochs"] == 1
    assert figures["test_mocap"]["windows"] > 0
    # The checkpoint of a training that is done is of no more use.
    assert list(tmp_path.iterdir()) == [path]
    assert oncue("bridge.session").manifold_path(scene) == str(path)


def test_a_stopped_training_goes_on_after_its_last_pass(oncue, core, captures, tmp_path):
    pipeline = oncue("pipeline")
    choice, cache = pipeline.LibraryChoice((str(captures),), "none"), pipeline.LibraryCache()
    path = tmp_path / "own.oncueman"
    checkpoint = pipeline.checkpoint_of(str(path))
    run = pipeline.Run(pipeline.manifold_steps(choice, cache, 4, str(path)))
    while not checkpoint.exists():
        assert not run.poll()
        time.sleep(0.002)
    run.cancel()
    assert run.wait(30)
    with pytest.raises(core.Cancelled):
        run.result()
    assert not path.exists()
    state = checkpoint.read_bytes()
    # Another number of passes is another training: said, and nothing is lost.
    with pytest.raises(core.DataFileError, match="another library, seed or settings"):
        pipeline.run_blocking(pipeline.manifold_steps(choice, cache, 2, str(path)))
    assert checkpoint.read_bytes() == state
    resumed = pipeline.run_blocking(pipeline.manifold_steps(choice, cache, 4, str(path)))
    assert not checkpoint.exists()
    whole = pipeline.run_blocking(pipeline.manifold_steps(choice, cache, 4, str(tmp_path / "whole.oncueman")))
    assert resumed.figures == whole.figures
    assert path.read_bytes() == (tmp_path / "whole.oncueman").read_bytes()


def test_escape_says_that_it_goes_on(oncue, captures, context, tmp_path):
    pipeline, job_operator = oncue("pipeline"), oncue("job_operator")
    operator, handle = oncue("operators.manifold").ONCUE_OT_train_manifold, job_operator.handle
    choice = pipeline.LibraryChoice((str(captures),), "none")
    run = pipeline.Run(pipeline.manifold_steps(choice, pipeline.LibraryCache(), 50, str(tmp_path / "own.oncueman")))
    run.poll()
    handle.run, handle.stopped_note = run, operator.stopped_note
    try:
        assert bpy.ops.oncue.cancel() == {"FINISHED"}
        assert "it goes on" in handle.message
        assert not handle.failed
        assert handle.stopped_note == job_operator.CANCELLED
    finally:
        handle.stop_and_wait("")


def test_training_needs_captures_and_a_place(context, captures, tmp_path):
    with pytest.raises(RuntimeError, match="Add your own motion capture"):
        bpy.ops.oncue.train_manifold(filepath=str(tmp_path / "own.oncueman"))
    list_captures(context.scene, captures)
    (tmp_path / "file").write_text("no folder")
    with pytest.raises(RuntimeError, match=r"cannot be written|exists"):
        bpy.ops.oncue.train_manifold(filepath=str(tmp_path / "file" / "own.oncueman"))
    assert context.scene.oncue.manifold == ""


@pytest.fixture
def stool(fixtures):
    fixtures.stool_alone()
    set_quick(bpy.context.scene)
    return bpy.context.scene


def synthesized(oncue):
    assert bpy.ops.oncue.synthesize() == {"FINISHED"}
    action = current_action()
    return keys_of(oncue, action), oncue("bridge.session").report_of(action)


def test_synthesis_and_resolve_go_along_the_chosen_manifold(stool, oncue, core, own):
    # A seat that the motion has to be fitted to; a key on every frame shows it as it is.
    bpy.data.objects["Sit"].location.z += 0.04
    stool.oncue.every_frame = True
    shipped, report = synthesized(oncue)
    assert report["edited"]["seat"] is not None
    assert report["extension"]["manifold"] == ""
    stool.oncue.manifold = str(own)
    along, report = synthesized(oncue)
    assert report["extension"]["manifold"] == str(own)
    assert report["edited"]["seat"]["pelvis_cm"] < 1
    # Only the editing can tell them apart: the walk is the same, the sitting down another.
    assert set(along) == set(shipped)
    assert along != shipped
    root = ('pose.bones["Hips"].location', 0)
    same = [np.frombuffer(keys[root], np.float32).reshape(-1, 2)[:10].tobytes() for keys in (along, shipped)]
    assert same[0] == same[1]

    arm = stool.oncue.character.pose.bones["LeftArm"]
    solved = {}
    for name, path in (("shipped", ""), ("own", str(own))):
        stool.oncue.manifold = ""
        synthesized(oncue)
        stool.frame_set(20)
        w, half = arm.rotation_quaternion.copy(), 0.3
        arm.rotation_quaternion = w @ type(w)((math.cos(half), 0.0, math.sin(half), 0.0))
        arm.keyframe_insert("rotation_quaternion", frame=20)
        stool.oncue.manifold = path
        assert bpy.ops.oncue.resolve() == {"FINISHED"}
        solved[name] = keys_of(oncue, current_action())
    assert solved["own"] != solved["shipped"]


@pytest.mark.parametrize("what", ["damaged", "foreign", "gone", "unsaved"])
def test_a_manifold_that_is_none_is_a_sentence(stool, oncue, core, own, tmp_path, what):
    path = tmp_path / "own.oncueman"
    words = {
        "damaged": "own.oncueman.*damaged or cut off; train the manifold again",
        "foreign": "own.oncueman.*not an Oncue motion manifold",
        "gone": "own.oncueman is not there any more",
        "unsaved": "never saved",
    }[what]
    if what == "damaged":
        path.write_bytes(own.read_bytes()[:-100])
    elif what == "foreign":
        path.write_bytes(b"a picture, say")
    stool.oncue.manifold = "//own.oncueman" if what == "unsaved" else str(path)
    objects = sorted(bpy.data.objects.keys())
    with pytest.raises(RuntimeError, match=words):
        bpy.ops.oncue.synthesize()
    assert sorted(bpy.data.objects.keys()) == objects
    assert not bpy.data.actions


def test_following_goes_along_the_chosen_manifold(stool, oncue, core, own):
    """The world that stays in memory holds it, and every motion that is played gets it."""
    pipeline, live = oncue("pipeline"), oncue("live")
    stool.oncue.manifold = str(own)
    request, _ = oncue("bridge.session").read_request(bpy.context)
    policies = oncue("bridge.policies").policy_cache(bpy.context)
    world = pipeline.run_blocking(live.world_steps(request, pipeline.LibraryCache(), policies, None))
    assert world.manifold.figures == core.Manifold.read(own).figures


def test_batch_takes_a_manifold(fixtures, oncue, core, own, tmp_path):
    fixtures.stool_alone()
    bpy.data.objects["Sit"].location.z += 0.04
    scene, out, report = (tmp_path / name for name in ("stool.blend", "out.blend", "out.json"))
    fixtures.save(scene)
    words = (scene, "--out", out, "--report", report, "--overrides", json.dumps(QUICK))
    forget_policies()
    done = batch(*words, "--manifold", own)
    assert done.returncode in {0, 3}, done.stderr
    written = json.loads(report.read_text())
    assert written["extension"]["manifold"] == str(own)
    bpy.ops.wm.open_mainfile(filepath=str(scene))
    set_quick(bpy.context.scene)
    bpy.context.scene.oncue.manifold = str(own)
    forget_policies()
    pressed, _ = synthesized(oncue)
    bpy.ops.wm.open_mainfile(filepath=str(out))
    assert keys_of(oncue, current_action()) == pressed
    failed(batch(*words, "--manifold", tmp_path / "none.oncueman"), report, "none.oncueman is not there any more")
