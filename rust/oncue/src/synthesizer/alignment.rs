//! Alignment: a matched sit or stop rarely ends exactly at the cue; what is missing is given to the
//! root while a foot swings, so that no planted foot slides, and to the pelvis height while it sinks.
//!
//! The paper leaves this to its motion editor; doing it here keeps the steps where the seat wants them.

use glam::Vec2;

use crate::cue::ActionCue;
use crate::library::database::{DatabaseFrame, GivesWay, MotionDatabase};
use crate::math::Planar;
use crate::math::curve::smoothstep;
use crate::math::rotation::wrap_angle;

/// Largest correction of one frame: metres, radians, metres of height.
const MOST_SHIFT: f32 = 0.022;
const MOST_TURN: f32 = 0.05;
const MOST_LIFT: f32 = 0.012;
/// Frames in which it sets in.
const SET_IN_FRAMES: f32 = 8.0;

#[derive(Debug, Clone)]
pub(super) struct Alignment {
    target: Planar,
    /// World height of the pelvis at the end; `None` for a stop.
    height: Option<f32>,
    lift: f32,
    /// Frames since it began.
    age: f32,
}

impl Alignment {
    pub(super) fn new(cue: &ActionCue) -> Self {
        Self { target: cue.planar(), height: cue.pelvis_height(), lift: 0.0, age: 0.0 }
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
        self.age += 1.0;
        let share_of = |gives: &dyn Fn(&GivesWay) -> f32| {
            let weight = |(at, frame): (usize, &DatabaseFrame)| {
                gives(&frame.gives_way) * smoothstep((self.age + at as f32) / SET_IN_FRAMES)
            };
            let all = coming[..ahead].iter().enumerate().map(weight).sum::<f32>();
            if all > 1e-3 { weight((0, &coming[0])) / all } else { 0.0 }
        };

        let end = planar.compose(database.travel(frame, ahead));
        let turn = wrap_angle(self.target.yaw - end.yaw) * share_of(&|g| g.turn);
        planar.yaw = wrap_angle(planar.yaw + turn.clamp(-MOST_TURN, MOST_TURN));
        let end = planar.compose(database.travel(frame, ahead));
        let missing: Vec2 = (self.target.position - end.position) * share_of(&|g| g.shift);
        planar.position += missing.clamp_length_max(MOST_SHIFT);

        if let Some(height) = self.height {
            let z = |f: &DatabaseFrame| f.posture.root_position.z;
            let missing = height - floor - z(&coming[ahead]) - self.lift;
            // Where the pelvis sinks fast a few millimetres more or less are not seen.
            let sinking = (z(&coming[0]) - z(&coming[1])).max(0.0);
            let left = (z(&coming[0]) - z(&coming[ahead])).max(1e-3);
            let step = missing * (sinking / left).min(1.0);
            self.lift += step.clamp(-MOST_LIFT, MOST_LIFT);
        }
    }
}
