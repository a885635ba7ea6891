//! The main job, in reading order: check, find a motion, hold, edit, measure.

use std::collections::BTreeMap;
use std::time::Instant;

use crate::action::ActionLabel;
use serde::{Deserialize, Serialize};

use crate::controller::optimize::UpdateFigures;
use crate::controller::{
    Environment, EpisodeEnd, KeptMotion, StoredPolicy, keep_motion, optimize_policy, request_of,
};
use crate::cue::{ActionCue, CueKind, Moments, PassCue, Performance, Task};
use crate::editor::first_step::prepare_first_step;
use crate::editor::seat::rests_from;
use crate::editor::{check_manipulations, edit_for_task, shipped_manifold};
use crate::error::Result;
use crate::figures::{BodyFigures, Company, StyleValues, Surroundings, body_figures, pose_distance_figures};
use crate::library::Segment;
use crate::library::database::MotionDatabase;
use crate::life::{Hold, enliven};
use crate::manifold::Manifold;
use crate::metrics::{
    FootFigures, PenetrationFigures, Residual, foot_figures, passed, penetration_among, residual,
    speed_figures,
};
use crate::motion::{FRAME_RATE, Motion};
use crate::progress::Progress;
use crate::report::{PolicySource, REPORT_VERSION, Report};
use crate::scene::{MovingObject, SceneIndex, check_task, short_of_knee_room};
use crate::seats::Seats;
use crate::settings::Settings;
use crate::synthesizer::unhurried;
use crate::timing::unpunctual;

/// How much more moves in the liveliest, as a part of the usual, and less in the calmest.
const LIVELIER: f32 = 0.6;

/// A motion, its report, and the policy that played it.
#[derive(Debug, Clone)]
pub struct Synthesis {
    /// M, edited.
    pub motion: Motion,
    /// How the episode ended that it was played in.
    pub end: EpisodeEnd,
    /// When what happens in it.
    pub moments: Moments,
    /// What of the report's problems is not of the body: cues that were missed, and what the editor could not do.
    pub not_done: Vec<String>,
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
    synthesize_along(shipped_manifold(), scene, None, database, task, stored, settings, seed, progress)
}

/// How much moves in who rests, 1 as usual.
pub(crate) fn liveliness(settings: &Settings) -> f32 {
    settings.synthesizer.life * (1.0 + LIVELIER * settings.kept.liveliness)
}

/// The same, edited along a given manifold, or by the finishing pass alone where there is none; and measured in `stays`, where
/// the scene that the motion is planned in holds what will have moved by then.
///
/// # Errors
/// As [`synthesize`].
#[allow(clippy::too_many_arguments)] // All that a motion follows from, and nothing that groups it.
pub fn synthesize_along(
    manifold: Option<&Manifold>,
    scene: &SceneIndex,
    stays: Option<&SceneIndex>,
    database: &MotionDatabase,
    task: &Task,
    stored: Option<&StoredPolicy>,
    settings: &Settings,
    seed: u64,
    progress: &Progress,
) -> Result<Synthesis> {
    synthesize_among(manifold, scene, stays, database, task, stored, settings, seed, None, progress)
}

/// The same where other people are about: of the motions that a policy plays, one that meets nobody is preferred.
///
/// # Errors
/// As [`synthesize`].
#[allow(clippy::too_many_arguments)] // All that a motion follows from, and nothing that groups it.
pub(crate) fn synthesize_among(
    manifold: Option<&Manifold>,
    scene: &SceneIndex,
    stays: Option<&SceneIndex>,
    database: &MotionDatabase,
    task: &Task,
    stored: Option<&StoredPolicy>,
    settings: &Settings,
    seed: u64,
    company: Option<Company>,
    progress: &Progress,
) -> Result<Synthesis> {
    let mut laps = Laps::new();
    progress.stage("Checking the cues");
    settings.validate()?;
    check_task(scene, task)?;
    check_manipulations(task)?;
    let environment = Environment::new(scene, database, task, settings)?.of_take(seed).among(company);
    laps.done("check");

    let request = request_of(task, settings, seed);
    let there = policies_there(stored.filter(|policy| policy.origin.request != request), settings)?;
    let Found { mut kept, policy, source, learning } =
        find_motion(&environment, &there, seed, progress, &mut laps)?;

    let mut motion = std::mem::take(&mut kept.motion);
    if settings.editor.fit && kept.end == EpisodeEnd::Complete {
        let later =
            prepare_first_step(&mut motion, task.start.position.z, task.start.body.is_some(), progress)?;
        kept.moments = kept.moments.each(|frame| frame + later);
    }
    let mut moments = kept.moments;
    let mut edited = if settings.editor.fit && kept.end == EpisodeEnd::Complete {
        let around = Surroundings::of(scene, task, &moments);
        let complete = moments.complete;
        Some(edit_for_task(&mut motion, task, complete, &around, manifold, &settings.editor, progress)?)
    } else {
        None
    };
    moments.complete = edited.as_ref().map_or(moments.complete, |e| e.complete_frame);
    laps.done("edit");

    if kept.end == EpisodeEnd::Complete {
        progress.stage("Bringing to life");
        let around = Surroundings::at_end(stays.unwrap_or(scene), &task.cue);
        let from = rests_from(&motion, moments.complete, around.seats.at_end().is_some());
        let carried = edited.as_ref().map(|e| e.carried(task)).unwrap_or_default();
        let hold = Hold {
            from,
            frames: from + (settings.synthesizer.hold_seconds * FRAME_RATE) as usize + 1,
            size: liveliness(settings),
            seed,
            floor: task.start.position.z,
            feet_free: task.cue.feet.map(|foot| foot.is_none()),
            carried: &carried,
            around,
            goes_on: false,
        };
        enliven(&mut motion, &hold, progress)?;
        laps.done("life");
    }

    // What the editor hurried, or life did, is slowed down; hands that follow a cue keep its time.
    if task.manipulations.is_empty()
        && let Some(paced) = unhurried(&motion, &database.turns)
    {
        moments = moments.each(|frame| paced.frame_of(frame));
        motion = paced.motion;
        edited.iter_mut().for_each(|e| e.complete_frame = moments.complete);
    }
    laps.done("edit");

    progress.stage("Measuring");
    let around = Around {
        scene: Some(stays.unwrap_or(scene)),
        moving: &[],
        leaves: &[],
        wait: 0,
        database: Some(database),
    };
    let measured = measure(&motion, &around, task, &moments, settings);
    let Measured { cues, foot, penetration, body, .. } = measured;
    let sits = kept.end == EpisodeEnd::Complete && task.cue.seat_height().is_some();
    let spans = segments(0, motion.len(), &moments, sits);
    let style = StyleValues::of(&motion, task.start.position.z, &spans).medians();
    laps.done("measure");

    let mut problems = problems(kept.end, &cues, scene, task);
    if kept.end != EpisodeEnd::Complete {
        let passes: Vec<Residual> =
            cues.iter().filter(|cue| cue.action_type == CueKind::Pass).cloned().collect();
        problems.extend(missed(&passes));
    }
    problems.extend(edited.iter().flat_map(|e| e.problems.clone()));
    let not_done = problems.clone();
    if kept.end == EpisodeEnd::Complete {
        problems.extend(body.problems(&settings.report));
    }
    let report = Report {
        report_version: REPORT_VERSION,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        seed,
        library_checksum: database.library_checksum.clone(),
        settings: Settings { scene: scene.settings().clone(), ..settings.clone() },
        success: problems.is_empty(),
        problems,
        cues,
        action_from: moments.action_from,
        steps: Vec::new(),
        things: Vec::new(),
        opened: Vec::new(),
        looks: Vec::new(),
        others: None,
        foot,
        penetration: penetration.unwrap_or_default(),
        speed: speed_figures(&motion, &database.turns.usual, &database.accelerations),
        body,
        style,
        edited,
        frames: motion.len(),
        path_m: kept.tally.travelled,
        shortest_path_m: environment.path.distance(0, environment.departure),
        seconds: laps.seconds,
        policy_source: source,
        updates: learning.curve.len(),
        environment_steps: learning.environment_steps,
        environment_steps_per_second: learning.environment_steps as f32 / learning.rollout_seconds.max(1e-3),
        rollouts: kept.rollouts,
        rollouts_succeeded: kept.succeeded,
        curve: learning.curve,
    };
    Ok(Synthesis { motion, end: kept.end, moments, not_done, report, policy })
}

/// What happens in the frames `first..end` of a motion, in which a cue is met: someone gets up, if anyone sat; is on foot; and, where
/// `sits`, sits down and sits to the end, which may be the frame on which the sit is complete.
pub(crate) fn segments(first: usize, end: usize, moments: &Moments, sits: bool) -> Vec<Segment> {
    let to_its_end = |label: ActionLabel, first: usize, end: usize| Segment {
        label,
        first,
        end,
        complete: end.saturating_sub(1),
    };
    let stood = moments.stood_at.unwrap_or(first);
    let sits_from = moments.action_from.filter(|_| sits);
    let mut out = vec![to_its_end(ActionLabel::Walk, stood, sits_from.unwrap_or(end))];
    if stood > first {
        out.insert(0, Segment { label: ActionLabel::StandUp, first, end: stood, complete: stood });
    }
    if let Some(from) = sits_from {
        let complete = moments.complete;
        out.push(Segment { label: ActionLabel::Sit, first: from, end: complete, complete });
        out.push(to_its_end(ActionLabel::SeatedIdle, complete, end));
    }
    out
}

/// What can be seen of a motion, whoever made it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Measured {
    /// How each cue was met.
    pub cues: Vec<Residual>,
    /// How well the feet stand.
    pub foot: FootFigures,
    /// How often the body is in the scene; `None` without one.
    pub penetration: Option<PenetrationFigures>,
    /// What an eye sees first.
    pub body: BodyFigures,
    /// In words what went wrong: a cue that was missed, and more than a brief touch of body or scene.
    pub problems: Vec<String>,
}

/// What a motion is measured in.
#[derive(Debug, Clone, Copy)]
pub struct Around<'a> {
    /// What stays where it is.
    pub scene: Option<&'a SceneIndex>,
    /// What moves: `penetration` alone counts it.
    pub moving: &'a [MovingObject],
    /// What hands open, on the motion's frames: counted wherever the scene is.
    pub leaves: &'a [MovingObject],
    /// Frames that the person waits before the motion begins.
    pub wait: usize,
    /// The library that the motion is made of, from whose poses its own are told apart.
    pub database: Option<&'a MotionDatabase>,
}

/// Measures a motion for a task.
pub fn measure(
    motion: &Motion,
    around: &Around,
    task: &Task,
    moments: &Moments,
    settings: &Settings,
) -> Measured {
    let cues = residuals(motion, &task.passes, &task.cue, 0, moments.complete);
    measure_cues(motion, around, task.start.position.z, task.seats(moments), cues, settings)
}

/// Measures the motion of a performance; `moments`: of each of its steps that was played, in frames of the whole motion.
pub fn measure_performance(
    motion: &Motion,
    around: &Around,
    performance: &Performance,
    moments: &[Moments],
    settings: &Settings,
) -> Measured {
    let first = std::iter::once(0).chain(moments.iter().map(|m| m.complete));
    let steps = performance.steps.iter().zip(moments).zip(first);
    let cues = steps
        .flat_map(|((step, m), first)| residuals(motion, &step.passes, &step.cue, first, m.complete))
        .collect();
    let (floor, seats) = (performance.start.position.z, performance.seats(moments));
    let mut measured = measure_cues(motion, around, floor, seats, cues, settings);
    measured.problems.extend(unpunctual(performance, moments));
    measured
}

/// How the waypoints on the way to a cue are passed from frame `first` on, and how it is met on frame `complete`.
fn residuals(
    motion: &Motion,
    passes: &[PassCue],
    cue: &ActionCue,
    first: usize,
    complete: usize,
) -> Vec<Residual> {
    let mut found = passed(passes, motion, first, complete);
    found.extend(residual(cue, motion, complete));
    found
}

fn measure_cues(
    motion: &Motion,
    around: &Around,
    floor: f32,
    seats: Seats,
    cues: Vec<Residual>,
    settings: &Settings,
) -> Measured {
    let penetration = around.scene.map(|scene| {
        let ignore_below = settings.reward.ignore_below;
        let moving = [(around.moving, around.wait), (around.leaves, 0)];
        penetration_among(motion, scene, &moving, floor, ignore_below, &seats)
    });
    let surroundings =
        around.scene.map(|scene| Surroundings { moving: around.leaves, ..Surroundings::with(scene, seats) });
    let mut body = body_figures(motion, floor, surroundings.as_ref());
    body.pose_distance =
        around.database.map(|database| pose_distance_figures(motion, database.known_poses(), around.scene));
    let mut problems = missed(&cues);
    problems.extend(body.problems(&settings.report));
    Measured { foot: foot_figures(motion, floor), penetration, cues, body, problems }
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
        EpisodeEnd::Complete => missed(cues),
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

/// What is said of each cue that was missed.
fn missed(cues: &[Residual]) -> Vec<String> {
    let said = |cue: &Residual| match cue.action_type {
        CueKind::Pass => format!("Cue '{}' was passed {:.0} cm away.", cue.cue, cue.pelvis_cm),
        CueKind::Sit | CueKind::Stop => {
            format!("Cue '{}' was missed by {:.0} cm and {:.0}°.", cue.cue, cue.pelvis_cm, cue.facing_degrees)
        }
    };
    cues.iter().filter(|cue| !cue.met).map(said).collect()
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Error;
    use crate::test_world::{World, close, database, stop_cue};
    use glam::{Vec2, Vec3};

    fn found(world: &World, there: &[(&StoredPolicy, PolicySource)], seed: u64) -> Found {
        let environment = world.environment();
        find_motion(&environment, there, seed, &Progress::new(), &mut Laps::new()).expect("not cancelled")
    }

    #[test]
    fn the_prior_comes_before_what_was_stored() {
        let mut settings = Settings::default();
        let stored =
            StoredPolicy { origin: Default::default(), ..StoredPolicy::prior().expect("shipped").clone() };
        let sources = |stored: Option<&StoredPolicy>, settings: &Settings| -> Vec<PolicySource> {
            policies_there(stored, settings).expect("a sound prior").iter().map(|p| p.1).collect()
        };
        assert_eq!(sources(Some(&stored), &settings), [PolicySource::Prior, PolicySource::Stored]);
        assert_eq!(sources(None, &settings), [PolicySource::Prior]);
        settings.ppo.prior = false;
        assert_eq!(sources(Some(&stored), &settings), [PolicySource::Stored]);
        assert_eq!(sources(None, &settings), []);
        // Neither is played with states or signals that it does not know.
        settings.ppo.prior = true;
        settings.state.view_cells = 5;
        assert_eq!(sources(Some(&stored), &settings), []);
    }

    #[test]
    fn a_policy_that_serves_is_played_and_not_optimized() {
        let world = World::stop_ahead(2.0);
        let (good, other) = (world.stored(), world.stored());
        let there = [(&good, PolicySource::Prior), (&other, PolicySource::Stored)];
        let found = found(&world, &there, 3);
        assert_eq!((found.source, found.kept.end), (PolicySource::Prior, EpisodeEnd::Complete));
        assert_eq!((found.learning.curve.len(), found.learning.environment_steps), (0, 0));
        assert_eq!(found.policy.policy, good.policy);
        assert_eq!(found.policy.origin.cues, std::slice::from_ref(&world.task.cue));
        assert_eq!(found.policy.origin.scene, world.scene.fingerprint());
        assert_eq!(found.policy.origin.library, database().library_checksum);
    }

    #[test]
    fn the_second_policy_is_played_where_the_first_does_not_serve() {
        let world = World::stop_ahead(2.0);
        let good = world.stored();
        let mut bad = world.stored();
        // It always wants to go back.
        let outputs = bad.policy.policy.parameters.len();
        let width = bad.policy.sizes().1;
        bad.policy.policy.parameters[outputs - width + crate::controller::policy::TYPE_COUNT + 1] = 3.0;
        let there = [(&bad, PolicySource::Prior), (&good, PolicySource::Stored)];
        let found = found(&world, &there, 3);
        assert_eq!((found.source, found.learning.curve.len()), (PolicySource::Stored, 0));
        assert!(world.environment().is_clean(found.kept.end, &found.kept.tally));
    }

    #[test]
    fn the_better_of_before_and_after_optimizing_is_kept() {
        let mut world = World::new(&[], crate::math::Planar::default(), stop_cue(Vec2::new(0.0, -2.5), 0.0));
        // Nothing is complete so early: the motion that came nearest is the best.
        world.settings.termination.longest = 30;
        world.settings.ppo.updates = 0;
        let policy = world.stored();
        let (mut before_was_better, mut after_was_better) = (0, 0);
        for seed in 0..24 {
            let played = |seed: u64| {
                keep_motion(&world.environment(), &policy.policy, seed, &Progress::new())
                    .expect("played")
                    .cost
            };
            let (before, after) = (played(seed), played(seed + AGAIN));
            let found = found(&world, &[(&policy, PolicySource::Stored)], seed);
            assert_eq!(found.kept.cost, before.min(after));
            assert_eq!(found.source, PolicySource::Stored);
            before_was_better += usize::from(before < after);
            after_was_better += usize::from(after < before);
        }
        assert!(before_was_better > 0 && after_was_better > 0, "{before_was_better} {after_was_better}");
    }

    #[test]
    fn what_is_optimized_remembers_what_for() {
        let mut world = World::stop_ahead(2.0);
        world.settings.termination.longest = 40;
        world.settings.ppo.solved = 2.0;
        let mut earlier = world.stored();
        earlier.origin.updates = 5;
        earlier.origin.environment_steps = 1000;
        earlier.origin.cues = vec![world.task.cue.clone(), stop_cue(Vec2::ONE, 1.0)];
        let found = found(&world, &[(&earlier, PolicySource::Stored)], 4);
        let origin = &found.policy.origin;
        assert_eq!(found.learning.curve.len(), 2);
        assert_eq!(found.learning.environment_steps, 512);
        assert_eq!((origin.updates, origin.environment_steps), (7, 1512));
        assert_eq!(origin.request, request_of(&world.task, &world.settings, 4));
        assert_eq!(origin.cues, [stop_cue(Vec2::ONE, 1.0), world.task.cue.clone()]);
        close(origin.success_rate, found.kept.succeeded as f32 / found.kept.rollouts as f32, 1e-6);
        assert_ne!(found.policy.policy, earlier.policy);
        // From nothing it is from scratch.
        world.settings.ppo.updates = 1;
        assert_eq!(super::tests::found(&world, &[], 4).source, PolicySource::Scratch);
    }

    #[test]
    fn the_job_reports_what_it_did() {
        let world = World::stop_ahead(2.0);
        let stored = world.stored();
        let run = |world: &World, stored: Option<&StoredPolicy>| {
            let (scene, task, settings) = (&world.scene, &world.task, &world.settings);
            synthesize_along(None, scene, None, database(), task, stored, settings, 3, &Progress::new())
        };
        let made = run(&world, Some(&stored)).expect("a motion");
        let report = &made.report;
        assert!(report.success && report.problems.is_empty(), "{:?}", report.problems);
        assert_eq!((report.policy_source, report.updates, report.seed), (PolicySource::Stored, 0, 3));
        assert_eq!((report.frames, report.rollouts), (made.motion.len(), 6));
        let cue = &report.cues[0];
        assert!(cue.met && cue.pelvis_cm < 10.0 && cue.facing_degrees < 20.0, "{cue:?}");
        close(report.shortest_path_m, 2.0, 0.1);
        assert!(report.path_m > 1.9 && report.path_m < 2.6, "{}", report.path_m);
        assert_eq!(report.penetration.percent, 0.0);
        assert!(report.rollouts_succeeded > 0);
        let stages: Vec<&str> = report.seconds.keys().map(String::as_str).collect();
        assert_eq!(stages, ["check", "edit", "life", "measure", "play"]);
        assert!(report.edited.is_some());
        // The same request again is not played with what came of it.
        let mut own = stored.clone();
        own.origin.request = request_of(&world.task, &world.settings, 3);
        assert_eq!(run(&world, Some(&own)).expect("a motion").report.policy_source, PolicySource::Scratch);
        // Without the editor.
        let mut world = world;
        world.settings.editor.fit = false;
        assert!(run(&world, Some(&stored)).expect("a motion").report.edited.is_none());
        // A way through a plate over the floor is a motion, and its report says what it touches.
        let plate = crate::test_world::room(&[([-3.0, -1.4, 1.25], [3.0, -0.8, 1.3])]);
        let through = World { scene: plate, ..world };
        let made = run(&through, Some(&stored)).expect("a motion");
        assert!(made.report.penetration.whole_body_percent > 0.0, "{:?}", made.report.penetration);
    }

    #[test]
    fn a_task_that_cannot_be_done_is_refused_before_anything_is_played() {
        let mut world = World::stop_ahead(2.0);
        world.scene = crate::test_world::room(&[([-3.0, -1.0, 0.0], [3.0, -0.9, 2.0])]);
        let run = |world: &World| {
            let (scene, task, settings) = (&world.scene, &world.task, &world.settings);
            synthesize_along(None, scene, None, database(), task, None, settings, 3, &Progress::new())
                .unwrap_err()
        };
        assert!(matches!(run(&world), Error::Unreachable(_)));
        let mut world = World::stop_ahead(2.0);
        world.task.manipulations = vec![crate::ManipulationCue {
            name: "Rail".into(),
            hand: crate::Hand::Left,
            path: Vec::new(),
            first_frame: None,
        }];
        assert!(run(&world).to_string().contains("‘Rail’"));
        world.settings.ppo.discount = 2.0;
        assert!(run(&world).to_string().contains("discount"));
    }

    #[test]
    fn every_end_has_its_sentence() {
        let world = World::stop_ahead(2.0);
        let said = |end: EpisodeEnd, cues: &[Residual]| problems(end, cues, &world.scene, &world.task);
        let residual = |met: bool| Residual {
            cue: "There".into(),
            action_type: CueKind::Stop,
            frame: 9,
            pelvis_cm: 23.4,
            facing_degrees: 31.2,
            feet_cm: [None; 2],
            met,
        };
        assert_eq!(said(EpisodeEnd::Complete, &[residual(true)]), Vec::<String>::new());
        assert_eq!(
            said(EpisodeEnd::Complete, &[residual(false)]),
            ["Cue 'There' was missed by 23 cm and 31°."]
        );
        let pass = |met| Residual { action_type: CueKind::Pass, ..residual(met) };
        assert_eq!(
            said(EpisodeEnd::Complete, &[pass(false), pass(true)]),
            ["Cue 'There' was passed 23 cm away."]
        );
        let one = |end: EpisodeEnd, part: &str| {
            let said = said(end, &[residual(true)]);
            assert!(said.len() == 1 && said[0].contains(part), "{said:?}");
        };
        one(EpisodeEnd::Collision, "without running into something");
        one(EpisodeEnd::Stall, "no way to finish there");
        one(EpisodeEnd::TooLong, "move it a little");
        one(EpisodeEnd::LeftScene, "left the scene");
        // A seat without room for the knees is why nothing ended there.
        let mut sits = World::stool();
        sits.scene = crate::test_world::room(&[
            ([-0.2, 0.15, 0.0], [0.2, 0.5, 0.44]),
            ([-1.0, -0.4, 0.5], [1.0, -0.1, 1.0]),
        ]);
        sits.task.cue.position = Vec3::new(0.0, 0.32, 0.54);
        let said = problems(EpisodeEnd::Stall, &[], &sits.scene, &sits.task);
        assert!(
            said.len() == 1 && said[0].contains("0.42 m in front") && said[0].contains("0.48 m"),
            "{said:?}"
        );
        assert!(problems(EpisodeEnd::Complete, &[], &sits.scene, &sits.task).is_empty());
    }

    #[test]
    fn a_stage_that_comes_again_adds_up() {
        let mut laps = Laps::new();
        for _ in 0..2 {
            std::thread::sleep(std::time::Duration::from_millis(4));
            laps.done("play");
        }
        laps.done("keep");
        assert!(laps.seconds["play"] >= 0.008 && laps.seconds["keep"] < laps.seconds["play"]);
    }
}
