//! Prints how people of a library walk, set off, sit down, sit and get up (`style` in docs/report.md): the tenth, half and
//! nine tenths of each row.
//!
//! `cargo run --release --example style [-- FOLDER_OR_FILE …]`: of the starter library, or of captures alone.

use std::path::PathBuf;

use oncue::Progress;
use oncue::library::{LibrarySettings, Source, StarterUse, build, starter};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let progress = Progress::new();
    let paths: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    let style = if paths.is_empty() {
        starter::generate(&progress)?.style(None)
    } else {
        let settings = LibrarySettings {
            starter: StarterUse::None,
            mirror: false,
            raised_arms: true,
            ..LibrarySettings::default()
        };
        build(&paths, &settings, &progress)?.library.style(Some(Source::Mocap))
    };
    for (group, name, values) in style.rows().into_iter().filter(|row| !row.2.is_empty()) {
        let mut sorted = values.to_vec();
        sorted.sort_by(f32::total_cmp);
        let [low, middle, high] =
            [0.1, 0.5, 0.9].map(|part| sorted[(part * (sorted.len() - 1) as f32).round() as usize]);
        println!("{:36} {low:7.2} {middle:7.2} {high:7.2}   of {}", format!("{group}.{name}"), sorted.len());
    }
    Ok(())
}
