//! The motion library: clips on the unified skeleton at 30 Hz, with contacts and labels.
//!
//! Two sources make clips: motion capture files ([`mocap_file`], [`retarget`], [`contact`], [`label`])
//! and the procedural [`starter`]. [`MotionLibrary`] keeps them and their file; [`feature`] and
//! [`search`] make them matchable.

pub mod clip;
pub mod feature;
pub mod search;

pub use clip::{ActionLabel, Clip, MotionLibrary, Segment, Source};
