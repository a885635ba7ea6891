# SPDX-License-Identifier: GPL-3.0-or-later
"""The motion library's list, and writing the library to one file."""

from __future__ import annotations

from pathlib import Path

import bpy
from bpy.props import BoolProperty, CollectionProperty, StringProperty

from ..bridge import session, user_preferences
from ..bridge.own_action import Taken, own_action_steps
from ..files import write_whole
from ..foreign_captures import SUFFIXES as FOREIGN
from ..job_operator import JobOperator
from ..pipeline import LIBRARY_SUFFIX, BuiltLibrary, Steps, library_steps
from .button import Button
from .synthesize import library_cache


class ONCUE_OT_add_library(Button, bpy.types.Operator):
    """Add motion capture (.bvh, .fbx, .glb or .gltf files, or a folder of them) or a library file"""

    bl_idname = "oncue.add_library"
    bl_label = "Add to Library"

    folder: BoolProperty(name="Folder", description="Add the folder itself", options={"SKIP_SAVE"})
    directory: StringProperty(description="Where the files lie", subtype="DIR_PATH", options={"SKIP_SAVE"})
    files: CollectionProperty(
        description="The files; none for the folder itself",
        type=bpy.types.OperatorFileListElement,
        options={"SKIP_SAVE"},
    )
    filter_glob: StringProperty(
        default=";".join(f"*{suffix}" for suffix in (".bvh", ".BVH", *FOREIGN, LIBRARY_SUFFIX)), options={"HIDDEN"}
    )
    filter_folder: BoolProperty(default=True, options={"HIDDEN"})

    def invoke(self, context: bpy.types.Context, _event) -> set[str]:
        known = user_preferences.get(context)
        if known and known.mocap_folder:
            self.directory = known.mocap_folder
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def act(self, context: bpy.types.Context) -> None:
        names = [] if self.folder else [entry.name for entry in self.files if entry.name]
        folder = Path(self.directory)
        add_paths(context.scene.oncue, [folder / name for name in names] or [folder])


def add_paths(settings, paths: list[Path]) -> None:
    """Adds to the library what is not there yet, and chooses the last."""
    known = {item.path for item in settings.library_paths}
    for path in paths:
        if str(path) not in known:
            settings.library_paths.add().path = str(path)
    settings.library_index = len(settings.library_paths) - 1


class ONCUE_OT_add_action(JobOperator, bpy.types.Operator):
    """Write what the active armature plays as a capture (.bvh), and add it to the library"""

    bl_idname = "oncue.add_action"
    bl_label = "Add Action"
    bl_options = {"REGISTER", "UNDO"}
    title = "Capturing the action"

    every: BoolProperty(
        name="Every Action",
        description="All actions of the file that move the armature's bones, each in a file of its own",
        options={"SKIP_SAVE"},
    )
    filepath: StringProperty(description="The capture to write", subtype="FILE_PATH", options={"SKIP_SAVE"})
    check_existing: BoolProperty(default=True, options={"HIDDEN"})
    filter_glob: StringProperty(default="*.bvh", options={"HIDDEN"})

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        armature = context.active_object
        if armature is None or armature.type != "ARMATURE" or armature.mode == "EDIT":
            return cls.cannot("Select an armature that plays an action, out of edit mode")
        return super().poll(context)

    def invoke(self, context: bpy.types.Context, event) -> set[str]:
        if self.filepath:
            return super().invoke(context, event)
        armature = context.active_object
        data = armature.animation_data
        name = f"{armature.name} {data.action.name}" if data and data.action else armature.name
        self.filepath = f"{bpy.path.clean_name(name)}.bvh"
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def begin(self, context: bpy.types.Context) -> Steps[list[Taken]]:
        return own_action_steps(context, context.active_object, every=self.every)

    def finish(self, context: bpy.types.Context, value: list[Taken]) -> None:
        path = Path(bpy.path.abspath(self.filepath)).with_suffix(".bvh")
        path.parent.mkdir(parents=True, exist_ok=True)
        paths = []
        for taken in value:
            name = path.name if len(value) == 1 else f"{path.stem} {bpy.path.clean_name(taken.action)}.bvh"
            paths.append(path.with_name(name))
            write_whole(paths[-1], taken.text)
        add_paths(context.scene.oncue, paths)
        self.say({"INFO"}, f"Added {', '.join(path.name for path in paths)} to the library.")


class ONCUE_OT_remove_library(Button, bpy.types.Operator):
    """Take the entry out of the library; the files stay"""

    bl_idname = "oncue.remove_library"
    bl_label = "Remove from Library"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return bool(context.scene.oncue.library_paths)

    def act(self, context: bpy.types.Context) -> None:
        settings = context.scene.oncue
        settings.library_paths.remove(settings.library_index)
        settings.library_index = max(0, min(settings.library_index, len(settings.library_paths) - 1))


class ONCUE_OT_save_library(JobOperator, bpy.types.Operator):
    """Build the motion library and write it to one file, which opens at once"""

    bl_idname = "oncue.save_library"
    bl_label = "Save Library"
    title = "Building the library"

    filepath: StringProperty(description="The library file to write", subtype="FILE_PATH", options={"SKIP_SAVE"})
    filter_glob: StringProperty(default=f"*{LIBRARY_SUFFIX}", options={"HIDDEN"})

    def invoke(self, context: bpy.types.Context, event) -> set[str]:
        if self.filepath:
            return super().invoke(context, event)
        self.filepath = f"library{LIBRARY_SUFFIX}"
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def begin(self, context: bpy.types.Context) -> Steps[BuiltLibrary]:
        return library_steps(session.library_choice(context.scene), library_cache)

    def finish(self, _context: bpy.types.Context, value: BuiltLibrary) -> None:
        library, captures = value
        path = Path(bpy.path.abspath(self.filepath)).with_suffix(LIBRARY_SUFFIX)
        library.write(str(path))
        self.say({"INFO"}, f"{path.name}: {library.clip_count} clips, {library.frame_count / 1800:.1f} minutes.")
        for capture in captures:
            if not capture["clip"]:
                self.say({"WARNING"}, f"{Path(capture['file']).name} was left out: {capture['reason']}")


class ONCUE_OT_read_library(JobOperator, bpy.types.Operator):
    """Read the files of the motion library, and list what each of them gives"""

    bl_idname = "oncue.read_library"
    bl_label = "Read Files"
    title = "Reading the library"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return super().poll(context) and bool(context.scene.oncue.library_paths)

    def begin(self, context: bpy.types.Context) -> Steps[BuiltLibrary]:
        return library_steps(session.library_choice(context.scene), library_cache)

    def finish(self, _context: bpy.types.Context, value: BuiltLibrary) -> None:
        library, captures = value
        used = sum(bool(capture["clip"]) for capture in captures)
        minutes = library.frame_count / 1800
        self.say({"INFO"}, f"{used} of {len(captures)} captures are used; the library has {minutes:.1f} minutes.")


CLASSES = (
    *(ONCUE_OT_add_library, ONCUE_OT_add_action, ONCUE_OT_remove_library),
    *(ONCUE_OT_save_library, ONCUE_OT_read_library),
)


register, unregister = bpy.utils.register_classes_factory(CLASSES)
