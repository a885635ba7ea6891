# SPDX-License-Identifier: GPL-3.0-or-later
"""Which bones of the artist's own rig are which joints: named one by one, or read from a file of such names."""

from __future__ import annotations

import json
from pathlib import Path

import bpy
from bpy.props import BoolProperty, StringProperty

from .. import native
from ..bridge import own_rig
from ..bridge.puppet import is_own_skeleton
from ..errors import SceneError
from ..files import write_whole
from ..job_operator import handle
from .button import Button

#: Larger files name no bones, bytes.
LARGEST_FILE = 1_000_000


def own_character(context: bpy.types.Context) -> bpy.types.Object:
    """The armature of the artist's own that is the scene's character. Raises SceneError where there is none."""
    character = context.scene.oncue.character
    if character is None or character.type != "ARMATURE":
        raise SceneError("Choose your rig as Character first.")
    if is_own_skeleton(character, native.core.skeleton()):
        raise SceneError(f"{character.name} is Oncue's own character, whose bones are known.")
    if not character.is_editable:
        raise SceneError(f"{character.name} is linked and cannot be changed: make a library override of it.")
    return character


class BonesButton(Button):
    """Mixin of the buttons about the bones of the artist's own rig."""

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if context.scene.oncue.character is None:
            return cls.cannot("Choose your rig as Character first")
        return True


class ONCUE_OT_name_bone(BonesButton, bpy.types.Operator):
    """Say which bone of your rig stands for a joint; none to have it recognised"""

    bl_idname = "oncue.name_bone"
    bl_label = "Name Bone"

    joint: StringProperty(name="Joint", description="The joint", options={"SKIP_SAVE", "HIDDEN"})
    bone: StringProperty(name="Bone", description="The bone that stands for it; empty to have it recognised")

    def invoke(self, context: bpy.types.Context, _event) -> set[str]:
        self.bone = own_rig.mapping_of(context.scene.oncue.character).get(self.joint, "")
        return context.window_manager.invoke_props_dialog(self)

    def draw(self, context: bpy.types.Context) -> None:
        self.layout.prop_search(self, "bone", context.scene.oncue.character.data, "bones", text=self.joint)

    def act(self, context: bpy.types.Context) -> None:
        character = own_character(context)
        if self.joint not in native.core.skeleton()["names"]:
            joints = ", ".join(native.core.skeleton()["names"])
            raise SceneError(f"There is no joint {self.joint or 'without a name'}: choose one of {joints}.")
        mapping = own_rig.mapping_of(character)
        mapping.pop(self.joint, None)
        if self.bone:
            mapping[self.joint] = self.bone
        if still := keep_if_known(character, mapping):
            self.say({"WARNING"}, still)


class ONCUE_OT_save_bones(BonesButton, bpy.types.Operator):
    """Write which bone stands for which joint to a file, for other rigs that are named alike"""

    bl_idname = "oncue.save_bones"
    bl_label = "Save Bones"

    filepath: StringProperty(description="The file to write", subtype="FILE_PATH", options={"SKIP_SAVE"})
    check_existing: BoolProperty(default=True, options={"HIDDEN"})
    filter_glob: StringProperty(default="*.json", options={"HIDDEN"})

    def invoke(self, context: bpy.types.Context, _event) -> set[str]:
        self.filepath = f"{bpy.path.clean_name(context.scene.oncue.character.name)}.json"
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def act(self, context: bpy.types.Context) -> None:
        found = own_rig.recognized(own_character(context))
        path = Path(bpy.path.abspath(self.filepath)).with_suffix(".json")
        write_whole(path, json.dumps(found["joints"], indent=1, ensure_ascii=False) + "\n")
        self.say({"INFO"}, f"Wrote the bones of {len(found['joints'])} joints to {path.name}.")


class ONCUE_OT_load_bones(BonesButton, bpy.types.Operator):
    """Read which bone stands for which joint from a file"""

    bl_idname = "oncue.load_bones"
    bl_label = "Load Bones"

    filepath: StringProperty(description="The file to read", subtype="FILE_PATH", options={"SKIP_SAVE"})
    filter_glob: StringProperty(default="*.json", options={"HIDDEN"})

    def invoke(self, context: bpy.types.Context, _event) -> set[str]:
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def act(self, context: bpy.types.Context) -> None:
        character = own_character(context)
        path = Path(bpy.path.abspath(self.filepath))
        still = keep_if_known(character, _read(path))
        self.say({"WARNING" if still else "INFO"}, still or f"{character.name} has the bones that {path.name} names.")


def keep_if_known(character: bpy.types.Object, mapping: dict[str, str]) -> str:
    """Keeps a mapping that makes a person of the rig, or might once more bones are named: then what is still missing,
    else nothing. Raises SceneError for another, and keeps what there was."""
    still = ""
    try:
        own_rig.recognized(character, mapping)
    except SceneError as error:
        if own_rig.UNNAMED not in str(error):
            raise
        still = str(error)
    own_rig.keep_mapping(character, mapping)
    handle.forget()
    return still


def _read(path: Path) -> dict[str, str]:
    if path.stat().st_size > LARGEST_FILE:
        raise SceneError(f"{path.name} is too large to name bones: choose a file that Save Bones has written.")
    try:
        mapping = json.loads(path.read_text(encoding="utf-8-sig"))
    except (ValueError, RecursionError) as error:
        raise SceneError(f"{path.name} names no bones: choose a file that Save Bones has written.") from error
    if not isinstance(mapping, dict) or not all(isinstance(one, str) for pair in mapping.items() for one in pair):
        raise SceneError(f"{path.name} names no bones: choose a file that Save Bones has written.")
    return mapping


CLASSES = (ONCUE_OT_name_bone, ONCUE_OT_save_bones, ONCUE_OT_load_bones)


register, unregister = bpy.utils.register_classes_factory(CLASSES)
