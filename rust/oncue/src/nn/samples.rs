//! How the numbers of a batch lie in memory for [`super::product`].

use ndarray::{ArrayView2, ShapeBuilder, s};

use super::product::{Padded, TILE};

/// A matrix with its rows padded, so that whole tiles may be read and written.
#[derive(Debug, Clone, Default)]
pub(super) struct Samples {
    pub data: Vec<f32>,
    pub rows: usize,
    pub columns: usize,
    stride: usize,
}

impl Samples {
    /// Takes a shape; what it holds afterwards are any (finite) numbers.
    pub(super) fn reshape(&mut self, rows: usize, columns: usize) {
        (self.rows, self.columns) = (rows, columns);
        // An odd number of cache lines: powers of two would put every row into the same few sets of the cache.
        self.stride = columns.next_multiple_of(TILE) + TILE / 2;
        self.data.resize(rows * self.stride, 0.0);
    }

    /// Copies a dense row-major matrix.
    pub(super) fn copy(&mut self, dense: &[f32], rows: usize, columns: usize) {
        self.reshape(rows, columns);
        for (to, from) in self.data.chunks_exact_mut(self.stride).zip(dense.chunks_exact(columns)) {
            to[..columns].copy_from_slice(from);
        }
    }

    /// Takes the transpose of a dense row-major matrix of `rows × columns`.
    pub(super) fn transpose_dense(&mut self, dense: &[f32], rows: usize, columns: usize) {
        self.reshape(columns, rows);
        transpose(dense, columns, rows, columns, &mut self.data, self.stride);
    }

    /// Takes the columns of a view from `from` on.
    pub(super) fn take(&mut self, view: ArrayView2<f32>, from: usize) {
        let view = view.slice(s![.., from..]);
        let (rows, columns) = view.dim();
        if let Some(turned) = view.t().to_slice() {
            return self.transpose_dense(turned, columns, rows);
        }
        self.reshape(rows, columns);
        for (to, row) in self.data.chunks_exact_mut(self.stride).zip(view.rows()) {
            to.iter_mut().zip(row).for_each(|(to, from)| *to = *from);
        }
    }

    /// Takes the transpose of another.
    pub(super) fn transpose(&mut self, other: &Samples) {
        self.reshape(other.columns, other.rows);
        transpose(&other.data, other.stride, other.rows, other.columns, &mut self.data, self.stride);
    }

    /// Writes the transpose as a dense row-major matrix.
    pub(super) fn write_transpose(&self, dense: &mut Vec<f32>) {
        dense.resize(self.rows * self.columns, 0.0);
        transpose(&self.data, self.stride, self.rows, self.columns, dense, self.rows);
    }

    /// The numbers of a row.
    pub(super) fn row(&self, row: usize) -> &[f32] {
        &self.data[row * self.stride..][..self.columns]
    }

    pub(super) fn view(&self) -> ArrayView2<'_, f32> {
        let shape = (self.rows, self.columns).strides((self.stride, 1));
        ArrayView2::from_shape(shape, &self.data).unwrap_or_else(|_| unreachable!("rows within the data"))
    }

    pub(super) fn padded(&self) -> Padded<&[f32]> {
        Padded { data: &self.data, stride: self.stride }
    }

    pub(super) fn padded_mut(&mut self) -> Padded<&mut [f32]> {
        Padded { data: &mut self.data, stride: self.stride }
    }
}

/// `to[c][r] = from[r][c]`, in blocks that fit the registers.
fn transpose(
    from: &[f32],
    from_stride: usize,
    rows: usize,
    columns: usize,
    to: &mut [f32],
    to_stride: usize,
) {
    const TRANSPOSE_BLOCK: usize = 8;
    for r in (0..rows).step_by(TRANSPOSE_BLOCK) {
        for c in (0..columns).step_by(TRANSPOSE_BLOCK) {
            if r + TRANSPOSE_BLOCK > rows || c + TRANSPOSE_BLOCK > columns {
                for r in r..rows.min(r + TRANSPOSE_BLOCK) {
                    for c in c..columns.min(c + TRANSPOSE_BLOCK) {
                        to[c * to_stride + r] = from[r * from_stride + c];
                    }
                }
                continue;
            }
            let mut block = [[0.0f32; TRANSPOSE_BLOCK]; TRANSPOSE_BLOCK];
            for i in 0..TRANSPOSE_BLOCK {
                block[i].copy_from_slice(&from[(r + i) * from_stride + c..][..TRANSPOSE_BLOCK]);
            }
            for j in 0..TRANSPOSE_BLOCK {
                let column: [f32; TRANSPOSE_BLOCK] = std::array::from_fn(|i| block[i][j]);
                to[(c + j) * to_stride + r..][..TRANSPOSE_BLOCK].copy_from_slice(&column);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_transpose_by_hand_and_back() {
        let dense: Vec<f32> = (0..9 * 17).map(|v| v as f32).collect();
        let (mut turned, mut twice, mut back) = (Samples::default(), Samples::default(), Vec::new());
        turned.transpose_dense(&dense, 9, 17);
        assert_eq!((turned.rows, turned.columns), (17, 9));
        assert_eq!(turned.row(3)[..3], [3.0, 20.0, 37.0]);
        turned.write_transpose(&mut back);
        assert_eq!(back, dense);
        twice.transpose(&turned);
        assert_eq!(twice.row(8), &dense[8 * 17..]);
    }
}
