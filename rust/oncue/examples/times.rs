//! Asks for the cues of a `rooms.tsv` at times: each as it comes, then a fifth sooner, a fifth later and five seconds later; prints a
//! table of how late each is and how it got there.
//!
//! `cargo run --release --example times -- FOLDER [--room ROOM]… [--tasks N] [--library FILE_OR_FOLDER]… [--seed N]`; `--tasks`: of each room.

#[path = "../tests/common/mod.rs"]
mod common;

use std::path::PathBuf;

use oncue::library::LibrarySettings;
use oncue::scene::SceneIndex;
use oncue::{MotionDatabase, Performance, Performed, Progress, Settings, Step, perform};

type AnyError = Box<dyn std::error::Error>;

fn main() -> Result<(), AnyError> {
    let mut words = std::env::args().skip(1);
    let folder: PathBuf = words.next().ok_or("the folder of rooms.tsv is missing")?.into();
    let (mut rooms, mut library, mut tasks, mut seed) = (Vec::new(), Vec::new(), usize::MAX, 1);
    while let Some(word) = words.next() {
        let value = words.next().ok_or("an option lacks its value")?;
        match word.as_str() {
            "--room" => rooms.push(value),
            "--tasks" => tasks = value.parse()?,
            "--library" => library.push(PathBuf::from(value)),
            "--seed" => seed = value.parse()?,
            other => return Err(format!("unknown option {other}").into()),
        }
    }
    let (progress, settings) = (Progress::new(), Settings::default());
    let library = oncue::library::build(&library, &LibrarySettings::default(), &progress)?.library;
    let database = MotionDatabase::build(&library, &settings.synthesizer.weights, &progress)?;
    println!(
        "| task | asked | met, s | late, s | waits, s | dawdles, s | walking, m/s | skate, cm | joints | hardest | success |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|");
    let mut rows = common::rooms::read(&folder);
    rows.retain(|row| rooms.is_empty() || rooms.contains(&row.room));
    for row in rows.chunk_by(|a, b| a.room == b.room).flat_map(|room| room.iter().take(tasks)) {
        let mesh = common::glb::read(&folder.join(format!("{}.glb", row.room)));
        let places = [row.task.start.position, row.task.cue.position];
        let scene =
            SceneIndex::build_for(&mesh.positions, &mesh.triangles, &settings.scene, &places, &progress)?;
        let play = |at_seconds: Option<f32>, earlier: Option<&Performed>| {
            let passes = Vec::new();
            let step = Step {
                passes,
                cue: row.task.cue.clone(),
                hold_seconds: None,
                at_seconds,
                manipulations: Vec::new(),
                things: Vec::new(),
            };
            let performance = Performance {
                start: row.task.start.clone(),
                steps: vec![step],
                things: Vec::new(),
                leaves: Vec::new(),
                looks: Vec::new(),
            };
            perform(None, &scene, &database, &performance, earlier, None, &settings, seed, &progress)
        };
        let free = match play(None, None) {
            Ok(free) => free,
            Err(error) => {
                println!("| {} {} | {error} |", row.room, row.number);
                continue;
            }
        };
        let name = format!("{} {}", row.room, row.number);
        tell(&name, "—", &free);
        let met = free.report.steps[0].moments.complete as f32 / 30.0;
        for (said, at) in [("−20 %", 0.8 * met), ("+20 %", 1.2 * met), ("+5 s", met + 5.0)] {
            match play(Some(at), Some(&free)) {
                Ok(made) => tell(&name, said, &made),
                Err(error) => println!("| {name} | {said} | {error} |"),
            }
        }
    }
    Ok(())
}

fn tell(name: &str, asked: &str, made: &Performed) {
    let (report, step) = (&made.report, &made.report.steps[0]);
    println!(
        "| {name} | {asked} | {:.2} | {} | {:.2} | {:.2} | {:.2} | {:.2} | {:.2} | {:.2} | {} |",
        step.moments.complete as f32 / 30.0,
        step.late_s.map_or("—".to_owned(), |late| format!("{late:.2}")),
        step.waits_s,
        step.dawdles_s,
        report.speed.walking,
        report.foot.skate_cm,
        report.speed.joint_ratio,
        report.speed.acceleration_ratio,
        if report.success { "yes".to_owned() } else { report.problems.join(" ") },
    );
}
