//! The main job, in reading order: check, find a motion, hold, measure.

use std::collections::BTreeMap;
use std::time::Instant;

use crate::controller::optimize::UpdateFigures;
use crate::controller::{Environment, EpisodeEnd, KeptMotion, KeptPolicy, keep_motion, optimize_policy};
use crate::cue::{ActionType, Task};
use crate::error::Result;
use crate::library::database::MotionDatabase;
use crate::metrics::{Residual, foot_figures, penetration_figures, residual};
use crate::motion::{FRAME_RATE, Motion};
use crate::progress::Progress;
use crate::report::{PolicySource, REPORT_VERSION, Report};
use crate::scene::{SceneIndex, check_task};
use crate::settings::{KeptSettings, Settings};

/// A motion, its report, and the policy that played it.
#[derive(Debug, Clone)]
pub struct Synthesis {
    pub motion: Motion,
    pub report: Report,
    /// To be kept for the next task in the scene.
    pub policy: KeptPolicy,
}

/// M = LAMA(W, Φ, g_init) (LAMA, eq. 1), up to the motion editor.
///
/// `kept` is a policy for the scene and the library: where it serves the task its motion is taken at once, and where
/// it does not it is fine-tuned (section 3.5). Without one the shipped prior takes its place, unless the settings have
/// a policy begin from scratch. The same seed, settings and policy give the same motion on any number of threads.
///
/// # Errors
/// `Unreachable` or `Input` when the task cannot be met as given, before anything is optimized; `Cancelled`.
pub fn synthesize(
    scene: &SceneIndex,
    database: &MotionDatabase,
    task: &Task,
    kept: Option<&KeptPolicy>,
    settings: &Settings,
    seed: u64,
    progress: &Progress,
) -> Result<Synthesis> {
    let mut laps = Laps::new();
    progress.stage("Checking the cues");
    check_task(scene, task)?;
    let environment = Environment::new(scene, database, task, settings);
    laps.done("check");

    let (start, source) = starting_policy(kept, settings);
    let Found { mut kept, policy, learning } = find_motion(&environment, start, seed, progress, &mut laps)?;

    let complete = kept.motion.len().saturating_sub(1);
    let mut motion = std::mem::take(&mut kept.motion);
    if kept.end == EpisodeEnd::Complete {
        for _ in 0..(settings.synthesizer.hold_seconds * FRAME_RATE) as usize {
            kept.episode.character.advance(database, &Default::default());
            motion.postures.push(kept.episode.character.posture);
            motion.contacts.push(kept.episode.character.contact);
        }
    }

    progress.stage("Measuring");
    let floor = task.start.position.z;
    let sits = task.cue.action_type == ActionType::Sit && kept.end == EpisodeEnd::Complete;
    let descent = motion.postures.iter().rposition(|p| p.root_position.z - floor > 0.85).map(|f| f + 1);
    let cues: Vec<_> = residual(&task.cue, &motion, complete).into_iter().collect();
    let foot = foot_figures(&motion, floor);
    let ignore = settings.reward.ignore_below;
    let penetration = penetration_figures(&motion, scene, floor, ignore, descent.filter(|_| sits));
    laps.done("measure");

    let problems = problems(kept.end, &cues, task);
    let report = Report {
        report_version: REPORT_VERSION,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        seed,
        library_checksum: database.library_checksum.clone(),
        settings: settings.clone(),
        success: problems.is_empty(),
        problems,
        cues,
        foot,
        penetration,
        frames: motion.len(),
        path_m: kept.tally.travelled,
        shortest_path_m: environment.path.distance(task.start.planar().position),
        seconds: laps.seconds,
        policy_source: source,
        updates: learning.curve.len(),
        environment_steps: learning.environment_steps,
        environment_steps_per_second: learning.environment_steps as f32 / learning.rollout_seconds.max(1e-3),
        rollouts: kept.rollouts,
        rollouts_succeeded: kept.succeeded,
        curve: learning.curve,
    };
    Ok(Synthesis { motion, report, policy })
}

/// The policy to begin with: the scene's own, else the prior, else none.
fn starting_policy<'a>(
    kept: Option<&'a KeptPolicy>,
    settings: &Settings,
) -> (Option<&'a KeptPolicy>, PolicySource) {
    if let Some(kept) = kept.filter(|k| k.fits(settings)) {
        return (Some(kept), PolicySource::Kept);
    }
    match KeptPolicy::prior().filter(|p| settings.ppo.prior && p.fits(settings)) {
        Some(prior) => (Some(prior), PolicySource::Prior),
        None => (None, PolicySource::Scratch),
    }
}

struct Found {
    kept: KeptMotion,
    policy: KeptPolicy,
    learning: Learning,
}

#[derive(Default)]
struct Learning {
    curve: Vec<UpdateFigures>,
    environment_steps: usize,
    rollout_seconds: f32,
}

/// The motion of `start` where it serves the task, else that of a policy optimized from it.
fn find_motion(
    environment: &Environment,
    start: Option<&KeptPolicy>,
    seed: u64,
    progress: &Progress,
    laps: &mut Laps,
) -> Result<Found> {
    let settings = environment.settings;
    let task = environment.task;
    let mut origin = start.map(|s| s.origin.clone()).unwrap_or_default();
    origin.scene = environment.scene.fingerprint().to_owned();
    origin.library = environment.database.library_checksum.clone();
    origin.cues.retain(|cue| cue != &task.cue);
    origin.cues.push(task.cue.clone());

    if let Some(start) = start.filter(|_| settings.kept.glance > 0) {
        progress.stage("Playing the policy");
        let glance = KeptSettings { rollouts: settings.kept.glance, rounds: 0, ..settings.kept.clone() };
        for budget in [&glance, &settings.kept] {
            let kept = keep_motion(environment, &start.policy, budget, seed, progress)?;
            laps.done("play");
            if kept.is_clean(environment) {
                let policy = KeptPolicy { origin, ..start.clone() };
                return Ok(Found { kept, policy, learning: Learning::default() });
            }
        }
    }

    progress.stage("Optimizing");
    let begin = start.map(|s| s.policy.clone());
    let optimized = optimize_policy(std::slice::from_ref(environment), begin, seed, progress)?;
    laps.done("optimize");
    progress.stage("Choosing the best motion");
    let kept = keep_motion(environment, &optimized.policy, &settings.kept, seed, progress)?;
    laps.done("keep");
    origin.updates += optimized.curve.len();
    origin.environment_steps += optimized.environment_steps;
    origin.success_rate = kept.succeeded as f32 / kept.rollouts.max(1) as f32;
    let learning = Learning {
        curve: optimized.curve,
        environment_steps: optimized.environment_steps,
        rollout_seconds: optimized.rollout_seconds,
    };
    Ok(Found { kept, policy: KeptPolicy::new(optimized.policy, settings, origin), learning })
}

/// In words what went wrong; empty when nothing did.
fn problems(end: EpisodeEnd, cues: &[Residual], task: &Task) -> Vec<String> {
    let name = &task.cue.name;
    let sits = task.cue.action_type == ActionType::Sit;
    match end {
        EpisodeEnd::Complete => cues
            .iter()
            .filter(|cue| !cue.met)
            .map(|cue| {
                format!(
                    "Cue '{}' was missed by {:.0} cm and {:.0}°.",
                    cue.cue, cue.pelvis_cm, cue.facing_degrees
                )
            })
            .collect(),
        EpisodeEnd::Collision => vec![format!(
            "No motion reached '{name}' without running into something; make more room on the way or move the cue."
        )],
        EpisodeEnd::Stall | EpisodeEnd::TooLong => vec![format!(
            "The character got near '{name}' but found no way to finish there; turn the cue towards free floor or move it {}.",
            if sits { "nearer the front of the seat" } else { "a little" }
        )],
        EpisodeEnd::LeftScene => {
            vec!["The character left the scene; start it farther from the edge.".to_owned()]
        }
    }
}

/// Seconds of each stage, by name; a stage that comes again adds up.
struct Laps {
    begun: Instant,
    seconds: BTreeMap<String, f32>,
}

impl Laps {
    fn new() -> Self {
        Self { begun: Instant::now(), seconds: BTreeMap::new() }
    }

    fn done(&mut self, stage: &str) {
        *self.seconds.entry(stage.to_owned()).or_default() += self.begun.elapsed().as_secs_f32();
        self.begun = Instant::now();
    }
}
