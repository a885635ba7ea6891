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
        surfaces: None,
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
