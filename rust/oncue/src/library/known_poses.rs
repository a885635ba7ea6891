//! The poses of arms and trunk that a library has: what is far from all of them no captured person did.

use std::f32::consts::PI;

use glam::Vec3;

use crate::motion::skeleton::ARMS;
use crate::motion::{Joint, Pose};

use Joint::*;

/// Poses are kept in balls within balls, so far across from their middle to their rim, degrees. The smallest are one pose
/// each: what is as close to one that is kept is not, and a distance may be as much too large.
const RADII: [f32; 3] = [16.0, 6.0, 2.0];

/// Where the bones of a part of the body point, unit vectors.
pub(crate) type Directions<const N: usize> = [Vec3; N];

/// Upper arm and forearm in the chest's frame, the right arm as the left one's mirror image; side 0 is the left.
pub(crate) fn arm_directions(pose: &Pose, side: usize) -> Directions<2> {
    let [_, shoulder, elbow, wrist] = ARMS[side].map(|joint| pose.position(joint));
    let chest = pose.rotation(Spine2).inverse();
    let mirror = Vec3::new(if side == 0 { 1.0 } else { -1.0 }, 1.0, 1.0);
    [elbow - shoulder, wrist - elbow].map(|bone| chest * bone.normalize_or_zero() * mirror)
}

/// Lower back, lower chest, upper chest, neck and head upwards, and the line across the chest, which shows its twist; in
/// the pelvis's frame.
pub(crate) fn trunk_directions(pose: &Pose) -> Directions<6> {
    let pelvis = pose.rotation(Hips).inverse();
    let bone = |from: Joint, to: Joint| (pose.position(to) - pose.position(from)).normalize_or_zero();
    [
        bone(Spine, Spine1),
        bone(Spine1, Spine2),
        bone(Spine2, Neck),
        bone(Neck, Head),
        pose.rotation(Head) * Vec3::Z,
        pose.rotation(Spine2) * Vec3::X,
    ]
    .map(|direction| pelvis * direction)
}

/// The cosine of the distance of two poses, which is the largest of the angles between their bones.
fn cosine<const N: usize>(a: &Directions<N>, b: &Directions<N>) -> f32 {
    (0..N).map(|i| a[i].dot(b[i])).fold(1.0, f32::min)
}

/// Poses close to one another, about a pose.
#[derive(Debug, Clone)]
struct Ball<const N: usize> {
    middle: Directions<N>,
    /// Balls of the next smaller radius.
    inside: Vec<Ball<N>>,
}

/// Adds a pose to balls of the first of `radii`, and in its ball to those of the next.
fn insert<const N: usize>(balls: &mut Vec<Ball<N>>, pose: &Directions<N>, radii: &[f32]) {
    let Some((radius, smaller)) = radii.split_first() else { return };
    let rim = radius.to_radians().cos();
    // Neighbours in a clip are close: who took the last takes most of the next, so it is kept at the end.
    match balls.iter().rposition(|ball| cosine(&ball.middle, pose) >= rim) {
        Some(ball) => {
            let last = balls.len() - 1;
            balls.swap(ball, last);
        }
        None => balls.push(Ball { middle: *pose, inside: Vec::new() }),
    }
    if let Some(ball) = balls.last_mut() {
        insert(&mut ball.inside, pose, smaller);
    }
}

/// The cosine of the distance to the nearest pose, or `nearest_yet` where none is nearer.
fn nearest<const N: usize>(balls: &[Ball<N>], pose: &Directions<N>, radii: &[f32], nearest_yet: f32) -> f32 {
    let cosines = || balls.iter().map(|ball| cosine(&ball.middle, pose));
    let Some((radius, smaller)) = radii.split_first().filter(|(_, smaller)| !smaller.is_empty()) else {
        return cosines().fold(nearest_yet, f32::max);
    };
    // The pose in a ball that is nearest is no nearer than its middle less its radius.
    let worth = |nearest: f32| (nearest.clamp(-1.0, 1.0).acos() + radius.to_radians()).min(PI).cos();
    let middles: Vec<f32> = cosines().collect();
    let Some(first) = (0..balls.len()).max_by(|a, b| middles[*a].total_cmp(&middles[*b])) else {
        return nearest_yet;
    };
    let mut found = nearest(&balls[first].inside, pose, smaller, nearest_yet);
    let mut least = worth(found);
    for (ball, middle) in middles.iter().enumerate() {
        if ball != first && *middle >= least {
            found = nearest(&balls[ball].inside, pose, smaller, found);
            least = worth(found);
        }
    }
    found
}

/// Poses of one part of the body.
#[derive(Debug, Clone)]
struct PartPoses<const N: usize>(Vec<Ball<N>>);

impl<const N: usize> PartPoses<N> {
    fn new(poses: impl Iterator<Item = Directions<N>>) -> Self {
        let mut balls = Vec::new();
        poses.for_each(|pose| insert(&mut balls, &pose, &RADII));
        Self(balls)
    }

    /// The distance to the nearest pose, degrees; half a turn where there is none.
    fn distance(&self, pose: &Directions<N>) -> f32 {
        nearest(&self.0, pose, &RADII, -1.0).clamp(-1.0, 1.0).acos().to_degrees()
    }
}

/// The poses of arms and trunk that a library has, thinned to two degrees.
#[derive(Debug, Clone)]
pub struct KnownPoses {
    /// Both arms, the right one as the left one's mirror image.
    arms: PartPoses<2>,
    trunks: PartPoses<6>,
}

impl KnownPoses {
    /// Those of `poses`, clip after clip.
    pub(crate) fn new(poses: impl Iterator<Item = Pose>) -> Self {
        let mut parts: Vec<([Directions<2>; 2], Directions<6>)> = Vec::new();
        parts.extend(
            poses.map(|pose| ([0, 1].map(|side| arm_directions(&pose, side)), trunk_directions(&pose))),
        );
        let arms = [0, 1].into_iter().flat_map(|side| parts.iter().map(move |(arms, _)| arms[side]));
        Self { arms: PartPoses::new(arms), trunks: PartPoses::new(parts.iter().map(|(_, trunk)| *trunk)) }
    }

    /// How far an arm's pose is from the nearest that is known, degrees: the larger angle of upper arm and forearm.
    pub fn arm_distance(&self, pose: &Pose, side: usize) -> f32 {
        self.arms.distance(&arm_directions(pose, side))
    }

    /// How far the trunk's pose is from the nearest that is known, degrees: the largest angle of its bones.
    pub fn trunk_distance(&self, pose: &Pose) -> f32 {
        self.trunks.distance(&trunk_directions(pose))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::Posture;
    use glam::Quat;

    fn turned(joint: Joint, rotation: Quat) -> Pose {
        let mut posture = Posture::default();
        posture.rotations[joint.index()] = rotation;
        posture.pose()
    }

    #[test]
    fn arms_by_hand() {
        let known = KnownPoses::new([Posture::default().pose()].into_iter());
        let left = turned(LeftArm, Quat::from_rotation_y(0.5));
        // The forearm goes with the upper arm.
        assert!((known.arm_distance(&left, 0) - 0.5f32.to_degrees()).abs() < 1e-3);
        assert!(known.arm_distance(&left, 1) < 0.1);
        let elbow = turned(RightForeArm, Quat::from_rotation_z(1.0));
        assert!((known.arm_distance(&elbow, 1) - 1f32.to_degrees()).abs() < 1e-3);
        // Who turns all of himself, or bends, has the same arms.
        let bent = turned(Spine, Quat::from_rotation_x(0.7));
        assert!(known.arm_distance(&bent, 0) < 0.1);
        // A left arm that is known is known of the right one too.
        let both = KnownPoses::new([left].into_iter());
        assert!(both.arm_distance(&turned(RightArm, Quat::from_rotation_y(-0.5)), 1) < 0.1);
    }

    #[test]
    fn trunks_by_hand() {
        let known = KnownPoses::new([Posture::default().pose()].into_iter());
        let degrees = |joint, rotation| known.trunk_distance(&turned(joint, rotation)).to_radians();
        assert!((degrees(Spine, Quat::from_rotation_x(0.3)) - 0.3).abs() < 1e-4);
        assert!((degrees(Head, Quat::from_rotation_y(0.4)) - 0.4).abs() < 1e-4);
        // A twist of the chest shows across it; looking aside is no pose of the trunk; nor is where the pelvis faces.
        assert!((degrees(Spine1, Quat::from_rotation_z(0.2)) - 0.2).abs() < 1e-4);
        assert!(degrees(Head, Quat::from_rotation_z(0.8)) < 1e-3);
        assert!(degrees(Hips, Quat::from_rotation_z(2.0)) < 1e-3);
    }

    /// Arms and trunks that wander as in clips, with a leap now and then.
    fn wandering(count: usize) -> impl Iterator<Item = Pose> {
        (0..count).map(|i| {
            let t = i as f32;
            let leap = (i / 50) as f32 * 2.4;
            let mut posture = Posture::default();
            let mut turn = |joint: Joint, a: f32, b: f32| {
                posture.rotations[joint.index()] = Quat::from_rotation_y(a) * Quat::from_rotation_z(b);
            };
            turn(LeftArm, 0.8 * (0.031 * t + leap).sin(), 0.6 * (0.017 * t).cos());
            turn(LeftForeArm, 0.0, 1.0 * (0.05 * t).sin());
            turn(RightArm, 0.7 * (0.023 * t).cos(), 0.4 * (0.029 * t + leap).sin());
            turn(Spine, 0.3 * (0.011 * t).sin(), 0.2 * (0.019 * t + leap).cos());
            turn(Neck, 0.2 * (0.037 * t).cos(), 0.5 * (0.013 * t).sin());
            posture.pose()
        })
    }

    #[test]
    fn the_nearest_is_found_as_by_looking_at_all() {
        let known = KnownPoses::new(wandering(600));
        let all: Vec<Pose> = wandering(600).collect();
        let mut far = 0;
        for pose in wandering(3000).skip(601).step_by(41) {
            let nearest = |of: &dyn Fn(&Pose) -> f32| {
                all.iter().map(of).fold(-1.0, f32::max).min(1.0).acos().to_degrees()
            };
            let arm = arm_directions(&pose, 1);
            let expected =
                nearest(&|k| (0..2).map(|s| cosine(&arm_directions(k, s), &arm)).fold(-1.0, f32::max));
            let found = known.arm_distance(&pose, 1);
            assert!((-1e-2..=RADII[2]).contains(&(found - expected)), "{found} {expected}");
            let trunk = trunk_directions(&pose);
            let expected = nearest(&|k| cosine(&trunk_directions(k), &trunk));
            let found = known.trunk_distance(&pose);
            assert!((-1e-2..=RADII[2]).contains(&(found - expected)), "{found} {expected}");
            far += usize::from(expected > 5.0);
        }
        assert!(far > 10, "{far}");
    }

    #[test]
    fn of_nothing_all_is_far() {
        let known = KnownPoses::new(std::iter::empty());
        assert_eq!(known.trunk_distance(&Posture::default().pose()), 180.0);
    }
}
