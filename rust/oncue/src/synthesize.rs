//! The main job, in reading order: check, match, optimize, keep, hold, measure.

use std::collections::BTreeMap;
use std::time::Instant;

use crate::controller::{Environment, EpisodeEnd, keep_motion, optimize_policy};
use crate::cue::{ActionType, Task};
use crate::error::Result;
use crate::library::MotionLibrary;
use crate::library::database::MotionDatabase;
use crate::metrics::{foot_figures, penetration_figures, residual};
use crate::motion::{FRAME_RATE, Motion};
use crate::progress::Progress;
use crate::report::{REPORT_VERSION, Report};
use crate::scene::{SceneIndex, check_task};
use crate::settings::Settings;

/// A motion and its report.
#[derive(Debug, Clone)]
pub struct Synthesis {
    pub motion: Motion,
    pub report: Report,
}

/// M = LAMA(W, Φ, g_init) (LAMA, eq. 1), up to the motion editor.
///
/// The same seed gives the same motion on any number of threads.
///
/// # Errors
/// `Unreachable` or `Input` when the task cannot be met as given, before anything is optimized; `Cancelled`.
pub fn synthesize(
    scene: &SceneIndex,
    library: &MotionLibrary,
    task: &Task,
    settings: &Settings,
    seed: u64,
    progress: &Progress,
) -> Result<Synthesis> {
    let mut seconds = BTreeMap::new();
    let mut lap = Instant::now();
    let mut stage_done = |name: &str| {
        seconds.insert(name.to_owned(), lap.elapsed().as_secs_f32());
        lap = Instant::now();
    };

    progress.stage("Checking the cues");
    check_task(scene, task)?;
    stage_done("check");

    progress.stage("Preparing the motion library");
    let database = MotionDatabase::build(library, &settings.synthesizer.weights, progress)?;
    let environment = Environment::new(scene, &database, task, settings);
    stage_done("prepare");
    progress.check()?;

    progress.stage("Optimizing");
    let optimized = optimize_policy(&environment, None, seed, progress)?;
    stage_done("optimize");

    progress.stage("Choosing the best motion");
    let mut kept = keep_motion(&environment, &optimized.policy, seed, progress)?;
    let complete = kept.motion.len().saturating_sub(1);
    let hold = (settings.synthesizer.hold_seconds * FRAME_RATE) as usize;
    let mut motion = std::mem::take(&mut kept.motion);
    if kept.end == EpisodeEnd::Complete {
        for _ in 0..hold {
            kept.episode.character.advance(&database, &Default::default());
            motion.postures.push(kept.episode.character.posture);
            motion.contacts.push(kept.episode.character.contact);
        }
    }
    stage_done("keep");

    progress.stage("Measuring");
    let floor = task.start.position.z;
    let sits = task.cue.action_type == ActionType::Sit && kept.end == EpisodeEnd::Complete;
    let descent = motion.postures.iter().rposition(|p| p.root_position.z - floor > 0.85).map(|f| f + 1);
    let cues: Vec<_> = residual(&task.cue, &motion, complete).into_iter().collect();
    let foot = foot_figures(&motion, floor);
    let ignore = settings.reward.ignore_below;
    let penetration = penetration_figures(&motion, scene, floor, ignore, descent.filter(|_| sits));
    stage_done("measure");

    let mut problems = Vec::new();
    match kept.end {
        EpisodeEnd::Complete => {
            for cue in cues.iter().filter(|c| !c.met) {
                problems.push(format!(
                    "Cue '{}' was missed by {:.0} cm and {:.0}°.",
                    cue.cue, cue.pelvis_cm, cue.facing_degrees
                ));
            }
        }
        EpisodeEnd::Collision => problems.push(format!(
            "No motion reached '{}' without running into something; make more room on the way or move the cue.",
            task.cue.name
        )),
        EpisodeEnd::Stall | EpisodeEnd::TooLong => problems.push(format!(
            "The character got near '{}' but found no way to finish there; turn the cue towards free floor or move it {}.",
            task.cue.name,
            if task.cue.action_type == ActionType::Sit { "nearer the front of the seat" } else { "a little" }
        )),
        EpisodeEnd::LeftScene => {
            problems.push("The character left the scene; start it farther from the edge.".to_owned());
        }
    }
    let report = Report {
        report_version: REPORT_VERSION,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        seed,
        library_checksum: library.checksum(),
        settings: settings.clone(),
        success: problems.is_empty(),
        problems,
        cues,
        foot,
        penetration,
        frames: motion.len(),
        path_m: kept.tally.travelled,
        shortest_path_m: environment.path.distance(task.start.planar().position),
        seconds,
        updates: optimized.curve.len(),
        environment_steps: optimized.environment_steps,
        environment_steps_per_second: optimized.environment_steps as f32
            / optimized.rollout_seconds.max(1e-3),
        rollouts: kept.rollouts,
        rollouts_succeeded: kept.succeeded,
        curve: optimized.curve,
    };
    Ok(Synthesis { motion, report })
}
