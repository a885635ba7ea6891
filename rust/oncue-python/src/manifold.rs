//! Motion manifolds as Python handles them: trained, read, written.

use std::path::PathBuf;
use std::sync::Arc;

use oncue::manifold::{ManifoldSettings, train_manifold as train};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::job::{self, Job};
use crate::json;
use crate::library::Library;

/// Ψ and Ψ⁻¹: the autoencoder that motions are edited in. Immutable.
#[pyclass(frozen, module = "oncue_core")]
pub struct Manifold {
    pub inner: Arc<oncue::manifold::Manifold>,
}

impl Manifold {
    fn new(manifold: oncue::manifold::Manifold) -> Self {
        Self { inner: Arc::new(manifold) }
    }
}

#[pymethods]
impl Manifold {
    /// The manifold that ships with Oncue.
    #[staticmethod]
    fn shipped(py: Python<'_>) -> PyResult<Self> {
        job::run(py, || oncue::manifold::Manifold::shipped().cloned()).map(Self::new)
    }

    /// Reads a manifold's file.
    #[staticmethod]
    fn read(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        job::run(py, || oncue::manifold::Manifold::read(&path)).map(Self::new)
    }

    /// Writes the manifold's file; an earlier one stays as it was until the new one is whole.
    fn write(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        job::run(py, || self.inner.write(&path))
    }

    /// Channels of each layer's output.
    #[getter]
    fn channels(&self) -> usize {
        self.inner.channels()
    }

    /// How it was trained, and its errors on clips that it was not trained on.
    #[getter]
    fn figures<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::to_python(py, &self.inner.report)
    }
}

/// Trains a manifold on a library's clips; the same seed gives the same manifold on any number of cores.
#[pyfunction]
#[pyo3(signature = (library, settings=None, seed=0, checkpoint=None))]
pub fn train_manifold(
    library: &Library,
    settings: Option<&Bound<'_, PyDict>>,
    seed: u64,
    checkpoint: Option<PathBuf>,
) -> PyResult<Job> {
    let settings: ManifoldSettings = json::from_optional_dict("manifold settings", settings)?;
    let library = library.inner.clone();
    Job::start(
        move |progress| train(&library, &settings, seed, checkpoint.as_deref(), progress),
        |py, manifold| Ok(Py::new(py, Manifold::new(manifold))?.into_any()),
    )
}
