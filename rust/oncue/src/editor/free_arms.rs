//! Arms out of the own body and out of the scene: what transitions, clips and other edits leave of it.
//!
//! Wherever an arm is deeper than flesh gives, the finishing pass turns shoulders and elbows alone, as little and as smoothly
//! as takes it out; trunk, legs and root stay. The paper has no such step: its bodies have no girth.

use std::ops::Range;

use crate::anatomy::{BodyPart, SHAPES, arm_contacts, body_capsules};
use crate::body_solver::{DegreesOfFreedom, FoundTerms, Span, Term, correct};
use crate::cue::Hand;
use crate::error::Result;
use crate::library::contact::runs;
use crate::math::capsule::Capsule;
use crate::motion::skeleton::ARMS;
use crate::motion::{Motion, Pose, Posture};
use crate::progress::Progress;
use crate::scene::{SceneContact, SceneIndex};

/// An arm that is deeper than this in the own body or the scene is taken out, metres: less than is counted.
const DEEPER: f32 = 0.004;
/// What is taken out ends so far clear, metres: the least-squares problem leaves a little.
const CLEAR: f32 = 0.001;
/// Arms lie on tables so deep, metres.
const RESTS: f32 = 0.002;
/// What is nearer than this is looked at as well, metres: were it not, an arm that has just been taken out would be let go back.
const NEAR: f32 = 0.03;
/// So near its beginning a capsule is the end of the one before it, as a part of its length.
const NEAR_END: f32 = 0.02;
/// σ of a contact, metres.
const CONTACT_SIGMA: f32 = 2e-3;
/// σ of an arm that is to stay as it is, radians.
const STAYS_SIGMA: f32 = 1e-4;
/// Frames over which the correction fades: slower than that of a body that reaches, or a swinging arm would be hurried.
const FADE_FRAMES: f64 = 8.0;
/// Frames before and after what is corrected in which the correction fades.
const MARGIN: usize = 2 * FADE_FRAMES as usize;

/// The scene that arms are kept out of.
#[derive(Clone, Copy)]
pub(crate) struct ArmRoom<'a> {
    pub scene: &'a SceneIndex,
    /// World height under which nothing counts, metres.
    pub above: f32,
}

/// Takes the arms of a motion out of the own body and out of the scene. `carried`: frames in which a hand follows a cue; that
/// arm stays as it is there.
///
/// # Errors
/// `Cancelled`.
pub(crate) fn free_arms(
    motion: &mut Motion,
    room: Option<ArmRoom>,
    carried: &[(Hand, Range<usize>)],
    progress: &Progress,
) -> Result<()> {
    let touches = Touches { room, carried, first: 0 };
    let deep: Vec<bool> = motion
        .postures
        .iter()
        .enumerate()
        .map(|(frame, posture)| touches.of(frame, &posture.pose()).any(|(_, touch)| touch.depth > DEEPER))
        .collect();
    let degrees = DegreesOfFreedom::arms();
    for (first, end) in merged(runs(&deep, true), motion.len()) {
        let postures = &motion.postures[first..end];
        let terms: Vec<Vec<Term>> =
            postures.iter().enumerate().map(|(i, posture)| touches.kept(first + i, posture)).collect();
        let found = Touches { first, ..touches };
        let span = Span {
            postures,
            joins: [first > 0, end < motion.len()],
            degrees: &degrees,
            terms: &terms,
            found: Some(&found),
            spread: FADE_FRAMES,
        };
        let free = correct(&span, progress)?;
        motion.postures[first..end].copy_from_slice(&free);
    }
    Ok(())
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

#[derive(Clone, Copy)]
struct Touches<'a> {
    room: Option<ArmRoom<'a>>,
    carried: &'a [(Hand, Range<usize>)],
    /// The motion's frame that is frame 0 here.
    first: usize,
}

/// An arm in something: which point of it has to move where.
struct Touch {
    depth: f32,
    place: glam::Vec3,
    direction: glam::Vec3,
    /// Share of the way that this arm makes.
    share: f32,
}

impl Touches<'_> {
    /// What the arms of a pose are in, with the capsule that is, but for arms that are carried.
    fn of(&self, frame: usize, pose: &Pose) -> impl Iterator<Item = (usize, Touch)> {
        let carried = [Hand::Left, Hand::Right].map(|hand| self.is_carried(frame, hand));
        let moves = move |part: BodyPart| part.is_arm() && !carried[usize::from(part.side() > 0)];
        let own = arm_contacts(pose, -NEAR).flat_map(move |contact| {
            let places = contact.places();
            let both = contact.parts.into_iter().all(moves);
            [0, 1].into_iter().filter(move |&i| moves(contact.parts[i])).map(move |i| {
                let direction = (places[i] - places[1 - i]).normalize_or(glam::Vec3::Z);
                let share = if both { 0.5 } else { 1.0 };
                (contact.shapes[i], Touch { depth: contact.depth, place: places[i], direction, share })
            })
        });
        let room = self.room;
        let scene =
            body_capsules(pose).into_iter().enumerate().filter_map(move |(shape, (part, capsule))| {
                let room = room.filter(|_| moves(part))?;
                let capsule = Capsule { radii: capsule.radii.map(|radius| radius + NEAR), ..capsule };
                let contact = room.scene.depth_of(&capsule, room.above)?;
                // An elbow or a wrist is the far end of what it hangs from, which knows from which side it came.
                if !contact.through && contact.part < NEAR_END && !is_upper_arm(part) {
                    return None;
                }
                let contact = from_the_shoulder(contact, &capsule);
                let place = capsule.ends[0].lerp(capsule.ends[1], contact.part);
                let depth = contact.depth - NEAR - RESTS;
                Some((shape, Touch { depth, place, direction: contact.direction, share: 1.0 }))
            });
        own.chain(scene)
    }

    fn is_carried(&self, frame: usize, hand: Hand) -> bool {
        let follows = |own: Hand| own == hand || own == Hand::Both;
        self.carried.iter().any(|(own, frames)| follows(*own) && frames.contains(&frame))
    }

    /// Keeps carried arms as they are.
    fn kept(&self, frame: usize, posture: &Posture) -> Vec<Term> {
        let of_side = |(side, hand): (usize, Hand)| {
            let joints =
                ARMS[side][1..3].iter().filter(|_| self.is_carried(frame, hand)).copied().collect::<Vec<_>>();
            joints.into_iter().map(|joint| Term::Local {
                joint,
                target: posture.rotations[joint.index()],
                sigma: STAYS_SIGMA,
            })
        };
        [(0, Hand::Left), (1, Hand::Right)].into_iter().flat_map(of_side).collect()
    }
}

fn is_upper_arm(part: BodyPart) -> bool {
    matches!(part, BodyPart::LeftUpperArm | BodyPart::RightUpperArm)
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
    use crate::motion::Joint;
    use crate::motion::speed::accelerations;
    use crate::test_world::room;
    use glam::{Quat, Vec3};
    use std::f32::consts::FRAC_PI_2;

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
        free_arms(&mut after, None, &[], &Progress::new()).expect("not cancelled");
        let figures = body_figures(&after, 0.0, None);
        assert!(figures.own_body.deepest_cm < 0.5, "{:?}", figures.own_body);
        assert_eq!(figures.joint_limits.percent, 0.0, "{:?}", figures.joint_limits);
        let left = [ARMS[0][1], ARMS[0][2]].map(Joint::index);
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
        free_arms(&mut again, None, &[], &Progress::new()).expect("not cancelled");
        assert_eq!(again, after);
    }

    #[test]
    fn a_carried_hand_stays_on_its_path() {
        let before = through_the_belly();
        let mut after = before.clone();
        free_arms(&mut after, None, &[(Hand::Left, 40..48)], &Progress::new()).expect("not cancelled");
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
        let deepest = |motion: &Motion| {
            let around = Surroundings { scene: &scene, ignore_below: 0.1, seat: None };
            body_figures(motion, 0.0, Some(&around)).scene.expect("a scene").deepest_cm
        };
        assert!(deepest(&motion) > 6.0, "{}", deepest(&motion));
        let room = Some(ArmRoom { scene: &scene, above: 0.1 });
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
