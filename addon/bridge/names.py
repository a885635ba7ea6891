# SPDX-License-Identifier: GPL-3.0-or-later
"""How Oncue recognises its own objects: custom properties, so that scripts can make them too."""

from __future__ import annotations

import bpy

#: On an empty: a kind of `cue_objects.KINDS`. The empty faces its local -Y.
CUE_KEY = "oncue_cue"
#: On a hand cue: the frames of the scene between which the hand follows it, first and last.
FIRST_FRAME_KEY, LAST_FRAME_KEY = "oncue_first_frame", "oncue_last_frame"
#: On a sit or stop cue: the seconds that the person stays there; without it one.
HOLD_KEY = "oncue_hold_seconds"
#: On a sit or stop cue: the frame of the scene on which it is to be reached; without it that is when it comes to it.
AT_FRAME_KEY = "oncue_at_frame"
#: On a take, put or open cue: the thing (the object) that is taken, put down or opened; on the action that has it so:
#: the same.
THING_KEY = "oncue_thing"
#: On a take or open cue: which hand takes or opens it, "left", "right" or "both".
HAND_KEY = "oncue_hand"
#: On an open cue: "hinge" or "slide", the object's own axis through its origin, "X", "Y" or "Z", how far it is opened,
#: degrees or metres, and over how many seconds; 0 or missing: as long as people take.
OPENS_KEY, AXIS_KEY, AMOUNT_KEY, OVER_KEY = "oncue_opens", "oncue_axis", "oncue_amount", "oncue_over_seconds"
#: On an action that has a thing carried: the take that it belongs to, and the object's own matrix before, 16 numbers.
CARRIED_IN_KEY, REST_KEY = "oncue_carried_in", "oncue_rest"
#: On a sit, stop, pass, take, put or open cue: its place in the order in which several are played, from 1; those
#: without come last, by name.
STEP_KEY = "oncue_step"
#: On a sit, stop or pass cue: the start (the object) of the person who plays it; needed where several people start.
PERSON_KEY = "oncue_person"
#: On a start cue: the armature of the person who starts there; needed where several people start.
ACTS_KEY = "oncue_acts"
#: On a start or put cue: the yaw that its button gave it, radians; one that the artist has turned since stays as it is.
GIVEN_YAW_KEY = "oncue_given_yaw"
#: On the armature and the meshes of a character: no part of the scene where it is the one that is moved, and in the way
#: as another person where it is not. A mesh that carries it without an armature is no obstacle.
CHARACTER_KEY = "oncue_character"
#: On any object that the character may walk through.
EXCLUDE_KEY = "oncue_exclude"
#: On an action: the report of the run that made it, JSON.
REPORT_KEY = "oncue_report"
#: On an action: the character for which a run made it.
TAKE_OF_KEY = "oncue_take_of"
#: On an action: the motion as the core gave it last, and what is pinned.
SOLVED_KEY, PINS_KEY = "oncue_solved", "oncue_pins"
#: On an action: that it was made by following the cues, and by which following.
LIVE_KEY = "oncue_live"

COLLECTION_NAME = "Oncue"


def oncue_collection(context: bpy.types.Context) -> bpy.types.Collection:
    """The scene's collection for cues and character, made when it is missing and never a hidden one."""
    scene = context.scene
    for collection in scene.collection.children:
        if (
            collection.name.split(".")[0] == COLLECTION_NAME
            and collection.is_editable
            and _usable(context.view_layer, collection)
        ):
            return collection
    collection = bpy.data.collections.new(COLLECTION_NAME)
    scene.collection.children.link(collection)
    return collection


def _usable(view_layer: bpy.types.ViewLayer, collection: bpy.types.Collection) -> bool:
    layer = view_layer.layer_collection.children.get(collection.name)
    return layer is not None and not layer.exclude and not layer.hide_viewport and not collection.hide_viewport
