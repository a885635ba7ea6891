//! Rotations and the person-centric plane.

pub mod planar;
pub mod rotation;

pub use planar::Planar;
