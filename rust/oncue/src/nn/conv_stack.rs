//! Layers of temporal convolutions, all in one direction, with a leaky ReLU between them whose knee is below zero.

use rand::Rng;
use serde::{Deserialize, Serialize};

use super::conv1d::{Conv1d, Direction, Shape, merge, split};

/// The slope below the knee. A plain ReLU would stop the gradient there, and with it an optimization of the latent
/// vector.
pub(crate) const LEAK: f32 = 0.2;
/// The activation bends at -ACTIVATION_KNEE instead of 0: the same as a bias before it and its opposite after it, but what the
/// next layer sees has mean 0, without which small steps of all its weights together are a large one.
pub(crate) const ACTIVATION_KNEE: f32 = 2.0;

fn activate(v: f32) -> f32 {
    if v > -ACTIVATION_KNEE { v } else { LEAK * (v + ACTIVATION_KNEE) - ACTIVATION_KNEE }
}

/// The activation's derivative, given its output.
fn slope(output: f32) -> f32 {
    if output > -ACTIVATION_KNEE { 1.0 } else { LEAK }
}

/// y = L_n(… act(L_1(x)) …), each layer halving (or doubling) the number of frames.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct ConvStack {
    pub layers: Vec<Conv1d>,
}

/// What a pass leaves behind, and the buffers of the way back.
#[derive(Debug, Clone, Default)]
pub(crate) struct ConvWorkspace {
    shapes: Vec<Shape>,
    /// Each layer's input, in the form that the layer takes.
    inputs: Vec<Vec<f32>>,
    /// The last layer's output: coarse for [`Direction::Down`], fine for [`Direction::Up`].
    pub output: Vec<f32>,
    gradient: [Vec<f32>; 2],
    scratch: Vec<f32>,
}

impl ConvWorkspace {
    /// The first layer's input, to be filled before [`ConvStack::forward`]: fine or coarse, as the layer takes it.
    pub(crate) fn input(&mut self) -> &mut Vec<f32> {
        if self.inputs.is_empty() {
            self.inputs.push(Vec::new());
        }
        &mut self.inputs[0]
    }
}

impl ConvStack {
    /// Random layers between the channel counts of `sizes`; the last one's output has the variance `output_gain` for
    /// an input of variance 1.
    pub(crate) fn new(direction: Direction, sizes: &[usize], output_gain: f32, rng: &mut impl Rng) -> Self {
        let last = sizes.len() - 2;
        let gain = |layer: usize| if layer == last { output_gain } else { 1.0 };
        let layers =
            sizes.windows(2).enumerate().map(|(i, s)| Conv1d::new(direction, s[0], s[1], gain(i), rng));
        Self { layers: layers.collect() }
    }

    pub(crate) fn parameter_count(&self) -> usize {
        self.layers.iter().map(|l| l.parameters.len()).sum()
    }

    /// Runs the workspace's input through the layers. `coarsest` is the shape at the narrow end.
    pub(crate) fn forward(&self, coarsest: Shape, work: &mut ConvWorkspace) {
        let count = self.layers.len();
        work.inputs.resize_with(count, Vec::new);
        work.shapes.clear();
        for (i, layer) in self.layers.iter().enumerate() {
            let level = if layer.direction == Direction::Down { count - 1 - i } else { i };
            let shape = Shape { frames: coarsest.frames << level, ..coarsest };
            work.shapes.push(shape);
            let (before, after) = work.inputs.split_at_mut(i + 1);
            layer.forward(&before[i], shape, &mut work.output, &mut work.scratch);
            if let Some(next) = after.first_mut() {
                let width = shape.batch * layer.outputs;
                match layer.direction {
                    Direction::Down => split(&work.output, width, next, activate),
                    Direction::Up => merge(&work.output, width, next, activate),
                }
            }
        }
    }

    /// The gradient of a loss by the input of the last [`ConvStack::forward`], given that by its output, both in the
    /// forms of that pass. Sets `parameters` (one slice a layer), where given, to the gradients by the layers'
    /// parameters; without `by_input` the first layer's input gets none and the result is empty.
    pub(crate) fn backward<'w>(
        &self,
        d_output: &[f32],
        work: &'w mut ConvWorkspace,
        mut parameters: Option<&mut [Vec<f32>]>,
        by_input: bool,
    ) -> &'w [f32] {
        let ConvWorkspace { shapes, inputs, gradient: [upper, lower], scratch, .. } = work;
        upper.clear();
        upper.extend_from_slice(d_output);
        for (i, layer) in self.layers.iter().enumerate().rev() {
            if let Some(gradients) = &mut parameters {
                gradients[i].resize(layer.parameters.len(), 0.0);
                layer.d_parameters(&inputs[i], upper, shapes[i], &mut gradients[i]);
            }
            if i == 0 && !by_input {
                return &[];
            }
            layer.d_input(upper, shapes[i], lower, scratch);
            if i == 0 {
                break;
            }
            for (d, &v) in lower.iter_mut().zip(&inputs[i]) {
                *d *= slope(v);
            }
            let width = shapes[i].batch * layer.inputs;
            match layer.direction {
                Direction::Down => merge(lower, width, upper, |v| v),
                Direction::Up => split(lower, width, upper, |v| v),
            }
        }
        lower
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg32;

    #[test]
    fn gradients_agree_with_finite_differences() {
        let mut rng = Pcg32::seed_from_u64(3);
        let coarsest = Shape { frames: 3, batch: 2 };
        for direction in [Direction::Down, Direction::Up] {
            let mut stack = ConvStack::new(direction, &[3, 4, 2], 1.0, &mut rng);
            let frames = if direction == Direction::Down { 12 } else { 3 };
            let mut input: Vec<f32> = (0..frames * 2 * 3).map(|_| rng.random_range(-6.0..6.0)).collect();
            let mut work = ConvWorkspace::default();
            let mut output = |stack: &ConvStack, input: &[f32]| {
                input.clone_into(work.input());
                stack.forward(coarsest, &mut work);
                work.clone()
            };
            let loss =
                |y: &[f32]| y.iter().enumerate().map(|(i, v)| f64::from(v * v) * (i % 7) as f64).sum::<f64>();
            let mut done = output(&stack, &input);
            let d: Vec<f32> = done.output.iter().enumerate().map(|(i, v)| 2.0 * v * (i % 7) as f32).collect();
            let mut gradients = vec![Vec::new(); 2];
            let d_input = stack.backward(&d, &mut done, Some(&mut gradients), true).to_vec();
            let agree = |numeric: f64, analytic: f32, what: &str| {
                let analytic = f64::from(analytic);
                assert!(
                    (numeric - analytic).abs() < 2e-2 * (1.0 + analytic.abs()),
                    "{what}: {numeric} {analytic}"
                );
            };
            let h = 1e-3;
            for i in 0..input.len() {
                let saved = input[i];
                input[i] = saved + h;
                let up = loss(&output(&stack, &input).output);
                input[i] = saved - h;
                let down = loss(&output(&stack, &input).output);
                input[i] = saved;
                agree((up - down) / f64::from(2.0 * h), d_input[i], "input");
            }
            for layer in 0..2 {
                for i in (0..stack.layers[layer].parameters.len()).step_by(5) {
                    let saved = stack.layers[layer].parameters[i];
                    stack.layers[layer].parameters[i] = saved + h;
                    let up = loss(&output(&stack, &input).output);
                    stack.layers[layer].parameters[i] = saved - h;
                    let down = loss(&output(&stack, &input).output);
                    stack.layers[layer].parameters[i] = saved;
                    agree((up - down) / f64::from(2.0 * h), gradients[layer][i], "parameter");
                }
            }
        }
    }
}
