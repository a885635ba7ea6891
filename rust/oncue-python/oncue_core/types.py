"""The plain dicts that go in and come out."""

from typing import Any, Literal, NotRequired, TypeAlias, TypedDict

import numpy as np
from numpy.typing import NDArray

#: Metres; x, y, z in the world unless said otherwise.
Point: TypeAlias = tuple[float, float, float]

#: Settings by name; what is left out keeps its default.
Settings: TypeAlias = dict[str, Any]


class InitialState(TypedDict):
    """g_init: where the person stands at first. `yaw` in radians turns the rest pose, which faces -Y, about +Z."""

    name: str
    position: Point | list[float]
    yaw: float


class ActionCue(TypedDict):
    """φ_A: how the motion is to end. `position` is the pelvis joint's; `feet` the left and the right ankle's."""

    name: str
    action_type: Literal["sit", "stop"]
    position: Point | list[float]
    yaw: float
    feet: NotRequired[list[Point | list[float] | None]]


class ManipulationCue(TypedDict):
    """φ_M: the path that a palm follows, one place a frame (30 Hz), world, metres.

    `first_frame`: the motion's frame at which the hand is at the first place; without it, as soon as the action is
    complete and the hand has got there. It may lie after the motion's end: who stands or sits still waits for it.
    """

    name: str
    hand: Literal["left", "right", "both"]
    path: list[Point] | list[list[float]]
    first_frame: NotRequired[int | None]


class PassCue(TypedDict):
    """A waypoint: a place on the floor that the pelvis passes over on the way to a cue, without a stop."""

    name: str
    position: Point | list[float]


class Task(TypedDict):
    """A start, the cue that follows it, and what the hands do. `passes`: what the way leads through, in order."""

    start: InitialState
    passes: NotRequired[list[PassCue]]
    cue: ActionCue
    manipulations: NotRequired[list[ManipulationCue]]


class Thing(TypedDict):
    """A thing that hands can take: where it stands at first, and its box in its own frame, metres.

    `rotation`: w first.
    """

    name: str
    position: Point | list[float]
    rotation: tuple[float, float, float, float] | list[float]
    low: Point | list[float]
    high: Point | list[float]


class TakeCue(TypedDict):
    """To take a thing. `grip`: in its frame, metres; palms come to the faces of its box to either side of it."""

    does: Literal["take"]
    name: str
    thing: str
    hand: Literal["left", "right", "both"]
    grip: Point | list[float]


class PutCue(TypedDict):
    """To put a thing down. `position`: where the middle of what it stands on comes to lie. `yaw`: of its -Y axis."""

    does: Literal["put"]
    name: str
    thing: str
    position: Point | list[float]
    yaw: NotRequired[float | None]


class Hinge(TypedDict):
    """What turns about a line of its own frame, metres: turns are positive about `axis` by the right hand's rule."""

    by: Literal["hinge"]
    point: Point | list[float]
    axis: Point | list[float]


class Slide(TypedDict):
    """What slides along a direction of its own frame."""

    by: Literal["slide"]
    direction: Point | list[float]


class Leaf(TypedDict):
    """What a hand can open: a door, a lid, a drawer; no part of the scene, and in the way wherever it is.

    `position`, `rotation` (w first): of its origin at first. `positions`, `triangles`: its mesh, in its frame, metres.
    """

    name: str
    position: Point | list[float]
    rotation: tuple[float, float, float, float] | list[float]
    hung: Hinge | Slide
    positions: NotRequired[list[list[float]]]
    triangles: NotRequired[list[list[int]]]


class Degrees(TypedDict):
    """An amount about a hinge."""

    degrees: float


class Metres(TypedDict):
    """An amount along a slide."""

    metres: float


class OpenCue(TypedDict):
    """To open a leaf, or to close it. `thing`: the leaf's name. `by`: from where it is by then.

    `grip`: where the palm takes hold of it, in its frame, metres. `over_seconds`: how long it moves; without it as long
    as people take.
    """

    does: Literal["open"]
    name: str
    thing: str
    hand: Literal["left", "right", "both"]
    by: Degrees | Metres
    grip: Point | list[float]
    over_seconds: NotRequired[float | None]


class OpenedFigures(TypedDict):
    """What became of something that was opened. Frames: the palm has come to the handle, lets go, and it stands open.

    `led`: the part of its way over which the hand led it, the rest it swung on. `handle_cm`: how far the palm was from
    the handle. `arm_cm`, `body_cm`: how deep arms, but for the hand on it, and the rest of the body were in it.
    """

    leaf: str
    open: str
    hand: Literal["left", "right", "both"]
    taken: int
    let_go: int
    opened: int
    led: float
    handle_cm: float
    arm_cm: float
    body_cm: float


class CarriedThing(TypedDict):
    """Where a thing was from the motion's frame on which it was taken, or a leaf from that on which it began to open,
    until it stood again, or the motion's end.

    `positions`: of its origin, (n, 3), world, metres. `rotations`: (n, 4), world, w first.
    """

    name: str
    first_frame: int
    positions: NDArray[np.float32]
    rotations: NDArray[np.float32]


class ThingFigures(TypedDict):
    """What became of a thing that was taken. `taken`, `placed`: when the palms had come to it, and it stood again.

    `grip_cm`, `turn_degrees`: how far a palm got on it and a hand turned on it while it was carried, at the most.
    `in_body_cm`: how deep it was in trunk, legs or head; `in_scene_cm`: its box in the scene, while carried;
    `in_others_cm`: how deep it was in another person, wherever it stood; of one alone it is not there.
    """

    thing: str
    take: str
    hand: Literal["left", "right", "both"]
    taken: int
    put: str | None
    placed: int | None
    put_cm: float | None
    grip_cm: float
    turn_degrees: float
    in_body_cm: float
    in_scene_cm: float
    in_others_cm: NotRequired[float]


class Step(TypedDict):
    """A cue of a performance, and what is done there.

    `hold_seconds`: how long the person stays; without it as long as it takes to go on, and at the end as the settings
    say. `at_seconds`: when the cue is to be met, seconds from the performance's first frame.
    `passes`: what the way to the cue leads through, in order. `manipulations`: their first frames are those of the
    whole performance. `things`: what is taken, put down and opened there, one after the other. The person stays until
    the hands are done.
    """

    passes: NotRequired[list[PassCue]]
    cue: ActionCue
    hold_seconds: NotRequired[float | None]
    at_seconds: NotRequired[float | None]
    manipulations: NotRequired[list[ManipulationCue]]
    things: NotRequired[list[TakeCue | PutCue | OpenCue]]


class LookCue(TypedDict):
    """Something that a person looks at while something lasts.

    `path`: where it is on each frame (30 Hz) of the performance, world, metres; after the last it stays. `after`: so
    many of the performance's cues, waypoints among them, come before: the person looks from when the last of them is
    met on. `hold_seconds`: for how long; without it until the next cue or waypoint is met, or to the end.
    """

    name: str
    path: list[Point] | list[list[float]]
    after: int
    hold_seconds: NotRequired[float | None]


class Performance(TypedDict):
    """What one person is asked to do: a start, and cues that are met one after the other. `things`: what can be taken.
    `leaves`: what can be opened. `looks`: what is looked at meanwhile."""

    start: InitialState
    steps: list[Step]
    things: NotRequired[list[Thing]]
    leaves: NotRequired[list[Leaf]]
    looks: NotRequired[list[LookCue]]


class Constraint(TypedDict):
    """Where a joint is to be from `first_frame` (30 Hz) on, one entry a frame; what is left out stays free.

    `offset`: the point of the joint that `positions` place, in the joint's own frame, metres; else the joint itself.
    `positions`: world, metres. `rotations`: world, w first. `facings`: of the Hips, radians. `soft`: a wish, which may
    be missed.
    """

    name: str
    joint: str
    first_frame: int
    offset: NotRequired[Point | list[float]]
    positions: NotRequired[list[Point] | list[list[float]]]
    rotations: NotRequired[list[tuple[float, float, float, float]] | list[list[float]]]
    facings: NotRequired[list[float]]
    soft: NotRequired[bool]


class Key(TypedDict):
    """A joint that was keyed at a frame: its posture there is the motion's own, and stays."""

    joint: str
    frame: int


class ConstraintFigures(TypedDict):
    """What is left of a constraint; None where nothing was asked. `met`: within 1 cm and 3°."""

    name: str
    joint: str
    frames: int
    mean_cm: float | None
    max_cm: float | None
    mean_degrees: float | None
    max_degrees: float | None
    met: bool


class SearchFigures(TypedDict):
    """What the search along the manifold did: its windows, its steps, and how far the targets were before and after."""

    windows: int
    steps: int
    before_cm: float
    after_cm: float


class ManipulationFigures(TypedDict):
    """Where a hand's path came to lie in the motion."""

    name: str
    first_frame: int
    frames: int


class SeatFigures(TypedDict):
    """How a person sits: on the last frame, `pelvis_cm` to `back_cm` the worst of the seated frames.

    `feet_cm`: ankles from their cues; `sole_degrees`: how far the soles are from flat; `hanging`: the seat is too high
    for that foot to stand; `thigh_cm` and `back_cm`: how deep a thigh is in the seat and the back in the backrest.
    """

    pelvis_cm: float
    facing_degrees: float
    feet_cm: list[float | None]
    sole_degrees: list[float]
    hanging: list[bool]
    thigh_cm: float
    back_cm: float


class Smoothness(TypedDict):
    """Accelerations of the joints, m/s², of their rotations, rad/s², and mean jerk, m/s³."""

    mean_acceleration: float
    largest_acceleration: float
    largest_turn: float
    mean_jerk: float


class FootFigures(TypedDict):
    """How the feet stand. `contact_cm`: the paper's foot contact; the others cm a frame but `sink_cm`, cm."""

    contact_cm: float
    skate_cm: float
    worst_skate_cm: float
    low_skate_cm: float
    sink_cm: float


#: A part of the body, as the figures of a report name it: "head", "pelvis", "trunk", and "left_" or "right_" with
#: "upper_arm", "forearm", "hand", "thigh", "shin" or "foot".
BodyPart: TypeAlias = str


class OwnTouch(TypedDict):
    """Two parts of the body deeper than 1 cm in one another, in frames `first` to before `end`; deepest in `frame`."""

    parts: list[BodyPart]
    first: int
    end: int
    depth_cm: float
    frame: int


class OwnBodyFigures(TypedDict):
    """Limbs in the trunk, the head and each other. `percent`: of the frames, deeper than 1 cm; the deepest first."""

    percent: float
    deepest_cm: float
    touches: list[OwnTouch]


class OthersTouch(TypedDict):
    """The own part and somebody else's, deeper than 1 cm in one another. `person`: the name of their start."""

    person: str
    parts: list[BodyPart]
    first: int
    end: int
    depth_cm: float
    frame: int


class LookReport(TypedDict):
    """What was to be looked at from frame `first` to before `end`, and on how many of these frames the gaze is what.

    `met`: it meets it, within 5°; `turning`: the head is on its way; `behind`: it is behind the person; `held`: the
    head does not get there.
    """

    look: str
    first: int
    end: int
    met: int
    turning: int
    behind: int
    held: int


class OthersFigures(TypedDict):
    """A person in others of the shot. `percent`: of the shot's frames, deeper than 1 cm; the deepest first."""

    percent: float
    deepest_cm: float
    touches: list[OthersTouch]


class BeyondLimit(TypedDict):
    """A joint beyond its limit in frames `first` to before `end`, farthest in `frame`."""

    joint: str
    turn: Literal["flexion", "hyperextension", "sideways", "swing", "twist"]
    first: int
    end: int
    degrees: float
    frame: int


class JointLimitFigures(TypedDict):
    """Joints turned further than people's. `percent`: of the frames, by more than 5°; the worst first."""

    percent: float
    worst_degrees: float
    joints_percent: dict[str, float]
    beyond: list[BeyondLimit]


class Spread(TypedDict):
    """The middle of a set of values and its 90th percentile; 0 of nothing."""

    median: float
    p90: float


class Swivel(TypedDict):
    """A flat foot (`side` 0 left, 1 right) that turned by more than 15° in frames `first` to before `end`."""

    side: int
    first: int
    end: int
    degrees: float


class FlatFoot(TypedDict):
    """Stances in which heel and ball are within 1 cm of what they stand on: how far they drift and turn."""

    stances: int
    heel_drift_cm: Spread
    ball_drift_cm: Spread
    swivel_degrees: Spread
    swivelled_percent: float
    swivels: list[Swivel]


class TurnedFeet(TypedDict):
    """Feet that carry who stands: frames with one turned out by more than 50° or in by more than 35°; the farthest."""

    percent: float
    out_degrees: float
    in_degrees: float


class StepFigures(TypedDict):
    """Steps of someone who walks: medians, None where nobody does."""

    steps: int
    heel_first_percent: float | None
    toe_up_degrees: float | None
    toe_clearance_cm: float | None
    heel_up_degrees: float | None


class WholeFootFigures(TypedDict):
    """Feet, heel to toe, whatever the contact flag says."""

    flat: FlatFoot
    turned: TurnedFeet
    steps: StepFigures


class SceneTouch(TypedDict):
    """A part of the body deeper than 1 cm in the scene; `place`: of the surface, world, metres."""

    part: BodyPart
    first: int
    end: int
    depth_cm: float
    frame: int
    place: list[float]


class SceneDepthFigures(TypedDict):
    """The whole body in the scene: shares of the frames, percent, and where, the deepest first."""

    over_1_cm_percent: float
    over_3_cm_percent: float
    deepest_cm: float
    touches: list[SceneTouch]


class FarPose(TypedDict):
    """A part farther than 20° from every pose of the library in frames `first` to before `end`, farthest in `frame`.

    `gap_cm`: the narrowest gap that the body is in within a second; None where there is none of less than a metre.
    """

    part: Literal["left_arm", "right_arm", "trunk"]
    first: int
    end: int
    degrees: float
    frame: int
    gap_cm: float | None


class PoseDistanceFigures(TypedDict):
    """How far arms and trunk are from the library's poses: shares of the frames beyond 20°, percent, and the worst."""

    arms_percent: float
    arms_worst_degrees: float
    trunk_percent: float
    trunk_worst_degrees: float
    beyond: list[FarPose]


class BodyFigures(TypedDict):
    """What an eye sees first in a motion. `scene` and `pose_distance`: None where no scene, no library was given.

    Those of a library are of all its clips together and do not tell where.
    """

    own_body: OwnBodyFigures
    joint_limits: JointLimitFigures
    feet: WholeFootFigures
    scene: SceneDepthFigures | None
    pose_distance: PoseDistanceFigures | None


class WalkingStyle(TypedDict):
    """Straight, even walking forwards: medians over stretches of 1.2 s."""

    speed_m_per_s: float | None
    neck_sideways_cm: float | None
    head_bob_cm: float | None
    head_up_cm: float | None
    shoulders_degrees: float | None
    pelvis_degrees: float | None
    head_pitch_degrees: float | None
    wrist_fore_aft_cm: float | None
    wrist_sideways_cm: float | None
    elbow_sideways_cm: float | None
    head_speed_sd_cm_per_s: float | None
    neck_speed_sd_cm_per_s: float | None
    shoulder_speed_sd_cm_per_s: float | None
    neck_fore_aft_cm: float | None
    knee_up_cm: float | None
    trunk_lean_degrees: float | None


class WayStyle(TypedDict):
    """The way on foot as a whole."""

    speed_variation: float | None
    fastest_turn_degrees_per_s: float | None
    head_leads_degrees: float | None


class StartStyle(TypedDict):
    """The first step out of standing."""

    weight_shift_cm: float | None
    shift_s: float | None


class DescentStyle(TypedDict):
    """Sitting down, and the 2.5 s before."""

    turn_before_degrees: float | None
    still_before_s: float | None
    descent_s: float | None
    lean_degrees: float | None
    lean_leads_s: float | None
    sunk_at_lean_percent: float | None
    lean_at_seat_degrees: float | None
    upper_arm_degrees: float | None
    fastest_sink_m_per_s: float | None
    feet_move_cm: float | None
    pelvis_turns_degrees: float | None


class SeatedStyle(TypedDict):
    """Sitting; speeds only where that lasts for a third of a second."""

    trunk_degrees: float | None
    feet_fore_aft_cm: float | None
    ankles_apart_cm: float | None
    knees_apart_cm: float | None
    wrists_cm_per_s: float | None
    head_cm_per_s: float | None
    knees_cm_per_s: float | None


class RisingStyle(TypedDict):
    """Getting up."""

    rise_s: float | None
    lean_degrees: float | None


class StyleFigures(TypedDict):
    """How a person walks, sets off, sits down, sits and gets up; docs/report.md defines each row.

    Medians; None where the motion shows nothing of the kind.
    """

    walking: WalkingStyle
    way: WayStyle
    start: StartStyle
    descent: DescentStyle
    seated: SeatedStyle
    rising: RisingStyle


class MotionFigures(TypedDict):
    """What a motion is like. `manifold_cm`: mean distance of the joints from those of Ψ⁻¹(Ψ(X)).

    `foot`, `body`: as in a report.
    """

    smoothness: Smoothness
    foot: FootFigures
    body: BodyFigures
    manifold_cm: float


class EditFigures(TypedDict):
    """What an edit did. Frames before `first_frame` and from `end_frame` on are as they were, to the bit.

    `seat`, `seat_before`: after and before a seat fit, else None.
    """

    constraints: list[ConstraintFigures]
    first_frame: int
    end_frame: int
    search: SearchFigures | None
    seconds: float
    manipulations: list[ManipulationFigures]
    seat: SeatFigures | None
    seat_before: SeatFigures | None


class ProgressSnapshot(TypedDict):
    """What a job has got to. `reward` and `success_rate` are those of the last update."""

    stage: str
    fraction: float
    update: int
    reward: float
    success_rate: float


class BoxNode(TypedDict):
    """A box that moves with a joint, axis-aligned in the joint's rest frame, metres."""

    limb: str
    joint: str
    center: Point
    half_extents: Point


class Skeleton(TypedDict):
    """The unified skeleton. `joint_offsets` (22, 3): from the parent's joint, metres; the root's is its rest place."""

    names: list[str]
    parents: list[int]
    joint_offsets: NDArray[np.float32]
    boxes: list[BoxNode]
    rest_hips_height: float
    ankle_height: float
    toe_height: float
    toe_length: float
    heel_length: float


class RigMapping(TypedDict):
    """Which bone of a rig is which joint (`joints`: ours -> theirs), and all bones from the hips to the chest.

    `shape_percent`: how sure the rig's shape is, where its names said nothing. `note`: what was put right.
    """

    joints: dict[str, str]
    spine: list[str]
    shape_percent: int | None
    note: str | None


class SummaryRow(TypedDict):
    """Seconds of one action ("walk", "idle", "sit", "seated_idle", "stand_up", "stop", "other").

    `shortfall` says why the captured part is too little to work with, so that the starter library fills it up.
    """

    label: str
    mocap_seconds: float
    mirrored_seconds: float
    procedural_seconds: float
    segments: int
    shortfall: str | None


class Segment(TypedDict):
    """Frames `first` to `end` (not included) of a clip, and what happens in them.

    `label`: "walk", "idle", "sit", "seated_idle", "stand_up", "stop" or "other". `complete`: the frame on which one is
    seated, has risen or stands still; the last one where nothing is completed.
    """

    label: str
    first: int
    end: int
    complete: int


class Clip(TypedDict):
    """A clip of a library, on the unified skeleton at 30 frames a second; the floor is at z = 0.

    `source`: "mocap" or "procedural". `mirrored`: whether left and right are exchanged. The arrays are those of a
    `Synthesis`: float32 (frames, 3), metres; (frames, 22, 4), w first; (frames, 2).
    """

    name: str
    source: str
    mirrored: bool
    root_positions: NDArray[np.float32]
    rotations: NDArray[np.float32]
    contacts: NDArray[np.float32]
    segments: list[Segment]


class Capture(TypedDict):
    """What a motion capture file gave to a library.

    `action`: which of its actions, where a file of another format was made a .bvh (`sources` of the settings), or None.
    `clip`: the name of what was made of it, or None. `seconds`: of each action that it shows, those of "other" are not
    matched. `notes`: what was taken otherwise than the file says it, a sentence each. `reason`: why the file, or the
    part of it that is not matched, is left out, a sentence or None.
    """

    file: str
    action: str | None
    clip: str | None
    seconds: dict[str, float]
    notes: list[str]
    reason: str | None


class Summary(TypedDict):
    """What a library holds.

    `turn_shortfall` says why the captured turns from standing are too few, so that the starter library fills them up.
    """

    clips: int
    frames: int
    rows: list[SummaryRow]
    turn_shortfall: str | None


class ManifoldErrors(TypedDict):
    """How well a manifold gives windows of 120 frames back.

    `joint_error_cm` is the mean distance of a joint with the root's path taken from the input, `path_joint_error_cm`
    with the path as it was given back; `rotation_error_degrees` the mean angle of a joint relative to its parent;
    `contact_accuracy` the share of foot contacts that are right; `root_drift_cm` the root's planar distance at the end.
    """

    windows: int
    joint_error_cm: float
    path_joint_error_cm: float
    rotation_error_degrees: float
    contact_accuracy: float
    root_drift_cm: float


class ManifoldEpoch(TypedDict):
    """One pass over the training windows: the mean loss, and the errors on the validation clips after it."""

    epoch: int
    loss: float
    validation: ManifoldErrors


class ManifoldFigures(TypedDict):
    """How a manifold was trained and measured. `clips`: for training, for validation, for the test.

    `test_mocap` are the captured of the test clips; `test_augmented` the test clips with arms that reach, backs that
    bend and pelvises that sink as no clip does.
    """

    library: str
    seed: int
    settings: Settings
    clips: list[int]
    training_windows: int
    test: ManifoldErrors
    test_mocap: ManifoldErrors
    test_augmented: ManifoldErrors
    curve: list[ManifoldEpoch]


class PolicyOrigin(TypedDict):
    """What a policy was optimized for. `scene`: its fingerprint, empty for the prior; `library`: a checksum."""

    scene: str
    library: str
    cues: list[ActionCue]
    #: Fingerprint of the request it was last optimized for.
    request: str
    generalized: bool
    updates: int
    environment_steps: int
    success_rate: float


class LearningFigures(TypedDict):
    """One point of a learning curve. Success rates are None where no such episode ended."""

    update: int
    reward: float
    success_rate: float | None
    success_rate_anywhere: float | None
    collisions: float
    stalls: float
    seconds: float


class Residual(TypedDict):
    """How a cue was met: `feet_cm` left and right, None without a foot cue. `met`: within 10 cm and 20°.

    A pass is met within 15 cm; it asks for no facing, and `facing_degrees` is 0.
    """

    cue: str
    action_type: Literal["sit", "stop", "pass"]
    frame: int
    pelvis_cm: float
    facing_degrees: float
    feet_cm: list[float | None]
    met: bool


class PenetrationFigures(TypedDict):
    """Shares of the frames in which the body is in the scene, percent; parts that touch nothing are left out."""

    percent: float
    legs_percent: float
    arms_percent: float
    whole_body_percent: float
    parts_percent: dict[Literal["leg", "arm", "foot", "torso", "head"], float]


class Meeting(TypedDict):
    """A moving object that the body runs into: on `frames` of `first` to before `end`, deepest in `frame`."""

    object: str
    part: str
    first: int
    end: int
    frames: int
    depth_cm: float
    frame: int


class Passing(TypedDict):
    """How a motion gets past what moves: after how many frames of waiting, and what it runs into.

    `percent`: of the frames, in which it is in any of them.
    """

    wait: int
    meetings: list[Meeting]
    percent: float


class Measured(TypedDict):
    """What can be seen of a motion, whoever made it; as in a report. `penetration`: None without a scene."""

    cues: list[Residual]
    foot: FootFigures
    penetration: PenetrationFigures | None
    body: BodyFigures
    problems: list[str]


class StepWay(TypedDict):
    """The way to one cue along the floor, some centimetres from point to point, or as far as it is free.

    `fails_at`, `problem`: where and why it would fail; None where all is well. `path` is empty where no way begins.
    """

    cue: str
    path: list[list[float]]
    length_m: float
    fails_at: list[float] | None
    problem: str | None


class PersonWays(TypedDict):
    """The ways of one person: `start`, the name of the start, and from there to each cue in order."""

    start: str
    steps: list[StepWay]


class Ways(TypedDict):
    """The ways of a shot. `problems`: what cannot be of the shot as a whole, though every way is clear."""

    people: list[PersonWays]
    problems: list[str]


class SpeedFigures(TypedDict):
    """How fast joints turn and how hard they are accelerated, beside the library; walking speed, m/s."""

    joint_ratio: float
    fastest_joint: str | None
    fastest_degrees: float
    faster_percent: float
    acceleration_ratio: float
    hardest_joint: str | None
    hardest_acceleration: float
    harder_percent: float
    walking: float
    fastest: float


class EditedFigures(TypedDict):
    """What the editor did for a task. `seat`: None for a stop, and where it could not be fitted."""

    seat: SeatFigures | None
    manipulations: list[ManipulationFigures]
    constraints: list[ConstraintFigures]
    complete_frame: int
    seconds: float
    problems: list[str]


class Moments(TypedDict):
    """When what happens in the part of a motion in which one cue is met: frames of the whole motion.

    `stood_at`: when who sat at first stands. `action_from`: when the sit or stop is entered. `complete`: when the cue
    is met.
    """

    stood_at: NotRequired[int | None]
    action_from: NotRequired[int | None]
    complete: int


class StepReport(Moments):
    """What is told of one step of a performance. `first_frame`: that in which the step before has ended; `asked_frame`,
    `late_s`: when the cue was to be met, and how much later it is; `waits_s`, `dawdles_s`: how long the person waits
    before setting off, and how much longer the way takes than by itself; `waited`: frames in which the person stays,
    before setting out, for others to pass; `edited`: in frames of the step's own.
    """

    cue: str
    first_frame: int
    asked_frame: int | None
    late_s: float | None
    waits_s: float
    dawdles_s: float
    edited: EditedFigures | None
    waited: NotRequired[int]
    policy_source: Literal["scratch", "prior", "kept"]
    updates: int
    path_m: float
    shortest_path_m: float


class Report(TypedDict):
    """What a run tells about itself; docs/report.md describes it.

    `seconds`: by stage, of those that there were. `edited`: None where nothing was edited. `steps`: of a performance,
    what was played of it. `things`: what became of those that were taken. `others`: of one of several people.
    """

    report_version: int
    version: str
    seed: int
    library_checksum: str
    settings: Settings
    success: bool
    problems: list[str]
    cues: list[Residual]
    action_from: int | None
    steps: NotRequired[list[StepReport]]
    things: NotRequired[list[ThingFigures]]
    opened: NotRequired[list[OpenedFigures]]
    looks: NotRequired[list[LookReport]]
    others: NotRequired[OthersFigures]
    foot: FootFigures
    penetration: PenetrationFigures
    speed: SpeedFigures
    body: BodyFigures
    style: StyleFigures
    edited: EditedFigures | None
    frames: int
    path_m: float
    shortest_path_m: float
    seconds: dict[str, float]
    policy_source: Literal["scratch", "prior", "kept"]
    updates: int
    environment_steps: int
    environment_steps_per_second: float
    rollouts: int
    rollouts_succeeded: int
    curve: list[LearningFigures]


class StartFigures(TypedDict):
    """What became of one start: how many trials met the cue, collided, or found no way to finish. `place`: x and y."""

    place: list[float]
    met: int
    collisions: int
    stalls: int


class Robustness(TypedDict):
    """The robustness test of one policy and cue; `ratio`: share of the starts that count."""

    starts: list[StartFigures]
    ratio: float
