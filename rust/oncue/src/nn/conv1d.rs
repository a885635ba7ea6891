//! Temporal convolutions of stride 2 and their transposes, channel-last, several sequences at once.
//!
//! A convolution halves a *fine* sequence of 2F frames into a *coarse* one of F, its transpose doubles it back:
//!
//! ```text
//! Direction::Down   coarse[t]            = b + Σ_k fine[2t + k - 12] · W_k
//! Direction::Up     fine[2t + k - 12]   += coarse[t] · W_k,  over b
//! ```
//!
//! with zeros outside the sequence. The fine sequence is kept as its even frames and then its odd ones
//! ([`split`], [`merge`]): then all frames that one tap k touches lie side by side in both sequences, and each tap
//! is a dense product, for every sequence of the batch at once. Frames stand outermost, sequences within:
//! coarse (F × batch × channels), fine (2 × F × batch × channels).
//!
//! The even and the odd taps go to two threads and are joined in a fixed order: the result does not depend on
//! how many there are.

use ndarray::ArrayView2;
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::matmul::{matmul, matrix};

/// Width of the kernel, frames (LAMA, supplementary).
pub(crate) const KERNEL: usize = 25;
/// Frames that the kernel reaches to each side.
const KERNEL_REACH: usize = KERNEL / 2;

/// Which of the two a layer is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Direction {
    /// Fine to coarse: the convolution.
    Down,
    /// Coarse to fine: the transposed convolution.
    Up,
}

/// How many frames and sequences a pass has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shape {
    /// F: frames of the coarse sequence.
    pub frames: usize,
    /// Sequences.
    pub batch: usize,
}

/// One layer; `parameters` hold W_0 … W_24 (each in × out, row-major), then b (out).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Conv1d {
    /// Whether frames become fewer or more.
    pub direction: Direction,
    /// Channels in.
    pub inputs: usize,
    /// Channels out.
    pub outputs: usize,
    /// Weights, tap by tap (inputs × outputs), then the biases.
    pub parameters: Vec<f32>,
}

impl Conv1d {
    /// Random normal weights that keep the variance `gain`-fold, b = 0.
    pub fn new(direction: Direction, inputs: usize, outputs: usize, gain: f32, rng: &mut impl Rng) -> Self {
        // Of the taps of a transposed convolution half reach each frame.
        let taps = if direction == Direction::Down { KERNEL } else { KERNEL.div_ceil(2) };
        let std = (gain / (taps * inputs) as f32).sqrt();
        let mut layer = Self::zeros(direction, inputs, outputs);
        for weight in &mut layer.parameters[..KERNEL * inputs * outputs] {
            let n: f32 = StandardNormal.sample(rng);
            *weight = n * std;
        }
        layer
    }

    /// W = 0, b = 0.
    pub fn zeros(direction: Direction, inputs: usize, outputs: usize) -> Self {
        let parameters = vec![0.0; (KERNEL * inputs + 1) * outputs];
        Self { direction, inputs, outputs, parameters }
    }

    fn weights(&self) -> usize {
        KERNEL * self.inputs * self.outputs
    }

    /// W_k, or its transpose.
    fn tap(&self, k: usize, transposed: bool) -> ArrayView2<'_, f32> {
        let size = self.inputs * self.outputs;
        let view = matrix(&self.parameters[k * size..(k + 1) * size], self.inputs, self.outputs);
        if transposed { view.reversed_axes() } else { view }
    }

    /// The layer's output. `input` is fine for [`Direction::Down`] and coarse for [`Direction::Up`], `output` the
    /// other; `scratch` is a buffer to reuse.
    pub fn forward(&self, input: &[f32], shape: Shape, output: &mut Vec<f32>, scratch: &mut Vec<f32>) {
        let bias = &self.parameters[self.weights()..];
        match self.direction {
            Direction::Down => self.gather(input, shape, false, Some(bias), output, scratch),
            Direction::Up => self.scatter(input, shape, false, Some(bias), output),
        }
    }

    /// The gradient of a loss by the layer's input, given that by its output.
    pub fn d_input(&self, d_output: &[f32], shape: Shape, d_input: &mut Vec<f32>, scratch: &mut Vec<f32>) {
        match self.direction {
            Direction::Down => self.scatter(d_output, shape, true, None, d_input),
            Direction::Up => self.gather(d_output, shape, true, None, d_input, scratch),
        }
    }

    /// Sets `gradient` (as long as `parameters`) to the gradient of a loss, given that by the layer's output.
    pub fn d_parameters(&self, input: &[f32], d_output: &[f32], shape: Shape, gradient: &mut [f32]) {
        let (d_weights, d_bias) = gradient.split_at_mut(self.weights());
        d_weights.par_chunks_exact_mut(self.inputs * self.outputs).enumerate().for_each(|(k, d_weight)| {
            let (fine, coarse, rows) = spans(k, shape);
            let (i, o) = match self.direction {
                Direction::Down => (fine, coarse),
                Direction::Up => (coarse, fine),
            };
            let x = matrix(&input[i * self.inputs..], rows, self.inputs);
            let d = matrix(&d_output[o * self.outputs..], rows, self.outputs);
            matmul(d_weight, x.t(), d, false);
        });
        d_bias.fill(0.0);
        for row in d_output.chunks_exact(self.outputs) {
            d_bias.iter_mut().zip(row).for_each(|(b, d)| *b += d);
        }
    }

    /// coarse[t] = bias + Σ_k fine[2t + k - 12] · W_k (or its transpose).
    fn gather(
        &self,
        fine: &[f32],
        shape: Shape,
        transposed: bool,
        bias: Option<&[f32]>,
        coarse: &mut Vec<f32>,
        scratch: &mut Vec<f32>,
    ) {
        let (from, to) = if transposed { (self.outputs, self.inputs) } else { (self.inputs, self.outputs) };
        let half = |phase: usize, out: &mut [f32]| {
            for k in (phase..KERNEL).step_by(2) {
                let (f, c, rows) = spans(k, shape);
                let out = &mut out[c * to..(c + rows) * to];
                matmul(out, matrix(&fine[f * from..], rows, from), self.tap(k, transposed), true);
            }
        };
        prepare(coarse, shape.frames * shape.batch, to, bias);
        prepare(scratch, shape.frames * shape.batch, to, None);
        rayon::join(|| half(0, coarse), || half(1, scratch));
        coarse.iter_mut().zip(scratch.iter()).for_each(|(c, s)| *c += s);
    }

    /// fine[2t + k - 12] += coarse[t] · W_k (or its transpose), over the bias.
    fn scatter(
        &self,
        coarse: &[f32],
        shape: Shape,
        transposed: bool,
        bias: Option<&[f32]>,
        fine: &mut Vec<f32>,
    ) {
        let (from, to) = if transposed { (self.outputs, self.inputs) } else { (self.inputs, self.outputs) };
        let phase_rows = shape.frames * shape.batch;
        let half = |phase: usize, out: &mut [f32]| {
            for k in (phase..KERNEL).step_by(2) {
                let (f, c, rows) = spans(k, shape);
                let f = f - phase * phase_rows;
                let out = &mut out[f * to..(f + rows) * to];
                matmul(out, matrix(&coarse[c * from..], rows, from), self.tap(k, transposed), true);
            }
        };
        prepare(fine, 2 * phase_rows, to, bias);
        let (even, odd) = fine.split_at_mut(phase_rows * to);
        rayon::join(|| half(0, even), || half(1, odd));
    }
}

/// Sets `out` to `rows` rows of `bias`, or of zeros.
fn prepare(out: &mut Vec<f32>, rows: usize, width: usize, bias: Option<&[f32]>) {
    out.resize(rows * width, 0.0);
    match bias {
        Some(bias) => out.chunks_exact_mut(width).for_each(|row| row.copy_from_slice(bias)),
        None => out.fill(0.0),
    }
}

/// Where tap k's rows begin in the fine and in the coarse sequence, and how many there are.
fn spans(k: usize, shape: Shape) -> (usize, usize, usize) {
    let phase = k % 2;
    // Fine frame 2t + k - 12 is frame t + shift of its phase.
    let shift = (k / 2) as isize - (KERNEL_REACH / 2) as isize;
    let (first, end) = ((-shift).max(0), shape.frames as isize - shift.max(0));
    if first >= end {
        return (phase * shape.frames * shape.batch, 0, 0);
    }
    let fine = phase * shape.frames + (first + shift) as usize;
    (fine * shape.batch, first as usize * shape.batch, (end - first) as usize * shape.batch)
}

/// Frame of the natural order → where it stands among `frames` fine frames, even ones first.
fn place(frame: usize, frames: usize) -> usize {
    frame % 2 * (frames / 2) + frame / 2
}

/// Natural order → even frames, then odd ones. `width` numbers a frame (batch × channels), each through `each`.
pub(crate) fn split(natural: &[f32], width: usize, fine: &mut Vec<f32>, each: impl Fn(f32) -> f32) {
    let frames = natural.len() / width;
    fine.resize(natural.len(), 0.0);
    for (frame, row) in natural.chunks_exact(width).enumerate() {
        let at = place(frame, frames) * width;
        fine[at..at + width].iter_mut().zip(row).for_each(|(out, v)| *out = each(*v));
    }
}

/// Even frames, then odd ones → natural order, each number through `each`.
pub(crate) fn merge(fine: &[f32], width: usize, natural: &mut Vec<f32>, each: impl Fn(f32) -> f32) {
    let frames = fine.len() / width;
    natural.resize(fine.len(), 0.0);
    for (frame, row) in natural.chunks_exact_mut(width).enumerate() {
        let at = place(frame, frames) * width;
        row.iter_mut().zip(&fine[at..at + width]).for_each(|(out, v)| *out = each(*v));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg32;

    fn random(count: usize, rng: &mut Pcg32) -> Vec<f32> {
        (0..count).map(|_| rng.random_range(-1.0..1.0)).collect()
    }

    /// The definition, in the natural order of frames.
    fn by_definition(layer: &Conv1d, input: &[f32], shape: Shape) -> Vec<f32> {
        let (frames, batch) = (shape.frames, shape.batch);
        let (i, o) = (layer.inputs, layer.outputs);
        let out_frames = if layer.direction == Direction::Down { frames } else { 2 * frames };
        let bias = &layer.parameters[KERNEL * i * o..];
        let mut out: Vec<f32> = bias.iter().copied().cycle().take(out_frames * batch * o).collect();
        for t in 0..frames {
            for k in 0..KERNEL {
                let Some(f) = (2 * t + k).checked_sub(KERNEL_REACH).filter(|f| *f < 2 * frames) else {
                    continue;
                };
                let (from, to) = if layer.direction == Direction::Down { (f, t) } else { (t, f) };
                for b in 0..batch {
                    for (a, c) in (0..i).flat_map(|a| (0..o).map(move |c| (a, c))) {
                        out[(to * batch + b) * o + c] +=
                            input[(from * batch + b) * i + a] * layer.parameters[(k * i + a) * o + c];
                    }
                }
            }
        }
        out
    }

    fn natural(layer: &Conv1d, input: &[f32], shape: Shape) -> Vec<f32> {
        let (mut fine, mut out, mut scratch) = (vec![], vec![], vec![]);
        match layer.direction {
            Direction::Down => {
                split(input, shape.batch * layer.inputs, &mut fine, |v| v);
                layer.forward(&fine, shape, &mut out, &mut scratch);
            }
            Direction::Up => {
                layer.forward(input, shape, &mut fine, &mut scratch);
                merge(&fine, shape.batch * layer.outputs, &mut out, |v| v);
            }
        }
        out
    }

    #[test]
    fn both_directions_agree_with_their_definition() {
        let mut rng = Pcg32::seed_from_u64(1);
        // Sequences shorter and longer than the kernel's reach.
        for (frames, batch) in [(1, 1), (4, 2), (15, 1), (20, 3)] {
            let shape = Shape { frames, batch };
            for direction in [Direction::Down, Direction::Up] {
                let mut layer = Conv1d::new(direction, 3, 5, 1.0, &mut rng);
                let bias = random(5, &mut rng);
                let at = layer.weights();
                layer.parameters[at..].copy_from_slice(&bias);
                let fine = if direction == Direction::Down { 2 } else { 1 };
                let input = random(fine * frames * batch * 3, &mut rng);
                let (ours, theirs) = (natural(&layer, &input, shape), by_definition(&layer, &input, shape));
                assert_eq!(ours.len(), theirs.len());
                for (a, b) in ours.iter().zip(&theirs) {
                    assert!((a - b).abs() < 1e-4, "{direction:?} {shape:?}: {a} {b}");
                }
            }
        }
    }

    /// The layers are linear in the input and in the parameters: the gradients are exact transposes, so
    /// ⟨d, forward(x)⟩ - ⟨d, b⟩ = ⟨d_input(d), x⟩ = ⟨d_weights(x, d), W⟩, for every d and x.
    #[test]
    fn gradients_are_the_transposes() {
        let dot = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| f64::from(a * b)).sum::<f64>();
        let mut rng = Pcg32::seed_from_u64(2);
        let shape = Shape { frames: 9, batch: 2 };
        for direction in [Direction::Down, Direction::Up] {
            let layer = Conv1d::new(direction, 4, 3, 1.0, &mut rng);
            let (fine, coarse) = (2 * 9 * 2, 9 * 2);
            let (rows_in, rows_out) =
                if direction == Direction::Down { (fine, coarse) } else { (coarse, fine) };
            let (x, d) = (random(rows_in * 4, &mut rng), random(rows_out * 3, &mut rng));
            let (mut y, mut dx, mut scratch) = (vec![], vec![], vec![]);
            layer.forward(&x, shape, &mut y, &mut scratch);
            layer.d_input(&d, shape, &mut dx, &mut scratch);
            let mut gradient = vec![f32::NAN; layer.parameters.len()];
            layer.d_parameters(&x, &d, shape, &mut gradient);
            let through = dot(&d, &y);
            let (weights, bias) = gradient.split_at(layer.weights());
            assert!((through - dot(&dx, &x)).abs() < 1e-3 * (1.0 + through.abs()));
            assert!((through - dot(weights, &layer.parameters)).abs() < 1e-3 * (1.0 + through.abs()));
            for (channel, b) in bias.iter().enumerate() {
                let sum: f32 = d.iter().skip(channel).step_by(3).sum();
                assert!((sum - b).abs() < 1e-4);
            }
        }
    }

    #[test]
    fn merge_undoes_split() {
        let natural: Vec<f32> = (0..24).map(|v| v as f32).collect();
        let (mut fine, mut back) = (vec![], vec![]);
        split(&natural, 3, &mut fine, |v| v);
        assert_eq!(fine[3..6], [6.0, 7.0, 8.0]);
        merge(&fine, 3, &mut back, |v| v);
        assert_eq!(back, natural);
    }
}
