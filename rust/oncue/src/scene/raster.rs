//! Square cells over the floor plane.

use glam::Vec2;

/// Where the cells of a grid lie. Cells are indexed `x + width * y`; (0, 0) has its lower corner at `origin`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Raster {
    /// World x and y, metres.
    pub origin: Vec2,
    /// Edge of a cell, metres.
    pub cell: f32,
    /// Cells along x.
    pub width: usize,
    /// Cells along y.
    pub height: usize,
}

impl Raster {
    /// All cells.
    pub fn len(&self) -> usize {
        self.width * self.height
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// World place of a cell's centre.
    pub fn center(&self, index: usize) -> Vec2 {
        self.origin
            + self.cell * Vec2::new((index % self.width) as f32 + 0.5, (index / self.width) as f32 + 0.5)
    }

    /// A world place in cells from the origin; `None` outside.
    #[inline]
    fn in_cells(&self, xy: Vec2) -> Option<Vec2> {
        let p = (xy - self.origin) / self.cell;
        let inside = p.x >= 0.0 && p.y >= 0.0 && p.x < self.width as f32 && p.y < self.height as f32;
        inside.then_some(p)
    }

    /// The cell at a world place; `None` outside.
    pub fn index_at(&self, xy: Vec2) -> Option<usize> {
        // Casts of what is not negative round down.
        self.in_cells(xy).map(|p| p.x as usize + self.width * p.y as usize)
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

    /// What a value at `xy` is blended from; `None` outside.
    #[inline]
    pub fn stencil(&self, xy: Vec2) -> Option<Stencil> {
        let p = self.in_cells(xy)?;
        // Of the four centres around, those to the right and above.
        let (right, above) = ((p.x + 0.5) as usize, (p.y + 0.5) as usize);
        let (u, v) = (p.x + 0.5 - right as f32, p.y + 0.5 - above as f32);
        let (x0, x1) = (right.saturating_sub(1), right.min(self.width - 1));
        let (y0, y1) = (self.width * above.saturating_sub(1), self.width * above.min(self.height - 1));
        Some(Stencil {
            cell: p.x as usize + self.width * p.y as usize,
            corners: [x0 + y0, x1 + y0, x0 + y1, x1 + y1],
            weights: [(1.0 - u) * (1.0 - v), u * (1.0 - v), (1.0 - u) * v, u * v],
        })
    }

    /// Value at `xy` between the four nearest cell centres; `None` outside. Corners that are not finite are left
    /// out; infinite where all are.
    #[inline]
    pub fn bilinear(&self, values: &[f32], xy: Vec2) -> Option<f32> {
        self.stencil(xy).map(|s| s.blend(values))
    }
}

/// A place seen from the four cell centres around it.
#[derive(Debug, Clone, Copy)]
pub struct Stencil {
    /// The cell that the place lies in.
    pub cell: usize,
    pub corners: [usize; 4],
    /// They sum to 1.
    pub weights: [f32; 4],
}

impl Stencil {
    /// See [`Raster::bilinear`].
    #[inline]
    pub fn blend(&self, values: &[f32]) -> f32 {
        let sum: f32 = self.corners.iter().zip(self.weights).map(|(c, w)| w * values[*c]).sum();
        // Any corner that is not finite shows in the sum.
        if sum.is_finite() { sum } else { self.blend_finite(values) }
    }

    #[cold]
    fn blend_finite(&self, values: &[f32]) -> f32 {
        let (mut sum, mut weight) = (0.0, 0.0);
        for (corner, w) in self.corners.iter().zip(self.weights) {
            if values[*corner].is_finite() {
                sum += w * values[*corner];
                weight += w;
            }
        }
        if weight > 1e-6 { sum / weight } else { f32::INFINITY }
    }

    /// As [`Stencil::blend`] for directions.
    #[inline]
    pub fn blend_vectors(&self, values: &[Vec2]) -> Vec2 {
        self.corners.iter().zip(self.weights).map(|(c, w)| w * values[*c]).sum()
    }
}
