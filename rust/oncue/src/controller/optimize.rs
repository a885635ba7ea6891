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
