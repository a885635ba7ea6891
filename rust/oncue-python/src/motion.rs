//! Motions as arrays: out as new ones, in as checked copies.

use glam::{Quat, Vec3};
use ndarray::{Array2, Array3, Ix2, Ix3};
use numpy::{IntoPyArray, PyArray2, PyArray3};
use oncue::Motion;
use oncue::motion::{JOINT_COUNT, Posture};
use pyo3::prelude::*;

use crate::arrays::array;
use crate::error::InputError;

/// A motion's three arrays.
pub struct MotionArrays {
    pub root_positions: Py<PyArray2<f32>>,
    pub rotations: Py<PyArray3<f32>>,
    pub contacts: Py<PyArray2<f32>>,
}

pub fn to_arrays(py: Python<'_>, motion: &Motion) -> PyResult<MotionArrays> {
    let frames = motion.len();
    let root_positions =
        Array2::from_shape_fn((frames, 3), |(f, axis)| motion.postures[f].root_position[axis]);
    let rotations = Array3::from_shape_fn((frames, JOINT_COUNT, 4), |(f, joint, part)| {
        let q = motion.postures[f].rotations[joint];
        [q.w, q.x, q.y, q.z][part]
    });
    let contacts = Array2::from_shape_fn((frames, 2), |(f, side)| motion.contacts[f][side]);
    Ok(MotionArrays {
        root_positions: root_positions.into_pyarray(py).unbind(),
        rotations: rotations.into_pyarray(py).unbind(),
        contacts: contacts.into_pyarray(py).unbind(),
    })
}

/// The motion of arrays like those of a synthesis. `InputError` names the array that is of another shape or kind.
pub fn from_arrays(
    root_positions: &Bound<'_, PyAny>,
    rotations: &Bound<'_, PyAny>,
    contacts: &Bound<'_, PyAny>,
) -> PyResult<Motion> {
    let positions = array::<f32, Ix2>("root_positions", root_positions, &[None, Some(3)])?;
    let frames = positions.nrows();
    let rotations = array::<f32, Ix3>("rotations", rotations, &[Some(frames), Some(JOINT_COUNT), Some(4)])?;
    let contacts = array::<f32, Ix2>("contacts", contacts, &[Some(frames), Some(2)])?;
    let postures: Vec<Posture> = positions
        .rows()
        .into_iter()
        .zip(rotations.outer_iter())
        .map(|(place, turns)| Posture {
            root_position: Vec3::new(place[0], place[1], place[2]),
            rotations: std::array::from_fn(|j| {
                let q = turns.row(j);
                Quat::from_xyzw(q[1], q[2], q[3], q[0])
            }),
        })
        .collect();
    let unit = |q: &Quat| (q.length() - 1.0).abs() < 1e-2;
    for (frame, posture) in postures.iter().enumerate() {
        if !posture.root_position.is_finite() || !posture.rotations.iter().all(unit) {
            return Err(InputError::new_err(format!(
                "Frame {frame} has a root position that is no number or a rotation that is no unit quaternion."
            )));
        }
    }
    Ok(Motion { postures, contacts: contacts.rows().into_iter().map(|c| [c[0], c[1]]).collect() })
}
