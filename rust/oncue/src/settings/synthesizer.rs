//! The constants of S, the motion synthesizer (LAMA, section 3.3).

use serde::{Deserialize, Serialize};

use crate::error::Result;
use crate::library::feature::FeatureWeights;
use crate::range::check_ranges;

/// S (LAMA, section 3.3).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SynthesizerSettings {
    /// N: frames between two searches (released: 10).
    pub search_every: usize,
    /// w_f².
    pub weights: FeatureWeights,
    /// A transition must be cheaper than playing on by this share of the cost (0 = the paper: always the nearest).
    pub reluctance: f32,
    /// A sit or stop is refused when its end misses the cue by more than this: metres (released: 0.32)…
    pub refuse_position: f32,
    /// …radians…
    pub refuse_direction: f32,
    /// …metres of pelvis height…
    pub refuse_height: f32,
    /// …or when C_tr + C_vel, the cost of the posture itself, exceeds this.
    pub refuse_posture: f32,
    /// τ plays wherever the policy wishes, as the paper's, and not only where something stands beside the arm.
    pub offset_everywhere: bool,
    /// Seconds that the motion goes on after the action is complete.
    pub hold_seconds: f32,
    /// How much breath, sway, looks and stirs there are meanwhile, 1 as usual; 0: none, as the paper has it.
    pub life: f32,
}

impl SynthesizerSettings {
    /// # Errors
    /// [`crate::Error::Input`] naming the first value that is out of its range or not a number.
    pub fn validate(&self) -> Result<()> {
        check_ranges!(
            self,
            "synthesizer",
            SynthesizerSettings {
                search_every: 1..=300,
                reluctance: 0.0..=1e3,
                refuse_position: 0.0..=1e3,
                refuse_direction: 0.0..=1e3,
                refuse_height: 0.0..=1e3,
                refuse_posture: 0.0..=1e6,
                hold_seconds: 0.0..=600.0,
                life: 0.0..=2.0,
            },
            free { weights, offset_everywhere }
        );
        self.weights.validate()
    }
}

impl Default for SynthesizerSettings {
    fn default() -> Self {
        Self {
            search_every: 10,
            weights: FeatureWeights::default(),
            reluctance: 0.15,
            refuse_position: 0.30,
            refuse_direction: 0.5,
            refuse_height: 0.08,
            refuse_posture: 1.2,
            offset_everywhere: false,
            hold_seconds: 1.0,
            life: 1.0,
        }
    }
}
