"""`nox -s evaluate -- --only naturalness`: its windows and features by hand, and what its classifier tells apart."""

import numpy as np
import oncue_core
import pytest

from tools.evaluation import naturalness, page, windows

BODY = windows.Body(oncue_core.skeleton())
JOINTS = oncue_core.skeleton()["names"]
STILL = np.tile([1.0, 0, 0, 0], (22, 1))


def about(axis, angles):
    """Quaternions (frames, 4) about an axis, radians."""
    angles = np.asarray(angles, dtype=float)
    return np.concatenate([np.cos(angles / 2)[:, None], np.sin(angles / 2)[:, None] * np.array(axis)], axis=1)


def gliding(frames, speed, height=BODY.hips_height):
    """Nothing moves but the place: (root positions, rotations)."""
    time = np.arange(frames) / windows.FRAME_RATE
    places = np.stack([0 * time, -speed * time, 0 * time + height], axis=1)
    return places, np.tile(STILL, (frames, 1, 1))


def walk(seed, tremble=0.0):
    """Two and a half seconds at a gait of one's own; the arms tremble by so many radians."""
    rng = np.random.default_rng(seed)
    places, rotations = gliding(75, rng.normal(1.0, 0.1))
    phase = 2 * np.pi * (np.arange(75) / windows.FRAME_RATE * rng.normal(1, 0.05) + rng.uniform())
    for side, sign in (("Left", 1), ("Right", -1)):
        for bone, swing in (("UpLeg", 0.45), ("Leg", 0.4), ("Arm", 0.3), ("ForeArm", 0.2)):
            angles = sign * swing * rng.normal(1, 0.2) * np.sin(phase)
            # At rest the arms are held out sideways: they swing about Z.
            axis = (0, 0, 1) if "Arm" in bone else (1, 0, 0)
            if "Arm" in bone:
                angles = angles + tremble * np.sin(6 * np.pi * np.arange(75) / windows.FRAME_RATE + rng.uniform(0, 6))
            rotations[:, JOINTS.index(side + bone)] = about(axis, angles)
    return places, rotations


def seen(motions):
    return naturalness.Windows.of([BODY.walks(*m, [(0, len(m[0]))]) for m in motions], len(BODY.names))


def test_joints_are_where_the_bones_end():
    skeleton = oncue_core.skeleton()
    places, rotations = gliding(1, 0)
    # A quarter to the left: what is at the left, +X, comes to lie behind, +Y.
    rotations[:, 0] = about((0, 0, 1), [np.pi / 2])
    hand, reach = JOINTS.index("LeftHand"), np.zeros(3)
    joint = hand
    while joint:
        reach += skeleton["joint_offsets"][joint]
        joint = skeleton["parents"][joint]
    found = windows.joint_positions(places, rotations, BODY.parents, BODY.offsets)[0, hand]
    assert found == pytest.approx(places[0] + [-reach[1], reach[0], reach[2]], abs=1e-6)
    # The elbow's bend moves the hand, by the forearm's length, and not the elbow.
    bent = rotations.copy()
    bent[:, JOINTS.index("LeftForeArm")] = about((0, 0, 1), [-np.pi / 2])
    moved = windows.joint_positions(places, bent, BODY.parents, BODY.offsets)[0]
    elbow = JOINTS.index("LeftForeArm")
    straight = windows.joint_positions(places, rotations, BODY.parents, BODY.offsets)[0]
    assert moved[elbow] == pytest.approx(straight[elbow])
    forearm = np.linalg.norm(BODY.offsets[hand])
    assert np.linalg.norm(moved[hand] - moved[elbow]) == pytest.approx(forearm)
    assert np.linalg.norm(moved[hand] - straight[hand]) == pytest.approx(np.sqrt(2) * forearm, rel=0.02)


def test_features_of_a_body_that_glides_and_one_that_nods():
    (one, *_) = BODY.walks(*gliding(60, 1.2), [(10, 45)])
    glides = dict(zip(BODY.names, one, strict=True))
    assert glides["Head, mean of speed"] == pytest.approx(120)
    assert glides["Head, largest of speed"] == pytest.approx(120)
    assert glides["LeftHand, sd of speed"] == pytest.approx(0, abs=1e-6)
    assert glides["LeftHand, range forward"] == pytest.approx(0, abs=1e-6)
    assert not [name for name in glides if "Toe" in name]
    # The trunk leans forward by 0.2 in all, so slowly that the low pass leaves it: the neck comes forward, -Y.
    places, rotations = gliding(60, 1.2)
    rotations[:, JOINTS.index("Spine")] = about((1, 0, 0), np.linspace(0, 0.2, 60))
    # Turned to face +X, which changes nothing of what is seen in the pelvis's frame.
    rotations[:, 0] = about((0, 0, 1), np.full(60, np.pi / 2))
    (one, *_) = BODY.walks(places, rotations, [(15, 45)])
    leans = dict(zip(BODY.names, one, strict=True))
    chain = [JOINTS.index(name) for name in ("Spine1", "Spine2", "Neck")]
    length = np.linalg.norm(np.sum(BODY.offsets[chain], axis=0))
    assert leans["Neck, range forward"] == pytest.approx(100 * length * 0.2 * 29 / 59, rel=0.05)
    assert leans["Neck, range left"] == pytest.approx(0, abs=1e-3)


@pytest.mark.parametrize(
    ("motion", "spans", "found"),
    [
        (gliding(75, 1.0), [(0, 75)], 4),
        (gliding(75, 1.0), [(0, 44), (45, 75)], 2),
        (gliding(29, 1.0), [(0, 29)], 0),
        (gliding(75, 0.3), [(0, 75)], 0),
        (gliding(75, 1.0, height=0.7), [(0, 75)], 0),
    ],
    ids=["windows overlap by half", "and lie within their span", "too short", "too slow", "too low"],
)
def test_what_is_a_window_of_walking(motion, spans, found):
    assert len(BODY.walks(*motion, spans)) == found


def test_windows_of_sits_lie_around_the_seat_and_within_the_clip():
    motion = gliding(300, 0.0)
    assert len(BODY.sits(*motion, [150])) == 5
    assert len(BODY.sits(*motion, [15])) == 2
    assert len(BODY.sits(*motion, [299])) == 3
    assert BODY.sits(*motion, []) == []


def test_segments_of_walking_that_follow_on_each_other_are_one_span():
    parts = [("walk", 0, 40), ("stop", 40, 60), ("idle", 60, 80), ("walk", 80, 99), ("other", 99, 120)]
    segments = [{"label": label, "first": first, "end": end} for label, first, end in parts]
    assert naturalness.on_foot(segments) == [(0, 60), (80, 99)]


def test_trembling_arms_are_told_and_named():
    calm, trembling = seen(walk(k) for k in range(30)), seen(walk(100 + k, 0.15) for k in range(30))
    row = naturalness.compared(calm, trembling, BODY.names, seed=1)
    assert row["auc"] > 0.95
    names = [name for name, _, _ in row["telling"]]
    assert len(names) == naturalness.TELLING
    assert all("Arm" in name or "Hand" in name for name in names[:5]), names
    # The same forest finds nothing where labels say nothing, and nothing between two halves of the calm.
    assert 0.35 < np.mean(row["shuffled"]) < 0.65
    assert 0.3 < np.mean(naturalness.halves(calm, 1)) < 0.7


def test_walks_of_one_kind_are_not_told_apart():
    areas = [
        naturalness.told_apart(
            seen(walk(1000 * draw + k) for k in range(30)), seen(walk(1000 * draw + 500 + k) for k in range(30)), draw
        )[0]
        for draw in range(2)
    ]
    assert 0.35 < np.mean(areas) < 0.65, areas


def test_a_clip_that_was_seen_in_training_is_not_asked_about():
    # Each clip has its own number, which says nothing of the next clip's label, and all of its own other windows'.
    rng = np.random.default_rng(5)
    numbers = rng.normal(size=(40, 3)).repeat(10, axis=0)
    clip, labels = np.arange(40).repeat(10), (np.arange(40) % 2).repeat(10)
    assert naturalness.out_of_fold(numbers, labels, clip, 1)[0] < 0.7


def test_a_section_made_anew_takes_the_place_of_its_own():
    text = "# Page\n\nHead.\n\n## One\n\nold\n\n### Part\n\nold too\n\n## Two\n\nstays\n"
    made = page.stamped("## One\n\nnew", "Today")
    assert page.replaced(text, [made]) == "# Page\n\nHead.\n\n## One\n\nToday.\n\nnew\n\n## Two\n\nstays\n"
    assert page.replaced(text, ["## Three\n\nmore"]) == text + "\n## Three\n\nmore\n"
