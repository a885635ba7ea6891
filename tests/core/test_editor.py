"""Editing a motion from Python: what it takes, what it gives, and what it refuses."""

import numpy as np
import oncue_core
import pytest
from oncue_core import Cancelled, InputError

LEFT_HAND = 9


def joints(root_positions, rotations):
    """Places of the joints, (frames, 22, 3): forward kinematics."""
    skeleton = oncue_core.skeleton()

    def turn(q, v):
        w, u = q[:, :1], q[:, 1:]
        t = 2 * np.cross(u, v)
        return v + w * t + np.cross(u, t)

    def product(p, q):
        w = p[:, 0] * q[:, 0] - (p[:, 1:] * q[:, 1:]).sum(1)
        v = p[:, :1] * q[:, 1:] + q[:, :1] * p[:, 1:] + np.cross(p[:, 1:], q[:, 1:])
        return np.concatenate([w[:, None], v], 1)

    places, turns = [root_positions], [rotations[:, 0]]
    for joint in range(1, 22):
        parent = skeleton["parents"][joint]
        offset = np.broadcast_to(skeleton["joint_offsets"][joint], root_positions.shape)
        places.append(places[parent] + turn(turns[parent], offset))
        turns.append(product(turns[parent], rotations[:, joint]))
    return np.stack(places, 1)


@pytest.fixture
def still():
    """Someone who stands still for four seconds, knees a little bent and arms hanging."""
    frames = 120
    root_positions = np.tile(np.float32([0, 0, 0.97]), (frames, 1))
    rotations = np.zeros((frames, 22, 4), np.float32)
    rotations[..., 0] = 1

    def bend(joint, axis, angle):
        rotations[:, joint, 0] = np.cos(angle / 2)
        rotations[:, joint, 1 + axis] = np.sin(angle / 2)

    # Left and right arms down; hips, knees and ankles so that the feet stand under them.
    bend(7, 1, 1.2)
    bend(11, 1, -1.2)
    bent = np.arccos(1 - 0.023 / (2 * 0.444))
    for thigh in (14, 18):
        bend(thigh, 0, -bent)
        bend(thigh + 1, 0, 2 * bent)
        bend(thigh + 2, 0, -bent)
    return root_positions, rotations, np.ones((frames, 2), np.float32)


def reach(motion, frame=60, count=10, by=(0.0, -0.3, 0.3)):
    place = joints(*motion[:2])[frame, LEFT_HAND] + by
    return {"name": "Cup", "joint": "LeftHand", "first_frame": frame, "positions": [place.tolist()] * count}


def test_a_hand_is_brought_to_its_place_and_the_rest_stays_to_the_bit(still):
    pin = reach(still)
    edited = oncue_core.edit_motion(*still, [pin]).result()
    for array, before in zip((edited.root_positions, edited.rotations, edited.contacts), still, strict=True):
        assert array.dtype == np.float32
        assert array.shape == before.shape
    figures = edited.figures
    (hand,) = figures["constraints"]
    places = joints(edited.root_positions, edited.rotations)[60:70, LEFT_HAND]
    misses = 100 * np.linalg.norm(places - pin["positions"][0], axis=1)
    assert misses.max() < 1
    assert hand["met"]
    assert hand["max_cm"] == pytest.approx(misses.max(), abs=0.01)
    first, end = figures["first_frame"], figures["end_frame"]
    assert 0 < first < 60
    assert 70 < end < 120
    for array, before in ((edited.root_positions, still[0]), (edited.rotations, still[1])):
        assert (array[:first] == before[:first]).all()
        assert (array[end:] == before[end:]).all()


def test_a_key_stays_to_the_bit_and_its_neighbours_come_along(still):
    root_positions, rotations, contacts = still
    rotations[50, 7] = [np.cos(0.2), 0, np.sin(0.2), 0]
    edited = oncue_core.edit_motion(
        root_positions, rotations, contacts, keys=[{"joint": "LeftArm", "frame": 50}]
    ).result()
    assert (edited.rotations[50, 7] == rotations[50, 7]).all()
    assert abs(np.dot(edited.rotations[48, 7], rotations[50, 7])) > abs(np.dot(rotations[48, 7], rotations[50, 7]))


def test_a_hands_path_lengthens_the_motion(still):
    start = np.array(reach(still)["positions"][0])
    path = [(start + np.array([0, 0, 0.005 * i])).tolist() for i in range(30)]
    cue = {"name": "Lid", "hand": "left", "path": path, "first_frame": 50}
    edited = oncue_core.edit_motion(*still, manipulations=[cue]).result()
    assert len(edited.root_positions) == 150
    assert edited.figures["manipulations"] == [{"name": "Lid", "first_frame": 50, "frames": 30}]
    places = joints(edited.root_positions, edited.rotations)[50:80, LEFT_HAND]
    assert np.linalg.norm(places - path, axis=1).max() < 0.01


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"joint": "LeftPaw"}, "LeftPaw.*LeftHand"),
        ({"place": [1, 2, 3]}, "constraint.*place"),
        ({"positions": [[0, 0]]}, r"constraint.*positions\[0\]"),
    ],
)
def test_a_malformed_constraint_is_named_at_once(still, change, named):
    with pytest.raises(InputError, match=named):
        oncue_core.edit_motion(*still, [reach(still) | change])


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"first_frame": 115}, "Cup.*115 to 124.*0 to 119"),
        ({"positions": [[0.3, -0.3, 1.0], [0.3, -0.3, 1.5]]}, "Cup.*jumps by 0.50 m between frames 60 and 61"),
        ({"positions": [[0.3, -2.3, 1.0]]}, "Cup.*out of reach of the LeftHand.*towards the character"),
        ({"positions": []}, "places nothing"),
    ],
)
def test_what_cannot_be_met_is_said_and_how(still, change, named):
    with pytest.raises(InputError, match=named):
        oncue_core.edit_motion(*still, [reach(still) | change]).result()


def test_two_targets_for_one_hand_are_refused(still):
    other = reach(still, frame=65, by=(0.1, -0.2, 0.4)) | {"name": "Plate"}
    with pytest.raises(InputError, match=r"Cup.* and .*Plate.* both want the LeftHand on frame 65"):
        oncue_core.edit_motion(*still, [reach(still), other]).result()


def test_arrays_of_another_shape_are_named(still):
    root_positions, rotations, contacts = still
    with pytest.raises(
        InputError, match=r"rotations must be .* \(120, 22, 4\), but it is float32 of shape \(100, 22, 4\)"
    ):
        oncue_core.edit_motion(root_positions, rotations[:100], contacts, [reach(still)])
    with pytest.raises(InputError, match=r"contacts must be .* float64"):
        oncue_core.edit_motion(root_positions, rotations, contacts.astype(float), [reach(still)])
    rotations[7, 3] = 0
    with pytest.raises(InputError, match="Frame 7"):
        oncue_core.edit_motion(root_positions, rotations, contacts, [reach(still)])


def test_nothing_to_do_is_said(still):
    with pytest.raises(InputError, match="nothing to edit"):
        oncue_core.edit_motion(*still).result()


def test_cancel_leaves_nothing_behind(still):
    job = oncue_core.edit_motion(*still, [reach(still)])
    job.cancel()
    with pytest.raises(Cancelled):
        job.result()
