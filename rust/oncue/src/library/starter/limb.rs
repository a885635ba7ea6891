//! Two-bone limbs in closed form.

use glam::{Mat3, Quat, Vec3};

use crate::math::capsule::Capsule;
use crate::motion::Joint;
use crate::motion::skeleton::{JOINT_OFFSET, LEG_LENGTH};

/// The longest reach of a leg: knee flexed by 7°. Straighter, a millimetre would turn the knee by degrees.
pub(super) const LEG_REACH: f32 = 2.0 * LEG_LENGTH * 0.99813;

const UPPER_ARM: f32 = JOINT_OFFSET[Joint::LeftForeArm as usize].x;
const FOREARM: f32 = JOINT_OFFSET[Joint::LeftHand as usize].x;

/// Upper arm and forearm together, metres.
pub(super) const ARM_LENGTH: f32 = UPPER_ARM + FOREARM;

/// World rotations of thigh and shin that put the ankle at `ankle`, with the knee towards `forward`.
///
/// Out of reach, the leg points at the ankle.
pub(super) fn leg(hip: Vec3, ankle: Vec3, forward: Vec3) -> (Quat, Quat) {
    let span = ankle - hip;
    let distance = span.length().clamp(0.15, LEG_REACH);
    let down = span.normalize_or(Vec3::NEG_Z);
    let ahead = (forward - down * forward.dot(down)).normalize_or(Vec3::NEG_Y);
    let bend = (LEG_LENGTH * LEG_LENGTH - 0.25 * distance * distance).max(0.0).sqrt();
    let hinge = ahead.cross(down);
    let bone = |direction: Vec3| {
        let z = -direction.normalize();
        Quat::from_mat3(&Mat3::from_cols(hinge, z.cross(hinge), z))
    };
    let thigh = down * (0.5 * distance) + ahead * bend;
    (bone(thigh), bone(down * distance - thigh))
}

/// A posed leg: its joints and rotations in the world.
#[derive(Debug, Clone, Copy)]
pub(super) struct Leg {
    pub hip: Vec3,
    pub ankle: Vec3,
    pub thigh: Quat,
    pub shin: Quat,
    pub foot: Quat,
}

/// Radii of a thigh and of a shin, upper and lower end, and of a foot, metres: the mannequin's.
const THIGH: [f32; 2] = [0.067, 0.052];
const SHIN: [f32; 2] = [0.052, 0.034];
const FOOT: [f32; 2] = [0.035, 0.030];
/// The quarter of a thigh at the hip lies in the groin.
const GROIN: f32 = 0.25;

impl Leg {
    pub(super) fn knee(&self) -> Vec3 {
        self.hip + self.thigh * (Vec3::NEG_Z * LEG_LENGTH)
    }

    fn capsules(&self) -> [Capsule; 3] {
        let knee = self.knee();
        let heel = self.ankle + self.foot * Vec3::new(0.0, 0.03, -0.045);
        let ball = self.ankle + self.foot * Vec3::new(0.0, -0.13, -0.055);
        [
            Capsule { ends: [self.hip.lerp(knee, GROIN), knee], radii: THIGH },
            Capsule { ends: [knee, self.ankle], radii: SHIN },
            Capsule { ends: [heel, ball], radii: FOOT },
        ]
    }
}

/// How deep two legs are in one another, metres; negative is the gap between them.
pub(super) fn depth_between(legs: &[Leg; 2]) -> f32 {
    let [left, right] = legs.each_ref().map(Leg::capsules);
    let pairs = left.iter().flat_map(|one| right.iter().map(move |other| one.depth_in(other)));
    pairs.fold(f32::NEG_INFINITY, f32::max)
}

/// The trunk of a posed body: two capsules each of pelvis, waist and chest, the mannequin's, in the world.
pub(super) struct Trunk([Capsule; 6]);

impl Trunk {
    /// `joints`: place and rotation of hips, lower chest and upper chest.
    pub(super) fn new(joints: [(Vec3, Quat); 3]) -> Self {
        /// The left ones' ends in their joints' frames, and their radii.
        const ENDS: [[[f32; 3]; 2]; 3] = [
            [[0.044, 0.013, -0.02], [0.041, 0.012, 0.08]],
            [[0.038, -0.011, -0.11], [0.042, -0.011, 0.06]],
            [[0.045, -0.013, -0.05], [0.055, -0.008, 0.09]],
        ];
        const RADII: [[f32; 2]; 3] = [[0.115, 0.105], [0.097, 0.106], [0.112, 0.108]];
        Self(std::array::from_fn(|k| {
            let side = Vec3::new(if k % 2 == 0 { 1.0 } else { -1.0 }, 1.0, 1.0);
            let (at, turned) = joints[k / 2];
            let ends = ENDS[k / 2].map(|end| at + turned * (Vec3::from(end) * side));
            Capsule { ends, radii: RADII[k / 2] }
        }))
    }

    /// How deep an arm is in the trunk beyond what flesh gives, metres; negative is the gap between them. The half of the
    /// upper arm at the shoulder lies in the armpit.
    pub(super) fn depth_of(&self, arm: &Arm) -> f32 {
        const GIVES: [f32; 3] = [0.035, 0.030, 0.035];
        let elbow = arm.shoulder + arm.upper * JOINT_OFFSET[arm.joint(0)];
        let wrist = elbow + arm.lower * JOINT_OFFSET[arm.joint(1)];
        let tip = wrist + arm.hand * Vec3::new(0.15 * arm.sign, 0.0, -0.02);
        let parts = [
            Capsule { ends: [arm.shoulder.lerp(elbow, 0.5), elbow], radii: [0.046, 0.038] },
            Capsule { ends: [elbow, wrist], radii: [0.039, 0.028] },
            Capsule { ends: [wrist, tip], radii: [0.020, 0.016] },
        ];
        let pairs = parts
            .iter()
            .zip(GIVES)
            .flat_map(|(part, gives)| self.0.iter().map(move |trunk| part.depth_in(trunk) - gives));
        pairs.fold(f32::NEG_INFINITY, f32::max)
    }
}

/// A posed arm: its shoulder joint and rotations in the world. `sign`: 1 left, -1 right.
#[derive(Debug, Clone, Copy)]
pub(super) struct Arm {
    pub sign: f32,
    pub shoulder: Vec3,
    pub clavicle: Quat,
    pub upper: Quat,
    pub lower: Quat,
    pub hand: Quat,
}

impl Arm {
    /// Forearm (0) or hand (1) of its side.
    fn joint(&self, which: usize) -> usize {
        let joints = if self.sign > 0.0 {
            [Joint::LeftForeArm, Joint::LeftHand]
        } else {
            [Joint::RightForeArm, Joint::RightHand]
        };
        joints[which].index()
    }
}

/// World rotations of upper arm and forearm (`sign` 1 left, -1 right) that put the wrist at `wrist`, elbow towards `elbow`.
pub(super) fn arm(sign: f32, shoulder: Vec3, wrist: Vec3, elbow: Vec3) -> (Quat, Quat) {
    let span = wrist - shoulder;
    let distance = span.length().clamp(0.12, 0.995 * (UPPER_ARM + FOREARM));
    let along = span.normalize_or(Vec3::NEG_Z);
    let out = (elbow - along * elbow.dot(along)).normalize_or(Vec3::Y);
    let near = (distance * distance + UPPER_ARM * UPPER_ARM - FOREARM * FOREARM) / (2.0 * distance);
    let bend = (UPPER_ARM * UPPER_ARM - near * near).max(0.0).sqrt();
    let hinge = along.cross(out) * sign;
    let bone = |direction: Vec3| {
        let x = direction.normalize() * sign;
        Quat::from_mat3(&Mat3::from_cols(x, hinge.cross(x), hinge))
    };
    let upper = along * near + out * bend;
    (bone(upper), bone(along * distance - upper))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn legs_side_by_side_have_the_gap_between_their_thighs() {
        let leg = |x: f32| Leg {
            hip: Vec3::new(x, 0.0, 0.97),
            ankle: Vec3::new(x, 0.0, 0.082),
            thigh: Quat::IDENTITY,
            shin: Quat::IDENTITY,
            foot: Quat::IDENTITY,
        };
        // Thickest where the groin ends.
        assert!((depth_between(&[leg(0.1), leg(-0.1)]) - (2.0 * THIGH[0] - 0.2)).abs() < 1e-5);
        assert!(depth_between(&[leg(0.05), leg(-0.05)]) > 0.03);
    }

    proptest! {
        #[test]
        fn a_leg_reaches_its_ankle_with_a_hinge_at_the_knee(x in -0.3f32..0.3, y in -0.6f32..0.4, z in -0.85f32..-0.3) {
            let ankle = Vec3::new(x, y, z);
            prop_assume!(ankle.length() < LEG_REACH);
            let (thigh, shin) = leg(Vec3::ZERO, ankle, Vec3::NEG_Y);
            let bone = Vec3::NEG_Z * LEG_LENGTH;
            prop_assert!((thigh * bone + shin * bone).distance(ankle) < 1e-4);
            let knee = thigh.inverse() * shin;
            prop_assert!(knee.y.abs() < 1e-3 && knee.z.abs() < 1e-3 && knee.x * knee.w >= 0.0);
        }

        #[test]
        fn an_arm_reaches_its_wrist(x in -0.2f32..0.3, y in -0.35f32..0.1, z in -0.4f32..-0.2, left in any::<bool>()) {
            let sign = if left { 1.0 } else { -1.0 };
            let wrist = Vec3::new(x * sign, y, z);
            prop_assume!(wrist.length() < 0.99 * (UPPER_ARM + FOREARM));
            let (upper, lower) = arm(sign, Vec3::ZERO, wrist, Vec3::new(0.5 * sign, 0.8, 0.0));
            prop_assert!((upper * (Vec3::X * sign * UPPER_ARM) + lower * (Vec3::X * sign * FOREARM)).distance(wrist) < 1e-4);
            // The elbow bends forward: about +Z backwards on the left, forwards on the right.
            let elbow = upper.inverse() * lower;
            prop_assert!(elbow.x.abs() < 1e-3 && elbow.y.abs() < 1e-3 && elbow.z * elbow.w * sign <= 0.0);
        }
    }
}
