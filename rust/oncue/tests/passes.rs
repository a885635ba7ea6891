//! Walks that pass waypoints without a stop: alone, in a performance, and in the real rooms.

mod common;
#[path = "common/shared_tests.rs"]
mod shared_tests;

use std::path::Path;
use std::process::ExitCode;
use std::sync::OnceLock;

use glam::Vec3;
use oncue::library::starter;
use oncue::scene::SceneIndex;
use oncue::synthesize::Synthesis;
use oncue::{
    ActionCue, ActionType, Around, CueKind, InitialState, Moments, Motion, MotionDatabase, PassCue,
    Performance, Performed, Progress, Settings, Step, Task, measure, perform, synthesize,
};

use common::boxes::boxes;

fn main() -> ExitCode {
    let always = shared_tests::always;
    shared_tests::run(vec![
        always("a_walk_passes_its_waypoints_without_a_stop", a_walk_passes_its_waypoints_without_a_stop),
        always("where_the_way_turns_back_nobody_stands_about", where_the_way_turns_back_nobody_stands_about),
        always(
            "a_performance_passes_waypoints_between_its_rests",
            a_performance_passes_waypoints_between_its_rests,
        ),
        always("a_waypoint_that_is_missed_is_told", a_waypoint_that_is_missed_is_told),
        always(
            "one_seed_gives_one_walk_on_any_number_of_threads",
            one_seed_gives_one_walk_on_any_number_of_threads,
        ),
        shared_tests::needs(
            "data/rooms",
            "waypoints_in_real_rooms_are_passed",
            waypoints_in_real_rooms_are_passed,
        ),
    ])
}

/// 5 × 5 m with a low table in the middle and a bench of 0.45 m at the far wall.
fn room() -> &'static SceneIndex {
    static ROOM: OnceLock<SceneIndex> = OnceLock::new();
    ROOM.get_or_init(|| {
        let (positions, triangles) = boxes(&[
            ([-2.5, -2.5, -0.1], [2.5, 2.5, 0.0]),
            ([-0.5, -0.5, 0.0], [0.5, 0.4, 0.4]),
            ([-0.8, 1.9, 0.0], [0.8, 2.4, 0.45]),
        ]);
        SceneIndex::build(&positions, &triangles, &Settings::default().scene, &Progress::new())
            .expect("a room")
    })
}

fn database() -> &'static MotionDatabase {
    static DATABASE: OnceLock<MotionDatabase> = OnceLock::new();
    DATABASE.get_or_init(|| {
        let library = starter::generate(&Progress::new()).expect("the starter library");
        MotionDatabase::build(&library, &Settings::default().synthesizer.weights, &Progress::new())
            .expect("a database")
    })
}

fn by(name: &str, x: f32, y: f32) -> PassCue {
    PassCue { name: name.into(), position: Vec3::new(x, y, 0.0) }
}

fn cue(name: &str, action_type: ActionType, position: [f32; 3], yaw: f32) -> ActionCue {
    ActionCue { name: name.into(), action_type, position: position.into(), yaw, feet: [None; 2] }
}

/// Round the table the long way.
fn round_the_table() -> Task {
    Task {
        start: InitialState::standing("Start", Vec3::new(0.3, -1.8, 0.0), 2.0),
        passes: vec![by("Corner", -1.5, -0.9), by("Far Corner", -1.3, 1.0)],
        cue: cue("There", ActionType::Stop, [1.4, 1.1, 0.0], 1.5),
        manipulations: Vec::new(),
    }
}

fn walk(task: &Task, seed: u64) -> Synthesis {
    synthesize(room(), database(), task, None, &Settings::default(), seed, &Progress::new())
        .expect("a motion")
}

/// The mean pace over a third of a second about a frame, m/s, and how fast the person turns, radians a second.
fn pace(motion: &Motion, frame: usize) -> (f32, f32) {
    let [from, to] =
        [frame.saturating_sub(5), (frame + 5).min(motion.len() - 1)].map(|f| motion.postures[f].planar());
    let seconds = (
        to.position.distance(from.position) * 3.0,
        oncue::math::rotation::wrap_angle(to.yaw - from.yaw) * 3.0,
    );
    (seconds.0, seconds.1.abs())
}

fn a_walk_passes_its_waypoints_without_a_stop() {
    for seed in [1, 2] {
        let made = walk(&round_the_table(), seed);
        let report = &made.report;
        assert!(report.success, "{:?}", report.problems);
        let told: Vec<_> = report.cues.iter().map(|cue| (cue.cue.as_str(), cue.action_type)).collect();
        assert_eq!(
            told,
            [("Corner", CueKind::Pass), ("Far Corner", CueKind::Pass), ("There", CueKind::Stop)]
        );
        for (told, asked) in report.cues.iter().zip(round_the_table().passes) {
            let root = made.motion.postures[told.frame].root_position.truncate();
            let away = 100.0 * root.distance(asked.place());
            assert!(told.met && away < 15.0 && (away - told.pelvis_cm).abs() < 0.01, "{told:?}");
            // For a second about it the person walks.
            for frame in told.frame - 15..told.frame + 15 {
                let (pace, _) = pace(&made.motion, frame);
                assert!(pace > 0.3, "{pace} m/s at {frame} of {told:?}");
            }
        }
        assert!(
            report.cues[0].frame + 20 < report.cues[1].frame && report.cues[1].frame < report.cues[2].frame
        );
        // By the waypoints it is farther, and nobody goes round in circles.
        let without = walk(&Task { passes: Vec::new(), ..round_the_table() }, seed);
        assert!(report.shortest_path_m > without.report.shortest_path_m + 0.5);
        assert!(
            report.path_m < 1.15 * report.shortest_path_m + 0.2,
            "{} {}",
            report.path_m,
            report.shortest_path_m
        );
    }
}

fn where_the_way_turns_back_nobody_stands_about() {
    let mut task = round_the_table();
    task.passes = vec![by("Dead End", -2.0, -1.8)];
    let made = walk(&task, 1);
    assert!(made.report.success, "{:?}", made.report.problems);
    let at = made.report.cues[0].frame;
    for frame in at - 30..at + 30 {
        let (pace, turn) = pace(&made.motion, frame);
        assert!(pace > 0.15 || turn > 0.4, "{pace} m/s, {turn} rad/s at {frame}, {at}");
    }
}

fn performance() -> Performance {
    let step = |passes: Vec<PassCue>, cue: ActionCue, hold_seconds: Option<f32>| Step {
        passes,
        cue,
        hold_seconds,
        at_seconds: None,
        manipulations: Vec::new(),
        things: Vec::new(),
    };
    Performance {
        start: InitialState::standing("Start", Vec3::new(0.2, -1.8, 0.0), 2.0),
        steps: vec![
            step(
                vec![by("By", -1.4, -0.4)],
                cue("Bench", ActionType::Sit, [-0.45, 2.12, 0.55], 0.0),
                Some(1.0),
            ),
            step(vec![by("Back", 1.3, 0.4)], cue("There", ActionType::Stop, [0.6, -1.6, 0.0], 1.5), None),
        ],
        things: Vec::new(),
        leaves: Vec::new(),
        looks: Vec::new(),
    }
}

fn play(performance: &Performance, earlier: Option<&Performed>) -> Performed {
    let settings = Settings::default();
    perform(None, room(), database(), performance, earlier, None, &settings, 1, &Progress::new())
        .expect("a performance")
}

fn a_performance_passes_waypoints_between_its_rests() {
    let made = play(&performance(), None);
    let report = &made.report;
    assert!(report.success, "{:?}", report.problems);
    let names: Vec<&str> = report.cues.iter().map(|cue| cue.cue.as_str()).collect();
    assert_eq!(names, ["By", "Bench", "Back", "There"]);
    let frames: Vec<usize> = report.cues.iter().map(|cue| cue.frame).collect();
    assert!(frames.is_sorted(), "{frames:?}");
    // Who sits passes nothing: the second waypoint is passed on foot.
    assert!(frames[2] > report.steps[1].moments.stood_at.expect("got up"));
    // A waypoint belongs to the step that it leads to.
    let mut moved = performance();
    moved.steps[1].passes[0].position.x -= 0.2;
    let again = play(&moved, Some(&made));
    let seam = report.steps[1].first_frame;
    assert_eq!(again.report.steps[1].first_frame, seam);
    assert!(again.motion.postures[..=seam] == made.motion.postures[..=seam]);
    assert!(again.motion.postures[seam + 1..] != made.motion.postures[seam + 1..]);
    assert!(again.report.cues[2].met, "{:?}", again.report.cues);
}

fn a_waypoint_that_is_missed_is_told() {
    let task = round_the_table();
    let made = walk(&task, 1);
    let mut elsewhere = task.clone();
    elsewhere.passes[1].position.x -= 0.4;
    let moments = Moments { complete: made.report.cues[2].frame, ..Default::default() };
    let around = Around { scene: None, moving: &[], leaves: &[], wait: 0, database: None };
    let measured = |task: &Task| measure(&made.motion, &around, task, &moments, &Settings::default());
    assert_eq!(measured(&task).cues, made.report.cues);
    let missed = measured(&elsewhere);
    assert!(!missed.cues[1].met && missed.cues[0].met && missed.cues[2].met, "{:?}", missed.cues);
    let said = missed.problems.join(" ");
    let cm = missed.cues[1].pelvis_cm;
    assert!(said.contains(&format!("'Far Corner' was passed {cm:.0} cm away")) && cm > 20.0, "{said}");
}

fn one_seed_gives_one_walk_on_any_number_of_threads() {
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    let alone = one.install(|| walk(&round_the_table(), 1));
    assert!(alone.motion == walk(&round_the_table(), 1).motion);
}

/// A walk with one waypoint and one with two in each of three rooms; `examples/passes.rs` plays all rooms.
fn waypoints_in_real_rooms_are_passed(folder: &Path) {
    let (progress, settings) = (Progress::new(), Settings::default());
    let mut rows = common::rooms::read(folder);
    rows.retain(|row| {
        ["quest_living_room", "sh3d_Studio", "quest_meeting_room"].contains(&row.room.as_str())
    });
    let (mut passed, mut all, mut met) = (0, 0, 0);
    for room in rows.chunk_by(|a, b| a.room == b.room) {
        let mesh = common::glb::read(&folder.join(format!("{}.glb", room[0].room)));
        let scene =
            SceneIndex::build(&mesh.positions, &mesh.triangles, &settings.scene, &progress).expect("a room");
        for task in common::walks::walks(room, &scene, 2) {
            let made =
                synthesize(&scene, database(), &task, None, &settings, 1, &progress).expect("a motion");
            let cues = &made.report.cues;
            all += task.passes.len();
            passed += cues.iter().filter(|cue| cue.action_type == CueKind::Pass && cue.met).count();
            met += usize::from(cues.iter().any(|cue| cue.action_type != CueKind::Pass && cue.met));
            println!("{} {:?}", room[0].room, cues.iter().map(|cue| cue.pelvis_cm).collect::<Vec<_>>());
        }
    }
    assert!(all >= 8, "{all}");
    assert_eq!((passed, met), (all, 6));
}
