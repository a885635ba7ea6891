//! The floor: the level under a person's feet, or that most of the scene can be walked on where nobody stands yet.

use std::f32::consts::FRAC_PI_4;

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::settings::SceneSettings;
use super::triangle_tree::TriangleTree;
use crate::error::Result;
use crate::progress::Progress;

/// Columns looked at along the longer side.
const COLUMNS: usize = 96;
/// A surface counts as level when its normal is within about 35 degrees of the vertical.
const LEVEL: f32 = 0.82;
/// Heights are counted in steps of 1 cm; a floor's own unevenness and rugs stay within `LEVEL_STEPS` of them.
const HEIGHT_STEP: f32 = 0.01;
const LEVEL_STEPS: i64 = 3;
/// A foot stands on what lies within this of its place, metres; and up to so high over it.
const FOOT: f32 = 0.05;
const STEP_UP: f32 = 0.25;

/// World z of the dominant walkable level: of the lowest level surface with `headroom` over it in each of many
/// columns, the height that most columns share. The lowest vertex where no column has such a surface.
pub(super) fn dominant_level(
    tree: &TriangleTree,
    bounds: (Vec3, Vec3),
    headroom: f32,
    progress: &Progress,
) -> Result<f32> {
    let lowest = |hits: &[Level]| hits.iter().find(|level| level.room >= headroom).map(|level| level.z);
    Ok(most_shared(columns(tree, bounds, lowest, progress)?, bounds.0.z).unwrap_or(bounds.0.z))
}

/// World z of the level that carries who stands at `place`: the `dominant` one unless the surface under the place lies
/// more than a carpet over or under it; then the height that most columns share of what lies at that surface's height.
pub(super) fn level_under(
    tree: &TriangleTree,
    bounds: (Vec3, Vec3),
    dominant: f32,
    place: Vec3,
    settings: &SceneSettings,
    progress: &Progress,
) -> Result<f32> {
    if !place.is_finite() {
        return Ok(dominant);
    }
    let Some(under) = support(tree, bounds.0.z, place) else { return Ok(dominant) };
    if (under - dominant).abs() <= settings.carpet_height {
        return Ok(dominant);
    }
    let near = HEIGHT_STEP * LEVEL_STEPS as f32;
    let beside = |hits: &[Level]| hits.iter().map(|level| level.z).find(|z| (z - under).abs() <= near);
    Ok(most_shared(columns(tree, bounds, beside, progress)?, bounds.0.z).unwrap_or(under))
}

/// The highest surface that a foot at `place` may stand on.
fn support(tree: &TriangleTree, bottom: f32, place: Vec3) -> Option<f32> {
    let around = (0..8).map(|i| Vec2::from_angle(i as f32 * FRAC_PI_4) * FOOT);
    let from = place.z + STEP_UP;
    std::iter::once(Vec2::ZERO)
        .chain(around)
        .filter_map(|d| {
            tree.ray((place.truncate() + d).extend(from), Vec3::NEG_Z, from - bottom + 0.1).map(|t| from - t)
        })
        .reduce(f32::max)
}

/// What `pick` finds among the level surfaces of each of many columns, in rising order.
fn columns(
    tree: &TriangleTree,
    bounds: (Vec3, Vec3),
    pick: impl Fn(&[Level]) -> Option<f32> + Sync,
    progress: &Progress,
) -> Result<Vec<f32>> {
    let (lo, hi) = bounds;
    let step = (hi - lo).truncate().max_element() / COLUMNS as f32;
    if step <= 0.0 {
        return Ok(Vec::new());
    }
    let count = ((hi - lo).truncate() / step).ceil().max(Vec2::ONE).as_uvec2();
    let found: Vec<Option<f32>> = (0..count.x * count.y)
        .into_par_iter()
        .map(|i| {
            // A column may go through a floor that is there a thousand times.
            progress.check()?;
            // Off the middle of the cells, as modelled scenes have their edges on round numbers.
            let xy =
                lo.truncate() + step * Vec2::new((i % count.x) as f32 + 0.47, (i / count.x) as f32 + 0.53);
            Ok(pick(&levels(tree, xy, lo.z, hi.z)))
        })
        .collect::<Result<_>>()?;
    let mut heights: Vec<f32> = found.into_iter().flatten().collect();
    heights.sort_by(f32::total_cmp);
    Ok(heights)
}

/// The height that most of the `heights`, in rising order, share.
fn most_shared(heights: Vec<f32>, bottom: f32) -> Option<f32> {
    let bin = |z: f32| ((z - bottom) / HEIGHT_STEP) as i64;
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
    best.get(best.len() / 2).copied()
}

/// A level surface, and how far over it the next thing is, metres.
struct Level {
    z: f32,
    room: f32,
}

/// The level surfaces of a column, from below.
fn levels(tree: &TriangleTree, xy: Vec2, bottom: f32, top: f32) -> Vec<Level> {
    let below = bottom - 1.0;
    let hits = tree.ray_all(xy.extend(below), Vec3::Z, top - bottom + 2.0);
    let mut next = 0;
    let level = |&(t, cosine): &(f32, f32)| {
        // The surfaces of one thin slab lie closer than a step of the histogram: look past them.
        while hits.get(next).is_some_and(|over| over.0 <= t + 1e-4) {
            next += 1;
        }
        let room = hits.get(next).map_or(f32::INFINITY, |over| over.0 - t);
        (cosine >= LEVEL).then_some(Level { z: below + t, room })
    };
    hits.iter().filter_map(level).collect()
}
