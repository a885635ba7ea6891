//! How far people's joints go.
//!
//! The ranges are the project's own. They lean on surveys with a goniometer and are widened by hand where captured motion of
//! everyday actions would lie beyond them, so that no number here is to be quoted as a survey's: active ranges of men (Boone and Azen 1979, J Bone
//! Joint Surg 61-A:756), of both sexes (Watanabe et al. 1979; AAOS 1994, as collected by Norkin and White, *Measurement of
//! Joint Motion*, appendix A), of neck (Youdas et al. 1992) and trunk (AAOS 1994). Each is meant to be
//! wider than most people's.

use glam::{Quat, Vec3};
use serde::{Deserialize, Serialize};

use crate::motion::{Joint, Posture};

/// A way in which a joint can be turned too far.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LimitedTurn {
    /// A hinge is bent through.
    Flexion,
    /// A hinge is bent backwards.
    Hyperextension,
    /// A hinge is bent out of its plane.
    Sideways,
    /// A bone points out of its cone.
    Swing,
    /// A bone is turned about itself.
    Twist,
}

/// A bone that bends in one plane. Degrees.
struct Hinge {
    flexion: f32,
    hyperextension: f32,
    /// The carrying angle of elbows, and what shows of a knee's own turn.
    sideways: f32,
}

/// Boone and Azen find 143 and 0.6, Watanabe 148–158; carrying angles are up to 15°.
const ELBOW: Hinge = Hinge { flexion: 158.0, hyperextension: 5.0, sideways: 15.0 };
/// Boone and Azen find 142 standing; on one's heels it is 160.
const KNEE: Hinge = Hinge { flexion: 160.0, hyperextension: 5.0, sideways: 10.0 };

/// Where a bone may point about an axis: half-angles at even steps of azimuth, from `across` towards `axis × across`; and how
/// far it may be turned about itself from rest, least and most. Degrees.
struct Cone<const N: usize> {
    axis: Vec3,
    across: Vec3,
    half: [f32; N],
    twist: (f32, f32),
}

impl<const N: usize> Cone<N> {
    /// How far a direction is outside, degrees.
    fn beyond(&self, direction: Vec3) -> f32 {
        let angle = direction.angle_between(self.axis).to_degrees();
        let up = self.axis.cross(self.across);
        let azimuth = direction.dot(up).atan2(direction.dot(self.across)).to_degrees().rem_euclid(360.0);
        let step = azimuth * N as f32 / 360.0;
        let (i, part) = (step as usize % N, step.fract());
        angle - (self.half[i] + (self.half[(i + 1) % N] - self.half[i]) * part)
    }

    fn twisted(&self, twist: f32) -> f32 {
        (twist - self.twist.1).max(self.twist.0 - twist)
    }
}

/// Left upper arm in the chest's frame, collar bone included: about a line 47° before straight out. From backwards in steps
/// of 45° by upwards: flexion 180, extension 78, abduction 187, horizontal flexion 141 and extension 57 (Boone and Azen,
/// mean and two standard deviations), across the trunk. Twist: medial 96, lateral 121.
const SHOULDER: Cone<8> = Cone {
    axis: Vec3::new(0.682, -0.731, 0.0),
    across: Vec3::new(0.731, 0.682, 0.0),
    half: [108.0, 100.0, 98.0, 100.0, 105.0, 110.0, 110.0, 138.0],
    twist: (-121.0, 96.0),
};
/// Left hand in the forearm's frame, palm down, thumb forwards: ulnar 40, extension 85, radial 25, flexion 90, in steps of 90°
/// from the little finger's side by upwards; sideways ten more, by which files differ in what they call straight. The twist of
/// forearm and hand is one.
const WRIST: Cone<4> =
    Cone { axis: Vec3::X, across: Vec3::Y, half: [50.0, 85.0, 35.0, 90.0], twist: (-360.0, 360.0) };
/// Forearm and hand together: pronation 90, supination 93, from the thumb upwards or from the palm down, as files have it.
const FOREARM_TWIST: f32 = 93.0;
/// Left thigh in the pelvis's frame, from outwards in steps of 90° by forwards: abduction 55, flexion 135, adduction 35,
/// extension 30. Twist: medial 52, lateral 52.
const HIP: Cone<4> =
    Cone { axis: Vec3::NEG_Z, across: Vec3::X, half: [55.0, 135.0, 35.0, 30.0], twist: (-52.0, 52.0) };
/// Chest over pelvis, from the left side in steps of 90° by backwards: sideways 40, back 30, forwards 90. Twist 45.
const SPINE: Cone<4> =
    Cone { axis: Vec3::Z, across: Vec3::X, half: [40.0, 30.0, 40.0, 90.0], twist: (-45.0, 45.0) };
/// Head over chest, neck included: sideways 45, back 80, forwards 65. Twist 90.
const NECK: Cone<4> =
    Cone { axis: Vec3::Z, across: Vec3::X, half: [45.0, 80.0, 45.0, 65.0], twist: (-90.0, 90.0) };

/// Where `bone` points after a rotation, and the rotation's twist about it, degrees.
fn swing_and_twist(rotation: Quat, bone: Vec3) -> (Vec3, f32) {
    let along = Vec3::new(rotation.x, rotation.y, rotation.z).dot(bone);
    let twist = 2.0 * along.atan2(rotation.w).to_degrees();
    (rotation * bone, (twist + 180.0).rem_euclid(360.0) - 180.0)
}

/// How far an upper arm is beyond where arms go, degrees, negative within. `arm`: its rotation in the chest's frame, the collar
/// bone's included; side 0 is the left, 1 the right.
pub(crate) fn shoulder_beyond(side: usize, arm: Quat) -> f32 {
    let (bone, twist) = swing_and_twist(as_left(side, arm), Vec3::X);
    SHOULDER.beyond(bone).max(SHOULDER.twisted(twist))
}

/// How far a hand points beyond where wrists go, degrees, negative within. `hand`: its rotation in the forearm's frame.
pub(crate) fn wrist_beyond(side: usize, hand: Quat) -> f32 {
    WRIST.beyond(swing_and_twist(as_left(side, hand), Vec3::X).0)
}

/// The right side's rotations as their mirror images.
fn as_left(side: usize, rotation: Quat) -> Quat {
    if side == 0 { rotation } else { Quat::from_xyzw(rotation.x, -rotation.y, -rotation.z, rotation.w) }
}

/// Where elbows are bent easily to, degrees of flexion: what changes an arm bends it no further.
pub(crate) const EASY_ELBOW: (f32, f32) = (8.0, 145.0);

/// How far an elbow is bent, degrees. `forearm`: its rotation in the upper arm's frame.
pub(crate) fn elbow_flexion(side: usize, forearm: Quat) -> f32 {
    let bone = forearm * if side == 0 { Vec3::X } else { Vec3::NEG_X };
    (-bone.y).atan2(if side == 0 { bone.x } else { -bone.x }).to_degrees()
}

/// How far an elbow is bent out of its plane beyond what elbows are, degrees, negative within. `forearm`: its rotation in the upper
/// arm's frame.
pub(crate) fn elbow_beyond(forearm: Quat) -> f32 {
    let aside = (forearm * Vec3::X).z;
    aside.abs().min(1.0).asin().to_degrees() - ELBOW.sideways
}

/// How far the joints of a posture are beyond their limits, degrees; negative within.
pub(crate) fn beyond_limits(posture: &Posture) -> [(Joint, LimitedTurn, f32); 28] {
    use Joint::*;
    use LimitedTurn::*;
    // The right side as the left one's mirror image.
    let mirrored = posture.mirrored();
    let mut out = [(Hips, Swing, f32::NEG_INFINITY); 28];
    let mut next = out.iter_mut();
    let mut tell = |joint, turn, degrees| {
        if let Some(slot) = next.next() {
            *slot = (joint, turn, degrees);
        }
    };
    for (side, posture) in [posture, &mirrored].into_iter().enumerate() {
        let of = |joint: Joint| posture.rotations[joint.index()];
        let named = |joint: Joint| if side == 0 { joint } else { joint.mirrored() };
        let mut cone_of = |joint, (swing, twist)| {
            tell(named(joint), Swing, swing);
            tell(named(joint), Twist, twist);
        };
        let (arm, twist) = swing_and_twist(of(LeftShoulder) * of(LeftArm), Vec3::X);
        cone_of(LeftArm, (SHOULDER.beyond(arm), SHOULDER.twisted(twist)));
        let (thigh, twist) = swing_and_twist(of(LeftUpLeg), Vec3::NEG_Z);
        cone_of(LeftUpLeg, (HIP.beyond(thigh), HIP.twisted(twist)));
        let (forearm, pronation) = swing_and_twist(of(LeftForeArm), Vec3::X);
        let (hand, more) = swing_and_twist(of(LeftHand), Vec3::X);
        cone_of(LeftHand, (WRIST.beyond(hand), (pronation + more).abs() - FOREARM_TWIST));
        let (shin, _) = swing_and_twist(of(LeftLeg), Vec3::NEG_Z);
        let mut hinge = |joint, limits: &Hinge, straight: f32, forwards: f32, aside: f32| {
            let flexion = forwards.atan2(straight).to_degrees();
            // Bent through by more than half a turn is bent backwards.
            tell(named(joint), Flexion, flexion - limits.flexion);
            tell(named(joint), Hyperextension, -flexion - limits.hyperextension);
            tell(named(joint), Sideways, aside.abs().min(1.0).asin().to_degrees() - limits.sideways);
        };
        hinge(LeftForeArm, &ELBOW, forearm.x, -forearm.y, forearm.z);
        hinge(LeftLeg, &KNEE, -shin.z, shin.y, shin.x);
    }
    let of = |joint: Joint| posture.rotations[joint.index()];
    let mut middle = |joint, rotation, cone: &Cone<4>| {
        let (up, twist) = swing_and_twist(rotation, Vec3::Z);
        tell(joint, Swing, cone.beyond(up));
        tell(joint, Twist, cone.twisted(twist));
    };
    middle(Spine2, of(Spine) * of(Spine1) * of(Spine2), &SPINE);
    middle(Head, of(Neck) * of(Head), &NECK);
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn turned(joint: Joint, axis: Vec3, degrees: f32) -> Posture {
        let mut posture = Posture::default();
        posture.rotations[joint.index()] = Quat::from_axis_angle(axis, degrees.to_radians());
        posture
    }

    /// What is beyond its limit at all, and by how much.
    fn found(posture: &Posture) -> Vec<(Joint, LimitedTurn, i32)> {
        let beyond = beyond_limits(posture);
        assert!(beyond.iter().all(|b| b.2.is_finite()));
        beyond.into_iter().filter(|b| b.2 > 0.0).map(|(j, t, d)| (j, t, d.round() as i32)).collect()
    }

    #[test]
    fn hinges_by_hand() {
        use Joint::*;
        use LimitedTurn::*;
        assert_eq!(found(&Posture::default()), []);
        // Palms down, arms out: elbows bend forwards, about −Z on the left and +Z on the right.
        assert_eq!(found(&turned(LeftForeArm, Vec3::Z, -150.0)), []);
        assert_eq!(found(&turned(LeftForeArm, Vec3::Z, -170.0)), [(LeftForeArm, Flexion, 12)]);
        assert_eq!(found(&turned(LeftForeArm, Vec3::Z, 35.0)), [(LeftForeArm, Hyperextension, 30)]);
        assert_eq!(found(&turned(RightForeArm, Vec3::Z, -35.0)), [(RightForeArm, Hyperextension, 30)]);
        assert_eq!(found(&turned(RightForeArm, Vec3::Y, 40.0)), [(RightForeArm, Sideways, 25)]);
        // A knee bends backwards about +X.
        assert_eq!(found(&turned(LeftLeg, Vec3::X, 140.0)), []);
        assert_eq!(found(&turned(RightLeg, Vec3::X, -15.0)), [(RightLeg, Hyperextension, 10)]);
        assert_eq!(found(&turned(LeftLeg, Vec3::Y, 30.0)), [(LeftLeg, Sideways, 20)]);
    }

    #[test]
    fn cones_by_hand() {
        use Joint::*;
        use LimitedTurn::*;
        // A thigh is raised forwards about −X, drawn back about +X, spread outwards about −Y on the left.
        assert_eq!(found(&turned(LeftUpLeg, Vec3::X, -130.0)), []);
        assert_eq!(found(&turned(LeftUpLeg, Vec3::X, 50.0)), [(LeftUpLeg, Swing, 20)]);
        assert_eq!(found(&turned(LeftUpLeg, Vec3::Y, -75.0)), [(LeftUpLeg, Swing, 20)]);
        assert_eq!(found(&turned(RightUpLeg, Vec3::Z, 70.0)), [(RightUpLeg, Twist, 18)]);
        // The head: forwards about +X, back about −X, to look about Z.
        assert_eq!(found(&turned(Head, Vec3::X, 85.0)), [(Head, Swing, 20)]);
        assert_eq!(found(&turned(Neck, Vec3::X, -100.0)), [(Head, Swing, 20)]);
        assert_eq!(found(&turned(Head, Vec3::Z, -120.0)), [(Head, Twist, 30)]);
        assert_eq!(found(&turned(Spine1, Vec3::Y, 60.0)), [(Spine2, Swing, 20)]);
        // A hand bends down about +Y on the left; pronation of forearm and hand adds up.
        assert_eq!(found(&turned(LeftHand, Vec3::Y, 110.0)), [(LeftHand, Swing, 20)]);
        let mut posture = turned(RightHand, Vec3::X, 60.0);
        posture.rotations[RightForeArm.index()] = Quat::from_rotation_x(50f32.to_radians());
        assert_eq!(found(&posture), [(RightHand, Twist, 17)]);
    }

    #[test]
    fn single_joints_are_as_the_whole_posture_says() {
        use Joint::*;
        let mut posture = turned(LeftArm, Vec3::Z, 100.0);
        posture.rotations[RightArm.index()] = Quat::from_rotation_z(-100f32.to_radians());
        posture.rotations[LeftForeArm.index()] = Quat::from_rotation_z(-0.5);
        posture.rotations[RightForeArm.index()] = Quat::from_rotation_z(0.5);
        let of = |joint: Joint| posture.rotations[joint.index()];
        let all = beyond_limits(&posture);
        for (side, arm, forearm) in [(0, LeftArm, LeftForeArm), (1, RightArm, RightForeArm)] {
            let most = all.iter().filter(|b| b.0 == arm).map(|b| b.2).fold(f32::NEG_INFINITY, f32::max);
            assert!(most > 5.0 && (shoulder_beyond(side, of(arm)) - most).abs() < 1e-3, "{side}: {most}");
            assert!((elbow_flexion(side, of(forearm)) - 0.5f32.to_degrees()).abs() < 1e-3);
            assert!((elbow_beyond(of(forearm)) + ELBOW.sideways).abs() < 1e-3);
            let aside = turned(forearm, Vec3::Y, 40.0);
            assert!((elbow_beyond(aside.rotations[forearm.index()]) - 25.0).abs() < 1e-3);
        }
    }

    #[test]
    fn an_arm_reaches_where_arms_reach() {
        // Hanging, up, forwards, across, drawn back by 60°: within. Straight back, level: not.
        let pointing = |direction: Vec3| {
            let mut posture = Posture::default();
            posture.rotations[Joint::LeftArm.index()] =
                Quat::from_rotation_arc(Vec3::X, direction.normalize());
            found(&posture).iter().any(|f| f.1 == LimitedTurn::Swing)
        };
        for within in [
            Vec3::NEG_Z,
            Vec3::new(0.02, 0.0, 1.0),
            Vec3::NEG_Y,
            Vec3::new(-0.7, -0.7, 0.0),
            Vec3::new(0.05, 0.866, -0.5),
        ] {
            assert!(!pointing(within), "{within}");
        }
        for beyond in [
            Vec3::new(0.0, 1.0, 0.0),
            Vec3::new(-0.7, 0.7, 0.0),
            Vec3::new(-1.0, 0.0, 0.1),
            Vec3::new(0.0, 0.8, 0.6),
        ] {
            assert!(pointing(beyond), "{beyond}");
        }
    }
}
