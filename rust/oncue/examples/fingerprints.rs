//! Prints a checksum of each of nine motions: what a change of structure must leave as it is, bit for bit.
//!
//! `cargo run --release --example fingerprints`, before the change and after it, on one machine: other vector
//! instructions round otherwise. Between them the nine walk, sit, stop, reach, pass a gap, place their feet, are played by
//! the prior, optimized from scratch and made with the paper's constants. What they do not run has tests of its own: an artist's
//! keys, captures, a stored policy, a manifold's training.

#[path = "../tests/common/boxes.rs"]
mod boxes;

use glam::Vec3;
use oncue::MotionDatabase;
use oncue::library::starter;
use oncue::scene::SceneIndex;
use oncue::{
    ActionCue, ActionType, Hand, InitialState, ManipulationCue, Motion, Progress, Settings, Task, synthesize,
};

type AnyError = Box<dyn std::error::Error>;

const FLOOR: ([f32; 3], [f32; 3]) = ([-3.0, -4.0, -0.1], [3.0, 3.0, 0.0]);

/// A low table in the middle and a bench at the far wall.
const ROOM: [([f32; 3], [f32; 3]); 3] =
    [FLOOR, ([-0.5, -0.5, 0.0], [0.5, 0.4, 0.4]), ([-0.8, 1.9, 0.0], [0.8, 2.4, 0.45])];
/// Two cupboards with 55 cm between them.
const GAP: [([f32; 3], [f32; 3]); 3] =
    [FLOOR, ([-3.0, -0.9, 0.0], [-0.275, -0.4, 1.9]), ([0.275, -0.9, 0.0], [3.0, -0.4, 1.9])];
/// A stool before a desk, with 45 cm between the seat's middle and the desk's edge.
const DESK: [([f32; 3], [f32; 3]); 3] =
    [FLOOR, ([-0.25, 1.0, 0.0], [0.25, 1.45, 0.45]), ([-0.8, 0.35, 0.68], [0.8, 0.78, 0.72])];

fn main() -> Result<(), AnyError> {
    let progress = Progress::new();
    let library = starter::generate(&progress)?;
    let usual = Settings::default();
    let mut scratch = small(usual.clone());
    scratch.ppo.prior = false;
    let mut paper = small(Settings::preset("paper")?);
    paper.ppo.epochs = 1;
    let mut plain = usual.clone();
    plain.editor.manifold = false;

    let sit = task([0.2, -1.8], 2.0, ActionType::Sit, [0.0, 2.12, 0.55], 0.0);
    let stop = task([0.2, -1.8], 2.0, ActionType::Stop, [-1.2, 1.0, 0.0], 3.0);
    let through = task([0.5, -3.0], 2.6, ActionType::Stop, [0.3, 1.4, 0.0], 2.8);
    let desk = task([-1.5, -1.5], 1.0, ActionType::Sit, [0.0, 1.22, 0.55], 0.0);
    let mut feet = sit.clone();
    feet.cue.feet = [Some(Vec3::new(0.14, 1.66, 0.0)), Some(Vec3::new(-0.1, 1.70, 0.0))];
    let mut hand = stop.clone();
    hand.manipulations = vec![ManipulationCue {
        name: "Hand".into(),
        hand: Hand::Right,
        path: (0..40).map(|i| Vec3::new(-1.35 + 0.002 * i as f32, 0.55, 1.1)).collect(),
        first_frame: None,
    }];

    let nine: [(&str, &[_], &Task, &Settings, u64); 9] = [
        ("sit", &ROOM, &sit, &usual, 1),
        ("sit, another seed", &ROOM, &sit, &usual, 2),
        ("sit, no manifold", &ROOM, &sit, &plain, 1),
        ("sit, feet placed", &ROOM, &feet, &usual, 1),
        ("stop", &ROOM, &stop, &usual, 1),
        ("stop and reach", &ROOM, &hand, &usual, 1),
        ("gap, from scratch", &GAP, &through, &scratch, 1),
        ("desk", &DESK, &desk, &small(usual.clone()), 1),
        ("sit, the paper's constants", &ROOM, &sit, &paper, 1),
    ];
    for (name, room, task, settings, seed) in nine {
        let (positions, triangles) = boxes::boxes(room);
        let scene = SceneIndex::build(&positions, &triangles, &settings.scene, &progress)?;
        let database = MotionDatabase::build(&library, &settings.synthesizer.weights, &progress)?;
        let done = synthesize(&scene, &database, task, None, settings, seed, &progress)?;
        println!(
            "{} {} frames, {} updates, met: {} · {name}",
            fingerprint(&done.motion),
            done.motion.len(),
            done.report.updates,
            done.report.success
        );
    }
    Ok(())
}

/// As many updates and rollouts as show a difference.
fn small(mut settings: Settings) -> Settings {
    settings.ppo.tuples = 1024;
    settings.ppo.updates = 2;
    settings.kept.rollouts = settings.kept.rollouts.min(48);
    settings
}

fn task(start: [f32; 2], yaw: f32, action_type: ActionType, cue: [f32; 3], cue_yaw: f32) -> Task {
    let start = InitialState { name: "Start".into(), position: Vec3::new(start[0], start[1], 0.0), yaw };
    let cue = ActionCue {
        name: "Cue".into(),
        action_type,
        position: Vec3::from(cue),
        yaw: cue_yaw,
        feet: [None; 2],
    };
    Task { start, cue, manipulations: Vec::new() }
}

/// The first half of the BLAKE3 of every number of a motion.
fn fingerprint(motion: &Motion) -> String {
    let mut hasher = blake3::Hasher::new();
    for (posture, contact) in motion.postures.iter().zip(&motion.contacts) {
        let rotations = posture.rotations.iter().flat_map(|r| r.to_array());
        for number in posture.root_position.to_array().into_iter().chain(rotations).chain(*contact) {
            hasher.update(&number.to_le_bytes());
        }
    }
    hasher.finalize().to_hex()[..16].to_owned()
}
