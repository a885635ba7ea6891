//! Limbs out of the own body and out of the scene: what transitions, clips and other edits leave of it.
//!
//! Wherever a limb is deeper than flesh gives, the finishing pass moves as little as takes it out, smoothly: legs, spine and the
//! place of the pelvis first, while the feet stay where they stand; then shoulders, elbows and wrists alone. A limb is looked for in the
//! own body half-way between frames, too: that is seen where a motion is played slower or at another frame rate. The paper has no such
//! step: its bodies have no girth.

use std::ops::Range;

use glam::Vec3;

use crate::anatomy::{
    BodyCapsules, BodyPart, OwnContact, SHAPES, arm_contacts, body_capsules, half_way, leg_contacts,
};
use crate::body_solver::{DegreesOfFreedom, FootPlan, FoundTerms, Span, Term, correct};
use crate::cue::{Hand, is_carried};
use crate::error::Result;
use crate::figures::Surroundings;
use crate::library::contact::runs;
use crate::math::capsule::Capsule;
use crate::motion::skeleton::{ARMS, palm};
use crate::motion::{Joint, Motion, Pose, Posture};
use crate::progress::Progress;
use crate::scene::SceneContact;

/// An arm that is deeper than this in the own body or the scene is taken out, metres: less than is counted.
const ARM_DEEPER: f32 = 0.004;
/// Legs and trunk are left where they touch as people do, metres.
const BODY_DEEPER: f32 = 0.007;
/// What is taken out ends so far clear, metres: the least-squares problem leaves a little.
const CLEAR: f32 = 0.001;
/// Arms lie on tables, and backs lean on backrests, so deep, metres.
const RESTS: f32 = 0.002;
/// What is nearer than this is looked at as well, metres: were it not, a limb that has just been taken out would be let go back.
const NEAR: f32 = 0.03;
/// So near its beginning a capsule is the end of the one before it, as a part of its length.
const NEAR_END: f32 = 0.02;
/// σ of a contact, metres.
const CONTACT_SIGMA: f32 = 2e-3;
/// σ of an arm that is to stay as it is, radians, and of a pelvis that is where it was asked for, metres.
const STAYS_SIGMA: f32 = 1e-4;
/// σ of a hand that has something: of its palm, metres, and of its turn, radians.
const GRIP_SIGMA: (f32, f32) = (2e-4, 0.03);
/// σ of a pelvis that may give way, metres.
const AWAY_SIGMA: f32 = 0.01;
/// A correction that moves a joint of legs or trunk farther than this is none, metres: who has to go so far out of the way has to go
/// another way. Knees that come round under a desk go by 16 cm.
const FARTHEST: f32 = 0.20;
/// Frames over which the correction fades: slower than that of a body that reaches, or a swinging arm would be hurried.
const FADE_FRAMES: f64 = 8.0;
/// Frames before and after what is corrected in which the correction fades.
const MARGIN: usize = 2 * FADE_FRAMES as usize;

/// Where a motion's limbs are to be free.
#[derive(Clone, Copy)]
pub(crate) struct Room<'a> {
    /// What they are kept out of; none: the own body alone.
    pub around: Option<&'a Surroundings<'a>>,
    /// World height of the floor, metres.
    pub floor: f32,
    /// Whether the motion goes on from another, whose end is to stay as it is.
    pub continues: bool,
}

/// Takes legs, trunk and head of a motion out of the scene, and legs out of each other. From frame `rests` on the pelvis stays
/// where it is: what the action cue asks for is met there.
///
/// # Errors
/// `Cancelled`.
pub(crate) fn free_body(motion: &mut Motion, room: Room, rests: usize, progress: &Progress) -> Result<()> {
    let plan = FootPlan::of(motion);
    let held = |frame: usize, posture: &Posture, out: &mut Vec<Term>| {
        plan.terms(frame, room.floor, out);
        let sigma = Vec3::splat(if frame >= rests { STAYS_SIGMA } else { AWAY_SIGMA });
        let target = posture.root_position;
        out.push(Term::Point { joint: Joint::Hips, offset: Vec3::ZERO, target, sigma });
    };
    let touches = Touches { room, limbs: Limbs::Body, carried: &[], gripping: &[], first: 0 };
    let all = 0..motion.len();
    free(motion, touches, &DegreesOfFreedom::body_on_its_feet(), all, held, progress)
}

/// Takes the arms of a motion out of the own body and out of the scene. `carried`: frames in which a hand follows a cue; that
/// arm stays as it is there.
///
/// # Errors
/// `Cancelled`.
pub(crate) fn free_arms(
    motion: &mut Motion,
    room: Room,
    carried: &[(Hand, Range<usize>)],
    progress: &Progress,
) -> Result<()> {
    let all = 0..motion.len();
    free_arms_within(motion, room, carried, &[], all, progress)
}

/// The same of what they are in on the frames `within`; what is farther from these than a correction takes to fade stays as it is, to
/// the bit. `gripping`: frames in which a hand has something; it stays where it is, and its arm makes way.
///
/// # Errors
/// `Cancelled`.
pub(crate) fn free_arms_within(
    motion: &mut Motion,
    room: Room,
    carried: &[(Hand, Range<usize>)],
    gripping: &[(Hand, Range<usize>)],
    within: Range<usize>,
    progress: &Progress,
) -> Result<()> {
    let touches = Touches { room, limbs: Limbs::Arms, carried, gripping, first: 0 };
    let held = |frame: usize, posture: &Posture, out: &mut Vec<Term>| touches.keep(frame, posture, out);
    free(motion, touches, &DegreesOfFreedom::arms(), within, held, progress)
}

/// Takes out what `touches` finds on the frames `within`. `held` adds what stays as it is in a frame.
fn free(
    motion: &mut Motion,
    touches: Touches,
    degrees: &DegreesOfFreedom,
    within: Range<usize>,
    held: impl Fn(usize, &Posture, &mut Vec<Term>),
    progress: &Progress,
) -> Result<()> {
    let deepest = |all: &[(usize, Touch)]| all.iter().map(|(_, touch)| touch.depth).fold(0.0, f32::max);
    let limbs = touches.limbs;
    let poses: Vec<Pose> = motion.postures.iter().map(Posture::pose).collect();
    let is_deep =
        |frame| within.contains(&frame) && deepest(&touches.of(frame, &poses)) > limbs.stay_within();
    let deep: Vec<bool> = (0..motion.len()).map(is_deep).collect();
    for (first, end) in merged(runs(&deep, true), motion.len()) {
        let postures = &motion.postures[first..end];
        let mut terms: Vec<Vec<Term>> = vec![Vec::new(); postures.len()];
        for (i, (posture, terms)) in postures.iter().zip(&mut terms).enumerate() {
            held(first + i, posture, terms);
        }
        let found = Touches { first, ..touches };
        let span = Span {
            postures,
            joins: [first > 0 || touches.room.continues, end < motion.len()],
            degrees,
            terms: &terms,
            found: Some(&found),
            spread: FADE_FRAMES,
        };
        let free = correct(&span, progress)?;
        // Squeezed from two sides a limb may come to lie no better.
        let (before, after) = (&poses[first..end], free.iter().map(Posture::pose).collect::<Vec<_>>());
        let sum = |poses: &[Pose]| (0..poses.len()).map(|f| deepest(&found.of(f, poses))).sum::<f32>();
        let moved = before.iter().zip(&after).map(|(a, b)| farthest(a, b));
        let too_far = limbs == Limbs::Body && moved.fold(0.0, f32::max) > FARTHEST;
        if sum(&after) < sum(before) && !too_far {
            motion.postures[first..end].copy_from_slice(&free);
        }
    }
    Ok(())
}

/// How far a joint is from where it was, at the most, metres.
fn farthest(before: &Pose, after: &Pose) -> f32 {
    before.positions.iter().zip(&after.positions).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max)
}

/// Runs with their margins, those that meet as one.
fn merged(runs: Vec<(usize, usize)>, frames: usize) -> Vec<(usize, usize)> {
    let mut out: Vec<(usize, usize)> = Vec::new();
    for (first, end) in runs {
        let (first, end) = (first.saturating_sub(MARGIN), (end + MARGIN).min(frames));
        match out.last_mut() {
            Some(last) if last.1 >= first => last.1 = end,
            _ => out.push((first, end)),
        }
    }
    out
}

/// What is taken out of what it is in.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Limbs {
    Arms,
    /// Legs, trunk, pelvis and head.
    Body,
}

impl Limbs {
    fn have(self, part: BodyPart) -> bool {
        match self {
            Limbs::Arms => part.is_arm(),
            Limbs::Body => !part.is_arm(),
        }
    }

    /// Deeper than this they do not stay, metres.
    fn stay_within(self) -> f32 {
        match self {
            Limbs::Arms => ARM_DEEPER,
            Limbs::Body => BODY_DEEPER,
        }
    }

    fn own_contacts(self, capsules: BodyCapsules) -> Vec<OwnContact> {
        match self {
            Limbs::Arms => arm_contacts(capsules, -NEAR).collect(),
            Limbs::Body => leg_contacts(capsules, -NEAR).collect(),
        }
    }
}

#[derive(Clone, Copy)]
struct Touches<'a> {
    room: Room<'a>,
    limbs: Limbs,
    carried: &'a [(Hand, Range<usize>)],
    gripping: &'a [(Hand, Range<usize>)],
    /// The motion's frame that is frame 0 here.
    first: usize,
}

/// A limb in something: which point of it has to move where.
struct Touch {
    depth: f32,
    place: Vec3,
    direction: Vec3,
    /// Share of the way that this limb makes.
    share: f32,
}

impl Touches<'_> {
    /// What the limbs are in, with the capsule that is, in a frame of `poses`, and half-way to the next and from the last one; but
    /// for arms that are carried.
    fn of(&self, at: usize, poses: &[Pose]) -> Vec<(usize, Touch)> {
        let frame = self.first + at;
        let carried = [Hand::Left, Hand::Right].map(|hand| is_carried(self.carried, hand, frame));
        let moves = |part: BodyPart| {
            self.limbs.have(part) && !(part.is_arm() && carried[usize::from(part.side() > 0)])
        };
        let mut out = Vec::new();
        let here = body_capsules(&poses[at]);
        let before = at.checked_sub(1).map(|f| body_capsules(&poses[f]));
        let after = poses.get(at + 1).map(body_capsules);
        let halves = [&before, &after].into_iter().flatten().map(|there| half_way(&here, there));
        for contact in [here].into_iter().chain(halves).flat_map(|body| self.limbs.own_contacts(body)) {
            let nearest = contact.nearest();
            let apart = nearest[0].1 - nearest[1].1;
            let since = before.and_then(|before| contact.way_round(&before, &here));
            let round = since.or_else(|| contact.way_round(&here, &after?));
            let (away, depth) = match round {
                Some(round) => (round, contact.depth + apart.length() - round.dot(contact.apart_in(&here))),
                None => (apart.normalize_or(Vec3::Z), contact.depth),
            };
            let share = if contact.parts.into_iter().all(moves) { 0.5 } else { 1.0 };
            for (i, direction) in
                [(0, away), (1, -away)].into_iter().filter(|&(i, _)| moves(contact.parts[i]))
            {
                let shape = contact.shapes[i];
                let [from, to] = here[shape].1.ends;
                // What is asked of a place half-way is asked of it in both frames.
                let place = from.lerp(to, nearest[i].0);
                out.push((shape, Touch { depth, place, direction, share }));
            }
        }
        let Some(around) = self.room.around else { return out };
        for (shape, (part, capsule)) in here.into_iter().enumerate().filter(|(_, c)| moves(c.0)) {
            let capsule = Capsule { radii: capsule.radii.map(|radius| radius + NEAR), ..capsule };
            let above = around.counted_from(part, frame, self.room.floor);
            let seen_before = part
                .hangs_from()
                .is_some_and(|before| around.counted_from(before, frame, self.room.floor) <= above);
            let moving = around.moving.iter().filter(|object| !object.is_held_by(part, frame));
            let in_them = moving.flat_map(|object| object.contacts_of(&capsule, frame, above));
            for contact in around.scene.contacts_of(&capsule, above).into_iter().chain(in_them) {
                // An elbow, a wrist or a knee is the far end of what it hangs from, which knows from which side it came.
                if !contact.through && contact.part < NEAR_END && seen_before {
                    continue;
                }
                let contact =
                    if self.limbs == Limbs::Arms { from_the_shoulder(contact, &capsule) } else { contact };
                let place = capsule.ends[0].lerp(capsule.ends[1], contact.part);
                let depth = contact.depth - NEAR - RESTS;
                out.push((shape, Touch { depth, place, direction: contact.direction, share: 1.0 }));
            }
        }
        out
    }

    /// Keeps carried arms as they are, and hands that have something where they are.
    fn keep(&self, frame: usize, posture: &Posture, out: &mut Vec<Term>) {
        for (joint, hand) in Joint::HANDS.into_iter().zip([Hand::Left, Hand::Right]) {
            if is_carried(self.gripping, hand, frame) {
                let (pose, offset) = (posture.pose(), palm(joint));
                let (target, sigma) = (pose.point(joint, offset), Vec3::splat(GRIP_SIGMA.0));
                out.push(Term::Point { joint, offset, target, sigma });
                out.push(Term::Turn { joint, target: pose.rotation(joint), sigma: GRIP_SIGMA.1 });
            }
        }
        for (arm, hand) in ARMS.iter().zip([Hand::Left, Hand::Right]) {
            if is_carried(self.carried, hand, frame) {
                out.extend(arm[1..3].iter().map(|&joint| Term::Local {
                    joint,
                    target: posture.rotations[joint.index()],
                    sigma: STAYS_SIGMA,
                }));
            }
        }
    }
}

/// An arm that passes through a surface went there from its shoulder: however little of it is on that side, the far end has to
/// come back.
fn from_the_shoulder(contact: SceneContact, capsule: &Capsule) -> SceneContact {
    if !contact.through || contact.part == 1.0 {
        return contact;
    }
    let beyond = (capsule.ends[1] - contact.place).dot(contact.direction).abs();
    SceneContact { depth: capsule.radii[1] + beyond, part: 1.0, direction: -contact.direction, ..contact }
}

impl FoundTerms for Touches<'_> {
    fn terms(&self, frame: usize, poses: &[Pose], out: &mut Vec<Term>) {
        let pose = &poses[frame];
        for (shape, touch) in self.of(frame, poses) {
            let joint = SHAPES[shape].joint;
            let offset = pose.rotation(joint).inverse() * (touch.place - pose.position(joint));
            let least = touch.direction.dot(touch.place) + touch.share * (touch.depth + CLEAR);
            out.push(Term::Plane { joint, offset, normal: touch.direction, least, sigma: CONTACT_SIGMA });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figures::{Surroundings, body_figures};
    use crate::library::foot::LEGS;
    use crate::motion::skeleton::ANKLE_HEIGHT;
    use crate::motion::speed::accelerations;
    use crate::seats::Seats;
    use crate::test_world::room;
    use glam::Quat;
    use std::f32::consts::FRAC_PI_2;

    const NOWHERE: Room = Room { around: None, floor: 0.0, continues: false };

    fn deepest_in(motion: &Motion, around: &Surroundings) -> f32 {
        body_figures(motion, 0.0, Some(around)).scene.expect("a scene").deepest_cm
    }

    /// Three seconds on a seat of 45 cm, trunk upright, shins upright, facing -y.
    fn seated() -> Motion {
        let mut posture = Posture { root_position: Vec3::new(0.0, 0.0, 0.55), ..Posture::default() };
        for leg in LEGS {
            posture.rotations[leg[0].index()] = Quat::from_rotation_x(-FRAC_PI_2);
            posture.rotations[leg[1].index()] = Quat::from_rotation_x(FRAC_PI_2);
        }
        for (arm, side) in [(Joint::LeftArm, 1.0), (Joint::RightArm, -1.0)] {
            posture.rotations[arm.index()] = Quat::from_rotation_y(side * 1.2);
        }
        // The soles on the floor.
        posture.root_position.z -= posture.pose().position(Joint::LeftFoot).z - ANKLE_HEIGHT;
        Motion { postures: vec![posture; 90], contacts: vec![[1.0; 2]; 90] }
    }

    /// What is left of a seated motion in `boxes`, and how far pelvis, an ankle and a toe moved at most, metres.
    fn freed(boxes: &[([f32; 3], [f32; 3])], before: &Motion) -> (Motion, [f32; 2], f32) {
        let scene = room(boxes);
        let around =
            Surroundings { scene: &scene, moving: &[], ignore_below: 0.1, seats: Seats::taken(0, 0.45) };
        let mut after = before.clone();
        let room = Room { around: Some(&around), floor: 0.0, continues: false };
        free_body(&mut after, room, 0, &Progress::new()).expect("not cancelled");
        let joints = [Joint::Hips, Joint::LeftFoot, Joint::RightFoot, Joint::LeftToe, Joint::RightToe];
        let moved = before.postures.iter().zip(&after.postures).flat_map(|(a, b)| {
            let (a, b) = (a.pose(), b.pose());
            joints.map(|joint| a.position(joint).distance(b.position(joint)))
        });
        let moved = moved.fold(0.0, f32::max);
        let depths = [deepest_in(before, &around), deepest_in(&after, &around)];
        (after, depths, moved)
    }

    #[test]
    fn a_thigh_is_taken_out_of_an_armrest_while_feet_and_pelvis_stay() {
        let before = seated();
        let knee = before.postures[0].pose().position(Joint::LeftLeg);
        // An armrest beside the left knee, 3 cm too near.
        let inner = knee.x + 0.052 - 0.03;
        let rest = ([inner, -0.6, 0.3], [inner + 0.15, -0.3, 0.65]);
        let (after, [deep, left], moved) = freed(&[rest], &before);
        assert!(deep > 2.5 && left < 0.7, "{deep} {left}");
        assert!(moved < 0.004, "{moved}");
        let turned = |joint: Joint| {
            let i = joint.index();
            before.postures[60].rotations[i].angle_between(after.postures[60].rotations[i])
        };
        assert!(turned(Joint::LeftUpLeg) > 0.04 && turned(Joint::RightUpLeg) < 0.01);
    }

    #[test]
    fn a_back_is_taken_out_of_a_backrest_and_what_is_too_deep_stays() {
        let before = seated();
        let (_, [deep, left], moved) = freed(&[([-0.3, 0.075, 0.85], [0.3, 0.2, 1.2])], &before);
        assert!(deep > 2.0 && left < 0.7 && moved < 0.004, "{deep} {left} {moved}");
        // Drawers where both knees are: nobody gets out of them by a small turn.
        let knee = before.postures[0].pose().position(Joint::LeftLeg);
        let drawers = ([-0.6, knee.y - 0.6, 0.2], [0.6, knee.y + 0.2, 0.9]);
        let (same, [deep, left], _) = freed(&[drawers], &before);
        assert!(same == before && deep == left && deep > 12.0, "{deep} {left}");
    }

    #[test]
    fn a_swinging_foot_is_taken_out_of_the_other() {
        let mut before = seated();
        for (frame, posture) in before.postures.iter_mut().enumerate().take(60).skip(30) {
            let part = (frame - 30) as f32 / 30.0;
            let inwards = 0.32 * (std::f32::consts::PI * part).sin().powi(2);
            posture.rotations[Joint::LeftUpLeg.index()] *= Quat::from_rotation_z(inwards);
        }
        before.contacts[30..60].fill([0.0, 1.0]);
        let deepest = |motion: &Motion| body_figures(motion, 0.0, None).own_body.deepest_cm;
        let mut after = before.clone();
        free_body(&mut after, NOWHERE, usize::MAX, &Progress::new()).expect("not cancelled");
        assert!(deepest(&before) > 1.0 && deepest(&after) < 0.8, "{} {}", deepest(&before), deepest(&after));
    }

    /// The deepest in the own body where a motion is played eight times slower, cm.
    fn deepest_when_slower(motion: &Motion) -> f32 {
        let mut slower = Motion::default();
        for pair in motion.postures.windows(2) {
            for part in (0..8).map(|i| i as f32 / 8.0) {
                let mut posture = pair[0];
                posture.root_position = pair[0].root_position.lerp(pair[1].root_position, part);
                for (rotation, after) in posture.rotations.iter_mut().zip(pair[1].rotations) {
                    *rotation = rotation.slerp(after, part);
                }
                slower.postures.push(posture);
                slower.contacts.push([0.0; 2]);
            }
        }
        body_figures(&slower, 0.0, None).own_body.deepest_cm
    }

    #[test]
    fn a_hand_that_swings_through_a_thigh_between_two_frames_is_taken_out() {
        // A raised thigh, and an arm that swings by 9 degrees a frame: beside the thigh in one frame and past it in the next.
        let swings = |frame: usize| {
            let mut posture = Posture::default();
            let ahead = 0.45 + 0.16 * (frame as f32 - 44.5).clamp(-6.0, 6.0);
            let mut turn = |joint: Joint, rotation: Quat| posture.rotations[joint.index()] = rotation;
            turn(Joint::LeftUpLeg, Quat::from_rotation_x(-0.8));
            turn(Joint::LeftLeg, Quat::from_rotation_x(0.96));
            turn(Joint::LeftArm, Quat::from_rotation_x(-ahead) * Quat::from_rotation_y(FRAC_PI_2 + 0.03));
            turn(Joint::LeftForeArm, Quat::from_rotation_z(-0.2));
            turn(Joint::RightArm, Quat::from_rotation_y(-FRAC_PI_2));
            posture
        };
        let before = Motion { postures: (0..90).map(swings).collect(), contacts: vec![[0.0, 1.0]; 90] };
        let shown = body_figures(&before, 0.0, None).own_body.deepest_cm;
        assert!(shown < 0.35 && deepest_when_slower(&before) > 1.0, "{shown}");
        let mut after = before.clone();
        free_arms(&mut after, NOWHERE, &[], &Progress::new()).expect("not cancelled");
        assert!(deepest_when_slower(&after) < 0.6, "{}", deepest_when_slower(&after));
    }

    #[test]
    fn a_hand_that_goes_through_a_thigh_from_one_frame_to_the_next_goes_over_it() {
        // The hand, held before the belly, sweeps outwards by 8 cm a frame at the height of the thigh's middle.
        let sweeps = |bend: f32| {
            let mut motion = seated();
            for (frame, posture) in motion.postures.iter_mut().enumerate() {
                let outwards = 0.3 * (frame as f32 - 44.5).clamp(-2.0, 2.0);
                let [arm, forearm] = [Joint::LeftArm, Joint::LeftForeArm].map(Joint::index);
                posture.rotations[arm] = Quat::from_rotation_z(outwards - 0.35) * Quat::from_rotation_y(1.45);
                posture.rotations[forearm] = Quat::from_rotation_z(-bend);
            }
            motion
        };
        let deepest = |bend: &f32| deepest_when_slower(&sweeps(*bend));
        let before = (4..16).map(|i| 0.1 * i as f32).max_by(|a, b| deepest(a).total_cmp(&deepest(b)));
        let before = sweeps(before.expect("some"));
        assert!(deepest_when_slower(&before) > 3.0, "{}", deepest_when_slower(&before));
        let mut after = before.clone();
        free_arms(&mut after, NOWHERE, &[], &Progress::new()).expect("not cancelled");
        assert!(deepest_when_slower(&after) < 1.3, "{}", deepest_when_slower(&after));
    }

    #[test]
    fn what_is_deep_for_long_is_taken_out_as_a_whole() {
        // The back leans into a board for two seconds, at last by more than 8 cm.
        let mut before = seated();
        for (frame, posture) in before.postures.iter_mut().enumerate() {
            let part = ((frame as f32 - 5.0) / 10.0).clamp(0.0, 1.0)
                * ((85.0 - frame as f32) / 10.0).clamp(0.0, 1.0);
            posture.rotations[Joint::Spine.index()] = Quat::from_rotation_x(-0.14 * part);
        }
        let (_, [deep, left], moved) = freed(&[([-0.3, 0.075, 0.75], [0.3, 0.3, 1.3])], &before);
        assert!(deep > 8.2 && left < 0.7 && moved < 0.004, "{deep} {left} {moved}");
    }

    #[test]
    fn a_hand_is_lifted_over_a_table_by_its_wrist_too() {
        let mut motion = Motion { postures: vec![hand_ahead(); 90], contacts: vec![[1.0; 2]; 90] };
        // A table whose top is over the fingertips and under the wrist.
        let hand = motion.postures[0].pose();
        let wrist = hand.position(Joint::LeftHand);
        let top = wrist.z - 0.03;
        let edge = wrist.y - 0.03;
        let scene = room(&[([-1.0, edge - 1.0, top - 0.04], [1.0, edge, top])]);
        let around = Surroundings { scene: &scene, moving: &[], ignore_below: 0.1, seats: Seats::default() };
        let before = motion.clone();
        assert!(deepest_in(&before, &around) > 4.0, "{}", deepest_in(&before, &around));
        let room = Room { around: Some(&around), floor: 0.0, continues: false };
        free_arms(&mut motion, room, &[], &Progress::new()).expect("not cancelled");
        assert!(deepest_in(&motion, &around) < 0.6, "{}", deepest_in(&motion, &around));
        let turned = [Joint::LeftArm, Joint::LeftForeArm, Joint::LeftHand].map(|joint| {
            let i = joint.index();
            before.postures[45].rotations[i].angle_between(motion.postures[45].rotations[i]).to_degrees()
        });
        assert!(turned[2] > turned[0].max(turned[1]) && turned[0] + turned[1] < 15.0, "{turned:?}");
    }

    /// Standing; the left forearm ahead and down by 40°.
    fn hand_ahead() -> Posture {
        let mut posture = Posture::default();
        let [left, right] = [Joint::LeftArm, Joint::RightArm].map(Joint::index);
        posture.rotations[left] = Quat::from_rotation_y(FRAC_PI_2);
        posture.rotations[right] = Quat::from_rotation_y(-FRAC_PI_2);
        posture.rotations[Joint::LeftForeArm.index()] = Quat::from_rotation_z(-50f32.to_radians());
        posture
    }

    /// Three seconds of standing with hanging arms; the left one swings into the belly and out again between frames 30 and 60.
    fn through_the_belly() -> Motion {
        let arm = |frame: usize| {
            let part = ((frame as f32 - 30.0) / 30.0).clamp(0.0, 1.0);
            let inwards = FRAC_PI_2 * (std::f32::consts::PI * part).sin().powi(2);
            let mut posture = Posture::default();
            let [left, right] = [Joint::LeftArm, Joint::RightArm].map(Joint::index);
            posture.rotations[left] = Quat::from_rotation_z(-inwards) * Quat::from_rotation_y(FRAC_PI_2);
            posture.rotations[right] = Quat::from_rotation_y(-FRAC_PI_2);
            posture.rotations[Joint::LeftForeArm.index()] = Quat::from_rotation_z(-FRAC_PI_2);
            posture
        };
        Motion { postures: (0..90).map(arm).collect(), contacts: vec![[1.0; 2]; 90] }
    }

    #[test]
    fn a_forearm_is_taken_out_of_the_belly_and_nothing_else_moves() {
        let before = through_the_belly();
        let deepest = body_figures(&before, 0.0, None).own_body.deepest_cm;
        assert!(deepest > 6.0, "{deepest}");
        let mut after = before.clone();
        free_arms(&mut after, NOWHERE, &[], &Progress::new()).expect("not cancelled");
        let figures = body_figures(&after, 0.0, None);
        assert!(figures.own_body.deepest_cm < 0.5, "{:?}", figures.own_body);
        assert_eq!(figures.joint_limits.percent, 0.0, "{:?}", figures.joint_limits);
        // The other arm makes way for the hand that comes across.
        let arms: Vec<usize> =
            ARMS.iter().flat_map(|arm| arm[1..4].iter().map(|joint| joint.index())).collect();
        for (frame, (a, b)) in before.postures.iter().zip(&after.postures).enumerate() {
            assert_eq!(a.root_position, b.root_position);
            for joint in 0..a.rotations.len() {
                let turned = a.rotations[joint].angle_between(b.rotations[joint]);
                let moves = arms.contains(&joint) && (10..81).contains(&frame);
                assert!(moves || turned < 3e-3, "{frame} {joint}: {turned}");
            }
        }
        // No snap: the hand accelerates hardly more than it did.
        let hardest = |motion: &Motion| {
            let poses: Vec<Pose> = motion.postures.iter().map(Posture::pose).collect();
            let hand = Joint::LeftHand.index();
            poses
                .windows(3)
                .map(|w| accelerations([&w[0].positions, &w[1].positions, &w[2].positions])[hand])
                .fold(0.0, f32::max)
        };
        assert!(hardest(&after) < 1.6 * hardest(&before), "{} {}", hardest(&after), hardest(&before));
        // What is free already stays bit for bit.
        let mut again = after.clone();
        free_arms(&mut again, NOWHERE, &[], &Progress::new()).expect("not cancelled");
        assert_eq!(again, after);
    }

    #[test]
    fn a_carried_hand_stays_on_its_path() {
        let before = through_the_belly();
        let mut after = before.clone();
        free_arms(&mut after, NOWHERE, &[(Hand::Left, 40..48)], &Progress::new()).expect("not cancelled");
        let hand = |motion: &Motion, frame: usize| motion.postures[frame].pose().position(Joint::LeftHand);
        for frame in 40..48 {
            assert!(hand(&before, frame).distance(hand(&after, frame)) < 1e-3, "{frame}");
        }
    }

    #[test]
    fn an_arm_is_taken_out_of_a_wall() {
        // A wall 30 cm beside the body; the right arm is held out by 18°, its wrist 6 cm in the wall.
        let scene = room(&[([-2.0, -2.0, 0.0], [-0.30, 2.0, 2.0])]);
        let mut motion = through_the_belly();
        motion.postures.iter_mut().for_each(|p| *p = Posture::default());
        for posture in &mut motion.postures {
            posture.rotations[Joint::LeftArm.index()] = Quat::from_rotation_y(FRAC_PI_2 - 0.3);
            posture.rotations[Joint::RightArm.index()] = Quat::from_rotation_y(-1.25);
        }
        let around = Surroundings { scene: &scene, moving: &[], ignore_below: 0.1, seats: Seats::default() };
        let deepest = |motion: &Motion| deepest_in(motion, &around);
        assert!(deepest(&motion) > 6.0, "{}", deepest(&motion));
        let room = Room { around: Some(&around), floor: 0.0, continues: false };
        free_arms(&mut motion, room, &[], &Progress::new()).expect("not cancelled");
        assert!(deepest(&motion) < 0.6, "{}", deepest(&motion));
        let elbow = motion.postures[45].pose().position(Joint::RightForeArm);
        assert!(elbow.distance(Vec3::new(-0.3, 0.0, 1.2)) < 0.3, "{elbow}");
    }

    #[test]
    fn margins_that_meet_are_one() {
        let m = MARGIN;
        assert_eq!(merged(vec![(0, 2), (2 * m + 2, 2 * m + 3)], 500), [(0, 3 * m + 3)]);
        assert_eq!(
            merged(vec![(m + 1, m + 2), (3 * m + 3, 3 * m + 4)], 3 * m + 5),
            [(1, 2 * m + 2), (2 * m + 3, 3 * m + 5)]
        );
    }
}
