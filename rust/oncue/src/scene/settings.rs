//! How a scene is indexed: every length with its source.

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::range::check_ranges;

/// The constants of the scene index. Lengths in metres.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SceneSettings {
    /// Edge of a cell of the occupancy grid and of the distance field. 0.05: half of a leg box (LAMA, figure 3a);
    /// grows by itself in scenes so large that the grids would pass `max_cells`.
    pub cell_size: f32,
    /// g_occ: heights over the floor between which a triangle occupies its cell (released constants: 0.15 to 1.2).
    pub occupied_from: f32,
    /// The upper of the two.
    pub occupied_to: f32,
    /// World z of the floor. `None`: the scene's dominant walkable level.
    pub floor_height: Option<f32>,
    /// What lies lower than this over the floor is floor, carpet or threshold, and is left out of the distance field.
    /// Ours: rugs are 1 to 2 cm high, and the soles of a walking person come as low.
    pub carpet_height: f32,
    /// A cell is walkable only where a surface lies this near the floor height. Ours: a low step.
    pub floor_tolerance: f32,
    /// Headroom that makes a level walkable. Ours: a tall person, and lower than any storey.
    pub headroom: f32,
    /// Most cells of the distance field; the occupancy grid gets a quarter. 16 million is 16 MB.
    pub max_cells: usize,
    /// Clear paths keep off cells with less clearance than this; half of a 24 cm wide, turned body. Ours.
    pub blocked_clearance: f32,
    /// Below this clearance a clear path pays highly: half of shoulders 40 cm wide. Ours.
    pub narrow_clearance: f32,
    /// From this clearance on a metre of clear path costs a metre: shoulders and swinging arms. Ours.
    pub free_clearance: f32,
}

impl Default for SceneSettings {
    fn default() -> Self {
        Self {
            cell_size: 0.05,
            occupied_from: 0.15,
            occupied_to: 1.2,
            floor_height: None,
            carpet_height: 0.05,
            floor_tolerance: 0.12,
            headroom: 1.7,
            max_cells: 16_000_000,
            blocked_clearance: 0.12,
            narrow_clearance: 0.20,
            free_clearance: 0.40,
        }
    }
}

impl SceneSettings {
    /// # Errors
    /// [`Error::Input`] naming the first value that is out of its range or not a number, or the heights and clearances that do
    /// not rise.
    pub fn validate(&self) -> Result<()> {
        check_ranges!(
            self,
            "scene",
            SceneSettings {
                cell_size: 0.005..=1.0,
                occupied_from: 0.0..=10.0,
                occupied_to: 0.01..=10.0,
                floor_height: -1e5..=1e5,
                carpet_height: 0.0..=1.0,
                floor_tolerance: 0.001..=2.0,
                headroom: 0.1..=10.0,
                max_cells: 1000..=200_000_000,
                blocked_clearance: 0.01..=2.0,
                narrow_clearance: 0.01..=2.0,
                free_clearance: 0.01..=5.0,
            },
            free {}
        );
        if self.occupied_to <= self.occupied_from {
            return Err(Error::input(format!(
                "The settings scene.occupied_from ({}) and scene.occupied_to ({}) must be heights in rising order.",
                self.occupied_from, self.occupied_to
            )));
        }
        if self.narrow_clearance <= self.blocked_clearance || self.free_clearance <= self.narrow_clearance {
            return Err(Error::input(
                "The settings scene.blocked_clearance, narrow_clearance and free_clearance must rise in this order.",
            ));
        }
        Ok(())
    }
}
