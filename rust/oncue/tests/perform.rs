//! Performances: cues that one person meets one after the other, without a seam, and what is kept where one cue cannot be met.

mod common;

use std::sync::OnceLock;

use glam::Vec3;
use oncue::MotionDatabase;
use oncue::editor::shipped_manifold;
use oncue::library::starter;
use oncue::motion::Joint;
use oncue::perform::check_performance;
use oncue::scene::SceneIndex;
use oncue::{
    ActionCue, ActionType, Error, Hand, InitialState, LookCue, ManipulationCue, Motion, Performance,
    Performed, Progress, Settings, Step, perform,
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
    Step {
        cue,
        hold_seconds,
        at_seconds: None,
        passes: Vec::new(),
        manipulations: Vec::new(),
        things: Vec::new(),
    }
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
        things: Vec::new(),
        leaves: Vec::new(),
        looks: Vec::new(),
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
    let stays = |made: &Performed| made.report.steps[2].first_frame - made.report.steps[1].moments.complete;
    assert!(stays(&longer) >= 45 && stays(made) < 20, "{} {}", stays(&longer), stays(made));
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

#[test]
fn a_chair_at_its_desk_is_left_by_the_side() {
    // A chair without a back, and a desk whose top is 10 cm before the seat.
    let (positions, triangles) = boxes(&[
        ([-2.5, -2.5, -0.1], [2.5, 2.5, 0.0]),
        ([-0.22, -0.2, 0.0], [0.22, 0.24, 0.45]),
        ([-0.8, -1.0, 0.70], [0.8, -0.30, 0.74]),
        ([-0.8, -1.0, 0.0], [0.8, -0.95, 0.70]),
    ]);
    let settings = Settings::default();
    let scene = SceneIndex::build(&positions, &triangles, &settings.scene, &Progress::new()).expect("a room");
    let asked = Performance {
        start: InitialState::standing("Start", Vec3::new(1.8, 1.2, 0.0), -0.9),
        steps: vec![
            step("Desk", ActionType::Sit, [0.0, 0.02, 0.55], 0.0, Some(1.0)),
            step("Away", ActionType::Stop, [-1.6, 1.4, 0.0], 2.5, None),
        ],
        things: Vec::new(),
        leaves: Vec::new(),
        looks: Vec::new(),
    };
    let made =
        perform(None, &scene, database(), &asked, None, None, &settings, 1, &Progress::new()).expect("made");
    assert!(made.report.success, "{:?}", made.report.problems);
    let [sits, goes] = &made.report.steps[..] else { panic!("two steps") };
    let stood = goes.moments.stood_at.expect("who sat gets up");
    // On the seat the person turns before rising: the pelvis is as low as it was, and faces aside by then.
    let motion = &made.motion;
    let (seat, turned) = (motion.postures[sits.moments.complete].root_position.z, |frame: usize| {
        motion.postures[frame].planar().yaw.abs().to_degrees()
    });
    let rises = (goes.first_frame..stood)
        .find(|&frame| motion.postures[frame].root_position.z > seat + 0.06)
        .expect("the pelvis rises");
    assert!(
        turned(goes.first_frame) < 5.0 && turned(rises) > 40.0,
        "{} {}",
        turned(goes.first_frame),
        turned(rises)
    );
    // Without a jump, and no harder than people.
    assert!(motion.postures.windows(2).all(|w| w[0].root_position.distance(w[1].root_position) < 0.08));
    assert!(made.report.speed.joint_ratio < 1.3, "{:?}", made.report.speed);
}

#[test]
fn a_look_is_laid_over_the_motion_and_changes_no_step() {
    let mut looking = performance();
    let lamp = Vec3::new(2.2, -0.6, 1.4);
    looking.looks.push(LookCue { name: "Lamp".into(), path: vec![lamp], after: 2, hold_seconds: None });
    let made = play(&looking, Some(played())).expect("a performance");
    let told = &made.report.looks[0];
    let met: Vec<usize> = made.report.steps.iter().map(|step| step.moments.complete).collect();
    assert_eq!((told.first, told.end), (met[1], met[2]));
    assert_eq!(told.met + told.turning + told.behind + told.held, told.end - told.first);
    assert!(told.met > 30, "{told:?}");
    let (plain, looks) = (&played().motion, &made.motion);
    assert_eq!((plain.len(), &plain.contacts), (looks.len(), &looks.contacts));
    assert_eq!(plain.postures[..=told.first], looks.postures[..=told.first]);
    for (one, other) in plain.postures.iter().zip(&looks.postures) {
        assert_eq!(one.root_position, other.root_position);
        let (one, other) = (one.pose(), other.pose());
        for joint in [Joint::LeftToe, Joint::RightToe, Joint::LeftHand, Joint::RightHand] {
            assert!(one.position(joint).distance(other.position(joint)) < 0.02, "{joint:?}");
        }
    }
    assert_ne!(plain.postures, looks.postures);
    // Nothing that cannot be is looked at.
    looking.looks[0].after = 9;
    let refused = play(&looking, None).expect_err("there are three cues");
    assert!(refused.to_string().contains("‘Lamp’ cannot be looked at"), "{refused}");
}

/// The performance with its cues to be met so many seconds later than they are by themselves.
fn later(times: &[(usize, f32)]) -> Performance {
    let mut timed = performance();
    for (step, seconds) in times {
        let met = played().report.steps[*step].moments.complete as f32 / 30.0;
        timed.steps[*step].at_seconds = Some(met + seconds);
    }
    timed
}

fn in_time(times: &[(usize, f32)]) -> Performed {
    play(&later(times), Some(played())).expect("a performance")
}

/// Farthest that a planted foot gets in a frame, metres.
fn slides(motion: &Motion) -> f32 {
    let frames = (1..motion.len()).flat_map(|frame| [0, 1].map(|side| (frame, side)));
    let stands = |frame: usize, side: usize| motion.contacts[frame][side] >= 1.0;
    let planted = frames.filter(|&(frame, side)| stands(frame, side) && stands(frame - 1, side));
    let place = |frame: usize, side: usize| motion.postures[frame].pose().position(Joint::TOES[side]);
    planted.map(|(frame, side)| place(frame, side).distance(place(frame - 1, side))).fold(0.0, f32::max)
}

#[test]
fn a_cue_is_met_at_its_time_by_who_hurries_dawdles_or_waits() {
    let free = played();
    let usual = slides(&free.motion);
    for seconds in [-0.4, 0.0, 0.2, 1.0, 3.0, 7.3] {
        for step in 0..3 {
            let made = in_time(&[(step, seconds)]);
            let (report, told) = (&made.report, &made.report.steps[step]);
            assert!(report.success, "{seconds} at {step}: {:?}", report.problems);
            let late = told.late_s.expect("a time");
            assert!(late.abs() <= 0.017, "{seconds} at {step}: {late}");
            assert_eq!(told.moments.complete, told.asked_frame.expect("a time"));
            // Who has little time left over walks slower, who has much waits, and nobody does both.
            assert!(told.waits_s == 0.0 || told.dawdles_s == 0.0, "{told:?}");
            assert!(if seconds < 0.3 { told.waits_s == 0.0 } else { seconds < 2.0 || told.dawdles_s == 0.0 });
            assert!((told.waits_s + told.dawdles_s - seconds).abs() < 0.018, "{told:?}");
            // All cues are met as they were, and what follows is the same, later.
            for (cue, before) in report.cues.iter().zip(&free.report.cues) {
                assert!((cue.pelvis_cm - before.pelvis_cm).abs() < 1e-3 && cue.met);
            }
            let [begins, end] =
                [&free.report.steps[step].first_frame, &free.report.steps[step].moments.complete];
            assert!(made.motion.postures[..*begins] == free.motion.postures[..*begins]);
            assert!(made.motion.postures[told.moments.complete..] == free.motion.postures[*end..]);
            // Feet stand, joints turn no faster than the library's, and nobody jumps.
            assert!(slides(&made.motion) < usual + 2e-4, "{} {usual}", slides(&made.motion));
            assert!(report.speed.joint_ratio <= 1.25, "{:?}", report.speed);
            for frame in 1..made.motion.len() {
                let [before, now] = [frame - 1, frame].map(|frame| places(&made.motion, frame));
                let most = before.iter().zip(&now).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max);
                assert!(most < 0.2, "{most} m at {frame}");
            }
        }
    }
}

#[test]
fn where_a_wait_begins_and_ends_no_seam_is_seen() {
    let usual = database().accelerations;
    for step in 0..3 {
        let made = in_time(&[(step, 4.0)]);
        let told = &made.report.steps[step];
        let sets_off = told.first_frame + (told.waits_s * 30.0).round() as usize;
        assert!(told.waits_s > 3.9);
        for frame in
            [told.first_frame, sets_off].into_iter().flat_map(|at| at.saturating_sub(2).max(1)..at + 4)
        {
            let [a, b, c] = [frame - 1, frame, frame + 1].map(|frame| places(&made.motion, frame));
            for joint in 0..a.len() {
                let ratio = (a[joint] - 2.0 * b[joint] + c[joint]).length() * 900.0 / usual[joint].max(1.0);
                assert!(ratio < 1.0, "{:?} at {frame} of {sets_off}: {ratio}", Joint::ALL[joint]);
            }
        }
        // Meanwhile the person lives, on feet that stay.
        let moved = |joint: Joint| {
            let place = |frame: usize| made.motion.postures[frame].pose().position(joint);
            let first = place(told.first_frame);
            (told.first_frame..=sets_off).map(|frame| place(frame).distance(first)).fold(0.0, f32::max)
        };
        assert!(moved(Joint::Head) > 0.003 && Joint::TOES.iter().all(|toe| moved(*toe) < 0.003));
    }
}

#[test]
fn a_time_changes_nothing_but_when() {
    let several = later(&[(0, 2.0), (1, 2.5), (2, 8.0)]);
    let made = play(&several, Some(played())).expect("a performance");
    assert!(made.report.success, "{:?}", made.report.problems);
    assert!(made.motion == play(&several, None).expect("a performance").motion);
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    assert!(made.motion == one.install(|| play(&several, Some(played()))).expect("a performance").motion);
    // Without times it is what it was.
    assert!(play(&performance(), Some(&made)).expect("a performance").motion == played().motion);
    // Another time for the last cue leaves all before it.
    let again = play(&later(&[(0, 2.0), (1, 2.5), (2, 9.0)]), Some(&made)).expect("a performance");
    let seam = made.report.steps[2].first_frame;
    assert!(again.motion.postures[..=seam] == made.motion.postures[..=seam]);
    assert_eq!(again.report.steps[2].moments.complete, made.report.steps[2].moments.complete + 30);
}

#[test]
fn who_cannot_be_there_in_time_hurries_and_it_is_told() {
    let free = &played().report.steps[0];
    let made = in_time(&[(0, -3.0)]);
    let told = &made.report.steps[0];
    let (met, asked) = (told.moments.complete, told.asked_frame.expect("a time"));
    assert!(met < free.moments.complete && met > asked + 1, "{met} {asked}");
    assert!((told.late_s.expect("a time") - (met - asked) as f32 / 30.0).abs() < 0.02);
    assert!(made.report.cues.iter().all(|cue| cue.met) && !made.report.success);
    let late = (met - asked) as f32 / 30.0;
    let said = format!("‘Left’ is reached on frame {met}, {late:.1} s after frame {asked}");
    assert!(made.report.problems.iter().any(|problem| problem.contains(&said)), "{:?}", made.report.problems);
    // Nobody walks faster than people do.
    let root = |frame: usize| made.motion.postures[frame].root_position.truncate();
    let stride = (0..met - 30).map(|frame| root(frame).distance(root(frame + 30)));
    assert!(stride.fold(0.0, f32::max) < 1.6);
}

#[test]
fn times_that_cannot_be_kept_are_named_before_anything_is_played() {
    let said = |times: &[(usize, f32)]| {
        let mut timed = performance();
        times.iter().for_each(|(step, at)| timed.steps[*step].at_seconds = Some(*at));
        check_performance(&room(), &timed).map_or_else(|error| error.to_string(), |()| String::new())
    };
    assert_eq!(said(&[(0, 9.0), (2, 30.0)]), "");
    let backwards = said(&[(0, 9.0), (2, 8.0)]);
    assert!(backwards.contains("‘Right’ is asked for on frame 240, no later than ‘Left’"), "{backwards}");
    assert!(said(&[(0, 0.0)]).contains("‘Left’ is asked for on frame 0, no later than ‘Start’"));
    for wrong in [-1.0, f32::NAN, f32::INFINITY, 4000.0] {
        assert!(said(&[(0, wrong)]).contains("‘Left’ is asked for after"), "{wrong}");
    }
    // Four metres and the stay of a second are not gone in two seconds.
    let soon = said(&[(0, 9.0), (1, 11.0)]);
    assert!(soon.contains("‘Beside’ cannot be reached by frame 330") && soon.contains("‘Left’"), "{soon}");
}

/// A knob 30 cm before the left shoulder of who stands beside the table, which is pushed on by 20 cm.
fn knob(first_frame: Option<usize>) -> ManipulationCue {
    let beside = performance().steps[1].cue.planar();
    let at = |ahead: f32| beside.point_to_world(glam::Vec2::new(0.15, -ahead)).extend(1.1);
    let path = (0..40).map(|frame| at(0.35 + 0.005 * frame as f32)).collect();
    ManipulationCue { name: "Knob".into(), hand: Hand::Left, path, first_frame }
}

/// The performance with the knob pushed beside the table, and the frame on which that begins.
fn pushed(first_frame: Option<usize>, at_seconds: Option<f32>) -> (Performed, usize) {
    let mut hands = performance();
    hands.steps[1].manipulations = vec![knob(first_frame)];
    hands.steps[1].at_seconds = at_seconds;
    let made = play(&hands, Some(played())).expect("a performance");
    let edited = made.report.edited.as_ref().expect("hands at work");
    assert!(made.report.success, "{:?}", made.report.problems);
    let first = edited.manipulations[0].first_frame;
    let palm = oncue::motion::skeleton::palm(Joint::LeftHand);
    for (frame, place) in knob(None).path.iter().enumerate() {
        let miss = made.motion.postures[first + frame].pose().point(Joint::LeftHand, palm).distance(*place);
        assert!(miss < 0.005, "{miss} at {frame}");
    }
    assert!(edited.constraints[0].met && edited.constraints[0].name == "Knob");
    (made, first)
}

#[test]
fn a_hand_follows_its_path_at_a_step_and_the_person_stays_for_it() {
    let free = played();
    let (made, first) = pushed(None, None);
    let [before, after] = [free, &made].map(|made| &made.report.steps);
    let met = after[1].moments.complete;
    assert!(first > met && met == before[1].moments.complete);
    // What lies before, and what follows, is what it was to the bit.
    assert!(made.motion.postures[..met] == free.motion.postures[..met]);
    let [was, is] = [before[2].first_frame, after[2].first_frame];
    assert!(is > first + 40 + 15 && is - was == made.motion.len() - free.motion.len());
    let other = (is + 1..made.motion.len())
        .find(|&frame| made.motion.postures[frame] != free.motion.postures[frame - is + was]);
    assert_eq!(other, None, "from {is}, hands from {first}");
    assert_eq!(after[2].moments, before[2].moments.each(|frame| frame + is - was));
    // Feet that stand stay, and nothing jumps where the longer stay begins and ends.
    assert!(slides(&made.motion) < slides(&free.motion) + 2e-4, "{}", slides(&made.motion));
    for seam in [was, is] {
        for frame in seam - 2..seam + 4 {
            let [a, b, c] = [frame - 1, frame, frame + 1].map(|frame| places(&made.motion, frame));
            for (joint, usual) in database().accelerations.iter().enumerate() {
                let ratio = (a[joint] - 2.0 * b[joint] + c[joint]).length() * 900.0 / usual.max(1.0);
                assert!(ratio < 1.0, "{:?} at {frame} of seam {seam}: {ratio}", Joint::ALL[joint]);
            }
        }
    }
}

#[test]
fn a_path_with_frames_of_its_own_is_waited_for() {
    let free = played();
    let met = free.report.steps[1].moments.complete;
    let (made, first) = pushed(Some(met + 200), None);
    assert_eq!(first, met + 200);
    assert!(made.report.steps[2].first_frame > met + 240);
    // Whoever comes later waits less.
    let (timed, first) = pushed(Some(met + 200), Some((met + 120) as f32 / 30.0));
    assert_eq!((first, timed.report.steps[1].moments.complete), (met + 200, met + 120));
    assert_eq!(timed.report.steps[2].first_frame, made.report.steps[2].first_frame);
    // At the last cue as well.
    let mut last = performance();
    last.steps.truncate(2);
    last.steps[1].manipulations = vec![knob(Some(met + 300))];
    let made = play(&last, Some(free)).expect("a performance");
    assert!(made.report.success && made.motion.len() > met + 340, "{:?}", made.report.problems);
}

#[test]
fn hands_that_cannot_follow_leave_the_motion_and_are_told() {
    let free = played();
    let met = free.report.steps[1].moments.complete;
    let said = |cue: ManipulationCue| {
        let mut hands = performance();
        hands.steps[1].manipulations = vec![cue];
        let made = play(&hands, Some(free)).expect("a performance");
        assert!(!made.report.success && made.report.steps.len() == 3);
        assert!(made.motion.postures[..met] == free.motion.postures[..met]);
        made.report.problems.join(" ")
    };
    let early = said(knob(Some(met - 150)));
    assert!(
        early.contains("‘Knob’ is out of reach on frame") && early.contains("‘Start’ is at ‘Beside’"),
        "{early}"
    );
    let late = said(knob(Some(met + 3700)));
    assert!(late.contains("123 s after ‘Start’ is at ‘Beside’") && late.contains("120 s"), "{late}");
}
