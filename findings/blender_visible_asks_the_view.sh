#!/usr/bin/env bash
# Blender 5.0.1 (bpy): whether an object is visible in a view layer depends on which view the mouse is in.
#
# One expects visible_get(view_layer=LAYER) to tell what a view layer shows, as its arguments say. Without the argument `viewport` it
# asks the 3D view of the context too, where there is one: the same call says another thing in local view, when a button of
# the sidebar makes it, than in the background. Oncue asks without an area (addon/bridge/what_counts.py).
# Seen on 2026-11-29, the same in 4.2.23 and 5.2.3. In 4.2.23 visible_in_viewport_get moreover says no of everything in local view.
# Needs Python 3.11 and fetches Blender's Python module (375 MB). Fails when the behaviour changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3.11 -m venv "$folder/venv" 2>/dev/null || python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet bpy==5.0.1
cat > "$folder/show.py" <<'PYTHON'
import bpy

bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
things = [bpy.data.objects.new(name, None) for name in ("Inside", "Outside")]
for thing in things:
    bpy.context.scene.collection.objects.link(thing)
layer = bpy.context.view_layer
layer.update()
things[0].select_set(True)
window = bpy.context.window_manager.windows[0]
area = next(area for area in window.screen.areas if area.type == "VIEW_3D")
region = next(region for region in area.regions if region.type == "WINDOW")
with bpy.context.temp_override(window=window, area=area, region=region):
    bpy.ops.view3d.localview()
    layer.update()
    with_view = [thing.visible_get(view_layer=layer) for thing in things]
    with bpy.context.temp_override(area=None):
        without = [thing.visible_get(view_layer=layer) for thing in things]
print("seen:", with_view, without, flush=True)
PYTHON
expected='seen: [True, False] [True, True]'
seen=$("$folder/venv/bin/python" "$folder/show.py" | grep '^seen: ')
echo "$seen"
[ "$seen" = "$expected" ] || { echo "not what was seen before:"; echo "$expected"; exit 1; }
