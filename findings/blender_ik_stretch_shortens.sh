#!/usr/bin/env bash
# Blender 5.0.1 (bpy): a limb with IK stretch is squashed by a target that it reaches without.
#
# Two bones of 50 cm hang down a little bent, with an inverse kinematics constraint and an ik_stretch of 0.1 each. One would think
# that stretch is for targets beyond reach, as in other programs. With the target 5 to 60 cm nearer than the limb is long, where
# bending alone gets there, both bones come out 1 to 4 % shorter than they are at rest; the tip is on the target to 0.2 mm either way.
# With the constraint's use_stretch off, or ik_stretch at 0, no bone changes its length at any distance.
# So a knee or an elbow that was placed by the bones' own lengths is up to 2 cm from where the solver puts it. On Rigify rigs Oncue
# keys that constraint not to stretch (addon/bridge/rigify_ik.py).
# Seen on 2026-12-01; the same in 4.2.23 and 5.2.3.
# Needs Python 3.11 and fetches Blender's Python module (375 MB). Fails when the behaviour changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3.11 -m venv "$folder/venv" 2>/dev/null || python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet bpy==5.0.1
cat > "$folder/show.py" <<'PYTHON'
import bpy
from mathutils import Vector

bpy.ops.wm.read_factory_settings(use_empty=True)


def limb(stretch, use_stretch):
    data = bpy.data.armatures.new("Limb")
    thing = bpy.data.objects.new("Limb", data)
    bpy.context.scene.collection.objects.link(thing)
    bpy.context.view_layer.objects.active = thing
    bpy.ops.object.mode_set(mode="EDIT")
    upper, lower = data.edit_bones.new("upper"), data.edit_bones.new("lower")
    upper.head, upper.tail, lower.head, lower.tail = (0, 0, 1), (0, -0.05, 0.5), (0, -0.05, 0.5), (0, 0, 0)
    lower.parent, lower.use_connect = upper, True
    bpy.ops.object.mode_set(mode="OBJECT")
    target = bpy.data.objects.new("Target", None)
    bpy.context.scene.collection.objects.link(target)
    constraint = thing.pose.bones["lower"].constraints.new("IK")
    constraint.target, constraint.chain_count, constraint.use_stretch = target, 2, use_stretch
    for bone in thing.pose.bones:
        bone.ik_stretch = stretch
    return thing, target


for stretch, use_stretch in ((0.1, True), (0.1, False), (0.0, True)):
    thing, target = limb(stretch, use_stretch)
    shares = []
    for nearer in (0.05, 0.2, 0.6):
        target.location = (0, 0, nearer)
        bpy.context.view_layer.update()
        bones = thing.evaluated_get(bpy.context.evaluated_depsgraph_get()).pose.bones
        assert (bones["lower"].tail - Vector(target.location)).length < 1e-3
        shares.append([round((bone.tail - bone.head).length / thing.data.bones[bone.name].length, 2) for bone in bones])
    print(f"seen: ik_stretch {stretch} use_stretch {use_stretch} lengths {shares}")
PYTHON
expected="seen: ik_stretch 0.1 use_stretch True lengths [[0.99, 0.99], [0.97, 0.97], [0.96, 0.96]]
seen: ik_stretch 0.1 use_stretch False lengths [[1.0, 1.0], [1.0, 1.0], [1.0, 1.0]]
seen: ik_stretch 0.0 use_stretch True lengths [[1.0, 1.0], [1.0, 1.0], [1.0, 1.0]]"
seen=$("$folder/venv/bin/python" "$folder/show.py" 2>/dev/null | grep '^seen: ')
echo "$seen"
[ "$seen" = "$expected" ] || { echo "not what was seen before:"; echo "$expected"; exit 1; }
