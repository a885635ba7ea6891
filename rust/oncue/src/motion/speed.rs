//! How fast and how hard joints move: what one motion, or all of a library, has of it.

use glam::Vec3;

use super::{FRAME_RATE, JOINT_COUNT, Motion, Pose, Posture};
use crate::math::rotation::angle_between;

/// Percentile of each joint's turn from frame to frame, radians: the hips' in the world, the others' in their parents'
/// frames. `part` in 0..=1; motions of one frame count for nothing.
pub fn joint_turns(pairs: impl Iterator<Item = (Posture, Posture)>, part: f64) -> [f32; JOINT_COUNT] {
    let mut turns: [Vec<f32>; JOINT_COUNT] = Default::default();
    for (before, after) in pairs {
        for (joint, turns) in turns.iter_mut().enumerate() {
            turns.push(angle_between(before.rotations[joint], after.rotations[joint]));
        }
    }
    turns.map(|mut turns| percentile(&mut turns, part))
}

/// How hard each joint is accelerated between three frames, world, m/s².
pub fn accelerations(positions: [&[Vec3; JOINT_COUNT]; 3]) -> [f32; JOINT_COUNT] {
    let [a, b, c] = positions;
    std::array::from_fn(|j| FRAME_RATE * FRAME_RATE * (a[j] + c[j] - 2.0 * b[j]).length())
}

/// Percentile of each joint's acceleration over `motions`, m/s². `part` in 0..=1; motions of fewer than three frames
/// count for nothing.
pub fn joint_accelerations<'a>(motions: impl Iterator<Item = &'a Motion>, part: f64) -> [f32; JOINT_COUNT] {
    let mut all: [Vec<f32>; JOINT_COUNT] = Default::default();
    for motion in motions {
        let poses: Vec<Pose> = motion.postures.iter().map(Posture::pose).collect();
        for w in poses.windows(3) {
            let hard = accelerations([&w[0].positions, &w[1].positions, &w[2].positions]);
            all.iter_mut().zip(hard).for_each(|(all, a)| all.push(a));
        }
    }
    all.map(|mut values| percentile(&mut values, part))
}

/// The value that `part` (0..=1) of the others do not exceed; 0 of nothing.
fn percentile(values: &mut [f32], part: f64) -> f32 {
    let at = ((values.len() as f64 * part) as usize).min(values.len().saturating_sub(1));
    if values.is_empty() { 0.0 } else { *values.select_nth_unstable_by(at, f32::total_cmp).1 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_by_hand() {
        let mut values: Vec<f32> = (0..10).rev().map(|v| v as f32).collect();
        assert_eq!(percentile(&mut values, 0.0), 0.0);
        assert_eq!(percentile(&mut values, 0.5), 5.0);
        assert_eq!(percentile(&mut values, 0.999), 9.0);
        assert_eq!(percentile(&mut values, 1.0), 9.0);
        assert_eq!(percentile(&mut [], 0.5), 0.0);
    }
}
