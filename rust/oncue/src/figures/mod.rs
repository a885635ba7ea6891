//! What an eye sees first: limbs in the own body, joints beyond their limits, feet that swivel, a body in its surroundings,
//! poses that the library has not; and the style of how a person walks and sits.
//!
//! The same figures of a motion and of a library, so that a motion stands beside what it is made of.

mod feet;
mod joint_limits;
mod others;
mod own_body;
mod pose_distance;
mod problems;
mod scene_depth;
mod spans;
mod style;

pub use feet::{FlatFoot, Spread, StepFigures, Swivel, TurnedFeet, WholeFootFigures};
pub use joint_limits::{BeyondLimit, JointLimitFigures};
pub(crate) use others::{Company, Other, others_figures};
pub use others::{OthersFigures, OthersTouch};
pub use own_body::{OwnBodyFigures, OwnTouch};
pub use pose_distance::{FarPose, PoseDistanceFigures, PosedPart, pose_distance_figures};
pub use scene_depth::{SceneDepthFigures, SceneTouch};
pub(crate) use scene_depth::{depth_in_scene, in_scene};
pub(crate) use spans::{Span, Spans};
pub use style::{
    DescentStyle, RisingStyle, SeatedStyle, StartStyle, Style, StyleFigures, StyleValues, WalkingStyle,
    WayStyle,
};

pub use crate::anatomy::{BodyPart, LimitedTurn, body_capsules};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::cue::{ActionCue, InitialState, Moments, Task};
use crate::library::MotionLibrary;
use crate::motion::{Motion, Pose, Posture};
use crate::scene::{MovingObject, SEAT_GIVE, SceneIndex};
use crate::seats::Seats;

/// What an eye sees first in a motion.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct BodyFigures {
    /// Limbs in the trunk, the head and each other.
    pub own_body: OwnBodyFigures,
    /// Joints that are turned further than people's.
    pub joint_limits: JointLimitFigures,
    /// Feet, heel to toe, whatever the contact flag says.
    pub feet: WholeFootFigures,
    /// The whole body in the scene; none where no scene was given.
    pub scene: Option<SceneDepthFigures>,
    /// How far arms and trunk are from the library's poses; none where it is not told which library the motion is made of.
    #[serde(default)]
    pub pose_distance: Option<PoseDistanceFigures>,
}

/// Where a motion takes place.
#[derive(Debug, Clone)]
pub struct Surroundings<'a> {
    /// The scene.
    pub scene: &'a SceneIndex,
    /// What moves in it, on the motion's frames.
    pub moving: &'a [MovingObject],
    /// What lies lower over the floor is not counted, metres.
    pub ignore_below: f32,
    /// What carries pelvis and thighs, and when.
    pub seats: Seats,
}

impl<'a> Surroundings<'a> {
    /// Those of the motion of a task.
    pub(crate) fn of(scene: &'a SceneIndex, task: &Task, moments: &Moments) -> Self {
        Self::with(scene, task.seats(moments))
    }

    /// Those of who has met `cue`.
    pub(crate) fn at_end(scene: &'a SceneIndex, cue: &ActionCue) -> Self {
        Self::with(scene, cue.seat_height().map_or_else(Seats::default, |height| Seats::taken(0, height)))
    }

    /// Those of who is about to set off from `start`.
    pub(crate) fn at_start(scene: &'a SceneIndex, start: &InitialState) -> Self {
        start.seat().map_or_else(|| Self::with(scene, Seats::default()), |seat| Self::at_end(scene, seat))
    }

    /// What is higher than a rug counts, whatever the paper leaves out of its penetration: a foot in a plinth of 7 cm is seen.
    pub(crate) fn with(scene: &'a SceneIndex, seats: Seats) -> Self {
        Self { scene, moving: &[], ignore_below: scene.settings().carpet_height, seats }
    }

    /// World height from which on the scene counts for a part of the body in a frame, metres.
    pub(crate) fn counted_from(&self, part: BodyPart, frame: usize, floor: f32) -> f32 {
        let above = floor + self.ignore_below;
        match self.seats.at(frame) {
            Some(seat) if part.is_carried() => above.max(seat + SEAT_GIVE),
            _ => above,
        }
    }
}

/// Figures of a motion on a floor `floor` metres high (world), or in a scene.
pub fn body_figures(motion: &Motion, floor: f32, surroundings: Option<&Surroundings>) -> BodyFigures {
    let mut tally = Tally::default();
    tally.add(motion, floor, surroundings);
    tally.finish(true)
}

impl MotionLibrary {
    /// Figures of all clips together, mirrored copies left out; where in which clip is not told.
    pub fn body_figures(&self) -> BodyFigures {
        let own: Vec<_> = self.clips.iter().filter(|clip| !clip.mirrored).collect();
        let tallies: Vec<Tally> = own
            .par_iter()
            .map(|clip| {
                let mut tally = Tally::default();
                tally.add(&clip.motion, 0.0, None);
                tally
            })
            .collect();
        let mut all = Tally::default();
        for tally in tallies {
            all.merge(tally);
        }
        all.finish(false)
    }
}

/// What has been counted so far.
#[derive(Debug, Clone, Default)]
struct Tally {
    own_body: own_body::Tally,
    joint_limits: joint_limits::Tally,
    feet: feet::Tally,
    scene: Option<scene_depth::Tally>,
}

impl Tally {
    fn add(&mut self, motion: &Motion, floor: f32, surroundings: Option<&Surroundings>) {
        let poses: Vec<Pose> = motion.postures.iter().map(Posture::pose).collect();
        self.own_body.add(&poses);
        self.joint_limits.add(&motion.postures);
        self.feet.add(&poses, floor, surroundings.map(|s| s.scene));
        if let Some(surroundings) = surroundings {
            self.scene.get_or_insert_default().add(&poses, floor, surroundings);
        }
    }

    fn merge(&mut self, other: Tally) {
        self.own_body.merge(other.own_body);
        self.joint_limits.merge(other.joint_limits);
        self.feet.merge(other.feet);
    }

    fn finish(self, spans: bool) -> BodyFigures {
        BodyFigures {
            own_body: self.own_body.finish(spans),
            joint_limits: self.joint_limits.finish(spans),
            feet: self.feet.finish(spans),
            scene: self.scene.map(scene_depth::Tally::finish),
            pose_distance: None,
        }
    }
}

/// Share of `part` in `all`, percent.
fn percent(part: usize, all: usize) -> f32 {
    100.0 * part as f32 / all.max(1) as f32
}
