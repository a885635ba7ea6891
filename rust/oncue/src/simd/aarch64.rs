//! The vector instructions of 64-bit Arm.

use std::arch::aarch64::*;

use super::Simd;

/// NEON, which every such processor has: two registers of 4 numbers, taken together as 8, so that blocks of eights need
/// no vectors of another width.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Neon;

/// One operation on both halves.
#[inline(always)]
fn halves(
    a: float32x4x2_t,
    b: float32x4x2_t,
    f: impl Fn(float32x4_t, float32x4_t) -> float32x4_t,
) -> float32x4x2_t {
    float32x4x2_t(f(a.0, b.0), f(a.1, b.1))
}

impl Simd for Neon {
    const LANES: usize = 8;
    // 24 of the 32 registers hold sums, 4 a row of the second matrix.
    const TILE_ROWS: usize = 6;
    type F32 = float32x4x2_t;

    #[inline(always)]
    unsafe fn load_from(self, from: *const f32) -> float32x4x2_t {
        // SAFETY: the numbers are readable and the load asks for no more alignment than theirs; every processor has NEON.
        unsafe { float32x4x2_t(vld1q_f32(from), vld1q_f32(from.add(4))) }
    }
    #[inline(always)]
    unsafe fn store_to(self, value: float32x4x2_t, to: *mut f32) {
        // SAFETY: the numbers are writable; every processor has NEON.
        unsafe {
            vst1q_f32(to, value.0);
            vst1q_f32(to.add(4), value.1);
        }
    }
    #[inline(always)]
    fn splat(self, value: f32) -> float32x4x2_t {
        // SAFETY: every processor of this architecture has NEON; so for all below.
        unsafe { float32x4x2_t(vdupq_n_f32(value), vdupq_n_f32(value)) }
    }
    #[inline(always)]
    fn add(self, a: float32x4x2_t, b: float32x4x2_t) -> float32x4x2_t {
        // SAFETY: see `splat`.
        halves(a, b, |a, b| unsafe { vaddq_f32(a, b) })
    }
    #[inline(always)]
    fn sub(self, a: float32x4x2_t, b: float32x4x2_t) -> float32x4x2_t {
        // SAFETY: see `splat`.
        halves(a, b, |a, b| unsafe { vsubq_f32(a, b) })
    }
    #[inline(always)]
    fn mul(self, a: float32x4x2_t, b: float32x4x2_t) -> float32x4x2_t {
        // SAFETY: see `splat`.
        halves(a, b, |a, b| unsafe { vmulq_f32(a, b) })
    }
    #[inline(always)]
    fn min(self, a: float32x4x2_t, b: float32x4x2_t) -> float32x4x2_t {
        // NEON's own minimum is no number where one is not; here it is b.
        // SAFETY: see `splat`.
        halves(a, b, |a, b| unsafe { vbslq_f32(vcltq_f32(a, b), a, b) })
    }
    #[inline(always)]
    fn max(self, a: float32x4x2_t, b: float32x4x2_t) -> float32x4x2_t {
        // SAFETY: see `splat`.
        halves(a, b, |a, b| unsafe { vbslq_f32(vcgtq_f32(a, b), a, b) })
    }
    #[inline(always)]
    fn abs(self, a: float32x4x2_t) -> float32x4x2_t {
        // SAFETY: see `splat`.
        unsafe { float32x4x2_t(vabsq_f32(a.0), vabsq_f32(a.1)) }
    }
    #[inline(always)]
    fn add_product(self, sum: float32x4x2_t, a: float32x4x2_t, b: float32x4x2_t) -> float32x4x2_t {
        // SAFETY: see `splat`.
        unsafe { float32x4x2_t(vfmaq_f32(sum.0, a.0, b.0), vfmaq_f32(sum.1, a.1, b.1)) }
    }
    #[inline(always)]
    fn where_positive(self, a: float32x4x2_t, by: float32x4x2_t) -> float32x4x2_t {
        // SAFETY: see `splat`.
        halves(a, by, |a, by| unsafe { vbslq_f32(vcgtzq_f32(by), a, vdupq_n_f32(0.0)) })
    }
    #[inline(always)]
    fn le(self, a: float32x4x2_t, b: float32x4x2_t) -> u32 {
        let bits: [u32; 8] = std::array::from_fn(|lane| 1 << lane);
        // SAFETY: see `splat`; four bits are readable from each half.
        unsafe {
            let low = vandq_u32(vcleq_f32(a.0, b.0), vld1q_u32(bits.as_ptr()));
            let high = vandq_u32(vcleq_f32(a.1, b.1), vld1q_u32(bits[4..].as_ptr()));
            vaddvq_u32(vorrq_u32(low, high))
        }
    }
}
