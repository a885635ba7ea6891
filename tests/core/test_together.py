"""Several people from Python: one shot, who fails in it, and what is refused."""

import copy

import numpy as np
import oncue_core
import pytest
from oncue_core import InputError, Library, Report

from .geometry import sit_on_the_bench
from .test_types import faults


def two() -> list[dict]:
    """One sits down on the bench, the other crosses the way there."""
    task = sit_on_the_bench()
    start = task["start"]["position"]
    stop = {"name": "Aside", "action_type": "stop", "position": [start[0] - 1.2, start[1] + 0.6, 0.0], "yaw": 1.5}
    other = {"name": "Other", "position": [start[0] + 1.0, start[1] + 0.4, 0.0], "yaw": -1.5}
    return [{"start": task["start"], "steps": [{"cue": task["cue"]}]}, {"start": other, "steps": [{"cue": stop}]}]


@pytest.fixture(scope="module")
def library() -> Library:
    return Library.starter()


def test_two_people_play_one_shot(bench_scene, library):
    oncue_core.check_task(bench_scene, two())
    made = oncue_core.perform_together(bench_scene, library, two(), seed=2).result()
    for one, asked in zip(made, two(), strict=True):
        assert not list(faults(one.report, Report))
        assert one.report["success"], one.report["problems"]
        assert one.report["others"] == {"percent": 0.0, "deepest_cm": one.report["others"]["deepest_cm"], "touches": []}
        assert [cue["cue"] for cue in one.report["cues"]] == [asked["steps"][0]["cue"]["name"]]
        assert one.report["seed"] == 2
    again = oncue_core.perform_together(bench_scene, library, two()[::-1], seed=2, earlier=made).result()
    for one, other in zip(made, again[::-1], strict=True):
        assert np.array_equal(one.rotations, other.rotations)


def test_who_fails_is_an_error_in_their_place(bench_scene, library):
    people = copy.deepcopy(two())
    people[1]["steps"][0]["manipulations"] = [{"name": "Rail", "hand": "left", "path": []}]
    one, other = oncue_core.perform_together(bench_scene, library, people, seed=2).result()
    assert one.report["success"]
    assert isinstance(other, InputError)
    assert "‘Rail’" in str(other)


def test_what_does_not_fit_names_both(bench_scene, library):
    people = copy.deepcopy(two())
    people[1]["start"]["position"] = [c + 0.1 for c in people[0]["start"]["position"]]
    for ask in (
        lambda: oncue_core.check_task(bench_scene, people),
        lambda: oncue_core.perform_together(bench_scene, library, people).result(),
    ):
        with pytest.raises(InputError, match="‘Other’ are 17 cm apart"):
            ask()
    with pytest.raises(InputError, match="steps"):
        oncue_core.perform_together(bench_scene, library, [{"start": people[0]["start"]}])
