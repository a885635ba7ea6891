# SPDX-License-Identifier: GPL-3.0-or-later
"""The character: an armature of the core's 22 joints with a mannequin on it, made once and reused."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import bpy
import numpy as np
from mathutils import Vector

from .. import quaternions
from ..errors import SceneError
from ..key_fit import Rest
from . import mannequin
from .names import CHARACTER_KEY, oncue_collection

#: Where a bone of a joint without exactly one child ends, metres from the joint.
END_TAILS = {
    "Hips": "Spine",
    "Spine2": "Neck",
    "Head": (0.0, 0.0, 0.18),
    "LeftHand": (0.17, 0.0, 0.0),
    "RightHand": (-0.17, 0.0, 0.0),
    "LeftToe": (0.0, -0.07, 0.0),
    "RightToe": (0.0, -0.07, 0.0),
}
#: As many bones with a rigid part on each make a body.
PARTS_OF_A_BODY = 4
#: A joint that was moved further than this from the core's rest pose makes the armature another skeleton, metres.
REST_TOLERANCE = 1e-4


def rest_positions(skeleton: dict) -> np.ndarray:
    """Joint positions of the rest pose, armature space, metres, shape (joints, 3)."""
    offsets = np.asarray(skeleton["joint_offsets"], dtype=np.float64)
    positions = offsets.copy()
    for joint, parent in enumerate(skeleton["parents"]):
        if parent is not None and parent >= 0:
            positions[joint] = positions[parent] + offsets[joint]
    return positions


def find_character(scene: bpy.types.Scene, skeleton: dict) -> bpy.types.Object | None:
    """The armature to reuse: the one the scene names, whatever its bones are, else the first of the scene that Oncue
    made.

    Of these one whose joints were renamed or moved is passed over, and so is one that is linked or that no view layer
    has: nobody asked for it.
    """
    chosen = scene.oncue.character if hasattr(scene, "oncue") else None
    if chosen is not None and chosen.type == "ARMATURE" and _is_in(scene, chosen):
        return chosen
    shown = {thing for layer in scene.view_layers for thing in layer.objects}
    candidates = [
        thing
        for thing in scene.objects
        if thing.get(CHARACTER_KEY) and thing.type == "ARMATURE" and thing.is_editable and thing in shown
    ]
    return next((one for one in candidates if misfit(one, skeleton) is None), None)


def check_chosen(scene: bpy.types.Scene) -> None:
    """Raises SceneError where the artist's own rig that was chosen is not in the scene: none is made in its place."""
    chosen = scene.oncue.character
    if chosen is not None and not chosen.get(CHARACTER_KEY) and not _is_in(scene, chosen):
        raise SceneError(
            f"{chosen.name} is chosen as Character and is not in this scene: choose another one, or clear the field."
        )


def _is_in(scene: bpy.types.Scene, thing: bpy.types.Object) -> bool:
    # By identity: a linked object may have another's name.
    return scene.objects.get(thing.name) == thing


def make_character(context: bpy.types.Context, skeleton: dict, metres_per_unit: float = 1.0) -> bpy.types.Object:
    """A new armature in its T-pose, facing -Y at the world's origin, with the mannequin bound to it."""
    data = bpy.data.armatures.new("Oncue Character")
    character = bpy.data.objects.new("Oncue Character", data)
    character[CHARACTER_KEY] = True
    character.scale = (1.0 / metres_per_unit,) * 3
    data.display_type = "STICK"
    oncue_collection(context).objects.link(character)
    context.view_layer.update()
    positions = rest_positions(skeleton)
    with _editing(context, character):
        _add_bones(data, skeleton, positions)
    for bone in character.pose.bones:
        bone.rotation_mode = "QUATERNION"
    give_skin(context, character, skeleton)
    context.view_layer.update()
    return character


def give_skin(context: bpy.types.Context, character: bpy.types.Object, skeleton: dict) -> None:
    """Binds a mannequin to a character that nothing is bound to: one whose armature was deleted, else a new one."""
    if _has_skin(character):
        return
    body = next((thing for thing in context.scene.objects if _is_abandoned_skin(thing, skeleton)), None)
    if body is None:
        body = mannequin.make(skeleton, rest_positions(skeleton))
        body[CHARACTER_KEY] = True
        oncue_collection(context).objects.link(body)
    body.parent = character
    body.matrix_parent_inverse.identity()
    body.matrix_basis.identity()
    modifiers = [modifier for modifier in body.modifiers if modifier.type == "ARMATURE"]
    (modifiers or [body.modifiers.new("Armature", "ARMATURE")])[0].object = character
    context.view_layer.update()


def _has_skin(character: bpy.types.Object) -> bool:
    """Whether a mesh is deformed by the character, or a body of rigid parts hangs on its bones. A cup in the hand is no
    skin."""
    meshes = [thing for thing in bpy.data.objects if thing.type == "MESH" and thing.users_scene]
    deformed = any(
        character in _deforming(mesh) or (mesh.parent == character and mesh.parent_type == "ARMATURE")
        for mesh in meshes
    )
    parts = {mesh.parent_bone for mesh in meshes if mesh.parent == character and mesh.parent_type == "BONE"}
    return deformed or len(parts) >= PARTS_OF_A_BODY


def _deforming(mesh: bpy.types.Object) -> list[bpy.types.Object | None]:
    """The armatures of a mesh's modifiers; None for one that was deleted."""
    return [modifier.object for modifier in mesh.modifiers if modifier.type == "ARMATURE"]


def _is_abandoned_skin(thing: bpy.types.Object, skeleton: dict) -> bool:
    """Whether a mesh is a mannequin whose armature was deleted."""
    if thing.type != "MESH" or thing.get(CHARACTER_KEY) is None or not thing.is_editable or thing.parent is not None:
        return False
    armatures = _deforming(thing)
    return bool(armatures) and not any(armatures) and all(name in thing.vertex_groups for name in skeleton["names"])


def rest_rotations(character: bpy.types.Object, names: list[str]) -> np.ndarray:
    """Rest rotation of each bone in armature space, shape (joints, 3, 3)."""
    return np.array([np.array(character.data.bones[name].matrix_local.to_3x3()) for name in names], dtype=np.float64)


def rest_of(
    character: bpy.types.Object,
    names: list[str],
    metres_per_unit: float,
    matrix_world=None,
    over: list[str | None] | None = None,
    labels: list[str] | None = None,
) -> Rest:
    """How bones hang on each other at rest: each on the nearest one over it that is named, which comes before it, or on
    that which `over` says.

    `matrix_world` says where the object stands, or else the object does; `labels`: the core's joints that the bones
    show, where they are called otherwise.
    """
    bones = [character.data.bones[name] for name in names]
    if over is None:
        over = [next((one.name for one in bone.parent_recursive if one.name in names), None) for bone in bones]
    frames = np.array([bone.matrix_local for bone in bones], dtype=np.float64)
    parents = [names.index(name) if name is not None else -1 for name in over]
    own = [frames[k] if p < 0 else np.linalg.inv(frames[p]) @ frames[k] for k, p in enumerate(parents)]
    world = np.array(character.matrix_world if matrix_world is None else matrix_world, dtype=np.float64)
    scale = np.cbrt(abs(np.linalg.det(world[:3, :3])))
    return Rest(
        list(labels or names),
        parents,
        np.array([frame[:3, 3] for frame in own]),
        np.array([quaternions.from_matrix(frame[:3, :3]) for frame in own]),
        1.0 / (metres_per_unit * scale),
    )


def misfit(character: bpy.types.Object, skeleton: dict) -> str | None:
    """What keeps an object from being the skeleton's: the rest of a sentence that begins with its name, or None."""
    if character.type != "ARMATURE":
        return "is no armature"
    names, bones = list(skeleton["names"]), character.data.bones
    for joint, expected in enumerate(rest_positions(skeleton)):
        bone, parent = bones.get(names[joint]), skeleton["parents"][joint]
        if bone is None:
            return f"has no bone {names[joint]}"
        away = (Vector(expected) - bone.head_local).length
        if away > REST_TOLERANCE:
            return f"has its bone {bone.name} {100 * away:.1f} cm from where the motion's skeleton has it"
        if parent is not None and parent >= 0 and (bone.parent is None or bone.parent.name != names[parent]):
            return f"has its bone {bone.name} not under {names[parent]}"
    return None


def _add_bones(data: bpy.types.Armature, skeleton: dict, positions: np.ndarray) -> None:
    names, parents = list(skeleton["names"]), skeleton["parents"]
    for joint, name in enumerate(names):
        bone = data.edit_bones.new(name)
        bone.head = positions[joint]
        children = [c for c, p in enumerate(parents) if p == joint]
        end = END_TAILS.get(name)
        if isinstance(end, str):
            bone.tail = positions[names.index(end)]
        elif end is not None:
            bone.tail = positions[joint] + np.array(end)
        else:
            bone.tail = positions[children[0]]
        bone.align_roll(_roll_axis(name))
        if parents[joint] is not None and parents[joint] >= 0:
            bone.parent = data.edit_bones[names[parents[joint]]]
            bone.use_connect = False


def _roll_axis(name: str) -> Vector:
    """Where a bone's Z axis points: knees and elbows then bend about X, and both sides mirror."""
    if name.endswith(("Foot", "Toe")):
        return Vector((0.0, 0.0, 1.0))
    if name.endswith(("Leg", "Arm", "Shoulder", "Hand")):
        return Vector((0.0, 1.0, 0.0))
    return Vector((0.0, -1.0, 0.0))


@contextmanager
def _editing(context: bpy.types.Context, character: bpy.types.Object) -> Iterator[None]:
    """Edit mode on `character`; afterwards the active object, its mode and the selection are as they were."""
    layer = context.view_layer
    active, selected = layer.objects.active, [o for o in layer.objects if o.select_get()]
    mode = active.mode if active else "OBJECT"
    if mode != "OBJECT":
        bpy.ops.object.mode_set(mode="OBJECT")
    layer.objects.active = character
    bpy.ops.object.mode_set(mode="EDIT")
    try:
        yield
    finally:
        bpy.ops.object.mode_set(mode="OBJECT")
        for other in layer.objects:
            other.select_set(other in selected)
        layer.objects.active = active
        if mode != "OBJECT":
            bpy.ops.object.mode_set(mode=mode)
