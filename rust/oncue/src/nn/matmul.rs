//! C = A·B (+ C) on views of any strides: [`super::product`] for matrices that lie anyhow.

use std::cell::RefCell;

use ndarray::ArrayView2;

use super::product::{Finish, Padded, Start, TILE, multiply};
use super::samples::Samples;
use crate::simd::Level;

/// The first `rows` × `columns` numbers of `data` as a dense row-major matrix.
///
/// # Panics
/// When there are fewer; shapes are fixed by the code, never by input.
pub(crate) fn matrix(data: &[f32], rows: usize, columns: usize) -> ArrayView2<'_, f32> {
    let data = &data[..rows * columns];
    ArrayView2::from_shape((rows, columns), data)
        .unwrap_or_else(|_| unreachable!("as many numbers as the shape has"))
}

/// Matrices that a product needs in another form than they came in.
#[derive(Default)]
struct Scratch {
    b: Samples,
    c: Samples,
}

thread_local! {
    static SCRATCH: RefCell<Scratch> = RefCell::default();
}

/// `c = a · b + (accumulate ? c : 0)`, with `c` dense row-major (a.nrows() × b.cols), on the calling thread.
///
/// # Panics
/// When the shapes do not fit; shapes are fixed by the code, never by input.
pub(crate) fn matmul(c: &mut [f32], a: ArrayView2<f32>, b: ArrayView2<f32>, accumulate: bool) {
    matmul_at(Level::current(), c, a, b, accumulate);
}

/// [`matmul`] at a level that the processor has.
pub(super) fn matmul_at(
    level: Level,
    c: &mut [f32],
    a: ArrayView2<f32>,
    b: ArrayView2<f32>,
    accumulate: bool,
) {
    assert_eq!(a.ncols(), b.nrows());
    assert!(c.len() >= a.nrows() * b.ncols());
    if a.nrows() == 0 || b.ncols() == 0 {
        return;
    }
    let columns = b.ncols();
    // What is not a whole number of tiles wide goes by way of the scratch.
    let (whole, rest) = (columns / TILE * TILE, columns % TILE);
    SCRATCH.with_borrow_mut(|scratch| {
        let start = if accumulate { Start::Kept } else { Start::Zero };
        let direct = Padded::of(&b);
        if let Some(b) = direct.filter(|_| whole > 0) {
            let c = Padded { data: &mut *c, stride: columns };
            multiply(level, c, a, b, whole, start, Finish::Plain);
        }
        let from = if direct.is_some() { whole } else { 0 };
        if from == columns {
            return;
        }
        scratch.b.take(b, from);
        if rest == 0 {
            let c = Padded { data: c, stride: columns };
            multiply(level, c, a, scratch.b.padded(), columns, start, Finish::Plain);
            return;
        }
        scratch.c.reshape(a.nrows(), columns - from);
        multiply(
            level,
            scratch.c.padded_mut(),
            a,
            scratch.b.padded(),
            columns - from,
            Start::Zero,
            Finish::Plain,
        );
        for (row, c) in c.chunks_exact_mut(columns).take(a.nrows()).enumerate() {
            let (sums, c) = (scratch.c.row(row), &mut c[from..]);
            if accumulate {
                c.iter_mut().zip(sums).for_each(|(c, sum)| *c += sum);
            } else {
                c.copy_from_slice(sums);
            }
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg32;

    #[test]
    fn a_product_by_hand() {
        let a = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]; // 2 × 3
        let b = [1.0, 0.0, 2.0, 1.0, 0.0, 3.0]; // 3 × 2
        let mut c = [10.0; 4];
        matmul(&mut c, matrix(&a, 2, 3), matrix(&b, 3, 2), false);
        assert_eq!(c, [5.0, 11.0, 14.0, 23.0]);
        matmul(&mut c, matrix(&b, 3, 2).reversed_axes(), matrix(&a, 2, 3).reversed_axes(), true);
        assert_eq!(c, [10.0, 25.0, 25.0, 46.0]);
    }

    /// Every level against the sum in double precision, over shapes with and without whole tiles, transposed or not.
    #[test]
    fn every_level_agrees_with_the_definition() {
        let mut rng = Pcg32::seed_from_u64(1);
        let shapes =
            [(1, 1, 1), (1, 7, 256), (3, 32, 5), (12, 64, 40), (13, 33, 31), (23, 96, 400), (40, 70, 801)];
        for level in Level::available() {
            for (m, n, k) in shapes {
                for (turn_a, turn_b, accumulate) in
                    [(false, false, false), (true, false, true), (false, true, true), (true, true, false)]
                {
                    let random = |count: usize, rng: &mut Pcg32| -> Vec<f32> {
                        (0..count).map(|_| rng.random_range(-1.0..1.0)).collect()
                    };
                    let (a, b) = (random(m * k, &mut rng), random(k * n, &mut rng));
                    let before = random(m * n, &mut rng);
                    let a = if turn_a { matrix(&a, k, m).reversed_axes() } else { matrix(&a, m, k) };
                    let b = if turn_b { matrix(&b, n, k).reversed_axes() } else { matrix(&b, k, n) };
                    let mut c = before.clone();
                    matmul_at(level, &mut c, a, b, accumulate);
                    for (i, (found, before)) in c.iter().zip(&before).enumerate() {
                        let sum: f64 =
                            (0..k).map(|k| f64::from(a[[i / n, k]]) * f64::from(b[[k, i % n]])).sum();
                        let sum = sum + if accumulate { f64::from(*before) } else { 0.0 };
                        // No more than a rounding of each term.
                        let error = (sum - f64::from(*found)).abs();
                        assert!(error < 1e-7 * (k + 1) as f64 + 1e-6, "{level} {m}×{n}×{k}: {found} {sum}");
                    }
                }
            }
        }
    }
}
