//! Rotations and the person-centric plane.

pub mod eigen;
pub mod planar;
pub mod rotation;

pub use planar::Planar;
