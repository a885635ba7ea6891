//! A reading tested against a body: knees bend backwards, toes point forward, both arms and legs have one left, and legs are
//! as long as legs are.

use glam::Vec3;

use super::joint_names::JointTable;
use super::mocap_file::{MocapFile, MocapPose};
use crate::motion::Joint;

use Joint::*;

/// Poses looked at, spread over the file.
const POSES: usize = 200;
/// A mean bend below this says nothing (sine of the angle): a stiff leg bends to both sides.
const LEAST_BEND: f64 = 0.03;
/// Knees or toes that speak for the other side by this much mean it.
const DECIDED: f32 = 0.3;

/// Thigh and shin together, in lengths of the trunk from the hips' line to the shoulders': 1.7 of adults, 1.1 of a child of
/// one year. Beyond these nobody is who walks.
const LEAST_LEGS: f32 = 0.85;
const MOST_LEGS: f32 = 3.5;

/// How knees and toes speak for the sides, −1 (the other way round) to 1; 0 where they say nothing.
///
/// A shin folds back about an axis that points to the body's left, and a foot stands forward of its shin: neither
/// needs to know what is up.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct SideVotes {
    pub knees: f32,
    pub toes: f32,
}

impl SideVotes {
    pub(crate) fn sum(&self) -> f32 {
        self.knees + self.toes
    }
}

/// The poses of a file that is looked at in samples, its leading rest pose left out.
pub(super) fn each_pose(file: &MocapFile, mut look: impl FnMut(&MocapPose)) {
    let mut pose = MocapPose::default();
    let first = file.leading_rest_frames();
    let step = ((file.frame_count() - first) / POSES).max(1);
    for frame in (first..file.frame_count()).step_by(step) {
        file.pose_at(frame as f64, &mut pose);
        look(&pose);
    }
}

pub(crate) fn side_votes(file: &MocapFile, table: &JointTable) -> SideVotes {
    // Σ of what speaks for the sides, Σ of its size, and how often.
    let (mut knees, mut toes) = ([0.0f64; 3], [0.0f64; 3]);
    each_pose(file, |pose| {
        let at = |j: Joint| table.get(j).map_or(Vec3::ZERO, |i| pose.positions[i]);
        let left = (at(LeftUpLeg) - at(RightUpLeg)).normalize_or_zero();
        for (side, [hip, knee]) in [[LeftUpLeg, LeftLeg], [RightUpLeg, RightLeg]].into_iter().enumerate() {
            let ankle = at(Joint::FEET[side]);
            let upper = (at(knee) - at(hip)).normalize_or_zero();
            let lower = (ankle - at(knee)).normalize_or_zero();
            let foot = (toe(file, table, pose, side) - ankle).normalize_or_zero();
            for (votes, axis) in [(&mut knees, upper.cross(lower)), (&mut toes, foot.cross(lower))] {
                votes[0] += f64::from(axis.dot(left));
                votes[1] += f64::from(axis.length());
                votes[2] += 1.0;
            }
        }
    });
    let share = |[sum, size, count]: [f64; 3]| {
        if size > LEAST_BEND * count { (sum / size) as f32 } else { 0.0 }
    };
    SideVotes { knees: share(knees), toes: share(toes) }
}

/// The toe's place: its joint, or the end of the foot's bone; the ankle where there is neither.
pub(super) fn toe(file: &MocapFile, table: &JointTable, pose: &MocapPose, side: usize) -> Vec3 {
    if let Some(toe) = table.get(Joint::TOES[side]) {
        return pose.positions[toe];
    }
    let foot = table.get(Joint::FEET[side]).unwrap_or_default();
    pose.positions[foot] + pose.rotations[foot] * file.joints[foot].end_site.unwrap_or_default()
}

/// Whether the left arm is on the left leg's side, −1 (on the other) to 1.
pub(crate) fn arms_against_legs(file: &MocapFile, table: &JointTable) -> f32 {
    let (mut sum, mut count) = (0.0, 0);
    each_pose(file, |pose| {
        let at = |j: Joint| table.get(j).map_or(Vec3::ZERO, |i| pose.positions[i]);
        let hips = (at(LeftUpLeg) - at(RightUpLeg)).normalize_or_zero();
        sum += hips.dot((at(LeftArm) - at(RightArm)).normalize_or_zero());
        count += 1;
    });
    sum / count.max(1) as f32
}

/// Tests how long the legs are beside the trunk: what a toy's short legs do, put on a person's, is nothing that a person does.
///
/// # Errors
/// A sentence where no person is made so.
pub(crate) fn check_legs(file: &MocapFile, table: &JointTable) -> Result<(), String> {
    let (mut legs, mut trunk) = (0.0f32, 0.0f32);
    each_pose(file, |pose| {
        let at = |j: Joint| table.get(j).map_or(Vec3::ZERO, |i| pose.positions[i]);
        let middle = |joints: [Joint; 2]| 0.5 * (at(joints[0]) + at(joints[1]));
        for [hip, knee, ankle] in [[LeftUpLeg, LeftLeg, LeftFoot], [RightUpLeg, RightLeg, RightFoot]] {
            legs += 0.5 * (at(hip).distance(at(knee)) + at(knee).distance(at(ankle)));
        }
        trunk += middle([LeftUpLeg, RightUpLeg]).distance(middle([LeftArm, RightArm]));
    });
    let lengths = legs / trunk;
    if lengths.is_nan() || (LEAST_LEGS..MOST_LEGS).contains(&lengths) {
        return Ok(());
    }
    Err(format!(
        "its legs are {lengths:.1} times as long as its trunk, a person's about 1.7 times: it is a figure of other proportions, \
         or its joints are not what they are called."
    ))
}

/// Puts exchanged sides right and says so.
///
/// # Errors
/// A sentence where the joints cannot be those of a person.
pub(crate) fn mend_sides(file: &MocapFile, table: &mut JointTable) -> Result<Option<String>, String> {
    let votes = side_votes(file, table);
    let against = |vote: f32| vote < -DECIDED;
    let mut mended = Vec::new();
    match (against(votes.knees), against(votes.toes)) {
        (true, _) if votes.toes > DECIDED => {
            return Err("its knees bend forward of its toes: it is not a person, or its joints are not what they are called.".into());
        }
        (_, true) if votes.knees > DECIDED => {
            return Err("its toes point backwards from its knees: it is not a person, or its joints are not what they are called.".into());
        }
        (true, _) | (_, true) => {
            table.exchange_legs();
            mended.push("legs");
        }
        _ => {}
    }
    if arms_against_legs(file, table) < -DECIDED {
        table.exchange_arms();
        mended.push("arms");
    }
    let what = mended.join(" and ");
    Ok((!mended.is_empty()).then(|| {
        format!("left and right {what} were exchanged: as it stands its knees bend or its shoulders face the wrong way.")
    }))
}
