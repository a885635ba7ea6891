//! Policies that are kept: for the scene and library they were optimized in, or shipped as a prior for any.

use std::path::Path;
use std::sync::OnceLock;

use half::f16;
use serde::{Deserialize, Serialize};

use super::policy::{Normalizer, Policy, TYPE_COUNT};
use crate::cue::{ActionCue, Task};
use crate::data_file::{FileKind, write_whole};
use crate::error::{Error, FileFault, Result};
use crate::nn::Mlp;
use crate::settings::{Settings, SignalSettings, StateSettings};

const FILE: FileKind = FileKind {
    magic: b"ONCUEPOL",
    oldest: 1,
    version: 1,
    name: "policy",
    remedy: "delete it, and Oncue optimizes a new one",
};

/// What a policy was optimized for.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct PolicyOrigin {
    /// [`crate::SceneIndex::fingerprint`]; empty for a policy that was optimized over many scenes.
    pub scene: String,
    /// Checksum of the motion library.
    pub library: String,
    /// The cues that it served, newest last.
    pub cues: Vec<ActionCue>,
    /// What was asked for when it was last optimized ([`request_of`]): the same again begins as it did then.
    pub request: String,
    /// Starts and cues varied from episode to episode (LAMA, section 3.5).
    pub generalized: bool,
    /// Updates and decisions that went into it, those of the policy it began with included.
    pub updates: usize,
    /// Decisions that went into it, those of the policy it began with included.
    pub environment_steps: usize,
    /// Share of the last update's episodes that met their cue.
    pub success_rate: f32,
}

impl PolicyOrigin {
    /// Whether its numbers are some that a run leaves.
    fn is_sound(&self) -> bool {
        let is_cue = |cue: &ActionCue| {
            let places = std::iter::once(&cue.position).chain(cue.feet.iter().flatten());
            cue.yaw.is_finite() && places.into_iter().all(|place| place.is_finite())
        };
        (0.0..=1.0).contains(&self.success_rate) && self.cues.iter().all(is_cue)
    }
}

/// A policy with what its numbers mean and what it was made for.
#[derive(Debug, Clone, PartialEq)]
pub struct StoredPolicy {
    /// π and V.
    pub policy: Policy,
    /// What its states hold.
    pub state: StateSettings,
    /// What its signals mean.
    pub signal: SignalSettings,
    /// What it was optimized for.
    pub origin: PolicyOrigin,
}

/// As stored: weights in half precision, which moves a mean by less than a thousandth of its spread.
#[derive(Serialize, Deserialize)]
struct PolicyFile {
    policy: StoredMlp,
    value: StoredMlp,
    log_std: Vec<f32>,
    normalizer: Normalizer,
    state: StateSettings,
    signal: SignalSettings,
    origin: PolicyOrigin,
}

#[derive(Serialize, Deserialize)]
struct StoredMlp {
    sizes: Vec<usize>,
    parameters: Vec<u16>,
}

impl StoredMlp {
    fn of(net: &Mlp) -> Self {
        let parameters = net.parameters.iter().map(|p| f16::from_f32(*p).to_bits()).collect();
        Self { sizes: net.sizes.clone(), parameters }
    }

    fn net(&self) -> Mlp {
        let parameters = self.parameters.iter().map(|p| f16::from_bits(*p).to_f32()).collect();
        Mlp { sizes: self.sizes.clone(), parameters }
    }
}

/// Whether what a file says of its states and signals makes sense.
fn stored_settings(policy: &StoredPolicy) -> Result<()> {
    policy.state.validate()?;
    policy.signal.validate()
}

/// A fingerprint of a request, hexadecimal.
pub fn request_of(task: &Task, settings: &Settings, seed: u64) -> String {
    // Numbers, names and lists always serialize.
    let bytes = serde_json::to_vec(&(task, settings, seed)).unwrap_or_default();
    blake3::hash(&bytes).to_hex().to_string()
}

impl StoredPolicy {
    /// A policy with the settings that it was optimized with.
    pub fn new(policy: Policy, settings: &Settings, origin: PolicyOrigin) -> Self {
        Self { policy, state: settings.state.clone(), signal: settings.signal.clone(), origin }
    }

    /// The policy that ships with Oncue, optimized over many rooms made by rule (`examples/prior.rs` makes it).
    ///
    /// # Errors
    /// [`Error::DataFile`] where this build carries a damaged one, or one that was made for other states or actions.
    pub fn prior() -> Result<&'static StoredPolicy> {
        static PRIOR: OnceLock<StoredPolicy> = OnceLock::new();
        if let Some(prior) = PRIOR.get() {
            return Ok(prior);
        }
        let bytes = include_bytes!("../../data/prior.oncuepolicy");
        let prior = Self::from_bytes(bytes, Path::new("the policy that ships with Oncue"))?;
        Ok(PRIOR.get_or_init(|| prior))
    }

    /// Whether its states and signals are those of `settings`, so that it can be played with them.
    pub fn fits(&self, settings: &Settings) -> bool {
        self.state == settings.state && self.signal == settings.signal
    }

    /// Whether it was optimized in this scene with this library.
    pub fn belongs_to(&self, scene: &str, library: &str) -> bool {
        self.origin.scene == scene && self.origin.library == library
    }

    /// The bytes of the policy's file: weights in half precision.
    pub fn to_bytes(&self) -> Vec<u8> {
        let stored = PolicyFile {
            policy: StoredMlp::of(&self.policy.policy),
            value: StoredMlp::of(&self.policy.value),
            log_std: self.policy.log_std.clone(),
            normalizer: self.policy.normalizer.clone(),
            state: self.state.clone(),
            signal: self.signal.clone(),
            origin: self.origin.clone(),
        };
        // Plain structs of numbers and strings always serialize.
        let payload = postcard::to_stdvec(&stored).unwrap_or_default();
        let header = format!(
            "Oncue policy, made by oncue {} in {} updates ({} decisions) of PPO over motion matching; {}.",
            env!("CARGO_PKG_VERSION"),
            self.origin.updates,
            self.origin.environment_steps,
            if self.origin.scene.is_empty() {
                "the prior of `cargo run --release --example prior`, from rooms made by rule and the starter library"
            } else {
                "for one scene and motion library"
            }
        );
        FILE.pack(&header, &payload)
    }

    /// Reads the bytes of a policy file; `file` is for the error.
    ///
    /// # Errors
    /// `DataFile` where the bytes are foreign, too new, cut off or damaged.
    pub fn from_bytes(bytes: &[u8], file: &Path) -> Result<Self> {
        let stored: PolicyFile = match FILE.unpack(bytes, file)? {
            (1, payload) => postcard::from_bytes(payload).map_err(|_| FILE.damaged(file))?,
            _ => return Err(FILE.damaged(file)),
        };
        let kept = Self {
            policy: Policy {
                policy: stored.policy.net(),
                value: stored.value.net(),
                log_std: stored.log_std,
                normalizer: stored.normalizer,
            },
            state: stored.state,
            signal: stored.signal,
            origin: stored.origin,
        };
        stored_settings(&kept).map_err(|_| FILE.damaged(file))?;
        let (state, vector) = (super::state::state_size(&kept.state), kept.signal.vector_size());
        if !kept.origin.is_sound() || !kept.policy.is_consistent() || kept.policy.log_std.len() != vector {
            return Err(FILE.damaged(file));
        }
        if kept.policy.sizes() != (state, TYPE_COUNT + vector) {
            let (theirs, outputs) = kept.policy.sizes();
            return Err(Error::DataFile {
                file: file.into(),
                fault: FileFault::Unfit,
                reason: format!(
                    "it was made for other states or actions ({theirs} numbers in and {outputs} out, where this Oncue has {state} and \
                     {}); {}.",
                    TYPE_COUNT + vector,
                    FILE.remedy
                ),
            });
        }
        Ok(kept)
    }

    /// # Errors
    /// [`Error::Io`] where the system refuses the file, and those of [`StoredPolicy::from_bytes`].
    pub fn read(path: &Path) -> Result<Self> {
        let bytes = std::fs::read(path).map_err(|e| Error::io(path, e))?;
        Self::from_bytes(&bytes, path)
    }

    /// # Errors
    /// Those of `write_whole`.
    pub fn write(&self, path: &Path) -> Result<()> {
        write_whole(path, &self.to_bytes())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_pcg::Pcg64;

    fn kept() -> StoredPolicy {
        let settings = Settings::default();
        let size = super::super::state::state_size(&settings.state);
        let mut policy = Policy::new(size, &settings, &mut Pcg64::seed_from_u64(1));
        policy.normalizer.update(&vec![0.5; size]);
        StoredPolicy::new(policy, &settings, PolicyOrigin { scene: "a".into(), ..PolicyOrigin::default() })
    }

    #[test]
    fn each_version_is_read() {
        let mut now = kept();
        // As it was when the file was written.
        now.signal.pace = 1.05;
        let size = super::super::state::state_size(&now.state);
        let outputs = TYPE_COUNT + now.signal.vector_size();
        now.policy.policy = Mlp::new(&[size, 2, outputs], 0.01, &mut Pcg64::seed_from_u64(2));
        now.policy.value = Mlp::new(&[size, 2, 1], 1.0, &mut Pcg64::seed_from_u64(3));
        let first = crate::data_file::golden("policy-1.oncuepolicy", &now.to_bytes());
        let read = StoredPolicy::from_bytes(&first, Path::new("x")).expect("read");
        // In half precision, as it was written.
        assert_eq!(read, StoredPolicy::from_bytes(&now.to_bytes(), Path::new("x")).expect("read"));
        assert_eq!(read.origin, now.origin);
    }

    #[test]
    fn what_is_written_is_read() {
        let kept = kept();
        let back = StoredPolicy::from_bytes(&kept.to_bytes(), Path::new("p")).unwrap();
        // Half precision the second time round is exact.
        assert_eq!(StoredPolicy::from_bytes(&back.to_bytes(), Path::new("p")).unwrap(), back);
        let furthest = kept.policy.policy.parameters.iter().zip(&back.policy.policy.parameters);
        assert!(furthest.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max) < 1e-3);
        assert_eq!((&back.origin, &back.policy.normalizer), (&kept.origin, &kept.policy.normalizer));
        assert!(
            back.state == Settings::default().state && kept.belongs_to("a", "") && !kept.belongs_to("b", "")
        );
        assert!(!kept.fits(&Settings::preset("paper").unwrap()));
    }

    #[test]
    fn damage_is_refused() {
        let sentence =
            |bytes: &[u8]| StoredPolicy::from_bytes(bytes, Path::new("p")).unwrap_err().to_string();
        let bytes = kept().to_bytes();
        assert!(sentence(b"").contains("not an Oncue policy"));
        assert!(sentence(&bytes[..bytes.len() - 7]).contains("damaged"));
        let mut wrong = kept();
        wrong.policy.log_std.pop();
        assert!(sentence(&wrong.to_bytes()).contains("damaged"));
        let mut wrong = kept();
        wrong.signal.reach = f32::NAN;
        assert!(sentence(&wrong.to_bytes()).contains("damaged"));
        let mut wrong = kept();
        wrong.origin.success_rate = f32::NAN;
        assert!(sentence(&wrong.to_bytes()).contains("damaged"));
        let mut wrong = kept();
        let position = glam::Vec3::new(1.0, f32::INFINITY, 0.0);
        let cue = ActionCue {
            name: "Cue".into(),
            action_type: crate::ActionType::Stop,
            position,
            yaw: 0.0,
            feet: [None; 2],
        };
        wrong.origin.cues.push(cue);
        assert!(sentence(&wrong.to_bytes()).contains("damaged"));
        let mut wrong = kept();
        wrong.policy.policy.parameters[3] = f32::NAN;
        assert!(sentence(&wrong.to_bytes()).contains("damaged"));
    }

    #[test]
    fn a_policy_of_another_width_is_refused_by_a_sentence() {
        let mut wider = kept();
        let size = super::super::state::state_size(&wider.state);
        // As it was before an action type more.
        let settings = Settings::default();
        let hidden = [size, 8, TYPE_COUNT - 1 + settings.signal.vector_size()];
        wider.policy.policy = Mlp::new(&hidden, 0.01, &mut Pcg64::seed_from_u64(2));
        let sentence = StoredPolicy::from_bytes(&wider.to_bytes(), Path::new("p")).unwrap_err().to_string();
        assert!(
            sentence.contains("made for other states or actions") && sentence.contains("delete it"),
            "{sentence}"
        );
    }

    #[test]
    fn the_prior_is_sound_and_fits_the_default() {
        let prior = StoredPolicy::prior().expect("the prior that is built in");
        assert!(prior.fits(&Settings::default()) && prior.origin.generalized);
    }
}
