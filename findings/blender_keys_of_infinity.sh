#!/usr/bin/env bash
# Blender 5.0.1 (bpy): a key of infinity is clamped when it is set by itself, and kept when it is set in bulk.
#
# Two ways to write the same number are expected to store the same. keyframe.co.y = inf stores the largest single-precision number;
# keyframe_points.foreach_set keeps inf; numbers that are none pass both ways. Oncue refuses to edit a take whose keys are not
# within reach of any scene (addon/bridge/take.py).
# Seen on 2026-11-29, the same in 4.2.23 and 5.2.3.
# Needs Python 3.11 and fetches Blender's Python module (375 MB). Fails when the behaviour changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3.11 -m venv "$folder/venv" 2>/dev/null || python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet bpy==5.0.1
cat > "$folder/show.py" <<'PYTHON'
import math

import bpy
from bpy_extras.anim_utils import action_ensure_channelbag_for_slot

action = bpy.data.actions.new("Action")
slot = action.slots.new("OBJECT", "Thing")
curve = action_ensure_channelbag_for_slot(action, slot).fcurves.new("location", index=0)
curve.keyframe_points.add(2)
curve.keyframe_points[0].co.y = math.inf
one = curve.keyframe_points[0].co.y
curve.keyframe_points.foreach_set("co", [1.0, math.inf, 2.0, math.nan])
print("seen:", one, *(key.co.y for key in curve.keyframe_points), flush=True)
PYTHON
expected='seen: 3.4028234663852886e+38 inf nan'
seen=$("$folder/venv/bin/python" "$folder/show.py" | grep '^seen: ')
echo "$seen"
[ "$seen" = "$expected" ] || { echo "not what was seen before:"; echo "$expected"; exit 1; }
