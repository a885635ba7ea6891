#!/usr/bin/env bash
# Blender 5.0.1 (bpy): whether a new modifier shows in edit mode depends on its type.
#
# One expects that a modifier is shown in edit mode until somebody switches that off. modifiers.new() leaves show_in_editmode off for
# Displace, Boolean, Decimate and Remesh, and on for Bevel, Array and Solidify: what a depsgraph gives of an object in edit mode
# is another shape than what renders. Oncue reads such an object from a copy outside edit mode (addon/bridge/edit_mode.py).
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
mesh = bpy.data.objects.new("Mesh", bpy.data.meshes.new("Mesh"))
kinds = ("ARRAY", "BEVEL", "BOOLEAN", "DECIMATE", "DISPLACE", "REMESH", "SOLIDIFY")
shown = {kind: mesh.modifiers.new(kind, kind).show_in_editmode for kind in kinds}
print("seen:", *(f"{kind}={shown[kind]}" for kind in kinds), flush=True)
PYTHON
expected='seen: ARRAY=True BEVEL=True BOOLEAN=False DECIMATE=False DISPLACE=False REMESH=False SOLIDIFY=True'
seen=$("$folder/venv/bin/python" "$folder/show.py" | grep '^seen: ')
echo "$seen"
[ "$seen" = "$expected" ] || { echo "not what was seen before:"; echo "$expected"; exit 1; }
