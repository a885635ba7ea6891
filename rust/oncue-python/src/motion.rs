//! Motions as arrays: out as new ones, in as checked copies.

use glam::{Quat, Vec3};
use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods};
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
    let positions = motion.postures.iter().flat_map(|p| p.root_position.to_array());
    let quaternions = motion.postures.iter().flat_map(|p| &p.rotations);
    let rotations = quaternions.flat_map(|q| [q.w, q.x, q.y, q.z]);
    let contacts = motion.contacts.iter().flatten().copied();
    Ok(MotionArrays {
        root_positions: PyArray1::from_iter(py, positions).reshape([frames, 3])?.unbind(),
        rotations: PyArray1::from_iter(py, rotations).reshape([frames, JOINT_COUNT, 4])?.unbind(),
        contacts: PyArray1::from_iter(py, contacts).reshape([frames, 2])?.unbind(),
    })
}

/// The motion of arrays like those of a synthesis. `InputError` names the array that is of another shape or kind.
pub fn from_arrays(
    root_positions: &Bound<'_, PyAny>,
    rotations: &Bound<'_, PyAny>,
    contacts: &Bound<'_, PyAny>,
) -> PyResult<Motion> {
    let positions = array("root_positions", root_positions, &[None, Some(3)])?;
    let frames = positions.len() / 3;
    let rotations = array("rotations", rotations, &[Some(frames), Some(JOINT_COUNT), Some(4)])?;
    let contacts = array("contacts", contacts, &[Some(frames), Some(2)])?;
    let places = positions.chunks_exact(3).map(Vec3::from_slice);
    let turns = rotations.chunks_exact(4 * JOINT_COUNT).map(|row| {
        std::array::from_fn(|j| Quat::from_xyzw(row[4 * j + 1], row[4 * j + 2], row[4 * j + 3], row[4 * j]))
    });
    let postures: Vec<Posture> =
        places.zip(turns).map(|(root_position, rotations)| Posture { root_position, rotations }).collect();
    let unit = |q: &Quat| (q.length() - 1.0).abs() < 1e-2;
    for (frame, posture) in postures.iter().enumerate() {
        if !posture.root_position.is_finite() || !posture.rotations.iter().all(unit) {
            return Err(InputError::new_err(format!(
                "Frame {frame} has a root position that is no number or a rotation that is no unit quaternion."
            )));
        }
    }
    Ok(Motion { postures, contacts: contacts.chunks_exact(2).map(|c| [c[0], c[1]]).collect() })
}
