//! The motion that is kept: the best of many rollouts of the policy from the task's start, and of rollouts that
//! branch off the best ones so far.
//!
//! The paper keeps whatever the policy plays. Drawing a few hundred takes a fraction of a second, and
//! the policy proposes all of them, so the best is never worse than the paper's.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use rayon::prelude::*;

use super::environment::Environment;
use super::episode::{Episode, EpisodeEnd, Tally};
use super::policy::{Draw, Gaussian, Policy, TYPE_COUNT, draw};
use crate::error::Result;
use crate::math::Planar;
use crate::motion::{FRAME_RATE, Motion};
use crate::nn::Activations;
use crate::progress::Progress;
use crate::settings::CostWeights;
use crate::synthesizer::unhurried;

/// A way that is longer than this, or that there is none, counts as this long, metres.
const FARTHEST_WAY: f32 = 50.0;
/// How much of the last decision's a^offset stays where the way is narrowest: arms that are past something stay so.
const OFFSET_HELD: f32 = 0.8;

/// The kept motion and its figures.
#[derive(Debug, Clone)]
pub struct KeptMotion {
    /// From the first frame (standing at the start) to the end; a completed action is held for a while.
    pub motion: Motion,
    /// The frame on which the action is complete, else the last.
    pub complete: usize,
    /// Frame at which the sit or stop was entered.
    pub action_from: Option<usize>,
    /// How its episode ended.
    pub end: EpisodeEnd,
    /// Figures of its episode.
    pub tally: Tally,
    /// What an artist would mind in it, in one number.
    pub cost: f32,
    /// Rollouts that were played, and how many of them met the cue.
    pub rollouts: usize,
    /// Rollouts that met the cue.
    pub succeeded: usize,
}

/// A rollout: the decisions that make it, and what it is worth.
#[derive(Debug, Clone)]
struct Candidate {
    seed: u64,
    draws: Vec<Draw>,
    end: EpisodeEnd,
    tally: Tally,
    /// Lower is better.
    cost: f32,
}

/// Plays the policy from the task's start and keeps the best motion.
pub fn keep_motion(
    environment: &Environment,
    policy: &Policy,
    seed: u64,
    progress: &Progress,
) -> Result<KeptMotion> {
    let settings = &environment.settings.kept;
    let map = policy.normalizer.map();
    // The best so far, best first.
    let mut best: Vec<Candidate> = Vec::new();
    let (mut rollouts, mut succeeded) = (0, 0);
    for round in 0..=settings.rounds + settings.more_rounds {
        if round > settings.rounds && best.first().is_some_and(|b| environment.is_clean(b.end, &b.tally)) {
            break;
        }
        // What the policy would hardly do is tried only where what it would do is not good enough.
        let spread = 0.7 + 0.15 * round.saturating_sub(settings.rounds) as f32;
        let played: Vec<Candidate> = (0..settings.rollouts as u64)
            .into_par_iter()
            .filter(|_| !progress.is_cancelled())
            .map(|i| {
                let own = rollout_seed(seed, round as u64, i);
                let Some(branch) = best.get(i as usize % best.len().max(1)) else {
                    // The first is the policy's mean.
                    return play(environment, policy, &map, own, &[], own, if i == 0 { 0.0 } else { 0.8 });
                };
                let mut rng = Pcg64::seed_from_u64(own);
                let keep = rng.random_range(0..branch.draws.len().max(1));
                play(environment, policy, &map, branch.seed, &branch.draws[..keep], own, spread)
            })
            .collect();
        progress.check()?;
        progress.fraction(((round + 1) as f32 / (settings.rounds + 1) as f32).min(1.0));
        rollouts += played.len();
        succeeded += played.iter().filter(|c| environment.succeeded(c.end, &c.tally)).count();
        best.extend(played);
        // Stable: of equals the earlier stays first.
        best.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        best.truncate(settings.branches.max(1));
    }
    let best = best.into_iter().next().ok_or(crate::error::Error::Cancelled)?;
    let (episode, complete) = record(environment, &best);
    let motion = episode.record.unwrap_or_default();
    let paced = unhurried(&motion, &environment.database.turns);
    let frame_of = |frame: usize| paced.as_ref().map_or(frame, |p| p.frame_of(frame));
    Ok(KeptMotion {
        action_from: episode.action_from.map(frame_of),
        complete: frame_of(complete),
        motion: paced.map_or(motion, |p| p.motion),
        end: best.end,
        tally: best.tally,
        cost: best.cost,
        rollouts,
        succeeded,
    })
}

/// The seed of a rollout's own draws. Mixed, so that neighbouring seeds of a request share no rollouts (SplitMix64's
/// finalizer; Steele, Lea and Flood 2014).
fn rollout_seed(seed: u64, round: u64, rollout: u64) -> u64 {
    let mix = |mut z: u64| {
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    };
    mix(mix(seed.wrapping_add(0x9e37_79b9_7f4a_7c15)) ^ (round << 32 | rollout))
}

fn play(
    environment: &Environment,
    policy: &Policy,
    map: &[(f32, f32)],
    start_seed: u64,
    prefix: &[Draw],
    seed: u64,
    spread: f32,
) -> Candidate {
    let mut rng = Pcg64::seed_from_u64(seed);
    let mut episode = environment.begin(&mut Pcg64::seed_from_u64(start_seed));
    let mut draws = prefix.to_vec();
    let end = play_on(environment, policy, map, &mut episode, &mut draws, spread, &mut rng);
    if end == EpisodeEnd::Complete {
        environment.hold(&mut episode);
    }
    let cost = cost(environment, end, &episode);
    Candidate { seed: start_seed, draws, end, tally: episode.tally, cost }
}

/// Plays `draws`, then what the policy draws, which is added to them, until the episode ends.
fn play_on(
    environment: &Environment,
    policy: &Policy,
    map: &[(f32, f32)],
    episode: &mut Episode,
    draws: &mut Vec<Draw>,
    spread: f32,
    rng: &mut Pcg64,
) -> EpisodeEnd {
    let mut state = vec![0.0; policy.state_size()];
    let mut activations = Activations::default();
    for decision in 0.. {
        let observation = environment.observe(episode, &mut state);
        if decision == draws.len() {
            Policy::normalize(&mut state, map);
            let means = policy.means(&state, 1, &mut activations);
            let mut mean: Vec<f32> = means.iter().zip(&observation.proposal).map(|(m, p)| m + p).collect();
            let mut log_std = policy.log_std.clone();
            if spread > 0.0 {
                vary_arms(environment, episode, draws.last(), &mut mean, &mut log_std);
            }
            draws.push(draw(&mean, observation.allowed, &Gaussian::of(&log_std), spread, rng));
        }
        if let Some(end) = environment.step(episode, &observation, &draws[decision]).end {
            return end;
        }
    }
    EpisodeEnd::TooLong
}

/// Widens what rollouts try of a^offset where the way is narrow, and has it go on from what was drawn last: arms hang
/// free nearly everywhere, so the policy by itself varies them too little for a rollout to take them past.
fn vary_arms(
    environment: &Environment,
    episode: &Episode,
    last: Option<&Draw>,
    mean: &mut [f32],
    log_std: &mut [f32],
) {
    let settings = environment.settings;
    let wanted = settings.kept.narrow_offset;
    if wanted <= 0.0 || !settings.signal.posture_offset {
        return;
    }
    let narrow = environment.narrowness(episode);
    let offset = settings.signal.future_size();
    let least = (narrow * wanted / settings.signal.offset_scale).ln();
    log_std[offset..].iter_mut().for_each(|s| *s = s.max(least));
    if let Some(last) = last {
        for (mean, last) in mean[TYPE_COUNT + offset..].iter_mut().zip(&last.vector[offset..]) {
            *mean += OFFSET_HELD * narrow * (last - *mean);
        }
    }
}

/// One rollout from `start`: how it ended and its figures. `map`: [`super::policy::Normalizer::map`].
pub(crate) fn play_once(
    environment: &Environment,
    policy: &Policy,
    map: &[(f32, f32)],
    start: Planar,
    spread: f32,
    rng: &mut Pcg64,
) -> (EpisodeEnd, Tally) {
    let mut episode = environment.begin_at(start, rng);
    let end = play_on(environment, policy, map, &mut episode, &mut Vec::new(), spread, rng);
    (end, episode.tally)
}

/// Plays a candidate again, keeping every posture; with the frame on which it ended before it was held.
fn record(environment: &Environment, candidate: &Candidate) -> (Episode, usize) {
    let mut episode = environment.begin(&mut Pcg64::seed_from_u64(candidate.seed));
    episode.record =
        Some(Motion { postures: vec![episode.character.posture], contacts: vec![episode.character.contact] });
    let mut state = vec![0.0; environment.state_size()];
    for drawn in &candidate.draws {
        let observation = environment.observe(&episode, &mut state);
        environment.step(&mut episode, &observation, drawn);
    }
    let complete = episode.tally.frames;
    if candidate.end == EpisodeEnd::Complete {
        environment.hold(&mut episode);
    }
    (episode, complete)
}

/// What an artist would mind in it, in one number ([`CostWeights`]): a missed cue most, then limbs in furniture, then visible
/// transitions and jolts, feet that creep, legs that hurry, detours and dawdling.
fn cost(environment: &Environment, end: EpisodeEnd, episode: &Episode) -> f32 {
    let way = |xy| environment.path.distance(xy).min(FARTHEST_WAY);
    let shortest = way(environment.task.start.planar().position);
    let left = way(episode.character.planar.position);
    let met = environment.succeeded(end, &episode.tally);
    cost_of(&episode.tally, end, met, left, shortest, &environment.settings.kept.weights)
}

/// [`cost`] of an episode's figures. `left`: metres from its last place to the cue; `shortest`: from its first.
fn cost_of(tally: &Tally, end: EpisodeEnd, met: bool, left: f32, shortest: f32, w: &CostWeights) -> f32 {
    let seconds = tally.frames as f32 / FRAME_RATE;
    if end != EpisodeEnd::Complete {
        // Of two that got as far, the one that tried longer is nearer to an end.
        return w.incomplete + w.way_left * left - seconds;
    }
    let missed = if met { 0.0 } else { w.missed };
    missed
        + w.residual * tally.residual
        + w.facing * tally.facing
        + w.penetrating * tally.penetrating as f32
        + w.touching * tally.touching as f32
        + w.crossing * tally.crossings as f32
        + w.worst_transition * tally.worst_transition
        + w.transition * tally.transition
        + w.worst_hurry * tally.worst_hurry
        + w.hurry * tally.hurry
        + w.worst_jolt * tally.worst_jolt
        + w.jolt * tally.jolt
        + w.contact * tally.contact.mean()
        + w.detour * (tally.travelled - shortest).max(0.0)
        + w.second * seconds
        + w.offset * tally.offset / FRAME_RATE
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_two_rollouts_share_their_draws() {
        let mut seeds: Vec<u64> = (0..20)
            .flat_map(|seed| {
                (0..12).flat_map(move |round| (0..128).map(move |i| rollout_seed(seed, round, i)))
            })
            .collect();
        let count = seeds.len();
        seeds.sort_unstable();
        seeds.dedup();
        assert_eq!(seeds.len(), count);
    }
}
