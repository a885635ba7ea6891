//! The tree over the scene's triangles: built by obvhs in chunks, walked eight boxes at a time.
//!
//! Large triangles are cut first, so that a floor does not overlap everything that stands on it; the pieces
//! refer to the whole triangle, and a crossing found in two pieces counts once. The references are halved in
//! space into chunks, obvhs builds and optimizes a binary tree for each (chunks in parallel, cancel between
//! them), and each is folded into nodes of eight children over blocks of at most eight triangles.
//! Counts do not depend on the tree's shape.

use glam::Vec3;
use obvhs::aabb::Aabb;
use rayon::prelude::*;

use super::box_edges::{OrientedBox, TriangleBlock, candidates, crossings, dot, edges_of, splat};
use super::tree_nodes::{BLOCK_FLAG, Builder, NO_CHILD, Node, Part, fold};
use super::tree_references::{halve, references};
use crate::error::Result;
use crate::progress::Progress;
use crate::simd::{Kernel, Level, Simd};

/// The tree. `nodes[0]` is the root.
#[derive(Debug, Clone)]
pub(super) struct TriangleTree {
    nodes: Vec<Node>,
    blocks: Vec<TriangleBlock>,
}

/// Reused between queries: the nodes still to visit and the crossings found on shared triangles.
#[derive(Debug, Default)]
pub(super) struct Scratch {
    stack: Vec<u32>,
    seen: Vec<(u32, u32)>,
}

impl TriangleTree {
    /// `triangles` must be finite.
    pub(super) fn build(triangles: &[[Vec3; 3]], progress: &Progress) -> Result<Self> {
        let references = references(triangles);
        progress.check()?;
        let chunks = halve(references, progress)?;
        let parts = chunks
            .into_par_iter()
            .map_init(Builder::new, |builder, chunk| {
                progress.check()?;
                Ok(Part::build(&chunk, triangles, builder))
            })
            .collect::<Result<Vec<Part>>>()?;
        progress.check()?;
        Ok(Self::join(parts))
    }

    /// Puts the parts under a tree of their own.
    fn join(parts: Vec<Part>) -> Self {
        let boxes: Vec<Aabb> = parts.iter().map(|p| p.aabb).collect();
        let mut nodes = Vec::with_capacity(parts.iter().map(|p| p.nodes.len()).sum::<usize>() + boxes.len());
        let mut blocks = Vec::with_capacity(parts.iter().map(|p| p.blocks.len()).sum());
        // The top's leaves hold part numbers until the parts' places are known.
        fold(&Builder::new().build(&boxes), 1, &mut nodes, &mut |items| BLOCK_FLAG | items[0]);
        let top = nodes.len();
        let mut roots = Vec::with_capacity(parts.len());
        for part in parts {
            let (first_node, first_block) = (nodes.len() as u32, blocks.len() as u32);
            roots.push(first_node);
            nodes.extend(part.nodes.into_iter().map(|mut node| {
                for child in node.child.iter_mut().filter(|c| **c != NO_CHILD) {
                    *child += if *child & BLOCK_FLAG == 0 { first_node } else { first_block };
                }
                node
            }));
            blocks.extend(part.blocks);
        }
        for child in nodes[..top].iter_mut().flat_map(|n| &mut n.child).filter(|c| **c != NO_CHILD) {
            if *child & BLOCK_FLAG != 0 {
                *child = roots[(*child & !BLOCK_FLAG) as usize];
            }
        }
        Self { nodes, blocks }
    }

    /// ρ(b, W) of LAMA, eq. 4, for one placed box: how often its 12 edges cross a triangle at world z >= `above`.
    pub(super) fn count(&self, placed: &OrientedBox, above: f32, scratch: &mut Scratch) -> u32 {
        self.count_at(Level::current(), placed, above, scratch)
    }

    /// [`TriangleTree::count`] at a level that the processor has.
    pub(super) fn count_at(
        &self,
        level: Level,
        placed: &OrientedBox,
        above: f32,
        scratch: &mut Scratch,
    ) -> u32 {
        level.run_in_eights(Count { tree: self, placed, above, scratch })
    }

    #[inline(always)]
    fn count_with<S: Simd>(&self, s: S, placed: &OrientedBox, above: f32, scratch: &mut Scratch) -> u32 {
        let test = NodeTest::new(s, placed);
        let mut count = 0;
        scratch.seen.clear();
        scratch.stack.clear();
        scratch.stack.push(0);
        while let Some(next) = scratch.stack.pop() {
            if next & BLOCK_FLAG == 0 {
                let node = &self.nodes[next as usize];
                let mut hit = test.overlaps(s, node);
                while hit != 0 {
                    scratch.stack.push(node.child[hit.trailing_zeros() as usize]);
                    hit &= hit - 1;
                }
                continue;
            }
            let block = &self.blocks[(next & !BLOCK_FLAG) as usize];
            let (mut found, by_edge) = candidates(s, placed, block);
            while found != 0 {
                let lane = found.trailing_zeros() as usize;
                found &= found - 1;
                let edges = crossings(placed, &block.triangle(lane), edges_of(&by_edge, lane), above);
                if edges == 0 {
                    continue;
                }
                if block.shared >> lane & 1 == 1 {
                    let index = block.index[lane];
                    if scratch.seen.iter().any(|&(seen, _)| seen == index) {
                        continue;
                    }
                    scratch.seen.push((index, edges));
                }
                count += edges.count_ones();
            }
        }
        count
    }

    /// Distance along `direction` (unit) to the nearest triangle within `max`, from either side.
    pub(super) fn ray(&self, origin: Vec3, direction: Vec3, max: f32) -> Option<f32> {
        let mut nearest = max;
        let mut hit = false;
        self.visit_ray(origin, direction, &mut nearest, |block, lane, nearest| {
            if let Some(t) = ray_triangle(origin, direction, &block.triangle(lane))
                && t <= *nearest
            {
                *nearest = t;
                hit = true;
            }
        });
        hit.then_some(nearest)
    }

    /// Every distance at which the ray passes a triangle within `max`, ascending, with |cos| of the angle between
    /// the ray and the triangle's normal. A triangle that was cut for the tree is reported once.
    pub(super) fn ray_all(&self, origin: Vec3, direction: Vec3, max: f32) -> Vec<(f32, f32)> {
        let mut hits: Vec<(f32, u32, f32)> = Vec::new();
        let mut reach = max;
        self.visit_ray(origin, direction, &mut reach, |block, lane, _| {
            let triangle = block.triangle(lane);
            if let Some(t) = ray_triangle(origin, direction, &triangle)
                && t <= max
            {
                let normal = (triangle[1] - triangle[0]).cross(triangle[2] - triangle[0]).normalize_or_zero();
                hits.push((t, block.index[lane], normal.dot(direction).abs()));
            }
        });
        hits.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        hits.dedup_by_key(|h| h.1);
        hits.into_iter().map(|(t, _, cosine)| (t, cosine)).collect()
    }

    fn visit_ray(
        &self,
        origin: Vec3,
        direction: Vec3,
        nearest: &mut f32,
        mut visit: impl FnMut(&TriangleBlock, usize, &mut f32),
    ) {
        // A zero component would give 0 · ∞; a tiny one gives the same answer without it.
        let inverse = Vec3::from_array(direction.to_array().map(|d| {
            let d = if d.abs() < 1e-20 { 1e-20f32.copysign(d) } else { d };
            1.0 / d
        }));
        let mut stack = vec![0u32];
        while let Some(next) = stack.pop() {
            if next & BLOCK_FLAG != 0 {
                let block = &self.blocks[(next & !BLOCK_FLAG) as usize];
                for lane in (0..8).filter(|&lane| block.index[lane] != u32::MAX) {
                    visit(block, lane, nearest);
                }
                continue;
            }
            let node = &self.nodes[next as usize];
            for slot in (0..8).filter(|&slot| node.child[slot] != NO_CHILD) {
                let (mut enter, mut leave) = (0.0f32, *nearest);
                for axis in 0..3 {
                    let (c, h) = (node.center[axis][slot] - origin[axis], node.half[axis][slot]);
                    let (a, b) = ((c - h) * inverse[axis], (c + h) * inverse[axis]);
                    enter = enter.max(a.min(b));
                    leave = leave.min(a.max(b));
                }
                if enter <= leave {
                    stack.push(node.child[slot]);
                }
            }
        }
    }

    /// Visits every triangle that may reach into the box from `low` to `high`, once or more.
    pub(super) fn visit_near(&self, low: Vec3, high: Vec3, mut visit: impl FnMut(&[Vec3; 3])) {
        let (middle, reach) = (0.5 * (low + high), 0.5 * (high - low));
        let mut stack = vec![0u32];
        while let Some(next) = stack.pop() {
            if next & BLOCK_FLAG != 0 {
                let block = &self.blocks[(next & !BLOCK_FLAG) as usize];
                for lane in (0..8).filter(|&lane| block.index[lane] != u32::MAX) {
                    let triangle = block.triangle(lane);
                    let [a, b, c] = triangle;
                    if a.min(b).min(c).cmple(high).all() && a.max(b).max(c).cmpge(low).all() {
                        visit(&triangle);
                    }
                }
                continue;
            }
            let node = &self.nodes[next as usize];
            for slot in (0..8).filter(|&slot| node.child[slot] != NO_CHILD) {
                let meets = |axis: usize| {
                    let apart = (node.center[axis][slot] - middle[axis]).abs();
                    apart <= node.half[axis][slot] + reach[axis]
                };
                if (0..3).all(meets) {
                    stack.push(node.child[slot]);
                }
            }
        }
    }

    /// The triangles that it was built from, in their order.
    pub(super) fn triangles(&self) -> Vec<[Vec3; 3]> {
        let lanes = || {
            let of = |block: &TriangleBlock| {
                (0..8).map(|lane| (block.index[lane], block.triangle(lane))).collect::<Vec<_>>()
            };
            self.blocks.iter().flat_map(of).filter(|(index, _)| *index != u32::MAX)
        };
        let count = lanes().map(|(index, _)| index as usize + 1).max().unwrap_or(0);
        let mut out = vec![[Vec3::ZERO; 3]; count];
        lanes().for_each(|(index, triangle)| out[index as usize] = triangle);
        out
    }

    /// Bytes held.
    pub(super) fn memory(&self) -> usize {
        self.nodes.len() * size_of::<Node>() + self.blocks.len() * size_of::<TriangleBlock>()
    }
}

/// [`TriangleTree::count`].
struct Count<'a> {
    tree: &'a TriangleTree,
    placed: &'a OrientedBox,
    above: f32,
    scratch: &'a mut Scratch,
}

impl Kernel for Count<'_> {
    type Output = u32;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> u32 {
        self.tree.count_with(simd, self.placed, self.above, self.scratch)
    }
}

/// The test of a placed box's edges against a node's boxes, prepared once a query. `S` has eight lanes.
struct NodeTest<S: Simd> {
    center: [S::F32; 3],
    world_half: [S::F32; 3],
    axes: [[S::F32; 3]; 3],
    half: [S::F32; 3],
}

impl<S: Simd> NodeTest<S> {
    #[inline(always)]
    fn new(s: S, placed: &OrientedBox) -> Self {
        Self {
            center: splat(s, placed.center),
            world_half: splat(s, placed.world_half_extents),
            axes: [splat(s, placed.axes.x_axis), splat(s, placed.axes.y_axis), splat(s, placed.axes.z_axis)],
            half: splat(s, placed.half_extents),
        }
    }

    /// Bit i: child i may touch an edge of the box.
    #[inline(always)]
    fn overlaps(&self, s: S, node: &Node) -> u32 {
        let half = [s.load(&node.half[0]), s.load(&node.half[1]), s.load(&node.half[2])];
        let apart = [
            s.sub(s.load(&node.center[0]), self.center[0]),
            s.sub(s.load(&node.center[1]), self.center[1]),
            s.sub(s.load(&node.center[2]), self.center[2]),
        ];
        let mut bits = 0xff;
        for i in 0..3 {
            bits &= s.le(s.abs(apart[i]), s.add(half[i], self.world_half[i]));
        }
        if bits == 0 {
            return 0;
        }
        // In the box's frame. An edge lies on two of the face planes: what reaches fewer than two, as all that is well
        // inside the box does, crosses none.
        let (mut one, mut two) = (0, 0);
        for i in 0..3 {
            let (axis, own) = (self.axes[i], self.half[i]);
            let along = s.abs(dot(s, apart, axis));
            let reach = dot(s, half, [s.abs(axis[0]), s.abs(axis[1]), s.abs(axis[2])]);
            let beyond = s.sub(along, own);
            bits &= s.le(beyond, reach);
            let plane = s.le(s.abs(beyond), reach);
            two |= one & plane;
            one |= plane;
        }
        bits &= two;
        bits
    }
}

/// Distance along the ray to the triangle, from either side (Möller and Trumbore 1997).
fn ray_triangle(origin: Vec3, direction: Vec3, triangle: &[Vec3; 3]) -> Option<f32> {
    let (e1, e2) = (triangle[1] - triangle[0], triangle[2] - triangle[0]);
    let p = direction.cross(e2);
    let determinant = e1.dot(p);
    if determinant == 0.0 {
        return None;
    }
    let s = origin - triangle[0];
    let q = s.cross(e1);
    let (u, v) = (s.dot(p) / determinant, direction.dot(q) / determinant);
    // A hair beyond the border, so that no ray slips between two triangles.
    let slack = -1e-6;
    (u >= slack && v >= slack && u + v <= 1.0 - slack).then(|| e2.dot(q) / determinant).filter(|t| *t >= 0.0)
}
