//! Optimizes the prior policy that ships with Oncue: over rooms made by rule, from random starts, with random cues
//! (LAMA, section 3.5, over many scenes).
//!
//! `cargo run --release --example prior -- --out rust/oncue/data/prior.oncuepolicy [--rooms N] [--updates N]
//! [--seed N] [--from FILE]`
//!
//! The motion is the starter library's alone, so that the file needs nothing from outside. Prints the learning curve;
//! the file is written anew every 25 updates, and `--from` goes on with one.

use std::path::PathBuf;

use oncue::MotionDatabase;
use oncue::controller::{Environment, PolicyOrigin, StoredPolicy, optimize_policy};
use oncue::internals::practice_room;
use oncue::library::starter;
use oncue::scene::{SceneIndex, check_task};
use oncue::{InitialState, Progress, Settings, Task};

type AnyError = Box<dyn std::error::Error>;

fn main() -> Result<(), AnyError> {
    let (mut out, mut from) = (PathBuf::from("prior.oncuepolicy"), None::<PathBuf>);
    let (mut rooms, mut updates, mut seed) = (96u64, 300usize, 1u64);
    let mut words = std::env::args().skip(1);
    while let Some(word) = words.next() {
        let value = words.next().ok_or("an option lacks its value")?;
        match word.as_str() {
            "--out" => out = value.into(),
            "--from" => from = Some(value.into()),
            "--rooms" => rooms = value.parse()?,
            "--updates" => updates = value.parse()?,
            "--seed" => seed = value.parse()?,
            other => return Err(format!("unknown option {other}").into()),
        }
    }
    let progress = Progress::new();
    let mut settings = Settings::default();
    settings.ppo.tuples = 30_000;
    settings.ppo.vary_start = 1.0;
    settings.ppo.updates = updates.min(25);
    settings.ppo.solved = 1.1;

    let library = starter::generate(&progress)?;
    let database = MotionDatabase::build(&library, &settings.synthesizer.weights, &progress)?;
    let mut scenes = Vec::new();
    for number in 0..rooms {
        let room = practice_room(1000 + number);
        let scene = SceneIndex::build(&room.positions, &room.triangles, &settings.scene, &progress)?;
        scenes.push((scene, room.cues));
    }
    // The start is drawn anew each episode; this one is only where the floor is.
    let start = InitialState::standing("Start", glam::Vec3::ZERO, 0.0);
    let tasks: Vec<(usize, Task)> = scenes
        .iter()
        .enumerate()
        .flat_map(|(s, (_, cues))| {
            cues.iter()
                .map(|cue| {
                    (
                        s,
                        Task {
                            start: start.clone(),
                            cue: cue.clone(),
                            passes: Vec::new(),
                            manipulations: Vec::new(),
                        },
                    )
                })
                .collect::<Vec<_>>()
        })
        .collect();
    let environments: Vec<Environment> = tasks
        .iter()
        .map(|(s, task)| Environment::new(&scenes[*s].0, &database, task, &settings))
        .filter(|environment| environment.as_ref().map_or(true, can_be_met))
        .collect::<oncue::Result<_>>()?;
    println!("{} rooms, {} of {} cues can be met", scenes.len(), environments.len(), tasks.len());

    let mut kept = from.map(|file| StoredPolicy::read(&file)).transpose()?;
    let mut done = kept.as_ref().map_or(0, |k| k.origin.updates);
    let last = done + updates;
    while done < last {
        let begin = kept.as_ref().map(|k| k.policy.clone());
        let optimized = optimize_policy(&environments, begin, seed + done as u64, &progress)?;
        for figures in &optimized.curve {
            println!(
                "{:4}  reward {:6.3}  success {:5.1} %  collisions {:5.1} %  stalls {:5.1} %  {:6.0} s",
                done + figures.update,
                figures.reward,
                100.0 * figures.success_rate_anywhere.unwrap_or(0.0),
                100.0 * figures.collisions,
                100.0 * figures.stalls,
                figures.seconds
            );
        }
        done += optimized.curve.len();
        let before = kept.map_or(0, |k| k.origin.environment_steps);
        let origin = PolicyOrigin {
            library: database.library_checksum.clone(),
            generalized: true,
            updates: done,
            environment_steps: before + optimized.environment_steps,
            success_rate: optimized.curve.last().and_then(|f| f.success_rate_anywhere).unwrap_or(0.0),
            ..PolicyOrigin::default()
        };
        let policy = StoredPolicy::new(optimized.policy, &settings, origin);
        policy.write(&out)?;
        kept = Some(policy);
    }
    Ok(())
}

/// Whether the cue can be met from at least one of some places on the clear floor.
fn can_be_met(environment: &Environment) -> bool {
    let starts = environment.starts();
    starts.iter().step_by((starts.len() / 8).max(1)).any(|xy| {
        let start = InitialState { position: xy.extend(0.0), ..environment.task.start.clone() };
        check_task(environment.scene, &Task { start, ..environment.task.clone() }).is_ok()
    })
}
