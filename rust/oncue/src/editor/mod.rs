//! The motion editor E (LAMA, sections 3.6 and 4.3; supplementary, "Motion Editing").
//!
//! ```text
//! Motion ──► window X ──► Ψ (encoder) ──► z, optimized ──► Ψ⁻¹ (decoder) ──► X ──► Motion
//! ```
//!
//! [`window`] lays a motion out as X, [`kinematics`] places its joints and carries gradients back,
//! [`manifold`] is the autoencoder, [`training`] makes one from a motion library.

mod banded;
pub mod constraint;
mod degrees;
pub mod edit;
mod feet;
mod finish;
pub mod kinematics;
pub mod latent;
pub mod manifold;
pub mod manipulation;
pub mod plain_ik;
pub mod resolve;
pub mod seat;
pub mod smoothness;
pub mod window;

pub use constraint::{Constraint, check_constraints};
pub use edit::{ConstraintFigures, EditFigures, Edited};
pub use manifold::{DecoderWorkspace, Manifold};
