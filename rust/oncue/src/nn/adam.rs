//! Adam (Kingma & Ba 2015).

use serde::{Deserialize, Serialize};

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
        const BETA1: f32 = 0.9;
        const BETA2: f32 = 0.999;
        const EPSILON: f32 = 1e-8;
        self.step += 1;
        let rate = self.learning_rate * (1.0 - BETA2.powi(self.step)).sqrt() / (1.0 - BETA1.powi(self.step));
        for (((p, &g), m), v) in
            parameters.iter_mut().zip(gradient).zip(&mut self.first).zip(&mut self.second)
        {
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
