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
    /// Of no states yet, of `size` numbers each: leaves them as they are.
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

    #[test]
    fn what_is_drawn_is_spread_as_the_policy_says() {
        use rand::SeedableRng;
        let mut rng = rand_pcg::Pcg64::seed_from_u64(2);
        // Logits of 1 : e : e² over two allowed types, and two numbers about 1 and -2.
        let mean = [0.0, 1.0, 2.0, 1.0, -2.0];
        let gaussian = Gaussian::of(&[0.5f32.ln(), 2f32.ln()]);
        let draws: Vec<Draw> =
            (0..4000).map(|_| draw(&mean, [true, false, true], &gaussian, 1.0, &mut rng)).collect();
        let count = |k: usize| draws.iter().filter(|d| d.action_type == k).count() as f32 / 4000.0;
        let p = 1.0 / (1.0 + 2f32.exp());
        assert!((count(0) - p).abs() < 0.02 && count(1) == 0.0 && (count(2) + p - 1.0).abs() < 0.02);
        for (k, (at, std)) in [(1.0, 0.5), (-2.0, 2.0)].into_iter().enumerate() {
            let m = draws.iter().map(|d| d.vector[k]).sum::<f32>() / 4000.0;
            let v = draws.iter().map(|d| (d.vector[k] - m).powi(2)).sum::<f32>() / 4000.0;
            assert!((m - at).abs() < 0.1 * std && (v.sqrt() / std - 1.0).abs() < 0.05, "{m} {v}");
        }
        for d in draws.iter().take(20) {
            let of = |k: usize, std: f32| {
                let z = (d.vector[k] - mean[3 + k]) / std;
                -0.5 * z * z - std.ln() - 0.5 * std::f32::consts::TAU.ln()
            };
            let chosen = if d.action_type == 0 { p } else { 1.0 - p };
            assert!((d.log_probability - chosen.ln() - of(0, 0.5) - of(1, 2.0)).abs() < 1e-4);
        }
        // Half the spread halves it; none takes the mean and the likeliest type that is allowed.
        let half: Vec<f32> =
            (0..4000).map(|_| draw(&mean, [true; 3], &gaussian, 0.5, &mut rng).vector[1]).collect();
        let v = half.iter().map(|x| (x + 2.0).powi(2)).sum::<f32>() / 4000.0;
        assert!((v.sqrt() - 1.0).abs() < 0.05, "{v}");
        let still = draw(&mean, [true, true, false], &gaussian, 0.0, &mut rng);
        assert_eq!((still.action_type, still.vector), (1, vec![1.0, -2.0]));
        // All three types are drawn as often as they are likely.
        let mut counts = [0; 3];
        (0..4000).for_each(|_| counts[draw(&mean, [true; 3], &gaussian, 1.0, &mut rng).action_type] += 1);
        for (count, p) in counts.into_iter().zip(type_probabilities(&mean[..3], [true; 3])) {
            assert!((count as f32 / 4000.0 - p).abs() < 0.025, "{counts:?}");
        }
    }

    #[test]
    fn a_normalizer_learns_row_by_row_and_does_not_blow_up_noise() {
        let mut n = Normalizer::new(2);
        assert_eq!(n.map(), [(1.0, 0.0); 2]);
        n.update(&[1.0, 5.0]);
        assert_eq!(n.map(), [(1.0, 0.0); 2]);
        n.update(&[3.0, 5.0, 5.0, 5.001]);
        n.update(&[7.0, 5.0]);
        let map = n.map();
        let std = 5f32.sqrt();
        assert!((map[0].0 - 1.0 / std).abs() < 1e-6 && (map[0].1 + 4.0 / std).abs() < 1e-5);
        assert!((map[1].0 - 20.0).abs() < 1e-4 && (map[1].1 + 100.0).abs() < 0.1);
        let mut states = [4.0 + std, 5.0, 400.0, -100.0];
        Policy::normalize(&mut states, &map);
        assert!((states[0] - 1.0).abs() < 1e-5 && states[1].abs() < 0.01);
        assert_eq!(states[2..], [CLIP, -CLIP]);
    }

    #[test]
    fn a_policy_is_made_to_its_settings_and_knows_when_it_is_broken() {
        use rand::SeedableRng;
        let mut settings = Settings::default();
        settings.ppo.policy_layers = vec![4];
        settings.ppo.value_layers = vec![3];
        (settings.ppo.log_std_future, settings.ppo.log_std_offset) = (-1.5, -2.5);
        let policy = Policy::new(5, &settings, &mut rand_pcg::Pcg64::seed_from_u64(1));
        assert_eq!((policy.state_size(), policy.vector_size(), policy.sizes()), (5, 15, (5, 18)));
        assert_eq!(policy.log_std[..3], [-1.5; 3]);
        assert_eq!(policy.log_std[3..], [-2.5; 12]);
        assert!(policy.is_consistent());
        let broken: [&dyn Fn(&mut Policy); 8] = [
            &|p| p.policy.parameters[3] = f32::NAN,
            &|p| p.value.parameters[0] = f32::INFINITY,
            &|p| p.log_std[2] = f32::NAN,
            &|p| p.policy.parameters.truncate(3),
            &|p| p.value.parameters.truncate(3),
            &|p| p.normalizer.mean.truncate(4),
            &|p| p.normalizer.square[1] = f64::NAN,
            &|p| p.normalizer.count = f64::NAN,
        ];
        for change in broken {
            let mut other = policy.clone();
            change(&mut other);
            assert!(!other.is_consistent());
        }
        let mut other = policy.clone();
        other.value = Policy::new(6, &settings, &mut rand_pcg::Pcg64::seed_from_u64(1)).value;
        assert!(!other.is_consistent(), "a value of other states");
        other.value = policy.policy.clone();
        assert!(!other.is_consistent(), "a value of many numbers");
        // One row and several give the same means.
        let states: Vec<f32> = (0..10).map(|i| 0.1 * i as f32).collect();
        let mut activations = Activations::default();
        let both = policy.means(&states, 2, &mut activations).to_vec();
        let second = policy.means(&states[5..], 1, &mut activations);
        assert!(both[18..].iter().zip(second).all(|(a, b)| (a - b).abs() < 1e-6));
    }
}
