//! Prints how people of a library walk, sit down, sit, get up and set off: the tenth, half and nine tenths of each figure.
//!
//! `cargo run --release --example style [-- FOLDER_OR_FILE …]`: of the starter library, or of captures alone.

#[path = "common/style.rs"]
mod style;

use std::path::PathBuf;

use oncue::Progress;
use oncue::library::{Clip, LibrarySettings, Source, StarterUse, build, starter};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let progress = Progress::new();
    let paths: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    let library = if paths.is_empty() {
        starter::generate(&progress)?
    } else {
        let settings =
            LibrarySettings { starter: StarterUse::None, mirror: false, ..LibrarySettings::default() };
        build(&paths, &settings, &progress)?.library
    };
    let wanted = |clip: &&Clip| !clip.mirrored && (paths.is_empty() || clip.source == Source::Mocap);
    let clips: Vec<&Clip> = library.clips.iter().filter(wanted).collect();
    for rows in [style::walking(&clips), style::sitting(&clips), style::starting(&clips)] {
        for row in rows {
            let Some([low, middle, high]) = row.spread() else { continue };
            println!("{:28} {low:7.2} {middle:7.2} {high:7.2}   of {}", row.name, row.values.len());
        }
    }
    Ok(())
}
