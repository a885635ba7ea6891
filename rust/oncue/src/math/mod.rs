//! Rotations, the person-centric plane, and shapes of curves.

pub mod capsule;
pub(crate) mod curve;
pub(crate) mod eigen;
pub(crate) mod planar;
pub mod rotation;

pub use planar::Planar;

/// `v.floor()` for values of a few millions at most, without the call that processors before SSE 4.1 need.
#[inline(always)]
pub fn floor(v: glam::Vec2) -> glam::Vec2 {
    let whole = v.as_ivec2().as_vec2();
    whole - glam::Vec2::select(whole.cmpgt(v), glam::Vec2::ONE, glam::Vec2::ZERO)
}

#[cfg(test)]
mod tests {
    use glam::Vec2;

    #[test]
    fn floor_is_floor() {
        for (x, y) in [(0.0, -0.0), (1.5, -1.5), (-3.0, 3.0), (1e6 + 0.5, -1e6 - 0.5), (-0.001, 0.999)] {
            assert_eq!(super::floor(Vec2::new(x, y)), Vec2::new(x, y).floor());
        }
    }
}
