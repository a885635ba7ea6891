//! A stack of dense layers with ReLU between them, its parameters in one flat vector.

use rand::Rng;
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};

use super::matmul::{matmul_at, matrix};
use super::product::{Finish, Start, add_row_products, multiply};
use super::samples::Samples;
use crate::simd::Level;

/// y = W_n·relu(… relu(W_1·x + b_1) …) + b_n.
///
/// Parameters lie layer by layer: W (out × in, row-major), then b (out).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Mlp {
    /// Widths from input to output.
    pub sizes: Vec<usize>,
    /// W and b of each layer.
    pub parameters: Vec<f32>,
}

/// What a forward pass leaves behind: every layer's output, a sample a column.
#[derive(Debug, Clone, Default)]
pub struct Activations {
    input: Samples,
    layers: Vec<Samples>,
    output: Vec<f32>,
    /// The last layer's input, where there is one sample only.
    one: Vec<f32>,
    gradient: [Samples; 2],
    /// A layer's input, a sample a row.
    rows: Samples,
}

impl Activations {
    /// The network's output, `rows × sizes.last()`.
    pub fn output(&self) -> &[f32] {
        &self.output
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

    /// Numbers of an input.
    pub fn input_size(&self) -> usize {
        self.sizes[0]
    }

    /// Numbers of an output.
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
        self.forward_at(Level::current(), input, rows, out);
    }

    /// [`Mlp::forward`] at a level that the processor has.
    fn forward_at(&self, level: Level, input: &[f32], rows: usize, out: &mut Activations) {
        let layer_count = self.sizes.len() - 1;
        out.layers.resize_with(layer_count, Samples::default);
        out.input.transpose_dense(input, rows, self.input_size());
        for (layer, (offset, inputs, outputs)) in self.layers().enumerate() {
            let weight = &self.parameters[offset..offset + inputs * outputs];
            let bias = &self.parameters[offset + inputs * outputs..offset + (inputs + 1) * outputs];
            let (before, after) = out.layers.split_at_mut(layer);
            let x = before.last().unwrap_or(&out.input).padded();
            let y = &mut after[0];
            y.reshape(outputs, rows);
            let finish = if layer + 1 < layer_count { Finish::Relu } else { Finish::Plain };
            let weight = matrix(weight, outputs, inputs);
            multiply(level, y.padded_mut(), weight, x, rows, Start::Bias(bias), finish);
        }
        if let Some(last) = out.layers.last() {
            last.write_transpose(&mut out.output);
        }
    }

    /// Runs one input through the network: as [`Mlp::forward`], but faster for one, and not to be followed by
    /// [`Mlp::backward`].
    pub fn forward_one(&self, input: &[f32], out: &mut Activations) {
        self.forward_one_at(Level::current(), input, out);
    }

    fn forward_one_at(&self, level: Level, input: &[f32], out: &mut Activations) {
        let Activations { output, one, .. } = out;
        input.clone_into(output);
        let last = self.sizes.len() - 2;
        for (layer, (offset, inputs, outputs)) in self.layers().enumerate() {
            std::mem::swap(output, one);
            let (weight, rest) = self.parameters[offset..].split_at(inputs * outputs);
            rest[..outputs].clone_into(output);
            add_row_products(level, weight, one, output);
            if layer < last {
                output.iter_mut().for_each(|v| *v = v.max(0.0));
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
        self.backward_at(Level::current(), input, rows, activations, d_output, gradient);
    }

    /// [`Mlp::backward`] at a level that the processor has.
    fn backward_at(
        &self,
        level: Level,
        input: &[f32],
        rows: usize,
        activations: &mut Activations,
        d_output: &[f32],
        gradient: &mut [f32],
    ) {
        let Activations { layers, gradient: [upper, lower], rows: x, .. } = activations;
        upper.transpose_dense(d_output, rows, self.output_size());
        for (layer, (offset, inputs, outputs)) in self.layers().enumerate().rev() {
            let below = layer.checked_sub(1).map(|below| &layers[below]);
            match below {
                Some(below) => x.transpose(below),
                None => x.copy(input, rows, inputs),
            }
            let (d_weight, rest) = gradient[offset..].split_at_mut(inputs * outputs);
            matmul_at(level, d_weight, upper.view(), x.view(), false);
            for (row, d) in rest[..outputs].iter_mut().enumerate() {
                *d = sum(upper.row(row));
            }
            if let Some(below) = below {
                let weight = matrix(&self.parameters[offset..offset + inputs * outputs], outputs, inputs);
                lower.reshape(inputs, rows);
                // ReLU passes the gradient where it passed the value.
                let finish = Finish::Passed(&below.data);
                multiply(
                    level,
                    lower.padded_mut(),
                    weight.reversed_axes(),
                    upper.padded(),
                    rows,
                    Start::Zero,
                    finish,
                );
                std::mem::swap(upper, lower);
            }
        }
    }
}

/// The sum of `values`, in lanes.
fn sum(values: &[f32]) -> f32 {
    let mut lanes = [0.0f32; 16];
    let chunks = values.chunks_exact(16);
    let rest: f32 = chunks.remainder().iter().sum();
    for chunk in chunks {
        for lane in 0..16 {
            lanes[lane] += chunk[lane];
        }
    }
    lanes.iter().sum::<f32>() + rest
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg32;

    #[test]
    fn gradient_agrees_with_finite_differences() {
        for level in Level::available() {
            // Fewer rows than a tile has, and more.
            for rows in [2, 35] {
                gradient_agrees(level, rows);
            }
        }
    }

    fn gradient_agrees(level: Level, rows: usize) {
        let mut rng = Pcg32::seed_from_u64(1);
        let mut net = Mlp::new(&[3, 5, 4, 2], 1.0, &mut rng);
        let input: Vec<f32> = (0..rows * 3).map(|_| rng.random_range(-1.0..1.0)).collect();
        let run = |net: &Mlp| {
            let mut act = Activations::default();
            net.forward_at(level, &input, rows, &mut act);
            act
        };
        let weight = |i: usize| f64::from((i % 3 + 1) as u8) / rows as f64;
        let loss = |net: &Mlp| -> f64 {
            run(net).output().iter().enumerate().map(|(i, v)| f64::from(v * v) * weight(i)).sum()
        };
        let mut act = run(&net);
        let d: Vec<f32> = act.output().iter().enumerate().map(|(i, v)| 2.0 * v * weight(i) as f32).collect();
        let mut gradient = vec![f32::NAN; net.parameters.len()];
        net.backward_at(level, &input, rows, &mut act, &d, &mut gradient);
        for i in 0..net.parameters.len() {
            let saved = net.parameters[i];
            let h = 1e-3;
            net.parameters[i] = saved + h;
            let up = loss(&net);
            net.parameters[i] = saved - h;
            let down = loss(&net);
            net.parameters[i] = saved;
            let (numeric, analytic) = ((up - down) / f64::from(2.0 * h), f64::from(gradient[i]));
            assert!(
                (numeric - analytic).abs() < 2e-2 * (1.0 + numeric.abs()),
                "{level}, {rows} rows, {i}: {numeric} {analytic}"
            );
        }
    }

    /// Two layers written out, at every level, one by one and as a batch.
    #[test]
    fn every_level_gives_the_networks_output() {
        let mut rng = Pcg32::seed_from_u64(2);
        let net = Mlp::new(&[37, 50, 19], 1.0, &mut rng);
        let input: Vec<f32> = (0..40 * 37).map(|_| rng.random_range(-1.0..1.0)).collect();
        let layer = |x: &[f64], weight: &[f32], bias: &[f32]| -> Vec<f64> {
            let product = |w: &[f32]| w.iter().zip(x).map(|(w, x)| f64::from(*w) * x).sum::<f64>();
            weight.chunks_exact(x.len()).zip(bias).map(|(w, b)| product(w) + f64::from(*b)).collect()
        };
        let (first, second) = net.parameters.split_at(38 * 50);
        for level in Level::available() {
            let (mut all, mut one) = (Activations::default(), Activations::default());
            net.forward_at(level, &input, 40, &mut all);
            for (x, found) in input.chunks_exact(37).zip(all.output().chunks_exact(19)) {
                net.forward_one_at(level, x, &mut one);
                let x: Vec<f64> = x.iter().copied().map(f64::from).collect();
                let hidden: Vec<f64> =
                    layer(&x, &first[..37 * 50], &first[37 * 50..]).into_iter().map(|v| v.max(0.0)).collect();
                let expected = layer(&hidden, &second[..50 * 19], &second[50 * 19..]);
                for ((e, a), b) in expected.iter().zip(found).zip(one.output()) {
                    assert!((e - f64::from(*a)).abs() < 1e-5, "{level}: {a} {e}");
                    assert!((e - f64::from(*b)).abs() < 1e-5, "{level}, one: {b} {e}");
                }
            }
        }
    }
}
