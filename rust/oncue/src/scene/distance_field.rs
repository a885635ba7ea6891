//! A conservative distance field: how far from a point there is certainly nothing.
//!
//! The cells that a triangle passes through are marked exactly (the triangle is cut by the cells' planes), and
//! every cell learns the least distance between any of its points and any marked cell, up to [`REACH_CELLS`] cells.
//! What lies under the floor's carpet height is left out, so that feet and shins are ruled out as well; whoever
//! asks has to know that (see [`DistanceField::lower_bound`]).

use std::sync::atomic::{AtomicU8, Ordering::Relaxed};

use glam::{IVec2, IVec3, Vec3};
use rayon::prelude::*;

use super::polygon::Polygon;
use crate::error::Result;
use crate::progress::Progress;

/// Distances are kept up to so many cells: with 5 cm, 0.6 m, more than any box of the body reaches.
const REACH_CELLS: i32 = 12;
/// Steps of the stored distance in one cell: `REACH_CELLS * CELL_STEPS` fits a byte.
const CELL_STEPS: f32 = 20.0;

#[derive(Debug, Clone)]
pub(super) struct DistanceField {
    origin: Vec3,
    cell: f32,
    per_metre: f32,
    size: IVec3,
    /// The last cell on each axis.
    last: Vec3,
    /// World z under which nothing was marked.
    pub bottom: f32,
    /// The marked space; outside it there is nothing.
    bounds: (Vec3, Vec3),
    /// Lower bound of the distance in `cell / CELL_STEPS`, in tiles of 4 × 4 × 4 cells, a cache line each: the places that
    /// one body asks for share a few of them.
    steps: Vec<u8>,
    /// Tiles along x and y.
    tiles: IVec2,
}

impl DistanceField {
    /// `bounds` hold all triangles; what is lower than `bottom` is left out.
    pub(super) fn build(
        triangles: &[[Vec3; 3]],
        bounds: (Vec3, Vec3),
        bottom: f32,
        cell: f32,
        max_cells: usize,
        progress: &Progress,
    ) -> Result<Self> {
        let (lo, hi) = (bounds.0.with_z(bottom.min(bounds.1.z)), bounds.1);
        let cells = |cell: f32| ((hi - lo) / cell).floor().as_dvec3() + 1.0;
        let mut cell = cell;
        while cells(cell).element_product() > max_cells as f64 {
            cell *= 1.1;
        }
        let size = cells(cell).as_ivec3();
        let field = Self {
            origin: lo,
            cell,
            per_metre: 1.0 / cell,
            size,
            last: (size - 1).as_vec3(),
            bottom,
            bounds: (lo, hi),
            steps: Vec::new(),
            tiles: (size.truncate() + 3) / 4,
        };
        let marked = field.mark(triangles, progress)?;
        progress.check()?;
        Ok(Self { steps: field.spread(marked, progress)?, ..field })
    }

    /// No triangle higher than `bottom` is nearer to `point` than this, metres; 0 where one may be.
    pub(super) fn lower_bound(&self, point: Vec3) -> f32 {
        let outside = (point - point.clamp(self.bounds.0, self.bounds.1)).length();
        outside.max(f32::from(self.steps_at(point)) * (self.cell / CELL_STEPS))
    }

    /// A distance in the units of [`DistanceField::steps_at`], rounded up: what it must be at least.
    pub(super) fn steps_of(&self, distance: f32) -> u8 {
        // A cast of what is too much gives 255, which no cell holds.
        (distance * (CELL_STEPS * self.per_metre)).ceil() as u8
    }

    /// The stored distance of the cell at a point, in `cell / CELL_STEPS`. From outside the grid that of the nearest
    /// cell, which is a bound as well: everything lies inside, so it is nearer to the grid's border than to the point.
    #[inline(always)]
    pub(super) fn steps_at(&self, point: Vec3) -> u8 {
        let c = ((point - self.origin) * self.per_metre).clamp(Vec3::ZERO, self.last);
        self.steps.get(self.tiled(c.as_ivec3())).copied().unwrap_or(0)
    }

    pub(super) fn memory(&self) -> usize {
        self.steps.len()
    }

    #[inline(always)]
    fn index(&self, c: IVec3) -> usize {
        (c.x + self.size.x * (c.y + self.size.y * c.z)) as usize
    }

    /// Where a cell's distance is kept.
    #[inline(always)]
    fn tiled(&self, c: IVec3) -> usize {
        let tile = (c.x >> 2) + self.tiles.x * ((c.y >> 2) + self.tiles.y * (c.z >> 2));
        ((tile << 6) | (c.x & 3) | (c.y & 3) << 2 | (c.z & 3) << 4) as usize
    }

    /// 0 in every cell that a triangle higher than `bottom` passes through, 255 elsewhere.
    fn mark(&self, triangles: &[[Vec3; 3]], progress: &Progress) -> Result<Vec<u8>> {
        let count = self.size.as_i64vec3().element_product() as usize;
        let mut cells: Vec<AtomicU8> = Vec::with_capacity(count);
        cells.resize_with(count, || AtomicU8::new(u8::MAX));
        triangles.par_chunks(8192).try_for_each(|chunk| {
            for triangle in chunk {
                // A single triangle may pass through every cell of the floor.
                progress.check()?;
                // Stores of the same value: the order of the threads does not matter.
                self.pass_through(triangle, |c| cells[self.index(c)].store(0, Relaxed));
            }
            Ok(())
        })?;
        Ok(cells.into_iter().map(AtomicU8::into_inner).collect())
    }

    fn cell_range(&self, axis: usize, from: f32, to: f32) -> (i32, i32) {
        // A little wider than the triangle: rounding must not lose a cell.
        let pad = 1e-3;
        let at = |x: f32, pad: f32| ((x - self.origin[axis]) * self.per_metre + pad).floor() as i32;
        (at(from, -pad).clamp(0, self.size[axis] - 1), at(to, pad).clamp(0, self.size[axis] - 1))
    }

    fn pass_through(&self, triangle: &[Vec3; 3], mut visit: impl FnMut(IVec3)) {
        let mut polygon = Polygon::new(triangle);
        let (mut lo, mut hi) = polygon.bounds();
        if hi.z < self.bottom {
            return;
        }
        if lo.z < self.bottom {
            polygon = polygon.clip(2, self.bottom, f32::INFINITY);
            if polygon.is_empty() {
                return;
            }
            (lo, hi) = polygon.bounds();
        }
        let ranges = [0, 1, 2].map(|axis| self.cell_range(axis, lo[axis], hi[axis]));
        let spans = ranges.iter().filter(|(a, b)| a != b).count();
        let [(x0, x1), (y0, y1), (z0, z1)] = ranges;
        if spans <= 1 {
            // A run along one axis: all of it.
            for z in z0..=z1 {
                for y in y0..=y1 {
                    (x0..=x1).for_each(|x| visit(IVec3::new(x, y, z)));
                }
            }
            return;
        }
        let slab = |polygon: &Polygon, axis: usize, i: i32| {
            let from = self.origin[axis] + i as f32 * self.cell;
            let pad = 1e-3 * self.cell;
            polygon.clip(axis, from - pad, from + self.cell + pad)
        };
        for z in z0..=z1 {
            let layer = slab(&polygon, 2, z);
            if layer.is_empty() {
                continue;
            }
            let (lo, hi) = layer.bounds();
            let (y0, y1) = self.cell_range(1, lo.y, hi.y);
            for y in y0..=y1 {
                let row = slab(&layer, 1, y);
                if row.is_empty() {
                    continue;
                }
                let (lo, hi) = row.bounds();
                let (x0, x1) = self.cell_range(0, lo.x, hi.x);
                (x0..=x1).for_each(|x| visit(IVec3::new(x, y, z)));
            }
        }
    }

    /// From marks to distances: the squared distance between two cells, Σ max(|Δ| − 1, 0)², is a sum over the axes,
    /// so its minimum is found one axis after the other.
    fn spread(&self, marked: Vec<u8>, progress: &Progress) -> Result<Vec<u8>> {
        let (nx, ny, nz) = (self.size.x as usize, self.size.y as usize, self.size.z as usize);
        let far = (REACH_CELLS * REACH_CELLS) as u8;
        let square = |d: i32| ((d.abs() - 1).max(0) as u32).pow(2).min(u32::from(far)) as u8;
        // Along x: the nearest mark on either side.
        let mut rows = marked;
        rows.par_chunks_mut(nx).try_for_each(|row| {
            progress.check()?;
            let mut distance = vec![REACH_CELLS + 1; nx];
            let mut last = REACH_CELLS + 1;
            for (d, &m) in distance.iter_mut().zip(row.iter()) {
                last = if m == 0 { 0 } else { (last + 1).min(REACH_CELLS + 1) };
                *d = last;
            }
            last = REACH_CELLS + 1;
            for (d, m) in distance.iter_mut().zip(row.iter_mut()).rev() {
                last = if *m == 0 { 0 } else { (last + 1).min(REACH_CELLS + 1) };
                *m = square((*d).min(last));
            }
            Ok(())
        })?;
        // Along y, then z: the least of the neighbours' values plus the step between them, whole rows at a time.
        let slices =
            |input: &[u8], stride: usize, length: usize, position: &(dyn Fn(usize) -> usize + Sync)| {
                let mut out = vec![far; input.len()];
                out.par_chunks_mut(nx).enumerate().try_for_each(|(row, out)| {
                    progress.check()?;
                    let at = position(row) as i32;
                    for d in -REACH_CELLS..=REACH_CELLS {
                        if at + d < 0 || at + d >= length as i32 {
                            continue;
                        }
                        let first = (row * nx) as i64 + i64::from(d) * stride as i64;
                        let from = &input[first as usize..first as usize + nx];
                        let step = square(d);
                        for (o, &f) in out.iter_mut().zip(from) {
                            *o = (*o).min(f.saturating_add(step));
                        }
                    }
                    Ok(())
                })?;
                Ok(out)
            };
        let rows: Vec<u8> = slices(&rows, nx, ny, &|row| row % ny)?;
        let squares = slices(&rows, nx * ny, nz, &|row| row / ny)?;
        let table: Vec<u8> =
            (0..=255u32).map(|s| (f64::from(s).sqrt() * f64::from(CELL_STEPS)) as u8).collect();
        let layer = 64 * (self.tiles.x * self.tiles.y) as usize;
        let mut steps = vec![0; layer * nz.div_ceil(4)];
        steps.par_chunks_mut(layer).enumerate().try_for_each(|(tile_z, layer)| {
            progress.check()?;
            let z0 = 4 * tile_z as i32;
            for z in z0..(z0 + 4).min(self.size.z) {
                for y in 0..self.size.y {
                    for x in 0..self.size.x {
                        let square = squares[self.index(IVec3::new(x, y, z))];
                        layer[self.tiled(IVec3::new(x, y, z - z0))] = table[usize::from(square)];
                    }
                }
            }
            Ok(())
        })?;
        Ok(steps)
    }
}
