//! What the hands do in a performance: laid over what is played, on frames of the whole.
//!
//! A step is played as if its hands had nothing to do, and the person stays at its cue for as long as they need. So what hands do
//! changes nothing of how a step is played nor of what the next goes on from, and no seam lies in a reach. `things` is what can be taken,
//! `carry` how it is taken, carried and put down; `leaf` is what can be opened, and the scene as it stands then, `open` how it is opened. `among`: the things
//! of one among others.

pub(crate) mod among;
mod carry;
pub(crate) mod leaf;
mod open;
pub(crate) mod things;

use std::ops::Range;
use std::time::Instant;

use glam::{Quat, Vec2, Vec3};
use serde::{Deserialize, Serialize};

use carry::{Carry, Down, FADES, GRIPS, Held, LIFTS, Way, crouch};
use leaf::openings;
pub use open::OpenedFigures;
use open::Opening;
use things::Placement;

use crate::cue::{
    Hand, Leaf, ManipulationCue, OpenCue, Performance, PutCue, TakeCue, Thing, ThingCue, is_carried,
};
use crate::editor::edit::{reach_frames, whole_span};
use crate::editor::free_limbs::{Room, free_arms_within};
use crate::editor::manipulation::{LONGEST_WAIT, constraints, joints};
use crate::editor::{
    Constraint, ConstraintFigures, EditedMotion, ManipulationFigures, TaskEditFigures, Wishes, edit_motion,
};
use crate::error::{Error, Result};
use crate::figures::{BodyPart, Surroundings, body_capsules, in_scene};
use crate::manifold::Manifold;
use crate::motion::skeleton::palm;
use crate::motion::{FRAME_RATE, Joint, Motion, Posture};
use crate::progress::Progress;
use crate::scene::MovingObject;
use crate::settings::{EditorSettings, ReportSettings, Settings};

/// After the hands are back the person stays so many frames more: what is taken out of the way fades over as many.
const SETTLES: usize = 18;
/// Nobody is drawn farther than this from where they are by a hand that reaches, metres: who has to go farther walks.
const DRAWN: f32 = 0.20;
/// Knees that would be deeper than this in something do not bend, metres.
const IN_THE_WAY: f32 = 0.01;
/// Frames between what one hand does and the next.
const BETWEEN: usize = 6;
/// A thing that is put down is where it was asked for within this, metres.
const PUT_WITHIN: f32 = 0.01;
/// A palm is on the handle that it leads within this, metres.
const ON_THE_HANDLE: f32 = 0.01;
/// An arm that is deeper in what it opens lets go of it sooner, metres, and so does who would lean farther aside for it, radians.
const IN_THE_LEAF: f32 = 0.01;
const LEANS_ASIDE: f32 = 0.26;

/// A thing as it was carried, or a leaf as it was opened: where it is from when that began until it stands again, or the motion ends.
#[derive(Debug, Clone, PartialEq)]
pub struct CarriedThing {
    /// Its name.
    pub name: String,
    /// The motion's frame of the first of them.
    pub first_frame: usize,
    /// Its origin, a frame each, world, metres.
    pub positions: Vec<Vec3>,
    /// How it is turned, a frame each, world.
    pub rotations: Vec<Quat>,
}

/// What is told of a thing that was taken.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ThingFigures {
    /// The thing's name.
    pub thing: String,
    /// The cue that took it, and by which hand.
    pub take: String,
    /// By which hand.
    pub hand: Hand,
    /// The frame on which the palms have come to it.
    pub taken: usize,
    /// The cue that puts it down; none where it is kept.
    pub put: Option<String>,
    /// The frame on which it stands there.
    pub placed: Option<usize>,
    /// How far from there it stands, cm.
    pub put_cm: Option<f32>,
    /// How far a palm gets on it from where it grips, at the most, cm.
    pub grip_cm: f32,
    /// How far a hand turns on it while it is carried, at the most, degrees.
    pub turn_degrees: f32,
    /// How deep it is in trunk, legs or head at the most, cm; 0 where it is in none.
    pub in_body_cm: f32,
    /// How deep its box is in the scene at the most while it is carried, cm; 0 where it is nowhere.
    pub in_scene_cm: f32,
    /// How deep it is in another person of the shot at the most, wherever it stands or is carried, cm; none for one alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub in_others_cm: Option<f32>,
}

/// What hands did.
#[derive(Debug, Default)]
pub(crate) struct Done {
    /// Of all paths, in frames of the whole; none where there were none.
    pub edited: Option<TaskEditFigures>,
    pub things: Vec<ThingFigures>,
    pub opened: Vec<OpenedFigures>,
    pub carried: Vec<CarriedThing>,
    /// What can be opened, on the motion's frames.
    pub leaves: Vec<MovingObject>,
    /// In words what could not be done.
    pub problems: Vec<String>,
}

/// The hands of a performance, as its steps come one after the other.
pub(crate) struct Hands<'a> {
    performance: &'a Performance,
    settings: &'a EditorSettings,
    report: &'a ReportSettings,
    paths: Vec<Path<'a>>,
    carries: Vec<Carry<'a>>,
    openings: Vec<Opening<'a>>,
    /// How far each leaf is open by now.
    open: Vec<f32>,
    /// Where each thing stands by now, its middle.
    middles: Vec<Vec3>,
    problems: Vec<String>,
}

/// A path on its frames.
struct Path<'a> {
    cue: &'a ManipulationCue,
    /// Which step's it is, and when that one's cue is met.
    step: usize,
    met: usize,
    first: usize,
}

impl Path<'_> {
    fn end(&self) -> usize {
        self.first + self.cue.path.len()
    }
}

/// A hand that has something, and on which frames.
type Grip = (Hand, Range<usize>);

/// All that hands are laid over a motion with.
struct Laying<'a> {
    around: &'a Surroundings<'a>,
    floor: f32,
    settings: &'a EditorSettings,
    progress: &'a Progress,
}

impl<'a> Hands<'a> {
    pub(crate) fn new(performance: &'a Performance, settings: &'a Settings) -> Self {
        let middle = |thing: &Thing| thing.placement().point(0.5 * (thing.low + thing.high));
        Self {
            performance,
            settings: &settings.editor,
            report: &settings.report,
            paths: Vec::new(),
            carries: Vec::new(),
            openings: Vec::new(),
            open: vec![0.0; performance.leaves.len()],
            middles: performance.things.iter().map(middle).collect(),
            problems: Vec::new(),
        }
    }

    fn person(&self) -> &'a str {
        &self.performance.start.name
    }

    /// Gives what the hands do at a step, whose cue is met on frame `met` of `motion`, its frames, and says up to which frame the person
    /// has to stay there for it; 0 for no longer than without.
    pub(crate) fn begin(&mut self, step: usize, motion: &Motion, met: usize) -> usize {
        if !self.settings.fit {
            return 0;
        }
        let mut until = 0;
        for cue in &self.performance.steps[step].things {
            let now = until.max(met);
            until = match cue {
                ThingCue::Take(take) => self.begin_take(take, motion, met, now),
                ThingCue::Put(put) => self.begin_put(put, now + BETWEEN),
                ThingCue::Open(open) => self.begin_open(open, motion, met, now),
            };
        }
        let cues = &self.performance.steps[step].manipulations;
        let (timed, untimed): (Vec<_>, Vec<_>) = cues.iter().partition(|cue| cue.first_frame.is_some());
        for cue in timed {
            let first = cue.first_frame.unwrap_or_default();
            let seconds = first.saturating_sub(met) as f32 / FRAME_RATE;
            if seconds > LONGEST_WAIT {
                self.problems.push(format!(
                    "‘{}’ begins on frame {first}, {seconds:.0} s after ‘{}’ is at ‘{}’; a person waits for at most \
                     {LONGEST_WAIT:.0} s, so move its range.",
                    cue.name,
                    self.person(),
                    self.performance.steps[step].cue.name
                ));
                continue;
            }
            let path = Path { cue, step, met, first };
            // What is over before the cue is met asks nobody to stay there.
            if path.end() > met {
                until =
                    until.max(path.end() + self.reach(motion, met, cue.hand, cue.path[cue.path.len() - 1]));
            }
            self.paths.push(path);
        }
        // One after the other, and after those that have their time.
        for cue in untimed {
            let first = until.max(met) + self.reach(motion, met, cue.hand, cue.path[0]);
            let path = Path { cue, step, met, first };
            until = path.end() + self.reach(motion, met, cue.hand, cue.path[cue.path.len() - 1]);
            self.paths.push(path);
        }
        if until > 0 { until + SETTLES } else { 0 }
    }

    fn begin_take(&mut self, take: &'a TakeCue, motion: &Motion, met: usize, now: usize) -> usize {
        let Some(thing) = self.performance.things.iter().position(|thing| thing.name == take.thing) else {
            return 0;
        };
        let taken = now + self.reach(motion, met, take.hand, self.middles[thing]);
        let carry = Carry { take, thing, taken, down: None };
        let until = carry.carried();
        self.carries.push(carry);
        until
    }

    fn begin_put(&mut self, cue: &'a PutCue, from: usize) -> usize {
        let names = &self.performance.things;
        let is_it = |carry: &&mut Carry| carry.down.is_none() && names[carry.thing].name == cue.thing;
        let Some(carry) = self.carries.iter_mut().find(is_it) else { return 0 };
        let down = Down { cue, from };
        let until = down.placed() + GRIPS + reach_frames(0.0, self.settings);
        carry.down = Some(down);
        let thing = &names[carry.thing];
        self.middles[carry.thing] = cue.position + Vec3::Z * 0.5 * (thing.high - thing.low).z;
        until
    }

    fn begin_open(&mut self, cue: &'a OpenCue, motion: &Motion, met: usize, now: usize) -> usize {
        let leaves = &self.performance.leaves;
        let Some((which, leaf)) = leaves.iter().enumerate().find(|(_, leaf)| leaf.name == cue.thing) else {
            return 0;
        };
        let from = self.open[which];
        let reach = self.reach(motion, met, cue.hand, leaf.at(from).point(cue.grip));
        let pose = motion.postures[met].pose();
        let opening = Opening::new(cue, (which, leaf), from, now + reach, &pose);
        self.open[which] += cue.by.number();
        // Nobody walks on before it is open, and has the hand back.
        let let_go = opening.let_go.unwrap_or(opening.opened);
        let until = (let_go + GRIPS + reach).max(opening.opened.saturating_sub(SETTLES));
        self.openings.push(opening);
        until
    }

    /// What is opened, on so many frames of the whole motion; `done`: which of the openings come to be.
    ///
    /// # Errors
    /// `Input` for a mesh that is none; `Cancelled`.
    fn leaves(&self, done: &[bool], progress: &Progress) -> Result<Vec<MovingObject>> {
        let object = |(which, leaf): (usize, &Leaf)| {
            let own = || self.openings.iter().zip(done).filter(move |(o, done)| o.which == which && **done);
            let last = own().map(|(opening, _)| opening.opened).max().unwrap_or(0);
            let so_far = |frame: usize| -> f32 {
                own().map(|(opening, _)| opening.cue.by.number() * opening.share(frame)).sum()
            };
            let held = own().map(|(o, _)| (o.cue.hand, o.held(o.let_go.unwrap_or(o.opened))));
            Ok(leaf.opened((0..=last).map(so_far), progress)?.held_by(held.collect()))
        };
        self.performance.leaves.iter().enumerate().map(object).collect()
    }

    /// Frames of a reach for a place from how the person is on a frame.
    fn reach(&self, motion: &Motion, frame: usize, hand: Hand, place: Vec3) -> usize {
        let pose = motion.postures[frame].pose();
        let away = |&joint: &Joint| pose.point(joint, palm(joint)).distance(place);
        reach_frames(joints(hand).iter().map(away).fold(0.0, f32::max), self.settings)
    }

    /// Has the hands do it. `around`: where the whole motion takes place. What cannot be done leaves the motion as it was and is told.
    ///
    /// # Errors
    /// `Cancelled`.
    pub(crate) fn follow(
        mut self,
        motion: &mut Motion,
        around: &Surroundings,
        manifold: Option<&Manifold>,
        progress: &Progress,
    ) -> Result<Done> {
        let mut out = Done { problems: std::mem::take(&mut self.problems), ..Default::default() };
        let all = self.leaves(&vec![true; self.openings.len()], progress)?;
        if self.paths.is_empty() && self.carries.is_empty() && self.openings.is_empty() {
            out.leaves = all;
            return Ok(out);
        }
        let began = Instant::now();
        progress.stage("Carrying the hands");
        let floor = self.performance.start.position.z;
        let (grips, leaves) = {
            let around = &Surroundings { moving: &all, ..around.clone() };
            let laying = Laying { around, floor, settings: self.settings, progress };
            let mut grips = self.carry_things(motion, &laying, &mut out)?;
            let done = self.open_leaves(motion, &laying, &mut grips, &mut out)?;
            (grips, self.leaves(&done, progress)?)
        };
        let around = &Surroundings { moving: &leaves, ..around.clone() };
        let laying = Laying { around, floor, settings: self.settings, progress };
        let mut edited = TaskEditFigures { complete_frame: motion.len() - 1, ..Default::default() };
        for step in 0..self.performance.steps.len() {
            let paths: Vec<&Path> = self.paths.iter().filter(|path| path.step == step).collect();
            if paths.is_empty() {
                continue;
            }
            match laying.along(&paths, motion, &grips, manifold) {
                Ok(constraints) => edited.constraints.extend(constraints),
                Err(Error::Cancelled) => return Err(Error::Cancelled),
                Err(error) => {
                    out.problems.push(self.not_done(&paths, error));
                    continue;
                }
            }
            edited.manipulations.extend(paths.iter().map(|path| ManipulationFigures {
                name: path.cue.name.clone(),
                first_frame: path.first,
                frames: path.cue.path.len(),
            }));
        }
        edited.seconds = began.elapsed().as_secs_f32();
        out.edited = (!self.paths.is_empty()).then_some(edited);
        out.leaves = leaves;
        Ok(out)
    }

    /// Why the hands of a step do nothing.
    fn not_done(&self, paths: &[&Path], error: Error) -> String {
        let late = paths
            .iter()
            .find(|path| path.first < path.met)
            .filter(|_| matches!(error, Error::Unreachable(_)));
        let Some(Path { cue, step, met, first }) = late else { return error.to_string() };
        format!(
            "‘{}’ is out of reach on frame {first}, and ‘{}’ is at ‘{}’ on frame {met} only: move its range to later frames, or have \
             the cue met sooner.",
            cue.name,
            self.person(),
            self.performance.steps[*step].cue.name
        )
    }

    /// Has things be taken, carried and put down, and says which hands are on them when.
    fn carry_things(&mut self, motion: &mut Motion, laying: &Laying, out: &mut Done) -> Result<Vec<Grip>> {
        let mut grips: Vec<Grip> = Vec::new();
        if self.carries.is_empty() {
            return Ok(grips);
        }
        let (way, person) = (Way::of(motion), self.person());
        let things = &self.performance.things;
        // Where each stands by now; nowhere once it is in a hand for good, or was never taken.
        let mut stand: Vec<Option<Placement>> = things.iter().map(|thing| Some(thing.placement())).collect();
        let mut laid: Vec<(Carry, Held)> = Vec::new();
        for mut carry in std::mem::take(&mut self.carries) {
            let thing = &things[carry.thing];
            let Some(rest) = stand[carry.thing].take() else { continue };
            let mut held = laying.carry(&carry, thing, rest, motion, &way, &grips, person);
            if let (Err(error), Some(down)) = (&held, &carry.down) {
                let said = format!(
                    "‘{person}’ keeps ‘{}’, which ‘{}’ does not have put down: {error}",
                    thing.name, down.cue.name
                );
                // It may be taken all the same.
                carry.down = None;
                held = laying.carry(&carry, thing, rest, motion, &way, &grips, person);
                out.problems.extend(held.is_ok().then_some(said));
            } else if let Ok(held) = &held {
                stand[carry.thing] = carry.down.as_ref().map(|_| held.at(usize::MAX));
            }
            match held {
                Ok(held) => {
                    grips.push((carry.take.hand, carry.held(motion.len())));
                    laid.push((carry, held));
                }
                Err(Error::Cancelled) => return Err(Error::Cancelled),
                Err(error) => out.problems.push(format!(
                    "‘{person}’ does not take ‘{}’ by ‘{}’: {error}",
                    thing.name, carry.take.name
                )),
            }
        }
        for (carry, mut held) in laid {
            let thing = &things[carry.thing];
            out.tell(&carry, &mut held, thing, motion, person, laying, self.report);
            out.carried.push(CarriedThing {
                name: thing.name.clone(),
                first_frame: carry.taken,
                positions: held.places.iter().map(|place| place.position).collect(),
                rotations: held.places.iter().map(|place| place.rotation).collect(),
            });
        }
        Ok(grips)
    }
}

impl Hands<'_> {
    /// Has leaves be opened, adds the hands that do to `grips`, and says which of them are.
    fn open_leaves(
        &mut self,
        motion: &mut Motion,
        laying: &Laying,
        grips: &mut Vec<Grip>,
        out: &mut Done,
    ) -> Result<Vec<bool>> {
        let mut done = Vec::new();
        let person = &self.performance.start.name;
        for opening in &mut self.openings {
            let led = laying.open(opening, motion, grips);
            done.push(led.is_ok());
            match led {
                Ok(let_go) => {
                    opening.let_go = Some(let_go);
                    grips.push((opening.cue.hand, opening.taken..let_go + 1));
                }
                Err(Error::Cancelled) => return Err(Error::Cancelled),
                Err(error) => out.problems.push(not_opened(opening.cue, person, &error.to_string())),
            }
        }
        for (opening, _) in self.openings.iter().zip(&done).filter(|(_, done)| **done) {
            out.tell_opened(opening, motion, person, laying);
            let (positions, rotations) =
                opening.places().into_iter().map(|place| (place.position, place.rotation)).unzip();
            out.carried.push(CarriedThing {
                name: opening.leaf.name.clone(),
                first_frame: opening.moves(),
                positions,
                rotations,
            });
        }
        Ok(done)
    }
}

fn not_opened(open: &OpenCue, person: &str, why: &str) -> String {
    format!("‘{person}’ does not open ‘{}’ by ‘{}’: {why}", open.thing, open.name)
}

/// Why whoever has met the cue of one of the steps with `motion` does not open what they are to there; none where they do, or it is not
/// known yet.
pub(crate) fn unopened(performance: &Performance, step: usize, motion: &Motion) -> Option<String> {
    let pose = motion.postures.last()?.pose();
    let mut open = openings(performance).swap_remove(step);
    for cue in performance.steps[step].openings() {
        let which = performance.leaves.iter().position(|leaf| leaf.name == cue.thing)?;
        let leaf = &performance.leaves[which];
        let opening = Opening::new(cue, (which, leaf), open[which], 0, &pose);
        if opening.let_go.is_none() {
            return Some(not_opened(cue, &performance.start.name, &opening.out_of_reach()));
        }
        open[which] += cue.by.number();
    }
    None
}

impl Done {
    /// Tells how a leaf was opened.
    fn tell_opened(&mut self, opening: &Opening, motion: &Motion, person: &str, laying: &Laying) {
        let Some(let_go) = opening.let_go else { return };
        let off = opening.off(motion, let_go);
        if off > ON_THE_HANDLE {
            self.problems.push(format!(
                "The hand of ‘{person}’ is {:.1} cm off the handle of ‘{}’, which ‘{}’ opens; move the cue at which the person stands.",
                100.0 * off,
                opening.leaf.name,
                opening.cue.name
            ));
        }
        let (arms, rest) = laying.in_the_leaf(opening, let_go, motion);
        self.opened.push(OpenedFigures {
            leaf: opening.leaf.name.clone(),
            open: opening.cue.name.clone(),
            hand: opening.cue.hand,
            taken: opening.taken,
            let_go,
            opened: opening.opened,
            led: opening.share(let_go),
            handle_cm: 100.0 * off,
            arm_cm: 100.0 * arms,
            body_cm: 100.0 * rest,
        });
    }

    /// Tells what became of a thing.
    #[allow(clippy::too_many_arguments)] // What was carried, by whom, and where.
    fn tell(
        &mut self,
        carry: &Carry,
        held: &mut Held,
        thing: &Thing,
        motion: &Motion,
        person: &str,
        laying: &Laying,
        settings: &ReportSettings,
    ) {
        let (own, around, floor) = (thing.own(), laying.around, laying.floor);
        let grip = held.carried_by(motion);
        let deepest = held.in_body(&own, motion).filter(|deep| deep.1 > 0.0);
        if let Some((part, depth, frame)) = deepest.filter(|deep| deep.1 > settings.touch_depth) {
            self.problems.push(format!(
                "‘{}’ is {:.0} cm deep in the {} of ‘{person}’, who carries it, on frame {frame}; grip it elsewhere, or with both hands.",
                thing.name,
                100.0 * depth,
                part.in_words()
            ));
        }
        let above = floor + around.ignore_below;
        let (frames, in_scene) = held.in_scene(&own, around.scene, above, settings.touch_depth);
        if frames > settings.brief_frames {
            self.problems.push(format!(
                "‘{}’, which ‘{person}’ carries, is in the scene on {frames} frames, by {:.0} cm at the most; clear the way, or have it carried \
                 by another one.",
                thing.name,
                100.0 * in_scene
            ));
        }
        let stands = held.at(usize::MAX);
        let off = |down: &Down| (stands.position + own.foot(stands.rotation)).distance(down.cue.position);
        let off = carry.down.as_ref().map(off);
        if let (Some(off), Some(down)) = (off.filter(|off| *off > PUT_WITHIN), &carry.down) {
            self.problems.push(format!(
                "‘{person}’ puts ‘{}’ down {:.1} cm from ‘{}’.",
                thing.name,
                100.0 * off,
                down.cue.name
            ));
        }
        let last = carry.down.as_ref().map_or(motion.len() - 1, |down| down.from);
        self.things.push(ThingFigures {
            thing: thing.name.clone(),
            take: carry.take.name.clone(),
            hand: carry.take.hand,
            taken: carry.taken,
            put: carry.down.as_ref().map(|down| down.cue.name.clone()),
            placed: carry.down.as_ref().map(Down::placed),
            put_cm: off.map(|off| 100.0 * off),
            grip_cm: 100.0 * grip,
            turn_degrees: held.turns(motion, carry.carried(), last).to_degrees(),
            in_body_cm: deepest.map_or(0.0, |deep| 100.0 * deep.1),
            in_scene_cm: 100.0 * in_scene,
            in_others_cm: None,
        });
    }
}

/// How far the trunk leans to the left or to the right of where it was before hands were laid over the motion, at the most, radians.
fn leans_aside(motion: &Motion, laid: &Motion) -> f32 {
    let aside = |posture: &Posture| {
        let pose = posture.pose();
        let trunk = pose.position(Joint::Neck) - pose.position(Joint::Hips);
        let left = posture.planar().direction_to_world(Vec2::X);
        trunk.truncate().dot(left).atan2(trunk.z)
    };
    let pairs = motion.postures.iter().zip(&laid.postures).filter(|(before, after)| before != after);
    pairs.map(|(before, after)| (aside(after) - aside(before)).abs()).fold(0.0, f32::max)
}

impl Laying<'_> {
    /// Has a thing that stands at `rest` be taken, carried and put down; `grips`: hands that have others.
    #[allow(clippy::too_many_arguments)] // What is carried, by whom, and over what it is laid.
    fn carry(
        &self,
        carry: &Carry,
        thing: &Thing,
        rest: Placement,
        motion: &mut Motion,
        way: &Way,
        grips: &[Grip],
        person: &str,
    ) -> Result<Held> {
        let held = Held::plan(carry, &thing.own(), rest, way, person)?;
        let mut laid = motion.clone();
        held.pose_arms(&mut laid, carry, way, self.progress)?;
        let last = motion.len() - 1;
        let first = held.asks(&carry.take.name, carry.taken..=(carry.carried() + FADES).min(last));
        let blend = reach_frames(0.0, self.settings);
        let takes = carry.taken..=carry.lifted();
        let crouches = held.crouches(&laid, self.floor, takes, blend, LIFTS);
        let mut within = self.reach_low(first, crouches, &mut laid, grips)?;
        if let Some(down) = &carry.down {
            let from = down.from.saturating_sub(FADES).max(carry.carried());
            let then = held.asks(&down.cue.name, from..=down.placed() + GRIPS - 1);
            let puts = down.placed()..=down.placed() + GRIPS;
            let crouches = held.crouches(&laid, self.floor, puts, LIFTS, blend);
            within.end = self.reach_low(then, crouches, &mut laid, grips)?.end;
        } else {
            within.end = motion.len();
        }
        let own = (carry.take.hand, carry.held(motion.len()));
        let all: Vec<Grip> = grips.iter().cloned().chain([own]).collect();
        free_arms_within(&mut laid, self.room(), &[], &all, within, self.progress)?;
        *motion = laid;
        Ok(held)
    }

    /// Has a leaf be opened, as far as the arm reaches, and says on which frame it is let go.
    fn open(&self, opening: &Opening, motion: &mut Motion, grips: &[Grip]) -> Result<usize> {
        let unreached = || Error::Unreachable(opening.out_of_reach());
        let mut tried = Some(opening.let_go.ok_or_else(unreached)?);
        let mut best: Option<(f32, usize, Motion)> = None;
        let mut missed = None;
        // Where it is let go sooner the arm need not reach so far, nor round the leaf.
        while let Some(let_go) = tried.filter(|_| best.as_ref().is_none_or(|best| best.0 > 1.0)) {
            tried = opening.sooner(let_go);
            match self.led(opening, let_go, motion, grips) {
                Ok(laid) if opening.off(&laid, let_go) <= ON_THE_HANDLE => {
                    let (arms, _) = self.in_the_leaf(opening, let_go, &laid);
                    let hard = (arms / IN_THE_LEAF).max(leans_aside(motion, &laid) / LEANS_ASIDE);
                    if best.as_ref().is_none_or(|best| hard < best.0) {
                        best = Some((hard, let_go, laid));
                    }
                }
                Err(Error::Cancelled) => return Err(Error::Cancelled),
                Ok(_) => {}
                Err(error) => missed = Some(error),
            }
        }
        let (_, let_go, laid) = best.ok_or_else(|| missed.unwrap_or_else(unreached))?;
        *motion = laid;
        Ok(let_go)
    }

    /// The motion with a leaf opened that is let go on a frame.
    fn led(&self, opening: &Opening, let_go: usize, motion: &Motion, grips: &[Grip]) -> Result<Motion> {
        let mut laid = motion.clone();
        let blend = reach_frames(0.0, self.settings);
        let at = opening.taken..=let_go;
        let crouches = crouch(motion, self.floor, opening.lowest(let_go), at, blend, blend);
        let span = self.reach_low(opening.asks(motion, let_go), crouches, &mut laid, grips)?;
        let own = (opening.cue.hand, opening.taken..let_go + 1);
        let all: Vec<Grip> = grips.iter().cloned().chain([own]).collect();
        free_arms_within(&mut laid, self.room(), &[], &all, span, self.progress)?;
        Ok(laid)
    }

    /// How deep arms, but for a hand on the handle, and the rest of the body are in a leaf while it moves and soon after, metres.
    fn in_the_leaf(&self, opening: &Opening, let_go: usize, motion: &Motion) -> (f32, f32) {
        let object = &self.around.moving[opening.which];
        let held = [(opening.cue.hand, opening.held(let_go))];
        let above = self.floor + self.around.ignore_below;
        let (mut arms, mut rest) = (0.0f32, 0.0f32);
        // The hand comes back past it.
        for frame in opening.taken..=(opening.opened + SETTLES).min(motion.len() - 1) {
            for (part, capsule) in body_capsules(&motion.postures[frame].pose()) {
                let is_on_it = match part {
                    BodyPart::LeftHand => is_carried(&held, Hand::Left, frame),
                    BodyPart::RightHand => is_carried(&held, Hand::Right, frame),
                    _ => false,
                };
                if !is_on_it {
                    let worst = if part.is_arm() { &mut arms } else { &mut rest };
                    let deep = object.contacts_of(&capsule, frame, above);
                    *worst = deep.iter().map(|contact| contact.depth).fold(*worst, f32::max);
                }
            }
        }
        (arms, rest)
    }

    /// Has the body reach for what is asked with knees that bend, but where something is in their way; over which frames.
    fn reach_low(
        &self,
        asked: Vec<Constraint>,
        crouches: Option<Constraint>,
        motion: &mut Motion,
        grips: &[Grip],
    ) -> Result<Range<usize>> {
        if let Some(crouches) = crouches {
            let mut bent = motion.clone();
            let all: Vec<Constraint> = asked.iter().cloned().chain([crouches]).collect();
            let (span, _) = self.reach(&all, &mut bent, grips, None)?;
            let is_free = |frame: usize| {
                let touches = in_scene(&bent.postures[frame].pose(), frame, self.floor, self.around);
                touches.iter().all(|(part, depth, _)| part.is_arm() || *depth < IN_THE_WAY)
            };
            if span.clone().all(is_free) {
                *motion = bent;
                return Ok(span);
            }
        }
        Ok(self.reach(&asked, motion, grips, None)?.0)
    }

    /// Carries hands along their paths, and takes arms out of what they are in meanwhile.
    fn along(
        &self,
        paths: &[&Path],
        motion: &mut Motion,
        grips: &[Grip],
        manifold: Option<&Manifold>,
    ) -> Result<Vec<ConstraintFigures>> {
        let asks = |path: &&Path| constraints(motion, path.first.min(motion.len() - 1), path.cue);
        let asked: Vec<Constraint> = paths.iter().flat_map(asks).collect();
        let (span, figures) = self.reach(&asked, motion, grips, manifold)?;
        let carried: Vec<Grip> = paths.iter().map(|path| (path.cue.hand, path.first..path.end())).collect();
        free_arms_within(motion, self.room(), &carried, grips, span, self.progress)?;
        Ok(figures)
    }

    fn room(&self) -> Room<'_> {
        Room { around: Some(self.around), floor: self.floor, continues: false }
    }

    /// Has the body reach for what is asked, while hands that have something keep it where it is; over which frames.
    fn reach(
        &self,
        asked: &[Constraint],
        motion: &mut Motion,
        grips: &[Grip],
        manifold: Option<&Manifold>,
    ) -> Result<(Range<usize>, Vec<ConstraintFigures>)> {
        let span = whole_span(motion, asked, self.settings);
        let span = span.start..span.end.min(motion.len());
        let mut all = asked.to_vec();
        for (hand, frames) in grips {
            let frames = frames.start.max(span.start)..frames.end.min(span.end);
            if !frames.is_empty() {
                let path = |joint: Joint| {
                    frames.clone().map(|f| motion.postures[f].pose().point(joint, palm(joint))).collect()
                };
                all.extend(joints(*hand).iter().map(|&joint| Constraint {
                    offset: palm(joint),
                    ..Constraint::positions("What is carried", joint, frames.start, path(joint))
                }));
            }
        }
        let wishes =
            Wishes { constraints: &all, keys: &[], scene: Some(self.around.scene), floor: self.floor };
        let EditedMotion { motion: edited, mut figures } =
            edit_motion(motion, &wishes, manifold, self.settings, self.progress)?;
        let drawn = span.clone().map(|frame| {
            let place = |motion: &Motion| motion.postures[frame].root_position.truncate();
            let [before, after] = [place(motion), place(&edited)];
            (before.distance(after), frame)
        });
        if let Some((by, frame)) = drawn.max_by(|a, b| a.0.total_cmp(&b.0)).filter(|drawn| drawn.0 > DRAWN) {
            return Err(Error::Unreachable(format!(
                "‘{}’ would draw the person {by:.2} m from where they are on frame {frame}; move it nearer to where they come by.",
                asked[0].name
            )));
        }
        *motion = edited;
        figures.constraints.truncate(asked.len());
        Ok((span, figures.constraints))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_world::close;

    #[test]
    fn who_leans_aside_is_told_from_who_bends_or_leaned_before() {
        // Facing −X: the trunk rolls about the way it faces, and bends about the line across it.
        let lean = |roll: f32, bend: f32| {
            let mut posture = Posture::default();
            posture.rotations[0] = Quat::from_rotation_z(-std::f32::consts::FRAC_PI_2);
            posture.rotations[Joint::Spine.index()] =
                Quat::from_rotation_y(roll) * Quat::from_rotation_x(bend);
            Motion { postures: vec![Posture::default(), posture], contacts: vec![[1.0; 2]; 2] }
        };
        let (upright, rolled) = (lean(0.0, 0.0), lean(0.4, 0.0));
        let whole = leans_aside(&upright, &rolled);
        assert!(whole > 0.3 && whole <= 0.4, "{whole}");
        close(leans_aside(&rolled, &upright), whole, 1e-6);
        close(leans_aside(&upright, &lean(0.0, 0.6)), 0.0, 1e-3);
        assert_eq!(leans_aside(&rolled, &rolled), 0.0);
    }
}
