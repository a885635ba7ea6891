"""A thousand random changes of each text that Oncue keeps in a .blend file or reads beside it: none does harm."""

import base64
import io
import json
import zipfile
from types import SimpleNamespace

import bpy
import numpy as np

from .test_edit import made, motion, skeleton, take_module  # noqa: F401
from .test_what_is_said import draw  # noqa: F401

INPUTS = 1000
WORDS = ["null", "true", "-1", "1e999", "NaN", "{", "}", "[", "]", '""', "18446744073709551616", "0", ",", "\\ud800"]


ODD = [None, True, -1, 0, 1e308, float("nan"), float("inf"), 2**64, "", "text", [], {}, [[]], {"a": None}]


def changed(text, random):
    """A text with up to three changes: letters taken out, doubled or exchanged, or words put in their place."""
    for _ in range(random.integers(1, 4)):
        at, run = int(random.integers(0, max(len(text), 1))), int(random.integers(1, 9))
        new = [WORDS[random.integers(0, len(WORDS))], "", text[at : at + run] * 2, chr(int(random.integers(32, 127)))]
        text = text[:at] + new[random.integers(0, len(new))] + text[at + run :]
    return text


def changed_tree(value, random):
    """The same of JSON's values: somewhere in the tree one is another, gone or there twice."""
    if not isinstance(value, dict | list) or not value or random.random() < 0.15:
        return ODD[random.integers(0, len(ODD))]
    keys = list(value) if isinstance(value, dict) else range(len(value))
    key = keys[random.integers(0, len(keys))]
    kind = random.random()
    if kind < 0.15:
        del value[key]
    elif kind < 0.25 and isinstance(value, list):
        value.append(value[key])
    elif kind < 0.25:
        value[f"{key}s"] = value.pop(key)
    else:
        value[key] = changed_tree(value[key], random)
    return value


def tried(text, read, refusals=(), *, is_json=True):
    """How many changed texts were read and how many refused; anything else that is raised is a fault."""
    random = np.random.default_rng(7)
    counts = {"read": 0, "refused": 0}
    for number in range(INPUTS):
        if is_json and number % 2:
            tree = json.loads(text)
            for _ in range(random.integers(1, 4)):
                tree = changed_tree(tree, random)
            new = json.dumps(tree)
        else:
            new = changed(text, random)
        try:
            given = read(new)
        except refusals:
            given = None
        counts["read" if given else "refused"] += 1
    assert min(counts.values()) > 20, counts


def repacked(packed, random):
    """What a take keeps with numbers, shapes and names of its arrays changed, in a container that is whole."""
    with np.load(io.BytesIO(base64.b85decode(packed))) as kept:
        arrays = dict(kept)
    name = sorted(arrays)[random.integers(0, len(arrays))]
    array = arrays.pop(name)
    kind = random.integers(0, 6)
    if kind == 0:
        array = array.astype(object if random.random() < 0.3 else str)
    elif kind == 1:
        array = array[: random.integers(0, max(len(array), 1))]
    elif kind == 2:
        array = array.reshape(-1)
    elif kind == 3:
        array = array.copy()
        array.flat[random.integers(0, array.size)] = random.choice([np.nan, np.inf, -1.0, 1e30, 0.0])
    elif kind == 4:
        name += "s"
    out = io.BytesIO()
    np.savez_compressed(out, **arrays, **({name: array} if kind != 5 else {}))
    return base64.b85encode(out.getvalue()).decode("ascii")


def test_the_motion_that_a_take_keeps(oncue, made):  # noqa: F811
    character, action = made()
    take = oncue("bridge.solved")
    packed = action["oncue_solved"]
    random = np.random.default_rng(3)

    def read(text):
        # Half of them in a container that is whole, so that what is in it is looked at.
        keeps = {"oncue_solved": repacked(packed, random) if random.random() < 0.5 else text}
        solved = take.solved_of(SimpleNamespace(name="Stroll", get=keeps.get))
        numbers = (solved.motion.root_positions, solved.motion.rotations, solved.contacts, solved.keys)
        assert all(np.isfinite(array).all() for array in numbers)
        return len(solved.keys)

    tried(packed, read, oncue("errors").SceneError, is_json=False)
    with zipfile.ZipFile(io.BytesIO(base64.b85decode(packed))) as whole:
        assert whole.testzip() is None
    assert take.solved_of(action)
    assert character.animation_data.action == action


def test_pins_and_keys(oncue, made):  # noqa: F811
    pins = oncue("bridge.pins")
    kept = [
        {"bone": "LeftHand", "first_frame": 11, "last_frame": 15, "position": [0.1, 0.2, 1.0], "rotation": None},
        {"bone": "Head", "first_frame": 12, "last_frame": 12, "position": None, "rotation": [1, 0, 0, 0]},
        {"bone": "Hips", "first_frame": 12, "last_frame": 12, "position": None, "rotation": None},
    ]

    def read(text):
        found = pins.read_pins({"oncue_pins": text})
        return [pin.title for pin in found]

    tried(json.dumps(kept), read)


def test_the_report_of_a_take(oncue, made, draw):  # noqa: F811
    """The panel draws whatever somebody made of it."""
    _, action = made()
    cues, session = oncue("bridge.cue_objects"), oncue("bridge.session")
    cues.make_cue(bpy.context, "start", (-2, 0, 0), 1.57)
    cues.make_cue(bpy.context, "stop", (1.5, 0, 0), 0.0)
    task = session.read_task(bpy.context, 1.0, as_drawn=True)
    report = {
        "cues": [{"cue": "Sit", "met": True, "pelvis_cm": 1.2, "facing_degrees": 3.0, "feet_cm": [None, 2.0]}],
        "edited": {"constraints": [{"name": "Hand", "max_cm": 1.0, "max_degrees": None, "met": True}]},
        "foot": {"contact_cm": 1.0, "skate_cm": 0.2},
        "penetration": {"percent": 1.0, "whole_body_percent": 2.0, "parts_percent": {"head": 1.0}},
        "problems": ["One."],
        "task": json.loads(json.dumps(task)),
        "seed": 3,
        "extension": {
            "seconds": {"library": 1.0},
            "deepest": {"part": "left_hand", "object": "Table", "depth_cm": 4.2, "frame": 59},
            "skipped_objects": [{"object": "A", "reason": "A is odd."}],
            "skipped_files": [{"file": "a.bvh", "reason": "it is odd."}],
        },
    }

    def read(text):
        action["oncue_report"] = text
        shown = draw("results").labels
        assert all(isinstance(label, str) for label in shown)
        return shown and "cannot be read" not in " ".join(shown)

    tried(json.dumps(report), read)


def test_settings_as_text(oncue):
    session, pipeline, core = oncue("bridge.session"), oncue("pipeline"), oncue("native").core
    settings = core.default_settings("default")

    def read(text):
        return pipeline.merged(settings, session.read_overrides(text))

    overrides = {"ppo": {"updates": 10, "policy_layers": [32, 32]}, "kept": {"rollouts": 3}, "scene": {}}
    tried(json.dumps(overrides), read, oncue("errors").SceneError)


def test_what_the_second_blender_said(oncue, tmp_path):
    foreign = oncue("foreign_captures")
    (tmp_path / "0.bvh").write_text("")
    said = {"takes": [{"file": "0.bvh", "action": "Walk"}], "left_out": [{"action": None, "reason": "it is odd."}]}

    def read(text):
        (tmp_path / foreign.TAKES).write_text(text, encoding="utf-8", errors="replace")
        found = foreign._takes(tmp_path)
        if found is not None:
            assert all(isinstance(take["action"], str) for take in found["takes"])
            assert all((tmp_path / take["file"]).is_file() for take in found["takes"])
            assert all(isinstance(one["reason"], str) and "action" in one for one in found["left_out"])
        return found

    tried(json.dumps(said), read)
