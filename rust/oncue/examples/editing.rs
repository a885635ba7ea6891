//! Seat fits over the rooms of a `rooms.tsv` and manipulations of the objects of an `objects.tsv`, with and without the
//! manifold, beside plain inverse kinematics; prints the tables.
//!
//! `cargo run --release --example editing -- --shared FOLDER [--motions CACHE] [--out FOLDER] [--only seats|hands]
//! [--manifold FILE]`

#[path = "../tests/common/mod.rs"]
mod common;

use std::path::{Path, PathBuf};

use std::time::Instant;

use glam::Vec2;
use oncue::editor::latent::manifold_distance;
use oncue::editor::manipulation::{Manipulated, lengthened, manipulate};
use oncue::editor::plain_ik::plain_ik;
use oncue::editor::seat::Seat;
use oncue::editor::smoothness::smoothness;
use oncue::editor::{ConstraintFigures, Manifold};
use oncue::library::database::MotionDatabase;
use oncue::metrics::{foot_figures, penetration_figures};
use oncue::scene::SceneIndex;
use oncue::settings::EditorSettings;
use oncue::{Motion, MotionLibrary, Progress, Settings, synthesize};

#[path = "editing/objects.rs"]
mod objects;

type AnyError = Box<dyn std::error::Error>;

struct Arguments {
    shared: PathBuf,
    motions: Option<PathBuf>,
    out: Option<PathBuf>,
    only: Option<String>,
    /// Another manifold than the one that ships.
    manifold: Option<PathBuf>,
}

fn arguments() -> Result<Arguments, AnyError> {
    let mut a =
        Arguments { shared: "../shared".into(), motions: None, out: None, only: None, manifold: None };
    let mut words = std::env::args().skip(1);
    while let Some(word) = words.next() {
        let value = words.next().ok_or("an option lacks its value")?;
        match word.as_str() {
            "--shared" => a.shared = value.into(),
            "--motions" => a.motions = Some(value.into()),
            "--out" => a.out = Some(value.into()),
            "--only" => a.only = Some(value),
            "--manifold" => a.manifold = Some(value.into()),
            other => return Err(format!("unknown option {other}").into()),
        }
    }
    Ok(a)
}

/// The controller's motion of a task, from the cache where it is there; with the frame at which it is complete.
fn controllers_motion(
    cache: Option<&Path>,
    name: &str,
    make: impl FnOnce() -> Result<(Motion, usize), AnyError>,
) -> Result<(Motion, usize), AnyError> {
    let file = cache.map(|folder| folder.join(format!("{name}.json")));
    if let Some(text) = file.as_ref().and_then(|f| std::fs::read_to_string(f).ok()) {
        return Ok(serde_json::from_str(&text)?);
    }
    let made = make()?;
    if let Some(file) = file {
        std::fs::create_dir_all(file.parent().ok_or("the cache has no folder")?)?;
        std::fs::write(file, serde_json::to_string(&made)?)?;
    }
    Ok(made)
}

fn main() -> Result<(), AnyError> {
    let a = arguments()?;
    let progress = Progress::new();
    let library = oncue::library::starter::generate(&progress)?;
    let settings = Settings::default();
    let run = Run {
        database: MotionDatabase::build(&library, &settings.synthesizer.weights, &progress)?,
        progress,
        library,
        settings: Settings {
            editor: EditorSettings { fit: false, ..Default::default() },
            ..Default::default()
        },
        manifold: a.manifold.as_deref().map(Manifold::read).transpose()?,
        arguments: a,
    };
    let only = run.arguments.only.clone();
    if only.as_deref() != Some("hands") {
        run.seats()?;
    }
    if only.as_deref() != Some("seats") {
        run.hands()?;
    }
    Ok(())
}

struct Run {
    arguments: Arguments,
    progress: Progress,
    library: MotionLibrary,
    database: MotionDatabase,
    settings: Settings,
    manifold: Option<Manifold>,
}

/// Mean and largest of a column.
#[derive(Default)]
struct Column(Vec<f32>);

impl Column {
    fn text(&self) -> String {
        if self.0.is_empty() {
            return "–".into();
        }
        let mean = self.0.iter().sum::<f32>() / self.0.len() as f32;
        let mut sorted = self.0.clone();
        sorted.sort_by(f32::total_cmp);
        format!("mean {mean:.2} median {:.2} max {:.2}", sorted[sorted.len() / 2], sorted[sorted.len() - 1])
    }
}

impl Run {
    /// Every seat of the rooms: as the controller leaves it, and fitted.
    fn seats(&self) -> Result<(), AnyError> {
        let rooms = self.arguments.shared.join("data/rooms");
        let mut scene: Option<(String, SceneIndex)> = None;
        let mut columns: [Column; 6] = Default::default();
        println!(
            "seat                              how   |  s | pelvis cm  ° | feet cm   | sole °    | thigh back cm was      | skate was  contact was | acc was     turn was   | body% was"
        );
        for row in common::rooms::read(&rooms) {
            if scene.as_ref().is_none_or(|(room, _)| *room != row.room) {
                let mesh = common::glb::read(&rooms.join(format!("{}.glb", row.room)));
                let index = SceneIndex::build(
                    &mesh.positions,
                    &mesh.triangles,
                    &self.settings.scene,
                    &self.progress,
                )?;
                scene = Some((row.room.clone(), index));
            }
            let Some((_, index)) = &scene else { continue };
            let name = format!("{}-{}", row.room, row.number);
            let made = controllers_motion(self.arguments.motions.as_deref(), &name, || {
                let done =
                    synthesize(index, &self.database, &row.task, None, &self.settings, 1, &self.progress)?;
                Ok((done.motion, done.report.cues[0].frame))
            });
            let (motion, complete) = match made {
                Ok(made) => made,
                Err(error) => {
                    println!("{name}: {error}");
                    continue;
                }
            };
            let floor = row.task.start.position.z;
            if motion.postures[complete].root_position.distance(row.task.cue.position) > 0.2 {
                println!("{name:33} the controller does not get there");
                continue;
            }
            // As it is; with cues for the feet; and at a cue that the controller did not aim at.
            for how in ["own", "feet", "moved"] {
                let mut cue = row.task.cue.clone();
                let here = cue.planar();
                if how == "feet" {
                    let at =
                        |side: f32, ahead: f32| here.point_to_world(Vec2::new(side, -ahead)).extend(floor);
                    cue.feet = [Some(at(0.20, 0.42)), Some(at(-0.10, 0.30))];
                } else if how == "moved" {
                    cue.position = here.point_to_world(Vec2::new(0.05, -0.06)).extend(cue.position.z + 0.04);
                    cue.yaw += 0.2;
                }
                let seat = Seat {
                    motion: &motion,
                    cue: &cue,
                    complete,
                    scene: Some(index),
                    floor,
                    settings: &self.settings.editor,
                };
                let before = seat.figures(&motion, [false; 2]);
                let began = Instant::now();
                let fit = match seat.fit(self.manifold.as_ref(), &self.progress) {
                    Ok(fit) => fit,
                    Err(error) => {
                        println!("{name:33} {error}");
                        continue;
                    }
                };
                let seconds = began.elapsed().as_secs_f32();
                let s = &fit.seat;
                let span = fit.figures.first_frame..fit.figures.end_frame;
                let (foot, foot_was) = (foot_figures(&fit.motion, floor), foot_figures(&motion, floor));
                let (acc, acc_was) = (smoothness(&fit.motion, &span), smoothness(&motion, &span));
                let ignore = self.settings.reward.ignore_below;
                let body = |m: &Motion| {
                    let sits = row.task.cue.seat_height().map(|seat| (complete.saturating_sub(45), seat));
                    penetration_figures(m, index, floor, ignore, sits).whole_body_percent
                };
                let feet = |f: Option<f32>| f.map_or("  - ".into(), |f| format!("{f:4.2}"));
                println!(
                    "{name:33} {:5} |{seconds:4.1}| {:5.2} {:5.2} | {} {} | {:3.1} {:3.1}{} | {:4.1}/{:4.1} {:4.1}/{:4.1} | {:.2}/{:.2} {:.1}/{:.1} | {:3.0}/{:3.0} {:3.0}/{:3.0} | {:.1}/{:.1}",
                    how,
                    s.pelvis_cm,
                    s.facing_degrees,
                    feet(s.feet_cm[0]),
                    feet(s.feet_cm[1]),
                    s.sole_degrees[0],
                    s.sole_degrees[1],
                    if s.hanging.contains(&true) { " hangs" } else { "" },
                    s.thigh_cm,
                    before.thigh_cm,
                    s.back_cm,
                    before.back_cm,
                    foot.skate_cm,
                    foot_was.skate_cm,
                    foot.contact_cm,
                    foot_was.contact_cm,
                    acc.largest_acceleration,
                    acc_was.largest_acceleration,
                    acc.largest_turn,
                    acc_was.largest_turn,
                    body(&fit.motion),
                    body(&motion),
                );
                columns[0].0.push(s.pelvis_cm);
                columns[1].0.push(s.facing_degrees);
                columns[2].0.extend(s.feet_cm.iter().flatten());
                columns[3].0.push(s.thigh_cm);
                columns[4].0.push(s.back_cm);
                columns[5].0.push(seconds);
                let file = format!("{name}-{how}");
                self.write(&file, &fit.motion, &motion, &serde_json::json!({"cue": cue, "floor": floor}))?;
            }
        }
        for (what, column) in
            ["pelvis cm", "facing °", "feet cm", "thigh in seat cm", "back in backrest cm", "seconds"]
                .iter()
                .zip(&columns)
        {
            println!("{what:20} {}", column.text());
        }
        Ok(())
    }

    /// Every hinge and slide of the objects, opened: with the manifold, without it, and by plain inverse kinematics.
    fn hands(&self) -> Result<(), AnyError> {
        let folder = self.arguments.shared.join("data/objects");
        let settings = &self.settings.editor;
        let ablated = EditorSettings { manifold: false, ..settings.clone() };
        let mut columns: [[Column; 6]; 3] = Default::default();
        println!(
            "task                 frames how       |  s | hand mean max cm | manifold cm | acc max  mean | jerk | turn max | foot slide mean max cm"
        );
        for task in objects::tasks(&folder, &self.library)? {
            let cues = std::slice::from_ref(&task.cue);
            for (how, name) in ["manifold", "finishing", "plain IK"].into_iter().enumerate() {
                let began = Instant::now();
                let ours = |settings| {
                    manipulate(
                        self.manifold.as_ref(),
                        &task.motion,
                        cues,
                        None,
                        0.0,
                        settings,
                        &self.progress,
                    )
                };
                let done = match how {
                    0 if self.manifold.is_none() => continue,
                    0 => ours(settings),
                    1 => ours(&ablated),
                    _ => lengthened(&task.motion, &task.cue, 0.0, settings).and_then(
                        |(motion, constraints)| {
                            let edited = plain_ik(&motion, &constraints, settings, &self.progress)?;
                            Ok(Manipulated {
                                motion: edited.motion,
                                cues: Vec::new(),
                                figures: edited.figures,
                            })
                        },
                    ),
                };
                let done = match done {
                    Ok(done) => done,
                    Err(error) => {
                        println!("{:20} {name:9} {error}", task.name);
                        continue;
                    }
                };
                let seconds = began.elapsed().as_secs_f32();
                let span = done.figures.first_frame..done.figures.end_frame;
                let mean = |f: fn(&ConstraintFigures) -> Option<f32>| {
                    let all: Vec<f32> = done.figures.constraints.iter().filter_map(f).collect();
                    all.iter().sum::<f32>() / all.len() as f32
                };
                let worst = done.figures.constraints.iter().filter_map(|c| c.max_cm).fold(0.0, f32::max);
                let smooth = smoothness(&done.motion, &span);
                let foot = foot_figures(&done.motion, 0.0);
                let distance =
                    self.manifold.as_ref().map_or(f32::NAN, |m| manifold_distance(m, &done.motion, &span));
                println!(
                    "{:20} {:5} {name:9} |{seconds:4.1}| {:6.2} {worst:6.2} | {distance:5.2} | {:5.1} {:5.2} | {:5.1} | {:5.1} | {:.3} {:.2}  {}",
                    task.name,
                    task.cue.path.len(),
                    mean(|c| c.mean_cm),
                    smooth.largest_acceleration,
                    smooth.mean_acceleration,
                    smooth.mean_jerk,
                    smooth.largest_turn,
                    foot.skate_cm,
                    foot.worst_skate_cm,
                    done.figures.search.map_or(String::new(), |s| format!(
                        "{} steps {:.1} -> {:.1} cm",
                        s.steps, s.before_cm, s.after_cm
                    )),
                );
                let row = [
                    mean(|c| c.mean_cm),
                    worst,
                    distance,
                    smooth.largest_acceleration,
                    smooth.mean_jerk,
                    foot.worst_skate_cm,
                ];
                columns[how].iter_mut().zip(row).for_each(|(column, value)| column.0.push(value));
                let more = serde_json::json!({"paths": [task.cue.path], "yaw": task.motion.postures[0].planar().yaw, "floor": 0.0, "mesh": task.mesh});
                self.write(
                    &format!("{}-{}", task.name, name.replace(' ', "-")),
                    &done.motion,
                    &task.motion,
                    &more,
                )?;
            }
        }
        for (name, columns) in ["manifold", "finishing", "plain IK"].iter().zip(&columns) {
            let what = [
                "hand mean cm",
                "hand max cm",
                "manifold cm",
                "acceleration m/s²",
                "jerk m/s³",
                "foot slide max cm",
            ];
            for (what, column) in what.iter().zip(columns) {
                println!("{name:9} {what:18} {}", column.text());
            }
        }
        Ok(())
    }

    /// Joints of an edited motion and of the one before, for drawing.
    fn write(
        &self,
        name: &str,
        edited: &Motion,
        before: &Motion,
        more: &serde_json::Value,
    ) -> Result<(), AnyError> {
        let Some(out) = &self.arguments.out else { return Ok(()) };
        std::fs::create_dir_all(out)?;
        let joints = |m: &Motion| m.postures.iter().map(|p| p.pose().positions).collect::<Vec<_>>();
        let json = serde_json::json!({"edited": joints(edited), "before": joints(before), "more": more});
        std::fs::write(out.join(format!("{name}.json")), json.to_string())?;
        Ok(())
    }
}
