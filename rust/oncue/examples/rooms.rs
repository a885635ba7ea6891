//! Runs the main job on the tasks of a `rooms.tsv` and prints a table; with `--out` also writes each motion
//! and report as JSON. At the end stands what an eye would see in all of them together (`body` in docs/report.md).
//!
//! `cargo run --release --example rooms -- FOLDER [--task ROOM[:N]]… [--library FILE_OR_FOLDER]… [--seed N]
//! [--settings JSON] [--out FOLDER]`

#[path = "../tests/common/mod.rs"]
mod common;

use std::path::PathBuf;
use std::time::Instant;

use oncue::MotionDatabase;
use oncue::library::LibrarySettings;
use oncue::report::Report;
use oncue::scene::SceneIndex;
use oncue::{MotionLibrary, Progress, Settings, synthesize};

type AnyError = Box<dyn std::error::Error>;

struct Arguments {
    folder: PathBuf,
    tasks: Vec<String>,
    library: Vec<PathBuf>,
    seed: u64,
    settings: Settings,
    out: Option<PathBuf>,
}

fn arguments() -> Result<Arguments, AnyError> {
    let mut words = std::env::args().skip(1);
    let folder = words.next().ok_or("the folder of rooms.tsv is missing")?.into();
    let mut a = Arguments {
        folder,
        tasks: Vec::new(),
        library: Vec::new(),
        seed: 1,
        settings: Settings::default(),
        out: None,
    };
    while let Some(word) = words.next() {
        let value = words.next().ok_or("an option lacks its value")?;
        match word.as_str() {
            "--task" => a.tasks.push(value),
            "--library" => a.library.push(value.into()),
            "--seed" => a.seed = value.parse()?,
            "--settings" => a.settings = serde_json::from_str(&value)?,
            "--out" => a.out = Some(value.into()),
            other => return Err(format!("unknown option {other}").into()),
        }
    }
    Ok(a)
}

fn main() -> Result<(), AnyError> {
    let a = arguments()?;
    let progress = Progress::new();
    let library = library(&a.library, &progress)?;
    let database = MotionDatabase::build(&library, &a.settings.synthesizer.weights, &progress)?;
    println!("library: {} clips, {} frames", library.clips.len(), library.frame_count());
    println!(
        "room:task                                seconds index updates  cm     deg  skate contact pen%  body%  path/shortest  kept"
    );
    let mut seen = Seen::default();
    let mut scene: Option<(String, SceneIndex)> = None;
    for row in common::rooms::read(&a.folder) {
        let name = format!("{}:{}", row.room, row.number);
        if !a.tasks.is_empty() && !a.tasks.iter().any(|t| *t == name || *t == row.room) {
            continue;
        }
        let lap = Instant::now();
        if scene.as_ref().is_none_or(|(room, _)| *room != row.room) {
            let mesh = common::glb::read(&a.folder.join(format!("{}.glb", row.room)));
            let index = SceneIndex::build(&mesh.positions, &mesh.triangles, &a.settings.scene, &progress)?;
            scene = Some((row.room.clone(), index));
        }
        let indexed = lap.elapsed().as_secs_f32();
        let Some((_, index)) = &scene else { continue };
        match synthesize(index, &database, &row.task, None, &a.settings, a.seed, &progress) {
            Err(error) => println!("{name:40} {error}"),
            Ok(done) => {
                let r = &done.report;
                seen.add(r);
                let c = &r.cues[0];
                println!(
                    "{name:40} {:6.1} {indexed:5.2} {:5} {:6.1} {:6.1} {:6.2} {:6.2} {:5.1} {:6.1} {:5.1}/{:4.1}  {}/{} {}",
                    lap.elapsed().as_secs_f32(),
                    r.updates,
                    c.pelvis_cm,
                    c.facing_degrees,
                    r.foot.skate_cm,
                    r.foot.contact_cm,
                    r.penetration.percent,
                    r.penetration.whole_body_percent,
                    r.path_m,
                    r.shortest_path_m,
                    r.rollouts_succeeded,
                    r.rollouts,
                    if r.penetration.parts_percent.is_empty() {
                        r.problems.join(" ")
                    } else {
                        format!("{:?} {}", r.penetration.parts_percent, r.problems.join(" "))
                    }
                );
                if let Some(out) = &a.out {
                    std::fs::create_dir_all(out)?;
                    let positions: Vec<_> = done.motion.postures.iter().map(|p| p.pose().positions).collect();
                    let json = serde_json::json!({
                        "name": name, "positions": positions, "contacts": done.motion.contacts,
                        "report": done.report, "cue": row.task.cue, "floor": row.task.start.position.z,
                    });
                    std::fs::write(out.join(format!("{}-{}.json", row.room, row.number)), json.to_string())?;
                }
            }
        }
    }
    seen.print();
    Ok(())
}

/// What an eye sees in the motions together.
#[derive(Default)]
struct Seen {
    motions: usize,
    successes: usize,
    /// Motions in which a limb is ever deeper than 1 cm in the own body.
    in_own_body: usize,
    /// Percent of the frames: own body, joints beyond their limits, body in the scene; summed over the motions.
    percent: [f32; 3],
    worst_scene: f32,
}

impl Seen {
    fn add(&mut self, report: &Report) {
        let body = &report.body;
        let scene = body.scene.as_ref().map_or(0.0, |s| s.over_1_cm_percent);
        self.motions += 1;
        self.successes += usize::from(report.success);
        self.in_own_body += usize::from(body.own_body.percent > 0.0);
        self.worst_scene = self.worst_scene.max(scene);
        let shown = [body.own_body.percent, body.joint_limits.percent, scene];
        self.percent.iter_mut().zip(shown).for_each(|(sum, percent)| *sum += percent);
    }

    fn print(&self) {
        let [own, joints, scene] = self.percent.map(|sum| sum / self.motions.max(1) as f32);
        println!(
            "{} motions, {} a success; a limb over 1 cm in the own body in {} of them, {own:.2} % of the frames; joints beyond \
             their limits {joints:.2} %; over 1 cm in the scene {scene:.2} %, worst {:.1} %",
            self.motions, self.successes, self.in_own_body, self.worst_scene
        );
    }
}

/// A library file is read as it is; anything else is built, the starter library filling in what it lacks.
fn library(paths: &[PathBuf], progress: &Progress) -> Result<MotionLibrary, AnyError> {
    if let [file] = paths
        && file.is_file()
        && file.extension().is_some_and(|e| e == "oncue")
    {
        return Ok(MotionLibrary::read(file)?);
    }
    Ok(oncue::library::build(paths, &LibrarySettings::default(), progress)?.library)
}
