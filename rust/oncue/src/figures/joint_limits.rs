//! Joints beyond the range of people's.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::percent;
use super::spans::Spans;
use crate::anatomy::{LimitedTurn, beyond_limits};
use crate::motion::{Joint, Posture};

/// A joint counts as beyond its limit from so many degrees on: retargeting blurs less.
const BLUR: f32 = 5.0;

/// How often joints are turned further than people's.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct JointLimitFigures {
    /// Share of the frames in which a joint is more than 5° beyond its limit, percent.
    pub percent: f32,
    /// How far beyond its limit any joint is at most, degrees.
    pub worst_degrees: f32,
    /// Share of the frames in which each joint is so; joints that never are are left out.
    pub joints_percent: BTreeMap<Joint, f32>,
    /// Where, from frame to frame, the worst first.
    pub beyond: Vec<BeyondLimit>,
}

/// A joint beyond its limit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BeyondLimit {
    /// Which.
    pub joint: Joint,
    /// In which way.
    pub turn: LimitedTurn,
    /// The first frame.
    pub first: usize,
    /// The frame after the last.
    pub end: usize,
    /// How far beyond the limit at most, degrees.
    pub degrees: f32,
    /// The frame in which it is farthest.
    pub frame: usize,
}

/// What has been counted so far.
#[derive(Debug, Clone, Default)]
pub(super) struct Tally {
    frames: usize,
    beyond: usize,
    worst: f32,
    joints: BTreeMap<Joint, usize>,
    spans: Spans<(Joint, LimitedTurn), ()>,
}

impl Tally {
    pub(super) fn add(&mut self, postures: &[Posture]) {
        for (frame, posture) in postures.iter().enumerate() {
            let mut joints: Vec<Joint> = Vec::new();
            for (joint, turn, degrees) in beyond_limits(posture) {
                self.worst = self.worst.max(degrees);
                if degrees > BLUR {
                    joints.push(joint);
                    self.spans.add(frame, (joint, turn), degrees, ());
                }
            }
            self.beyond += usize::from(!joints.is_empty());
            joints.sort_unstable();
            joints.dedup();
            joints.into_iter().for_each(|joint| *self.joints.entry(joint).or_default() += 1);
        }
        self.frames += postures.len();
    }

    pub(super) fn merge(&mut self, other: Tally) {
        self.frames += other.frames;
        self.beyond += other.beyond;
        self.worst = self.worst.max(other.worst);
        other.joints.into_iter().for_each(|(joint, n)| *self.joints.entry(joint).or_default() += n);
    }

    pub(super) fn finish(self, spans: bool) -> JointLimitFigures {
        let beyond = self.spans.worst_first().into_iter().filter(|_| spans).map(|span| BeyondLimit {
            joint: span.key.0,
            turn: span.key.1,
            first: span.first,
            end: span.end,
            degrees: span.worst,
            frame: span.worst_frame,
        });
        JointLimitFigures {
            percent: percent(self.beyond, self.frames),
            worst_degrees: self.worst,
            joints_percent: self.joints.iter().map(|(joint, n)| (*joint, percent(*n, self.frames))).collect(),
            beyond: beyond.collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{Quat, Vec3};

    fn turned(joint: Joint, axis: Vec3, degrees: f32) -> Posture {
        let mut posture = Posture::default();
        posture.rotations[joint.index()] = Quat::from_axis_angle(axis, degrees.to_radians());
        posture
    }

    #[test]
    fn shares_and_spans() {
        let bad = turned(Joint::LeftForeArm, Vec3::Z, 35.0);
        let within_blur = turned(Joint::LeftForeArm, Vec3::Z, 8.0);
        let mut tally = Tally::default();
        tally.add(&[within_blur, bad, bad, within_blur]);
        let figures = tally.finish(true);
        assert_eq!((figures.percent, figures.beyond.len()), (50.0, 1));
        assert_eq!((figures.beyond[0].first, figures.beyond[0].end), (1, 3));
        assert!((figures.worst_degrees - 30.0).abs() < 1e-2);
        assert_eq!(figures.joints_percent, BTreeMap::from([(Joint::LeftForeArm, 50.0)]));
    }
}
