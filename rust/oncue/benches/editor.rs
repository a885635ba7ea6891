//! Prints what the motion manifold costs: seconds of 500 steps of a latent optimization (decode, kinematics, backward)
//! on one window and on two at once, and windows a second of training.
//!
//! With `ONCUE_PEERS` naming a Python that has PyTorch, the same decoder runs its 500 steps there beside it
//! (`tools/peers/torch_decoder.py`), after its output was found to be the same. `cargo bench --bench editor`, or
//! `nox -s bench`, which sets the variable.

#[allow(dead_code)] // each bench uses what it needs of it
mod peer;

use std::time::Instant;

use glam::Vec3;
use oncue::Progress;
use oncue::internals::DecoderWorkspace;
use oncue::internals::{Adam, Conv1d};
use oncue::internals::{FEATURES, WINDOW, from_motion};
use oncue::internals::{Kinematics, RootPath};
use oncue::library::starter;
use oncue::manifold::{Manifold, ManifoldSettings, train_manifold};
use oncue::math::Planar;
use oncue::motion::{JOINT_COUNT, Motion};
use peer::Work;
use rayon::prelude::*;
use serde_json::json;

const STEPS: usize = 500;
const LEARNING_RATE: f32 = 0.005;

fn main() {
    let library = starter::generate(&Progress::new()).expect("the starter library");
    let clips = library.clips.iter().filter(|clip| clip.motion.len() >= WINDOW);
    let windows: Vec<Vec<f32>> = clips
        .take(2)
        .map(|clip| {
            let postures = clip.motion.postures[..WINDOW].to_vec();
            from_motion(&Motion { postures, contacts: clip.motion.contacts[..WINDOW].to_vec() }).0
        })
        .collect();
    // The paper's 256 channels, and those of the manifold that ships.
    for channels in [256, ManifoldSettings::default().channels] {
        let manifold = Manifold::random(channels, 1);
        let lap = Instant::now();
        optimize(&manifold, &windows[0]);
        let one = lap.elapsed().as_secs_f64();
        let lap = Instant::now();
        windows.par_iter().for_each(|x| optimize(&manifold, x));
        let two = lap.elapsed().as_secs_f64();
        println!("{channels} channels, {STEPS} steps: {one:.2} s for one window, {two:.2} s for two at once");
        if let Some(work) = Work::new(&format!("decoder-{channels}")) {
            peer(&work, &manifold, &windows[0], one);
        }
    }
    // `-- decoder` leaves the training out.
    if !std::env::args().any(|argument| argument == "decoder") {
        training(&library);
    }
}

/// The editor's inner loop without its other terms: every joint is drawn 10 cm up.
fn optimize(manifold: &Manifold, x: &[f32]) {
    let mut z = manifold.encode(x);
    let mut adam = Adam::new(LEARNING_RATE, z.len());
    let mut work = DecoderWorkspace::default();
    let (mut wanted, mut found) = (Kinematics::default(), Kinematics::default());
    let path = RootPath::From(Planar::default());
    wanted.forward(x, path);
    let mut d_positions = vec![[Vec3::ZERO; JOINT_COUNT]; WINDOW];
    let mut d_x = vec![0.0; WINDOW * FEATURES];
    for _ in 0..STEPS {
        let decoded = manifold.decode(&z, &mut work);
        found.forward(decoded, path);
        for ((d, found), wanted) in d_positions.iter_mut().zip(&found.positions).zip(&wanted.positions) {
            *d = std::array::from_fn(|joint| found[joint] - wanted[joint] - Vec3::Z * 0.1);
        }
        d_x.fill(0.0);
        found.backward(decoded, &d_positions, None, &mut d_x);
        let d_z = manifold.backward(&d_x, &mut work);
        adam.step(&mut z, d_z, 1.0);
    }
}

fn training(library: &oncue::MotionLibrary) {
    let settings = ManifoldSettings { epochs: 2, stride: 120, ..ManifoldSettings::default() };
    let lap = Instant::now();
    let one = train_manifold(
        library,
        &ManifoldSettings { epochs: 1, ..settings.clone() },
        1,
        None,
        &Progress::new(),
    )
    .expect("a manifold");
    let first = lap.elapsed().as_secs_f64();
    let lap = Instant::now();
    train_manifold(library, &settings, 1, None, &Progress::new()).expect("a manifold");
    // What the second epoch adds: preparing and measuring are in both.
    let epoch = lap.elapsed().as_secs_f64() - first;
    let windows = one.report.training_windows as f64;
    println!("training, {} channels: {:.0} windows/s", settings.channels, windows / epoch);
}

/// Runs the decoder in PyTorch: it checks its output against ours, and prints its own time.
fn peer(work: &Work, manifold: &Manifold, x: &[f32], seconds: f64) {
    let z = manifold.encode(x);
    for (i, Conv1d { parameters, .. }) in manifold.decoder_layers().iter().enumerate() {
        work.floats(&format!("layer{i}"), parameters);
    }
    work.floats("z", &z);
    work.floats("x", manifold.decode(&z, &mut DecoderWorkspace::default()));
    let facts = json!({ "channels": manifold.channels(), "steps": STEPS, "seconds": seconds });
    work.run("torch_decoder.py", &facts);
}
