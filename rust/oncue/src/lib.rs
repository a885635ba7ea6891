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

pub mod action;
pub mod body_solver;
pub mod controller;
pub mod cue;
pub mod data_file;
pub mod editor;
pub mod error;
pub mod job;
pub mod library;
pub mod manifold;
pub mod math;
pub mod metrics;
pub mod motion;
pub mod nn;
pub mod practice;
pub mod progress;
pub mod report;
pub mod scene;
pub mod settings;
pub mod simd;
pub mod synthesize;
pub mod synthesizer;
#[cfg(test)]
mod test_world;

pub use action::{ActionLabel, ActionType};
pub use cue::{ActionCue, Hand, InitialState, ManipulationCue, Task};
pub use error::{Error, Result};
pub use job::Job;
pub use library::MotionLibrary;
pub use motion::{Motion, Posture};
pub use progress::Progress;
pub use scene::SceneIndex;
pub use settings::Settings;
pub use synthesize::{Synthesis, synthesize, synthesize_along};
