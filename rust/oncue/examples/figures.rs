//! Prints what an eye sees first in nine motions, beside the same figures of the library they are made of.
//!
//! `cargo run --release --example figures [-- FOLDER_OR_FILE …]`: of the starter library, or of one built from captures.

#[path = "../tests/common/boxes.rs"]
mod boxes;
#[path = "common/feet_row.rs"]
mod feet_row;
#[path = "common/nine.rs"]
mod nine;

use feet_row::feet_row;
use std::path::PathBuf;

use oncue::figures::{BodyFigures, Surroundings, body_figures, pose_distance_figures};
use oncue::library::{LibrarySettings, StarterUse, build, starter};
use oncue::scene::SceneIndex;
use oncue::seats::Seats;
use oncue::{MotionDatabase, Progress, synthesize};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let progress = Progress::new();
    let paths: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    let library = if paths.is_empty() {
        starter::generate(&progress)?
    } else {
        let settings = LibrarySettings { starter: StarterUse::Missing, ..LibrarySettings::default() };
        build(&paths, &settings, &progress)?.library
    };
    println!("{HEAD}");
    println!("{}", row("the library", &library.body_figures()));
    if !paths.is_empty() {
        let mut captured = library.clone();
        captured.clips.retain(|clip| clip.source == oncue::library::Source::Mocap);
        println!("{}", row("its captures", &captured.body_figures()));
        for clip in captured.clips.iter().filter(|clip| !clip.mirrored) {
            let figures = body_figures(&clip.motion, 0.0, None);
            tell(&clip.name, &figures);
        }
    }
    let mut milliseconds = Vec::new();
    for case in nine::cases()? {
        let (positions, triangles) = boxes::boxes(case.room);
        let scene = SceneIndex::build(&positions, &triangles, &case.settings.scene, &progress)?;
        let database = MotionDatabase::build(&library, &case.settings.synthesizer.weights, &progress)?;
        match synthesize(&scene, &database, &case.task, None, &case.settings, case.seed, &progress) {
            Ok(done) => {
                println!("{}", row(case.name, &done.report.body));
                let surroundings =
                    Surroundings { scene: &scene, moving: &[], ignore_below: 0.1, seats: Seats::default() };
                let known = database.known_poses();
                let took = |measure: &dyn Fn()| {
                    let begun = std::time::Instant::now();
                    measure();
                    begun.elapsed().as_secs_f32() * 1e3
                };
                let least = |measure: &dyn Fn()| (0..10).map(|_| took(measure)).fold(f32::INFINITY, f32::min);
                milliseconds.push([
                    least(&|| drop(body_figures(&done.motion, 0.0, Some(&surroundings)))),
                    least(&|| drop(pose_distance_figures(&done.motion, known, Some(&scene)))),
                ]);
                tell(case.name, &done.report.body);
            }
            Err(error) => println!("{error} · {}", case.name),
        }
    }
    println!(
        "measured in ms, of these frames of the library: {}; body, pose distance: {milliseconds:.1?}",
        library.frame_count()
    );
    Ok(())
}

const HEAD: &str = "own >1cm %  cm | joints % ° | flat: n heel cm (p90) ball swivel° >15° % | steps heel1st% toe-up° clear cm heel-up° | scene >1 >3 % cm";

fn row(name: &str, figures: &BodyFigures) -> String {
    let (own, joints) = (&figures.own_body, &figures.joint_limits);
    let scene = figures.scene.as_ref().map_or("–".to_owned(), |s| {
        format!("{:.1} {:.1} {:.1}", s.over_1_cm_percent, s.over_3_cm_percent, s.deepest_cm)
    });
    format!(
        "{:4.1} {:4.1} | {:4.1} {:4.1} | {} | {scene} · {name}",
        own.percent,
        own.deepest_cm,
        joints.percent,
        joints.worst_degrees,
        feet_row(&figures.feet),
    )
}

/// The worst of each kind, with its frames.
fn tell(name: &str, figures: &BodyFigures) {
    for touch in figures.own_body.touches.iter().take(2) {
        println!("     {:?} {}..{} {:.1} cm · {name}", touch.parts, touch.first, touch.end, touch.depth_cm);
    }
    for beyond in figures.joint_limits.beyond.iter().take(2) {
        let (joint, turn) = (beyond.joint, beyond.turn);
        println!("     {joint:?} {turn:?} {}..{} {:.0}° · {name}", beyond.first, beyond.end, beyond.degrees);
    }
    for touch in figures.scene.iter().flat_map(|scene| scene.touches.iter().take(2)) {
        println!(
            "     {:?} in the scene {}..{} {:.1} cm at {:.2?} · {name}",
            touch.part, touch.first, touch.end, touch.depth_cm, touch.place
        );
    }
}
