//! Taking, carrying and putting down: where a thing is on each frame, and how the body is that has it in the hands.
//!
//! A thing moves as one moves it: it is lifted off, kept level and before the body, and turned with it; the palms are where they have
//! gripped it. The body reaches for it and puts it down as it reaches for any place; in between arms alone follow.

use std::ops::{Range, RangeInclusive};

use glam::{Quat, Vec2, Vec3};

use super::things::{Box3, Placement};
use crate::anatomy::body_capsules;
use crate::body_solver::{DegreesOfFreedom, FADE_FRAMES, Span, Term, correct, is_supported};
use crate::cue::{Hand, PutCue, TakeCue};
use crate::editor::Constraint;
use crate::error::{Error, Result};
use crate::figures::BodyPart;
use crate::math::capsule::Capsule;
use crate::math::curve::{least_jerk, smoothstep, softened, widened};
use crate::math::planar::rotate;
use crate::math::rotation::{angle_between, wrap_angle, yaw};
use crate::motion::skeleton::{ARMS, palm};
use crate::motion::{Joint, Motion, Pose, Posture};
use crate::progress::Progress;
use crate::scene::SceneIndex;

/// Frames in which a hand closes on a thing, or lets it go.
pub(super) const GRIPS: usize = 6;
/// Frames in which it is lifted to where it is carried, and set down from there.
pub(super) const LIFTS: usize = 27;
/// Frames of carrying that the reach and the setting down fade over.
pub(super) const FADES: usize = 14;
/// A thing keeps so far before the pelvis, metres: what trunk and clothes take of it.
const TRUNK: f32 = 0.17;
/// And over thighs that are raised, the thighs' own girth included, metres.
const OVER_KNEES: f32 = 0.09;
/// Palms are carried at least so far ahead of the pelvis, and no farther, metres: upper arms hang, elbows are bent.
const AHEAD: (f32, f32) = (0.30, 0.48);
/// And so far over it: forearms lie level; for what reaches far down, higher.
const OVER_PELVIS: (f32, f32) = (0.17, 0.45);
/// What is carried ends no farther than this below the pelvis, metres: walking thighs pass under it.
const BELOW: f32 = 0.14;
/// One palm is carried so far to its side, metres.
const ASIDE: f32 = 0.18;
/// Palms keep so far over what a thing stands on, metres: fingers point down.
const OVER_GROUND: f32 = 0.07;
/// Two palms come no farther apart than this, metres.
const APART: f32 = 0.80;
/// From where it is carried a thing is set down no farther away, metres.
const SET_DOWN: f32 = 1.20;
/// What is set down is turned in one hand and in two by no more than this, radians.
const TURNS: [f32; 2] = [1.05, 0.61];
/// Who reaches lower than this over the floor bends the knees: the pelvis sinks by so much of what is missing, up to so much, and goes back
/// by so much of that. Metres and shares.
const CROUCHES_BELOW: f32 = 0.80;
const SINKS: f32 = 0.80;
const CROUCHES: f32 = 0.42;
const LEAST_CROUCH: f32 = 0.03;
const BACK: f32 = 0.30;
/// Who carries much before the belly leans back so far, radians, from a thing of the first size to one of the second, metres.
const LEANS: f32 = 0.10;
const LEANS_FOR: (f32, f32) = (0.25, 0.60);
/// Edges of a thing are looked at as if they were so thick, metres; so many frames after it is lifted, and before it stands, it is near what
/// it stands on.
const EDGES: f32 = 0.015;
const STANDS: usize = 8;
/// σ of palms on what they carry, metres, and of hands that keep their turn on it, radians.
const PALM_SIGMA: f32 = 2e-4;
const TURN_SIGMA: f32 = 0.03;

/// A thing in the hands, on frames of the whole motion.
#[derive(Debug, Clone)]
pub(super) struct Carry<'a> {
    pub take: &'a TakeCue,
    /// Which of the performance's things.
    pub thing: usize,
    /// The palms have come to it.
    pub taken: usize,
    pub down: Option<Down<'a>>,
}

/// Where it is put down.
#[derive(Debug, Clone)]
pub(super) struct Down<'a> {
    pub cue: &'a PutCue,
    /// Sets out to be set down.
    pub from: usize,
}

impl Carry<'_> {
    /// It begins to move.
    pub(super) fn lifted(&self) -> usize {
        self.taken + GRIPS
    }

    /// It is where it is carried.
    pub(super) fn carried(&self) -> usize {
        self.lifted() + LIFTS
    }

    /// The frames on which the palms are on it, in a motion of so many frames.
    pub(super) fn held(&self, frames: usize) -> Range<usize> {
        self.taken..self.down.as_ref().map_or(frames, |down| down.placed() + GRIPS)
    }
}

impl Down<'_> {
    /// It stands where it is put.
    pub(super) fn placed(&self) -> usize {
        self.from + LIFTS
    }
}

/// Where the body is and faces on each frame, as what is carried follows it: without its sway.
pub(super) struct Way {
    places: Vec<Vec3>,
    yaws: Vec<f32>,
    /// Knees over the pelvis, metres.
    knees: Vec<f32>,
}

impl Way {
    pub(super) fn of(motion: &Motion) -> Self {
        /// Frames that are averaged to either side: half of a step.
        const SWAY: usize = 8;
        const TURN: usize = 12;
        /// So far the neck is ahead of the pelvis of who stands upright, metres.
        const UPRIGHT: f32 = 0.05;
        let poses: Vec<Pose> = motion.postures.iter().map(Posture::pose).collect();
        let facing = |pose: &Pose| {
            let of = |joint: Joint| rotate(yaw(pose.rotation(joint)), Vec2::NEG_Y);
            (of(Joint::Hips) + of(Joint::Spine2)).normalize_or(of(Joint::Hips))
        };
        let facings: Vec<Vec2> = poses.iter().map(facing).collect();
        // Shoulders that come forward take what is carried along.
        let place = |(pose, ahead): (&Pose, &Vec2)| {
            let hips = pose.position(Joint::Hips);
            let lean = (pose.position(Joint::Neck) - hips).truncate().dot(*ahead) - UPRIGHT;
            hips + (*ahead * lean.max(0.0)).extend(0.0)
        };
        let places: Vec<Vec3> = poses.iter().zip(&facings).map(place).collect();
        let soft = |values: Vec<f32>, radius: usize| softened(&values, radius);
        let axis = |axis: usize| soft(places.iter().map(|place| place[axis]).collect(), SWAY);
        let (x, y, z) = (axis(0), axis(1), axis(2));
        let turn = |axis: usize| soft(facings.iter().map(|ahead| ahead[axis]).collect(), TURN);
        // Whoever turns round has turned all the way.
        let mut yaws: Vec<f32> = turn(0).iter().zip(turn(1)).map(|(x, y)| f32::atan2(*x, -y)).collect();
        for frame in 1..yaws.len() {
            yaws[frame] = yaws[frame - 1] + wrap_angle(yaws[frame] - yaws[frame - 1]);
        }
        let knee = |pose: &Pose| {
            let highest = pose.position(Joint::LeftLeg).z.max(pose.position(Joint::RightLeg).z);
            highest - pose.position(Joint::Hips).z
        };
        Self {
            places: (0..poses.len()).map(|f| Vec3::new(x[f], y[f], z[f])).collect(),
            yaws,
            knees: poses.iter().map(knee).collect(),
        }
    }

    /// A point of the body's own, ahead along −Y, on a frame; world, metres.
    fn point(&self, frame: usize, own: Vec3) -> Vec3 {
        self.places[frame] + Quat::from_rotation_z(self.yaws[frame]) * own
    }
}

/// How a thing is held, and where it is on each frame.
pub(super) struct Held {
    rest: Placement,
    /// Where the palms are on it, left and right, in its own frame.
    pub palms: [Option<Vec3>; 2],
    /// On each frame from the one on which it was taken, to the one on which it stands again, or the motion's end.
    pub places: Vec<Placement>,
    first: usize,
    /// Its size across the body and ahead, metres.
    size: f32,
}

impl Held {
    /// # Errors
    /// `Unreachable`, by a sentence, for what cannot be carried so or put down so. `person`: whose hands.
    pub(super) fn plan(carry: &Carry, own: &Box3, rest: Placement, way: &Way, person: &str) -> Result<Self> {
        let TakeCue { name, hand, grip, .. } = carry.take;
        let facing = way.yaws[carry.taken];
        let to_left = rotate(facing, Vec2::X).extend(0.0);
        // Hands come to its faces squarely.
        let across = own.axis_along(&rest, to_left);
        let palms = own.grips(*hand, *grip, rest.rotation.inverse() * across);
        // Nor do fingers come into what it stands on.
        let least = rest.position.z + own.foot(rest.rotation).z + OVER_GROUND;
        let lifted = |palm: Vec3| {
            let at = rest.point(palm);
            rest.rotation.inverse() * (at.with_z(at.z.max(least)) - rest.position)
        };
        let palms = palms.map(|palm| palm.map(lifted));
        let there: Vec<Vec3> = palms.iter().flatten().copied().collect();
        let middle = there.iter().sum::<Vec3>() / there.len() as f32;
        let apart = there[0].distance(there[there.len() - 1]);
        // It is turned so that they come before the body.
        let square = wrap_angle(f32::atan2(to_left.y, to_left.x) - f32::atan2(across.y, across.x));
        let aligned = Quat::from_rotation_z(square - facing) * rest.rotation;
        let corners = own.corners().map(|corner| aligned * (corner - middle));
        let farthest = |axis: Vec3| corners.iter().map(|corner| corner.dot(axis)).fold(0.0, f32::max);
        let (back, below) = (farthest(Vec3::Y), farthest(Vec3::NEG_Z));
        let ahead = AHEAD.0.max(TRUNK + back);
        if ahead > AHEAD.1 || apart > APART || below - BELOW > OVER_PELVIS.1 {
            return Err(Error::Unreachable(format!(
                "from where ‘{name}’ grips it, it reaches {back:.2} m towards ‘{person}’ and {below:.2} m down, and hands would be \
                 {apart:.2} m apart, which is too big to carry; grip it elsewhere, or take something smaller."
            )));
        }
        let aside = match hand {
            Hand::Left => ASIDE,
            Hand::Right => -ASIDE,
            Hand::Both => 0.0,
        };
        let low = OVER_PELVIS.0.max(below - BELOW);
        let needed: Vec<f32> =
            way.knees.iter().map(|knee| (knee + OVER_KNEES + below - low).max(0.0)).collect();
        let raised = softened(&widened(&needed, 10), 10);
        let turned = |frame: usize| way.yaws[frame] - facing + square;
        // Its middle and turn where it is carried.
        let carried =
            |frame: usize| (way.point(frame, Vec3::new(aside, -ahead, low + raised[frame])), turned(frame));
        let last = carry.down.as_ref().map_or(way.yaws.len() - 1, Down::placed);
        let down = match &carry.down {
            Some(down) => {
                let before = turned(down.from);
                let by = down.cue.yaw.map_or(0.0, |asked| wrap_angle(asked - yaw(rest.rotation) - before));
                let most = TURNS[usize::from(*hand == Hand::Both)];
                if by.abs() > most {
                    return Err(Error::Unreachable(format!(
                        "‘{}’ has ‘{person}’ turn what is carried by {:.0}° to put it down, and a person turns it by up to {:.0}°; turn the \
                         cue, or the one at which the person stands.",
                        down.cue.name,
                        by.to_degrees().abs(),
                        most.to_degrees()
                    )));
                }
                let turn = before + by;
                let rotation = Quat::from_rotation_z(turn) * rest.rotation;
                let place = down.cue.position - own.foot(rotation) + rotation * middle;
                let away = place.distance(carried(down.from).0);
                if away > SET_DOWN {
                    return Err(Error::Unreachable(format!(
                        "‘{}’ lies {away:.2} m from the hands of ‘{person}’, who sets down within {SET_DOWN:.2} m; move it, or the cue at \
                         which the person stands.",
                        down.cue.name
                    )));
                }
                Some((down.from, place, turn))
            }
            None => None,
        };
        let place = |frame: usize| {
            let (mut at, mut turn) = (rest.point(middle), 0.0);
            if frame > carry.lifted() {
                let share = (frame - carry.lifted()) as f32 / LIFTS as f32;
                let (to, whole) = carried(frame);
                (at, turn) = (moved(at, to, share), whole * least_jerk(share));
            }
            if let Some((from, to, whole)) = down
                && frame > from
            {
                let share = (frame - from) as f32 / LIFTS as f32;
                at = moved(at, to, share);
                turn += (whole - turn) * least_jerk(share);
            }
            let rotation = Quat::from_rotation_z(turn) * rest.rotation;
            Placement { position: at - rotation * middle, rotation }
        };
        Ok(Self {
            rest,
            palms,
            places: (carry.taken..=last).map(place).collect(),
            first: carry.taken,
            size: (own.high - own.low).max_element(),
        })
    }

    /// Where it is on a frame.
    pub(super) fn at(&self, frame: usize) -> Placement {
        let after = frame.saturating_sub(self.first).min(self.places.len() - 1);
        if frame < self.first { self.rest } else { self.places[after] }
    }

    /// The hands on it, with their places in its frame.
    fn hands(&self) -> impl Iterator<Item = (usize, Joint, Vec3)> + '_ {
        let of = |(side, palm): (usize, &Option<Vec3>)| palm.map(|palm| (side, Joint::HANDS[side], palm));
        self.palms.iter().enumerate().filter_map(of)
    }

    /// Has the palms be on it over these frames.
    pub(super) fn asks(&self, name: &str, frames: RangeInclusive<usize>) -> Vec<Constraint> {
        let path = |palm: Vec3| frames.clone().map(|frame| self.at(frame).point(palm)).collect();
        let ask = |(_, joint, own): (usize, Joint, Vec3)| Constraint {
            offset: palm(joint),
            ..Constraint::positions(name, joint, *frames.start(), path(own))
        };
        self.hands().map(ask).collect()
    }

    /// See [`crouch`]. `at`: the frames on which the hands are there; so many frames before them it sets out, and is back after them.
    pub(super) fn crouches(
        &self,
        motion: &Motion,
        floor: f32,
        at: RangeInclusive<usize>,
        before: usize,
        after: usize,
    ) -> Option<Constraint> {
        let low =
            self.hands().map(|(.., own)| self.at(*at.start()).point(own).z).fold(f32::INFINITY, f32::min);
        crouch(motion, floor, low, at, before, after)
    }

    /// Gives a motion the arms, and the back, of who carries it, from when it is lifted until it stands again.
    ///
    /// # Errors
    /// `Cancelled`.
    pub(super) fn pose_arms(
        &self,
        motion: &mut Motion,
        carry: &Carry,
        way: &Way,
        progress: &Progress,
    ) -> Result<()> {
        let carried = carry.carried();
        let frames = motion.len();
        let from = carry.down.as_ref().map_or(frames - 1, |down| down.from);
        let sides = self.palms.map(|palm| palm.is_some());
        let terms = |frame: usize| {
            let at = self.at(frame);
            let point = |(_, joint, own): (usize, Joint, Vec3)| Term::Point {
                joint,
                offset: palm(joint),
                target: at.point(own),
                sigma: Vec3::splat(PALM_SIGMA),
            };
            self.hands().map(point).collect::<Vec<Term>>()
        };
        // Arms as they carry it once it is lifted; they stay so, whatever they would do otherwise.
        let arms = DegreesOfFreedom::holding(sides, false);
        let asked = [terms(carried)];
        let here = [leaning(&motion.postures[carried], self.lean())];
        let alone = Span {
            postures: &here,
            joins: [false; 2],
            degrees: &arms,
            terms: &asked,
            found: None,
            spread: 0.0,
        };
        let holds = correct(&alone, progress)?[0];
        let weight = |frame: usize| {
            let up = smoothstep((frame as f32 - carry.lifted() as f32) / LIFTS as f32);
            let down =
                carry.down.as_ref().map_or(0.0, |down| (frame as f32 - down.from as f32) / LIFTS as f32);
            up * (1.0 - smoothstep(down))
        };
        for frame in carry.lifted()..carry.held(frames).end.min(frames) {
            let weight = weight(frame);
            let posture = leaning(&motion.postures[frame], self.lean() * weight);
            motion.postures[frame] = posture;
            for joint in self.hands().flat_map(|(side, ..)| ARMS[side]) {
                let own = &mut motion.postures[frame].rotations[joint.index()];
                *own = own.slerp(holds.rotations[joint.index()], weight);
            }
        }
        // And follow it, the hands turned on it as they were.
        let (first, end) = (carried.saturating_sub(FADES), (from + FADES + 1).min(frames));
        let pose = holds.pose();
        let mut asked: Vec<Vec<Term>> = vec![Vec::new(); end - first];
        for frame in carried..=from.min(frames - 1) {
            let turned = Quat::from_rotation_z(way.yaws[frame] - way.yaws[carried]);
            let turn = |(_, joint, _): (usize, Joint, Vec3)| Term::Turn {
                joint,
                target: turned * pose.rotation(joint),
                sigma: TURN_SIGMA,
            };
            asked[frame - first].extend(terms(frame).into_iter().chain(self.hands().map(turn)));
        }
        let arms = DegreesOfFreedom::holding(sides, true);
        let span = Span {
            postures: &motion.postures[first..end],
            joins: [true, end < frames],
            degrees: &arms,
            terms: &asked,
            found: None,
            spread: FADE_FRAMES,
        };
        let posed = correct(&span, progress)?;
        motion.postures[first..end].copy_from_slice(&posed);
        Ok(())
    }

    fn lean(&self) -> f32 {
        let much = (self.size - LEANS_FOR.0) / (LEANS_FOR.1 - LEANS_FOR.0);
        if self.palms.iter().all(Option::is_some) { LEANS * smoothstep(much) } else { 0.0 }
    }

    /// Where it came to be in a motion whose palms have it, and how far the palms are from where they grip it at the most, metres: it goes
    /// with the hands.
    pub(super) fn carried_by(&mut self, motion: &Motion) -> f32 {
        let mut worst = 0.0f32;
        for (i, place) in self.places.iter_mut().enumerate() {
            let Some(posture) = motion.postures.get(self.first + i) else { break };
            let pose = posture.pose();
            let miss: Vec<Vec3> = self
                .palms
                .iter()
                .zip(Joint::HANDS)
                .filter_map(|(own, joint)| Some(pose.point(joint, palm(joint)) - place.point((*own)?)))
                .collect();
            let mean = miss.iter().sum::<Vec3>() / miss.len() as f32;
            if i >= GRIPS {
                place.position += mean;
                worst = miss.iter().map(|one| one.distance(mean)).fold(worst, f32::max);
            }
        }
        worst
    }

    /// How far a hand turns on it while it is carried, from `first` to `last`, at the most, radians.
    pub(super) fn turns(&self, motion: &Motion, first: usize, last: usize) -> f32 {
        let on_it = |frame: usize, joint: Joint| {
            self.at(frame).rotation.inverse() * motion.postures[frame].pose().rotation(joint)
        };
        let turn = |joint: Joint| {
            let before = on_it(first, joint);
            (first..=last.min(motion.len() - 1))
                .map(|frame| angle_between(before, on_it(frame, joint)))
                .fold(0.0, f32::max)
        };
        self.hands().map(|(_, joint, _)| turn(joint)).fold(0.0, f32::max)
    }

    /// The part of the body, but arms, that it is deepest in while it is carried: how deep, metres, and on which frame.
    pub(super) fn in_body(&self, own: &Box3, motion: &Motion) -> Option<(BodyPart, f32, usize)> {
        let frames = (self.first + GRIPS..self.first + self.places.len()).filter(|&f| f < motion.len());
        let deep = frames.flat_map(|frame| {
            let at = self.at(frame);
            body_capsules(&motion.postures[frame].pose())
                .into_iter()
                .filter(|(part, _)| !part.is_arm())
                .map(move |(part, capsule)| (part, own.depth(&at, &capsule) - part.gives(), frame))
        });
        deep.max_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// On how many frames it is deeper in the scene than `touch` while it is carried, and how deep at the most, metres. What is lower than
    /// `above` (world z) is not counted. As it is lifted and set down it stands on things.
    pub(super) fn in_scene(&self, own: &Box3, scene: &SceneIndex, above: f32, touch: f32) -> (usize, f32) {
        let ends = self.places.len().saturating_sub(STANDS);
        let filled = own.filled(EDGES);
        let deep: Vec<f32> = (GRIPS + STANDS..ends)
            .map(|i| {
                let at = self.places[i];
                let depth = |capsule: &Capsule| {
                    let ends = capsule.ends.map(|end| at.point(end));
                    scene.depth_of(&Capsule { ends, ..*capsule }, above).map_or(0.0, |contact| contact.depth)
                };
                filled.iter().map(depth).fold(0.0, f32::max)
            })
            .collect();
        (deep.iter().filter(|depth| **depth > touch).count(), deep.into_iter().fold(0.0, f32::max))
    }
}

/// Has the pelvis sink, and go back over the feet, of who stands and reaches as low as `low` (world z): rather knees that bend than a bow.
/// `at`: the frames on which the hands are there; so many frames before them it sets out, and is back after them.
pub(super) fn crouch(
    motion: &Motion,
    floor: f32,
    low: f32,
    at: RangeInclusive<usize>,
    before: usize,
    after: usize,
) -> Option<Constraint> {
    let sinks = (CROUCHES_BELOW - (low - floor)).clamp(0.0, CROUCHES / SINKS) * SINKS;
    let there = motion.postures[*at.start()];
    if sinks < LEAST_CROUCH || is_supported(&there.pose(), floor) {
        return None;
    }
    let back = -there.planar().forward().extend(0.0) * BACK;
    let first = at.start().saturating_sub(before);
    let place = |frame: usize| {
        let out = (frame as f32 - first as f32) / before as f32;
        let home = (frame as f32 - *at.end() as f32) / after as f32;
        let share = least_jerk(out) * (1.0 - least_jerk(home));
        motion.postures[frame].root_position + (back - Vec3::Z) * sinks * share
    };
    let end = (at.end() + after).min(motion.len() - 1);
    let path = (first..=end).map(place).collect();
    Some(Constraint { soft: true, ..Constraint::positions("Knees", Joint::Hips, first, path) })
}

/// Who leans back by so much, radians, but for who sits.
fn leaning(posture: &Posture, by: f32) -> Posture {
    let mut out = *posture;
    let pose = posture.pose();
    let stands = pose.position(Joint::Hips).z
        - pose.position(Joint::LeftFoot).z.min(pose.position(Joint::RightFoot).z);
    let turn = Quat::from_rotation_x(-0.5 * by * smoothstep((stands - 0.60) / 0.15));
    for joint in [Joint::Spine, Joint::Spine1] {
        out.rotations[joint.index()] *= turn;
    }
    out
}

/// On the way from one place to another, by the share of its time: what rises rises first, what sinks sinks last, and between it is a
/// little over both.
fn moved(from: Vec3, to: Vec3, share: f32) -> Vec3 {
    /// Metres, and how much of the time the one is ahead of the other.
    const CLEARS: f32 = 0.03;
    const AHEAD: f32 = 0.30;
    let share = share.clamp(0.0, 1.0);
    let early = least_jerk(share / (1.0 - AHEAD));
    let late = least_jerk((share - AHEAD) / (1.0 - AHEAD));
    let (level, upright) = if to.z > from.z { (late, early) } else { (early, late) };
    let hump = CLEARS * (std::f32::consts::PI * share).sin().powi(2);
    from.truncate().lerp(to.truncate(), level).extend(from.z + (to.z - from.z) * upright + hump)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_world::room;

    /// A box of 30 × 40 × 20 cm that is carried along x at this height, 2 cm a frame.
    fn held(z: f32) -> (Held, Box3) {
        let at = |i: usize| Placement {
            position: Vec3::new(-0.6 + 0.02 * i as f32, 0.0, z),
            rotation: Quat::from_rotation_z(0.3),
        };
        let rest = at(0);
        let own = Box3 { low: Vec3::new(-0.15, -0.20, -0.10), high: Vec3::new(0.15, 0.20, 0.10) };
        (Held { rest, palms: [None; 2], places: (0..60).map(at).collect(), first: 0, size: 0.4 }, own)
    }

    #[test]
    fn a_box_through_a_wall_is_in_the_scene_and_one_on_a_table_is_not() {
        // A wall of 4 cm: the box, turned so and about 40 cm long on its way, is in it on some twenty frames.
        let wall = room(&[([0.0, -1.0, 0.0], [0.04, 1.0, 2.0])]);
        let (held, own) = held(1.0);
        let (frames, depth) = held.in_scene(&own, &wall, 0.1, 0.01);
        assert!((15..26).contains(&frames) && depth > 0.05, "{frames} {depth}");
        let table = room(&[([-1.0, -1.0, 0.0], [1.0, 1.0, 0.9])]);
        assert_eq!(held.in_scene(&own, &table, 0.1, 0.01).0, 0);
        let sunk = room(&[([-1.0, -1.0, 0.0], [1.0, 1.0, 0.93])]);
        let (frames, depth) = held.in_scene(&own, &sunk, 0.1, 0.01);
        assert!(frames == 60 - GRIPS - 2 * STANDS && (0.025..0.04).contains(&depth), "{frames} {depth}");
        // What is higher than asked about is not there.
        assert_eq!(held.in_scene(&own, &sunk, 1.5, 0.01), (0, 0.0));
    }
}
