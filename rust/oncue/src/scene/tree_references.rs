//! What the tree is built over: the triangles, the long ones cut into pieces, in chunks of neighbours.

use glam::{Vec3, Vec3A};
use obvhs::aabb::Aabb;
use rayon::prelude::*;

use super::polygon::Polygon;
use crate::error::Result;
use crate::progress::Progress;

/// References handed to obvhs at once: about 30 ms of work, so that a cancel is seen in time.
const REFERENCE_CHUNK: usize = 32_768;
/// The same of references many of which have one box: obvhs (0.4.0) clusters these in a time that grows with their square.
const ALIKE_CHUNK: usize = 512;
/// Of a chunk so many references are looked at, spread over it; it is alike where so many of them have one box.
const LOOKED_AT: usize = 256;
const ALIKE: usize = 16;
/// Triangles longer than this are cut for the tree, metres; doubled until the pieces stay within `SPLIT_BUDGET`.
const PIECE_LENGTH: f32 = 0.5;
/// Most pieces beyond one a triangle: this share of the triangles, and a floor for small scenes.
const SPLIT_BUDGET: (f32, usize) = (0.25, 16_384);

/// One entry of the tree: a triangle or a piece of one.
#[derive(Debug, Clone, Copy)]
pub(super) struct Reference {
    pub aabb: Aabb,
    pub triangle: u32,
    pub shared: bool,
}

/// The triangles as references, the long ones cut into pieces.
pub(super) fn references(triangles: &[[Vec3; 3]]) -> Vec<Reference> {
    let extent = |t: &[Vec3; 3]| t[0].max(t[1]).max(t[2]) - t[0].min(t[1]).min(t[2]);
    let budget = SPLIT_BUDGET.1 + (SPLIT_BUDGET.0 * triangles.len() as f32) as usize;
    let mut piece = PIECE_LENGTH;
    let pieces = |piece: f32| -> f64 {
        let of = |t: &[Vec3; 3]| {
            let e = extent(t);
            let cells = (e / piece).ceil().max(Vec3::ONE);
            // A flat piece takes about the cells of its largest face.
            let m = cells.max_element() as f64;
            if m <= 1.0 { 0.0 } else { m * (cells.element_product() as f64 / m).sqrt().max(1.0) }
        };
        triangles.par_iter().map(of).collect::<Vec<_>>().iter().sum()
    };
    while pieces(piece) > budget as f64 {
        piece *= 2.0;
    }
    triangles
        .par_iter()
        .enumerate()
        .flat_map_iter(|(index, triangle)| {
            let mut out = Vec::with_capacity(1);
            let long = extent(triangle).max_element() > piece;
            let mut open = vec![Polygon::new(triangle)];
            while let Some(polygon) = open.pop() {
                let (lo, hi) = polygon.bounds();
                let size = hi - lo;
                if size.max_element() <= piece {
                    let aabb = Aabb::new(Vec3A::from(lo), Vec3A::from(hi));
                    out.push(Reference { aabb, triangle: index as u32, shared: long });
                    continue;
                }
                let axis = size.max_position();
                let middle = 0.5 * (lo[axis] + hi[axis]);
                open.extend(
                    [polygon.clip(axis, lo[axis], middle), polygon.clip(axis, middle, hi[axis])]
                        .into_iter()
                        .filter(|p| !p.is_empty()),
                );
            }
            out
        })
        .collect()
}

/// Halves the references about the median of their centres along the longest side, until each part is a chunk.
pub(super) fn halve(mut references: Vec<Reference>, progress: &Progress) -> Result<Vec<Vec<Reference>>> {
    progress.check()?;
    if references.len() <= ALIKE_CHUNK || (references.len() <= REFERENCE_CHUNK && !are_alike(&references)) {
        return Ok(vec![references]);
    }
    let center = |r: &Reference| r.aabb.min + r.aabb.max;
    let first = center(&references[0]);
    let (lo, hi) = references.iter().map(center).fold((first, first), |(lo, hi), c| (lo.min(c), hi.max(c)));
    let axis = Vec3::from(hi - lo).max_position();
    let middle = references.len() / 2;
    references.select_nth_unstable_by(middle, |a, b| center(a)[axis].total_cmp(&center(b)[axis]));
    let upper = references.split_off(middle);
    let (lower, upper) = rayon::join(|| halve(references, progress), || halve(upper, progress));
    let mut chunks = lower?;
    chunks.extend(upper?);
    Ok(chunks)
}

/// Whether many of the references have one box, as those of a floor that is there a thousand times.
fn are_alike(references: &[Reference]) -> bool {
    let step = (references.len() / LOOKED_AT).max(1);
    let key = |r: &Reference| [r.aabb.min, r.aabb.max].map(|v| v.to_array().map(f32::to_bits));
    let mut boxes: Vec<_> = references.iter().step_by(step).map(key).collect();
    boxes.sort_unstable();
    boxes.chunk_by(|a, b| a == b).any(|same| same.len() >= ALIKE)
}
