#!/usr/bin/env bash
# Blender 5.0.1 (bpy): after an object is removed, view_layer.objects holds None in its place.
#
# One expects a collection of objects to hold objects. Until the view layer is updated, iterating it gives None for what was removed,
# so that a comprehension over its names raises AttributeError. Oncue looks at what is there only after an update
# (addon/bridge/what_counts.py).
# Seen on 2026-11-29, the same in 4.2.23 and 5.2.3.
# Needs Python 3.11 and fetches Blender's Python module (375 MB). Fails when the behaviour changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3.11 -m venv "$folder/venv" 2>/dev/null || python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet bpy==5.0.1
cat > "$folder/show.py" <<'PYTHON'
import bpy

bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
layer = bpy.context.view_layer
thing = bpy.data.objects.new("Thing", None)
bpy.context.scene.collection.objects.link(thing)
layer.update()
bpy.data.objects.remove(thing)
before = list(layer.objects)
layer.update()
print("seen:", before, list(layer.objects), flush=True)
PYTHON
expected='seen: [None] []'
seen=$("$folder/venv/bin/python" "$folder/show.py" | grep '^seen: ')
echo "$seen"
[ "$seen" = "$expected" ] || { echo "not what was seen before:"; echo "$expected"; exit 1; }
