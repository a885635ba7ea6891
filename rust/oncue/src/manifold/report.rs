//! What a training came to.

use serde::{Deserialize, Serialize};

use super::settings::ManifoldSettings;

/// How well a manifold gives windows back that it was not trained on.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct ReconstructionFigures {
    /// Windows that were given back.
    pub windows: usize,
    /// Mean distance of a joint from its place, the root's planar path taken from the input, centimetres.
    pub joint_error_cm: f32,
    /// The same with the path as it was given back, from the window's first frame on, centimetres.
    pub path_joint_error_cm: f32,
    /// Mean angle of a joint's rotation, relative to its parent, from what it was, degrees.
    pub rotation_error_degrees: f32,
    /// Share of foot contacts that round to the right one of 0, 0.5 and 1.
    pub contact_accuracy: f32,
    /// Mean planar distance of the root from its place in the last frame, centimetres.
    pub root_drift_cm: f32,
}

/// One epoch of the training. The loss of the later epochs has the path in it, which those before have not.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct ManifoldEpoch {
    /// Which epoch it was, from 1.
    pub epoch: u32,
    /// Mean L_recon over the epoch's windows.
    pub loss: f32,
    /// On the validation clips.
    pub validation: ReconstructionFigures,
}

/// What a training came to, kept in the manifold's file.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct TrainingReport {
    /// Checksum of the library.
    pub library: String,
    /// Seed of the training.
    pub seed: u64,
    /// How it was trained.
    pub settings: ManifoldSettings,
    /// Training, validation and test clips, mirror images included.
    pub clips: [usize; 3],
    /// Windows that were trained on.
    pub training_windows: usize,
    /// On the test clips, with the weights as they are written.
    pub test: ReconstructionFigures,
    /// On those of the test clips that were captured.
    pub test_mocap: ReconstructionFigures,
    /// On test windows changed as `augment` does: postures that no clip has.
    pub test_augmented: ReconstructionFigures,
    /// One point an epoch.
    pub curve: Vec<ManifoldEpoch>,
}
