//! The motion library: clips on the unified skeleton at 30 Hz, with contacts and labels.
//!
//! Two sources make clips: motion capture files ([`mocap_file`], [`retarget`], [`contact`], [`label`])
//! and the procedural [`starter`]. [`MotionLibrary`] keeps them and their file; [`feature`] and
//! [`search`] make them matchable. [`build()`] does it all.

pub(crate) mod build;
pub(crate) mod calibration;
pub(crate) mod clip;
pub(crate) mod contact;
pub(crate) mod database;
pub(crate) mod feature;
pub(crate) mod file;
pub(crate) mod foot;
pub(crate) mod joint_names;
pub(crate) mod label;
pub(crate) mod mocap_file;
mod mocap_text;
pub(crate) mod quality;
pub(crate) mod retarget;
pub(crate) mod search;
pub(crate) mod sidecar;
pub mod starter;

pub use build::{BuiltLibrary, LibrarySettings, Skipped, StarterUse, build};
pub use clip::{Clip, MotionLibrary, Segment, Source};
pub use database::MotionDatabase;
pub use feature::FeatureWeights;
pub use file::{Summary, SummaryRow};
