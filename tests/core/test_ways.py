"""The ways that people would walk, as Python gets them."""

import oncue_core
import pytest

from .geometry import sit_on_the_bench
from .test_types import check


def test_ways_of_a_task_and_of_several_people(bench_scene):
    task = sit_on_the_bench()
    ways = oncue_core.find_ways(bench_scene, task).result()
    check(ways, oncue_core.Ways)
    (person,) = ways["people"]
    (step,) = person["steps"]
    assert (person["start"], step["cue"]) == (task["start"]["name"], task["cue"]["name"])
    assert (ways["problems"], step["problem"], step["fails_at"]) == ([], None, None)
    assert step["path"][0] == pytest.approx(task["start"]["position"], abs=1e-4)
    assert step["path"][-1][:2] == pytest.approx(task["cue"]["position"][:2], abs=1e-4)
    assert step["length_m"] > 1.0
    performance = {"start": task["start"], "steps": [{"cue": task["cue"]}]}
    assert oncue_core.find_ways(bench_scene, performance).result() == ways
    # Two who start at one place.
    both = oncue_core.find_ways(bench_scene, [performance, performance]).result()
    assert len(both["people"]) == 2
    assert "where two people do not fit" in both["problems"][0]


def test_what_fails_is_no_error(bench_scene):
    task = sit_on_the_bench()
    far = {**task, "cue": {**task["cue"], "position": [40.0, 0.0, 0.5]}}
    ways = oncue_core.find_ways(bench_scene, far).result()
    check(ways, oncue_core.Ways)
    (step,) = ways["people"][0]["steps"]
    assert "lies outside the scene" in step["problem"]
    assert (step["fails_at"], step["path"]) == ([40.0, 0.0, 0.5], [])
    with pytest.raises(oncue_core.InputError):
        oncue_core.find_ways(bench_scene, {"start": task["start"]})
