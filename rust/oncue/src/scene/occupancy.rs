//! The occupancy grid g_occ on the floor plane (LAMA, section 3.2), and the clearance from it.
//!
//! A cell is occupied when any triangle passes through it between 0.15 and 1.2 m over the floor: the triangle
//! is cut to that layer and its outline drawn on the grid, so that a large triangle without a vertex in the
//! layer counts (the released code looks at vertices).

use std::sync::atomic::{AtomicU8, Ordering::Relaxed};

use glam::{IVec2, Vec2, Vec3};
use rayon::prelude::*;

use super::polygon::Polygon;
use super::raster::Raster;
use super::settings::SceneSettings;
use crate::error::Result;
use crate::progress::Progress;

/// Clearance is measured up to this, metres.
const MOST_CLEARANCE: f32 = 3.0;
/// Holes in a scanned floor up to twice this wide are walked over, metres.
const HOLE: f32 = 0.15;

const OCCUPIED: u8 = 1;
const FLOOR: u8 = 2;

/// g_occ over the whole scene.
#[derive(Debug, Clone)]
pub struct OccupancyGrid {
    /// Where the cells lie.
    pub raster: Raster,
    /// A triangle passes through the cell in the layer.
    occupied: Vec<bool>,
    /// Free, and a floor under it.
    walkable: Vec<bool>,
    /// From each cell's centre to the nearest cell that is not walkable, metres.
    clearance: Vec<f32>,
}

impl OccupancyGrid {
    /// Draws all triangles that lie between the heights of the settings over the floor.
    pub fn build(
        triangles: &[[Vec3; 3]],
        bounds: (Vec3, Vec3),
        floor: f32,
        settings: &SceneSettings,
        progress: &Progress,
    ) -> Result<Self> {
        let (lo, hi) = (bounds.0.truncate(), bounds.1.truncate());
        let mut cell = settings.cell_size;
        let cells = |cell: f32| ((hi - lo) / cell).floor().as_dvec2() + 1.0;
        while cells(cell).element_product() > settings.max_cells as f64 / 4.0 {
            cell *= 1.1;
        }
        let size = cells(cell).as_uvec2();
        let (width, height) = (size.x as usize, size.y as usize);
        let mut grid = Self {
            raster: Raster { origin: lo, cell, width, height },
            occupied: Vec::new(),
            walkable: Vec::new(),
            clearance: Vec::new(),
        };
        let mut flags: Vec<AtomicU8> = Vec::with_capacity(width * height);
        flags.resize_with(width * height, AtomicU8::default);
        let layers = [
            (OCCUPIED, floor + settings.occupied_from, floor + settings.occupied_to),
            (FLOOR, floor - settings.floor_tolerance, floor + settings.floor_tolerance),
        ];
        triangles.par_chunks(8192).try_for_each(|chunk| {
            for triangle in chunk {
                // A single triangle may cover every cell of the floor.
                progress.check()?;
                for (flag, from, to) in layers {
                    grid.draw(triangle, from, to, |i| {
                        flags[i].fetch_or(flag, Relaxed);
                    });
                }
            }
            Ok(())
        })?;
        let has = |flag: u8| flags.iter().map(|f| f.load(Relaxed) & flag != 0).collect::<Vec<bool>>();
        grid.occupied = has(OCCUPIED);
        let floor = grid.without_holes(has(FLOOR), progress)?;
        grid.walkable = grid.occupied.iter().zip(&floor).map(|(&o, &f)| f && !o).collect();
        let blocked: Vec<bool> = grid.walkable.iter().map(|w| !w).collect();
        grid.clearance = grid.distance_to(&blocked, MOST_CLEARANCE, true, progress)?;
        Ok(grid)
    }

    /// Whether a triangle occupies the cell at `xy` (world); true outside the grid.
    pub fn is_occupied(&self, xy: Vec2) -> bool {
        self.raster.index_at(xy).is_none_or(|i| self.occupied[i])
    }

    /// Whether one can stand at `xy`: free, and a floor under it.
    pub fn is_walkable(&self, xy: Vec2) -> bool {
        self.raster.index_at(xy).is_some_and(|i| self.walkable[i])
    }

    /// Distance from `xy` to the nearest cell that is occupied, has no floor or lies outside the scene, metres
    /// (bilinear between cell centres; 0 inside such a cell's neighbourhood, at most 3).
    pub fn clearance(&self, xy: Vec2) -> f32 {
        self.raster.bilinear(&self.clearance, xy).unwrap_or(0.0)
    }

    /// g_occ: occupied cells, row by row (`x + width * y`).
    pub fn occupied_cells(&self) -> &[bool] {
        &self.occupied
    }

    /// Walkable cells, row by row.
    pub fn walkable_cells(&self) -> &[bool] {
        &self.walkable
    }

    /// Clearance at the cells' centres, row by row, metres.
    pub fn clearance_cells(&self) -> &[f32] {
        &self.clearance
    }

    /// Bytes held.
    pub fn memory(&self) -> usize {
        self.occupied.len() * 6
    }

    /// Calls `visit` for each cell over which the part of the triangle between the heights lies.
    fn draw(&self, triangle: &[Vec3; 3], from: f32, to: f32, mut visit: impl FnMut(usize)) {
        let z = triangle.map(|v| v.z);
        let (low, high) = (z[0].min(z[1]).min(z[2]), z[0].max(z[1]).max(z[2]));
        if low > to || high < from {
            return;
        }
        let mut polygon = Polygon::new(triangle);
        if low < from || high > to {
            polygon = polygon.clip(2, from, to);
        }
        if polygon.is_empty() {
            return;
        }
        let (lo, hi) = polygon.bounds();
        let last = IVec2::new(self.raster.width as i32 - 1, self.raster.height as i32 - 1);
        let cell_of = |p: Vec2| {
            ((p - self.raster.origin) / self.raster.cell).floor().as_ivec2().clamp(IVec2::ZERO, last)
        };
        let (a, b) = (cell_of(lo.truncate()), cell_of(hi.truncate()));
        for y in a.y..=b.y {
            let (mut x0, mut x1) = (a.x, b.x);
            if a.y != b.y && a.x != b.x {
                let bottom = self.raster.origin.y + y as f32 * self.raster.cell;
                let row = polygon.clip(1, bottom, bottom + self.raster.cell);
                if row.is_empty() {
                    continue;
                }
                let (lo, hi) = row.bounds();
                (x0, x1) = (cell_of(lo.truncate()).x, cell_of(hi.truncate()).x);
            }
            for x in x0..=x1 {
                visit(x as usize + self.raster.width * y as usize);
            }
        }
    }

    /// The floor with narrow holes closed: grown by [`HOLE`], then shrunk by it, so that its outline stays.
    fn without_holes(&self, floor: Vec<bool>, progress: &Progress) -> Result<Vec<bool>> {
        let reach = HOLE + self.raster.cell;
        let gap: Vec<bool> =
            self.distance_to(&floor, reach, false, progress)?.iter().map(|&d| d > HOLE).collect();
        let grown = self.distance_to(&gap, reach, false, progress)?;
        Ok(floor.iter().zip(grown).map(|(&f, d)| f || d > HOLE).collect())
    }

    /// Exact distance from each cell's centre to the nearest marked cell (to its border), at most `most`; with
    /// `walled`, everything outside the grid is marked too.
    fn distance_to(&self, marked: &[bool], most: f32, walled: bool, progress: &Progress) -> Result<Vec<f32>> {
        let (nx, ny) = (self.raster.width, self.raster.height);
        let reach = (most / self.raster.cell).ceil() as usize + 1;
        let square = |d: usize| (d as f32 - 0.5).max(0.0).powi(2);
        let outside = if walled { 0 } else { reach };
        // Cells along the row to the nearest mark.
        let mut rows = vec![reach; nx * ny];
        rows.par_chunks_mut(nx).zip(marked.par_chunks(nx)).try_for_each(|(row, marked)| {
            progress.check()?;
            let mut last = outside;
            for (d, &m) in row.iter_mut().zip(marked) {
                last = if m { 0 } else { (last + 1).min(reach) };
                *d = last;
            }
            last = outside;
            for (d, &m) in row.iter_mut().zip(marked).rev() {
                last = if m { 0 } else { (last + 1).min(reach) };
                *d = (*d).min(last);
            }
            Ok(())
        })?;
        let mut out = vec![0.0; nx * ny];
        out.par_chunks_mut(nx).enumerate().try_for_each(|(y, out)| {
            progress.check()?;
            for (x, out) in out.iter_mut().enumerate() {
                let mut best = square(rows[x + nx * y]);
                for d in 1..=reach {
                    let step = square(d);
                    if step >= best {
                        break;
                    }
                    for row in [y.checked_sub(d), Some(y + d).filter(|&r| r < ny)] {
                        best = match row {
                            Some(row) => best.min(square(rows[x + nx * row]) + step),
                            None if walled => best.min(step),
                            None => best,
                        };
                    }
                }
                *out = (best.sqrt() * self.raster.cell).min(most);
            }
            Ok(())
        })?;
        Ok(out)
    }
}
