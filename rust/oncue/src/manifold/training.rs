//! `train_manifold`: Ψ and Ψ⁻¹ from a motion library (LAMA, section 3.6; supplementary, "Reconstruction Loss").
//!
//! ```text
//! L_recon = w_c L_contact + w_r L_root + w_q L_quat + w_p L_pos
//! ```
//!
//! Windows of 120 frames every 10 frames of every clip. Clips, not windows, are divided into training, validation
//! and test, a clip and its mirror image together, by the hashes of their names: a library is always divided alike.
//! Clips shorter than a window are held at their last frame, those under a third of a window are left out.
//!
//! Every batch is a fixed number of chunks whose gradients are added in order: one seed gives one manifold on
//! any number of threads. It does not give the same on processors with other vector widths, whose products
//! round differently.

use std::path::Path;

use rand::seq::SliceRandom;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg32;
use rayon::prelude::*;

use super::autoencoder::{LATENT_FRAMES, LAYERS, Manifold};
use super::checkpoint::{self, TrainingState};
use super::kinematics::Kinematics;
use super::linear_start;
use super::loss::{measure, reconstruction_loss};
use super::report::{ManifoldEpoch, TrainingReport};
use super::settings::{CHUNK_WINDOWS, ManifoldSettings};
use super::training_windows::{Parts, SHORTEST_CLIP, Window, draw, generator, normalization, parts, windows};
use super::window::{FEATURES, WINDOW};
use crate::error::{Error, Result};
use crate::library::{MotionLibrary, Source};
use crate::nn::conv1d::Shape;
use crate::nn::{Adam, ConvWorkspace};
use crate::progress::Progress;

/// At most so many windows show where training begins.
const START_WINDOWS: usize = 3000;
/// Steps over which Adam's rate rises.
const WARM_UP: u64 = 200;

/// Trains a manifold on `library`. Deterministic in `seed`.
///
/// With a `checkpoint` the training is written there after every epoch, and goes on from there where the file
/// holds one of the same library, settings and seed.
///
/// # Errors
/// [`Error::Input`] for settings out of range and for a library of fewer than three clips that are long enough,
/// [`Error::DataFile`] for a checkpoint that is damaged or of another training, [`Error::Io`], [`Error::Cancelled`].
pub fn train_manifold(
    library: &MotionLibrary,
    settings: &ManifoldSettings,
    seed: u64,
    checkpoint: Option<&Path>,
    progress: &Progress,
) -> Result<Manifold> {
    progress.stage("Preparing the manifold's windows");
    let mut training = Training::new(library, settings, seed, progress)?;
    if let Some(path) = checkpoint.filter(|path| path.exists()) {
        training.state = checkpoint::read(path, &training.state.report)?;
    }
    while training.state.epoch < settings.epochs {
        training.epoch(progress)?;
        if let Some(path) = checkpoint {
            checkpoint::write(path, &training.state)?;
        }
    }
    training.finish(progress)
}

struct Training<'a> {
    windows: Parts<'a>,
    state: TrainingState,
    chunks: Vec<Chunk>,
}

/// Buffers of one chunk of a batch.
#[derive(Default)]
struct Chunk {
    x: Vec<f32>,
    given_back: Vec<f32>,
    d_x: Vec<f32>,
    d_fine: Vec<f32>,
    d_z: Vec<f32>,
    encoder: ConvWorkspace,
    decoder: ConvWorkspace,
    wanted: Kinematics,
    found: Kinematics,
    /// One a layer, encoder's first.
    gradients: Vec<Vec<f32>>,
    loss: f64,
}

impl<'a> Training<'a> {
    fn new(
        library: &'a MotionLibrary,
        settings: &ManifoldSettings,
        seed: u64,
        progress: &Progress,
    ) -> Result<Self> {
        settings.validate()?;
        let part = parts(library, settings);
        let clips = [0, 1, 2].map(|wanted| part.iter().filter(|p| **p == Some(wanted)).count());
        if clips.contains(&0) {
            return Err(Error::input(format!(
                "A manifold needs clips to learn from, to watch and to be measured on: at least three of \
                 {SHORTEST_CLIP} frames, and this library has {}.",
                clips.iter().sum::<usize>()
            )));
        }
        let of = |wanted: usize, stride: usize| -> Vec<Window> {
            library
                .clips
                .iter()
                .zip(&part)
                .filter(|(_, part)| **part == Some(wanted))
                .flat_map(|(clip, _)| {
                    let repeats =
                        if wanted == 0 && clip.source == Source::Mocap { settings.mocap_repeats } else { 1 };
                    (0..repeats).flat_map(move |_| windows(clip, stride))
                })
                .collect()
        };
        let windows = Parts {
            training: of(0, settings.stride),
            validation: of(1, 4 * settings.stride),
            test: of(2, settings.stride),
        };
        let mut manifold = Manifold::random(settings.channels, seed);
        manifold.normalization = normalization(&windows.training, settings, seed, progress)?;
        let every = windows.training.len().div_ceil(START_WINDOWS);
        let drawn: Vec<Vec<f32>> = (0..windows.training.len().div_ceil(every))
            .into_par_iter()
            .map(|i| {
                progress.check()?;
                let member = i * every;
                Ok(draw(&windows.training, member, settings, generator(seed, u32::MAX, member as u32)))
            })
            .collect::<Result<_>>()?;
        linear_start::begin(&mut manifold, &drawn, settings, progress)?;
        let layers = manifold.encoder.layers.iter().chain(&manifold.decoder.layers);
        let adam = layers.map(|l| Adam::new(settings.learning_rate, l.parameters.len())).collect();
        let report = TrainingReport {
            library: library.checksum(),
            seed,
            settings: settings.clone(),
            clips,
            training_windows: windows.training.len(),
            ..TrainingReport::default()
        };
        let chunks = (0..settings.batch / CHUNK_WINDOWS).map(|_| Chunk::default()).collect();
        Ok(Self { windows, state: TrainingState { report, epoch: 0, step: 0, manifold, adam }, chunks })
    }

    /// One pass over the training windows in random order.
    fn epoch(&mut self, progress: &Progress) -> Result<()> {
        let TrainingState { report, epoch, .. } = &self.state;
        let (settings, epoch, seed) = (report.settings.clone(), *epoch, report.seed);
        match report.curve.last() {
            None => progress.stage("Training the manifold"),
            Some(point) => progress.stage(&format!(
                "Training the manifold: {:.1} cm and {:.1}° after {epoch} of {} rounds",
                point.validation.joint_error_cm, point.validation.rotation_error_degrees, settings.epochs
            )),
        }
        let mut order: Vec<usize> = (0..self.windows.training.len()).collect();
        order.shuffle(&mut generator(seed, epoch, u32::MAX));
        let batches = order.len().div_ceil(settings.batch);
        let steps = batches as u64 * u64::from(settings.epochs);
        let centred = (epoch as f32) < settings.centred * settings.epochs as f32;
        let path_share = if centred { 0.0 } else { settings.path_share };
        let mut loss = 0.0;
        for batch in 0..batches {
            // The last batch is filled up from the beginning.
            let members: Vec<usize> =
                (0..settings.batch).map(|i| order[(batch * settings.batch + i) % order.len()]).collect();
            let (manifold, all) = (&self.state.manifold, &self.windows.training);
            self.chunks.par_iter_mut().zip(members.par_chunks(CHUNK_WINDOWS)).try_for_each(
                |(chunk, members)| {
                    chunk.x.clear();
                    for &member in members {
                        chunk.x.extend(draw(all, member, &settings, generator(seed, epoch, member as u32)));
                    }
                    chunk.gradient(
                        manifold,
                        path_share,
                        &settings,
                        generator(seed, epoch, u32::MAX - 1 - members[0] as u32),
                        progress,
                    )
                },
            )?;
            loss += self.chunks.iter().map(|c| c.loss).sum::<f64>() / settings.batch as f64;
            self.learn(rate(&settings, self.state.step, steps));
            let done = epoch as f32 + (batch + 1) as f32 / batches as f32;
            progress.fraction(done / settings.epochs as f32);
        }
        let validation = measure(&self.state.manifold, &self.windows.validation, None, progress)?;
        self.state.epoch += 1;
        let point = ManifoldEpoch { epoch: epoch + 1, loss: (loss / batches as f64) as f32, validation };
        self.state.report.curve.push(point);
        Ok(())
    }

    /// One step of Adam down the sum of the chunks' gradients.
    fn learn(&mut self, learning_rate: f32) {
        let TrainingState { manifold, adam, step, report, .. } = &mut self.state;
        *step += 1;
        let scale = 1.0 / report.settings.batch as f32;
        let layers = manifold.encoder.layers.iter_mut().chain(&mut manifold.decoder.layers);
        let (first, others) = match self.chunks.split_first_mut() {
            Some(split) => split,
            None => return,
        };
        let work: Vec<_> = layers.zip(adam).zip(&mut first.gradients).enumerate().collect();
        work.into_par_iter().for_each(|(layer, ((weights, adam), sum))| {
            for chunk in others.iter() {
                sum.iter_mut().zip(&chunk.gradients[layer]).for_each(|(s, g)| *s += g);
            }
            adam.learning_rate = learning_rate;
            adam.step(&mut weights.parameters, sum, scale);
        });
    }

    /// The finished manifold, its weights as they will be written, with its figures.
    fn finish(mut self, progress: &Progress) -> Result<Manifold> {
        progress.stage("Measuring the manifold");
        let mut manifold = self.state.manifold;
        manifold.round();
        let report = &mut self.state.report;
        let test = &self.windows.test;
        report.test = measure(&manifold, test, None, progress)?;
        let mocap: Vec<Window> = test.iter().filter(|w| w.clip.source == Source::Mocap).copied().collect();
        report.test_mocap = measure(&manifold, &mocap, None, progress)?;
        report.test_augmented = measure(&manifold, test, Some(report.seed), progress)?;
        manifold.report = self.state.report;
        Ok(manifold)
    }
}

/// Warm-up, then a cosine down to the final rate.
fn rate(settings: &ManifoldSettings, step: u64, steps: u64) -> f32 {
    let warm_up = WARM_UP.min(steps / 10).max(1);
    let (high, low) = (settings.learning_rate, settings.final_learning_rate);
    if step < warm_up {
        return high * (step + 1) as f32 / warm_up as f32;
    }
    let t = (step - warm_up) as f32 / (steps - warm_up).max(1) as f32;
    low + (high - low) * 0.5 * (1.0 + (std::f32::consts::PI * t).cos())
}

impl Chunk {
    /// Sets `gradients` and `loss` to the sums over the windows of `x`.
    fn gradient(
        &mut self,
        manifold: &Manifold,
        path_share: f32,
        settings: &ManifoldSettings,
        mut rng: Pcg32,
        progress: &Progress,
    ) -> Result<()> {
        progress.check()?;
        let windows = self.x.len() / (WINDOW * FEATURES);
        let shape = Shape { frames: LATENT_FRAMES, batch: windows };
        manifold.normalize(&self.x, windows, self.encoder.input());
        for value in self.encoder.input().iter_mut() {
            let n: f32 = StandardNormal.sample(&mut rng);
            *value += settings.noise * n;
        }
        manifold.encoder.forward(shape, &mut self.encoder);
        self.encoder.output.clone_into(self.decoder.input());
        manifold.decoder.forward(shape, &mut self.decoder);
        self.given_back.resize(self.x.len(), 0.0);
        manifold.denormalize(&self.decoder.output, windows, &mut self.given_back);
        progress.check()?;

        self.d_x.clear();
        self.d_x.resize(self.x.len(), 0.0);
        self.loss = 0.0;
        let size = WINDOW * FEATURES;
        for window in 0..windows {
            let range = window * size..(window + 1) * size;
            self.loss += reconstruction_loss(
                &self.x[range.clone()],
                &self.given_back[range.clone()],
                &manifold.normalization,
                path_share,
                settings,
                (&mut self.wanted, &mut self.found),
                &mut self.d_x[range],
            );
        }
        manifold.d_normalized(&self.d_x, windows, &mut self.d_fine);
        self.gradients.resize_with(2 * LAYERS, Vec::new);
        let (encoder, decoder) = self.gradients.split_at_mut(LAYERS);
        let d_z = manifold.decoder.backward(&self.d_fine, &mut self.decoder, Some(decoder), true);
        d_z.clone_into(&mut self.d_z);
        progress.check()?;
        manifold.encoder.backward(&self.d_z, &mut self.encoder, Some(encoder), false);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::manifold::training_windows::tests::{library, small};
    use crate::motion::Posture;
    use glam::Quat;

    fn train(settings: &ManifoldSettings, seed: u64) -> Manifold {
        train_manifold(&library(), settings, seed, None, &Progress::new()).unwrap()
    }

    #[test]
    fn one_seed_gives_one_manifold_on_any_number_of_threads() {
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| train(&small(), 5).to_bytes())
        };
        let one = on(1);
        assert_eq!(one, on(3));
        assert_ne!(one, train(&small(), 6).to_bytes());
    }

    #[test]
    fn training_learns_and_reports() {
        // Of motion that has something to learn: each joint sways in its own way.
        let mut library = library();
        for (number, clip) in library.clips.iter_mut().enumerate() {
            for (frame, posture) in clip.motion.postures.iter_mut().enumerate() {
                *posture = Posture::default();
                let angle = (0.1 * frame as f32 + number as f32).sin();
                posture.rotations[1] = Quat::from_rotation_x(0.5 * angle);
                posture.rotations[7] = Quat::from_rotation_z(angle);
            }
        }
        let settings = ManifoldSettings { epochs: 30, learning_rate: 2e-3, augmented: 0.0, ..small() };
        let manifold = train_manifold(&library, &settings, 1, None, &Progress::new()).unwrap();
        let report = &manifold.report;
        assert_eq!(report.curve.len(), 30);
        let [first, last] = [report.curve[0], report.curve[29]];
        assert!(last.loss < 0.6 * first.loss, "{first:?} {last:?}");
        assert!(last.validation.joint_error_cm < first.validation.joint_error_cm, "{first:?} {last:?}");
        assert!(report.test.windows > 0 && report.test.joint_error_cm > 0.0);
        assert_eq!((report.test, report.clips), (report.test_mocap, [4, 4, 4]));
    }

    #[test]
    fn a_stopped_training_goes_on_as_if_never_stopped() {
        let path = std::env::temp_dir().join(format!("oncue-checkpoint-{}", std::process::id()));
        let (library, progress, settings) = (library(), Progress::new(), small());
        let mut first = Training::new(&library, &settings, 3, &progress).unwrap();
        first.epoch(&progress).unwrap();
        checkpoint::write(&path, &first.state).unwrap();
        let resumed = train_manifold(&library, &settings, 3, Some(&path), &progress).unwrap();
        assert_eq!(resumed.to_bytes(), train(&settings, 3).to_bytes());
        // Finished, it gives the same once more; another training does not take it for its own.
        let again = train_manifold(&library, &settings, 3, Some(&path), &progress).unwrap();
        assert_eq!(again, resumed);
        let other = train_manifold(&library, &settings, 4, Some(&path), &progress).unwrap_err();
        assert!(other.to_string().contains("another library, seed or settings"), "{other}");
        std::fs::write(&path, b"not much").unwrap();
        let foreign = train_manifold(&library, &settings, 3, Some(&path), &progress).unwrap_err();
        assert!(foreign.to_string().contains("is not an Oncue checkpoint"), "{foreign}");
        std::fs::remove_file(&path).unwrap();
    }

    #[test]
    fn a_cancelled_training_ends_with_cancelled() {
        let progress = Progress::new();
        progress.cancel();
        let cancelled = train_manifold(&library(), &small(), 0, None, &progress);
        assert!(matches!(cancelled, Err(Error::Cancelled)));
    }

    #[test]
    fn what_cannot_be_trained_is_a_sentence() {
        let refused = |library: &MotionLibrary, settings: ManifoldSettings| {
            train_manifold(library, &settings, 0, None, &Progress::new()).unwrap_err().to_string()
        };
        let library = library();
        assert!(refused(&library, ManifoldSettings { batch: 20, ..small() }).contains("multiple of 16"));
        assert!(
            refused(&library, ManifoldSettings { channels: 0, ..small() })
                .contains("manifold.channels is 0; it must be 1 to 1024")
        );
        assert!(
            refused(&library, ManifoldSettings { epochs: 0, ..small() }).contains("manifold.epochs is 0")
        );
        assert!(
            refused(&library, ManifoldSettings { noise: f32::NAN, ..small() })
                .contains("manifold.noise is NaN")
        );
        assert!(refused(&library, ManifoldSettings { test_share: 1.0, ..small() }).contains("0.9"));
        let few = MotionLibrary { clips: library.clips[..2].to_vec() };
        assert!(refused(&few, small()).contains("at least three"));
    }
}
