//! The main job, in reading order: check, find a motion, hold, edit, measure.

use std::collections::BTreeMap;
use std::time::Instant;

use crate::controller::optimize::UpdateFigures;
use crate::controller::{
    Environment, EpisodeEnd, KeptMotion, StoredPolicy, keep_motion, optimize_policy, request_of,
};
use crate::cue::Task;
use crate::editor::{check_manipulations, edit_for_task, shipped_manifold};
use crate::error::Result;
use crate::figures::{Surroundings, body_figures};
use crate::library::database::MotionDatabase;
use crate::manifold::Manifold;
use crate::metrics::{Residual, foot_figures, penetration_figures, residual, speed_figures};
use crate::motion::Motion;
use crate::progress::Progress;
use crate::report::{PolicySource, REPORT_VERSION, Report};
use crate::scene::{SceneIndex, check_task, short_of_knee_room};
use crate::settings::Settings;

/// A motion, its report, and the policy that played it.
#[derive(Debug, Clone)]
pub struct Synthesis {
    /// M, edited.
    pub motion: Motion,
    /// What it is worth, and what went wrong.
    pub report: Report,
    /// To be kept for the next task in the scene.
    pub policy: StoredPolicy,
}

/// M = LAMA(W, Φ, g_init) (LAMA, eq. 1), edited to fit its seat and its hands' cues.
///
/// `stored` is a policy of the same scene and library. Where the shipped prior, or else `stored`, serves the task, its
/// motion is taken at once; where neither does, `stored` (or the prior) is fine-tuned (section 3.5). The prior comes first so
/// that a motion depends on what was stored only where the prior fails, and the same request again begins as it did the first
/// time. Settings may have every policy begin from scratch. The same seed, settings and policy give the same motion on any number of threads.
///
/// # Errors
/// `Unreachable` or `Input` when the task cannot be met as given, and `Input` for settings out of range, before anything is
/// optimized; `DataFile` where this build carries a damaged policy; `Cancelled`.
pub fn synthesize(
    scene: &SceneIndex,
    database: &MotionDatabase,
    task: &Task,
    stored: Option<&StoredPolicy>,
    settings: &Settings,
    seed: u64,
    progress: &Progress,
) -> Result<Synthesis> {
    synthesize_along(shipped_manifold(), scene, database, task, stored, settings, seed, progress)
}

/// The same, edited along a given manifold, or by the finishing pass alone where there is none.
///
/// # Errors
/// As [`synthesize`].
#[allow(clippy::too_many_arguments)] // All that a motion follows from, and nothing that groups it.
pub fn synthesize_along(
    manifold: Option<&Manifold>,
    scene: &SceneIndex,
    database: &MotionDatabase,
    task: &Task,
    stored: Option<&StoredPolicy>,
    settings: &Settings,
    seed: u64,
    progress: &Progress,
) -> Result<Synthesis> {
    let mut laps = Laps::new();
    progress.stage("Checking the cues");
    settings.validate()?;
    check_task(scene, task)?;
    check_manipulations(task)?;
    let environment = Environment::new(scene, database, task, settings)?;
    laps.done("check");

    let request = request_of(task, settings, seed);
    let there = policies_there(stored.filter(|policy| policy.origin.request != request), settings)?;
    let Found { mut kept, policy, source, learning } =
        find_motion(&environment, &there, seed, progress, &mut laps)?;

    let complete = kept.complete;
    let mut motion = std::mem::take(&mut kept.motion);
    let edited = if settings.editor.fit && kept.end == EpisodeEnd::Complete {
        Some(edit_for_task(&mut motion, task, complete, scene, manifold, &settings.editor, progress)?)
    } else {
        None
    };
    let complete = edited.as_ref().map_or(complete, |e| e.complete_frame);
    laps.done("edit");

    progress.stage("Measuring");
    let floor = task.start.position.z;
    let seat = kept.action_from.zip(task.cue.seat_height());
    let cues: Vec<_> = residual(&task.cue, &motion, complete).into_iter().collect();
    let foot = foot_figures(&motion, floor);
    let ignore = settings.reward.ignore_below;
    let penetration = penetration_figures(&motion, scene, floor, ignore, seat);
    let surroundings = Surroundings { scene, ignore_below: ignore, seat };
    let body = body_figures(&motion, floor, Some(&surroundings));
    laps.done("measure");

    let mut problems = problems(kept.end, &cues, scene, task);
    problems.extend(edited.iter().flat_map(|e| e.problems.clone()));
    let report = Report {
        report_version: REPORT_VERSION,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        seed,
        library_checksum: database.library_checksum.clone(),
        settings: Settings { scene: scene.settings().clone(), ..settings.clone() },
        success: problems.is_empty(),
        problems,
        cues,
        foot,
        penetration,
        speed: speed_figures(&motion, &database.turns.usual, &database.accelerations),
        body,
        edited,
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

/// The policies that can be played before any is optimized.
fn policies_there<'a>(
    stored: Option<&'a StoredPolicy>,
    settings: &Settings,
) -> Result<Vec<(&'a StoredPolicy, PolicySource)>> {
    let prior = if settings.ppo.prior { Some((StoredPolicy::prior()?, PolicySource::Prior)) } else { None };
    let stored = stored.map(|policy| (policy, PolicySource::Stored));
    Ok(prior.into_iter().chain(stored).filter(|(policy, _)| policy.fits(settings)).collect())
}

/// Between the seeds of the rollouts before and after optimizing.
const AGAIN: u64 = 1 << 32;

struct Found {
    kept: KeptMotion,
    policy: StoredPolicy,
    source: PolicySource,
    learning: Learning,
}

#[derive(Default)]
struct Learning {
    curve: Vec<UpdateFigures>,
    environment_steps: usize,
    rollout_seconds: f32,
}

/// The motion of a policy that is there where one serves the task, else that of one optimized from the last of them.
fn find_motion(
    environment: &Environment,
    there: &[(&StoredPolicy, PolicySource)],
    seed: u64,
    progress: &Progress,
    laps: &mut Laps,
) -> Result<Found> {
    let settings = environment.settings;
    let task = environment.task;
    let origin_from = |start: Option<&StoredPolicy>| {
        let mut origin = start.map(|s| s.origin.clone()).unwrap_or_default();
        origin.scene = environment.scene.fingerprint().to_owned();
        origin.library = environment.database.library_checksum.clone();
        origin.cues.retain(|cue| cue != &task.cue);
        origin.cues.push(task.cue.clone());
        origin
    };

    progress.stage("Playing the policy");
    let mut before: Option<KeptMotion> = None;
    for &(start, source) in there {
        let kept = keep_motion(environment, &start.policy, seed, progress)?;
        laps.done("play");
        if environment.is_clean(kept.end, &kept.tally) {
            let policy = StoredPolicy { origin: origin_from(Some(start)), ..start.clone() };
            return Ok(Found { kept, policy, source, learning: Learning::default() });
        }
        before = before.into_iter().chain([kept]).min_by(|a, b| a.cost.total_cmp(&b.cost));
    }

    let (start, source) =
        there.last().map_or((None, PolicySource::Scratch), |&(p, source)| (Some(p), source));
    progress.stage("Optimizing");
    let begin = start.map(|s| s.policy.clone());
    let optimized = optimize_policy(std::slice::from_ref(environment), begin, seed, progress)?;
    laps.done("optimize");
    progress.stage("Choosing the best motion");
    // Other rollouts than before: where the policy needed no update, the same would come again.
    let mut kept = keep_motion(environment, &optimized.policy, seed.wrapping_add(AGAIN), progress)?;
    laps.done("keep");
    let mut origin = origin_from(start);
    origin.request = request_of(task, settings, seed);
    origin.updates += optimized.curve.len();
    origin.environment_steps += optimized.environment_steps;
    origin.success_rate = kept.succeeded as f32 / kept.rollouts.max(1) as f32;
    if let Some(before) = before.filter(|before| before.cost < kept.cost) {
        kept = before;
    }
    let learning = Learning {
        curve: optimized.curve,
        environment_steps: optimized.environment_steps,
        rollout_seconds: optimized.rollout_seconds,
    };
    Ok(Found { kept, policy: StoredPolicy::new(optimized.policy, settings, origin), source, learning })
}

/// In words what went wrong; empty when nothing did.
fn problems(end: EpisodeEnd, cues: &[Residual], scene: &SceneIndex, task: &Task) -> Vec<String> {
    let name = &task.cue.name;
    if let Some((ahead, needed)) =
        short_of_knee_room(scene, &task.cue).filter(|_| end != EpisodeEnd::Complete)
    {
        return vec![format!(
            "No motion ends at '{name}': something stands {ahead:.2} m in front of the pelvis, and knees need {needed:.2} m; move the \
             cue back, turn it, or move what stands there."
        )];
    }
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
            task.cue.action_type.spec().remedy
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
