//! The artist's keys: what was keyed stays, and the frames around it adapt.

use std::collections::BTreeMap;

use glam::Quat;
use serde::{Deserialize, Serialize};

use super::constraint::{Constraint, check_constraints, check_numbers, joint_named};
use super::edit::{Edit, EditedMotion};
use super::latent::{Decoder, mix};
use crate::body_solver::Surfaces;
use crate::error::{Error, Result};
use crate::motion::{Joint, Motion};
use crate::progress::Progress;
use crate::scene::SceneIndex;
use crate::settings::EditorSettings;

/// A bone that the artist keyed on a frame: its posture there is the motion's own.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Key {
    /// The bone's name.
    pub joint: String,
    /// 30 Hz.
    pub frame: usize,
}

/// What an artist asks of a motion.
#[derive(Clone, Copy)]
pub struct Wishes<'a> {
    /// Where joints are to be.
    pub constraints: &'a [Constraint],
    /// What the artist keyed.
    pub keys: &'a [Key],
    /// The scene that a seated body is kept out of.
    pub scene: Option<&'a SceneIndex>,
    /// World height of the floor, metres.
    pub floor: f32,
}

/// The motion with what was wished for, by a given manifold or by the finishing pass alone.
///
/// Keyed joints stay as they are on their frames (their own rotations to the bit, and the root's place), constraints are
/// met, and the frames around adapt; outside the touched span nothing changes.
///
/// # Errors
/// `Input` for contradictions, paths that jump, bones that are none and ranges outside the motion; `Unreachable`, by how
/// much and which way; `Cancelled`.
pub(crate) fn resolve<D: Decoder>(
    decoder: Option<&D>,
    motion: &Motion,
    wishes: &Wishes,
    settings: &EditorSettings,
    progress: &Progress,
) -> Result<EditedMotion> {
    let Wishes { constraints, keys, scene, floor } = *wishes;
    progress.stage("Checking the constraints");
    settings.validate()?;
    check_numbers(motion, floor)?;
    check_constraints(motion, constraints)?;
    let mut keyed: BTreeMap<usize, Vec<Joint>> = BTreeMap::new();
    for key in keys {
        let joint = joint_named(&key.joint)?;
        if key.frame >= motion.len() {
            return Err(Error::input(format!(
                "The {} is keyed on frame {}, and the motion has frames 0 to {}.",
                key.joint,
                key.frame,
                motion.len().saturating_sub(1)
            )));
        }
        let joints = keyed.entry(key.frame).or_default();
        if !joints.contains(&joint) {
            joints.push(joint);
        }
    }
    if keyed.is_empty() && constraints.is_empty() {
        return Err(Error::input("There is nothing to edit: key or pin a bone, or give a cue, first."));
    }
    // A keyed frame sticks out of the motion around it. The motion without the keys, and how far they are from it:
    let smooth = without_keys(motion, &keyed);
    let mut wanted = constraints.to_vec();
    let mut exact: Vec<(usize, Joint, Quat)> = Vec::new();
    for (&frame, joints) in &keyed {
        let pose = motion.postures[frame].pose();
        for &joint in joints {
            exact.push((frame, joint, motion.postures[frame].rotations[joint.index()]));
            let name = format!("Key of the {}", joint.name());
            let place = Constraint::positions(&name, joint, frame, vec![pose.position(joint)]);
            wanted.push(Constraint { rotations: vec![pose.rotation(joint)], ..place });
        }
    }
    check_constraints(motion, &wanted)?;
    let mut edit = Edit::new(&smooth, &wanted, floor, settings);
    edit.exact = &exact;
    edit.surfaces = scene.map(|scene| Surfaces { scene, floor });
    edit.check_reach(constraints, progress)?;
    let mut edited = edit.run(decoder, progress)?;
    for (&frame, joints) in &keyed {
        if joints.contains(&Joint::Hips) {
            edited.motion.postures[frame].root_position = motion.postures[frame].root_position;
        }
    }
    Ok(edited)
}

/// The motion as it would be had nothing been keyed: keyed joints between their neighbours' frames.
fn without_keys(motion: &Motion, keyed: &BTreeMap<usize, Vec<Joint>>) -> Motion {
    let mut out = motion.clone();
    for (&frame, joints) in keyed {
        for &joint in joints {
            let free = |f: &usize| keyed.get(f).is_none_or(|j| !j.contains(&joint));
            let before = (0..frame).rev().find(free);
            let after = (frame + 1..motion.len()).find(free);
            let (Some(a), Some(b)) = (before.or(after), after.or(before)) else { continue };
            let share = if a == b { 0.0 } else { (frame - a) as f32 / (b - a) as f32 };
            let between = mix(&motion.postures[a], &motion.postures[b], share);
            out.postures[frame].rotations[joint.index()] = between.rotations[joint.index()];
            if joint == Joint::Hips {
                out.postures[frame].root_position = between.root_position;
            }
        }
    }
    out
}
