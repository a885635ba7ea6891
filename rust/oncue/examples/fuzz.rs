//! Changes files of each kind at random, reads them in this process, and counts what comes of it.
//!
//! `cargo run --release --example fuzz -- INPUTS [SEED]`: so many over all kinds, on all cores. Prints a table.

#[path = "../tests/common/mutate.rs"]
mod mutate;

use std::time::Instant;

use mutate::Counts;
use rayon::prelude::*;

/// Inputs that one thread tries at a stretch.
const STRETCH: usize = 1000;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let inputs: usize = arguments.next().map_or(Ok(1_000_000), |text| text.parse())?;
    let seed: u64 = arguments.next().map_or(Ok(1), |text| text.parse())?;
    // A panic is counted; its story would fill the screen.
    std::panic::set_hook(Box::new(|_| {}));
    let kinds = mutate::kinds();
    let stretches = inputs.div_ceil(STRETCH * kinds.len()).max(1);
    println!(
        "| file | inputs | read | refused by a sentence | read as nonsense | panics | over 20 s | slowest, s |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    let begun = Instant::now();
    for kind in &kinds {
        let parts: Vec<Counts> = (0..stretches)
            .into_par_iter()
            .map(|stretch| mutate::try_kind(kind, STRETCH, seed.wrapping_add((stretch as u64) << 20)))
            .collect();
        let mut all = Counts::default();
        for part in parts {
            all.inputs += part.inputs;
            all.read += part.read;
            all.refused += part.refused;
            all.nonsense.extend(part.nonsense);
            all.panics.extend(part.panics);
            all.hangs += part.hangs;
            all.slowest = all.slowest.max(part.slowest);
        }
        println!(
            "| {} | {} | {} | {} | {} | {} | {} | {:.2} |",
            kind.name,
            all.inputs,
            all.read,
            all.refused,
            all.nonsense.len(),
            all.panics.len(),
            all.hangs,
            all.slowest.as_secs_f32()
        );
        for first in all.nonsense.iter().chain(&all.panics).take(3) {
            eprintln!("{}: {first}", kind.name);
        }
    }
    eprintln!("{:.0} s, seed {seed}", begun.elapsed().as_secs_f32());
    Ok(())
}
