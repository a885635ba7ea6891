//! From motion capture files to a motion library, in parallel, with progress and cancel.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::calibration::{self, Calibration, Sampler, Sums, UpAxis};
use super::clip::{Clip, MotionLibrary, Segment, Source};
use super::joint_names::{self, JointMapping, JointTable};
use super::mocap_file::{self, MocapFile};
use super::sidecar::{self, Sidecar};
use super::{contact, foot, label, retarget, starter, sufficiency};
use crate::action::ActionLabel;
use crate::error::{Error, Result};
use crate::motion::{FRAME_RATE, Motion};
use crate::progress::Progress;
use glam::Vec2;

/// What of the procedural starter library joins the mocap.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StarterUse {
    /// All of it.
    All,
    /// The actions of which the mocap has too little to work with.
    #[default]
    Missing,
    /// Nothing.
    None,
}

/// How a library is built.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LibrarySettings {
    /// Add a copy of each mocap clip with left and right exchanged. Default: true.
    pub mirror: bool,
    /// Default: [`StarterUse::Missing`].
    pub starter: StarterUse,
    /// A JSON file that names the joints of the files, ours → theirs; sidecar files go before it. Default: none.
    pub mapping: Option<PathBuf>,
}

impl Default for LibrarySettings {
    fn default() -> Self {
        Self { mirror: true, starter: StarterUse::Missing, mapping: None }
    }
}

/// A library, and what was left out of it.
#[derive(Debug, Clone, Default)]
pub struct BuiltLibrary {
    /// The clips.
    pub library: MotionLibrary,
    /// The files that gave none.
    pub skipped: Vec<Skipped>,
}

/// A file that is not in the library, and why.
#[derive(Debug, Clone, PartialEq)]
pub struct Skipped {
    /// The file.
    pub file: PathBuf,
    /// A sentence.
    pub reason: String,
}

/// Files beyond this many bytes in all are read twice instead of kept between the two passes.
const KEEP_BYTES: u64 = 512 << 20;
/// Shorter clips show no action.
const SHORTEST_CLIP: usize = 15;

/// Builds a library from `.bvh` files and folders (searched to their depths), in the order of their paths.
///
/// A file that cannot be used is skipped with a reason. With no paths the library is the starter's.
///
/// # Errors
/// [`Error::Io`] for a path that is not there, [`Error::Input`] for a folder without `.bvh` files or where no
/// file at all could be used, [`Error::Cancelled`].
pub fn build(paths: &[PathBuf], settings: &LibrarySettings, progress: &Progress) -> Result<BuiltLibrary> {
    progress.stage("Finding motion capture");
    let files = find_files(paths)?;
    let mapping = settings.mapping.as_deref().map(sidecar::read_mapping).transpose().map_err(Error::Input)?;
    let bytes: u64 = files.iter().filter_map(|f| f.metadata().ok()).map(|m| m.len()).sum();

    progress.stage("Reading motion capture");
    let surveyed = each(&files, progress, |path| survey(path, mapping.as_ref(), bytes < KEEP_BYTES))?;
    // Files with one skeleton are calibrated together, in the order of the files. Their up axis is the one that
    // most of their motion shows; a take of lying alone would show another.
    let mut groups: BTreeMap<&str, (Sums, [f64; 2])> = BTreeMap::new();
    let good = || surveyed.iter().filter_map(|s| s.as_ref().ok());
    for s in good() {
        let scores = &mut groups.entry(&s.key).or_default().1;
        scores[0] += s.up_scores[0];
        scores[1] += s.up_scores[1];
    }
    for s in good() {
        if let Some((sums, scores)) = groups.get_mut(s.key.as_str())
            && up_axis(&s.up_scores) == up_axis(scores)
        {
            sums.add(&s.sums);
        }
    }

    progress.stage("Retargeting motion capture");
    let work: Vec<_> = files.iter().zip(&surveyed).collect();
    let clips = each(&work, progress, |(path, survey)| {
        let survey = survey.as_ref().map_err(Clone::clone)?;
        let (sums, scores) = &groups[survey.key.as_str()];
        make_clip(path, survey, sums, scores)
    })?;
    drop(work);

    let mut built = BuiltLibrary::default();
    let mut names = BTreeSet::new();
    for (path, clip) in files.iter().zip(clips) {
        match clip {
            Ok(mut clip) => {
                let stem = clip.name.clone();
                for n in 2.. {
                    if names.insert(clip.name.clone()) {
                        break;
                    }
                    clip.name = format!("{stem} ({n})");
                }
                let mirrored = settings.mirror.then(|| clip.mirror());
                built.library.clips.push(clip);
                built.library.clips.extend(mirrored);
            }
            Err(reason) => {
                log::warn!(target: "oncue", "{} is left out: {reason}", path.display());
                built.skipped.push(Skipped { file: path.clone(), reason });
            }
        }
    }
    if built.library.clips.is_empty()
        && let Some(first) = built.skipped.first()
    {
        return Err(Error::input(format!(
            "None of the {} motion capture files could be used; {}: {}",
            files.len(),
            first.file.file_name().unwrap_or_default().to_string_lossy(),
            first.reason
        )));
    }
    add_starter(&mut built.library, settings.starter, progress)?;
    progress.check()?;
    Ok(built)
}

/// Runs `work` over `items` in parallel; the results stand in the items' order.
fn each<T: Sync, R: Send>(
    items: &[T],
    progress: &Progress,
    work: impl Fn(&T) -> std::result::Result<R, String> + Sync,
) -> Result<Vec<std::result::Result<R, String>>> {
    let done = AtomicUsize::new(0);
    items
        .par_iter()
        .map(|item| {
            progress.check()?;
            let result = work(item);
            progress.fraction((done.fetch_add(1, Relaxed) + 1) as f32 / items.len() as f32);
            Ok(result)
        })
        .collect()
}

/// The `.bvh` files under the paths, sorted, each once.
fn find_files(paths: &[PathBuf]) -> Result<Vec<PathBuf>> {
    let mut files = BTreeSet::new();
    for path in paths {
        let meta = std::fs::metadata(path).map_err(|e| Error::io(path, e))?;
        if meta.is_dir() {
            let mut found = BTreeSet::new();
            walk(path, 0, &mut found)?;
            if found.is_empty() {
                return Err(Error::input(format!("The folder {} holds no .bvh files.", path.display())));
            }
            files.extend(found);
        } else {
            files.insert(path.clone());
        }
    }
    Ok(files.into_iter().collect())
}

fn walk(folder: &Path, depth: usize, found: &mut BTreeSet<PathBuf>) -> Result<()> {
    for entry in std::fs::read_dir(folder).map_err(|e| Error::io(folder, e))? {
        let path = entry.map_err(|e| Error::io(folder, e))?.path();
        // A link may lead back up: a few levels are enough for any collection.
        if path.is_dir() {
            if depth < 8 {
                walk(&path, depth + 1, found)?;
            }
        } else if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("bvh")) {
            found.insert(path);
        }
    }
    Ok(())
}

/// What the first pass learns about a file.
struct Survey {
    /// `None` where it is to be read again.
    file: Option<MocapFile>,
    table: JointTable,
    sidecar: Sidecar,
    key: String,
    up_scores: [f64; 2],
    sums: Sums,
}

fn read(path: &Path) -> std::result::Result<MocapFile, String> {
    mocap_file::read(path).map_err(|e| match e {
        Error::MocapFile { reason, .. } => reason,
        Error::Io { source, .. } => format!("it could not be read ({source})."),
        other => other.to_string(),
    })
}

fn survey(path: &Path, mapping: Option<&JointMapping>, keep: bool) -> std::result::Result<Survey, String> {
    let sidecar = sidecar::read(path)?;
    if sidecar.exclude == Some(true) {
        return Err("its sidecar file excludes it.".into());
    }
    let file = read(path)?;
    let table = joint_names::recognize(&file, sidecar.mapping.as_ref().or(mapping))?;
    let up_scores = match sidecar.up {
        Some(UpAxis::Y) => [1e9, 0.0],
        Some(UpAxis::Z) => [0.0, 1e9],
        None => calibration::up_scores(&file, &table),
    };
    let mut sampler = Sampler::new(&file, &table, up_axis(&up_scores))?;
    let sums = calibration::measure(&mut sampler);
    let key = format!("{:?};{}", sidecar.up, retarget::skeleton_key(&file));
    Ok(Survey { file: keep.then_some(file), table, sidecar, key, up_scores, sums })
}

fn up_axis(scores: &[f64; 2]) -> UpAxis {
    if scores[1] > scores[0] { UpAxis::Z } else { UpAxis::Y }
}

fn make_clip(
    path: &Path,
    survey: &Survey,
    group: &Sums,
    scores: &[f64; 2],
) -> std::result::Result<Clip, String> {
    let again;
    let file = match &survey.file {
        Some(file) => file,
        None => {
            again = read(path)?;
            &again
        }
    };
    let up = up_axis(scores);
    let mut sampler = Sampler::new(file, &survey.table, up)?;
    let turned;
    let sums = if up == up_axis(&survey.up_scores) {
        &survey.sums
    } else {
        turned = calibration::measure(&mut sampler);
        &turned
    };
    // Each take has its own floor, but one capture room tends to tilt alike.
    sampler.set_floor(sums.floor.slope(group.floor.slope(Vec2::ZERO)));
    let mut motion = retarget::retarget(&mut sampler, &Calibration::from_sums(&sums.with_group(group))?);
    retarget::trim_end(&mut motion);
    if motion.len() < SHORTEST_CLIP {
        return Err("it is shorter than half a second.".into());
    }
    motion.contacts = contact::detect(&motion);
    foot::clean_up(&mut motion);
    let bad = motion
        .postures
        .iter()
        .any(|p| !p.root_position.is_finite() || p.rotations.iter().any(|q| !q.is_finite()));
    if bad {
        return Err("its motion could not be put on the skeleton.".into());
    }
    let segments = labelled(&motion, &sampler, &survey.sidecar, file.frame_count())?;
    let name = path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
    Ok(Clip { name, source: Source::Mocap, mirrored: false, motion, segments })
}

/// The detected segments, with the sidecar's ranges over them.
fn labelled(
    motion: &Motion,
    sampler: &Sampler,
    sidecar: &Sidecar,
    file_frames: usize,
) -> std::result::Result<Vec<Segment>, String> {
    let detected = label::label(motion);
    let ours = |frame: usize| {
        let start = sampler.file_frame(0);
        let step = sampler.file_frame(1) - start;
        (((frame as f64 - start) / step).round().max(0.0) as usize).min(motion.len())
    };
    let mut ranges: Vec<Segment> = Vec::new();
    for range in &sidecar.labels {
        if range.first >= range.end || range.first >= file_frames {
            return Err(format!(
                "its sidecar labels the frames {} to {}, but it has {file_frames}.",
                range.first, range.end
            ));
        }
        let (first, end) = (ours(range.first), ours(range.end));
        let complete = range.complete.map_or(end.saturating_sub(1), ours);
        if first < end {
            ranges.push(Segment { label: range.label, first, end, complete });
        }
    }
    ranges.sort_by_key(|r| r.first);
    if ranges.windows(2).any(|w| w[1].first < w[0].end) {
        return Err("the label ranges of its sidecar overlap.".into());
    }
    Ok(sidecar::override_labels(&detected, &ranges, motion.len()))
}

/// Adds what of the starter is asked for.
fn add_starter(library: &mut MotionLibrary, starter: StarterUse, progress: &Progress) -> Result<()> {
    if library.clips.is_empty() && starter != StarterUse::None {
        *library = starter::generate(progress)?;
        return Ok(());
    }
    let wanted: BTreeSet<ActionLabel> = ActionLabel::ALL
        .iter()
        .copied()
        .filter(|&label| match starter {
            StarterUse::All => true,
            StarterUse::Missing => sufficiency::shortfall(library, label).is_some(),
            StarterUse::None => false,
        })
        .collect();
    if wanted.is_empty() {
        return Ok(());
    }
    for mut clip in starter::generate(progress)?.clips {
        clip.segments.retain(|s| wanted.contains(&s.label));
        if !clip.segments.is_empty() {
            library.clips.push(clip);
        }
    }
    Ok(())
}

/// Seconds of `frames` at 30 Hz.
pub(crate) fn seconds(frames: usize) -> f32 {
    frames as f32 / FRAME_RATE
}
