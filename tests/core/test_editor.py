"""Editing a motion from Python: what it takes, what it gives, and what it refuses."""

import numpy as np
import oncue_core
import pytest
from oncue_core import Cancelled, InputError

LEFT_HAND = 9


#: Where a hand holds what it holds, in the left hand's frame: along the hand, and before the palm.
PALM = np.array([0.08, 0.0, -0.02])


def joints(root_positions, rotations, point=(0.0, 0.0, 0.0)):
    """Places of the joints, or of a `point` in each joint's frame, (frames, 22, 3): forward kinematics."""
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
    point = np.broadcast_to(np.asarray(point), root_positions.shape)
    return np.stack([place + turn(q, point) for place, q in zip(places, turns, strict=True)], 1)


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
    palms = joints(edited.root_positions, edited.rotations, PALM)[50:80, LEFT_HAND]
    assert np.linalg.norm(palms - path, axis=1).max() < 0.01
    wrists = joints(edited.root_positions, edited.rotations)[50:80, LEFT_HAND]
    assert np.allclose(np.linalg.norm(wrists - palms, axis=1), np.linalg.norm(PALM), atol=1e-5)


def low_drawer(still):
    """A path of the left palm down before the shins and towards the person: no arm gets there without the knees."""
    start = joints(*still[:2], PALM)[50, LEFT_HAND] + [-0.1, -0.55, -0.60]
    return {"name": "Drawer", "hand": "left", "path": (start + np.linspace(0, 0.2, 30)[:, None] * [0, 1, 0]).tolist()}


def test_plain_inverse_kinematics_falls_short_where_the_editor_arrives(still):
    cue = low_drawer(still)
    ours = oncue_core.edit_motion(*still, manipulations=[cue]).result()
    plain = oncue_core.plain_ik(*still, cue).result()
    assert len(ours.root_positions) == len(plain.root_positions)
    assert ours.figures["constraints"][0]["max_cm"] < 1
    assert plain.figures["constraints"][0]["max_cm"] > 2
    # The pelvis stays where it was, and so do the feet.
    assert (plain.root_positions == np.float32([0, 0, 0.97])).all()
    figures = {}
    for name, edited in (("ours", ours), ("plain", plain)):
        arrays = (edited.root_positions, edited.rotations, edited.contacts)
        span = edited.figures["first_frame"], edited.figures["end_frame"]
        figures[name] = oncue_core.motion_figures(*arrays, *span)
        lifted = arrays[0] + np.float32([0, 0, 1])
        again = oncue_core.motion_figures(lifted, *arrays[1:], *span, floor=1.0)
        assert again["manifold_cm"] == pytest.approx(figures[name]["manifold_cm"], abs=0.01)
    assert figures["ours"]["manifold_cm"] < figures["plain"]["manifold_cm"]
    assert figures["ours"]["foot"]["worst_skate_cm"] < 0.3
    assert figures["ours"]["smoothness"]["mean_jerk"] > 0


def test_accelerations_are_those_of_the_arrays(still):
    """A fall: half of g times the square of the time."""
    root_positions, rotations, contacts = still
    root_positions = root_positions.copy()
    root_positions[:, 2] -= 0.5 * 9.81 * (np.arange(120) / 30) ** 2
    smooth = oncue_core.motion_figures(root_positions, rotations, contacts, 20, 40)["smoothness"]
    assert smooth["mean_acceleration"] == pytest.approx(9.81, rel=0.02)
    assert smooth["largest_turn"] == pytest.approx(0, abs=0.01)


def test_a_sit_is_fitted_to_its_seat(still):
    """Someone who hangs in the air 8 cm beside the cue is no walk, but shows what is asked and what comes back."""
    cue = {"name": "Seat", "action_type": "sit", "position": [0.05, -0.06, 0.93], "yaw": 0.1}
    fitted = oncue_core.fit_seat(*still, cue, 90).result()
    assert np.linalg.norm(fitted.root_positions[90:] - cue["position"], axis=1).max() < 0.01
    figures = fitted.figures
    assert figures["seat"]["pelvis_cm"] < 1
    assert figures["seat"]["facing_degrees"] < 3
    assert figures["seat_before"]["pelvis_cm"] == pytest.approx(100 * np.linalg.norm([0.05, 0.06, 0.04]), abs=0.01)
    with pytest.raises(InputError, match=r"ends before anyone sits at .*Seat"):
        oncue_core.fit_seat(*still, cue, 120).result()
    with pytest.raises(InputError, match=r"sits down 2\.00 m from"):
        oncue_core.fit_seat(*still, cue | {"position": [0, 2, 0.97]}, 90).result()


def test_the_given_manifold_is_the_one_that_is_searched(still):
    """Without any latent step the manifold cannot count; with them another one gives another motion."""
    folder = [oncue_core.Library.starter()]
    small = {"channels": 16, "epochs": 1, "stride": 120, "batch": 16}
    own = oncue_core.train_manifold(folder[0], small).result()
    pin = reach(still)
    shipped = oncue_core.edit_motion(*still, [pin]).result()
    other = oncue_core.edit_motion(*still, [pin], manifold=own).result()
    assert other.figures["constraints"][0]["met"]
    assert not np.array_equal(shipped.rotations, other.rotations)
    none = {"editor": {"steps": 0}}
    shipped = oncue_core.edit_motion(*still, [pin], settings=none).result()
    other = oncue_core.edit_motion(*still, [pin], settings=none, manifold=own).result()
    assert np.allclose(shipped.rotations, other.rotations, atol=1e-4)


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
