//! How a manifold is trained: every constant with its source.

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::range::check_ranges;

/// Windows that one thread takes at a time.
pub(super) const CHUNK_WINDOWS: usize = 16;

/// Bytes of the sentence in the header of a manifold's file.
const LONGEST_ORIGIN: usize = 4096;

/// How a manifold is trained. The paper's values where it gives them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ManifoldSettings {
    /// Channels of each layer's output (paper: 256; half of them give joints within a centimetre).
    pub channels: usize,
    /// Passes over the training windows (released: 250).
    pub epochs: u32,
    /// Share of the epochs in which L_pos is measured with the root at the origin ("the early epochs").
    pub centred: f32,
    /// Windows of one step (released: 128).
    pub batch: usize,
    /// Adam's rate after the warm-up…
    pub learning_rate: f32,
    /// …and at the end, reached along a cosine (paper: 1e-4 throughout).
    pub final_learning_rate: f32,
    /// Scale of the normal noise on the normalized input (paper: 0.01).
    pub noise: f32,
    /// Share of the training windows that are changed as `augment` does (paper: none).
    pub augmented: f32,
    /// How often a captured window is taken for each time that a procedural one is.
    pub mocap_repeats: usize,
    /// Frames between the starts of two windows (released: 10).
    pub stride: usize,
    /// w_c (released: 0.5).
    pub contact_weight: f32,
    /// w_r (released: 1).
    pub root_weight: f32,
    /// w_q (released: 1).
    pub rotation_weight: f32,
    /// w_p (released: 1.3).
    pub position_weight: f32,
    /// What of w_p the joints' places along the given-back path have, after the early epochs, beside their places
    /// about the root (paper: all of it, in place of those). A step's error moves every later frame, so that the
    /// whole weight would drown the postures.
    pub path_share: f32,
    /// Share of the clips that only measure the finished manifold (paper: 0.18 of the windows).
    pub test_share: f32,
    /// Share of the clips that the curve is measured on (paper: 0.085 of the windows).
    pub validation_share: f32,
    /// A sentence for the header of the file: the data, and the command that made it.
    pub origin: String,
}

impl Default for ManifoldSettings {
    fn default() -> Self {
        Self {
            channels: 128,
            epochs: 24,
            centred: 0.75,
            batch: 32,
            learning_rate: 1e-4,
            final_learning_rate: 1e-6,
            noise: 0.01,
            augmented: 0.5,
            mocap_repeats: 2,
            stride: 10,
            contact_weight: 0.5,
            root_weight: 1.0,
            rotation_weight: 1.0,
            position_weight: 1.3,
            path_share: 0.001,
            test_share: 0.1,
            validation_share: 0.05,
            origin: String::new(),
        }
    }
}

impl ManifoldSettings {
    /// # Errors
    /// [`Error::Input`] naming the first value that makes no sense.
    pub fn validate(&self) -> Result<()> {
        const WEIGHT: std::ops::RangeInclusive<f32> = 0.0..=1e3;
        const SHARE: std::ops::RangeInclusive<f32> = 0.0..=1.0;
        check_ranges!(
            self,
            "manifold",
            ManifoldSettings {
                channels: 1..=1024,
                epochs: 1..=100_000,
                centred: SHARE,
                batch: CHUNK_WINDOWS..=4096,
                learning_rate: SHARE,
                final_learning_rate: SHARE,
                noise: 0.0..=10.0,
                augmented: SHARE,
                mocap_repeats: 1..=100,
                stride: 1..=10_000,
                contact_weight: WEIGHT,
                root_weight: WEIGHT,
                rotation_weight: WEIGHT,
                position_weight: WEIGHT,
                path_share: SHARE,
                test_share: SHARE,
                validation_share: SHARE,
            },
            free { origin }
        );
        if !self.batch.is_multiple_of(CHUNK_WINDOWS) {
            return Err(Error::input(format!(
                "The setting manifold.batch is {}; it must be a multiple of {CHUNK_WINDOWS}.",
                self.batch
            )));
        }
        if self.test_share + self.validation_share > 0.9 {
            return Err(Error::input(
                "The settings manifold.test_share and manifold.validation_share must leave a tenth for the training: together they \
                 are at most 0.9.",
            ));
        }
        if self.origin.len() > LONGEST_ORIGIN {
            return Err(Error::input(format!(
                "The setting manifold.origin is {} letters long; it must be a sentence of at most {LONGEST_ORIGIN}.",
                self.origin.len()
            )));
        }
        Ok(())
    }
}
