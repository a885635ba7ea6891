//! Nine motions: between them they walk, sit, stop, reach, pass a gap, place their feet, are played by the prior, optimized
//! from scratch and made with the paper's constants.

use glam::Vec3;
use oncue::{ActionCue, ActionType, Hand, InitialState, ManipulationCue, Settings, Task};

/// A box from its lowest to its highest corner, metres.
type Box3 = ([f32; 3], [f32; 3]);

/// What one motion is made from.
pub struct Case {
    pub name: &'static str,
    pub room: &'static [Box3],
    pub task: Task,
    pub settings: Settings,
    pub seed: u64,
}

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

/// The nine.
pub fn cases() -> Result<Vec<Case>, oncue::Error> {
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

    let small_usual = small(usual.clone());
    let nine: [(_, &'static [Box3], &Task, &Settings, _); 9] = [
        ("sit", &ROOM, &sit, &usual, 1),
        ("sit, another seed", &ROOM, &sit, &usual, 2),
        ("sit, no manifold", &ROOM, &sit, &plain, 1),
        ("sit, feet placed", &ROOM, &feet, &usual, 1),
        ("stop", &ROOM, &stop, &usual, 1),
        ("stop and reach", &ROOM, &hand, &usual, 1),
        ("gap, from scratch", &GAP, &through, &scratch, 1),
        ("desk", &DESK, &desk, &small_usual, 1),
        ("sit, the paper's constants", &ROOM, &sit, &paper, 1),
    ];
    let case = |(name, room, task, settings, seed): (_, _, &Task, &Settings, _)| Case {
        name,
        room,
        task: task.clone(),
        settings: settings.clone(),
        seed,
    };
    Ok(nine.map(case).into())
}

/// As many updates and rollouts as show a difference.
fn small(mut settings: Settings) -> Settings {
    settings.ppo.tuples = 1024;
    settings.ppo.updates = 2;
    settings.kept.rollouts = settings.kept.rollouts.min(48);
    settings
}

fn task(start: [f32; 2], yaw: f32, action_type: ActionType, cue: [f32; 3], cue_yaw: f32) -> Task {
    let start = InitialState::standing("Start", Vec3::new(start[0], start[1], 0.0), yaw);
    let cue = ActionCue {
        name: "Cue".into(),
        action_type,
        position: Vec3::from(cue),
        yaw: cue_yaw,
        feet: [None; 2],
    };
    Task { start, cue, passes: Vec::new(), manipulations: Vec::new() }
}
