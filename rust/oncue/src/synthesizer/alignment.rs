//! Alignment: a matched sit or stop rarely ends exactly at the cue; what is missing is given to the
//! root while a foot swings, so that no planted foot slides, and to the pelvis height while it sinks.
//!
//! The paper leaves this to its motion editor; doing it here keeps the steps where the seat wants them.

use glam::Vec2;

use crate::cue::{ActionCue, ActionType};
use crate::library::database::{DatabaseFrame, MotionDatabase};
use crate::math::Planar;
use crate::math::rotation::wrap_angle;

/// Largest correction of one frame: metres, radians, metres of height.
const LARGEST_STEP: f32 = 0.022;
const LARGEST_TURN: f32 = 0.05;
const LARGEST_LIFT: f32 = 0.012;
/// Share of a frame's correction that even a frame with both feet planted takes: the pelvis can
/// shift a little over standing feet.
const PLANTED: f32 = 0.06;

#[derive(Debug, Clone)]
pub(super) struct Alignment {
    target: Planar,
    /// World height of the pelvis at the end; `None` for a stop.
    height: Option<f32>,
    lift: f32,
}

impl Alignment {
    pub(super) fn new(cue: &ActionCue) -> Self {
        Self {
            target: cue.planar(),
            height: (cue.action_type == ActionType::Sit).then_some(cue.position.z),
            lift: 0.0,
        }
    }

    /// Metres added to the pelvis height so far.
    pub(super) fn lift(&self) -> f32 {
        self.lift
    }

    /// Corrects `planar`, which stands for database frame `frame`.
    pub(super) fn step(&mut self, database: &MotionDatabase, frame: usize, planar: &mut Planar, floor: f32) {
        let ahead = usize::from(database.frames[frame].until_complete);
        if ahead == 0 {
            return;
        }
        let coming = &database.frames[frame..=frame + ahead];
        let swing = |f: &DatabaseFrame| PLANTED + f.contact.iter().map(|c| 1.0 - c).sum::<f32>().min(1.0);
        let share_of = |weight: &dyn Fn(&DatabaseFrame) -> f32| {
            let all = coming[..ahead].iter().map(weight).sum::<f32>();
            (all > 1e-3).then(|| weight(&coming[0]) / all)
        };
        let share = share_of(&swing).unwrap_or(0.0);

        let end = planar.compose(database.travel(frame, ahead));
        let turn = wrap_angle(self.target.yaw - end.yaw) * share;
        planar.yaw = wrap_angle(planar.yaw + turn.clamp(-LARGEST_TURN, LARGEST_TURN));
        let end = planar.compose(database.travel(frame, ahead));
        // Who sits, and turns on the seat, does not glide along it.
        let share = share_of(&|f| if f.until_seated > 0 { swing(f) } else { 0.0 }).unwrap_or(share);
        let missing: Vec2 = (self.target.position - end.position) * share;
        planar.position += missing.clamp_length_max(LARGEST_STEP);

        if let Some(height) = self.height {
            let z = |f: &DatabaseFrame| f.posture.root_position.z;
            let missing = height - floor - z(&coming[ahead]) - self.lift;
            // Where the pelvis sinks fast a few millimetres more or less are not seen.
            let sinking = (z(&coming[0]) - z(&coming[1])).max(0.0);
            let left = (z(&coming[0]) - z(&coming[ahead])).max(1e-3);
            let step = missing * (sinking / left).min(1.0);
            self.lift += step.clamp(-LARGEST_LIFT, LARGEST_LIFT);
        }
    }
}
