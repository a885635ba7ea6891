//! The unified skeleton as Python reads it.

use numpy::PyArray2;
use oncue::motion::skeleton::{
    ANKLE_HEIGHT, BODY_BOXES, HEEL_LENGTH, JOINT_OFFSET, Limb, NAMES, PARENT, REST_HIPS_HEIGHT, TOE_HEIGHT,
    TOE_LENGTH,
};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

/// The unified skeleton: joints, offsets from the parent and box nodes; metres, rest pose facing -Y.
#[pyfunction]
pub fn skeleton(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
    let out = PyDict::new(py);
    out.set_item("names", NAMES.to_vec())?;
    let parents: Vec<i64> = PARENT.iter().map(|&p| i64::try_from(p).unwrap_or(-1)).collect();
    out.set_item("parents", parents)?;
    let offsets: Vec<Vec<f32>> = JOINT_OFFSET.iter().map(|o| o.to_array().to_vec()).collect();
    out.set_item("joint_offsets", PyArray2::from_vec2(py, &offsets)?)?;
    let boxes = PyList::empty(py);
    for node in BODY_BOXES {
        let entry = PyDict::new(py);
        entry.set_item("limb", limb_name(node.limb))?;
        entry.set_item("joint", node.joint.name())?;
        entry.set_item("center", <(f32, f32, f32)>::from(node.center))?;
        entry.set_item("half_extents", <(f32, f32, f32)>::from(node.half_extents))?;
        boxes.append(entry)?;
    }
    out.set_item("boxes", boxes)?;
    out.set_item("rest_hips_height", REST_HIPS_HEIGHT)?;
    out.set_item("ankle_height", ANKLE_HEIGHT)?;
    out.set_item("toe_height", TOE_HEIGHT)?;
    out.set_item("toe_length", TOE_LENGTH)?;
    out.set_item("heel_length", HEEL_LENGTH)?;
    Ok(out)
}

fn limb_name(limb: Limb) -> &'static str {
    match limb {
        Limb::Leg => "leg",
        Limb::Arm => "arm",
        Limb::Foot => "foot",
        Limb::Torso => "torso",
        Limb::Head => "head",
    }
}
