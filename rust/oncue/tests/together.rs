//! Several people in one shot: who goes by, who waits, who sits beside whom, and what is said where two do not fit.

mod common;
#[path = "common/shared_tests.rs"]
mod shared_tests;

use std::path::Path;
use std::process::ExitCode;
use std::sync::OnceLock;

use glam::{Vec2, Vec3};
use oncue::figures::body_capsules;
use oncue::library::starter;
use oncue::scene::SceneIndex;
use oncue::{
    ActionCue, ActionType, Error, Hand, InitialState, ManipulationCue, Motion, MotionDatabase, Performance,
    Performed, Progress, PutCue, Settings, Step, TakeCue, Thing, ThingCue, perform, perform_together,
};

use common::boxes::boxes;

fn main() -> ExitCode {
    let always = shared_tests::always;
    shared_tests::run(vec![
        always("who_crosses_a_way_lets_pass_or_goes_round", who_crosses_a_way_lets_pass_or_goes_round),
        always("two_come_towards_each_other_in_a_corridor", two_come_towards_each_other_in_a_corridor),
        always("two_share_a_bench_and_nobody_sits_on_anybody", two_share_a_bench_and_nobody_sits_on_anybody),
        always("who_sits_for_good_is_walked_round", who_sits_for_good_is_walked_round),
        always("who_waits_stands_and_lives", who_waits_stands_and_lives),
        always("one_alone_is_as_before", one_alone_is_as_before),
        always("a_thing_in_somebody_else_is_told_of_both", a_thing_in_somebody_else_is_told_of_both),
        always("who_takes_something_goes_on_later", who_takes_something_goes_on_later),
        always("what_fails_loses_nobody_else_and_is_told", what_fails_loses_nobody_else_and_is_told),
        always("who_cannot_but_meet_somebody_is_told_of_it", who_cannot_but_meet_somebody_is_told_of_it),
        always("what_was_made_before_is_taken_from_it", what_was_made_before_is_taken_from_it),
        always(
            "what_does_not_fit_is_said_before_anything_is_played",
            what_does_not_fit_is_said_before_anything_is_played,
        ),
        shared_tests::needs("data/rooms", "two_play_in_a_real_room", two_play_in_a_real_room),
    ])
}

fn scene(list: &[([f32; 3], [f32; 3])]) -> SceneIndex {
    let (positions, triangles) = boxes(list);
    SceneIndex::build(&positions, &triangles, &Settings::default().scene, &Progress::new()).expect("a room")
}

/// 7 × 7 m with a bench of 0.45 m at the far wall.
fn hall() -> &'static SceneIndex {
    static HALL: OnceLock<SceneIndex> = OnceLock::new();
    HALL.get_or_init(|| scene(&[([-3.5, -3.5, -0.1], [3.5, 3.5, 0.0]), ([-1.0, 2.4, 0.0], [1.0, 2.9, 0.45])]))
}

fn database() -> &'static MotionDatabase {
    static DATABASE: OnceLock<MotionDatabase> = OnceLock::new();
    DATABASE.get_or_init(|| {
        let library = starter::generate(&Progress::new()).expect("the starter library");
        MotionDatabase::build(&library, &Settings::default().synthesizer.weights, &Progress::new())
            .expect("a database")
    })
}

fn step(name: &str, action_type: ActionType, position: [f32; 3], yaw: f32) -> Step {
    let cue = ActionCue { name: name.into(), action_type, position: position.into(), yaw, feet: [None; 2] };
    Step {
        cue,
        hold_seconds: None,
        at_seconds: None,
        passes: Vec::new(),
        manipulations: Vec::new(),
        things: Vec::new(),
    }
}

/// Who stands at a place facing the next and goes there.
fn walk(name: &str, from: [f32; 2], to: [f32; 2]) -> Performance {
    let way = Vec2::from(to) - Vec2::from(from);
    let yaw = way.y.atan2(way.x) + std::f32::consts::FRAC_PI_2;
    Performance {
        start: InitialState::standing(name, Vec2::from(from).extend(0.0), yaw),
        steps: vec![step(&format!("{name}'s stop"), ActionType::Stop, [to[0], to[1], 0.0], yaw)],
        things: Vec::new(),
        leaves: Vec::new(),
        looks: Vec::new(),
    }
}

fn sitter(name: &str, from: [f32; 2], x: f32) -> Performance {
    let mut sits = walk(name, from, [x, 2.0]);
    sits.steps = vec![step(&format!("{name}'s seat"), ActionType::Sit, [x, 2.62, 0.55], 0.0)];
    sits
}

fn play(scene: &SceneIndex, people: &[Performance]) -> Vec<Performed> {
    let settings = Settings::default();
    let made = perform_together(None, scene, database(), people, &[], None, &settings, 1, &Progress::new());
    made.expect("a shot").into_iter().map(|one| one.expect("a performance")).collect()
}

/// The deepest that any two are in one another on any frame of the shot, metres of capsules without what flesh gives; and how near
/// their pelvises come.
fn nearest(made: &[Performed]) -> (f32, f32) {
    let frames = made.iter().map(|one| one.motion.len()).max().unwrap_or(0);
    let pose = |motion: &Motion, frame: usize| motion.postures[frame.min(motion.len() - 1)].pose();
    let (mut deepest, mut pelvises) = (f32::NEG_INFINITY, f32::INFINITY);
    for frame in 0..frames {
        let poses: Vec<_> = made.iter().map(|one| pose(&one.motion, frame)).collect();
        for (at, one) in poses.iter().enumerate() {
            for other in &poses[..at] {
                pelvises = pelvises.min(one.positions[0].truncate().distance(other.positions[0].truncate()));
                for (_, a) in body_capsules(one) {
                    for (_, b) in body_capsules(other) {
                        deepest = deepest.max(a.depth_in(&b));
                    }
                }
            }
        }
    }
    (deepest, pelvises)
}

/// What flesh gives at the most, both parts, and a centimetre.
const TOUCH: f32 = 0.05;

fn all_succeed(made: &[Performed]) {
    for one in made {
        assert!(one.report.success, "{:?}", one.report.problems);
        let others = one.report.others.as_ref().expect("others");
        assert!(others.percent == 0.0 && others.touches.is_empty(), "{others:?}");
        assert_eq!(one.motion.len(), one.report.frames);
    }
    let (deepest, _) = nearest(made);
    assert!(deepest < TOUCH, "{deepest}");
}

fn who_crosses_a_way_lets_pass_or_goes_round() {
    // Both at the crossing after as long a way.
    let people = [walk("Ann", [-2.5, 0.0], [2.5, 0.0]), walk("Ben", [0.0, -2.5], [0.0, 1.8])];
    // Each alone comes through the other.
    let alone = |one: &Performance| {
        let settings = Settings::default();
        perform(None, hall(), database(), one, None, None, &settings, 1, &Progress::new()).expect("a walk")
    };
    let together = [alone(&people[0]), alone(&people[1])];
    assert!(nearest(&together).0 > TOUCH, "{:?}", nearest(&together));
    let made = play(hall(), &people);
    all_succeed(&made);
    // Who has the smaller x is made first, as if alone.
    assert!(made[0].motion == together[0].motion);
    assert_eq!(made[0].report.steps[0].waited, 0);

    // Neither names nor order make a difference, nor the number of threads.
    let renamed = [walk("Zoe", [0.0, -2.5], [0.0, 1.8]), walk("Abe", [-2.5, 0.0], [2.5, 0.0])];
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    let other = one.install(|| play(hall(), &renamed));
    assert!(other[1].motion == made[0].motion && other[0].motion == made[1].motion);
}

fn two_come_towards_each_other_in_a_corridor() {
    let corridor = scene(&[
        ([-5.0, -1.0, -0.1], [5.0, 1.0, 0.0]),
        ([-5.0, -1.1, 0.0], [5.0, -1.0, 2.2]),
        ([-5.0, 1.0, 0.0], [5.0, 1.1, 2.2]),
    ]);
    let people = [walk("Ann", [-4.0, 0.0], [2.8, 0.0]), walk("Ben", [4.0, 0.0], [-2.8, 0.0])];
    let made = play(&corridor, &people);
    all_succeed(&made);
    for (one, end) in made.iter().zip([2.8, -2.8]) {
        assert!((one.motion.postures.last().expect("frames").root_position.x - end).abs() < 0.1);
    }
}

fn two_share_a_bench_and_nobody_sits_on_anybody() {
    let people = [sitter("Ann", [-2.0, -1.5], -0.35), sitter("Ben", [2.0, -1.5], 0.35)];
    let made = play(hall(), &people);
    all_succeed(&made);
    for one in &made {
        let cue = &one.report.cues[0];
        assert!(cue.met && cue.pelvis_cm < 1.0, "{cue:?}");
    }
}

fn who_sits_for_good_is_walked_round() {
    // A stool in the middle of the way.
    let room = scene(&[([-3.5, -3.5, -0.1], [3.5, 3.5, 0.0]), ([-0.2, -0.2, 0.0], [0.2, 0.2, 0.45])]);
    let mut sits = walk("Ann", [-1.2, -1.0], [0.0, 0.0]);
    sits.steps = vec![step("Stool", ActionType::Sit, [0.0, 0.0, 0.55], 0.0)];
    // Ben comes by the sitter's feet.
    let made = play(&room, &[sits, walk("Ben", [3.0, -0.45], [-3.0, -0.45])]);
    all_succeed(&made);
}

fn who_waits_stands_and_lives() {
    // A door of 0.8 m: Ann comes out of it as Ben comes in.
    let room = scene(&[
        ([-3.5, -3.5, -0.1], [3.5, 3.5, 0.0]),
        ([-3.5, -0.05, 0.0], [-0.4, 0.05, 2.2]),
        ([0.4, -0.05, 0.0], [3.5, 0.05, 2.2]),
    ]);
    let people = [walk("Ann", [-0.5, -1.8], [-1.2, 2.0]), walk("Ben", [0.5, 1.8], [1.2, -2.0])];
    let made = play(&room, &people);
    all_succeed(&made);
    let ben = &made[1];
    let waited = ben.report.steps[0].waited;
    assert!(waited > 0 && waited.is_multiple_of(3), "{waited}");
    let head = |frame: usize| ben.motion.postures[frame].pose().positions[10];
    let gone = |frame: usize| {
        ben.motion.postures[frame].root_position.distance(ben.motion.postures[0].root_position)
    };
    assert!((0..waited).all(|frame| gone(frame) < 0.06));
    assert!(waited < 30 || (1..waited).any(|frame| head(frame) != head(0)));
    // No joint jumps where the wait ends.
    let at = |frame: usize| ben.motion.postures[frame].pose().positions;
    let [a, b, c] = [waited - 1, waited, waited + 1].map(at);
    for (joint, usual) in database().accelerations.iter().enumerate() {
        let acceleration = (a[joint] - 2.0 * b[joint] + c[joint]).length() * 900.0;
        assert!(acceleration < usual.max(1.0), "joint {joint}: {acceleration} {usual}");
    }
    let told = &ben.report.steps[0].moments;
    assert!(told.complete == ben.report.cues[0].frame && told.complete > waited + 30, "{told:?}");
}

fn one_alone_is_as_before() {
    let one = walk("Ann", [-2.5, 0.0], [0.5, 0.0]);
    let settings = Settings::default();
    let alone = perform(None, hall(), database(), &one, None, None, &settings, 1, &Progress::new());
    let alone = alone.expect("a walk");
    let made = play(hall(), std::slice::from_ref(&one));
    assert!(made[0].motion == alone.motion);
    assert!(made[0].report.others.is_none() && made[0].report.problems == alone.report.problems);
}

fn what_fails_loses_nobody_else_and_is_told() {
    let mut fails = walk("Ann", [-2.5, 0.0], [0.0, -1.0]);
    fails.steps[0].manipulations =
        vec![ManipulationCue { name: "Rail".into(), hand: Hand::Left, path: Vec::new(), first_frame: None }];
    let people = [fails, walk("Ben", [2.5, 0.0], [1.0, -1.0])];
    let settings = Settings::default();
    let made = perform_together(None, hall(), database(), &people, &[], None, &settings, 1, &Progress::new());
    let made = made.expect("a shot");
    assert!(matches!(&made[0], Err(Error::Input(said)) if said.contains("‘Rail’")), "{:?}", made[0]);
    assert!(made[1].as_ref().is_ok_and(|one| one.report.success));
}

fn who_cannot_but_meet_somebody_is_told_of_it() {
    // Ann stays in the only door of 0.7 m, and Ben has to go through it.
    let room = scene(&[
        ([-3.5, -3.5, -0.1], [3.5, 3.5, 0.0]),
        ([-3.5, -0.05, 0.0], [-0.35, 0.05, 2.2]),
        ([0.35, -0.05, 0.0], [3.5, 0.05, 2.2]),
    ]);
    let people = [walk("Ann", [-0.3, -1.5], [0.0, 0.0]), walk("Ben", [0.4, -2.5], [0.4, 2.0])];
    let made = play(&room, &people);
    for (own, other) in [(0, "Ben"), (1, "Ann")] {
        let report = &made[own].report;
        let said = report.problems.join(" ");
        assert!(!report.success && said.contains(&format!("of ‘{other}’ (frames ")), "{said}");
        let worst = &report.others.as_ref().expect("others").touches[0];
        assert!(worst.person == other && worst.depth_cm > 1.0 && worst.first < worst.end, "{worst:?}");
    }
}

fn what_was_made_before_is_taken_from_it() {
    let people = [walk("Ann", [-2.5, 0.0], [-1.0, 1.0]), walk("Ben", [2.5, 0.0], [1.0, 1.0])];
    let made = play(hall(), &people);
    let earlier: Vec<&Performed> = made.iter().collect();
    let settings = Settings::default();
    let again = |people: &[Performance], earlier: &[&Performed]| -> Vec<Performed> {
        let progress = Progress::new();
        let made = perform_together(None, hall(), database(), people, earlier, None, &settings, 1, &progress);
        made.expect("a shot").into_iter().map(|one| one.expect("a performance")).collect()
    };
    let same = again(&people, &earlier);
    assert!(
        same.iter().zip(&made).all(|(a, b)| a.motion == b.motion && a.report.seconds == b.report.seconds)
    );
    // Who is made later and moved is made anew, and gives what it would without what was there.
    let mut moved = people.clone();
    moved[1].steps[0].cue.position.x += 0.2;
    let other = again(&moved, &earlier);
    assert!(other[0].motion == made[0].motion && other[1].motion != made[1].motion);
    assert!(other[1].motion == again(&moved, &[])[1].motion);
}

fn what_does_not_fit_is_said_before_anything_is_played() {
    let said = |people: &[Performance]| {
        let settings = Settings::default();
        let made =
            perform_together(None, hall(), database(), people, &[], None, &settings, 1, &Progress::new());
        made.map_or_else(|error| error.to_string(), |_| String::new())
    };
    assert!(said(&[]).contains("nobody to perform"));
    let near = said(&[walk("Ann", [0.0, 0.0], [-2.0, 0.0]), walk("Ben", [0.3, 0.0], [2.0, 0.0])]);
    assert!(near.contains("‘Ann’") && near.contains("‘Ben’") && near.contains("30 cm apart"), "{near}");
    let shared = said(&[sitter("Ann", [-2.0, -1.5], 0.1), sitter("Ben", [2.0, -1.5], 0.35)]);
    assert!(shared.contains("‘Ben's seat’ of ‘Ben’") && shared.contains("25 cm apart"), "{shared}");
    let mut lap = sitter("Ben", [2.0, -1.5], 0.0);
    lap.steps[0].cue.position += Vec3::new(0.05, -0.25, 0.12);
    let lap = said(&[sitter("Ann", [-2.0, -1.5], 0.0), lap]);
    assert!(lap.contains("on the lap"), "{lap}");
    let nobodys = Performance { steps: Vec::new(), ..walk("Ben", [2.0, 0.0], [1.0, 0.0]) };
    let nobodys = said(&[walk("Ann", [-2.0, 0.0], [-1.0, 0.0]), nobodys]);
    assert!(nobodys.contains("‘Ben’ has no cue"), "{nobodys}");
    let carries = |name, y: f32| carrier(name, [-2.5, y], [0.0, y], [1.5, y], [2.0, y, 0.8]);
    let both = said(&[carries("Ann", -1.0), carries("Ben", 1.0)]);
    assert!(both.contains("‘Ann’ and ‘Ben’ both take ‘Box’"), "{both}");
    let mut floats = sitter("Ben", [2.0, -1.5], 0.35);
    floats.steps[0].cue.position.z = 1.3;
    let floats = said(&[walk("Ann", [-2.0, 0.0], [-1.0, 0.0]), floats]);
    assert!(floats.contains("Ben: ") && floats.contains("‘Ben's seat’ floats"), "{floats}");
}

/// Takes a box of 20 cm on the way, and puts it down at a place ahead of where the way ends.
fn carrier(name: &str, from: [f32; 2], by: [f32; 2], to: [f32; 2], put: [f32; 3]) -> Performance {
    let (low, high) = (Vec3::new(-0.10, -0.10, 0.0), Vec3::new(0.10, 0.10, 0.20));
    let mut carries = walk(name, from, by);
    let at = Vec3::new(by[0] + 0.45, by[1], 0.80);
    carries.things =
        vec![Thing { name: "Box".into(), position: at, rotation: [1.0, 0.0, 0.0, 0.0], low, high }];
    carries.steps[0].cue.yaw = std::f32::consts::FRAC_PI_2;
    let thing = "Box".to_owned();
    carries.steps[0].things = vec![ThingCue::Take(TakeCue {
        name: "Take".into(),
        thing: thing.clone(),
        hand: Hand::Right,
        grip: 0.5 * (low + high),
    })];
    let mut goes = walk(name, by, to).steps.remove(0);
    goes.things = vec![ThingCue::Put(PutCue { name: "Put".into(), thing, position: put.into(), yaw: None })];
    carries.steps.push(goes);
    carries
}

fn a_thing_in_somebody_else_is_told_of_both() {
    let ben = walk("Ben", [2.5, 1.2], [0.0, 1.2]);
    let carries = |put| carrier("Ann", [-2.5, -1.0], [0.0, -1.0], [0.0, 0.5], put);
    // Beside Ben: nobody is in it.
    let made = play(hall(), &[carries([0.45, 0.75, 0.9]), ben.clone()]);
    let [ann, _] = &made[..] else { panic!("two people") };
    let figures = &ann.report.things[0];
    assert!(ann.report.success && figures.in_others_cm == Some(0.0), "{:?}", ann.report.problems);
    assert!(figures.put_cm.is_some_and(|cm| cm < 1.0), "{figures:?}");
    // Where Ben stands: half of the box is in the trunk, for as long as both stay.
    let made = play(hall(), &[carries([0.0, 1.05, 0.95]), ben]);
    let [ann, other] = &made[..] else { panic!("two people") };
    assert!(ann.report.things[0].in_others_cm.is_some_and(|cm| cm > 5.0), "{:?}", ann.report.things);
    for one in [ann, other] {
        let said = one.report.problems.join(" ");
        assert!(!one.report.success && said.contains("‘Box’ of ‘Ann’ is "), "{said}");
        assert!(said.contains(" cm deep in the ") && said.contains(" of ‘Ben’ (frames "), "{said}");
    }
}

/// While a hand takes something others go on: who would have had to let Ben pass finds the way free.
fn who_takes_something_goes_on_later() {
    let mut ben = walk("Ben", [-3.3, 0.3], [-1.6, 0.3]);
    ben.steps.extend(walk("Ben", [-1.6, 0.3], [3.0, 0.3]).steps);
    let mut ann = carrier("Ann", [0.1, -1.8], [0.0, -1.0], [0.0, 2.0], [0.5, 2.4, 0.6]);
    let made = play(hall(), &[ben.clone(), ann.clone()]);
    all_succeed(&made);
    assert_eq!(made[1].report.steps[1].waited, 0);
    ann.things.clear();
    ann.steps.iter_mut().for_each(|step| step.things.clear());
    let made = play(hall(), &[ben, ann]);
    all_succeed(&made);
    assert!(made[1].report.steps[1].waited > 0);
}

/// Two people in a room that was scanned: from the starts and to the seats of two of its tasks.
fn two_play_in_a_real_room(rooms: &Path) {
    let rows: Vec<_> = common::rooms::read(rooms)
        .into_iter()
        .filter(|row| row.room == "quest_living_room")
        .take(2)
        .collect();
    let mesh = common::glb::read(&rooms.join("quest_living_room.glb"));
    let people: Vec<Performance> = rows
        .into_iter()
        .map(|row| {
            let start = InitialState { name: format!("Start {}", row.number), ..row.task.start };
            let step = Step {
                cue: row.task.cue,
                hold_seconds: None,
                at_seconds: None,
                passes: Vec::new(),
                manipulations: Vec::new(),
                things: Vec::new(),
            };
            Performance {
                start,
                steps: vec![step],
                things: Vec::new(),
                leaves: Vec::new(),
                looks: Vec::new(),
            }
        })
        .collect();
    let places: Vec<Vec3> = people.iter().flat_map(Performance::places).collect();
    let settings = Settings::default();
    let scene =
        SceneIndex::build_for(&mesh.positions, &mesh.triangles, &settings.scene, &places, &Progress::new())
            .expect("a room");
    all_succeed(&play(&scene, &people));
}
