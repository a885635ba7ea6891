//! Hostile values in every field of the settings: each is refused by a sentence that names it, or the run ends and can be
//! cancelled.

mod common;

use std::sync::Arc;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread;
use std::time::Duration;

use glam::Vec3;
use oncue::MotionDatabase;
use oncue::library::starter;
use oncue::manifold::ManifoldSettings;
use oncue::{
    ActionCue, ActionType, Error, InitialState, MotionLibrary, Progress, SceneIndex, Settings, Task,
    synthesize,
};
use serde_json::{Value, json};

use common::boxes::boxes;

/// How long an accepted value may run before it is cancelled, and how soon a cancel must be answered.
const PATIENCE: Duration = Duration::from_secs(1);
const ANSWER: Duration = Duration::from_secs(20);

/// As few rollouts and updates as make a motion.
fn small() -> Settings {
    let mut settings = Settings::default();
    settings.ppo.tuples = 256;
    settings.ppo.updates = 1;
    settings.ppo.batch = 128;
    settings.ppo.epochs = 1;
    settings.ppo.policy_layers = vec![16];
    settings.ppo.value_layers = vec![16];
    settings.ppo.prior = false;
    settings.kept.rollouts = 2;
    settings.kept.rounds = 0;
    settings.kept.more_rounds = 0;
    settings.editor.steps = 2;
    settings
}

/// The paths of all numbers in a tree of settings, as JSON pointers.
fn numbers(value: &Value, at: &str, out: &mut Vec<String>) {
    match value {
        Value::Object(fields) => fields.iter().for_each(|(name, v)| numbers(v, &format!("{at}/{name}"), out)),
        Value::Array(items) => {
            items.iter().enumerate().for_each(|(i, v)| numbers(v, &format!("{at}/{i}"), out));
        }
        Value::Number(_) | Value::Null => out.push(at.to_owned()),
        Value::Bool(_) | Value::String(_) => {}
    }
}

fn with(settings: &Settings, path: &str, hostile: Value) -> Result<Settings, serde_json::Error> {
    let mut tree = serde_json::to_value(settings).expect("settings are JSON");
    *tree.pointer_mut(path).expect("a field") = hostile;
    serde_json::from_value(tree)
}

/// From one place on the floor to a cue.
fn task(action_type: ActionType, position: Vec3, yaw: f32) -> Task {
    let start = InitialState::standing("Start", Vec3::new(0.0, -1.0, 0.0), 3.0);
    let cue = ActionCue { name: "Cue".into(), action_type, position, yaw, feet: [None; 2] };
    Task { start, cue, passes: Vec::new(), manipulations: Vec::new() }
}

/// Sits on a bench, through everything that has settings: library, scene, policy, editor.
fn run(
    library: &MotionLibrary,
    usual: &MotionDatabase,
    settings: &Settings,
    progress: &Progress,
) -> oncue::Result<()> {
    let (positions, triangles) =
        boxes(&[([-2.0, -2.0, -0.1], [2.0, 2.0, 0.0]), ([-0.5, 1.0, 0.0], [0.5, 1.5, 0.45])]);
    settings.validate()?;
    let scene = SceneIndex::build(&positions, &triangles, &settings.scene, progress)?;
    let other = settings.synthesizer.weights != usual.weights;
    let built =
        other.then(|| MotionDatabase::build(library, &settings.synthesizer.weights, progress)).transpose()?;
    let database = built.as_ref().unwrap_or(usual);
    let task = task(ActionType::Sit, Vec3::new(0.0, 1.2, 0.55), 0.0);
    synthesize(&scene, database, &task, None, settings, 1, progress).map(|_| ())
}

#[test]
fn no_value_of_any_field_hangs_panics_or_says_cancelled() {
    let library = Arc::new(starter::generate(&Progress::new()).expect("the starter library"));
    let base = small();
    let usual =
        MotionDatabase::build(&library, &base.synthesizer.weights, &Progress::new()).expect("a database");
    let usual = Arc::new(usual);
    let mut paths = Vec::new();
    numbers(&serde_json::to_value(&base).expect("settings are JSON"), "", &mut paths);
    assert!(paths.len() > 90, "{}", paths.len());
    let (mut refused, mut ended, mut cancelled) = (0, 0, 0);
    for path in &paths {
        for hostile in [json!(0), json!(-1), json!(1_000_000_000u64), json!(1e30)] {
            let Ok(settings) = with(&base, path, hostile.clone()) else { continue };
            if let Err(error) = settings.validate() {
                let name = path.trim_start_matches('/').split('/').filter(|p| p.parse::<usize>().is_err());
                let name = name.collect::<Vec<_>>().join(".");
                assert!(matches!(error, Error::Input(_)), "{path} = {hostile}: {error}");
                let sentence = error.to_string();
                let last = name.rsplit('.').next().expect("a name");
                assert!(sentence.contains(last) && sentence.ends_with('.'), "{path} = {hostile}: {sentence}");
                refused += 1;
                continue;
            }
            let progress = Arc::new(Progress::new());
            let (sender, receiver) = channel();
            let work = thread::spawn({
                let (library, usual, progress) = (library.clone(), usual.clone(), progress.clone());
                move || sender.send(run(&library, &usual, &settings, &progress))
            });
            match receiver.recv_timeout(PATIENCE) {
                Ok(result) => {
                    assert!(
                        !matches!(result, Err(Error::Cancelled)),
                        "{path} = {hostile} was cancelled by nobody"
                    );
                    ended += 1;
                }
                Err(RecvTimeoutError::Timeout) => {
                    progress.cancel();
                    let answer = receiver.recv_timeout(ANSWER);
                    assert!(answer.is_ok(), "{path} = {hostile} is not to be stopped");
                    cancelled += 1;
                }
                Err(RecvTimeoutError::Disconnected) => panic!("{path} = {hostile} panicked"),
            }
            let _ = work.join();
        }
    }
    println!("{} fields: {refused} values refused, {ended} runs ended, {cancelled} cancelled", paths.len());
    // How many end by themselves is a matter of the machine; that all were tried is not.
    assert!(refused > 200 && ended + cancelled > 50, "{refused} {ended} {cancelled}");
}

#[test]
fn what_is_no_number_is_refused_in_every_struct() {
    let nan = f32::NAN;
    let mut all = vec![Settings::default(); 10];
    all[0].synthesizer.reluctance = nan;
    all[1].synthesizer.weights.up = nan;
    all[2].state.view_spacing[1] = nan;
    all[3].signal.reach = nan;
    all[4].reward.sigma_root = nan;
    all[5].termination.collision = nan;
    all[6].ppo.log_std_future = nan;
    all[7].kept.weights.jolt = nan;
    all[8].scene.floor_height = Some(nan);
    all[9].editor.met = nan;
    for settings in all {
        let error = settings.validate().expect_err("not a number").to_string();
        assert!(error.contains("NaN"), "{error}");
    }
    let error =
        ManifoldSettings { noise: nan, ..ManifoldSettings::default() }.validate().expect_err("no number");
    assert!(error.to_string().contains("manifold.noise"), "{error}");
}

#[test]
fn settings_that_would_not_be_used_are_refused() {
    let library = starter::generate(&Progress::new()).expect("the starter library");
    let (positions, triangles) = boxes(&[([-2.0, -2.0, -0.1], [2.0, 2.0, 0.0])]);
    let usual = small();
    let scene = SceneIndex::build(&positions, &triangles, &usual.scene, &Progress::new()).expect("a room");
    let database =
        MotionDatabase::build(&library, &usual.synthesizer.weights, &Progress::new()).expect("a database");
    let task = task(ActionType::Stop, Vec3::new(0.0, 1.0, 0.0), 3.0);
    let said = |settings: &Settings| {
        synthesize(&scene, &database, &task, None, settings, 1, &Progress::new())
            .expect_err("refused")
            .to_string()
    };
    let mut other = usual.clone();
    other.scene.carpet_height = 0.02;
    assert!(said(&other).contains("indexed with other settings"), "{}", said(&other));
    let mut other = usual.clone();
    other.synthesizer.weights.up = 3.0;
    assert!(said(&other).contains("other weights"), "{}", said(&other));
    // A walk is no end.
    let mut walk = task.clone();
    walk.cue.action_type = ActionType::Walk;
    let error = synthesize(&scene, &database, &walk, None, &usual, 1, &Progress::new()).expect_err("refused");
    assert!(error.to_string().contains("Walk is not one"), "{error}");
}
