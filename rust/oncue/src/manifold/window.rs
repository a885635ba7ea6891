//! X: a motion as the manifold sees it, one row of [`FEATURES`] numbers a frame (LAMA, section 3.6).
//!
//! ```text
//! ROTATIONS  22 × 6  6D rotations (Zhou et al. 2019) relative to the parent, in the order of the joints;
//!                    the root's is relative to its own facing, so it holds the lean alone
//! HEIGHT     1       of the root over the floor, metres
//! STEP       3       planar root transform from the frame before, in that frame's person-centric space:
//!                    x (to its left) and y (backward) in metres, turn in radians
//! CONTACTS   2       of the left and the right foot
//! ```
//!
//! A window knows no place: where its first frame stands is a [`Planar`] beside it, and that frame's own STEP
//! is not used to place anything.

use std::ops::Range;

use glam::{Quat, Vec2};

use crate::math::Planar;
use crate::math::rotation::{from_6d, to_6d, wrap_angle, yaw};
use crate::motion::{FootContact, JOINT_COUNT, Motion, Posture};

/// Frames of one window (LAMA, supplementary).
pub const WINDOW: usize = 120;

/// Numbers of one rotation.
pub(crate) const ROTATION: usize = 6;
/// Where the rotations stand in a row: joint j's at `j * ROTATION`.
pub(crate) const ROTATIONS: Range<usize> = 0..JOINT_COUNT * ROTATION;
/// Where the root's height stands in a row.
pub(crate) const HEIGHT: usize = ROTATIONS.end;
/// Where the root's step (x, y, turn) stands in a row.
pub(crate) const STEP: Range<usize> = HEIGHT + 1..HEIGHT + 4;
/// Where the contacts stand in a row.
pub(crate) const CONTACTS: Range<usize> = STEP.end..STEP.end + 2;
/// Numbers of one row.
pub const FEATURES: usize = CONTACTS.end;

/// Where joint `joint`'s rotation stands in a row.
pub(crate) const fn rotation_range(joint: usize) -> Range<usize> {
    joint * ROTATION..(joint + 1) * ROTATION
}

/// X of a whole motion, (frames × [`FEATURES`]), and where its first frame stands.
///
/// The first frame has no frame before it; its step is the second frame's.
pub fn from_motion(motion: &Motion) -> (Vec<f32>, Planar) {
    let mut x = vec![0.0; motion.len() * FEATURES];
    let start = motion.postures.first().map(Posture::planar).unwrap_or_default();
    let mut before = start;
    for ((row, posture), contact) in x.chunks_exact_mut(FEATURES).zip(&motion.postures).zip(&motion.contacts)
    {
        let here = posture.planar();
        let mut rotations = posture.rotations;
        rotations[0] = Quat::from_rotation_z(-yaw(rotations[0])) * rotations[0];
        for (joint, rotation) in rotations.iter().enumerate() {
            row[rotation_range(joint)].copy_from_slice(&to_6d(*rotation));
        }
        row[HEIGHT] = posture.root_position.z;
        let step = before.relative(here);
        row[STEP].copy_from_slice(&[step.position.x, step.position.y, step.yaw]);
        row[CONTACTS].copy_from_slice(contact);
        before = here;
    }
    if motion.len() > 1 {
        let (first, second) = x.split_at_mut(FEATURES);
        first[STEP].copy_from_slice(&second[STEP]);
    }
    (x, start)
}

/// The motion of X (frames × [`FEATURES`]) whose first frame stands at `start`.
///
/// Rotations come from their 6D form by Gram-Schmidt, the root's path by adding up the steps; contacts are
/// held within 0..=1.
pub(crate) fn to_motion(x: &[f32], start: Planar) -> Motion {
    let mut motion = Motion::default();
    let mut here = start;
    for (frame, row) in x.chunks_exact(FEATURES).enumerate() {
        if frame > 0 {
            here = next_planar(here, row);
        }
        let mut posture = Posture {
            root_position: here.position.extend(row[HEIGHT]),
            rotations: std::array::from_fn(|joint| rotation(row, joint)),
        };
        posture.rotations[0] = here.rotation() * posture.rotations[0];
        motion.postures.push(posture);
        motion.contacts.push(contact(row));
    }
    motion
}

/// Joint `joint`'s rotation in a row.
pub(crate) fn rotation(row: &[f32], joint: usize) -> Quat {
    let mut numbers = [0.0; ROTATION];
    numbers.copy_from_slice(&row[rotation_range(joint)]);
    from_6d(numbers)
}

/// Where the frame of `row` stands, the frame before it standing at `before`.
pub(crate) fn next_planar(before: Planar, row: &[f32]) -> Planar {
    let [x, y, turn] = [row[STEP.start], row[STEP.start + 1], row[STEP.start + 2]];
    let next = before.compose(Planar::new(Vec2::new(x, y), turn));
    Planar::new(next.position, wrap_angle(next.yaw))
}

fn contact(row: &[f32]) -> FootContact {
    [row[CONTACTS.start].clamp(0.0, 1.0), row[CONTACTS.start + 1].clamp(0.0, 1.0)]
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::math::rotation::angle_between;
    use glam::Vec3;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg32;

    /// A motion of random postures along a random path: nothing of it is special.
    pub(crate) fn random_motion(frames: usize, seed: u64) -> Motion {
        let mut rng = Pcg32::seed_from_u64(seed);
        let mut number = move |range: f32| rng.random_range(-range..range);
        let mut here = Planar::new(Vec2::new(number(3.0), number(3.0)), number(3.0));
        let mut motion = Motion::default();
        for _ in 0..frames {
            here = here.compose(Planar::new(Vec2::new(number(0.05), number(0.05)), number(0.2)));
            let mut posture = Posture {
                root_position: here.position.extend(0.9 + number(0.2)),
                rotations: std::array::from_fn(|_| {
                    Quat::from_scaled_axis(Vec3::new(number(1.0), number(1.0), number(1.0)))
                }),
            };
            let lean = Quat::from_scaled_axis(Vec3::new(number(0.4), number(0.4), 0.0));
            posture.rotations[0] = here.rotation() * lean;
            motion.postures.push(posture);
            motion.contacts.push([number(0.5) + 0.5, number(0.5) + 0.5]);
        }
        motion
    }

    #[test]
    fn a_motion_comes_back_from_x() {
        let motion = random_motion(150, 1);
        let (x, start) = from_motion(&motion);
        assert_eq!(x.len(), 150 * FEATURES);
        let back = to_motion(&x, start);
        assert_eq!(back.contacts, motion.contacts);
        for (a, b) in motion.postures.iter().zip(&back.postures) {
            // The path adds up 150 rounded steps.
            assert!(a.root_position.distance(b.root_position) < 2e-4);
            for (p, q) in a.rotations.iter().zip(&b.rotations) {
                assert!(angle_between(*p, *q) < 1e-4);
            }
        }
    }

    #[test]
    fn x_knows_no_place() {
        let motion = random_motion(20, 2);
        let to = Planar::new(Vec2::new(-4.0, 7.0), 2.0);
        let from = motion.postures[0].planar();
        let moved = Motion {
            postures: motion.postures.iter().map(|p| p.moved(from, to)).collect(),
            contacts: motion.contacts.clone(),
        };
        let ((a, _), (b, start)) = (from_motion(&motion), from_motion(&moved));
        assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 1e-5));
        assert!(start.position.distance(to.position) < 1e-5);
    }

    #[test]
    fn steps_by_hand() {
        // Facing +X (yaw 90°), walking 0.04 m a frame forward while turning left by 0.1.
        let mut motion = Motion::default();
        for frame in 0..2 {
            let root_position = Vec3::new(0.04 * frame as f32, 0.0, 0.9);
            let mut posture = Posture { root_position, ..Posture::default() };
            posture.rotations[0] = Quat::from_rotation_z(std::f32::consts::FRAC_PI_2 + 0.1 * frame as f32);
            motion.postures.push(posture);
            motion.contacts.push([1.0, 0.0]);
        }
        let (x, _) = from_motion(&motion);
        let row = &x[FEATURES..];
        assert!(
            row[STEP].iter().zip([0.0, -0.04, 0.1]).all(|(a, b)| (a - b).abs() < 1e-6),
            "{:?}",
            &row[STEP]
        );
        assert_eq!(row[HEIGHT], 0.9);
        assert_eq!(row[CONTACTS], [1.0, 0.0]);
        // All the facing is in the path: the root's own rotation is the identity.
        assert!(row[..6].iter().zip([1.0, 0.0, 0.0, 0.0, 1.0, 0.0]).all(|(a, b)| (a - b).abs() < 1e-6));
        assert_eq!(x[STEP], x[FEATURES + STEP.start..FEATURES + STEP.end]);
    }

    #[test]
    fn an_empty_motion_is_an_empty_window() {
        let (x, start) = from_motion(&Motion::default());
        assert!(x.is_empty() && start == Planar::default());
        assert!(to_motion(&x, start).is_empty());
    }
}
