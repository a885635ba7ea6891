//! LAMA (*Locomotion-Action-Manipulation*, Lee & Joo, ICCV 2023) on two CPU cores.
//!
//! ```text
//! .bvh files, starter ──► library::MotionLibrary ──► library::feature ──► search k*
//! meshes ──► scene::SceneIndex (ρ, distance field, g_occ, clear paths)
//! start, cues ──► cue::Task
//!                     │
//!   controller::optimize_policy:  A(s_t) ─► a_t ─► S(m_t, a_t) ─► m_{t+1}   (PPO over motion matching)
//!                     │
//!                 motion::Motion ──► metrics, report
//! ```
//!
//! One space everywhere, Blender's: right-handed, Z up, metres, quaternions w first at the borders.
//!
//! # The main job
//!
//! A person walks through a room and sits down on a bench:
//!
//! ```
//! use oncue::glam::Vec3;
//! use oncue::library::starter;
//! use oncue::{ActionCue, ActionType, InitialState, MotionDatabase, Progress, SceneIndex, Settings, Task, synthesize};
//!
//! # fn main() -> oncue::Result<()> {
//! let (settings, progress) = (Settings::default(), Progress::new());
//! // W: a floor and a bench, as triangles.
//! let corner = |x, y, z| Vec3::new(x, y, z);
//! let positions = [
//!     corner(-2.0, -2.0, 0.0), corner(2.0, -2.0, 0.0), corner(2.0, 2.0, 0.0), corner(-2.0, 2.0, 0.0),
//!     corner(-0.6, 1.2, 0.45), corner(0.6, 1.2, 0.45), corner(0.6, 1.7, 0.45), corner(-0.6, 1.7, 0.45),
//! ];
//! let triangles = [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]];
//! let scene = SceneIndex::build(&positions, &triangles, &settings.scene, &progress)?;
//! // What the motion is made of: here the library that Oncue makes itself.
//! let database = MotionDatabase::build(&starter::generate(&progress)?, &settings.synthesizer.weights, &progress)?;
//! // g_init and φ_A: where the person stands at first, and where the pelvis ends.
//! let start = InitialState::standing("Start", corner(0.0, -1.2, 0.0), 3.0);
//! let seat = corner(0.0, 1.4, 0.55);
//! let cue = ActionCue { name: "Bench".into(), action_type: ActionType::Sit, position: seat, yaw: 0.0, feet: [None; 2] };
//! let task = Task { start, cue, passes: Vec::new(), manipulations: Vec::new() };
//! let done = synthesize(&scene, &database, &task, None, &settings, 1, &progress)?;
//! assert!(done.report.success, "{:?}", done.report.problems);
//! let hips = done.motion.postures[done.motion.len() - 1].root_position;
//! assert!(hips.distance(seat) < 0.02);
//! # Ok(())
//! # }
//! ```
//!
//! Captures come in by [`library::build()`], long work runs beside the program as a [`Job`], motions are edited by
//! [`editor::edit_motion`]. What the core does it says through the `log` crate, one line a stage.

#![warn(missing_docs, unreachable_pub)]

pub mod action;
mod anatomy;
mod body_solver;
pub mod controller;
pub mod cue;
mod data_file;
pub mod editor;
pub mod error;
pub mod figures;
mod hands;
#[doc(hidden)]
pub mod internals;
pub mod job;
pub mod keys;
pub mod library;
mod life;
pub mod manifold;
pub mod math;
pub mod metrics;
pub mod motion;
mod nn;
pub mod passing;
pub mod perform;
mod practice;
pub mod progress;
mod range;
pub mod report;
pub mod scene;
pub mod seats;
pub mod settings;
mod simd;
pub mod synthesize;
mod synthesizer;
#[cfg(test)]
mod test_world;
mod timing;
pub mod together;
pub mod ways;

pub use action::{ActionLabel, ActionType};
pub use cue::{
    ActionCue, Amount, BodyState, CueKind, Hand, Hung, InitialState, Leaf, LookCue, ManipulationCue, Moments,
    OpenCue, PassCue, Performance, PutCue, Step, TakeCue, Task, Thing, ThingCue,
};
pub use error::{Error, Result};
pub use glam;
pub use hands::{CarriedThing, OpenedFigures, ThingFigures};
pub use job::Job;
pub use library::{MotionDatabase, MotionLibrary};
pub use motion::{Motion, Posture};
pub use perform::{Performed, perform};
pub use progress::Progress;
pub use scene::SceneIndex;
pub use settings::Settings;
pub use synthesize::{
    Around, Measured, Synthesis, measure, measure_performance, synthesize, synthesize_along,
};
pub use together::perform_together;
pub use ways::{PersonWays, StepWay, Ways, ways};
