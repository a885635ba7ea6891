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

use glam::Vec3;
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg32;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::augment::augment;
use super::kinematics::{Kinematics, RootPath};
use super::manifold::{LATENT_FRAMES, LAYERS, Manifold, Normalization};
use super::window::{CONTACTS, FEATURES, HEIGHT, ROTATIONS, WINDOW, from_motion, rotation};
use super::{checkpoint, linear_start};
use crate::error::{Error, Result};
use crate::library::{Clip, MotionLibrary, Source};
use crate::math::Planar;
use crate::math::rotation::angle_between;
use crate::motion::{JOINT_COUNT, Motion};
use crate::nn::conv1d::Shape;
use crate::nn::{Adam, ConvWorkspace};
use crate::progress::Progress;

/// Windows that one thread takes at a time.
const CHUNK: usize = 16;
/// Fewer frames than this show too little.
const SHORTEST_CLIP: usize = WINDOW / 3;
/// At most so many windows show where training begins.
const START_WINDOWS: usize = 3000;
/// Steps over which Adam's rate rises.
const WARM_UP: u64 = 200;
/// L_pos counts in decimetres: an error of 1 dm weighs as one standard deviation of a feature does.
const POSITION_UNIT: f32 = 0.1;
/// Standard deviations are not taken for less than this: a joint that never moves has no scale of its own.
const LEAST_STD: [f32; 3] = [0.05, 0.01, 0.002];

/// How a manifold is trained. The paper's values where it gives them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ManifoldSettings {
    /// Channels of each layer's output (paper: 256; half of them give joints within a centimetre).
    pub channels: usize,
    /// Passes over the training windows (released: 250).
    pub epochs: u32,
    /// Share of the epochs in which L_pos is measured with the root at the origin ("the early epochs").
    pub centred: f32,
    /// Windows of one step (released: 128).
    pub batch: usize,
    /// Adam's rate after the warm-up…
    pub learning_rate: f32,
    /// …and at the end, reached along a cosine (paper: 1e-4 throughout).
    pub final_learning_rate: f32,
    /// Scale of the normal noise on the normalized input (paper: 0.01).
    pub noise: f32,
    /// Share of the training windows that are changed as [`super::augment`] does (paper: none).
    pub augmented: f32,
    /// How often a captured window is taken for each time that a procedural one is.
    pub mocap_repeats: usize,
    /// Frames between the starts of two windows (released: 10).
    pub stride: usize,
    /// w_c (released: 0.5).
    pub contact_weight: f32,
    /// w_r (released: 1).
    pub root_weight: f32,
    /// w_q (released: 1).
    pub rotation_weight: f32,
    /// w_p (released: 1.3).
    pub position_weight: f32,
    /// What of w_p the joints' places along the given-back path have, after the early epochs, beside their places
    /// about the root (paper: all of it, in place of those). A step's error moves every later frame, so that the
    /// whole weight would drown the postures.
    pub path_share: f32,
    /// Share of the clips that only measure the finished manifold (paper: 0.18 of the windows).
    pub test_share: f32,
    /// Share of the clips that the curve is measured on (paper: 0.085 of the windows).
    pub validation_share: f32,
    /// A sentence for the header of the file: the data, and the command that made it.
    pub origin: String,
}

impl Default for ManifoldSettings {
    fn default() -> Self {
        Self {
            channels: 128,
            epochs: 24,
            centred: 0.75,
            batch: 32,
            learning_rate: 1e-4,
            final_learning_rate: 1e-6,
            noise: 0.01,
            augmented: 0.5,
            mocap_repeats: 2,
            stride: 10,
            contact_weight: 0.5,
            root_weight: 1.0,
            rotation_weight: 1.0,
            position_weight: 1.3,
            path_share: 0.001,
            test_share: 0.1,
            validation_share: 0.05,
            origin: String::new(),
        }
    }
}

impl ManifoldSettings {
    fn check(&self) -> Result<()> {
        let shares = [self.centred, self.augmented, self.test_share, self.validation_share];
        let scales = [
            self.learning_rate,
            self.final_learning_rate,
            self.noise,
            self.contact_weight,
            self.root_weight,
            self.rotation_weight,
            self.position_weight,
            self.path_share,
        ];
        let sentence = if !(1..=1024).contains(&self.channels) {
            format!("The manifold's channels are 1 to 1024, not {}.", self.channels)
        } else if self.epochs == 0 || self.stride == 0 || self.mocap_repeats == 0 {
            "The manifold's epochs, stride and mocap_repeats are at least 1.".to_owned()
        } else if self.batch == 0 || !self.batch.is_multiple_of(CHUNK) {
            format!("The manifold's batch is a multiple of {CHUNK}, not {}.", self.batch)
        } else if shares.iter().any(|s| !(0.0..=1.0).contains(s))
            || self.test_share + self.validation_share > 0.9
        {
            "The manifold's shares are 0 to 1, and test and validation together at most 0.9.".to_owned()
        } else if scales.iter().any(|s| !s.is_finite() || *s < 0.0) {
            "The manifold's rates, weights and noise are numbers of at least 0.".to_owned()
        } else {
            return Ok(());
        };
        Err(Error::input(sentence))
    }
}

/// How well a manifold gives windows back that it was not trained on.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Figures {
    pub windows: usize,
    /// Mean distance of a joint from its place, the root's planar path taken from the input, centimetres.
    pub joint_error_cm: f32,
    /// The same with the path as it was given back, from the window's first frame on, centimetres.
    pub path_joint_error_cm: f32,
    /// Mean angle of a joint's rotation, relative to its parent, from what it was, degrees.
    pub rotation_error_degrees: f32,
    /// Share of foot contacts that round to the right one of 0, 0.5 and 1.
    pub contact_accuracy: f32,
    /// Mean planar distance of the root from its place in the last frame, centimetres.
    pub root_drift_cm: f32,
}

/// One epoch of the training. The loss of the later epochs has the path in it, which those before have not.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct CurvePoint {
    pub epoch: u32,
    /// Mean L_recon over the epoch's windows.
    pub loss: f32,
    /// On the validation clips.
    pub validation: Figures,
}

/// What a training came to, kept in the manifold's file.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct TrainingReport {
    /// Checksum of the library.
    pub library: String,
    pub seed: u64,
    pub settings: ManifoldSettings,
    /// Training, validation and test clips, mirror images included.
    pub clips: [usize; 3],
    pub training_windows: usize,
    /// On the test clips, with the weights as they are written.
    pub test: Figures,
    /// On those of the test clips that were captured.
    pub test_mocap: Figures,
    /// On test windows changed as [`super::augment`] does: postures that no clip has.
    pub test_augmented: Figures,
    pub curve: Vec<CurvePoint>,
}

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

/// All that changes while a manifold is trained.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct State {
    /// What is known so far; names the training, too.
    pub report: TrainingReport,
    pub epoch: u32,
    pub step: u64,
    pub manifold: Manifold,
    /// One a layer, encoder's first.
    adam: Vec<Adam>,
}

/// The windows of a library in their parts.
struct Parts<'a> {
    training: Vec<Window<'a>>,
    validation: Vec<Window<'a>>,
    test: Vec<Window<'a>>,
}

/// One window of a clip.
#[derive(Clone, Copy)]
struct Window<'a> {
    clip: &'a Clip,
    first: usize,
}

impl Window<'_> {
    /// Its frames; beyond the clip's end the last one is held.
    fn motion(&self) -> Motion {
        let motion = &self.clip.motion;
        let frames = || (self.first..self.first + WINDOW).map(|frame| frame.min(motion.len() - 1));
        Motion {
            postures: frames().map(|frame| motion.postures[frame]).collect(),
            contacts: frames().map(|frame| motion.contacts[frame]).collect(),
        }
    }
}

/// The windows of a clip: one every `stride` frames, and the last whole one.
fn windows(clip: &Clip, stride: usize) -> impl Iterator<Item = Window<'_>> {
    let last = clip.motion.len().saturating_sub(WINDOW);
    (0..last).step_by(stride).chain([last]).map(move |first| Window { clip, first })
}

/// Name of a clip and of its mirror image.
fn base_name(clip: &Clip) -> &str {
    clip.name.strip_suffix(" (mirrored)").filter(|_| clip.mirrored).unwrap_or(&clip.name)
}

/// 0 for training, 1 for validation, 2 for test, for each clip; `None` where it is too short.
///
/// Captured and procedural clips are divided each for themselves, in the order of the hashes of their names.
fn parts(library: &MotionLibrary, settings: &ManifoldSettings) -> Vec<Option<usize>> {
    let mut part = vec![None; library.clips.len()];
    for source in [Source::Mocap, Source::Procedural] {
        let usable = |clip: &&Clip| clip.source == source && clip.motion.len() >= SHORTEST_CLIP;
        let mut names: Vec<&str> = library.clips.iter().filter(usable).map(base_name).collect();
        names.sort_by_key(|name| (*blake3::hash(name.as_bytes()).as_bytes(), *name));
        names.dedup();
        let count = |share: f32| (share * names.len() as f32).ceil() as usize;
        let test = count(settings.test_share);
        let validation = test + count(settings.validation_share);
        let of = |name: &str| {
            let rank = names.iter().position(|n| *n == name)?;
            Some(if rank < test { 2 } else { usize::from(rank < validation) })
        };
        for (clip, part) in library.clips.iter().zip(&mut part) {
            if usable(&clip) {
                *part = of(base_name(clip));
            }
        }
    }
    part
}

struct Training<'a> {
    windows: Parts<'a>,
    state: State,
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
        settings.check()?;
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
        let chunks = (0..settings.batch / CHUNK).map(|_| Chunk::default()).collect();
        Ok(Self { windows, state: State { report, epoch: 0, step: 0, manifold, adam }, chunks })
    }

    /// One pass over the training windows in random order.
    fn epoch(&mut self, progress: &Progress) -> Result<()> {
        let State { report, epoch, .. } = &self.state;
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
            self.chunks.par_iter_mut().zip(members.par_chunks(CHUNK)).try_for_each(|(chunk, members)| {
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
            })?;
            loss += self.chunks.iter().map(|c| c.loss).sum::<f64>() / settings.batch as f64;
            self.learn(rate(&settings, self.state.step, steps));
            let done = epoch as f32 + (batch + 1) as f32 / batches as f32;
            progress.fraction(done / settings.epochs as f32);
        }
        let validation = measure(&self.state.manifold, &self.windows.validation, None, progress)?;
        self.state.epoch += 1;
        let point = CurvePoint { epoch: epoch + 1, loss: (loss / batches as f64) as f32, validation };
        self.state.report.curve.push(point);
        Ok(())
    }

    /// One step of Adam down the sum of the chunks' gradients.
    fn learn(&mut self, learning_rate: f32) {
        let State { manifold, adam, step, report, .. } = &mut self.state;
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

/// The generator of one item of one epoch.
fn generator(seed: u64, epoch: u32, item: u32) -> Pcg32 {
    Pcg32::seed_from_u64(
        seed ^ (u64::from(epoch) << 32 | u64::from(item)).wrapping_mul(0x9e37_79b9_7f4a_7c15),
    )
}

/// X of one training window, changed or plain.
fn draw(all: &[Window], member: usize, settings: &ManifoldSettings, mut rng: Pcg32) -> Vec<f32> {
    let mut motion = all[member].motion();
    if rng.random_range(0.0..1.0) < settings.augmented {
        let other = all[rng.random_range(0..all.len())].motion();
        motion = augment(&motion, &other, &mut rng);
    }
    from_motion(&motion).0
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

/// Mean and standard deviation of the features, over one draw of every training window.
fn normalization(
    all: &[Window],
    settings: &ManifoldSettings,
    seed: u64,
    progress: &Progress,
) -> Result<Normalization> {
    let sums: Vec<Vec<[f64; 2]>> = (0..all.len())
        .into_par_iter()
        .map(|member| {
            progress.check()?;
            let mut sums = vec![[0.0; 2]; FEATURES];
            for row in
                draw(all, member, settings, generator(seed, u32::MAX, member as u32)).chunks_exact(FEATURES)
            {
                for ([sum, squares], value) in sums.iter_mut().zip(row) {
                    *sum += f64::from(*value);
                    *squares += f64::from(*value).powi(2);
                }
            }
            Ok(sums)
        })
        .collect::<Result<_>>()?;
    let count = (all.len() * WINDOW) as f64;
    let mut normalization = Normalization::default();
    for i in 0..FEATURES {
        let total = |which: usize| sums.iter().map(|s| s[i][which]).sum::<f64>() / count;
        let (mean, squares) = (total(0), total(1));
        let least = if ROTATIONS.contains(&i) {
            LEAST_STD[0]
        } else if i == HEIGHT || CONTACTS.contains(&i) {
            LEAST_STD[1]
        } else {
            LEAST_STD[2]
        };
        normalization.mean[i] = mean as f32;
        normalization.std[i] = ((squares - mean * mean).max(0.0).sqrt() as f32).max(least);
    }
    Ok(normalization)
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

/// L_recon of one window; adds its gradient by `found` to `d_found`. `buffers` hold the joints of the two.
///
/// Each term is a mean over the frames and its numbers: of the normalized contacts, root numbers and 6D rotations
/// the squared difference, of the joints the squared distance in decimetres.
fn reconstruction_loss(
    wanted: &[f32],
    found: &[f32],
    normalization: &Normalization,
    path_share: f32,
    settings: &ManifoldSettings,
    buffers: (&mut Kinematics, &mut Kinematics),
    d_found: &mut [f32],
) -> f64 {
    let frames = found.len() / FEATURES;
    let mut weights = [settings.root_weight / 4.0; FEATURES];
    weights[ROTATIONS].fill(settings.rotation_weight / ROTATIONS.len() as f32);
    weights[CONTACTS].fill(settings.contact_weight / CONTACTS.len() as f32);
    let mut loss = 0.0f64;
    for ((wanted, found), d) in wanted
        .chunks_exact(FEATURES)
        .zip(found.chunks_exact(FEATURES))
        .zip(d_found.chunks_exact_mut(FEATURES))
    {
        let mut sum = 0.0;
        for i in 0..FEATURES {
            let weight = weights[i] / frames as f32;
            let difference = (found[i] - wanted[i]) / normalization.std[i];
            sum += weight * difference * difference;
            d[i] += 2.0 * weight * difference / normalization.std[i];
        }
        loss += f64::from(sum);
    }
    let (there, here) = buffers;
    let unit = POSITION_UNIT * POSITION_UNIT * (frames * JOINT_COUNT) as f32;
    for (path, share) in [(RootPath::Centred, 1.0), (RootPath::From(Planar::default()), path_share)] {
        if share == 0.0 {
            continue;
        }
        there.forward(wanted, path);
        here.forward(found, path);
        let weight = settings.position_weight * share / unit;
        let d_positions: Vec<[Vec3; JOINT_COUNT]> = here
            .positions
            .iter()
            .zip(&there.positions)
            .map(|(here, there)| {
                std::array::from_fn(|joint| {
                    let difference = here[joint] - there[joint];
                    loss += f64::from(weight * difference.length_squared());
                    2.0 * weight * difference
                })
            })
            .collect();
        here.backward(found, &d_positions, None, d_found);
    }
    loss
}

/// How well `manifold` gives `windows` back; changed as in training where there is a `seed` for it.
fn measure(
    manifold: &Manifold,
    windows: &[Window],
    augmented: Option<u64>,
    progress: &Progress,
) -> Result<Figures> {
    let xs = |first: usize, some: &[Window]| -> Vec<f32> {
        let x = some.iter().enumerate().map(|(i, window)| {
            let motion = window.motion();
            let changed = augmented.map(|seed| {
                let mut rng = generator(seed, u32::MAX - 1, (first + i) as u32);
                let other = windows[rng.random_range(0..windows.len())].motion();
                augment(&motion, &other, &mut rng)
            });
            from_motion(&changed.unwrap_or(motion)).0
        });
        x.flatten().collect()
    };
    let sums: Vec<[f64; 5]> = windows
        .par_chunks(CHUNK)
        .enumerate()
        .map(|(chunk, some)| {
            progress.check()?;
            let x = xs(chunk * CHUNK, some);
            let z = manifold.encode(&x);
            progress.check()?;
            let mut work = super::manifold::DecoderWorkspace::default();
            let found = manifold.decode(&z, &mut work);
            let mut sum = [0.0; 5];
            let size = WINDOW * FEATURES;
            for (wanted, found) in x.chunks_exact(size).zip(found.chunks_exact(size)) {
                sum.iter_mut().zip(window_errors(wanted, found)).for_each(|(s, e)| *s += e);
            }
            Ok(sum)
        })
        .collect::<Result<_>>()?;
    let mean =
        |which: usize| (sums.iter().map(|s| s[which]).sum::<f64>() / windows.len().max(1) as f64) as f32;
    Ok(Figures {
        windows: windows.len(),
        joint_error_cm: 100.0 * mean(0),
        path_joint_error_cm: 100.0 * mean(1),
        rotation_error_degrees: mean(2).to_degrees(),
        contact_accuracy: mean(3),
        root_drift_cm: 100.0 * mean(4),
    })
}

/// Of one window: joint error and the same along the path (m), rotation error (rad), contact accuracy, drift (m).
fn window_errors(wanted: &[f32], found: &[f32]) -> [f64; 5] {
    let frames = wanted.len() / FEATURES;
    let joints = (frames * JOINT_COUNT) as f64;
    let mut out = [0.0; 5];
    let (mut there, mut here) = (Kinematics::default(), Kinematics::default());
    for (which, path) in [(0, RootPath::Centred), (1, RootPath::From(Planar::default()))] {
        there.forward(wanted, path);
        here.forward(found, path);
        let pairs = here.positions.iter().flatten().zip(there.positions.iter().flatten());
        out[which] = pairs.map(|(a, b)| f64::from(a.distance(*b))).sum::<f64>() / joints;
    }
    if let (Some(a), Some(b)) = (here.planar().last(), there.planar().last()) {
        out[4] = f64::from(a.position.distance(b.position));
    }
    let level = |contact: f32| (2.0 * contact.clamp(0.0, 1.0)).round() as u8;
    for (wanted, found) in wanted.chunks_exact(FEATURES).zip(found.chunks_exact(FEATURES)) {
        for joint in 0..JOINT_COUNT {
            out[2] += f64::from(angle_between(rotation(wanted, joint), rotation(found, joint))) / joints;
        }
        for foot in CONTACTS {
            out[3] += f64::from(u8::from(level(wanted[foot]) == level(found[foot]))) / (2 * frames) as f64;
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::editor::window::STEP;
    use crate::editor::window::tests::random_motion;
    use crate::motion::Posture;
    use glam::Quat;

    /// Six clips with their mirror images, and one too short.
    fn library() -> MotionLibrary {
        let mut library = MotionLibrary::default();
        for seed in 0..7 {
            let motion = random_motion(if seed == 6 { 20 } else { 100 + 20 * seed }, seed as u64);
            let name = format!("clip {seed}");
            let clip = Clip { name, source: Source::Mocap, mirrored: false, motion, segments: vec![] };
            let mirror = clip.mirror();
            library.clips.extend([clip, mirror]);
        }
        library
    }

    fn small() -> ManifoldSettings {
        ManifoldSettings {
            channels: 8,
            epochs: 2,
            batch: 32,
            stride: 30,
            mocap_repeats: 3,
            test_share: 0.2,
            validation_share: 0.2,
            ..ManifoldSettings::default()
        }
    }

    fn train(settings: &ManifoldSettings, seed: u64) -> Manifold {
        train_manifold(&library(), settings, seed, None, &Progress::new()).unwrap()
    }

    #[test]
    fn a_clip_and_its_mirror_image_are_in_one_part() {
        let library = library();
        let parts = parts(&library, &small());
        for pair in parts.chunks_exact(2) {
            assert_eq!(pair[0], pair[1]);
        }
        assert_eq!(parts[12], None, "20 frames are too few");
        let count = |part: usize| parts.iter().filter(|p| **p == Some(part)).count();
        assert_eq!([count(0), count(1), count(2)], [4, 4, 4]);
        // Whatever the order of the clips.
        let mut turned = library.clone();
        turned.clips.reverse();
        let mut again = super::parts(&turned, &small());
        again.reverse();
        assert_eq!(parts, again);
    }

    #[test]
    fn windows_cover_a_clip_to_its_end_and_hold_a_short_one() {
        let library = library();
        let firsts = |clip: &Clip| windows(clip, 30).map(|w| w.first).collect::<Vec<_>>();
        assert_eq!(firsts(&library.clips[10]), [0, 30, 60, 80]);
        assert_eq!(firsts(&library.clips[2]), [0]);
        assert_eq!(firsts(&library.clips[0]), [0]);
        let held = Window { clip: &library.clips[0], first: 0 }.motion();
        assert_eq!((held.len(), held.contacts.len()), (WINDOW, WINDOW));
        assert_eq!(held.postures[119], library.clips[0].motion.postures[99]);
    }

    #[test]
    fn gradient_of_the_loss_agrees_with_finite_differences() {
        let (wanted, _) = from_motion(&random_motion(3, 1));
        let (mut found, _) = from_motion(&random_motion(3, 2));
        let mut normalization = Normalization::default();
        normalization.std.iter_mut().enumerate().for_each(|(i, s)| *s = 0.2 + 0.01 * i as f32);
        let settings = ManifoldSettings::default();
        for path_share in [0.0, 0.5] {
            let loss = |found: &[f32], d: &mut [f32]| {
                let (mut a, mut b) = (Kinematics::default(), Kinematics::default());
                reconstruction_loss(
                    &wanted,
                    found,
                    &normalization,
                    path_share,
                    &settings,
                    (&mut a, &mut b),
                    d,
                )
            };
            let mut gradient = vec![0.0; found.len()];
            loss(&found, &mut gradient);
            let mut unused = vec![0.0; found.len()];
            for i in 0..found.len() {
                let (saved, h) = (found[i], 2e-3);
                found[i] = saved + h;
                let up = loss(&found, &mut unused);
                found[i] = saved - h;
                let down = loss(&found, &mut unused);
                found[i] = saved;
                let (numeric, analytic) = ((up - down) / f64::from(2.0 * h), f64::from(gradient[i]));
                assert!(
                    (numeric - analytic).abs() < 3e-2 * (1.0 + analytic.abs()),
                    "{i}: {numeric} {analytic}"
                );
            }
        }
    }

    #[test]
    fn the_terms_of_the_loss_by_hand() {
        // One frame; every contact off by one standard deviation, the root's height by 2 dm and its std by 0.4 m.
        let (wanted, _) = from_motion(&random_motion(1, 1));
        let mut found = wanted.clone();
        CONTACTS.for_each(|i| found[i] += 0.5);
        found[HEIGHT] += 0.2;
        let mut normalization = Normalization::default();
        normalization.std.fill(0.5);
        normalization.std[HEIGHT] = 0.4;
        let settings = ManifoldSettings::default();
        let buffers = (&mut Kinematics::default(), &mut Kinematics::default());
        let mut d = vec![0.0; found.len()];
        let loss = reconstruction_loss(&wanted, &found, &normalization, 0.5, &settings, buffers, &mut d);
        // w_c·1 + w_r·(0.5²)/4 + w_p·2², half of it once more along the path.
        let expected = 0.5 + 0.0625 + 1.5 * 1.3 * 4.0;
        assert!((loss - expected).abs() < 1e-3, "{loss} {expected}");
    }

    #[test]
    fn errors_of_a_window_by_hand() {
        let (wanted, _) = from_motion(&random_motion(WINDOW, 3));
        assert!(
            window_errors(&wanted, &wanted)
                .iter()
                .zip([0.0, 0.0, 0.0, 1.0, 0.0])
                .all(|(a, b)| (a - b).abs() < 1e-6)
        );
        let mut found = wanted.clone();
        for row in found.chunks_exact_mut(FEATURES) {
            row[HEIGHT] += 0.03;
        }
        let errors = window_errors(&wanted, &found);
        assert!((errors[0] - 0.03).abs() < 1e-4 && (errors[1] - 0.03).abs() < 1e-4 && errors[4] < 1e-6);
        // A straight path whose every step is 1 mm too long: 119 mm at its end.
        let mut straight = wanted.clone();
        let mut longer = wanted.clone();
        for (row, long) in straight.chunks_exact_mut(FEATURES).zip(longer.chunks_exact_mut(FEATURES)) {
            row[STEP].copy_from_slice(&[0.0, -0.02, 0.0]);
            long[STEP].copy_from_slice(&[0.0, -0.021, 0.0]);
        }
        let errors = window_errors(&straight, &longer);
        assert!((errors[4] - 0.119).abs() < 1e-4 && errors[0] < 1e-6);
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
        assert!(refused(&library, ManifoldSettings { channels: 0, ..small() }).contains("1 to 1024, not 0"));
        assert!(refused(&library, ManifoldSettings { epochs: 0, ..small() }).contains("at least 1"));
        assert!(refused(&library, ManifoldSettings { noise: f32::NAN, ..small() }).contains("at least 0"));
        assert!(refused(&library, ManifoldSettings { test_share: 1.0, ..small() }).contains("0.9"));
        let few = MotionLibrary { clips: library.clips[..2].to_vec() };
        assert!(refused(&few, small()).contains("at least three"));
    }
}
