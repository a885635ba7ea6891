//! Plays shots of several people and prints a table of them: people who cross one hall of 12 × 12 m, or, with the folder of a
//! `rooms.tsv`, two people in each room, from the starts and to the seats of two of its tasks.
//!
//! `cargo run --release --example together -- [FOLDER] [--people N] [--shots N] [--seed N]`

#[path = "../tests/common/mod.rs"]
mod common;

use std::path::PathBuf;
use std::time::Instant;

use oncue::glam::{Vec2, Vec3};
use oncue::library::starter;
use oncue::scene::SceneIndex;
use oncue::{
    ActionCue, ActionType, InitialState, MotionDatabase, Performance, Progress, Settings, Step,
    perform_together,
};

type AnyError = Box<dyn std::error::Error>;

/// Half of the hall's width, and from how far out people cross it, metres.
const HALL: f32 = 6.0;
const FROM: f32 = 5.2;

fn main() -> Result<(), AnyError> {
    let mut words = std::env::args().skip(1);
    let (mut folder, mut people, mut shots, mut seed) = (None, 6, 8, 1);
    while let Some(word) = words.next() {
        match word.as_str() {
            "--people" => people = words.next().ok_or("how many?")?.parse()?,
            "--shots" => shots = words.next().ok_or("how many?")?.parse()?,
            "--seed" => seed = words.next().ok_or("which?")?.parse()?,
            _ => folder = Some(PathBuf::from(word)),
        }
    }
    let (progress, settings) = (Progress::new(), Settings::default());
    let library = starter::generate(&progress)?;
    let database = MotionDatabase::build(&library, &settings.synthesizer.weights, &progress)?;
    let Some(folder) = folder else {
        let (scene, crossing) = hall(people, &settings)?;
        return tell("hall", &scene, &crossing, &database, &settings, seed);
    };
    let rows = common::rooms::read(&folder);
    let mut played = 0;
    for room in rows.chunk_by(|a, b| a.room == b.room).filter(|room| room.len() > 1) {
        let name = &room[0].room;
        let mesh = common::glb::read(&folder.join(format!("{name}.glb")));
        for pair in room.chunks_exact(2) {
            if played == shots {
                return Ok(());
            }
            let both: Vec<Performance> = pair
                .iter()
                .map(|row| {
                    let mut start = row.task.start.clone();
                    start.name = format!("Start {}", row.number);
                    let cue = ActionCue { name: format!("Seat {}", row.number), ..row.task.cue.clone() };
                    let step = Step {
                        cue,
                        hold_seconds: None,
                        at_seconds: None,
                        passes: Vec::new(),
                        manipulations: Vec::new(),
                        things: Vec::new(),
                    };
                    Performance {
                        start,
                        steps: vec![step],
                        things: Vec::new(),
                        leaves: Vec::new(),
                        looks: Vec::new(),
                    }
                })
                .collect();
            let places: Vec<Vec3> = both.iter().flat_map(Performance::places).collect();
            let (at, corners) = (&mesh.positions, &mesh.triangles);
            let scene = SceneIndex::build_for(at, corners, &settings.scene, &places, &progress)?;
            tell(name, &scene, &both, &database, &settings, seed)?;
            played += 1;
        }
    }
    Ok(())
}

/// People all round an empty hall, each of whom goes to the other side.
fn hall(people: usize, settings: &Settings) -> Result<(SceneIndex, Vec<Performance>), AnyError> {
    let floor = [[-HALL, -HALL, 0.0], [HALL, -HALL, 0.0], [HALL, HALL, 0.0], [-HALL, HALL, 0.0]];
    let scene = SceneIndex::build(
        &floor.map(Vec3::from),
        &[[0, 1, 2], [0, 2, 3]],
        &settings.scene,
        &Progress::new(),
    )?;
    let crossing = (0..people).map(|at| {
        let angle = std::f32::consts::TAU * at as f32 / people as f32 + 0.1;
        let from = Vec2::from_angle(angle) * FROM;
        let yaw = (-from).to_angle() + std::f32::consts::FRAC_PI_2;
        let cue = ActionCue {
            name: format!("Stop {at}"),
            action_type: ActionType::Stop,
            // Not quite where the one on the other side starts.
            position: (Vec2::from_angle(angle + 0.2) * -FROM).extend(0.0),
            yaw,
            feet: [None; 2],
        };
        Performance {
            start: InitialState::standing(format!("Start {at}"), from.extend(0.0), yaw),
            steps: vec![Step {
                cue,
                hold_seconds: None,
                at_seconds: None,
                passes: Vec::new(),
                manipulations: Vec::new(),
                things: Vec::new(),
            }],
            things: Vec::new(),
            leaves: Vec::new(),
            looks: Vec::new(),
        }
    });
    Ok((scene, crossing.collect()))
}

fn tell(
    name: &str,
    scene: &SceneIndex,
    people: &[Performance],
    database: &MotionDatabase,
    settings: &Settings,
    seed: u64,
) -> Result<(), AnyError> {
    let begun = Instant::now();
    let made =
        match perform_together(None, scene, database, people, &[], None, settings, seed, &Progress::new()) {
            Ok(made) => made,
            Err(error) => {
                println!("{name}: {error}");
                return Ok(());
            }
        };
    println!("{name}: {} people in {:.1} s", people.len(), begun.elapsed().as_secs_f32());
    for (one, asked) in made.iter().zip(people) {
        let one = match one {
            Ok(one) => one,
            Err(error) => {
                println!("  {:10} {error}", asked.start.name);
                continue;
            }
        };
        let report = &one.report;
        let others = report.others.clone().unwrap_or_default();
        let waited: usize = report.steps.iter().map(|step| step.waited).sum();
        println!(
            "  {:10} {:4.1} s, waits {:4.1} s, way {:4.1} of {:4.1} m, in others {:.1} %, {:.1} cm, success {}, {} updates {}",
            asked.start.name,
            one.motion.len() as f32 / 30.0,
            waited as f32 / 30.0,
            report.path_m,
            report.shortest_path_m,
            others.percent,
            others.deepest_cm,
            report.success,
            report.updates,
            report.problems.join(" "),
        );
    }
    Ok(())
}
