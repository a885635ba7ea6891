//! The motion manifold: the autoencoder Ψ, Ψ⁻¹ over windows X (LAMA, section 3.6; supplementary).
//!
//! Three temporal convolutions of kernel 25 and stride 2 lead from a window's 120 frames to a latent vector
//! z of 15 × channels; three transposed ones lead back. All windows are (120 × [`FEATURES`]), row by row, in
//! the units of [`super::window`]: what the networks see is normalized inside.

use rand::SeedableRng;
use rand_pcg::Pcg32;

use super::window::{FEATURES, WINDOW};
use crate::nn::conv1d::{Direction, Shape};
use crate::nn::{ConvStack, ConvWorkspace};

/// Layers of Ψ and of Ψ⁻¹.
pub const LAYERS: usize = 3;
/// Frames of z: a latent frame stands for eight of the window.
pub const LATENT_FRAMES: usize = WINDOW >> LAYERS;

/// Mean and standard deviation of each feature.
#[derive(Debug, Clone, PartialEq)]
pub struct Normalization {
    pub mean: [f32; FEATURES],
    pub std: [f32; FEATURES],
}

impl Default for Normalization {
    fn default() -> Self {
        Self { mean: [0.0; FEATURES], std: [1.0; FEATURES] }
    }
}

/// Ψ and Ψ⁻¹, and how their features are normalized.
#[derive(Debug, Clone, PartialEq)]
pub struct Manifold {
    pub(crate) channels: usize,
    pub(crate) encoder: ConvStack,
    pub(crate) decoder: ConvStack,
    pub(crate) normalization: Normalization,
}

/// Buffers of [`Manifold::decode`] and [`Manifold::backward`], to be used again and again.
#[derive(Debug, Clone, Default)]
pub struct DecoderWorkspace {
    work: ConvWorkspace,
    windows: usize,
    x: Vec<f32>,
    d_fine: Vec<f32>,
    d_z: Vec<f32>,
}

impl Manifold {
    /// Random weights, not trained: where training begins.
    pub fn random(channels: usize, seed: u64) -> Self {
        let mut rng = Pcg32::seed_from_u64(seed);
        let c = channels;
        Self {
            channels,
            encoder: ConvStack::new(Direction::Down, &[FEATURES, c, c, c], &mut rng),
            decoder: ConvStack::new(Direction::Up, &[c, c, c, FEATURES], &mut rng),
            normalization: Normalization::default(),
        }
    }

    pub fn channels(&self) -> usize {
        self.channels
    }

    /// Numbers of one window's z: [`LATENT_FRAMES`] × channels.
    pub fn latent_len(&self) -> usize {
        LATENT_FRAMES * self.channels
    }

    /// z = Ψ(X) of one window or of several after each other.
    pub fn encode(&self, x: &[f32]) -> Vec<f32> {
        let windows = x.len() / (WINDOW * FEATURES);
        let mut work = ConvWorkspace::default();
        self.normalize(x, windows, work.input());
        self.encoder.forward(Shape { frames: LATENT_FRAMES, batch: windows }, &mut work);
        let mut z = vec![0.0; windows * self.latent_len()];
        gather_windows(&work.output, windows, self.channels, &mut z);
        z
    }

    /// X = Ψ⁻¹(z) of one window's z or of several after each other.
    pub fn decode<'w>(&self, z: &[f32], work: &'w mut DecoderWorkspace) -> &'w [f32] {
        work.windows = z.len() / self.latent_len();
        scatter_windows(z, work.windows, self.channels, work.work.input());
        self.decoder.forward(Shape { frames: LATENT_FRAMES, batch: work.windows }, &mut work.work);
        work.x.resize(work.windows * WINDOW * FEATURES, 0.0);
        self.denormalize(&work.work.output, work.windows, &mut work.x);
        &work.x
    }

    /// The gradient of a loss by z, given that by X, at the z of the last [`Manifold::decode`] in `work`.
    pub fn backward<'w>(&self, d_x: &[f32], work: &'w mut DecoderWorkspace) -> &'w [f32] {
        self.d_normalized(d_x, work.windows, &mut work.d_fine);
        let d_z = self.decoder.backward(&work.d_fine, &mut work.work, None, true);
        work.d_z.resize(work.windows * self.latent_len(), 0.0);
        gather_windows(d_z, work.windows, self.channels, &mut work.d_z);
        &work.d_z
    }

    /// Windows → normalized, in the encoder's form.
    pub(crate) fn normalize(&self, x: &[f32], windows: usize, fine: &mut Vec<f32>) {
        let Normalization { mean, std } = &self.normalization;
        fine.resize(x.len(), 0.0);
        for_rows(windows, |row, at| {
            for (i, out) in fine[at..at + FEATURES].iter_mut().enumerate() {
                *out = (x[row + i] - mean[i]) / std[i];
            }
        });
    }

    /// The decoder's output → windows.
    pub(crate) fn denormalize(&self, fine: &[f32], windows: usize, x: &mut [f32]) {
        let Normalization { mean, std } = &self.normalization;
        for_rows(windows, |row, at| {
            for (i, out) in x[row..row + FEATURES].iter_mut().enumerate() {
                *out = fine[at + i] * std[i] + mean[i];
            }
        });
    }

    /// The gradient by X → the gradient by the decoder's output.
    pub(crate) fn d_normalized(&self, d_x: &[f32], windows: usize, d_fine: &mut Vec<f32>) {
        let std = &self.normalization.std;
        d_fine.resize(d_x.len(), 0.0);
        for_rows(windows, |row, at| {
            for (i, out) in d_fine[at..at + FEATURES].iter_mut().enumerate() {
                *out = d_x[row + i] * std[i];
            }
        });
    }
}

/// Calls `each` with where a frame's row begins in the windows and where in the fine form of the networks.
fn for_rows(windows: usize, mut each: impl FnMut(usize, usize)) {
    for window in 0..windows {
        for frame in 0..WINDOW {
            let place = frame % 2 * (WINDOW / 2) + frame / 2;
            each((window * WINDOW + frame) * FEATURES, (place * windows + window) * FEATURES);
        }
    }
}

/// Latent vectors one after the other → frames outermost.
fn scatter_windows(z: &[f32], windows: usize, channels: usize, coarse: &mut Vec<f32>) {
    coarse.resize(z.len(), 0.0);
    for (i, row) in z.chunks_exact(channels).enumerate() {
        let (window, frame) = (i / LATENT_FRAMES, i % LATENT_FRAMES);
        coarse[(frame * windows + window) * channels..][..channels].copy_from_slice(row);
    }
}

/// Frames outermost → latent vectors one after the other.
fn gather_windows(coarse: &[f32], windows: usize, channels: usize, z: &mut [f32]) {
    for (i, row) in z.chunks_exact_mut(channels).enumerate() {
        let (window, frame) = (i / LATENT_FRAMES, i % LATENT_FRAMES);
        row.copy_from_slice(&coarse[(frame * windows + window) * channels..][..channels]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::editor::window::from_motion;
    use crate::editor::window::tests::random_motion;

    fn manifold() -> Manifold {
        let mut manifold = Manifold::random(16, 1);
        for i in 0..FEATURES {
            manifold.normalization.mean[i] = 0.01 * i as f32;
            manifold.normalization.std[i] = 0.1 + 0.003 * i as f32;
        }
        manifold
    }

    #[test]
    fn several_windows_are_each_as_alone() {
        let manifold = manifold();
        let x: Vec<f32> = (0..3).flat_map(|seed| from_motion(&random_motion(WINDOW, seed)).0).collect();
        let z = manifold.encode(&x);
        let mut work = DecoderWorkspace::default();
        let decoded = manifold.decode(&z, &mut work).to_vec();
        let d_z = manifold.backward(&x, &mut work).to_vec();
        let (len, latent) = (WINDOW * FEATURES, manifold.latent_len());
        for i in 0..3 {
            let alone = manifold.encode(&x[i * len..(i + 1) * len]);
            let mut work = DecoderWorkspace::default();
            let x_alone = manifold.decode(&alone, &mut work).to_vec();
            let d_alone = manifold.backward(&x[i * len..(i + 1) * len], &mut work);
            let close = |a: &[f32], b: &[f32]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-4);
            assert!(close(&alone, &z[i * latent..(i + 1) * latent]));
            assert!(close(&x_alone, &decoded[i * len..(i + 1) * len]));
            assert!(close(d_alone, &d_z[i * latent..(i + 1) * latent]));
        }
    }

    #[test]
    fn gradient_by_z_agrees_with_finite_differences() {
        let manifold = manifold();
        let (x, _) = from_motion(&random_motion(WINDOW, 7));
        let mut z = manifold.encode(&x);
        let mut work = DecoderWorkspace::default();
        let loss = |y: &[f32]| y.iter().zip(&x).map(|(a, b)| 0.5 * f64::from((a - b) * (a - b))).sum::<f64>();
        let y = manifold.decode(&z, &mut work).to_vec();
        let d: Vec<f32> = y.iter().zip(&x).map(|(a, b)| a - b).collect();
        let d_z = manifold.backward(&d, &mut work).to_vec();
        for i in (0..z.len()).step_by(7) {
            let (saved, h) = (z[i], 1e-2);
            z[i] = saved + h;
            let up = loss(manifold.decode(&z, &mut work));
            z[i] = saved - h;
            let down = loss(manifold.decode(&z, &mut work));
            z[i] = saved;
            let numeric = (up - down) / f64::from(2.0 * h);
            let analytic = f64::from(d_z[i]);
            assert!((numeric - analytic).abs() < 2e-2 * (1.0 + analytic.abs()), "{i}: {numeric} {analytic}");
        }
    }
}
