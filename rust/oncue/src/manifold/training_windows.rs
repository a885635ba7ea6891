//! The windows that a manifold is trained and measured on: divided by clips, drawn, changed, normalized.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;
use rayon::prelude::*;

use super::augment::augment;
use super::autoencoder::Normalization;
use super::settings::ManifoldSettings;
use super::window::{CONTACTS, FEATURES, HEIGHT, ROTATIONS, WINDOW, from_motion};
use crate::error::Result;
use crate::library::{Clip, MotionLibrary, Source};
use crate::motion::Motion;
use crate::progress::Progress;

/// Fewer frames than this show too little.
pub(super) const SHORTEST_CLIP: usize = WINDOW / 3;
/// Standard deviations are not taken for less than this: a joint that never moves has no scale of its own.
const LEAST_STD: [f32; 3] = [0.05, 0.01, 0.002];

/// The windows of a library in their parts.
pub(super) struct Parts<'a> {
    pub training: Vec<Window<'a>>,
    pub validation: Vec<Window<'a>>,
    pub test: Vec<Window<'a>>,
}

/// One window of a clip.
#[derive(Clone, Copy)]
pub(super) struct Window<'a> {
    pub clip: &'a Clip,
    pub first: usize,
}

impl Window<'_> {
    /// Its frames; beyond the clip's end the last one is held.
    pub(super) fn motion(&self) -> Motion {
        let motion = &self.clip.motion;
        let frames = || (self.first..self.first + WINDOW).map(|frame| frame.min(motion.len() - 1));
        Motion {
            postures: frames().map(|frame| motion.postures[frame]).collect(),
            contacts: frames().map(|frame| motion.contacts[frame]).collect(),
        }
    }
}

/// The windows of a clip: one every `stride` frames, and the last whole one.
pub(super) fn windows(clip: &Clip, stride: usize) -> impl Iterator<Item = Window<'_>> {
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
pub(super) fn parts(library: &MotionLibrary, settings: &ManifoldSettings) -> Vec<Option<usize>> {
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

/// The generator of one item of one epoch.
pub(super) fn generator(seed: u64, epoch: u32, item: u32) -> Pcg32 {
    Pcg32::seed_from_u64(
        seed ^ (u64::from(epoch) << 32 | u64::from(item)).wrapping_mul(0x9e37_79b9_7f4a_7c15),
    )
}

/// X of one training window, changed or plain.
pub(super) fn draw(all: &[Window], member: usize, settings: &ManifoldSettings, mut rng: Pcg32) -> Vec<f32> {
    let mut motion = all[member].motion();
    if rng.random_range(0.0..1.0) < settings.augmented {
        let other = all[rng.random_range(0..all.len())].motion();
        motion = augment(&motion, &other, &mut rng);
    }
    from_motion(&motion).0
}

/// Mean and standard deviation of the features, over one draw of every training window.
pub(super) fn normalization(
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

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::manifold::window::tests::random_motion;

    /// Six clips with their mirror images, and one too short.
    pub(crate) fn library() -> MotionLibrary {
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

    pub(crate) fn small() -> ManifoldSettings {
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
}
