//! Arms turn aside in a gap between two cupboards (posture offset, LAMA section 3.3): the room of the fixture `gap_room`,
//! with the posture offset and without, otherwise alike and from scratch.

mod common;

use glam::Vec3;
use oncue::MotionDatabase;
use oncue::library::starter;
use oncue::motion::{BODY_BOXES, Limb, Pose};
use oncue::scene::SceneIndex;
use oncue::{ActionCue, ActionType, InitialState, Motion, Progress, Settings, Task, synthesize};

use common::boxes::boxes;

/// The gap is so wide, and the cupboards so deep, metres.
const GAP: f32 = 0.55;
const CUPBOARDS: (f32, f32) = (-0.9, -0.4);

fn gap_room() -> SceneIndex {
    let (positions, triangles) = boxes(&[
        ([-3.0, -4.0, -0.1], [3.0, 3.0, 0.0]),
        ([-3.0, CUPBOARDS.0, 0.0], [-GAP / 2.0, CUPBOARDS.1, 1.9]),
        ([GAP / 2.0, CUPBOARDS.0, 0.0], [3.0, CUPBOARDS.1, 1.9]),
    ]);
    SceneIndex::build(&positions, &triangles, &Settings::default().scene, &Progress::new()).expect("a room")
}

fn through_the_gap() -> Task {
    Task {
        start: InitialState::standing("Start", Vec3::new(0.5, -3.0, 0.0), 2.6),
        cue: ActionCue {
            name: "Stop".into(),
            action_type: ActionType::Stop,
            position: Vec3::new(0.3, 1.4, 0.0),
            yaw: 2.8,
            feet: [None; 2],
        },
        passes: Vec::new(),
        manipulations: Vec::new(),
    }
}

/// Over a motion: frames with any arm in a cupboard, their crossings, and how wide the arms are between the cupboards,
/// metres.
#[derive(Debug, Default)]
struct Arms {
    frames: usize,
    crossings: u32,
    width: f32,
    other_frames: usize,
}

fn arms(scene: &SceneIndex, motion: &Motion) -> Arms {
    let mut arms = Arms::default();
    for posture in &motion.postures {
        let pose = posture.pose();
        let counts = scene.body_intersections(&pose, 0.1);
        let of = |wanted: fn(Limb) -> bool| -> u32 {
            BODY_BOXES.iter().zip(counts).filter(|(node, _)| wanted(node.limb)).map(|(_, count)| count).sum()
        };
        let crossings = of(|limb| limb == Limb::Arm);
        arms.frames += usize::from(crossings > 0);
        arms.crossings += crossings;
        arms.other_frames += usize::from(of(|limb| limb != Limb::Arm) > 0);
        let (left, right) = sides(&pose);
        arms.width = arms.width.max(right - left);
    }
    arms
}

/// The least and the greatest x of the arms' corners between the cupboards.
fn sides(pose: &Pose) -> (f32, f32) {
    let (mut left, mut right) = (f32::INFINITY, f32::NEG_INFINITY);
    for node in BODY_BOXES.iter().filter(|node| node.limb == Limb::Arm) {
        let joint = node.joint.index();
        for corner in 0..8 {
            let sign = |axis: usize| if corner & (1 << axis) == 0 { -1.0 } else { 1.0 };
            let local = node.center + node.half_extents * Vec3::new(sign(0), sign(1), sign(2));
            let place = pose.positions[joint] + pose.rotations[joint] * local;
            if (CUPBOARDS.0..CUPBOARDS.1).contains(&place.y) {
                (left, right) = (left.min(place.x), right.max(place.x));
            }
        }
    }
    (left, right)
}

#[test]
fn arms_turn_aside_between_two_cupboards() {
    let (scene, task, progress) = (gap_room(), through_the_gap(), Progress::new());
    let library = starter::generate(&progress).expect("the starter library");
    let mut settings = Settings::default();
    let weights = settings.synthesizer.weights.clone();
    let database = MotionDatabase::build(&library, &weights, &progress).expect("a database");
    settings.ppo.prior = false;
    // The best there is, whatever the take.
    settings.kept.takes = 1;
    // What the controller does by itself: limbs that brush something are taken out of it afterwards, with the offset or without.
    settings.editor.fit = false;
    let mut walk = |posture_offset: bool, seed: u64| {
        settings.signal.posture_offset = posture_offset;
        let done = synthesize(&scene, &database, &task, None, &settings, seed, &progress).expect("a motion");
        let report = done.report;
        println!("seed {seed}, posture offset {posture_offset}: {:?}", report.problems);
        // Arms that may not turn aside brush the cupboards, and the report says so.
        assert!(
            report.cues.iter().all(|cue| cue.met) && (report.success || !posture_offset),
            "{:?}",
            report.problems
        );
        arms(&scene, &done.motion)
    };
    let (mut frames, mut crossings) = (0, [0, 0]);
    for seed in 1..4 {
        let (with, without) = (walk(true, seed), walk(false, seed));
        println!("seed {seed}: with the posture offset {with:?}, without {without:?}");
        assert_eq!(with.other_frames, 0, "{with:?}");
        // It is arms that brush the cupboards without it, seldom a shoulder or a foot with them.
        assert!(2 * without.other_frames < without.frames, "{without:?}");
        // Without it the arms brush the cupboards, as there is no other way; with it they are clear or nearly so.
        assert!(with.crossings < without.crossings, "{with:?} {without:?}");
        frames += with.frames;
        crossings[0] += with.crossings;
        crossings[1] += without.crossings;
    }
    // A brief touch, three frames, a walk.
    assert!(frames <= 9 && 5 * crossings[0] < crossings[1], "{frames} {crossings:?}");
}
