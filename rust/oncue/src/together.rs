//! Several people in one shot: the performance of each, on one clock.
//!
//! They are made one after the other, by where they start (smaller x first, then smaller y), so that neither names nor the order
//! of a list make a difference. Each sees those who were made before wherever they are on every frame, and goes round them, waits for
//! them or sits beside them ([`crate::perform()`]); of those who come after it sees that they stand where they start.

use glam::Vec3;

use crate::controller::StoredPolicy;
use crate::cue::{ActionCue, Performance};
use crate::error::{Error, Result};
use crate::figures::{Other, others_figures};
use crate::hands::among::{check_owners, in_others};
use crate::hands::leaf::Phases;
use crate::library::database::MotionDatabase;
use crate::manifold::Manifold;
use crate::math::planar::rotate;
use crate::motion::Motion;
use crate::perform::{Means, Performed, check_performance, perform_among};
use crate::progress::Progress;
use crate::scene::SceneIndex;
use crate::settings::Settings;

/// Starts nearer to each other than this are one place, metres.
const STARTS_APART: f32 = 0.40;
/// So far from one another two people end, metres: half of the shoulders' breadth each, and on seats half of that of the knees.
const ENDS_APART: f32 = 0.45;
const SEATS_APART: f32 = 0.55;
/// Before who sits nobody ends on the thighs: so far ahead of the pelvis, and so far to a side, metres.
const LAP: (f32, f32) = (0.60, 0.30);
/// Of a thing in others so many touches are told, the deepest.
const TOUCHES_TOLD: usize = 2;
/// Who is not made yet stands where they start for so many frames: nobody walks through people who have not set out.
const SETS_OUT: usize = 150;

/// Plays the performances of several people in one shot, each in `performances`' order; all begin at once, and who is done stays.
/// `earlier`: people who were made before; steps that follow from the same as then are taken from them. One alone is what
/// [`crate::perform()`] makes.
///
/// People do not come into each other where a way past one another is found; where none is, [`crate::report::Report::others`] and
/// `problems` of both say who is in whom. Who cannot be played at all is an error in their place, and stands at the start for the
/// others. The same seed gives the same shot, whatever the order and the names, on any number of threads.
///
/// # Errors
/// As [`crate::perform()`] for what can be known before anything is played, naming the start; for two starts, or two last cues, where
/// two people do not fit; `Cancelled`.
#[allow(clippy::too_many_arguments)] // All that a shot follows from, and nothing that groups it.
pub fn perform_together(
    manifold: Option<&Manifold>,
    scene: &SceneIndex,
    database: &MotionDatabase,
    performances: &[Performance],
    earlier: &[&Performed],
    stored: Option<&StoredPolicy>,
    settings: &Settings,
    seed: u64,
    progress: &Progress,
) -> Result<Vec<Result<Performed>>> {
    settings.validate()?;
    progress.person(None);
    progress.stage("Checking the cues");
    check_together(scene, performances)?;
    let place = |at: usize| performances[at].start.position;
    let mut order: Vec<usize> = (0..performances.len()).collect();
    order.sort_by(|&a, &b| {
        let (a, b) = (place(a), place(b));
        a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)).then(a.z.total_cmp(&b.z))
    });

    let mut made: Vec<Option<Result<Performed>>> = performances.iter().map(|_| None).collect();
    let mut there: Vec<Other> = Vec::new();
    for (turn, &at) in order.iter().enumerate() {
        let performance = &performances[at];
        let name = &performance.start.name;
        let still = order[turn + 1..]
            .iter()
            .map(|&later| Other::standing(&performances[later].start.name, place(later), SETS_OUT));
        let others: Vec<Other> = there.iter().cloned().chain(still).collect();
        // The first is as if alone; the others are not the same person again, breathing as one.
        let seed = if turn == 0 { seed } else { seed_of(seed, place(at)) };
        let means = Means { manifold, scene, database, stored, settings, seed, progress };
        progress.person((performances.len() > 1).then_some(name));
        let phases = Phases::of(scene, performance, progress)?;
        let one = perform_among(&means, performance, &phases, earlier, &others);
        if matches!(one, Err(Error::Cancelled)) {
            return Err(Error::Cancelled);
        }
        there.push(match &one {
            Ok(one) => Other::moving(name, &one.motion),
            Err(_) => Other::standing(name, place(at), usize::MAX),
        });
        made[at] = Some(one);
    }
    progress.person(None);
    progress.end_stage();
    let mut made: Vec<Result<Performed>> = made.into_iter().flatten().collect();
    if performances.len() > 1 {
        tell_of_things(performances, &mut made);
        for (figures, &at) in others_figures(&there).into_iter().zip(&order) {
            let Ok(one) = &mut made[at] else { continue };
            one.report.problems.extend(figures.problems());
            one.report.success = one.report.problems.is_empty();
            one.report.others = Some(figures);
            one.report.seed = seed;
        }
    }
    Ok(made)
}

/// Has both told where a thing of one is in the other.
fn tell_of_things(performances: &[Performance], made: &mut [Result<Performed>]) {
    let frames = made.iter().flatten().map(|one| one.motion.len()).max().unwrap_or(0);
    let mut told: Vec<(usize, String)> = Vec::new();
    for (at, performance) in performances.iter().enumerate() {
        let others: Vec<usize> =
            (0..made.len()).filter(|&other| other != at && made[other].is_ok()).collect();
        for thing in &performance.things {
            let motions: Vec<&Motion> =
                others.iter().filter_map(|&other| Some(&made[other].as_ref().ok()?.motion)).collect();
            let carried = made[at].as_ref().map_or(&[][..], |one| &one.carried);
            let touches = in_others(thing, carried, &motions, frames);
            for touch in touches.iter().take(TOUCHES_TOLD) {
                let (other, part) = (others[touch.key.0], touch.key.1);
                let said = format!(
                    "‘{}’ of ‘{}’ is {:.0} cm deep in the {} of ‘{}’ (frames {} to {}); have it carried or put down elsewhere.",
                    thing.name,
                    performance.start.name,
                    100.0 * touch.worst,
                    part.in_words(),
                    performances[other].start.name,
                    touch.first,
                    touch.end - 1
                );
                told.extend([(at, said.clone()), (other, said)]);
            }
            let Ok(one) = &mut made[at] else { continue };
            for figures in one.report.things.iter_mut().filter(|figures| figures.thing == thing.name) {
                figures.in_others_cm = Some(touches.first().map_or(0.0, |touch| 100.0 * touch.worst));
            }
        }
    }
    for (at, said) in told {
        if let Ok(one) = &mut made[at] {
            one.report.problems.push(said);
        }
    }
}

/// Another person's seed, by where they start: it stays when somebody joins.
fn seed_of(seed: u64, place: Vec3) -> u64 {
    let bytes: Vec<u8> = place.to_array().into_iter().flat_map(f32::to_le_bytes).collect();
    let hash = blake3::hash(&[&seed.to_le_bytes(), bytes.as_slice()].concat());
    hash.as_bytes()[..8].iter().fold(0, |number, &byte| number << 8 | u64::from(byte))
}

/// What can be known of a shot before anything is played: what can be known of each performance, and whether people start and end where
/// they do not fit together.
///
/// # Errors
/// `Input` or `Unreachable`, naming the start and the cue.
pub fn check_together(scene: &SceneIndex, performances: &[Performance]) -> Result<()> {
    if performances.is_empty() {
        return Err(Error::input("There is nobody to perform; add a start."));
    }
    for performance in performances {
        check_performance(scene, performance).map_err(|error| of(performance, performances.len(), error))?;
    }
    check_people(performances)
}

/// The part of it that is about several people, and for which no scene is needed.
pub(crate) fn check_people(performances: &[Performance]) -> Result<()> {
    for performance in performances {
        // Others are waited for and walked around on the way that is played, which a time would change.
        if let Some(timed) =
            performance.steps.iter().find(|s| performances.len() > 1 && s.at_seconds.is_some())
        {
            return Err(Error::input(format!(
                "{}: ‘{}’ is asked for at a time, which is for one person alone; take its time away, or hide the other starts.",
                performance.start.name, timed.cue.name
            )));
        }
    }
    for performance in performances.iter().filter(|_| performances.len() > 1) {
        // What one opens the others would have to find open.
        if let Some(open) = performance.steps.iter().flat_map(|step| step.openings()).next() {
            return Err(Error::input(format!(
                "{}: ‘{}’ opens ‘{}’, which is for one person alone; take it away, or hide the other starts.",
                performance.start.name, open.name, open.thing
            )));
        }
    }
    check_owners(performances)?;
    for (at, one) in performances.iter().enumerate() {
        for other in &performances[..at] {
            check_pair(other, one)?;
        }
    }
    Ok(())
}

/// A sentence about one of several people, with whose it is.
fn of(performance: &Performance, people: usize, error: Error) -> Error {
    let name = &performance.start.name;
    match error {
        Error::Input(said) if people > 1 => Error::Input(format!("{name}: {said}")),
        Error::Unreachable(said) if people > 1 => Error::Unreachable(format!("{name}: {said}")),
        other => other,
    }
}

fn check_pair(one: &Performance, other: &Performance) -> Result<()> {
    let (a, b) = (&one.start, &other.start);
    let apart = a.position.distance(b.position);
    if apart < STARTS_APART {
        return Err(Error::input(format!(
            "Starts ‘{}’ and ‘{}’ are {:.0} cm apart, where two people do not fit; move one of them {:.0} cm away.",
            a.name,
            b.name,
            100.0 * apart,
            100.0 * (STARTS_APART - apart) + 5.0
        )));
    }
    // Who comes to the same place later may find it left; at the last cues both stay.
    let (Some(a), Some(b)) = (one.steps.last(), other.steps.last()) else { return Ok(()) };
    let (a, b) = (&a.cue, &b.cue);
    if on_the_lap(a, b) || on_the_lap(b, a) {
        return Err(Error::input(format!(
            "Cue ‘{}’ of ‘{}’ and cue ‘{}’ of ‘{}’ put one person on the lap of the other; move one of them aside.",
            a.name, one.start.name, b.name, other.start.name
        )));
    }
    let apart = a.position.truncate().distance(b.position.truncate());
    let needed = if a.is_seated() && b.is_seated() { SEATS_APART } else { ENDS_APART };
    if apart < needed && (a.position.z - b.position.z).abs() < 1.0 {
        return Err(Error::input(format!(
            "Cue ‘{}’ of ‘{}’ and cue ‘{}’ of ‘{}’ are {:.0} cm apart, and two people need {:.0} cm; move one of them aside.",
            a.name,
            one.start.name,
            b.name,
            other.start.name,
            100.0 * apart,
            100.0 * needed
        )));
    }
    Ok(())
}

/// Whether `other` ends on the thighs of who sits at `seat`.
fn on_the_lap(seat: &ActionCue, other: &ActionCue) -> bool {
    let way = other.position - seat.position;
    let facing = seat.planar().forward();
    let (ahead, aside) =
        (facing.dot(way.truncate()), rotate(std::f32::consts::FRAC_PI_2, facing).dot(way.truncate()));
    // A place to stand says nothing of its height.
    let level = !other.is_seated() || way.z.abs() < 1.0;
    seat.is_seated() && level && (0.05..LAP.0).contains(&ahead) && aside.abs() < LAP.1
}
