"""Clips that a library gives back as .bvh files, read by Blender's own importer."""

import math

import bpy
import numpy as np
import pytest
from mathutils import Vector

from ..core.bvh import stepping

#: Joints that the capture and our skeleton share, each with the one after it.
LIMBS = [
    (f"{side}{upper}", f"{side}{lower}")
    for side in ("Left", "Right")
    for upper, lower in (("UpLeg", "Leg"), ("Leg", "Foot"), ("Arm", "ForeArm"), ("ForeArm", "Hand"))
]


def imported(context, path):
    assert bpy.ops.import_anim.bvh(filepath=str(path), global_scale=0.01) == {"FINISHED"}
    return context.object


def place(armature, name):
    """A joint in the world: Blender draws its bone from there."""
    return armature.matrix_world @ armature.pose.bones[name].head


def test_blenders_importer_reads_what_the_library_wrote(context, core, tmp_path):
    capture, written = tmp_path / "walk.bvh", tmp_path / "written.bvh"
    capture.write_text(stepping(speed=1.0))
    library, _ = core.build_library([capture], {"starter": "none", "mirror": False}).result()
    library.write_bvh(0, written)
    theirs, ours = imported(context, capture), imported(context, written)
    # At rest: our offsets, in Blender's axes and metres, with no turn left over.
    skeleton = core.skeleton()
    bones = ours.data.bones
    assert {bone.name for bone in bones} == set(skeleton["names"])
    for name, parent, offset in zip(
        skeleton["names"], skeleton["parents"], skeleton["joint_offsets"].astype(float), strict=True
    ):
        if parent >= 0:
            step = ours.matrix_world @ (bones[name].head_local - bones[skeleton["names"][parent]].head_local)
            assert (step - Vector(offset)).length < 1e-3, name
    # In motion: the limbs point where the capture's do, and the person travels as it does, for its size.
    assert library.frame_count == 90
    hips = []
    for frame in range(1, 91, 8):
        context.scene.frame_set(frame)
        for joint, end in LIMBS:
            directions = [place(armature, end) - place(armature, joint) for armature in (theirs, ours)]
            assert math.degrees(directions[0].angle(directions[1])) < 4, (frame, joint)
        hips.append([place(armature, "Hips") for armature in (theirs, ours)])
    travelled = np.array([[last - first for last, first in zip(hips[-1], hips[0], strict=True)]], float)[0]
    assert travelled[0][1] == pytest.approx(-88 / 30, abs=0.01), "towards -Y, at 1 m/s"
    # Thighs and shins are 85 cm in the capture, 88.8 in our skeleton.
    assert travelled[1] == pytest.approx(travelled[0] * 0.888 / 0.85, abs=0.02)
