//! The operations of a level, and those of any processor.

/// Vectors of [`Simd::LANES`] numbers, and the proof that the processor has what they need: a value of this exists only
/// then.
pub(crate) trait Simd: Copy {
    /// Numbers side by side.
    const LANES: usize;
    /// Rows of a product's tile that fit the registers, two vectors each.
    const TILE_ROWS: usize;
    /// One register.
    type F32: Copy;

    /// The first [`Simd::LANES`] numbers of `from`.
    ///
    /// # Panics
    /// When there are fewer.
    #[inline(always)]
    fn load(self, from: &[f32]) -> Self::F32 {
        assert!(from.len() >= Self::LANES, "a load beyond the end");
        // SAFETY: LANES numbers are readable.
        unsafe { self.load_from(from.as_ptr()) }
    }

    /// Writes to the first [`Simd::LANES`] numbers of `to`.
    ///
    /// # Panics
    /// When there are fewer.
    #[inline(always)]
    fn store(self, value: Self::F32, to: &mut [f32]) {
        assert!(to.len() >= Self::LANES, "a store beyond the end");
        // SAFETY: LANES numbers are writable.
        unsafe { self.store_to(value, to.as_mut_ptr()) }
    }

    /// Reads [`Simd::LANES`] numbers.
    ///
    /// # Safety
    /// They must be readable.
    unsafe fn load_from(self, from: *const f32) -> Self::F32;
    /// Writes [`Simd::LANES`] numbers.
    ///
    /// # Safety
    /// They must be writable.
    unsafe fn store_to(self, value: Self::F32, to: *mut f32);
    /// The same number in all lanes.
    fn splat(self, value: f32) -> Self::F32;
    /// a + b.
    fn add(self, a: Self::F32, b: Self::F32) -> Self::F32;
    /// a - b.
    fn sub(self, a: Self::F32, b: Self::F32) -> Self::F32;
    /// a · b.
    fn mul(self, a: Self::F32, b: Self::F32) -> Self::F32;
    /// The smaller; b where one is not a number.
    fn min(self, a: Self::F32, b: Self::F32) -> Self::F32;
    /// The larger; b where one is not a number.
    fn max(self, a: Self::F32, b: Self::F32) -> Self::F32;
    /// |a|.
    fn abs(self, a: Self::F32) -> Self::F32;
    /// sum + a · b, with one rounding where the processor can.
    fn add_product(self, sum: Self::F32, a: Self::F32, b: Self::F32) -> Self::F32;
    /// Lanes of `a` in which `by` is positive; 0 in the others.
    fn where_positive(self, a: Self::F32, by: Self::F32) -> Self::F32;
    /// Bit i: lane i of `a` <= lane i of `b`; false where one is not a number.
    fn le(self, a: Self::F32, b: Self::F32) -> u32;
}

/// Lanes for every processor; the compiler puts them in what registers it has.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Portable<const LANES: usize>;

#[inline(always)]
fn zip<const N: usize>(a: [f32; N], b: [f32; N], f: impl Fn(f32, f32) -> f32) -> [f32; N] {
    let mut out = a;
    for (a, &b) in out.iter_mut().zip(&b) {
        *a = f(*a, b);
    }
    out
}

impl<const N: usize> Simd for Portable<N> {
    const LANES: usize = N;
    const TILE_ROWS: usize = 4;
    type F32 = [f32; N];

    #[inline(always)]
    unsafe fn load_from(self, from: *const f32) -> [f32; N] {
        // SAFETY: N numbers are readable; an array of them needs no more alignment than one.
        unsafe { *from.cast() }
    }
    #[inline(always)]
    unsafe fn store_to(self, value: [f32; N], to: *mut f32) {
        // SAFETY: N numbers are writable.
        unsafe { *to.cast() = value }
    }
    #[inline(always)]
    fn splat(self, value: f32) -> [f32; N] {
        [value; N]
    }
    #[inline(always)]
    fn add(self, a: [f32; N], b: [f32; N]) -> [f32; N] {
        zip(a, b, |a, b| a + b)
    }
    #[inline(always)]
    fn sub(self, a: [f32; N], b: [f32; N]) -> [f32; N] {
        zip(a, b, |a, b| a - b)
    }
    #[inline(always)]
    fn mul(self, a: [f32; N], b: [f32; N]) -> [f32; N] {
        zip(a, b, |a, b| a * b)
    }
    #[inline(always)]
    fn min(self, a: [f32; N], b: [f32; N]) -> [f32; N] {
        zip(a, b, |a, b| if a < b { a } else { b })
    }
    #[inline(always)]
    fn max(self, a: [f32; N], b: [f32; N]) -> [f32; N] {
        zip(a, b, |a, b| if a > b { a } else { b })
    }
    #[inline(always)]
    fn abs(self, a: [f32; N]) -> [f32; N] {
        zip(a, a, |a, _| a.abs())
    }
    #[inline(always)]
    fn add_product(self, sum: [f32; N], a: [f32; N], b: [f32; N]) -> [f32; N] {
        // Without the instruction a fused product is a slow function of the C library.
        if cfg!(any(target_arch = "aarch64", target_feature = "fma")) {
            let mut out = sum;
            for lane in 0..N {
                out[lane] = a[lane].mul_add(b[lane], out[lane]);
            }
            out
        } else {
            zip(sum, zip(a, b, |a, b| a * b), |sum, product| sum + product)
        }
    }
    #[inline(always)]
    fn where_positive(self, a: [f32; N], by: [f32; N]) -> [f32; N] {
        zip(a, by, |a, by| if by > 0.0 { a } else { 0.0 })
    }
    #[inline(always)]
    fn le(self, a: [f32; N], b: [f32; N]) -> u32 {
        let mut bits = 0;
        for lane in 0..N {
            bits |= u32::from(a[lane] <= b[lane]) << lane;
        }
        bits
    }
}
