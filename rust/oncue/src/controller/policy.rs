//! π and its value function: the paper's networks, and what they need beside them to be used again.

use rand::{Rng, RngExt};
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};

use crate::action::ActionType;
use crate::nn::{Activations, Mlp};
use crate::settings::Settings;

/// Observations are cut off this many standard deviations from the mean (released: 10).
const CLIP: f32 = 10.0;

/// Mean and variance of every number of the state, learnt while rolling out.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Normalizer {
    count: f64,
    mean: Vec<f64>,
    square: Vec<f64>,
}

impl Normalizer {
    pub fn new(size: usize) -> Self {
        Self { count: 0.0, mean: vec![0.0; size], square: vec![0.0; size] }
    }

    fn is_consistent(&self, size: usize) -> bool {
        let sound = |numbers: &[f64]| numbers.len() == size && numbers.iter().all(|n| n.is_finite());
        self.count.is_finite() && sound(&self.mean) && sound(&self.square)
    }

    /// Takes in `rows` of states.
    pub fn update(&mut self, rows: &[f32]) {
        let size = self.mean.len();
        for row in rows.chunks_exact(size) {
            self.count += 1.0;
            for ((mean, square), &x) in self.mean.iter_mut().zip(&mut self.square).zip(row) {
                let x = f64::from(x);
                let delta = x - *mean;
                *mean += delta / self.count;
                *square += delta * (x - *mean);
            }
        }
    }

    /// The affine map (scale, shift) that normalises each number.
    pub fn map(&self) -> Vec<(f32, f32)> {
        self.mean
            .iter()
            .zip(&self.square)
            .map(|(&mean, &square)| {
                if self.count < 2.0 {
                    return (1.0, 0.0);
                }
                // A number that hardly varies must not become noise.
                let std = (square / self.count).sqrt().max(0.05);
                ((1.0 / std) as f32, (-mean / std) as f32)
            })
            .collect()
    }
}

/// π(a_t | s_t) and V(s_t).
///
/// The policy's output: a logit for each action type, then the mean of the continuous action vector
/// (both on top of what the environment proposes, see `Observation`).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Policy {
    /// π's network.
    pub policy: Mlp,
    /// V's network.
    pub value: Mlp,
    /// Log standard deviation of each number of the action vector.
    pub log_std: Vec<f32>,
    /// How states are scaled before both.
    pub normalizer: Normalizer,
}

/// Logits in front of the action vector.
pub(crate) const TYPE_COUNT: usize = ActionType::COUNT;

impl Policy {
    /// Random networks for states of `state_size` numbers.
    pub fn new(state_size: usize, settings: &Settings, rng: &mut impl Rng) -> Self {
        let vector_size = settings.signal.vector_size();
        let sizes = |hidden: &[usize], outputs: usize| {
            let mut sizes = vec![state_size];
            sizes.extend_from_slice(hidden);
            sizes.push(outputs);
            sizes
        };
        let future = settings.signal.future_size();
        let mut log_std = vec![settings.ppo.log_std_offset; vector_size];
        log_std[..future].fill(settings.ppo.log_std_future);
        Self {
            policy: Mlp::new(&sizes(&settings.ppo.policy_layers, TYPE_COUNT + vector_size), 0.01, rng),
            value: Mlp::new(&sizes(&settings.ppo.value_layers, 1), 0.01, rng),
            log_std,
            normalizer: Normalizer::new(state_size),
        }
    }

    /// Numbers of a state that it takes, and of an output that it gives: a logit for each action type, then the vector.
    pub fn sizes(&self) -> (usize, usize) {
        (self.policy.input_size(), self.policy.output_size())
    }

    /// Whether its parts fit one another and hold numbers only.
    pub fn is_consistent(&self) -> bool {
        self.policy.is_consistent()
            && self.value.is_consistent()
            && self.value.input_size() == self.policy.input_size()
            && self.value.output_size() == 1
            && self.normalizer.is_consistent(self.policy.input_size())
            && [&self.policy.parameters, &self.value.parameters, &self.log_std]
                .iter()
                .all(|numbers| numbers.iter().all(|n| n.is_finite()))
    }

    /// Numbers of a state.
    pub fn state_size(&self) -> usize {
        self.policy.input_size()
    }

    /// Numbers of the continuous action vector.
    pub fn vector_size(&self) -> usize {
        self.log_std.len()
    }

    /// Applies the normaliser in place; `map` from `Normalizer::map`.
    pub fn normalize(states: &mut [f32], map: &[(f32, f32)]) {
        for row in states.chunks_exact_mut(map.len()) {
            for (x, (scale, shift)) in row.iter_mut().zip(map) {
                *x = (*x * scale + shift).clamp(-CLIP, CLIP);
            }
        }
    }

    /// Means (logits, then vector) of normalised states, `rows × (TYPE_COUNT + vector_size)`, without the proposals.
    pub fn means<'a>(&self, states: &[f32], rows: usize, activations: &'a mut Activations) -> &'a [f32] {
        if rows == 1 {
            self.policy.forward_one(states, activations);
        } else {
            self.policy.forward(states, rows, activations);
        }
        activations.output()
    }
}

/// One draw from π.
#[derive(Debug, Clone, PartialEq)]
pub struct Draw {
    pub action_type: usize,
    pub vector: Vec<f32>,
    pub log_probability: f32,
}

/// The spread of π's vector about its mean, each number by itself.
#[derive(Debug, Clone, PartialEq)]
pub struct Gaussian {
    std: Vec<f32>,
    /// 1/σ of each number.
    pub inverse: Vec<f32>,
    /// log of the density at the mean.
    peak: f32,
}

impl Gaussian {
    /// Of the logarithms of the standard deviations.
    pub fn of(log_std: &[f32]) -> Self {
        const HALF_LOG_TAU: f32 = 0.918_938_5;
        let std: Vec<f32> = log_std.iter().map(|s| s.exp()).collect();
        let inverse = std.iter().map(|s| 1.0 / s).collect();
        Self { std, inverse, peak: -log_std.iter().map(|s| s + HALF_LOG_TAU).sum::<f32>() }
    }
}

/// Draws an action; `spread` 0 takes the mean and the likeliest type, 1 draws from π.
pub fn draw(
    mean: &[f32],
    allowed: [bool; TYPE_COUNT],
    gaussian: &Gaussian,
    spread: f32,
    rng: &mut impl Rng,
) -> Draw {
    let (logits, mean) = mean.split_at(TYPE_COUNT);
    let p = type_probabilities(logits, allowed);
    let action_type = if spread > 0.0 {
        let mut u: f32 = rng.random();
        let mut chosen = 0;
        for (i, p) in p.iter().enumerate() {
            if *p > 0.0 {
                chosen = i;
                if u < *p {
                    break;
                }
                u -= p;
            }
        }
        chosen
    } else {
        (0..TYPE_COUNT).max_by(|a, b| p[*a].total_cmp(&p[*b])).unwrap_or(0)
    };
    let vector: Vec<f32> = mean
        .iter()
        .zip(&gaussian.std)
        .map(|(m, s)| {
            let n: f32 = StandardNormal.sample(rng);
            m + spread * s * n
        })
        .collect();
    let log_probability = log_probability(&p, action_type, mean, &vector, gaussian);
    Draw { action_type, vector, log_probability }
}

/// Softmax over the allowed types.
pub(crate) fn type_probabilities(logits: &[f32], allowed: [bool; TYPE_COUNT]) -> [f32; TYPE_COUNT] {
    let top = (0..TYPE_COUNT).filter(|i| allowed[*i]).map(|i| logits[i]).fold(f32::NEG_INFINITY, f32::max);
    let mut p = [0.0; TYPE_COUNT];
    for i in (0..TYPE_COUNT).filter(|i| allowed[*i]) {
        p[i] = (logits[i] - top).exp();
    }
    let sum: f32 = p.iter().sum();
    p.map(|p| p / sum)
}

/// log π(a): of the type and of the vector.
pub(crate) fn log_probability(
    p: &[f32; TYPE_COUNT],
    action_type: usize,
    mean: &[f32],
    vector: &[f32],
    gaussian: &Gaussian,
) -> f32 {
    let squares: f32 = mean
        .iter()
        .zip(vector)
        .zip(&gaussian.inverse)
        .map(|((m, v), inverse)| ((v - m) * inverse).powi(2))
        .sum();
    p[action_type].max(1e-8).ln() + gaussian.peak - 0.5 * squares
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normalizer_gives_zero_mean_and_unit_variance() {
        let mut n = Normalizer::new(1);
        n.update(&[1.0, 3.0, 5.0, 7.0]);
        let (scale, shift) = n.map()[0];
        assert!((4.0 * scale + shift).abs() < 1e-6);
        assert!((scale - 1.0 / 5.0f32.sqrt()).abs() < 1e-6);
    }

    #[test]
    fn a_forbidden_type_is_never_drawn() {
        // Two are open and equally likely; the one that is shut has by far the largest logit.
        let (mut logits, mut allowed, mut expected) =
            ([0.0; TYPE_COUNT], [false; TYPE_COUNT], [0.0; TYPE_COUNT]);
        logits[1] = 50.0;
        (allowed[0], allowed[2]) = (true, true);
        (expected[0], expected[2]) = (0.5, 0.5);
        assert_eq!(type_probabilities(&logits, allowed), expected);
        // One standard normal at its mean, worked by hand.
        let mut certain = [0.0; TYPE_COUNT];
        certain[0] = 1.0;
        let l = log_probability(&certain, 0, &[0.3], &[0.3], &Gaussian::of(&[0.0]));
        assert!((l + 0.918_938_5).abs() < 1e-6);
    }
}
