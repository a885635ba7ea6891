//! The main job on a room made in code: what must hold of every motion, whatever the task.

mod common;

use glam::{Quat, Vec3};
use oncue::MotionDatabase;
use oncue::controller::{Environment, EpisodeEnd, StoredPolicy, keep_motion};
use oncue::library::starter;
use oncue::math::rotation::wrap_angle;
use oncue::metrics::{foot_figures, penetration_figures};
use oncue::motion::Joint;
use oncue::report::PolicySource;
use oncue::scene::SceneIndex;
use oncue::{ActionCue, ActionType, Error, InitialState, Progress, Settings, Synthesis, Task, synthesize};

use common::boxes::boxes;

/// 5 × 5 m with a low table in the middle and a bench of 0.45 m at the far wall.
fn room() -> SceneIndex {
    let (positions, triangles) = boxes(&[
        ([-2.5, -2.5, -0.1], [2.5, 2.5, 0.0]),
        ([-2.6, -2.5, 0.0], [-2.5, 2.5, 2.0]),
        ([2.5, -2.5, 0.0], [2.6, 2.5, 2.0]),
        ([-2.5, 2.5, 0.0], [2.5, 2.6, 2.0]),
        ([-2.5, -2.6, 0.0], [2.5, -2.5, 2.0]),
        ([-0.5, -0.5, 0.0], [0.5, 0.4, 0.4]),
        ([-0.8, 1.9, 0.0], [0.8, 2.4, 0.45]),
    ]);
    SceneIndex::build(&positions, &triangles, &Settings::default().scene, &Progress::new()).expect("a room")
}

fn task(action_type: ActionType) -> Task {
    let sits = action_type == ActionType::Sit;
    Task {
        start: InitialState::standing("Start", Vec3::new(0.2, -1.8, 0.0), 2.0),
        cue: ActionCue {
            name: "Cue".into(),
            action_type,
            position: if sits { Vec3::new(0.0, 2.12, 0.55) } else { Vec3::new(-1.2, 1.0, 0.0) },
            yaw: if sits { 0.0 } else { 3.0 },
            feet: [None, None],
        },
        passes: Vec::new(),
        manipulations: Vec::new(),
    }
}

/// The default settings with less of everything.
fn small() -> Settings {
    let mut settings = Settings::default();
    settings.ppo.tuples = 1024;
    settings.ppo.updates = 2;
    settings.ppo.solved = 0.2;
    settings.ppo.prior = false;
    settings.kept.rollouts = 48;
    settings.kept.rounds = 1;
    settings
}

fn database() -> MotionDatabase {
    let progress = Progress::new();
    let library = starter::generate(&progress).expect("the starter library");
    MotionDatabase::build(&library, &Settings::default().synthesizer.weights, &progress).expect("a database")
}

fn run(task: &Task, seed: u64) -> Synthesis {
    run_from(task, seed, None)
}

fn run_from(task: &Task, seed: u64, kept: Option<&StoredPolicy>) -> Synthesis {
    synthesize(&room(), &database(), task, kept, &small(), seed, &Progress::new()).expect("a motion")
}

/// Largest change of a joint's rotation from one frame to the next, and of that change, radians.
fn largest_changes(done: &Synthesis) -> (f32, f32) {
    let (mut speed, mut jerk) = (0.0f32, 0.0f32);
    let postures = &done.motion.postures;
    let turn = |frame: usize, joint: usize| -> Quat {
        postures[frame].rotations[joint] * postures[frame - 1].rotations[joint].inverse()
    };
    for frame in 2..postures.len() {
        for joint in 0..Joint::ALL.len() {
            let (now, then) = (turn(frame, joint), turn(frame - 1, joint));
            speed = speed.max(now.angle_between(Quat::IDENTITY));
            jerk = jerk.max(now.angle_between(then));
        }
    }
    (speed, jerk)
}

#[test]
fn walks_round_the_table_and_sits() {
    (1..=8).for_each(walks_and_sits);
}

fn walks_and_sits(seed: u64) {
    let done = run(&task(ActionType::Sit), seed);
    let report = &done.report;
    assert!(report.success, "{:?}", report.problems);
    assert!(report.cues[0].pelvis_cm < 10.0 && report.cues[0].facing_degrees < 20.0, "{:?}", report.cues);
    assert!(report.penetration.percent < 3.0, "{:?}", report.penetration);
    let foot = foot_figures(&done.motion, 0.0);
    assert!(foot.skate_cm < 0.05 && foot.worst_skate_cm < 0.5, "{foot:?}");
    assert!(foot.sink_cm < 0.5, "{foot:?}");
    // Blind to labels: feet near the floor hardly move (mocap itself reads 0.5 and more).
    assert!(foot.low_skate_cm < 0.6, "{foot:?}");
    let (speed, change) = largest_changes(&done);
    // 0.45 rad a frame is 13 rad/s, a brisk knee; a pop shows as a change of speed of that order.
    assert!(speed < 0.45 && change < 0.30, "{speed} {change}");
    assert!(report.path_m < 1.5 * report.shortest_path_m);
    // No turn is faster than all but a thousandth of the library's own, and hardly an acceleration harder by much.
    let speed = &report.speed;
    assert!(speed.joint_ratio < 1.001 && speed.faster_percent == 0.0, "seed {seed}: {speed:?}");
    assert!(speed.acceleration_ratio < 2.5 && speed.harder_percent < 2.0, "seed {seed}: {speed:?}");
}

#[test]
fn stops_at_a_cue() {
    let done = run(&task(ActionType::Stop), 1);
    assert!(done.report.success, "{:?}", done.report.problems);
    let last = done.motion.postures.len() - 1;
    let still =
        done.motion.postures[last].root_position.distance(done.motion.postures[last - 15].root_position);
    assert!(still < 0.05, "{still}");
}

#[test]
fn one_seed_one_motion_on_one_thread_and_on_three() {
    let task = task(ActionType::Sit);
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| run(&task, 11))
    };
    let (one, three) = (on(1), on(3));
    assert_eq!(one.motion, three.motion);
    assert_ne!(one.motion, run(&task, 12).motion);
}

#[test]
fn a_kept_policy_plays_a_moved_task_without_optimizing() {
    let first = run(&task(ActionType::Sit), 3);
    assert_eq!(first.report.policy_source, PolicySource::Scratch);
    assert!(
        first.report.updates > 0
            && first.policy.belongs_to(room().fingerprint(), &database().library_checksum)
    );
    let mut moved = task(ActionType::Sit);
    moved.start.position.x -= 0.8;
    moved.start.yaw = -1.0;
    moved.cue.position.x += 0.15;
    let second = run_from(&moved, 4, Some(&first.policy));
    assert_eq!((second.report.policy_source, second.report.updates), (PolicySource::Stored, 0));
    assert!(second.report.success, "{:?}", second.report.problems);
    assert_eq!(second.policy.policy, first.policy.policy);
    assert_eq!(second.policy.origin.cues, [task(ActionType::Sit).cue, moved.cue]);
    // The same request again begins as it did the first time, whatever was kept since.
    let again = run_from(&task(ActionType::Sit), 3, Some(&first.policy));
    assert_eq!((again.report.policy_source, again.motion), (PolicySource::Scratch, first.motion.clone()));
    // A policy of other settings is not played.
    let other = StoredPolicy { state: Settings::preset("paper").expect("a preset").state, ..first.policy };
    assert_eq!(run_from(&task(ActionType::Sit), 3, Some(&other)).report.policy_source, PolicySource::Scratch);
}

#[test]
fn the_prior_serves_a_room_it_never_saw() {
    let settings = Settings::default();
    for action_type in [ActionType::Sit, ActionType::Stop] {
        let task = task(action_type);
        let done =
            synthesize(&room(), &database(), &task, None, &settings, 5, &Progress::new()).expect("a motion");
        assert_eq!((done.report.policy_source, done.report.updates), (PolicySource::Prior, 0));
        assert!(done.report.success, "{:?}", done.report.problems);
    }
}

#[test]
fn cancel_is_seen() {
    let (database, progress) = (database(), Progress::new());
    progress.cancel();
    let task = task(ActionType::Sit);
    let result = synthesize(&room(), &database, &task, None, &Settings::default(), 1, &progress);
    assert!(matches!(result, Err(Error::Cancelled)));
}

/// A chair without a back, 16 cm from a desk before a wall.
fn desk() -> (SceneIndex, Task) {
    let (positions, triangles) = boxes(&[
        ([-2.5, -2.5, -0.1], [2.5, 2.5, 0.0]),
        ([-2.5, 2.5, 0.0], [2.5, 2.6, 2.0]),
        ([-0.7, 1.7, 0.68], [0.7, 2.4, 0.72]),
        ([-0.2, 1.14, 0.42], [0.2, 1.54, 0.46]),
    ]);
    let scene = SceneIndex::build(&positions, &triangles, &Settings::default().scene, &Progress::new());
    let task = Task {
        cue: ActionCue {
            name: "Desk chair".into(),
            position: Vec3::new(0.0, 1.34, 0.56),
            yaw: std::f32::consts::PI,
            ..task(ActionType::Sit).cue
        },
        ..task(ActionType::Sit)
    };
    (scene.expect("a room"), task)
}

#[test]
fn sits_down_at_a_desk_from_the_side() {
    let (scene, task) = desk();
    let settings = Settings::default();
    let done =
        synthesize(&scene, &database(), &task, None, &settings, 1, &Progress::new()).expect("a motion");
    let report = &done.report;
    assert!(report.success, "{:?}", report.problems);
    assert!(report.penetration.percent == 0.0, "{:?}", report.penetration);
    assert!(report.penetration.whole_body_percent < 5.0, "{:?}", report.penetration);
    // Where the pelvis comes down the person faces aside: there is no room to stand before the chair.
    let down = done.motion.postures.iter().find(|p| p.root_position.z < 0.62).expect("a seated frame");
    let aside = wrap_angle(down.planar().yaw - task.cue.yaw).abs().to_degrees();
    assert!((40.0..120.0).contains(&aside), "{aside}");
}

/// What a rollout is judged by is what the report says of it.
#[test]
fn the_figures_that_choose_are_the_figures_that_are_reported() {
    let (scene, task) = desk();
    let (settings, database) = (Settings::default(), database());
    let prior = StoredPolicy::prior().expect("the prior");
    let environment = Environment::new(&scene, &database, &task, &settings).expect("settings that fit");
    for seed in 1..=3 {
        let kept = keep_motion(&environment, &prior.policy, seed, &Progress::new()).expect("a motion");
        assert_eq!(kept.end, EpisodeEnd::Complete);
        // Where a joint would hurry, the motion that is kept takes some frames more than the rollout.
        let added = kept.motion.len() - 1 - kept.tally.frames;
        assert!(added < 30, "{added}");
        let hold = (settings.synthesizer.hold_seconds * 30.0) as usize;
        assert_eq!(kept.moments.complete + hold + 1, kept.motion.len());
        let seats = task.seats(&kept.moments);
        let ignore = settings.reward.ignore_below;
        let reported = penetration_figures(&kept.motion, &scene, 0.0, ignore, &seats);
        let touching = reported.whole_body_percent / 100.0 * kept.motion.len() as f32;
        // The standing frame at the start, and the one on which the sit is entered, may count on one side only.
        let slack = 2.5 + added as f32;
        assert!((touching - kept.tally.touching as f32).abs() < slack, "{touching} {:?}", kept.tally);
    }
}
