//! Which vector instructions the kernels use: chosen at run time, so that one wheel runs on any processor.
//!
//! Kernels are written once, over a trait of lanes, and compiled for every level. Every level that a processor has
//! can be called by itself, so that tests hold each against a plain reference.

use std::fmt;
use std::sync::OnceLock;

/// A set of vector instructions, the smallest first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Level {
    /// Whatever the compiler may take for granted: any processor.
    Portable,
    /// x86-64 with AVX2 and FMA.
    Avx2,
    /// x86-64 with AVX-512 F beside them.
    Avx512,
}

impl Level {
    const ALL: [Level; 3] = [Level::Portable, Level::Avx2, Level::Avx512];

    /// The highest level of this processor, or the lower one that the environment variable `ONCUE_SIMD` names
    /// (`portable`, `avx2`, `avx512`). Asked once a process.
    pub fn current() -> Level {
        static CURRENT: OnceLock<Level> = OnceLock::new();
        *CURRENT.get_or_init(|| {
            let best = Self::available().fold(Level::Portable, Level::max);
            let wanted = std::env::var("ONCUE_SIMD").unwrap_or_default();
            Self::ALL
                .into_iter()
                .find(|level| level.to_string() == wanted)
                .map_or(best, |level| level.min(best))
        })
    }

    /// The levels that this processor has, the smallest first.
    pub fn available() -> impl Iterator<Item = Level> {
        Self::ALL.into_iter().filter(|level| level.is_available())
    }

    fn is_available(self) -> bool {
        #[cfg(target_arch = "x86_64")]
        {
            let avx2 = || is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma");
            match self {
                Level::Portable => true,
                Level::Avx2 => avx2(),
                Level::Avx512 => avx2() && is_x86_feature_detected!("avx512f"),
            }
        }
        #[cfg(not(target_arch = "x86_64"))]
        {
            self == Level::Portable
        }
    }
}

impl fmt::Display for Level {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            Level::Portable => "portable",
            Level::Avx2 => "avx2",
            Level::Avx512 => "avx512",
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
}
