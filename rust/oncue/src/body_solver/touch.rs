//! What carries a seated body and stands behind its back, found by rays as the body moves.

use glam::Vec3;

use super::feet::is_supported;
use super::term::{FoundTerms, Term};
use crate::library::foot::LEGS;
use crate::motion::skeleton::{LEG_LENGTH, SEATED_HIPS_HEIGHT};
use crate::motion::{Joint, Pose, Posture};
use crate::scene::SceneIndex;

/// Half a thigh's thickness, metres: that of the box nodes B.
const THIGH_RADIUS: f32 = 0.05;
/// How far the back is behind the spine, metres: half a centimetre to a centimetre less than the trunk's girth (`anatomy`), which
/// gives as much where it leans.
const BACK_DEPTH: f32 = 0.09;
/// σ of thighs in the seat and of the back in the backrest, metres.
const TOUCH_SIGMA: f32 = 2e-3;
/// A seat that the body is deeper in than this is not looked for, metres: what lies higher over a thigh's underside is a desk
/// or an armrest above the thigh, and a thigh that was lifted on it would pass through it.
const DEEPEST_SEAT: f32 = 0.08;
/// Nor does a seat rise so far over where it carries the pelvis, metres: that is a desk over the knees, seen from below.
const HIGHEST_SEAT: f32 = 0.06;
/// Places along a thigh, as shares of its length, that the seat is looked for under.
const UNDER_THIGH: [f32; 4] = [0.2, 0.45, 0.7, 0.9];
const BACK_JOINTS: [Joint; 3] = [Joint::Spine1, Joint::Spine2, Joint::Neck];

/// The surfaces of a scene as a seated body meets them.
#[derive(Clone, Copy)]
pub(crate) struct Surfaces<'a> {
    pub scene: &'a SceneIndex,
    /// World height of the floor, metres.
    pub floor: f32,
}

/// Keeps thighs and back of a seated body out of what carries them.
impl FoundTerms for Surfaces<'_> {
    fn terms(&self, frame: usize, poses: &[Pose], out: &mut Vec<Term>) {
        let pose = &poses[frame];
        if !is_supported(pose, self.floor) {
            return;
        }
        for side in 0..2 {
            for (offset, point) in under_thigh(pose, side) {
                if let Some(least) = self.under(pose, point) {
                    let joint = LEGS[side][0];
                    out.push(Term::Plane { joint, offset, normal: Vec3::Z, least, sigma: TOUCH_SIGMA });
                }
            }
        }
        let normal = ahead(pose);
        for joint in BACK_JOINTS {
            if let Some(least) = self.behind(pose, joint) {
                out.push(Term::Plane {
                    joint,
                    offset: Vec3::Y * BACK_DEPTH,
                    normal,
                    least,
                    sigma: TOUCH_SIGMA,
                });
            }
        }
    }
}

impl Surfaces<'_> {
    /// How deep a thigh is in the seat, metres.
    pub(crate) fn thigh_depth(&self, pose: &Pose, side: usize) -> f32 {
        let depth =
            |(_, point): (Vec3, Vec3)| self.under(pose, point).map_or(0.0, |surface| surface - point.z);
        under_thigh(pose, side).map(depth).fold(0.0, f32::max)
    }

    /// How deep the back is in the backrest, metres.
    pub(crate) fn back_depth(&self, pose: &Pose) -> f32 {
        let depth = |joint: Joint| {
            let point = pose.position(joint) + pose.rotation(joint) * (Vec3::Y * BACK_DEPTH);
            self.behind(pose, joint).map_or(0.0, |least| least - ahead(pose).dot(point))
        };
        BACK_JOINTS.into_iter().map(depth).fold(0.0, f32::max)
    }

    /// World z of the surface that a point under a thigh is in, or stands on.
    fn under(&self, pose: &Pose, point: Vec3) -> Option<f32> {
        let highest = pose.position(Joint::Hips).z - SEATED_HIPS_HEIGHT + HIGHEST_SEAT;
        let from = point + Vec3::Z * DEEPEST_SEAT;
        let surface = self.scene.ray(from, Vec3::NEG_Z, DEEPEST_SEAT + 0.02).map(|t| from.z - t);
        surface.filter(|z| *z < highest)
    }

    /// How far ahead the surface behind a joint of the back is.
    fn behind(&self, pose: &Pose, joint: Joint) -> Option<f32> {
        let ahead = ahead(pose);
        let from = pose.position(joint) + ahead * 0.04;
        self.scene.ray(from, -ahead, 0.04 + BACK_DEPTH + 0.02).map(|t| ahead.dot(from) - t)
    }
}

/// Points under a thigh: in its own frame and in the world.
fn under_thigh(pose: &Pose, side: usize) -> impl Iterator<Item = (Vec3, Vec3)> + '_ {
    let joint = LEGS[side][0];
    UNDER_THIGH.into_iter().map(move |along| {
        let offset = Vec3::new(0.0, THIGH_RADIUS, -along * LEG_LENGTH);
        (offset, pose.position(joint) + pose.rotation(joint) * offset)
    })
}

/// Where the root faces, on the floor plane.
fn ahead(pose: &Pose) -> Vec3 {
    let root = Posture { root_position: pose.positions[0], rotations: pose.rotations };
    root.planar().forward().extend(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_world::room;
    use glam::Quat;

    #[test]
    fn a_desk_over_the_knees_is_no_seat() {
        // Thighs that rise ahead by 13°, and level ones.
        let seated = |turn: f32| {
            let mut posture = Posture { root_position: Vec3::new(0.0, 0.0, 0.57), ..Posture::default() };
            for leg in LEGS {
                posture.rotations[leg[0].index()] = Quat::from_rotation_x(turn);
            }
            posture.pose()
        };
        let depth = |pose: &Pose, boxes: &[([f32; 3], [f32; 3])]| {
            let scene = room(boxes);
            Surfaces { scene: &scene, floor: 0.0 }.thigh_depth(pose, 0)
        };
        let rises = seated(-1.8);
        let knee = rises.position(Joint::LeftLeg).z - THIGH_RADIUS;
        assert_eq!(depth(&rises, &[([-1.0, -1.0, knee - 0.03], [1.0, -0.2, knee + 0.01])]), 0.0);
        let level = seated(-std::f32::consts::FRAC_PI_2);
        let seat = level.position(Joint::LeftLeg).z - THIGH_RADIUS + 0.02;
        let sunk = depth(&level, &[([-1.0, -0.3, 0.3], [1.0, 0.5, seat])]);
        assert!((sunk - 0.02).abs() < 1e-3, "{sunk}");
    }
}
