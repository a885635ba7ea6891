//! Limbs in the own body.

use serde::{Deserialize, Serialize};

use super::percent;
use super::spans::Spans;
use crate::anatomy::{BodyPart, DEEP, touching};
use crate::motion::Pose;

/// How often limbs are in the trunk, the head and each other.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct OwnBodyFigures {
    /// Share of the frames in which one part is deeper than 1 cm in another, percent.
    pub percent: f32,
    /// The deepest, cm; 0 where nothing touches.
    pub deepest_cm: f32,
    /// The parts that are deeper than 1 cm in one another, from frame to frame, the deepest first.
    pub touches: Vec<OwnTouch>,
}

/// Two parts of the body in one another.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OwnTouch {
    /// Which.
    pub parts: [BodyPart; 2],
    /// The first frame.
    pub first: usize,
    /// The frame after the last.
    pub end: usize,
    /// How deep at most, cm, beyond what flesh gives.
    pub depth_cm: f32,
    /// The frame in which it is deepest.
    pub frame: usize,
}

/// What has been counted so far.
#[derive(Debug, Clone, Default)]
pub(super) struct Tally {
    frames: usize,
    deep: usize,
    deepest: f32,
    spans: Spans<[BodyPart; 2], ()>,
}

impl Tally {
    pub(super) fn add(&mut self, poses: &[Pose]) {
        for (frame, pose) in poses.iter().enumerate() {
            let mut is_deep = false;
            for (parts, depth) in touching(pose, 0.0) {
                self.deepest = self.deepest.max(depth);
                if depth > DEEP {
                    is_deep = true;
                    self.spans.add(frame, parts, depth, ());
                }
            }
            self.deep += usize::from(is_deep);
        }
        self.frames += poses.len();
    }

    pub(super) fn merge(&mut self, other: Tally) {
        self.frames += other.frames;
        self.deep += other.deep;
        self.deepest = self.deepest.max(other.deepest);
    }

    pub(super) fn finish(self, spans: bool) -> OwnBodyFigures {
        let touches = self.spans.worst_first().into_iter().filter(|_| spans).map(|span| OwnTouch {
            parts: span.key,
            first: span.first,
            end: span.end,
            depth_cm: 100.0 * span.worst,
            frame: span.worst_frame,
        });
        OwnBodyFigures {
            percent: percent(self.deep, self.frames),
            deepest_cm: 100.0 * self.deepest,
            touches: touches.collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::{Joint, Posture};
    use glam::Quat;
    use std::f32::consts::FRAC_PI_2;

    fn figures(postures: &[Posture]) -> OwnBodyFigures {
        let mut tally = Tally::default();
        tally.add(&postures.iter().map(Posture::pose).collect::<Vec<_>>());
        tally.finish(true)
    }

    /// The left arm hangs, turned by so much about the vertical line through the chest, its elbow bent by a right angle.
    fn bent_across(inwards: f32) -> Posture {
        let mut posture = Posture::default();
        posture.rotations[Joint::LeftArm.index()] =
            Quat::from_rotation_z(inwards) * Quat::from_rotation_y(FRAC_PI_2);
        posture.rotations[Joint::LeftForeArm.index()] = Quat::from_rotation_z(-FRAC_PI_2);
        posture
    }

    #[test]
    fn the_rest_pose_touches_nothing() {
        assert_eq!(figures(&[Posture::default()]), OwnBodyFigures::default());
    }

    #[test]
    fn a_forearm_through_the_belly_is_told_with_its_frames() {
        // Forwards it is free; turned inwards by a right angle it lies across, through the trunk: shoulders and spine are in
        // one plane.
        let free = bent_across(0.0);
        let found = figures(&[free, bent_across(-FRAC_PI_2), bent_across(-FRAC_PI_2), free]);
        assert!((found.percent - 50.0).abs() < 1e-4, "{found:?}");
        let worst = &found.touches[0];
        assert_eq!(worst.parts, [BodyPart::Trunk, BodyPart::LeftForearm]);
        assert_eq!((worst.first, worst.end), (1, 3));
        assert!(worst.depth_cm > 8.0 && worst.depth_cm == found.deepest_cm);
    }

    #[test]
    fn crossed_shins_by_hand() {
        // Both legs turned inwards about the fore-and-aft line through the hips until the shins' axes cross: there they
        // are both radii deep, less what shins give.
        let mut posture = Posture::default();
        let angle = (0.095f32 / 0.666).atan();
        posture.rotations[Joint::LeftUpLeg.index()] = Quat::from_rotation_y(angle);
        posture.rotations[Joint::RightUpLeg.index()] = Quat::from_rotation_y(-angle);
        let found = figures(&[posture]);
        let shins = found.touches.iter().find(|t| t.parts == [BodyPart::LeftShin, BodyPart::RightShin]);
        let part = (0.666f32.hypot(0.095) - 0.444) / 0.444;
        let expected = 100.0 * (2.0 * (0.052 - 0.018 * part) - 0.010);
        assert!((shins.map_or(0.0, |t| t.depth_cm) - expected).abs() < 0.05, "{found:?} {expected}");
    }
}
