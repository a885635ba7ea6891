//! Editing a motion: constraints, keys and hands' cues in, the edited arrays and what is left out.

use numpy::{PyArray2, PyArray3};
use oncue::editor::manifold_distance;
use oncue::editor::plain_ik as solve_plainly;
use oncue::editor::{Constraint, EditFigures, Key, Wishes, edit_motion as edit, shipped_manifold};
use oncue::editor::{ManipulationFigures, lengthened, manipulate};
use oncue::editor::{Seat, SeatFigures};
use oncue::figures::{BodyFigures, body_figures};
use oncue::metrics::{FootFigures, foot_figures};
use oncue::motion::FRAME_RATE;
use oncue::motion::smoothness::{Smoothness, smoothness};
use oncue::{ActionCue, ManipulationCue, Motion, Settings};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::job::{self, Job};
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
    /// How the person sits, and sat before.
    seat: Option<SeatFigures>,
    seat_before: Option<SeatFigures>,
}

impl Figures {
    fn of(edit: EditFigures) -> Self {
        Self { edit, manipulations: Vec::new(), seat: None, seat_before: None }
    }
}

fn give(py: Python<'_>, (motion, figures): (Motion, Figures)) -> PyResult<Py<PyAny>> {
    let MotionArrays { root_positions, rotations, contacts } = to_arrays(py, &motion)?;
    let figures = json::to_python(py, &figures)?.unbind();
    let edited = EditedMotion { root_positions, rotations, contacts, frame_rate: FRAME_RATE, figures };
    Ok(Py::new(py, edited)?.into_any())
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
            let mut figures = Figures::of(EditFigures::default());
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
        give,
    )
}

/// Fits a motion that is seated from frame `complete` on to its seat.
#[pyfunction]
#[pyo3(signature = (
    root_positions, rotations, contacts, cue, complete, scene=None, floor=0.0, settings=None, manifold=None
))]
#[allow(clippy::too_many_arguments)] // Python's face: all but five have names and defaults there.
pub fn fit_seat(
    root_positions: &Bound<'_, PyAny>,
    rotations: &Bound<'_, PyAny>,
    contacts: &Bound<'_, PyAny>,
    cue: &Bound<'_, PyDict>,
    complete: usize,
    scene: Option<&SceneIndex>,
    floor: f32,
    settings: Option<&Bound<'_, PyDict>>,
    manifold: Option<&Manifold>,
) -> PyResult<Job> {
    let motion = from_arrays(root_positions, rotations, contacts)?;
    let cue: ActionCue = json::from_dict("cue", cue)?;
    let settings: Settings = json::from_optional_dict("settings", settings)?;
    let scene = scene.map(|s| s.inner.clone());
    let manifold = manifold.map(|m| m.inner.clone());
    Job::start(
        move |progress| {
            let manifold = manifold.as_deref().or_else(|| shipped_manifold());
            let (scene, settings) = (scene.as_deref(), &settings.editor);
            let seat = Seat { motion: &motion, cue: &cue, complete, scene, floor, settings };
            let fit = seat.fit(manifold, progress)?;
            let before = seat.figures(&motion, [false; 2]);
            let figures =
                Figures { seat: Some(fit.seat), seat_before: Some(before), ..Figures::of(fit.figures) };
            Ok((fit.motion, figures))
        },
        give,
    )
}

/// The ablation's baseline: a hand's path followed by arm and spine alone, frame by frame.
#[pyfunction]
#[pyo3(signature = (root_positions, rotations, contacts, manipulation, floor=0.0, settings=None))]
pub fn plain_ik(
    root_positions: &Bound<'_, PyAny>,
    rotations: &Bound<'_, PyAny>,
    contacts: &Bound<'_, PyAny>,
    manipulation: &Bound<'_, PyDict>,
    floor: f32,
    settings: Option<&Bound<'_, PyDict>>,
) -> PyResult<Job> {
    let motion = from_arrays(root_positions, rotations, contacts)?;
    let cue: ManipulationCue = json::from_dict("manipulation", manipulation)?;
    let settings: Settings = json::from_optional_dict("settings", settings)?;
    Job::start(
        move |progress| {
            let (motion, constraints) = lengthened(&motion, &cue, floor, &settings.editor)?;
            let done = solve_plainly(&motion, &constraints, &settings.editor, progress)?;
            Ok((done.motion, Figures::of(done.figures)))
        },
        give,
    )
}

/// What a motion is like over a range of frames.
#[derive(Serialize)]
struct MotionFigures {
    smoothness: Smoothness,
    foot: FootFigures,
    body: BodyFigures,
    manifold_cm: f32,
}

/// How smoothly frames `first` to `end` of a motion run, how far they are from a manifold, and how the feet stand.
#[pyfunction]
#[pyo3(signature = (root_positions, rotations, contacts, first, end, floor=0.0, manifold=None))]
#[allow(clippy::too_many_arguments)] // Python's face: all but five have names and defaults there.
pub fn motion_figures<'py>(
    py: Python<'py>,
    root_positions: &Bound<'py, PyAny>,
    rotations: &Bound<'py, PyAny>,
    contacts: &Bound<'py, PyAny>,
    first: usize,
    end: usize,
    floor: f32,
    manifold: Option<&Manifold>,
) -> PyResult<Bound<'py, PyAny>> {
    let mut motion = from_arrays(root_positions, rotations, contacts)?;
    let manifold = manifold.map(|m| m.inner.clone());
    let figures = job::run(py, || {
        let span = first.min(motion.len())..end.min(motion.len());
        let seen = Motion {
            postures: motion.postures.get(span.clone()).unwrap_or_default().to_vec(),
            contacts: motion.contacts.get(span.clone()).unwrap_or_default().to_vec(),
        };
        let foot = foot_figures(&seen, floor);
        let body = body_figures(&seen, floor, None);
        motion.postures.iter_mut().for_each(|p| p.root_position.z -= floor);
        let distance = match manifold.as_deref() {
            Some(manifold) => manifold_distance(manifold, &motion, &span),
            None => manifold_distance(oncue::manifold::Manifold::shipped()?, &motion, &span),
        };
        Ok(MotionFigures { smoothness: smoothness(&motion, &span), foot, body, manifold_cm: distance })
    })?;
    json::to_python(py, &figures)
}

fn from_dicts<T: DeserializeOwned>(what: &str, dicts: &[Bound<'_, PyDict>]) -> PyResult<Vec<T>> {
    dicts.iter().map(|dict| json::from_dict(what, dict)).collect()
}
