//! What episodes are played in: the scene, the library, the task and the clear path to its cue.

use glam::Vec2;

use super::reward::{TransitionCost, transition_cost};
use crate::action::ActionType;
use crate::cue::Task;
use crate::error::{Error, Result};
use crate::library::database::MotionDatabase;
use crate::library::feature::PoseFeature;
use crate::scene::{ClearPath, SceneIndex, SceneSettings};
use crate::settings::Settings;

/// What an episode plays in. Shared by all threads.
#[derive(Debug)]
pub struct Environment<'a> {
    /// W.
    pub scene: &'a SceneIndex,
    /// What S searches.
    pub database: &'a MotionDatabase,
    /// The start and its cues.
    pub task: &'a Task,
    /// Every constant.
    pub settings: &'a Settings,
    /// The ways to the cue.
    pub path: ClearPath,
    walk_weights: Vec<f32>,
    /// Places on the clear floor at which an episode may begin.
    starts: Vec<Vec2>,
}

impl<'a> Environment<'a> {
    /// Everything but the policy that episodes of a task depend on.
    ///
    /// # Errors
    /// [`crate::Error::Input`] for settings that make no sense, and for those that the scene or the database was not built
    /// with.
    pub fn new(
        scene: &'a SceneIndex,
        database: &'a MotionDatabase,
        task: &'a Task,
        settings: &'a Settings,
    ) -> Result<Self> {
        settings.validate()?;
        if settings.scene != SceneSettings::default() && settings.scene != *scene.settings() {
            return Err(Error::input(
                "The scene was indexed with other settings than those under ‘scene’ here: index it with these, or leave them out.",
            ));
        }
        if settings.synthesizer.weights != database.weights {
            return Err(Error::input(
                "The library was made matchable with other weights than those under ‘synthesizer.weights’ here: build it with \
                 these, or leave them out.",
            ));
        }
        let path = ClearPath::to_cue(scene, &task.cue);
        let (low, high) = scene.bounds();
        let mut starts = Vec::new();
        let step = 0.15;
        let (columns, rows) = (((high.x - low.x) / step) as usize, ((high.y - low.y) / step) as usize);
        for row in 0..rows {
            for column in 0..columns {
                let xy = low.truncate() + Vec2::new(column as f32 + 0.5, row as f32 + 0.5) * step;
                let grid = scene.occupancy();
                if grid.is_walkable(xy) && grid.clearance(xy) > 0.28 && path.distance(xy).is_finite() {
                    starts.push(xy);
                }
            }
        }
        let walk_weights = settings.synthesizer.weights.vector(ActionType::LOCOMOTION);
        Ok(Self { scene, database, task, settings, path, walk_weights, starts })
    }

    /// Places on the clear floor from which the cue can be reached, 15 cm apart.
    pub fn starts(&self) -> &[Vec2] {
        &self.starts
    }

    /// C_tr, C_vel of entering a database frame.
    pub fn transition_cost(&self, query: &PoseFeature, frame: usize) -> TransitionCost {
        transition_cost(query, &self.database.pose_features[frame], &self.walk_weights)
    }
}
