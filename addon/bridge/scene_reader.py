# SPDX-License-Identifier: GPL-3.0-or-later
"""The evaluated meshes of the scene → one array of world triangles, for the core's scene index.

Modifiers, instances (collections, geometry nodes) and world transforms are in, and a mesh in edit mode as it is edited;
the character that is moved and what belongs to it, the cues, what the view hides, shown as wire or bounds, or excluded,
is left out.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import bpy
import numpy as np

from ..errors import ScaleError, SceneError
from .edit_mode import copies_outside
from .scene_time import may_deform, may_move, simulation_fault
from .shown_cues import ENDS, visible_cues
from .what_counts import Furniture

#: A scene wider than this is hardly modelled in metres.
WIDEST_ROOM = 60.0
#: Half of a scene's objects are no longer than this where it is modelled in metres, and nobody walks less, metres.
LARGEST_FURNITURE, SHORTEST_WAY = 10.0, 0.5
#: Single precision has centimetres left up to here, metres.
FARTHEST = 1e5
#: Larger meshes are not tried for having no area, triangles; the core leaves out single ones that have none.
LOOKED_AT_CLOSELY = 100_000


@dataclass(frozen=True)
class Movable:
    """A mesh of the scene that something may move or deform: its part of the arrays, and what tells its instance from
    others."""

    name: str
    key: tuple
    #: What its corners were taken into the world by.
    matrix: np.ndarray
    first_vertex: int
    end_vertex: int
    first_triangle: int
    end_triangle: int
    #: Whether its corners may lie otherwise in the object on another frame.
    may_deform: bool = False


def instance_key(thing: bpy.types.Object, instance: bpy.types.DepsgraphObjectInstance) -> tuple:
    """Tells an instance of an object from others, at every frame alike."""
    if not instance.is_instance:
        return (thing.session_uid,)
    return thing.session_uid, instance.parent.original.session_uid, tuple(instance.persistent_id)


@dataclass
class SceneMeshes:
    """W: the scene's triangles, world, metres."""

    #: float32, shape (n, 3).
    positions: np.ndarray
    #: uint32, shape (m, 3).
    triangles: np.ndarray
    #: How many objects and instances were read.
    object_count: int = 0
    #: The longest side of each, metres.
    sizes: list[float] = field(default_factory=list)
    #: (object, reason) of each mesh that could not be used.
    skipped: list[tuple[str, str]] = field(default_factory=list)
    #: What may move by itself, each as it stands now and part of the triangles too.
    movable: list[Movable] = field(default_factory=list)
    #: The object of each triangle, by its place in `names`: uint32, shape (m,).
    owners: np.ndarray = field(default_factory=lambda: np.empty(0, np.uint32))
    names: list[str] = field(default_factory=list)


def read_scene(
    context: bpy.types.Context,
    *,
    exclude: bpy.types.Collection | None = None,
    metres_per_unit: float = 1.0,
    scale_confirmed: bool = True,
    cast: tuple[bpy.types.Object, ...] = (),
) -> SceneMeshes:
    """Reads the scene as the viewport shows it at the current frame, without the `cast`: several characters that a run
    moves.

    Raises SceneError when nothing can be collided with, and, unless the scale is confirmed, ScaleError when the
    scene's size says that it was not modelled in metres.
    """
    with copies_outside(context) as copies:
        meshes = _read_meshes(context, Furniture(context, exclude, cast), copies, metres_per_unit)
    if not scale_confirmed:
        _check_scale(context, meshes)
    return meshes


def _read_meshes(
    context: bpy.types.Context,
    furniture: Furniture,
    copies: dict[bpy.types.Object, bpy.types.Object],
    metres_per_unit: float,
) -> SceneMeshes:
    """`copies`: what is read in place of an object, and counts as the object does."""
    replaced = set(copies.values())
    depsgraph = context.evaluated_depsgraph_get()
    positions, triangles, sizes, skipped, movable = [], [], [], [], []
    vertex_count, triangle_count, object_count = 0, 0, 0
    names: list[str] = []
    counts: list[int] = []
    #: Object → whether it may move, and whether it may deform.
    may_change: dict[bpy.types.Object, tuple[bool, bool]] = {}
    meshes: dict[int, tuple[np.ndarray, np.ndarray]] = {}

    for instance in depsgraph.object_instances:
        evaluated = instance.object
        if evaluated.type != "MESH" or not instance.show_self:
            continue
        owners = _owners(instance)
        if not replaced.isdisjoint(owners):
            continue
        owners = [copies.get(owner, owner) for owner in owners]
        if not furniture.counts(owners):
            continue
        name = owners[0].name
        mesh = evaluated.data
        key = mesh.as_pointer()
        if key not in meshes:
            meshes[key] = _read_edited(evaluated) if mesh.is_editmode else _read_mesh(mesh)
        local, corners = meshes[key]
        if not len(corners):
            continue
        matrix = np.array(instance.matrix_world, dtype=np.float64)
        with np.errstate(invalid="ignore", over="ignore"):
            world = ((local @ matrix[:3, :3].T + matrix[:3, 3]) * metres_per_unit).astype(np.float32)
        fault = _fault(world, corners)
        if fault:
            skipped.append((name, f"{name} {fault}; it was left out of the collision."))
            continue
        if np.linalg.det(matrix[:3, :3]) < 0.0:
            # A mirrored object: keep the outside outside.
            corners = corners[:, ::-1]
        positions.append(world)
        triangles.append(corners + np.uint32(vertex_count))
        for owner in owners:
            if owner not in may_change:
                may_change[owner] = may_move(owner, by_bones=True), may_deform(owner)
                if said := simulation_fault(owner, context.scene):
                    skipped.append((owner.name, f"{owner.name} {said}"))
        moves, deforms = (any(may_change[owner][k] for owner in owners) for k in (0, 1))
        shown_name = furniture.other_person(owners) or owners[-1].name
        if moves or deforms:
            part = (vertex_count, vertex_count + len(world), triangle_count, triangle_count + len(corners))
            movable.append(Movable(shown_name, instance_key(owners[0], instance), matrix, *part, deforms))
        names.append(shown_name)
        counts.append(len(corners))
        vertex_count += len(world)
        triangle_count += len(corners)
        sizes.append(float(np.ptp(world, axis=0).max()))
        object_count += 1

    if not triangles:
        broken = f" ({skipped[0][1]})" if skipped else ""
        raise SceneError(
            "The scene has no visible mesh to walk on or sit on. "
            "Add a floor and furniture, or show what is hidden or excluded." + broken
        )
    joined = np.concatenate(positions), np.concatenate(triangles)
    of_triangles = np.repeat(np.arange(len(names), dtype=np.uint32), counts)
    return SceneMeshes(*joined, object_count, sizes, skipped, movable, of_triangles, names)


def _fault(world: np.ndarray, corners: np.ndarray) -> str | None:
    """What makes a mesh unfit for collision: the rest of a sentence, or None."""
    # Not a number is not smaller either.
    if not np.abs(world).max() < FARTHEST:
        return "has vertices that are not numbers" if np.isnan(world).any() else "reaches farther than 100 km"
    if len(corners) <= LOOKED_AT_CLOSELY:
        a, b, c = (world[corners[:, k]] for k in range(3))
        if not np.cross(b - a, c - a).any():
            return "has no area"
    return None


def suggested_scale(extent: float, unit_length: float) -> float | None:
    """Metres per unit that make sense of a scene `extent` units wide, or None when metres do."""
    if extent <= WIDEST_ROOM:
        return None
    if unit_length != 1.0 and 1.0 <= extent * unit_length <= WIDEST_ROOM:
        return unit_length
    return 0.01 if extent * 0.01 <= WIDEST_ROOM else 0.001


def _check_scale(context: bpy.types.Context, meshes: SceneMeshes) -> None:
    """Raises ScaleError where the furniture and the way between the cues say that the units are no metres.

    The widest object alone says nothing: a ground or a sky is as wide as it likes.
    """
    extent = float((meshes.positions.max(axis=0) - meshes.positions.min(axis=0)).max())
    scale = suggested_scale(extent, context.scene.unit_settings.scale_length)
    if scale is None or float(np.median(meshes.sizes)) <= LARGEST_FURNITURE:
        return
    way = _way(context)
    if way is None or way * scale >= SHORTEST_WAY:
        word = {0.01: "centimetres", 0.001: "millimetres"}.get(round(scale, 6), "other units")
        raise ScaleError(
            f"The scene is {extent:.0f} units wide: it seems to be modelled in {word}. Set Scene Scale to {scale:g} "
            f"metres per unit (or to 1 if it really is that large) and run again."
        )


def _way(context: bpy.types.Context) -> float | None:
    """How far the end cue lies from the start, scene units, or None while one of them is missing."""
    starts, ends = visible_cues(context, "start"), visible_cues(context, *ENDS)
    if not starts or not ends:
        return None
    return (starts[0].matrix_world.translation - ends[0].matrix_world.translation).length


def _owners(instance: bpy.types.DepsgraphObjectInstance) -> list[bpy.types.Object]:
    """The original objects that an instance comes from: itself, and what instances it."""
    owners = [instance.object.original]
    if instance.is_instance and instance.parent:
        owners.append(instance.parent.original)
    return owners


def _read_edited(evaluated: bpy.types.Object) -> tuple[np.ndarray, np.ndarray]:
    """`_read_mesh` of an object in edit mode, whose evaluated mesh has no vertices or attributes until it is copied."""
    try:
        return _read_mesh(evaluated.to_mesh())
    finally:
        evaluated.to_mesh_clear()


def _read_mesh(mesh: bpy.types.Mesh) -> tuple[np.ndarray, np.ndarray]:
    """Local positions (n, 3) float32 and triangles (m, 3) uint32 of an evaluated mesh."""
    mesh.calc_loop_triangles()
    count = len(mesh.loop_triangles)
    positions = corners_of(mesh)
    if not count or not len(positions):
        return np.empty((0, 3), np.float32), np.empty((0, 3), np.uint32)
    # Reading the triangles' loops and looking the vertices up is faster than reading the vertices.
    loops = np.empty(count * 3, dtype=np.int32)
    mesh.loop_triangles.foreach_get("loops", loops)
    corner_vertices = np.empty(len(mesh.loops), dtype=np.int32)
    mesh.attributes[".corner_vert"].data.foreach_get("value", corner_vertices)
    return positions, corner_vertices[loops].astype(np.uint32).reshape(-1, 3)


def corners_of(mesh: bpy.types.Mesh) -> np.ndarray:
    """Local positions of an evaluated mesh's vertices, (n, 3) float32; none of a mesh in edit mode."""
    positions = np.empty((len(mesh.vertices), 3), dtype=np.float32)
    if len(positions):
        mesh.attributes["position"].data.foreach_get("vector", positions.reshape(-1))
    return positions
