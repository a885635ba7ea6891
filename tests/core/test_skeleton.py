"""The unified skeleton as Python sees it."""

import numpy as np
import oncue_core
import pytest


@pytest.fixture(scope="module")
def skeleton() -> oncue_core.Skeleton:
    return oncue_core.skeleton()


def test_every_joint_hangs_on_an_earlier_one(skeleton):
    assert len(skeleton["names"]) == len(set(skeleton["names"])) == 22
    assert skeleton["parents"][0] == -1
    assert all(0 <= parent < joint for joint, parent in enumerate(skeleton["parents"][1:], start=1))


def test_the_rest_pose_stands_on_the_floor(skeleton):
    assert skeleton["joint_offsets"].shape == (22, 3)
    assert skeleton["joint_offsets"].dtype == np.float32
    heights = {}
    for name, parent, offset in zip(skeleton["names"], skeleton["parents"], skeleton["joint_offsets"], strict=True):
        heights[name] = offset[2] + (heights[skeleton["names"][parent]] if parent >= 0 else 0)
    assert heights["Hips"] == pytest.approx(skeleton["rest_hips_height"])
    for side in ("Left", "Right"):
        assert heights[f"{side}Foot"] == pytest.approx(skeleton["ankle_height"], abs=1e-5)
        assert heights[f"{side}Toe"] == pytest.approx(skeleton["toe_height"], abs=1e-5)


def test_boxes_sit_on_joints(skeleton):
    assert {node["limb"] for node in skeleton["boxes"]} == {"leg", "arm", "foot", "torso", "head"}
    for node in skeleton["boxes"]:
        assert node["joint"] in skeleton["names"]
        assert min(node["half_extents"]) > 0
