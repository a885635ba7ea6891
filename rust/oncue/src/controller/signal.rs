//! The action signal a_t = (a^type, a^future, a^offset) and the vector of numbers that stands for it.

use std::f32::consts::PI;

use glam::{Vec2, Vec3};

use crate::action::ActionType;
use crate::library::feature::FUTURE_FRAMES;
use crate::math::Planar;
use crate::settings::{FutureForm, SignalSettings};
use crate::synthesizer::{OFFSET_JOINTS, PostureOffset};

/// Numbers of a^offset.
pub(crate) const OFFSET_SIZE: usize = 3 * OFFSET_JOINTS.len();

/// a_t.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ActionSignal {
    pub action_type: ActionType,
    /// The root's place and facing after 10, 20, 30 frames, person-centric.
    pub future: [Planar; 3],
    pub posture_offset: PostureOffset,
}

impl SignalSettings {
    /// Numbers of a^future.
    pub fn future_size(&self) -> usize {
        match self.future_form {
            FutureForm::Points => 2 * FUTURE_FRAMES.len(),
            FutureForm::Goal => 3,
        }
    }

    /// Length of the continuous part of the action vector: a^future, then a^offset.
    pub fn vector_size(&self) -> usize {
        self.future_size() + OFFSET_SIZE
    }

    /// The signal that an action vector stands for. One unit of a^future is [`SignalSettings::reach`] metres
    /// (or `largest_turn` radians), of a^offset `offset_scale` radians. `velocity` is the root's, person-centric, m/s.
    pub fn decode(&self, action_type: ActionType, vector: &[f32], velocity: Vec2) -> ActionSignal {
        let (future, offset) = vector.split_at(self.future_size());
        let future = match self.future_form {
            FutureForm::Points => {
                let mut at = Planar::default();
                std::array::from_fn(|i| {
                    let point =
                        Vec2::new(future[2 * i], future[2 * i + 1]).clamp_length_max(1.0) * self.reach;
                    // The facing follows the path; on the spot it stays.
                    let way = point - at.position;
                    let yaw = if way.length() > 0.1 { way.to_angle() + PI / 2.0 } else { at.yaw };
                    at = Planar::new(point, crate::math::rotation::wrap_angle(yaw));
                    at
                })
            }
            FutureForm::Goal => {
                let goal = Vec2::new(future[0], future[1]).clamp_length_max(1.0) * self.reach;
                let turn = future[2].clamp(-1.0, 1.0) * self.largest_turn;
                FUTURE_FRAMES.map(|ahead| {
                    let s = ahead as f32 / FUTURE_FRAMES[2] as f32;
                    Planar::new(glide(goal, velocity, s), turn * s * (2.0 - s))
                })
            }
        };
        let mut posture_offset = [Vec3::ZERO; OFFSET_JOINTS.len()];
        if self.posture_offset {
            for (joint, v) in posture_offset.iter_mut().zip(offset.chunks_exact(3)) {
                let raw = Vec3::from_slice(v) * self.offset_scale;
                *joint = raw.clamp(Vec3::splat(-self.largest_offset), Vec3::splat(self.largest_offset));
            }
        }
        ActionSignal { action_type, future, posture_offset }
    }

    /// The action vector's a^future that leads to `goal` (person-centric metres) facing `turn` radians after 30 frames.
    pub fn encode_goal(&self, goal: Vec2, turn: f32, velocity: Vec2, out: &mut [f32]) {
        match self.future_form {
            FutureForm::Points => {
                for (i, ahead) in FUTURE_FRAMES.iter().enumerate() {
                    let s = *ahead as f32 / FUTURE_FRAMES[2] as f32;
                    (glide(goal, velocity, s) / self.reach).write_to_slice(&mut out[2 * i..]);
                }
            }
            FutureForm::Goal => {
                (goal / self.reach).write_to_slice(out);
                out[2] = turn / self.largest_turn;
            }
        }
    }
}

/// The goal nearest to `goal` by which the glide there is within `near` of `place` at the part `s` of it, metres. Early in a glide a
/// goal has so little say that it is moved no farther than it would be at a third of the way.
pub(crate) fn goal_through(goal: Vec2, velocity: Vec2, place: Vec2, s: f32, near: f32) -> Vec2 {
    let miss = place - glide(goal, velocity, s);
    let beyond = (miss.length() - near).max(0.0);
    // How far the glide goes along with its goal.
    let say = |s: f32| s * s * (2.0 - s);
    goal + miss.normalize_or_zero() * beyond / say(s).max(say(1.0 / 3.0))
}

/// A smooth way to `goal` (reached at s = 1, one second) that begins with `velocity` and ends at the mean pace.
fn glide(goal: Vec2, velocity: Vec2, s: f32) -> Vec2 {
    let (s2, s3) = (s * s, s * s * s);
    goal * (3.0 * s2 - 2.0 * s3) + velocity * (s - 2.0 * s2 + s3) + goal * (s3 - s2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_goal_round_trips() {
        let settings = SignalSettings::default();
        let mut vector = vec![0.0; settings.vector_size()];
        let (goal, velocity) = (Vec2::new(0.3, -1.0), Vec2::new(0.0, -1.2));
        settings.encode_goal(goal, 0.8, velocity, &mut vector);
        let signal = settings.decode(ActionType::Walk, &vector, velocity);
        assert!(signal.future[2].position.distance(goal) < 1e-5);
        assert!((signal.future[2].yaw - 0.8).abs() < 1e-5);
        // At a steady pace the points lie evenly on the way.
        let steady = settings.decode(ActionType::Walk, &vector, goal);
        assert!(steady.future[0].position.distance(goal / 3.0) < 1e-5);
        assert_eq!(signal.posture_offset, [Vec3::ZERO; 4]);
    }

    #[test]
    fn a_goal_by_hand() {
        let settings = SignalSettings::default();
        let mut vector = vec![0.0; settings.vector_size()];
        vector[..3].copy_from_slice(&[0.25, -0.5, 0.5]);
        let signal = settings.decode(ActionType::Stop, &vector, Vec2::new(0.6, 0.0));
        assert_eq!(signal.action_type, ActionType::Stop);
        let goal = Vec2::new(0.4, -0.8);
        for (future, s) in signal.future.iter().zip([1.0f32 / 3.0, 2.0 / 3.0, 1.0]) {
            // Hermite's cubic: from 0 with the velocity to the goal with the goal's.
            let (h01, h10, h11) =
                (3.0 * s * s - 2.0 * s.powi(3), s - 2.0 * s * s + s.powi(3), s.powi(3) - s * s);
            let expected = goal * (h01 + h11) + Vec2::new(0.6, 0.0) * h10;
            assert!(future.position.distance(expected) < 1e-5, "{future:?} {expected}");
            assert!((future.yaw - 1.1 * s * (2.0 - s)).abs() < 1e-5);
        }
        // No farther than it reaches, and no more turned.
        vector[..3].copy_from_slice(&[3.0, 4.0, -7.0]);
        let far = settings.decode(ActionType::Walk, &vector, Vec2::ZERO).future[2];
        assert!(far.position.distance(Vec2::new(0.96, 1.28)) < 1e-5 && (far.yaw + 2.2).abs() < 1e-5);
    }

    #[test]
    fn a_glide_is_led_through_a_place() {
        let (goal, velocity) = (Vec2::new(0.6, -0.5), Vec2::new(0.1, -1.1));
        for (place, s) in [(Vec2::new(0.0, -0.6), 0.5), (Vec2::new(0.2, -0.9), 0.9)] {
            let found = goal_through(goal, velocity, place, s, 0.05);
            assert!((glide(found, velocity, s).distance(place) - 0.05).abs() < 1e-4);
            assert!(goal_through(found, velocity, place, s, 0.06).distance(found) < 1e-5, "near enough");
        }
        // Hardly begun it is moved a little, not far away.
        let late = goal_through(goal, velocity, Vec2::new(0.1, -0.1), 0.05, 0.0);
        assert!(late.distance(goal) < 1.0, "{late}");
    }

    #[test]
    fn points_face_along_their_path() {
        let settings =
            SignalSettings { future_form: FutureForm::Points, reach: 2.0, ..SignalSettings::default() };
        assert_eq!((settings.future_size(), settings.vector_size()), (6, 18));
        let mut vector = vec![0.0; 18];
        vector[..6].copy_from_slice(&[0.2, 0.0, 0.21, 0.0, 0.21, -0.4]);
        let future = settings.decode(ActionType::Walk, &vector, Vec2::ZERO).future;
        // To +X, which one faces turned by a quarter; 2 cm on the spot; then to -Y.
        for (point, (x, y, yaw)) in
            future.iter().zip([(0.4, 0.0, PI / 2.0), (0.42, 0.0, PI / 2.0), (0.42, -0.8, 0.0)])
        {
            assert!(point.position.distance(Vec2::new(x, y)) < 1e-5);
            assert!((point.yaw - yaw).abs() < 1e-5, "{point:?}");
        }
        let mut out = vec![0.0; 6];
        settings.encode_goal(Vec2::new(0.0, -1.2), 0.3, Vec2::new(0.0, -1.2), &mut out);
        for (found, expected) in out.iter().zip([0.0, -0.2, 0.0, -0.4, 0.0, -0.6]) {
            assert!((found - expected).abs() < 1e-5, "{out:?}");
        }
    }

    #[test]
    fn arms_turn_as_far_as_allowed() {
        let mut settings =
            SignalSettings { offset_scale: 0.5, largest_offset: 0.8, ..SignalSettings::default() };
        let mut vector = vec![0.0; settings.vector_size()];
        vector[3..9].copy_from_slice(&[0.4, -1.0, 9.0, -9.0, 0.2, 0.0]);
        let offset = settings.decode(ActionType::Walk, &vector, Vec2::ZERO).posture_offset;
        assert_eq!(offset, [Vec3::new(0.2, -0.5, 0.8), Vec3::new(-0.8, 0.1, 0.0), Vec3::ZERO, Vec3::ZERO]);
        settings.posture_offset = false;
        assert_eq!(settings.decode(ActionType::Walk, &vector, Vec2::ZERO).posture_offset, [Vec3::ZERO; 4]);
    }
}
