//! A performance of several cues as Python starts it, and the motion it gives.

use std::sync::Arc;

use ndarray::Array2;
use numpy::{IntoPyArray, PyArray2, PyArray3};
use oncue::editor::shipped_manifold;
use oncue::motion::FRAME_RATE;
use oncue::{CarriedThing, Performance, Settings};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::error::to_python;
use crate::job::Job;
use crate::json;
use crate::library::Library;
use crate::manifold::Manifold;
use crate::motion::{MotionArrays, to_arrays};
use crate::policy::Policy;
use crate::scene::SceneIndex;

/// A performance as it was made.
#[pyclass(frozen, module = "oncue_core")]
pub struct Performed {
    /// p_root: float32 (frames, 3), world, metres.
    #[pyo3(get)]
    root_positions: Py<PyArray2<f32>>,
    /// float32 (frames, 22, 4), w first; [:, 0] in the world, the others relative to their parent.
    #[pyo3(get)]
    rotations: Py<PyArray3<f32>>,
    /// float32 (frames, 2), left and right foot: 0 in the air, 0.5 near the floor, 1 planted.
    #[pyo3(get)]
    contacts: Py<PyArray2<f32>>,
    /// Frames a second.
    #[pyo3(get)]
    frame_rate: f32,
    /// What the run tells about itself; docs/report.md describes it.
    #[pyo3(get)]
    report: Py<PyAny>,
    /// The things that were taken: for each a dict of its `name`, the `first_frame` on which it was, and from there until it stands
    /// again, or the motion ends, `positions` of its origin, float32 (n, 3), world, metres, and `rotations`, float32 (n, 4), w first.
    #[pyo3(get)]
    things: Py<PyList>,
    inner: Arc<oncue::Performed>,
}

impl Performed {
    fn new(py: Python<'_>, performed: oncue::Performed) -> PyResult<Self> {
        let MotionArrays { root_positions, rotations, contacts } = to_arrays(py, &performed.motion)?;
        let report = json::to_python(py, &performed.report)?.unbind();
        let things = PyList::empty(py);
        for thing in &performed.carried {
            things.append(carried(py, thing)?)?;
        }
        let (things, inner) = (things.unbind(), Arc::new(performed));
        Ok(Self { root_positions, rotations, contacts, frame_rate: FRAME_RATE, report, things, inner })
    }
}

fn carried<'py>(py: Python<'py>, thing: &CarriedThing) -> PyResult<Bound<'py, PyDict>> {
    let frames = thing.positions.len();
    let positions = Array2::from_shape_fn((frames, 3), |(f, axis)| thing.positions[f][axis]);
    let rotations = Array2::from_shape_fn((frames, 4), |(f, part)| {
        let q = thing.rotations[f];
        [q.w, q.x, q.y, q.z][part]
    });
    let told = PyDict::new(py);
    told.set_item("name", &thing.name)?;
    told.set_item("first_frame", thing.first_frame)?;
    told.set_item("positions", positions.into_pyarray(py))?;
    told.set_item("rotations", rotations.into_pyarray(py))?;
    Ok(told)
}

/// Plays a performance: cues that one person meets one after the other.
#[pyfunction]
#[pyo3(signature = (scene, library, performance, settings=None, seed=0, policy=None, manifold=None, earlier=None))]
#[allow(clippy::too_many_arguments)] // Python's face: all but three have names and defaults there.
pub fn perform(
    scene: &SceneIndex,
    library: &Library,
    performance: &Bound<'_, PyDict>,
    settings: Option<&Bound<'_, PyDict>>,
    seed: u64,
    policy: Option<&Policy>,
    manifold: Option<&Manifold>,
    earlier: Option<&Performed>,
) -> PyResult<Job> {
    let performance: Performance = json::from_dict("performance", performance)?;
    let settings: Settings = json::from_optional_dict("settings", settings)?;
    let policy = policy.map(|p| p.inner.clone());
    let manifold = manifold.map(|m| m.inner.clone());
    let earlier = earlier.map(|e| e.inner.clone());
    let scene = scene.inner.clone();
    let (library, database) = library.database();
    Job::start(
        move |progress| {
            let database = database.get(&library, &settings.synthesizer.weights, progress)?;
            let manifold = manifold.as_deref().or_else(|| shipped_manifold());
            let (earlier, policy) = (earlier.as_deref(), policy.as_deref());
            oncue::perform(
                manifold,
                &scene,
                &database,
                &performance,
                earlier,
                policy,
                &settings,
                seed,
                progress,
            )
        },
        |py, performed| Ok(Py::new(py, Performed::new(py, performed)?)?.into_any()),
    )
}

/// Plays the performances of several people in one shot.
#[pyfunction]
#[pyo3(signature = (scene, library, performances, settings=None, seed=0, policy=None, manifold=None, earlier=vec![]))]
#[allow(clippy::too_many_arguments)] // Python's face: all but three have names and defaults there.
pub fn perform_together(
    scene: &SceneIndex,
    library: &Library,
    performances: Vec<Bound<'_, PyDict>>,
    settings: Option<&Bound<'_, PyDict>>,
    seed: u64,
    policy: Option<&Policy>,
    manifold: Option<&Manifold>,
    earlier: Vec<Py<Performed>>,
) -> PyResult<Job> {
    let performances = performances_of(&performances)?;
    let settings: Settings = json::from_optional_dict("settings", settings)?;
    let policy = policy.map(|p| p.inner.clone());
    let manifold = manifold.map(|m| m.inner.clone());
    let earlier: Vec<Arc<oncue::Performed>> = earlier.iter().map(|e| e.get().inner.clone()).collect();
    let scene = scene.inner.clone();
    let (library, database) = library.database();
    Job::start(
        move |progress| {
            let database = database.get(&library, &settings.synthesizer.weights, progress)?;
            let manifold = manifold.as_deref().or_else(|| shipped_manifold());
            let earlier: Vec<&oncue::Performed> = earlier.iter().map(|e| &**e).collect();
            oncue::perform_together(
                manifold,
                &scene,
                &database,
                &performances,
                &earlier,
                policy.as_deref(),
                &settings,
                seed,
                progress,
            )
        },
        |py, people| {
            let one = |made: oncue::Result<oncue::Performed>| -> PyResult<Py<PyAny>> {
                Ok(match made {
                    Ok(performed) => Py::new(py, Performed::new(py, performed)?)?.into_any(),
                    Err(error) => to_python(error.into()).into_value(py).into_any(),
                })
            };
            let people = people.into_iter().map(one).collect::<PyResult<Vec<_>>>()?;
            Ok(PyList::new(py, people)?.into_any().unbind())
        },
    )
}

/// The performances that a list of dicts describes.
pub fn performances_of(performances: &[Bound<'_, PyDict>]) -> PyResult<Vec<Performance>> {
    performances.iter().map(|one| json::from_dict("performance", one)).collect()
}
