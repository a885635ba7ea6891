//! Adam (Kingma & Ba 2015).

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

const BETA1: f32 = 0.9;
const BETA2: f32 = 0.999;
const EPSILON: f32 = 1e-8;
/// Parameters that one thread takes at a time.
const SLICE: usize = 1 << 15;

/// Moments of one flat parameter vector.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Adam {
    pub learning_rate: f32,
    step: i32,
    first: Vec<f32>,
    second: Vec<f32>,
}

impl Adam {
    pub fn new(learning_rate: f32, parameters: usize) -> Self {
        Self { learning_rate, step: 0, first: vec![0.0; parameters], second: vec![0.0; parameters] }
    }

    /// One step down `gradient × scale`.
    pub fn step(&mut self, parameters: &mut [f32], gradient: &[f32], scale: f32) {
        self.step += 1;
        let rate = self.learning_rate * (1.0 - BETA2.powi(self.step)).sqrt() / (1.0 - BETA1.powi(self.step));
        let moments = self.first.par_chunks_mut(SLICE).zip(self.second.par_chunks_mut(SLICE));
        parameters.par_chunks_mut(SLICE).zip(gradient.par_chunks(SLICE)).zip(moments).for_each(
            |((parameters, gradient), (first, second))| {
                descend(parameters, gradient, first, second, rate, scale);
            },
        );
    }
}

fn descend(p: &mut [f32], g: &[f32], first: &mut [f32], second: &mut [f32], rate: f32, scale: f32) {
    #[cfg(target_arch = "x86_64")]
    if crate::simd::Level::current() >= crate::simd::Level::Avx2 {
        // SAFETY: the processor has AVX2.
        return unsafe { descend_avx2(p, g, first, second, rate, scale) };
    }
    descend_impl(p, g, first, second, rate, scale);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
unsafe fn descend_avx2(
    p: &mut [f32],
    g: &[f32],
    first: &mut [f32],
    second: &mut [f32],
    rate: f32,
    scale: f32,
) {
    descend_impl(p, g, first, second, rate, scale);
}

#[inline(always)]
fn descend_impl(p: &mut [f32], g: &[f32], first: &mut [f32], second: &mut [f32], rate: f32, scale: f32) {
    for (((p, &g), m), v) in p.iter_mut().zip(g).zip(first).zip(second) {
        let g = g * scale;
        *m = BETA1 * *m + (1.0 - BETA1) * g;
        *v = BETA2 * *v + (1.0 - BETA2) * g * g;
        *p -= rate * *m / (v.sqrt() + EPSILON);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn first_step_is_the_learning_rate_against_the_sign() {
        let mut adam = Adam::new(0.1, 2);
        let mut p = [1.0, -1.0];
        adam.step(&mut p, &[3.0, -0.5], 1.0);
        assert!((p[0] - 0.9).abs() < 1e-5 && (p[1] + 0.9).abs() < 1e-5);
    }
}
