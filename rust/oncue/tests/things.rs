//! Things in hands: taken, carried and put down again, in a performance.

mod common;

use std::sync::OnceLock;

use glam::{Quat, Vec3};
use oncue::figures::body_figures;
use oncue::library::starter;
use oncue::motion::Joint;
use oncue::motion::skeleton::palm;
use oncue::perform::check_performance;
use oncue::scene::SceneIndex;
use oncue::{
    ActionCue, ActionType, Hand, InitialState, LookCue, ManipulationCue, Motion, MotionDatabase, Performance,
    Performed, Progress, PutCue, Settings, Step, TakeCue, Thing, ThingCue, perform,
};

use common::boxes::boxes;

/// A table of 0.75 m on the right, a low one of 0.45 m on the left, and a bench at the far wall.
const ROOM: [([f32; 3], [f32; 3]); 4] = [
    ([-3.0, -3.0, -0.1], [3.0, 3.0, 0.0]),
    ([1.5, -1.0, 0.0], [2.2, 0.6, 0.75]),
    ([-2.4, -1.0, 0.0], [-1.6, 0.6, 0.45]),
    ([-0.8, 2.2, 0.0], [0.8, 2.7, 0.45]),
];

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

fn step(name: &str, action_type: ActionType, position: [f32; 3], yaw: f32, things: Vec<ThingCue>) -> Step {
    let cue = ActionCue { name: name.into(), action_type, position: position.into(), yaw, feet: [None; 2] };
    Step { cue, hold_seconds: None, at_seconds: None, passes: Vec::new(), manipulations: Vec::new(), things }
}

fn take(thing: &Thing, hand: Hand) -> ThingCue {
    let grip = 0.5 * (thing.low + thing.high);
    ThingCue::Take(TakeCue { name: format!("Take {}", thing.name), thing: thing.name.clone(), hand, grip })
}

fn put(thing: &Thing, position: [f32; 3], yaw: Option<f32>) -> ThingCue {
    let name = format!("Put {}", thing.name);
    ThingCue::Put(PutCue { name, thing: thing.name.clone(), position: position.into(), yaw })
}

/// A cup of 8 × 8 × 10 cm, or a box of 45 × 30 × 25 cm, that stands at a place.
fn thing(name: &str, size: [f32; 3], at: [f32; 3]) -> Thing {
    let [x, y, z] = size;
    let (low, high) = (Vec3::new(-0.5 * x, -0.5 * y, 0.0), Vec3::new(0.5 * x, 0.5 * y, z));
    Thing { name: name.into(), position: at.into(), rotation: [1.0, 0.0, 0.0, 0.0], low, high }
}

fn cup() -> Thing {
    thing("Cup", [0.08, 0.08, 0.10], [1.62, -0.20, 0.75])
}

fn parcel() -> Thing {
    thing("Box", [0.30, 0.45, 0.25], [1.72, -0.20, 0.75])
}

/// From the high table to the low one: faces +X there and −X here.
fn carries(thing: &Thing, hand: Hand, to: [f32; 3], yaw: Option<f32>) -> Performance {
    let quarter = std::f32::consts::FRAC_PI_2;
    Performance {
        start: InitialState::standing("Ann", Vec3::new(0.0, -1.5, 0.0), 2.5),
        steps: vec![
            step("Table", ActionType::Stop, [1.15, -0.2, 0.0], quarter, vec![take(thing, hand)]),
            step("Low", ActionType::Stop, [-1.2, -0.2, 0.0], -quarter, vec![put(thing, to, yaw)]),
        ],
        things: vec![thing.clone()],
        leaves: Vec::new(),
        looks: Vec::new(),
    }
}

fn play(performance: &Performance, earlier: Option<&Performed>) -> Performed {
    let settings = Settings::default();
    perform(None, room(), database(), performance, earlier, None, &settings, 1, &Progress::new())
        .expect("a performance")
}

fn with_the_cup() -> &'static Performed {
    static MADE: OnceLock<Performed> = OnceLock::new();
    MADE.get_or_init(|| play(&carries(&cup(), Hand::Right, [-1.8, -0.15, 0.45], None), None))
}

/// Where a palm is in the frame of what it carries, on a frame of the whole.
fn on_it(made: &Performed, joint: Joint, frame: usize) -> Vec3 {
    let carried = &made.carried[0];
    let i = frame - carried.first_frame;
    let palm = made.motion.postures[frame].pose().point(joint, palm(joint));
    carried.rotations[i].inverse() * (palm - carried.positions[i])
}

/// The hardest acceleration of a joint over the library's 99.9th percentile, and on which frame.
fn hardest(motion: &Motion) -> (f32, usize, Joint) {
    let places = |frame: usize| motion.postures[frame].pose().positions;
    let mut worst = (0.0, 0, Joint::Hips);
    for frame in 1..motion.len() - 1 {
        let [a, b, c] = [frame - 1, frame, frame + 1].map(places);
        for (joint, usual) in Joint::ALL.into_iter().zip(database().accelerations) {
            let i = joint.index();
            let ratio = (a[i] - 2.0 * b[i] + c[i]).length() * 900.0 / usual.max(1.0);
            if ratio > worst.0 {
                worst = (ratio, frame, joint);
            }
        }
    }
    worst
}

fn held_well(made: &Performed, asked: &Performance, hands: &[Joint]) {
    assert!(made.report.success, "{:?}", made.report.problems);
    carried_well(made, asked, hands);
}

fn carried_well(made: &Performed, asked: &Performance, hands: &[Joint]) {
    let (told, carried) = (&made.report.things[0], &made.carried[0]);
    let placed = told.placed.expect("put down");
    // It stands where it stood until it is taken, and stays where it is put, within a centimetre.
    assert_eq!((carried.first_frame, carried.positions.len()), (told.taken, placed - told.taken + 1));
    assert!(carried.positions[0].distance(asked.things[0].position) < 1e-4);
    let ThingCue::Put(put) = &asked.steps[1].things[0] else { panic!("a put") };
    let stands = *carried.positions.last().expect("places");
    assert!(stands.distance(put.position) < 0.01, "{stands}");
    assert!(told.put_cm.is_some_and(|off| off < 1.0) && told.grip_cm < 0.5, "{told:?}");
    // All the way the palms are where they gripped it, to the millimetre or so, and it is level.
    let lifted = told.taken + 6;
    for &hand in hands {
        let grip = on_it(made, hand, lifted);
        for frame in lifted..=placed {
            let off = on_it(made, hand, frame).distance(grip);
            assert!(off < 0.006, "{hand:?} is {off} m off at {frame}");
        }
    }
    assert!(carried.rotations.iter().all(|turn| (*turn * Vec3::Z).z > 0.9999));
    // Nothing jumps: neither the thing nor a joint.
    for pair in carried.positions.windows(2) {
        assert!(pair[0].distance(pair[1]) < 0.075, "{}", pair[0].distance(pair[1]));
    }
    let (ratio, frame, joint) = hardest(&made.motion);
    assert!(ratio < 2.0, "{ratio} at {frame}: {joint:?}");
    // Elbows are bent while it is carried, hands are before the body and over the belly.
    let (from, to) = (told.taken + 40, made.report.steps[1].moments.complete);
    for frame in from..to {
        let pose = made.motion.postures[frame].pose();
        for &hand in hands {
            let fore = hand.parent().expect("a forearm");
            let upper = fore.parent().expect("an upper arm");
            let [shoulder, elbow, wrist] = [upper, fore, hand].map(|joint| pose.position(joint));
            let bend = (elbow - shoulder).angle_between(wrist - elbow).to_degrees();
            assert!((50.0..125.0).contains(&bend), "{bend}° at {frame}");
        }
    }
    let body = body_figures(&made.motion, 0.0, None);
    assert!(body.own_body.deepest_cm < 1.5, "{:?}", body.own_body.touches);
    assert!(told.in_body_cm < 1.0 && told.turn_degrees < 12.0, "{told:?}");
}

#[test]
fn a_cup_is_carried_in_one_hand_from_table_to_table() {
    let asked = carries(&cup(), Hand::Right, [-1.8, -0.15, 0.45], None);
    held_well(with_the_cup(), &asked, &[Joint::RightHand]);
}

#[test]
fn a_box_is_carried_in_both_hands_and_turned_to_the_cue() {
    // Its -Y faces -X, towards the person, where it is asked to face -Y again: a quarter turn less what it was turned by.
    let asked = carries(&parcel(), Hand::Both, [-1.78, -0.2, 0.45], Some(std::f32::consts::PI - 0.2));
    let made = play(&asked, None);
    held_well(&made, &asked, &Joint::HANDS);
    let turned = *made.carried[0].rotations.last().expect("rotations") * Vec3::NEG_Y;
    let wanted = Quat::from_rotation_z(std::f32::consts::PI - 0.2) * Vec3::NEG_Y;
    assert!(turned.angle_between(wanted) < 0.02, "{turned} {wanted}");
}

#[test]
fn what_hands_do_changes_no_step() {
    let made = with_the_cup();
    let mut empty = carries(&cup(), Hand::Right, [-1.8, -0.15, 0.45], None);
    empty.steps.iter_mut().for_each(|step| step.things.clear());
    let free = play(&empty, Some(made));
    let [was, is] = [&free, made].map(|made| made.report.steps[1].first_frame);
    assert!(is > was + 60);
    // As soon as the person walks the legs do as they did, to the bit, and so nearly does the arm that carries nothing.
    let told = &made.report.things[0];
    let placed = told.placed.expect("put down");
    for frame in is + 45..made.report.steps[1].moments.complete - 50 {
        let [a, b] =
            [(&made.motion, frame), (&free.motion, frame - is + was)].map(|(m, f)| m.postures[f].rotations);
        assert!(a[Joint::LeftUpLeg.index()] == b[Joint::LeftUpLeg.index()], "{frame} of {is} to {placed}");
        let turned = a[Joint::LeftArm.index()].angle_between(b[Joint::LeftArm.index()]);
        assert!(turned < 0.03, "{turned} at {frame}");
    }
    let before = told.taken - 60;
    assert!(made.motion.postures[..before] == free.motion.postures[..before]);
    // Without its cue nothing is taken, and the same comes again.
    assert!(free.carried.is_empty() && free.report.things.is_empty());
    let again = play(&carries(&cup(), Hand::Right, [-1.8, -0.15, 0.45], None), Some(&free));
    assert!(again.motion == made.motion && again.carried == made.carried);
}

#[test]
fn a_cup_is_held_while_sitting_down() {
    let cup = cup();
    let mut sits = carries(&cup, Hand::Right, [0.0; 3], None);
    sits.steps[1] = step("Bench", ActionType::Sit, [0.0, 2.42, 0.55], 0.0, Vec::new());
    let made = play(&sits, Some(with_the_cup()));
    assert!(made.report.success, "{:?}", made.report.problems);
    let (told, carried) = (&made.report.things[0], &made.carried[0]);
    assert_eq!((told.placed, carried.first_frame + carried.positions.len()), (None, made.motion.len()));
    // Over the lap of who sits.
    let pelvis = made.motion.postures[made.motion.len() - 1].root_position;
    let over = carried.positions[carried.positions.len() - 1].z - pelvis.z;
    assert!((0.05..0.40).contains(&over) && told.grip_cm < 0.5 && told.in_body_cm < 1.0, "{over} {told:?}");
}

#[test]
fn what_cannot_be_taken_is_told_by_cue_and_person() {
    let said = |change: &dyn Fn(&mut Performance)| {
        let mut asked = carries(&cup(), Hand::Right, [-1.8, -0.15, 0.45], None);
        change(&mut asked);
        check_performance(room(), &asked).map_or_else(|error| error.to_string(), |()| String::new())
    };
    assert_eq!(said(&|_| ()), "");
    let never = said(&|p| p.steps[0].things.clear());
    assert!(never.contains("‘Put Cup’ has ‘Ann’ put ‘Cup’ down, which is in no hand"), "{never}");
    let twice = said(&|p| p.steps[1].things = p.steps[0].things.clone());
    assert!(twice.contains("‘Take Cup’ has ‘Ann’ take ‘Cup’, which is in a hand already"), "{twice}");
    let unknown = said(&|p| p.things.clear());
    assert!(unknown.contains("‘Cup’, which is none of the things of ‘Ann’"), "{unknown}");
    let big = said(&|p| p.things[0].high = Vec3::new(1.0, 0.9, 0.8));
    assert!(big.contains("‘Cup’ is too big for ‘Take Cup’") && big.contains("‘Ann’ carries up to"), "{big}");
    let busy = said(&|p| {
        p.things.push(parcel());
        p.steps[0].things.push(take(&parcel(), Hand::Both));
    });
    assert!(busy.contains("take ‘Box’ with both hands, and the right hand carries ‘Cup’"), "{busy}");
    let led = said(&|p| {
        let path = vec![Vec3::ZERO];
        let cue = ManipulationCue { name: "Rail".into(), hand: Hand::Right, path, first_frame: None };
        p.steps[0].manipulations.push(cue);
    });
    assert!(led.contains("‘Rail’ leads the right hand of ‘Ann’, and the right hand carries ‘Cup’"), "{led}");
    assert!(said(&|p| p.things[0].rotation = [0.0; 4]).contains("Thing ‘Cup’"));
}

#[test]
fn what_is_out_of_reach_stays_where_it_is() {
    // On the table's far side.
    let far = Thing { position: Vec3::new(2.15, 0.5, 0.75), ..cup() };
    let made = play(&carries(&far, Hand::Right, [-1.8, -0.15, 0.45], None), Some(with_the_cup()));
    let said = made.report.problems.join(" ");
    assert!(said.contains("‘Ann’ does not take ‘Cup’ by ‘Take Cup’: ‘Take Cup’ is"), "{said}");
    assert!(made.carried.is_empty() && !made.report.success && made.report.steps.len() == 2);
    // Where it cannot be put it is kept.
    let made = play(&carries(&cup(), Hand::Right, [-1.8, 1.9, 0.45], None), Some(with_the_cup()));
    let said = made.report.problems.join(" ");
    assert!(said.contains("‘Ann’ keeps ‘Cup’, which ‘Put Cup’ does not have put down: ‘Put Cup’"), "{said}");
    assert!(made.report.things[0].placed.is_none() && made.carried.len() == 1);
    // Nor is it turned right round in a hand.
    let made = play(&carries(&cup(), Hand::Right, [-1.8, -0.15, 0.45], Some(1.57)), Some(with_the_cup()));
    let said = made.report.problems.join(" ");
    assert!(said.contains("has ‘Ann’ turn what is carried by") && said.contains("up to 60°"), "{said}");
}

#[test]
fn who_carries_looks_about_and_the_hands_stay_on_it() {
    let mut asked = carries(&parcel(), Hand::Both, [-1.7, -0.2, 0.45], None);
    let picture = Vec3::new(-3.4, 0.6, 1.5);
    asked.looks.push(LookCue { name: "Picture".into(), path: vec![picture], after: 1, hold_seconds: None });
    let made = play(&asked, None);
    carried_well(&made, &asked, &Joint::HANDS);
    // Until the person has turned from the table it is behind, and that is all there is to say.
    assert!(
        matches!(&made.report.problems[..], [one] if one.contains("‘Picture’")),
        "{:?}",
        made.report.problems
    );
    let told = &made.report.looks[0];
    let [_, low] = &made.report.steps[..] else { panic!("two steps") };
    assert!(told.end == low.moments.complete && told.met > 20, "{told:?}");
    // The head is there in the motion that plays, hands and all.
    let faces = |frame: usize| {
        let head = made.motion.postures[frame].pose();
        let ahead = head.rotation(Joint::Head) * Vec3::NEG_Y;
        ahead.angle_between(picture - head.position(Joint::Head)).to_degrees() < 8.0
    };
    let there = (told.first..told.end).filter(|&frame| faces(frame)).count();
    assert!(there + 8 > told.met, "{there} {told:?}");
}

#[test]
fn what_is_carried_through_something_is_told() {
    // Posts to either side of who turns from the table: the body keeps clear of them, the box before it does not.
    let posts = [-0.63f32, 0.20].map(|y| ([1.13, y, 0.0], [1.16, y + 0.03, 1.6]));
    let (positions, triangles) = boxes(&[&ROOM[..], &posts].concat());
    let settings = Settings::default();
    let scene = SceneIndex::build(&positions, &triangles, &settings.scene, &Progress::new()).expect("a room");
    let asked = carries(&parcel(), Hand::Both, [-1.7, -0.2, 0.45], None);
    let made =
        perform(None, &scene, database(), &asked, None, None, &settings, 1, &Progress::new()).expect("made");
    let told = &made.report.things[0];
    assert!(told.in_scene_cm > 1.0, "{told:?}");
    // What stands on a table is not in it.
    assert!(with_the_cup().report.things[0].in_scene_cm < 0.5, "{:?}", with_the_cup().report.things);
}
