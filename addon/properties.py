# SPDX-License-Identifier: GPL-3.0-or-later
"""What a scene remembers of Oncue, `scene.oncue`, and an armature object of the artist's own, `oncue_mapping`."""

from __future__ import annotations

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

from . import native
from .bridge.compat import RELATIVE_PATHS
from .key_fit import TOLERANCE_MM

#: The largest number that a property of Blender's has, and the last frame of a scene.
LARGEST_INTEGER, LAST_FRAME = 2**31 - 1, 1_000_000
#: Smallest and largest metres per scene unit.
SCENE_SCALES = (1e-4, 1e4)
#: Dynamic enum items must stay alive while Blender shows them.
_PRESETS: list[tuple[str, str, str]] = []
PRESET_NOTES = {
    "default": "Fast: optimizing starts from the shortest clear path and stops once the cue is met",
    "paper": "The paper's constants and terms throughout; many times slower",
}


def _presets(_self, _context):
    if not _PRESETS:
        for name in native.preset_names():
            _PRESETS.append((name, name.title(), PRESET_NOTES.get(name, "")))
    return _PRESETS


def _first_frame(settings) -> int:
    """The frame that was chosen, else the first of the shot: of the preview range where one is set."""
    if not settings.starts_with_shot:
        return settings.chosen_frame
    scene = settings.id_data
    return max(scene.frame_preview_start if scene.use_preview_range else scene.frame_start, 0)


def _choose_first_frame(settings, frame: int) -> None:
    settings.chosen_frame, settings.starts_with_shot = frame, False


def _confirm_scale(self, _context) -> None:
    self.scale_confirmed = True


def _redraw(_self, context) -> None:
    for area in context.screen.areas if context.screen else ():
        area.tag_redraw()


class OncueLibraryPath(bpy.types.PropertyGroup):
    """One entry of the motion library."""

    path: StringProperty(
        name="Path",
        description="A .bvh, .fbx, .glb or .gltf file, a folder of them, or a library file",
        subtype="FILE_PATH",
        options={"ANIMATABLE", *RELATIVE_PATHS},
        default="",
    )


class OncueSettings(bpy.types.PropertyGroup):
    """Settings of one scene."""

    library_paths: CollectionProperty(description="The motion library's files and folders", type=OncueLibraryPath)
    library_index: IntProperty(name="Entry", description="The entry that the list shows as chosen")
    starter: EnumProperty(
        name="Starter",
        description="What the procedural starter library adds to your files",
        items=[
            ("MISSING", "Where Missing", "The actions that your files lack; all of it when there are no files"),
            ("ALL", "All", "All of its motion beside your files'"),
            ("NONE", "None", "Your files only"),
        ],
        default="MISSING",
    )
    mapping: StringProperty(
        name="Mapping",
        description="A file that says how the captures are to be read: joints, up axis, rate, labels; empty for what "
        "lies beside them",
        subtype="FILE_PATH",
        options={"ANIMATABLE", *RELATIVE_PATHS},
        default="",
    )
    manifold: StringProperty(
        name="Manifold",
        description="File of the motion manifold that seats, hands and keys are fitted along; "
        "empty for the one that ships",
        subtype="FILE_PATH",
        options={"ANIMATABLE", *RELATIVE_PATHS},
        default="",
    )
    manifold_passes: IntProperty(
        name="Passes",
        description="How often a training goes through the library; the manifold that ships has 24",
        default=24,
        min=1,
        max=1000,
    )
    preset: EnumProperty(name="Preset", description="Settings of the motion's optimization", items=_presets)
    overrides: StringProperty(
        name="Overrides",
        description='Settings that depart from the preset, as JSON: {"ppo": {"updates": 10}}',
        default="",
    )
    seed: IntProperty(
        name="Seed", description="The same seed gives the same motion; another one another take", min=0, default=1
    )
    variations: IntProperty(
        name="Takes",
        description="How many takes Variations makes, each by a seed of its own",
        default=4,
        min=2,
        max=32,
    )
    liveliness: FloatProperty(
        name="Liveliness",
        description="From calm (-1) to lively (1): the pace, and how much moves in sitting down and in coming to stand",
        min=-1.0,
        max=1.0,
        default=0.0,
        step=10,
    )
    every_frame: BoolProperty(
        name="Key Every Frame",
        description="Write a key on every frame, instead of as few as an artist can edit",
        default=False,
    )
    root_motion: EnumProperty(
        name="Root Motion",
        description="What carries the body along its way",
        items=[
            ("HIPS", "Hips", "The hips go all the way themselves"),
            ("BONE", "Root Bone", "The root bone at the rig's feet goes along the floor and faces as the hips do"),
            ("OBJECT", "Object", "The armature object goes along the floor and faces as the hips do"),
            ("PLACE", "In Place", "Nothing: the body moves on the spot"),
        ],
        default="HIPS",
    )
    rig_legs: EnumProperty(
        name="Legs",
        description="The controls of a Rigify rig's legs that get the keys",
        items=[
            ("IK", "IK", "The feet's controls with their roll, the toes' and the knees' poles"),
            ("FK", "FK", "Thighs, shins, feet and toes"),
        ],
        default="IK",
    )
    rig_arms: EnumProperty(
        name="Arms",
        description="The controls of a Rigify rig's arms that get the keys",
        items=[
            ("IK", "IK", "The hands' controls and the elbows' poles"),
            ("FK", "FK", "Upper arms, forearms and hands"),
        ],
        default="FK",
    )
    key_tolerance: FloatProperty(
        name="Key Tolerance",
        description="How far few keys may leave hands, feet and hips from the motion, millimetres; joints turn by up "
        "to a degree at 3",
        default=TOLERANCE_MM,
        min=0.1,
        max=100.0,
        precision=1,
    )
    start_frame: IntProperty(
        name="Start Frame",
        description="Frame of the first key; where none is chosen, the first of the shot",
        min=0,
        max=LAST_FRAME,
        get=_first_frame,
        set=_choose_first_frame,
    )
    starts_with_shot: BoolProperty(
        name="Start with the Shot",
        description="Begin at the scene's first frame, or at that of its preview range",
        default=True,
    )
    chosen_frame: IntProperty(description="The start frame that was chosen", options={"HIDDEN"}, default=1)
    shot_end: IntProperty(description="The scene's last frame as the artist had it", options={"HIDDEN"}, default=-1)
    fitted_end: IntProperty(
        description="The scene's last frame as a take made it; -1 where none did", options={"HIDDEN"}, default=-1
    )
    scene_scale: FloatProperty(
        name="Scene Scale",
        description="Metres per scene unit: 1 for a scene in metres, 0.01 for centimetres",
        default=1.0,
        min=SCENE_SCALES[0],
        max=SCENE_SCALES[1],
        precision=4,
        update=_confirm_scale,
    )
    scale_confirmed: BoolProperty(name="Scale Is Right", description="Do not question the scene's size", default=False)
    exclude: PointerProperty(
        name="Exclude",
        description="A collection that the character may walk through",
        type=bpy.types.Collection,
    )
    character: PointerProperty(
        name="Character",
        description="The armature that gets the motion; made on the first run",
        type=bpy.types.Object,
        poll=lambda _self, thing: thing.type == "ARMATURE",
    )
    show_cues: BoolProperty(
        name="Draw Cues",
        description="Draw footprints, facing and the seated figure at the cues",
        default=True,
        update=_redraw,
    )


CLASSES = (OncueLibraryPath, OncueSettings)


def register() -> None:
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.Scene.oncue = PointerProperty(type=OncueSettings)
    # A custom property that is new on a library override would be gone with the file.
    bpy.types.Object.oncue_mapping = StringProperty(
        name="Bones of Oncue",
        description="The bones that were named for joints by hand, JSON",
        options={"HIDDEN"},
        override={"LIBRARY_OVERRIDABLE"},
    )


def unregister() -> None:
    del bpy.types.Scene.oncue, bpy.types.Object.oncue_mapping
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
    _PRESETS.clear()
