//! What the artist asks for: g_init and the cues Φ (LAMA, section 3.1).

use std::ops::Range;

use glam::{Vec2, Vec3};
use serde::{Deserialize, Serialize};

use crate::action::{ActionType, CueHeight, Fit};
use crate::math::Planar;
use crate::motion::skeleton::SEATED_HIPS_HEIGHT;
use crate::motion::{FootContact, Posture};
use crate::seats::{Seat, Seats};

/// g_init: where the character stands at frame 0 and faces, or what its body does there.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InitialState {
    /// The name the artist gave it, for messages.
    pub name: String,
    /// World, metres; z is the floor that the character stands on.
    pub position: Vec3,
    /// Radians; see [`Planar`].
    pub yaw: f32,
    /// What the body does there, where the motion goes on from another; without it the character stands.
    #[serde(skip_deserializing, skip_serializing_if = "Option::is_none")]
    pub body: Option<Box<BodyState>>,
}

/// A body in motion or at rest, from which another motion goes on.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BodyState {
    /// m_{-1} and m_0: the posture one frame before, and that with which the motion begins.
    pub postures: [Posture; 2],
    /// The feet's contacts in m_0.
    pub contact: FootContact,
    /// The cue whose seat it sits on.
    pub seat: Option<ActionCue>,
}

impl InitialState {
    /// Standing.
    pub fn standing(name: impl Into<String>, position: Vec3, yaw: f32) -> Self {
        Self { name: name.into(), position, yaw, body: None }
    }

    /// Going on from what a body does, on a floor of world height `floor`, metres.
    pub fn continuing(name: impl Into<String>, body: BodyState, floor: f32) -> Self {
        let here = body.postures[1].planar();
        let position = here.position.extend(floor);
        Self { name: name.into(), position, yaw: here.yaw, body: Some(Box::new(body)) }
    }

    /// Its place and facing on the floor plane.
    pub fn planar(&self) -> Planar {
        Planar::new(self.position.truncate(), self.yaw)
    }

    /// The cue whose seat it sits on.
    pub fn seat(&self) -> Option<&ActionCue> {
        self.body.as_ref()?.seat.as_ref()
    }
}

/// φ_A = {q_root, r_root, q_lFoot, q_rFoot}: how the motion is to end.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ActionCue {
    /// The name the artist gave it, for messages.
    pub name: String,
    /// One of [`ActionType::of_cues`].
    pub action_type: ActionType,
    /// q_root: where the pelvis joint ends, world, metres. How far z counts is the action type's: see [`crate::action::CueHeight`].
    pub position: Vec3,
    /// r_root's part about the vertical: the facing at the end, radians; see [`Planar`].
    pub yaw: f32,
    /// Optional places of the left and the right foot (ankle's projection on the ground; z is the floor there), world, metres.
    #[serde(default)]
    pub feet: [Option<Vec3>; 2],
}

impl ActionCue {
    /// Its place and facing on the floor plane.
    pub fn planar(&self) -> Planar {
        Planar::new(self.position.truncate(), self.yaw)
    }

    /// Whether who has met it sits.
    pub fn is_seated(&self) -> bool {
        self.action_type.spec().fit == Fit::Seat
    }

    /// World z of the seat's surface under a cue that ends on one.
    pub fn seat_height(&self) -> Option<f32> {
        match self.action_type.spec().fit {
            Fit::Seat => Some(self.position.z - SEATED_HIPS_HEIGHT),
            Fit::Nothing => None,
        }
    }

    /// World z of the pelvis joint at the end, where the cue says it.
    pub fn pelvis_height(&self) -> Option<f32> {
        match self.action_type.spec().height {
            CueHeight::Pelvis => Some(self.position.z),
            CueHeight::Standing => None,
        }
    }

    /// How far a pelvis joint at `root` is from where the cue wants it, metres: on the floor plane where the cue's height says
    /// nothing.
    pub fn pelvis_distance(&self, root: Vec3) -> f32 {
        match self.action_type.spec().height {
            CueHeight::Pelvis => root.distance(self.position),
            CueHeight::Standing => root.truncate().distance(self.position.truncate()),
        }
    }
}

/// A waypoint: a place on the floor that the way to a cue leads through, without a stop.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PassCue {
    /// The name the artist gave it, for messages.
    pub name: String,
    /// What the pelvis is to pass over, world, metres; z is the floor there.
    pub position: Vec3,
}

impl PassCue {
    /// Its place on the floor plane.
    pub fn place(&self) -> Vec2 {
        self.position.truncate()
    }

    /// The same as a place to stop at, for what is asked of both: whether one can stand there, and which ways lead there.
    pub(crate) fn as_stop(&self) -> ActionCue {
        ActionCue {
            name: self.name.clone(),
            action_type: ActionType::Stop,
            position: self.position,
            yaw: 0.0,
            feet: [None; 2],
        }
    }
}

/// What a cue asks for, as a report names it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CueKind {
    /// To sit down.
    Sit,
    /// To come to stand.
    Stop,
    /// To walk through.
    Pass,
}

impl From<ActionType> for CueKind {
    fn from(action_type: ActionType) -> Self {
        match action_type {
            ActionType::Sit => CueKind::Sit,
            ActionType::Stop => CueKind::Stop,
            ActionType::Walk => CueKind::Pass,
        }
    }
}

/// Which hand follows a [`ManipulationCue`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Hand {
    /// The left one.
    Left,
    /// The right one.
    Right,
    /// One on each side of the path.
    Both,
}

/// Whether a hand follows a cue in a frame. `carried`: the frames in which hands do.
pub(crate) fn is_carried(carried: &[(Hand, Range<usize>)], hand: Hand, frame: usize) -> bool {
    let follows = |own: Hand| own == hand || own == Hand::Both;
    carried.iter().any(|(own, frames)| follows(*own) && frames.contains(&frame))
}

/// φ_M = {q_j^t}: the path that a hand follows (LAMA, section 3.1 and supplementary).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ManipulationCue {
    /// The name the artist gave it, for messages.
    pub name: String,
    /// Which hand follows the path.
    pub hand: Hand,
    /// Where the palm is on each frame (30 Hz), world, metres.
    pub path: Vec<Vec3>,
    /// The motion's frame on which the hand is at the path's first place; without it that is as soon as the action is
    /// complete and the hand has got there. It may lie after the motion's end: who stands or sits still waits for it.
    #[serde(default)]
    pub first_frame: Option<usize>,
}

/// When what happens in the motion of a [`Task`], in its frames.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Moments {
    /// When who sat at first stands.
    #[serde(default)]
    pub stood_at: Option<usize>,
    /// When the sit or stop is entered.
    #[serde(default)]
    pub action_from: Option<usize>,
    /// When the cue is to be met; where nothing is complete, the last frame.
    pub complete: usize,
}

impl Moments {
    /// Each of them by the same rule, where a motion is re-timed.
    pub fn each(self, frame: impl Fn(usize) -> usize) -> Self {
        Self {
            stood_at: self.stood_at.map(&frame),
            action_from: self.action_from.map(&frame),
            complete: frame(self.complete),
        }
    }
}

impl Task {
    /// Where the person is to be, the start first: what a scene is indexed for.
    pub fn places(&self) -> Vec<Vec3> {
        let passes = self.passes.iter().map(|pass| pass.position);
        std::iter::once(self.start.position).chain(passes).chain([self.cue.position]).collect()
    }

    /// The seats of its motion: that which is got up from until the person stands, that of the cue from when the sit is entered.
    pub fn seats(&self, moments: &Moments) -> Seats {
        let left = self.start.seat().and_then(ActionCue::seat_height);
        let left = left.map(|height| Seat { height, first: 0, last: moments.stood_at.unwrap_or(0) });
        let taken = moments.action_from.zip(self.cue.seat_height());
        let taken = taken.map(|(first, height)| Seat { height, first, last: usize::MAX });
        Seats(left.into_iter().chain(taken).collect())
    }
}

/// One task: a start, the cue that follows it, and what the hands do.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Task {
    /// g_init.
    pub start: InitialState,
    /// What the way to the cue leads through, in this order.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub passes: Vec<PassCue>,
    /// φ_A.
    pub cue: ActionCue,
    /// φ_M: what the hands do on the way or once the cue is met.
    #[serde(default)]
    pub manipulations: Vec<ManipulationCue>,
}

/// A thing that hands can take.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Thing {
    /// Its name, for cues and messages.
    pub name: String,
    /// Where its origin is at first, world, metres.
    pub position: Vec3,
    /// How it is turned at first: a unit quaternion, w first, world.
    pub rotation: [f32; 4],
    /// The lowest corner of its box, in its own frame, metres.
    pub low: Vec3,
    /// And the highest.
    pub high: Vec3,
}

/// To take a thing at a step's cue; it is carried from then on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TakeCue {
    /// The name the artist gave it, for messages.
    pub name: String,
    /// The thing's name.
    pub thing: String,
    /// Which hand takes it.
    pub hand: Hand,
    /// Where, in the thing's frame, metres: palms come to the faces of its box to either side of a place within, and to, or beside, one that is
    /// not.
    pub grip: Vec3,
}

/// To put a thing down at a step's cue.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PutCue {
    /// The name the artist gave it, for messages.
    pub name: String,
    /// The thing's name.
    pub thing: String,
    /// Where the middle of what it stands on comes to lie, world, metres.
    pub position: Vec3,
    /// How its −Y axis is turned there about the vertical, radians, see [`Planar`]; without it as it comes.
    #[serde(default)]
    pub yaw: Option<f32>,
}

/// How a leaf hangs, in its own frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "by", rename_all = "snake_case", deny_unknown_fields)]
pub enum Hung {
    /// It turns about a line.
    Hinge {
        /// A place on it, metres.
        point: Vec3,
        /// Its direction: turns are positive about it by the right hand's rule.
        axis: Vec3,
    },
    /// It slides.
    Slide {
        /// Where to.
        direction: Vec3,
    },
}

/// What a hand can open: a door, a lid, a drawer. It is no part of the scene that the person is in, and in the way wherever it is.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Leaf {
    /// Its name, for cues and messages.
    pub name: String,
    /// Where its origin is at first, world, metres.
    pub position: Vec3,
    /// How it is turned at first: a unit quaternion, w first, world.
    pub rotation: [f32; 4],
    /// What it turns about, or where it slides to.
    pub hung: Hung,
    /// The corners of its mesh, in its own frame, metres.
    #[serde(default)]
    pub positions: Vec<Vec3>,
    /// Its triangles, by their corners' places in `positions`.
    #[serde(default)]
    pub triangles: Vec<[u32; 3]>,
}

/// How far a leaf is opened.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Amount {
    /// About its hinge.
    Degrees(f32),
    /// Along its slide.
    Metres(f32),
}

impl Amount {
    /// The number alone.
    pub fn number(self) -> f32 {
        match self {
            Amount::Degrees(number) | Amount::Metres(number) => number,
        }
    }
}

/// To open a leaf, or to close it again, at a step's cue: the hand comes to its handle, leads it, and lets go.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OpenCue {
    /// The name the artist gave it, for messages.
    pub name: String,
    /// The leaf's name.
    pub thing: String,
    /// Which hand opens it.
    pub hand: Hand,
    /// How far, from where it is by then.
    pub by: Amount,
    /// Where the palm takes hold of it, in the leaf's frame, metres.
    pub grip: Vec3,
    /// How long it moves, seconds; without it as long as people take.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub over_seconds: Option<f32>,
}

/// What is done with a thing, or a leaf.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "does", rename_all = "snake_case")]
pub enum ThingCue {
    /// It is taken.
    Take(TakeCue),
    /// It is put down.
    Put(PutCue),
    /// It is opened.
    Open(OpenCue),
}

impl ThingCue {
    /// The cue's name.
    pub fn name(&self) -> &str {
        match self {
            ThingCue::Take(take) => &take.name,
            ThingCue::Put(put) => &put.name,
            ThingCue::Open(open) => &open.name,
        }
    }

    /// The name of the thing, or of the leaf.
    pub fn thing(&self) -> &str {
        match self {
            ThingCue::Take(take) => &take.thing,
            ThingCue::Put(put) => &put.thing,
            ThingCue::Open(open) => &open.thing,
        }
    }
}

/// A cue of a [`Performance`], and what is done there.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Step {
    /// What the way to the cue leads through, in this order.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub passes: Vec<PassCue>,
    /// φ_A.
    pub cue: ActionCue,
    /// How long the person stays there, seconds; without it, as long as it takes to go on, and at the end as the settings say.
    #[serde(default)]
    pub hold_seconds: Option<f32>,
    /// When the cue is to be met, seconds from the performance's first frame; without it, when the person gets there.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at_seconds: Option<f32>,
    /// φ_M: what the hands do on the way there or once the cue is met, their first frames those of the whole performance. The person
    /// stays at the cue until they are done.
    #[serde(default)]
    pub manipulations: Vec<ManipulationCue>,
    /// What is taken, put down and opened there, one after the other, and before hands follow paths that have no frame of their own.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub things: Vec<ThingCue>,
}

/// Something that a person looks at while something lasts.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LookCue {
    /// The name the artist gave it, for messages.
    pub name: String,
    /// Where it is on each frame (30 Hz) of the performance, world, metres; after the last it stays. One place for what stands still.
    pub path: Vec<Vec3>,
    /// So many of the performance's cues, waypoints among them, come before: the person looks from when the last of these is met on, from
    /// the performance's first frame where there is none.
    pub after: usize,
    /// For so long, seconds; without it until the next cue, or waypoint, is met, or to the end.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hold_seconds: Option<f32>,
}

/// What one person is asked to do: a start, and cues that are met one after the other.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Performance {
    /// g_init.
    pub start: InitialState,
    /// At least one.
    pub steps: Vec<Step>,
    /// What can be taken.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub things: Vec<Thing>,
    /// What can be opened.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub leaves: Vec<Leaf>,
    /// What the person looks at meanwhile.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub looks: Vec<LookCue>,
}

impl Step {
    /// What is opened there, one after the other.
    pub(crate) fn openings(&self) -> impl Iterator<Item = &OpenCue> {
        self.things.iter().filter_map(|cue| if let ThingCue::Open(open) = cue { Some(open) } else { None })
    }
}

impl Performance {
    /// Where the person is to be, the start first: what a scene is indexed for.
    pub fn places(&self) -> Vec<Vec3> {
        let of_step = |step: &'_ Step| -> Vec<Vec3> {
            step.passes.iter().map(|pass| pass.position).chain([step.cue.position]).collect()
        };
        std::iter::once(self.start.position).chain(self.steps.iter().flat_map(of_step)).collect()
    }

    /// The seats of its motion; `moments`: of each step that was played, in frames of the whole.
    pub fn seats(&self, moments: &[Moments]) -> Seats {
        let own = self.start.seat().and_then(ActionCue::seat_height).map(|height| (0, height));
        let taken = self.steps.iter().zip(moments).map(|(step, m)| m.action_from.zip(step.cue.seat_height()));
        // Each is left where the next step's person stands.
        let left = moments.iter().map(|m| m.stood_at).chain([None]);
        let seats = std::iter::once(own).chain(taken).zip(left);
        let seat = |((first, height), last): ((usize, f32), Option<usize>)| Seat {
            height,
            first,
            last: last.unwrap_or(usize::MAX),
        };
        Seats(seats.filter_map(|(taken, left)| Some(seat((taken?, left)))).collect())
    }
}
