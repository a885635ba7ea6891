# SPDX-License-Identifier: GPL-3.0-or-later
"""Captures of any kind that Blender knows, as .bvh files: what a second Blender does for the first one.

A request is a list of {"file", "folder"}: of each file the actions of its armatures go to its folder as .bvh files, and
`takes.json`, written last, says which they are and why others are left out. For a .blend file the entry also has
"armature" and "actions", which are taken out of it, and "rate", its frames a second.
"""

from __future__ import annotations

import json
import traceback
from pathlib import Path

import bpy

from ..errors import SceneError
from ..mocap_writer import bvh_text
from .armature_motion import armature_actions, bone_motion

#: What Blender itself reads a kind of file with, the best first; which of them it has differs from version to version.
IMPORTERS = {
    ".fbx": (("wm", "fbx_import"), ("import_scene", "fbx")),
    ".glb": (("import_scene", "gltf"),),
    ".gltf": (("import_scene", "gltf"),),
}
#: Frames a second at which a file is looked at that counts seconds.
IMPORTED_RATE = 60


def answer(request: Path) -> None:
    """Reads the files of a request, which is JSON."""
    for entry in json.loads(request.read_text(encoding="utf-8")):
        folder = Path(entry["folder"])
        try:
            takes, left_out = read(entry, folder)
            said = {"takes": takes, "left_out": left_out}
        except Exception as error:  # whatever an importer stumbles over, the next file is read
            if not isinstance(error, SceneError):
                traceback.print_exc()
            said = {"takes": [], "left_out": [{"action": None, "reason": sentence(error)}]}
        part = folder / "takes.json.part"
        part.write_text(json.dumps(said), encoding="utf-8")
        part.replace(folder / "takes.json")


def read(entry: dict, folder: Path) -> tuple[list[dict], list[dict]]:
    """Writes the takes of a file: {"file", "action"} of each, and {"action", "reason"} of what is left out."""
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    file = Path(entry["file"])
    if file.suffix.lower() == ".blend":
        append(entry)
    else:
        bpy.context.scene.render.fps = IMPORTED_RATE
        import_file(file)
    armatures = [thing for thing in bpy.data.objects if thing.type == "ARMATURE"]
    if not armatures:
        raise SceneError("it holds no armature.")
    wanted = entry.get("actions")
    found = [take for armature in armatures for take in armature_actions(armature)]
    found = [take for take in found if wanted is None or take.action.name in wanted]
    if not found:
        raise SceneError(f"no action moves the bones of its armature ‘{armatures[0].name}’.")
    takes: list[dict] = []
    left_out: list[dict] = []
    for take in found:
        name = take.name if len(armatures) == 1 else f"{take.armature.name} {take.name}"
        path = folder / f"{len(takes)}.bvh"
        try:
            path.write_text(bvh_text(bone_motion(bpy.context.scene, take)), encoding="utf-8")
        except SceneError as error:
            left_out.append({"action": name, "reason": str(error)})
        else:
            takes.append({"file": path.name, "action": name})
    return takes, left_out


def append(entry: dict) -> None:
    """Brings an armature and actions of a .blend file into the scene."""
    with bpy.data.libraries.load(entry["file"]) as (_, taken):
        taken.objects, taken.actions = [entry["armature"]], list(entry["actions"])
    armature = taken.objects[0]
    if armature is None:
        raise SceneError(f"the armature {entry['armature']} could not be taken out of the file.")
    scene = bpy.context.scene
    scene.collection.objects.link(armature)
    scene.render.fps = max(round(entry["rate"]), 1)
    scene.render.fps_base = scene.render.fps / entry["rate"]
    bpy.context.view_layer.update()


def import_file(file: Path) -> None:
    """Has Blender import a file. Raises SceneError where no importer is there or none of them can read it."""
    fault = ""
    for group, name in IMPORTERS[file.suffix.lower()]:
        operator = getattr(getattr(bpy.ops, group), name)
        try:
            operator.get_rna_type()
        except KeyError:  # this Blender does not have it
            continue
        try:
            if "FINISHED" in operator(filepath=str(file)):
                return
            fault = fault or "it gave no reason"
        except RuntimeError as error:
            fault = fault or last_line(error)
    if not fault:
        raise SceneError(f"this Blender has no importer for {file.suffix.lower()} files.")
    raise SceneError(f"Blender could not import it: {fault}.")


def sentence(error: Exception) -> str:
    return str(error) if isinstance(error, SceneError) else f"Blender could not read it: {last_line(error)}."


def last_line(error: Exception) -> str:
    """What an error says in the end: an importer's report has a whole story before it, and after it where that was."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip() and not line.startswith("Location: ")]
    return (lines[-1] if lines else type(error).__name__).removeprefix("Error: ").rstrip(".")[:200]
