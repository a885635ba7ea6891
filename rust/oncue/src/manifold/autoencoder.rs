//! The motion manifold: the autoencoder Ψ, Ψ⁻¹ over windows X (LAMA, section 3.6; supplementary).
//!
//! Three temporal convolutions of kernel 25 and stride 2 lead from a window's 120 frames to a latent vector
//! z of 15 × channels; three transposed ones lead back. All windows are (120 × [`FEATURES`]), row by row, in
//! the units of [`super::window`]: what the networks see is normalized inside.

use std::path::Path;
use std::sync::OnceLock;

use half::f16;
use rand::SeedableRng;
use rand_pcg::Pcg32;
use serde::{Deserialize, Serialize};

use super::report::TrainingReport;
use super::window::{FEATURES, WINDOW};
use crate::data_file::{FileKind, write_whole};
use crate::error::{Error, FileFault, Result};
use crate::motion::skeleton::{JOINT_OFFSET, NAMES, PARENT};
use crate::nn::conv1d::{Direction, Shape};
use crate::nn::{Conv1d, ConvStack, ConvWorkspace};

/// Layers of Ψ and of Ψ⁻¹.
pub(crate) const LAYERS: usize = 3;
/// Frames of z: a latent frame stands for eight of the window.
pub(crate) const LATENT_FRAMES: usize = WINDOW >> LAYERS;

const FILE: FileKind = FileKind {
    magic: b"ONCUEMAN",
    oldest: 1,
    version: 1,
    name: "motion manifold",
    remedy: "train the manifold again, or use the one that ships with Oncue",
};
/// More channels than any training makes are damage.
const MOST_CHANNELS: usize = 1024;

/// Mean and standard deviation of each feature.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Normalization {
    pub mean: Vec<f32>,
    pub std: Vec<f32>,
}

impl Default for Normalization {
    fn default() -> Self {
        Self { mean: vec![0.0; FEATURES], std: vec![1.0; FEATURES] }
    }
}

/// Ψ and Ψ⁻¹, and how their features are normalized.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Manifold {
    pub(crate) channels: usize,
    pub(crate) encoder: ConvStack,
    pub(crate) decoder: ConvStack,
    pub(crate) normalization: Normalization,
    /// How it was trained, and how well it does on clips that it was not trained on.
    pub report: TrainingReport,
}

/// What stands in a manifold's file before the weights.
#[derive(Serialize, Deserialize)]
struct Stored {
    skeleton: [u8; 32],
    channels: usize,
    normalization: Normalization,
    report: TrainingReport,
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
            encoder: ConvStack::new(Direction::Down, &[FEATURES, c, c, c], 1.0, &mut rng),
            // Begins near the mean posture, which is one; random 6D numbers are none.
            decoder: ConvStack::new(Direction::Up, &[c, c, c, FEATURES], 0.01, &mut rng),
            normalization: Normalization::default(),
            report: TrainingReport::default(),
        }
    }

    /// The manifold that ships with Oncue; docs/manifold.md tells the data and the command that it was made with.
    ///
    /// # Errors
    /// [`Error::DataFile`] where this build carries a damaged one.
    pub fn shipped() -> Result<&'static Self> {
        static SHIPPED: OnceLock<Manifold> = OnceLock::new();
        if let Some(manifold) = SHIPPED.get() {
            return Ok(manifold);
        }
        let bytes = include_bytes!("../../data/manifold.oncueman");
        let manifold = Self::from_bytes(bytes, Path::new("the manifold that ships with Oncue"))?;
        Ok(SHIPPED.get_or_init(|| manifold))
    }

    fn zeros(channels: usize) -> Self {
        let c = channels;
        let layers = |direction: Direction, sizes: [usize; LAYERS + 1]| ConvStack {
            layers: sizes.windows(2).map(|s| Conv1d::zeros(direction, s[0], s[1])).collect(),
        };
        Self {
            channels,
            encoder: layers(Direction::Down, [FEATURES, c, c, c]),
            decoder: layers(Direction::Up, [c, c, c, FEATURES]),
            normalization: Normalization::default(),
            report: TrainingReport::default(),
        }
    }

    /// Channels of each layer's output.
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// Ψ⁻¹'s layers, from z to X.
    pub fn decoder_layers(&self) -> &[Conv1d] {
        &self.decoder.layers
    }

    /// Numbers of one window's z: `LATENT_FRAMES` × channels.
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

    /// Every weight, encoder's first.
    fn weights(&self) -> impl Iterator<Item = &f32> {
        self.encoder.layers.iter().chain(&self.decoder.layers).flat_map(|layer| &layer.parameters)
    }

    fn weights_mut(&mut self) -> impl Iterator<Item = &mut f32> {
        self.encoder.layers.iter_mut().chain(&mut self.decoder.layers).flat_map(|l| &mut l.parameters)
    }

    /// Rounds the weights to the half precision of the file: what is measured is what is written.
    pub(crate) fn round(&mut self) {
        self.weights_mut().for_each(|w| *w = f16::from_f32(*w).to_f32());
    }

    /// The bytes of the manifold's file: weights in half precision.
    pub fn to_bytes(&self) -> Vec<u8> {
        let TrainingReport { settings, test, seed, .. } = &self.report;
        let header = format!(
            "Oncue motion manifold, made by oncue {} with seed {seed}. {} Held-out clips: joints {:.2} cm, \
             rotations {:.2} degrees, contacts {:.1} %.",
            env!("CARGO_PKG_VERSION"),
            settings.origin,
            test.joint_error_cm,
            test.rotation_error_degrees,
            100.0 * test.contact_accuracy,
        );
        let stored = Stored {
            skeleton: skeleton_fingerprint(),
            channels: self.channels,
            normalization: self.normalization.clone(),
            report: self.report.clone(),
        };
        // Plain structs of numbers and strings always serialize.
        let mut payload = postcard::to_stdvec(&stored).unwrap_or_default();
        payload.extend(self.weights().flat_map(|w| f16::from_f32(*w).to_le_bytes()));
        FILE.pack(header.trim(), &payload)
    }

    /// Reads the bytes of a manifold's file; `file` is for the error.
    ///
    /// # Errors
    /// [`Error::DataFile`] where the bytes are foreign, too new, damaged, or of another skeleton.
    pub fn from_bytes(bytes: &[u8], file: &Path) -> Result<Self> {
        let damaged = || FILE.damaged(file);
        let (stored, weights) = match FILE.unpack(bytes, file)? {
            (1, payload) => postcard::take_from_bytes::<Stored>(payload).map_err(|_| damaged())?,
            _ => return Err(damaged()),
        };
        if stored.skeleton != skeleton_fingerprint() {
            return Err(Error::DataFile {
                file: file.into(),
                fault: FileFault::Unfit,
                reason: "it was trained for another skeleton; train a manifold with this Oncue.".into(),
            });
        }
        if !(1..=MOST_CHANNELS).contains(&stored.channels) {
            return Err(damaged());
        }
        let mut manifold = Self {
            normalization: stored.normalization,
            report: stored.report,
            ..Self::zeros(stored.channels)
        };
        let count = manifold.encoder.parameter_count() + manifold.decoder.parameter_count();
        if weights.len() != 2 * count {
            return Err(damaged());
        }
        let halves = weights.as_chunks::<2>().0;
        manifold.weights_mut().zip(halves).for_each(|(w, half)| *w = f16::from_le_bytes(*half).to_f32());
        let Normalization { mean, std } = &manifold.normalization;
        let sound = mean.len() == FEATURES
            && std.len() == FEATURES
            && mean.iter().chain(manifold.weights()).all(|v| v.is_finite())
            && std.iter().all(|s| s.is_finite() && *s > 0.0);
        if sound { Ok(manifold) } else { Err(damaged()) }
    }

    /// # Errors
    /// [`Error::Io`] where the system refuses the file, and those of [`Manifold::from_bytes`].
    pub fn read(path: &Path) -> Result<Self> {
        Self::from_bytes(&std::fs::read(path).map_err(|e| Error::io(path, e))?, path)
    }

    /// Writes the manifold's file; an earlier one stays as it was until the new one is whole.
    ///
    /// # Errors
    /// [`Error::Io`] where the system refuses it.
    pub fn write(&self, path: &Path) -> Result<()> {
        write_whole(path, &self.to_bytes())
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

/// BLAKE3 of the joints' names, parents and offsets: what a manifold's numbers are about.
fn skeleton_fingerprint() -> [u8; 32] {
    let mut hasher = blake3::Hasher::new();
    for ((name, parent), offset) in NAMES.iter().zip(PARENT).zip(JOINT_OFFSET) {
        hasher.update(name.as_bytes());
        hasher.update(&(parent as u64).to_le_bytes());
        offset.to_array().iter().for_each(|v| {
            hasher.update(&v.to_le_bytes());
        });
    }
    *hasher.finalize().as_bytes()
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
    use crate::manifold::kinematics::{Kinematics, RootPath};
    use crate::manifold::window::from_motion;
    use crate::manifold::window::tests::random_motion;
    use crate::motion::{JOINT_COUNT, Motion};

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

    #[test]
    fn each_version_is_read() {
        let mut now = Manifold::random(1, 7);
        now.round();
        now.report.settings.origin = "From nothing.".into();
        let first = crate::data_file::golden("manifold-1.oncueman", &now.to_bytes());
        assert_eq!(Manifold::from_bytes(&first, Path::new("x")).expect("read"), now);
    }

    #[test]
    fn what_is_written_is_read() {
        let mut manifold = manifold();
        manifold.round();
        manifold.report.settings.origin = "From nothing.".into();
        let path = std::env::temp_dir().join(format!("oncue-manifold-{}", std::process::id()));
        manifold.write(&path).unwrap();
        let back = Manifold::read(&path).unwrap();
        std::fs::remove_file(&path).unwrap();
        assert_eq!(back, manifold);
        let bytes = manifold.to_bytes();
        assert!(String::from_utf8_lossy(&bytes[16..200]).contains("From nothing."));
        assert!(matches!(manifold.write(Path::new("/nowhere/at/all")), Err(Error::Io { .. })));
    }

    #[test]
    fn damage_and_other_skeletons_are_refused() {
        let manifold = manifold();
        let bytes = manifold.to_bytes();
        let sentence = |bytes: &[u8]| Manifold::from_bytes(bytes, Path::new("x")).unwrap_err().to_string();
        assert!(sentence(b"").contains("not an Oncue motion manifold"));
        for cut in [9, 40, bytes.len() / 2, bytes.len() - 2] {
            assert!(sentence(&bytes[..cut]).contains("damaged"), "{cut}");
        }
        let mut flipped = bytes.clone();
        let middle = flipped.len() / 2;
        flipped[middle] ^= 4;
        assert!(sentence(&flipped).contains("damaged"));
        // A payload that is well formed: of another skeleton, or full of nonsense.
        let header = u32::from_le_bytes([bytes[12], bytes[13], bytes[14], bytes[15]]) as usize;
        let payload = &bytes[16 + header + 32..];
        let mut other = payload.to_vec();
        other[0] ^= 1;
        assert!(sentence(&FILE.pack("", &other)).contains("another skeleton"));
        assert!(sentence(&FILE.pack("", &payload[..payload.len() - 2])).contains("damaged"));
        let mut nonsense = manifold.clone();
        nonsense.decoder.layers[1].parameters[7] = f32::NAN;
        assert!(sentence(&nonsense.to_bytes()).contains("damaged"));
        let mut nonsense = manifold;
        nonsense.normalization.std[3] = 0.0;
        assert!(sentence(&nonsense.to_bytes()).contains("damaged"));
    }

    #[test]
    fn the_shipped_manifold_gives_motion_back() {
        assert!(include_bytes!("../../data/manifold.oncueman").len() < 10_000_000);
        let manifold = Manifold::shipped().unwrap();
        let report = &manifold.report;
        for needed in ["nox -s manifold", "ACCAD", "CC BY 3.0", "mocap.cs.cmu.edu", "NSF EIA-0196217"] {
            assert!(report.settings.origin.contains(needed), "{needed}");
        }
        assert!(report.test.joint_error_cm < 2.0 && report.test.rotation_error_degrees < 3.0);
        assert!(report.test_mocap.joint_error_cm < 2.0 && report.test_mocap.rotation_error_degrees < 3.0);
        // Measured here, not only read: a walk to a seat from the starter library, whose joints come back in place.
        let library = crate::library::starter::generate(&crate::Progress::new()).unwrap();
        let clip =
            library.clips.iter().find(|c| c.name.starts_with("sit") && c.motion.len() >= WINDOW).unwrap();
        let postures = clip.motion.postures[..WINDOW].to_vec();
        let (x, _) = from_motion(&Motion { postures, contacts: clip.motion.contacts[..WINDOW].to_vec() });
        let mut work = DecoderWorkspace::default();
        let back = manifold.decode(&manifold.encode(&x), &mut work);
        let (mut wanted, mut found) = (Kinematics::default(), Kinematics::default());
        wanted.forward(&x, RootPath::Centred);
        found.forward(back, RootPath::Centred);
        let pairs = found.positions.iter().flatten().zip(wanted.positions.iter().flatten());
        let error = pairs.map(|(a, b)| a.distance(*b)).sum::<f32>() / (WINDOW * JOINT_COUNT) as f32;
        assert!(error < 0.015, "{error} m");
    }
}
