//! ρ(b, W) for one box and a few triangles: where the box's 12 edges pass through them (LAMA, eq. 4).
//!
//! In the box's own frame its edges run along the axes, so an edge crosses a triangle where the edge's
//! point lies inside the triangle's projection along that axis, and the crossing's coordinate lies within
//! the box. A point exactly on the line between two triangles belongs to one of them (the point is thought
//! moved by an infinitely small step), so that a surface is crossed once wherever the mesh is cut.

use glam::{Mat3, Quat, Vec3};

use crate::motion::BoxNode;
use crate::simd::Simd;

/// Eight triangles side by side: corner 0 x, y, z, then corners 1 and 2. Unused lanes hold NaN.
#[derive(Debug, Clone)]
#[repr(C, align(32))]
pub(super) struct TriangleBlock {
    pub corners: [[f32; 8]; 9],
    /// Index of each triangle in the list that the tree was built from.
    pub index: [u32; 8],
    /// Bit i: triangle i lies in other blocks as well, because it was cut for the tree.
    pub shared: u32,
}

impl TriangleBlock {
    pub(super) fn empty() -> Self {
        Self { corners: [[f32::NAN; 8]; 9], index: [u32::MAX; 8], shared: 0 }
    }

    pub(super) fn set(&mut self, lane: usize, triangle: &[Vec3; 3], index: u32, shared: bool) {
        for (corner, vertex) in triangle.iter().enumerate() {
            for axis in 0..3 {
                self.corners[3 * corner + axis][lane] = vertex[axis];
            }
        }
        self.index[lane] = index;
        self.shared |= u32::from(shared) << lane;
    }

    pub(super) fn triangle(&self, lane: usize) -> [Vec3; 3] {
        let c = |i: usize| self.corners[i][lane];
        [Vec3::new(c(0), c(1), c(2)), Vec3::new(c(3), c(4), c(5)), Vec3::new(c(6), c(7), c(8))]
    }
}

/// A box placed in the world.
#[derive(Debug, Clone, Copy)]
pub(super) struct OrientedBox {
    /// World, metres.
    pub center: Vec3,
    /// The box's axes in the world, unit columns.
    pub axes: Mat3,
    pub half_extents: Vec3,
    /// Half of the size of the world-aligned box around it.
    pub world_half_extents: Vec3,
}

impl OrientedBox {
    pub(super) fn new(center: Vec3, rotation: Quat, half_extents: Vec3) -> Self {
        let axes = Mat3::from_quat(rotation);
        let reach = |a: Vec3, h: f32| a.abs() * h;
        let world_half_extents = reach(axes.x_axis, half_extents.x)
            + reach(axes.y_axis, half_extents.y)
            + reach(axes.z_axis, half_extents.z);
        Self { center, axes, half_extents, world_half_extents }
    }

    /// `node` on a joint at `position` with global `rotation`.
    pub(super) fn of_node(node: &BoxNode, position: Vec3, rotation: Quat) -> Self {
        Self::new(position + rotation * node.center, rotation, node.half_extents)
    }

    #[inline(always)]
    fn to_local(self, point: Vec3) -> Vec3 {
        let d = point - self.center;
        let along = |a: Vec3| d.x * a.x + d.y * a.y + d.z * a.z;
        Vec3::new(along(self.axes.x_axis), along(self.axes.y_axis), along(self.axes.z_axis))
    }
}

/// All of a box's edges, for [`crossings`].
#[cfg(test)]
pub(super) const ALL_EDGES: u32 = 0xfff;

/// Crossings of a box's edges with one triangle: bit `4 * axis + corner` for the edge along `axis` at the corner whose
/// bits are the signs on (first other axis, second other axis). Only `edges` are looked at, and crossings lower than
/// `above` (world z) are left out.
///
/// This is the definition of a crossing; [`candidates`] only rules edges and triangles out.
pub(super) fn crossings(placed: &OrientedBox, triangle: &[Vec3; 3], edges: u32, above: f32) -> u32 {
    let v = [placed.to_local(triangle[0]), placed.to_local(triangle[1]), placed.to_local(triangle[2])];
    let mut bits = 0;
    let mut left = edges;
    while left != 0 {
        let edge = left.trailing_zeros() as usize;
        left &= left - 1;
        let z = match edge / 4 {
            0 => crossing::<0, 1, 2>(placed, &v, edge & 3),
            1 => crossing::<1, 2, 0>(placed, &v, edge & 3),
            _ => crossing::<2, 0, 1>(placed, &v, edge & 3),
        };
        bits |= u32::from(z.is_some_and(|z| z >= above)) << edge;
    }
    bits
}

/// World z of the place where the edge along axis A, at a corner of the plane of S and T, crosses the triangle `v`
/// (in the box's frame).
#[inline(always)]
fn crossing<const A: usize, const S: usize, const T: usize>(
    placed: &OrientedBox,
    v: &[Vec3; 3],
    corner: usize,
) -> Option<f32> {
    let half = placed.half_extents;
    let cs = if corner & 1 == 0 { -half[S] } else { half[S] };
    let ct = if corner & 2 == 0 { -half[T] } else { half[T] };
    // Twice the signed area of the triangle (corner, a, b), and its sign for a corner moved a little.
    let area = |a: Vec3, b: Vec3| (a[S] - cs) * (b[T] - ct) - (a[T] - ct) * (b[S] - cs);
    let side = |e: f32, a: Vec3, b: Vec3| {
        if e != 0.0 {
            e > 0.0
        } else if a[T] != b[T] {
            a[T] > b[T]
        } else {
            b[S] > a[S]
        }
    };
    let (e0, e1, e2) = (area(v[1], v[2]), area(v[2], v[0]), area(v[0], v[1]));
    let (p0, p1, p2) = (side(e0, v[1], v[2]), side(e1, v[2], v[0]), side(e2, v[0], v[1]));
    if p0 != p1 || p1 != p2 {
        return None;
    }
    let along = (e0 * v[0][A] + e1 * v[1][A] + e2 * v[2][A]) / (e0 + e1 + e2);
    // NaN where the triangle is seen exactly from its edge: no crossing.
    if along.is_nan() || along.abs() > half[A] {
        return None;
    }
    let z = |axis: usize| placed.axes.col(axis).z;
    Some(placed.center.z + along * z(A) + cs * z(S) + ct * z(T))
}

/// The edges that a lane of [`candidates`]' second part names.
#[inline(always)]
pub(super) fn edges_of(by_edge: &[u32; 12], lane: usize) -> u32 {
    let mut edges = 0;
    for (edge, lanes) in by_edge.iter().enumerate() {
        edges |= (lanes >> lane & 1) << edge;
    }
    edges
}

/// The triangles of a block that may cross an edge of the box (bit i for triangle i), and the same edge by edge. Never
/// misses one that [`crossings`] counts.
///
/// `S` has eight lanes.
#[inline(always)]
pub(super) fn candidates<S: Simd>(s: S, placed: &OrientedBox, block: &TriangleBlock) -> (u32, [u32; 12]) {
    let half = placed.half_extents.to_array();
    let center = splat(s, placed.center);
    let axes = [splat(s, placed.axes.x_axis), splat(s, placed.axes.y_axis), splat(s, placed.axes.z_axis)];
    // v[corner][axis], in the box's frame, by the same operations as `to_local`.
    let mut v = [[s.splat(0.0); 3]; 3];
    for corner in 0..3 {
        let x = s.sub(s.load(&block.corners[3 * corner]), center[0]);
        let y = s.sub(s.load(&block.corners[3 * corner + 1]), center[1]);
        let z = s.sub(s.load(&block.corners[3 * corner + 2]), center[2]);
        for axis in 0..3 {
            v[corner][axis] = dot(s, [x, y, z], axes[axis]);
        }
    }
    // An edge lies on two of the face planes: a triangle has to reach two of them, and the third pair's inside.
    let (mut near, mut one, mut two) = (0xff, 0, 0);
    for axis in 0..3 {
        let (a, b, c) = (v[0][axis], v[1][axis], v[2][axis]);
        let (low, high) = (s.min(s.min(a, b), c), s.max(s.max(a, b), c));
        // Wider than the box by far more than rounding moves a crossing.
        let slack = half[axis] * 1e-4 + 1e-5;
        let (outer, inner) = (half[axis] + slack, half[axis] - slack);
        let inside = s.le(low, s.splat(outer)) & s.le(s.splat(-outer), high);
        near &= inside;
        let plane = inside & (s.le(s.splat(inner), high) | s.le(low, s.splat(-inner)));
        two |= one & plane;
        one |= plane;
    }
    near &= two;
    let mut by_edge = [0; 12];
    if near == 0 {
        return (0, by_edge);
    }
    let mut found = 0;
    let zero = s.splat(0.0);
    // d[sign][corner][axis]: triangle corners as seen from the box's faces.
    let mut d = [v; 2];
    for corner in 0..3 {
        for axis in 0..3 {
            let h = s.splat(half[axis]);
            d[0][corner][axis] = s.sub(v[corner][axis], s.sub(zero, h));
            d[1][corner][axis] = s.sub(v[corner][axis], h);
        }
    }
    for axis in 0..3 {
        let (p, q) = ((axis + 1) % 3, (axis + 2) % 3);
        for corner in 0..4 {
            let (dp, dq) = (&d[corner & 1], &d[corner >> 1]);
            // Twice the signed areas of the triangles (edge, corner, next corner).
            let e0 = s.sub(s.mul(dp[1][p], dq[2][q]), s.mul(dq[1][q], dp[2][p]));
            let e1 = s.sub(s.mul(dp[2][p], dq[0][q]), s.mul(dq[2][q], dp[0][p]));
            let e2 = s.sub(s.mul(dp[0][p], dq[1][q]), s.mul(dq[0][q], dp[1][p]));
            let (low, high) = (s.min(s.min(e0, e1), e2), s.max(s.max(e0, e1), e2));
            let lanes = near & (s.le(zero, low) | s.le(high, zero));
            by_edge[4 * axis + corner] = lanes;
            found |= lanes;
        }
    }
    (found, by_edge)
}

/// A vector's parts, each in all lanes.
#[inline(always)]
pub(super) fn splat<S: Simd>(s: S, v: Vec3) -> [S::F32; 3] {
    [s.splat(v.x), s.splat(v.y), s.splat(v.z)]
}

/// The scalar product, lane by lane. No fused product: every level gives the same bits.
#[inline(always)]
pub(super) fn dot<S: Simd>(s: S, a: [S::F32; 3], b: [S::F32; 3]) -> S::F32 {
    s.add(s.add(s.mul(a[0], b[0]), s.mul(a[1], b[1])), s.mul(a[2], b[2]))
}
