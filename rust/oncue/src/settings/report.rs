//! What a person would still accept in a motion that met its cues.

use serde::{Deserialize, Serialize};

use crate::error::Result;
use crate::range::check_ranges;

/// What the report lets pass: a motion with more is no success, and the report says where.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ReportSettings {
    /// A limb may touch the own body or the scene for so many frames on end, …
    pub brief_frames: usize,
    /// … or for longer, but no deeper than this, metres. Less than 1 cm is not looked for.
    pub touch_depth: f32,
    /// An elbow or a knee may be so far beyond its limit, degrees, or farther for [`ReportSettings::brief_frames`].
    pub beyond_degrees: f32,
}

impl ReportSettings {
    /// # Errors
    /// [`crate::Error::Input`] naming the first value that is out of its range or not a number.
    pub fn validate(&self) -> Result<()> {
        check_ranges!(
            self,
            "report",
            ReportSettings {
                brief_frames: 0..=100_000,
                touch_depth: 0.01..=10.0,
                beyond_degrees: 5.0..=360.0
            },
            free {}
        );
        Ok(())
    }
}

impl Default for ReportSettings {
    fn default() -> Self {
        Self { brief_frames: 3, touch_depth: 0.01, beyond_degrees: 6.0 }
    }
}
