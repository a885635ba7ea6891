//! What an edited motion must meet: joints at places or turned as given, over a range of frames.

use std::ops::Range;

use glam::{Quat, Vec3};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::error::{Error, Result};
use crate::math::rotation::angle_between;
use crate::motion::skeleton::NAMES;
use crate::motion::{Joint, Motion, Pose};

/// q_j^t (LAMA, φ_M, section 3.1), and the same for rotations: where a joint is to be, frame by frame.
///
/// One entry for each frame from `first_frame` on; a list that is empty leaves that side of the joint free.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Constraint {
    /// The name the artist gave it, for messages.
    pub name: String,
    /// The joint that is placed or turned.
    #[serde(with = "by_name")]
    pub joint: Joint,
    /// The point of the joint that `positions` place, in the joint's frame, metres: a palm, say. Zero is the joint itself.
    #[serde(default)]
    pub offset: Vec3,
    /// 30 Hz.
    pub first_frame: usize,
    /// World, metres.
    #[serde(default)]
    pub positions: Vec<Vec3>,
    /// World, w first in files and in Python.
    #[serde(default, with = "w_first")]
    pub rotations: Vec<Quat>,
    /// The root's facing alone (radians, see [`crate::math::Planar`]), where its lean is free.
    #[serde(default)]
    pub facings: Vec<f32>,
    /// A wish: it pulls, and may be missed.
    #[serde(default)]
    pub soft: bool,
}

/// Two hard targets of one joint on one frame may differ so far, metres and radians.
const SAME_PLACE: f32 = 1e-3;
const SAME_TURN: f32 = 5e-3;
/// Nothing is placed farther from the origin, metres.
const FARTHEST_PLACE: f32 = 1e5;
/// A target moves at most so far from one frame to the next, metres: 4 m/s, a fast reach.
const MOST_PATH_STEP: f32 = 0.134;
/// And turns at most so far, radians.
const MOST_PATH_TURN: f32 = 0.8;

impl Constraint {
    /// A joint at given places.
    pub fn positions(name: &str, joint: Joint, first_frame: usize, positions: Vec<Vec3>) -> Self {
        Self {
            name: name.to_owned(),
            joint,
            offset: Vec3::ZERO,
            first_frame,
            positions,
            rotations: Vec::new(),
            facings: Vec::new(),
            soft: false,
        }
    }

    /// Where the point that it places is in a pose.
    pub fn point(&self, pose: &Pose) -> Vec3 {
        pose.point(self.joint, self.offset)
    }

    /// The frames it speaks of.
    pub fn frames(&self) -> Range<usize> {
        let count = self.positions.len().max(self.rotations.len()).max(self.facings.len());
        self.first_frame..self.first_frame + count
    }

    /// The place asked for on a frame of the motion, world, metres.
    pub fn position(&self, frame: usize) -> Option<Vec3> {
        self.positions.get(frame.checked_sub(self.first_frame)?).copied()
    }

    /// The rotation asked for on a frame of the motion, world.
    pub fn rotation(&self, frame: usize) -> Option<Quat> {
        self.rotations.get(frame.checked_sub(self.first_frame)?).copied()
    }

    /// The facing asked for on a frame of the motion, radians.
    pub fn facing(&self, frame: usize) -> Option<f32> {
        self.facings.get(frame.checked_sub(self.first_frame)?).copied()
    }

    fn check(&self, motion: &Motion) -> Result<()> {
        let name = &self.name;
        let frames = self.frames();
        if frames.is_empty() {
            return Err(Error::input(format!(
                "‘{name}’ places nothing: give the {} a position or a rotation on at least one frame.",
                self.joint.name()
            )));
        }
        let lengths = [self.positions.len(), self.rotations.len(), self.facings.len()];
        if lengths.iter().any(|&n| n != 0 && n != frames.len()) {
            return Err(Error::input(format!(
                "‘{name}’ has {} positions, {} rotations and {} facings; give each frame one, or none at all.",
                lengths[0], lengths[1], lengths[2]
            )));
        }
        if frames.end > motion.len() {
            return Err(Error::input(format!(
                "‘{name}’ asks for frames {} to {}, and the motion has frames 0 to {}; move it within the motion.",
                frames.start,
                frames.end - 1,
                motion.len().saturating_sub(1)
            )));
        }
        if !self.facings.is_empty() && self.joint != Joint::Hips {
            return Err(Error::input(format!(
                "‘{name}’ gives the {} a facing; only the Hips have one.",
                self.joint.name()
            )));
        }
        let numbers = self.offset.is_finite()
            && self.positions.iter().all(|p| p.is_finite())
            && self.rotations.iter().all(|q| q.is_finite())
            && self.facings.iter().all(|f| f.is_finite());
        if !numbers {
            return Err(Error::input(format!("‘{name}’ has a place or a rotation that is not a number.")));
        }
        if let Some(far) = self.positions.iter().chain([&self.offset]).find(|p| !is_place(**p)) {
            return Err(Error::input(format!(
                "‘{name}’ asks for a place {:.0} km from the origin; nothing is placed farther than {:.0} km from it.",
                far.abs().max_element() / 1000.0,
                FARTHEST_PLACE / 1000.0
            )));
        }
        if let Some(turn) = self.rotations.iter().find(|q| (q.length() - 1.0).abs() >= 1e-2) {
            return Err(Error::input(format!(
                "‘{name}’ has a rotation of length {:.3}; a quaternion that turns has the length 1.",
                turn.length()
            )));
        }
        check_path(name, self.first_frame, &self.positions)?;
        for (i, pair) in self.rotations.windows(2).enumerate() {
            let turn = angle_between(pair[0], pair[1]);
            if turn > MOST_PATH_TURN {
                return Err(Error::input(format!(
                    "‘{name}’ turns by {:.0}° between frames {} and {}; a joint turns at most {:.0}° a frame.",
                    turn.to_degrees(),
                    self.first_frame + i,
                    self.first_frame + i + 1,
                    MOST_PATH_TURN.to_degrees()
                )));
            }
        }
        Ok(())
    }
}

/// Whether something can be there: numbers, no farther away than single precision places a hand.
fn is_place(place: Vec3) -> bool {
    place.is_finite() && place.abs().max_element() < FARTHEST_PLACE
}

/// Refuses a motion without frames, and one with places or rotations that no body can have, as a key that was scaled by
/// infinity gives them; so for the floor.
///
/// # Errors
/// `Input`; the sentence names the frame.
pub(super) fn check_numbers(motion: &Motion, floor: f32) -> Result<()> {
    if motion.is_empty() {
        return Err(Error::input("There is no motion to edit: it has no frames."));
    }
    if !is_place(Vec3::Z * floor) {
        return Err(Error::input(format!("The floor's height is {floor}, which is no place.")));
    }
    for (frame, posture) in motion.postures.iter().enumerate() {
        let turned = posture.rotations.iter().all(|q| q.is_finite() && (q.length() - 1.0).abs() < 1e-2);
        if !(turned && is_place(posture.root_position)) {
            return Err(Error::input(format!(
                "The motion has a place or a rotation on frame {frame} that is not a number or far beyond the scene; take the \
                 key there away."
            )));
        }
    }
    Ok(())
}

/// Refuses a path that jumps.
pub(super) fn check_path(name: &str, first_frame: usize, path: &[Vec3]) -> Result<()> {
    for (i, pair) in path.windows(2).enumerate() {
        let step = pair[0].distance(pair[1]);
        if step > MOST_PATH_STEP {
            return Err(Error::input(format!(
                "The path of ‘{name}’ jumps by {step:.2} m between frames {} and {}; a hand moves at most {MOST_PATH_STEP:.2} m a \
                 frame. Give it more frames or smooth its keys.",
                first_frame + i,
                first_frame + i + 1
            )));
        }
    }
    Ok(())
}

/// Refuses what cannot be met whatever the body does: ranges outside the motion, paths that jump, two targets for one
/// joint on one frame.
///
/// # Errors
/// `Input`; the sentence names the constraint, the frame and the value.
pub fn check_constraints(motion: &Motion, constraints: &[Constraint]) -> Result<()> {
    constraints.iter().try_for_each(|c| c.check(motion))?;
    for (i, a) in constraints.iter().enumerate().filter(|(_, c)| !c.soft) {
        for b in constraints[i + 1..].iter().filter(|b| b.joint == a.joint && !b.soft) {
            let both = a.frames().start.max(b.frames().start)..a.frames().end.min(b.frames().end);
            for frame in both {
                let apart = a.position(frame).zip(b.position(frame)).map_or(0.0, |(a, b)| a.distance(b));
                // Two points of one joint are never farther apart than in its own frame.
                let apart = (apart - a.offset.distance(b.offset)).max(0.0);
                let turned =
                    a.rotation(frame).zip(b.rotation(frame)).map_or(0.0, |(a, b)| angle_between(a, b));
                if apart > SAME_PLACE || turned > SAME_TURN {
                    let how = if apart > SAME_PLACE {
                        format!("{apart:.2} m apart")
                    } else {
                        format!("{:.0}° apart", turned.to_degrees())
                    };
                    return Err(Error::input(format!(
                        "‘{}’ and ‘{}’ both want the {} on frame {frame}, {how}; keep one of them.",
                        a.name,
                        b.name,
                        a.joint.name()
                    )));
                }
            }
        }
    }
    Ok(())
}

/// The joint of that name.
///
/// # Errors
/// `Input` naming it and those there are.
pub(crate) fn joint_named(name: &str) -> Result<Joint> {
    NAMES.iter().position(|n| *n == name).map(|i| Joint::ALL[i]).ok_or_else(|| {
        Error::input(format!("The character has no bone ‘{name}’; its bones are {}.", NAMES.join(", ")))
    })
}

mod by_name {
    use super::*;

    pub(super) fn serialize<S: Serializer>(joint: &Joint, to: S) -> std::result::Result<S::Ok, S::Error> {
        to.serialize_str(joint.name())
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> std::result::Result<Joint, D::Error> {
        let name = String::deserialize(from)?;
        joint_named(&name).map_err(serde::de::Error::custom)
    }
}

pub(crate) mod w_first {
    use super::*;

    pub(crate) fn serialize<S: Serializer>(
        rotations: &[Quat],
        to: S,
    ) -> std::result::Result<S::Ok, S::Error> {
        to.collect_seq(rotations.iter().map(|q| [q.w, q.x, q.y, q.z]))
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(
        from: D,
    ) -> std::result::Result<Vec<Quat>, D::Error> {
        let numbers = Vec::<[f32; 4]>::deserialize(from)?;
        Ok(numbers.into_iter().map(|[w, x, y, z]| Quat::from_xyzw(x, y, z, w)).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::Posture;

    fn still(frames: usize) -> Motion {
        Motion { postures: vec![Posture::default(); frames], contacts: vec![[1.0, 1.0]; frames] }
    }

    fn hand(name: &str, first: usize, places: &[Vec3]) -> Constraint {
        Constraint::positions(name, Joint::LeftHand, first, places.to_vec())
    }

    #[test]
    fn bad_input_is_named() {
        let motion = still(20);
        let refused =
            |constraints: &[Constraint]| check_constraints(&motion, constraints).unwrap_err().to_string();
        let late = refused(&[hand("Lid", 18, &[Vec3::ONE; 5])]);
        assert!(late.contains("‘Lid’") && late.contains("18 to 22") && late.contains("0 to 19"), "{late}");
        let twice = refused(&[hand("A", 3, &[Vec3::ONE; 5]), hand("B", 6, &[Vec3::ONE * 1.1; 2])]);
        assert!(
            twice.contains("‘A’ and ‘B’") && twice.contains("frame 6") && twice.contains("0.17 m"),
            "{twice}"
        );
        let jump = refused(&[hand("Door", 3, &[Vec3::ZERO, Vec3::X * 0.1, Vec3::X])]);
        assert!(jump.contains("jumps by 0.90 m between frames 4 and 5"), "{jump}");
        assert!(refused(&[hand("Door", 3, &[])]).contains("places nothing"));
        assert!(refused(&[hand("Door", 3, &[Vec3::NAN])]).contains("not a number"));
        let far = refused(&[hand("Pin", 3, &[Vec3::Z, Vec3::X * -1e6])]);
        assert!(
            far.contains("a place 1000 km from the origin; nothing is placed farther than 100 km"),
            "{far}"
        );
        let mut flat = hand("Pin", 3, &[]);
        flat.rotations.push(Quat::from_xyzw(0.0, 0.0, 0.0, 0.5));
        assert!(refused(&[flat]).contains("a rotation of length 0.500"));
        let mut uneven = hand("Door", 3, &[Vec3::ZERO; 2]);
        uneven.rotations.push(Quat::IDENTITY);
        assert!(refused(&[uneven]).contains("2 positions, 1 rotations"));
        // The same place twice, a soft wish beside a hard one: nothing to refuse.
        let mut wish = hand("C", 3, &[Vec3::ZERO; 5]);
        wish.soft = true;
        check_constraints(&motion, &[hand("A", 3, &[Vec3::ONE; 5]), hand("B", 3, &[Vec3::ONE; 5]), wish])
            .unwrap();
    }

    #[test]
    fn reads_json_and_names_a_bone_that_is_none() {
        let text = r#"{"name": "Pin", "joint": "LeftPaw", "first_frame": 3}"#;
        let error = serde_json::from_str::<Constraint>(text).unwrap_err().to_string();
        assert!(error.contains("no bone ‘LeftPaw’") && error.contains("LeftHand"), "{error}");
        let text =
            r#"{"name": "Pin", "joint": "Head", "first_frame": 3, "rotations": [[0.6, 0.8, 0.0, 0.0]]}"#;
        let pin: Constraint = serde_json::from_str(text).unwrap();
        assert_eq!(pin.rotations, [Quat::from_xyzw(0.8, 0.0, 0.0, 0.6)]);
        assert_eq!(serde_json::from_str::<Constraint>(&serde_json::to_string(&pin).unwrap()).unwrap(), pin);
    }

    #[test]
    fn what_is_just_allowed_and_just_not() {
        let motion = still(20);
        let check = |c: Constraint| check_constraints(&motion, &[c]);
        let far = |x: f32| hand("Far", 3, &[Vec3::new(0.0, x, 0.0)]);
        assert!(check(far(0.99e5)).is_ok() && check(far(-1.01e5)).is_err());
        let step = |x: f32| hand("Step", 3, &[Vec3::ZERO, Vec3::X * x]);
        assert!(check(step(0.133)).is_ok() && check(step(0.135)).is_err());
        let turn = |angle: f32| {
            let rotations = vec![Quat::IDENTITY, Quat::from_rotation_y(angle)];
            Constraint { rotations, ..hand("Turn", 3, &[]) }
        };
        assert!(check(turn(0.79)).is_ok());
        let said = check(turn(0.81)).unwrap_err().to_string();
        assert!(said.contains("46° between frames 3 and 4") && said.contains("at most 46°"), "{said}");
        let scaled =
            |length: f32| Constraint { rotations: vec![Quat::IDENTITY * length], ..hand("Q", 3, &[]) };
        assert!(
            check(scaled(1.009)).is_ok() && check(scaled(1.011)).is_err() && check(scaled(0.98)).is_err()
        );
        let faces =
            |joint: Joint, facing: f32| Constraint { joint, facings: vec![facing], ..hand("F", 3, &[]) };
        assert!(check(faces(Joint::Hips, 1.0)).is_ok() && check(faces(Joint::Hips, f32::NAN)).is_err());
        assert!(check(faces(Joint::Head, 1.0)).unwrap_err().to_string().contains("only the Hips"));
        assert!(check(Constraint { offset: Vec3::NAN, ..hand("O", 3, &[Vec3::ZERO]) }).is_err());
        // The last frame there is.
        assert!(
            check(hand("End", 19, &[Vec3::ZERO])).is_ok() && check(hand("End", 20, &[Vec3::ZERO])).is_err()
        );
        // One of two lists may be left out, and none may be shorter.
        let both = Constraint { rotations: vec![Quat::IDENTITY; 2], ..hand("Both", 3, &[Vec3::ZERO; 2]) };
        assert!(check(both.clone()).is_ok());
        assert!(check(Constraint { facings: vec![0.0], ..both }).is_err());
    }

    #[test]
    fn two_targets_of_one_joint_may_differ_by_a_hair() {
        let motion = still(20);
        let pair = |a: Constraint, b: Constraint| check_constraints(&motion, &[a, b]);
        let at = |x: f32| hand("A", 3, &[Vec3::X * x]);
        assert!(pair(at(0.0), at(0.0009)).is_ok() && pair(at(0.0), at(0.0011)).is_err());
        let turned =
            |angle: f32| Constraint { rotations: vec![Quat::from_rotation_x(angle)], ..hand("T", 3, &[]) };
        assert!(pair(turned(0.0), turned(0.0049)).is_ok());
        let said = pair(turned(0.0), turned(0.5)).unwrap_err().to_string();
        assert!(said.contains("LeftHand on frame 3, 29° apart"), "{said}");
        // Two points of one joint are as far apart as they are in it, and no farther.
        let other = |x: f32| Constraint { offset: Vec3::Y * 0.1, ..at(x) };
        assert!(pair(at(0.0), other(0.1)).is_ok() && pair(at(0.0), other(0.102)).is_err());
        // Another joint, another frame, or a wish: nothing to refuse.
        let head = Constraint { joint: Joint::Head, ..at(1.0) };
        let later = Constraint { first_frame: 4, ..at(1.0) };
        let wish = Constraint { soft: true, ..at(1.0) };
        assert!(pair(at(0.0), head).is_ok() && pair(at(0.0), later).is_ok() && pair(at(0.0), wish).is_ok());
    }

    #[test]
    fn a_constraint_speaks_of_its_frames() {
        let c = Constraint {
            rotations: vec![Quat::from_rotation_z(0.1), Quat::from_rotation_z(0.2)],
            facings: vec![0.3, 0.4],
            ..hand("A", 5, &[Vec3::X, Vec3::Y])
        };
        assert_eq!(c.frames(), 5..7);
        assert_eq!([4, 5, 6, 7].map(|f| c.position(f)), [None, Some(Vec3::X), Some(Vec3::Y), None]);
        assert_eq!([4, 6, 7].map(|f| c.rotation(f)), [None, Some(c.rotations[1]), None]);
        assert_eq!([4, 6, 7].map(|f| c.facing(f)), [None, Some(0.4), None]);
        let pose = Posture::default().pose();
        let palm = Constraint { offset: Vec3::Z * 0.1, ..c };
        assert_eq!(palm.point(&pose), pose.position(Joint::LeftHand) + Vec3::Z * 0.1);
    }

    #[test]
    fn a_motion_that_no_body_can_have_is_refused() {
        assert!(check_numbers(&still(3), 0.0).is_ok() && check_numbers(&still(3), -99.0).is_ok());
        assert!(check_numbers(&still(0), 0.0).unwrap_err().to_string().contains("no frames"));
        assert!(check_numbers(&still(3), f32::INFINITY).is_err() && check_numbers(&still(3), 2e5).is_err());
        let mut scaled = still(3);
        scaled.postures[2].rotations[4] = Quat::IDENTITY * 1.02;
        assert!(check_numbers(&scaled, 0.0).unwrap_err().to_string().contains("frame 2"));
        scaled.postures[2].rotations[4] = Quat::IDENTITY * 1.005;
        assert!(check_numbers(&scaled, 0.0).is_ok());
        scaled.postures[1].root_position.x = 2e5;
        assert!(check_numbers(&scaled, 0.0).unwrap_err().to_string().contains("frame 1"));
    }
}
