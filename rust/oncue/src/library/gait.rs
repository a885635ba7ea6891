//! Steps of a file, counted in its own frames: how the feet pass each other, whatever the file's frame rate says.

use glam::Vec3;

use super::body;
use super::contact::runs;
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

/// How long one foot takes to pass the other in going.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Steps {
    /// Median of the frames in which a foot covers the middle 80 % of its way past the other.
    pub pass_frames: f32,
}

/// Hips lower over the feet than this do not walk: they crawl or crouch, leg lengths.
const LOWEST_HIPS: f32 = 0.8;
/// A floor's lowest and highest step differ by less than this, leg lengths.
const LEVEL: f32 = 0.5;
/// Both feet are in the air where all of them is higher than this over where they stand, leg lengths.
const AIRBORNE: f32 = 0.05;
/// Flights shorter than this tell nothing of their fall, frames.
const SHORTEST_FLIGHT: usize = 5;
/// Leg lengths that a body falls in a second, in the second: 9.81 m/s² for legs of 0.88 m.
const FALL: f32 = 11.1;

/// What of a file shows how it goes, frame by frame, in leg lengths and along its own up axis.
pub(super) struct Gait {
    /// How far the left ankle is before the right one.
    apart: Vec<f32>,
    /// How high the hips are over the ankles.
    hips: Vec<f32>,
    /// How high the hips are.
    height: Vec<f32>,
    /// How high the lowest part of the feet is over where it stands.
    air: Vec<f32>,
    /// How high the lowest part of the feet is.
    feet: Vec<f32>,
}

impl Gait {
    pub(super) fn new(file: &MocapFile, table: &JointTable, up: UpAxis) -> Self {
        let length = leg_length(file, table).max(1e-6);
        let up = up.direction();
        let mut out = Self {
            apart: Vec::new(),
            hips: Vec::new(),
            height: Vec::new(),
            air: Vec::new(),
            feet: Vec::new(),
        };
        let mut feet: Vec<[f32; 4]> = Vec::new();
        let mut pose = MocapPose::default();
        let first = file.leading_rest_frames();
        for frame in first..file.frame_count().min(first + FRAMES) {
            file.pose_at(frame as f64, &mut pose);
            let at = |j: Joint| table.get(j).map_or(Vec3::ZERO, |i| pose.positions[i]);
            let left = at(LeftUpLeg) - at(RightUpLeg);
            let forward = left.cross(up).normalize_or_zero();
            let height = (at(LeftUpLeg) + at(RightUpLeg)).dot(up) / 2.0;
            out.apart.push((at(LeftFoot) - at(RightFoot)).dot(forward) / length);
            out.hips.push((height - (at(LeftFoot) + at(RightFoot)).dot(up) / 2.0) / length);
            out.height.push(height / length);
            let toes = [0, 1].map(|side| body::toe(file, table, &pose, side));
            feet.push([at(LeftFoot), at(RightFoot), toes[0], toes[1]].map(|p| p.dot(up) / length));
        }
        let stands: [f32; 4] = std::array::from_fn(|part| {
            let mut heights: Vec<f32> = feet.iter().map(|f| f[part]).collect();
            heights.sort_unstable_by(f32::total_cmp);
            heights.get(heights.len() / 20).copied().unwrap_or_default()
        });
        out.air = feet.iter().map(|f| (0..4).map(|i| f[i] - stands[i]).fold(f32::MAX, f32::min)).collect();
        out.feet = feet.iter().map(|f| f.iter().copied().fold(f32::MAX, f32::min)).collect();
        out
    }

    /// Whether all steps are on one floor. Who crawls goes where his head points, so along that axis his feet rise.
    pub(super) fn is_level(&self) -> bool {
        let mut heights = self.feet.clone();
        heights.sort_unstable_by(f32::total_cmp);
        let at = |share: usize| heights.get(heights.len() * share / 20).copied().unwrap_or_default();
        at(19) - at(1) < LEVEL
    }

    /// The steps, or `None` where there are fewer than `fewest`.
    pub(super) fn steps(&self, fewest: usize) -> Option<Steps> {
        let mut found: Vec<f32> = Vec::new();
        let mut passes = passes(&self.apart);
        passes.retain(|pass| self.hips[pass.first..pass.end].iter().all(|&h| h > LOWEST_HIPS));
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
        (found.len() >= fewest).then(|| Steps { pass_frames: found[found.len() / 2] })
    }

    /// The frames a second at which bodies in the air fall as all do, or `None` where none is long enough in the air.
    pub(super) fn rate_by_flight(&self) -> Option<f64> {
        let flies: Vec<bool> = self.air.iter().map(|&h| h > AIRBORNE).collect();
        let mut rates: Vec<f32> = Vec::new();
        for (first, end) in runs(&flies, true) {
            let half = (end - first - 1) / 2;
            if end - first < SHORTEST_FLIGHT || first == 0 || end == flies.len() {
                continue;
            }
            let [a, b, c] = [first, first + half, first + 2 * half].map(|f| self.height[f]);
            // Second difference over half the flight: what it falls in a frame, in the frame.
            let fall = (2.0 * b - a - c) / (half * half) as f32;
            if fall > 0.0 {
                rates.push((FALL / fall).sqrt());
            }
        }
        rates.sort_unstable_by(f32::total_cmp);
        rates.get(rates.len() / 2).map(|&rate| f64::from(rate))
    }
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
    fn a_fall_tells_the_rate() {
        // By hand: at 50 frames a second a body falls by 11.1 / 2500 leg lengths a frame, in the frame.
        let flight = |f: usize| if (10..31).contains(&f) { (f as f32 - 20.0) / 50.0 } else { 0.2 };
        let height: Vec<f32> = (0..40).map(|f| 1.5 - 11.1 / 2.0 * flight(f).powi(2)).collect();
        let air = (0..40).map(|f| if (10..31).contains(&f) { 0.1 } else { 0.0 }).collect();
        let gait = Gait { apart: vec![0.0; 40], hips: vec![1.0; 40], height, air, feet: vec![0.0; 40] };
        let rate = gait.rate_by_flight().unwrap();
        assert!((rate - 50.0).abs() < 0.1, "{rate}");
        assert_eq!(gait.steps(1), None);
        // Feet that rest on a stool do not fall.
        let seated = Gait { height: vec![0.6; 40], ..gait };
        assert_eq!(seated.rate_by_flight(), None);
    }

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
