//! The field's own checks of PPO, CartPole-v1 and Pendulum-v1 by their published dynamics, learnt by the very update that
//! the controller makes ([`Ppo::update`]: advantages, clipped objective, limits of the gradients, Adam, the states' scale).
//!
//! π has a logit for each action type and a Gaussian vector. CartPole opens two of the types and has no vector, which
//! is the categorical policy of the field; Pendulum opens one and has a vector of one number, which is its Gaussian one.
//!
//! Other than in CleanRL's `ppo.py` and in Stable-Baselines3: ReLU for tanh, normal weights for orthogonal ones, advantages
//! standardized over an update for a batch, states always scaled and rewards never, V with an Adam and a limit of its own
//! and no clipped loss.

use oncue::Progress;
use oncue::controller::Policy;
use oncue::internals::{Activations, Gaussian, Mlp, Normalizer, Ppo, Tuples, draw};
use oncue::settings::PpoSettings;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// A task of classic control.
pub trait Control {
    /// Numbers of a state.
    const STATE: usize;
    /// Types of action that are open.
    const CHOICES: usize;
    /// Numbers of the continuous action.
    const NUMBERS: usize;
    /// An episode is over after so many steps.
    const LIMIT: usize;

    /// Where an episode begins.
    fn begin(rng: &mut Pcg64) -> Self;
    /// What is seen.
    fn state(&self) -> Vec<f32>;
    /// Plays an action; the reward, and whether the episode has failed.
    fn step(&mut self, choice: usize, numbers: &[f32]) -> (f32, bool);
}

/// A pole on a cart that is pushed left or right (Barto, Sutton and Anderson 1983), with the constants and the Euler steps
/// of gymnasium's CartPole-v1.
#[derive(Debug, Clone)]
pub struct CartPole {
    /// Place of the cart, m, and its velocity; angle of the pole, rad, and its velocity.
    pub now: [f64; 4],
}

impl Control for CartPole {
    const STATE: usize = 4;
    const CHOICES: usize = 2;
    const NUMBERS: usize = 0;
    const LIMIT: usize = 500;

    fn begin(rng: &mut Pcg64) -> Self {
        Self { now: std::array::from_fn(|_| rng.random_range(-0.05..0.05)) }
    }

    fn state(&self) -> Vec<f32> {
        self.now.iter().map(|v| *v as f32).collect()
    }

    fn step(&mut self, choice: usize, _: &[f32]) -> (f32, bool) {
        const GRAVITY: f64 = 9.8;
        const POLE_MASS: f64 = 0.1;
        const MASS: f64 = 1.0 + POLE_MASS;
        /// Half of the pole.
        const LENGTH: f64 = 0.5;
        const FORCE: f64 = 10.0;
        const SECONDS: f64 = 0.02;
        let [place, velocity, angle, turning] = self.now;
        let force = if choice == 1 { FORCE } else { -FORCE };
        let (sine, cosine) = angle.sin_cos();
        let common = (force + POLE_MASS * LENGTH * turning * turning * sine) / MASS;
        let turn =
            (GRAVITY * sine - cosine * common) / (LENGTH * (4.0 / 3.0 - POLE_MASS * cosine * cosine / MASS));
        let push = common - POLE_MASS * LENGTH * turn * cosine / MASS;
        self.now = [
            place + SECONDS * velocity,
            velocity + SECONDS * push,
            angle + SECONDS * turning,
            turning + SECONDS * turn,
        ];
        (1.0, self.now[0].abs() > 2.4 || self.now[2].abs() > 12f64.to_radians())
    }
}

/// A pendulum that is swung up and held by a torque too weak to lift it at once: gymnasium's Pendulum-v1.
#[derive(Debug, Clone)]
pub struct Pendulum {
    /// Angle from upright, rad, and its velocity.
    pub now: [f64; 2],
}

impl Control for Pendulum {
    const STATE: usize = 3;
    const CHOICES: usize = 1;
    const NUMBERS: usize = 1;
    const LIMIT: usize = 200;

    fn begin(rng: &mut Pcg64) -> Self {
        let half = std::f64::consts::PI;
        Self { now: [rng.random_range(-half..half), rng.random_range(-1.0..1.0)] }
    }

    fn state(&self) -> Vec<f32> {
        let [angle, turning] = self.now;
        vec![angle.cos() as f32, angle.sin() as f32, turning as f32]
    }

    fn step(&mut self, _: usize, numbers: &[f32]) -> (f32, bool) {
        const GRAVITY: f64 = 10.0;
        const SECONDS: f64 = 0.05;
        const FASTEST: f64 = 8.0;
        const STRONGEST: f64 = 2.0;
        let [angle, turning] = self.now;
        let torque = f64::from(numbers[0]).clamp(-STRONGEST, STRONGEST);
        // Mass and length are 1.
        let off = (angle + std::f64::consts::PI).rem_euclid(std::f64::consts::TAU) - std::f64::consts::PI;
        let cost = off * off + 0.1 * turning * turning + 0.001 * torque * torque;
        let faster = turning + SECONDS * (1.5 * GRAVITY * angle.sin() + 3.0 * torque);
        let faster = faster.clamp(-FASTEST, FASTEST);
        self.now = [angle + SECONDS * faster, faster];
        (-cost as f32, false)
    }
}

/// How a task is learnt.
#[derive(Debug, Clone)]
pub struct Lesson {
    /// Widths, rates, batches and the rest; `tuples` is what an update learns from.
    pub ppo: PpoSettings,
    /// Episodes that are played side by side.
    pub environments: usize,
    /// Steps in all; the rates fall to zero over them, along a line.
    pub steps: usize,
}

impl Lesson {
    /// CleanRL's `ppo.py` with its defaults, but for V's rate: that of the controller, four times π's. With π's, 2.5e-4, ten
    /// seeds end between 231 and 500.
    pub fn cart_pole() -> Self {
        let ppo = PpoSettings {
            policy_layers: vec![64; 2],
            value_layers: vec![64; 2],
            policy_rate: 2.5e-4,
            value_rate: 1e-3,
            discount: 0.99,
            lambda: 0.95,
            clip: 0.2,
            tuples: 4 * 128,
            batch: 128,
            epochs: 4,
            gradient_norm: 0.5,
            entropy: 0.01,
            ..PpoSettings::default()
        };
        Self { ppo, environments: 4, steps: 500_000 }
    }

    /// CleanRL's `ppo_continuous_action.py` with its defaults, for half of its steps.
    pub fn pendulum() -> Self {
        let ppo = PpoSettings {
            policy_rate: 3e-4,
            value_rate: 3e-4,
            tuples: 2048,
            batch: 64,
            epochs: 10,
            entropy: 0.0,
            ..Self::cart_pole().ppo
        };
        Self { ppo, environments: 1, steps: 500_000 }
    }
}

/// What came of a lesson.
pub struct Learnt {
    /// π and V at the end.
    pub policy: Policy,
    /// Returns of the episodes that ended on the way, in order.
    pub returns: Vec<f32>,
}

impl Learnt {
    /// Mean return of the last hundred episodes, the field's figure.
    pub fn last_hundred(&self) -> f32 {
        let last = &self.returns[self.returns.len().saturating_sub(100)..];
        last.iter().sum::<f32>() / last.len() as f32
    }
}

/// Random networks for a task.
fn beginner<C: Control>(ppo: &PpoSettings, rng: &mut Pcg64) -> Policy {
    let types = oncue::ActionType::COUNT;
    let sizes = |hidden: &[usize], outputs: usize| [&[C::STATE], hidden, &[outputs]].concat();
    Policy {
        policy: Mlp::new(&sizes(&ppo.policy_layers, types + C::NUMBERS), 0.01, rng),
        value: Mlp::new(&sizes(&ppo.value_layers, 1), 0.01, rng),
        log_std: vec![0.0; C::NUMBERS],
        normalizer: Normalizer::new(C::STATE),
    }
}

struct Slot<C> {
    control: C,
    steps: usize,
    total: f32,
}

impl<C: Control> Slot<C> {
    fn begin(rng: &mut Pcg64) -> Self {
        Self { control: C::begin(rng), steps: 0, total: 0.0 }
    }

    /// Plays an action; the reward, and whether the episode is over.
    fn step(&mut self, choice: usize, numbers: &[f32]) -> (f32, bool) {
        let (reward, failed) = self.control.step(choice, numbers);
        self.steps += 1;
        self.total += reward;
        (reward, failed || self.steps == C::LIMIT)
    }
}

/// Learns a task from scratch.
pub fn learn<C: Control>(lesson: &Lesson, seed: u64) -> Learnt {
    let mut rng = Pcg64::seed_from_u64(seed);
    let mut ppo_settings = lesson.ppo.clone();
    let mut policy = beginner::<C>(&ppo_settings, &mut rng);
    let mut ppo = Ppo::new(&policy, &ppo_settings, seed.wrapping_add(1));
    let mut slots: Vec<Slot<C>> = (0..lesson.environments).map(|_| Slot::begin(&mut rng)).collect();
    let mut returns = Vec::new();
    let updates = lesson.steps / lesson.ppo.tuples;
    for update in 0..updates {
        let left = 1.0 - update as f32 / updates as f32;
        ppo_settings.policy_rate = left * lesson.ppo.policy_rate;
        ppo_settings.value_rate = left * lesson.ppo.value_rate;
        let mut tuples = gather(&policy, &mut slots, ppo_settings.tuples, &mut returns, &mut rng);
        ppo.update(&mut policy, &mut tuples, &ppo_settings, &Progress::new()).expect("not cancelled");
    }
    Learnt { policy, returns }
}

/// Tuples as the controller's rollout gives them.
fn gather<C: Control>(
    policy: &Policy,
    slots: &mut [Slot<C>],
    count: usize,
    returns: &mut Vec<f32>,
    rng: &mut Pcg64,
) -> Tuples {
    let steps = count / slots.len();
    let width = oncue::ActionType::COUNT + C::NUMBERS;
    let (map, gaussian) = (policy.normalizer.map(), Gaussian::of(&policy.log_std));
    let allowed = std::array::from_fn(|k| k < C::CHOICES);
    let mut parts = vec![Tuples::default(); slots.len()];
    let mut activations = Activations::default();
    for _ in 0..steps {
        let mut states = Vec::with_capacity(slots.len() * C::STATE);
        for (slot, part) in slots.iter().zip(&mut parts) {
            let state = slot.control.state();
            part.states.extend_from_slice(&state);
            states.extend(state);
        }
        Policy::normalize(&mut states, &map);
        let means = policy.means(&states, slots.len(), &mut activations);
        for ((slot, part), mean) in slots.iter_mut().zip(&mut parts).zip(means.chunks_exact(width)) {
            let drawn = draw(mean, allowed, &gaussian, 1.0, rng);
            let (reward, over) = slot.step(drawn.action_type, &drawn.vector);
            part.proposals.extend(std::iter::repeat_n(0.0, width));
            part.allowed.push(allowed);
            part.types.push(drawn.action_type);
            part.vectors.extend(drawn.vector);
            part.log_probabilities.push(drawn.log_probability);
            part.rewards.push(reward);
            part.ended.push(over);
            if over {
                returns.push(slot.total);
                *slot = Slot::begin(rng);
            }
        }
    }
    let mut all = Tuples { per_environment: steps, ..Tuples::default() };
    for (slot, part) in slots.iter().zip(parts) {
        all.states.extend(part.states);
        all.proposals.extend(part.proposals);
        all.allowed.extend(part.allowed);
        all.types.extend(part.types);
        all.vectors.extend(part.vectors);
        all.log_probabilities.extend(part.log_probabilities);
        all.rewards.extend(part.rewards);
        all.ended.extend(part.ended);
        all.last_states.extend(slot.control.state());
    }
    all
}

/// Mean return of fresh episodes: actions drawn from π, or its mean and likeliest type.
pub fn play<C: Control>(policy: &Policy, episodes: usize, drawn: bool, seed: u64) -> f32 {
    let mut rng = Pcg64::seed_from_u64(seed);
    let (map, gaussian) = (policy.normalizer.map(), Gaussian::of(&policy.log_std));
    let allowed = std::array::from_fn(|k| k < C::CHOICES);
    let mut activations = Activations::default();
    let mut total = 0.0;
    for _ in 0..episodes {
        let mut slot = Slot::<C>::begin(&mut rng);
        loop {
            let mut state = slot.control.state();
            Policy::normalize(&mut state, &map);
            let mean = policy.means(&state, 1, &mut activations);
            let action = draw(mean, allowed, &gaussian, f32::from(u8::from(drawn)), &mut rng);
            if slot.step(action.action_type, &action.vector).1 {
                break;
            }
        }
        total += slot.total;
    }
    total / episodes as f32
}
