//! Editing a motion: constraints, keys and hands' cues in, the edited arrays and what is left out.

use numpy::{PyArray2, PyArray3};
use oncue::editor::manipulation::{ManipulationFigures, manipulate};
use oncue::editor::{Constraint, EditFigures, Key, Wishes, edit_motion as edit, shipped_manifold};
use oncue::motion::FRAME_RATE;
use oncue::{ManipulationCue, Motion, Settings};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::job::Job;
use crate::json;
use crate::manifold::Manifold;
use crate::motion::{MotionArrays, from_arrays, to_arrays};
use crate::scene::SceneIndex;

/// An edited motion, and how its constraints were met.
#[pyclass(frozen, get_all, module = "oncue_core")]
pub struct EditedMotion {
    /// p_root: float32 (frames, 3), world, metres.
    root_positions: Py<PyArray2<f32>>,
    /// float32 (frames, 22, 4), w first; [:, 0] in the world, the others relative to their parent.
    rotations: Py<PyArray3<f32>>,
    /// float32 (frames, 2), left and right foot: 0 in the air, 0.5 near the floor, 1 planted.
    contacts: Py<PyArray2<f32>>,
    /// Frames a second.
    frame_rate: f32,
    /// What is left of each constraint, the frames that may have changed, and where the hands' paths came to lie.
    figures: Py<PyAny>,
}

#[derive(Serialize)]
struct Figures {
    #[serde(flatten)]
    edit: EditFigures,
    manipulations: Vec<ManipulationFigures>,
}

/// Edits a motion so that it meets constraints, keys and hands' cues, along the manifold and outside it to the bit as it was.
#[pyfunction]
#[pyo3(signature = (
    root_positions, rotations, contacts, constraints=Vec::new(), keys=Vec::new(), manipulations=Vec::new(),
    scene=None, floor=0.0, settings=None, manifold=None
))]
#[allow(clippy::too_many_arguments)] // Python's face: all but three have names and defaults there.
pub fn edit_motion(
    root_positions: &Bound<'_, PyAny>,
    rotations: &Bound<'_, PyAny>,
    contacts: &Bound<'_, PyAny>,
    constraints: Vec<Bound<'_, PyDict>>,
    keys: Vec<Bound<'_, PyDict>>,
    manipulations: Vec<Bound<'_, PyDict>>,
    scene: Option<&SceneIndex>,
    floor: f32,
    settings: Option<&Bound<'_, PyDict>>,
    manifold: Option<&Manifold>,
) -> PyResult<Job> {
    let motion = from_arrays(root_positions, rotations, contacts)?;
    let constraints: Vec<Constraint> = from_dicts("constraint", &constraints)?;
    let keys: Vec<Key> = from_dicts("key", &keys)?;
    let manipulations: Vec<ManipulationCue> = from_dicts("manipulation", &manipulations)?;
    let settings: Settings = json::from_optional_dict("settings", settings)?;
    let scene = scene.map(|s| s.inner.clone());
    let manifold = manifold.map(|m| m.inner.clone());
    Job::start(
        move |progress| {
            let manifold = manifold.as_deref().or_else(|| shipped_manifold());
            let scene = scene.as_deref();
            let mut figures = Figures { edit: EditFigures::default(), manipulations: Vec::new() };
            let mut edited: Motion = motion;
            if !manipulations.is_empty() {
                let done =
                    manipulate(manifold, &edited, &manipulations, scene, floor, &settings.editor, progress)?;
                (edited, figures.edit, figures.manipulations) = (done.motion, done.figures, done.cues);
            }
            if manipulations.is_empty() || !(constraints.is_empty() && keys.is_empty()) {
                let wishes = Wishes { constraints: &constraints, keys: &keys, scene, floor };
                let done = edit(&edited, &wishes, manifold, &settings.editor, progress)?;
                edited = done.motion;
                figures.edit.join(done.figures);
            }
            Ok((edited, figures))
        },
        |py, (motion, figures)| {
            let MotionArrays { root_positions, rotations, contacts } = to_arrays(py, &motion)?;
            let figures = json::to_python(py, &figures)?.unbind();
            let edited =
                EditedMotion { root_positions, rotations, contacts, frame_rate: FRAME_RATE, figures };
            Ok(Py::new(py, edited)?.into_any())
        },
    )
}

fn from_dicts<T: DeserializeOwned>(what: &str, dicts: &[Bound<'_, PyDict>]) -> PyResult<Vec<T>> {
    dicts.iter().map(|dict| json::from_dict(what, dict)).collect()
}
