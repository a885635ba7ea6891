# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene's time: its rate, its current frame, and what moves in it by itself."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from contextlib import contextmanager

import bpy
import numpy as np

from . import compat

#: Frames that are looked at to see whether a thing moves, seconds after the first.
LOOKED_AT = tuple(0.5 * half for half in range(33))
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
#: Ways of hanging on an object by which that bends a mesh as a modifier would, without one.
BENDING_PARENTS = {"ARMATURE", "LATTICE"}
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
        if _is_simulated_body(one) or (one is not thing and _is_path_that_runs(one)):
            return True
        constraints = [c for c in one.constraints if not c.mute and c.influence > 0.0]
        # What hangs on another goes along with its bones, whichever of them it hangs on.
        if (by_bones or one is not thing) and one.pose is not None:
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


def _is_path_that_runs(thing: bpy.types.Object) -> bool:
    """Whether what hangs on a curve goes along it as time goes: by keys or drivers of the curve itself."""
    return thing.type == "CURVE" and thing.data.animation_data is not None


def _is_simulated_body(thing: bpy.types.Object) -> bool:
    body = thing.rigid_body
    return body is not None and body.type == "ACTIVE" and body.enabled and not body.kinematic


NOT_BAKED = "is simulated and not baked, and may stand otherwise than it was read: bake it first."
#: Nothing tells a simulation of nodes that is baked from one that is not.
NODES_SIMULATE = "is simulated by geometry nodes, and may stand otherwise than it was read where that is not baked."


def simulation_fault(thing: bpy.types.Object, scene: bpy.types.Scene) -> str | None:
    """What is said of an object that a simulation moves or deforms which only frames in their order show, or None.

    It is the rest of a sentence that begins with its name.
    """
    shown = [modifier for modifier in thing.modifiers if modifier.show_viewport]
    caches = [modifier.point_cache for modifier in shown if modifier.type in {"CLOTH", "SOFT_BODY"}]
    if _is_simulated_body(thing) and scene.rigidbody_world is not None and scene.rigidbody_world.enabled:
        caches.append(scene.rigidbody_world.point_cache)
    for modifier in shown:
        if modifier.type == "DYNAMIC_PAINT" and modifier.canvas_settings is not None:
            caches += [surface.point_cache for surface in modifier.canvas_settings.canvas_surfaces if surface.is_active]
        elif modifier.type == "PARTICLE_SYSTEM" and _particles_are_seen(modifier.particle_system):
            caches.append(modifier.particle_system.point_cache)
        elif modifier.type == "FLUID" and modifier.fluid_type == "DOMAIN":
            domain = modifier.domain_settings
            if domain.domain_type == "LIQUID" and not domain.has_cache_baked_data:
                return NOT_BAKED
    if any(cache is not None and not cache.is_baked for cache in caches):
        return NOT_BAKED
    trees = [modifier.node_group for modifier in shown if modifier.type == "NODES" and modifier.node_group is not None]
    if any(_has_nodes(tree, {"GeometryNodeSimulationOutput"}) for tree in trees):
        return NODES_SIMULATE
    return None


def _particles_are_seen(system: bpy.types.ParticleSystem | None) -> bool:
    """Whether particles are emitted over time and shown as meshes."""
    chosen = system.settings if system is not None else None
    return chosen is not None and chosen.type == "EMITTER" and chosen.render_type in {"OBJECT", "COLLECTION"}


def may_deform(thing: bpy.types.Object, seen: frozenset[bpy.types.Object] = frozenset()) -> bool:
    """Whether the mesh of an object may have another shape on another frame. Cheap; may be wrong only where it says
    yes. `seen`: what was asked already."""
    if thing in seen:
        return False
    seen, data = seen | {thing}, thing.data
    keys = getattr(data, "shape_keys", None)
    if any(one is not None and one.animation_data is not None for one in (data, keys)):
        return True
    if thing.type == "META":
        return any(may_move(ball, by_bones=True) or ball.data.animation_data is not None for ball in _family(thing))
    bent = thing.parent is not None and thing.parent_type in BENDING_PARENTS
    if bent and any(may_move(one, by_bones=True) or may_deform(one, seen) for one in (thing, thing.parent)):
        return True
    shown = [modifier for modifier in thing.modifiers if modifier.show_viewport]
    if any(_varies_mesh(thing, modifier, seen) for modifier in shown):
        return True
    return bool(thing.modifiers) and _keys_modifiers(thing)


def _family(ball: bpy.types.Object) -> list[bpy.types.Object]:
    """The metaballs that flow into one mesh with this one, which is theirs: those called alike but for their number."""
    things = {ball, *(thing for scene in ball.users_scene for thing in scene.objects)}
    name = _without_number(ball.name)
    return [thing for thing in things if thing.type == "META" and _without_number(thing.name) == name]


def _without_number(name: str) -> str:
    return re.sub(r"\.\d+$", "", name)


def _varies_mesh(thing: bpy.types.Object, modifier: bpy.types.Modifier, seen: frozenset[bpy.types.Object]) -> bool:
    if modifier.type == "NODES":
        return modifier.node_group is not None and _varies_nodes(modifier.node_group)
    if modifier.type in TIMED:
        return True
    pointers = [prop.identifier for prop in modifier.bl_rna.properties if prop.type == "POINTER"]
    named = [one for one in (getattr(modifier, p) for p in pointers) if isinstance(one, bpy.types.Object)]
    # A mesh that is moved past what its modifier names is bent by that too.
    return any(may_move(one, by_bones=True) or may_deform(one, seen) for one in [thing, *named] if named)


def _varies_nodes(tree: bpy.types.NodeTree) -> bool:
    return any(one.animation_data is not None for one in _trees(tree, set())) or _has_nodes(tree, TIMED_NODES)


def _has_nodes(tree: bpy.types.NodeTree, kinds: set[str]) -> bool:
    """Whether a tree, or one that is a group in it, has a node of these kinds."""
    return any(node.bl_idname in kinds for one in _trees(tree, set()) for node in one.nodes)


def _trees(tree: bpy.types.NodeTree, seen: set[bpy.types.NodeTree]) -> Iterator[bpy.types.NodeTree]:
    """A tree and all that are groups in it, each once."""
    if tree in seen:
        return
    seen.add(tree)
    yield tree
    for node in tree.nodes:
        if node.type == "GROUP" and node.node_tree is not None:
            yield from _trees(node.node_tree, seen)


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
