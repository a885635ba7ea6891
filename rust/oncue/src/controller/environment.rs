//! What episodes are played in: the scene, the library, the task and the clear way to its cue.

use glam::Vec2;

use super::reward::{TransitionCost, transition_cost};
use super::taste::Taste;
use crate::action::ActionType;
use crate::cue::{InitialState, Task};
use crate::error::{Error, Result};
use crate::figures::Company;
use crate::library::Rise;
use crate::library::database::MotionDatabase;
use crate::library::feature::PoseFeature;
use crate::scene::{SceneIndex, SceneSettings, Way};
use crate::settings::Settings;
use crate::synthesizer::Character;

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
    /// The ways to the cue, through the waypoints.
    pub path: Way,
    /// Where the way from the task's start begins.
    pub departure: Vec2,
    /// How who sits at the start may get up, the likeliest first.
    rises: Vec<Rise>,
    walk_weights: Vec<f32>,
    /// Places on the clear floor at which an episode may begin.
    starts: Vec<Vec2>,
    /// The take's own taste, and what else rollouts follow; the last is none.
    tastes: Vec<Taste>,
    /// Who else is about.
    pub(crate) company: Option<Company<'a>>,
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
        let path = Way::to_cue(scene, &task.passes, &task.cue);
        let (low, high) = scene.bounds();
        let mut starts = Vec::new();
        let step = 0.15;
        let (columns, rows) = (((high.x - low.x) / step) as usize, ((high.y - low.y) / step) as usize);
        for row in 0..rows {
            for column in 0..columns {
                let xy = low.truncate() + Vec2::new(column as f32 + 0.5, row as f32 + 0.5) * step;
                let grid = scene.occupancy();
                if grid.is_walkable(xy) && grid.clearance(xy) > 0.28 && path.distance(0, xy).is_finite() {
                    starts.push(xy);
                }
            }
        }
        let walk_weights = settings.synthesizer.weights.vector(ActionType::LOCOMOTION);
        if task.start.seat().is_some() && database.rises.is_empty() {
            return Err(Error::input(
                "The motion library has no getting up from a seat; add captures of it or let the starter library fill in what is \
                 missing.",
            ));
        }
        Ok(Self {
            departure: path.departure(scene, &task.start),
            rises: rises(database, &task.start, &walk_weights),
            scene,
            database,
            task,
            settings,
            path,
            walk_weights,
            starts,
            tastes: vec![Taste::default()],
            company: None,
        })
    }

    /// For the take with this seed, see `taste`.
    pub fn of_take(self, seed: u64) -> Self {
        let height = self.task.cue.pelvis_height().map(|z| z - self.task.start.position.z);
        let tastes = Taste::all_of_take(self.database, seed, height, self.settings);
        Self { tastes, ..self }
    }

    /// The same with others about.
    pub(crate) fn among(self, company: Option<Company<'a>>) -> Self {
        Self { company, ..self }
    }

    /// The taste so far from the take's own, which is 0; none beyond the last.
    pub(crate) fn taste(&self, steps: usize) -> &Taste {
        &self.tastes[steps.min(self.tastes.len() - 1)]
    }

    /// Which taste the n-th rollout of a take follows: every other one its own, the rest the others in turn.
    pub(crate) fn taste_of(&self, rollout: u64) -> usize {
        let others = self.tastes.len() as u64 - 1;
        if rollout.is_multiple_of(2) || others == 0 { 0 } else { 1 + (rollout / 2 % others) as usize }
    }

    /// Places on the clear floor from which the cue can be reached, 15 cm apart.
    pub fn starts(&self) -> &[Vec2] {
        &self.starts
    }

    /// How who sits at the start may get up, the likeliest first; none for who stands.
    pub(crate) fn rises(&self) -> &[Rise] {
        &self.rises
    }

    /// C_tr, C_vel of entering a database frame.
    pub fn transition_cost(&self, query: &PoseFeature, frame: usize) -> TransitionCost {
        transition_cost(query, &self.database.pose_features[frame], &self.walk_weights)
    }
}

/// Ways of getting up that are tried.
const RISES: usize = 8;
/// What a seat that is a metre higher or lower than the clip's costs, as a posture would.
const OTHER_HEIGHT: f32 = 8.0;

/// The library's ways of getting up whose first posture is most like that of a start that sits.
fn rises(database: &MotionDatabase, start: &InitialState, weights: &[f32]) -> Vec<Rise> {
    let Some(body) = start.body.as_ref().filter(|body| body.seat.is_some()) else { return Vec::new() };
    let floor = start.position.z;
    let cost = |rise: &Rise| {
        let seated = Character::continuing(database, rise.first, Some(rise.end), body, floor);
        let posture = &database.frames[rise.first].posture;
        let height = (body.postures[1].root_position.z - floor - posture.root_position.z).abs();
        let cost = transition_cost(&seated.pose_feature(), &database.pose_features[rise.first], weights);
        cost.posture + OTHER_HEIGHT * height
    };
    let mut rises: Vec<(f32, Rise)> = database.rises.iter().map(|rise| (cost(rise), *rise)).collect();
    rises.sort_by(|a, b| a.0.total_cmp(&b.0));
    rises.into_iter().take(RISES).map(|(_, rise)| rise).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_world::{World, database};

    #[test]
    fn what_scene_and_library_were_not_made_with_is_refused() {
        let said = |change: &dyn Fn(&mut Settings)| {
            let mut world = World::stop_ahead(1.0);
            change(&mut world.settings);
            Environment::new(&world.scene, database(), &world.task, &world.settings)
                .map_or_else(|e| e.to_string(), |_| String::new())
        };
        assert_eq!(said(&|_| ()), "");
        assert!(said(&|s| s.scene.cell_size = 0.06).contains("indexed with other settings"));
        assert!(said(&|s| s.synthesizer.weights.up = 3.0).contains("with other weights"));
        assert!(said(&|s| s.ppo.clip = -1.0).contains("ppo.clip"));
        // A scene that was itself indexed so is fine, whatever the settings say of scenes in general.
        let mut world = World::stop_ahead(1.0);
        world.settings.scene = world.scene.settings().clone();
        assert!(Environment::new(&world.scene, database(), &world.task, &world.settings).is_ok());
    }

    #[test]
    fn a_transition_costs_what_the_weights_say() {
        let world = World::stop_ahead(1.0);
        let environment = world.environment();
        let mut query = database().pose_features[3];
        assert_eq!(environment.transition_cost(&query, 3), TransitionCost::default());
        // The head by 0.5 m, at 1 per m²; its velocity by 2 m/s, at 0.02 per (m/s)².
        query[0] += 0.5;
        query[15] += 2.0;
        let cost = environment.transition_cost(&query, 3);
        assert!((cost.posture - 0.25).abs() < 1e-5 && (cost.velocity - 0.08).abs() < 1e-5, "{cost:?}");
    }

    #[test]
    fn starts_are_every_15_cm_where_a_body_has_room() {
        let world = World::stop_ahead(1.0);
        let environment = world.environment();
        let grid = world.scene.occupancy();
        let mut expected = 0;
        for row in 0..40 {
            for column in 0..40 {
                let xy = Vec2::new(column as f32 + 0.5, row as f32 + 0.5) * 0.15 - 3.0;
                let room = grid.is_walkable(xy) && grid.clearance(xy) > 0.28;
                let found = environment.starts().iter().any(|s| s.distance(xy) < 1e-4);
                assert_eq!(found, room, "{xy}");
                expected += usize::from(room);
            }
        }
        assert_eq!(environment.starts().len(), expected);
        assert!((1200..1500).contains(&expected), "{expected}");
    }
}
