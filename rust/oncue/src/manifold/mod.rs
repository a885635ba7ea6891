//! The motion manifold: Ψ and Ψ⁻¹ over windows X (LAMA, section 3.6; supplementary).
//!
//! `window` lays a motion out as X, `kinematics` places its joints and carries gradients back, `autoencoder` is Ψ
//! and Ψ⁻¹ with their file, `training` makes one from a motion library: on `training_windows`, changed by `augment`, down
//! the gradient of `loss`, from where `linear_start` begins, with a `checkpoint` after each epoch.

mod augment;
pub(crate) mod autoencoder;
pub(crate) mod checkpoint;
pub(crate) mod kinematics;
mod linear_start;
mod loss;
pub(crate) mod report;
pub(crate) mod settings;
pub(crate) mod training;
mod training_windows;
pub(crate) mod window;

pub use autoencoder::Manifold;
pub use report::{ManifoldEpoch, ReconstructionFigures, TrainingReport};
pub use settings::ManifoldSettings;
pub use training::train_manifold;
