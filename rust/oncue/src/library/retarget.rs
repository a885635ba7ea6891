//! From a file's own skeleton to the unified one.
//!
//! Global bone directions are the file's, twist included ([`super::calibration`]). The root moves as the
//! file's, scaled by the ratio of the leg lengths, and the ankles are put by IK exactly where the file's
//! ankles are at that scale, so that feet slide no more than they did. Then the floor is brought to z = 0.

use glam::{Quat, Vec3};

use super::calibration::Calibration;
use super::foot;
use super::mocap_file::MocapFile;
use super::sampler::Sampler;
use crate::math::curve::smoothstep;
use crate::motion::skeleton::{JOINT_OFFSET, PARENT, TOE_HEIGHT};
use crate::motion::{FRAME_RATE, Joint, Motion, Posture};

/// Units that files come in: name, metres. The last is cgspeed's conversion of CMU.
const UNITS: [(&str, f32); 5] =
    [("m", 1.0), ("cm", 0.01), ("inch", 0.0254), ("mm", 0.001), ("0.45 inch", 0.0564)];

/// The unit in which legs of this length are a person's (0.6 to 1.1 m; an adult's 0.85 is preferred).
pub fn recognize_unit(leg_length: f32) -> Option<(&'static str, f32)> {
    UNITS.into_iter().filter(|(_, metres)| (0.6..1.1).contains(&(leg_length * metres))).min_by(|a, b| {
        let off = |metres: f32| (leg_length * metres / 0.85).ln().abs();
        off(a.1).total_cmp(&off(b.1))
    })
}

/// Retargets a file; contacts are still empty.
///
/// Out: 30 Hz, feet on z = 0, heading as in the file.
pub(crate) fn retarget(sampler: &mut Sampler, calibration: &Calibration) -> Motion {
    let count = sampler.frame_count();
    let mut motion = Motion::default();
    let mut ankles: Vec<[Vec3; 2]> = Vec::with_capacity(count);
    for frame in 0..count {
        sampler.sample(frame);
        motion.postures.push(posture(sampler, calibration));
        ankles.push(Joint::FEET.map(|j| sampler.position(j).unwrap_or_default()));
    }
    let (lift, ankle_lift) = floor(&motion, &ankles);
    for (posture, ankles) in motion.postures.iter_mut().zip(&ankles) {
        posture.root_position.z += lift;
        for side in 0..2 {
            let pose = posture.pose();
            let foot_rotation = pose.rotation(Joint::FEET[side]);
            let target = ankles[side] + Vec3::new(0.0, 0.0, ankle_lift[side]);
            foot::reach(posture, &pose, side, target, foot_rotation);
        }
    }
    foot::align_signs(&mut motion);
    motion
}

/// Drops up to two frames at the end in which the body jerks to a halt: captures often end in a frame that was
/// filtered against nothing.
pub(crate) fn trim_end(motion: &mut Motion) {
    for _ in 0..2 {
        let [.., a, b, c] = motion.postures.as_slice() else { return };
        let jerk = (c.root_position - b.root_position) - (b.root_position - a.root_position);
        if jerk.length() * FRAME_RATE * FRAME_RATE < 8.0 {
            return;
        }
        motion.postures.pop();
    }
}

/// One posture from the sampled pose.
fn posture(s: &Sampler, c: &Calibration) -> Posture {
    let mut global = [Quat::IDENTITY; crate::motion::JOINT_COUNT];
    let turned = |joint: Joint| Some(s.rotation(joint)? * c.joints[joint.index()]?);
    let hips = turned(Joint::Hips).unwrap_or_default();
    // The file's spine as a curve of rotations from the hips to the chest, read at our three joints.
    let curve: Vec<Quat> = std::iter::once(hips)
        .chain(s.table.spine.iter().zip(&c.spine).map(|(&joint, c)| s.pose.rotations[joint] * *c))
        .collect();
    let along = |u: f32| {
        let at = u * (curve.len() - 1) as f32;
        let i = (at.floor() as usize).min(curve.len().saturating_sub(2));
        match curve.get(i + 1) {
            Some(next) => curve[i].slerp(*next, at - i as f32),
            None => curve[i],
        }
    };
    for joint in Joint::ALL {
        let parent = PARENT[joint.index()];
        global[joint.index()] = match joint {
            Joint::Hips => hips,
            Joint::Spine => along(1.0 / 3.0),
            Joint::Spine1 => along(2.0 / 3.0),
            Joint::Spine2 => along(1.0),
            _ => turned(joint).unwrap_or(global[parent]),
        };
    }
    for (upper, lower, bone, hinge) in [
        (Joint::LeftArm, Joint::LeftForeArm, Vec3::X, Vec3::NEG_Z),
        (Joint::RightArm, Joint::RightForeArm, Vec3::NEG_X, Vec3::Z),
    ] {
        let (a, b) = (global[upper.index()], global[lower.index()]);
        global[upper.index()] = roll_to_hinge(a, b, bone, hinge) * a;
    }
    let middle = (s.position(Joint::LeftUpLeg).unwrap_or_default()
        + s.position(Joint::RightUpLeg).unwrap_or_default())
        / 2.0;
    let mut posture =
        Posture { root_position: middle + hips * Vec3::new(0.0, 0.0, 0.02), ..Default::default() };
    posture.rotations[0] = hips.normalize();
    for joint in 1..global.len() {
        posture.rotations[joint] = (global[PARENT[joint]].inverse() * global[joint]).normalize();
    }
    posture
}

/// The roll about the upper arm that turns its hinge into the plane in which the elbow really bends.
///
/// Captured upper arms roll with the soft tissue or not at all. A nearly straight arm shows no plane and keeps
/// its roll, as does one that seems to bend backwards.
fn roll_to_hinge(upper: Quat, lower: Quat, bone: Vec3, hinge: Vec3) -> Quat {
    let along = upper * bone;
    let bend = along.cross(lower * bone);
    let is = upper * hinge;
    let angle = along.dot(is.cross(bend)).atan2(is.dot(bend));
    let trust = smoothstep((bend.length() - 0.1) / 0.3) * smoothstep((2.4 - angle.abs()) / 0.8);
    Quat::from_axis_angle(along.normalize_or(Vec3::Z), angle * trust)
}

/// How far to lift the whole body, and each ankle, so that planted feet stand on z = 0.
///
/// The ball of a foot keeps its height while the foot stands on it, flat or not, so the median height of still
/// balls is the floor; each foot has its own, since files differ in where a foot's joints sit. Without such
/// frames the lowest points of the feet decide.
fn floor(motion: &Motion, ankles: &[[Vec3; 2]]) -> (f32, [f32; 2]) {
    let balls: Vec<[Vec3; 2]> = motion
        .postures
        .iter()
        .zip(ankles)
        .map(|(posture, ankles)| {
            let pose = posture.pose();
            [0, 1].map(|side| {
                ankles[side] + pose.rotation(Joint::FEET[side]) * JOINT_OFFSET[Joint::TOES[side].index()]
            })
        })
        .collect();
    let heights = [0, 1].map(|side| {
        let mut still: Vec<f32> = (1..balls.len().saturating_sub(1))
            .filter(|&f| balls[f + 1][side].distance(balls[f - 1][side]) * FRAME_RATE / 2.0 < 0.2)
            .map(|f| balls[f][side].z)
            .collect();
        still.sort_unstable_by(f32::total_cmp);
        // Below the middle: still feet on a chair or in a kneel lie higher.
        (still.len() >= 5).then(|| still[still.len() * 2 / 5])
    });
    let lowest = || {
        let mut lows: Vec<f32> = motion
            .postures
            .iter()
            .map(|p| {
                let pose = p.pose();
                (0..2).flat_map(|side| foot::sole(&pose, side)).map(|p| p.z).fold(f32::MAX, f32::min)
            })
            .collect();
        lows.sort_unstable_by(f32::total_cmp);
        -lows[lows.len() / 20]
    };
    let to = |height: f32| TOE_HEIGHT - height;
    match heights {
        [Some(a), Some(b)] if (a - b).abs() < 0.06 => (to((a + b) / 2.0), [to(a), to(b)]),
        // Feet that differ by more stand on different heights (a step, a kneel): trust the lower.
        [Some(a), Some(b)] => (to(a.min(b)), [to(a.min(b)); 2]),
        [Some(a), None] | [None, Some(a)] => (to(a), [to(a); 2]),
        [None, None] => {
            let lift = lowest();
            (lift, [lift; 2])
        }
    }
}

/// A key that two files share when they have the same skeleton: names and offsets.
pub(crate) fn skeleton_key(file: &MocapFile) -> String {
    let mut key = String::new();
    for (i, joint) in file.joints.iter().enumerate() {
        // The root's offset is often where the take begins.
        let offset = if i == 0 { Vec3::ZERO } else { joint.offset };
        key.push_str(&format!("{}:{:.2},{:.2},{:.2};", joint.name, offset.x, offset.y, offset.z));
    }
    key
}
