//! The constants of E, the motion editor (LAMA, section 3.6 and supplementary).

use serde::{Deserialize, Serialize};

use crate::error::Result;
use crate::range::check_ranges;

/// E, the motion editor (LAMA, section 3.6; supplementary, "Motion Editing").
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EditorSettings {
    /// Fit a synthesized sit to its seat and carry hands along their manipulation cues. Without it the motion is the
    /// controller's own.
    pub fit: bool,
    /// Search the manifold before the finishing pass (the ablation switches it off).
    pub manifold: bool,
    /// Adam's learning rate (0.005) and most steps (500).
    pub learning_rate: f32,
    /// Most steps of Adam.
    pub steps: usize,
    /// The search stops once every target is this near, metres. The finishing pass takes the rest.
    pub met: f32,
    /// w_p, w_f, w_r, w_Δr (released, for manipulation: 7, 6, 1, 10).
    pub w_pos: f32,
    /// w_f.
    pub w_foot: f32,
    /// w_r.
    pub w_root: f32,
    /// w_Δr.
    pub w_root_velocity: f32,
    /// Ours: weight of what trembles in the changed rotations.
    pub w_smooth: f32,
    /// An edit fades in before the first frame that asks for it and out after the last, seconds.
    pub blend_seconds: f32,
    /// Seconds of a reach of no length, and what each metre adds to it; a return takes as long.
    pub reach_seconds: f32,
    /// What each metre adds to it.
    pub reach_seconds_per_metre: f32,
}

impl EditorSettings {
    /// # Errors
    /// [`crate::Error::Input`] naming the first value that is out of its range or not a number.
    pub fn validate(&self) -> Result<()> {
        check_ranges!(
            self,
            "editor",
            EditorSettings {
                learning_rate: 0.0..=1.0,
                steps: 0..=100_000,
                met: 0.0..=10.0,
                w_pos: 0.0..=1e4,
                w_foot: 0.0..=1e4,
                w_root: 0.0..=1e4,
                w_root_velocity: 0.0..=1e4,
                w_smooth: 0.0..=1e4,
                blend_seconds: 0.0..=60.0,
                reach_seconds: 0.0..=60.0,
                reach_seconds_per_metre: 0.0..=60.0,
            },
            free { fit, manifold }
        );
        Ok(())
    }
}

impl Default for EditorSettings {
    fn default() -> Self {
        Self {
            fit: true,
            manifold: true,
            learning_rate: 0.005,
            steps: 500,
            met: 0.03,
            w_pos: 7.0,
            w_foot: 6.0,
            w_root: 1.0,
            w_root_velocity: 10.0,
            w_smooth: 1.0,
            blend_seconds: 0.8,
            reach_seconds: 0.6,
            reach_seconds_per_metre: 0.3,
        }
    }
}
