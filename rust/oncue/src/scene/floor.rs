//! The floor: the level that most of the scene can be walked on.

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::triangle_tree::TriangleTree;

/// Columns looked at along the longer side.
const COLUMNS: usize = 96;
/// A surface counts as level when its normal is within about 35 degrees of the vertical.
const LEVEL: f32 = 0.82;
/// Heights are counted in steps of 1 cm; a floor's own unevenness and rugs stay within `LEVEL_STEPS` of them.
const HEIGHT_STEP: f32 = 0.01;
const LEVEL_STEPS: i64 = 3;

/// World z of the dominant walkable level: of the lowest level surface with `headroom` over it in each of many
/// columns, the height that most columns share. The lowest vertex where no column has such a surface.
pub(super) fn dominant_level(tree: &TriangleTree, bounds: (Vec3, Vec3), headroom: f32) -> f32 {
    let (lo, hi) = bounds;
    let step = (hi - lo).truncate().max_element() / COLUMNS as f32;
    if step <= 0.0 {
        return lo.z;
    }
    let count = ((hi - lo).truncate() / step).ceil().max(Vec2::ONE).as_uvec2();
    let mut heights: Vec<f32> = (0..count.x * count.y)
        .into_par_iter()
        .filter_map(|i| {
            // Off the middle of the cells, as modelled scenes have their edges on round numbers.
            let xy =
                lo.truncate() + step * Vec2::new((i % count.x) as f32 + 0.47, (i / count.x) as f32 + 0.53);
            lowest_level(tree, xy, lo.z, hi.z, headroom)
        })
        .collect();
    heights.sort_by(f32::total_cmp);
    let bin = |z: f32| ((z - lo.z) / HEIGHT_STEP) as i64;
    // The window of 2 LEVEL_STEPS + 1 steps that holds most columns; the lowest of equals.
    let mut best: &[f32] = &[];
    let mut end = 0;
    for first in 0..heights.len() {
        end = end.max(first);
        while end < heights.len() && bin(heights[end]) <= bin(heights[first]) + 2 * LEVEL_STEPS {
            end += 1;
        }
        if end - first > best.len() {
            best = &heights[first..end];
        }
    }
    best.get(best.len() / 2).copied().unwrap_or(lo.z)
}

fn lowest_level(tree: &TriangleTree, xy: Vec2, bottom: f32, top: f32, headroom: f32) -> Option<f32> {
    let below = bottom - 1.0;
    let hits = tree.ray_all(xy.extend(below), Vec3::Z, top - bottom + 2.0);
    hits.iter().enumerate().find_map(|(i, &(t, cosine))| {
        // The surfaces of one thin slab lie closer than a step of the histogram: look past them.
        let next = hits[i + 1..].iter().map(|h| h.0).find(|&n| n > t + 1e-4);
        (cosine >= LEVEL && next.is_none_or(|n| n - t >= headroom)).then_some(below + t)
    })
}
