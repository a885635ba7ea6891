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
use super::signal::OFFSET_SIZE;
use crate::anatomy::DEEP;
use crate::cue::Moments;
use crate::error::Result;
use crate::figures::{Surroundings, body_figures, pose_distance_figures};
use crate::math::Planar;
use crate::motion::{FRAME_RATE, Motion};
use crate::nn::Activations;
use crate::progress::Progress;
use crate::settings::CostWeights;
use crate::synthesizer::unhurried;

/// A way that is longer than this, or that there is none, counts as this long, metres.
const FARTHEST_WAY: f32 = 50.0;
/// So many of the best are looked at with the body's whole girth after each round.
const LOOKED_AT: usize = 8;
/// Farther than this no taste is from the take's own.
const FARTHEST_TASTE: usize = 8;
/// How much of the last decision's a^offset stays where the way is narrowest: arms that are past something stay so.
const OFFSET_HELD: f32 = 0.8;

/// The kept motion and its figures.
#[derive(Debug, Clone)]
pub struct KeptMotion {
    /// From the first frame (standing at the start) to the end; a completed action is held for a while.
    pub motion: Motion,
    /// When what happens in it.
    pub moments: Moments,
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
    /// How far from the take's own taste.
    taste: usize,
    end: EpisodeEnd,
    tally: Tally,
    /// Lower is better.
    cost: f32,
    /// Whether the cost has what the report would say in it.
    looked_at: bool,
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
    // The policy's mean alone is the paper's.
    let choosing = settings.rollouts > 1;
    // The best so far, best first.
    let mut best: Vec<Candidate> = Vec::new();
    let (mut rollouts, mut succeeded) = (0, 0);
    for round in 0..=settings.rounds + settings.more_rounds {
        if round > settings.rounds && best.first().is_some_and(|b| environment.is_clean(b.end, &b.tally)) {
            break;
        }
        // What the policy would hardly do is tried only where what it would do is not good enough.
        let spread = 0.7 + 0.15 * round.saturating_sub(settings.rounds) as f32;
        let played: Vec<Candidate> = each(settings.rollouts as u64, progress, |i| {
            let own = rollout_seed(seed, round as u64, i);
            let branches = best.len().min(settings.branches.max(1));
            let Some(branch) = best.get(i as usize % branches.max(1)) else {
                // The first is the policy's mean.
                let taste = if choosing { environment.taste_of(i) } else { usize::MAX };
                let begun = Begun { seed: own, draws: &[], taste };
                return play(environment, policy, &map, begun, own, if i == 0 { 0.0 } else { 0.8 });
            };
            let mut rng = Pcg64::seed_from_u64(own);
            let keep = rng.random_range(0..branch.draws.len().max(1));
            let begun = Begun { draws: &branch.draws[..keep], ..branch.begun() };
            play(environment, policy, &map, begun, own, spread)
        });
        progress.check()?;
        progress.fraction(((round + 1) as f32 / (settings.rounds + 1) as f32).min(1.0));
        rollouts += played.len();
        succeeded += played.iter().filter(|c| environment.succeeded(c.end, &c.tally)).count();
        best.extend(played);
        // Stable: of equals the earlier stays first.
        best.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        best.truncate(settings.branches.max(LOOKED_AT));
        if choosing {
            look_at(environment, &mut best);
        }
    }
    let best = best.into_iter().next().ok_or(crate::error::Error::Cancelled)?;
    let best = if choosing { spare_arms(environment, policy, &map, best, progress)? } else { best };
    let (episode, complete) = record(environment, &best);
    let moments = episode.moments(complete);
    let motion = episode.record.unwrap_or_default();
    let paced = unhurried(&motion, &environment.database.turns);
    let frame_of = |frame: usize| paced.as_ref().map_or(frame, |p| p.frame_of(frame));
    Ok(KeptMotion {
        moments: moments.each(frame_of),
        motion: paced.map_or(motion, |p| p.motion),
        end: best.end,
        tally: best.tally,
        cost: best.cost,
        rollouts,
        succeeded,
    })
}

/// Plays so many rollouts side by side, and gives them in their order. Once one of them panics, or the work is cancelled, no
/// other is begun.
fn each<T: Send>(count: u64, progress: &Progress, play: impl Fn(u64) -> T + Sync + Send) -> Vec<T> {
    (0..count).into_par_iter().panic_fuse().filter(|_| !progress.is_cancelled()).map(play).collect()
}

/// Looks at the best candidates as an eye does: what the report would say of them adds to their cost.
///
/// While rollouts are played the body is its thin boxes, as the paper has it; an eye sees it with its girth. To look at every
/// rollout so would take longer than to play it.
fn look_at(environment: &Environment, best: &mut [Candidate]) {
    best.par_iter_mut().panic_fuse().take(LOOKED_AT).filter(|candidate| !candidate.looked_at).for_each(
        |candidate| {
            candidate.looked_at = true;
            if environment.succeeded(candidate.end, &candidate.tally) {
                candidate.cost +=
                    environment.settings.kept.weights.problem * objections(environment, candidate);
            }
        },
    );
    best.sort_by(|a, b| a.cost.total_cmp(&b.cost));
}

/// More than a limb can be taken out of the scene after the edit counts as another objection for each so many cm, …
const OUT_OF_REACH: (f32, f32) = (6.0, 4.0);
/// … and so does each share of the frames, percent, in which a part is very deep in it.
const VERY_DEEP_SHARE: f32 = 10.0;

/// How much an eye would object to in a candidate's motion: all that a report would tell of, and how bad the worst of the scene is.
fn objections(environment: &Environment, candidate: &Candidate) -> f32 {
    let settings = environment.settings;
    let (episode, complete) = record(environment, candidate);
    let surroundings = Surroundings::of(environment.scene, environment.task, &episode.moments(complete));
    let motion = episode.record.unwrap_or_default();
    let body = body_figures(&motion, episode.character.floor, Some(&surroundings));
    let known = environment.database.known_poses();
    let poses = pose_distance_figures(&motion, known, Some(environment.scene));
    let scene = body.scene.clone().unwrap_or_default();
    let deep = (scene.deepest_cm - OUT_OF_REACH.0).max(0.0) / OUT_OF_REACH.1
        + scene.over_3_cm_percent / VERY_DEEP_SHARE;
    // A report tells of the worst alone; of two motions the one with fewer is the better.
    let touches: usize = body.objections(&settings.report).iter().map(Vec::len).sum();
    let met = environment.company.map_or(0.0, |company| company.objections(&motion));
    (touches + poses.unasked(settings.report.brief_frames)) as f32 + deep + met
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

/// How a rollout begins.
#[derive(Debug, Clone, Copy)]
struct Begun<'a> {
    /// Of the moment of standing that it begins with.
    seed: u64,
    draws: &'a [Draw],
    taste: usize,
}

impl Begun<'_> {
    fn episode(&self, environment: &Environment) -> Episode {
        let mut episode = environment.begin(&mut Pcg64::seed_from_u64(self.seed));
        episode.tally.taste = self.taste;
        episode
    }
}

impl Candidate {
    fn begun(&self) -> Begun<'_> {
        Begun { seed: self.seed, draws: &self.draws, taste: self.taste }
    }
}

fn play(
    environment: &Environment,
    policy: &Policy,
    map: &[(f32, f32)],
    begun: Begun,
    seed: u64,
    spread: f32,
) -> Candidate {
    let mut rng = Pcg64::seed_from_u64(seed);
    let mut episode = begun.episode(environment);
    let mut draws = begun.draws.to_vec();
    let end = play_on(environment, policy, map, &mut episode, &mut draws, spread, &mut rng);
    if end == EpisodeEnd::Complete {
        environment.hold(&mut episode);
    }
    let cost = cost(environment, end, &episode);
    Candidate {
        seed: begun.seed,
        draws,
        taste: begun.taste,
        end,
        tally: episode.tally,
        cost,
        looked_at: false,
    }
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

/// Most blocks that a motion's decisions are divided into by [`spare_arms`].
const MOST_BLOCKS: usize = 16;

/// Takes a^offset back wherever the motion is no worse without it: first from the whole of it, then from its halves, quarters and
/// so on. What remains is there because something would be touched otherwise.
fn spare_arms(
    environment: &Environment,
    policy: &Policy,
    map: &[(f32, f32)],
    mut best: Candidate,
    progress: &Progress,
) -> Result<Candidate> {
    let first = environment.settings.signal.future_size();
    let mut blocks = 1;
    while blocks <= MOST_BLOCKS.min(best.draws.len()) && best.tally.offset > 0.0 {
        let count = best.draws.len();
        let tried: Vec<Candidate> = each(blocks as u64, progress, |block| {
            let block = block as usize;
            let mut draws = best.draws.clone();
            for draw in &mut draws[block * count / blocks..(block + 1) * count / blocks] {
                draw.vector[first..].fill(0.0);
            }
            play(environment, policy, map, Begun { draws: &draws, ..best.begun() }, best.seed, 0.0)
        });
        progress.check()?;
        match tried.into_iter().min_by(|a, b| a.cost.total_cmp(&b.cost)) {
            Some(better) if better.cost < best.cost => best = better,
            _ => blocks *= 2,
        }
    }
    Ok(best)
}

/// Widens what rollouts try of a^offset where the way is narrow, and has it go on from what was drawn last: arms hang
/// free nearly everywhere, so the policy by itself varies them too little for a rollout to take them past.
fn vary_arms(
    environment: &Environment,
    episode: &mut Episode,
    last: Option<&Draw>,
    mean: &mut [f32],
    log_std: &mut [f32],
) {
    let settings = environment.settings;
    let wanted = settings.kept.narrow_offset;
    if wanted <= 0.0 || !settings.signal.posture_offset {
        return;
    }
    let tightness = environment.tightness(&episode.character);
    episode.tightness = Some(tightness);
    let first = settings.signal.future_size();
    for (side, tight) in tightness.into_iter().enumerate() {
        let least = (tight * wanted / settings.signal.offset_scale).ln();
        let own = first + OFFSET_SIZE / 2 * side..first + OFFSET_SIZE / 2 * (side + 1);
        log_std[own.clone()].iter_mut().for_each(|s| *s = s.max(least));
        let Some(last) = last else { continue };
        for number in own {
            mean[TYPE_COUNT + number] +=
                OFFSET_HELD * tight * (last.vector[number] - mean[TYPE_COUNT + number]);
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
    let mut episode = candidate.begun().episode(environment);
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
    let way = |leg, xy| environment.path.distance(leg, xy).min(FARTHEST_WAY);
    let shortest = way(0, environment.departure);
    let left = way(episode.leg, episode.character.planar.position);
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
        + w.residual * (tally.residual + tally.passed)
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
        + w.surge * tally.surge
        + w.offset * tally.offset / FRAME_RATE
        + w.in_own_body * tally.in_own_body as f32
        + w.own_depth * tally.own_depth
        + w.held_depth * (tally.held_depth - DEEP).max(0.0)
        + w.taste * tally.taste.min(FARTHEST_TASTE) as f32
        + w.unprepared * f32::from(u8::from(tally.unprepared))
        + w.repeated_step * tally.repeated_steps as f32
        + w.twisted * tally.twisted
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::ContactError;
    use crate::test_world::{World, close, stop_cue};
    use glam::Vec2;

    #[test]
    fn after_a_panic_no_other_rollout_is_begun() {
        use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
        let begun = AtomicUsize::new(0);
        let outcome = crate::job::catch(|| {
            Ok(each(20_000, &Progress::new(), |i| {
                begun.fetch_add(1, Relaxed);
                // By then the others are at work.
                std::thread::sleep(std::time::Duration::from_micros(200));
                assert!(i != 7, "rollout {i}");
                i
            }))
        });
        assert!(matches!(outcome, Err(crate::job::Failure::Panic(said)) if said.contains("rollout 7")));
        assert!(begun.load(Relaxed) < 10_000, "{} were begun", begun.load(Relaxed));
        // None panics: all of them, in their order; cancelled: none.
        let progress = Progress::new();
        assert_eq!(each(100, &progress, |i| i), (0..100).collect::<Vec<_>>());
        progress.cancel();
        assert!(each(100, &progress, |i| i).is_empty());
    }

    /// Weights and figures that no two of are alike.
    fn weights() -> CostWeights {
        CostWeights {
            incomplete: 5000.0,
            way_left: 70.0,
            missed: 900.0,
            residual: 31.0,
            facing: 4.1,
            penetrating: 0.51,
            touching: 0.23,
            crossing: 0.011,
            worst_transition: 1.7,
            transition: 0.13,
            worst_hurry: 2.3,
            hurry: 0.37,
            worst_jolt: 1.1,
            jolt: 0.053,
            contact: 61.0,
            detour: 0.83,
            second: 0.29,
            surge: 1.3,
            offset: 0.019,
            in_own_body: 0.33,
            own_depth: 1.9,
            held_depth: 97.0,
            problem: 3.7,
            taste: 1.35,
            unprepared: 0.71,
            repeated_step: 0.43,
            twisted: 0.19,
        }
    }

    fn tally() -> Tally {
        let mut contact = ContactError::default();
        // A foot that stands creeps by 1 cm in the second of two frames, then leaves; the other never stands.
        let at = |x: f32| [Vec2::new(x, 0.0), Vec2::new(0.0, 9.0 * x)];
        contact.add(at(0.0), at(0.01));
        contact.add(at(0.01), at(0.02));
        contact.add([Vec2::ZERO; 2], [Vec2::X, Vec2::X]);
        Tally {
            frames: 60,
            penetrating: 3,
            touching: 7,
            crossings: 130,
            transition: 2.9,
            worst_transition: 1.3,
            transitions: 5,
            hurry: 1.9,
            worst_hurry: 0.7,
            jolt: 3.1,
            worst_jolt: 1.7,
            contact,
            travelled: 4.3,
            surge: 2.1,
            offset: 87.0,
            in_own_body: 11,
            own_depth: 0.41,
            held_depth: 0.04,
            taste: 2,
            unprepared: true,
            repeated_steps: 2,
            twisted: 1.4,
            residual: 0.06,
            passed: 0.21,
            worst_pass: 0.13,
            facing: 0.17,
        }
    }

    #[test]
    fn the_cost_is_worked_by_hand() {
        let (t, w) = (tally(), weights());
        close(t.contact.mean(), 0.005, 1e-6);
        let parts = [
            31.0 * (0.06 + 0.21),
            4.1 * 0.17,
            0.51 * 3.0,
            0.23 * 7.0,
            0.011 * 130.0,
            1.7 * 1.3,
            0.13 * 2.9,
            2.3 * 0.7,
            0.37 * 1.9,
            1.1 * 1.7,
            0.053 * 3.1,
            61.0 * 0.005,
            0.43 * 2.0,
            0.19 * 1.4,
            0.83 * (4.3 - 3.2),
            0.29 * 2.0,
            1.3 * 2.1,
            0.019 * 87.0 / 30.0,
            0.33 * 11.0,
            1.9 * 0.41,
            97.0 * 0.03,
            2.7,
            0.71,
        ];
        let met: f32 = parts.iter().sum();
        close(cost_of(&t, EpisodeEnd::Complete, true, 7.0, 3.2, &w), met, 1e-3);
        close(cost_of(&t, EpisodeEnd::Complete, false, 7.0, 3.2, &w), met + 900.0, 1e-3);
        // Shorter than the shortest way is no gain.
        let no_detour = met - 0.83 * 1.1;
        close(cost_of(&t, EpisodeEnd::Complete, true, 7.0, 5.0, &w), no_detour, 1e-3);
        for end in [EpisodeEnd::Stall, EpisodeEnd::Collision, EpisodeEnd::LeftScene, EpisodeEnd::TooLong] {
            close(cost_of(&t, end, false, 7.0, 3.2, &w), 5000.0 + 490.0 - 2.0, 1e-3);
        }
    }

    /// One rollout of round 0.
    fn rollout(environment: &Environment, policy: &Policy, seed: u64, round: u64, i: u64) -> Candidate {
        let own = rollout_seed(seed, round, i);
        let begun = Begun { seed: own, draws: &[], taste: environment.taste_of(i) };
        play(environment, policy, &policy.normalizer.map(), begun, own, if i == 0 { 0.0 } else { 0.8 })
    }

    #[test]
    fn the_motion_of_least_cost_is_kept() {
        let world = World::stop_ahead(2.0);
        let (environment, policy) = (world.environment(), world.proposed());
        let mut first_was_best = 0;
        for seed in 0..4 {
            let all: Vec<Candidate> = (0..6).map(|i| rollout(&environment, &policy, seed, 0, i)).collect();
            let best = all.iter().min_by(|a, b| a.cost.total_cmp(&b.cost)).expect("six");
            first_was_best += usize::from(best.cost == all[0].cost);
            let kept = keep_motion(&environment, &policy, seed, &Progress::new()).expect("not cancelled");
            assert_eq!((kept.cost, kept.end, kept.tally), (best.cost, best.end, best.tally));
            let met = all.iter().filter(|c| environment.succeeded(c.end, &c.tally)).count();
            assert_eq!((kept.rollouts, kept.succeeded), (6, met));
            // The motion is that one, from the first frame on, a second of holding included.
            let (episode, complete) = record(&environment, best);
            assert_eq!(episode.tally, best.tally);
            let motion = episode.record.expect("recorded");
            assert_eq!(motion.len(), best.tally.frames + 1);
            let held = if best.end == EpisodeEnd::Complete { 30 } else { 0 };
            assert_eq!(complete, best.tally.frames - held);
            assert_eq!(kept.motion.postures[0], motion.postures[0]);
            assert_eq!(kept.motion.postures.last(), motion.postures.last());
            assert!(kept.motion.len() >= motion.len() && kept.moments.complete >= complete);
            assert!(kept.moments.action_from.is_none_or(|from| from < kept.moments.complete));
        }
        assert!(first_was_best < 4, "else the first, not the best, would do");
    }

    #[test]
    fn a_proposed_stop_is_met_and_costs_what_it_shows() {
        let world = World::stop_ahead(2.0);
        let environment = world.environment();
        let kept = keep_motion(&environment, &world.proposed(), 3, &Progress::new()).expect("not cancelled");
        assert_eq!(kept.end, EpisodeEnd::Complete);
        assert!(environment.is_clean(kept.end, &kept.tally), "{:?}", kept.tally);
        let shortest = environment.path.distance(0, Vec2::ZERO);
        let cost = cost_of(&kept.tally, kept.end, true, 0.0, shortest, &world.settings.kept.weights);
        close(kept.cost, cost, 1e-4);
        let root = kept.motion.postures[kept.moments.complete].root_position;
        assert!(root.truncate().distance(Vec2::new(0.0, -2.0)) < 0.1, "{root}");
        assert!(kept.moments.action_from.expect("a stop") < kept.moments.complete);
    }

    #[test]
    fn an_episode_that_is_not_complete_costs_the_way_that_is_left() {
        let mut world = World::stop_ahead(2.0);
        world.settings.termination.longest = 20;
        let (environment, policy) = (world.environment(), world.proposed());
        let played = rollout(&environment, &policy, 1, 0, 0);
        assert_eq!((played.end, played.tally.frames), (EpisodeEnd::TooLong, 20));
        let episode = record(&environment, &played).0;
        let left = environment.path.distance(0, episode.character.planar.position);
        assert!(left > 1.0 && left < 2.01, "{left}");
        let w = &world.settings.kept.weights;
        close(played.cost, w.incomplete + w.way_left * left - 20.0 / 30.0, 1e-2);
        // Where there is no way at all it counts as a long one.
        world.scene = crate::test_world::room(&[([-3.0, -1.0, 0.0], [3.0, -0.9, 2.0])]);
        let environment = world.environment();
        let played = rollout(&environment, &policy, 1, 0, 0);
        let seconds = played.tally.frames as f32 / 30.0;
        close(played.cost, w.incomplete + w.way_left * FARTHEST_WAY - seconds, 1e-2);
    }

    #[test]
    fn rounds_branch_off_the_best_and_end_when_a_motion_is_clean() {
        let mut world = World::stop_ahead(2.0);
        let count = |world: &World| {
            let kept = keep_motion(&world.environment(), &world.proposed(), 2, &Progress::new());
            let kept = kept.expect("not cancelled");
            (kept.rollouts, kept.cost)
        };
        let (one, first) = count(&world);
        world.settings.kept.rounds = 2;
        world.settings.kept.more_rounds = 3;
        let (three, later) = count(&world);
        // Clean: no more rounds than those there always are.
        assert_eq!((one, three), (6, 18));
        assert!(later <= first);
        // Never clean (the way there is a detour already): every round there may be.
        world.task.cue = stop_cue(Vec2::new(0.0, -2.0), 3.0);
        world.settings.termination.longest = 25;
        assert_eq!(count(&world).0, 36);
    }

    #[test]
    fn a_branch_begins_as_what_it_branches_off() {
        let world = World::stop_ahead(2.0);
        let (environment, policy) = (world.environment(), world.proposed());
        let map = policy.normalizer.map();
        let best = rollout(&environment, &policy, 7, 0, 1);
        assert!(best.draws.len() > 3);
        let branch =
            play(&environment, &policy, &map, Begun { draws: &best.draws[..2], ..best.begun() }, 99, 0.7);
        assert_eq!(branch.draws[..2], best.draws[..2]);
        assert_ne!(branch.draws[2], best.draws[2]);
        assert_eq!(branch.seed, best.seed);
        let whole = play(&environment, &policy, &map, best.begun(), 99, 0.7);
        assert_eq!((whole.cost, whole.end, whole.tally), (best.cost, best.end, best.tally));
        // Without spread it is the policy's mean: no arm is lifted.
        let mean = rollout(&environment, &policy, 7, 0, 0);
        let offset = world.settings.signal.future_size();
        assert!(mean.draws.iter().all(|d| d.vector[offset..].iter().all(|v| *v == 0.0)));
        assert!(best.draws.iter().all(|d| d.vector[offset..].iter().any(|v| *v != 0.0)));
        assert_eq!(mean.tally.offset, 0.0);
        let (end, tally) = play_once(
            &environment,
            &policy,
            &map,
            world.task.start.planar(),
            0.0,
            &mut Pcg64::seed_from_u64(mean.seed),
        );
        assert_eq!(end, mean.end);
        close(tally.residual, mean.tally.residual, 1e-6);
    }

    #[test]
    fn arms_vary_where_it_is_narrow() {
        // A wall 34 cm to the right (-X for who faces -Y), so six tenths as tight as can be; the left is free.
        let walls = [([-2.0, -3.0, 0.0], [-0.34, 3.0, 2.0])];
        let mut world = World::stop_ahead(2.0);
        let free = world.scene;
        world.scene = crate::test_world::room(&walls);
        let offset = world.settings.signal.future_size();
        let last = Draw { action_type: 0, vector: vec![1.0; offset + 12], log_probability: 0.0 };
        let varied = |world: &World, last: Option<&Draw>| {
            let environment = world.environment();
            let mut episode = environment.begin(&mut Pcg64::seed_from_u64(1));
            let mut mean = vec![0.2; TYPE_COUNT + offset + 12];
            let mut log_std = vec![-5.0; offset + 12];
            vary_arms(&environment, &mut episode, last, &mut mean, &mut log_std);
            (environment.tightness(&episode.character), mean, log_std)
        };
        let ([left, right], mean, log_std) = varied(&world, Some(&last));
        close(left, 0.0, 1e-6);
        close(right, 0.6, 0.02);
        let (s, k) = (&world.settings.signal, &world.settings.kept);
        let least = (right * k.narrow_offset / s.offset_scale).ln();
        let own = offset + 6;
        assert!(log_std[..own].iter().all(|v| *v == -5.0));
        log_std[own..].iter().for_each(|v| close(*v, least, 1e-5));
        assert!(mean[..TYPE_COUNT + own].iter().all(|v| *v == 0.2));
        mean[TYPE_COUNT + own..].iter().for_each(|v| close(*v, 0.2 + OFFSET_HELD * right * 0.8, 1e-5));
        // The first decision has none before it; and where nothing is wanted nothing is varied.
        let (_, mean, _) = varied(&world, None);
        assert!(mean.iter().all(|v| *v == 0.2));
        let untouched = |world: &World| {
            let (_, mean, log_std) = varied(world, Some(&last));
            mean.iter().all(|v| *v == 0.2) && log_std.iter().all(|v| *v == -5.0)
        };
        world.settings.kept.narrow_offset = 0.0;
        assert!(untouched(&world));
        world.settings.kept.narrow_offset = 0.2;
        world.settings.signal.posture_offset = false;
        assert!(untouched(&world));
        world.settings.signal.posture_offset = true;
        world.scene = free;
        assert!(untouched(&world));
    }

    #[test]
    fn a_cancelled_choice_says_so() {
        let world = World::stop_ahead(2.0);
        let progress = Progress::new();
        progress.cancel();
        let error = keep_motion(&world.environment(), &world.proposed(), 1, &progress).unwrap_err();
        assert!(matches!(error, crate::Error::Cancelled));
    }

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
