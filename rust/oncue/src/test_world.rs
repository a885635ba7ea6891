//! What unit tests share: rooms of boxes, a person who can be posed by hand, and a motion library of a few clips that are
//! simple enough to work out what must come of them.
//!
//! Walking here is gliding: the root moves evenly and the feet with it, a few centimetres a frame.

// Shared with the integration tests, which are crates of their own.
#[path = "../tests/common/boxes.rs"]
#[allow(unreachable_pub)]
mod boxes;

use std::sync::OnceLock;

use glam::{Quat, Vec2, Vec3};

use crate::action::{ActionLabel, ActionType};
use crate::controller::policy::{Draw, Policy, TYPE_COUNT};
use crate::controller::{Environment, StoredPolicy};
use crate::cue::{ActionCue, InitialState, Task};
use crate::library::database::{MotionDatabase, TurnLimits};
use crate::library::feature::FeatureWeights;
use crate::library::{Clip, MotionLibrary, Segment, Source};
use crate::math::Planar;
use crate::math::curve::smoothstep;
use crate::motion::skeleton::{ANKLE_HEIGHT, LEG_LENGTH};
use crate::motion::{FRAME_RATE, FootContact, JOINT_COUNT, Joint, Motion, Posture};
use crate::progress::Progress;
use crate::scene::SceneIndex;
use crate::settings::Settings;

/// Height of the pelvis of who stands in these tests, metres.
pub(crate) const STANDS: f32 = 0.93;
/// Metres a frame of the library's straight walk: 1.2 m/s.
pub(crate) const PACE: f32 = 0.04;
/// Radians that any joint turns a frame at the most in the tests' database.
pub(crate) const TURN: f32 = 0.2;
/// Frames in which the sit is complete, how far behind its feet the pelvis ends, and how high, metres.
pub(crate) const SITS_IN: usize = 50;
pub(crate) const SITS_BACK: f32 = 0.30;
pub(crate) const SITS_AT: f32 = 0.55;
/// Frames in which the stop is complete, and how far it goes on, metres.
pub(crate) const STOPS_IN: usize = 40;
pub(crate) const STOPS_AFTER: f32 = 0.8;
/// The floor of [`World::new`] reaches so far to each side, metres.
pub(crate) const HALF_FLOOR: f32 = 3.0;

/// Boxes from their lowest and highest corners, metres.
pub(crate) type Boxes = [([f32; 3], [f32; 3])];

/// The scene of some boxes and nothing else.
pub(crate) fn scene(list: &Boxes) -> SceneIndex {
    let (positions, triangles) = boxes::boxes(list);
    SceneIndex::build(&positions, &triangles, &Settings::default().scene, &Progress::new()).expect("a scene")
}

/// The same on a floor of 6 × 6 m about the origin.
pub(crate) fn room(boxes: &Boxes) -> SceneIndex {
    let mut all = vec![([-HALF_FLOOR, -HALF_FLOOR, -0.1], [HALF_FLOOR, HALF_FLOOR, 0.0])];
    all.extend_from_slice(boxes);
    scene(&all)
}

/// A person with arms down and feet flat who faces as `at`, the pelvis `height` over the floor and `back` behind the feet.
pub(crate) fn person(at: Planar, height: f32, back: f32) -> Posture {
    let mut posture = Posture::default();
    let mut turn = |joint: Joint, rotation: Quat| posture.rotations[joint.index()] = rotation;
    turn(Joint::LeftArm, Quat::from_rotation_y(1.4));
    turn(Joint::RightArm, Quat::from_rotation_y(-1.4));
    // Hip, knee and ankle in the plane that the person faces: an isosceles triangle of thigh and shin.
    let down = height - 0.02 - ANKLE_HEIGHT;
    let half = (back.hypot(down) / (2.0 * LEG_LENGTH)).min(1.0).acos();
    let lean = f32::atan2(-back, down);
    for [thigh, shin, foot] in [
        [Joint::LeftUpLeg, Joint::LeftLeg, Joint::LeftFoot],
        [Joint::RightUpLeg, Joint::RightLeg, Joint::RightFoot],
    ] {
        turn(thigh, Quat::from_rotation_x(lean - half));
        turn(shin, Quat::from_rotation_x(2.0 * half));
        turn(foot, Quat::from_rotation_x(-lean - half));
    }
    posture.root_position = Vec3::new(0.0, 0.0, height);
    posture.moved(Planar::default(), at)
}

/// Who stands still for so many frames, both feet planted.
pub(crate) fn still(frames: usize) -> Motion {
    Motion {
        postures: vec![person(Planar::default(), STANDS, 0.0); frames],
        contacts: vec![[1.0; 2]; frames],
    }
}

fn clip(
    name: &str,
    label: ActionLabel,
    frames: usize,
    complete: usize,
    frame: impl Fn(usize) -> (Posture, FootContact),
) -> Clip {
    let (postures, contacts) = (0..frames).map(frame).unzip();
    Clip {
        name: name.to_owned(),
        source: Source::Procedural,
        mirrored: false,
        motion: Motion { postures, contacts },
        segments: vec![Segment { label, first: 0, end: frames, complete }],
    }
}

/// Stand, walk, turn left, turn right, stop, sit: the clips in this order.
pub(crate) fn library() -> MotionLibrary {
    let at = |y: f32| Planar::new(Vec2::new(0.0, y), 0.0);
    let arc = |side: f32| {
        move |i: usize| {
            // 0.03 m and 0.04 rad a frame: a circle of 0.75 m.
            let yaw = side * 0.04 * i as f32;
            let place = side * 0.75 * Vec2::new(1.0 - yaw.cos(), -yaw.sin());
            (person(Planar::new(place, yaw), STANDS, 0.0), [0.0; 2])
        }
    };
    let clips = vec![
        clip("stand", ActionLabel::Idle, 60, 59, |_| (person(at(0.0), STANDS, 0.0), [1.0; 2])),
        clip("walk", ActionLabel::Walk, 120, 119, |i| (person(at(-PACE * i as f32), STANDS, 0.0), [0.0; 2])),
        clip("left", ActionLabel::Walk, 90, 89, arc(1.0)),
        clip("right", ActionLabel::Walk, 90, 89, arc(-1.0)),
        clip("stop", ActionLabel::Stop, 90, STOPS_IN, |i| {
            // Evenly slower, from the pace to nothing.
            let t = (i as f32 / STOPS_IN as f32).min(1.0);
            let contact = if i < STOPS_IN { 0.0 } else { 1.0 };
            (person(at(-STOPS_AFTER * t * (2.0 - t)), STANDS, 0.0), [contact; 2])
        }),
        clip("sit", ActionLabel::Sit, 90, SITS_IN, |i| {
            let t = smoothstep((i as f32 - 10.0) / (SITS_IN - 10) as f32);
            let back = SITS_BACK * t;
            (person(at(back), STANDS + (SITS_AT - STANDS) * t, back), [1.0; 2])
        }),
    ];
    MotionLibrary { clips }
}

/// The library made matchable. Each joint turns by [`TURN`] a frame at the most, and is accelerated by 50 m/s².
pub(crate) fn database() -> &'static MotionDatabase {
    static DATABASE: OnceLock<MotionDatabase> = OnceLock::new();
    DATABASE.get_or_init(|| {
        let built = MotionDatabase::build(&library(), &FeatureWeights::default(), &Progress::new());
        let mut database = built.expect("clips of every kind");
        database.turns = TurnLimits::new([TURN; JOINT_COUNT]);
        database.accelerations = [50.0; JOINT_COUNT];
        database
    })
}

/// The database frame of a clip's frame.
pub(crate) fn frame_of(clip: &str, index: usize) -> usize {
    let clips = library().clips;
    let before = clips.iter().take_while(|c| c.name != clip).map(|c| c.motion.len());
    before.sum::<usize>() + index
}

/// The clip that a database frame is of.
pub(crate) fn clip_of(frame: usize) -> String {
    library().clips[database().frames[frame].clip as usize].name.clone()
}

/// All that an episode plays in.
pub(crate) struct World {
    pub scene: SceneIndex,
    pub task: Task,
    pub settings: Settings,
}

impl World {
    /// The [`room`] of some boxes, a start and a cue; networks, tuples and rollouts are few and small.
    pub(crate) fn new(boxes: &Boxes, start: Planar, cue: ActionCue) -> Self {
        let position = start.position.extend(0.0);
        let task = Task {
            start: InitialState::standing("Here", position, start.yaw),
            cue,
            passes: Vec::new(),
            manipulations: Vec::new(),
        };
        let mut settings = Settings::default();
        settings.ppo.policy_layers = vec![4];
        settings.ppo.value_layers = vec![4];
        settings.ppo.tuples = 256;
        settings.ppo.batch = 64;
        settings.ppo.epochs = 1;
        settings.ppo.updates = 2;
        settings.ppo.prior = false;
        settings.kept.rollouts = 6;
        settings.kept.rounds = 0;
        settings.kept.more_rounds = 0;
        settings.kept.branches = 2;
        Self { scene: room(boxes), task, settings }
    }

    /// Starts at the origin facing -Y, before a stool at the place to which the library's sit leads from there.
    pub(crate) fn stool() -> Self {
        Self::new(&[([-0.2, 0.15, 0.0], [0.2, 0.5, 0.44])], Planar::default(), sit_cue())
    }

    /// Starts at the origin facing -Y, to stop so many metres ahead.
    pub(crate) fn stop_ahead(metres: f32) -> Self {
        Self::new(&[], Planar::default(), stop_cue(Vec2::new(0.0, -metres), 0.0))
    }

    pub(crate) fn environment(&self) -> Environment<'_> {
        Environment::new(&self.scene, database(), &self.task, &self.settings).expect("sound settings")
    }

    /// A policy that adds nothing to what is proposed.
    pub(crate) fn proposed(&self) -> Policy {
        use rand::SeedableRng;
        let mut rng = rand_pcg::Pcg64::seed_from_u64(1);
        let size = crate::controller::state::state_size(&self.settings.state);
        let mut policy = Policy::new(size, &self.settings, &mut rng);
        policy.policy.parameters.fill(0.0);
        policy.value.parameters.fill(0.0);
        policy
    }

    /// The same to be stored.
    pub(crate) fn stored(&self) -> StoredPolicy {
        StoredPolicy::new(self.proposed(), &self.settings, Default::default())
    }
}

/// Where the library's sit ends for who begins it at the origin facing -Y.
pub(crate) fn sit_cue() -> ActionCue {
    ActionCue {
        name: "Stool".into(),
        action_type: ActionType::Sit,
        position: Vec3::new(0.0, SITS_BACK, SITS_AT),
        yaw: 0.0,
        feet: [None; 2],
    }
}

/// To stop at a place.
pub(crate) fn stop_cue(place: Vec2, yaw: f32) -> ActionCue {
    ActionCue {
        name: "There".into(),
        action_type: ActionType::Stop,
        position: place.extend(0.0),
        yaw,
        feet: [None; 2],
    }
}

/// The decision for an action whose vector begins with `future`; the rest is 0.
pub(crate) fn decide(settings: &Settings, action_type: ActionType, future: [f32; 3]) -> Draw {
    let mut vector = vec![0.0; settings.signal.vector_size()];
    vector[..3].copy_from_slice(&future);
    assert!(action_type.index() < TYPE_COUNT);
    Draw { action_type: action_type.index(), vector, log_probability: 0.0 }
}

/// To walk straight on at the library's pace.
pub(crate) fn walk_on(settings: &Settings) -> Draw {
    let goal = PACE * FRAME_RATE / settings.signal.reach;
    decide(settings, ActionType::Walk, [0.0, -goal, 0.0])
}

/// Whether two numbers are the same but for rounding.
#[track_caller]
pub(crate) fn close(a: f32, b: f32, tolerance: f32) {
    assert!((a - b).abs() <= tolerance, "{a} and {b} differ by more than {tolerance}");
}
