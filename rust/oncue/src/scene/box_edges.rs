//! ρ(b, W) for one box and a few triangles: where the box's 12 edges pass through them (LAMA, eq. 4).
//!
//! In the box's own frame its edges run along the axes, so an edge crosses a triangle where the edge's
//! point lies inside the triangle's projection along that axis, and the crossing's coordinate lies within
//! the box. A point exactly on the line between two triangles belongs to one of them (the point is thought
//! moved by an infinitely small step), so that a surface is crossed once wherever the mesh is cut.

use glam::{Mat3, Quat, Vec3};

use super::lanes::Lanes;
use crate::motion::BoxNode;

/// Eight triangles side by side: corner 0 x, y, z, then corners 1 and 2. Unused lanes hold NaN.
#[derive(Debug, Clone)]
#[repr(C, align(32))]
pub struct TriangleBlock {
    pub corners: [[f32; 8]; 9],
    /// Index of each triangle in the list that the tree was built from.
    pub index: [u32; 8],
    /// Bit i: triangle i lies in other blocks as well, because it was cut for the tree.
    pub shared: u32,
}

impl TriangleBlock {
    pub fn empty() -> Self {
        Self { corners: [[f32::NAN; 8]; 9], index: [u32::MAX; 8], shared: 0 }
    }

    pub fn set(&mut self, lane: usize, triangle: &[Vec3; 3], index: u32, shared: bool) {
        for (corner, vertex) in triangle.iter().enumerate() {
            for axis in 0..3 {
                self.corners[3 * corner + axis][lane] = vertex[axis];
            }
        }
        self.index[lane] = index;
        self.shared |= u32::from(shared) << lane;
    }

    pub fn triangle(&self, lane: usize) -> [Vec3; 3] {
        let c = |i: usize| self.corners[i][lane];
        [Vec3::new(c(0), c(1), c(2)), Vec3::new(c(3), c(4), c(5)), Vec3::new(c(6), c(7), c(8))]
    }
}

/// A box placed in the world.
#[derive(Debug, Clone, Copy)]
pub struct OrientedBox {
    /// World, metres.
    pub center: Vec3,
    /// The box's axes in the world, unit columns.
    pub axes: Mat3,
    pub half_extents: Vec3,
    /// Half of the size of the world-aligned box around it.
    pub world_half_extents: Vec3,
}

impl OrientedBox {
    pub fn new(center: Vec3, rotation: Quat, half_extents: Vec3) -> Self {
        let axes = Mat3::from_quat(rotation);
        let reach = |a: Vec3, h: f32| a.abs() * h;
        let world_half_extents = reach(axes.x_axis, half_extents.x)
            + reach(axes.y_axis, half_extents.y)
            + reach(axes.z_axis, half_extents.z);
        Self { center, axes, half_extents, world_half_extents }
    }

    /// `node` on a joint at `position` with global `rotation`.
    pub fn of_node(node: &BoxNode, position: Vec3, rotation: Quat) -> Self {
        Self::new(position + rotation * node.center, rotation, node.half_extents)
    }

    #[inline(always)]
    fn to_local(self, point: Vec3) -> Vec3 {
        let d = point - self.center;
        let along = |a: Vec3| d.x * a.x + d.y * a.y + d.z * a.z;
        Vec3::new(along(self.axes.x_axis), along(self.axes.y_axis), along(self.axes.z_axis))
    }
}

/// Crossings of the box's 12 edges with one triangle: bit `4 * axis + corner` for the edge along `axis` at the
/// corner whose sign bits are (first other axis, second other axis). Crossings lower than `above` (world z) are left out.
///
/// This is the definition of a crossing; [`candidates`] only rules triangles out.
pub fn crossings(placed: &OrientedBox, triangle: &[Vec3; 3], above: f32) -> u32 {
    let v = triangle.map(|p| placed.to_local(p));
    let half = placed.half_extents;
    let mut bits = 0;
    for axis in 0..3 {
        let (s, t) = ((axis + 1) % 3, (axis + 2) % 3);
        for corner in 0..4 {
            let cs = if corner & 1 == 0 { -half[s] } else { half[s] };
            let ct = if corner & 2 == 0 { -half[t] } else { half[t] };
            // Twice the signed area of the triangle (corner, a, b), and its sign for a corner moved a little.
            let area = |a: Vec3, b: Vec3| (a[s] - cs) * (b[t] - ct) - (a[t] - ct) * (b[s] - cs);
            let side = |e: f32, a: Vec3, b: Vec3| {
                if e != 0.0 {
                    e > 0.0
                } else if a[t] != b[t] {
                    a[t] > b[t]
                } else {
                    b[s] > a[s]
                }
            };
            let (e0, e1, e2) = (area(v[1], v[2]), area(v[2], v[0]), area(v[0], v[1]));
            let (p0, p1, p2) = (side(e0, v[1], v[2]), side(e1, v[2], v[0]), side(e2, v[0], v[1]));
            if p0 != p1 || p1 != p2 {
                continue;
            }
            let along = (e0 * v[0][axis] + e1 * v[1][axis] + e2 * v[2][axis]) / (e0 + e1 + e2);
            // NaN where the triangle is seen exactly from its edge: no crossing.
            if along.is_nan() || along.abs() > half[axis] {
                continue;
            }
            let mut point = Vec3::ZERO;
            point[axis] = along;
            point[s] = cs;
            point[t] = ct;
            if (placed.axes * point).z + placed.center.z >= above {
                bits |= 1 << (4 * axis + corner);
            }
        }
    }
    bits
}

/// Bit i: triangle i of the block may cross an edge of the box. Never misses one that [`crossings`] counts.
#[inline(always)]
pub fn candidates<L: Lanes>(placed: &OrientedBox, block: &TriangleBlock) -> u32 {
    let axes = [placed.axes.x_axis, placed.axes.y_axis, placed.axes.z_axis];
    let half = placed.half_extents;
    let center = [L::splat(placed.center.x), L::splat(placed.center.y), L::splat(placed.center.z)];
    // v[corner][axis], in the box's frame, by the same operations as `to_local`.
    let mut v = [[L::splat(0.0); 3]; 3];
    for (corner, local) in v.iter_mut().enumerate() {
        let d = [0, 1, 2].map(|i| L::load(&block.corners[3 * corner + i]).sub(center[i]));
        for (out, a) in local.iter_mut().zip(axes) {
            *out = d[0].mul(L::splat(a.x)).add(d[1].mul(L::splat(a.y))).add(d[2].mul(L::splat(a.z)));
        }
    }
    let mut near = 0xff;
    for axis in 0..3 {
        // Wider than the box by far more than rounding moves a crossing.
        let (a, b, c) = (v[0][axis], v[1][axis], v[2][axis]);
        let h = half[axis] * 1.0001 + 1e-5;
        near &= a.min(b).min(c).le(L::splat(h)) & L::splat(-h).le(a.max(b).max(c));
    }
    if near == 0 {
        return 0;
    }
    let mut found = 0;
    let zero = L::splat(0.0);
    // d[sign][corner][axis]: triangle corners as seen from the box's faces.
    let from = |sign: f32| {
        let mut out = v;
        for corner in &mut out {
            for axis in 0..3 {
                corner[axis] = corner[axis].sub(L::splat(sign * half[axis]));
            }
        }
        out
    };
    let d = [from(-1.0), from(1.0)];
    for axis in 0..3 {
        let (s, t) = ((axis + 1) % 3, (axis + 2) % 3);
        for corner in 0..4 {
            let (ds, dt) = (&d[corner & 1], &d[corner >> 1]);
            let area = |a: usize, b: usize| ds[a][s].mul(dt[b][t]).sub(dt[a][t].mul(ds[b][s]));
            let (e0, e1, e2) = (area(1, 2), area(2, 0), area(0, 1));
            found |= zero.le(e0.min(e1).min(e2)) | e0.max(e1).max(e2).le(zero);
        }
    }
    found & near
}
