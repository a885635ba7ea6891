//! Figures that tell natural motion from broken motion, for any clip: procedural or imported.

use glam::{Quat, Vec3};
use serde::Serialize;

use super::clip::Clip;
use crate::math::rotation::to_angle_axis;
use crate::motion::skeleton::{ANKLE_HEIGHT, HEEL_LENGTH, JOINT_COUNT, JOINT_OFFSET, TOE_HEIGHT, TOE_LENGTH};
use crate::motion::{FRAME_RATE, Joint, Pose, Posture};

/// What [`measure`] finds in one clip. Angles in degrees, lengths in metres.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Quality {
    /// Largest move of a Toe joint between two frames of full contact.
    pub toe_slide: f32,
    /// Lowest point of heel, ball or toe tip over the floor; negative is below.
    pub lowest_foot_point: f32,
    /// Knee flexion, smallest and largest; negative bends forward.
    pub knee: [f32; 2],
    /// Elbow flexion, smallest and largest.
    pub elbow: [f32; 2],
    /// Largest turn of the knee or elbow off its hinge.
    pub off_hinge: f32,
    /// Largest angle of the thigh against the pelvis, of the foot against its rest, of the whole spine, of the neck with the head.
    pub hip: f32,
    pub ankle: f32,
    pub spine: f32,
    pub neck: f32,
    /// Largest rotation speed of a joint against its parent, degrees/s, and the joint.
    pub joint_speed: f32,
    pub fastest_joint: Joint,
    /// Largest change of that speed, degrees/s².
    pub joint_acceleration: f32,
    pub jerkiest_joint: Joint,
    /// The same for the knees alone: a pop shows here.
    pub knee_acceleration: f32,
    /// Planar speed of the root, m/s.
    pub root_speed: f32,
    /// Largest acceleration of the root, m/s².
    pub root_acceleration: f32,
    /// Smallest distance between a wrist and the axes of the thighs.
    pub hand_to_thigh: f32,
    /// Smallest distance between the two feet's middles.
    pub between_feet: f32,
}

/// Heel, ball and tip of each foot's sole in the world: left's three, then right's.
pub(crate) fn sole_points(pose: &Pose) -> [Vec3; 6] {
    let mut out = [Vec3::ZERO; 6];
    for (side, (foot, toe)) in Joint::FEET.into_iter().zip(Joint::TOES).enumerate() {
        let toe_point = |y: f32| pose.position(toe) + pose.rotation(toe) * Vec3::new(0.0, y, -TOE_HEIGHT);
        out[3 * side] =
            pose.position(foot) + pose.rotation(foot) * Vec3::new(0.0, HEEL_LENGTH, -ANKLE_HEIGHT);
        out[3 * side + 1] = toe_point(0.0);
        out[3 * side + 2] = toe_point(-TOE_LENGTH);
    }
    out
}

/// Flexion about +X of a knee in degrees, and the turn off that hinge.
pub fn knee_flexion(rotation: Quat) -> (f32, f32) {
    let v = to_angle_axis(rotation);
    (v.x.to_degrees(), Vec3::new(0.0, v.y, v.z).length().to_degrees())
}

/// Flexion of an elbow in degrees: the angle between its two bones.
fn elbow_flexion(posture: &Posture, joint: Joint) -> f32 {
    let bone = JOINT_OFFSET[joint.index()];
    bone.angle_between(posture.rotations[joint.index()] * bone).to_degrees()
}

/// Where the point on a segment is nearest to `point`.
fn distance_to_segment(point: Vec3, a: Vec3, b: Vec3) -> f32 {
    let along = b - a;
    let t = ((point - a).dot(along) / along.length_squared().max(1e-12)).clamp(0.0, 1.0);
    point.distance(a + along * t)
}

/// Measures a clip. An empty clip gives neutral figures.
pub fn measure(clip: &Clip) -> Quality {
    let postures = &clip.motion.postures;
    let poses: Vec<Pose> = postures.iter().map(Posture::pose).collect();
    let mut q = Quality {
        toe_slide: 0.0,
        lowest_foot_point: f32::INFINITY,
        knee: [f32::INFINITY, f32::NEG_INFINITY],
        elbow: [f32::INFINITY, f32::NEG_INFINITY],
        off_hinge: 0.0,
        hip: 0.0,
        ankle: 0.0,
        spine: 0.0,
        neck: 0.0,
        joint_speed: 0.0,
        fastest_joint: Joint::Hips,
        joint_acceleration: 0.0,
        jerkiest_joint: Joint::Hips,
        knee_acceleration: 0.0,
        root_speed: 0.0,
        root_acceleration: 0.0,
        hand_to_thigh: f32::INFINITY,
        between_feet: f32::INFINITY,
    };
    let angle = |rotation: Quat| to_angle_axis(rotation).length().to_degrees();
    for (posture, pose) in postures.iter().zip(&poses) {
        let local = |joint: Joint| posture.rotations[joint.index()];
        for point in sole_points(pose) {
            q.lowest_foot_point = q.lowest_foot_point.min(point.z);
        }
        for (side, knee) in [Joint::LeftLeg, Joint::RightLeg].into_iter().enumerate() {
            let (flexion, off) = knee_flexion(local(knee));
            q.knee = [q.knee[0].min(flexion), q.knee[1].max(flexion)];
            q.off_hinge = q.off_hinge.max(off);
            let up = pose.position([Joint::LeftUpLeg, Joint::RightUpLeg][side]);
            for hand in Joint::HANDS {
                q.hand_to_thigh =
                    q.hand_to_thigh.min(distance_to_segment(pose.position(hand), up, pose.position(knee)));
            }
        }
        for elbow in [Joint::LeftForeArm, Joint::RightForeArm] {
            let flexion = elbow_flexion(posture, elbow);
            q.elbow = [q.elbow[0].min(flexion), q.elbow[1].max(flexion)];
        }
        for side in 0..2 {
            q.hip = q.hip.max(angle(local([Joint::LeftUpLeg, Joint::RightUpLeg][side])));
            q.ankle = q.ankle.max(angle(local(Joint::FEET[side])));
        }
        q.spine = q.spine.max(angle(local(Joint::Spine) * local(Joint::Spine1) * local(Joint::Spine2)));
        q.neck = q.neck.max(angle(local(Joint::Neck) * local(Joint::Head)));
        let middle =
            |s: usize| 0.5 * (pose.position(Joint::FEET[s]) + pose.position(Joint::TOES[s])).truncate();
        q.between_feet = q.between_feet.min(middle(0).distance(middle(1)));
    }
    for f in 1..postures.len() {
        for (side, toe) in Joint::TOES.into_iter().enumerate() {
            if clip.motion.contacts[f][side] == 1.0 && clip.motion.contacts[f - 1][side] == 1.0 {
                q.toe_slide = q.toe_slide.max(poses[f].position(toe).distance(poses[f - 1].position(toe)));
            }
        }
        let step = postures[f].root_position - postures[f - 1].root_position;
        q.root_speed = q.root_speed.max(step.truncate().length() * FRAME_RATE);
        if f >= 2 {
            let before = postures[f - 1].root_position - postures[f - 2].root_position;
            q.root_acceleration = q.root_acceleration.max((step - before).length() * FRAME_RATE * FRAME_RATE);
        }
    }
    for j in 0..JOINT_COUNT {
        let joint = Joint::ALL[j];
        let velocity = |f: usize| {
            to_angle_axis(postures[f].rotations[j].inverse() * postures[f + 1].rotations[j])
                * (FRAME_RATE.to_degrees())
        };
        let velocities: Vec<Vec3> = (0..postures.len().saturating_sub(1)).map(velocity).collect();
        for (f, v) in velocities.iter().enumerate() {
            if v.length() > q.joint_speed {
                (q.joint_speed, q.fastest_joint) = (v.length(), joint);
            }
            let Some(before) = f.checked_sub(1).map(|b| velocities[b]) else { continue };
            let acceleration = (*v - before).length() * FRAME_RATE;
            if acceleration > q.joint_acceleration {
                (q.joint_acceleration, q.jerkiest_joint) = (acceleration, joint);
            }
            if matches!(joint, Joint::LeftLeg | Joint::RightLeg) {
                q.knee_acceleration = q.knee_acceleration.max(acceleration);
            }
        }
    }
    q
}

/// What a person's body or a floor forbids; one sentence each. Empty is good.
///
/// The bounds hold for walking and sitting: knees 0–150° on their hinge, elbows to 150°, hips to 135°, ankles to 65°
/// (heel rise and toe-off included), spine 75°, neck 90°, toes that slide under a millimetre a frame, feet not below the floor.
pub fn faults(quality: &Quality) -> Vec<String> {
    let mut out = Vec::new();
    let mut check = |good: bool, text: String| {
        if !good {
            out.push(text);
        }
    };
    let q = quality;
    check(q.toe_slide < 0.001, format!("a planted toe slides by {:.1} mm in a frame", 1000.0 * q.toe_slide));
    check(
        q.lowest_foot_point > -0.001,
        format!("a foot is {:.1} mm below the floor", -1000.0 * q.lowest_foot_point),
    );
    check(
        q.knee[0] >= 0.0 && q.knee[1] <= 150.0,
        format!("a knee bends from {:.0}° to {:.0}°", q.knee[0], q.knee[1]),
    );
    check(q.elbow[1] <= 150.0, format!("an elbow bends to {:.0}°", q.elbow[1]));
    check(q.off_hinge < 2.0, format!("a knee turns {:.1}° off its hinge", q.off_hinge));
    check(q.hip <= 135.0, format!("a hip turns by {:.0}°", q.hip));
    check(q.ankle <= 65.0, format!("an ankle turns by {:.0}°", q.ankle));
    check(q.spine <= 75.0, format!("the spine turns by {:.0}°", q.spine));
    check(q.neck <= 90.0, format!("neck and head turn by {:.0}°", q.neck));
    check(
        q.hand_to_thigh > 0.06,
        format!("a wrist is {:.0} mm from the middle of a thigh", 1000.0 * q.hand_to_thigh),
    );
    check(q.between_feet > 0.06, format!("the feet pass at {:.0} mm", 1000.0 * q.between_feet));
    check(q.joint_speed <= 900.0, format!("{} turns at {:.0}°/s", q.fastest_joint.name(), q.joint_speed));
    check(q.knee_acceleration <= 12000.0, format!("a knee pops at {:.0}°/s²", q.knee_acceleration));
    check(
        q.joint_acceleration <= 15000.0,
        format!("{} jerks at {:.0}°/s²", q.jerkiest_joint.name(), q.joint_acceleration),
    );
    check(q.root_speed <= 2.5, format!("the root moves at {:.2} m/s", q.root_speed));
    check(q.root_acceleration <= 12.0, format!("the root accelerates at {:.1} m/s²", q.root_acceleration));
    out
}
