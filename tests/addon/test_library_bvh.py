"""Clips that a library gives back as .bvh files, read by Blender's own importer."""

import bpy
import numpy as np
import pytest
from mathutils import Vector

from ..core.bvh import stepping

#: Blender draws a bone from its head, which is the joint.
SOME = ("Hips", "Spine2", "Head", "LeftHand", "RightForeArm", "LeftFoot", "RightToe")


def test_blenders_importer_reads_what_the_library_wrote(context, core, tmp_path):
    (tmp_path / "walk.bvh").write_text(stepping(speed=1.0))
    library, _ = core.build_library([tmp_path / "walk.bvh"], {"starter": "none", "mirror": False}).result()
    written = tmp_path / "out.bvh"
    library.write_bvh(0, written)
    assert bpy.ops.import_anim.bvh(filepath=str(written), global_scale=0.01) == {"FINISHED"}
    armature = context.object
    skeleton = core.skeleton()
    names, parents = skeleton["names"], skeleton["parents"]
    assert {bone.name for bone in armature.data.bones} == set(names)
    # At rest: our offsets, in Blender's axes and metres, with no turn left over.
    for name, parent, offset in zip(names, parents, skeleton["joint_offsets"], strict=True):
        if parent >= 0:
            bones = armature.data.bones
            step = bones[name].head_local - bones[names[parent]].head_local
            assert (armature.matrix_world @ step - Vector(np.asarray(offset, float))).length < 1e-3, name
    # In motion: upright, on the floor, and walking the way that the file says.
    rows = [line.split() for line in written.read_text().partition("Frame Time:")[2].splitlines()[1:]]
    for frame in (0, len(rows) // 2, len(rows) - 1):
        context.scene.frame_set(frame + 1)
        place = {name: armature.matrix_world @ armature.pose.bones[name].head for name in SOME}
        x, y, z = (float(value) / 100 for value in rows[frame][:3])
        assert place["Hips"][:] == pytest.approx((x, -z, y), abs=1e-3)
        assert place["Head"].z - place["Hips"].z > 0.5
        assert -0.05 < min(place["LeftFoot"].z, place["RightFoot"].z) < 0.25
        assert place["LeftHand"].x > place["RightForeArm"].x or place["LeftHand"].x > place["Hips"].x
