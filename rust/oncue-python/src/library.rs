//! Motion libraries as Python handles them: built, read, joined, written.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use numpy::{PyArray1, PyArrayMethods};
use oncue::MotionDatabase;
use oncue::library::FeatureWeights;
use oncue::library::{LibrarySettings, Source, build, starter};
use oncue::{MotionLibrary, Progress};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::error::InputError;
use crate::job::{self, Job};
use crate::json;
use crate::motion::{MotionArrays, to_arrays};

/// Clips to match against, on the unified skeleton at 30 Hz. Immutable.
#[pyclass(frozen, module = "oncue_core")]
pub struct Library {
    pub inner: Arc<MotionLibrary>,
    checksum: OnceLock<String>,
    database: Database,
}

/// The library made matchable, kept from run to run.
#[derive(Clone, Default)]
pub struct Database {
    last: Arc<Mutex<Option<Arc<MotionDatabase>>>>,
}

impl Database {
    /// The database for `weights`: the one that is there, or a new one in its place.
    pub fn get(
        &self,
        library: &MotionLibrary,
        weights: &FeatureWeights,
        progress: &Progress,
    ) -> oncue::Result<Arc<MotionDatabase>> {
        let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(database) = last.as_ref().filter(|d| d.weights == *weights) {
            return Ok(database.clone());
        }
        progress.stage("Preparing the motion library");
        let database = Arc::new(MotionDatabase::build(library, weights, progress)?);
        *last = Some(database.clone());
        Ok(database)
    }
}

impl Library {
    /// To be asked for its database on the job's thread.
    pub fn database(&self) -> (Arc<MotionLibrary>, Database) {
        (self.inner.clone(), self.database.clone())
    }

    fn new(library: MotionLibrary) -> Self {
        Self { inner: Arc::new(library), checksum: OnceLock::new(), database: Database::default() }
    }
}

#[pymethods]
impl Library {
    /// The starter library: procedural motion, made by rule; the same each time.
    #[staticmethod]
    fn starter(py: Python<'_>) -> PyResult<Self> {
        job::run(py, || starter::generate(&Progress::new())).map(Self::new)
    }

    /// Reads a library file.
    #[staticmethod]
    fn read(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        job::run(py, || MotionLibrary::read(&path)).map(Self::new)
    }

    /// Writes the library file; an earlier one stays as it was until the new one is whole.
    fn write(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        job::run(py, || self.inner.write(&path))
    }

    /// A library with this one's clips and then the other's.
    fn merged(&self, py: Python<'_>, other: &Library) -> PyResult<Self> {
        job::run(py, || {
            let mut library = MotionLibrary::clone(&self.inner);
            library.merge(MotionLibrary::clone(&other.inner));
            Ok(library)
        })
        .map(Self::new)
    }

    /// BLAKE3 of the clips, hexadecimal: the same for the same clips, wherever they are kept.
    #[getter]
    fn checksum(&self, py: Python<'_>) -> PyResult<&str> {
        job::run(py, || Ok(self.checksum.get_or_init(|| self.inner.checksum()).as_str()))
    }

    /// Frames over all clips.
    #[getter]
    fn frame_count(&self) -> usize {
        self.inner.frame_count()
    }

    /// Clips, mirrored copies included.
    #[getter]
    fn clip_count(&self) -> usize {
        self.inner.clips.len()
    }

    /// The clips' names, in their order.
    #[getter]
    fn clip_names(&self) -> Vec<&str> {
        self.inner.clips.iter().map(|clip| clip.name.as_str()).collect()
    }

    /// Clip number `clip`: its motion as a synthesis gives one, and what happens in it.
    fn clip<'py>(&self, py: Python<'py>, clip: usize) -> PyResult<Bound<'py, PyDict>> {
        let found = job::run(py, || self.inner.clip(clip))?;
        let MotionArrays { root_positions, rotations, contacts } = to_arrays(py, &found.motion)?;
        let out = PyDict::new(py);
        out.set_item("name", &found.name)?;
        out.set_item("source", json::to_python(py, &found.source)?)?;
        out.set_item("mirrored", found.mirrored)?;
        out.set_item("root_positions", root_positions)?;
        out.set_item("rotations", rotations)?;
        out.set_item("contacts", contacts)?;
        out.set_item("segments", json::to_python(py, &found.segments)?)?;
        Ok(out)
    }

    /// Writes clip number `clip` as a .bvh file; an earlier one stays as it was until the new one is whole.
    fn write_bvh(&self, py: Python<'_>, clip: usize, path: PathBuf) -> PyResult<()> {
        job::run(py, || self.inner.write_bvh(clip, &path))
    }

    /// The foot figures of the library's own walking, by the same measures as a report's.
    fn foot_figures<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let figures = job::run(py, || Ok(self.inner.foot_figures()))?;
        json::to_python(py, &figures)
    }

    /// What an eye sees first in the clips, by the same measures as a report's.
    fn body_figures<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let figures = job::run(py, || Ok(self.inner.body_figures()))?;
        json::to_python(py, &figures)
    }

    /// How people walk and sit in the clips, by the same measures as a report's; of one source alone where one is given.
    #[pyo3(signature = (source=None))]
    fn style_figures<'py>(&self, py: Python<'py>, source: Option<&str>) -> PyResult<Bound<'py, PyAny>> {
        let known = |source: &str| match source {
            "mocap" => Ok(Source::Mocap),
            "procedural" => Ok(Source::Procedural),
            other => Err(InputError::new_err(format!(
                "Clips come from \"mocap\" or are \"procedural\"; none is \"{other}\"."
            ))),
        };
        let source = source.map(known).transpose()?;
        let figures = job::run(py, || Ok(self.inner.style(source).medians()))?;
        json::to_python(py, &figures)
    }

    /// Seconds of each action, by where they come from.
    fn summary<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let summary = job::run(py, || Ok(self.inner.summary()))?;
        json::to_python(py, &summary)
    }
}

/// Practice room number `seed`: positions float32 (n, 3), triangles uint32 (m, 3), and the cues that it offers.
#[pyfunction]
pub fn practice_room(py: Python<'_>, seed: u64) -> PyResult<Bound<'_, PyAny>> {
    let room = oncue::internals::practice_room(seed);
    let positions = PyArray1::from_iter(py, room.positions.iter().flat_map(|p| p.to_array()));
    let triangles = PyArray1::from_iter(py, room.triangles.iter().flatten().copied());
    let positions = positions.reshape([room.positions.len(), 3])?;
    let triangles = triangles.reshape([room.triangles.len(), 3])?;
    Ok((positions, triangles, json::to_python(py, &room.cues)?).into_pyobject(py)?.into_any())
}

/// Builds a library from .bvh files and folders; gives it with what each file gave to it.
#[pyfunction]
#[pyo3(signature = (paths, settings=None))]
pub fn build_library(paths: Vec<PathBuf>, settings: Option<&Bound<'_, PyDict>>) -> PyResult<Job> {
    let settings: LibrarySettings = json::from_optional_dict("library settings", settings)?;
    Job::start(
        move |progress| build(&paths, &settings, progress),
        |py, built| {
            let captures = json::to_python(py, &built.captures)?;
            let library = Py::new(py, Library::new(built.library))?;
            Ok((library, captures).into_pyobject(py)?.into_any().unbind())
        },
    )
}
