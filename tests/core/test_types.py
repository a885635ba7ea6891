"""The typed dicts are what the core gives: the same keys and kinds, all the way down."""

import copy
from collections.abc import Iterator
from types import UnionType
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints, is_typeddict

import oncue_core
import pytest
from oncue_core import Library

from .bvh import stepping
from .geometry import sit_on_the_bench

#: One small update from nothing: too little to walk well, enough for a learning curve.
LEARNING = {
    "ppo": {"prior": False, "updates": 1, "tuples": 1024, "policy_layers": [32], "value_layers": [32]},
    "kept": {"rollouts": 8, "rounds": 1, "more_rounds": 0},
}
#: The prior's motion, seat and hands fitted.
PLAYED = {"ppo": {"updates": 0}}


def faults(value: Any, kind: Any, where: str = "it") -> Iterator[str]:
    """Where `value` is not of `kind`, in words."""
    origin, arguments = get_origin(kind), get_args(kind)
    if kind is Any:
        return
    if is_typeddict(kind):
        if not isinstance(value, dict):
            yield f"{where} is {type(value).__name__}, not {kind.__name__}"
            return
        hints = get_type_hints(kind)
        yield from (f"{where} has no {name}" for name in sorted(kind.__required_keys__ - value.keys()))
        yield from (
            f"{where} has {name}, which {kind.__name__} has not" for name in sorted(value.keys() - hints.keys())
        )
        for name in sorted(value.keys() & hints.keys()):
            yield from faults(value[name], hints[name], f"{where}.{name}")
    elif origin in (Union, UnionType):
        if all(any(faults(value, one)) for one in arguments):
            # Of a `… | None` the interesting part is what is wrong with the value that is there.
            others = [one for one in arguments if one is not type(None)]
            yield from faults(value, others[0], where)
    elif origin is Literal:
        if value not in arguments:
            yield f"{where} is {value!r}, none of {arguments}"
    elif origin is dict:
        if not isinstance(value, dict):
            yield f"{where} is {type(value).__name__}, not dict"
            return
        for name, item in value.items():
            yield from faults(name, arguments[0], f"a key of {where}")
            yield from faults(item, arguments[1], f"{where}.{name}")
    elif origin in (list, tuple):
        if type(value) is not origin or (origin is tuple and len(value) != len(arguments)):
            yield f"{where} is {value!r}, not {kind}"
            return
        kinds = arguments if origin is tuple else arguments * len(value)
        for k, (item, one) in enumerate(zip(value, kinds, strict=True)):
            yield from faults(item, one, f"{where}[{k}]")
    elif type(value) is not (origin or kind):
        yield f"{where} is {value!r}, not {kind}"


def check(value: Any, kind: Any) -> None:
    assert list(faults(value, kind)) == []


@pytest.fixture(scope="module")
def library() -> Library:
    return Library.starter()


@pytest.fixture(scope="module")
def learnt(bench_scene, library):
    """One that was optimized."""
    return oncue_core.synthesize(bench_scene, library, sit_on_the_bench(), LEARNING, 1).result()


@pytest.fixture(scope="module")
def played(bench_scene, library):
    """One of the prior's, whose seat was fitted and whose hand followed a cue."""
    path = [[0.25, 1.55 - 0.002 * k, 0.85] for k in range(20)]
    task = sit_on_the_bench() | {"manipulations": [{"name": "Cup", "hand": "right", "path": path}]}
    return oncue_core.synthesize(bench_scene, library, task, PLAYED, 1).result()


def test_a_report_has_what_its_type_says(learnt, played):
    for synthesis in (learnt, played):
        check(synthesis.report, oncue_core.Report)
    # Nothing was empty that should have been looked into.
    assert learnt.report["curve"]
    assert learnt.report["cues"]
    penetration = played.report["penetration"]
    assert bool(penetration["parts_percent"]) == (penetration["whole_body_percent"] > 0)
    assert bool(played.report["problems"]) != played.report["success"]
    assert played.report["body"]["pose_distance"]
    assert played.report["style"]["descent"]["descent_s"]
    edited = played.report["edited"]
    assert edited is not None
    assert edited["seat"], edited
    assert edited["manipulations"], edited
    assert edited["constraints"], edited


def test_every_other_dict_has_what_its_type_says(bench_scene, library, played, tmp_path):
    check(oncue_core.skeleton(), oncue_core.Skeleton)
    check(library.summary(), oncue_core.Summary)
    check(library.clip(0), oncue_core.Clip)
    check(library.foot_figures(), oncue_core.FootFigures)
    check(library.body_figures(), oncue_core.BodyFigures)
    style = library.style_figures()
    check(style, oncue_core.StyleFigures)
    assert all(value is not None for rows in style.values() for value in rows.values()), style
    # Nothing of it is captured.
    captured = library.style_figures("mocap")
    check(captured, oncue_core.StyleFigures)
    assert all(value is None for rows in captured.values() for value in rows.values())
    with pytest.raises(oncue_core.InputError, match="taken"):
        library.style_figures("taken")
    shipped = oncue_core.Manifold.shipped().figures
    check(shipped, oncue_core.ManifoldFigures)
    assert shipped["curve"]
    check(shipped["curve"][0], oncue_core.ManifoldEpoch)
    check(played.policy.origin, oncue_core.PolicyOrigin)
    assert played.policy.origin["cues"]
    check(oncue_core.practice_room(3)[2], list[oncue_core.ActionCue])
    (tmp_path / "brisk.bvh").write_text(stepping(speed=1.2))
    (tmp_path / "empty.bvh").write_text("")
    captures = oncue_core.build_library([tmp_path], {"starter": "none"}).result()[1]
    check(captures, list[oncue_core.Capture])

    motion = (played.root_positions, played.rotations, played.contacts)
    figures = oncue_core.motion_figures(*motion, 0, len(played.contacts))
    check(figures, oncue_core.MotionFigures)
    check(figures["smoothness"], oncue_core.Smoothness)
    report = played.report
    seen = oncue_core.measure_motion(
        *motion, sit_on_the_bench(), report["cues"][0]["frame"], report["action_from"], bench_scene
    ).result()
    check(seen, oncue_core.Measured)
    # What a report says of its own motion.
    assert all(seen[part] == report[part] for part in ("cues", "foot", "penetration"))
    # How far it is from a library's poses is told by whoever has the library.
    assert seen["body"] == {**report["body"], "pose_distance": None}
    beside = oncue_core.measure_motion(
        *(*motion, sit_on_the_bench(), report["cues"][0]["frame"], report["action_from"], bench_scene),
        library=library,
    ).result()
    assert beside["body"] == report["body"]
    without = oncue_core.measure_motion(*motion, sit_on_the_bench(), 0).result()
    check(without, oncue_core.Measured)
    assert without["penetration"] is None
    assert without["body"]["scene"] is None
    assert not without["cues"][0]["met"]
    assert "was missed by" in without["problems"][0]
    wanted = {"name": "Head", "joint": "Head", "first_frame": 5, "positions": [[0.0, 0.0, 1.6]], "soft": True}
    job = oncue_core.edit_motion(*motion, [wanted])
    check(job.progress(), oncue_core.ProgressSnapshot)
    edited = job.result().figures
    check(edited, oncue_core.EditFigures)
    assert edited["constraints"]
    frame = played.report["cues"][0]["frame"]
    fitted = oncue_core.fit_seat(*motion, sit_on_the_bench()["cue"], frame, bench_scene).result().figures
    check(fitted, oncue_core.EditFigures)
    assert fitted["seat"]
    assert fitted["seat_before"]


def test_the_robustness_test_has_what_its_type_says(bench_scene, library, played):
    test = {"spacing": 1.5, "trials": 1, "needed": 1}
    job = oncue_core.robustness(bench_scene, library, played.policy, sit_on_the_bench(), PLAYED, test)
    figures = job.result()
    check(figures, oncue_core.Robustness)
    assert figures["starts"]


def test_everything_typed_is_public():
    """Each typed dict that a public one names can be imported from the package itself."""
    named = {name for name, item in vars(oncue_core.types).items() if is_typeddict(item)}
    assert named <= set(oncue_core.__all__)
    assert len(named) > 25


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda r: r.pop("seed"), "it has no seed"),
        (lambda r: r.update(sead=1), "it has sead, which Report has not"),
        (lambda r: r.update(frames=1.0), "it.frames is 1.0, not <class 'int'>"),
        (lambda r: r["foot"].update(sink_cm=None), "it.foot.sink_cm is None, not <class 'float'>"),
        (lambda r: r["cues"][0].pop("met"), "it.cues[0] has no met"),
        (lambda r: r["curve"][0].update(success_rate="all"), "it.curve[0].success_rate is 'all', not <class 'float'>"),
        (lambda r: r["edited"]["seat"].pop("hanging"), "it.edited.seat has no hanging"),
        (
            lambda r: r["penetration"]["parts_percent"].update(tail=1.0),
            "a key of it.penetration.parts_percent is 'tail'",
        ),
        (lambda r: r.update(policy_source="own"), "it.policy_source is 'own', none of"),
    ],
)
def test_what_is_not_as_the_type_says_is_found(learnt, played, change, words):
    report = copy.deepcopy(played.report) | {"curve": copy.deepcopy(learnt.report["curve"])}
    change(report)
    (fault,) = faults(report, oncue_core.Report)
    assert fault.startswith(words)
