# SPDX-License-Identifier: GPL-3.0-or-later
"""The motion library's list, and writing the library to one file."""

from __future__ import annotations

from pathlib import Path

import bpy
from bpy.props import BoolProperty, CollectionProperty, StringProperty

from ..bridge import session, user_preferences
from ..job_operator import JobOperator
from ..pipeline import LIBRARY_SUFFIX, BuiltLibrary, Steps, library_steps
from .button import Button
from .synthesize import library_cache


class ONCUE_OT_add_library(Button, bpy.types.Operator):
    """Add motion capture (.bvh files or a folder of them) or a library file"""

    bl_idname = "oncue.add_library"
    bl_label = "Add to Library"

    folder: BoolProperty(name="Folder", description="Add the folder itself", options={"SKIP_SAVE"})
    directory: StringProperty(description="Where the files lie", subtype="DIR_PATH", options={"SKIP_SAVE"})
    files: CollectionProperty(
        description="The files; none for the folder itself",
        type=bpy.types.OperatorFileListElement,
        options={"SKIP_SAVE"},
    )
    filter_glob: StringProperty(default=f"*.bvh;*.BVH;*{LIBRARY_SUFFIX}", options={"HIDDEN"})
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
        settings = context.scene.oncue
        known = {item.path for item in settings.library_paths}
        for path in [folder / name for name in names] or [folder]:
            if str(path) not in known:
                settings.library_paths.add().path = str(path)
        settings.library_index = len(settings.library_paths) - 1


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
        self.report({"INFO"}, f"{path.name}: {library.clip_count} clips, {library.frame_count / 1800:.1f} minutes.")
        for capture in captures:
            if not capture["clip"]:
                self.report({"WARNING"}, f"{Path(capture['file']).name} was left out: {capture['reason']}")


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
        self.report({"INFO"}, f"{used} of {len(captures)} captures are used; the library has {minutes:.1f} minutes.")


CLASSES = (ONCUE_OT_add_library, ONCUE_OT_remove_library, ONCUE_OT_save_library, ONCUE_OT_read_library)


register, unregister = bpy.utils.register_classes_factory(CLASSES)
