//! Motions given back as `.bvh` files, written by the `bvh_anim` crate.
//!
//! Y up, facing +Z at rest, centimetres, 30 frames a second: as most programs expect a `.bvh`. The skeleton is ours,
//! with a T-pose of unturned joints as its rest pose.

use std::path::Path;

use bvh_anim::write::{LineTerminator, WriteOptions};
use bvh_anim::{Bvh, BvhLiteralBuilder, ChannelType};
use glam::{DQuat, EulerRot, Vec3};

use super::clip::MotionLibrary;
use crate::data_file::write_whole;
use crate::error::{Error, Result};
use crate::motion::skeleton::{BODY_BOXES, JOINT_OFFSET, LEFT_PALM, NAMES, TOE_LENGTH};
use crate::motion::{FRAME_RATE, Joint, Motion, Posture};

const CENTIMETRES: f32 = 100.0;
/// Digits after the point: a hundredth of a micrometre, and what an `f32` holds of 180°.
const DECIMALS: usize = 6;
const POSITION: [ChannelType; 3] = [ChannelType::PositionX, ChannelType::PositionY, ChannelType::PositionZ];
/// The order that most files have: q = Z·X·Y.
const ROTATION: [ChannelType; 3] = [ChannelType::RotationZ, ChannelType::RotationX, ChannelType::RotationY];

/// The text of a `.bvh` with every frame of `motion`. Foot contacts have no place in the format.
///
/// # Errors
/// [`Error::Input`] for a motion without frames or with a number that is not finite.
pub fn to_bvh(motion: &Motion) -> Result<String> {
    if motion.is_empty() {
        return Err(Error::input("A motion without frames cannot be written as a .bvh file."));
    }
    let bad = motion.postures.iter().position(|p| {
        !(p.root_position.is_finite()
            && p.rotations.iter().all(|r| r.is_finite() && r.length_squared() > 0.0))
    });
    if let Some(frame) = bad {
        return Err(Error::input(format!(
            "Frame {frame} of the motion holds a number that is not finite; it cannot be written as a .bvh file."
        )));
    }
    let text = WriteOptions::new()
        .with_line_terminator(LineTerminator::Unix)
        .with_offset_significant_figures(DECIMALS)
        .with_frame_time_significant_figures(DECIMALS + 3)
        .with_motion_values_significant_figures(DECIMALS)
        .write_to_string(&bvh(motion));
    Ok(String::from_utf8_lossy(text.as_bytes()).into_owned())
}

impl MotionLibrary {
    /// Writes clip number `clip` as a `.bvh` file; an earlier one stays as it was until the new one is whole.
    ///
    /// # Errors
    /// [`Error::Input`] where there is no such clip or it cannot be written, [`Error::Io`].
    pub fn write_bvh(&self, clip: usize, path: &Path) -> Result<()> {
        write_whole(path, to_bvh(&self.clip(clip)?.motion)?.as_bytes())
    }
}

/// The crate's own form of the file. Its documented builder leaves the joints out; this one is behind its `bvh!` macro.
fn bvh(motion: &Motion) -> Bvh {
    let mut builder = BvhLiteralBuilder::default();
    let mut depth = [0; NAMES.len()];
    for joint in Joint::ALL {
        let index = joint.index();
        match joint.parent() {
            None => builder.push_root(NAMES[index]),
            Some(parent) => {
                depth[index] = depth[parent.index()] + 1;
                builder.current_depth = depth[index];
                builder.push_joint(NAMES[index]);
            }
        }
        // The root's place is in its channels alone, so that it does not matter whether a reader adds its offset.
        let offset = if joint.parent().is_none() { Vec3::ZERO } else { JOINT_OFFSET[index] };
        builder.push_joint_offset(axes(offset).into(), false);
        let channels = if joint.parent().is_none() { &POSITION[..] } else { &[] };
        channels.iter().chain(&ROTATION).for_each(|channel| builder.push_channel(*channel));
        if let Some(end) = end_site(joint) {
            builder.push_joint_offset(axes(end).into(), true);
        }
    }
    builder.set_frame_time(1.0 / f64::from(FRAME_RATE));
    builder.set_num_frames(motion.len());
    builder.set_motion_values(rows(&motion.postures));
    builder.bvh
}

/// Where a chain of joints ends, in its last joint's frame, metres.
fn end_site(joint: Joint) -> Option<Vec3> {
    match joint {
        Joint::Head => {
            BODY_BOXES.iter().find(|b| b.joint == joint).map(|b| Vec3::Z * (b.center.z + b.half_extents.z))
        }
        Joint::LeftHand => Some(Vec3::X * LEFT_PALM.x * 2.0),
        Joint::RightHand => Some(Vec3::NEG_X * LEFT_PALM.x * 2.0),
        Joint::LeftToe | Joint::RightToe => Some(Vec3::NEG_Y * TOE_LENGTH),
        _ => None,
    }
}

/// Our metres with Z up and facing -Y as the file's centimetres with Y up and facing +Z.
fn axes(v: Vec3) -> [f32; 3] {
    [v.x * CENTIMETRES, v.z * CENTIMETRES, -v.y * CENTIMETRES]
}

/// The numbers of all frames, a row each.
fn rows(postures: &[Posture]) -> Vec<f32> {
    let mut angles = [[0.0; 3]; NAMES.len()];
    let mut values = Vec::new();
    for posture in postures {
        values.extend(axes(posture.root_position));
        for (rotation, angles) in posture.rotations.iter().zip(&mut angles) {
            let q = rotation.as_dquat().normalize();
            *angles = nearest_angles(DQuat::from_xyzw(q.x, q.z, -q.y, q.w), *angles);
            values.extend(angles.map(|angle| angle as f32));
        }
    }
    values
}

/// The angles about Z, X and Y, degrees, that make `rotation` and lie nearest to those of the frame before, so that curves
/// through them have no jumps.
fn nearest_angles(rotation: DQuat, before: [f64; 3]) -> [f64; 3] {
    let (z, x, y) = rotation.to_euler(EulerRot::ZXY);
    let [z, x, y] = [z, x, y].map(f64::to_degrees);
    // The same rotation by the other way over the middle axis, and each by whole turns.
    let ways = [[z, x, y], [z + 180.0, 180.0 - x, y + 180.0]]
        .map(|way| std::array::from_fn(|i| way[i] + 360.0 * ((before[i] - way[i]) / 360.0).round()));
    let distance = |way: &[f64; 3]| way.iter().zip(before).map(|(a, b)| (a - b).abs()).sum::<f64>();
    if distance(&ways[1]) < distance(&ways[0]) { ways[1] } else { ways[0] }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::library::mocap_file::{self, MocapPose};
    use crate::motion::JOINT_COUNT;
    use glam::Quat;
    use proptest::prelude::*;

    fn motion(numbers: &[f32]) -> Motion {
        let postures: Vec<Posture> = numbers
            .chunks_exact(3 + 4 * JOINT_COUNT)
            .map(|n| Posture {
                root_position: Vec3::from_slice(n) * 5.0,
                rotations: std::array::from_fn(|j| {
                    let q = glam::Vec4::from_slice(&n[3 + 4 * j..]) + glam::Vec4::W * 1e-3;
                    Quat::from_vec4(q.normalize())
                }),
            })
            .collect();
        Motion { contacts: vec![[0.0; 2]; postures.len()], postures }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        /// Read back, every joint stands where it stood, whatever the posture.
        #[test]
        fn comes_back(numbers in proptest::collection::vec(-1.0f32..1.0, 3 * (3 + 4 * JOINT_COUNT))) {
            let motion = motion(&numbers);
            let text = to_bvh(&motion).unwrap();
            let file = mocap_file::parse(text.as_bytes()).unwrap();
            prop_assert_eq!((file.frame_rate, file.frame_count()), (30.0, motion.len()));
            let mut read = MocapPose::default();
            for (frame, posture) in motion.postures.iter().enumerate() {
                file.pose_at(frame as f64, &mut read);
                let pose = posture.pose();
                for joint in 0..JOINT_COUNT {
                    prop_assert_eq!(&file.joints[joint].name, NAMES[joint]);
                    let expected = Vec3::from(axes(pose.positions[joint]));
                    let distance = read.positions[joint].distance(expected);
                    prop_assert!(distance < 1e-2, "{distance} cm at frame {frame}, {}", NAMES[joint]);
                }
            }
            // The crate reads what it wrote; the numbers are ours, so that its number parser sees nothing foreign.
            let again = bvh_anim::from_bytes(text.as_bytes()).unwrap();
            prop_assert_eq!(again.joints().count(), JOINT_COUNT);
            let ours: Vec<f32> = rows(&motion.postures);
            let theirs = again.frames().flat_map(|f| f.as_slice().to_vec());
            prop_assert!(ours.iter().zip(theirs).all(|(a, b)| (a - b).abs() < 2e-5 * (1.0 + a.abs())));
        }

        /// A rotation that goes round and round: no angle jumps from frame to frame.
        #[test]
        fn curves_do_not_jump(axis in proptest::array::uniform3(-1.0f64..1.0), tilt in -1.4f64..1.4) {
            let axis = glam::DVec3::from(axis).try_normalize().unwrap_or(glam::DVec3::X);
            let mut before = [0.0; 3];
            for step in 0..2000 {
                let turn = DQuat::from_axis_angle(axis, tilt * (0.01 * f64::from(step)).sin())
                    * DQuat::from_rotation_y(0.01 * f64::from(step));
                let angles = nearest_angles(turn, before);
                let [z, x, y] = angles.map(f64::to_radians);
                let back = DQuat::from_euler(EulerRot::ZXY, z, x, y);
                prop_assert!(back.dot(turn).abs() > 1.0 - 1e-9, "{angles:?}");
                // Where the middle angle comes near a right angle the outer ones turn fast, but never by half a turn.
                prop_assert!(angles.iter().zip(before).all(|(a, b)| (a - b).abs() < 180.0), "{before:?} {angles:?}");
                before = angles;
            }
            prop_assert!(before[2].abs() > 720.0, "{before:?}");
        }
    }

    #[test]
    fn a_somersault_goes_on_over_the_poles() {
        let mut before = [0.0; 3];
        for step in 0..1300 {
            let angle = 0.01 * f64::from(step);
            before = nearest_angles(DQuat::from_rotation_x(angle), before);
            assert!((before[1] - angle.to_degrees()).abs() < 1e-3, "{angle}: {before:?}");
            assert!(before[0].abs() < 1e-3 && before[2].abs() < 1e-3, "{angle}: {before:?}");
        }
    }

    #[test]
    fn worked_by_hand() {
        let mut posture = Posture::default();
        // A quarter turn to the left about our Z, the file's Y; the left thigh raised forward.
        posture.rotations[0] = Quat::from_rotation_z(std::f32::consts::FRAC_PI_2);
        posture.rotations[Joint::LeftUpLeg.index()] = Quat::from_rotation_x(-std::f32::consts::FRAC_PI_2);
        posture.rotations[Joint::LeftArm.index()] = Quat::from_rotation_y(std::f32::consts::FRAC_PI_2);
        let text = to_bvh(&Motion { postures: vec![posture; 2], contacts: vec![[1.0; 2]; 2] }).unwrap();
        let lines: Vec<&str> = text.lines().map(str::trim).collect();
        assert_eq!(lines[..2], ["HIERARCHY", "ROOT Hips"]);
        assert!(lines.contains(&"OFFSET 9.500000 -2.000000 -0.000000"), "{text}");
        let at = lines.iter().position(|l| l.starts_with("MOTION")).unwrap();
        assert_eq!(lines[at + 1..at + 3], ["Frames: 2", "Frame Time: 0.033333333"]);
        let row: Vec<f32> = lines[at + 3].split(' ').map(|v| v.parse().unwrap()).collect();
        assert_eq!(row.len(), 3 + 3 * JOINT_COUNT);
        let close = |a: &[f32], b: [f32; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-4);
        assert!(close(&row[..3], [0.0, 99.3, 0.0]) && close(&row[3..6], [0.0, 0.0, 90.0]), "{row:?}");
        let thigh = 3 + 3 * Joint::LeftUpLeg.index();
        assert!(close(&row[thigh..thigh + 3], [0.0, -90.0, 0.0]), "{row:?}");
        // The arm hangs, turned about our Y: about the file's -Z.
        let arm = 3 + 3 * Joint::LeftArm.index();
        assert!(close(&row[arm..arm + 3], [-90.0, 0.0, 0.0]), "{row:?}");
    }

    #[test]
    fn what_cannot_be_written_gets_a_sentence() {
        let empty = to_bvh(&Motion::default()).unwrap_err().to_string();
        assert!(empty.contains("without frames"), "{empty}");
        let mut postures = vec![Posture::default(); 3];
        postures[1].root_position.x = f32::NAN;
        let bad = to_bvh(&Motion { postures, contacts: vec![[0.0; 2]; 3] }).unwrap_err().to_string();
        assert!(bad.starts_with("Frame 1 "), "{bad}");
        let none = MotionLibrary::default().write_bvh(3, Path::new("never.bvh")).unwrap_err().to_string();
        assert!(none.contains("0 clips") && none.contains("number 3"), "{none}");
    }
}
