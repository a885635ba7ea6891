//! Proximal policy optimization (Schulman et al. 2017) with the paper's table of hyper-parameters.

use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_pcg::Pcg64;
use rayon::prelude::*;

use super::policy::{Gaussian, Policy, TYPE_COUNT, log_probability, type_probabilities};
use super::rollout::Tuples;
use crate::error::Result;
use crate::nn::{Activations, Adam, CHUNK_ROWS};
use crate::progress::Progress;
use crate::settings::PpoSettings;

/// Parameters that one thread takes at a time where they are added up.
const GRADIENT_SLICE: usize = 1 << 15;

/// Returns are divided by this before the value network learns them.
const VALUE_SCALE: f32 = 10.0;

/// The optimizer's memory from update to update.
pub struct Ppo {
    policy_adam: Adam,
    value_adam: Adam,
    std_adam: Adam,
    rng: Pcg64,
    chunks: Vec<Chunk>,
}

/// What an update's tuples say of its decisions, one number a tuple.
#[derive(Debug, Clone)]
pub struct Targets {
    /// How much better than expected each turned out, standardized over the tuples.
    pub advantages: Vec<f32>,
    /// What V is to learn, in reward units.
    pub returns: Vec<f32>,
}

impl Targets {
    /// Of tuples with normalised states, by the V of before the update.
    pub fn of(policy: &Policy, tuples: &Tuples, settings: &PpoSettings) -> Self {
        let values = all_values(policy, &tuples.states);
        let last_values = all_values(policy, &tuples.last_states);
        let (mut advantages, returns) = advantages(tuples, &values, &last_values, settings);
        standardize(&mut advantages);
        Self { advantages, returns }
    }
}

/// Advantages and returns of a batch (GAE, Schulman et al. 2016).
pub(crate) fn advantages(
    tuples: &Tuples,
    values: &[f32],
    last_values: &[f32],
    settings: &PpoSettings,
) -> (Vec<f32>, Vec<f32>) {
    let steps = tuples.per_environment;
    let mut advantages = vec![0.0; values.len()];
    for (environment, last) in last_values.iter().enumerate() {
        let (mut next_value, mut running) = (*last, 0.0);
        for t in (environment * steps..(environment + 1) * steps).rev() {
            let live = f32::from(u8::from(!tuples.ended[t]));
            let delta = tuples.rewards[t] + settings.discount * next_value * live - values[t];
            running = delta + settings.discount * settings.lambda * live * running;
            advantages[t] = running;
            next_value = values[t];
        }
    }
    let returns = advantages.iter().zip(values).map(|(a, v)| a + v).collect();
    (advantages, returns)
}

impl Ppo {
    /// Adam for the networks of `policy`, and a generator for the order of the batches.
    pub fn new(policy: &Policy, settings: &PpoSettings, seed: u64) -> Self {
        Self {
            policy_adam: Adam::new(settings.policy_rate, policy.policy.parameters.len()),
            value_adam: Adam::new(settings.value_rate, policy.value.parameters.len()),
            std_adam: Adam::new(settings.policy_rate, policy.log_std.len()),
            rng: Pcg64::seed_from_u64(seed),
            chunks: Vec::new(),
        }
    }

    /// Adam of π's network, of V's and of the spread.
    pub fn optimizers(&self) -> [&Adam; 3] {
        [&self.policy_adam, &self.value_adam, &self.std_adam]
    }

    /// One update of π and V on `tuples`.
    pub fn update(
        &mut self,
        policy: &mut Policy,
        tuples: &mut Tuples,
        settings: &PpoSettings,
        progress: &Progress,
    ) -> Result<()> {
        let size = policy.state_size();
        let map = policy.normalizer.map();
        // What is learnt of the states' spread serves from the next update on.
        let mut normalizer = policy.normalizer.clone();
        normalizer.update(&tuples.states);
        tuples.states.par_chunks_mut(size * CHUNK_ROWS).for_each(|rows| Policy::normalize(rows, &map));
        Policy::normalize(&mut tuples.last_states, &map);
        let targets = Targets::of(policy, tuples, settings);

        let count = tuples.rewards.len();
        let mut order: Vec<usize> = (0..count).collect();
        for _ in 0..settings.epochs {
            order.shuffle(&mut self.rng);
            for batch in order.chunks(settings.batch) {
                progress.check()?;
                self.step(policy, tuples, &targets, batch, settings);
            }
        }
        policy.normalizer = normalizer;
        Ok(())
    }

    /// One gradient step on the tuples whose numbers are in `batch`; their states are normalised.
    pub fn step(
        &mut self,
        policy: &mut Policy,
        tuples: &Tuples,
        targets: &Targets,
        batch: &[usize],
        settings: &PpoSettings,
    ) {
        let parts = batch.len().div_ceil(CHUNK_ROWS);
        self.chunks.resize_with(parts.max(self.chunks.len()), Chunk::default);
        let shared = &*policy;
        self.chunks[..parts].par_iter_mut().zip(batch.par_chunks(CHUNK_ROWS)).for_each(|(chunk, rows)| {
            chunk.gradients(shared, tuples, targets, rows, settings);
        });
        let (first, rest) = self.chunks[..parts].split_at_mut(1);
        for other in rest.iter() {
            add(&mut first[0].policy_gradient, &other.policy_gradient);
            add(&mut first[0].value_gradient, &other.value_gradient);
            add(&mut first[0].std_gradient, &other.std_gradient);
        }
        let n = 1.0 / batch.len() as f32;
        let total = &first[0];
        let scale = |gradient: &[f32]| n * clip_factor(gradient, n, settings.gradient_norm);
        // Whoever calls may have the rates fall from update to update.
        self.policy_adam.learning_rate = settings.policy_rate;
        self.std_adam.learning_rate = settings.policy_rate;
        self.value_adam.learning_rate = settings.value_rate;
        let s = scale(&total.policy_gradient);
        self.policy_adam.step(&mut policy.policy.parameters, &total.policy_gradient, s);
        self.std_adam.step(&mut policy.log_std, &total.std_gradient, n);
        policy.log_std.iter_mut().for_each(|s| *s = s.clamp(-3.5, 0.5));
        let s = scale(&total.value_gradient);
        self.value_adam.step(&mut policy.value.parameters, &total.value_gradient, s);
    }
}

fn add(a: &mut [f32], b: &[f32]) {
    a.par_chunks_mut(GRADIENT_SLICE).zip(b.par_chunks(GRADIENT_SLICE)).for_each(|(a, b)| {
        a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
    });
}

fn clip_factor(gradient: &[f32], n: f32, limit: f32) -> f32 {
    let norm = n * gradient.chunks(4096).map(|c| c.iter().map(|g| g * g).sum::<f32>()).sum::<f32>().sqrt();
    if norm > limit { limit / norm } else { 1.0 }
}

fn standardize(values: &mut [f32]) {
    let n = values.len().max(1) as f64;
    let mean = values.iter().map(|v| f64::from(*v)).sum::<f64>() / n;
    let variance = values.iter().map(|v| (f64::from(*v) - mean).powi(2)).sum::<f64>() / n;
    let scale = 1.0 / (variance.sqrt() + 1e-6);
    values.iter_mut().for_each(|v| *v = ((f64::from(*v) - mean) * scale) as f32);
}

/// V of normalised states, in reward units.
fn all_values(policy: &Policy, states: &[f32]) -> Vec<f32> {
    let size = policy.state_size();
    states
        .par_chunks(size * CHUNK_ROWS)
        .flat_map_iter(|rows| {
            let mut activations = Activations::default();
            policy.value.forward(rows, rows.len() / size, &mut activations);
            activations.output().iter().map(|v| v * VALUE_SCALE).collect::<Vec<_>>()
        })
        .collect()
}

/// One thread's share of a batch.
#[derive(Default)]
struct Chunk {
    states: Vec<f32>,
    policy_activations: Activations,
    value_activations: Activations,
    d_policy: Vec<f32>,
    d_value: Vec<f32>,
    policy_gradient: Vec<f32>,
    value_gradient: Vec<f32>,
    std_gradient: Vec<f32>,
}

impl Chunk {
    fn gradients(
        &mut self,
        policy: &Policy,
        tuples: &Tuples,
        targets: &Targets,
        rows: &[usize],
        settings: &PpoSettings,
    ) {
        let size = policy.state_size();
        let vector_size = policy.vector_size();
        let width = TYPE_COUNT + vector_size;
        self.states.clear();
        for &t in rows {
            self.states.extend_from_slice(&tuples.states[t * size..(t + 1) * size]);
        }
        // The networks write theirs whole.
        self.policy_gradient.resize(policy.policy.parameters.len(), 0.0);
        self.value_gradient.resize(policy.value.parameters.len(), 0.0);
        self.std_gradient.clear();
        self.std_gradient.resize(vector_size, 0.0);

        policy.policy.forward(&self.states, rows.len(), &mut self.policy_activations);
        self.d_policy.clear();
        self.d_policy.resize(rows.len() * width, 0.0);
        let gaussian = Gaussian::of(&policy.log_std);
        let mut mean = vec![0.0; width];
        for (i, &t) in rows.iter().enumerate() {
            let output = &self.policy_activations.output()[i * width..(i + 1) * width];
            let proposal = &tuples.proposals[t * width..(t + 1) * width];
            for ((mean, m), p) in mean.iter_mut().zip(output).zip(proposal) {
                *mean = m + p;
            }
            let vector = &tuples.vectors[t * vector_size..(t + 1) * vector_size];
            let p = type_probabilities(&mean[..TYPE_COUNT], tuples.allowed[t]);
            let new = log_probability(&p, tuples.types[t], &mean[TYPE_COUNT..], vector, &gaussian);
            let ratio = (new - tuples.log_probabilities[t]).clamp(-20.0, 20.0).exp();
            let advantage = targets.advantages[t];
            // The clipped objective is flat where the ratio has already moved far enough.
            let moved_enough =
                if advantage >= 0.0 { ratio > 1.0 + settings.clip } else { ratio < 1.0 - settings.clip };
            let d_log = if moved_enough { 0.0 } else { -advantage * ratio };
            let d = &mut self.d_policy[i * width..(i + 1) * width];
            let logs = p.map(|p| p.max(f32::MIN_POSITIVE).ln());
            let entropy = -p.iter().zip(logs).map(|(p, log)| p * log).sum::<f32>();
            for k in 0..TYPE_COUNT {
                if tuples.allowed[t][k] {
                    let chosen = f32::from(u8::from(k == tuples.types[t]));
                    d[k] = d_log * (chosen - p[k]) + settings.entropy * p[k] * (logs[k] + entropy);
                }
            }
            for k in 0..vector_size {
                let z = (vector[k] - mean[TYPE_COUNT + k]) * gaussian.inverse[k];
                d[TYPE_COUNT + k] = d_log * z * gaussian.inverse[k];
                self.std_gradient[k] += d_log * (z * z - 1.0) - settings.entropy;
            }
        }
        policy.policy.backward(
            &self.states,
            rows.len(),
            &mut self.policy_activations,
            &self.d_policy,
            &mut self.policy_gradient,
        );

        policy.value.forward(&self.states, rows.len(), &mut self.value_activations);
        self.d_value.clear();
        let values = self.value_activations.output();
        self.d_value
            .extend(rows.iter().zip(values).map(|(&t, v)| 2.0 * (v - targets.returns[t] / VALUE_SCALE)));
        policy.value.backward(
            &self.states,
            rows.len(),
            &mut self.value_activations,
            &self.d_value,
            &mut self.value_gradient,
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::RngExt;

    #[test]
    fn advantages_by_hand() {
        let tuples = Tuples {
            rewards: vec![1.0, 2.0, 3.0],
            ended: vec![false, true, false],
            per_environment: 3,
            ..Tuples::default()
        };
        let settings = PpoSettings { discount: 0.5, lambda: 0.5, ..PpoSettings::default() };
        let (a, r) = advantages(&tuples, &[10.0, 20.0, 30.0], &[40.0], &settings);
        // δ2 = 3 + 0.5·40 - 30 = -7; δ1 = 2 - 20 = -18 (ended); δ0 = 1 + 0.5·20 - 10 = 1, A0 = 1 + 0.25·(-18).
        assert_eq!(a, [-3.5, -18.0, -7.0]);
        assert_eq!(r, [6.5, 2.0, 23.0]);
    }

    /// A task with a known answer: the reward is highest where the first number of the action is 0.5.
    #[test]
    fn learns_a_bandit() {
        use crate::settings::Settings;
        let mut settings = Settings::default();
        settings.ppo.policy_rate = 3e-3;
        settings.ppo.log_std_future = -1.2;
        let mut rng = Pcg64::seed_from_u64(3);
        let mut policy = Policy::new(4, &settings, &mut rng);
        let mut ppo = Ppo::new(&policy, &settings.ppo, 1);
        let progress = Progress::new();
        // The mean over the last updates: a single one still wanders by what its tuples happened to be.
        const UPDATES: usize = 40;
        let mut late = 0.0;
        for update in 0..UPDATES {
            let mut tuples = Tuples { per_environment: 1, ..Tuples::default() };
            for _ in 0..1024 {
                let width = TYPE_COUNT + policy.vector_size();
                let mut act = Activations::default();
                let state: [f32; 4] = std::array::from_fn(|_| rng.random_range(-1.0..1.0));
                let mut normal = state;
                Policy::normalize(&mut normal, &policy.normalizer.map());
                let mean = policy.means(&normal, 1, &mut act).to_vec();
                let drawn = super::super::policy::draw(
                    &mean,
                    [true; TYPE_COUNT],
                    &Gaussian::of(&policy.log_std),
                    1.0,
                    &mut rng,
                );
                tuples.states.extend(state);
                tuples.proposals.extend(vec![0.0; width]);
                tuples.allowed.push([true; TYPE_COUNT]);
                let good = f32::from(u8::from(drawn.action_type == 1));
                tuples.rewards.push(good - (drawn.vector[0] - 0.5).powi(2));
                tuples.types.push(drawn.action_type);
                tuples.vectors.extend(drawn.vector);
                tuples.log_probabilities.push(drawn.log_probability);
                tuples.ended.push(true);
                tuples.last_states.extend(state);
            }
            ppo.update(&mut policy, &mut tuples, &settings.ppo, &progress).expect("not cancelled");
            let mut act = Activations::default();
            let map = policy.normalizer.map();
            let mut state = [0.2; 4];
            Policy::normalize(&mut state, &map);
            let mean = policy.means(&state, 1, &mut act);
            if update >= UPDATES - 10 {
                late += mean[TYPE_COUNT] / 10.0;
            }
        }
        assert!((late - 0.5).abs() < 0.15, "{late}");
    }

    #[test]
    fn advantages_of_two_environments_do_not_mix() {
        let tuples = Tuples {
            rewards: vec![1.0, 2.0, 5.0, 7.0],
            ended: vec![false, false, true, false],
            per_environment: 2,
            ..Tuples::default()
        };
        let settings = PpoSettings { discount: 0.5, lambda: 0.4, ..PpoSettings::default() };
        let (a, r) = advantages(&tuples, &[1.0, 2.0, 3.0, 4.0], &[10.0, 20.0], &settings);
        // First: δ1 = 2 + 0.5·10 - 2 = 5; δ0 = 1 + 0.5·2 - 1 = 1, A0 = 1 + 0.2·5.
        // Second: δ1 = 7 + 0.5·20 - 4 = 13; δ0 = 5 - 3 = 2 (ended).
        assert_eq!(a, [2.0, 5.0, 2.0, 13.0]);
        assert_eq!(r, [3.0, 7.0, 5.0, 17.0]);
    }

    #[test]
    fn advantages_are_standardized_and_gradients_clipped() {
        let mut values = [1.0, 2.0, 3.0, 6.0];
        standardize(&mut values);
        // Mean 3, variance (4 + 1 + 0 + 9) / 4.
        for (value, from) in values.iter().zip([-2.0, -1.0, 0.0, 3.0]) {
            assert!((value - from / 3.5f32.sqrt()).abs() < 1e-5, "{values:?}");
        }
        assert_eq!(clip_factor(&[3.0, 4.0], 0.1, 0.5), 1.0);
        assert!((clip_factor(&[3.0, 4.0], 0.4, 0.5) - 0.25).abs() < 1e-6);
    }

    /// A small policy, and tuples drawn from one that was a little different.
    fn small() -> (Policy, Tuples, PpoSettings) {
        let mut settings = crate::settings::Settings::default();
        settings.ppo.policy_layers = vec![3];
        settings.ppo.value_layers = vec![2];
        settings.ppo.entropy = 0.07;
        let mut rng = Pcg64::seed_from_u64(11);
        let mut old = Policy::new(2, &settings, &mut rng);
        let mut shaken = |numbers: &mut [f32], by: f32| {
            numbers.iter_mut().for_each(|p| *p += rng.random_range(-by..by));
        };
        shaken(&mut old.policy.parameters, 0.5);
        shaken(&mut old.value.parameters, 0.5);
        let mut policy = old.clone();
        shaken(&mut policy.policy.parameters, 0.02);
        shaken(&mut policy.log_std, 0.02);
        let mut tuples = Tuples { per_environment: 1, ..Tuples::default() };
        for row in 0..12 {
            let state: [f32; 2] = std::array::from_fn(|_| rng.random_range(-1.0..1.0));
            let width = TYPE_COUNT + old.vector_size();
            let proposal: Vec<f32> = (0..width).map(|_| rng.random_range(-0.3..0.3)).collect();
            let mut activations = Activations::default();
            let means = old.means(&state, 1, &mut activations);
            let mean: Vec<f32> = means.iter().zip(&proposal).map(|(m, p)| m + p).collect();
            let allowed = [true, row % 3 > 0, row % 2 > 0];
            let gaussian = Gaussian::of(&old.log_std);
            let drawn = super::super::policy::draw(&mean, allowed, &gaussian, 1.0, &mut rng);
            tuples.states.extend(state);
            tuples.proposals.extend(proposal);
            tuples.allowed.push(allowed);
            tuples.types.push(drawn.action_type);
            tuples.vectors.extend(drawn.vector);
            tuples.log_probabilities.push(drawn.log_probability);
        }
        (policy, tuples, settings.ppo)
    }

    const ADVANTAGES: [f32; 12] = [1.0, -0.7, 0.4, -1.3, 2.0, 0.3, -0.2, 0.9, -2.0, 1.1, 0.6, -0.4];
    const RETURNS: [f32; 12] = [3.0, -8.0, 1.0, 4.0, 9.0, -2.0, 0.0, 5.0, 7.0, -1.0, 2.0, 6.0];

    /// What an update makes smaller, summed over the rows: -min(r A, clip(r) A), less the entropy of the type and of the
    /// vector, and the squared error of the value.
    fn loss(policy: &Policy, tuples: &Tuples, rows: &[usize], settings: &PpoSettings) -> (f64, f64, usize) {
        let (size, width) = (policy.state_size(), TYPE_COUNT + policy.vector_size());
        let (mut objective, mut error, mut clipped) = (0.0, 0.0, 0);
        for &t in rows {
            let state = &tuples.states[t * size..(t + 1) * size];
            let mut activations = Activations::default();
            let means = policy.means(state, 1, &mut activations);
            let proposal = &tuples.proposals[t * width..(t + 1) * width];
            let mean: Vec<f32> = means.iter().zip(proposal).map(|(m, p)| m + p).collect();
            let p = type_probabilities(&mean[..TYPE_COUNT], tuples.allowed[t]);
            let mut log = f64::from(p[tuples.types[t]]).ln();
            for p in p.map(f64::from).into_iter().filter(|p| *p > 0.0) {
                objective += f64::from(settings.entropy) * p * p.ln();
            }
            let vector = &tuples.vectors[t * policy.vector_size()..(t + 1) * policy.vector_size()];
            for ((v, m), s) in vector.iter().zip(&mean[TYPE_COUNT..]).zip(&policy.log_std) {
                let (v, m, s) = (f64::from(*v), f64::from(*m), f64::from(*s));
                log += -0.5 * ((v - m) / s.exp()).powi(2) - s - 0.5 * std::f64::consts::TAU.ln();
                objective -= f64::from(settings.entropy) * s;
            }
            let ratio = (log - f64::from(tuples.log_probabilities[t])).exp();
            let (a, clip) = (f64::from(ADVANTAGES[t]), f64::from(settings.clip));
            let held = ratio.clamp(1.0 - clip, 1.0 + clip);
            clipped += usize::from(held * a < ratio * a - 1e-9);
            objective -= (ratio * a).min(held * a);
            let mut activations = Activations::default();
            policy.value.forward_one(state, &mut activations);
            error += (f64::from(activations.output()[0]) - f64::from(RETURNS[t]) / 10.0).powi(2);
        }
        (objective, error, clipped)
    }

    #[test]
    fn gradients_are_those_of_the_clipped_objective() {
        let (policy, tuples, settings) = small();
        let rows: Vec<usize> = vec![0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11];
        let mut chunk = Chunk::default();
        let targets = Targets { advantages: ADVANTAGES.to_vec(), returns: RETURNS.to_vec() };
        chunk.gradients(&policy, &tuples, &targets, &rows, &settings);
        let clipped = loss(&policy, &tuples, &rows, &settings).2;
        assert!((2..11).contains(&clipped), "some rows are clipped and some are not: {clipped}");
        let step = 1e-3;
        let check = |name: &str, gradient: &[f32], nudge: &dyn Fn(&mut Policy, usize, f32), value: bool| {
            let mut largest = 0.0f64;
            for (i, &found) in gradient.iter().enumerate() {
                let at = |by: f32| {
                    let mut moved = policy.clone();
                    nudge(&mut moved, i, by);
                    let (objective, error, _) = loss(&moved, &tuples, &rows, &settings);
                    if value { error } else { objective }
                };
                let expected = (at(step) - at(-step)) / (2.0 * f64::from(step));
                largest = largest.max(expected.abs());
                let off = (f64::from(found) - expected).abs();
                assert!(off < 0.02 + 0.02 * expected.abs(), "{name} {i}: {found} for {expected}");
            }
            assert!(largest > 0.1, "{name}: something to be learnt");
        };
        check("policy", &chunk.policy_gradient, &|p, i, by| p.policy.parameters[i] += by, false);
        check("log_std", &chunk.std_gradient, &|p, i, by| p.log_std[i] += by, false);
        check("value", &chunk.value_gradient, &|p, i, by| p.value.parameters[i] += by, true);
        // A second use of the same chunk begins anew.
        let first = (chunk.policy_gradient.clone(), chunk.std_gradient.clone(), chunk.value_gradient.clone());
        chunk.gradients(&policy, &tuples, &targets, &rows, &settings);
        assert_eq!(first, (chunk.policy_gradient, chunk.std_gradient, chunk.value_gradient));
    }

    #[test]
    fn an_update_learns_the_states_and_keeps_the_spread_in_bounds() {
        let (mut policy, mut tuples, mut settings) = small();
        tuples.rewards = ADVANTAGES.to_vec();
        tuples.ended = vec![true; 12];
        tuples.last_states = vec![0.0; 24];
        settings.epochs = 3;
        settings.batch = 5;
        policy.log_std[0] = 4.0;
        policy.log_std[1] = -9.0;
        let mut expected = policy.normalizer.clone();
        expected.update(&tuples.states);
        let (before, states) = (policy.clone(), tuples.states.clone());
        let mut ppo = Ppo::new(&policy, &settings, 1);
        ppo.update(&mut policy, &mut tuples, &settings, &Progress::new()).expect("not cancelled");
        assert_eq!(policy.normalizer, expected);
        assert_eq!(tuples.states, states, "a fresh normalizer changes nothing yet");
        assert!(policy.log_std[0] <= 0.5 && policy.log_std[0] > 0.49, "{}", policy.log_std[0]);
        assert!(policy.log_std[1] >= -3.5 && policy.log_std[1] < -3.49, "{}", policy.log_std[1]);
        let moved = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        // Nine steps of at most the learning rate, or a little more, each.
        let policy_moved = moved(&policy.policy.parameters, &before.policy.parameters);
        let value_moved = moved(&policy.value.parameters, &before.value.parameters);
        assert!(policy_moved > settings.policy_rate && policy_moved < 20.0 * settings.policy_rate);
        assert!(value_moved > settings.value_rate && value_moved < 20.0 * settings.value_rate);
        // The next update has the states as far from their mean as they vary.
        tuples.states = states.clone();
        ppo.update(&mut policy, &mut tuples, &settings, &Progress::new()).expect("not cancelled");
        let mean = tuples.states.iter().step_by(2).sum::<f32>() / 12.0;
        assert!(mean.abs() < 1e-4 && tuples.states != states);
        let progress = Progress::new();
        progress.cancel();
        assert!(ppo.update(&mut policy, &mut tuples, &settings, &progress).is_err());
    }

    #[test]
    fn values_are_in_units_of_the_reward() {
        let (mut policy, tuples, _) = small();
        policy.value.parameters.fill(0.0);
        let last = policy.value.parameters.len() - 1;
        policy.value.parameters[last] = 0.7;
        let values = all_values(&policy, &tuples.states);
        assert_eq!(values.len(), 12);
        assert!(values.iter().all(|v| (v - 7.0).abs() < 1e-5), "{values:?}");
    }
}
