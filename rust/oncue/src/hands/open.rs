//! Opening: a hand comes to the handle of a leaf, leads it along its arc or its slide, and lets go.
//!
//! A leaf moves with the least jerk, as a hand moves what it leads. Standing where one stands an arm does not reach all along the arc of a
//! wide door: there the hand lets go while the door swings, and it goes on by itself, as doors do. A lid would fall and a drawer would
//! stop: these are led all the way.

use std::ops::Range;

use glam::{Mat3, Quat, Vec3};
use serde::{Deserialize, Serialize};

use super::carry::GRIPS;
use super::things::Placement;
use crate::cue::{Hand, Hung, Leaf, OpenCue};
use crate::editor::Constraint;
use crate::editor::manipulation::joints;
use crate::math::curve::least_jerk;
use crate::motion::skeleton::{ARMS, JOINT_OFFSET, palm};
use crate::motion::{FRAME_RATE, Joint, Motion, Pose};

/// What is opened moves for so long, seconds, and for so much longer for each metre of the handle's way.
const LASTS: (f32, f32) = (0.8, 0.75);
/// A hand that lets go of what comes towards the person slides off it, away from the hinge, by so much, metres, while it goes along for so
/// many frames; any hand that lets go of what swings on comes to rest within so many more.
const SLIDES: f32 = 0.26;
const ALONG: usize = 6;
const THROUGH: usize = 8;
/// What swings on is led at least over this share of its way.
const LEAST_LED: f32 = 0.4;
/// Two hands on one leaf keep so far apart, metres.
const APART: f32 = 0.20;
/// Shoulders come towards what is reached for by so much, and down to it by so much, metres, and arms are never quite straight. Who may let
/// go leans no farther than is easy.
const LEANS: f32 = 0.22;
const LEANS_EASILY: f32 = 0.10;
const STOOPS: f32 = 0.35;
const STRETCHED: f32 = 0.97;
/// A hand turns with its handle by this share: the rest of it the fingers slip round.
const TURNS_ALONG: f32 = 0.5;
/// Frames before and after it holds the handle in which a hand may touch the leaf.
const NEAR: usize = 5;

/// What is told of something that was opened.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OpenedFigures {
    /// The leaf's name.
    pub leaf: String,
    /// The cue that opened it.
    pub open: String,
    /// By which hand.
    pub hand: Hand,
    /// The frame on which the palm has come to the handle, that on which it lets go, and that on which the leaf stands.
    pub taken: usize,
    /// On which it lets go.
    pub let_go: usize,
    /// On which the leaf stands.
    pub opened: usize,
    /// The part of its way over which the hand led it, 0 to 1; the rest it swung on.
    pub led: f32,
    /// How far the palm is from the handle until it lets go, at the most, cm.
    pub handle_cm: f32,
    /// How deep arms, but for the hand on the handle, are in the leaf while it moves, at the most, cm; 0 where they are not.
    pub arm_cm: f32,
    /// And the rest of the body.
    pub body_cm: f32,
}

/// A leaf that is opened, on frames of the whole motion.
#[derive(Debug, Clone)]
pub(super) struct Opening<'a> {
    pub cue: &'a OpenCue,
    /// Which of the performance's leaves.
    pub which: usize,
    pub leaf: &'a Leaf,
    /// How far it is open before.
    pub from: f32,
    /// The palm has come to the handle.
    pub taken: usize,
    /// It stands open.
    pub opened: usize,
    /// The hand lets go; none where it gets hold of it over too little of its way.
    pub let_go: Option<usize>,
}

impl<'a> Opening<'a> {
    /// `taken`: when the palm has come to the handle of what is open so far as `from`; `pose`: of the person by then.
    pub(super) fn new(
        cue: &'a OpenCue,
        (which, leaf): (usize, &'a Leaf),
        from: f32,
        taken: usize,
        pose: &Pose,
    ) -> Self {
        let usual = LASTS.0 + LASTS.1 * leaf.way(cue.grip, cue.by.number());
        let lasts = (cue.over_seconds.unwrap_or(usual) * FRAME_RATE).round() as usize;
        let mut opening = Self { cue, which, leaf, from, taken, opened: taken + GRIPS + lasts, let_go: None };
        opening.let_go = opening.reached(pose, LEANS_EASILY).or_else(|| opening.reached(pose, LEANS));
        opening
    }

    /// It begins to move.
    pub(super) fn moves(&self) -> usize {
        self.taken + GRIPS
    }

    /// The part of its way that is behind it on a frame.
    pub(super) fn share(&self, frame: usize) -> f32 {
        least_jerk((frame as f32 - self.moves() as f32) / (self.opened - self.moves()) as f32)
    }

    /// How far it is open on a frame, degrees or metres.
    pub(super) fn so_far(&self, frame: usize) -> f32 {
        self.from + self.cue.by.number() * self.share(frame)
    }

    /// Its handle for each hand on a frame, left and right, world, metres; `to_left`: the person's left as the hand set out.
    fn handles(&self, frame: usize, to_left: Vec3) -> [Vec3; 2] {
        let at = self.leaf.at(self.so_far(frame)).point(self.cue.grip);
        let beside = if self.cue.hand == Hand::Both { 0.5 * APART } else { 0.0 };
        let beside = self.turned(frame) * to_left * beside;
        [at + beside, at - beside]
    }

    /// How it is turned on a frame since the hand has come to it, world.
    fn turned(&self, frame: usize) -> Quat {
        let turn = |opened: f32| self.leaf.at(opened).rotation;
        turn(self.so_far(frame)) * turn(self.from).inverse()
    }

    /// Where the palms of who stands so are from when they have come to the handle until they have come to rest, left and right; `let_go`:
    /// when they let go.
    pub(super) fn palms(&self, let_go: usize, pose: &Pose) -> Vec<[Vec3; 2]> {
        let to_left = to_left(pose);
        let mut out: Vec<[Vec3; 2]> =
            (self.taken..=let_go).map(|frame| self.handles(frame, to_left)).collect();
        if let_go < self.opened {
            let comes = self.handles(let_go, to_left)[0] - self.handles(let_go - 1, to_left)[0];
            if comes.dot(pose.position(Joint::Hips) - self.handles(self.taken, to_left)[0]) > 0.0 {
                for after in 1..=ALONG {
                    let frame = (let_go + after).min(self.opened);
                    let off = self.away_from_hinge(frame) * SLIDES * least_jerk(after as f32 / ALONG as f32);
                    out.push(self.handles(frame, to_left).map(|handle| handle + off));
                }
            }
            let [before, last] = [out[out.len() - 2], out[out.len() - 1]];
            for after in 1..=THROUGH {
                let on = after as f32 - (after * after) as f32 / (2 * THROUGH) as f32;
                out.push([0, 1].map(|side| last[side] + (last[side] - before[side]) * on));
            }
        } else {
            out.extend(std::iter::repeat_n(self.handles(let_go, to_left), GRIPS));
        }
        out
    }

    /// From its hinge to its handle on a frame, of length 1, world; nowhere for what slides.
    fn away_from_hinge(&self, frame: usize) -> Vec3 {
        let Hung::Hinge { point, axis } = self.leaf.hung else { return Vec3::ZERO };
        let own = (self.cue.grip - point).reject_from(axis.normalize()).normalize_or_zero();
        self.leaf.at(self.so_far(frame)).rotation * own
    }

    /// The last frame on which the hands of who stands so, and leans so far, metres, are on the handle; none where that is too early.
    fn reached(&self, pose: &Pose, leans: f32) -> Option<usize> {
        let within = |palms: &[Vec3; 2]| {
            joints(self.cue.hand).iter().all(|joint| {
                let side = usize::from(*joint == Joint::RightHand);
                let arm: f32 = ARMS[side][2..].iter().map(|joint| JOINT_OFFSET[joint.index()].length()).sum();
                let most = STRETCHED * (arm + palm(*joint).length()) + leans;
                let away = palms[side] - pose.position(ARMS[side][1]);
                away.with_z(if away.z < 0.0 { (away.z + STOOPS).min(0.0) } else { away.z }).length() < most
            })
        };
        (self.earliest()..=self.opened).rev().find(|frame| self.palms(*frame, pose).iter().all(within))
    }

    /// The earliest frame on which a hand may let go.
    fn earliest(&self) -> usize {
        if !self.leaf.swings_on() {
            return self.opened;
        }
        (self.moves()..self.opened).find(|frame| self.share(*frame) >= LEAST_LED).unwrap_or(self.opened)
    }

    /// A frame on which it is let go sooner, nearer to the earliest there is.
    pub(super) fn sooner(&self, let_go: usize) -> Option<usize> {
        let earliest = self.earliest();
        (let_go > earliest).then(|| (let_go - 1).min(earliest + (let_go - earliest) * 3 / 4))
    }

    /// Has the palms be on the handle until they let go, the hands turned to it; `motion`: as the person stands without.
    pub(super) fn asks(&self, motion: &Motion, let_go: usize) -> Vec<Constraint> {
        let pose = motion.postures[self.taken.min(motion.len() - 1)].pose();
        let path = self.palms(let_go, &pose);
        let name = &self.cue.name;
        let ask = |&joint: &Joint| {
            let side = usize::from(joint == Joint::RightHand);
            let palms: Vec<Vec3> = path.iter().map(|palms| palms[side]).collect();
            let turn = turned_to(joint, palms[0] - pose.position(ARMS[side][1]));
            let turns = (self.taken..=let_go)
                .map(|frame| Quat::IDENTITY.slerp(self.turned(frame), TURNS_ALONG) * turn);
            let hold =
                Constraint { offset: palm(joint), ..Constraint::positions(name, joint, self.taken, palms) };
            let wish = Constraint {
                rotations: turns.collect(),
                soft: true,
                ..Constraint::positions(name, joint, self.taken, Vec::new())
            };
            [hold, wish]
        };
        joints(self.cue.hand).iter().flat_map(ask).collect()
    }

    /// The lowest that a palm gets meanwhile, world z.
    pub(super) fn lowest(&self, let_go: usize) -> f32 {
        let height = |frame: usize| self.handles(frame, Vec3::ZERO)[0].z;
        (self.taken..=let_go).map(height).fold(f32::INFINITY, f32::min)
    }

    /// What is said where a hand does not lead it far enough.
    pub(super) fn out_of_reach(&self) -> String {
        let least = if self.leaf.swings_on() { LEAST_LED } else { 1.0 };
        format!(
            "from where they stand the hand cannot lead its handle over {} of its {}; move the cue at which they stand, or take another \
             hand.",
            self.leaf.in_words(least * self.cue.by.number().abs()),
            self.leaf.in_words(self.cue.by.number().abs())
        )
    }

    /// The frames on which the hand may touch the leaf.
    pub(super) fn held(&self, let_go: usize) -> Range<usize> {
        self.taken.saturating_sub(NEAR)..let_go + GRIPS + NEAR
    }

    /// How far a palm is from its handle, at the most, metres.
    pub(super) fn off(&self, motion: &Motion, let_go: usize) -> f32 {
        let to_left = to_left(&motion.postures[self.taken].pose());
        let off = |frame: usize| {
            let (pose, handles) = (motion.postures[frame].pose(), self.handles(frame, to_left));
            let away = |&joint: &Joint| {
                let side = usize::from(joint == Joint::RightHand);
                pose.point(joint, palm(joint)).distance(handles[side])
            };
            joints(self.cue.hand).iter().map(away).fold(0.0, f32::max)
        };
        (self.taken..=let_go.min(motion.len() - 1)).map(off).fold(0.0, f32::max)
    }

    /// Where it is while it moves, a frame each from that after which it does.
    pub(super) fn places(&self) -> Vec<Placement> {
        (self.moves()..=self.opened).map(|frame| self.leaf.at(self.so_far(frame))).collect()
    }
}

/// The person's left on the floor plane.
fn to_left(pose: &Pose) -> Vec3 {
    (pose.position(Joint::LeftArm) - pose.position(Joint::RightArm)).with_z(0.0).normalize_or(Vec3::X)
}

/// A hand whose fingers point the way of a reach, level, and whose palm faces down and inwards: as one takes hold of handles, be they bars,
/// knobs or edges.
fn turned_to(hand: Joint, reach: Vec3) -> Quat {
    let ahead = reach.with_z(0.0).normalize_or(Vec3::NEG_Y);
    let left = Vec3::Z.cross(ahead);
    let (inwards, out) = if hand == Joint::LeftHand { (-left, 1.0) } else { (left, -1.0) };
    let palm = (inwards - Vec3::Z).normalize();
    let turn = Mat3::from_cols(ahead * out, -palm.cross(ahead * out), -palm);
    Quat::from_mat3(&turn)
}
