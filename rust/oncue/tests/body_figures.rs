//! Real captures are all but free of what the figures call wrong: limbs in the own body, joints beyond their limits.
//!
//! Reads `$ONCUE_SHARED/data/mocap` (default `<repository>/../shared`); says so and passes where it is absent.

mod common;

use oncue::figures::{BodyFigures, body_figures};
use oncue::library::{Clip, LibrarySettings, StarterUse, build, starter};
use oncue::{MotionLibrary, Progress};

fn captured(set: &str) -> Option<MotionLibrary> {
    let folder = common::shared(&format!("data/mocap/{set}"))?;
    let settings = LibrarySettings { mirror: false, starter: StarterUse::None, ..LibrarySettings::default() };
    Some(build(&[folder], &settings, &Progress::new()).expect("a library").library)
}

fn of(clip: &Clip) -> BodyFigures {
    body_figures(&clip.motion, 0.0, None)
}

#[test]
fn captures_are_all_but_free() {
    let Some(library) = captured("accad") else { return };
    let all = library.body_figures();
    assert!(all.own_body.percent < 0.6, "{:?}", all.own_body);
    assert!(all.joint_limits.percent < 1.0, "{:?}", all.joint_limits);
    // Who walks, stands or turns touches nothing; who crouches and lifts boxes lays hand on hand and on thigh.
    let walks = |clip: &&Clip| {
        clip.name.contains("Walk") && !["Box", "Crouch", "Skip"].iter().any(|w| clip.name.contains(w))
    };
    let mut count = 0;
    for clip in library.clips.iter().filter(walks) {
        let figures = of(clip);
        assert_eq!(figures.own_body.percent, 0.0, "{}: {:?}", clip.name, figures.own_body);
        assert!(figures.own_body.touches.is_empty());
        count += 1;
    }
    assert!(count > 15, "{count}");
    // A library's figures are its clips', by their lengths.
    let clips: Vec<(f32, f32)> =
        library.clips.iter().map(|c| (c.motion.len() as f32, of(c).own_body.percent)).collect();
    let frames: f32 = clips.iter().map(|c| c.0).sum();
    let mean = clips.iter().map(|c| c.0 * c.1).sum::<f32>() / frames;
    assert!((mean - all.own_body.percent).abs() < 1e-3);
}

#[test]
fn captures_step_as_people_do() {
    let Some(library) = captured("accad") else { return };
    let feet = library.body_figures().feet;
    // Feet that people stand on flat stay where they are.
    assert!(feet.flat.stances > 300 && feet.flat.swivelled_percent < 1.0, "{feet:?}");
    assert!(feet.flat.heel_drift_cm.p90 < 2.0, "{feet:?}");
    let value = |v: Option<f32>| v.expect("steps");
    assert!(feet.steps.steps > 20 && value(feet.steps.heel_first_percent) > 80.0, "{feet:?}");
    assert!((8.0..20.0).contains(&value(feet.steps.toe_up_degrees)), "{feet:?}");
    assert!((30.0..60.0).contains(&value(feet.steps.heel_up_degrees)), "{feet:?}");
}

#[test]
fn the_starter_library_keeps_its_joints_within_their_limits() {
    let library = starter::generate(&Progress::new()).expect("the starter library");
    let figures = library.body_figures();
    assert!(figures.joint_limits.percent < 0.05, "{:?}", figures.joint_limits);
}
