#!/usr/bin/env bash
# Blender 5.0.1 (bpy): of an .fbx at 30/1.001 frames a second one of Blender's two importers stretches the keys by 1.001.
#
# 61 keys on whole frames, exported by Blender at 29.97 frames a second, are expected to come back on whole frames of a scene at
# 29.97. wm.fbx_import does that. import_scene.fbx sets the scene to 29.97, too, but places the keys as at 30: the last lies
# on frame 61.06, and a minute of motion lasts 0.06 s longer. At 30, 25 or 24 both agree. Oncue asks wm.fbx_import first
# (addon/bridge/imported_captures.py).
# Seen on 2026-11-29; import_scene.fbx the same in 4.2.23, which has no other, and in 5.2.3.
# Needs Python 3.11 and fetches Blender's Python module (375 MB). Fails when the behaviour changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3.11 -m venv "$folder/venv" 2>/dev/null || python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet bpy==5.0.1
cat > "$folder/show.py" <<'PYTHON'
import sys

import bpy

path = sys.argv[1]


def empty_file():
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)


for base in (1.0, 1.001):
    empty_file()
    scene = bpy.context.scene
    scene.render.fps, scene.render.fps_base = 30, base
    scene.frame_start, scene.frame_end = 1, 61
    armature = bpy.data.armatures.new("Armature")
    thing = bpy.data.objects.new("Armature", armature)
    scene.collection.objects.link(thing)
    bpy.context.view_layer.objects.active = thing
    bpy.ops.object.mode_set(mode="EDIT")
    armature.edit_bones.new("Bone").tail = (0, 0, 1)
    bpy.ops.object.mode_set(mode="OBJECT")
    for frame, x in ((1, 0.0), (61, 1.0)):
        thing.pose.bones["Bone"].location = (x, 0, 0)
        thing.pose.bones["Bone"].keyframe_insert("location", frame=frame)
    bpy.ops.export_scene.fbx(filepath=path)
    for group, name in (("wm", "fbx_import"), ("import_scene", "fbx")):
        empty_file()
        getattr(getattr(bpy.ops, group), name)(filepath=path)
        render = bpy.context.scene.render
        (action,) = bpy.data.actions
        rate = f"{render.fps / render.fps_base:.2f}"
        print(f"seen: {group}.{name} last key {action.frame_range[1]:.2f} at {rate}", flush=True)
PYTHON
expected='seen: wm.fbx_import last key 61.00 at 30.00
seen: import_scene.fbx last key 61.00 at 30.00
seen: wm.fbx_import last key 61.00 at 29.97
seen: import_scene.fbx last key 61.06 at 29.97'
seen=$("$folder/venv/bin/python" "$folder/show.py" "$folder/armature.fbx" 2>/dev/null | grep '^seen: ')
echo "$seen"
[ "$seen" = "$expected" ] || { echo "not what was seen before:"; echo "$expected"; exit 1; }
