//! The body as capsules: its girth, and how far its surface gives.
//!
//! Girths are the mannequin's (`addon/body_shape.py`), whose widths follow the 50th percentile of adult men and women. Trunk
//! and pelvis are wider than deep: two capsules side by side.

use std::sync::LazyLock;

use glam::Vec3;
use serde::{Deserialize, Serialize};

use crate::math::capsule::Capsule;
use crate::motion::{Joint, Pose};

/// A part of the body that can be seen to run into something.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[allow(missing_docs)] // Their names say it.
pub enum BodyPart {
    Head,
    Pelvis,
    Trunk,
    LeftUpperArm,
    RightUpperArm,
    LeftForearm,
    RightForearm,
    LeftHand,
    RightHand,
    LeftThigh,
    RightThigh,
    LeftShin,
    RightShin,
    LeftFoot,
    RightFoot,
}

use BodyPart::*;

impl BodyPart {
    /// How far flesh, clothes and fingers give where the part is pressed, metres. Chosen so that captures put on the one
    /// skeleton, whose limbs are not the captured person's, are all but free of depth.
    pub(crate) fn gives(self) -> f32 {
        match self {
            Pelvis | Trunk => 0.020,
            LeftUpperArm | RightUpperArm | LeftThigh | RightThigh | LeftHand | RightHand => 0.015,
            Head | LeftForearm | RightForearm => 0.010,
            LeftShin | RightShin | LeftFoot | RightFoot => 0.005,
        }
    }

    /// −1 on the left, 1 on the right, 0 in the middle.
    pub(crate) fn side(self) -> i32 {
        match self {
            Head | Pelvis | Trunk => 0,
            LeftUpperArm | LeftForearm | LeftHand | LeftThigh | LeftShin | LeftFoot => -1,
            _ => 1,
        }
    }

    /// Whether it hangs from a shoulder.
    pub(crate) fn is_arm(self) -> bool {
        (LeftUpperArm..=RightHand).contains(&self)
    }

    /// The part at whose end this one begins, of an arm or a leg.
    pub(crate) fn hangs_from(self) -> Option<BodyPart> {
        Some(match self {
            LeftForearm => LeftUpperArm,
            RightForearm => RightUpperArm,
            LeftHand => LeftForearm,
            RightHand => RightForearm,
            LeftShin => LeftThigh,
            RightShin => RightThigh,
            _ => return None,
        })
    }

    /// Whether a seat carries it.
    pub(crate) fn is_carried(self) -> bool {
        matches!(self, Pelvis | LeftThigh | RightThigh)
    }
}

/// A capsule that moves with a joint; in the joint's frame, metres.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PartShape {
    pub part: BodyPart,
    pub joint: Joint,
    pub capsule: Capsule,
}

/// All capsules of the body.
pub(crate) const SHAPE_COUNT: usize = 19;

pub(crate) static SHAPES: LazyLock<[PartShape; SHAPE_COUNT]> = LazyLock::new(|| {
    use Joint as J;
    let one = |part, joint, from: [f32; 3], to: [f32; 3], radii| PartShape {
        part,
        joint,
        capsule: Capsule { ends: [Vec3::from(from), Vec3::from(to)], radii },
    };
    let pelvis =
        |s: f32| one(Pelvis, J::Hips, [s * 0.044, 0.013, -0.02], [s * 0.041, 0.012, 0.08], [0.115, 0.105]);
    let waist =
        |s: f32| one(Trunk, J::Spine1, [s * 0.038, -0.011, -0.11], [s * 0.042, -0.011, 0.06], [0.097, 0.106]);
    let chest =
        |s: f32| one(Trunk, J::Spine2, [s * 0.045, -0.013, -0.05], [s * 0.055, -0.008, 0.09], [0.112, 0.108]);
    let arm = |s: f32, part, joint, from: f32, to: f32, sinks: f32, radii| {
        one(part, joint, [s * from, 0.0, 0.0], [s * to, 0.0, -sinks], radii)
    };
    let leg =
        |part, joint, from: f32, to: f32, radii| one(part, joint, [0.0, 0.0, -from], [0.0, 0.0, -to], radii);
    let foot = |part, joint| one(part, joint, [0.0, 0.03, -0.045], [0.0, -0.13, -0.055], [0.035, 0.030]);
    [
        one(Head, J::Head, [0.0, -0.01, 0.02], [0.0, -0.01, 0.10], [0.075, 0.070]),
        pelvis(-1.0),
        pelvis(1.0),
        waist(-1.0),
        waist(1.0),
        chest(-1.0),
        chest(1.0),
        // The half at the shoulder lies in the armpit, the quarter at the hip in the groin.
        arm(1.0, LeftUpperArm, J::LeftArm, 0.1415, 0.283, 0.0, [0.046, 0.038]),
        arm(-1.0, RightUpperArm, J::RightArm, 0.1415, 0.283, 0.0, [0.046, 0.038]),
        arm(1.0, LeftForearm, J::LeftForeArm, 0.0, 0.278, 0.0, [0.039, 0.028]),
        arm(-1.0, RightForearm, J::RightForeArm, 0.0, 0.278, 0.0, [0.039, 0.028]),
        arm(1.0, LeftHand, J::LeftHand, 0.0, 0.15, 0.02, [0.020, 0.016]),
        arm(-1.0, RightHand, J::RightHand, 0.0, 0.15, 0.02, [0.020, 0.016]),
        leg(LeftThigh, J::LeftUpLeg, 0.111, 0.444, [0.072, 0.052]),
        leg(RightThigh, J::RightUpLeg, 0.111, 0.444, [0.072, 0.052]),
        leg(LeftShin, J::LeftLeg, 0.0, 0.444, [0.052, 0.034]),
        leg(RightShin, J::RightLeg, 0.0, 0.444, [0.052, 0.034]),
        foot(LeftFoot, J::LeftFoot),
        foot(RightFoot, J::RightFoot),
    ]
});

/// What [`body_capsules`] gives.
pub(crate) type BodyCapsules = [(BodyPart, Capsule); SHAPE_COUNT];

/// The capsules of a posed body in the world, with the parts that they belong to.
pub fn body_capsules(pose: &Pose) -> [(BodyPart, Capsule); SHAPE_COUNT] {
    SHAPES.each_ref().map(|shape| {
        let ends = shape.capsule.ends.map(|end| pose.point(shape.joint, end));
        (shape.part, Capsule { ends, radii: shape.capsule.radii })
    })
}

/// Half-way between the bodies of two frames. A limb that is beside another in both may be in it there: feet swing past shins, and
/// hands past thighs, farther from frame to frame than these are thick.
pub(crate) fn half_way(one: &BodyCapsules, other: &BodyCapsules) -> BodyCapsules {
    std::array::from_fn(|i| {
        let ((part, one), (_, other)) = (one[i], other[i]);
        let ends = [0, 1].map(|end| 0.5 * (one.ends[end] + other.ends[end]));
        (part, Capsule { ends, ..one })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::Posture;

    #[test]
    fn the_body_is_its_own_mirror_image_and_stands_on_the_floor() {
        let capsules = body_capsules(&Posture::default().pose());
        let mirror = Vec3::new(-1.0, 1.0, 1.0);
        for (part, capsule) in &capsules {
            let twin = capsules.iter().any(|(other, twin)| {
                other.side() == -part.side()
                    && twin.radii == capsule.radii
                    && (0..2).all(|i| twin.ends[i].distance(capsule.ends[i] * mirror) < 1e-6)
            });
            assert!(twin, "{part:?}");
        }
        let lowest =
            |(_, c): &(BodyPart, Capsule)| (0..2).map(|i| c.ends[i].z - c.radii[i]).fold(9.0, f32::min);
        let sole = capsules.iter().map(lowest).fold(9.0, f32::min);
        assert!(sole.abs() < 0.006, "{sole}");
    }
}
