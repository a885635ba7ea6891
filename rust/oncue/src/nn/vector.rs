//! The registers that [`super::product`] calculates with, one type a [`crate::simd::Level`].

#[cfg(target_arch = "x86_64")]
use std::arch::x86_64::*;

/// Some `f32` side by side.
///
/// The methods are inlined into functions that have the processor feature switched on. Only such functions may use
/// the types of higher levels, after the processor was asked: that is what makes the intrinsics sound.
pub trait Vector: Copy {
    const LANES: usize;
    /// Reads [`Vector::LANES`] numbers.
    ///
    /// # Safety
    /// They must be readable.
    unsafe fn load(from: *const f32) -> Self;
    /// Writes [`Vector::LANES`] numbers.
    ///
    /// # Safety
    /// They must be writable.
    unsafe fn store(self, to: *mut f32);
    fn splat(value: f32) -> Self;
    fn add(self, other: Self) -> Self;
    /// self + a·b, with one rounding where the processor can.
    fn add_product(self, a: Self, b: Self) -> Self;
    /// The positive part.
    fn relu(self) -> Self;
    /// Lanes in which `by` is positive; 0 in the others.
    fn where_positive(self, by: Self) -> Self;
}

/// Four lanes, the registers that every 64-bit processor has; the compiler puts them there.
#[derive(Clone, Copy)]
pub struct Portable([f32; 4]);

impl Portable {
    #[inline(always)]
    fn zip(self, other: Self, f: impl Fn(f32, f32) -> f32) -> Self {
        let mut out = self.0;
        for (a, &b) in out.iter_mut().zip(&other.0) {
            *a = f(*a, b);
        }
        Self(out)
    }
}

impl Vector for Portable {
    const LANES: usize = 4;
    #[inline(always)]
    unsafe fn load(from: *const f32) -> Self {
        // SAFETY: four numbers are readable; an array of them needs no more alignment than one.
        unsafe { Self(*from.cast()) }
    }
    #[inline(always)]
    unsafe fn store(self, to: *mut f32) {
        // SAFETY: four numbers are writable.
        unsafe { *to.cast() = self.0 }
    }
    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self([value; 4])
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.zip(other, |a, b| a + b)
    }
    #[inline(always)]
    fn add_product(self, a: Self, b: Self) -> Self {
        // Without the instruction a fused product is a slow function of the C library.
        if cfg!(any(target_arch = "aarch64", target_feature = "fma")) {
            let mut out = self.0;
            for lane in 0..4 {
                out[lane] = a.0[lane].mul_add(b.0[lane], out[lane]);
            }
            Self(out)
        } else {
            self.add(a.zip(b, |a, b| a * b))
        }
    }
    #[inline(always)]
    fn relu(self) -> Self {
        self.where_positive(self)
    }
    #[inline(always)]
    fn where_positive(self, by: Self) -> Self {
        self.zip(by, |a, by| if by > 0.0 { a } else { 0.0 })
    }
}

/// One AVX register.
#[cfg(target_arch = "x86_64")]
#[derive(Clone, Copy)]
pub struct Avx2(__m256);

#[cfg(target_arch = "x86_64")]
impl Vector for Avx2 {
    const LANES: usize = 8;
    #[inline(always)]
    unsafe fn load(from: *const f32) -> Self {
        // SAFETY: eight numbers are readable; AVX2 and FMA, here and below: see the trait.
        unsafe { Self(_mm256_loadu_ps(from)) }
    }
    #[inline(always)]
    unsafe fn store(self, to: *mut f32) {
        // SAFETY: eight numbers are writable.
        unsafe { _mm256_storeu_ps(to, self.0) }
    }
    #[inline(always)]
    fn splat(value: f32) -> Self {
        unsafe { Self(_mm256_set1_ps(value)) }
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        unsafe { Self(_mm256_add_ps(self.0, other.0)) }
    }
    #[inline(always)]
    fn add_product(self, a: Self, b: Self) -> Self {
        unsafe { Self(_mm256_fmadd_ps(a.0, b.0, self.0)) }
    }
    #[inline(always)]
    fn relu(self) -> Self {
        unsafe { Self(_mm256_max_ps(self.0, _mm256_setzero_ps())) }
    }
    #[inline(always)]
    fn where_positive(self, by: Self) -> Self {
        unsafe { Self(_mm256_and_ps(self.0, _mm256_cmp_ps::<_CMP_GT_OQ>(by.0, _mm256_setzero_ps()))) }
    }
}

/// One AVX-512 register.
#[cfg(target_arch = "x86_64")]
#[derive(Clone, Copy)]
pub struct Avx512(__m512);

#[cfg(target_arch = "x86_64")]
impl Vector for Avx512 {
    const LANES: usize = 16;
    #[inline(always)]
    unsafe fn load(from: *const f32) -> Self {
        // SAFETY: sixteen numbers are readable; AVX-512 F, here and below: see the trait.
        unsafe { Self(_mm512_loadu_ps(from)) }
    }
    #[inline(always)]
    unsafe fn store(self, to: *mut f32) {
        // SAFETY: sixteen numbers are writable.
        unsafe { _mm512_storeu_ps(to, self.0) }
    }
    #[inline(always)]
    fn splat(value: f32) -> Self {
        unsafe { Self(_mm512_set1_ps(value)) }
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        unsafe { Self(_mm512_add_ps(self.0, other.0)) }
    }
    #[inline(always)]
    fn add_product(self, a: Self, b: Self) -> Self {
        unsafe { Self(_mm512_fmadd_ps(a.0, b.0, self.0)) }
    }
    #[inline(always)]
    fn relu(self) -> Self {
        unsafe { Self(_mm512_max_ps(self.0, _mm512_setzero_ps())) }
    }
    #[inline(always)]
    fn where_positive(self, by: Self) -> Self {
        unsafe {
            let positive = _mm512_cmp_ps_mask::<_CMP_GT_OQ>(by.0, _mm512_setzero_ps());
            Self(_mm512_maskz_mov_ps(positive, self.0))
        }
    }
}
