//! Feet: two-bone leg IK, and the clean-up that keeps planted toes planted and soles on the floor.

use glam::{Mat3, Quat, Vec3};

use super::contact::{median, runs};
use crate::math::curve::{smoothstep, widened};
use crate::math::rotation::wrap_angle;
use crate::motion::skeleton::{ANKLE_HEIGHT, HEEL_LENGTH, JOINT_OFFSET, LEG_LENGTH, TOE_HEIGHT, TOE_LENGTH};
use crate::motion::{Joint, Motion, Pose, Posture};

/// Thigh, shin, foot, toe.
pub(crate) const LEGS: [[Joint; 4]; 2] = [
    [Joint::LeftUpLeg, Joint::LeftLeg, Joint::LeftFoot, Joint::LeftToe],
    [Joint::RightUpLeg, Joint::RightLeg, Joint::RightFoot, Joint::RightToe],
];

/// A leg stays this much short of straight: about 4° of knee flexion.
const LONGEST_LEG: f32 = 2.0 * LEG_LENGTH * 0.9995;
/// A leg may always be this long (17° of knee flexion) …
const EASY_LEG: f32 = 2.0 * LEG_LENGTH * 0.989;
/// Toes bend up at most so far from the foot, radians.
const MOST_TOE_BEND: f32 = 1.0;
/// Corrections of a planted foot fade in and out over this many frames.
const BLEND_FRAMES: f32 = 8.0;

/// From the ball's joint (Toe) to the heel on the sole, in the foot's frame, metres.
pub(crate) const HEEL_ARM: Vec3 = Vec3::new(
    0.0,
    HEEL_LENGTH - JOINT_OFFSET[Joint::LeftToe.index()].y,
    -ANKLE_HEIGHT - JOINT_OFFSET[Joint::LeftToe.index()].z,
);

/// The lowest points of a foot: heel, ball, tip of the toes (on the sole), in the world.
pub fn sole(pose: &Pose, side: usize) -> [Vec3; 3] {
    let [_, _, foot, toe] = LEGS[side];
    let at = |joint: Joint, local: Vec3| pose.position(joint) + pose.rotation(joint) * local;
    [
        at(foot, Vec3::new(0.0, HEEL_LENGTH, -ANKLE_HEIGHT)),
        at(toe, Vec3::new(0.0, 0.0, -TOE_HEIGHT)),
        at(toe, Vec3::new(0.0, -TOE_LENGTH, -TOE_HEIGHT)),
    ]
}

/// How far a foot points outward of where the pelvis faces, on the floor plane, radians.
pub(crate) fn turned_out(pose: &Pose, side: usize) -> f32 {
    let [.., foot, toe] = LEGS[side];
    let ahead = (pose.position(toe) - pose.position(foot)).truncate();
    let left = (pose.position(Joint::LeftUpLeg) - pose.position(Joint::RightUpLeg)).truncate();
    [1.0, -1.0][side] * (-left.perp()).angle_to(ahead)
}

/// Bends one leg so that its ankle reaches `ankle` (world) with the foot turned as `foot` (world).
///
/// The knee stays a pure hinge about the thigh's X axis and bends forward; where the ankle is out of
/// reach the leg points at it, not quite straight.
pub(crate) fn reach(posture: &mut Posture, pose: &Pose, side: usize, ankle: Vec3, foot: Quat) {
    let [thigh, shin, foot_joint, _] = LEGS[side];
    let hip = pose.position(thigh);
    let to = ankle - hip;
    let Some(direction) = to.try_normalize() else { return };
    let distance = to.length().clamp(0.15, LONGEST_LEG);
    let half_flexion = (distance / (2.0 * LEG_LENGTH)).clamp(-1.0, 1.0).acos();
    let hinge = pose.rotation(thigh) * Vec3::X;
    let Some(hinge) = (hinge - direction * hinge.dot(direction)).try_normalize() else { return };
    let bone = |angle: f32| {
        let down = Quat::from_axis_angle(hinge, angle) * direction;
        Quat::from_mat3(&Mat3::from_cols(hinge, hinge.cross(down), -down))
    };
    let (thigh_rotation, shin_rotation) = (bone(-half_flexion), bone(half_flexion));
    let hips = pose.rotation(Joint::Hips);
    posture.rotations[thigh.index()] = (hips.inverse() * thigh_rotation).normalize();
    posture.rotations[shin.index()] = (thigh_rotation.inverse() * shin_rotation).normalize();
    posture.rotations[foot_joint.index()] = (shin_rotation.inverse() * foot).normalize();
}

/// Gives each joint's quaternions the sign that lies nearer to the frame before, so that they can be averaged.
pub(crate) fn align_signs(motion: &mut Motion) {
    for frame in 1..motion.postures.len() {
        let before = motion.postures[frame - 1].rotations;
        for (q, before) in motion.postures[frame].rotations.iter_mut().zip(before) {
            if q.dot(before) < 0.0 {
                *q = -*q;
            }
        }
    }
}

/// Where the ankle is to be and how the foot is turned, frame by frame.
#[derive(Clone, Copy)]
struct FootTarget {
    ankle: Vec3,
    rotation: Quat,
    toe_rotation: Quat,
}

/// Keeps planted toes where they are, soles out of the floor (z = 0) and knees short of straight.
///
/// `motion.contacts` must be as long as the postures; it says which toes are planted. Corrections fade
/// in and out, so nothing pops. The root comes down a little where a planted leg would not reach.
pub(crate) fn clean_up(motion: &mut Motion) {
    let poses: Vec<Pose> = motion.postures.iter().map(|p| p.pose()).collect();
    let mut targets: [Vec<FootTarget>; 2] = [Vec::new(), Vec::new()];
    for (side, out) in targets.iter_mut().enumerate() {
        let planted: Vec<bool> = motion.contacts.iter().map(|c| c[side] == 1.0).collect();
        *out = foot_targets(&poses, &planted, side);
    }
    // How far the root must come down for the feet on the floor to be reached.
    let mut drop: Vec<f32> = (0..poses.len())
        .map(|frame| {
            (0..2)
                .filter(|&side| motion.contacts[frame][side] > 0.0)
                .map(|side| {
                    let hip = poses[frame].position(LEGS[side][0]);
                    needed_drop(hip, targets[side][frame].ankle, longest(&poses[frame], side))
                })
                .fold(0.0, f32::max)
        })
        .collect();
    drop = smooth(&widened(&drop, 4), 4);
    for (frame, posture) in motion.postures.iter_mut().enumerate() {
        posture.root_position.z -= drop[frame];
        for (side, leg) in LEGS.iter().enumerate() {
            let pose = posture.pose();
            let target = targets[side][frame];
            let mut ankle = target.ankle;
            if motion.contacts[frame][side] == 0.0 {
                let hip = pose.position(leg[0]);
                ankle = hip + (ankle - hip).clamp_length_max(longest(&poses[frame], side));
            }
            reach(posture, &pose, side, ankle, target.rotation);
            posture.rotations[leg[3].index()] = (target.rotation.inverse() * target.toe_rotation).normalize();
        }
    }
    align_signs(motion);
}

fn foot_targets(poses: &[Pose], planted: &[bool], side: usize) -> Vec<FootTarget> {
    let [_, _, foot, toe] = LEGS[side];
    let plants = runs(planted, true);
    let toes: Vec<Vec3> = poses.iter().map(|p| p.position(toe)).collect();
    // Correction of the toe's place: exact while planted, faded around.
    let mut shift = vec![Vec3::ZERO; poses.len()];
    for &(first, end) in &plants {
        let place = median(&toes[first..end]);
        let lock = Vec3::new(place.x, place.y, TOE_HEIGHT);
        for frame in first..end {
            shift[frame] = lock - toes[frame];
        }
    }
    for (first, end) in runs(planted, false) {
        let before = if first > 0 { shift[first - 1] } else { Vec3::ZERO };
        let after = if end < poses.len() { shift[end] } else { Vec3::ZERO };
        let length = BLEND_FRAMES.min((end - first) as f32 + 1.0);
        for (frame, out) in shift.iter_mut().enumerate().take(end).skip(first) {
            let fade_out = 1.0 - smoothstep((frame + 1 - first) as f32 / length);
            let fade_in = 1.0 - smoothstep((end - frame) as f32 / length);
            *out = before * fade_out + after * fade_in;
        }
    }
    let balls: Vec<Vec3> = (0..poses.len())
        .map(|f| {
            let ball = toes[f] + shift[f];
            Vec3::new(ball.x, ball.y, ball.z.max(TOE_HEIGHT))
        })
        .collect();
    let tip_arm = Vec3::new(0.0, -TOE_LENGTH, -TOE_HEIGHT);
    let turn = |rotation: Quat, angle: f32| rotation * Quat::from_rotation_x(angle);
    let turned = |rotations: &[Quat], angles: &[f32], sign: f32| -> Vec<Quat> {
        rotations.iter().zip(angles).map(|(&q, &angle)| turn(q, sign * angle)).collect()
    };
    // A planted heel that hovers a little is set down (captured feet are never quite flat); then heels and toes
    // that would go through the floor turn up about the ball. All angles are eased, so nothing snaps.
    let feet: Vec<Quat> = poses.iter().map(|p| p.rotation(foot)).collect();
    let hover: Vec<f32> = (0..poses.len())
        .map(|f| {
            let arm = feet[f] * HEEL_ARM;
            let height = balls[f].z + arm.z;
            let kept = smoothstep((height - 0.015) / 0.04);
            if planted[f] { (height * (1.0 - kept)).max(0.0) / arm.truncate().length().max(0.1) } else { 0.0 }
        })
        .collect();
    let feet = turned(&feet, &smooth(&hover, 4), -1.0);
    let needed = |rotations: &[Quat], arm: Vec3, sign: f32| -> Vec<f32> {
        let lifts: Vec<f32> =
            rotations.iter().zip(&balls).map(|(&q, ball)| lift_angle(ball.z, q, arm, sign)).collect();
        smooth(&widened(&lifts, 2), 2)
    };
    let feet = turned(&feet, &needed(&feet, HEEL_ARM, 1.0), 1.0);
    // Toes are a hinge: captured ones twist and jitter.
    let bends: Vec<f32> = poses
        .iter()
        .map(|p| {
            let local = p.rotation(foot).inverse() * p.rotation(toe);
            wrap_angle(2.0 * local.x.atan2(local.w)).clamp(-MOST_TOE_BEND, 0.3)
        })
        .collect();
    let toe_rotations = turned(&feet, &smooth(&bends, 4), 1.0);
    let toe_rotations = turned(&toe_rotations, &needed(&toe_rotations, tip_arm, -1.0), -1.0);
    (0..poses.len())
        .map(|f| FootTarget {
            ankle: balls[f] - feet[f] * JOINT_OFFSET[toe.index()],
            rotation: feet[f],
            toe_rotation: toe_rotations[f],
        })
        .collect()
}

/// The angle about the joint's own X axis (times `sign`) that brings the end of `arm` up to the floor.
fn lift_angle(ball_height: f32, rotation: Quat, arm: Vec3, sign: f32) -> f32 {
    let mut lift = 0.0;
    for _ in 0..5 {
        let reach = rotation * (Quat::from_rotation_x(sign * lift) * arm);
        let under = -(ball_height + reach.z);
        if under < 1e-4 {
            break;
        }
        lift += (under / reach.truncate().length().max(0.04)).min(0.4);
    }
    lift.min(1.3)
}

/// How long a leg may get: as long as it was captured, or [`EASY_LEG`].
///
/// Near full extension millimetres of the ankle are many degrees of the knee, so a corrected foot must not
/// stretch its leg further than the person did.
fn longest(pose: &Pose, side: usize) -> f32 {
    let [thigh, _, foot, _] = LEGS[side];
    pose.position(thigh).distance(pose.position(foot)).clamp(EASY_LEG, LONGEST_LEG)
}

/// How far a hip must come down for its ankle to be within `longest`.
fn needed_drop(hip: Vec3, ankle: Vec3, longest: f32) -> f32 {
    let to = hip - ankle;
    let side = to.truncate().length_squared();
    let high = (longest * longest - side).max(0.0).sqrt();
    (to.z - high).clamp(0.0, 0.15)
}

/// A smooth mean over `radius` frames each side: half of that, twice.
fn smooth(values: &[f32], radius: usize) -> Vec<f32> {
    let once = |values: &[f32], radius: usize| -> Vec<f32> {
        (0..values.len())
            .map(|i| {
                let window = &values[i.saturating_sub(radius)..(i + radius + 1).min(values.len())];
                window.iter().sum::<f32>() / window.len() as f32
            })
            .collect()
    };
    once(&once(values, radius / 2), radius / 2)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rotation::angle_between;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn reach_puts_the_ankle_there(x in -0.3f32..0.3, y in -0.4f32..0.4, z in 0.1f32..0.5, yaw in -3.0f32..3.0, side in 0usize..2) {
            let mut posture = Posture::default();
            posture.rotations[0] = Quat::from_rotation_z(yaw);
            let pose = posture.pose();
            let ankle = pose.position(LEGS[side][0]) + Quat::from_rotation_z(yaw) * Vec3::new(x, y, z - 0.85);
            let foot = Quat::from_rotation_z(yaw + 0.2);
            reach(&mut posture, &pose, side, ankle, foot);
            let after = posture.pose();
            if ankle.distance(pose.position(LEGS[side][0])) < LONGEST_LEG {
                prop_assert!(after.position(LEGS[side][2]).distance(ankle) < 1e-4);
            }
            prop_assert!(angle_between(after.rotation(LEGS[side][2]), foot) < 1e-4);
            // The knee bends the human way: its hinge rotation is about +X only.
            let knee = posture.rotations[LEGS[side][1].index()];
            prop_assert!(knee.y.abs() < 1e-3 && knee.z.abs() < 1e-3 && knee.x * knee.w >= -1e-4);
        }
    }

    #[test]
    fn a_sliding_plant_is_stopped_without_a_pop() {
        // A rest pose that drifts 4 mm a frame although its feet count as planted, then walks away.
        let mut motion = Motion::default();
        for frame in 0..60 {
            let mut posture = Posture::default();
            posture.root_position.y = -0.004 * frame as f32;
            posture.root_position.z -= 0.05;
            motion.postures.push(posture);
            motion.contacts.push(if (20..35).contains(&frame) { [1.0, 1.0] } else { [0.5, 0.5] });
        }
        clean_up(&mut motion);
        let poses: Vec<Pose> = motion.postures.iter().map(|p| p.pose()).collect();
        for side in 0..2 {
            let toe = |f: usize| poses[f].position(LEGS[side][3]);
            for frame in 21..35 {
                assert!(toe(frame).distance(toe(frame - 1)) < 1e-4);
            }
            for frame in 1..60 {
                assert!(toe(frame).distance(toe(frame - 1)) < 0.02, "frame {frame} pops");
                assert!(sole(&poses[frame], side).iter().all(|p| p.z > -0.002));
            }
        }
    }
}
