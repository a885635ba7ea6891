//! Eigenvectors of symmetric matrices.

/// Eigenvalues, largest first, and eigenvectors, one a row, of the symmetric `matrix` (size × size), by cyclic Jacobi.
///
/// Orthonormal whatever the matrix. `check` is called every few milliseconds; its error ends the work.
pub(crate) fn symmetric_eigen<E>(
    matrix: &mut [f64],
    size: usize,
    mut check: impl FnMut() -> Result<(), E>,
) -> Result<(Vec<f64>, Vec<f64>), E> {
    let a = matrix;
    let scale = (0..size).map(|i| a[i * size + i].abs()).fold(0.0, f64::max).max(1e-30);
    let mut v = vec![0.0f64; size * size];
    for i in 0..size {
        v[i * size + i] = 1.0;
    }
    for _ in 0..30 {
        let off: f64 =
            (0..size).flat_map(|i| (0..i).map(move |j| (i, j))).map(|(i, j)| a[i * size + j].powi(2)).sum();
        if off < 1e-18 * scale.max(1.0) {
            break;
        }
        for p in 0..size {
            check()?;
            for q in p + 1..size {
                rotate_jacobi(a, &mut v, size, p, q);
            }
        }
    }
    let mut order: Vec<usize> = (0..size).collect();
    order.sort_by(|i, j| a[j * size + j].total_cmp(&a[i * size + i]).then(i.cmp(j)));
    let values = order.iter().map(|&i| a[i * size + i]).collect();
    let vectors = order.iter().flat_map(|&i| v[i * size..(i + 1) * size].iter().copied()).collect();
    Ok((values, vectors))
}

/// Makes entry (p, q) of `a` zero; `v` holds the eigenvectors found so far, one a row.
fn rotate_jacobi(a: &mut [f64], v: &mut [f64], size: usize, p: usize, q: usize) {
    let apq = a[p * size + q];
    if apq.abs() < 1e-300 {
        return;
    }
    let theta = (a[q * size + q] - a[p * size + p]) / (2.0 * apq);
    let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
    let t = if theta == 0.0 { 1.0 } else { t };
    let c = 1.0 / (t * t + 1.0).sqrt();
    let s = t * c;
    for k in 0..size {
        let (kp, kq) = (a[k * size + p], a[k * size + q]);
        a[k * size + p] = c * kp - s * kq;
        a[k * size + q] = s * kp + c * kq;
    }
    turn_rows(a, size, p, q, c, s);
    turn_rows(v, size, p, q, c, s);
}

fn turn_rows(m: &mut [f64], size: usize, p: usize, q: usize, c: f64, s: f64) {
    let (before, after) = m.split_at_mut(q * size);
    for (p, q) in before[p * size..(p + 1) * size].iter_mut().zip(&mut after[..size]) {
        (*p, *q) = (c * *p - s * *q, s * *p + c * *q);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::convert::Infallible;

    proptest! {
        #[test]
        fn vectors_rebuild_the_matrix(half in proptest::collection::vec(-2.0f64..2.0, 36)) {
            const N: usize = 6;
            let matrix: Vec<f64> = (0..N * N).map(|i| half[i] + half[i % N * N + i / N]).collect();
            let (values, vectors) = symmetric_eigen(&mut matrix.clone(), N, || Ok::<(), Infallible>(())).unwrap();
            prop_assert!(values.is_sorted_by(|a, b| a >= b));
            for i in 0..N {
                for j in 0..N {
                    let rebuilt: f64 = (0..N).map(|k| values[k] * vectors[k * N + i] * vectors[k * N + j]).sum();
                    prop_assert!((rebuilt - matrix[i * N + j]).abs() < 1e-6);
                    let product: f64 = (0..N).map(|k| vectors[i * N + k] * vectors[j * N + k]).sum();
                    prop_assert!((product - f64::from(u8::from(i == j))).abs() < 1e-9);
                }
            }
        }
    }

    #[test]
    fn an_error_of_the_check_ends_the_work() {
        let mut matrix = [2.0, 1.0, 1.0, 2.0];
        assert_eq!(symmetric_eigen(&mut matrix, 2, || Err("stop")), Err("stop"));
    }
}
