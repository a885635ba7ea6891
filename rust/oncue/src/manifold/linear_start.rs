//! Where training begins: the best linear autoencoder of its shape, put into the weights of Ψ and Ψ⁻¹.
//!
//! Each layer halves the number of frames. The linear way to do that with least loss is to keep the principal
//! components of two neighbouring frames: of the features first, then of the components found before. A layer's
//! two middle taps hold them; all others begin at zero, and learning finds what they are good for.
//!
//! Each channel is scaled to variance 1. The activations bend only beyond two standard deviations, so that what is
//! between the layers hardly differs from the linear solution.
//!
//! From here a few passes with small steps give what random weights need hundreds for; the paper does not say how
//! it begins.

use rayon::prelude::*;

use super::autoencoder::{LAYERS, Manifold};
use super::settings::ManifoldSettings;
use super::window::{CONTACTS, FEATURES, HEIGHT, ROTATIONS, STEP, rotation_range};
use crate::error::{Error, Result};
use crate::math::eigen::symmetric_eigen;
use crate::motion::skeleton::PARENT;
use crate::motion::{JOINT_COUNT, Posture};
use crate::nn::Conv1d;
use crate::nn::matmul::{matmul, matrix};
use crate::progress::Progress;

/// The taps that hold the principal components: those of a coarse frame's own two fine frames.
const MIDDLE: [usize; 2] = [12, 13];
/// Components of less variance than this share of the first one's are taken for noise of rounding.
const LEAST_VARIANCE: f64 = 1e-7;

/// Principal components of the pairs of neighbouring frames of sequences.
struct Components {
    /// One a row: of the even frame's numbers, then of the odd frame's.
    directions: Vec<f32>,
    /// Standard deviation along each.
    std: Vec<f32>,
    /// Numbers of one frame.
    width: usize,
}

impl Components {
    /// The first `most` of `rows` (pairs × 2·width).
    fn of(chunks: &[Vec<f32>], width: usize, most: usize, progress: &Progress) -> Result<Self> {
        let size = 2 * width;
        let products: Vec<Vec<f32>> = chunks
            .par_iter()
            .map(|chunk| {
                progress.check()?;
                let rows = matrix(chunk, chunk.len() / size, size);
                let mut product = vec![0.0; size * size];
                matmul(&mut product, rows.t(), rows, false);
                Ok(product)
            })
            .collect::<Result<_>>()?;
        let count: usize = chunks.iter().map(|c| c.len() / size).sum();
        let mut covariance = vec![0.0f64; size * size];
        for product in &products {
            covariance.iter_mut().zip(product).for_each(|(c, p)| *c += f64::from(*p) / count.max(1) as f64);
        }
        progress.check()?;
        let (values, vectors) = symmetric_eigen(&covariance, size)
            .ok_or_else(|| Error::input("The library's clips hold a number that is not finite."))?;
        let least = LEAST_VARIANCE * values[0].max(0.0);
        let kept = values.iter().take(most).filter(|v| **v > least).count();
        Ok(Self {
            directions: vectors[..kept * size].iter().map(|v| *v as f32).collect(),
            std: values[..kept].iter().map(|v| v.sqrt() as f32).collect(),
            width,
        })
    }

    fn count(&self) -> usize {
        self.std.len()
    }

    /// Direction `component`'s number for the even (0) or odd (1) frame's `i`.
    fn at(&self, component: usize, half: usize, i: usize) -> f32 {
        self.directions[(2 * component + half) * self.width + i]
    }

    /// The sequences of the components: half as many frames.
    fn reduce(&self, chunk: &[f32]) -> Vec<f32> {
        let (size, count) = (2 * self.width, self.count());
        let rows = chunk.len() / size;
        let mut out = vec![0.0; rows * count];
        matmul(&mut out, matrix(chunk, rows, size), matrix(&self.directions, count, size).t(), false);
        out
    }
}

/// Puts the linear autoencoder of `windows` (X each) into the weights of `manifold`, whose normalization is set.
pub(super) fn begin(
    manifold: &mut Manifold,
    windows: &[Vec<f32>],
    settings: &ManifoldSettings,
    progress: &Progress,
) -> Result<()> {
    let metric = metric(&manifold.normalization.std, settings);
    let mut chunks: Vec<Vec<f32>> = windows
        .par_chunks(64)
        .map(|some| {
            let rows = some.iter().flat_map(|x| x.chunks_exact(FEATURES));
            let n = &manifold.normalization;
            rows.flat_map(|row| (0..FEATURES).map(|i| metric[i] * (row[i] - n.mean[i]) / n.std[i])).collect()
        })
        .collect();
    let mut levels: Vec<Components> = Vec::new();
    for _ in 0..LAYERS {
        let width = levels.last().map_or(FEATURES, Components::count);
        let components = Components::of(&chunks, width, manifold.channels(), progress)?;
        chunks.par_iter_mut().for_each(|chunk| *chunk = components.reduce(chunk));
        levels.push(components);
    }
    for (i, level) in levels.iter().enumerate() {
        // What a number of the level below stands for, times its number in the networks.
        let unit = match i.checked_sub(1) {
            Some(below) => levels[below].std.clone(),
            None => metric.clone(),
        };
        encode(&mut manifold.encoder.layers[i], level, &unit);
        decode(&mut manifold.decoder.layers[LAYERS - 1 - i], level, &unit);
    }
    Ok(())
}

/// Weights that reduce the level below to `level`.
fn encode(layer: &mut Conv1d, level: &Components, unit: &[f32]) {
    let (inputs, outputs) = (layer.inputs, layer.outputs);
    layer.parameters.fill(0.0);
    for (half, tap) in MIDDLE.into_iter().enumerate() {
        for (i, c) in (0..level.width).flat_map(|i| (0..level.count()).map(move |c| (i, c))) {
            layer.parameters[(tap * inputs + i) * outputs + c] =
                level.at(c, half, i) * unit[i] / level.std[c];
        }
    }
}

/// Weights that make the level below of `level`.
fn decode(layer: &mut Conv1d, level: &Components, unit: &[f32]) {
    let (inputs, outputs) = (layer.inputs, layer.outputs);
    layer.parameters.fill(0.0);
    for (half, tap) in MIDDLE.into_iter().enumerate() {
        for (c, i) in (0..level.count()).flat_map(|c| (0..level.width).map(move |i| (c, i))) {
            layer.parameters[(tap * inputs + c) * outputs + i] =
                level.at(c, half, i) * level.std[c] / unit[i];
        }
    }
}

/// How much an error of each normalized feature costs in L_recon, as the root of its weight.
///
/// A rotation moves every joint beyond it; half the square of their distance at rest is its share of L_pos.
fn metric(std: &[f32], settings: &ManifoldSettings) -> Vec<f32> {
    let rest = Posture::default().pose().positions;
    let position = settings.position_weight * 100.0;
    let mut weights = vec![0.0; FEATURES];
    for joint in 0..JOINT_COUNT {
        let mut lever = 0.0;
        for beyond in joint + 1..JOINT_COUNT {
            let mut at = beyond;
            while at > joint {
                at = PARENT[at];
            }
            if at == joint {
                lever += rest[beyond].distance_squared(rest[joint]);
            }
        }
        for i in rotation_range(joint) {
            weights[i] = settings.rotation_weight / ROTATIONS.len() as f32
                + position * 0.5 * lever / JOINT_COUNT as f32 * std[i] * std[i];
        }
    }
    weights[HEIGHT] = settings.root_weight / 4.0 + position * std[HEIGHT] * std[HEIGHT];
    weights[STEP].fill(settings.root_weight / 4.0);
    weights[CONTACTS].fill(settings.contact_weight / 2.0);
    weights.iter().map(|w| w.max(1e-6).sqrt()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::manifold::autoencoder::DecoderWorkspace;
    use crate::manifold::window::tests::random_motion;
    use crate::manifold::window::{WINDOW, from_motion};

    #[test]
    fn motion_of_few_dimensions_comes_back_whole() {
        // Eight fixed rows of features, mixed by slow waves: 8 dimensions a frame, fewer a pair of frames than channels.
        let (rows, _) = from_motion(&random_motion(8, 1));
        let window = |seed: usize| -> Vec<f32> {
            (0..WINDOW)
                .flat_map(|t| {
                    let mix: Vec<f32> = (0..8)
                        .map(|r| ((0.03 + 0.004 * r as f32) * t as f32 + (seed * (r + 1)) as f32).sin())
                        .collect();
                    let rows = &rows;
                    (0..FEATURES).map(move |i| (0..8).map(|r| mix[r] * rows[r * FEATURES + i]).sum::<f32>())
                })
                .collect()
        };
        let windows: Vec<Vec<f32>> = (0..40).map(window).collect();
        let mut manifold = Manifold::random(80, 1);
        manifold.normalization.std.fill(0.7);
        begin(&mut manifold, &windows, &ManifoldSettings::default(), &Progress::new()).unwrap();
        let mut work = DecoderWorkspace::default();
        let (mut error, mut size, mut variance) = (0.0, 0.0, 0.0);
        for window in &windows {
            let z = manifold.encode(window);
            variance += z.iter().map(|v| v * v).sum::<f32>() / (z.len() * windows.len()) as f32;
            let back = manifold.decode(&z, &mut work);
            error += window.iter().zip(back).map(|(a, b)| (a - b).powi(2)).sum::<f32>();
            size += window.iter().map(|v| v * v).sum::<f32>();
        }
        // The rest is what lies beyond two standard deviations below, where the activations bend.
        let share = (error / size).sqrt();
        assert!(share < 0.08, "{share}");
        assert!((0.0..3.0).contains(&variance), "{variance}");
    }
}
