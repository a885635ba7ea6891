//! From how many starts a policy meets a cue, without further optimization (LAMA, section 4.4 and its supplementary).

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::f32::consts::PI;

use super::environment::Environment;
use super::episode::EpisodeEnd;
use super::kept::play_once;
use super::policy::Policy;
use crate::cue::{InitialState, Task};
use crate::error::Result;
use crate::math::Planar;
use crate::progress::Progress;
use crate::range::check_ranges;
use crate::scene::check_task;

/// How the starts are laid out and judged.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RobustnessSettings {
    /// Grid of the starts, metres.
    pub spacing: f32,
    /// Trials from each start, each facing anywhere (the paper: 5).
    pub trials: usize,
    /// A start counts when so many of them meet the cue (the paper: 2).
    pub needed: usize,
    /// Spread of the actions round the policy's mean, 1: as it was optimized.
    pub spread: f32,
}

impl RobustnessSettings {
    /// # Errors
    /// [`crate::Error::Input`] naming the first value that is out of its range or not a number.
    pub fn validate(&self) -> Result<()> {
        check_ranges!(
            self,
            "robustness",
            RobustnessSettings {
                spacing: 0.02..=100.0,
                trials: 1..=1000,
                needed: 1..=1000,
                spread: 0.0..=10.0,
            },
            free {}
        );
        Ok(())
    }
}

impl Default for RobustnessSettings {
    fn default() -> Self {
        Self { spacing: 0.25, trials: 5, needed: 2, spread: 1.0 }
    }
}

/// What became of one start.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StartFigures {
    /// World, metres.
    pub place: [f32; 2],
    /// Trials that met the cue.
    pub met: usize,
    /// Trials that ended in a collision, and that found no way to finish.
    pub collisions: usize,
    /// Trials that found no way to finish.
    pub stalls: usize,
}

/// The robustness test of one policy and cue.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Robustness {
    /// One a start.
    pub starts: Vec<StartFigures>,
    /// Share of the starts that count.
    pub ratio: f32,
}

/// Plays the policy from every valid start of the scene: a grid over the floor, without the places that are occupied
/// or from which the cue cannot be reached at all.
///
/// # Errors
/// `Cancelled`.
pub fn robustness(
    environment: &Environment,
    policy: &Policy,
    settings: &RobustnessSettings,
    seed: u64,
    progress: &Progress,
) -> Result<Robustness> {
    settings.validate()?;
    let valid = valid_starts(environment, settings.spacing);
    let map = policy.normalizer.map();
    let starts = valid
        .par_iter()
        .panic_fuse()
        .enumerate()
        .map(|(i, start)| {
            let mut figures = StartFigures {
                place: start.position.truncate().to_array(),
                met: 0,
                collisions: 0,
                stalls: 0,
            };
            for trial in 0..settings.trials as u64 {
                progress.check()?;
                let mut rng = Pcg64::seed_from_u64(seed ^ ((i as u64) << 20) ^ (trial << 8));
                let planar = Planar::new(start.position.truncate(), rng.random_range(-PI..PI));
                let (end, tally) = play_once(environment, policy, &map, planar, settings.spread, &mut rng);
                figures.met += usize::from(environment.succeeded(end, &tally));
                figures.collisions += usize::from(end == EpisodeEnd::Collision);
                figures.stalls += usize::from(matches!(end, EpisodeEnd::Stall | EpisodeEnd::TooLong));
            }
            Ok(figures)
        })
        .collect::<Result<Vec<_>>>()?;
    let count = starts.iter().filter(|s| s.met >= settings.needed).count();
    let ratio = count as f32 / starts.len().max(1) as f32;
    Ok(Robustness { starts, ratio })
}

/// Places on a grid where a person can stand and from which the task can be done.
pub(crate) fn valid_starts(environment: &Environment, spacing: f32) -> Vec<InitialState> {
    let (low, high) = environment.scene.bounds();
    let floor = environment.scene.floor_height();
    let counts = ((high - low).truncate() / spacing).floor().as_usizevec2();
    let mut valid = Vec::new();
    for row in 0..counts.y {
        for column in 0..counts.x {
            let xy = low.truncate() + glam::Vec2::new(column as f32 + 0.5, row as f32 + 0.5) * spacing;
            if !environment.scene.occupancy().is_walkable(xy) {
                continue;
            }
            let start = InitialState::standing("Start", xy.extend(floor), 0.0);
            let task = Task { start, ..environment.task.clone() };
            if check_task(environment.scene, &task).is_ok() {
                valid.push(task.start);
            }
        }
    }
    valid
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_world::{World, close, stop_cue};
    use glam::Vec2;

    #[test]
    fn starts_are_where_one_can_stand() {
        // A table in a corner, and a wall that shuts the far side off.
        let boxes = [([1.0, 1.0, 0.0], [2.0, 2.0, 0.8]), ([-3.0, -1.6, 0.0], [3.0, -1.5, 2.0])];
        let world = World::new(&boxes, Planar::default(), stop_cue(Vec2::new(-1.0, 1.0), 0.0));
        let environment = world.environment();
        let valid = valid_starts(&environment, 0.5);
        for start in &valid {
            let xy = start.position.truncate();
            assert!(xy.y > -1.35 && xy.max_element() < 2.85 && xy.x > -2.85, "{xy}");
            assert!((xy - 1.5).abs().max_element() > 0.6, "{xy}");
            close(start.position.z, 0.0, 1e-4);
            let cells = (xy + 3.0) / 0.5 - 0.5;
            assert!((cells - cells.round()).abs().max_element() < 1e-3, "{xy}");
        }
        // Twelve columns and nine rows over the wall, of which the lowest stands at y = -1.25 and four places on the table.
        assert_eq!(valid.len(), 12 * 9 - 4);
    }

    #[test]
    fn a_start_counts_when_enough_of_its_trials_met_the_cue() {
        let mut world = World::stop_ahead(0.8);
        world.settings.termination.longest = 240;
        let (environment, policy) = (world.environment(), world.proposed());
        let run = |needed: usize| {
            let settings = RobustnessSettings { spacing: 1.5, trials: 2, needed, spread: 1.0 };
            robustness(&environment, &policy, &settings, 4, &Progress::new()).expect("not cancelled")
        };
        let all = run(1);
        assert_eq!(all.starts.len(), 16);
        let met: usize = all.starts.iter().map(|s| s.met).sum();
        assert!(
            met > 2 && all.starts.iter().all(|s| s.met + s.collisions + s.stalls <= 2),
            "{:?}",
            all.starts
        );
        for needed in [1, 2] {
            let counts = all.starts.iter().filter(|s| s.met >= needed).count();
            close(run(needed).ratio, counts as f32 / 16.0, 1e-6);
        }
        assert_eq!(run(4).ratio, 0.0);
        let progress = Progress::new();
        progress.cancel();
        assert!(robustness(&environment, &policy, &RobustnessSettings::default(), 4, &progress).is_err());
        let wrong = RobustnessSettings { trials: 0, ..Default::default() };
        assert!(robustness(&environment, &policy, &wrong, 4, &Progress::new()).is_err());
    }
}
