//! Symmetric positive definite systems with a band: Cholesky's factors and the solution, in double precision.

use crate::simd::{Kernel, Level, Simd};

/// The lower band of a symmetric matrix: row i holds columns `i - band ..= i`.
#[derive(Debug, Clone)]
pub(super) struct BandedMatrix {
    size: usize,
    band: usize,
    rows: Vec<f64>,
}

impl BandedMatrix {
    pub(super) fn zeros(size: usize, band: usize) -> Self {
        Self { size, band, rows: vec![0.0; size * (band + 1)] }
    }

    pub(super) fn clear(&mut self) {
        self.rows.fill(0.0);
    }

    /// Element (row, column) with `row - band <= column <= row`.
    #[inline]
    pub(super) fn at(&mut self, row: usize, column: usize) -> &mut f64 {
        &mut self.rows[row * (self.band + 1) + column + self.band - row]
    }

    /// Columns `first..=row` of a row.
    #[inline]
    pub(super) fn row_from(&mut self, row: usize, first: usize) -> &mut [f64] {
        let begin = row * (self.band + 1) + first + self.band - row;
        &mut self.rows[begin..(row + 1) * (self.band + 1)]
    }

    /// Replaces the matrix by its lower factor L, A = L·Lᵀ. `false` where A is not positive definite.
    #[must_use]
    pub(super) fn factorize(&mut self) -> bool {
        Level::current().run_in_eights(Factorization(self))
    }

    #[inline(always)]
    fn factorize_here(&mut self) -> bool {
        let (band, width) = (self.band, self.band + 1);
        for i in 0..self.size {
            let first = i.saturating_sub(band);
            let (above, below) = self.rows.split_at_mut(i * width);
            let row = &mut below[..width];
            for j in first..i {
                let from = first.max(j.saturating_sub(band));
                let other = &above[j * width..(j + 1) * width];
                let sum = dot(&row[from + band - i..j + band - i], &other[from + band - j..band]);
                row[j + band - i] = (row[j + band - i] - sum) / other[band];
            }
            let own = &row[first + band - i..band];
            let pivot = row[band] - dot(own, own);
            if !(pivot > 0.0 && pivot.is_finite()) {
                return false;
            }
            row[band] = pivot.sqrt();
        }
        true
    }

    /// Solves L·Lᵀ·x = b in place; the matrix must have been factorized.
    pub(super) fn solve(&self, x: &mut [f64]) {
        let (band, width) = (self.band, self.band + 1);
        for i in 0..self.size {
            let first = i.saturating_sub(band);
            let row = &self.rows[i * width..(i + 1) * width];
            x[i] = (x[i] - dot(&row[first + band - i..band], &x[first..i])) / row[band];
        }
        for i in (0..self.size).rev() {
            let first = i.saturating_sub(band);
            let row = &self.rows[i * width..(i + 1) * width];
            x[i] /= row[band];
            let value = x[i];
            for (x, l) in x[first..i].iter_mut().zip(&row[first + band - i..band]) {
                *x -= value * l;
            }
        }
    }
}

/// [`BandedMatrix::factorize`]: the same operations in the same order at every level.
struct Factorization<'a>(&'a mut BandedMatrix);

impl Kernel for Factorization<'_> {
    type Output = bool;

    #[inline(always)]
    fn run<S: Simd>(self, _simd: S) -> bool {
        self.0.factorize_here()
    }
}

/// Σ aᵢ·bᵢ in a fixed order, eight sums side by side.
#[inline(always)]
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 8];
    let (whole_a, rest_a) = a.as_chunks::<8>();
    let (whole_b, rest_b) = b.as_chunks::<8>();
    for (a, b) in whole_a.iter().zip(whole_b) {
        for i in 0..8 {
            sums[i] += a[i] * b[i];
        }
    }
    let rest: f64 = rest_a.iter().zip(rest_b).map(|(a, b)| a * b).sum();
    sums.iter().sum::<f64>() + rest
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn solves_what_it_is_given(values in prop::collection::vec(-1.0f64..1.0, 12 * 12), right in prop::collection::vec(-1.0f64..1.0, 12)) {
            // A = B·Bᵀ + I with B lower triangular of band 4: positive definite with band 4.
            let (size, band) = (12, 4);
            let b = |i: usize, j: usize| if j <= i && i - j <= band { values[i * size + j] } else { 0.0 };
            let a = |i: usize, j: usize| (0..size).map(|k| b(i, k) * b(j, k)).sum::<f64>() + f64::from(u8::from(i == j));
            let mut matrix = BandedMatrix::zeros(size, band);
            for i in 0..size {
                for j in i.saturating_sub(band)..=i {
                    *matrix.at(i, j) = a(i, j);
                }
            }
            prop_assert!(matrix.factorize());
            let mut x = right.clone();
            matrix.solve(&mut x);
            for i in 0..size {
                let product: f64 = (0..size).map(|j| a(i, j) * x[j]).sum();
                prop_assert!((product - right[i]).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn an_indefinite_matrix_is_refused() {
        let mut matrix = BandedMatrix::zeros(2, 1);
        *matrix.at(0, 0) = 1.0;
        *matrix.at(1, 0) = 2.0;
        *matrix.at(1, 1) = 1.0;
        assert!(!matrix.factorize());
    }
}
