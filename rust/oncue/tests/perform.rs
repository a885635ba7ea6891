//! Performances: cues that one person meets one after the other, without a seam, and what is kept where one cue cannot be met.

mod common;

use std::sync::OnceLock;

use glam::Vec3;
use oncue::MotionDatabase;
use oncue::editor::shipped_manifold;
use oncue::library::starter;
use oncue::motion::Joint;
use oncue::scene::SceneIndex;
use oncue::{
    ActionCue, ActionType, Error, Hand, InitialState, ManipulationCue, Motion, Performance, Performed,
    Progress, Settings, Step, perform,
};

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

fn database() -> &'static MotionDatabase {
    static DATABASE: OnceLock<MotionDatabase> = OnceLock::new();
    DATABASE.get_or_init(|| {
        let library = starter::generate(&Progress::new()).expect("the starter library");
        MotionDatabase::build(&library, &Settings::default().synthesizer.weights, &Progress::new())
            .expect("a database")
    })
}

fn step(
    name: &str,
    action_type: ActionType,
    position: [f32; 3],
    yaw: f32,
    hold_seconds: Option<f32>,
) -> Step {
    let cue = ActionCue { name: name.into(), action_type, position: position.into(), yaw, feet: [None; 2] };
    Step { cue, hold_seconds, passes: Vec::new(), manipulations: Vec::new() }
}

/// Sits down on the bench, gets up, stops beside the table, and sits down again.
fn performance() -> Performance {
    Performance {
        start: InitialState::standing("Start", Vec3::new(0.2, -1.8, 0.0), 2.0),
        steps: vec![
            step("Left", ActionType::Sit, [-0.45, 2.12, 0.55], 0.0, Some(1.0)),
            step("Beside", ActionType::Stop, [-1.4, -0.8, 0.0], 1.5, None),
            step("Right", ActionType::Sit, [0.45, 2.12, 0.55], 0.0, None),
        ],
    }
}

fn play(performance: &Performance, earlier: Option<&Performed>) -> Result<Performed, Error> {
    let settings = Settings::default();
    perform(None, &room(), database(), performance, earlier, None, &settings, 1, &Progress::new())
}

fn played() -> &'static Performed {
    static PLAYED: OnceLock<Performed> = OnceLock::new();
    PLAYED.get_or_init(|| play(&performance(), None).expect("a performance"))
}

fn places(motion: &Motion, frame: usize) -> [Vec3; 22] {
    motion.postures[frame].pose().positions
}

#[test]
fn every_cue_is_met_and_the_seams_are_not_seen() {
    let made = played();
    let report = &made.report;
    assert!(report.success, "{:?}", report.problems);
    assert_eq!(report.steps.len(), 3);
    assert_eq!(made.motion.len(), report.frames);
    for (step, asked) in report.steps.iter().zip(performance().steps) {
        let cue = report.cues.iter().find(|cue| cue.cue == asked.cue.name).expect("measured");
        assert!(cue.met && (step.cue == cue.cue) && step.moments.complete == cue.frame, "{cue:?}");
        let root = made.motion.postures[cue.frame].root_position;
        let near = if asked.cue.is_seated() { 0.01 } else { 0.10 };
        assert!(asked.cue.pelvis_distance(root) < near, "{root} at {cue:?}");
    }
    // Who sat stands before walking on; who stood does not get up.
    let stood =
        |at: usize| report.steps[at].moments.stood_at.map(|frame| frame - report.steps[at].first_frame);
    assert!(stood(0).is_none() && stood(1).is_some_and(|f| (25..120).contains(&f)) && stood(2).is_none());
    // The bench carries while one sits down, sits and gets up, and nothing else does.
    assert_eq!(
        (report.penetration.percent, report.body.scene.as_ref().map(|s| s.over_3_cm_percent)),
        (0.0, Some(0.0))
    );
    assert_eq!(report.action_from, report.steps[2].moments.action_from);

    let usual = database().accelerations;
    for seam in report.steps[1..].iter().map(|step| step.first_frame) {
        // Planted feet stay where they are, and no joint jumps, nor is any harder accelerated than nearly all of the library's are.
        for (foot, side) in Joint::TOES.into_iter().zip(0..2) {
            let at = |frame: usize| made.motion.postures[frame].pose().position(foot);
            let stands = (seam - 3..seam + 4).all(|frame| made.motion.contacts[frame][side] >= 1.0);
            assert!(!stands || at(seam - 3).distance(at(seam + 3)) < 0.004, "{foot:?} at {seam}");
        }
        for frame in seam - 2..seam + 4 {
            let [a, b, c] = [frame - 1, frame, frame + 1].map(|frame| places(&made.motion, frame));
            for joint in 0..a.len() {
                let acceleration = (a[joint] - 2.0 * b[joint] + c[joint]).length() * 900.0;
                let ratio = acceleration / usual[joint].max(1.0);
                assert!(ratio < 1.0, "{:?} at {frame} of seam {seam}: {ratio}", Joint::ALL[joint]);
            }
        }
    }
}

#[test]
fn who_gets_up_leans_draws_the_feet_back_and_leaves_the_seat_behind() {
    let made = played();
    let up = &made.report.steps[1];
    let stood = up.moments.stood_at.expect("a getting up");
    let pose = |frame: usize| made.motion.postures[frame].pose();
    let lean = |frame: usize| {
        let way = pose(frame).position(Joint::Neck) - pose(frame).position(Joint::Hips);
        way.truncate().length().atan2(way.z).to_degrees()
    };
    let most = (up.first_frame..stood).map(lean).fold(0.0, f32::max);
    assert!((30.0..70.0).contains(&most), "{most}");
    // Before the pelvis is lifted the ankles are under the knees or behind them.
    let lifts = (up.first_frame..stood)
        .find(|&f| pose(f).position(Joint::Hips).z > pose(up.first_frame).position(Joint::Hips).z + 0.03)
        .expect("the pelvis rises");
    for leg in [[Joint::LeftLeg, Joint::LeftFoot], [Joint::RightLeg, Joint::RightFoot]] {
        let [knee, ankle] = leg.map(|joint| pose(lifts).position(joint));
        // The bench is at +Y, and its people face -Y.
        assert!(ankle.y > knee.y - 0.03, "{knee} {ankle}");
    }
    assert!(pose(stood).position(Joint::Hips).z > 0.85);
}

#[test]
fn what_lies_before_a_moved_cue_stays_to_the_bit() {
    let made = played();
    let mut moved = performance();
    moved.steps[2].cue.position.x -= 0.10;
    let again = play(&moved, Some(made)).expect("a performance");
    let seam = again.report.steps[2].first_frame;
    assert_eq!(seam, made.report.steps[2].first_frame);
    assert!(again.motion.postures[..=seam] == made.motion.postures[..=seam]);
    assert!(again.motion.postures.last() != made.motion.postures.last());
    // As if nothing had been there before.
    assert!(again.motion == play(&moved, None).expect("a performance").motion);
    // A step that stays longer is another one; the one before it is the same.
    moved.steps[1].hold_seconds = Some(1.5);
    let longer = play(&moved, Some(&again)).expect("a performance");
    let second = longer.report.steps[1].first_frame;
    assert!(longer.motion.postures[..=second] == made.motion.postures[..=second]);
    let frames = |made: &Performed| made.report.steps[2].first_frame - made.report.steps[1].first_frame;
    assert!(frames(&longer) >= frames(made) + 40, "{} {}", frames(&longer), frames(made));
}

#[test]
fn what_was_made_along_another_manifold_is_made_anew() {
    let mut first = performance();
    first.steps.truncate(1);
    let along = |earlier: Option<&Performed>| {
        let (manifold, settings) = (shipped_manifold(), Settings::default());
        perform(manifold, &room(), database(), &first, earlier, None, &settings, 1, &Progress::new())
            .expect("a performance")
            .motion
    };
    let alone = along(None);
    assert!(alone != played().steps[0].made.motion, "the manifold makes a difference");
    assert!(along(Some(played())) == alone);
}

#[test]
fn one_seed_gives_one_motion_on_any_number_of_threads() {
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    let mut two_steps = performance();
    two_steps.steps.truncate(2);
    let alone = one.install(|| play(&two_steps, None)).expect("a performance");
    let end = alone.report.steps[1].first_frame;
    assert!(alone.motion.postures[..=end] == played().motion.postures[..=end]);
}

#[test]
fn a_step_that_fails_does_not_lose_the_others() {
    let mut fails = performance();
    // A rail behind the wall: no hand gets there, wherever the person stands.
    fails.steps[2].manipulations =
        vec![ManipulationCue { name: "Rail".into(), hand: Hand::Left, path: Vec::new(), first_frame: None }];
    let made = play(&fails, Some(played())).expect("what lies before");
    assert_eq!(made.report.steps.len(), 2);
    assert!(!made.report.success);
    let said = made.report.problems.join(" ");
    assert!(said.contains("‘Rail’") && said.contains("ends before ‘Right’"), "{said}");
    let end = made.motion.len() - 1;
    assert!(made.motion.postures[..=end] == played().motion.postures[..=end]);
}

#[test]
fn what_can_be_known_is_said_before_anything_is_played() {
    let said = |change: &dyn Fn(&mut Performance)| {
        let mut performance = performance();
        change(&mut performance);
        play(&performance, None).map_or_else(|error| error.to_string(), |_| String::new())
    };
    assert!(said(&|p| p.steps.clear()).contains("‘Start’ has no cue"));
    assert!(said(&|p| p.steps[2].cue.position.z = 1.3).contains("‘Right’ floats"));
    assert!(said(&|p| p.steps[1].cue.position = Vec3::new(0.0, 0.0, 0.0)).contains("‘Beside’ stands inside"));
    assert!(said(&|p| p.steps[1].hold_seconds = Some(-2.0)).contains("-2 seconds at cue ‘Beside’"));
    assert!(said(&|p| p.steps[0].hold_seconds = Some(f32::NAN)).contains("at cue ‘Left’"));
}
