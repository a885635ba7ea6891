//! The unified skeleton as Python reads it.

use std::collections::BTreeMap;

use numpy::PyArray2;
use oncue::glam::Vec3;
use oncue::library::{RestBone, map_rest_skeleton};
use oncue::motion::skeleton::{
    ANKLE_HEIGHT, BODY_BOXES, HEEL_LENGTH, JOINT_OFFSET, Limb, NAMES, PARENT, REST_HIPS_HEIGHT, TOE_HEIGHT,
    TOE_LENGTH,
};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::error::InputError;
use crate::job;

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

/// Which bones of a rig at rest are which joints of the unified skeleton.
#[pyfunction]
#[pyo3(signature = (names, parents, heads, tails, mapping = BTreeMap::new()))]
pub fn map_rig<'py>(
    py: Python<'py>,
    names: Vec<String>,
    parents: Vec<i64>,
    heads: Vec<[f32; 3]>,
    tails: Vec<[f32; 3]>,
    mapping: BTreeMap<String, String>,
) -> PyResult<Bound<'py, PyDict>> {
    let count = names.len();
    if [parents.len(), heads.len(), tails.len()].iter().any(|&len| len != count) {
        return Err(InputError::new_err(
            "names, parents, heads and tails must have one entry for each bone.",
        ));
    }
    let bones: Vec<RestBone> = names
        .iter()
        .zip(parents)
        .zip(heads.into_iter().zip(tails))
        .map(|((name, parent), (head, tail))| RestBone {
            name: name.clone(),
            parent: usize::try_from(parent).ok(),
            head: Vec3::from_array(head),
            tail: Vec3::from_array(tail),
        })
        .collect();
    let found = job::run(py, || map_rest_skeleton(&bones, &mapping))?;
    let joints = PyDict::new(py);
    for (joint, bone) in NAMES.iter().zip(found.bones) {
        if let Some(bone) = bone {
            joints.set_item(joint, &names[bone])?;
        }
    }
    let out = PyDict::new(py);
    out.set_item("joints", joints)?;
    out.set_item("spine", found.spine.iter().map(|&bone| names[bone].as_str()).collect::<Vec<_>>())?;
    out.set_item("shape_percent", found.shape_percent)?;
    out.set_item("note", found.note)?;
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
