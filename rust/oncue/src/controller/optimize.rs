//! Test-time optimization of π for one task: roll out, update, until the task is solved.

use std::time::Instant;

use rand::SeedableRng;
use rand_pcg::Pcg64;
use serde::{Deserialize, Serialize};

use super::environment::Environment;
use super::episode::EpisodeEnd;
use super::policy::Policy;
use super::ppo::Ppo;
use super::rollout::{Rollout, Tuples};
use crate::error::{Error, Result};
use crate::progress::Progress;

/// One point of the learning curve.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct UpdateFigures {
    /// Which update it was, from 0.
    pub update: usize,
    /// Mean reward of a decision.
    pub reward: f32,
    /// Share of the episodes from the task's own start that met the cue; `None` when none ended.
    pub success_rate: Option<f32>,
    /// The same over all episodes.
    pub success_rate_anywhere: Option<f32>,
    /// Shares of all episodes by how they ended.
    pub collisions: f32,
    /// Share of all episodes that stalled.
    pub stalls: f32,
    /// Seconds since the optimization began.
    pub seconds: f32,
}

/// A policy and how it came about.
#[derive(Debug, Clone)]
pub struct OptimizedPolicy {
    /// π and V after the last update.
    pub policy: Policy,
    /// One point an update.
    pub curve: Vec<UpdateFigures>,
    /// Decisions played in all.
    pub environment_steps: usize,
    /// Seconds of rolling out and of learning.
    pub rollout_seconds: f32,
    /// Seconds of learning.
    pub learning_seconds: f32,
}

/// Optimizes π for the task of one environment (LAMA, section 3.4), or for those of several (section 3.5), from
/// `start` if given, else from scratch. All environments have the same settings.
///
/// Stops when the task is solved or the updates are used up ([`crate::settings::PpoSettings`]). The same seed gives the
/// same policy.
pub fn optimize_policy(
    environments: &[Environment],
    start: Option<Policy>,
    seed: u64,
    progress: &Progress,
) -> Result<OptimizedPolicy> {
    let first = environments.first().ok_or_else(|| Error::input("There is no cue to optimize for."))?;
    let settings = &first.settings.ppo;
    let begun = Instant::now();
    let mut rng = Pcg64::seed_from_u64(seed);
    let mut policy = start.unwrap_or_else(|| Policy::new(first.state_size(), first.settings, &mut rng));
    let mut ppo = Ppo::new(&policy, settings, seed.wrapping_add(1));
    let mut rollout = Rollout::new(environments, seed.wrapping_add(2));
    let mut result = OptimizedPolicy {
        policy: policy.clone(),
        curve: Vec::new(),
        environment_steps: 0,
        rollout_seconds: 0.0,
        learning_seconds: 0.0,
    };
    for update in 0..settings.updates {
        let lap = Instant::now();
        let mut tuples = rollout.gather(environments, &policy, settings.tuples, progress);
        progress.check()?;
        result.rollout_seconds += lap.elapsed().as_secs_f32();
        result.environment_steps += tuples.rewards.len();
        let figures = UpdateFigures { seconds: begun.elapsed().as_secs_f32(), ..figures(update, &tuples) };
        progress.update(
            update as u32,
            figures.reward,
            figures.success_rate.or(figures.success_rate_anywhere).unwrap_or(0.0),
        );
        progress.fraction(update as f32 / settings.updates as f32);
        // Where every episode begins elsewhere, those count.
        let solved =
            figures.success_rate.or(figures.success_rate_anywhere).is_some_and(|s| s >= settings.solved);
        result.curve.push(figures);
        if solved {
            break;
        }
        let lap = Instant::now();
        ppo.update(&mut policy, &mut tuples, settings, progress)?;
        result.learning_seconds += lap.elapsed().as_secs_f32();
    }
    result.policy = policy;
    Ok(result)
}

fn figures(update: usize, tuples: &Tuples) -> UpdateFigures {
    let episodes = &tuples.episodes;
    let share = |own: bool| {
        let of: Vec<_> = episodes.iter().filter(|e| !own || e.own_start).collect();
        (!of.is_empty()).then(|| of.iter().filter(|e| e.success).count() as f32 / of.len() as f32)
    };
    let ended = |end: EpisodeEnd| {
        episodes.iter().filter(|e| e.end == end).count() as f32 / episodes.len().max(1) as f32
    };
    UpdateFigures {
        update,
        reward: tuples.rewards.iter().sum::<f32>() / tuples.rewards.len().max(1) as f32,
        success_rate: share(true),
        success_rate_anywhere: share(false),
        collisions: ended(EpisodeEnd::Collision),
        stalls: ended(EpisodeEnd::Stall),
        seconds: 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::controller::rollout::EpisodeSummary;
    use crate::test_world::World;

    fn optimized(world: &World, start: Option<Policy>) -> OptimizedPolicy {
        optimize_policy(&[world.environment()], start, 5, &Progress::new()).expect("not cancelled")
    }

    #[test]
    fn it_stops_when_the_task_is_solved() {
        let mut world = World::stop_ahead(0.9);
        world.settings.ppo.updates = 3;
        world.settings.ppo.tuples = 1280;
        world.settings.ppo.solved = 0.5;
        let solved = optimized(&world, Some(world.proposed()));
        // What is proposed meets most of such cues: nothing is left to learn.
        assert_eq!((solved.curve.len(), solved.environment_steps), (1, 1280));
        assert!(solved.curve[0].success_rate.expect("episodes ended") >= 0.5, "{:?}", solved.curve);
        assert_eq!(solved.policy, world.proposed());
        // At its very rate it is solved too; over it every update is used.
        world.settings.ppo.solved = solved.curve[0].success_rate.expect("as before");
        assert_eq!(optimized(&world, Some(world.proposed())).curve.len(), 1);
        world.settings.ppo.solved = 1.5;
        let all = optimized(&world, Some(world.proposed()));
        assert_eq!((all.curve.len(), all.environment_steps), (3, 3 * 1280));
        assert_ne!(all.policy, world.proposed());
        assert_eq!(all.curve.iter().map(|f| f.update).collect::<Vec<_>>(), [0, 1, 2]);
        assert!(all.curve.windows(2).all(|w| w[0].seconds <= w[1].seconds));
        assert!(all.rollout_seconds > 0.0 && all.learning_seconds > 0.0);
        // Where every episode begins elsewhere, those count.
        world.settings.ppo.vary_start = 1.0;
        world.settings.ppo.solved = 0.0;
        let anywhere = optimized(&world, Some(world.proposed()));
        assert_eq!((anywhere.curve.len(), anywhere.curve[0].success_rate), (1, None));
        assert!(anywhere.curve[0].success_rate_anywhere.is_some());
    }

    #[test]
    fn from_nothing_it_begins_with_random_weights_of_its_seed() {
        let mut world = World::stop_ahead(0.9);
        world.settings.ppo.updates = 0;
        let policy = |seed: u64| {
            optimize_policy(&[world.environment()], None, seed, &Progress::new())
                .expect("not cancelled")
                .policy
        };
        assert_eq!(policy(1), policy(1));
        assert_ne!(policy(1), policy(2));
        let error = optimize_policy(&[], None, 1, &Progress::new()).unwrap_err();
        assert!(error.to_string().contains("no cue"));
    }

    #[test]
    fn figures_by_hand() {
        let episode = |end, success, own_start| EpisodeSummary { end, success, own_start };
        let tuples = Tuples {
            rewards: vec![1.0, 2.0, 6.0],
            episodes: vec![
                episode(EpisodeEnd::Complete, true, true),
                episode(EpisodeEnd::Complete, false, true),
                episode(EpisodeEnd::Collision, false, true),
                episode(EpisodeEnd::Stall, false, true),
                episode(EpisodeEnd::Complete, true, false),
                episode(EpisodeEnd::Collision, false, false),
                episode(EpisodeEnd::LeftScene, false, false),
                episode(EpisodeEnd::Collision, false, false),
            ],
            ..Tuples::default()
        };
        let f = figures(7, &tuples);
        assert_eq!((f.update, f.reward), (7, 3.0));
        assert_eq!((f.success_rate, f.success_rate_anywhere), (Some(0.25), Some(0.25)));
        assert_eq!((f.collisions, f.stalls), (0.375, 0.125));
        let none = figures(0, &Tuples::default());
        assert_eq!((none.reward, none.success_rate, none.success_rate_anywhere), (0.0, None, None));
        assert_eq!((none.collisions, none.stalls), (0.0, 0.0));
        let elsewhere = Tuples { episodes: tuples.episodes[4..6].to_vec(), ..Tuples::default() };
        let f = figures(0, &elsewhere);
        assert_eq!((f.success_rate, f.success_rate_anywhere), (None, Some(0.5)));
    }
}
