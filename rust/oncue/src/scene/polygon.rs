//! A triangle cut by planes across the axes: the exact part of it inside a box.

use glam::Vec3;

const CAPACITY: usize = 14;

/// A convex polygon: a triangle cut by the planes of a box has at most nine corners; rounding may add a few.
#[derive(Debug, Clone, Copy)]
pub(super) struct Polygon {
    corners: [Vec3; CAPACITY],
    len: usize,
}

impl Polygon {
    pub(super) fn new(triangle: &[Vec3; 3]) -> Self {
        let mut corners = [Vec3::ZERO; CAPACITY];
        corners[..3].copy_from_slice(triangle);
        Self { corners, len: 3 }
    }

    pub(super) fn corners(&self) -> &[Vec3] {
        &self.corners[..self.len]
    }

    pub(super) fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Smallest and largest corner; meaningless when empty.
    pub(super) fn bounds(&self) -> (Vec3, Vec3) {
        let first = self.corners[0];
        self.corners().iter().fold((first, first), |(lo, hi), &c| (lo.min(c), hi.max(c)))
    }

    /// The part with `axis` coordinate in `from..=to`.
    pub(super) fn clip(&self, axis: usize, from: f32, to: f32) -> Polygon {
        self.cut(axis, from, 1.0).cut(axis, to, -1.0)
    }

    /// The part where `side · (coordinate - at) >= 0` (Sutherland-Hodgman).
    fn cut(&self, axis: usize, at: f32, side: f32) -> Polygon {
        let mut out = Polygon { corners: [Vec3::ZERO; CAPACITY], len: 0 };
        for i in 0..self.len {
            let a = self.corners[i];
            let b = self.corners[if i + 1 == self.len { 0 } else { i + 1 }];
            let (da, db) = (side * (a[axis] - at), side * (b[axis] - at));
            if da >= 0.0 {
                out.push(a);
            }
            if (da >= 0.0) != (db >= 0.0) {
                let mut cut = a + (b - a) * (da / (da - db));
                cut[axis] = at;
                out.push(cut);
            }
        }
        out
    }

    fn push(&mut self, corner: Vec3) {
        // Never reached by a triangle that is cut by one box; a corner too many would lie on the others.
        if self.len < self.corners.len() {
            self.corners[self.len] = corner;
            self.len += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_corner_is_cut_off() {
        let triangle = [Vec3::ZERO, Vec3::X * 2.0, Vec3::Y * 2.0];
        let cut = Polygon::new(&triangle).clip(0, 1.0, 5.0);
        let (lo, hi) = cut.bounds();
        assert_eq!(cut.corners().len(), 3);
        assert!(lo.distance(Vec3::new(1.0, 0.0, 0.0)) < 1e-6 && hi.distance(Vec3::new(2.0, 1.0, 0.0)) < 1e-6);
        assert!(Polygon::new(&triangle).clip(2, 0.1, 1.0).is_empty());
    }

    proptest! {
        #[test]
        fn parts_hold_every_point_of_the_triangle(
            c in prop::array::uniform9(-2f32..2.0), u in 0f32..1.0, v in 0f32..1.0, at in -1f32..1.0, axis in 0usize..3,
        ) {
            let t = [Vec3::new(c[0], c[1], c[2]), Vec3::new(c[3], c[4], c[5]), Vec3::new(c[6], c[7], c[8])];
            let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
            let p = t[0] + (t[1] - t[0]) * u + (t[2] - t[0]) * v;
            let part = if p[axis] < at { Polygon::new(&t).clip(axis, -9.0, at) } else { Polygon::new(&t).clip(axis, at, 9.0) };
            prop_assert!(!part.is_empty());
            let (lo, hi) = part.bounds();
            prop_assert!(p.cmpge(lo - 1e-4).all() && p.cmple(hi + 1e-4).all());
        }
    }
}
