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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::manifold::Manifold;
    use crate::math::rotation::angle_between;
    use crate::test_world::still;
    use glam::Vec3;

    fn settings() -> EditorSettings {
        EditorSettings {
            manifold: false,
            blend_seconds: 0.3,
            reach_seconds: 0.2,
            reach_seconds_per_metre: 0.0,
            ..Default::default()
        }
    }

    fn resolved(motion: &Motion, keys: &[Key], constraints: &[Constraint]) -> Result<EditedMotion> {
        let wishes = Wishes { constraints, keys, scene: None, floor: 0.0 };
        resolve(None::<&Manifold>, motion, &wishes, &settings(), &Progress::new())
    }

    fn key(joint: Joint, frame: usize) -> Key {
        Key { joint: joint.name().to_owned(), frame }
    }

    #[test]
    fn a_key_stays_and_the_frames_around_adapt() {
        let mut motion = still(40);
        let arm = Joint::LeftArm.index();
        let own = motion.postures[20].rotations[arm];
        motion.postures[20].rotations[arm] = Quat::from_rotation_y(-0.5) * own;
        let edited =
            resolved(&motion, &[key(Joint::LeftArm, 20), key(Joint::LeftArm, 20)], &[]).expect("done").motion;
        assert_eq!(edited.postures[20].rotations[arm], motion.postures[20].rotations[arm]);
        let turned = |frame: usize| angle_between(edited.postures[frame].rotations[arm], own);
        assert!(turned(19) > 0.2 && turned(21) > 0.2, "{} {}", turned(19), turned(21));
        assert!((0..20).all(|f| turned(f) <= turned(f + 1) + 0.02));
        assert_eq!(edited.postures[..8], motion.postures[..8]);
        assert_eq!(edited.postures[33..], motion.postures[33..]);
    }

    #[test]
    fn a_keyed_root_keeps_its_place() {
        let mut motion = still(40);
        motion.postures[20].root_position.z -= 0.1;
        let edited = resolved(&motion, &[key(Joint::Hips, 20)], &[]).expect("done").motion;
        assert_eq!(edited.postures[20].root_position, motion.postures[20].root_position);
        let sunk = |frame: usize| motion.postures[0].root_position.z - edited.postures[frame].root_position.z;
        assert!(sunk(19) > 0.05 && sunk(21) > 0.05 && sunk(5).abs() < 1e-6, "{} {}", sunk(19), sunk(21));
    }

    #[test]
    fn the_motion_without_its_keys_goes_between_their_neighbours() {
        let mut motion = still(10);
        let at = |i: usize| Quat::from_rotation_z(0.1 * i as f32);
        for (i, posture) in motion.postures.iter_mut().enumerate() {
            posture.rotations[3] = at(i);
            posture.rotations[5] = at(i);
            posture.root_position.x = i as f32;
        }
        for f in [4, 5] {
            motion.postures[f].rotations[3] = at(20);
            motion.postures[f].root_position.x = 99.0;
        }
        let joint = Joint::ALL[3];
        let keyed = BTreeMap::from([(4, vec![joint]), (5, vec![joint, Joint::Hips])]);
        let out = without_keys(&motion, &keyed);
        for f in [4, 5] {
            assert!(angle_between(out.postures[f].rotations[3], at(f)) < 1e-3);
            assert_eq!(out.postures[f].rotations[5], motion.postures[f].rotations[5]);
        }
        // The root was keyed on frame 5 alone: between 4, as it is, and 6.
        assert_eq!((out.postures[4].root_position.x, out.postures[5].root_position.x), (99.0, 52.5));
        // At an end the one neighbour there is; with none, as it is.
        let keyed = BTreeMap::from([(0, vec![joint]), (9, vec![joint])]);
        let out = without_keys(&motion, &keyed);
        assert!(angle_between(out.postures[0].rotations[3], at(1)) < 1e-3);
        assert!(angle_between(out.postures[9].rotations[3], at(8)) < 1e-3);
        let all: BTreeMap<usize, Vec<Joint>> = (0..10).map(|f| (f, vec![joint])).collect();
        assert_eq!(without_keys(&motion, &all), motion);
    }

    #[test]
    fn what_cannot_be_resolved_is_a_sentence() {
        let motion = still(10);
        let said = |keys: &[Key], constraints: &[Constraint]| {
            resolved(&motion, keys, constraints).unwrap_err().to_string()
        };
        assert!(said(&[], &[]).contains("nothing to edit"));
        assert!(said(&[Key { joint: "Tail".into(), frame: 0 }], &[]).contains("no bone ‘Tail’"));
        let late = said(&[key(Joint::Head, 10)], &[]);
        assert!(late.contains("Head is keyed on frame 10") && late.contains("0 to 9"), "{late}");
        assert!(resolved(&motion, &[key(Joint::Head, 9)], &[]).is_ok());
        // A key and a pin of one joint on one frame.
        let pin = Constraint::positions("Pin", Joint::Head, 4, vec![Vec3::new(0.0, 0.0, 1.5)]);
        let both = said(&[key(Joint::Head, 4)], std::slice::from_ref(&pin));
        assert!(both.contains("‘Pin’ and ‘Key of the Head’"), "{both}");
        let far = Constraint::positions("Far", Joint::LeftHand, 4, vec![Vec3::new(3.0, 0.0, 1.0)]);
        assert!(matches!(resolved(&motion, &[], &[far]).unwrap_err(), Error::Unreachable(_)));
    }
}
