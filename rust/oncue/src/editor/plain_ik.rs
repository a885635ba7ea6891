//! The ablation's baseline (LAMA, section 4.3, figure 9): inverse kinematics of arm and spine, frame by frame.
//!
//! A plain damped solver: it knows nothing of the frames around, of the feet or of balance, and the pelvis stays where it
//! was. Reach and return are blended between the motion and the first and last solved frame.

use super::constraint::{Constraint, check_constraints, check_numbers};
use super::edit::{EditFigures, EditedMotion, constraint_figures, span};
use super::latent::mix;
use crate::body_solver::{DegreesOfFreedom, Span, Term, correct};
use crate::error::Result;
use crate::math::curve::smoothstep;
use crate::motion::{Joint, Motion};
use crate::progress::Progress;
use crate::settings::EditorSettings;

/// σ of the solver's target, metres.
const TARGET: f32 = 1e-3;

/// The motion with its hands brought to their places by plain inverse kinematics.
///
/// # Errors
/// As [`super::edit_motion`], but it never says that a target is out of reach: it falls short.
pub fn plain_ik(
    motion: &Motion,
    constraints: &[Constraint],
    settings: &EditorSettings,
    progress: &Progress,
) -> Result<EditedMotion> {
    settings.validate()?;
    check_numbers(motion, 0.0)?;
    check_constraints(motion, constraints)?;
    let joints: Vec<Joint> = constraints.iter().map(|c| c.joint).collect();
    let degrees = DegreesOfFreedom::arm_and_spine(&joints);
    let frames: Vec<usize> =
        (0..motion.len()).filter(|f| constraints.iter().any(|c| c.frames().contains(f))).collect();
    let terms: Vec<Vec<Term>> = frames
        .iter()
        .map(|&frame| {
            let point = |c: &Constraint| {
                Some(Term::Point {
                    joint: c.joint,
                    offset: c.offset,
                    target: c.position(frame)?,
                    sigma: glam::Vec3::splat(TARGET),
                })
            };
            constraints.iter().filter_map(point).collect()
        })
        .collect();
    let postures: Vec<_> = frames.iter().map(|&f| motion.postures[f]).collect();
    let solve = Span {
        postures: &postures,
        joins: [false; 2],
        degrees: &degrees,
        terms: &terms,
        found: None,
        spread: 0.0,
    };
    let solved = correct(&solve, progress)?;
    let mut out = motion.clone();
    let span = span(motion, constraints, settings);
    if let (Some(&first), Some(&last)) = (frames.first(), frames.last()) {
        for frame in span.clone() {
            let (near, t) = if frame < first {
                (0, (frame + 1 - span.start) as f32 / (first + 1 - span.start) as f32)
            } else if frame > last {
                (solved.len() - 1, (span.end - frame) as f32 / (span.end - last) as f32)
            } else {
                (frames.partition_point(|&f| f < frame).min(solved.len() - 1), 1.0)
            };
            let mut posture = motion.postures[frame];
            posture.rotations = mix(&posture, &solved[near], smoothstep(t)).rotations;
            posture.rotations[0] = motion.postures[frame].rotations[0];
            out.postures[frame] = posture;
        }
    }
    let figures = EditFigures {
        constraints: constraints.iter().map(|c| constraint_figures(c, &out)).collect(),
        first_frame: span.start,
        end_frame: span.end,
        ..Default::default()
    };
    Ok(EditedMotion { motion: out, figures })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_world::{close, still};
    use glam::Vec3;

    #[test]
    fn the_arm_alone_is_brought_there_and_blended() {
        let mut motion = still(60);
        motion.postures.iter_mut().for_each(|p| p.rotations[0] = glam::Quat::from_rotation_z(0.2));
        let hand = motion.postures[0].pose().position(Joint::LeftHand);
        let place = hand + Vec3::new(0.05, -0.2, 0.25);
        let c = [Constraint::positions("Lid", Joint::LeftHand, 30, vec![place; 2])];
        let settings = EditorSettings {
            blend_seconds: 0.3,
            reach_seconds: 0.1,
            reach_seconds_per_metre: 0.0,
            ..Default::default()
        };
        let edited = plain_ik(&motion, &c, &settings, &Progress::new()).expect("done");
        assert!(edited.figures.constraints[0].met, "{:?}", edited.figures.constraints);
        assert_eq!((edited.figures.first_frame, edited.figures.end_frame), (21, 41));
        let gone = |frame: usize| {
            let at = edited.motion.postures[frame].pose().position(Joint::LeftHand);
            at.distance(hand) / place.distance(hand)
        };
        // Ten steps there and ten back, with the share of a smooth step.
        assert_eq!((gone(20), gone(41)), (0.0, 0.0));
        for (frame, share) in [(21, 0.028), (25, 0.5), (36, 0.5), (40, 0.028)] {
            close(gone(frame), share, 0.06);
        }
        close(gone(30), 1.0, 0.01);
        close(gone(31), 1.0, 0.01);
        for (before, after) in motion.postures.iter().zip(&edited.motion.postures) {
            assert_eq!(
                (before.root_position, before.rotations[0]),
                (after.root_position, after.rotations[0])
            );
            let leg = Joint::LeftLeg.index();
            assert!(before.rotations[leg].dot(after.rotations[leg]) > 0.999_999);
        }
        // Out of reach it falls short.
        let far = [Constraint::positions("Far", Joint::LeftHand, 30, vec![hand + Vec3::X * 3.0])];
        let edited = plain_ik(&motion, &far, &settings, &Progress::new()).expect("done");
        assert!(!edited.figures.constraints[0].met);
    }
}
