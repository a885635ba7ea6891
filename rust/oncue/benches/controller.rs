//! Prints what the controller's parts cost: search µs, µs of an observation and of a decision, environment
//! steps a second, seconds an update. Each beside a plain reference in the same run where there is one.
//!
//! With `ONCUE_PEERS` naming a Python that has them, the same searches are made by numpy and scipy and the same learning
//! by PyTorch (`tools/peers`). `cargo bench --bench controller`, or `nox -s bench`, which sets the variable.

#[allow(dead_code)] // each bench uses what it needs of it
mod peer;

use std::hint::black_box;
use std::time::Instant;

use glam::Vec3;
use oncue::MotionDatabase;
use oncue::controller::Environment;
use oncue::controller::Policy;
use oncue::controller::StoredPolicy;
use oncue::internals::Activations;
use oncue::internals::SearchIndex;
use oncue::internals::{Future, feature_size, write_feature};
use oncue::internals::{Gaussian, draw};
use oncue::internals::{Ppo, Targets};
use oncue::internals::{Rollout, Tuples};
use oncue::library::starter;
use oncue::scene::SceneIndex;
use oncue::settings::PpoSettings;
use oncue::{ActionCue, ActionType, InitialState, Progress, Settings, Task};
use peer::Work;
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use serde_json::json;

/// The paper's tuples an update.
const TUPLES: usize = 30_000;

fn main() {
    let progress = Progress::new();
    let settings = Settings::default();
    let library = starter::generate(&progress).expect("the starter library");
    let database =
        MotionDatabase::build(&library, &settings.synthesizer.weights, &progress).expect("a database");
    println!(
        "library: {} frames, {} walk, {} sit entries",
        database.frames.len(),
        database.entries(ActionType::Walk).len(),
        database.entries(ActionType::Sit).len()
    );
    search(&database);

    let (positions, triangles) = room();
    let scene = SceneIndex::build(&positions, &triangles, &settings.scene, &progress).expect("a scene");
    let task = Task {
        start: InitialState::standing("Start", Vec3::new(-2.0, -1.5, 0.0), 0.0),
        cue: ActionCue {
            name: "Sit".into(),
            action_type: ActionType::Sit,
            position: Vec3::new(2.0, 1.0, 0.55),
            yaw: -std::f32::consts::FRAC_PI_2,
            feet: [None, None],
        },
        passes: Vec::new(),
        manipulations: Vec::new(),
    };
    let environment = Environment::new(&scene, &database, &task, &settings).expect("settings that fit");
    let policy = Policy::new(environment.state_size(), &settings, &mut Pcg64::seed_from_u64(1));
    println!("state: {} numbers", environment.state_size());
    decision(&environment, &policy);
    real_searches(&environment);
    for preset in Settings::PRESETS {
        update(&environment, preset);
    }
}

/// One update of [`TUPLES`] from scratch with a preset's networks and epochs: rolled out, then learnt, here and in
/// PyTorch. The states are those of the environment's own preset.
fn update(environment: &Environment, preset: &str) {
    let settings = Settings::preset(preset).expect("a preset").ppo;
    let epochs = settings.epochs;
    let networks = Settings { ppo: settings.clone(), ..environment.settings.clone() };
    let policy = &Policy::new(environment.state_size(), &networks, &mut Pcg64::seed_from_u64(1));
    let environments = std::slice::from_ref(environment);
    let mut rollout = Rollout::new(environments, 1);
    let lap = Instant::now();
    let tuples = rollout.gather(environments, policy, TUPLES, &Progress::new());
    let rolled = lap.elapsed().as_secs_f64();
    let work = Work::new(&format!("update-{preset}"));
    if let Some(work) = &work {
        let order = write_tuples(work, policy, &tuples, epochs);
        write_first_step(work, policy, &tuples, &order[..settings.batch], &settings);
    }
    let states = normalized(policy, &tuples.states);
    let learn = |mut tuples: Tuples| {
        let (mut learnt, mut ppo) = (policy.clone(), Ppo::new(policy, &settings, 1));
        let lap = Instant::now();
        ppo.update(&mut learnt, &mut tuples, &settings, &Progress::new()).expect("not cancelled");
        (learnt, lap.elapsed().as_secs_f64())
    };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    let (_, alone) = pool.install(|| learn(tuples.clone()));
    let (learnt_policy, learnt) = learn(tuples.clone());
    let n = tuples.rewards.len();
    println!(
        "update of {n} tuples, {preset} preset, {epochs} epochs of {}: {:.2} s (rollout {rolled:.2} s, {:.0} environment steps/s; learning {learnt:.2} s, {alone:.2} s on one thread)",
        settings.batch,
        rolled + learnt,
        n as f64 / rolled,
    );
    let Some(work) = work else { return };
    let mut activations = Activations::default();
    work.floats("means", learnt_policy.means(&states, n, &mut activations));
    learnt_policy.value.forward(&states, n, &mut activations);
    work.floats("values", activations.output());
    let facts = json!({
        "ppo": settings, "policy_sizes": policy.policy.sizes, "value_sizes": policy.value.sizes,
        "per_environment": tuples.per_environment, "seconds": learnt, "seconds_alone": alone, "threads": rayon::current_num_threads(),
    });
    work.run("torch_update.py", &facts);
}

fn normalized(policy: &Policy, states: &[f32]) -> Vec<f32> {
    let mut states = states.to_vec();
    Policy::normalize(&mut states, &policy.normalizer.map());
    states
}

/// What the update begins with: the policy, its tuples, and the order in which its seed takes them, which is given back.
fn write_tuples(work: &Work, policy: &Policy, tuples: &Tuples, epochs: usize) -> Vec<usize> {
    work.floats("policy", &policy.policy.parameters);
    work.floats("value", &policy.value.parameters);
    work.floats("log_std", &policy.log_std);
    work.floats("states", &normalized(policy, &tuples.states));
    work.floats("last_states", &normalized(policy, &tuples.last_states));
    work.floats("proposals", &tuples.proposals);
    work.floats("vectors", &tuples.vectors);
    work.floats("log_probabilities", &tuples.log_probabilities);
    work.floats("rewards", &tuples.rewards);
    work.counts("types", tuples.types.iter().map(|&t| t as u32));
    work.counts("allowed", tuples.allowed.iter().flatten().map(|&a| u32::from(a)));
    work.counts("ended", tuples.ended.iter().map(|&e| u32::from(e)));
    let mut rng = Pcg64::seed_from_u64(1);
    let mut order: Vec<usize> = (0..tuples.rewards.len()).collect();
    let orders: Vec<usize> = (0..epochs)
        .flat_map(|_| {
            order.shuffle(&mut rng);
            order.clone()
        })
        .collect();
    work.counts("order", orders.iter().map(|&t| t as u32));
    orders
}

/// The first moments of Adam after one gradient step on `batch`: a tenth of the gradients that it went down.
fn write_first_step(work: &Work, policy: &Policy, tuples: &Tuples, batch: &[usize], settings: &PpoSettings) {
    let tuples = Tuples {
        states: normalized(policy, &tuples.states),
        last_states: normalized(policy, &tuples.last_states),
        ..tuples.clone()
    };
    let targets = Targets::of(policy, &tuples, settings);
    let (mut moved, mut ppo) = (policy.clone(), Ppo::new(policy, settings, 1));
    ppo.step(&mut moved, &tuples, &targets, batch, settings);
    for (name, adam) in ["policy", "value", "log_std"].into_iter().zip(ppo.optimizers()) {
        work.floats(&format!("first_{name}"), adam.moments().0);
    }
}

/// An action type with the queries of its searches and their hints.
type Recorded = (ActionType, Vec<Vec<f32>>, Vec<Option<usize>>);

/// What S is asked for while the prior plays episodes from anywhere: queries, and the hint that comes with each.
fn recorded(environment: &Environment) -> [Recorded; 2] {
    let mut walks = (ActionType::Walk, Vec::new(), Vec::new());
    let mut sits = (ActionType::Sit, Vec::new(), Vec::new());
    let (Ok(prior), settings) = (StoredPolicy::prior(), environment.settings) else { return [walks, sits] };
    let (policy, map) = (&prior.policy, prior.policy.normalizer.map());
    let mut rng = Pcg64::seed_from_u64(4);
    let mut numbers = vec![0.0; environment.state_size()];
    let mut activations = Activations::default();
    while walks.1.len() < 2000 {
        let mut episode = environment.begin_anywhere(&mut rng);
        loop {
            let observation = environment.observe(&episode, &mut numbers);
            let Some(pose) = observation.query.as_deref() else { break };
            let cue = &environment.task.cue;
            let character = &episode.character;
            let target = character.planar.relative(cue.planar());
            if target.position.length() <= environment.database.reach(environment.task.cue.action_type) {
                let mut query = vec![0.0; feature_size(ActionType::Sit)];
                let height = cue.position.z - character.floor;
                write_feature(pose, &Future::Complete(target, height), &mut query);
                sits.1.push(query);
                sits.2.push(None);
            }
            Policy::normalize(&mut numbers, &map);
            let means = policy.means(&numbers, 1, &mut activations);
            let means: Vec<f32> = means.iter().zip(&observation.proposal).map(|(m, p)| m + p).collect();
            let drawn = draw(&means, observation.allowed, &Gaussian::of(&policy.log_std), 1.0, &mut rng);
            if drawn.action_type == ActionType::Walk as usize {
                let signal = settings.signal.decode(ActionType::Walk, &drawn.vector, character.velocity());
                let mut query = vec![0.0; feature_size(ActionType::Walk)];
                write_feature(pose, &Future::Walk(signal.future), &mut query);
                walks.1.push(query);
                walks.2.push(Some(character.frame));
            }
            if environment.step(&mut episode, &observation, &drawn).end.is_some() {
                break;
            }
        }
    }
    [walks, sits]
}

/// The searches of real episodes, here and by numpy and scipy.
fn real_searches(environment: &Environment) {
    for (action_type, queries, hints) in recorded(environment) {
        let (frames, all) = entries(environment.database, action_type);
        let weights = environment.database.weights.vector(action_type);
        let index = SearchIndex::build(
            ndarray::ArrayView2::from_shape((frames.len(), weights.len()), &all).expect("features"),
            &weights,
        );
        let hints: Vec<_> = hints.iter().map(|hint| frames.binary_search(&(*hint)?).ok()).collect();
        let mut found = Vec::new();
        let microseconds = (0..3)
            .map(|_| {
                let lap = Instant::now();
                found =
                    queries.iter().zip(&hints).filter_map(|(q, &hint)| index.nearest(q, hint, &[])).collect();
                lap.elapsed().as_secs_f64() / queries.len() as f64 * 1e6
            })
            .fold(f64::INFINITY, f64::min);
        println!(
            "search {action_type:?} of real episodes: {microseconds:.1} µs ({} queries of {} entries)",
            queries.len(),
            frames.len()
        );
        let Some(work) = Work::new(&format!("search-{action_type:?}").to_lowercase()) else { continue };
        work.floats("features", &all);
        work.floats("weights", &weights);
        work.floats("queries", &queries.concat());
        work.floats("costs", &found.iter().map(|m| m.cost).collect::<Vec<_>>());
        work.counts("entries", found.iter().map(|m| m.entry as u32));
        let title = format!("search {action_type:?}, as episodes ask");
        work.run("nearest.py", &json!({ "title": title, "microseconds": microseconds }));
    }
}

/// The frames that may be entered for an action and their features, one after the other.
fn entries(database: &MotionDatabase, action_type: ActionType) -> (Vec<usize>, Vec<f32>) {
    let size = feature_size(action_type);
    let (mut frames, mut features) = (Vec::new(), Vec::new());
    for frame in 0..database.frames.len() {
        let Some(future) = database.future(action_type, frame) else { continue };
        frames.push(frame);
        features.resize(features.len() + size, 0.0);
        let at = features.len() - size;
        write_feature(&database.pose_features[frame], &future, &mut features[at..]);
    }
    (frames, features)
}

fn search(database: &MotionDatabase) {
    let mut rng = Pcg64::seed_from_u64(5);
    for action_type in [ActionType::Walk, ActionType::Sit] {
        let size = feature_size(action_type);
        let (_, all) = entries(database, action_type);
        let weights = database.weights.vector(action_type);
        for noise in [0.02, 0.1, 0.3] {
            let queries: Vec<Vec<f32>> = (0..200)
                .map(|_| {
                    let entry = rng.random_range(0..all.len() / size);
                    let mut q = all[entry * size..(entry + 1) * size].to_vec();
                    q.iter_mut().for_each(|v| *v += noise * rng.random_range(-1.0f32..1.0));
                    q
                })
                .collect();
            let lap = Instant::now();
            for q in &queries {
                black_box(database.search(action_type, q, None, &[]));
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
            let drawn = draw(&mean, observation.allowed, &Gaussian::of(&policy.log_std), 1.0, &mut rng);
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
