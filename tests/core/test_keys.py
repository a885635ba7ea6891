"""Few keys, as Python asks for them: shapes, what stays, and what is refused."""

import numpy as np
import oncue_core
import pytest

FRAMES = 41


def arguments(**changed):
    """Two bones, one on the other, that sway; 3 mm and a degree."""
    times = np.arange(FRAMES)
    half = 0.15 * np.sin(times / 6.0)
    turns = np.stack([np.cos(half), np.sin(half), 0.0 * half, 0.0 * half], axis=1)
    return {
        "parents": [-1, 0],
        "offsets": np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 0.5]]),
        "rests": np.array([[1.0, 0.0, 0.0, 0.0]] * 2),
        "limbs": [([0], []), ([1], [11])],
        "tolerances": np.array([[0.001, 0.002], [0.003, 0.0175]]),
        "planted": np.zeros((FRAMES, 2), dtype=bool),
        "drift": 0.0018,
        "locations": np.stack([0.01 * times, 0.0 * times, 0.0 * times], axis=1),
        "rotations": np.stack([turns, turns], axis=1),
        **changed,
    }


def test_each_bone_has_keys_with_values_and_slopes():
    for bone, (frames, values, before, after) in enumerate(oncue_core.fit_keys(**arguments())):
        assert (frames[0], frames[-1]) == (0, FRAMES - 1)
        assert 3 <= len(frames) < FRAMES // 3
        assert values.shape == before.shape == after.shape == (len(frames), 4 if bone else 7)
        assert np.array_equal(values[:, :4], arguments()["rotations"][frames, bone])
        assert np.isnan(before[0]).all()
        assert np.isnan(after[-1]).all()
        assert np.isfinite(before[1:]).all()
        assert np.isfinite(after[:-1]).all()
    assert 11 in frames


def test_a_smaller_tolerance_takes_more_keys():
    few = len(oncue_core.fit_keys(**arguments())[1][0])
    more = len(oncue_core.fit_keys(**arguments(tolerances=np.array([[1e-5, 2e-5], [3e-5, 2e-4]])))[1][0])
    assert more > few


def test_where_curves_stay_there_is_no_key():
    given = arguments()
    stays = np.ones((FRAMES, 2), dtype=bool)
    stays[10:25, 1] = False
    halves = np.arange(2 * FRAMES - 1) / 2
    played = {
        "played_locations": np.stack([np.interp(halves, range(FRAMES), way) for way in given["locations"].T], axis=1),
        "played_rotations": np.repeat(given["rotations"], 2, axis=0)[:-1],
    }
    still, moved = oncue_core.fit_keys(**given, **played, stays=stays)
    assert len(still[0]) == 0
    assert (moved[0][0], moved[0][-1]) == (10, 25)


@pytest.mark.parametrize(
    "changed",
    [
        {"parents": [-1, 1]},
        {"offsets": np.zeros((3, 3))},
        {"tolerances": np.zeros((2, 2), dtype=np.float32)},
        {"planted": np.zeros((FRAMES - 1, 2), dtype=bool)},
        {"rotations": np.zeros((FRAMES, 2, 4))},
        {"locations": np.full((FRAMES, 3), np.nan)},
        {"limbs": [([0], []), ([7], [])]},
    ],
)
def test_arrays_that_are_not_of_one_motion_are_refused(changed):
    with pytest.raises(oncue_core.InputError):
        oncue_core.fit_keys(**arguments(**changed))
