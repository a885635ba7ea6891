//! From obvhs's binary trees to nodes of eight children over blocks of eight triangles.

use glam::Vec3;
use obvhs::aabb::Aabb;
use obvhs::bvh2::{Bvh2, reinsertion::ReinsertionOptimizer};
use obvhs::ploc::{PlocBuilder, PlocSearchDistance, SortPrecision};

use super::box_edges::TriangleBlock;
use super::tree_references::Reference;

/// Marks a child that is a block of triangles.
pub(super) const BLOCK_FLAG: u32 = 1 << 31;
/// A slot of a node that holds nothing.
pub(super) const NO_CHILD: u32 = u32::MAX;

/// Eight boxes side by side (centre and half size; unused ones have a negative size) and what is in them.
#[derive(Debug, Clone)]
#[repr(C, align(32))]
pub(super) struct Node {
    pub center: [[f32; 8]; 3],
    pub half: [[f32; 8]; 3],
    pub child: [u32; 8],
}

impl Node {
    fn empty() -> Self {
        Self { center: [[0.0; 8]; 3], half: [[f32::NEG_INFINITY; 8]; 3], child: [NO_CHILD; 8] }
    }

    fn set(&mut self, slot: usize, aabb: &Aabb, child: u32) {
        for axis in 0..3 {
            let (lo, hi) = (aabb.min[axis], aabb.max[axis]);
            self.center[axis][slot] = 0.5 * (lo + hi);
            // Wider by more than rounding can move a crossing.
            self.half[axis][slot] = 0.5 * (hi - lo) + 1e-5 + 1e-6 * lo.abs().max(hi.abs());
        }
        self.child[slot] = child;
    }
}

/// The tree of one chunk, with node and block numbers of its own.
pub(super) struct Part {
    pub aabb: Aabb,
    pub nodes: Vec<Node>,
    pub blocks: Vec<TriangleBlock>,
}

impl Part {
    pub(super) fn build(chunk: &[Reference], triangles: &[[Vec3; 3]], builder: &mut Builder) -> Self {
        let boxes: Vec<Aabb> = chunk.iter().map(|r| r.aabb).collect();
        let tree = builder.build(&boxes);
        let mut blocks = Vec::with_capacity(chunk.len() / 4 + 1);
        let mut nodes = Vec::with_capacity(chunk.len() / 24 + 1);
        fold(&tree, 8, &mut nodes, &mut |items| {
            let mut block = TriangleBlock::empty();
            for (lane, &item) in items.iter().enumerate() {
                let reference = &chunk[item as usize];
                block.set(
                    lane,
                    &triangles[reference.triangle as usize],
                    reference.triangle,
                    reference.shared,
                );
            }
            blocks.push(block);
            BLOCK_FLAG | (blocks.len() - 1) as u32
        });
        let aabb = boxes.iter().fold(boxes[0], |all, b| all.union(b));
        Self { aabb, nodes, blocks }
    }
}

/// obvhs's builders, kept for their memory.
pub(super) struct Builder {
    cluster: PlocBuilder,
    reinsert: ReinsertionOptimizer,
}

impl Builder {
    pub(super) fn new() -> Self {
        Self { cluster: PlocBuilder::new(), reinsert: ReinsertionOptimizer::default() }
    }

    /// The binary tree, one box a leaf: locally ordered clustering, then reinsertion.
    pub(super) fn build(&mut self, boxes: &[Aabb]) -> Bvh2 {
        let indices = (0..boxes.len() as u32).collect();
        let mut tree = self.cluster.build(PlocSearchDistance::Medium, boxes, indices, SortPrecision::U64, 3);
        self.reinsert.run(&mut tree, 0.05, None);
        tree
    }
}

/// Folds a binary tree into nodes of eight children, root first; `emit` turns at most `leaf_size` leaves into a child.
pub(super) fn fold(
    tree: &Bvh2,
    leaf_size: usize,
    nodes: &mut Vec<Node>,
    emit: &mut impl FnMut(&[u32]) -> u32,
) {
    let sizes = leaf_counts(tree);
    let is_child = |node: usize| sizes[node] as usize <= leaf_size;
    let area = |node: usize| if is_child(node) { -1.0 } else { tree.nodes[node].aabb().half_area() };
    // (binary node, node and slot that are to name the folded one)
    let mut open: Vec<(usize, Option<(usize, usize)>)> = vec![(0, None)];
    let mut items = Vec::with_capacity(leaf_size);
    while let Some((root, place)) = open.pop() {
        let (mut children, mut areas, mut count) = ([root; 8], [area(root); 8], 1);
        // Open the largest box that is not yet a leaf, until eight are there.
        while count < 8 {
            let mut largest = 0;
            for i in 1..count {
                if areas[i] > areas[largest] {
                    largest = i;
                }
            }
            if areas[largest] < 0.0 {
                break;
            }
            let first = tree.nodes[children[largest]].first_index as usize;
            (children[largest], areas[largest]) = (first, area(first));
            (children[count], areas[count]) = (first + 1, area(first + 1));
            count += 1;
        }
        let number = nodes.len();
        nodes.push(Node::empty());
        if let Some((parent, slot)) = place {
            nodes[parent].child[slot] = number as u32;
        }
        for (slot, &child) in children[..count].iter().enumerate() {
            let mut name = NO_CHILD;
            if is_child(child) {
                items.clear();
                gather(tree, child, &mut items);
                name = emit(&items);
            } else {
                open.push((child, Some((number, slot))));
            }
            nodes[number].set(slot, tree.nodes[child].aabb(), name);
        }
    }
}

/// Leaves under each node of the binary tree.
fn leaf_counts(tree: &Bvh2) -> Vec<u32> {
    let mut order = Vec::with_capacity(tree.nodes.len());
    let mut next = 0;
    order.push(0u32);
    while next < order.len() {
        let node = &tree.nodes[order[next] as usize];
        if !node.is_leaf() {
            order.extend([node.first_index, node.first_index + 1]);
        }
        next += 1;
    }
    let mut counts = vec![0u32; tree.nodes.len()];
    for &node in order.iter().rev() {
        let n = &tree.nodes[node as usize];
        counts[node as usize] = if n.is_leaf() {
            n.prim_count
        } else {
            counts[n.first_index as usize] + counts[n.first_index as usize + 1]
        };
    }
    counts
}

/// The boxes under a node of the binary tree that has few.
fn gather(tree: &Bvh2, node: usize, items: &mut Vec<u32>) {
    let n = &tree.nodes[node];
    let first = n.first_index as usize;
    if n.is_leaf() {
        items.extend(&tree.primitive_indices[first..first + n.prim_count as usize]);
    } else {
        gather(tree, first, items);
        gather(tree, first + 1, items);
    }
}
