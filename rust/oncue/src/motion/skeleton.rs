//! The one skeleton that everything runs on: 22 joints, fixed offsets, box nodes B (LAMA, figure 3a).
//!
//! Rest pose: a T-pose on the floor, facing -Y, left hand at +X, all rotations the identity.
//! The long boxes have the size the paper's released constants give: legs 0.10 × 0.10 × 0.444 m,
//! arms 0.07 × 0.07 × 0.283 and 0.278 m.

use glam::Vec3;
use serde::{Deserialize, Serialize};

/// Joints of the unified skeleton.
pub const JOINT_COUNT: usize = 22;

/// The joints, parents before children; `as usize` indexes every per-joint array.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[repr(u8)]
pub enum Joint {
    /// The root: the pelvis.
    Hips,
    /// Lumbar spine.
    Spine,
    /// Lower chest.
    Spine1,
    /// Upper chest.
    Spine2,
    /// Neck.
    Neck,
    /// Head.
    Head,
    /// Left collar bone.
    LeftShoulder,
    /// Left upper arm, from the shoulder.
    LeftArm,
    /// Left forearm, from the elbow.
    LeftForeArm,
    /// Left hand, from the wrist.
    LeftHand,
    /// Right collar bone.
    RightShoulder,
    /// Right upper arm, from the shoulder.
    RightArm,
    /// Right forearm, from the elbow.
    RightForeArm,
    /// Right hand, from the wrist.
    RightHand,
    /// Left thigh, from the hip.
    LeftUpLeg,
    /// Left shin, from the knee.
    LeftLeg,
    /// Left foot, from the ankle.
    LeftFoot,
    /// Left toes, from the ball of the foot.
    LeftToe,
    /// Right thigh, from the hip.
    RightUpLeg,
    /// Right shin, from the knee.
    RightLeg,
    /// Right foot, from the ankle.
    RightFoot,
    /// Right toes, from the ball of the foot.
    RightToe,
}

use Joint::*;

impl Joint {
    /// Every joint, parents before children.
    pub const ALL: [Joint; JOINT_COUNT] = [
        Hips,
        Spine,
        Spine1,
        Spine2,
        Neck,
        Head,
        LeftShoulder,
        LeftArm,
        LeftForeArm,
        LeftHand,
        RightShoulder,
        RightArm,
        RightForeArm,
        RightHand,
        LeftUpLeg,
        LeftLeg,
        LeftFoot,
        LeftToe,
        RightUpLeg,
        RightLeg,
        RightFoot,
        RightToe,
    ];

    /// The toes, left then right: the points whose contact is kept.
    pub const TOES: [Joint; 2] = [LeftToe, RightToe];
    /// Left and right foot.
    pub const FEET: [Joint; 2] = [LeftFoot, RightFoot];
    /// Left and right hand.
    pub const HANDS: [Joint; 2] = [LeftHand, RightHand];

    /// Its place in [`Joint::ALL`], and in every array of joints.
    pub const fn index(self) -> usize {
        self as usize
    }

    /// `None` for the root.
    pub fn parent(self) -> Option<Joint> {
        let p = PARENT[self.index()];
        (p != usize::MAX).then(|| Joint::ALL[p])
    }

    /// Its name, as in [`NAMES`].
    pub fn name(self) -> &'static str {
        NAMES[self.index()]
    }

    /// The same joint on the other side; joints of the middle are their own mirror.
    pub fn mirrored(self) -> Joint {
        Joint::ALL[MIRROR[self.index()]]
    }
}

/// Joint names, as Blender's bones and the reports show them.
pub const NAMES: [&str; JOINT_COUNT] = [
    "Hips",
    "Spine",
    "Spine1",
    "Spine2",
    "Neck",
    "Head",
    "LeftShoulder",
    "LeftArm",
    "LeftForeArm",
    "LeftHand",
    "RightShoulder",
    "RightArm",
    "RightForeArm",
    "RightHand",
    "LeftUpLeg",
    "LeftLeg",
    "LeftFoot",
    "LeftToe",
    "RightUpLeg",
    "RightLeg",
    "RightFoot",
    "RightToe",
];

/// Index of each joint's parent; `usize::MAX` for the root.
pub const PARENT: [usize; JOINT_COUNT] =
    [usize::MAX, 0, 1, 2, 3, 4, 3, 6, 7, 8, 3, 10, 11, 12, 0, 14, 15, 16, 0, 18, 19, 20];

/// Collar bone, upper arm, forearm and hand of each side.
pub(crate) const ARMS: [[Joint; 4]; 2] = [
    [Joint::LeftShoulder, Joint::LeftArm, Joint::LeftForeArm, Joint::LeftHand],
    [Joint::RightShoulder, Joint::RightArm, Joint::RightForeArm, Joint::RightHand],
];

/// Index of each joint's mirror image.
pub const MIRROR: [usize; JOINT_COUNT] =
    [0, 1, 2, 3, 4, 5, 10, 11, 12, 13, 6, 7, 8, 9, 18, 19, 20, 21, 14, 15, 16, 17];

/// Height of the root over the floor in the rest pose, metres.
pub const REST_HIPS_HEIGHT: f32 = 0.993;

/// Height of the pelvis joint over the seat that a person sits on, metres.
pub const SEATED_HIPS_HEIGHT: f32 = 0.10;
/// The same over the floor for a person who stands at ease or has just stopped, metres: knees are never quite straight.
pub const STANDING_HIPS_HEIGHT: f32 = 0.93;

/// Length of a thigh and of a shin, metres.
pub const LEG_LENGTH: f32 = 0.444;

/// Joint offsets: from the parent's joint to this joint, in the parent's frame, metres. The root's is its rest height.
pub const JOINT_OFFSET: [Vec3; JOINT_COUNT] = [
    Vec3::new(0.0, 0.0, REST_HIPS_HEIGHT),
    Vec3::new(0.0, 0.01, 0.10),
    Vec3::new(0.0, 0.01, 0.13),
    Vec3::new(0.0, 0.0, 0.13),
    Vec3::new(0.0, 0.0, 0.17),
    Vec3::new(0.0, -0.02, 0.10),
    Vec3::new(0.03, 0.0, 0.125),
    Vec3::new(0.145, 0.0, 0.0),
    Vec3::new(0.283, 0.0, 0.0),
    Vec3::new(0.278, 0.0, 0.0),
    Vec3::new(-0.03, 0.0, 0.125),
    Vec3::new(-0.145, 0.0, 0.0),
    Vec3::new(-0.283, 0.0, 0.0),
    Vec3::new(-0.278, 0.0, 0.0),
    Vec3::new(0.095, 0.0, -0.02),
    Vec3::new(0.0, 0.0, -LEG_LENGTH),
    Vec3::new(0.0, 0.0, -LEG_LENGTH),
    Vec3::new(0.0, -0.13, -0.060),
    Vec3::new(-0.095, 0.0, -0.02),
    Vec3::new(0.0, 0.0, -LEG_LENGTH),
    Vec3::new(0.0, 0.0, -LEG_LENGTH),
    Vec3::new(0.0, -0.13, -0.060),
];

/// Where a hand holds what it holds: the middle of the grip before the palm, in the frame of the left hand's joint (the
/// wrist), metres. The palm faces down in the rest pose; the right hand's is the mirror image.
pub const LEFT_PALM: Vec3 = Vec3::new(0.08, 0.0, -0.02);

/// The same of a hand's joint; zero for every other joint.
pub fn palm(joint: Joint) -> Vec3 {
    match joint {
        LeftHand => LEFT_PALM,
        RightHand => LEFT_PALM * Vec3::new(-1.0, 1.0, 1.0),
        _ => Vec3::ZERO,
    }
}

/// Height of the ankle (Foot) joint over the sole, metres.
pub const ANKLE_HEIGHT: f32 = 0.085;
/// Height of the ball of the foot (Toe joint) over the sole, metres.
pub const TOE_HEIGHT: f32 = 0.025;
/// From the Toe joint to the tip of the toes, along -Y in the toe's frame, metres.
pub const TOE_LENGTH: f32 = 0.07;
/// From the Foot joint to the heel, along +Y in the foot's frame, metres.
pub const HEEL_LENGTH: f32 = 0.06;

/// What a box node belongs to, for the weights w_b and the penetration figures.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Limb {
    /// Thighs and shins.
    Leg,
    /// Upper arms and forearms.
    Arm,
    /// Feet.
    Foot,
    /// Pelvis and trunk.
    Torso,
    /// Head.
    Head,
}

/// A box node b ∈ B: a box that moves with a joint. Axis-aligned in the joint's rest frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BoxNode {
    /// What it is a part of.
    pub limb: Limb,
    /// The joint that carries it.
    pub joint: Joint,
    /// In the joint's frame, metres.
    pub center: Vec3,
    /// Half of its size along its own axes, metres.
    pub half_extents: Vec3,
}

impl BoxNode {
    /// Whether a seat carries it: pelvis and thighs.
    pub fn is_carried(&self) -> bool {
        matches!(self.joint, Hips | LeftUpLeg | RightUpLeg)
    }
}

const fn node(limb: Limb, joint: Joint, center: [f32; 3], half: [f32; 3]) -> BoxNode {
    BoxNode { limb, joint, center: Vec3::from_array(center), half_extents: Vec3::from_array(half) }
}

/// The whole body. The first [`LIMB_BOX_COUNT`] (legs, then arms) are the B of the paper's r_coli;
/// the rest (feet, torso, head) it leaves out, and we count them in the whole-body figure.
pub const BODY_BOXES: [BoxNode; 13] = [
    node(Limb::Leg, LeftUpLeg, [0.0, 0.0, -0.222], [0.05, 0.05, 0.222]),
    node(Limb::Leg, LeftLeg, [0.0, 0.0, -0.222], [0.05, 0.05, 0.222]),
    node(Limb::Leg, RightUpLeg, [0.0, 0.0, -0.222], [0.05, 0.05, 0.222]),
    node(Limb::Leg, RightLeg, [0.0, 0.0, -0.222], [0.05, 0.05, 0.222]),
    node(Limb::Arm, LeftArm, [0.1415, 0.0, 0.0], [0.1415, 0.035, 0.035]),
    node(Limb::Arm, LeftForeArm, [0.139, 0.0, 0.0], [0.139, 0.035, 0.035]),
    node(Limb::Arm, RightArm, [-0.1415, 0.0, 0.0], [0.1415, 0.035, 0.035]),
    node(Limb::Arm, RightForeArm, [-0.139, 0.0, 0.0], [0.139, 0.035, 0.035]),
    node(Limb::Foot, LeftFoot, [0.0, -0.06, -0.045], [0.0385, 0.12, 0.035]),
    node(Limb::Foot, RightFoot, [0.0, -0.06, -0.045], [0.0385, 0.12, 0.035]),
    node(Limb::Torso, Spine1, [0.0, 0.0, 0.10], [0.14, 0.08, 0.24]),
    node(Limb::Torso, Hips, [0.0, 0.0, 0.04], [0.14, 0.08, 0.07]),
    node(Limb::Head, Head, [0.0, -0.01, 0.09], [0.08, 0.10, 0.12]),
];

/// How many of [`BODY_BOXES`] are legs and arms.
pub const LIMB_BOX_COUNT: usize = 8;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_agree() {
        for joint in Joint::ALL {
            assert_eq!(Joint::ALL[joint.index()], joint);
            assert_eq!(joint.mirrored().mirrored(), joint);
            let (a, b) = (JOINT_OFFSET[joint.index()], JOINT_OFFSET[joint.mirrored().index()]);
            assert_eq!(a * Vec3::new(-1.0, 1.0, 1.0), b);
            if let Some(parent) = joint.parent() {
                assert!(parent < joint);
            }
        }
        assert!(BODY_BOXES[..LIMB_BOX_COUNT].iter().all(|b| matches!(b.limb, Limb::Leg | Limb::Arm)));
    }

    #[test]
    fn rest_pose_stands_on_the_floor() {
        let ankle = REST_HIPS_HEIGHT - 0.02 - 2.0 * LEG_LENGTH;
        assert!((ankle - ANKLE_HEIGHT).abs() < 1e-5);
        assert!((ankle + JOINT_OFFSET[LeftToe.index()].z - TOE_HEIGHT).abs() < 1e-5);
    }
}
