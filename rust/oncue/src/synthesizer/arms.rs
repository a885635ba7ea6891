//! The posture offset as arms can take it: shoulders turn and elbows bend, no further than people's and never into the own body.

use glam::{Quat, Vec3};

use super::{OFFSET_JOINTS, PostureOffset};
use crate::anatomy::{EASY_ELBOW, arm_depth, elbow_flexion, shoulder_beyond};
use crate::math::rotation::from_angle_axis;
use crate::motion::skeleton::ARMS;
use crate::motion::{Joint, Pose, Posture};

/// Halvings of the share of an offset that an arm can take: to less than a hundredth of it.
const HALVINGS: usize = 7;
/// What is deeper or farther by less is no worse, metres and degrees.
const NO_DEEPER: f32 = 1e-4;
const NO_FARTHER: f32 = 1e-2;

/// Turns the arms of a posture by an offset as far as they go, and gives by what each of [`OFFSET_JOINTS`] was turned.
///
/// Of an elbow's three numbers only the one about its hinge counts. Where the whole offset would turn a shoulder beyond its
/// limit, or the arm deeper into the own body than the clip has it, a share of it is taken: the largest that does not.
pub(super) fn turn(
    posture: &mut Posture,
    pose: &mut Pose,
    offset: &PostureOffset,
) -> [Quat; OFFSET_JOINTS.len()] {
    let mut turns = [Quat::IDENTITY; OFFSET_JOINTS.len()];
    for side in 0..2 {
        let own = [offset[2 * side], offset[2 * side + 1]];
        if own != [Vec3::ZERO; 2] {
            turns[2 * side..2 * side + 2].copy_from_slice(&turn_arm(side, posture, pose, own));
        }
    }
    turns
}

fn turn_arm(side: usize, posture: &mut Posture, pose: &mut Pose, offset: [Vec3; 2]) -> [Quat; 2] {
    let [collar_bone, arm, forearm, hand] = ARMS[side].map(Joint::index);
    let clip = [posture.rotations[arm], posture.rotations[forearm]];
    let hinge = if side == 0 { Vec3::NEG_Z } else { Vec3::Z };
    let flexion = elbow_flexion(side, clip[1]);
    let (straight, bent) = (EASY_ELBOW.0.min(flexion), EASY_ELBOW.1.max(flexion));
    let wanted = flexion + offset[1].dot(hinge).to_degrees();
    let bend = hinge * (wanted.clamp(straight, bent) - flexion).to_radians();
    let chest = posture.rotations[collar_bone];
    let farthest = shoulder_beyond(side, chest * clip[0]).max(0.0) + NO_FARTHER;
    let mut taken = |share: f32| {
        let turns = [from_angle_axis(offset[0] * share), from_angle_axis(bend * share)];
        posture.rotations[arm] = (clip[0] * turns[0]).normalize();
        posture.rotations[forearm] = (clip[1] * turns[1]).normalize();
        for joint in [arm, forearm, hand] {
            pose.place(posture, joint);
        }
        let is_possible = shoulder_beyond(side, chest * posture.rotations[arm]) <= farthest;
        (turns, is_possible, arm_depth(pose, side))
    };
    let (turns, is_possible, depth) = taken(1.0);
    if is_possible && depth <= NO_DEEPER {
        return turns;
    }
    // What is in the body has to be compared with the clip's own arm.
    let deepest = taken(0.0).2 + NO_DEEPER;
    if is_possible && depth <= deepest {
        return taken(1.0).0;
    }
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        let (_, is_possible, depth) = taken(middle);
        if is_possible && depth <= deepest { low = middle } else { high = middle }
    }
    taken(low).0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::anatomy::{LimitedTurn, beyond_limits};
    use proptest::prelude::*;
    use std::f32::consts::FRAC_PI_2;

    /// Standing, the arms hanging a little away from the body, the elbows bent by 20°.
    fn hanging() -> Posture {
        let mut posture = Posture::default();
        for (side, sign) in [(0, 1.0), (1, -1.0)] {
            posture.rotations[ARMS[side][1].index()] = Quat::from_rotation_y(sign * (FRAC_PI_2 - 0.25));
            posture.rotations[ARMS[side][2].index()] = Quat::from_rotation_z(-sign * 20f32.to_radians());
        }
        posture
    }

    fn turned(offset: PostureOffset) -> (Posture, [Quat; 4]) {
        let mut posture = hanging();
        let mut pose = posture.pose();
        let turns = turn(&mut posture, &mut pose, &offset);
        assert_eq!(pose, posture.pose(), "the pose is that of the posture");
        (posture, turns)
    }

    #[test]
    fn an_elbow_only_bends_and_no_further_than_it_goes() {
        for (bend, expected) in [(0.5, 20.0 + 0.5f32.to_degrees()), (3.0, EASY_ELBOW.1), (-2.0, EASY_ELBOW.0)]
        {
            // What is not about the hinge is left out.
            let (left, right) = (Vec3::new(0.7, -0.9, -bend), Vec3::new(0.7, 0.9, bend));
            let (posture, _) = turned([Vec3::Y * -0.6, left, Vec3::Y * 0.6, right]);
            for side in 0..2 {
                let forearm = posture.rotations[ARMS[side][2].index()];
                assert!((elbow_flexion(side, forearm) - expected).abs() < 0.2, "{side}: {expected}");
                let plane = forearm * Vec3::X;
                assert!(plane.z.abs() < 1e-3, "{plane}");
            }
        }
    }

    #[test]
    fn free_arms_turn_as_they_are_told_and_the_other_stays() {
        let offset = Vec3::new(0.1, -0.5, 0.2);
        let (posture, turns) = turned([offset, Vec3::ZERO, Vec3::ZERO, Vec3::ZERO]);
        let before = hanging();
        let arm = Joint::LeftArm.index();
        assert!(turns[0].angle_between(from_angle_axis(offset)) < 1e-3);
        assert!(posture.rotations[arm].angle_between(before.rotations[arm] * from_angle_axis(offset)) < 1e-3);
        for joint in (0..posture.rotations.len()).filter(|j| *j != arm) {
            assert!(posture.rotations[joint].angle_between(before.rotations[joint]) < 1e-3, "{joint}");
        }
    }

    #[test]
    fn an_arm_stops_at_the_body() {
        // Straight into the flank: it touches and goes no deeper.
        let inwards = [Vec3::Y * 0.9, Vec3::ZERO, Vec3::Y * -0.9, Vec3::ZERO];
        let (posture, turns) = turned(inwards);
        let pose = posture.pose();
        for side in 0..2 {
            assert!(arm_depth(&pose, side) <= 2.0 * NO_DEEPER);
            let angle = turns[2 * side].angle_between(Quat::IDENTITY);
            assert!(angle > 0.03 && angle < 0.8, "{angle}");
        }
        // A little more would be in it.
        let mut deeper = posture;
        let mut pose = pose;
        let joint = Joint::LeftArm.index();
        deeper.rotations[joint] *= Quat::from_rotation_y(0.05);
        for joint in ARMS[0] {
            pose.place(&deeper, joint.index());
        }
        assert!(arm_depth(&pose, 0) > NO_DEEPER);
    }

    proptest! {
        #[test]
        fn whatever_is_asked_no_arm_is_wrenched(v in prop::collection::vec(-3f32..3.0, 12)) {
            let offset: PostureOffset = std::array::from_fn(|i| Vec3::from_slice(&v[3 * i..]));
            let (posture, _) = turned(offset);
            for (joint, limit, degrees) in beyond_limits(&posture) {
                let own = matches!(limit, LimitedTurn::Swing | LimitedTurn::Twist) && joint != Joint::LeftHand && joint != Joint::RightHand;
                prop_assert!(degrees < 0.1 || !own, "{joint:?} {limit:?} {degrees}");
            }
            let pose = posture.pose();
            prop_assert!((0..2).all(|side| arm_depth(&pose, side) < 2e-3));
        }
    }
}
