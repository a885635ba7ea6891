//! A file read in our axes and at our frame rate.

use glam::{Quat, Vec2, Vec3};

use super::joint_names::JointTable;
use super::mocap_file::{MocapFile, MocapPose};
use super::up_axis::UpAxis;
use crate::motion::skeleton::LEG_LENGTH;
use crate::motion::{FRAME_RATE, Joint};

use Joint::*;

/// A file read at 30 Hz in our axes, scaled so that its legs are as long as ours.
pub struct Sampler<'a> {
    file: &'a MocapFile,
    /// Which of the file's joints are ours.
    pub table: &'a JointTable,
    up: UpAxis,
    /// Our metres for one unit of the file.
    pub scale: f32,
    first: usize,
    /// Takes the file's floor, which some captures tilt by a degree, to the level.
    level: Quat,
    /// What is added to the places of each frame, where a walk on the spot got its way back.
    way: Vec<Vec2>,
    /// Where the file's joints are, in its own axes and unit.
    pub pose: MocapPose,
}

impl<'a> Sampler<'a> {
    /// # Errors
    /// A sentence where the legs have no length.
    pub fn new(file: &'a MocapFile, table: &'a JointTable, up: UpAxis) -> Result<Self, String> {
        let length = leg_length(file, table);
        if !(1e-4..1e6).contains(&length) {
            return Err("its legs have no length.".into());
        }
        let scale = 2.0 * LEG_LENGTH / length;
        let first = file.leading_rest_frames();
        Ok(Self {
            file,
            table,
            up,
            scale,
            first,
            level: Quat::IDENTITY,
            way: Vec::new(),
            pose: MocapPose::default(),
        })
    }

    /// From now on the floor of this slope is level.
    pub fn set_floor(&mut self, slope: Vec2) {
        self.level = Quat::from_rotation_arc(Vec3::new(-slope.x, -slope.y, 1.0).normalize(), Vec3::Z);
    }

    /// From now on frame by frame this way over the floor is added, in our metres and axes.
    pub(super) fn set_way(&mut self, way: Vec<Vec2>) {
        self.way = way;
    }

    /// The file's own skeleton and motion.
    pub(super) fn file(&self) -> &'a MocapFile {
        self.file
    }

    /// Frames at 30 Hz.
    pub fn frame_count(&self) -> usize {
        let seconds = (self.file.frame_count() - 1 - self.first) as f64 / self.file.frame_rate;
        (seconds * f64::from(FRAME_RATE) + 1e-3).floor() as usize + 1
    }

    /// The frame of the file at frame `frame` of ours.
    pub fn file_frame(&self, frame: usize) -> f64 {
        self.first as f64 + frame as f64 * self.file.frame_rate / f64::from(FRAME_RATE)
    }

    /// Fills `pose` with frame `frame` at 30 Hz.
    pub fn sample(&mut self, frame: usize) {
        let mut at = self.file_frame(frame);
        if (at - at.round()).abs() < 1e-3 {
            at = at.round();
        }
        self.file.pose_at(at, &mut self.pose);
        let turn = self.level * self.up.to_z();
        let way = self.way.get(frame).copied().unwrap_or_default().extend(0.0);
        for p in &mut self.pose.positions {
            *p = turn * (*p * self.scale) + way;
        }
        for r in &mut self.pose.rotations {
            *r = turn * *r;
        }
    }

    /// Where one of our joints is, in the file's axes and unit.
    pub fn position(&self, joint: Joint) -> Option<Vec3> {
        self.table.get(joint).map(|i| self.pose.positions[i])
    }

    /// How one of our joints is turned, in the file's axes.
    pub fn rotation(&self, joint: Joint) -> Option<Quat> {
        self.table.get(joint).map(|i| self.pose.rotations[i])
    }

    /// Position of a joint that every table has.
    pub(super) fn at(&self, joint: Joint) -> Vec3 {
        self.position(joint).unwrap_or_default()
    }

    /// The toe's place: its joint, or the end of the foot's bone.
    pub(super) fn toe(&self, side: usize) -> Vec3 {
        let (toe, foot) = (Joint::TOES[side], Joint::FEET[side]);
        if let Some(p) = self.position(toe)
            && p.distance(self.at(foot)) > 0.02
        {
            return p;
        }
        let index = self.table.get(foot).unwrap_or_default();
        let end = self.file.joints[index].end_site.unwrap_or_default();
        self.at(foot) + self.pose.rotations[index] * (end * self.scale)
    }
}

/// Length of thigh and shin in the file's unit, mean of both legs.
pub fn leg_length(file: &MocapFile, table: &JointTable) -> f32 {
    let mut pose = MocapPose::default();
    file.pose_at(0.0, &mut pose);
    let at = |j: Joint| table.get(j).map_or(Vec3::ZERO, |i| pose.positions[i]);
    [[LeftUpLeg, LeftLeg, LeftFoot], [RightUpLeg, RightLeg, RightFoot]]
        .map(|[hip, knee, ankle]| at(hip).distance(at(knee)) + at(knee).distance(at(ankle)))
        .iter()
        .sum::<f32>()
        / 2.0
}
