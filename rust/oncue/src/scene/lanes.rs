//! Eight numbers at a time: the same arithmetic on AVX2 and on any processor.
//!
//! Both give the same bits: no fused multiply-add, the same order of operations.
//!
//! Code over [`Lanes`] is inlined into a function that has the processor feature switched on. Closures and
//! iterators are functions of their own without it, so kernels use neither.

use glam::Vec3;
#[cfg(target_arch = "x86_64")]
use std::arch::x86_64::*;

/// Eight `f32` that are loaded from aligned memory and calculated with side by side.
pub trait Lanes: Copy {
    fn load(from: &[f32; 8]) -> Self;
    fn splat(value: f32) -> Self;
    fn add(self, other: Self) -> Self;
    fn sub(self, other: Self) -> Self;
    fn mul(self, other: Self) -> Self;
    fn min(self, other: Self) -> Self;
    fn max(self, other: Self) -> Self;
    fn abs(self) -> Self;
    /// Bit i: lane i of `self` <= lane i of `other`; false for NaN.
    fn le(self, other: Self) -> u32;
}

/// Lanes for every processor; the compiler vectorises what it can.
#[derive(Clone, Copy)]
pub struct Portable([f32; 8]);

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

impl Lanes for Portable {
    #[inline(always)]
    fn load(from: &[f32; 8]) -> Self {
        Self(*from)
    }
    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self([value; 8])
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.zip(other, |a, b| a + b)
    }
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.zip(other, |a, b| a - b)
    }
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.zip(other, |a, b| a * b)
    }
    // As the x86 instruction: the second operand where one is NaN.
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        self.zip(other, |a, b| if a < b { a } else { b })
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.zip(other, |a, b| if a > b { a } else { b })
    }
    #[inline(always)]
    fn abs(self) -> Self {
        self.zip(self, |a, _| a.abs())
    }
    #[inline(always)]
    fn le(self, other: Self) -> u32 {
        let mut bits = 0;
        for lane in 0..8 {
            bits |= u32::from(self.0[lane] <= other.0[lane]) << lane;
        }
        bits
    }
}

/// Lanes of one AVX register.
///
/// Only to be used inside functions with `#[target_feature(enable = "avx2")]`, after the processor was asked:
/// that is what makes the intrinsics below sound.
#[cfg(target_arch = "x86_64")]
#[derive(Clone, Copy)]
pub struct Avx(__m256);

#[cfg(target_arch = "x86_64")]
impl Lanes for Avx {
    #[inline(always)]
    fn load(from: &[f32; 8]) -> Self {
        // SAFETY: eight floats are readable; the load asks for no alignment. AVX: see the type.
        unsafe { Self(_mm256_loadu_ps(from.as_ptr())) }
    }
    #[inline(always)]
    fn splat(value: f32) -> Self {
        // SAFETY: AVX, see the type; so for all below.
        unsafe { Self(_mm256_set1_ps(value)) }
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        unsafe { Self(_mm256_add_ps(self.0, other.0)) }
    }
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        unsafe { Self(_mm256_sub_ps(self.0, other.0)) }
    }
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        unsafe { Self(_mm256_mul_ps(self.0, other.0)) }
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        unsafe { Self(_mm256_min_ps(self.0, other.0)) }
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        unsafe { Self(_mm256_max_ps(self.0, other.0)) }
    }
    #[inline(always)]
    fn abs(self) -> Self {
        unsafe { Self(_mm256_andnot_ps(_mm256_set1_ps(-0.0), self.0)) }
    }
    #[inline(always)]
    fn le(self, other: Self) -> u32 {
        unsafe { _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(self.0, other.0)) as u32 }
    }
}

/// A vector's parts, each in all lanes.
#[inline(always)]
pub fn splat<L: Lanes>(v: Vec3) -> [L; 3] {
    [L::splat(v.x), L::splat(v.y), L::splat(v.z)]
}

/// Whether [`Avx`] may be used; asked once by the standard library, then a load.
#[inline(always)]
pub fn has_avx2() -> bool {
    #[cfg(target_arch = "x86_64")]
    {
        crate::simd::Level::current() >= crate::simd::Level::Avx2
    }
    #[cfg(not(target_arch = "x86_64"))]
    {
        false
    }
}
