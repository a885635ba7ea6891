//! Adam (Kingma & Ba 2015), with ε beside the uncorrected second moment, as at the end of their section 2.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::simd::{Kernel, Level, Simd};

const BETA1: f32 = 0.9;
const BETA2: f32 = 0.999;
const EPSILON: f32 = 1e-8;
/// Parameters that one thread takes at a time.
const PARAMETER_SLICE: usize = 1 << 15;

/// Moments of one flat parameter vector.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Adam {
    /// Step size before the moments' correction.
    pub learning_rate: f32,
    step: i32,
    first: Vec<f32>,
    second: Vec<f32>,
}

impl Adam {
    /// Moments at zero, for so many parameters.
    pub fn new(learning_rate: f32, parameters: usize) -> Self {
        Self { learning_rate, step: 0, first: vec![0.0; parameters], second: vec![0.0; parameters] }
    }

    /// The running means of the gradient and of its square, before the correction.
    pub fn moments(&self) -> (&[f32], &[f32]) {
        (&self.first, &self.second)
    }

    /// One step down `gradient × scale`.
    pub fn step(&mut self, parameters: &mut [f32], gradient: &[f32], scale: f32) {
        self.step += 1;
        let rate = self.learning_rate * (1.0 - BETA2.powi(self.step)).sqrt() / (1.0 - BETA1.powi(self.step));
        let level = Level::current();
        let moments =
            self.first.par_chunks_mut(PARAMETER_SLICE).zip(self.second.par_chunks_mut(PARAMETER_SLICE));
        parameters
            .par_chunks_mut(PARAMETER_SLICE)
            .zip(gradient.par_chunks(PARAMETER_SLICE))
            .zip(moments)
            .for_each(|((parameters, gradient), (first, second))| {
                level.run_in_eights(Descent { parameters, gradient, first, second, rate, scale });
            });
    }
}

/// One slice of [`Adam::step`].
struct Descent<'a> {
    parameters: &'a mut [f32],
    gradient: &'a [f32],
    first: &'a mut [f32],
    second: &'a mut [f32],
    rate: f32,
    scale: f32,
}

impl Kernel for Descent<'_> {
    type Output = ();

    /// The compiler lays these lines out in whatever vectors the level has.
    #[inline(always)]
    fn run<S: Simd>(self, _simd: S) {
        let Self { parameters, gradient, first, second, rate, scale } = self;
        for (((p, &g), m), v) in parameters.iter_mut().zip(gradient).zip(first).zip(second) {
            let g = g * scale;
            *m = BETA1 * *m + (1.0 - BETA1) * g;
            *v = BETA2 * *v + (1.0 - BETA2) * g * g;
            *p -= rate * *m / (v.sqrt() + EPSILON);
        }
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
