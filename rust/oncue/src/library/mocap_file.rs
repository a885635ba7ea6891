//! Motion capture files: a `.bvh`'s joints and numbers, and the poses that they stand for.

use std::path::Path;

use glam::{Quat, Vec3};

use super::mocap_text::{self, Channel, MocapText};
use super::rest_skeleton::RestBone;
use crate::error::{Error, Result};

/// Larger files are refused before they are read.
const MAX_BYTES: u64 = 1 << 30;

/// A joint of the file's own skeleton.
#[derive(Debug, Clone, PartialEq)]
pub struct MocapJoint {
    /// As the file spells it.
    pub name: String,
    pub parent: Option<usize>,
    /// From the parent's joint, in the file's unit and axes.
    pub offset: Vec3,
    /// End of the last bone, in the joint's frame; only leaves have one.
    pub end_site: Option<Vec3>,
    /// Column of each position channel that the joint has.
    position: [Option<usize>; 3],
    /// Axis and column of each rotation channel, in the file's order.
    rotation: Vec<(usize, usize)>,
    /// The position channels stand in place of the offset (they are not all zero).
    position_used: bool,
}

/// A `.bvh` file in its own unit, axes and frame rate.
#[derive(Debug, Clone, PartialEq)]
pub struct MocapFile {
    /// Parents before children.
    pub joints: Vec<MocapJoint>,
    /// Frames a second.
    pub frame_rate: f64,
    channel_count: usize,
    /// Row by row.
    values: Vec<f32>,
}

/// Every joint's place and rotation in the file's own axes and unit.
#[derive(Debug, Clone, Default)]
pub struct MocapPose {
    pub positions: Vec<Vec3>,
    pub rotations: Vec<Quat>,
}

/// Reads a `.bvh` file.
///
/// # Errors
/// [`Error::Io`] where the system refuses it, [`Error::MocapFile`] with a sentence for anything that is not
/// a usable `.bvh`; never a panic.
pub fn read(path: &Path) -> Result<MocapFile> {
    let size = std::fs::metadata(path).map_err(|e| Error::io(path, e))?.len();
    if size > MAX_BYTES {
        return Err(Error::MocapFile {
            file: path.into(),
            reason: format!("it is {} MB large; {} MB at most are read.", size >> 20, MAX_BYTES >> 20),
        });
    }
    let bytes = std::fs::read(path).map_err(|e| Error::io(path, e))?;
    parse(&bytes).map_err(|reason| Error::MocapFile { file: path.into(), reason })
}

/// Reads the bytes of a `.bvh` file. The error is a sentence without the file's name.
pub(crate) fn parse(bytes: &[u8]) -> std::result::Result<MocapFile, String> {
    mocap_text::read(bytes).map(MocapFile::from)
}

impl From<MocapText> for MocapFile {
    fn from(text: MocapText) -> Self {
        let MocapText { joints, frame_time, channel_count, values } = text;
        let moves = |column: usize| values.iter().skip(column).step_by(channel_count).any(|v| v.abs() > 1e-6);
        let mut columns = 0..channel_count;
        let joints = joints
            .into_iter()
            .map(|joint| {
                let (mut position, mut rotation) = ([None; 3], Vec::new());
                for (channel, column) in joint.channels.iter().zip(&mut columns) {
                    match *channel {
                        Channel::Position(axis) => position[axis] = Some(column),
                        Channel::Rotation(axis) => rotation.push((axis, column)),
                    }
                }
                // Some exporters give every joint position channels and leave them at zero.
                let position_used =
                    joint.parent.is_none() || position.iter().flatten().any(|&column| moves(column));
                MocapJoint {
                    name: joint.name,
                    parent: joint.parent,
                    offset: Vec3::from(joint.offset),
                    end_site: joint.end_site.map(Vec3::from),
                    position,
                    rotation,
                    position_used,
                }
            })
            .collect();
        let rate = 1.0 / frame_time;
        // 0.0333333 and .0083333 are meant as 30 and 120 Hz.
        let frame_rate = if (rate - rate.round()).abs() < 2e-3 * rate.round() { rate.round() } else { rate };
        Self { joints, frame_rate, channel_count, values }
    }
}

impl MocapFile {
    /// One frame of a skeleton at rest, its bones as joints: parents before children, metres, +Z up.
    pub(crate) fn at_rest(bones: &[RestBone]) -> Self {
        let joints = bones
            .iter()
            .map(|bone| MocapJoint {
                name: bone.name.clone(),
                parent: bone.parent,
                offset: bone.head - bone.parent.map_or(Vec3::ZERO, |parent| bones[parent].head),
                end_site: Some(bone.tail - bone.head),
                position: [None; 3],
                rotation: Vec::new(),
                position_used: false,
            })
            .collect();
        Self { joints, frame_rate: 1.0, channel_count: 1, values: vec![0.0] }
    }

    pub fn frame_count(&self) -> usize {
        self.values.len() / self.channel_count
    }

    /// Seconds from the first frame to the last.
    pub fn duration(&self) -> f64 {
        (self.frame_count() - 1) as f64 / self.frame_rate
    }

    /// Rotation of a joint relative to its parent.
    fn rotation(&self, joint: &MocapJoint, row: &[f32]) -> Quat {
        joint.rotation.iter().fold(Quat::IDENTITY, |q, &(axis, column)| {
            let angle = row[column].to_radians();
            q * match axis {
                0 => Quat::from_rotation_x(angle),
                1 => Quat::from_rotation_y(angle),
                _ => Quat::from_rotation_z(angle),
            }
        })
    }

    /// Place of a joint relative to its parent. A root's OFFSET is never added to its position channels:
    /// files differ in whether it is meant (ACCAD's is not), and the floor is found from the feet anyway.
    fn translation(joint: &MocapJoint, row: &[f32]) -> Vec3 {
        if !joint.position_used {
            return joint.offset;
        }
        let channel = |axis: usize| joint.position[axis].map_or(joint.offset[axis], |column| row[column]);
        Vec3::new(channel(0), channel(1), channel(2))
    }

    /// Forward kinematics at `frame`, which may lie between two frames (rotations by slerp).
    pub fn pose_at(&self, frame: f64, out: &mut MocapPose) {
        let last = self.frame_count() - 1;
        let frame = frame.clamp(0.0, last as f64);
        let first = frame.floor() as usize;
        let t = (frame - first as f64) as f32;
        let row = |f: usize| &self.values[f * self.channel_count..(f + 1) * self.channel_count];
        let (a, b) = (row(first), row((first + 1).min(last)));
        out.positions.clear();
        out.rotations.clear();
        for joint in &self.joints {
            let (mut rotation, mut translation) = (self.rotation(joint, a), Self::translation(joint, a));
            if t > 1e-4 {
                rotation = rotation.slerp(self.rotation(joint, b), t);
                translation = translation.lerp(Self::translation(joint, b), t);
            }
            if let Some(parent) = joint.parent {
                translation = out.positions[parent] + out.rotations[parent] * translation;
                rotation = (out.rotations[parent] * rotation).normalize();
            }
            out.positions.push(translation);
            out.rotations.push(rotation);
        }
    }

    /// How many frames at the start are a rest pose from which the motion jumps: 0 or 1.
    pub fn leading_rest_frames(&self) -> usize {
        if self.frame_count() < 8 {
            return 0;
        }
        let change = |f: usize| -> f32 {
            let row = |f: usize| &self.values[f * self.channel_count..(f + 1) * self.channel_count];
            self.joints
                .iter()
                .map(|j| self.rotation(j, row(f)).angle_between(self.rotation(j, row(f + 1))))
                .sum::<f32>()
                / self.joints.len() as f32
        };
        let later = (1..self.frame_count().min(30) - 1).map(change).fold(0.0, f32::max);
        usize::from(change(0) > 0.03 && change(0) > 4.0 * later)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PENDULUM: &str = "HIERARCHY\nROOT Hips\n{\nOFFSET 5 5 5\nCHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation\nJOINT Arm\n{\nOFFSET 0 10 0\nCHANNELS 3 Zrotation Xrotation Yrotation\nEnd Site\n{\nOFFSET 0 5 0\n}\n}\nJOINT Other\n{\nOFFSET 1 0 0\nCHANNELS 3 Zrotation Xrotation Yrotation\nEnd Site\n{\nOFFSET 0 5 0\n}\n}\n}\nMOTION\nFrames: 2\nFrame Time: .0083333\n1 2 3 90 0 0 0 0 0 0 0 0\n1 2 3 0 0 0 0 90 0 0 0 0\n";

    #[test]
    fn forward_kinematics_by_hand() {
        let file = parse(PENDULUM.as_bytes()).unwrap();
        assert_eq!(file.frame_rate, 120.0);
        assert_eq!(file.joints[2].parent, Some(0));
        assert_eq!(file.joints[1].end_site, Some(Vec3::new(0.0, 5.0, 0.0)));
        let mut pose = MocapPose::default();
        file.pose_at(0.0, &mut pose);
        // The root's offset is not added; a quarter turn about Z takes +Y to -X.
        assert!(pose.positions[0].distance(Vec3::new(1.0, 2.0, 3.0)) < 1e-5);
        assert!(pose.positions[1].distance(Vec3::new(-9.0, 2.0, 3.0)) < 1e-5);
        assert!(pose.positions[2].distance(Vec3::new(1.0, 3.0, 3.0)) < 1e-5);
        // Half-way: an eighth turn.
        file.pose_at(0.5, &mut pose);
        let half = std::f32::consts::FRAC_1_SQRT_2 * 10.0;
        assert!(pose.positions[1].distance(Vec3::new(1.0 - half, 2.0 + half, 3.0)) < 1e-4);
        file.pose_at(1.0, &mut pose);
        let arm = pose.rotations[1] * Vec3::Y;
        assert!(arm.distance(Vec3::Z) < 1e-5, "{arm}");
    }
}
