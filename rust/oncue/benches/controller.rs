//! Prints what the controller's parts cost: search µs, µs of an observation and of a decision, environment
//! steps a second, seconds an update. Each beside a plain reference in the same run where there is one.
//!
//! `cargo bench --bench controller`

use std::hint::black_box;
use std::time::Instant;

use glam::Vec3;
use oncue::controller::episode::Environment;
use oncue::controller::policy::{Policy, draw};
use oncue::controller::ppo::Ppo;
use oncue::controller::rollout::Rollout;
use oncue::library::database::MotionDatabase;
use oncue::library::feature::{Future, feature_size, write_feature};
use oncue::library::starter;
use oncue::scene::SceneIndex;
use oncue::{ActionCue, ActionType, InitialState, Progress, Settings, Task};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

fn main() {
    let progress = Progress::new();
    let settings = Settings::default();
    let library = starter::generate(&progress).expect("the starter library");
    let database =
        MotionDatabase::build(&library, &settings.synthesizer.weights, &progress).expect("a database");
    println!(
        "library: {} frames, {} walk, {} sit entries",
        database.frames.len(),
        database.entry_count(ActionType::Walk),
        database.entry_count(ActionType::Sit)
    );
    search(&database);

    let (positions, triangles) = room();
    let scene = SceneIndex::build(&positions, &triangles, &settings.scene, &progress).expect("a scene");
    let task = Task {
        start: InitialState { name: "Start".into(), position: Vec3::new(-2.0, -1.5, 0.0), yaw: 0.0 },
        cue: ActionCue {
            name: "Sit".into(),
            action_type: ActionType::Sit,
            position: Vec3::new(2.0, 1.0, 0.55),
            yaw: -std::f32::consts::FRAC_PI_2,
            feet: [None, None],
        },
        manipulations: Vec::new(),
    };
    let environment = Environment::new(&scene, &database, &task, &settings);
    let mut rng = Pcg64::seed_from_u64(1);
    let mut policy = Policy::new(environment.state_size(), &settings, &mut rng);
    println!("state: {} numbers", environment.state_size());
    decision(&environment, &policy);

    let mut rollout = Rollout::new(std::slice::from_ref(&environment), 1);
    let lap = Instant::now();
    let mut tuples =
        rollout.gather(std::slice::from_ref(&environment), &policy, settings.ppo.tuples, &progress);
    let rolled = lap.elapsed().as_secs_f64();
    let lap = Instant::now();
    let mut ppo = Ppo::new(&policy, &settings.ppo, 1);
    ppo.update(&mut policy, &mut tuples, &settings.ppo, &progress).expect("not cancelled");
    let learnt = lap.elapsed().as_secs_f64();
    let n = tuples.rewards.len() as f64;
    println!("rollout: {:.0} environment steps/s ({rolled:.2} s)", n / rolled);
    println!("update of {n:.0} tuples: {:.2} s (learning {learnt:.2} s)", rolled + learnt);
}

fn search(database: &MotionDatabase) {
    let mut rng = Pcg64::seed_from_u64(5);
    for action_type in [ActionType::Walk, ActionType::Sit] {
        let size = feature_size(action_type);
        let frames: Vec<usize> =
            (0..database.frames.len()).filter(|f| database.future(action_type, *f).is_some()).collect();
        let feature = |frame: usize| {
            let mut out = vec![0.0; size];
            let future =
                database.future(action_type, frame).unwrap_or(Future::Complete(Default::default(), 0.0));
            write_feature(&database.pose_features[frame], &future, &mut out);
            out
        };
        let all: Vec<f32> = frames.iter().flat_map(|f| feature(*f)).collect();
        let weights = database.weights.vector(action_type);
        for noise in [0.02, 0.1, 0.3] {
            let queries: Vec<Vec<f32>> = (0..200)
                .map(|_| {
                    let mut q = feature(frames[rng.random_range(0..frames.len())]);
                    q.iter_mut().for_each(|v| *v += noise * rng.random_range(-1.0f32..1.0));
                    q
                })
                .collect();
            let lap = Instant::now();
            for q in &queries {
                black_box(database.search(action_type, q, None));
            }
            let ours = lap.elapsed().as_secs_f64() / 200e-6;
            let lap = Instant::now();
            for q in &queries[..50] {
                black_box(brute_force(&all, &weights, q));
            }
            let brute = lap.elapsed().as_secs_f64() / 50e-6;
            println!("search {action_type:?} noise {noise}: {ours:.1} µs; brute force {brute:.1} µs");
        }
    }
}

fn brute_force(all: &[f32], weights: &[f32], query: &[f32]) -> (usize, f32) {
    let mut best = (0, f32::INFINITY);
    for (k, y) in all.chunks_exact(weights.len()).enumerate() {
        let cost: f32 = y.iter().zip(query).zip(weights).map(|((y, x), w)| (w * (x - y)).powi(2)).sum();
        if cost < best.1 {
            best = (k, cost);
        }
    }
    best
}

fn decision(environment: &Environment, policy: &Policy) {
    let mut rng = Pcg64::seed_from_u64(9);
    let mut state = vec![0.0; environment.state_size()];
    let (mut observing, mut stepping, mut count) = (0.0, 0.0, 0);
    let width = 3 + policy.vector_size();
    let mut frames = 0;
    for _ in 0..60 {
        let mut episode = environment.begin_anywhere(&mut rng);
        for _ in 0..30 {
            let lap = Instant::now();
            let observation = environment.observe(&episode, &mut state);
            observing += lap.elapsed().as_secs_f64();
            let mean: Vec<f32> = observation.proposal.clone();
            assert_eq!(mean.len(), width);
            let drawn = draw(&mean, observation.allowed, &policy.log_std, 1.0, &mut rng);
            let lap = Instant::now();
            let outcome = environment.step(&mut episode, &observation, &drawn);
            stepping += lap.elapsed().as_secs_f64();
            count += 1;
            if outcome.end.is_some() {
                break;
            }
        }
        frames += episode.tally.frames;
    }
    let n = f64::from(count);
    println!(
        "observation {:.1} µs, step {:.1} µs, {:.2} µs a frame",
        observing / n * 1e6,
        stepping / n * 1e6,
        stepping / frames as f64 * 1e6
    );
}

/// A room of 6 × 5 m with furniture, finely tessellated.
fn room() -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    let mut add = |low: [f32; 3], high: [f32; 3]| {
        let (l, h) = (Vec3::from(low), Vec3::from(high));
        let base = positions.len() as u32;
        for i in 0..8 {
            let pick = |bit: u32, a: f32, b: f32| if i & bit == 0 { a } else { b };
            positions.push(Vec3::new(pick(1, l.x, h.x), pick(2, l.y, h.y), pick(4, l.z, h.z)));
        }
        for q in [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]] {
            triangles.push([base + q[0], base + q[1], base + q[2]]);
            triangles.push([base + q[0], base + q[2], base + q[3]]);
        }
    };
    add([-3.0, -2.5, -0.1], [3.0, 2.5, 0.0]);
    for wall in
        [[-3.1, -2.5, 3.1, -2.4], [-3.1, 2.4, 3.1, 2.5], [-3.1, -2.5, -3.0, 2.5], [3.0, -2.5, 3.1, 2.5]]
    {
        add([wall[0], wall[1], 0.0], [wall[2], wall[3], 2.5]);
    }
    add([-0.4, -0.6, 0.0], [0.6, 0.6, 0.45]);
    add([1.75, 0.4, 0.0], [2.4, 1.8, 0.45]);
    add([2.4, 0.4, 0.0], [2.5, 1.8, 0.9]);
    (positions, triangles)
}
