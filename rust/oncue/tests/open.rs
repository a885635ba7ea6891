//! Doors and drawers that a hand opens, in a performance that goes on from there.

mod common;

use std::f32::consts::PI;
use std::sync::OnceLock;

use glam::{Quat, Vec3};
use oncue::figures::body_capsules;
use oncue::library::starter;
use oncue::motion::Joint;
use oncue::motion::skeleton::palm;
use oncue::perform::check_performance;
use oncue::scene::{MovingObject, SceneIndex};
use oncue::{
    ActionCue, ActionType, Amount, Hand, Hung, InitialState, Leaf, MotionDatabase, OpenCue, Performance,
    Performed, Progress, Settings, Step, ThingCue, perform,
};

use common::boxes::boxes;

/// A wall of 10 cm across the room with a doorway of 92 cm, and a chest on the near side.
const ROOM: [([f32; 3], [f32; 3]); 4] = [
    ([-3.0, -4.0, -0.1], [3.0, 4.0, 0.0]),
    ([-3.0, 0.0, 0.0], [-0.46, 0.1, 2.4]),
    ([0.46, 0.0, 0.0], [3.0, 0.1, 2.4]),
    ([-2.9, -2.4, 0.0], [-2.45, -1.6, 0.62]),
];
/// The door's leaf, closed, and a drawer on the chest.
const DOOR: ([f32; 3], [f32; 3]) = ([-0.45, 0.0, 0.01], [0.45, 0.04, 2.05]);
const DRAWER: ([f32; 3], [f32; 3]) = ([-2.88, -2.35, 0.66], [-2.45, -1.65, 0.86]);
const HINGE: Vec3 = Vec3::new(-0.45, 0.0, 0.0);
const HANDLE: Vec3 = Vec3::new(0.38, -0.06, 1.02);

fn room() -> &'static SceneIndex {
    static INDEX: OnceLock<SceneIndex> = OnceLock::new();
    INDEX.get_or_init(|| {
        let (positions, triangles) = boxes(&ROOM);
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

fn leaf(name: &str, own: ([f32; 3], [f32; 3]), hung: Hung) -> Leaf {
    let position = Vec3::from(own.0);
    let (mut positions, triangles) = boxes(&[own]);
    positions.iter_mut().for_each(|corner| *corner -= position);
    Leaf { name: name.into(), position, rotation: [1.0, 0.0, 0.0, 0.0], hung, positions, triangles }
}

/// It opens towards −y, the hinge on the left of who stands there.
fn door() -> Leaf {
    leaf("Door", DOOR, Hung::Hinge { point: HINGE - Vec3::from(DOOR.0), axis: Vec3::NEG_Z })
}

fn drawer() -> Leaf {
    leaf("Drawer", DRAWER, Hung::Slide { direction: Vec3::X })
}

/// `handle`: world, as the leaf stands at first.
fn open(leaf: &Leaf, hand: Hand, by: Amount, handle: Vec3) -> OpenCue {
    let (name, thing) = (format!("Open {}", leaf.name), leaf.name.clone());
    OpenCue { name, thing, hand, by, grip: handle - leaf.position, over_seconds: None }
}

fn stop(name: &str, position: [f32; 3], yaw: f32, openings: Vec<OpenCue>) -> Step {
    let action_type = ActionType::Stop;
    let cue = ActionCue { name: name.into(), action_type, position: position.into(), yaw, feet: [None; 2] };
    let things = openings.into_iter().map(ThingCue::Open).collect();
    Step { cue, hold_seconds: None, at_seconds: None, passes: Vec::new(), manipulations: Vec::new(), things }
}

/// Facing from one place to another.
fn towards(from: [f32; 3], to: Vec3) -> f32 {
    let way = to - Vec3::from(from);
    f32::atan2(way.y, way.x) + 0.5 * PI
}

fn asked(steps: Vec<Step>, leaves: Vec<Leaf>) -> Performance {
    let start = InitialState::standing("Ann", Vec3::new(0.8, -2.6, 0.0), PI);
    Performance { start, steps, things: Vec::new(), leaves, looks: Vec::new() }
}

/// To the door, which is opened, and through it.
fn through_the_door() -> Performance {
    let before = [0.60, -0.62, 0.0];
    let opens = open(&door(), Hand::Left, Amount::Degrees(90.0), HANDLE);
    asked(
        vec![
            stop("Before", before, towards(before, HANDLE), vec![opens]),
            stop("Beyond", [0.0, 2.2, 0.0], PI, Vec::new()),
        ],
        vec![door()],
    )
}

fn play(performance: &Performance, earlier: Option<&Performed>) -> oncue::Result<Performed> {
    let settings = Settings::default();
    perform(None, room(), database(), performance, earlier, None, &settings, 1, &Progress::new())
}

fn through() -> &'static Performed {
    static MADE: OnceLock<Performed> = OnceLock::new();
    MADE.get_or_init(|| play(&through_the_door(), None).expect("a performance"))
}

/// How deep a body is in a leaf on a frame, metres, but for one hand.
fn deepest(made: &Performed, object: &MovingObject, frame: usize, hand: Option<Joint>) -> f32 {
    let capsules = body_capsules(&made.motion.postures[frame].pose()).into_iter();
    let own = |part: String| match hand {
        Some(Joint::LeftHand) => part == "LeftHand",
        Some(Joint::RightHand) => part == "RightHand",
        _ => false,
    };
    capsules
        .filter(|(part, _)| !own(format!("{part:?}")))
        .filter_map(|(_, capsule)| object.depth_of(&capsule, 0))
        .fold(0.0, f32::max)
}

/// The door's leaf on a frame, by the track that was given.
fn door_on(made: &Performed, frame: usize) -> MovingObject {
    let track = &made.carried[0];
    let at = frame.saturating_sub(track.first_frame).min(track.positions.len() - 1);
    let turn = if frame < track.first_frame { Quat::IDENTITY } else { track.rotations[at] };
    let own = door();
    let place = if frame < track.first_frame { own.position } else { track.positions[at] };
    MovingObject::build("Door", &own.positions, &own.triangles, &[(place, turn)], &Progress::new())
        .expect("a leaf")
}

#[test]
fn a_hand_opens_a_door_and_the_person_walks_on_through_it() {
    let made = through();
    assert!(made.report.success, "{:?}", made.report.problems);
    let (told, track) = (&made.report.opened[0], &made.carried[0]);
    assert_eq!((told.leaf.as_str(), track.name.as_str()), ("Door", "Door"));
    assert_eq!((track.first_frame, track.positions.len()), (told.taken + 6, told.opened - told.taken - 5));
    // The leaf's origin goes round its hinge by a quarter turn: −x and then −y of it is where +x was.
    let last = *track.rotations.last().expect("rotations");
    assert!((last * Vec3::X).distance(Vec3::NEG_Y) < 1e-4, "{last}");
    for (place, turn) in track.positions.iter().zip(&track.rotations) {
        assert!(place.distance(HINGE + *turn * (door().position - HINGE)) < 1e-4);
    }
    // While the hand leads it the palm is within a centimetre of the handle, which turns about the hinge as the leaf does.
    assert!(told.led >= 0.4 && told.handle_cm < 1.0, "{told:?}");
    for frame in told.taken..=told.let_go {
        let at = frame.saturating_sub(track.first_frame).min(track.rotations.len() - 1);
        let turn = if frame < track.first_frame { Quat::IDENTITY } else { track.rotations[at] };
        let handle = HINGE + turn * (HANDLE - HINGE);
        let palm = made.motion.postures[frame].pose().point(Joint::LeftHand, palm(Joint::LeftHand));
        assert!(palm.distance(handle) < 0.01, "{} m off on {frame}", palm.distance(handle));
    }
    // Nothing of the body but the hand on the handle is in the leaf, wherever it is: not before, not meanwhile, not on the way through.
    for frame in (0..made.motion.len()).step_by(2) {
        let holds = (told.taken - 5..told.let_go + 11).contains(&frame).then_some(Joint::LeftHand);
        let deep = deepest(made, &door_on(made, frame), frame, holds);
        assert!(deep < 0.02, "{deep} m in the leaf on frame {frame}");
    }
    let ends = made.motion.postures[made.motion.len() - 1].root_position;
    assert!(ends.y > 2.0, "{ends}");
}

#[test]
fn the_way_through_a_closed_door_is_none() {
    let mut performance = through_the_door();
    performance.steps.remove(0);
    let error = check_performance(room(), &performance).unwrap_err().to_string();
    assert!(error.contains("Beyond"), "{error}");
    // Nor is there one through a door that opened a little.
    let mut ajar = through_the_door();
    let ThingCue::Open(open) = &mut ajar.steps[0].things[0] else { panic!("an opening") };
    open.by = Amount::Degrees(15.0);
    assert!(check_performance(room(), &ajar).is_err());
    assert!(check_performance(room(), &through_the_door()).is_ok());
}

#[test]
fn a_drawer_is_pulled_out() {
    let handle = Vec3::new(-2.43, -2.0, 0.76);
    let at = [-1.85, -2.0, 0.0];
    let pulls = open(&drawer(), Hand::Right, Amount::Metres(0.25), handle);
    let performance = asked(vec![stop("At the chest", at, towards(at, handle), vec![pulls])], vec![drawer()]);
    let made = play(&performance, None).expect("a performance");
    assert!(made.report.success, "{:?}", made.report.problems);
    let (told, track) = (&made.report.opened[0], &made.carried[0]);
    // It is led all the way, by the hand that asks no more of the body than to be there.
    assert_eq!((told.let_go, told.led), (told.opened, 1.0));
    assert!(told.handle_cm < 1.0 && told.arm_cm < 1.0 && told.body_cm == 0.0, "{told:?}");
    let moved = *track.positions.last().expect("places") - Vec3::from(DRAWER.0);
    assert!(moved.distance(Vec3::X * 0.25) < 1e-4 && track.rotations.iter().all(|turn| turn.w > 0.9999));
}

#[test]
fn what_is_opened_leaves_the_steps_before_it_as_they_were() {
    let mut other = through_the_door();
    let ThingCue::Open(open) = &mut other.steps[0].things[0] else { panic!("an opening") };
    open.over_seconds = Some(2.5);
    let again = play(&other, Some(through())).expect("a performance");
    let met = |made: &Performed| made.report.steps[0].moments.complete;
    assert_eq!(met(&again), met(through()));
    let until = through().report.opened[0].taken - 30;
    assert_eq!(again.motion.postures[..until], through().motion.postures[..until]);
}

#[test]
fn what_cannot_be_opened_is_said_with_cue_and_person() {
    let said = |change: &dyn Fn(&mut Performance)| {
        let mut performance = through_the_door();
        change(&mut performance);
        let error = check_performance(room(), &performance).unwrap_err().to_string();
        assert!(error.contains("Door"), "{error}");
        error
    };
    fn opening(performance: &mut Performance) -> &mut OpenCue {
        let ThingCue::Open(open) = &mut performance.steps[0].things[0] else { panic!("an opening") };
        open
    }
    let unknown = said(&|p| p.leaves[0].hung = Hung::Hinge { point: Vec3::ZERO, axis: Vec3::ZERO });
    assert!(
        unknown.contains("‘Open Door’ has ‘Ann’ open ‘Door’, and which way that opens is unknown"),
        "{unknown}"
    );
    let nothing = said(&|p| p.leaves[0].name = "Gate".into());
    assert!(nothing.contains("‘Ann’") && nothing.contains("‘Open Door’"), "{nothing}");
    let far = said(&|p| opening(p).grip += Vec3::X * 3.0);
    assert!(far.contains("‘Ann’") && far.contains("farther than a hand gets"), "{far}");
    let swept = said(&|p| p.steps[0].cue.position = Vec3::new(0.1, -0.55, 0.0));
    assert!(swept.contains("‘Ann’ would stand in the way of ‘Door’"), "{swept}");
    let hinge = said(&|p| opening(p).grip = HINGE - Vec3::from(DOOR.0));
    assert!(hinge.contains("on its hinge"), "{hinge}");
    let by = said(&|p| opening(p).by = Amount::Degrees(400.0));
    assert!(by.contains("by 400°; give 1° to 180°"), "{by}");
    let quick = said(&|p| opening(p).over_seconds = Some(0.4));
    assert!(quick.contains("in 0.4 s"), "{quick}");
    let slides = said(&|p| opening(p).by = Amount::Metres(0.3));
    assert!(slides.contains("by metres, and it hangs on a hinge"), "{slides}");
    assert!(said(&|p| p.leaves[0].triangles.clear()).contains("cannot be opened"));
}

#[test]
fn who_cannot_reach_along_it_opens_nothing_and_stays() {
    // A lid would fall, and a drawer stops: from so far aside the arm leads it by a part of its way only.
    let handle = Vec3::new(-2.43, -2.0, 0.76);
    let at = [-2.05, -1.05, 0.0];
    let mut far = open(&drawer(), Hand::Left, Amount::Metres(0.30), handle);
    far.grip.y -= 0.3;
    let steps = vec![
        stop("Aside", at, towards(at, handle), vec![far]),
        stop("Away", [1.5, -2.0, 0.0], 0.0, Vec::new()),
    ];
    let made = play(&asked(steps, vec![drawer()]), None).expect("a performance");
    assert!(!made.report.success && made.report.opened.is_empty() && made.carried.is_empty());
    let told = made.report.problems.join(" ");
    assert!(
        told.contains("‘Ann’ does not open ‘Drawer’ by ‘Open Drawer’") && told.contains("‘Away’"),
        "{told}"
    );
    assert_eq!(told.matches("does not open").count(), 1, "{told}");
}
