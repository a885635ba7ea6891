"""Runs of the main job that are short enough for tests."""

import json
import os
from pathlib import Path

import bpy
import numpy as np

#: One small update from scratch and few rollouts: the whole chain on a small budget, the same on every machine.
QUICK = {
    "ppo": {"prior": False, "updates": 1, "tuples": 1500},
    "kept": {"rollouts": 48, "rounds": 1, "more_rounds": 0},
}


def set_quick(scene):
    scene.oncue.overrides = json.dumps(QUICK)


def forget_policies():
    """Nothing is kept any more: neither by the extension nor by `batch.py` without it, in a folder of its own."""
    for kept in Path(os.environ["BLENDER_USER_RESOURCES"]).rglob("*.oncuepolicy"):
        kept.unlink()


def keys_of(oncue, action):
    """Every channel of an action: (data path, index) → its keys' coordinates as bytes."""
    keys = {}
    for curve in oncue("bridge.compat").action_curves(action):
        values = np.empty(len(curve.keyframe_points) * 2, dtype=np.float32)
        curve.keyframe_points.foreach_get("co", values)
        keys[(curve.data_path, curve.array_index)] = values.tobytes()
    return keys


def current_action(context=None):
    character = (context or bpy.context).scene.oncue.character
    return character.animation_data.action


def datablocks():
    """How much of everything the file holds."""
    kinds = ("objects", "meshes", "armatures", "actions", "collections", "materials", "texts", "node_groups")
    return {kind: sorted(item.name for item in getattr(bpy.data, kind)) for kind in kinds}
