//! How smoothly a motion runs: accelerations of joints and of their rotations.

use std::ops::Range;

use serde::{Deserialize, Serialize};

use crate::math::rotation::to_angle_axis;
use crate::motion::{FRAME_RATE, JOINT_COUNT, Motion, Pose, Posture};

/// Accelerations over a range of frames.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Smoothness {
    /// Mean over frames and joints, and the largest, m/s².
    pub mean_acceleration: f32,
    /// The largest, m/s².
    pub largest_acceleration: f32,
    /// Largest change of a joint's own angular velocity, rad/s².
    pub largest_turn: f32,
    /// Mean change of the joints' acceleration, m/s³.
    pub mean_jerk: f32,
}

/// Accelerations of the joints in `frames` (those before and after are looked at too, where there are any).
pub fn smoothness(motion: &Motion, frames: &Range<usize>) -> Smoothness {
    let poses: Vec<Pose> = motion.postures.iter().map(Posture::pose).collect();
    let mut out = Smoothness::default();
    let (mut sum, mut jerks, mut count, mut jerk_count) = (0.0f64, 0.0f64, 0usize, 0usize);
    let square = FRAME_RATE * FRAME_RATE;
    for frame in frames.start.max(1)..frames.end.min(motion.len().saturating_sub(1)) {
        for joint in 0..JOINT_COUNT {
            let place = |f: usize| poses[f].positions[joint];
            let bend = |f: usize| place(f - 1) + place(f + 1) - 2.0 * place(f);
            let acceleration = square * bend(frame).length();
            out.largest_acceleration = out.largest_acceleration.max(acceleration);
            sum += f64::from(acceleration);
            count += 1;
            let rotation = |f: usize| motion.postures[f].rotations[joint];
            let turn = |f: usize| to_angle_axis(rotation(f) * rotation(f - 1).inverse());
            out.largest_turn = out.largest_turn.max(square * turn(frame + 1).distance(turn(frame)));
            if frame > 1 {
                jerks += f64::from(square * FRAME_RATE * bend(frame).distance(bend(frame - 1)));
                jerk_count += 1;
            }
        }
    }
    out.mean_acceleration = (sum / count.max(1) as f64) as f32;
    out.mean_jerk = (jerks / jerk_count.max(1) as f64) as f32;
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Quat;

    #[test]
    fn a_fall_and_a_spin_by_hand() {
        let mut motion = Motion::default();
        for frame in 0..10 {
            let mut posture = Posture::default();
            let t = frame as f32 / FRAME_RATE;
            posture.root_position.z -= 0.5 * 9.81 * t * t;
            posture.rotations[5] = Quat::from_rotation_z(0.5 * 3.0 * t * t);
            motion.postures.push(posture);
        }
        let found = smoothness(&motion, &(0..10));
        assert!((found.largest_acceleration - 9.81).abs() < 0.05, "{found:?}");
        assert!((found.mean_acceleration - 9.81).abs() < 0.05);
        assert!((found.largest_turn - 3.0).abs() < 0.05);
        assert!(found.mean_jerk < 5.0);
    }
}
