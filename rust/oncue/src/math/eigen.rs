//! Eigenvectors of symmetric matrices, by nalgebra's tridiagonal QR.

use nalgebra::{DMatrix, SymmetricEigen};

/// Eigenvalues, largest first, and orthonormal eigenvectors, one a row, of the symmetric `matrix` (size × size).
///
/// Each vector's number of largest magnitude is positive, so that the result is one and the same for one matrix.
/// Runs on the calling thread: 512 × 512 take a tenth of a second. `None` where a number is not finite.
pub(crate) fn symmetric_eigen(matrix: &[f64], size: usize) -> Option<(Vec<f64>, Vec<f64>)> {
    if !matrix.iter().all(|v| v.is_finite()) {
        return None;
    }
    // nalgebra refuses the empty matrix.
    if size == 0 {
        return Some((Vec::new(), Vec::new()));
    }
    // A step or two for each eigenvalue is usual; the limit is only there so that the loop has an end.
    let steps = 100 * (size + 1);
    let eigen = SymmetricEigen::try_new(DMatrix::from_column_slice(size, size, matrix), f64::EPSILON, steps)?;
    let mut order: Vec<usize> = (0..size).collect();
    order.sort_by(|&i, &j| eigen.eigenvalues[j].total_cmp(&eigen.eigenvalues[i]).then(i.cmp(&j)));
    let values = order.iter().map(|&i| eigen.eigenvalues[i]).collect();
    let mut vectors = Vec::with_capacity(size * size);
    for &i in &order {
        let vector = eigen.eigenvectors.column(i);
        let sign = vector[vector.icamax()].signum();
        vectors.extend(vector.iter().map(|v| sign * v));
    }
    Some((values, vectors))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// What makes them eigenvalues and eigenvectors, with room for rounding at the matrix' own scale.
    fn check(matrix: &[f64], size: usize) -> Result<(), TestCaseError> {
        let (values, vectors) = symmetric_eigen(matrix, size).expect("finite");
        let scale = matrix.iter().fold(f64::MIN_POSITIVE, |most, v| v.abs().max(most));
        let tolerance = 1e-13 * (size + 1) as f64;
        prop_assert_eq!((values.len(), vectors.len()), (size, size * size));
        prop_assert!(values.is_sorted_by(|a, b| a >= b));
        for (k, v) in vectors.chunks_exact(size.max(1)).enumerate() {
            for (i, row) in matrix.chunks_exact(size).enumerate() {
                let product: f64 = row.iter().zip(v).map(|(a, b)| a / scale * b).sum();
                prop_assert!((product - values[k] / scale * v[i]).abs() < tolerance, "A·v = λ·v, {k}");
            }
            for (j, w) in vectors.chunks_exact(size).enumerate() {
                let product: f64 = v.iter().zip(w).map(|(a, b)| a * b).sum();
                prop_assert!(
                    (product - f64::from(u8::from(j == k))).abs() < tolerance,
                    "orthonormal, {j} {k}"
                );
            }
            let largest = v.iter().fold(0.0f64, |m, x| if x.abs() > m.abs() { *x } else { m });
            prop_assert!(largest > 0.0, "its sign, {v:?}");
        }
        let trace: f64 = (0..size).map(|i| matrix[i * size + i] / scale).sum();
        prop_assert!(
            (values.iter().map(|v| v / scale).sum::<f64>() - trace).abs() < tolerance * (size + 1) as f64
        );
        Ok(())
    }

    proptest! {
        #[test]
        fn any_symmetric_matrix(
            size in 0usize..24,
            half in proptest::collection::vec(-2.0f64..2.0, 24 * 24),
            magnitude in -140i32..140,
        ) {
            let unit = 10f64.powi(magnitude);
            let matrix: Vec<f64> =
                (0..size * size).map(|i| unit * (half[i] + half[i % size * size + i / size])).collect();
            check(&matrix, size)?;
        }

        /// Covariances of fewer rows than numbers: most eigenvalues are zero, and any basis of their space will do.
        #[test]
        fn matrices_of_low_rank(
            size in 2usize..40,
            rank in 0usize..3,
            rows in proptest::collection::vec(-1.0f64..1.0, 3 * 40),
        ) {
            let matrix: Vec<f64> = (0..size * size)
                .map(|i| (0..rank).map(|r| rows[r * size + i / size] * rows[r * size + i % size]).sum())
                .collect();
            check(&matrix, size)?;
            let (values, _) = symmetric_eigen(&matrix, size).expect("finite");
            prop_assert!(values[rank..].iter().all(|v| v.abs() < 1e-12), "{values:?}");
        }
    }

    #[test]
    fn worked_by_hand() {
        let half = std::f64::consts::FRAC_1_SQRT_2;
        // λ = 3 along (1, 1) and λ = 1 along (1, -1) or (-1, 1).
        let (values, vectors) = symmetric_eigen(&[2.0, 1.0, 1.0, 2.0], 2).unwrap();
        let expected = [half, half, half, half];
        assert!(values.iter().zip([3.0, 1.0]).all(|(a, b)| (a - b).abs() < 1e-14), "{values:?}");
        assert!(vectors.iter().zip(expected).all(|(a, b)| (a.abs() - b).abs() < 1e-14), "{vectors:?}");
        assert!(vectors[0] * vectors[1] > 0.0 && vectors[2] * vectors[3] < 0.0, "{vectors:?}");
        // A diagonal matrix has the axes, largest first.
        let (values, vectors) = symmetric_eigen(&[-1.0, 0.0, 0.0, 0.0, 5.0, 0.0, 0.0, 0.0, 2.0], 3).unwrap();
        assert_eq!(values, [5.0, 2.0, -1.0]);
        assert_eq!(vectors, [0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0]);
        assert_eq!(symmetric_eigen(&[], 0), Some((vec![], vec![])));
    }

    #[test]
    fn numbers_that_are_not_finite_have_none() {
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert_eq!(symmetric_eigen(&[1.0, bad, bad, 1.0], 2), None);
        }
    }
}
