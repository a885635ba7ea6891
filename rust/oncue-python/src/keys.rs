//! Few keys for curves of bones: arrays in, the keys of each bone out.

use ndarray::{Array2, Array3, Ix2, Ix3};
use numpy::{IntoPyArray, PyArray1, PyArray2};
use oncue::glam::{DQuat, DVec3};
use oncue::keys::{BoneKeys, Bones, Kept, Limb, Limits, Poses, Tolerance, fit_keys as fit};
use pyo3::prelude::*;

use crate::arrays::array;
use crate::job;

/// The frames of a bone's keys, their values, and the slopes before and after them.
type Keys = (Py<PyArray1<i64>>, Py<PyArray2<f64>>, Py<PyArray2<f64>>, Py<PyArray2<f64>>);

/// Fits few keys of Bézier curves to the channels of bones: those of each bone where its curves do not stay.
#[pyfunction]
#[pyo3(signature = (
    parents, offsets, rests, limbs, tolerances, planted, drift, locations, rotations,
    played_locations=None, played_rotations=None, stays=None
))]
#[allow(clippy::too_many_arguments)] // Python's face: arrays that belong together have names there.
pub fn fit_keys(
    py: Python<'_>,
    parents: Vec<i64>,
    offsets: &Bound<'_, PyAny>,
    rests: &Bound<'_, PyAny>,
    limbs: Vec<(Vec<usize>, Vec<usize>)>,
    tolerances: &Bound<'_, PyAny>,
    planted: &Bound<'_, PyAny>,
    drift: f64,
    locations: &Bound<'_, PyAny>,
    rotations: &Bound<'_, PyAny>,
    played_locations: Option<&Bound<'_, PyAny>>,
    played_rotations: Option<&Bound<'_, PyAny>>,
    stays: Option<&Bound<'_, PyAny>>,
) -> PyResult<Vec<Keys>> {
    let count = parents.len();
    let motion = poses("locations", locations, "rotations", rotations, count)?;
    let frames = motion.locations.len();
    let offsets = places("offsets", offsets, count)?;
    let rests = array::<f64, Ix2>("rests", rests, &[Some(count), Some(4)])?;
    let rests = rests.rows().into_iter().map(|q| DQuat::from_xyzw(q[1], q[2], q[3], q[0])).collect();
    let tolerances = array::<f64, Ix2>("tolerances", tolerances, &[Some(count), Some(2)])?;
    let tolerances = tolerances.rows().into_iter().map(|t| Tolerance { place: t[0], turn: t[1] }).collect();
    let planted: Array2<bool> = array("planted", planted, &[Some(frames), Some(count)])?;
    let kept = match (played_locations, played_rotations, stays) {
        (Some(locations), Some(rotations), Some(stays)) => {
            let played = poses("played_locations", locations, "played_rotations", rotations, count)?;
            let stays: Array2<bool> = array("stays", stays, &[Some(frames), Some(count)])?;
            Some(Kept { played, stays: stays.into_iter().collect() })
        }
        _ => None,
    };
    let limits = Limits { tolerances, planted: planted.into_iter().collect(), drift };
    let limbs: Vec<Limb> = limbs.into_iter().map(|(bones, keyed)| Limb { bones, keyed }).collect();
    let parents = parents.iter().map(|&parent| usize::try_from(parent).ok()).collect();
    let fitted =
        job::run(py, || fit(&Bones::new(parents, offsets, rests)?, &limbs, &limits, &motion, kept.as_ref()))?;
    fitted.into_iter().map(|keys| give(py, keys)).collect()
}

fn places(name: &str, given: &Bound<'_, PyAny>, count: usize) -> PyResult<Vec<DVec3>> {
    let given = array::<f64, Ix2>(name, given, &[Some(count), Some(3)])?;
    Ok(given.rows().into_iter().map(|p| DVec3::new(p[0], p[1], p[2])).collect())
}

fn poses(
    places_name: &str,
    locations: &Bound<'_, PyAny>,
    turns_name: &str,
    rotations: &Bound<'_, PyAny>,
    count: usize,
) -> PyResult<Poses> {
    let rotations: Array3<f64> = array::<f64, Ix3>(turns_name, rotations, &[None, Some(count), Some(4)])?;
    let locations = places(places_name, locations, rotations.shape()[0])?;
    let rotations = rotations.rows().into_iter().map(|q| DQuat::from_xyzw(q[1], q[2], q[3], q[0])).collect();
    Ok(Poses { locations, rotations })
}

fn give(py: Python<'_>, keys: BoneKeys) -> PyResult<Keys> {
    let count = keys.frames.len();
    let width = keys.values.len().checked_div(count).unwrap_or(0);
    let rows = |values: Vec<f64>| -> PyResult<Py<PyArray2<f64>>> {
        let rows = Array2::from_shape_vec((count, width), values);
        let rows = rows.map_err(|error| pyo3::exceptions::PyValueError::new_err(error.to_string()))?;
        Ok(rows.into_pyarray(py).unbind())
    };
    let frames: Vec<i64> = keys.frames.iter().map(|&frame| frame as i64).collect();
    Ok((frames.into_pyarray(py).unbind(), rows(keys.values)?, rows(keys.before)?, rows(keys.after)?))
}
