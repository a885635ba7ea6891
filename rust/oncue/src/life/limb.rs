//! Limbs that stay where they rest while what they hang from moves.

use glam::{Quat, Vec3};

use crate::motion::{Joint, Pose, Posture};

/// Longest a limb gets, of its whole length: never quite straight, where a millimetre turns the joint by degrees.
const LONGEST: f32 = 0.9985;

/// Bends a limb so that its end is at `to` with the world rotation `turned`: as it was bent, but for what that takes, and turned by
/// `swivel` (radians) about the line between its ends. `hinge`: the axis of the middle joint in its own frame, by which a straight
/// limb bends. Gives how far the end stays away, metres.
///
/// Where nothing moved the limb stays as it is.
pub(super) fn reach(
    posture: &mut Posture,
    pose: &mut Pose,
    limb: [Joint; 3],
    hinge: Vec3,
    to: Vec3,
    turned: Quat,
    swivel: f32,
) -> f32 {
    let [upper, lower, end] = limb.map(|joint| pose.position(joint));
    let (long, short) = (upper.distance(lower), lower.distance(end));
    let now = (end - upper).length();
    let most = (LONGEST * (long + short)).max(now);
    let distance = upper.distance(to).clamp((long - short).abs() + 0.02, most);
    let angle = |distance: f32| {
        ((long * long + short * short - distance * distance) / (2.0 * long * short)).clamp(-1.0, 1.0).acos()
    };
    let across = (upper - lower).cross(end - lower);
    let axis = if across.length() > 0.02 * long * short {
        across.normalize()
    } else {
        pose.rotation(limb[1]) * hinge
    };
    let bend = Quat::from_axis_angle(axis, angle(distance) - angle(now));
    let bent = lower + bend * (end - lower);
    let line = (to - upper).normalize_or(Vec3::NEG_Z);
    let from = (bent - upper).normalize_or(line);
    // By the sine: the cosine of so small a turn is rounded away.
    let axis = from.cross(line);
    let aside = Quat::from_axis_angle(axis.normalize_or(Vec3::X), axis.length().atan2(from.dot(line)));
    let swing = Quat::from_axis_angle(line, swivel) * aside;
    let rotations = [swing * pose.rotation(limb[0]), swing * bend * pose.rotation(limb[1]), turned];
    let mut parent = limb[0].parent().map_or(Quat::IDENTITY, |parent| pose.rotation(parent));
    for (joint, rotation) in limb.into_iter().zip(rotations) {
        posture.rotations[joint.index()] = (parent.inverse() * rotation).normalize();
        pose.place(posture, joint.index());
        parent = rotation;
    }
    pose.position(limb[2]).distance(to)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::Joint::*;
    use crate::test_world::{STANDS, person};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn an_end_that_stays_is_where_it_was(x in -0.03f32..0.03, y in -0.03f32..0.03, z in -0.03f32..0.0, swivel in -0.1f32..0.1) {
            let base = person(Default::default(), STANDS - 0.1, 0.1);
            let before = base.pose();
            let mut posture = base;
            posture.root_position += Vec3::new(x, y, z);
            let mut pose = posture.pose();
            let (to, turned) = (before.position(LeftFoot), before.rotation(LeftFoot));
            let missed = reach(&mut posture, &mut pose, [LeftUpLeg, LeftLeg, LeftFoot], Vec3::X, to, turned, swivel);
            prop_assert!(missed < 1e-4);
            let after = posture.pose();
            prop_assert!(after.position(LeftToe).distance(before.position(LeftToe)) < 1e-3);
            // A knee is a hinge.
            let knee = posture.rotations[LeftLeg.index()];
            prop_assert!(knee.y.abs() < 2e-3 && knee.z.abs() < 2e-3, "{knee}");
            // The rest of the leg is as long as it was, and what is not of it stays.
            prop_assert!((after.position(LeftUpLeg).distance(after.position(LeftLeg)) - 0.444).abs() < 1e-4);
            prop_assert_eq!(posture.rotations[RightUpLeg.index()], base.rotations[RightUpLeg.index()]);
        }
    }

    #[test]
    fn a_limb_that_is_where_it_should_be_stays_as_it_is() {
        for (limb, hinge) in
            [([LeftUpLeg, LeftLeg, LeftFoot], Vec3::X), ([RightArm, RightForeArm, RightHand], Vec3::Z)]
        {
            let base = person(Default::default(), STANDS - 0.1, 0.1);
            let mut posture = base;
            let mut pose = base.pose();
            let (to, turned) = (pose.position(limb[2]), pose.rotation(limb[2]));
            let missed = reach(&mut posture, &mut pose, limb, hinge, to, turned, 0.0);
            assert!(missed < 1e-5);
            for joint in limb {
                assert!(posture.rotations[joint.index()].angle_between(base.rotations[joint.index()]) < 2e-3);
            }
        }
        // What is out of reach is pointed at.
        let mut posture = person(Default::default(), STANDS, 0.0);
        let mut pose = posture.pose();
        let to = pose.position(LeftFoot) - Vec3::Z * 0.3;
        let limb = [LeftUpLeg, LeftLeg, LeftFoot];
        let missed = reach(&mut posture, &mut pose, limb, Vec3::X, to, Quat::IDENTITY, 0.0);
        assert!(missed > 0.2 && missed < 0.31, "{missed}");
    }
}
