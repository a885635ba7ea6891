//! Changes files of each kind at random, reads them in this process, and counts what comes of it.
//!
//! `cargo run --release --example fuzz -- INPUTS [SEED]`: so many over all kinds, on all cores. Prints docs/fuzz.md.

#[path = "../tests/common/mutate.rs"]
mod mutate;

use std::time::Instant;

use mutate::Counts;
use rayon::prelude::*;

/// Inputs that one thread tries at a stretch.
const STRETCH: usize = 1000;

const HEAD: &str = "# Files changed at random

`nox -s fuzz` takes a whole file of each kind, changes bits, bytes, words, sizes and numbers in it at random (in containers mostly
the payload, under a checksum that fits, so that it is decoded), and reads it in this process: captures and their mapping files
all the way to a clip, libraries into the database that is matched against, settings until they are validated. Nonsense is what
was read and is no sound file: a posture that is no posture, what is not written again as it was read. `cargo test --test
mutations` does so with a thousand of each kind, `tests/addon/test_mutations.py` with what is kept in a .blend file.
";

/// `1 000 000`.
fn grouped(count: usize) -> String {
    let digits = count.to_string();
    let groups: Vec<&str> =
        digits.as_bytes().rchunks(3).rev().filter_map(|g| std::str::from_utf8(g).ok()).collect();
    groups.join(" ")
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let inputs: usize = arguments.next().map_or(Ok(1_000_000), |text| text.parse())?;
    let seed: u64 = arguments.next().map_or(Ok(1), |text| text.parse())?;
    // A panic is counted; its story would fill the screen.
    std::panic::set_hook(Box::new(|_| {}));
    let kinds = mutate::kinds();
    let stretches = inputs.div_ceil(STRETCH * kinds.len()).max(1);
    println!("{HEAD}");
    println!("{} files, seed {seed}:\n", grouped(stretches * STRETCH * kinds.len()));
    println!(
        "| file | inputs | read | refused by a sentence | read as nonsense | panics | over 20 s | slowest, s |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    let begun = Instant::now();
    let mut faults = 0;
    for kind in &kinds {
        if kind.read_whole() != Ok(true) {
            return Err(format!("the whole file of the kind {} is not read", kind.name).into());
        }
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
        faults += all.nonsense.len() + all.panics.len() + all.hangs;
        for first in all.nonsense.iter().chain(&all.panics).take(3) {
            eprintln!("{}: {first}", kind.name);
        }
    }
    let threads = rayon::current_num_threads();
    println!("\nIn {:.0} s on {threads} threads.", begun.elapsed().as_secs_f32());
    if faults > 0 {
        return Err(format!("{faults} inputs panicked, hung or were read as nonsense").into());
    }
    Ok(())
}
