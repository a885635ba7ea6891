//! Policies as Python handles them: kept, optimized for several cues, tested.

use std::path::PathBuf;
use std::sync::Arc;

use oncue::controller::{
    Environment, PolicyOrigin, RobustnessSettings, StoredPolicy, optimize_policy as optimize,
    robustness as play_everywhere,
};
use oncue::{Error, Settings, Task};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::job::{self, Job};
use crate::json;
use crate::library::Library;
use crate::scene::SceneIndex;

/// An action controller that was optimized before. Immutable.
#[pyclass(frozen, module = "oncue_core")]
pub struct Policy {
    pub inner: Arc<StoredPolicy>,
}

impl Policy {
    pub fn new(policy: StoredPolicy) -> Self {
        Self { inner: Arc::new(policy) }
    }
}

#[pymethods]
impl Policy {
    /// The policy that ships with Oncue.
    #[staticmethod]
    fn prior(py: Python<'_>) -> PyResult<Self> {
        job::run(py, || StoredPolicy::prior().cloned()).map(Self::new)
    }

    /// Reads a policy file.
    #[staticmethod]
    fn read(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        job::run(py, || StoredPolicy::read(&path)).map(Self::new)
    }

    /// Writes the policy file; an earlier one stays as it was until the new one is whole.
    fn write(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        job::run(py, || self.inner.write(&path))
    }

    /// Whether it was optimized in this scene with the library of this checksum.
    fn belongs_to(&self, scene: &SceneIndex, library_checksum: &str) -> bool {
        self.inner.belongs_to(scene.inner.fingerprint(), library_checksum)
    }

    /// What it was optimized for: scene, library, cues, generalized, updates, environment_steps, success_rate.
    #[getter]
    fn origin<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::to_python(py, &self.inner.origin)
    }
}

/// Optimizes one policy for the cues of `tasks`, from `policy` if given; with `generalized` from starts all over the
/// floor, else from the tasks' own. Gives the policy and the learning curve.
#[pyfunction]
#[pyo3(signature = (scene, library, tasks, settings=None, seed=0, policy=None, generalized=true))]
pub fn optimize_policy(
    scene: &SceneIndex,
    library: &Library,
    tasks: Vec<Bound<'_, PyDict>>,
    settings: Option<&Bound<'_, PyDict>>,
    seed: u64,
    policy: Option<&Policy>,
    generalized: bool,
) -> PyResult<Job> {
    let tasks: Vec<Task> = tasks.iter().map(|task| json::from_dict("task", task)).collect::<PyResult<_>>()?;
    let mut settings: Settings = json::from_optional_dict("settings", settings)?;
    if generalized {
        settings.ppo.vary_start = 1.0;
    }
    let start = policy.map(|p| p.inner.clone());
    let scene = scene.inner.clone();
    let (library, database) = library.database();
    Job::start(
        move |progress| {
            let database = database.get(&library, &settings.synthesizer.weights, progress)?;
            let environments: Vec<Environment> = tasks
                .iter()
                .map(|task| Environment::new(&scene, &database, task, &settings))
                .collect::<oncue::Result<_>>()?;
            progress.stage("Optimizing");
            let begin = start.as_ref().filter(|p| p.fits(&settings));
            let optimized = optimize(&environments, begin.map(|p| p.policy.clone()), seed, progress)?;
            let before = begin.map(|p| p.origin.clone()).unwrap_or_default();
            let origin = PolicyOrigin {
                scene: scene.fingerprint().to_owned(),
                library: database.library_checksum.clone(),
                cues: tasks.iter().map(|task| task.cue.clone()).collect(),
                request: String::new(),
                generalized,
                updates: before.updates + optimized.curve.len(),
                environment_steps: before.environment_steps + optimized.environment_steps,
                success_rate: optimized
                    .curve
                    .last()
                    .and_then(|last| last.success_rate.or(last.success_rate_anywhere))
                    .unwrap_or(0.0),
            };
            Ok((StoredPolicy::new(optimized.policy, &settings, origin), optimized.curve))
        },
        |py, (policy, curve)| {
            let policy = Py::new(py, Policy::new(policy))?;
            Ok((policy, json::to_python(py, &curve)?).into_pyobject(py)?.into_any().unbind())
        },
    )
}

/// The paper's robustness test: plays the policy towards the task's cue from a grid of starts over the whole floor.
#[pyfunction]
#[pyo3(signature = (scene, library, policy, task, settings=None, test=None, seed=0))]
pub fn robustness(
    scene: &SceneIndex,
    library: &Library,
    policy: &Policy,
    task: &Bound<'_, PyDict>,
    settings: Option<&Bound<'_, PyDict>>,
    test: Option<&Bound<'_, PyDict>>,
    seed: u64,
) -> PyResult<Job> {
    let task: Task = json::from_dict("task", task)?;
    let settings: Settings = json::from_optional_dict("settings", settings)?;
    let layout: RobustnessSettings = json::from_optional_dict("test", test)?;
    let policy = policy.inner.clone();
    let scene = scene.inner.clone();
    let (library, database) = library.database();
    Job::start(
        move |progress| {
            let database = database.get(&library, &settings.synthesizer.weights, progress)?;
            let environment = Environment::new(&scene, &database, &task, &settings)?;
            if !policy.fits(&settings) {
                return Err(Error::input("The policy was optimized with other settings of state or signal."));
            }
            progress.stage("Playing the policy from everywhere");
            play_everywhere(&environment, &policy.policy, &layout, seed, progress)
        },
        |py, figures| Ok(json::to_python(py, &figures)?.unbind()),
    )
}
