//! The whole main job in a scene of a million triangles: its memory, and how soon a cancel is answered, at moments spread
//! over the run.
//!
//! `cargo bench -p oncue --bench large_scene`. Optimized from scratch, so that every stage is passed.

mod mesh;

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use glam::Vec3;
use mesh::{finer, made_room, peak_memory};
use oncue::MotionDatabase;
use oncue::job::Failure;
use oncue::library::starter;
use oncue::scene::SceneIndex;
use oncue::{
    ActionCue, ActionType, Error, InitialState, Job, Progress, Settings, Synthesis, Task, synthesize,
};

const TRIANGLES: usize = 1_000_000;
/// Moments of the run at which it is cancelled.
const CANCELS: u32 = 24;

fn main() {
    println!("{} threads", rayon::current_num_threads());
    let whole = Instant::now();
    let done = finish(&start()).expect("a motion");
    let whole = whole.elapsed();
    println!(
        "{TRIANGLES} triangles, library, index and synthesis: {:.1} s, {} updates, cue met: {}, {}",
        whole.as_secs_f64(),
        done.report.updates,
        done.report.cues[0].met,
        peak_memory()
    );

    let mut slowest: BTreeMap<String, f64> = BTreeMap::new();
    for i in 0..CANCELS {
        let job = start();
        std::thread::sleep(whole * (2 * i + 1) / (2 * CANCELS));
        let stage = job.progress().stage.to_string();
        let asked = Instant::now();
        job.cancel();
        let cancelled = finish(&job).is_none();
        let seconds = asked.elapsed().as_secs_f64();
        let worst = slowest.entry(if cancelled { stage } else { "(over before)".into() }).or_default();
        *worst = worst.max(seconds);
    }
    for (stage, seconds) in slowest {
        println!("  cancelled in {stage:32} {:5.1} ms at the most", 1e3 * seconds);
    }
}

fn start() -> Job<Synthesis> {
    Job::start(|progress: &Progress| {
        let mut settings = Settings::default();
        settings.ppo.prior = false;
        settings.ppo.updates = 4;
        settings.ppo.solved = 1.1;
        let library = starter::generate(progress)?;
        let database = MotionDatabase::build(&library, &settings.synthesizer.weights, progress)?;
        let mesh = finer(&made_room(), TRIANGLES);
        progress.check()?;
        let scene = SceneIndex::build(&mesh.positions, &mesh.triangles, &settings.scene, progress)?;
        let task = Task {
            start: InitialState::standing("Start", Vec3::new(0.6, 2.6, 0.0), 0.0),
            cue: ActionCue {
                name: "Chair".into(),
                action_type: ActionType::Sit,
                position: Vec3::new(3.9, 4.65, 0.56),
                yaw: std::f32::consts::PI,
                feet: [None, None],
            },
            passes: Vec::new(),
            manipulations: Vec::new(),
        };
        synthesize(&scene, &database, &task, None, &settings, 1, progress)
    })
    .expect("a thread")
}

/// Waits for the job; `None` where it was cancelled.
fn finish(job: &Job<Synthesis>) -> Option<Synthesis> {
    while !job.wait(Duration::from_millis(200)) {}
    match job.take() {
        Some(Ok(value)) => Some(value),
        Some(Err(Failure::Error(Error::Cancelled))) => None,
        Some(Err(failure)) => panic!("{failure}"),
        None => unreachable!("it was waited for"),
    }
}
