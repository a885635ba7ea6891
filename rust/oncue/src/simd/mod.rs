//! Which vector instructions the kernels use: chosen at run time, so that one wheel runs on any processor.
//!
//! A kernel is written once, over [`Simd`], and compiled for every [`Level`]; [`Level::run`] and [`Level::run_in_eights`] are
//! the only places where code for more than any processor is entered. The value that a kernel calculates through is the
//! proof that its instructions are there: one exists only where the processor was asked. Every level that a processor has
//! can be called by itself, so that tests hold each against a plain reference.
//!
//! A kernel's functions are inlined into the place where they are entered. A closure that is not inlined stays a
//! function of its own, without the instructions, so that kernels are measured after a change (`nox -s bench`).

#[cfg(target_arch = "aarch64")]
mod aarch64;
mod vector;
#[cfg(target_arch = "x86_64")]
mod x86;

use std::fmt;
use std::sync::OnceLock;

#[cfg(target_arch = "aarch64")]
pub(crate) use aarch64::Neon;
pub(crate) use vector::{Portable, Simd};
#[cfg(target_arch = "x86_64")]
pub(crate) use x86::{Avx2, Avx512};

/// A set of vector instructions, the smallest first. Those beyond [`Level::Portable`] carry the proof that the processor
/// has them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Level {
    /// Whatever the compiler may take for granted: any processor.
    Portable,
    /// x86-64 with AVX2 and FMA.
    #[cfg(target_arch = "x86_64")]
    Avx2(Avx2),
    /// x86-64 with AVX-512 F beside them.
    #[cfg(target_arch = "x86_64")]
    Avx512(Avx512),
    /// 64-bit Arm.
    #[cfg(target_arch = "aarch64")]
    Neon(Neon),
}

/// Something to calculate at any level.
pub(crate) trait Kernel {
    /// What it gives.
    type Output;
    /// Calculates with the instructions of `simd`. To be marked `#[inline(always)]`, as all that it calls.
    fn run<S: Simd>(self, simd: S) -> Self::Output;
}

impl Level {
    /// The highest level of this processor, or the lower one that the environment variable `ONCUE_SIMD` names
    /// (`portable`, `avx2`, `avx512`; `portable`, `neon` on Arm). Asked once a process.
    pub(crate) fn current() -> Level {
        static CURRENT: OnceLock<Level> = OnceLock::new();
        *CURRENT.get_or_init(|| {
            let best = Self::available().fold(Level::Portable, Level::max);
            let Ok(wanted) = std::env::var("ONCUE_SIMD") else { return best };
            Self::available().find(|level| level.to_string() == wanted).unwrap_or_else(|| {
                log::warn!(target: "oncue", "ONCUE_SIMD is ‘{wanted}’, a level that this processor has not; {best} is used");
                best
            })
        })
    }

    /// The levels that this processor has, the smallest first.
    #[cfg(target_arch = "x86_64")]
    pub(crate) fn available() -> impl Iterator<Item = Level> {
        let vectors = [Avx2::detect().map(Level::Avx2), Avx512::detect().map(Level::Avx512)];
        [Level::Portable].into_iter().chain(vectors.into_iter().flatten())
    }

    /// The levels that this processor has, the smallest first.
    #[cfg(target_arch = "aarch64")]
    pub(crate) fn available() -> impl Iterator<Item = Level> {
        [Level::Portable, Level::Neon(Neon)].into_iter()
    }

    /// The levels that this processor has, the smallest first.
    #[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
    pub(crate) fn available() -> impl Iterator<Item = Level> {
        [Level::Portable].into_iter()
    }

    /// Runs a kernel with the widest vectors of this level: 4 numbers side by side, 8 with AVX2 and NEON, 16 with AVX-512.
    #[inline]
    pub(crate) fn run<K: Kernel>(self, kernel: K) -> K::Output {
        match self {
            Level::Portable => kernel.run(Portable::<4>),
            #[cfg(target_arch = "x86_64")]
            Level::Avx2(proof) => proof.enter(kernel),
            #[cfg(target_arch = "x86_64")]
            Level::Avx512(proof) => proof.enter(kernel),
            #[cfg(target_arch = "aarch64")]
            Level::Neon(neon) => kernel.run(neon),
        }
    }

    /// Runs a kernel over data that lies in eights, with vectors of 8 numbers at every level. Every level gives the same
    /// bits as long as the kernel takes no fused product.
    #[inline]
    pub(crate) fn run_in_eights<K: Kernel>(self, kernel: K) -> K::Output {
        match self {
            Level::Portable => kernel.run(Portable::<8>),
            #[cfg(target_arch = "x86_64")]
            Level::Avx2(proof) => proof.enter(kernel),
            #[cfg(target_arch = "x86_64")]
            Level::Avx512(proof) => proof.avx2().enter(kernel),
            #[cfg(target_arch = "aarch64")]
            Level::Neon(neon) => kernel.run(neon),
        }
    }
}

impl fmt::Display for Level {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            Level::Portable => "portable",
            #[cfg(target_arch = "x86_64")]
            Level::Avx2(_) => "avx2",
            #[cfg(target_arch = "x86_64")]
            Level::Avx512(_) => "avx512",
            #[cfg(target_arch = "aarch64")]
            Level::Neon(_) => "neon",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_processor_has_the_portable_level_and_uses_one_that_it_has() {
        let levels: Vec<Level> = Level::available().collect();
        assert_eq!(levels[0], Level::Portable);
        assert!(levels.is_sorted() && levels.contains(&Level::current()));
    }

    /// Every operation on two vectors, with what it should give lane by lane.
    struct Operations<'a> {
        a: &'a [f32],
        b: &'a [f32],
    }

    impl Kernel for Operations<'_> {
        type Output = usize;

        fn run<S: Simd>(self, s: S) -> usize {
            let (a, b) = (s.load(self.a), s.load(self.b));
            let check = |name: &str, found: S::F32, wanted: fn(f32, f32) -> f32| {
                let mut lanes = vec![0.0; S::LANES];
                s.store(found, &mut lanes);
                for (i, lane) in lanes.iter().enumerate() {
                    let wanted = wanted(self.a[i], self.b[i]);
                    assert!(
                        *lane == wanted || (lane.is_nan() && wanted.is_nan()),
                        "{name} {i}: {lane} {wanted}"
                    );
                }
            };
            check("load", a, |a, _| a);
            check("splat", s.splat(2.5), |_, _| 2.5);
            check("add", s.add(a, b), |a, b| a + b);
            check("sub", s.sub(a, b), |a, b| a - b);
            check("mul", s.mul(a, b), |a, b| a * b);
            // The second operand where one is not a number.
            check("min", s.min(a, b), |a, b| if a < b { a } else { b });
            check("max", s.max(a, b), |a, b| if a > b { a } else { b });
            check("abs", s.abs(a), |a, _| a.abs());
            check("where_positive", s.where_positive(a, b), |a, b| if b > 0.0 { a } else { 0.0 });
            // Of numbers whose product is exact, a fused product and a plain one are equal.
            check("add_product", s.add_product(a, a, b), |a, b| a + a * b);
            let bits = s.le(a, b);
            for i in 0..S::LANES {
                assert_eq!(bits >> i & 1 == 1, self.a[i] <= self.b[i], "le {i}");
            }
            assert_eq!(bits >> S::LANES, 0);
            S::LANES
        }
    }

    #[test]
    fn every_operation_of_every_level_is_that_of_each_number() {
        let a: Vec<f32> = (0..16).map(|i| [0.0, -1.5, 2.25, -0.0, f32::NAN, 3.0, -8.0][i % 7]).collect();
        let b: Vec<f32> = (0..16).map(|i| [1.0, -1.5, -4.0, 0.0, 2.0][i % 5]).collect();
        for level in Level::available() {
            let lanes = level.run(Operations { a: &a, b: &b });
            assert!([4, 8, 16].contains(&lanes));
            assert_eq!(level.run_in_eights(Operations { a: &a, b: &b }), 8);
        }
    }

    #[test]
    #[should_panic(expected = "load")]
    fn a_load_beyond_the_end_is_caught() {
        Level::current().run(Operations { a: &[1.0; 2], b: &[1.0; 16] });
    }
}
