# SPDX-License-Identifier: GPL-3.0-or-later
"""The sidebar tab."""

from __future__ import annotations

import textwrap
from pathlib import Path

import bpy

from . import body_size, native
from .bridge import own_rig, people, session, takes
from .bridge.cue_objects import KINDS
from .bridge.names import (
    AMOUNT_KEY,
    AT_FRAME_KEY,
    CUE_KEY,
    FIRST_FRAME_KEY,
    HOLD_KEY,
    LAST_FRAME_KEY,
    OPENS_KEY,
    OVER_KEY,
)
from .bridge.pins import Pin, read_pins
from .bridge.puppet import is_own_skeleton, who_acts
from .bridge.rigify import is_rigify
from .bridge.shown_cues import (
    ENDS,
    FEET,
    HANDS,
    LOOK,
    OPEN,
    PASS,
    PUT,
    TAKE,
    end_cues,
    ordered_cues,
    person_of,
    visible_cues,
)
from .errors import CharacterError, EdgeError, ScaleError, SceneError
from .foreign_captures import SUFFIXES as FOREIGN
from .job_operator import handle
from .operators.follow import following
from .operators.synthesize import library_cache, unwritten
from .operators.ways import showing
from .pipeline import Progress
from .sentences import told

CUE_ICONS = {
    "start": "PLAY",
    "sit": "EMPTY_SINGLE_ARROW",
    "stop": "SNAP_FACE",
    PASS: "TRACKING_FORWARDS_SINGLE",
    TAKE: "VIEW_PAN",
    PUT: "IMPORT",
    OPEN: "MOD_EDGESPLIT",
    LOOK: "HIDE_OFF",
}
#: A list that is no longer is open at first; of a longer one so many lines are shown.
SHORT_LIST, LONGEST_LIST = 12, 100
#: Pixels that a character of the interface's font is wide, on average.
CHARACTER_WIDTH = 7


class OncuePanel:
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Oncue"
    #: The page of the guide that tells of the panel.
    guide = ""

    def draw_header_preset(self, _context: bpy.types.Context) -> None:
        if self.guide:
            self.layout.operator("oncue.open_guide", text="", icon="HELP", emboss=False).page = self.guide


class ONCUE_PT_cues(OncuePanel, bpy.types.Panel):
    bl_label = "Cues"
    bl_order = 0
    guide = "first-shot"

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        row = layout.row(align=True)
        row.operator("oncue.place_cue", text="Start", icon="PLAY").kind = "start"
        row.operator("oncue.place_cue", text="Sit", icon="EMPTY_SINGLE_ARROW").kind = "sit"
        row.operator("oncue.place_cue", text="Stop", icon="SNAP_FACE").kind = "stop"
        layout.operator("oncue.sit_on_selection", icon="FACESEL")
        played = ordered_cues(context)
        if end_cues(context):
            row = layout.row(align=True)
            row.operator("oncue.place_cue", text="Pass", icon=CUE_ICONS[PASS]).kind = PASS
            for kind, text in (("sit", "Then Sit"), ("stop", "Then Stop")):
                button = row.operator("oncue.place_cue", text=text, icon=CUE_ICONS[kind])
                button.kind, button.then = kind, True
            row = layout.row(align=True)
            row.operator("oncue.place_look", icon=CUE_ICONS[LOOK])
            row.operator("oncue.add_person", icon="COMMUNITY")
            layout.operator("oncue.show_ways", icon="TRACKING", depress=showing.on)
            for said in showing.said(context.scene):
                write_lines(context, layout, said, "ERROR")
        header, limbs = layout.panel("oncue_limbs", default_closed=True)
        header.label(text="Feet and Hands")
        if limbs:
            _draw_limbs(limbs.column(align=True))
        column = layout.column(align=True)
        if found := people.cast(context):
            _draw_people(context, column, found)
            return
        order = list(KINDS)
        cues = sorted(visible_cues(context, *KINDS), key=lambda cue: order.index(cue[CUE_KEY]))
        if len(played) > 1:
            # In the order in which they are played.
            starts, others = visible_cues(context, "start"), visible_cues(context, *FEET, *HANDS)
            cues = [*starts, *played, *others]
            frames = session.frames_of_cues(context)
        for cue in cues:
            row = column.row(align=True)
            if cue in played and len(played) > 1:
                _draw_step(row, cue, played, frames.get(cue.name))
            else:
                row.label(text=cue.name, icon=CUE_ICONS.get(cue[CUE_KEY], "DOT"))
            if cue[CUE_KEY] in HANDS:
                for key in (FIRST_FRAME_KEY, LAST_FRAME_KEY):
                    row.prop(cue, f'["{key}"]', text="")
            if HOLD_KEY in cue:
                row.prop(cue, f'["{HOLD_KEY}"]', text="Looks (s)" if cue[CUE_KEY] == LOOK else "Stays (s)")
            if AMOUNT_KEY in cue:
                _draw_opening(column.row(align=True), cue)
            if cue[CUE_KEY] in ENDS and (AT_FRAME_KEY in cue or cue == context.active_object):
                _draw_time(column.row(align=True), cue)
        kinds = {cue[CUE_KEY] for cue in cues}
        if "start" not in kinds:
            column.label(text="No Start cue yet", icon="INFO")
        if not kinds & set(ENDS):
            column.label(text="No Sit or Stop cue yet", icon="INFO")


def _draw_people(context: bpy.types.Context, column: bpy.types.UILayout, found: list[people.Person]) -> None:
    """Several people: each with the character and the cues, as they are played in order, and what is nobody's."""
    frames, acting = session.frames_of_cues(context), context.scene.oncue.character
    for person in found:
        box = column.box().column(align=True)
        row, name = box.row(align=True), person.start.name
        chosen = person.character is not None and person.character == acting
        row.operator(
            "oncue.choose_person", text=name, icon=CUE_ICONS["start"], depress=chosen, translate=False
        ).start = name
        character = person.character
        row.label(text=character.name if character else told("A mannequin"), icon="ARMATURE_DATA", translate=False)
        played = ordered_cues(context, person.start)
        for cue in played:
            row = box.row(align=True)
            _draw_step(row, cue, played, frames.get(cue.name))
            if HOLD_KEY in cue:
                row.prop(cue, f'["{HOLD_KEY}"]', text="Looks (s)" if cue[CUE_KEY] == LOOK else "Stays (s)")
        if not any(cue[CUE_KEY] in ENDS for cue in played):
            box.label(text="No Sit or Stop cue yet", icon="INFO")
    starts = [person.start for person in found]
    for cue in (cue for cue in ordered_cues(context) if person_of(context, cue, starts) is None):
        column.label(text=told(f"{cue.name} is nobody's"), icon="ERROR")
    for foot in visible_cues(context, *FEET):
        column.label(text=foot.name, icon="DOT", translate=False)
    row = column.row(align=True)
    row.operator("oncue.give_to_person", icon="LINKED")
    row.operator("oncue.act_by", icon="ARMATURE_DATA")


def _draw_step(row: bpy.types.UILayout, cue: bpy.types.Object, played: list, frame: int | None) -> None:
    """One of several sit, stop, pass and look cues: its place in the order, when it is met, and what moves it."""
    number = played.index(cue) + 1
    text = f"{number}  {cue.name}"
    row.operator("oncue.select_cue", text=text, icon=CUE_ICONS[cue[CUE_KEY]], translate=False).cue = cue.name
    if frame is not None:
        row.operator("oncue.go_to_frame", text=str(frame), icon="TIME", translate=False).frame = frame
    for icon, by in (("TRIA_UP", -1), ("TRIA_DOWN", 1)):
        button = row.operator("oncue.move_step", text="", icon=icon)
        button.cue, button.by = cue.name, by


def _draw_opening(row: bpy.types.UILayout, cue: bpy.types.Object) -> None:
    """How far an open cue opens something, and over how long."""
    row.label(text="", icon="BLANK1")
    unit = "Metres" if cue.get(OPENS_KEY) == "slide" else "Degrees"
    row.prop(cue, f'["{AMOUNT_KEY}"]', text=unit)
    if OVER_KEY in cue:
        row.prop(cue, f'["{OVER_KEY}"]', text="Takes (s)")


def _draw_time(row: bpy.types.UILayout, cue: bpy.types.Object) -> None:
    """The frame on which a cue is to be reached, and what gives it one or takes it off."""
    timed = AT_FRAME_KEY in cue
    icon = "CHECKBOX_HLT" if timed else "CHECKBOX_DEHLT"
    row.operator("oncue.be_here", icon=icon, emboss=False).cue = cue.name
    if timed:
        row.prop(cue, f'["{AT_FRAME_KEY}"]', text="")


class ONCUE_PT_library(OncuePanel, bpy.types.Panel):
    bl_label = "Motion Library"
    bl_order = 1
    guide = "captures"

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, context.scene.oncue
        if settings.library_paths:
            row = layout.row()
            row.template_list(
                "ONCUE_UL_library", "", settings, "library_paths", settings, "library_index", rows=2, maxrows=6
            )
            row.column().operator("oncue.remove_library", text="", icon="REMOVE")
            layout.prop(settings, "starter")
        else:
            layout.label(text="Starter library (procedural)", icon="ARMATURE_DATA")
        row = layout.row(align=True)
        row.operator("oncue.add_library", text="Add Files", icon="FILE")
        row.operator("oncue.add_library", text="Add Folder", icon="FILE_FOLDER").folder = True
        layout.operator("oncue.add_action", icon="ACTION")
        if settings.library_paths:
            layout.prop(settings, "mapping")
            row = layout.row(align=True)
            row.operator("oncue.read_library", icon="VIEWZOOM")
            row.operator("oncue.save_library", icon="FILE_TICK")
            _draw_captures(context, layout)
        header, manifold = layout.panel("oncue_manifold", default_closed=True)
        header.label(text="Motion Manifold")
        if manifold:
            _draw_manifold(manifold.column(), settings)


def _draw_captures(context: bpy.types.Context, layout: bpy.types.UILayout) -> None:
    """What each file gave when the library was read last."""
    try:
        captures = library_cache.captures_of(session.library_choice(context.scene))
    except SceneError:
        captures = None
    if not captures:
        return
    left_out = sum(not capture["clip"] for capture in captures)
    header, body = layout.panel("oncue_captures", default_closed=len(captures) > SHORT_LIST and not left_out)
    header.label(text=told(f"{len(captures)} Captures" + (f", {left_out} Left Out" if left_out else "")))
    if not body:
        return
    # Those that gave nothing come first: they want something done.
    for capture in sorted(captures, key=lambda capture: bool(capture["clip"]))[:LONGEST_LIST]:
        column = body.column(align=True)
        column.label(text=capture_line(capture), icon="CHECKMARK" if capture["clip"] else "ERROR")
        for said in [*capture["notes"], *filter(None, [capture["reason"]])]:
            write_lines(context, column, said, "BLANK1")
    if len(captures) > LONGEST_LIST:
        body.label(text=told(f"and {len(captures) - LONGEST_LIST} more"))


def capture_line(capture: dict) -> str:
    """A capture's file and the seconds of each action that it shows."""
    gave = [f"{label} {seconds:.0f} s" for label, seconds in capture["seconds"].items() if seconds >= 0.5]
    named = Path(capture["file"]).name + (f" ‘{capture['action']}’" if capture["action"] else "")
    return f"{named}: {', '.join(gave) if capture['clip'] and gave else 'nothing'}"


class ONCUE_UL_library(bpy.types.UIList):
    def draw_item(self, _context, layout, _data, item, _icon, _active_data, _active_property) -> None:
        icon = "FILE" if item.path.lower().endswith((".bvh", ".oncue", *FOREIGN)) else "FILE_FOLDER"
        layout.prop(item, "path", text="", emboss=False, icon=icon)


class ONCUE_PT_settings(OncuePanel, bpy.types.Panel):
    bl_label = "Settings"
    bl_order = 2
    bl_options = {"DEFAULT_CLOSED"}
    guide = "settings"

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, context.scene.oncue
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.prop(settings, "seed")
        layout.prop(settings, "liveliness", slider=True)
        row = layout.row(align=True)
        row.prop(settings, "start_frame")
        row.prop(settings, "starts_with_shot", text="", icon="PREVIEW_RANGE")
        layout.prop(settings, "every_frame")
        tolerance = layout.row()
        tolerance.active = not settings.every_frame
        tolerance.prop(settings, "key_tolerance")
        for name in ("root_motion", "preset", "overrides", "exclude", "scene_scale", "show_cues"):
            layout.prop(settings, name)
        layout.operator("oncue.toggle_exclude")
        layout.operator("oncue.reset_character")
        character = settings.character
        if character is not None and character.type == "ARMATURE" and is_rigify(character):
            layout.prop(settings, "rig_legs", expand=True)
            layout.prop(settings, "rig_arms", expand=True)
        _draw_bones(context, layout)


def _draw_bones(context: bpy.types.Context, layout: bpy.types.UILayout) -> None:
    """Which bones of the artist's own rig are which joints."""
    character = context.scene.oncue.character
    if native.MISSING or character is None or is_own_skeleton(character, native.core.skeleton()):
        return
    header, body = layout.panel("oncue_bones", default_closed=True)
    header.label(text=told(f"Bones of {character.name}"))
    if not body:
        return
    body.use_property_split = False
    try:
        known, said = own_rig.recognized(character)["joints"], ""
    except native.expected_errors() as error:
        known, said = {}, native.sentence(error)
    if said:
        write_lines(context, body, said, "ERROR")
    named = named_bones(character)
    column = body.column(align=True)
    for joint in native.core.skeleton()["names"]:
        if joint in known or joint in named or said:
            row = column.row(align=True)
            row.label(text=joint, icon="PINNED" if joint in named else "BONE_DATA")
            bone = named.get(joint) or known.get(joint, "")
            row.operator("oncue.name_bone", text=bone or told("None"), translate=False).joint = joint
    row = body.row(align=True)
    row.operator("oncue.save_bones", icon="FILE_TICK")
    row.operator("oncue.load_bones", icon="FILE_FOLDER")


def named_bones(character: bpy.types.Object) -> dict[str, str]:
    """The bones that the artist has named; none where what is kept of them cannot be read."""
    try:
        return own_rig.mapping_of(character)
    except SceneError:
        return {}


class ONCUE_PT_synthesize(OncuePanel, bpy.types.Panel):
    """Who acts, the button, and a row that tells how it goes. Blender puts what has no header above all else, in any
    order."""

    bl_label = "Synthesize"
    bl_order = 3
    bl_options = {"HIDE_HEADER"}

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        if native.MISSING:
            write_lines(context, layout, native.MISSING, "ERROR")
            return
        # As high while it works as before: what lies below stays where it is.
        row = layout.row()
        row.enabled = handle.run is None
        row.prop(context.scene.oncue, "character")
        layout.label(text=told(who_acts(context)), icon="BLANK1")
        row = layout.row()
        row.scale_y = 1.6
        if handle.run is not None:
            progress = handle.run.progress()
            stage = "Stopping" if handle.run.cancelled else progress.stage or handle.title
            stage = f"Waits for {handle.awaited}" if handle.awaited else stage
            row.progress(factor=min(max(progress.fraction, 0.0), 1.0), text=told_stage(stage))
            layout.operator("oncue.cancel", text="Cancel (Esc)", icon="CANCEL")
        else:
            row.operator("oncue.synthesize", icon="ARMATURE_DATA")
            layout.operator("oncue.follow_cues", icon="CON_FOLLOWPATH", depress=following.on)
        line, icon = status_line(context)
        row = layout.row()
        row.label(text=told(line), icon=icon)
        if handle.run is None and unwritten.of(context.scene):
            row.operator("oncue.write_motion", icon="ACTION")


class ONCUE_PT_takes(OncuePanel, bpy.types.Panel):
    """The takes of the character, and several at once."""

    bl_label = "Takes"
    bl_order = 5
    bl_options = {"DEFAULT_CLOSED"}
    guide = "first-shot"

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, context.scene.oncue
        row = layout.row(align=True)
        row.operator("oncue.variations", icon="MOD_ARRAY")
        row.prop(settings, "variations", text="")
        found = takes.takes_of(settings.character)
        if not found:
            return
        played = session.current_action(context.scene)
        column = layout.column(align=True)
        for take in found[:LONGEST_LIST]:
            row = column.row(align=True)
            icon = "RADIOBUT_ON" if take == played else "RADIOBUT_OFF"
            row.operator("oncue.play_take", text="", icon=icon, emboss=False).name = take.name
            row.prop(take, "name", text="", emboss=False)
            line, mark = take_line(session.report_of(take))
            row.label(text=line, icon=mark)
            row.operator("oncue.discard_take", text="", icon="X", emboss=False).name = take.name
        if len(found) > LONGEST_LIST:
            column.label(text=told(f"and {len(found) - LONGEST_LIST} more"))
        row = layout.row(align=True)
        row.operator("oncue.copy_take", icon="DUPLICATE")
        row.operator("oncue.push_take", text="Push to NLA", icon="NLA_PUSHDOWN")


def take_line(report: dict | None) -> tuple[str, str]:
    """What the list tells of a take beside its name, and its icon: how long it is, and how far off its worst cue."""
    try:
        seconds = report["frames"] / 30.0 * body_size.clock(session.body_size_of(report))
        off = max((cue["pelvis_cm"] for cue in report["cues"]), default=None)
        line = f"{seconds:.1f} s" + (f", {off:.1f} cm" if off is not None else "")
        return line, "CHECKMARK" if report["success"] else "ERROR"
    except (LookupError, TypeError, ValueError, AttributeError):
        return "", "ERROR"


class ONCUE_PT_results(OncuePanel, bpy.types.Panel):
    bl_label = "Result"
    bl_order = 6
    guide = "troubleshooting"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return session.current_report(context.scene) is not None

    def draw(self, context: bpy.types.Context) -> None:
        layout, report = self.layout, session.current_report(context.scene)
        column = layout.column(align=True)
        try:
            same_cues, lines = session.belongs_to_cues(context, report), result_lines(report)
            problems, deepest = [str(problem) for problem in session.problems_of(report)], deepest_line(report)
        except (KeyError, TypeError, ValueError, AttributeError, OverflowError):
            same_cues, lines, deepest = True, [], None
            problems = ["The report that is kept with this take was changed and cannot be read."]
        if not same_cues:
            said = "The cues have changed since: this motion belongs to where they were."
            write_lines(context, column, said, "INFO")
        for line, icon in lines:
            column.label(text=told_line(line), icon=icon)
        if deepest:
            row = column.row(align=True)
            row.label(text=told_line(deepest[0]), icon="BLANK1")
            row.operator("oncue.go_to_frame", text=told(f"Frame {deepest[1]}"), icon="TIME").frame = deepest[1]
        for problem in problems:
            write_lines(context, layout.box(), problem, "ERROR")


class ONCUE_PT_messages(OncuePanel, bpy.types.Panel):
    """All that is said: below everything else, so that it pushes no button from under the mouse when it comes."""

    bl_label = "Messages"
    bl_order = 7
    guide = "troubleshooting"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return bool(handle.run or handle.message or following_line(context)[0] or unwritten.of(context.scene))

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        if handle.run is not None:
            for line, icon in progress_lines(handle.run.progress()):
                layout.label(text=told(line), icon=icon)
            if handle.awaited:
                said = f"The result is ready and belongs to the scene {handle.awaited}: show it, and it is written."
                write_lines(context, layout, said, "INFO")
            return
        line, icon = following_line(context)
        if line:
            write_lines(context, layout, line, icon)
        if handle.message:
            write_lines(context, layout.box(), handle.message, "ERROR" if handle.failed else "INFO")
            _draw_way_out(layout, handle.error)
        if unwritten.of(context.scene):
            write_lines(context, layout, "A motion was made and is not written yet.", "INFO")


def _draw_way_out(layout: bpy.types.UILayout, error: BaseException | None) -> None:
    """The button that does what a refusal asks for."""
    if isinstance(error, CharacterError):
        layout.operator("oncue.reset_character", icon="LOOP_BACK")
    elif isinstance(error, EdgeError):
        button = layout.operator("oncue.move_to_edge", icon="SNAP_EDGE")
        button.place, button.yaw = error.place, error.yaw
    elif isinstance(error, ScaleError):
        row = layout.row(align=True)
        for label, scale in (("Centimetres", 0.01), ("Millimetres", 0.001), ("Metres", 1.0)):
            row.operator("oncue.set_scene_scale", text=label).scale = scale


class ONCUE_PT_edit(OncuePanel, bpy.types.Panel):
    bl_label = "Edit"
    bl_order = 4
    guide = "editing-keys"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return session.current_action(context.scene) is not None

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        row = layout.row(align=True)
        row.operator("oncue.pin", icon="PINNED")
        row.operator("oncue.pin", text="Pin over Frames", icon="PREVIEW_RANGE").over_range = True
        layout.operator("oncue.resolve", icon="FILE_REFRESH")
        pins = read_pins(session.current_action(context.scene))
        if not pins:
            return
        header, body = layout.panel("oncue_pins", default_closed=len(pins) > SHORT_LIST)
        header.label(text=told(f"{len(pins)} Pins and Keys" if len(pins) > 1 else "1 Pin or Key"))
        header.operator("oncue.remove_pins", text="", icon="TRASH", emboss=False)
        if body:
            _draw_pins(body.column(align=True), pins)


def _draw_pins(column: bpy.types.UILayout, pins: list[Pin]) -> None:
    for index, pin in enumerate(pins[:LONGEST_LIST]):
        row = column.row(align=True)
        row.label(text=pin.title, icon="KEY_HLT" if pin.is_key else "PINNED")
        row.operator("oncue.remove_pin", text="", icon="X", emboss=False).index = index
    if len(pins) > LONGEST_LIST:
        column.label(text=told(f"and {len(pins) - LONGEST_LIST} more"))


def result_lines(report: dict) -> list[tuple[str, str]]:
    """The figures of a report as (line, icon)."""
    lines = []
    late = {step["cue"]: step.get("late_s") for step in report.get("steps", [])}
    for cue in report.get("cues", []):
        lines.append((f"{cue['cue']}: {'met' if cue['met'] else 'not met'}", "CHECKMARK" if cue["met"] else "ERROR"))
        if (by := late.get(cue["cue"])) is not None:
            lines.append((_late_line(by), "BLANK1"))
        if cue.get("action_type") == PASS:
            lines.append((f"    Passed {cue['pelvis_cm']:.1f} cm away", "BLANK1"))
        else:
            lines.append((f"    Pelvis {cue['pelvis_cm']:.1f} cm, facing {cue['facing_degrees']:.1f}°", "BLANK1"))
        for foot, miss in zip(("Left foot", "Right foot"), cue.get("feet_cm", (None, None)), strict=True):
            if miss is not None:
                lines.append((f"    {foot} {miss:.1f} cm", "BLANK1"))
    for look in report.get("looks", []):
        seconds, lasts = look["met"] / 30.0, (look["end"] - look["first"]) / 30.0
        lines.append((f"{look['look']}: looked at for {seconds:.1f} of {lasts:.1f} s", CUE_ICONS[LOOK]))
    lines += _met_lines((report.get("edited") or {}).get("constraints", []), skip={c["cue"] for c in report["cues"]})
    lines += _met_lines(report.get("artist", {}).get("constraints", []), skip=set())
    if "foot" in report:
        lines.append((f"Foot contact {report['foot']['contact_cm']:.1f} cm", "BLANK1"))
        lines.append((f"Skate {report['foot']['skate_cm']:.2f} cm a frame", "BLANK1"))
    if "penetration" in report:
        lines += _clipping_lines(report["penetration"])
    moving = report.get("extension", {}).get("moving", {})
    if moving.get("meetings"):
        met = ", ".join(meeting["object"] for meeting in moving["meetings"])
        lines.append((f"    in what moves ({met}) in {moving['percent']:.1f} %", "BLANK1"))
    if others := report.get("others"):
        lines.append((f"In other people in {others['percent']:.1f} % of the frames", "BLANK1"))
    seconds = report.get("extension", {}).get("seconds", {})
    if seconds:
        lines.append((f"Made in {sum(seconds.values()):.0f} s, seed {report.get('seed', 0)}", "TIME"))
    return lines


def _late_line(seconds: float) -> str:
    """Whether a cue is met at its time."""
    by = f"{abs(seconds):.1f}"
    if by == "0.0":
        return "    On time"
    return f"    {by} s late" if seconds > 0.0 else f"    {by} s early"


def deepest_line(report: dict) -> tuple[str, int] | None:
    """Which part of the body is deepest in what, and on which frame; None where nothing is."""
    deepest = (report.get("extension") or {}).get("deepest")
    if not deepest:
        return None
    part, thing = deepest["part"].replace("_", " "), deepest["object"] or "what moves"
    return f"    Deepest: {part} {deepest['depth_cm']:.1f} cm in {thing}", int(deepest["frame"])


def _clipping_lines(penetration: dict) -> list[tuple[str, str]]:
    """In how many frames limbs are in the scene, and any part at all: which part most."""
    lines = [(f"Clipping: legs or arms in {penetration['percent']:.1f} % of the frames", "BLANK1")]
    parts = penetration.get("parts_percent") or {}
    percent = penetration["whole_body_percent"]
    if not parts:
        return [*lines, (f"    any part in {percent:.1f} %", "BLANK1")]
    worst = max(parts, key=parts.get)
    return [*lines, (f"    any part in {percent:.1f} %, most the {worst} ({parts[worst]:.1f} %)", "BLANK1")]


def _met_lines(constraints: list[dict], skip: set[str]) -> list[tuple[str, str]]:
    """One line for everything of one name that an edit was to meet: how far the worst of it is off."""
    lines = []
    for name in dict.fromkeys(c["name"] for c in constraints if c["name"] not in skip):
        same = [c for c in constraints if c["name"] == name]
        centimetres = [c["max_cm"] for c in same if c["max_cm"] is not None]
        degrees = [c["max_degrees"] for c in same if c["max_degrees"] is not None]
        off = [f"{max(centimetres):.1f} cm"] if centimetres else []
        off += [f"{max(degrees):.1f}°"] if degrees else []
        lines.append((f"{name}: {', '.join(off)}", "CHECKMARK" if all(c["met"] for c in same) else "ERROR"))
    return lines


def _draw_limbs(column: bpy.types.UILayout) -> None:
    row = column.row(align=True)
    row.operator("oncue.place_foot", text="Left Foot").side = "left"
    row.operator("oncue.place_foot", text="Right Foot").side = "right"
    row = column.row(align=True)
    row.operator("oncue.place_hand", text="Left Hand").kind = "left_hand"
    row.operator("oncue.place_hand", text="Right Hand").kind = "right_hand"
    row.operator("oncue.place_hand", text="Both").kind = "both_hands"
    column.separator()
    row = column.row(align=True)
    for hand, text in (("left", "Take Left"), ("right", "Take Right"), ("both", "Take Both")):
        row.operator("oncue.place_take", text=text).hand = hand
    column.operator("oncue.place_put")
    row = column.row(align=True)
    for hand, text in (("left", "Open Left"), ("right", "Open Right"), ("both", "Open Both")):
        row.operator("oncue.place_open", text=text).hand = hand


def _draw_manifold(column: bpy.types.UILayout, settings) -> None:
    column.use_property_split = True
    column.use_property_decorate = False
    column.prop(settings, "manifold", text="File", placeholder="The one that ships")
    column.prop(settings, "manifold_passes")
    column.operator("oncue.train_manifold", icon="GRAPH")


def progress_lines(progress: Progress) -> list[tuple[str, str]]:
    """What a run tells besides its stage, as (line, icon)."""
    taken, left = f"{progress.elapsed_s:.0f} s", progress.remaining_s
    lines = [(taken if left is None else f"{taken}, about {left:.0f} s left", "TIME")]
    if progress.update:
        success, reward = 100.0 * progress.success_rate, progress.reward
        lines.append((f"Update {progress.update}, success {success:.0f} %, reward {reward:.2f}", "BLANK1"))
    return lines


def status_line(context: bpy.types.Context) -> tuple[str, str]:
    """The one row of what is said that always stands below the button, and its icon; the rest is in Messages."""
    if handle.run is not None:
        return progress_lines(handle.run.progress())[0]
    line, icon = following_line(context)
    if line:
        return line, icon
    return handle.message, "NONE" if not handle.message else "ERROR" if handle.failed else "INFO"


def following_line(context: bpy.types.Context) -> tuple[str, str]:
    """What is said of the following, and its icon; nothing where there is nothing to say."""
    follower = following.follower
    if follower is None:
        return following.message, "INFO"
    if follower.line:
        return follower.line, "ERROR"
    if follower.rested:
        hands = visible_cues(context, *HANDS)
        return ("Met but for the hands: press Synthesize", "INFO") if hands else ("Met", "CHECKMARK")
    # Short, so that the panels below stay where they are during a drag.
    return ("Drag a cue" if follower.delay is None else f"Followed in {1000 * follower.delay:.0f} ms"), "INFO"


def told_line(line: str) -> str:
    """A line in the language of the interface, as far in as it was."""
    words = line.lstrip()
    return line[: len(line) - len(words)] + told(words)


def told_stage(stage: str) -> str:
    """A stage in the language of the interface; of several people's the person is named before it."""
    person, of, rest = stage.rpartition(": ")
    return f"{person}{of}{told(rest)}"


def write_lines(context: bpy.types.Context, layout: bpy.types.UILayout, text: str, icon: str) -> None:
    """A sentence over as many lines as the sidebar's width asks for."""
    width = context.region.width / context.preferences.system.ui_scale if context.region else 240
    column = layout.column(align=True)
    for k, line in enumerate(textwrap.wrap(told(text), max(int((width - 50) / CHARACTER_WIDTH), 16))):
        column.label(text=line, icon=icon if k == 0 else "BLANK1")


CLASSES = (
    *(ONCUE_UL_library, ONCUE_PT_cues, ONCUE_PT_library, ONCUE_PT_settings),
    *(ONCUE_PT_synthesize, ONCUE_PT_edit, ONCUE_PT_takes, ONCUE_PT_results, ONCUE_PT_messages),
)


register, unregister = bpy.utils.register_classes_factory(CLASSES)
