//! The motion editor E (LAMA, sections 3.6 and 4.3; supplementary, "Motion Editing").
//!
//! ```text
//! Motion ──► window X ──► Ψ (encoder) ──► z, optimized ──► Ψ⁻¹ (decoder) ──► X ──► Motion
//! ```
//!
//! [`window`] lays a motion out as X, [`kinematics`] places its joints and carries gradients back,
//! [`manifold`] is the autoencoder, [`training`] makes one from a motion library.

mod augment;
mod checkpoint;
pub mod kinematics;
mod linear_start;
pub mod manifold;
pub mod training;
pub mod window;

pub use manifold::{DecoderWorkspace, Manifold};
pub use training::{Figures, ManifoldSettings, TrainingReport, train_manifold};
