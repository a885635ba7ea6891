//! Prints how feet stand, roll and step in many motions, one row each and one for all together, the worst swivels by name.
//!
//! `cargo run --release --example feet [-- [--library FILE_OR_FOLDER]… [--rooms FOLDER] [--task ROOM[:N]]… [--seeds N]
//! [--out FOLDER]]`: of a dozen tasks among boxes, or of those of a `rooms.tsv`. `--out` writes each motion's joints and soles
//! as JSON.

#[path = "../tests/common/mod.rs"]
mod common;
#[path = "common/feet_row.rs"]
mod feet_row;

use feet_row::feet_row;
use std::path::{Path, PathBuf};

use glam::Vec3;
use oncue::internals::foot::sole;
use oncue::library::{Clip, LibrarySettings, Source, StarterUse, build, starter};
use oncue::math::rotation::wrap_angle;
use oncue::motion::{FRAME_RATE, Motion};
use oncue::scene::SceneIndex;
use oncue::{
    ActionCue, ActionType, InitialState, MotionDatabase, MotionLibrary, Progress, Settings, Task, synthesize,
};

type AnyError = Box<dyn std::error::Error>;
type Box3 = ([f32; 3], [f32; 3]);

const FLOOR: Box3 = ([-3.5, -4.0, -0.1], [3.5, 3.5, 0.0]);
/// A low table in the middle, a bench at the far wall, and a stool before a desk.
const ROOM: [Box3; 5] = [
    FLOOR,
    ([-0.5, -0.5, 0.0], [0.5, 0.4, 0.4]),
    ([-0.8, 1.9, 0.0], [0.8, 2.4, 0.45]),
    ([2.3, -2.4, 0.0], [2.75, -1.9, 0.45]),
    ([1.5, -3.0, 0.68], [1.9, -1.4, 0.72]),
];

/// Start, its yaw, what to do, where, and the yaw there.
type Errand = ([f32; 2], f32, ActionType, [f32; 3], f32);

const TASKS: [Errand; 12] = [
    ([0.2, -1.8], 2.0, ActionType::Sit, [0.0, 2.12, 0.55], 0.0),
    ([-2.5, 2.0], 0.0, ActionType::Sit, [0.4, 2.12, 0.55], 0.2),
    ([2.5, 0.5], -2.0, ActionType::Sit, [0.0, 2.12, 0.55], -0.2),
    ([-2.0, -2.5], -1.0, ActionType::Sit, [-0.4, 2.12, 0.55], 0.0),
    ([0.0, -3.0], 0.0, ActionType::Sit, [2.5, -2.15, 0.55], 1.6),
    ([2.8, 2.5], 3.0, ActionType::Sit, [2.5, -2.15, 0.55], -1.5),
    ([0.2, -1.8], 2.0, ActionType::Stop, [-1.2, 1.0, 0.0], 3.0),
    ([-2.5, -2.5], 1.5, ActionType::Stop, [2.0, 1.0, 0.0], 0.5),
    ([2.5, 2.5], 0.5, ActionType::Stop, [-2.0, -1.5, 0.0], -1.6),
    ([-1.0, -3.0], 3.0, ActionType::Stop, [-1.2, 1.5, 0.0], 0.0),
    ([-2.0, 0.0], 1.5, ActionType::Stop, [-0.9, 1.0, 0.0], 1.6),
    ([1.0, 1.2], -1.6, ActionType::Stop, [-2.5, 1.2, 0.0], 1.6),
];

struct Arguments {
    library: Vec<PathBuf>,
    rooms: Option<PathBuf>,
    tasks: Vec<String>,
    seeds: u64,
    out: Option<PathBuf>,
}

fn arguments() -> Result<Arguments, AnyError> {
    let mut words = std::env::args().skip(1);
    let mut a = Arguments { library: Vec::new(), rooms: None, tasks: Vec::new(), seeds: 2, out: None };
    while let Some(word) = words.next() {
        let value = words.next().ok_or("an option lacks its value")?;
        match word.as_str() {
            "--library" => a.library.push(value.into()),
            "--rooms" => a.rooms = Some(value.into()),
            "--task" => a.tasks.push(value),
            "--seeds" => a.seeds = value.parse()?,
            "--out" => a.out = Some(value.into()),
            other => return Err(format!("unknown option {other}").into()),
        }
    }
    Ok(a)
}

fn main() -> Result<(), AnyError> {
    let a = arguments()?;
    let progress = Progress::new();
    let library = if a.library.is_empty() {
        starter::generate(&progress)?
    } else {
        let settings = LibrarySettings { starter: StarterUse::Missing, ..LibrarySettings::default() };
        build(&a.library, &settings, &progress)?.library
    };
    // As many updates as show what a policy does: feet are not what it learns.
    let mut settings = Settings::default();
    settings.ppo.tuples = 1024;
    settings.ppo.updates = 2;
    let database = MotionDatabase::build(&library, &settings.synthesizer.weights, &progress)?;
    let tasks: Vec<(String, String, Task)> = match &a.rooms {
        Some(folder) => common::rooms::read(folder)
            .into_iter()
            .map(|row| (format!("{}:{}", row.room, row.number), row.room, row.task))
            .filter(|(name, room, _)| a.tasks.is_empty() || a.tasks.iter().any(|t| t == name || t == room))
            .collect(),
        None => own_tasks(),
    };
    println!("{HEAD}");
    let (mut all, mut turns, mut swivels) = (MotionLibrary::default(), Vec::new(), Vec::new());
    let (mut skates, mut problems) = (Vec::new(), 0);
    let mut scene: Option<(String, SceneIndex)> = None;
    for (name, room, task) in tasks {
        if scene.as_ref().is_none_or(|(of, _)| *of != room) {
            let (positions, triangles) = match &a.rooms {
                Some(folder) => {
                    let mesh = common::glb::read(&folder.join(format!("{room}.glb")));
                    (mesh.positions, mesh.triangles)
                }
                None => common::boxes::boxes(&ROOM),
            };
            scene = Some((room, SceneIndex::build(&positions, &triangles, &settings.scene, &progress)?));
        }
        let Some((_, index)) = &scene else { continue };
        for seed in 1..=a.seeds {
            let name = format!("{name}, seed {seed}");
            let done = match synthesize(index, &database, &task, None, &settings, seed, &progress) {
                Ok(done) => done,
                Err(error) => {
                    println!("{error} · {name}");
                    continue;
                }
            };
            let mut motion = done.motion.clone();
            motion.postures.iter_mut().for_each(|p| p.root_position.z -= task.start.position.z);
            let alone = pool(&name, motion.clone());
            let foot = &done.report.foot;
            let turn = fastest_turn(&motion);
            let told = format!(
                "skate {:.2} worst {:.1} low {:.2} sink {:.1} | joints {:.2} {:.3}% | turn {turn:3.0}°/s | still {:.1} s",
                foot.skate_cm,
                foot.worst_skate_cm,
                foot.low_skate_cm,
                foot.sink_cm,
                done.report.speed.joint_ratio,
                done.report.speed.faster_percent,
                still_before_end(&motion, done.report.cues.first().map_or(motion.len(), |c| c.frame)),
            );
            println!("{} | {told} · {name} {}", row(&alone), done.report.problems.join(" "));
            for swivel in &done.report.body.feet.flat.swivels {
                swivels.push((
                    swivel.degrees,
                    format!("foot {} {}..{} · {name}", swivel.side, swivel.first, swivel.end),
                ));
            }
            if let Some(out) = &a.out {
                write(out, &name, &motion, &done.motion)?;
            }
            turns.push(turn);
            skates.push(foot.skate_cm);
            problems += usize::from(!done.report.problems.is_empty());
            all.clips.extend(alone.clips);
        }
    }
    turns.sort_by(f32::total_cmp);
    let at = |part: f32| turns.get((part * turns.len() as f32) as usize).copied().unwrap_or_default();
    let skate = skates.iter().sum::<f32>() / skates.len().max(1) as f32;
    println!(
        "{} | skate {skate:.3} | turn {:.0} (p95 {:.0}) | {problems} with problems · all {}",
        row(&all),
        at(0.5),
        at(0.95),
        all.clips.len()
    );
    swivels.sort_by(|a, b| b.0.total_cmp(&a.0));
    for (degrees, what) in swivels.iter().take(12) {
        println!("     swivels by {degrees:.0}° {what}");
    }
    Ok(())
}

const HEAD: &str = "flat: n heel cm (p90) ball swivel° >15° % | steps heel1st% toe-up° clear cm heel-up°";

fn own_tasks() -> Vec<(String, String, Task)> {
    let task = |(i, (start, yaw, action_type, place, facing)): (usize, Errand)| {
        let start = InitialState::standing("Start", Vec3::new(start[0], start[1], 0.0), yaw);
        let cue = ActionCue {
            name: "Cue".into(),
            action_type,
            position: Vec3::from_array(place),
            yaw: facing,
            feet: [None; 2],
        };
        let name = format!("{action_type:?} {i}");
        (name, String::new(), Task { start, cue, passes: Vec::new(), manipulations: Vec::new() })
    };
    TASKS.into_iter().enumerate().map(task).collect()
}

fn pool(name: &str, motion: Motion) -> MotionLibrary {
    let clip =
        Clip { name: name.into(), source: Source::Mocap, mirrored: false, motion, segments: Vec::new() };
    MotionLibrary { clips: vec![clip] }
}

fn row(motions: &MotionLibrary) -> String {
    feet_row(&motions.body_figures().feet)
}

/// The fastest turn of the pelvis about the vertical, mean of five frames, degrees a second.
fn fastest_turn(motion: &Motion) -> f32 {
    let yaws: Vec<f32> = motion.postures.iter().map(|p| p.planar().yaw).collect();
    let turned = |w: &[f32]| w.windows(2).map(|p| wrap_angle(p[1] - p[0])).sum::<f32>();
    let rate = |w: &[f32]| turned(w).abs() * FRAME_RATE / (w.len() - 1) as f32;
    yaws.windows(6).map(rate).fold(0.0, f32::max).to_degrees()
}

/// Lower than this the pelvis sits or is on its way to, metres.
const STANDING: f32 = 0.85;

/// Seconds that someone who walks stands nearly still (under 10 cm/s in all directions) before the action is complete, the
/// longest such time after the first step.
fn still_before_end(motion: &Motion, complete: usize) -> f32 {
    let places: Vec<Vec3> = motion.postures.iter().map(|p| p.root_position).collect();
    let speeds: Vec<f32> = places.windows(2).map(|p| p[0].distance(p[1]) * FRAME_RATE).collect();
    let sinks = places.iter().rposition(|p| p.z > STANDING).unwrap_or(0);
    let until = complete.min(sinks).min(speeds.len());
    let Some(begun) = speeds.iter().position(|s| *s > 0.5) else { return 0.0 };
    let (mut longest, mut now) = (0usize, 0usize);
    for speed in speeds.iter().take(until).skip(begun) {
        now = if *speed < 0.1 { now + 1 } else { 0 };
        longest = longest.max(now);
    }
    longest as f32 / FRAME_RATE
}

fn write(out: &Path, name: &str, motion: &Motion, shown: &Motion) -> Result<(), AnyError> {
    std::fs::create_dir_all(out)?;
    let poses: Vec<_> = motion.postures.iter().map(|p| p.pose()).collect();
    let soles: Vec<_> = poses.iter().map(|pose| [0, 1].map(|side| sole(pose, side))).collect();
    let positions: Vec<_> = poses.iter().map(|pose| pose.positions).collect();
    let json = serde_json::json!({
        "name": name, "positions": positions, "soles": soles, "contacts": shown.contacts,
    });
    let file: String = name.chars().map(|c| if c.is_alphanumeric() { c } else { '-' }).collect();
    std::fs::write(out.join(format!("{file}.json")), json.to_string())?;
    Ok(())
}
