//! Square cells over the floor plane.

use glam::Vec2;

use crate::math::floor;

/// Where the cells of a grid lie. Cells are indexed `x + width * y`; (0, 0) has its lower corner at `origin`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Raster {
    /// World x and y, metres.
    pub origin: Vec2,
    /// Edge of a cell, metres.
    pub cell: f32,
    pub width: usize,
    pub height: usize,
}

impl Raster {
    pub fn len(&self) -> usize {
        self.width * self.height
    }

    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// World place of a cell's centre.
    pub fn center(&self, index: usize) -> Vec2 {
        self.origin
            + self.cell * Vec2::new((index % self.width) as f32 + 0.5, (index / self.width) as f32 + 0.5)
    }

    /// The cell at a world place; `None` outside.
    pub fn index_at(&self, xy: Vec2) -> Option<usize> {
        let c = floor((xy - self.origin) / self.cell);
        let inside = c.cmpge(Vec2::ZERO).all() && c.x < self.width as f32 && c.y < self.height as f32;
        inside.then(|| c.x as usize + self.width * c.y as usize)
    }

    /// The neighbours left, right, below and above; `None` beyond the border.
    pub fn neighbours(&self, index: usize) -> [Option<usize>; 4] {
        let (x, y) = (index % self.width, index / self.width);
        [
            (x > 0).then(|| index - 1),
            (x + 1 < self.width).then(|| index + 1),
            (y > 0).then(|| index - self.width),
            (y + 1 < self.height).then(|| index + self.width),
        ]
    }

    /// Value at `xy` between the four nearest cell centres; `None` outside. Corners that are not finite are left
    /// out; infinite where all are.
    pub fn bilinear(&self, values: &[f32], xy: Vec2) -> Option<f32> {
        self.index_at(xy)?;
        let p = (xy - self.origin) / self.cell - 0.5;
        let low = floor(p);
        let f = p - low;
        let at = |dx: i32, dy: i32| {
            let x = (low.x as i32 + dx).clamp(0, self.width as i32 - 1) as usize;
            let y = (low.y as i32 + dy).clamp(0, self.height as i32 - 1) as usize;
            values[x + self.width * y]
        };
        let corners = [
            (at(0, 0), (1.0 - f.x) * (1.0 - f.y)),
            (at(1, 0), f.x * (1.0 - f.y)),
            (at(0, 1), (1.0 - f.x) * f.y),
            (at(1, 1), f.x * f.y),
        ];
        let (mut sum, mut weight) = (0.0, 0.0);
        for (value, w) in corners {
            if value.is_finite() {
                sum += w * value;
                weight += w;
            }
        }
        Some(if weight > 1e-6 { sum / weight } else { f32::INFINITY })
    }
}
