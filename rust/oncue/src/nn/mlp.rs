//! A stack of dense layers with ReLU between them, its parameters in one flat vector.

use rand::Rng;
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};

use super::matmul::{View, matmul};

/// y = W_n·relu(… relu(W_1·x + b_1) …) + b_n.
///
/// Parameters lie layer by layer: W (out × in, row-major), then b (out).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Mlp {
    /// Widths from input to output.
    pub sizes: Vec<usize>,
    pub parameters: Vec<f32>,
}

/// What a forward pass leaves behind: the output of every layer, `rows × width` each.
#[derive(Debug, Clone, Default)]
pub struct Activations {
    layers: Vec<Vec<f32>>,
    gradient: [Vec<f32>; 2],
}

impl Activations {
    /// The network's output, `rows × sizes.last()`.
    pub fn output(&self) -> &[f32] {
        self.layers.last().map_or(&[], |l| l.as_slice())
    }
}

impl Mlp {
    /// Random normal weights: std √(2 / fan-in) for the hidden layers, `output_scale` / √fan-in for the last.
    pub fn new(sizes: &[usize], output_scale: f32, rng: &mut impl Rng) -> Self {
        let mut parameters = Vec::with_capacity(Self::count(sizes));
        let last = sizes.len() - 2;
        for (layer, pair) in sizes.windows(2).enumerate() {
            let (inputs, outputs) = (pair[0], pair[1]);
            let std = if layer == last { output_scale } else { 2.0f32.sqrt() } / (inputs as f32).sqrt();
            parameters.extend((0..inputs * outputs).map(|_| {
                let n: f32 = StandardNormal.sample(rng);
                n * std
            }));
            parameters.extend(std::iter::repeat_n(0.0, outputs));
        }
        Self { sizes: sizes.to_vec(), parameters }
    }

    fn count(sizes: &[usize]) -> usize {
        sizes.windows(2).map(|p| (p[0] + 1) * p[1]).sum()
    }

    /// Whether the parameters are as many as the sizes say.
    pub fn is_consistent(&self) -> bool {
        self.sizes.len() >= 2 && self.parameters.len() == Self::count(&self.sizes)
    }

    pub fn input_size(&self) -> usize {
        self.sizes[0]
    }

    pub fn output_size(&self) -> usize {
        self.sizes[self.sizes.len() - 1]
    }

    /// For each layer: where its weights begin in the flat vector, its inputs, its outputs.
    fn layers(&self) -> impl DoubleEndedIterator<Item = (usize, usize, usize)> + ExactSizeIterator {
        let mut offset = 0;
        let layers: Vec<_> = self
            .sizes
            .windows(2)
            .map(|p| {
                let here = offset;
                offset += (p[0] + 1) * p[1];
                (here, p[0], p[1])
            })
            .collect();
        layers.into_iter()
    }

    /// Runs `rows` inputs (`rows × input_size`) through the network.
    pub fn forward(&self, input: &[f32], rows: usize, out: &mut Activations) {
        let layer_count = self.sizes.len() - 1;
        out.layers.resize_with(layer_count, Vec::new);
        for (layer, (offset, inputs, outputs)) in self.layers().enumerate() {
            let weight = &self.parameters[offset..offset + inputs * outputs];
            let bias = &self.parameters[offset + inputs * outputs..offset + (inputs + 1) * outputs];
            let (before, after) = out.layers.split_at_mut(layer);
            let x: &[f32] = if layer == 0 { input } else { &before[layer - 1] };
            let y = &mut after[0];
            y.resize(rows * outputs, 0.0);
            for row in y.chunks_exact_mut(outputs) {
                row.copy_from_slice(bias);
            }
            matmul(y, View::new(x, rows, inputs), View::new(weight, outputs, inputs).t(), true);
            if layer + 1 < layer_count {
                for v in y.iter_mut() {
                    *v = v.max(0.0);
                }
            }
        }
    }

    /// Writes the gradient of a loss to `gradient` (as long as `parameters`), given its derivative by the
    /// output of the last [`Mlp::forward`] with the same `input` and `activations`.
    pub fn backward(
        &self,
        input: &[f32],
        rows: usize,
        activations: &mut Activations,
        d_output: &[f32],
        gradient: &mut [f32],
    ) {
        let Activations { layers, gradient: [upper, lower] } = activations;
        upper.clear();
        upper.extend_from_slice(d_output);
        for (layer, (offset, inputs, outputs)) in self.layers().enumerate().rev() {
            let x: &[f32] = if layer == 0 { input } else { &layers[layer - 1] };
            let (d_weight, rest) = gradient[offset..].split_at_mut(inputs * outputs);
            matmul(d_weight, View::new(upper, rows, outputs).t(), View::new(x, rows, inputs), false);
            rest[..outputs].fill(0.0);
            for row in upper.chunks_exact(outputs) {
                for (d, v) in rest[..outputs].iter_mut().zip(row) {
                    *d += v;
                }
            }
            if layer > 0 {
                let weight = &self.parameters[offset..offset + inputs * outputs];
                lower.resize(rows * inputs, 0.0);
                matmul(lower, View::new(upper, rows, outputs), View::new(weight, outputs, inputs), false);
                for (d, &v) in lower.iter_mut().zip(x) {
                    // ReLU passes the gradient where it passed the value.
                    *d = if v > 0.0 { *d } else { 0.0 };
                }
                std::mem::swap(upper, lower);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_pcg::Pcg32;

    #[test]
    fn gradient_agrees_with_finite_differences() {
        let mut rng = Pcg32::seed_from_u64(1);
        let mut net = Mlp::new(&[3, 5, 4, 2], 1.0, &mut rng);
        let input = [0.3, -0.2, 0.9, -0.5, 0.8, 0.1];
        let loss = |net: &Mlp| {
            let mut act = Activations::default();
            net.forward(&input, 2, &mut act);
            act.output().iter().enumerate().map(|(i, v)| v * v * (i + 1) as f32).sum::<f32>()
        };
        let mut act = Activations::default();
        net.forward(&input, 2, &mut act);
        let d: Vec<f32> = act.output().iter().enumerate().map(|(i, v)| 2.0 * v * (i + 1) as f32).collect();
        let mut gradient = vec![0.0; net.parameters.len()];
        net.backward(&input, 2, &mut act, &d, &mut gradient);
        for i in 0..net.parameters.len() {
            let saved = net.parameters[i];
            let h = 1e-3;
            net.parameters[i] = saved + h;
            let up = loss(&net);
            net.parameters[i] = saved - h;
            let down = loss(&net);
            net.parameters[i] = saved;
            let numeric = (up - down) / (2.0 * h);
            assert!(
                (numeric - gradient[i]).abs() < 2e-2 * (1.0 + numeric.abs()),
                "{i}: {numeric} {}",
                gradient[i]
            );
        }
    }
}
