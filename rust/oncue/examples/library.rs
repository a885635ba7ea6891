//! Builds a motion library from `.bvh` files and folders and prints what it holds.
//!
//! `cargo run --release --example library -- FOLDER_OR_FILE … [--out FILE] [--no-mirror] [--starter all|missing|none] [--clips] [--files]
//! [--mapping FILE]`

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use oncue::library::{LibrarySettings, StarterUse, build};
use oncue::{MotionLibrary, Progress};

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
    let mut settings = LibrarySettings::default();
    let (mut paths, mut out, mut clips, mut files) = (Vec::new(), None, false, false);
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        let mut value = || arguments.next().ok_or_else(|| format!("{argument} needs a value."));
        match argument.as_str() {
            "--out" => out = Some(PathBuf::from(value()?)),
            "--no-mirror" => settings.mirror = false,
            "--clips" => clips = true,
            "--files" => files = true,
            "--mapping" => settings.mapping = Some(PathBuf::from(value()?)),
            "--starter" => {
                settings.starter = match value()?.as_str() {
                    "all" => StarterUse::All,
                    "missing" => StarterUse::Missing,
                    "none" => StarterUse::None,
                    other => return Err(format!("--starter is all, missing or none, not {other}.")),
                }
            }
            _ => paths.push(PathBuf::from(argument)),
        }
    }
    let begin = Instant::now();
    let built = build(&paths, &settings, &Progress::new()).map_err(|e| e.to_string())?;
    print(&built.library, clips);
    for capture in &built.captures {
        let file = capture.file.display();
        for note in &capture.notes {
            println!("{file}: {note}");
        }
        match (&capture.clip, &capture.reason) {
            (None, reason) => println!("skipped {file}: {}", reason.as_deref().unwrap_or_default()),
            (Some(_), Some(reason)) if files => println!("{file}: {reason}"),
            _ => {}
        }
    }
    println!("built in {:.1} s, checksum {}", begin.elapsed().as_secs_f32(), built.library.checksum());
    if let Some(out) = out {
        built.library.write(&out).map_err(|e| e.to_string())?;
        println!("written to {}", out.display());
    }
    Ok(())
}

fn print(library: &MotionLibrary, clips: bool) {
    if clips {
        for clip in library.clips.iter().filter(|c| !c.mirrored) {
            let segments: Vec<String> = clip
                .segments
                .iter()
                .map(|s| format!("{:?} {}..{} ({})", s.label, s.first, s.end, s.complete))
                .collect();
            println!("{:44} {:5} frames: {}", clip.name, clip.motion.len(), segments.join(", "));
        }
    }
    let summary = library.summary();
    println!("{} clips, {} frames", summary.clips, summary.frames);
    println!("{:12} {:>9} {:>9} {:>11} {:>9}", "seconds", "mocap", "mirrored", "procedural", "segments");
    if let Some(shortfall) = summary.turn_shortfall {
        println!("turns from standing are filled up by the starter library: {shortfall}");
    }
    for row in summary.rows {
        println!(
            "{:12} {:9.1} {:9.1} {:11.1} {:9}",
            format!("{:?}", row.label),
            row.mocap_seconds,
            row.mirrored_seconds,
            row.procedural_seconds,
            row.segments
        );
        if let Some(shortfall) = row.shortfall.filter(|_| row.procedural_seconds > 0.0) {
            println!("             filled up by the starter library: {shortfall}");
        }
    }
}
