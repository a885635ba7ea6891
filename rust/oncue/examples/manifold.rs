//! Trains a motion manifold and writes its file; `nox -s manifold` runs it.
//!
//! `cargo run --release --example manifold -- --out FILE [--library FOLDER_OR_FILE …] [--starter all|missing|none]
//!  [--settings JSON] [--seed N] [--checkpoint FILE] [--origin SENTENCE]`
//!
//! A `--library` is a library file, or folders and `.bvh` files to build one from; without it the starter's is used.
//! With a checkpoint a training that was stopped goes on where it was.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use oncue::library::{LibrarySettings, StarterUse, build};
use oncue::manifold::{ManifoldSettings, train_manifold};
use oncue::{Job, Progress};

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(reason) => {
            eprintln!("{reason}");
            ExitCode::FAILURE
        }
    }
}

fn run() -> Result<(), String> {
    let mut library_settings = LibrarySettings { starter: StarterUse::All, ..LibrarySettings::default() };
    let mut settings = ManifoldSettings::default();
    let (mut paths, mut out, mut checkpoint, mut seed) = (Vec::new(), None, None, 0);
    let mut origin = None;
    let mut arguments = std::env::args().skip(1).peekable();
    while let Some(argument) = arguments.next() {
        if argument == "--library" {
            while let Some(path) = arguments.next_if(|a| !a.starts_with("--")) {
                paths.push(PathBuf::from(path));
            }
            continue;
        }
        let value = arguments.next().ok_or_else(|| format!("{argument} needs a value."))?;
        match argument.as_str() {
            "--out" => out = Some(PathBuf::from(value)),
            "--checkpoint" => checkpoint = Some(PathBuf::from(value)),
            "--origin" => origin = Some(value),
            "--seed" => {
                seed = value.parse().map_err(|_| format!("--seed is a whole number, not {value}."))?
            }
            "--settings" => {
                settings = serde_json::from_str(&value).map_err(|e| format!("--settings: {e}."))?;
            }
            "--starter" => {
                library_settings.starter = match value.as_str() {
                    "all" => StarterUse::All,
                    "missing" => StarterUse::Missing,
                    "none" => StarterUse::None,
                    other => return Err(format!("--starter is all, missing or none, not {other}.")),
                }
            }
            other => return Err(format!("{other} is no option of this command.")),
        }
    }
    let out = out.ok_or("--out names the file to write.")?;
    if let Some(origin) = origin {
        settings.origin = origin;
    }
    let library = build(&paths, &library_settings, &Progress::new()).map_err(|e| e.to_string())?.library;
    println!(
        "{} clips, {} frames, checksum {}",
        library.clips.len(),
        library.frame_count(),
        library.checksum()
    );

    let begin = Instant::now();
    let job = Job::start(move |progress| {
        train_manifold(&library, &settings, seed, checkpoint.as_deref(), progress)
    })
    .map_err(|e| e.to_string())?;
    let mut stage = String::new();
    while !job.wait(Duration::from_millis(500)) {
        let seen = job.progress();
        if seen.stage != stage {
            println!("{:6.0} s  {}", begin.elapsed().as_secs_f32(), seen.stage);
            stage = seen.stage;
        }
    }
    let manifold = job.take().ok_or("The training gave no manifold.")?.map_err(|e| e.to_string())?;
    manifold.write(&out).map_err(|e| e.to_string())?;
    let report = serde_json::to_string_pretty(&manifold.report).map_err(|e| e.to_string())?;
    println!("{report}\nwritten to {} after {:.0} s", out.display(), begin.elapsed().as_secs_f32());
    Ok(())
}
