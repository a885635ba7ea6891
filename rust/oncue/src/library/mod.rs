//! The motion library: clips on the unified skeleton at 30 Hz, with contacts and labels.
//!
//! Two sources make clips: motion capture files ([`mocap_file`], [`retarget`], [`contact`], [`label`])
//! and the procedural [`starter`]. [`MotionLibrary`] keeps them and their file; [`feature`] and
//! [`search`] make them matchable. [`build()`] does it all.

pub mod build;
pub mod calibration;
pub mod clip;
pub mod contact;
pub mod database;
pub mod feature;
pub mod file;
pub mod foot;
pub mod joint_names;
pub mod label;
pub mod mocap_file;
mod mocap_text;
pub mod mocap_writer;
pub mod quality;
pub mod retarget;
pub mod search;
pub mod sidecar;
pub mod starter;

pub use build::{BuiltLibrary, LibrarySettings, Skipped, StarterUse, build};
pub use clip::{ActionLabel, Clip, MotionLibrary, Segment, Source};
pub use file::{Summary, SummaryRow};
