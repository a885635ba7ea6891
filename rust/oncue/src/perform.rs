//! One person's performance: cues that are met one after the other, each motion going on from where the one before has ended.
//!
//! The seams lie where the person rests, on a seat or standing, so that what follows depends on nothing but the posture, and the
//! velocity, in which that rest ends: what lies before a cue that is moved stays as it was, to the bit.

use std::collections::BTreeMap;

use crate::controller::{EpisodeEnd, StoredPolicy};
use crate::cue::{ActionCue, BodyState, InitialState, LookCue, Moments, Performance, Step, Task};
use crate::editor::check_manipulations;
use crate::error::{Error, Result};
use crate::figures::{Company, Other, StyleValues, Surroundings};
use crate::hands::leaf::{Phases, check_openings};
use crate::hands::things::check_things;
use crate::hands::{CarriedThing, Hands, unopened};
use crate::library::database::MotionDatabase;
use crate::life::{Gaze, GazeFigures, Pause, look, pause};
use crate::manifold::Manifold;
use crate::math::Planar;
use crate::math::curve::smoothstep;
use crate::metrics::{passed, speed_figures};
use crate::motion::{FRAME_RATE, Motion, Posture};
use crate::progress::Progress;
use crate::report::{LookReport, Report, StepReport};
use crate::scene::{ClearPath, SceneIndex, check_task};
use crate::settings::Settings;
use crate::synthesize::{
    Around, Synthesis, liveliness, measure_performance, segments, synthesize_along, synthesize_among,
};
use crate::timing::{Timing, asked_frame, check_times, late_seconds, unpunctual};

/// Who sits down and goes on stays at least so long, seconds: nobody gets up before having sat.
const SHORTEST_SIT: f32 = 0.8;
/// Seeds of neighbouring steps are so far apart.
const STEP_SEED: u64 = 1 << 40;
/// Between the seeds of a rest and of a longer stay before it.
const HANDS_SEED: u64 = 1 << 37;

/// A performance as it was made.
#[derive(Debug, Clone)]
pub struct Performed {
    /// All of it, one motion, each cue as near to its time as people manage.
    pub motion: Motion,
    /// What it is worth as a whole, and what went wrong; `steps` tells what was played, and is shorter than what was asked for where
    /// a step could not be.
    pub report: Report,
    /// Each step as it comes; each begins with the last frame of the one before.
    pub steps: Vec<PerformedStep>,
    /// The things that were taken, in the order in which they were.
    pub carried: Vec<CarriedThing>,
}

/// One step as it was made.
#[derive(Debug, Clone)]
pub struct PerformedStep {
    /// All that it follows from, as a fingerprint; its time is none of that.
    key: blake3::Hash,
    /// What it goes on from.
    start: InitialState,
    /// Its own motion, report and policy, as it comes: at no time that was asked for.
    pub made: Synthesis,
    /// Frames that the motion begins with in which the person stays, for others to pass.
    pub waited: usize,
}

/// What every step is made with.
#[derive(Clone, Copy)]
pub(crate) struct Means<'a> {
    pub manifold: Option<&'a Manifold>,
    pub scene: &'a SceneIndex,
    pub database: &'a MotionDatabase,
    pub stored: Option<&'a StoredPolicy>,
    pub settings: &'a Settings,
    pub seed: u64,
    pub progress: &'a Progress,
}

/// Plays a performance. `earlier` is one that was made before: steps that follow from the same as then are taken from it.
///
/// A step that cannot be played ends the performance: what lies before is kept, and its `problems` say why.
///
/// # Errors
/// As [`crate::synthesize()`], for a cue that can be seen not to be met before anything is played, and for the first step; `Cancelled`.
#[allow(clippy::too_many_arguments)] // All that a motion follows from, and nothing that groups it.
pub fn perform(
    manifold: Option<&Manifold>,
    scene: &SceneIndex,
    database: &MotionDatabase,
    performance: &Performance,
    earlier: Option<&Performed>,
    stored: Option<&StoredPolicy>,
    settings: &Settings,
    seed: u64,
    progress: &Progress,
) -> Result<Performed> {
    settings.validate()?;
    progress.stage("Checking the cues");
    check_steps(performance)?;
    let phases = Phases::of(scene, performance, progress)?;
    check_in(&phases, performance)?;
    let means = Means { manifold, scene, database, stored, settings, seed, progress };
    let earlier: Vec<&Performed> = earlier.into_iter().collect();
    perform_among(&means, performance, &phases, &earlier, &[])
}

/// The same of a performance that was checked, among others whose motions are there.
pub(crate) fn perform_among(
    means: &Means,
    performance: &Performance,
    phases: &Phases,
    earlier: &[&Performed],
    others: &[Other],
) -> Result<Performed> {
    let &Means { database, settings, seed, progress, .. } = means;
    let mut steps: Vec<PerformedStep> = Vec::new();
    let mut stopped = None;
    let mut start = performance.start.clone();
    let mut before = first_key(means, performance, others);
    // The clock's frame on which the next step begins, and by how many the hands have the person stay longer before it.
    let (mut begins, mut stays) = (0, 0);
    let mut clock = Clock::new(performance, settings);
    for (at, step) in performance.steps.iter().enumerate() {
        let is_last = at + 1 == performance.steps.len();
        let hold_seconds = hold_seconds(step, is_last, settings);
        let scene = phases.before(at);
        let stands = phases.differ().then(|| scene.fingerprint());
        let key = next_key(before, step, hold_seconds, stands, stays);
        before = key;
        let known = earlier.iter().filter_map(|e| e.steps.get(at)).find(|known| known.key == key);
        let Step { passes, cue, .. } = step.clone();
        let task = Task { start: start.clone(), passes, cue, manipulations: Vec::new() };
        let made = check_hands(step, &task, others).and_then(|()| match known {
            Some(known) => Ok((known.made.clone(), known.waited)),
            None => {
                let mut settings = settings.clone();
                settings.synthesizer.hold_seconds = hold_seconds;
                let means = Means { scene, settings: &settings, seed: step_seed(seed, at), ..*means };
                means.step(&task, others, begins, is_last, steps.last())
            }
        });
        let (made, waited) = match made {
            Err(Error::Cancelled) => return Err(Error::Cancelled),
            Err(error) if at == 0 => return Err(error),
            Err(error) => {
                stopped = Some(error.to_string());
                break;
            }
            Ok(made) => made,
        };
        if at > 0 && made.end != EpisodeEnd::Complete {
            stopped = Some(made.not_done.join(" "));
            break;
        }
        let next = end_of(&made.motion, &step.cue, performance.start.position.z);
        let ended = made.end == EpisodeEnd::Complete;
        if !others.is_empty() {
            (begins, stays) = clock.after(at, &made);
        }
        steps.push(PerformedStep { key, start: std::mem::replace(&mut start, next), made, waited });
        if !ended {
            break;
        }
        // Nobody walks on through what was not opened.
        stopped = if is_last { None } else { unopened(performance, at, &steps[at].made.motion) };
        if stopped.is_some() {
            break;
        }
    }
    let floor = performance.start.position.z;
    let timing = Timing { scene: phases.without(), database, settings, floor, progress };
    joined(&timing, means.manifold, performance, phases, steps, stopped, seed)
}

/// The clock of who plays among others: what is played so far, with the stays that hands ask for.
struct Clock<'a> {
    hands: Hands<'a>,
    /// As [`joined`] will have it, but that who stays for a hand does not move here.
    motion: Motion,
    stays: usize,
}

impl<'a> Clock<'a> {
    fn new(performance: &'a Performance, settings: &'a Settings) -> Self {
        Self { hands: Hands::new(performance, settings), motion: Motion::default(), stays: 0 }
    }

    /// The frame on which the step after this one begins, and how many of them are a longer stay for the hands.
    fn after(&mut self, at: usize, made: &Synthesis) -> (usize, usize) {
        let first_frame = self.motion.len().saturating_sub(1) + self.stays;
        if let (Some(&posture), Some(&contact)) = (self.motion.postures.last(), self.motion.contacts.last()) {
            self.motion.postures.resize(self.motion.len() + self.stays, posture);
            self.motion.contacts.resize(self.motion.postures.len(), contact);
        }
        append(&mut self.motion, &made.motion);
        if made.end == EpisodeEnd::Complete {
            let until = self.hands.begin(at, &self.motion, first_frame + made.moments.complete);
            self.stays = (until + 1).saturating_sub(self.motion.len());
        }
        (self.motion.len() + self.stays, self.stays)
    }
}

/// Refuses paths of hands that can be seen not to be followed at a step's cue.
fn check_hands(step: &Step, task: &Task, others: &[Other]) -> Result<()> {
    let Some(first) = step.manipulations.first() else { return Ok(()) };
    // A path has a time of its own, and who lets somebody pass comes later.
    if !others.is_empty() {
        return Err(Error::input(format!(
            "A hand follows ‘{}’ where one person plays alone; take it away, or the other starts.",
            first.name
        )));
    }
    check_manipulations(&Task { manipulations: step.manipulations.clone(), ..task.clone() })
}

/// Of who waits for others to pass, seeds of what moves meanwhile are so far from those of what moves later.
const WAIT_SEED: u64 = 1 << 39;
/// So long somebody waits for others to pass, seconds; and so long without looking for a way round them.
const LONGEST_WAIT: f32 = 30.0;
const SHORT_WAIT: f32 = 1.0;
/// So many ways round others are looked for.
const DETOURS: usize = 2;
/// Nearer to a start, waypoint or cue than this nobody's going by is planned around, metres: one would not get there.
const ROOM: f32 = 0.5;
/// A step takes no longer, seconds for a metre as the crow flies and besides.
const STEP_SECONDS: (f32, f32) = (1.5, 4.0);

impl Means<'_> {
    fn alone(&self, scene: &SceneIndex, task: &Task) -> Result<Synthesis> {
        let &Means { manifold, database, stored, settings, seed, progress, .. } = self;
        synthesize_along(manifold, scene, None, database, task, stored, settings, seed, progress)
    }

    /// The motion of a step after `last`: beside others where there are some, and out of a seat by the side where its front is taken up.
    /// Also the frames that the person waits at its start.
    fn step(
        &self,
        task: &Task,
        others: &[Other],
        begins: usize,
        is_last: bool,
        last: Option<&PerformedStep>,
    ) -> Result<(Synthesis, usize)> {
        let play = |task: &Task, begins: usize| match others.is_empty() {
            true => self.alone(self.scene, task).map(|made| (made, 0)),
            false => self.among(task, &Company { others, begins, stays: is_last, most_wait: 0 }),
        };
        if let Some((rest, stands)) = leaving_by_the_side(self.scene, &task.start, last) {
            let task = Task { start: stands, ..task.clone() };
            match play(&task, begins + rest.len()) {
                Err(Error::Cancelled) => return Err(Error::Cancelled),
                Ok((mut made, waited)) if made.end == EpisodeEnd::Complete => {
                    made.moments.stood_at = Some(rest.len());
                    put_before(&mut made, rest);
                    return Ok((made, waited));
                }
                // As if there were nothing in the way of the knees.
                _ => {}
            }
        }
        play(task, begins)
    }

    /// A motion for the task that meets nobody, where one is found: others who stay are in the way as furniture is; whoever goes by
    /// is let pass, or walked around. Also the frames that the person waits for others at its start, which it then begins with.
    fn among(&self, task: &Task, company: &Company) -> Result<(Synthesis, usize)> {
        let &Means { manifold, scene, database, stored, settings, seed, progress } = self;
        let company = Company { most_wait: (LONGEST_WAIT * FRAME_RATE) as usize, ..*company };
        let play = |scene: &SceneIndex, learnt: Option<&StoredPolicy>| {
            let company = Some(company);
            // What was learnt for one way round is tried on the next, and no more is learnt for the step.
            let mut settings = settings.clone();
            settings.ppo.updates = if learnt.is_some() { 0 } else { settings.ppo.updates };
            let stored = learnt.or(stored);
            synthesize_among(
                manifold, scene, None, database, task, stored, &settings, seed, company, progress,
            )
        };
        let mut learnt: Option<StoredPolicy> = None;
        let places = task.places();
        let flies: f32 = places.windows(2).map(|way| way[0].distance(way[1])).sum();
        let lasts = STEP_SECONDS.0 * flies + STEP_SECONDS.1 + settings.synthesizer.hold_seconds;
        let mut solids = Vec::new();
        company.resting((lasts * FRAME_RATE) as usize, &mut solids);
        let mut best: Option<(Synthesis, Option<usize>)> = None;
        for detour in 0..=DETOURS {
            let crowded = if solids.is_empty() { None } else { Some(scene.with(&solids, progress)?) };
            let made = match play(crowded.as_ref().unwrap_or(scene), learnt.as_ref()) {
                // Whoever stays in the only way may leave it, and is met where not.
                Err(Error::Input(_) | Error::Unreachable(_)) if crowded.is_some() && detour == 0 => {
                    solids.clear();
                    play(scene, learnt.as_ref())?
                }
                Err(Error::Input(_) | Error::Unreachable(_)) if best.is_some() => break,
                made => made?,
            };
            if made.report.updates > 0 {
                learnt = Some(made.policy.clone());
            }
            let wait = company.wait(&made.motion);
            let known = solids.len();
            company.in_the_way(&made.motion, &places, ROOM, &mut solids);
            let is_new = solids.len() > known;
            let is_fine = made.end == EpisodeEnd::Complete
                && wait.is_some_and(|wait| wait as f32 <= SHORT_WAIT * FRAME_RATE);
            let rank = |made: &Synthesis, wait: Option<usize>| {
                let frames = wait.unwrap_or(0) + made.motion.len();
                (made.end != EpisodeEnd::Complete, wait.is_none(), made.report.problems.len(), frames)
            };
            if best.as_ref().is_none_or(|(best, its)| rank(&made, wait) < rank(best, *its)) {
                best = Some((made, wait));
            }
            if is_fine || !is_new {
                break;
            }
        }
        let Some((mut made, wait)) = best else { return Err(Error::Cancelled) };
        let wait = wait.unwrap_or(0);
        if wait > 0 {
            self.wait_before(&mut made, wait, task, &company)?;
        }
        Ok((made, wait))
    }

    /// Has a motion begin so many frames later.
    fn wait_before(&self, made: &mut Synthesis, frames: usize, task: &Task, company: &Company) -> Result<()> {
        let rest = |size: f32| {
            let asked = Pause {
                frames,
                before: task.start.body.as_ref().map(|body| body.postures[0]),
                size,
                seed: self.seed.wrapping_add(WAIT_SEED),
                floor: task.start.position.z,
                around: Surroundings::at_start(self.scene, &task.start),
            };
            pause(&made.motion, &asked, self.progress)
        };
        let lively = rest(liveliness(self.settings))?;
        // Who is as near to somebody as can be keeps still.
        let rest = if company.is_free(&lively) { lively } else { rest(0.0)? };
        put_before(made, rest);
        Ok(())
    }
}

/// Has a motion come after another, whose last frame would be its first.
fn put_before(made: &mut Synthesis, rest: Motion) {
    let frames = rest.len();
    made.motion.postures.splice(0..0, rest.postures);
    made.motion.contacts.splice(0..0, rest.contacts);
    made.moments = made.moments.each(|frame| frame + frames);
    let report = &mut made.report;
    report.frames += frames;
    report.action_from = report.action_from.map(|frame| frame + frames);
    report.cues.iter_mut().for_each(|cue| cue.frame += frames);
    report.edited.iter_mut().for_each(|edited| edited.complete_frame += frames);
}

/// Who sits has settled so long after the sit is complete, frames; and whoever has settled otherwise since does so as then within
/// so many.
const SETTLED: usize = 50;
const RESETTLES: usize = 24;
/// Who sits still begins to move within so many frames.
const SETS_IN: f32 = 16.0;
/// A pelvis this much lower than where the sit is entered is on its way down, metres.
const GOES_DOWN: f32 = 0.03;

/// How somebody leaves a seat whose front is taken up, as a chair at its desk: as they came onto it, the other way round in time, since
/// what got in between table and seat gets out again. Also who stands beside the seat then. None of another seat, or where it is not
/// known how it was taken.
///
/// The motion begins with the first frame that the person is to have, and would end with the posture of who stands.
fn leaving_by_the_side(
    scene: &SceneIndex,
    start: &InitialState,
    before: Option<&PerformedStep>,
) -> Option<(Motion, InitialState)> {
    let (seat, body, made) = (start.seat()?, start.body.as_ref()?, &before?.made);
    let entered = made.moments.action_from?;
    if made.end != EpisodeEnd::Complete || !ClearPath::to_cue(scene, seat).from_the_side() {
        return None;
    }
    let Motion { postures, contacts } = &made.motion;
    let complete = made.moments.complete.min(made.motion.len() - 1);
    // Where the person stood with both feet before it, as still as can be.
    let least = postures[entered].root_position.z - GOES_DOWN;
    let speed = |frame: &usize| {
        postures[*frame].root_position.distance(postures[frame.saturating_sub(1)].root_position)
    };
    let stands = (entered..complete)
        .take_while(|&frame| postures[frame].root_position.z > least)
        .filter(|&frame| contacts[frame].iter().all(|contact| *contact >= 1.0))
        .min_by(|a, b| speed(a).total_cmp(&speed(b)))
        .unwrap_or(entered);
    let settled = (complete + SETTLED).min(made.motion.len() - 1);
    let way = (settled - stands) as f32;
    let frames = (way + 0.5 * SETS_IN).ceil() as usize;
    let posture = |frame: usize| {
        let time = frame as f32;
        let gone = if time < SETS_IN { time * time / (2.0 * SETS_IN) } else { time - 0.5 * SETS_IN };
        let at = settled as f32 - gone.min(way);
        let (one, other) = (&postures[at.floor() as usize], &postures[at.ceil() as usize]);
        let as_then = blended(one, other, at.fract());
        blended(&body.postures[1], &as_then, smoothstep(time / RESETTLES as f32))
    };
    let contact =
        |frame: usize| contacts[settled - (frame.saturating_sub(SETS_IN as usize / 2)).min(settled - stands)];
    let rest =
        Motion { postures: (0..frames).map(posture).collect(), contacts: (0..frames).map(contact).collect() };
    let floor = start.position.z;
    let body = BodyState {
        postures: [posture(frames.saturating_sub(1)), posture(frames)],
        contact: contacts[stands],
        seat: None,
    };
    Some((rest, InitialState::continuing(start.name.clone(), body, floor)))
}

/// A posture between two, `part` of the way from one to the other.
fn blended(one: &Posture, other: &Posture, part: f32) -> Posture {
    if part >= 1.0 {
        return *other;
    }
    let mut out = *one;
    out.root_position = one.root_position.lerp(other.root_position, part);
    for (rotation, to) in out.rotations.iter_mut().zip(&other.rotations) {
        *rotation = rotation.slerp(*to, part).normalize();
    }
    out
}

/// What can be known of a performance before anything is played: whether each cue can be met from where the one before is met, and at
/// its time.
///
/// # Errors
/// `Input` or `Unreachable`, naming the cue.
pub fn check_performance(scene: &SceneIndex, performance: &Performance) -> Result<()> {
    check_steps(performance)?;
    check_in(&Phases::of(scene, performance, &Progress::new())?, performance)
}

/// The part of it for which the scene is needed, as it stands on the way to each cue; and times.
fn check_in(phases: &Phases, performance: &Performance) -> Result<()> {
    let tasks = tasks_of(performance);
    tasks.iter().enumerate().try_for_each(|(at, task)| check_task(phases.before(at), task))?;
    check_times(performance)
}

/// The part of it that no scene is needed for, times aside.
pub(crate) fn check_steps(performance: &Performance) -> Result<()> {
    if performance.steps.is_empty() {
        return Err(Error::input(format!(
            "Start ‘{}’ has no cue to go to; add a stop or a sit.",
            performance.start.name
        )));
    }
    for step in &performance.steps {
        if let Some(seconds) = step.hold_seconds.filter(|s| !(0.0..=600.0).contains(s)) {
            return Err(Error::input(format!(
                "The person is to stay {seconds} seconds at cue ‘{}’; give 0 to 600.",
                step.cue.name
            )));
        }
    }
    let cues: usize = performance.steps.iter().map(|step| step.passes.len() + 1).sum();
    for look in &performance.looks {
        if look.path.is_empty() || look.path.iter().any(|place| !place.is_finite()) || look.after > cues {
            return Err(Error::input(format!(
                "‘{}’ cannot be looked at: it has no place, one that is not a number, or comes after more cues than there are.",
                look.name
            )));
        }
        if let Some(seconds) = look.hold_seconds.filter(|s| !(0.0..=600.0).contains(s)) {
            return Err(Error::input(format!(
                "‘{}’ is to be looked at for {seconds} seconds; give 0 to 600.",
                look.name
            )));
        }
    }
    check_things(performance)?;
    check_openings(performance)
}

/// A performance's steps, each begun by whoever has met the cue before.
pub(crate) fn tasks_of(performance: &Performance) -> Vec<Task> {
    let floor = performance.start.position.z;
    let mut start = performance.start.clone();
    let task = |step: &Step| {
        // Which posture it is plays no part.
        let mut posture = Posture::default().moved(Planar::default(), step.cue.planar());
        posture.root_position.z += floor;
        let next = continuing(&step.cue, [posture; 2], [1.0; 2], floor);
        let start = std::mem::replace(&mut start, next);
        Task { start, passes: step.passes.clone(), cue: step.cue.clone(), manipulations: Vec::new() }
    };
    performance.steps.iter().map(task).collect()
}

/// The seed of a performance's step.
fn step_seed(seed: u64, at: usize) -> u64 {
    seed.wrapping_add(STEP_SEED.wrapping_mul(at as u64))
}

/// How long the person stays where a step ends.
fn hold_seconds(step: &Step, is_last: bool, settings: &Settings) -> f32 {
    let least = if step.cue.is_seated() && !is_last { SHORTEST_SIT } else { 0.0 };
    let usual = if is_last { settings.synthesizer.hold_seconds } else { 0.0 };
    step.hold_seconds.unwrap_or(usual).max(least)
}

fn continuing(cue: &ActionCue, postures: [Posture; 2], contact: [f32; 2], floor: f32) -> InitialState {
    let seat = cue.is_seated().then(|| cue.clone());
    InitialState::continuing(cue.name.clone(), BodyState { postures, contact, seat }, floor)
}

/// Who has met `cue` with `motion`.
fn end_of(motion: &Motion, cue: &ActionCue, floor: f32) -> InitialState {
    let last = motion.len() - 1;
    let postures = [motion.postures[last.saturating_sub(1)], motion.postures[last]];
    continuing(cue, postures, motion.contacts[last], floor)
}

/// A fingerprint of all that every step follows from.
fn first_key(means: &Means, performance: &Performance, others: &[Other]) -> blake3::Hash {
    let &Means { manifold, scene, database, stored, settings, seed, .. } = means;
    let file = |bytes: Option<Vec<u8>>| bytes.map(|bytes| blake3::hash(&bytes).to_hex().to_string());
    let along = file(manifold.map(Manifold::to_bytes));
    let by = file(stored.map(StoredPolicy::to_bytes));
    let all =
        (along, scene.fingerprint(), &database.library_checksum, &performance.start, by, settings, seed);
    // Numbers, names and lists always serialize.
    let mut key = blake3::hash(&serde_json::to_vec(&all).unwrap_or_default());
    for other in others {
        key = blake3::hash(&[key.as_bytes().as_slice(), other.fingerprint().as_bytes()].concat());
    }
    key
}

/// `stands`: of the scene as it stands then, where it does not always stand so. `late`: by how many frames hands had the person stay
/// longer before it, while others went on.
fn next_key(
    before: blake3::Hash,
    step: &Step,
    hold_seconds: f32,
    stands: Option<&str>,
    late: usize,
) -> blake3::Hash {
    // Whenever it is asked for, and whatever hands do there, it is played the same.
    let step = Step { at_seconds: None, manipulations: Vec::new(), things: Vec::new(), ..step.clone() };
    let step = serde_json::to_vec(&(step, hold_seconds, late)).unwrap_or_default();
    blake3::hash(&[before.as_bytes(), step.as_slice(), stands.unwrap_or_default().as_bytes()].concat())
}

/// The motions of all steps as one, each at its time, and what is told of it.
fn joined(
    timing: &Timing,
    manifold: Option<&Manifold>,
    performance: &Performance,
    phases: &Phases,
    steps: Vec<PerformedStep>,
    stopped: Option<String>,
    seed: u64,
) -> Result<Performed> {
    let Timing { scene, database, settings, progress, .. } = *timing;
    let mut motion = Motion::default();
    let (mut told, mut spans, mut moments) = (Vec::new(), Vec::new(), Vec::new());
    let mut hands = Hands::new(performance, settings);
    // So long the person stays where the step before has ended until the hands are done there, in frames.
    let mut stays = 0;
    for (at, (PerformedStep { start, made, waited, .. }, step)) in
        steps.iter().zip(&performance.steps).enumerate()
    {
        let first_frame = motion.len().saturating_sub(1) + stays;
        let timing = Timing { scene: phases.before(at), ..*timing };
        let timed = timing.timed(made, step, start, first_frame, step_seed(seed, at))?;
        if stays > 0 {
            let before = start.body.as_ref().map(|body| body.postures[0]);
            let around = Surroundings::at_start(timing.scene, start);
            let seed = step_seed(seed, at) ^ HANDS_SEED;
            append(&mut motion, &timing.rest(&timed.motion, before, around, stays, seed)?);
            // The rest ends where the step begins.
            motion.postures.push(timed.motion.postures[0]);
            motion.contacts.push(timed.motion.contacts[0]);
        }
        append(&mut motion, &timed.motion);
        let when = timed.moments.each(|frame| first_frame + frame);
        let sits = step.cue.is_seated() && made.end == EpisodeEnd::Complete;
        spans.extend(segments(first_frame + waited + timed.waits, motion.len(), &when, sits));
        stays = match made.end {
            EpisodeEnd::Complete => {
                (hands.begin(at, &motion, when.complete) + 1).saturating_sub(motion.len())
            }
            _ => 0,
        };
        moments.push(when);
        let Report { edited, policy_source, updates, path_m, shortest_path_m, .. } = made.report.clone();
        told.push(StepReport {
            cue: step.cue.name.clone(),
            first_frame,
            moments: when,
            asked_frame: asked_frame(step),
            late_s: late_seconds(step, &when),
            waits_s: timed.waits as f32 / FRAME_RATE,
            dawdles_s: timed.dawdles as f32 / FRAME_RATE,
            edited,
            waited: *waited,
            policy_source,
            updates,
            path_m,
            shortest_path_m,
        });
    }
    if stays > 0 {
        let end = motion.len() - 1;
        let here = Motion { postures: vec![motion.postures[end]], contacts: vec![motion.contacts[end]] };
        let around =
            Surroundings::at_end(phases.before(steps.len()), &performance.steps[steps.len() - 1].cue);
        let before = motion.postures[end.saturating_sub(1)];
        let seed = step_seed(seed, steps.len()) ^ HANDS_SEED;
        append(&mut motion, &timing.rest(&here, Some(before), around, stays + 1, seed)?);
    }
    let around = Surroundings::with(scene, performance.seats(&moments));
    // Hands last: they are where they are to be however chest and head turn.
    let looks = looked(&mut motion, timing, performance, &moments)?;
    let done = hands.follow(&mut motion, &around, manifold, progress)?;
    progress.stage("Measuring");
    let around =
        Around { scene: Some(scene), moving: &[], leaves: &done.leaves, wait: 0, database: Some(database) };
    let measured = measure_performance(&motion, &around, performance, &moments, settings);
    let mut problems: Vec<String> = steps.iter().flat_map(|step| step.made.not_done.clone()).collect();
    // What stopped it may be what hands could not do: told once.
    let stop = stopped.clone();
    problems.extend(stopped.into_iter().chain(unplayed(performance, steps.len())));
    problems.extend(unpunctual(performance, &moments));
    problems.extend(done.problems.into_iter().filter(|problem| stop.as_ref() != Some(problem)));
    problems.extend(looks.iter().filter_map(unseen));
    problems.extend(measured.body.problems(&settings.report));

    let all = || steps.iter().map(|step| &step.made.report);
    let mut seconds: BTreeMap<String, f32> = BTreeMap::new();
    for (stage, taken) in all().flat_map(|report| &report.seconds) {
        *seconds.entry(stage.clone()).or_default() += taken;
    }
    let first = &steps[0].made.report;
    let environment_steps = all().map(|r| r.environment_steps).sum();
    let rolled_out: f32 =
        all().map(|r| r.environment_steps as f32 / r.environment_steps_per_second.max(1e-3)).sum();
    let report = Report {
        success: problems.is_empty(),
        problems,
        cues: measured.cues,
        action_from: moments.last().and_then(|m| m.action_from),
        foot: measured.foot,
        penetration: measured.penetration.unwrap_or_default(),
        speed: speed_figures(&motion, &database.turns.usual, &database.accelerations),
        body: measured.body,
        style: StyleValues::of(&motion, performance.start.position.z, &spans).medians(),
        edited: done.edited,
        things: done.things,
        opened: done.opened,
        frames: motion.len(),
        path_m: all().map(|r| r.path_m).sum(),
        shortest_path_m: all().map(|r| r.shortest_path_m).sum(),
        seconds,
        policy_source: all().max_by_key(|r| r.updates).map_or(first.policy_source, |r| r.policy_source),
        updates: all().map(|r| r.updates).sum(),
        environment_steps,
        environment_steps_per_second: environment_steps as f32 / rolled_out.max(1e-3),
        rollouts: all().map(|r| r.rollouts).sum(),
        rollouts_succeeded: all().map(|r| r.rollouts_succeeded).sum(),
        curve: all().flat_map(|r| r.curve.clone()).collect(),
        steps: told,
        looks,
        settings: Settings { scene: scene.settings().clone(), ..settings.clone() },
        ..first.clone()
    };
    Ok(Performed { motion, report, steps, carried: done.carried })
}

/// Adds to a motion one that begins with its last frame.
fn append(motion: &mut Motion, more: &Motion) {
    let own = usize::from(!motion.is_empty());
    motion.postures.extend(&more.postures[own..]);
    motion.contacts.extend(&more.contacts[own..]);
}

/// Has the person look at what they are to, as far as the performance was played; `moments`: of each of its steps that was.
fn looked(
    motion: &mut Motion,
    timing: &Timing,
    performance: &Performance,
    moments: &[Moments],
) -> Result<Vec<LookReport>> {
    if performance.looks.is_empty() {
        return Ok(Vec::new());
    }
    timing.progress.stage("Looking");
    // When each cue, waypoints among them, is met.
    let (mut met, mut first) = (Vec::new(), 0);
    for (step, moments) in performance.steps.iter().zip(moments) {
        met.extend(passed(&step.passes, motion, first, moments.complete).iter().map(|pass| pass.frame));
        met.push(moments.complete);
        first = moments.complete;
    }
    let (looks, gazes): (Vec<&LookCue>, Vec<Gaze>) = performance
        .looks
        .iter()
        .filter_map(|look| {
            let first = if look.after == 0 { 0 } else { *met.get(look.after - 1)? };
            let lasts = look.hold_seconds.map(|seconds| first + (seconds * FRAME_RATE).round() as usize);
            let end = lasts.or(met.get(look.after).copied()).unwrap_or(motion.len()).min(motion.len());
            Some((look, Gaze { frames: first.min(end)..end, path: &look.path }))
        })
        .unzip();
    let around = Surroundings::with(timing.scene, performance.seats(moments));
    let told = look(motion, &gazes, &around, timing.floor, timing.progress)?;
    let report = |((cue, gaze), told): ((&LookCue, &Gaze), GazeFigures)| LookReport {
        look: cue.name.clone(),
        first: gaze.frames.start,
        end: gaze.frames.end,
        met: told.met,
        turning: told.turning,
        behind: told.behind,
        held: told.held,
    };
    Ok(looks.into_iter().zip(&gazes).zip(told).map(report).collect())
}

/// What is said of something that was not looked at for most of the time in which it could have been.
fn unseen(look: &LookReport) -> Option<String> {
    let seconds = |frames: usize| frames as f32 / FRAME_RATE;
    let (name, lasts) = (&look.look, look.end - look.first);
    if 2 * look.met >= lasts - look.turning && look.met > 0 {
        return None;
    }
    let of = format!("‘{name}’ is looked at for {:.1} of {:.1} s", seconds(look.met), seconds(lasts));
    Some(if look.turning >= look.behind.max(look.held) {
        format!("{of}, which is too short to turn there; give it longer.")
    } else if look.behind >= look.held {
        format!(
            "{of}: for {:.1} s it lies behind the person, farther round than head and chest turn; turn the cue that comes before it, \
             or move what is looked at.",
            seconds(look.behind)
        )
    } else {
        format!(
            "{of}: for {:.1} s the head does not get there, as it lies too high or too low, or what stands around is in the way; move \
             it.",
            seconds(look.held)
        )
    })
}

/// What is said where a performance ends after so many steps, and not all are played.
fn unplayed(performance: &Performance, played: usize) -> Option<String> {
    let names: Vec<String> =
        performance.steps[played..].iter().map(|step| format!("‘{}’", step.cue.name)).collect();
    (!names.is_empty()).then(|| format!("The performance ends before {}.", names.join(", ")))
}
