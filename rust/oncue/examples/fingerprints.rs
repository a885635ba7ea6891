//! Prints a checksum of each of nine motions: what a change of structure must leave as it is, bit for bit.
//!
//! `cargo run --release --example fingerprints`, before the change and after it, on one machine: other vector
//! instructions round otherwise. Between them the nine walk, sit, stop, reach, pass a gap, place their feet, are played by
//! the prior, optimized from scratch and made with the paper's constants. What they do not run has tests of its own: an artist's
//! keys, captures, a stored policy, a manifold's training.

#[path = "../tests/common/boxes.rs"]
mod boxes;
#[path = "common/nine.rs"]
mod nine;

use oncue::library::starter;
use oncue::scene::SceneIndex;
use oncue::{Motion, MotionDatabase, Progress, synthesize};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let progress = Progress::new();
    let library = starter::generate(&progress)?;
    for nine::Case { name, room, task, settings, seed } in nine::cases()? {
        let (positions, triangles) = boxes::boxes(room);
        let scene = SceneIndex::build(&positions, &triangles, &settings.scene, &progress)?;
        let database = MotionDatabase::build(&library, &settings.synthesizer.weights, &progress)?;
        let done = synthesize(&scene, &database, &task, None, &settings, seed, &progress)?;
        println!(
            "{} {} frames, {} updates, met: {} · {name}",
            fingerprint(&done.motion),
            done.motion.len(),
            done.report.updates,
            done.report.success
        );
    }
    Ok(())
}

/// The first half of the BLAKE3 of every number of a motion.
fn fingerprint(motion: &Motion) -> String {
    let mut hasher = blake3::Hasher::new();
    for (posture, contact) in motion.postures.iter().zip(&motion.contacts) {
        let rotations = posture.rotations.iter().flat_map(|r| r.to_array());
        for number in posture.root_position.to_array().into_iter().chain(rotations).chain(*contact) {
            hasher.update(&number.to_le_bytes());
        }
    }
    hasher.finalize().to_hex()[..16].to_owned()
}
