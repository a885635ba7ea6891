//! Small networks: dense layers, temporal convolutions, Adam. Knows nothing of motion.
//!
//! The batch, not the product, is what is split over threads, in chunks of a fixed number of rows
//! whose gradients are summed in order: the result does not depend on the number of threads.

pub(crate) mod adam;
pub(crate) mod conv1d;
pub(crate) mod conv_stack;
pub(crate) mod matmul;
pub(crate) mod mlp;
mod product;
mod samples;

pub use adam::Adam;
pub(crate) use conv_stack::{ConvStack, ConvWorkspace};
pub use conv1d::Conv1d;
pub use mlp::{Activations, Mlp};

/// Rows of a batch that one thread takes at a time.
pub(crate) const CHUNK_ROWS: usize = 256;
