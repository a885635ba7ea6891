//! One safe door to the f32 kernels of `gemm`: C = A·B (+ C) on strided row-major views.

/// A read-only matrix view: element (r, c) is `data[r * row_stride + c * col_stride]`.
#[derive(Clone, Copy)]
pub struct View<'a> {
    pub data: &'a [f32],
    pub rows: usize,
    pub cols: usize,
    pub row_stride: usize,
    pub col_stride: usize,
}

impl<'a> View<'a> {
    /// A dense row-major matrix.
    pub fn new(data: &'a [f32], rows: usize, cols: usize) -> Self {
        Self { data, rows, cols, row_stride: cols, col_stride: 1 }
    }

    /// The transpose, without a copy.
    pub fn t(self) -> Self {
        Self {
            data: self.data,
            rows: self.cols,
            cols: self.rows,
            row_stride: self.col_stride,
            col_stride: self.row_stride,
        }
    }

    fn fits(&self) -> bool {
        self.rows == 0
            || self.cols == 0
            || (self.rows - 1) * self.row_stride + (self.cols - 1) * self.col_stride < self.data.len()
    }
}

/// `c = a · b + (accumulate ? c : 0)`, with `c` dense row-major (a.rows × b.cols), on the calling thread.
///
/// # Panics
/// When the shapes do not fit; shapes are fixed by the code, never by input.
pub fn matmul(c: &mut [f32], a: View, b: View, accumulate: bool) {
    assert_eq!(a.cols, b.rows);
    assert!(a.fits() && b.fits() && c.len() >= a.rows * b.cols);
    if a.rows == 0 || b.cols == 0 {
        return;
    }
    // SAFETY: the three views were checked to lie within their slices, and `c` is borrowed mutably,
    // so it aliases neither `a` nor `b`.
    unsafe {
        gemm_f32::gemm::f32::get_gemm_fn()(
            a.rows,
            b.cols,
            a.cols,
            c.as_mut_ptr(),
            1,
            b.cols as isize,
            accumulate,
            a.data.as_ptr(),
            a.col_stride as isize,
            a.row_stride as isize,
            b.data.as_ptr(),
            b.col_stride as isize,
            b.row_stride as isize,
            1.0,
            1.0,
            false,
            false,
            false,
            gemm_common::Parallelism::None,
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_product_by_hand() {
        let a = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]; // 2 × 3
        let b = [1.0, 0.0, 2.0, 1.0, 0.0, 3.0]; // 3 × 2
        let mut c = [10.0; 4];
        matmul(&mut c, View::new(&a, 2, 3), View::new(&b, 3, 2), false);
        assert_eq!(c, [5.0, 11.0, 14.0, 23.0]);
        matmul(&mut c, View::new(&b, 3, 2).t(), View::new(&a, 2, 3).t(), true);
        assert_eq!(c, [10.0, 25.0, 25.0, 46.0]);
    }
}
