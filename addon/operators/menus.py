# SPDX-License-Identifier: GPL-3.0-or-later
"""The operators in Blender's own menus: Add, Object and Pose. The search (F3) finds what a menu has."""

from __future__ import annotations

import bpy


class ONCUE_MT_cues(bpy.types.Menu):
    """Where a person starts, passes, sits, stops, looks, and puts feet and hands"""

    bl_idname = "ONCUE_MT_cues"
    bl_label = "Oncue Cue"

    def draw(self, _context: bpy.types.Context) -> None:
        layout = self.layout
        for kind, text in (("start", "Start Cue"), ("sit", "Sit Cue"), ("stop", "Stop Cue"), ("pass", "Pass Cue")):
            layout.operator("oncue.place_cue", text=text).kind = kind
        layout.operator("oncue.place_look", text="Look Cue")
        layout.operator("oncue.sit_on_selection")
        for name in ("add_person", "give_to_person", "act_by"):
            layout.operator(f"oncue.{name}")
        layout.separator()
        for side in ("left", "right"):
            layout.operator("oncue.place_foot", text=f"{side.title()} Foot Cue").side = side
        for kind in ("left_hand", "right_hand", "both_hands"):
            layout.operator("oncue.place_hand", text=f"{kind.replace('_', ' ').title()} Cue").kind = kind
        for hand, text in (("left", "Take Left"), ("right", "Take Right"), ("both", "Take Both")):
            layout.operator("oncue.place_take", text=text).hand = hand
        layout.operator("oncue.place_put")
        for hand, text in (("left", "Open Left"), ("right", "Open Right"), ("both", "Open Both")):
            layout.operator("oncue.place_open", text=text).hand = hand
        layout.separator()
        layout.operator("oncue.show_ways")


class ONCUE_MT_motion(bpy.types.Menu):
    """Making a person walk to the cues"""

    bl_idname = "ONCUE_MT_motion"
    bl_label = "Oncue"

    def draw(self, _context: bpy.types.Context) -> None:
        layout = self.layout
        # A menu runs what it names at once unless it is told to ask: the run is modal in the window.
        layout.operator_context = "INVOKE_DEFAULT"
        for name in ("synthesize", "variations", "write_motion", "follow_cues", "resolve"):
            layout.operator(f"oncue.{name}")
        layout.separator()
        for name in ("copy_take", "push_take", "discard_take"):
            layout.operator(f"oncue.{name}")
        layout.separator()
        layout.operator("oncue.pin")
        layout.operator("oncue.pin", text="Pin over Frames").over_range = True
        layout.operator("oncue.remove_pins")
        layout.separator()
        for name in ("toggle_exclude", "reset_character", "save_bones", "load_bones"):
            layout.operator(f"oncue.{name}")
        layout.operator("oncue.add_library", text="Add Motion Capture Files")
        layout.operator("oncue.add_library", text="Add Motion Capture Folder").folder = True
        layout.operator("oncue.add_action", text="Add Action to Library")
        for name in ("read_library", "save_library", "train_manifold"):
            layout.operator(f"oncue.{name}")
        layout.separator()
        layout.operator("oncue.open_guide", icon="HELP")


def _draw_cues(menu: bpy.types.Menu, _context: bpy.types.Context) -> None:
    menu.layout.menu(ONCUE_MT_cues.bl_idname, icon="EMPTY_ARROWS")


def _draw_motion(menu: bpy.types.Menu, _context: bpy.types.Context) -> None:
    menu.layout.separator()
    menu.layout.menu(ONCUE_MT_motion.bl_idname, icon="ARMATURE_DATA")


CLASSES = (ONCUE_MT_cues, ONCUE_MT_motion)
#: Blender's menu, and what is drawn at its end.
PLACES = (("VIEW3D_MT_add", _draw_cues), ("VIEW3D_MT_object", _draw_motion), ("VIEW3D_MT_pose", _draw_motion))


def register() -> None:
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    for menu, draw in PLACES:
        getattr(bpy.types, menu).append(draw)


def unregister() -> None:
    for menu, draw in PLACES:
        getattr(bpy.types, menu).remove(draw)
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
