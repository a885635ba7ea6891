//! The scene W as Python hands it over: arrays of positions and triangles.

use std::sync::Arc;

use glam::Vec3;
use ndarray::Ix2;
use oncue::Task;
use oncue::scene::{SceneSettings, check_task as check};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::array;
use crate::job::{self, Job};
use crate::json;

/// A scene's triangles, indexed for collision and for finding ways. Immutable.
#[pyclass(frozen, module = "oncue_core")]
pub struct SceneIndex {
    pub inner: Arc<oncue::scene::SceneIndex>,
}

#[pymethods]
impl SceneIndex {
    /// Triangles that have an area.
    #[getter]
    fn triangle_count(&self) -> usize {
        self.inner.triangle_count()
    }

    /// Smallest and largest corner, world, metres.
    #[getter]
    fn bounds(&self) -> ((f32, f32, f32), (f32, f32, f32)) {
        let (low, high) = self.inner.bounds();
        (low.into(), high.into())
    }

    /// BLAKE3 of the triangles, hexadecimal: changes when anything in the scene moves.
    #[getter]
    fn fingerprint(&self) -> &str {
        self.inner.fingerprint()
    }

    /// World z of the level that is walked on, metres: the dominant one, or that of the task's start.
    #[getter]
    fn floor_height(&self) -> f32 {
        self.inner.floor_height()
    }
}

/// Indexes the scene of `positions` float32 (n, 3), world, metres, Z up, and `triangles` uint32 (m, 3); with a task, on the
/// level that carries its start.
#[pyfunction]
#[pyo3(signature = (positions, triangles, settings=None, task=None))]
pub fn index_scene(
    positions: &Bound<'_, PyAny>,
    triangles: &Bound<'_, PyAny>,
    settings: Option<&Bound<'_, PyDict>>,
    task: Option<&Bound<'_, PyDict>>,
) -> PyResult<Job> {
    let positions = array::<f32, Ix2>("positions", positions, &[None, Some(3)])?;
    let positions: Vec<Vec3> = positions.rows().into_iter().map(|p| Vec3::new(p[0], p[1], p[2])).collect();
    let triangles = array::<u32, Ix2>("triangles", triangles, &[None, Some(3)])?;
    let triangles: Vec<[u32; 3]> = triangles.rows().into_iter().map(|t| [t[0], t[1], t[2]]).collect();
    let settings: SceneSettings = json::from_optional_dict("scene settings", settings)?;
    let task: Option<Task> = task.map(|task| json::from_dict("task", task)).transpose()?;
    Job::start(
        move |progress| {
            oncue::scene::SceneIndex::build_for(&positions, &triangles, &settings, task.as_ref(), progress)
        },
        |py, scene| Ok(Py::new(py, SceneIndex { inner: Arc::new(scene) })?.into_any()),
    )
}

/// Returns where the person can get from the task's start to its cue and do there what it asks; raises InputError with
/// the reason otherwise. `synthesize` asks the same first.
#[pyfunction]
pub fn check_task(py: Python<'_>, scene: &SceneIndex, task: &Bound<'_, PyDict>) -> PyResult<()> {
    let task: Task = json::from_dict("task", task)?;
    job::run(py, || check(&scene.inner, &task))
}
