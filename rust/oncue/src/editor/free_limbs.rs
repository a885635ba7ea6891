//! Limbs out of the own body and out of the scene: what transitions, clips and other edits leave of it.
//!
//! Wherever a limb is deeper than flesh gives, the finishing pass moves as little as takes it out, smoothly: legs, spine and the
//! place of the pelvis first, while the feet stay where they stand; then shoulders, elbows and wrists alone. The paper has no such step:
//! its bodies have no girth.

use std::ops::Range;

use glam::Vec3;

use crate::anatomy::{BodyPart, OwnContact, SHAPES, arm_contacts, body_capsules, leg_contacts};
use crate::body_solver::{DegreesOfFreedom, FootPlan, FoundTerms, Span, Term, correct};
use crate::cue::{Hand, is_carried};
use crate::error::Result;
use crate::figures::Surroundings;
use crate::library::contact::runs;
use crate::math::capsule::Capsule;
use crate::motion::skeleton::ARMS;
use crate::motion::{Joint, Motion, Pose, Posture};
use crate::progress::Progress;
use crate::scene::SceneContact;

/// An arm that is deeper than this in the own body or the scene is taken out, metres: less than is counted.
const ARM_DEEPER: f32 = 0.004;
/// Legs and trunk are left where they touch as people do, metres.
const BODY_DEEPER: f32 = 0.007;
/// Farther than this no leg and no trunk, and no head, is moved, metres: who has to go so far out of the way has to go another way.
const BODY_DEEPEST: f32 = 0.08;
const HEAD_DEEPEST: f32 = 0.15;
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
/// σ of a pelvis that may give way, metres.
const AWAY_SIGMA: f32 = 0.01;
/// A correction that moves a joint of legs or trunk farther than this is none, metres.
const FARTHEST: f32 = 0.15;
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
    let touches = Touches { room, limbs: Limbs::Body, carried: &[], first: 0 };
    free(motion, touches, &DegreesOfFreedom::body_on_its_feet(), held, progress)
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
    let touches = Touches { room, limbs: Limbs::Arms, carried, first: 0 };
    let held = |frame: usize, posture: &Posture, out: &mut Vec<Term>| touches.keep(frame, posture, out);
    free(motion, touches, &DegreesOfFreedom::arms(), held, progress)
}

/// Takes out what `touches` finds. `held` adds what stays as it is in a frame.
fn free(
    motion: &mut Motion,
    touches: Touches,
    degrees: &DegreesOfFreedom,
    held: impl Fn(usize, &Posture, &mut Vec<Term>),
    progress: &Progress,
) -> Result<()> {
    let deepest = |all: &[(usize, Touch)]| all.iter().map(|(_, touch)| touch.depth).fold(0.0, f32::max);
    let depth = |frame: usize, posture: &Posture| deepest(&touches.of(frame, &posture.pose()));
    let limbs = touches.limbs;
    let looked_at = motion.postures.iter().enumerate().map(|(frame, posture)| {
        let all = touches.of(frame, &posture.pose());
        let may_be = |(shape, touch): &(usize, Touch)| touch.depth < limbs.taken_out_of(SHAPES[*shape].part);
        let deepest = deepest(&all);
        (deepest, deepest > limbs.stay_within() && all.iter().all(may_be))
    });
    let (depths, deep): (Vec<f32>, Vec<bool>) = looked_at.unzip();
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
        let after: f32 = free.iter().enumerate().map(|(i, p)| depth(first + i, p)).sum();
        let moved = postures.iter().zip(&free).map(|(a, b)| farthest(&a.pose(), &b.pose()));
        let too_far = limbs == Limbs::Body && moved.fold(0.0, f32::max) > FARTHEST;
        if after < depths[first..end].iter().sum() && !too_far {
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

    /// Deeper than this a part is not taken out, metres.
    fn taken_out_of(self, part: BodyPart) -> f32 {
        match (self, part) {
            (Limbs::Arms, _) => f32::INFINITY,
            (Limbs::Body, BodyPart::Head) => HEAD_DEEPEST,
            (Limbs::Body, _) => BODY_DEEPEST,
        }
    }

    fn own_contacts(self, pose: &Pose) -> Vec<OwnContact> {
        match self {
            Limbs::Arms => arm_contacts(pose, -NEAR).collect(),
            Limbs::Body => leg_contacts(pose, -NEAR).collect(),
        }
    }
}

#[derive(Clone, Copy)]
struct Touches<'a> {
    room: Room<'a>,
    limbs: Limbs,
    carried: &'a [(Hand, Range<usize>)],
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
    /// What the limbs of a pose are in, with the capsule that is, but for arms that are carried.
    fn of(&self, frame: usize, pose: &Pose) -> Vec<(usize, Touch)> {
        let carried = [Hand::Left, Hand::Right].map(|hand| is_carried(self.carried, hand, frame));
        let moves = |part: BodyPart| {
            self.limbs.have(part) && !(part.is_arm() && carried[usize::from(part.side() > 0)])
        };
        let mut out = Vec::new();
        for contact in self.limbs.own_contacts(pose) {
            let places = contact.places();
            let share = if contact.parts.into_iter().all(moves) { 0.5 } else { 1.0 };
            for i in (0..2).filter(|&i| moves(contact.parts[i])) {
                let direction = (places[i] - places[1 - i]).normalize_or(Vec3::Z);
                let touch = Touch { depth: contact.depth, place: places[i], direction, share };
                out.push((contact.shapes[i], touch));
            }
        }
        let Some(around) = self.room.around else { return out };
        for (shape, (part, capsule)) in
            body_capsules(pose).into_iter().enumerate().filter(|(_, c)| moves(c.0))
        {
            let capsule = Capsule { radii: capsule.radii.map(|radius| radius + NEAR), ..capsule };
            let above = around.counted_from(part, frame, self.room.floor);
            let seen_before = hangs_from(part)
                .is_some_and(|before| around.counted_from(before, frame, self.room.floor) <= above);
            for contact in around.scene.contacts_of(&capsule, above) {
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

    /// Keeps carried arms as they are.
    fn keep(&self, frame: usize, posture: &Posture, out: &mut Vec<Term>) {
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

/// The part at whose end this one begins.
fn hangs_from(part: BodyPart) -> Option<BodyPart> {
    use BodyPart::*;
    Some(match part {
        LeftForearm => LeftUpperArm,
        RightForearm => RightUpperArm,
        LeftHand => LeftForearm,
        RightHand => RightForearm,
        LeftShin => LeftThigh,
        RightShin => RightThigh,
        _ => return None,
    })
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
    fn terms(&self, frame: usize, pose: &Pose, out: &mut Vec<Term>) {
        for (shape, touch) in self.of(self.first + frame, pose) {
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
        let around = Surroundings { scene: &scene, ignore_below: 0.1, seats: Seats::taken(0, 0.45) };
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
        // A board through the knee: nobody gets out of it by a small turn.
        let knee = before.postures[0].pose().position(Joint::LeftLeg);
        let board = ([knee.x - 0.01, -0.6, 0.2], [knee.x + 0.3, 0.2, 0.9]);
        let (same, [deep, left], _) = freed(&[board], &before);
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
        let left = [ARMS[0][1], ARMS[0][2], ARMS[0][3]].map(Joint::index);
        for (frame, (a, b)) in before.postures.iter().zip(&after.postures).enumerate() {
            assert_eq!(a.root_position, b.root_position);
            for joint in 0..a.rotations.len() {
                let turned = a.rotations[joint].angle_between(b.rotations[joint]);
                let moves = left.contains(&joint) && (10..81).contains(&frame);
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
        let around = Surroundings { scene: &scene, ignore_below: 0.1, seats: Seats::default() };
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
