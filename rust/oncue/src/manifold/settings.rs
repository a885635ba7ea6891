//! How a manifold is trained: every constant with its source.

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};

/// Windows that one thread takes at a time.
pub(super) const CHUNK: usize = 16;

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
    /// Share of the training windows that are changed as [`super::augment`] does (paper: none).
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
        let shares = [self.centred, self.augmented, self.test_share, self.validation_share];
        let scales = [
            self.learning_rate,
            self.final_learning_rate,
            self.noise,
            self.contact_weight,
            self.root_weight,
            self.rotation_weight,
            self.position_weight,
            self.path_share,
        ];
        let sentence = if !(1..=1024).contains(&self.channels) {
            format!("The manifold's channels are 1 to 1024, not {}.", self.channels)
        } else if self.epochs == 0 || self.stride == 0 || self.mocap_repeats == 0 {
            "The manifold's epochs, stride and mocap_repeats are at least 1.".to_owned()
        } else if self.batch == 0 || !self.batch.is_multiple_of(CHUNK) {
            format!("The manifold's batch is a multiple of {CHUNK}, not {}.", self.batch)
        } else if shares.iter().any(|s| !(0.0..=1.0).contains(s))
            || self.test_share + self.validation_share > 0.9
        {
            "The manifold's shares are 0 to 1, and test and validation together at most 0.9.".to_owned()
        } else if scales.iter().any(|s| !s.is_finite() || *s < 0.0) {
            "The manifold's rates, weights and noise are numbers of at least 0.".to_owned()
        } else {
            return Ok(());
        };
        Err(Error::input(sentence))
    }
}
