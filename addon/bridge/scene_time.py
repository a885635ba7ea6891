# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene's time: its rate, its current frame, and what moves in it by itself."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager

import bpy
import numpy as np

from . import compat

#: Frames that are looked at to see whether a thing moves, seconds after the first.
LOOKED_AT = (0.0, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0)
#: How far the entries of a world matrix may differ for a thing that stands still.
STANDS_STILL = 1e-4


def show(scene: bpy.types.Scene, frame: float) -> None:
    """Goes to a frame that may lie between two."""
    whole = math.floor(frame + 1e-6)
    scene.frame_set(whole, subframe=min(max(frame - whole, 0.0), 0.999999))


def frame_rate(scene: bpy.types.Scene) -> float:
    return scene.render.fps / scene.render.fps_base


@contextmanager
def current_frame_kept(scene: bpy.types.Scene) -> Iterator[None]:
    """Afterwards the scene stands at the frame at which it stood before."""
    frame, subframe = scene.frame_current, scene.frame_subframe
    try:
        yield
    finally:
        scene.frame_set(frame, subframe=subframe)


#: Modifiers by which a mesh may be another on each frame, whatever else there is; so may one that names an object.
TIMED = {
    "BUILD",
    "CLOTH",
    "DISPLACE",
    "DYNAMIC_PAINT",
    "EXPLODE",
    "FLUID",
    "MESH_CACHE",
    "MESH_SEQUENCE_CACHE",
    "OCEAN",
    "PARTICLE_INSTANCE",
    "SOFT_BODY",
    "WARP",
    "WAVE",
}
#: Nodes by which geometry nodes may be.
TIMED_NODES = {
    "GeometryNodeCollectionInfo",
    "GeometryNodeInputSceneTime",
    "GeometryNodeObjectInfo",
    "GeometryNodeSelfObject",
    "GeometryNodeSimulationOutput",
}


def may_move(thing: bpy.types.Object, *, own_action: bool = True, by_bones: bool = False) -> bool:
    """Whether something animates where an object stands: itself, what it hangs on, or constraints. Cheap; may be wrong
    only where it says yes. With `by_bones` also what the bones of an armature that it hangs on are constrained to.
    """
    seen = set()
    todo = [(thing, own_action)]
    while todo:
        one, with_action = todo.pop()
        if one in seen:
            continue
        seen.add(one)
        data = one.animation_data
        if data is not None:
            tracks = data.use_nla and any(not track.mute and len(track.strips) for track in data.nla_tracks)
            played = compat.action_curves(data.action, one) if with_action and data.action is not None else []
            if tracks or len(data.drivers) or any(map(_varies, played)):
                return True
        if _is_simulated_body(one):
            return True
        constraints = [c for c in one.constraints if not c.mute and c.influence > 0.0]
        if by_bones and one.pose is not None:
            bent = [c for bone in one.pose.bones for c in bone.constraints if not c.mute and c.influence > 0.0]
            constraints += [c for c in bent if getattr(c, "target", None) is not None or c.type == "ARMATURE"]
        targets = [getattr(c, "target", None) for c in constraints]
        if any(target is None for target in targets):
            return True
        if one.parent is not None and one.parent_type in {"VERTEX", "VERTEX_3"}:
            return True
        todo += [(other, True) for other in [one.parent, *targets] if other is not None]
    return False


def _varies(curve: bpy.types.FCurve) -> bool:
    values = [point.co.y for point in curve.keyframe_points]
    return bool(curve.modifiers) or (len(values) > 1 and max(values) - min(values) > 1e-6)


def _is_simulated_body(thing: bpy.types.Object) -> bool:
    body = thing.rigid_body
    return body is not None and body.type == "ACTIVE" and body.enabled and not body.kinematic


def is_simulated_unbaked(thing: bpy.types.Object, scene: bpy.types.Scene) -> bool:
    """Whether a simulation moves or deforms an object that only frames in their order show: it has no bake."""
    caches = [m.point_cache for m in thing.modifiers if m.type in {"CLOTH", "SOFT_BODY"} and m.show_viewport]
    if _is_simulated_body(thing) and scene.rigidbody_world is not None and scene.rigidbody_world.enabled:
        caches.append(scene.rigidbody_world.point_cache)
    return any(cache is not None and not cache.is_baked for cache in caches)


def may_deform(thing: bpy.types.Object, seen: frozenset[bpy.types.Object] = frozenset()) -> bool:
    """Whether the mesh of an object may have another shape on another frame. Cheap; may be wrong only where it says
    yes. `seen`: what was asked already."""
    if thing in seen:
        return False
    seen, data = seen | {thing}, thing.data
    keys = getattr(data, "shape_keys", None)
    if any(one is not None and one.animation_data is not None for one in (data, keys)):
        return True
    shown = [modifier for modifier in thing.modifiers if modifier.show_viewport]
    if any(_varies_mesh(thing, modifier, seen) for modifier in shown):
        return True
    return bool(thing.modifiers) and _keys_modifiers(thing)


def _varies_mesh(thing: bpy.types.Object, modifier: bpy.types.Modifier, seen: frozenset[bpy.types.Object]) -> bool:
    if modifier.type == "NODES":
        return modifier.node_group is not None and _varies_nodes(modifier.node_group, set())
    if modifier.type in TIMED:
        return True
    pointers = [prop.identifier for prop in modifier.bl_rna.properties if prop.type == "POINTER"]
    named = [one for one in (getattr(modifier, p) for p in pointers) if isinstance(one, bpy.types.Object)]
    # A mesh that is moved past what its modifier names is bent by that too.
    return any(may_move(one, by_bones=True) or may_deform(one, seen) for one in [thing, *named] if named)


def _varies_nodes(tree: bpy.types.NodeTree, seen: set[bpy.types.NodeTree]) -> bool:
    if tree in seen:
        return False
    seen.add(tree)
    groups = [node.node_tree for node in tree.nodes if node.type == "GROUP" and node.node_tree is not None]
    return (
        tree.animation_data is not None
        or any(node.bl_idname in TIMED_NODES for node in tree.nodes)
        or any(_varies_nodes(group, seen) for group in groups)
    )


def _keys_modifiers(thing: bpy.types.Object) -> bool:
    """Whether keys or drivers of an object reach its modifiers."""
    data = thing.animation_data
    if data is None:
        return False
    curves = [*data.drivers, *(compat.action_curves(data.action, thing) if data.action is not None else [])]
    return any(len(track.strips) for track in data.nla_tracks) or any(
        curve.data_path.startswith("modifiers[") for curve in curves
    )


def moving(context: bpy.types.Context, things: list[bpy.types.Object], first_frame: int) -> list[bpy.types.Object]:
    """Those of `things` that stand elsewhere at some of the frames looked at than at the first.

    Goes through the frames and comes back to the current one.
    """
    scene, seen = context.scene, []
    with current_frame_kept(scene):
        for seconds in LOOKED_AT:
            scene.frame_set(first_frame + math.floor(seconds * frame_rate(scene)))
            depsgraph = context.evaluated_depsgraph_get()
            seen.append([np.array(thing.evaluated_get(depsgraph).matrix_world) for thing in things])
    return [
        thing
        for k, thing in enumerate(things)
        if any(not np.allclose(places[k], seen[0][k], atol=STANDS_STILL) for places in seen)
    ]
