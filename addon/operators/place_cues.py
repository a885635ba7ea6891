# SPDX-License-Identifier: GPL-3.0-or-later
"""Placing cues: at the 3D cursor, on the selected seat, feet beside a cue, and hands on what they hold."""

from __future__ import annotations

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, FloatVectorProperty, IntProperty, StringProperty

from ..bridge import cue_objects, hand_reader, people, seat_finder, session
from ..bridge.leaves import AXES
from ..bridge.names import CUE_KEY
from ..bridge.shown_cues import ordered_cues, person_of, several_starts
from ..errors import SceneError
from ..job_operator import handle
from .button import Button


class ONCUE_OT_place_cue(Button, bpy.types.Operator):
    """Place the cue on what lies under the 3D cursor; one that is there already moves"""

    bl_idname = "oncue.place_cue"
    bl_label = "Place Cue"

    kind: EnumProperty(
        name="Kind",
        description="What the person does there",
        items=[
            ("start", "Start", "Where the character begins"),
            ("sit", "Sit", "Where the character's pelvis ends seated"),
            ("stop", "Stop", "Where the character ends standing"),
            ("pass", "Pass", "What the character walks over on the way to the next Sit or Stop cue"),
        ],
        options={"SKIP_SAVE"},
    )
    then: BoolProperty(
        name="Then",
        description="Make another cue, which is played after those that are there",
        default=False,
        options={"SKIP_SAVE"},
    )

    @classmethod
    def description(cls, _context, properties) -> str:
        if properties.then:
            return "Place another cue under the 3D cursor, for which the person goes on from the last one"
        if properties.kind == "pass":
            return (
                "Place another Pass cue on the floor under the 3D cursor, which the person walks over without a stop: "
                "before the selected Sit or Stop cue, or after the selected Pass cue"
            )
        where = {
            "start": "Place the Start cue on the floor under the 3D cursor",
            "sit": "Place the Sit cue on the seat under the 3D cursor, facing away from its back",
            "stop": "Place the Stop cue on the floor under the 3D cursor",
        }
        return where[properties.kind] + ". One that is there already moves"

    def act(self, context: bpy.types.Context) -> None:
        scale = context.scene.oncue.scene_scale
        cursor = context.scene.cursor.location
        if self.kind == "sit":
            seat = seat_finder.seat_below(context, cursor, scale)
            place, yaw = seat.pelvis, seat.yaw
        else:
            place = seat_finder.surface_below(context, cursor, scale)
            yaw = cue_objects.facing_on_the_way(context, self.kind, place, self.then)
        cue_objects.place_cue(context, self.kind, place, yaw, scale, then=self.then)


class ONCUE_OT_move_step(Button, bpy.types.Operator):
    """Have the person come to this cue earlier or later"""

    bl_idname = "oncue.move_step"
    bl_label = "Move in the Order"
    bl_options = {"REGISTER", "UNDO", "INTERNAL"}

    cue: StringProperty(name="Cue", description="The cue in the list", options={"SKIP_SAVE"})
    by: IntProperty(name="By", description="So many places later", default=1, options={"SKIP_SAVE"})

    def act(self, context: bpy.types.Context) -> None:
        cue = next((cue for cue in ordered_cues(context) if cue.name == self.cue), None)
        person = person_of(context, cue) if cue is not None and several_starts(context) else None
        played = ordered_cues(context, person)
        at = next((at for at, cue in enumerate(played) if cue.name == self.cue), None)
        if at is None:
            raise SceneError(f"There is no cue {self.cue} any more.")
        moved = played.pop(at)
        played.insert(min(max(at + self.by, 0), len(played)), moved)
        cue_objects.number_steps(played)


class ONCUE_OT_add_person(Button, bpy.types.Operator):
    """Place another Start cue on the floor under the 3D cursor, for a person with cues and a character of their own"""

    bl_idname = "oncue.add_person"
    bl_label = "Add Person"

    def act(self, context: bpy.types.Context) -> None:
        scale = context.scene.oncue.scene_scale
        place = seat_finder.surface_below(context, context.scene.cursor.location, scale)
        cue_objects.add_person(context, place, scale)


class ONCUE_OT_give_to_person(Button, bpy.types.Operator):
    """Have the selected Sit, Stop, Pass and Look cues be the person's whose Start cue is active"""

    bl_idname = "oncue.give_to_person"
    bl_label = "Give to Person"

    def act(self, context: bpy.types.Context) -> None:
        cue_objects.give_to_person(*cue_objects.given_cues(context))


class ONCUE_OT_choose_person(Button, bpy.types.Operator):
    """Select this person: the Start cue, and the character whose takes, figures and edits the panels show"""

    bl_idname = "oncue.choose_person"
    bl_label = "Choose Person"
    bl_options = {"REGISTER", "UNDO", "INTERNAL"}

    start: StringProperty(name="Start", description="The person's Start cue", options={"SKIP_SAVE"})

    def act(self, context: bpy.types.Context) -> None:
        person = people.person_named(context, self.start)
        if person.character is not None:
            context.scene.oncue.character = person.character
        cue_objects.select_cue(context, self.start)


class ONCUE_OT_act_by(Button, bpy.types.Operator):
    """Have the person whose Start cue is active act by the selected armature"""

    bl_idname = "oncue.act_by"
    bl_label = "Act by Selected Armature"

    def act(self, context: bpy.types.Context) -> None:
        start = context.active_object
        chosen = [thing for thing in context.selected_objects if thing.type == "ARMATURE"]
        if start is None or start.get(CUE_KEY) != "start" or len(chosen) != 1:
            raise SceneError("Select an armature, and last the Start cue of the person who is to act by it.")
        people.choose_character(start, chosen[0])


class ONCUE_OT_select_cue(Button, bpy.types.Operator):
    """Select this cue"""

    bl_idname = "oncue.select_cue"
    bl_label = "Select Cue"
    bl_options = {"REGISTER", "UNDO", "INTERNAL"}

    cue: StringProperty(name="Cue", description="The cue's name", options={"SKIP_SAVE"})

    def act(self, context: bpy.types.Context) -> None:
        cue_objects.select_cue(context, self.cue)


class ONCUE_OT_be_here(Button, bpy.types.Operator):
    """Have the person be here at a frame, or take that off: at first that on which it is now, else the current one"""

    bl_idname = "oncue.be_here"
    bl_label = "Be Here at Frame"
    bl_options = {"REGISTER", "UNDO", "INTERNAL"}

    cue: StringProperty(name="Cue", description="The Sit or Stop cue", options={"SKIP_SAVE"})

    def act(self, context: bpy.types.Context) -> None:
        met = session.frames_of_cues(context).get(self.cue)
        cue_objects.be_here(context, self.cue, context.scene.frame_current if met is None else met)


class ONCUE_OT_sit_on_selection(Button, bpy.types.Operator):
    """Place the Sit cue on the seat's selected face (edit mode) or on the active object, facing away from its back"""

    bl_idname = "oncue.sit_on_selection"
    bl_label = "Sit on Selection"

    def act(self, context: bpy.types.Context) -> None:
        scale = context.scene.oncue.scene_scale
        seat = seat_finder.seat_of_selection(context, scale)
        cue_objects.place_cue(context, "sit", seat.pelvis, seat.yaw, scale)


class ONCUE_OT_place_look(Button, bpy.types.Operator):
    """Place a Look cue on the selected object, along with which it goes, else at the 3D cursor. The person looks \
there once the cue before it is reached"""

    bl_idname = "oncue.place_look"
    bl_label = "Look"

    def act(self, context: bpy.types.Context) -> None:
        cue_objects.place_look(context, context.scene.oncue.scene_scale)


class ONCUE_OT_move_to_edge(Button, bpy.types.Operator):
    """Move the Sit cue to the nearest edge of its seat from which a person can sit down"""

    bl_idname = "oncue.move_to_edge"
    bl_label = "Move to the Near Edge"
    bl_options = {"REGISTER", "UNDO", "INTERNAL"}

    place: FloatVectorProperty(
        name="Place", description="Where the pelvis is to be, world, metres", size=3, options={"SKIP_SAVE"}
    )
    yaw: FloatProperty(name="Facing", description="From -Y about +Z", subtype="ANGLE", options={"SKIP_SAVE"})

    def act(self, context: bpy.types.Context) -> None:
        scale = context.scene.oncue.scene_scale
        cue_objects.move_end_cue(context, [c / scale for c in self.place], self.yaw, scale)
        handle.forget()


class ONCUE_OT_place_foot(Button, bpy.types.Operator):
    """Place a foot cue before the Sit or Stop cue; move it to where the foot is to stand"""

    bl_idname = "oncue.place_foot"
    bl_label = "Place Foot"

    side: EnumProperty(
        name="Side",
        description="Which foot",
        items=[("left", "Left", "The person's own left"), ("right", "Right", "The person's own right")],
        options={"SKIP_SAVE"},
    )

    def act(self, context: bpy.types.Context) -> None:
        cue_objects.place_foot(context, self.side, context.scene.oncue.scene_scale)


class ONCUE_OT_place_hand(Button, bpy.types.Operator):
    """Place a hand cue, which the hand follows for some frames: on the selected vertex (edit mode), or at the cursor. \
It goes along with the selected object"""

    bl_idname = "oncue.place_hand"
    bl_label = "Place Hand"

    kind: EnumProperty(
        name="Hand",
        description="Which hand follows the cue",
        items=[
            ("left_hand", "Left", "The person's own left"),
            ("right_hand", "Right", "The person's own right"),
            ("both_hands", "Both", "Side by side, as at a box or a wide door"),
        ],
        options={"SKIP_SAVE"},
    )
    first_frame: IntProperty(name="First Frame", description="When the hand is there first", options={"SKIP_SAVE"})
    last_frame: IntProperty(name="Last Frame", description="When the hand lets go", options={"SKIP_SAVE"})

    def act(self, context: bpy.types.Context) -> None:
        scene = context.scene
        if not self.properties.is_property_set("first_frame"):
            self.first_frame, self.last_frame = self._usual_range(context)
        cue_objects.place_hand(context, self.kind, self.first_frame, self.last_frame, scene.oncue.scene_scale)

    def _usual_range(self, context: bpy.types.Context) -> tuple[int, int]:
        """The frames over which what the hand holds moves, else two seconds from the current frame on."""
        now, seconds = context.scene.frame_current, 2.0
        held = context.active_object
        found = cue_objects.animated_range(held) if held and held.select_get() else None
        return found or (now, now + round(seconds * hand_reader.frame_rate(context.scene)))


class ONCUE_OT_place_take(Button, bpy.types.Operator):
    """Have the selected thing taken by a hand at the last Sit or Stop cue, and carried from then on. Where that is \
out of reach, a Stop cue is placed before the thing"""

    bl_idname = "oncue.place_take"
    bl_label = "Take Thing"

    hand: EnumProperty(
        name="Hand",
        description="Which hand takes it",
        items=[
            ("left", "Left", "The person's own left"),
            ("right", "Right", "The person's own right"),
            ("both", "Both", "One on each side, as a box or a tray is carried"),
        ],
        default="right",
        options={"SKIP_SAVE"},
    )

    def act(self, context: bpy.types.Context) -> None:
        cue_objects.place_take(context, self.hand, context.scene.oncue.scene_scale)


class ONCUE_OT_place_put(Button, bpy.types.Operator):
    """Have what was taken last be put down on what lies under the 3D cursor, at the last Sit or Stop cue. Where that \
is out of reach, a Stop cue is placed before it"""

    bl_idname = "oncue.place_put"
    bl_label = "Put Down"

    def act(self, context: bpy.types.Context) -> None:
        scale = context.scene.oncue.scene_scale
        place = seat_finder.surface_below(context, context.scene.cursor.location, scale)
        cue_objects.place_put(context, place, scale)


class ONCUE_OT_place_open(Button, bpy.types.Operator):
    """Have the selected door, lid or drawer opened by a hand at the last Sit or Stop cue. Where that is out of reach, \
a Stop cue is placed where nothing that opens runs into the person"""

    bl_idname = "oncue.place_open"
    bl_label = "Open"

    hand: EnumProperty(
        name="Hand",
        description="Which hand opens it",
        items=[
            ("left", "Left", "The person's own left"),
            ("right", "Right", "The person's own right"),
            ("both", "Both", "Side by side, as at a wide lid"),
        ],
        default="right",
        options={"SKIP_SAVE"},
    )
    how: EnumProperty(
        name="Opens",
        description="Whether it turns or slides",
        items=[
            ("auto", "As Found", "By its limits and locks, else about the edge on which its origin lies"),
            ("hinge", "Turns", "About an axis through its origin"),
            ("slide", "Slides", "Along an axis of its own"),
        ],
        options={"SKIP_SAVE"},
    )
    axis: EnumProperty(
        name="Axis",
        description="About or along which of its own axes",
        items=[
            ("auto", "As Found", "By its limits, locks or origin; what slides comes towards the person"),
            ("X", "X", "The object's own X"),
            ("Y", "Y", "The object's own Y"),
            ("Z", "Z", "The object's own Z"),
        ],
        options={"SKIP_SAVE"},
    )
    amount: FloatProperty(
        name="How Far",
        description="Degrees, or metres; negative the other way. 0: as far as it can or usually is",
        options={"SKIP_SAVE"},
    )

    def act(self, context: bpy.types.Context) -> None:
        how = None if self.how == "auto" else self.how
        axis = None if self.axis == "auto" else AXES.index(self.axis)
        cue_objects.place_open(context, self.hand, how, axis, self.amount, context.scene.oncue.scene_scale)


CLASSES = (
    *(ONCUE_OT_move_step, ONCUE_OT_select_cue, ONCUE_OT_be_here),
    *(ONCUE_OT_add_person, ONCUE_OT_give_to_person, ONCUE_OT_choose_person, ONCUE_OT_act_by),
    *(ONCUE_OT_place_cue, ONCUE_OT_sit_on_selection, ONCUE_OT_move_to_edge),
    *(ONCUE_OT_place_foot, ONCUE_OT_place_hand, ONCUE_OT_place_take, ONCUE_OT_place_put, ONCUE_OT_place_open),
    ONCUE_OT_place_look,
)


register, unregister = bpy.utils.register_classes_factory(CLASSES)
