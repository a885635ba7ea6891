#!/usr/bin/env bash
# Blender 5.0.1 (bpy): a custom property that a library override has gained, or changed, is gone when the file is opened again.
#
# A rig is linked and overridden, as every animator's is. On the override its location is set, a custom property of the library's
# is changed, one is added, and one is added and flagged by property_overridable_library_set, which answers True. All are there until
# the file is saved; after it was opened again the location is there, the changed one is the library's, and both that were added are
# missing, without a word. What stays: a custom property that the library's own object has and has flagged, and a property that an
# extension registers with override={'LIBRARY_OVERRIDABLE'}. One that it registers without reads as its default.
# Oncue keeps the bones that an artist names on a rig in a registered one (Object.oncue_mapping in addon/properties.py).
# Seen on 2026-11-30; the same in 4.2.23 and 5.2.3.
# Needs Python 3.11 and fetches Blender's Python module (375 MB). Fails when the behaviour changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3.11 -m venv "$folder/venv" 2>/dev/null || python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet bpy==5.0.1
cat > "$folder/show.py" <<'PYTHON'
import os
import sys

import bpy

bpy.types.Object.registered = bpy.props.IntProperty(override={"LIBRARY_OVERRIDABLE"})
bpy.types.Object.not_overridable = bpy.props.IntProperty()
library, shot = (os.path.join(sys.argv[1], name) for name in ("rig.blend", "shot.blend"))

bpy.ops.wm.read_factory_settings(use_empty=True)
rig = bpy.data.objects.new("Rig", bpy.data.armatures.new("Rig"))
bpy.context.scene.collection.objects.link(rig)
rig["changed"] = rig["flagged"] = 1
rig.property_overridable_library_set('["flagged"]', True)
bpy.ops.wm.save_as_mainfile(filepath=library)

bpy.ops.wm.read_factory_settings(use_empty=True)
with bpy.data.libraries.load(library, link=True) as (_, wanted):
    wanted.objects = ["Rig"]
rig = wanted.objects[0].override_create(remap_local_usages=True)
bpy.context.scene.collection.objects.link(rig)
for name in ("changed", "flagged", "added", "added_and_flagged"):
    rig[name] = 2
answer = rig.property_overridable_library_set('["added_and_flagged"]', True)
rig.registered = rig.not_overridable = 2
rig.location.x = 2.0


def tell(when, rig):
    custom = {name: rig.get(name) for name in ("changed", "flagged", "added", "added_and_flagged")}
    print(f"seen: {when} {custom} registered {rig.registered} not_overridable {rig.not_overridable} x {rig.location.x:g}")


tell(f"before ({answer})", rig)
bpy.ops.wm.save_as_mainfile(filepath=shot)
bpy.ops.wm.open_mainfile(filepath=shot)
tell("after", next(thing for thing in bpy.data.objects if thing.library is None))
PYTHON
expected="seen: before (True) {'changed': 2, 'flagged': 2, 'added': 2, 'added_and_flagged': 2} registered 2 not_overridable 2 x 2
seen: after {'changed': 1, 'flagged': 2, 'added': None, 'added_and_flagged': None} registered 2 not_overridable 0 x 2"
seen=$("$folder/venv/bin/python" "$folder/show.py" "$folder" 2>/dev/null | grep '^seen: ')
echo "$seen"
[ "$seen" = "$expected" ] || { echo "not what was seen before:"; echo "$expected"; exit 1; }
