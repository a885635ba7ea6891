//! Prints what PPO makes of the field's own checks, CartPole-v1 and Pendulum-v1: the returns that it comes to within 500,000
//! steps with CleanRL's settings, and the seconds of each seed.
//!
//! With `ONCUE_PEERS` naming a Python that has it, Stable-Baselines3 learns the same by the same settings in gymnasium's
//! environments (`tools/peers/stable_baselines.py`), after those were found to move as ours do. That takes ten minutes.
//! `cargo bench --bench learning`, or `nox -s bench`, which sets the variable.

#[path = "../tests/common/control.rs"]
mod control;
#[allow(dead_code)] // each bench uses what it needs of it
mod peer;

use std::time::Instant;

use control::{CartPole, Control, Lesson, Pendulum, learn, play};
use peer::Work;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use serde_json::json;

const SEEDS: [u64; 3] = [1, 2, 3];
/// Fresh episodes that a policy is judged by.
const EPISODES: usize = 100;
/// Steps that are compared with gymnasium's.
const STEPS: usize = 1000;

fn main() {
    task::<CartPole>("CartPole-v1", 475.0, &Lesson::cart_pole(), |control| control.now.to_vec());
    task::<Pendulum>("Pendulum-v1", -250.0, &Lesson::pendulum(), |control| control.now.to_vec());
}

/// Learns a task with each seed; `wanted` is the return that is asked for, `inner` the whole of an environment's state.
fn task<C: Control>(name: &str, wanted: f32, lesson: &Lesson, inner: impl Fn(&C) -> Vec<f64>) {
    let (mut last, mut drawn, mut likeliest, mut seconds) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for seed in SEEDS {
        let lap = Instant::now();
        let learnt = learn::<C>(lesson, seed);
        seconds.push(lap.elapsed().as_secs_f64());
        last.push(learnt.last_hundred());
        drawn.push(play::<C>(&learnt.policy, EPISODES, true, 9));
        likeliest.push(play::<C>(&learnt.policy, EPISODES, false, 9));
    }
    let mean = |of: &[f32]| of.iter().sum::<f32>() / of.len() as f32;
    let each = |of: &[f32]| of.iter().map(|v| format!("{v:.0}")).collect::<Vec<_>>().join(", ");
    println!(
        "{name}, {} steps: last {EPISODES} episodes {:.1} ({}), wanted {wanted}; as many fresh ones {:.1} drawn, {:.1} without noise; {:.1} s a seed",
        lesson.steps,
        mean(&last),
        each(&last),
        mean(&drawn),
        mean(&likeliest),
        seconds.iter().sum::<f64>() / seconds.len() as f64,
    );
    let Some(work) = Work::new(&format!("learning-{name}").to_lowercase()) else { return };
    write_steps::<C>(&work, inner);
    let facts = json!({
        "task": name, "ppo": lesson.ppo, "environments": lesson.environments, "steps": lesson.steps,
        "state": C::STATE, "numbers": C::NUMBERS, "last": mean(&last), "drawn": mean(&drawn),
        "likeliest": mean(&likeliest), "seconds": seconds.iter().sum::<f64>() / seconds.len() as f64,
    });
    work.run("stable_baselines.py", &facts);
}

/// Steps of episodes that are played at random: before, what was done, what is seen after and the reward.
fn write_steps<C: Control>(work: &Work, inner: impl Fn(&C) -> Vec<f64>) {
    let mut rng = Pcg64::seed_from_u64(7);
    let (mut before, mut choices, mut torques, mut after, mut rewards) =
        (Vec::new(), Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let mut control = C::begin(&mut rng);
    for _ in 0..STEPS {
        // As gymnasium will be given it.
        before.extend(inner(&control).into_iter().map(|v| v as f32));
        let choice = rng.random_range(0..C::CHOICES);
        let numbers: Vec<f32> = (0..C::NUMBERS).map(|_| rng.random_range(-2.5..2.5)).collect();
        let (reward, failed) = control.step(choice, &numbers);
        choices.push(choice as u32);
        torques.extend(numbers);
        after.extend(control.state());
        rewards.push(reward);
        if failed {
            control = C::begin(&mut rng);
        }
    }
    work.floats("before", &before);
    work.counts("choices", choices);
    work.floats("torques", &torques);
    work.floats("after", &after);
    work.floats("rewards", &rewards);
}
