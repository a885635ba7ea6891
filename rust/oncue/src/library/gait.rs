//! Steps of a file, counted in its own frames: how the feet pass each other, whatever the file's frame rate says.

use glam::Vec3;

use super::joint_names::JointTable;
use super::mocap_file::{MocapFile, MocapPose};
use super::sampler::leg_length;
use super::up_axis::UpAxis;
use crate::motion::Joint;

use Joint::*;

/// A foot passes the other by at least this, leg lengths.
const SHORTEST_PASS: f32 = 0.4;
/// Feet that rest between two passes for longer than this many passes do not walk.
const LONGEST_REST: f32 = 2.0;
/// Frames looked at: walking shows itself in fewer.
const FRAMES: usize = 20_000;

/// How many times one foot passed the other in going, and how long that takes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Steps {
    pub count: usize,
    /// Median of the frames in which a foot covers the middle 80 % of its way past the other.
    pub pass_frames: f32,
}

/// The steps of a file, or `None` where it has fewer than `fewest`.
pub(super) fn steps(file: &MocapFile, table: &JointTable, up: UpAxis, fewest: usize) -> Option<Steps> {
    let apart = feet_apart(file, table, up);
    let mut found: Vec<f32> = Vec::new();
    let passes = passes(&apart);
    let walked =
        |a: &Pass, b: &Pass| b.first as f32 - a.end as f32 <= LONGEST_REST * a.frames().max(b.frames());
    for (i, pass) in passes.iter().enumerate() {
        let before = i > 0 && walked(&passes[i - 1], pass);
        let after = passes.get(i + 1).is_some_and(|next| walked(pass, next));
        if before || after {
            found.push(pass.frames());
        }
    }
    found.sort_unstable_by(f32::total_cmp);
    (found.len() >= fewest).then(|| Steps { count: found.len(), pass_frames: found[found.len() / 2] })
}

/// How far the left ankle is before the right one in each frame, leg lengths.
fn feet_apart(file: &MocapFile, table: &JointTable, up: UpAxis) -> Vec<f32> {
    let length = leg_length(file, table).max(1e-6);
    let mut pose = MocapPose::default();
    let first = file.leading_rest_frames();
    (first..file.frame_count().min(first + FRAMES))
        .map(|frame| {
            file.pose_at(frame as f64, &mut pose);
            let at = |j: Joint| table.get(j).map_or(Vec3::ZERO, |i| pose.positions[i]);
            let left = at(LeftUpLeg) - at(RightUpLeg);
            let forward = left.cross(up.direction()).normalize_or_zero();
            (at(LeftFoot) - at(RightFoot)).dot(forward) / length
        })
        .collect()
}

/// The middle 80 % of a foot's way past the other, in frames.
struct Pass {
    first: usize,
    end: usize,
}

impl Pass {
    fn frames(&self) -> f32 {
        (self.end - self.first) as f32
    }
}

/// Where the feet pass each other: between one turning point and the next.
fn passes(apart: &[f32]) -> Vec<Pass> {
    let mut out = Vec::new();
    let (mut from, mut to) = (0, 0);
    for (frame, &value) in apart.iter().enumerate() {
        let rising = apart[to] >= apart[from];
        if (value >= apart[to]) == rising || value == apart[to] {
            to = frame;
        } else if (value - apart[to]).abs() >= SHORTEST_PASS / 2.0 {
            // It has turned for good.
            out.extend(pass(apart, from, to));
            (from, to) = (to, frame);
        }
    }
    out.extend(pass(apart, from, to));
    out
}

fn pass(apart: &[f32], from: usize, to: usize) -> Option<Pass> {
    let (start, way) = (apart[from], apart[to] - apart[from]);
    if way.abs() < SHORTEST_PASS {
        return None;
    }
    let share = |f: usize| (apart[f] - start) / way;
    let first = (from..=to).rev().find(|&f| share(f) <= 0.1)?;
    let end = (first..=to).find(|&f| share(f) >= 0.9)?;
    (end > first).then_some(Pass { first, end })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn passes_by_hand() {
        // Feet at rest for 50 frames, a step of 20 frames in a straight line, rest for 5, and one back.
        let mut apart = vec![0.0; 50];
        apart.extend((1..=20).map(|i| 0.05 * i as f32));
        apart.extend([1.0; 5]);
        apart.extend((1..=20).map(|i| 1.0 - 0.1 * i as f32));
        let found: Vec<(usize, f32)> = passes(&apart).iter().map(|p| (p.first, p.frames())).collect();
        // 10 % of the first way are done at its 2nd frame, 90 % at its 18th.
        assert_eq!(found.len(), 2, "{found:?}");
        assert!(found[0].0.abs_diff(51) <= 1 && (found[0].1 - 16.0).abs() <= 1.0, "{found:?}");
        assert!(found[1].0.abs_diff(76) <= 1 && (found[1].1 - 16.0).abs() <= 1.0, "{found:?}");
        // Trembling feet pass nothing.
        let trembling: Vec<f32> = (0..200).map(|i| 0.15 * (i as f32 * 0.7).sin()).collect();
        assert!(passes(&trembling).is_empty());
    }
}
