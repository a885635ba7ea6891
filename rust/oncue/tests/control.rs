//! PPO learns what the field checks it with: CartPole-v1 and Pendulum-v1, from scratch, by the controller's own update.

#[path = "common/control.rs"]
mod control;

use control::{CartPole, Control, Learnt, Lesson, Pendulum, learn, play};

/// Several: on other processors sums round otherwise, and a single seed can end on a bad stretch.
const SEEDS: [u64; 3] = [1, 2, 3];

fn mean(of: impl Iterator<Item = f32>) -> f32 {
    of.sum::<f32>() / SEEDS.len() as f32
}

fn close<const N: usize>(found: [f64; N], expected: [f64; N]) {
    assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9), "{found:?} for {expected:?}");
}

#[test]
fn the_cart_follows_its_published_equations() {
    // Upright at rest, pushed right: (10/1.1) of push in common; the pole turns by -(10/1.1) / (0.5 (4/3 - 0.1/1.1)).
    let mut upright = CartPole { now: [0.0; 4] };
    assert_eq!(upright.step(1, &[]), (1.0, false));
    let turn = -(10.0 / 1.1) / (0.5 * (4.0 / 3.0 - 0.1 / 1.1));
    close(upright.now, [0.0, 0.02 * (10.0 / 1.1 - 0.05 * turn / 1.1), 0.0, 0.02 * turn]);
    // Euler's steps: the places move by the velocities of before.
    let mut moving = CartPole { now: [0.1, 1.0, 0.0, 2.0] };
    moving.step(0, &[]);
    close([moving.now[0], moving.now[2]], [0.12, 0.04]);
    // Left is right in a mirror.
    let (mut left, mut right) =
        (CartPole { now: [0.3, -0.2, 0.1, 0.4] }, CartPole { now: [-0.3, 0.2, -0.1, -0.4] });
    left.step(0, &[]);
    right.step(1, &[]);
    close(left.now, right.now.map(|v| -v));
    // It fails beyond 12° and 2.4 m, not before.
    let step = |now| CartPole { now }.step(1, &[]).1;
    assert!(step([0.0, 0.0, 0.20, 0.5]) && !step([0.0, 0.0, 0.20, 0.45]));
    assert!(step([-2.39, -0.6, 0.0, 0.0]) && !step([-2.39, -0.4, 0.0, 0.0]));
}

#[test]
fn the_pendulum_follows_its_published_equations() {
    // Level at rest: 1.5 · 10 from gravity and 3 · 2 from the torque, which is cut off there.
    let level = std::f64::consts::FRAC_PI_2;
    for torque in [2.0, 7.0] {
        let mut pendulum = Pendulum { now: [level, 0.0] };
        let (reward, over) = pendulum.step(0, &[torque]);
        close(pendulum.now, [level + 0.05 * 1.05, 1.05]);
        assert!((f64::from(reward) + level * level + 0.004).abs() < 1e-6 && !over);
    }
    // No faster than 8 a second; the angle counts from upright, however often it has gone round.
    let mut fast = Pendulum { now: [level, 7.9] };
    let (reward, _) = fast.step(0, &[0.0]);
    close(fast.now, [level + 0.4, 8.0]);
    let mut wound = Pendulum { now: [level + 3.0 * std::f64::consts::TAU, 7.9] };
    assert!((wound.step(0, &[0.0]).0 - reward).abs() < 1e-5);
    assert!((f64::from(reward) + level * level + 0.1 * 7.9 * 7.9).abs() < 1e-5);
    let seen = Pendulum { now: [level, -3.0] }.state();
    assert!(seen.iter().zip([0.0, 1.0, -3.0]).all(|(a, b)| (a - b).abs() < 1e-6), "{seen:?}");
}

/// What is learnt with each seed, and the mean of the last hundred episodes over them.
fn learnt<C: Control>(lesson: &Lesson) -> (Vec<Learnt>, f32) {
    let learnt: Vec<Learnt> = SEEDS.into_iter().map(|seed| learn::<C>(lesson, seed)).collect();
    for (seed, learnt) in SEEDS.iter().zip(&learnt) {
        println!("seed {seed}: the last hundred episodes {:.1}", learnt.last_hundred());
    }
    let last = mean(learnt.iter().map(Learnt::last_hundred));
    (learnt, last)
}

#[test]
fn a_pole_is_held_up() {
    let (learnt, last) = learnt::<CartPole>(&Lesson::cart_pole());
    let first = mean(learnt.iter().map(|l| l.returns[..20].iter().sum::<f32>() / 20.0));
    assert!(first < 60.0, "nothing is known at first: {first}");
    assert!(last >= 475.0, "CartPole-v1 is solved at 475: {last}");
    let likeliest = mean(learnt.iter().map(|l| play::<CartPole>(&l.policy, 20, false, 9)));
    assert!(likeliest >= 475.0, "{likeliest}");
}

#[test]
fn a_pendulum_is_swung_up() {
    let (learnt, last) = learnt::<Pendulum>(&Lesson::pendulum());
    let first = mean(learnt.iter().map(|l| l.returns[..20].iter().sum::<f32>() / 20.0));
    assert!(first < -900.0, "nothing is known at first: {first}");
    assert!(last >= -250.0, "{last}");
    let drawn = mean(learnt.iter().map(|l| play::<Pendulum>(&l.policy, 20, true, 9)));
    assert!(drawn >= -250.0, "{drawn}");
}
