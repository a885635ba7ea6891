//! Where the feet are to be while the rest of the body is edited, and what keeps them there.

use std::ops::Range;

use glam::{Quat, Vec3};

use super::term::Term;
use crate::library::foot::LEGS;
use crate::motion::skeleton::{ANKLE_HEIGHT, HEEL_LENGTH, TOE_HEIGHT, TOE_LENGTH};
use crate::motion::{Joint, Motion, Pose};

/// One foot on one frame.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Foot {
    pub ankle: Vec3,
    pub toe: Vec3,
    pub turn: Quat,
    pub toe_turn: Quat,
    /// The toes stay where they are.
    pub planted: bool,
    /// How exactly the ankle follows, metres.
    pub sigma: f32,
}

/// Where foot and toe of each side are to stay on one frame: left ankle, left toe, right ankle, right toe; world, metres.
pub(crate) type FootPlaces = [Vec3; 4];

/// Both feet of every frame of a motion.
#[derive(Debug, Clone)]
pub(crate) struct FootPlan {
    pub feet: Vec<[Foot; 2]>,
}

/// σ of a planted toe, metres: a tenth of what the eye sees slide.
const PLANTED_SIGMA: f32 = 2e-4;

impl FootPlan {
    /// The feet as the motion has them.
    pub(crate) fn of(motion: &Motion) -> Self {
        let feet = motion
            .postures
            .iter()
            .zip(&motion.contacts)
            .map(|(posture, contact)| {
                let pose = posture.pose();
                [0, 1].map(|side| {
                    let [_, _, foot, toe] = LEGS[side];
                    Foot {
                        ankle: pose.position(foot),
                        toe: pose.position(toe),
                        turn: pose.rotation(foot),
                        toe_turn: pose.rotation(toe),
                        planted: contact[side] >= 1.0,
                        sigma: if contact[side] > 0.0 { 0.01 } else { 0.03 },
                    }
                })
            })
            .collect();
        Self { feet }
    }

    /// For the search along the manifold.
    pub(crate) fn places(&self) -> Vec<FootPlaces> {
        self.feet.iter().map(|[l, r]| [l.ankle, l.toe, r.ankle, r.toe]).collect()
    }

    /// What holds the feet of one frame.
    pub(crate) fn terms(&self, frame: usize, floor: f32, out: &mut Vec<Term>) {
        for (side, foot) in self.feet[frame].iter().enumerate() {
            let [_, _, ankle_joint, toe_joint] = LEGS[side];
            let point = |joint, target, sigma| Term::Point {
                joint,
                offset: Vec3::ZERO,
                target,
                sigma: Vec3::splat(sigma),
            };
            if foot.planted {
                out.push(point(toe_joint, foot.toe, PLANTED_SIGMA));
                out.push(point(ankle_joint, foot.ankle, 0.01));
                out.push(Term::Turn { joint: ankle_joint, target: foot.turn, sigma: 0.06 });
            } else {
                out.push(point(ankle_joint, foot.ankle, foot.sigma));
                out.push(Term::Turn { joint: ankle_joint, target: foot.turn, sigma: 0.12 });
            }
            out.push(Term::Turn { joint: toe_joint, target: foot.toe_turn, sigma: 0.06 });
            // Neither heel nor toes go deeper than they were.
            let heel = Vec3::new(0.0, HEEL_LENGTH, -ANKLE_HEIGHT);
            let tip = Vec3::new(0.0, -TOE_LENGTH, -TOE_HEIGHT);
            for (joint, offset, place) in [
                (ankle_joint, heel, foot.ankle + foot.turn * heel),
                (toe_joint, tip, foot.toe + foot.toe_turn * tip),
            ] {
                let least = floor.min(place.z);
                out.push(Term::Plane { joint, offset, normal: Vec3::Z, least, sigma: 5e-4 });
            }
        }
    }

    /// The last stretch of frames earlier than `before` in which the foot of a side is in the air: its last swing.
    pub(crate) fn last_swing(&self, side: usize, before: usize) -> Option<Range<usize>> {
        let end = (0..before.min(self.feet.len())).rev().find(|&f| !self.feet[f][side].planted)? + 1;
        let first = (0..end).rev().find(|&f| self.feet[f][side].planted).map_or(0, |f| f + 1);
        Some(first..end)
    }
}

/// Whether something other than the feet carries the body: the pelvis is low, or far behind the feet.
pub(crate) fn is_supported(pose: &Pose, floor: f32) -> bool {
    let hips = pose.position(Joint::Hips);
    let height = hips.z - floor;
    let feet = 0.5 * (pose.position(Joint::LeftFoot) + pose.position(Joint::RightFoot));
    let away = hips.truncate().distance(feet.truncate());
    height < 0.70 || (height < 0.90 && away > 0.22)
}
