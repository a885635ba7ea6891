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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_world::{SITS_AT, STANDS, close, database, frame_of, sit_cue, stop_cue};

    #[test]
    fn a_correction_has_its_largest_step() {
        let mut cue = sit_cue();
        cue.position.x += 5.0;
        cue.position.z += 2.0;
        cue.yaw = 3.0;
        let mut alignment = Alignment::new(&cue);
        // Ten frames before the end, long after it set in, everything is missing at once.
        alignment.age = 20.0;
        let mut planar = Planar::default();
        alignment.step(database(), frame_of("sit", 40), &mut planar, 0.0);
        close(planar.position.length(), MOST_SHIFT, 1e-4);
        close(planar.yaw, MOST_TURN, 1e-4);
        close(alignment.lift(), MOST_LIFT, 1e-4);
        let mut other = cue.clone();
        other.position.z = -2.0;
        let mut alignment = Alignment::new(&other);
        alignment.step(database(), frame_of("sit", 40), &mut planar, 0.0);
        close(alignment.lift(), -MOST_LIFT, 1e-4);
    }

    #[test]
    fn what_is_missing_is_shared_by_the_frames_that_come() {
        let mut cue = sit_cue();
        cue.position.x += 0.04;
        let mut alignment = Alignment::new(&cue);
        let mut planar = Planar::default();
        alignment.step(database(), frame_of("sit", 0), &mut planar, 0.0);
        // Fifty frames that all give way alike but for how it sets in: the first takes the least.
        let set_in = |at: f32| smoothstep((1.0 + at) / SET_IN_FRAMES);
        let gives = |f: usize| database().frames[frame_of("sit", f)].gives_way.shift;
        let all: f32 = (0..50).map(|f| gives(f) * set_in(f as f32)).sum();
        close(planar.position.x, 0.04 * gives(0) * set_in(0.0) / all, 1e-6);
        assert!(planar.position.x > 0.0 && planar.position.y.abs() < 1e-4);
        // While it stands nothing is lifted.
        assert_eq!(alignment.lift(), 0.0);
        assert_eq!(alignment.age, 1.0);
    }

    #[test]
    fn height_is_made_up_for_as_the_pelvis_sinks() {
        let mut cue = sit_cue();
        cue.position.z += 0.5 + 0.03;
        let mut alignment = Alignment::new(&cue);
        let z = |f: usize| database().frames[frame_of("sit", f)].posture.root_position.z;
        alignment.step(database(), frame_of("sit", 30), &mut Planar::default(), 0.5);
        // By the share of what is left to sink that this frame sinks.
        close(alignment.lift(), 0.03 * (z(30) - z(31)) / (z(30) - z(50)), 1e-5);
        assert!(z(30) < STANDS && z(30) > SITS_AT);
        // Once complete, and for a stop, nothing is done.
        let mut planar = Planar::default();
        alignment.step(database(), frame_of("sit", 50), &mut planar, 0.5);
        assert_eq!((planar, alignment.age), (Planar::default(), 1.0));
        let mut stop = Alignment::new(&stop_cue(Vec2::new(0.0, -0.5), 0.0));
        stop.step(database(), frame_of("stop", 10), &mut planar, 0.0);
        assert_eq!(stop.lift(), 0.0);
    }
}
