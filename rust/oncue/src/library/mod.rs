//! The motion library: clips on the unified skeleton at 30 Hz, with contacts and labels.
//!
//! Two sources make clips: motion capture files (`mocap_file`, `retarget`, `contact`, `label`)
//! and the procedural [`starter`]. [`MotionLibrary`] keeps them and their file; `feature` and
//! `search` make them matchable. [`build()`] does it all.
//!
//! ```
//! use oncue::library::{LibrarySettings, StarterUse, build};
//! use oncue::{ActionLabel, Progress};
//!
//! # fn main() -> oncue::Result<()> {
//! // Of no file at all: what the starter library has. Files and folders of `.bvh` go in the list.
//! let built = build(&[], &LibrarySettings { starter: StarterUse::Missing, ..LibrarySettings::default() }, &Progress::new())?;
//! assert!(built.captures.is_empty());
//! let sits = built.library.summary().rows.iter().find(|row| row.label == ActionLabel::Sit).map(|row| row.segments);
//! assert!(sits.is_some_and(|count| count > 10));
//! # Ok(())
//! # }
//! ```

pub(crate) mod body;
pub(crate) mod build;
pub(crate) mod calibration;
pub(crate) mod clip;
pub(crate) mod contact;
pub(crate) mod database;
pub(crate) mod feature;
pub(crate) mod file;
pub(crate) mod foot;
mod frame_rate;
mod gait;
pub(crate) mod joint_names;
pub(crate) mod known_poses;
pub(crate) mod label;
pub(crate) mod mocap_file;
mod mocap_text;
pub(crate) mod mocap_writer;
pub(crate) mod quality;
pub(crate) mod rest_skeleton;
pub(crate) mod retarget;
mod rise;
pub(crate) mod sampler;
pub(crate) mod search;
pub(crate) mod sidecar;
mod start;
pub mod starter;
pub(crate) mod sufficiency;
mod survey;
mod take;
mod travel;
pub(crate) mod up_axis;

pub use build::{BuiltLibrary, Capture, CaptureSource, LibrarySettings, StarterUse, build};
pub use clip::{Clip, MotionLibrary, Segment, Source};
pub use database::MotionDatabase;
pub use feature::FeatureWeights;
pub use file::{Summary, SummaryRow};
pub use known_poses::KnownPoses;
pub use mocap_writer::to_bvh;
pub use rest_skeleton::{RestBone, RestMapping, map_rest_skeleton};
pub use rise::Rise;
pub(crate) use start::SEEN_AHEAD;
pub use start::Start;
