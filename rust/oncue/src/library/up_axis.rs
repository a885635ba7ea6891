//! Which of six axes of a file points up: the one along which the head stands over the feet.

use std::f32::consts::{FRAC_PI_2, PI};

use glam::{Quat, Vec3};

use super::body;
use super::joint_names::JointTable;
use super::mocap_file::MocapFile;
use crate::motion::Joint;

use Joint::*;

/// Which axis of a file points up.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum UpAxis {
    /// Y is up.
    #[serde(rename = "y", alias = "+y", alias = "Y", alias = "+Y")]
    Y,
    /// Z is up.
    #[serde(rename = "z", alias = "+z", alias = "Z", alias = "+Z")]
    Z,
    /// X is up.
    #[serde(rename = "x", alias = "+x", alias = "X", alias = "+X")]
    X,
    /// Y is down, as in the coordinates of a camera.
    #[serde(rename = "-y", alias = "-Y")]
    MinusY,
    /// Z is down.
    #[serde(rename = "-z", alias = "-Z")]
    MinusZ,
    /// X is down.
    #[serde(rename = "-x", alias = "-X")]
    MinusX,
}

impl UpAxis {
    /// All of them; of two as likely the earlier is meant.
    pub const ALL: [UpAxis; 6] =
        [UpAxis::Y, UpAxis::Z, UpAxis::X, UpAxis::MinusY, UpAxis::MinusZ, UpAxis::MinusX];

    /// Its direction in the file's axes.
    pub fn direction(self) -> Vec3 {
        match self {
            UpAxis::Y => Vec3::Y,
            UpAxis::Z => Vec3::Z,
            UpAxis::X => Vec3::X,
            UpAxis::MinusY => Vec3::NEG_Y,
            UpAxis::MinusZ => Vec3::NEG_Z,
            UpAxis::MinusX => Vec3::NEG_X,
        }
    }

    /// The turn that takes it to our +Z.
    pub(crate) fn to_z(self) -> Quat {
        match self {
            UpAxis::Y => Quat::from_rotation_x(FRAC_PI_2),
            UpAxis::Z => Quat::IDENTITY,
            UpAxis::X => Quat::from_rotation_y(-FRAC_PI_2),
            UpAxis::MinusY => Quat::from_rotation_x(-FRAC_PI_2),
            UpAxis::MinusZ => Quat::from_rotation_x(PI),
            UpAxis::MinusX => Quat::from_rotation_y(FRAC_PI_2),
        }
    }

    /// As a mapping file writes it.
    pub(crate) fn name(self) -> &'static str {
        match self {
            UpAxis::Y => "y",
            UpAxis::Z => "z",
            UpAxis::X => "x",
            UpAxis::MinusY => "-y",
            UpAxis::MinusZ => "-z",
            UpAxis::MinusX => "-x",
        }
    }
}

/// How much the motion speaks for each of [`UpAxis::ALL`].
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct UpScores([f64; 6]);

impl UpScores {
    /// A mapping file said it.
    pub(crate) fn told(axis: UpAxis) -> Self {
        Self(UpAxis::ALL.map(|a| if a == axis { 1e9 } else { 0.0 }))
    }

    pub(crate) fn of(file: &MocapFile, table: &JointTable) -> Self {
        let mut scores = [0.0; 6];
        body::each_pose(file, |pose| {
            let at = |j: Joint| table.get(j).map_or(Vec3::ZERO, |i| pose.positions[i]);
            let head = if table.get(Head).is_some() { at(Head) } else { (at(LeftArm) + at(RightArm)) / 2.0 };
            let up = (head - (at(LeftFoot) + at(RightFoot)) / 2.0).normalize_or_zero();
            for (score, axis) in scores.iter_mut().zip(UpAxis::ALL) {
                *score += f64::from((up.dot(axis.direction()) - 0.7).max(0.0));
            }
        });
        Self(scores)
    }

    pub(crate) fn add(&mut self, other: &UpScores) {
        for (a, b) in self.0.iter_mut().zip(other.0) {
            *a += b;
        }
    }

    /// Only what speaks for Y and Z: who lies or crawls in such a file has his head along another axis.
    pub(crate) fn usual(mut self) -> Self {
        self.0[2..].fill(0.0);
        self
    }

    /// The axis for which most speaks; Y where nothing does.
    pub(crate) fn axis(&self) -> UpAxis {
        let mut best = 0;
        for i in 1..self.0.len() {
            if self.0[i] > self.0[best] {
                best = i;
            }
        }
        UpAxis::ALL[best]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_usual_axes_are_y_and_z() {
        let lying = UpScores([0.1, 0.2, 9.0, 0.0, 0.0, 0.0]);
        assert_eq!((lying.axis(), lying.usual().axis()), (UpAxis::X, UpAxis::Z));
    }

    #[test]
    fn each_axis_is_taken_to_z_and_keeps_its_name() {
        for axis in UpAxis::ALL {
            assert!((axis.to_z() * axis.direction()).distance(Vec3::Z) < 1e-6, "{axis:?}");
            let read: UpAxis = serde_json::from_str(&format!("\"{}\"", axis.name())).unwrap();
            assert_eq!(read, axis);
            assert_eq!(UpScores::told(axis).axis(), axis);
        }
        assert_eq!(UpScores::default().axis(), UpAxis::Y);
        assert_eq!(serde_json::from_str::<UpAxis>("\"+X\"").unwrap(), UpAxis::X);
        assert!(serde_json::from_str::<UpAxis>("\"up\"").is_err());
    }
}
