# SPDX-License-Identifier: GPL-3.0-or-later
"""An armature of any humanoid as a `rig.Rig`: its bones at rest, which of them are which joints, and its soles."""

from __future__ import annotations

import json
from collections.abc import Iterator

import bpy
import numpy as np

from .. import native
from ..body_size import clock
from ..errors import SceneError
from ..rig import LARGEST, SIDES, SMALLEST, Hold, RestRig, Rig, Sole
from . import rigify
from .armature_motion import body_bones, parents_among
from .names import CHARACTER_KEY, REPORT_KEY
from .what_counts import HANGING, OUTLINES, is_shown, things_of

#: What the core says where a joint has no bone.
UNNAMED = "no joint was recognised as"
#: A corner belongs to a foot where so much of it does, and does not go with the toes where so much goes with the rest.
OF_A_FOOT, STIFF = 0.5, 0.95
#: Height of the core's hip joints over its soles, metres.
HIPS = 0.973
#: No corner of a foot is farther from its ankle, the core's metres.
FOOT_REACH = 0.4
#: A corner belongs to the trunk where so much of it does; so many are looked at.
OF_A_TRUNK, MOST_CORNERS = 0.8, 4000
#: Half of the width of the core's trunk, metres, and how much wider a body may be without a word.
TRUNK, WIDER = 0.17, 1.3
#: Fewer corners are no foot.
FEWEST_CORNERS = 6


def mapping_of(character: bpy.types.Object) -> dict[str, str]:
    """The bones that the artist has named for joints: joint → bone. Raises SceneError for what is no such mapping."""
    text = character.oncue_mapping
    try:
        mapping = json.loads(text) if text else {}
    except (TypeError, ValueError):
        mapping = None
    if not isinstance(mapping, dict) or not all(isinstance(one, str) for pair in mapping.items() for one in pair):
        raise SceneError(f"{character.name} has bones named for it that cannot be read: choose them again.")
    return {joint: bone for joint, bone in mapping.items() if bone}


def keep_mapping(character: bpy.types.Object, mapping: dict[str, str]) -> None:
    """Keeps on the armature which bones the artist has named."""
    character.oncue_mapping = json.dumps(mapping) if mapping else ""


#: What was recognised last of some armatures: their bones as they were asked for, and what came of it.
_known: dict[tuple, dict | SceneError] = {}
MOST_KNOWN = 16


def recognized(character: bpy.types.Object, mapping: dict[str, str] | None = None) -> dict:
    """Which bones of an armature are which joints, as `oncue_core.map_rig` gives it. Raises SceneError."""
    mapping = mapping_of(character) if mapping is None else mapping
    # A panel asks at each redraw.
    seen = _seen(character, mapping)
    if seen not in _known:
        while len(_known) >= MOST_KNOWN:
            del _known[next(iter(_known))]
        try:
            _known[seen] = _recognized(character, mapping)
        except SceneError as error:
            _known[seen] = error
    found = _known[seen]
    if isinstance(found, SceneError):
        raise SceneError(str(found))
    return found


def _seen(character: bpy.types.Object, mapping: dict[str, str]) -> tuple:
    """All of an armature by which its bones are recognised."""
    bones = character.data.bones
    places = np.empty(2 * 3 * len(bones), dtype=np.float32)
    bones.foreach_get("head_local", places[: len(places) // 2])
    bones.foreach_get("tail_local", places[len(places) // 2 :])
    return (
        character.name,
        tuple((bone.name, bone.parent.name if bone.parent else "", bone.use_deform) for bone in bones),
        places.tobytes(),
        tuple(mapping.items()),
        tuple(value for row in character.matrix_world for value in row),
    )


def _recognized(character: bpy.types.Object, mapping: dict[str, str]) -> dict:
    for joint, name in mapping.items():
        if name not in character.data.bones:
            raise SceneError(f"{character.name} has no bone {name}, which is named for {joint}: choose another.")
    if rigify.is_rigify(character):
        bones = rigify.body_bones(character)
        parents = rigify.parents_of(bones)
    else:
        bones = body_bones(character, also=set(mapping.values()))
        parents = parents_among(bones)
    world = np.array(character.matrix_world, dtype=np.float64)
    scale = np.cbrt(abs(np.linalg.det(world[:3, :3]))) or 1.0
    turn = world[:3, :3] / scale if np.isfinite(world).all() else np.eye(3)

    def places(points: list) -> list:
        return [tuple(float(c) for c in turn @ np.array(point)) for point in points]

    rest = (
        [bone.name for bone in bones],
        list(parents),
        places([bone.head_local for bone in bones]),
        places([bone.tail_local for bone in bones]),
    )
    try:
        found = native.core.map_rig(*rest, mapping)
    except native.core.InputError as error:
        found = _by_shape(rest, mapping) if UNNAMED in str(error) else None
        if found is None:
            raise SceneError(f"{character.name} was not recognised as a person: {error}") from error
    if rigify.is_rigify(character):
        found["spine"] = [bone for bone in found["spine"] if bone in rigify.SPINE]
    return found


def people(view_layer: bpy.types.ViewLayer) -> Iterator[bpy.types.Object]:
    """The armatures that a view layer shows and that have a person's bones, but for Oncue's own characters."""
    for thing in things_of(view_layer):
        if thing.type != "ARMATURE" or thing.get(CHARACTER_KEY) or not is_shown(thing, view_layer):
            continue
        try:
            recognized(thing)
        except native.expected_errors():
            continue
        yield thing


def _by_shape(rest: tuple, mapping: dict[str, str]) -> dict | None:
    """What the rig's shape says where neither its names nor those that the artist has named do; theirs come first."""
    if not mapping:
        return None
    try:
        seen = native.core.map_rig(*rest, {})
        return native.core.map_rig(*rest, {**seen["joints"], **mapping})
    except native.core.InputError:
        return None


def rig_of(character: bpy.types.Object, skeleton: dict) -> Rig:
    """The rig of an armature. Raises SceneError naming what keeps motion from being put on it."""
    mapping = recognized(character)
    rest = rigify.rest_of(character) if rigify.is_rigify(character) else _rest_of(character)
    plain = Rig(character.name, rest, mapping, skeleton)
    soles = {side: sole for side in SIDES if (sole := _sole(character, plain, mapping, side)) is not None}
    return Rig(character.name, rest, mapping, skeleton, soles) if soles else plain


def size_of(character: bpy.types.Object, rig: Rig, metres_per_unit: float) -> float:
    """How many times as large as the core's body it is. Raises SceneError where nobody is that large or small."""
    scale = float(np.cbrt(np.linalg.det(np.array(character.matrix_world, dtype=np.float64)[:3, :3])))
    size = rig.unit * scale * metres_per_unit
    if not SMALLEST <= size <= LARGEST:
        raise SceneError(
            f"{character.name} has its hips {size * HIPS:.2f} m over its soles, as nobody has: set its scale, or the "
            f"Scene Scale in Oncue's settings, so that they are {SMALLEST * HIPS:.2f} to {LARGEST * HIPS:.2f} m."
        )
    return size


def holds_of_action(action: bpy.types.Action, size: float) -> tuple[Hold, ...]:
    """When which hand holds something in the motion of a take; never where nobody knows any more."""
    try:
        report = json.loads(action.get(REPORT_KEY) or "{}")
        body = report.get("extension", {}).get("body")
        return holds_of(body["task"] if body else report.get("task"), size)
    except (LookupError, TypeError, ValueError, AttributeError):
        return ()


def holds_of(task: dict | None, size: float) -> tuple[Hold, ...]:
    """When which hand holds something, seconds of the scene from the motion's begin; of a task as the core has it."""
    found = []
    task = task or {}
    for hand in [hand for one in [task, *task.get("steps", [])] for hand in one.get("manipulations") or []]:
        first = hand.get("first_frame")
        if first is not None:
            begin = first / 30.0 * clock(size)
            found.append((hand["hand"], begin, begin + (len(hand["path"]) - 1) / 30.0 * clock(size)))
    return tuple(found)


def _rest_of(character: bpy.types.Object) -> RestRig:
    bones = list(character.data.bones)
    index = {bone.name: k for k, bone in enumerate(bones)}
    matrices = np.array([bone.matrix_local for bone in bones], dtype=np.float64).reshape(-1, 4, 4)
    return RestRig(
        tuple(bone.name for bone in bones),
        tuple(index[bone.parent.name] if bone.parent else -1 for bone in bones),
        matrices,
        np.array([bone.tail_local for bone in bones], dtype=np.float64).reshape(-1, 3),
        tuple(bone.use_connect and bone.parent is not None for bone in bones),
    )


def _sole(character: bpy.types.Object, rig: Rig, mapping: dict, side: str) -> Sole | None:
    """The sole of a foot as the meshes on the rig show it at rest, skins and shoes; None where they do not."""
    toes = _with_below(character, mapping["joints"].get(f"{side}Toe"))
    foot = _with_below(character, mapping["joints"].get(f"{side}Foot")) - toes
    ankle = rig.head(f"{side}Foot")
    assert ankle is not None  # a rig without ankles is none
    reach = FOOT_REACH * rig.unit
    worn = [places for places in _worn(character, foot) if np.linalg.norm(places - ankle, axis=1).min() < reach]
    stiff = [*worn, *(c for mesh in skins(character) for c in _corners(character, mesh, foot, ankle, reach, STIFF))]
    corners = [c for mesh in skins(character) for c in _corners(character, mesh, foot | toes, ankle, reach, OF_A_FOOT)]
    corners += [*worn, *(c for c in _worn(character, toes) if np.linalg.norm(c - ankle, axis=1).min() < reach)]
    if not corners:
        return None
    seen = np.concatenate(corners) @ rig.axes
    if len(seen) < FEWEST_CORNERS or not np.isfinite(seen).all():
        return None
    low, back, front = (float(value) for value in (seen[:, 2].min(), seen[:, 1].max(), seen[:, 1].min()))
    ahead = min((float((places @ rig.axes[:, 1]).min()) for places in stiff), default=back)
    return Sole(low, back, front, ahead)


def _with_below(character: bpy.types.Object, name: str | None) -> set[str]:
    """The names of a bone and of all that hang on it, and of what carries the skin in their place on a Rigify rig."""
    bone = character.data.bones.get(name) if name else None
    if bone is None:
        return set()
    found = {bone.name, *(below.name for below in bone.children_recursive)}
    # Rigify's skin hangs on twins of the body's bones.
    return found | {name.replace(rigify.BODY, "DEF-", 1) for name in found if name.startswith(rigify.BODY)}


def _worn(character: bpy.types.Object, bones: set[str]) -> Iterator[np.ndarray]:
    """The corners of each mesh that hangs on one of the bones as a whole, as shoes do, where it is at rest, armature
    space. What nobody sees or takes for solid is none."""
    graph = bpy.context.evaluated_depsgraph_get()
    posed = character.evaluated_get(graph)
    for thing in things_of(bpy.context.view_layer):
        if thing.type != "MESH" or thing.display_type in OUTLINES or not is_shown(thing, bpy.context.view_layer):
            continue
        bone = _carried_by(thing, character)
        if bone not in bones:
            continue
        seen = thing.evaluated_get(graph)
        mesh = seen.to_mesh()
        places = np.empty(len(mesh.vertices) * 3, dtype=np.float32)
        mesh.vertices.foreach_get("co", places)
        seen.to_mesh_clear()
        if not len(places):
            continue
        # Whatever is played: as it lies on the bone now it lies on it at rest.
        on_bone = (posed.matrix_world @ posed.pose.bones[bone].matrix).inverted_safe() @ seen.matrix_world
        to_armature = np.array(character.data.bones[bone].matrix_local @ on_bone, dtype=np.float64)
        yield places.reshape(-1, 3).astype(np.float64) @ to_armature[:3, :3].T + to_armature[:3, 3]


def _carried_by(thing: bpy.types.Object, character: bpy.types.Object) -> str:
    """The bone of an armature that carries an object as a whole, by its parent or a constraint, or by those of what
    it hangs on; an empty name for none."""
    seen: set[bpy.types.Object] = set()
    over: bpy.types.Object | None = thing
    while over is not None and over not in seen:
        seen.add(over)
        for constraint in over.constraints:
            if constraint.type not in HANGING or constraint.mute or not constraint.influence > 0.0:
                continue
            targets = constraint.targets if constraint.type == "ARMATURE" else [constraint]
            if bone := next((one.subtarget for one in targets if one.target == character and one.subtarget), ""):
                return bone
        if over.parent == character:
            return over.parent_bone if over.parent_type == "BONE" else ""
        over = over.parent
    return ""


def girth_remark(character: bpy.types.Object, rig: Rig) -> str | None:
    """What is said of a body much wider than that for which motion is made, whose arms may run into it unseen."""
    trunk = {rig.mapping["joints"]["Hips"], *rig.mapping["spine"]}
    trunk |= {name.replace(rigify.BODY, "DEF-", 1) for name in trunk if name.startswith(rigify.BODY)}
    shoulders = (rig.head("LeftArm"), rig.head("RightArm"))
    assert shoulders[0] is not None and shoulders[1] is not None  # noqa: PT018  # a rig without arms is none
    middle = (shoulders[0] + shoulders[1]) / 2.0
    widest = 0.0
    for mesh in skins(character):
        groups = {group.index for group in mesh.vertex_groups if group.name in trunk}
        count = len(mesh.data.vertices)
        if not groups or not count:
            continue
        to_armature = np.array(character.matrix_world.inverted_safe() @ mesh.matrix_world, dtype=np.float64)
        # A few thousand corners tell how wide a trunk is.
        corners = [mesh.data.vertices[k] for k in range(0, count, max(count // MOST_CORNERS, 1))]
        own = [
            corner.co
            for corner in corners
            if sum(entry.weight for entry in corner.groups if entry.group in groups) > OF_A_TRUNK
        ]
        if len(own) < FEWEST_CORNERS:
            continue
        places = np.array(own, dtype=np.float64) @ to_armature[:3, :3].T + to_armature[:3, 3]
        aside = np.abs((places - middle) @ rig.axes[:, 0])
        widest = max(widest, float(np.quantile(aside, 0.95)))
    times = widest / (TRUNK * rig.unit)
    if times < WIDER:
        return None
    return (
        f"{character.name} is {times:.1f} times as wide as the body that motion is made for: its arms may run into its "
        "trunk, which the report does not see."
    )


def turning_remark(character: bpy.types.Object, bones: list[str]) -> str | None:
    """What is said of bones that turn by angles, before a take is made that Re-solve cannot adapt."""
    turned = [bone for bone in bones if character.pose.bones[bone].rotation_mode != "QUATERNION"]
    if not turned:
        return None
    more = f" and {len(turned) - 1} more" if len(turned) > 1 else ""
    return (
        f"{character.name} has bones that turn by angles ({turned[0]}{more}), and Re-solve will not adapt this "
        "take. To have it do so, set their Rotation Mode to Quaternion (WXYZ) and synthesize again."
    )


def skins(character: bpy.types.Object) -> Iterator[bpy.types.Object]:
    """The meshes that an armature deforms, by a modifier or as their parent."""
    for thing in bpy.data.objects:
        if thing.type == "MESH" and (
            any(modifier.type == "ARMATURE" and modifier.object == character for modifier in thing.modifiers)
            or (thing.parent == character and thing.parent_type == "ARMATURE")
        ):
            yield thing


def _corners(
    character: bpy.types.Object, mesh: bpy.types.Object, bones: set[str], near: np.ndarray, reach: float, share: float
) -> Iterator[np.ndarray]:
    """The corners of a mesh of which more than `share` belongs to the bones, as they are at rest, armature space; none
    farther than `reach` from the place `near`."""
    groups = {group.index for group in mesh.vertex_groups if group.name in bones}
    if not groups:
        return
    places = np.empty(len(mesh.data.vertices) * 3, dtype=np.float32)
    mesh.data.vertices.foreach_get("co", places)
    # Bound at rest: where both objects stand says where the mesh lies on the bones.
    to_armature = np.array(character.matrix_world.inverted_safe() @ mesh.matrix_world, dtype=np.float64)
    places = places.reshape(-1, 3).astype(np.float64) @ to_armature[:3, :3].T + to_armature[:3, 3]
    # Weights are asked for corner by corner: of a whole body that takes long.
    beside = np.flatnonzero(np.linalg.norm(places - near, axis=1) < reach)
    found = []
    for index in beside.tolist():
        entries = mesh.data.vertices[index].groups
        total = sum(entry.weight for entry in entries)
        if total > 0.0 and sum(entry.weight for entry in entries if entry.group in groups) > share * total:
            found.append(index)
    if found:
        yield places[found]
