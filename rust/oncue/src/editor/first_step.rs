//! The first step, prepared: who is about to step shifts the weight over the leg that stays, and looks where to go.
//!
//! A search that is asked for a way ahead from standing finds the frame in which a foot leaves the floor. Where the library has
//! whole starts that lead the way, a motion begins with one ([`crate::library::Start`]); where it has none (hardly a library sets
//! off in all directions), the finishing pass makes the shift over feet that stand. The paper's figures step off as they are.

use glam::{Quat, Vec3};

use crate::body_solver::{DegreesOfFreedom, FADE_FRAMES, FootPlan, Span, Term, correct};
use crate::error::Result;
use crate::math::rotation::{wrap_angle, yaw};
use crate::motion::{Joint, Motion, Pose, Posture};
use crate::progress::Progress;

/// So far the pelvis has gone to the standing leg when the other foot leaves, metres: people do by 3.5 to 6.4 cm.
const SHIFT: f32 = 0.042;
/// Less of it is no shift, metres.
const LEAST_SHIFT: f32 = 0.025;
/// Frames that it takes: people take 0.3 to 0.5 s.
const SHIFT_FRAMES: usize = 13;
/// A foot has left where its ankle is so far from where it stood, metres; it does so within so many frames, or nobody is about to
/// step.
const LEFT: (f32, usize) = (0.03, 45);
/// Who stands does not get farther than this before, metres, nor this far in so many frames.
const STANDS: f32 = 0.10;
const STILL: (f32, usize) = (0.02, 4);
/// A pelvis lower than this does not stand, metres over the floor.
const LOW: f32 = 0.80;
/// Frames after the foot has left in which the body is again where it was.
const AFTER: usize = 24;
/// The head looks at the foot's leaving where it will look so many frames later, if that is farther aside than this, but no
/// farther from where the hips face than that, radians.
const LOOKS_AHEAD: usize = 12;
const ASIDE: f32 = 0.15;
const FARTHEST_LOOK: f32 = 0.7;
/// σ of the pelvis at the first frame and where it is shifted to, metres, and of the look, radians.
const STARTS_SIGMA: f32 = 5e-4;
const SHIFT_SIGMA: f32 = 3e-3;
const LOOK_SIGMA: f32 = 0.1;

/// Prepares the first step of a motion that begins standing; gives the frames that it begins later than it did. `continues`: whether
/// it goes on from another motion.
///
/// # Errors
/// `Cancelled`.
pub(crate) fn prepare_first_step(
    motion: &mut Motion,
    floor: f32,
    continues: bool,
    progress: &Progress,
) -> Result<usize> {
    let poses: Vec<Pose> = motion.postures.iter().take(LEFT.1).map(Posture::pose).collect();
    let Some((leaves, towards)) = first_step(&poses) else { return Ok(0) };
    let root = |pose: &Pose| pose.position(Joint::Hips);
    let shifted = (root(&poses[leaves]) - root(&poses[0])).dot(towards);
    let soon = poses.get(STILL.1 - 1).unwrap_or(&poses[0]);
    let moves = root(soon).distance(root(&poses[0])) > STILL.0;
    let low = poses[..=leaves].iter().any(|pose| root(pose).z - floor < LOW);
    let stays = root(&poses[leaves]).truncate().distance(root(&poses[0]).truncate()) < STANDS;
    if moves || low || !stays || shifted > LEAST_SHIFT {
        return Ok(0);
    }
    let added = SHIFT_FRAMES.saturating_sub(leaves);
    let (first, contact) = (motion.postures[0], motion.contacts[0]);
    motion.postures.splice(0..0, std::iter::repeat_n(first, added));
    motion.contacts.splice(0..0, std::iter::repeat_n(contact, added));
    let leaves = leaves + added;

    let end = (leaves + AFTER).min(motion.len());
    let plan = FootPlan::of(motion);
    let point = |posture: &Posture, shift: Vec3, sigma: f32| Term::Point {
        joint: Joint::Hips,
        offset: Vec3::ZERO,
        target: posture.root_position + shift,
        // How high it goes is the legs' to say.
        sigma: Vec3::new(sigma, sigma, 5.0 * sigma),
    };
    let mut terms: Vec<Vec<Term>> = vec![Vec::new(); end];
    for (frame, terms) in terms.iter_mut().enumerate() {
        plan.terms(frame, floor, terms);
    }
    let begins = leaves - SHIFT_FRAMES.min(leaves);
    for frame in 0..=begins {
        terms[frame].push(point(&motion.postures[frame], Vec3::ZERO, STARTS_SIGMA));
    }
    let missing = towards * (SHIFT - shifted);
    terms[leaves].push(point(&motion.postures[leaves], missing, SHIFT_SIGMA));
    if let Some(target) = look(motion, leaves) {
        terms[leaves].push(Term::Turn { joint: Joint::Head, target, sigma: LOOK_SIGMA });
    }
    let degrees = DegreesOfFreedom::for_joints(&[], &[]);
    let span = Span {
        postures: &motion.postures[..end],
        joins: [continues, end < motion.len()],
        degrees: &degrees,
        terms: &terms,
        found: None,
        spread: FADE_FRAMES,
    };
    let prepared = correct(&span, progress)?;
    motion.postures[..end].copy_from_slice(&prepared);
    Ok(added)
}

/// The frame in which a foot has left its place, and the way from that foot to the other, on the floor, of length 1.
fn first_step(poses: &[Pose]) -> Option<(usize, Vec3)> {
    let first = poses.first()?;
    let foot = |pose: &Pose, side: usize| pose.position(Joint::FEET[side]).with_z(0.0);
    let gone = |frame: usize, side: usize| foot(&poses[frame], side).distance(foot(first, side)) > LEFT.0;
    let (leaves, side) =
        (0..poses.len()).find_map(|f| (0..2).find(|&side| gone(f, side)).map(|side| (f, side)))?;
    Some((leaves, (foot(first, 1 - side) - foot(first, side)).normalize_or_zero()))
}

/// How the head is turned in a frame if it looks where it will soon look.
fn look(motion: &Motion, frame: usize) -> Option<Quat> {
    let soon = motion.postures.get(frame + LOOKS_AHEAD)?.pose();
    let now = motion.postures[frame].pose();
    let turned = |pose: &Pose| yaw(pose.rotation(Joint::Head));
    let aside = wrap_angle(turned(&soon) - turned(&now));
    if aside.abs() < ASIDE {
        return None;
    }
    let hips = yaw(now.rotation(Joint::Hips));
    let already = wrap_angle(turned(&now) - hips);
    let looks = (already + aside).clamp(-FARTHEST_LOOK, FARTHEST_LOOK);
    Some(Quat::from_rotation_z(looks - already) * now.rotation(Joint::Head))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_world::{library, still};

    /// A second of standing with feet apart, then the left foot leaves at frame `at` and swings ahead.
    fn steps_off(at: usize) -> Motion {
        let mut motion = still(60);
        for (frame, posture) in motion.postures.iter_mut().enumerate() {
            let part = (frame.saturating_sub(at) as f32 / 12.0).min(1.0);
            posture.rotations[Joint::LeftUpLeg.index()] = Quat::from_rotation_x(-0.5 * part);
            posture.rotations[Joint::Head.index()] = Quat::from_rotation_z(-0.6 * part);
        }
        motion.contacts[at..].fill([0.0, 1.0]);
        motion
    }

    fn hips(motion: &Motion, frame: usize) -> Vec3 {
        motion.postures[frame].root_position
    }

    #[test]
    fn the_weight_goes_over_the_leg_that_stays_and_the_feet_stay() {
        for at in [1, 30] {
            let before = steps_off(at);
            let mut after = before.clone();
            let added = prepare_first_step(&mut after, 0.0, false, &Progress::new()).expect("not cancelled");
            let poses: Vec<Pose> = before.postures.iter().map(Posture::pose).collect();
            let (leaves, towards) = first_step(&poses).expect("a step");
            assert_eq!(added, SHIFT_FRAMES.saturating_sub(leaves));
            assert_eq!((after.len(), after.contacts.len()), (60 + added, 60 + added));
            let foot = |joint: Joint| poses[0].position(joint).with_z(0.0);
            let over = (foot(Joint::RightFoot) - foot(Joint::LeftFoot)).normalize();
            assert!(towards.dot(over) > 0.999, "the right leg stays: {towards}");
            let shift = |frame: usize| (hips(&after, frame) - hips(&before, 0)).dot(towards);
            assert!((shift(leaves + added) - SHIFT).abs() < 0.004, "{}", shift(leaves + added));
            assert!(shift(0).abs() < 1e-3 && shift(after.len() - 1).abs() < 1e-3);
            // It goes over within half a second.
            assert!(shift(leaves + added - 15 + added.min(2)).abs() < 0.006);
            let foot =
                |motion: &Motion, frame: usize| motion.postures[frame].pose().position(Joint::RightToe);
            let away =
                (0..after.len()).map(|f| foot(&after, f).distance(foot(&before, 0))).fold(0.0, f32::max);
            assert!(away < 2e-3, "{away}");
            // The head looks aside already, more than it did.
            let looks =
                |motion: &Motion, frame: usize| yaw(motion.postures[frame].pose().rotation(Joint::Head));
            assert!(looks(&after, leaves + added) < looks(&before, leaves) - 0.15);
        }
    }

    #[test]
    fn who_sits_or_stands_or_walks_already_or_has_shifted_is_left_as_is() {
        let mut seated = steps_off(5);
        seated.postures.iter_mut().for_each(|p| p.root_position.z -= 0.4);
        let walk = library().clips.remove(0).motion;
        let mut shifted = steps_off(20);
        for (frame, posture) in shifted.postures.iter_mut().enumerate() {
            let first = posture.pose();
            let towards = first.position(Joint::RightFoot) - first.position(Joint::LeftFoot);
            posture.root_position += towards.with_z(0.0).normalize() * (0.004 * frame.min(10) as f32);
        }
        for motion in [seated, still(60), walk, shifted] {
            let mut after = motion.clone();
            assert_eq!(
                prepare_first_step(&mut after, 0.0, false, &Progress::new()).expect("not cancelled"),
                0
            );
            assert!(after == motion);
        }
    }
}
