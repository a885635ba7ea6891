//! Plays a tour of each room of a `rooms.tsv` as one performance: each seat in turn, by way of the next one's start; prints a table of
//! its steps and, with `--out`, writes each motion and report as JSON.
//!
//! `cargo run --release --example perform -- FOLDER [--room ROOM]… [--seats N] [--library FILE_OR_FOLDER]… [--seed N] [--out FOLDER]`

#[path = "../tests/common/mod.rs"]
mod common;

use std::path::PathBuf;
use std::time::Instant;

use oncue::library::LibrarySettings;
use oncue::scene::SceneIndex;
use oncue::{ActionCue, ActionType, MotionDatabase, Performance, Progress, Settings, Step, perform};

type AnyError = Box<dyn std::error::Error>;

fn main() -> Result<(), AnyError> {
    let mut words = std::env::args().skip(1);
    let folder: PathBuf = words.next().ok_or("the folder of rooms.tsv is missing")?.into();
    let (mut rooms, mut library, mut seats, mut seed, mut out) = (Vec::new(), Vec::new(), 99, 1, None);
    while let Some(word) = words.next() {
        let value = words.next().ok_or("an option lacks its value")?;
        match word.as_str() {
            "--room" => rooms.push(value),
            "--seats" => seats = value.parse()?,
            "--library" => library.push(PathBuf::from(value)),
            "--seed" => seed = value.parse()?,
            "--out" => out = Some(PathBuf::from(value)),
            other => return Err(format!("unknown option {other}").into()),
        }
    }
    let (progress, settings) = (Progress::new(), Settings::default());
    let library = oncue::library::build(&library, &LibrarySettings::default(), &progress)?.library;
    let database = MotionDatabase::build(&library, &settings.synthesizer.weights, &progress)?;
    let mut rows = common::rooms::read(&folder);
    rows.retain(|row| rooms.is_empty() || rooms.contains(&row.room));
    for room in rows.chunk_by(|a, b| a.room == b.room) {
        let name = &room[0].room;
        let mesh = common::glb::read(&folder.join(format!("{name}.glb")));
        let scene = SceneIndex::build(&mesh.positions, &mesh.triangles, &settings.scene, &progress)?;
        let mut steps = Vec::new();
        for (at, row) in room.iter().take(seats).enumerate() {
            if at > 0 {
                let (position, yaw) = (row.task.start.position, row.task.start.yaw);
                let name = format!("start {}", row.number);
                let cue = ActionCue { name, action_type: ActionType::Stop, position, yaw, feet: [None; 2] };
                steps.push(Step {
                    cue,
                    hold_seconds: None,
                    at_seconds: None,
                    passes: Vec::new(),
                    manipulations: Vec::new(),
                    things: Vec::new(),
                });
            }
            let cue =
                ActionCue { name: format!("{} {}", row.task.cue.name, row.number), ..row.task.cue.clone() };
            steps.push(Step {
                cue,
                hold_seconds: Some(2.0),
                at_seconds: None,
                passes: Vec::new(),
                manipulations: Vec::new(),
                things: Vec::new(),
            });
        }
        let performance = Performance {
            start: room[0].task.start.clone(),
            steps,
            things: Vec::new(),
            leaves: Vec::new(),
            looks: Vec::new(),
        };
        let begun = Instant::now();
        let made =
            match perform(None, &scene, &database, &performance, None, None, &settings, seed, &progress) {
                Ok(made) => made,
                Err(error) => {
                    println!("{name}: {error}");
                    continue;
                }
            };
        let seconds = made.motion.len() as f32 / 30.0;
        println!("{name}: {seconds:.0} s of motion in {:.1} s", begun.elapsed().as_secs_f32());
        let mut before = None;
        for ((step, told), cue) in made.steps.iter().zip(&made.report.steps).zip(&made.report.cues) {
            let motion = &step.made.motion;
            // How far a joint is from where the step before left it.
            let first = motion.postures[0].pose().positions;
            let seam = before.map_or(0.0, |last: [glam::Vec3; 22]| {
                last.iter().zip(&first).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max)
            });
            before = motion.postures.last().map(|p| p.pose().positions);
            println!(
                "  {:5} {:24} {:5.1} cm {:4.1}° {:?} {} updates, path {:.1}/{:.1} m, seam {:.2} cm",
                told.first_frame,
                told.cue,
                cue.pelvis_cm,
                cue.facing_degrees,
                told.moments,
                told.updates,
                told.path_m,
                told.shortest_path_m,
                100.0 * seam,
            );
        }
        let body = &made.report.body;
        println!(
            "  over 1 cm in the scene {:.2} %, in the own body {:.2} %, beyond joints {:.2} %, skate {:.2} cm",
            body.scene.as_ref().map_or(0.0, |s| s.over_1_cm_percent),
            body.own_body.percent,
            body.joint_limits.percent,
            made.report.foot.skate_cm,
        );
        println!("  {}", made.report.problems.join(" "));
        if let Some(out) = &out {
            std::fs::create_dir_all(out)?;
            let positions: Vec<_> = made.motion.postures.iter().map(|p| p.pose().positions).collect();
            let json = serde_json::json!({
                "name": name, "positions": positions, "contacts": made.motion.contacts, "report": made.report,
            });
            std::fs::write(out.join(format!("{name}.json")), json.to_string())?;
        }
    }
    Ok(())
}
