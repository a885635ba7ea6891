//! Tuples for PPO: many episodes side by side, in groups that each think in one product.
//!
//! One environment is test-time optimization of its task; several are the generalized controller of section 3.5,
//! where each episode has another cue (and scene).
//! A group of environments belongs to one thread at a time and has its own generators, so the tuples
//! are the same whatever the number of threads.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use rayon::prelude::*;

use super::environment::Environment;
use super::episode::{Episode, EpisodeEnd};
use super::policy::{Gaussian, Policy, TYPE_COUNT, draw};
use crate::nn::Activations;
use crate::progress::Progress;

/// Episodes that one group plays side by side.
const GROUP_EPISODES: usize = 32;
/// Groups.
const GROUPS: usize = 8;

/// Tuples (s, a, r, …), time-major within each environment.
#[derive(Debug, Clone, Default)]
pub struct Tuples {
    /// As observed, not normalised.
    pub states: Vec<f32>,
    /// What the environment added to the network's output, for each decision.
    pub proposals: Vec<f32>,
    /// Which action types were open.
    pub allowed: Vec<[bool; TYPE_COUNT]>,
    /// Index of the action type that was drawn.
    pub types: Vec<usize>,
    /// The continuous action vectors that were drawn.
    pub vectors: Vec<f32>,
    /// ln π(a|s) of each.
    pub log_probabilities: Vec<f32>,
    /// R_total of each.
    pub rewards: Vec<f32>,
    /// The episode ended with this tuple.
    pub ended: Vec<bool>,
    /// Tuples of one environment, one after the other.
    pub per_environment: usize,
    /// State after the last tuple of each environment.
    pub last_states: Vec<f32>,
    /// The episodes that ended.
    pub episodes: Vec<EpisodeSummary>,
}

/// What became of an episode.
#[derive(Debug, Clone, Copy)]
pub struct EpisodeSummary {
    pub end: EpisodeEnd,
    pub success: bool,
    /// It began at the task's own start.
    pub own_start: bool,
}

/// The environments, kept from update to update.
pub struct Rollout {
    groups: Vec<Group>,
}

struct Group {
    slots: Vec<Slot>,
    rng: Pcg64,
}

struct Slot {
    /// Which of the environments it plays in.
    environment: usize,
    episode: Episode,
    own_start: bool,
}

impl Rollout {
    /// `environments` must not be empty.
    pub fn new(environments: &[Environment], seed: u64) -> Self {
        let groups = (0..GROUPS)
            .map(|g| {
                let mut rng =
                    Pcg64::seed_from_u64(seed ^ (0x9E37_79B9_7F4A_7C15u64.wrapping_mul(g as u64 + 1)));
                let slots = (0..GROUP_EPISODES).map(|_| Slot::begin(environments, &mut rng)).collect();
                Group { slots, rng }
            })
            .collect();
        Self { groups }
    }

    /// Gathers at least `count` tuples.
    pub fn gather(
        &mut self,
        environments: &[Environment],
        policy: &Policy,
        count: usize,
        progress: &Progress,
    ) -> Tuples {
        let steps = count.div_ceil(GROUP_EPISODES * GROUPS);
        let map = policy.normalizer.map();
        let parts: Vec<Vec<Tuples>> = self
            .groups
            .par_iter_mut()
            .panic_fuse()
            .map(|group| group.gather(environments, policy, &map, steps, progress))
            .collect();
        let mut all = Tuples { per_environment: steps, ..Tuples::default() };
        for part in parts.into_iter().flatten() {
            all.states.extend(part.states);
            all.proposals.extend(part.proposals);
            all.allowed.extend(part.allowed);
            all.types.extend(part.types);
            all.vectors.extend(part.vectors);
            all.log_probabilities.extend(part.log_probabilities);
            all.rewards.extend(part.rewards);
            all.ended.extend(part.ended);
            all.last_states.extend(part.last_states);
            all.episodes.extend(part.episodes);
        }
        all
    }
}

impl Slot {
    fn begin(environments: &[Environment], rng: &mut Pcg64) -> Self {
        let chosen = if environments.len() > 1 { rng.random_range(0..environments.len()) } else { 0 };
        let environment = &environments[chosen];
        let own_start = rng.random::<f32>() >= environment.settings.ppo.vary_start;
        let episode = if own_start { environment.begin(rng) } else { environment.begin_anywhere(rng) };
        Self { environment: chosen, episode, own_start }
    }
}

impl Group {
    fn gather(
        &mut self,
        environments: &[Environment],
        policy: &Policy,
        map: &[(f32, f32)],
        steps: usize,
        progress: &Progress,
    ) -> Vec<Tuples> {
        let size = policy.state_size();
        let width = TYPE_COUNT + policy.vector_size();
        let mut out: Vec<Tuples> = (0..GROUP_EPISODES).map(|_| Tuples::default()).collect();
        let mut states = vec![0.0; GROUP_EPISODES * size];
        let mut activations = Activations::default();
        let gaussian = Gaussian::of(&policy.log_std);
        for step in 0..=steps {
            if progress.is_cancelled() {
                break;
            }
            let observations: Vec<_> = self
                .slots
                .iter()
                .zip(states.chunks_exact_mut(size))
                .map(|(slot, state)| environments[slot.environment].observe(&slot.episode, state))
                .collect();
            if step == steps {
                for (tuples, state) in out.iter_mut().zip(states.chunks_exact(size)) {
                    tuples.last_states.extend_from_slice(state);
                }
                break;
            }
            for (tuples, state) in out.iter_mut().zip(states.chunks_exact(size)) {
                tuples.states.extend_from_slice(state);
            }
            Policy::normalize(&mut states, map);
            let means = policy.means(&states, GROUP_EPISODES, &mut activations);
            for (i, observation) in observations.iter().enumerate() {
                let mean: Vec<f32> = means[i * width..(i + 1) * width]
                    .iter()
                    .zip(&observation.proposal)
                    .map(|(m, p)| m + p)
                    .collect();
                let drawn = draw(&mean, observation.allowed, &gaussian, 1.0, &mut self.rng);
                let slot = &mut self.slots[i];
                let environment = &environments[slot.environment];
                let outcome = environment.step(&mut slot.episode, observation, &drawn);
                let tuples = &mut out[i];
                tuples.proposals.extend_from_slice(&observation.proposal);
                tuples.allowed.push(observation.allowed);
                tuples.types.push(drawn.action_type);
                tuples.vectors.extend_from_slice(&drawn.vector);
                tuples.log_probabilities.push(drawn.log_probability);
                tuples.rewards.push(outcome.reward);
                tuples.ended.push(outcome.end.is_some());
                if let Some(end) = outcome.end {
                    let success = environment.succeeded(end, &slot.episode.tally);
                    tuples.episodes.push(EpisodeSummary { end, success, own_start: slot.own_start });
                    *slot = Slot::begin(environments, &mut self.rng);
                }
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_world::World;

    fn gathered(world: &World, times: usize, count: usize) -> Vec<Tuples> {
        let environments = [world.environment()];
        let policy = world.proposed();
        let mut rollout = Rollout::new(&environments, 9);
        (0..times).map(|_| rollout.gather(&environments, &policy, count, &Progress::new())).collect()
    }

    #[test]
    fn tuples_stand_in_the_order_of_time() {
        let mut world = World::stop_ahead(1.0);
        world.settings.ppo.vary_start = 0.0;
        let size = world.environment().state_size();
        let width = TYPE_COUNT + world.settings.signal.vector_size();
        let parts = gathered(&world, 3, 300);
        let environments = GROUP_EPISODES * GROUPS;
        for tuples in &parts {
            // At least so many: two of each of the 256.
            assert_eq!((tuples.per_environment, tuples.rewards.len()), (2, 2 * environments));
            assert_eq!(tuples.states.len(), 2 * environments * size);
            assert_eq!(tuples.last_states.len(), environments * size);
            assert_eq!(tuples.proposals.len(), 2 * environments * width);
            assert_eq!(tuples.vectors.len(), 2 * environments * (width - TYPE_COUNT));
            let lengths = [
                tuples.allowed.len(),
                tuples.types.len(),
                tuples.log_probabilities.len(),
                tuples.ended.len(),
            ];
            assert_eq!(lengths, [2 * environments; 4]);
            assert_eq!(tuples.episodes.len(), tuples.ended.iter().filter(|e| **e).count());
            assert!(tuples.types.iter().zip(&tuples.allowed).all(|(t, allowed)| allowed[*t]));
            assert!(tuples.episodes.iter().all(|e| e.own_start));
        }
        // What is seen last is what is seen first of the next tuples, environment by environment.
        for pair in parts.windows(2) {
            for environment in 0..environments {
                let last = &pair[0].last_states[environment * size..(environment + 1) * size];
                let first = 2 * environment * size;
                assert_eq!(last, &pair[1].states[first..first + size]);
            }
        }
        // Every episode begins at the start, where all states are one but for the moment that stands.
        let starts: Vec<&[f32]> = parts[0].states.chunks_exact(2 * size).map(|s| &s[..size]).collect();
        assert!(starts.iter().all(|s| s == &starts[0]));
        let all: Vec<&EpisodeSummary> = parts.iter().flat_map(|p| &p.episodes).collect();
        assert!(all.iter().any(|e| e.success && e.end == EpisodeEnd::Complete));
        assert!(all.iter().all(|e| !e.success || e.end == EpisodeEnd::Complete));
    }

    #[test]
    fn a_log_probability_is_that_of_what_was_drawn() {
        let world = World::stop_ahead(1.0);
        let policy = world.proposed();
        let tuples = &gathered(&world, 1, 256)[0];
        let (width, gaussian) = (TYPE_COUNT + policy.vector_size(), Gaussian::of(&policy.log_std));
        for t in 0..tuples.rewards.len() {
            // The policy adds nothing: the means are the proposals.
            let mean = &tuples.proposals[t * width..(t + 1) * width];
            let p = super::super::policy::type_probabilities(&mean[..TYPE_COUNT], tuples.allowed[t]);
            let vector = &tuples.vectors[t * policy.vector_size()..(t + 1) * policy.vector_size()];
            let expected = super::super::policy::log_probability(
                &p,
                tuples.types[t],
                &mean[TYPE_COUNT..],
                vector,
                &gaussian,
            );
            assert!((tuples.log_probabilities[t] - expected).abs() < 1e-4);
        }
    }

    #[test]
    fn starts_vary_as_often_as_asked_and_environments_take_turns() {
        let mut world = World::stop_ahead(1.0);
        world.settings.ppo.vary_start = 0.25;
        let environments = [world.environment(), world.environment(), world.environment()];
        let rollout = Rollout::new(&environments, 3);
        let slots: Vec<&Slot> = rollout.groups.iter().flat_map(|g| &g.slots).collect();
        assert_eq!(slots.len(), GROUP_EPISODES * GROUPS);
        let own = slots.iter().filter(|s| s.own_start).count();
        assert!((172..213).contains(&own), "three quarters of 256: {own}");
        for slot in &slots {
            let at_start = slot.episode.character.planar == world.task.start.planar();
            assert_eq!(at_start, slot.own_start);
        }
        for environment in 0..3 {
            let count = slots.iter().filter(|s| s.environment == environment).count();
            assert!((60..112).contains(&count), "a third of 256: {count}");
        }
        // Two groups play other episodes.
        let facing = |g: usize| -> Vec<u32> {
            rollout.groups[g].slots.iter().map(|s| s.episode.character.planar.yaw.to_bits()).collect()
        };
        assert_ne!(facing(0), facing(1));
    }

    #[test]
    fn a_cancelled_rollout_ends() {
        let world = World::stop_ahead(1.0);
        let environments = [world.environment()];
        let progress = Progress::new();
        progress.cancel();
        let tuples = Rollout::new(&environments, 9).gather(&environments, &world.proposed(), 256, &progress);
        assert!(tuples.rewards.is_empty());
    }
}
