//! The main job as Python starts it, and the motion it gives.

use std::time::Instant;

use numpy::{PyArray2, PyArray3};
use oncue::editor::shipped_manifold;
use oncue::motion::FRAME_RATE;
use oncue::{ActionType, Around, Measured, Moments, Performance, Settings, Task};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::error::to_python;
use crate::job::Job;
use crate::json;
use crate::library::Library;
use crate::manifold::Manifold;
use crate::motion::{MotionArrays, from_arrays, to_arrays};
use crate::policy::Policy;
use crate::scene::{MovingObject, SceneIndex, built};

/// A motion and its report.
#[pyclass(frozen, get_all, module = "oncue_core")]
pub struct Synthesis {
    /// p_root: float32 (frames, 3), world, metres.
    root_positions: Py<PyArray2<f32>>,
    /// float32 (frames, 22, 4), w first; [:, 0] in the world, the others relative to their parent.
    rotations: Py<PyArray3<f32>>,
    /// float32 (frames, 2), left and right foot: 0 in the air, 0.5 near the floor, 1 planted.
    contacts: Py<PyArray2<f32>>,
    /// Frames a second.
    frame_rate: f32,
    /// What the run tells about itself; docs/report.md describes it.
    report: Py<PyAny>,
    /// The policy that played it, for the next task in the scene.
    policy: Py<Policy>,
}

impl Synthesis {
    fn new(py: Python<'_>, synthesis: oncue::Synthesis) -> PyResult<Self> {
        let MotionArrays { root_positions, rotations, contacts } = to_arrays(py, &synthesis.motion)?;
        Ok(Self {
            root_positions,
            rotations,
            contacts,
            frame_rate: FRAME_RATE,
            report: json::to_python(py, &synthesis.report)?.unbind(),
            policy: Py::new(py, Policy::new(synthesis.policy))?,
        })
    }
}

/// Synthesizes the motion of a task; the same seed and policy give the same motion on any number of cores.
#[pyfunction]
#[pyo3(signature = (scene, library, task, settings=None, seed=0, policy=None, manifold=None, stays=None))]
#[allow(clippy::too_many_arguments)] // Python's face: all but three have names and defaults there.
pub fn synthesize(
    scene: &SceneIndex,
    library: &Library,
    task: &Bound<'_, PyDict>,
    settings: Option<&Bound<'_, PyDict>>,
    seed: u64,
    policy: Option<&Policy>,
    manifold: Option<&Manifold>,
    stays: Option<&SceneIndex>,
) -> PyResult<Job> {
    let task: Task = json::from_dict("task", task)?;
    let settings: Settings = json::from_optional_dict("settings", settings)?;
    let policy = policy.map(|p| p.inner.clone());
    let manifold = manifold.map(|m| m.inner.clone());
    let scene = scene.inner.clone();
    let stays = stays.map(|s| s.inner.clone());
    let (library, database) = library.database();
    Job::start(
        move |progress| {
            let begun = Instant::now();
            let database = database.get(&library, &settings.synthesizer.weights, progress)?;
            let prepared = begun.elapsed().as_secs_f32();
            let manifold = manifold.as_deref().or_else(|| shipped_manifold());
            let policy = policy.as_deref();
            let mut done = oncue::synthesize_along(
                manifold,
                &scene,
                stays.as_deref(),
                &database,
                &task,
                policy,
                &settings,
                seed,
                progress,
            )?;
            done.report.seconds.insert("prepare".to_owned(), prepared);
            Ok(done)
        },
        |py, synthesis| Ok(Py::new(py, Synthesis::new(py, synthesis)?)?.into_any()),
    )
}

/// What a report tells of a motion's looks, of any motion for the task.
#[pyfunction]
#[pyo3(signature = (root_positions, rotations, contacts, task, complete, action_from=None, scene=None, settings=None, moving=vec![], wait=0, library=None))]
#[allow(clippy::too_many_arguments)] // Python's face: the last six have names and defaults there.
pub fn measure_motion(
    root_positions: &Bound<'_, PyAny>,
    rotations: &Bound<'_, PyAny>,
    contacts: &Bound<'_, PyAny>,
    task: &Bound<'_, PyDict>,
    complete: usize,
    action_from: Option<usize>,
    scene: Option<&SceneIndex>,
    settings: Option<&Bound<'_, PyDict>>,
    moving: Vec<Py<MovingObject>>,
    wait: usize,
    library: Option<&Library>,
) -> PyResult<Job> {
    let motion = from_arrays(root_positions, rotations, contacts)?;
    let task: Task = json::from_dict("task", task)?;
    let moments = Moments { stood_at: None, action_from, complete };
    measuring(scene, settings, moving, library, wait, move |around, settings| {
        oncue::measure(&motion, around, &task, &moments, settings)
    })
}

/// The same of any motion for a performance.
#[pyfunction]
#[pyo3(signature = (root_positions, rotations, contacts, performance, moments, scene=None, settings=None, moving=vec![], wait=0, library=None))]
#[allow(clippy::too_many_arguments)] // Python's face: the last five have names and defaults there.
pub fn measure_performance(
    root_positions: &Bound<'_, PyAny>,
    rotations: &Bound<'_, PyAny>,
    contacts: &Bound<'_, PyAny>,
    performance: &Bound<'_, PyDict>,
    moments: Vec<Bound<'_, PyDict>>,
    scene: Option<&SceneIndex>,
    settings: Option<&Bound<'_, PyDict>>,
    moving: Vec<Py<MovingObject>>,
    wait: usize,
    library: Option<&Library>,
) -> PyResult<Job> {
    let motion = from_arrays(root_positions, rotations, contacts)?;
    let performance: Performance = json::from_dict("performance", performance)?;
    let moments: Vec<Moments> =
        moments.iter().map(|m| json::from_dict("moments", m)).collect::<PyResult<_>>()?;
    measuring(scene, settings, moving, library, wait, move |around, settings| {
        oncue::measure_performance(&motion, around, &performance, &moments, settings)
    })
}

/// A job that measures in what is given.
fn measuring(
    scene: Option<&SceneIndex>,
    settings: Option<&Bound<'_, PyDict>>,
    moving: Vec<Py<MovingObject>>,
    library: Option<&Library>,
    wait: usize,
    measure: impl FnOnce(&Around, &Settings) -> Measured + Send + 'static,
) -> PyResult<Job> {
    let settings: Settings = json::from_optional_dict("settings", settings)?;
    let scene = scene.map(|s| s.inner.clone());
    let library = library.map(Library::database);
    Job::start(
        move |progress| {
            settings.validate()?;
            let database = library
                .map(|(library, database)| database.get(&library, &settings.synthesizer.weights, progress))
                .transpose()?;
            progress.stage("Measuring");
            let moving = built(&moving, progress)?;
            let around = Around {
                scene: scene.as_deref(),
                moving: &moving,
                leaves: &[],
                wait,
                database: database.as_deref(),
            };
            Ok(measure(&around, &settings))
        },
        |py, measured| Ok(json::to_python(py, &measured)?.unbind()),
    )
}

/// The settings of a preset, as `synthesize` takes them.
#[pyfunction]
#[pyo3(signature = (preset="default"))]
pub fn default_settings<'py>(py: Python<'py>, preset: &str) -> PyResult<Bound<'py, PyAny>> {
    let settings = Settings::preset(preset).map_err(|error| to_python(error.into()))?;
    json::to_python(py, &settings)
}

/// The action types that a cue may ask for.
#[pyfunction]
pub fn cue_types(py: Python<'_>) -> PyResult<Bound<'_, PyAny>> {
    json::to_python(py, &ActionType::of_cues().collect::<Vec<_>>())
}

/// Names of the presets.
#[pyfunction]
pub fn presets() -> Vec<&'static str> {
    Settings::PRESETS.to_vec()
}
