//! Prints, as JSON, what PPO makes of a few hundred tuples: advantages and returns, then every number that learning moves, before
//! the first gradient step and after each. `tests/test_learning.py` follows it in double precision.
//!
//! The tuples are drawn at random, by a policy that has moved since, so that some ratios are clipped.

use oncue::controller::Policy;
use oncue::internals::{Activations, Gaussian, Ppo, Targets, Tuples, draw};
use oncue::{ActionType, Settings};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use serde_json::{Value, json};

const STATE: usize = 9;
const ENVIRONMENTS: usize = 6;
const STEPS: usize = 100;

fn main() {
    let mut settings = Settings::default();
    settings.ppo.policy_layers = vec![24, 16];
    settings.ppo.value_layers = vec![20];
    settings.ppo.entropy = 0.05;
    (settings.ppo.log_std_future, settings.ppo.log_std_offset) = (-0.3, -0.6);
    // More rows than one thread takes at a time, and a last batch of fewer.
    settings.ppo.batch = 350;
    settings.ppo.epochs = 2;
    // Two step sizes that tell π from V, and a limit that one of them keeps to.
    (settings.ppo.policy_rate, settings.ppo.value_rate) = (2e-4, 1e-3);
    settings.ppo.gradient_norm = 1.3;
    let mut rng = Pcg64::seed_from_u64(5);
    let mut policy = Policy::new(STATE, &settings, &mut rng);
    policy.policy.parameters.iter_mut().for_each(|p| *p += rng.random_range(-0.1..0.1));
    policy.value.parameters.iter_mut().for_each(|p| *p += rng.random_range(-0.1..0.1));
    let tuples = tuples(&policy, &mut rng);
    policy.policy.parameters.iter_mut().for_each(|p| *p += rng.random_range(-0.01..0.01));
    policy.log_std.iter_mut().for_each(|p| *p += rng.random_range(-0.01..0.01));

    let targets = Targets::of(&policy, &tuples, &settings.ppo);
    let mut ppo = Ppo::new(&policy, &settings.ppo, 1);
    let mut moments = vec![state(&policy, &ppo)];
    let mut batches = Vec::new();
    let order: Vec<usize> = (0..ENVIRONMENTS * STEPS).map(|i| i * 7 % (ENVIRONMENTS * STEPS)).collect();
    for _ in 0..settings.ppo.epochs {
        for batch in order.chunks(settings.ppo.batch) {
            ppo.step(&mut policy, &tuples, &targets, batch, &settings.ppo);
            batches.push(batch);
            moments.push(state(&policy, &ppo));
        }
    }
    println!(
        "{}",
        json!({
            "ppo": settings.ppo,
            "policy_sizes": policy.policy.sizes,
            "value_sizes": policy.value.sizes,
            "per_environment": STEPS,
            "states": tuples.states,
            "last_states": tuples.last_states,
            "proposals": tuples.proposals,
            "vectors": tuples.vectors,
            "log_probabilities": tuples.log_probabilities,
            "rewards": tuples.rewards,
            "ended": tuples.ended,
            "types": tuples.types,
            "allowed": tuples.allowed,
            "advantages": targets.advantages,
            "returns": targets.returns,
            "batches": batches,
            "moments": moments,
        })
    );
}

/// The numbers that learning moves: parameters and both moments of π's network, V's and the spread.
fn state(policy: &Policy, ppo: &Ppo) -> Value {
    let parameters = [&policy.policy.parameters, &policy.value.parameters, &policy.log_std];
    let parts = parameters.into_iter().zip(ppo.optimizers()).map(|(parameters, adam)| {
        let (first, second) = adam.moments();
        json!({ "parameters": parameters, "first": first, "second": second })
    });
    parts.collect()
}

fn tuples(policy: &Policy, rng: &mut Pcg64) -> Tuples {
    let width = ActionType::COUNT + policy.vector_size();
    let gaussian = Gaussian::of(&policy.log_std);
    let mut activations = Activations::default();
    let mut tuples = Tuples { per_environment: STEPS, ..Tuples::default() };
    for t in 0..ENVIRONMENTS * STEPS {
        let state: [f32; STATE] = std::array::from_fn(|_| rng.random_range(-1.0..1.0));
        let proposal: Vec<f32> = (0..width).map(|_| rng.random_range(-0.3..0.3)).collect();
        let means = policy.means(&state, 1, &mut activations);
        let mean: Vec<f32> = means.iter().zip(&proposal).map(|(m, p)| m + p).collect();
        // All types, two of them, and one.
        let allowed = std::array::from_fn(|k| k == 0 || t % 5 > k);
        let drawn = draw(&mean, allowed, &gaussian, 1.0, rng);
        tuples.states.extend(state);
        tuples.proposals.extend(proposal);
        tuples.allowed.push(allowed);
        tuples.types.push(drawn.action_type);
        tuples.vectors.extend(drawn.vector);
        tuples.log_probabilities.push(drawn.log_probability);
        tuples.rewards.push(rng.random_range(-1.0..2.0));
        tuples.ended.push(rng.random::<f32>() < 0.05);
    }
    tuples.last_states = (0..ENVIRONMENTS * STATE).map(|_| rng.random_range(-1.0..1.0)).collect();
    tuples
}
