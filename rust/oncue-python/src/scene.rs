//! The scene W as Python hands it over: arrays of positions and triangles.

use std::sync::Arc;

use glam::{Quat, Vec3};
use ndarray::Ix2;
use oncue::passing::{self, PassingOptions};
use oncue::perform::check_performance;
use oncue::scene::{SceneSettings, check_task as check};
use oncue::together::check_together;
use oncue::{Performance, Step, Task};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::array;
use crate::job::{self, Job};
use crate::json;
use crate::motion::from_arrays;
use crate::perform::performances_of;

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

/// Indexes the scene of `positions` float32 (n, 3), world, metres, Z up, and `triangles` uint32 (m, 3); with a task, a
/// performance or several people's, on the level that carries its start, of several people the first's.
#[pyfunction]
#[pyo3(signature = (positions, triangles, settings=None, task=None))]
pub fn index_scene(
    positions: &Bound<'_, PyAny>,
    triangles: &Bound<'_, PyAny>,
    settings: Option<&Bound<'_, PyDict>>,
    task: Option<Asked<'_>>,
) -> PyResult<Job> {
    let positions = points("positions", positions)?;
    let triangles = corners(triangles)?;
    let settings: SceneSettings = json::from_optional_dict("scene settings", settings)?;
    let places = match task {
        Some(Asked::OfOne(dict)) if dict.contains("steps")? => {
            json::from_dict::<Performance>("performance", &dict)?.places()
        }
        Some(Asked::OfOne(dict)) => json::from_dict::<Task>("task", &dict)?.places(),
        Some(Asked::OfSeveral(people)) => {
            performances_of(&people)?.iter().flat_map(Performance::places).collect()
        }
        None => Vec::new(),
    };
    Job::start(
        move |progress| {
            oncue::scene::SceneIndex::build_for(&positions, &triangles, &settings, &places, progress)
        },
        |py, scene| Ok(Py::new(py, SceneIndex { inner: Arc::new(scene) })?.into_any()),
    )
}

/// Returns where the person can get from the start of a task, or of a performance, to its cue, or from each to the next, and do
/// there what is asked, and, of several people's, where they fit together; raises InputError with the reason otherwise. `synthesize`,
/// `perform` and `perform_together` ask the same first.
#[pyfunction]
pub fn check_task(py: Python<'_>, scene: &SceneIndex, task: Asked<'_>) -> PyResult<()> {
    let task = match &task {
        Asked::OfOne(task) => task,
        Asked::OfSeveral(people) => {
            let people = performances_of(people)?;
            return job::run(py, || check_together(&scene.inner, &people));
        }
    };
    if task.contains("steps")? {
        let performance: Performance = json::from_dict("performance", task)?;
        return job::run(py, || check_performance(&scene.inner, &performance));
    }
    let task: Task = json::from_dict("task", task)?;
    job::run(py, || check(&scene.inner, &task))
}

/// The ways that people would walk by a task, a performance or several people's, and where each would fail and why; nothing is played.
#[pyfunction]
pub fn find_ways(scene: &SceneIndex, task: Asked<'_>) -> PyResult<Job> {
    let people = match task {
        Asked::OfOne(dict) if dict.contains("steps")? => vec![json::from_dict("performance", &dict)?],
        Asked::OfOne(dict) => {
            let Task { start, passes, cue, manipulations } = json::from_dict("task", &dict)?;
            let step =
                Step { passes, cue, hold_seconds: None, at_seconds: None, manipulations, things: Vec::new() };
            vec![Performance {
                start,
                steps: vec![step],
                things: Vec::new(),
                leaves: Vec::new(),
                looks: Vec::new(),
            }]
        }
        Asked::OfSeveral(people) => performances_of(&people)?,
    };
    let scene = scene.inner.clone();
    Job::start(
        move |progress| {
            progress.stage("Finding the ways");
            Ok(oncue::ways(&scene, &people))
        },
        |py, ways| Ok(json::to_python(py, &ways)?.unbind()),
    )
}

/// A task or a performance, or the performances of several people.
#[derive(FromPyObject)]
pub enum Asked<'py> {
    OfOne(Bound<'py, PyDict>),
    OfSeveral(Vec<Bound<'py, PyDict>>),
}

fn points(name: &str, points: &Bound<'_, PyAny>) -> PyResult<Vec<Vec3>> {
    let points = array::<f32, Ix2>(name, points, &[None, Some(3)])?;
    Ok(points.rows().into_iter().map(|p| Vec3::new(p[0], p[1], p[2])).collect())
}

fn corners(triangles: &Bound<'_, PyAny>) -> PyResult<Vec<[u32; 3]>> {
    let triangles = array::<u32, Ix2>("triangles", triangles, &[None, Some(3)])?;
    Ok(triangles.rows().into_iter().map(|t| [t[0], t[1], t[2]]).collect())
}

/// A rigid mesh that moves in the scene by itself. Immutable.
#[pyclass(frozen, module = "oncue_core")]
pub struct MovingObject {
    name: String,
    positions: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
    poses: Vec<(Vec3, Quat)>,
}

#[pymethods]
impl MovingObject {
    /// `positions` float32 (n, 3), world, metres, and `triangles` uint32 (m, 3) as it was read; for each frame (30 Hz) the
    /// `translations` float32 (frames, 3) and `rotations` float32 (frames, 4), w first, that take it to where it stands then.
    #[new]
    fn new(
        name: String,
        positions: &Bound<'_, PyAny>,
        triangles: &Bound<'_, PyAny>,
        translations: &Bound<'_, PyAny>,
        rotations: &Bound<'_, PyAny>,
    ) -> PyResult<Self> {
        let translations = points("translations", translations)?;
        let rotations = array::<f32, Ix2>("rotations", rotations, &[Some(translations.len()), Some(4)])?;
        let turns = rotations.rows().into_iter().map(|q| Quat::from_xyzw(q[1], q[2], q[3], q[0]));
        let poses = translations.into_iter().zip(turns).collect();
        Ok(Self { name, positions: points("positions", positions)?, triangles: corners(triangles)?, poses })
    }

    /// The name that messages have.
    #[getter]
    fn name(&self) -> &str {
        &self.name
    }
}

/// The core's own of what moves. `Input` for a mesh or poses that are none.
pub fn built(
    objects: &[Py<MovingObject>],
    progress: &oncue::Progress,
) -> oncue::Result<Vec<oncue::scene::MovingObject>> {
    objects
        .iter()
        .map(|object| {
            let MovingObject { name, positions, triangles, poses } = object.get();
            oncue::scene::MovingObject::build(name, positions, triangles, poses, progress)
        })
        .collect()
}

/// How a motion gets past what moves, each frame against where everything stands on it; with the frames that the person waits
/// at the start to do so.
#[pyfunction]
#[pyo3(signature = (root_positions, rotations, contacts, objects, floor, arms_may_touch=false, most_wait=0))]
pub fn pass_moving(
    root_positions: &Bound<'_, PyAny>,
    rotations: &Bound<'_, PyAny>,
    contacts: &Bound<'_, PyAny>,
    objects: Vec<Py<MovingObject>>,
    floor: f32,
    arms_may_touch: bool,
    most_wait: usize,
) -> PyResult<Job> {
    let motion = from_arrays(root_positions, rotations, contacts)?;
    let options = PassingOptions { floor, arms_may_touch, most_wait };
    Job::start(
        move |progress| {
            progress.stage("Looking at what moves");
            passing::pass_moving(&motion, &built(&objects, progress)?, &options, progress)
        },
        |py, passing| Ok(json::to_python(py, &passing)?.unbind()),
    )
}
