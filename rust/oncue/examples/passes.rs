//! Plays walks through waypoints in the rooms of a `rooms.tsv`, and each of them without its waypoints; prints a table and what the two
//! kinds have of what an eye sees. With `--out` it writes each motion and report as JSON.
//!
//! `cargo run --release --example passes -- FOLDER [--room ROOM]… [--walks N] [--library FILE_OR_FOLDER]… [--seed N] [--plain yes|no]
//! [--out FOLDER]`

#[path = "../tests/common/mod.rs"]
mod common;

use std::path::PathBuf;
use std::time::Instant;

use oncue::library::LibrarySettings;
use oncue::report::Report;
use oncue::scene::SceneIndex;
use oncue::{CueKind, Motion, MotionDatabase, Progress, Settings, Task, synthesize};

type AnyError = Box<dyn std::error::Error>;

fn main() -> Result<(), AnyError> {
    let mut words = std::env::args().skip(1);
    let folder: PathBuf = words.next().ok_or("the folder of rooms.tsv is missing")?.into();
    let (mut rooms, mut library, mut walks, mut seed, mut plain) = (Vec::new(), Vec::new(), 3, 1, true);
    let mut out = None;
    while let Some(word) = words.next() {
        let value = words.next().ok_or("an option lacks its value")?;
        match word.as_str() {
            "--room" => rooms.push(value),
            "--walks" => walks = value.parse()?,
            "--library" => library.push(PathBuf::from(value)),
            "--seed" => seed = value.parse()?,
            "--plain" => plain = value == "yes",
            "--out" => out = Some(PathBuf::from(value)),
            other => return Err(format!("unknown option {other}").into()),
        }
    }
    let (progress, settings) = (Progress::new(), Settings::default());
    let library = oncue::library::build(&library, &LibrarySettings::default(), &progress)?.library;
    let database = MotionDatabase::build(&library, &settings.synthesizer.weights, &progress)?;
    let mut rows = common::rooms::read(&folder);
    rows.retain(|row| rooms.is_empty() || rooms.contains(&row.room));
    let (mut through, mut straight) = (Seen::default(), Seen::default());
    for room in rows.chunk_by(|a, b| a.room == b.room) {
        let name = &room[0].room;
        let mesh = common::glb::read(&folder.join(format!("{name}.glb")));
        let scene = SceneIndex::build(&mesh.positions, &mesh.triangles, &settings.scene, &progress)?;
        for (at, task) in common::walks::walks(room, &scene, walks).into_iter().enumerate() {
            let without = Task { passes: Vec::new(), ..task.clone() };
            let tasks = [(&task, &mut through), (&without, &mut straight)];
            for (task, seen) in tasks.into_iter().take(if plain { 2 } else { 1 }) {
                let begun = Instant::now();
                let name = format!("{name}:{at}{}", if task.passes.is_empty() { " without" } else { "" });
                match synthesize(&scene, &database, task, None, &settings, seed, &progress) {
                    Err(error) => println!("{name:44} {error}"),
                    Ok(made) => {
                        seen.add(&made.report);
                        row(&name, &made.motion, &made.report, begun);
                        if let Some(out) = &out {
                            std::fs::create_dir_all(out)?;
                            let positions: Vec<_> =
                                made.motion.postures.iter().map(|p| p.pose().positions).collect();
                            let json = serde_json::json!({
                                "name": name, "positions": positions, "report": made.report, "task": task,
                            });
                            let file = name.replace([':', ' '], "-");
                            std::fs::write(out.join(format!("{file}.json")), json.to_string())?;
                        }
                    }
                }
            }
        }
    }
    through.print("with waypoints");
    straight.print("without");
    Ok(())
}

/// One line for a walk: how near each waypoint, and the slowest pace about it, m/s.
fn row(name: &str, motion: &Motion, report: &Report, begun: Instant) {
    let passes: Vec<String> = report
        .cues
        .iter()
        .filter(|cue| cue.action_type == CueKind::Pass)
        .map(|cue| format!("{:.0} cm at {:.2} m/s", cue.pelvis_cm, slowest(motion, cue.frame)))
        .collect();
    let cue = &report.cues[report.cues.len() - 1];
    println!(
        "{name:44} {:5.1} s {:2} updates, passed {}; {:.1} cm {:.1}°, path {:.1}/{:.1} m, skate {:.2}  {}",
        begun.elapsed().as_secs_f32(),
        report.updates,
        passes.join(", "),
        cue.pelvis_cm,
        cue.facing_degrees,
        report.path_m,
        report.shortest_path_m,
        report.foot.skate_cm,
        report.problems.join(" ")
    );
}

/// The slowest mean pace of a third of a second within two thirds about a frame, m/s.
fn slowest(motion: &Motion, frame: usize) -> f32 {
    let root = |frame: usize| motion.postures[frame].root_position.truncate();
    let (first, last) = (frame.saturating_sub(20), (frame + 20).min(motion.len() - 1));
    (first..last.saturating_sub(10))
        .map(|from| 3.0 * root(from).distance(root(from + 10)))
        .fold(f32::INFINITY, f32::min)
}

/// What an eye sees in the motions together.
#[derive(Default)]
struct Seen {
    motions: usize,
    successes: usize,
    waypoints: usize,
    passed: usize,
    /// Skate, cm; percent of the frames in the own body, beyond joints and in the scene: summed over the motions.
    figures: [f32; 4],
}

impl Seen {
    fn add(&mut self, report: &Report) {
        let body = &report.body;
        let passes = report.cues.iter().filter(|cue| cue.action_type == CueKind::Pass);
        self.motions += 1;
        self.successes += usize::from(report.success);
        self.waypoints += passes.clone().count();
        self.passed += passes.filter(|cue| cue.met).count();
        let scene = body.scene.as_ref().map_or(0.0, |s| s.over_1_cm_percent);
        let figures = [report.foot.skate_cm, body.own_body.percent, body.joint_limits.percent, scene];
        self.figures.iter_mut().zip(figures).for_each(|(sum, figure)| *sum += figure);
    }

    fn print(&self, which: &str) {
        let [skate, own, joints, scene] = self.figures.map(|sum| sum / self.motions.max(1) as f32);
        println!(
            "{which}: {} walks, {} a success, {}/{} waypoints passed; skate {skate:.3} cm, in the own body {own:.2} % of the frames, \
             beyond joints {joints:.2} %, over 1 cm in the scene {scene:.2} %",
            self.motions, self.successes, self.passed, self.waypoints
        );
    }
}
