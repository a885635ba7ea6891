//! The motion feature f(m) = { {p_j}, {ṗ_j}, θ_up, c, o_future } and the weights w_f (LAMA, section 3.3).
//!
//! A feature is a flat vector; this file is the only one that knows where each block lies.
//! p_j, ṗ_j for j ∈ {Head, Hands, Feet} and θ_up are in the person-centric space of the frame
//! (root's projection on the floor, facing -Y), c is per foot.
//! o_future is action-specific: for walking the root's place and facing 10, 20 and 30 frames ahead;
//! for sitting and stopping those of the frame that completes the action, and there also the pelvis
//! height, which the paper leaves out and without which a bar stool matches an armchair.

use glam::{Vec2, Vec3};
use serde::{Deserialize, Serialize};

use crate::action::{ActionType, CueHeight, FutureKind};
use crate::error::Result;
use crate::math::Planar;
use crate::motion::{FRAME_RATE, FootContact, Joint, Pose};
use crate::range::check_ranges;

/// The j of p_j: end effectors, in the order of the feature.
pub(crate) const END_EFFECTORS: [Joint; 5] =
    [Joint::Head, Joint::LeftHand, Joint::RightHand, Joint::LeftFoot, Joint::RightFoot];

/// Frames ahead of o_future for locomotion, at 30 Hz.
pub(crate) const FUTURE_FRAMES: [usize; 3] = [10, 20, 30];

pub(crate) const POSITION: usize = 0;
pub(crate) const VELOCITY: usize = 15;
pub(crate) const UP: usize = 30;
pub(crate) const CONTACT: usize = 33;
pub(crate) const FUTURE: usize = 35;

/// Length of a feature of an action type.
pub const fn feature_size(action_type: ActionType) -> usize {
    match action_type.spec().future {
        FutureKind::Path => FUTURE + 12,
        FutureKind::Completion => FUTURE + 5,
    }
}

/// The largest of them.
pub(crate) const MAX_FEATURE: usize = FUTURE + 12;

/// o_future: where the root is to be and face, person-centric.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Future {
    /// After 10, 20, 30 frames.
    Walk([Planar; 3]),
    /// When the action completes, and the pelvis joint's height over the floor then (metres).
    Complete(Planar, f32),
}

/// The part of a feature that is the posture's own.
pub(crate) type PoseFeature = [f32; FUTURE];

/// {p_j}, {ṗ_j}, θ_up, c of a posture, from its pose and the one a frame before (both in the world).
pub(crate) fn pose_feature(pose: &Pose, before: &Pose, contact: FootContact) -> PoseFeature {
    let here = Planar::of_root(pose.positions[0], pose.rotations[0]);
    let mut feature = [0.0; FUTURE];
    let local = |world: Vec3| -> Vec3 { here.direction_to_local(world.truncate()).extend(world.z) };
    let origin = here.position.extend(0.0);
    for (e, joint) in END_EFFECTORS.iter().enumerate() {
        let p = pose.position(*joint);
        let velocity = (p - before.position(*joint)) * FRAME_RATE;
        local(p - origin).write_to_slice(&mut feature[POSITION + 3 * e..]);
        local(velocity).write_to_slice(&mut feature[VELOCITY + 3 * e..]);
    }
    local(pose.rotations[0] * Vec3::Z).write_to_slice(&mut feature[UP..]);
    feature[CONTACT] = contact[0];
    feature[CONTACT + 1] = contact[1];
    feature
}

/// Appends o_future to a posture's feature; `out` is as long as [`feature_size`] of the action type.
pub fn write_feature(pose: &PoseFeature, future: &Future, out: &mut [f32]) {
    out[..FUTURE].copy_from_slice(pose);
    let out = &mut out[FUTURE..];
    match future {
        Future::Walk(points) => {
            for (i, point) in points.iter().enumerate() {
                write_vec2(&mut out[2 * i..], point.position);
                write_vec2(&mut out[6 + 2 * i..], point.forward());
            }
        }
        Future::Complete(point, height) => {
            write_vec2(out, point.position);
            write_vec2(&mut out[2..], point.forward());
            out[4] = *height;
        }
    }
}

fn write_vec2(out: &mut [f32], v: Vec2) {
    out[0] = v.x;
    out[1] = v.y;
}

/// w_f² by block: what a squared difference of one unit costs.
///
/// The paper gives no values ("a fixed weight vector"); these were set by looking at transitions.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FeatureWeights {
    /// Foot positions, per m².
    pub foot_position: f32,
    /// Head and hand positions, per m².
    pub hand_position: f32,
    /// Foot velocities, per (m/s)².
    pub foot_velocity: f32,
    /// Head and hand velocities, per (m/s)².
    pub hand_velocity: f32,
    /// Up vector.
    pub up: f32,
    /// Contact, per unit.
    pub contact: f32,
    /// Future positions at 10, 20, 30 frames, per m².
    pub future_position: [f32; 3],
    /// Future directions at 10, 20, 30 frames (difference of unit vectors).
    pub future_direction: [f32; 3],
    /// Place where an action completes, per m².
    pub complete_position: f32,
    /// Facing where an action completes.
    pub complete_direction: f32,
    /// Pelvis height where an action completes, per m².
    pub complete_height: f32,
}

impl Default for FeatureWeights {
    fn default() -> Self {
        Self {
            foot_position: 10.0,
            hand_position: 1.0,
            foot_velocity: 0.12,
            hand_velocity: 0.02,
            up: 1.0,
            contact: 0.1,
            future_position: [0.8, 1.6, 2.4],
            future_direction: [0.3, 0.6, 0.9],
            complete_position: 8.0,
            complete_direction: 2.0,
            complete_height: 30.0,
        }
    }
}

impl FeatureWeights {
    /// # Errors
    /// [`crate::Error::Input`] naming the first value that is negative, too large or not a number.
    pub fn validate(&self) -> Result<()> {
        const ANY: std::ops::RangeInclusive<f32> = 0.0..=1e6;
        check_ranges!(
            self,
            "synthesizer.weights",
            FeatureWeights {
                foot_position: ANY,
                hand_position: ANY,
                foot_velocity: ANY,
                hand_velocity: ANY,
                up: ANY,
                contact: ANY,
                future_position: ANY,
                future_direction: ANY,
                complete_position: ANY,
                complete_direction: ANY,
                complete_height: ANY,
            },
            free {}
        );
        Ok(())
    }

    /// w_f: the factor of each element before the difference is squared (LAMA, eq. 2).
    pub fn vector(&self, action_type: ActionType) -> Vec<f32> {
        let mut squared = vec![0.0; feature_size(action_type)];
        for (e, joint) in END_EFFECTORS.iter().enumerate() {
            let foot = Joint::FEET.contains(joint);
            let (p, v) = if foot {
                (self.foot_position, self.foot_velocity)
            } else {
                (self.hand_position, self.hand_velocity)
            };
            squared[POSITION + 3 * e..POSITION + 3 * e + 3].fill(p);
            squared[VELOCITY + 3 * e..VELOCITY + 3 * e + 3].fill(v);
        }
        squared[UP..CONTACT].fill(self.up);
        squared[CONTACT..FUTURE].fill(self.contact);
        let future = &mut squared[FUTURE..];
        match action_type.spec().future {
            FutureKind::Path => {
                for i in 0..3 {
                    future[2 * i..2 * i + 2].fill(self.future_position[i]);
                    future[6 + 2 * i..8 + 2 * i].fill(self.future_direction[i]);
                }
            }
            FutureKind::Completion => {
                future[..2].fill(self.complete_position);
                future[2..4].fill(self.complete_direction);
                // A standing pelvis has one height; asking for it would only punish a lively walk.
                future[4] = match action_type.spec().height {
                    CueHeight::Pelvis => self.complete_height,
                    CueHeight::Standing => 0.0,
                };
            }
        }
        squared.iter().map(|w| w.sqrt()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::Posture;

    #[test]
    fn a_feature_does_not_depend_on_where_the_person_stands() {
        let mut a = Posture::default();
        a.rotations[Joint::LeftUpLeg.index()] = glam::Quat::from_rotation_x(-0.6);
        let mut b = a;
        b.root_position.y -= 0.04;
        let to = Planar::new(Vec2::new(3.0, -2.0), 1.1);
        let here = pose_feature(&b.pose(), &a.pose(), [1.0, 0.5]);
        let there = pose_feature(
            &b.moved(Planar::default(), to).pose(),
            &a.moved(Planar::default(), to).pose(),
            [1.0, 0.5],
        );
        for (x, y) in here.iter().zip(there) {
            assert!((x - y).abs() < 2e-4, "{here:?}\n{there:?}");
        }
        // 0.04 m a frame forward (-Y) is 1.2 m/s for the head.
        assert!((here[VELOCITY + 1] + 1.2).abs() < 1e-3);
    }

    #[test]
    fn blocks_fill_the_vector() {
        for &action_type in ActionType::ALL {
            let w = FeatureWeights::default().vector(action_type);
            let zero = w.iter().filter(|w| **w == 0.0).count();
            let ignores_height = action_type.spec().future == FutureKind::Completion
                && action_type.spec().height == CueHeight::Standing;
            assert_eq!(zero, usize::from(ignores_height));
        }
    }
}
