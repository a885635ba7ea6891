//! From motion capture files to a motion library, in parallel, with progress and cancel.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::clip::{MotionLibrary, Segment};
use super::sidecar::{self, FolderSidecar};
use super::sufficiency::StandingTurn;
use super::survey::{self, survey};
use super::take::{self, Take};
use super::{starter, sufficiency};
use crate::action::ActionLabel;
use crate::error::{Error, Result};
use crate::motion::FRAME_RATE;
use crate::progress::Progress;

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
    /// A mapping file for all the files (docs/captures.md); those beside the files go before it. Default: none.
    pub mapping: Option<PathBuf>,
    /// Files that were made of others, each with what it shows. Default: none.
    pub sources: BTreeMap<PathBuf, CaptureSource>,
    /// Match captured sits and rises whose arms are held up too, as those of exercises are. Default: false.
    pub raised_arms: bool,
}

/// What a `.bvh` was made of that stands for a capture of another format.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CaptureSource {
    /// The capture: it is named in place of the `.bvh`, and mapping files lie beside it.
    pub file: PathBuf,
    /// Which of its actions.
    pub action: String,
}

impl Default for LibrarySettings {
    fn default() -> Self {
        Self {
            mirror: true,
            starter: StarterUse::Missing,
            mapping: None,
            sources: BTreeMap::new(),
            raised_arms: false,
        }
    }
}

/// A library, and what each file gave to it.
#[derive(Debug, Clone, Default)]
pub struct BuiltLibrary {
    /// The clips.
    pub library: MotionLibrary,
    /// One a file, in the order of their paths.
    pub captures: Vec<Capture>,
}

impl BuiltLibrary {
    /// The files that gave no clip.
    pub fn skipped(&self) -> impl Iterator<Item = &Capture> {
        self.captures.iter().filter(|capture| capture.clip.is_none())
    }
}

/// What a file gave.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Capture {
    /// The file.
    pub file: PathBuf,
    /// Which of its actions, where it is of a format that holds several.
    pub action: Option<String>,
    /// The clip that was made of it, or `None`.
    pub clip: Option<String>,
    /// Seconds of each action that it shows; those of [`ActionLabel::Other`] are not matched.
    pub seconds: BTreeMap<ActionLabel, f32>,
    /// What was taken otherwise than the file says it: a sentence each.
    pub notes: Vec<String>,
    /// Why the file, or the part of it that is not matched, is left out: a sentence.
    pub reason: Option<String>,
}

/// Files beyond this many bytes in all are read twice instead of kept between the two passes.
const KEEP_BYTES: u64 = 512 << 20;

/// Builds a library from `.bvh` files and folders (searched to their depths), in the order of their paths.
///
/// A file that cannot be used is skipped with a reason. With no paths the library is the starter's.
///
/// # Errors
/// [`Error::Io`] for a path that is not there, [`Error::Input`] for a folder without `.bvh` files or where no
/// file at all could be used, [`Error::Cancelled`].
pub fn build(paths: &[PathBuf], settings: &LibrarySettings, progress: &Progress) -> Result<BuiltLibrary> {
    progress.stage("Finding motion capture");
    let source = |path: &PathBuf| settings.sources.get(path);
    let named = |path: &PathBuf| source(path).map_or(path, |source| &source.file).clone();
    let mut files = find_files(paths)?;
    // By what they stand for, wherever that is kept.
    files.sort_by_cached_key(|path| (named(path), source(path).cloned()));
    let common = match &settings.mapping {
        Some(path) => sidecar::read_common(path).map_err(Error::Input)?,
        None => FolderSidecar::default(),
    };
    let bytes: u64 = files.iter().filter_map(|f| f.metadata().ok()).map(|m| m.len()).sum();

    progress.stage("Reading motion capture");
    let surveyed = each(&files, progress, |path| survey(path, &named(path), &common, bytes < KEEP_BYTES))?;
    let groups = survey::groups(surveyed.iter().filter_map(|s| s.as_ref().ok()));

    progress.stage("Retargeting motion capture");
    let work: Vec<_> = files.iter().zip(&surveyed).collect();
    let takes = each(&work, progress, |(path, survey)| {
        let survey = survey.as_ref().map_err(Clone::clone)?;
        take::make(path, survey, &groups[survey.key.as_str()], settings.raised_arms)
    })?;
    drop(work);

    let mut built = BuiltLibrary::default();
    let mut names = BTreeSet::new();
    for (path, take) in files.iter().zip(takes) {
        let mut capture = Capture {
            file: named(path),
            action: source(path).map(|source| source.action.clone()),
            clip: None,
            seconds: BTreeMap::new(),
            notes: Vec::new(),
            reason: None,
        };
        match take {
            Ok(Take { mut clip, notes, reason }) => {
                if let Some(source) = source(path) {
                    clip.name = format!("{} {}", name_of(&source.file), source.action);
                }
                let stem = clip.name.clone();
                for n in 2.. {
                    if names.insert(clip.name.clone()) {
                        break;
                    }
                    clip.name = format!("{stem} ({n})");
                }
                for segment in &clip.segments {
                    *capture.seconds.entry(segment.label).or_default() +=
                        seconds(segment.end - segment.first);
                }
                (capture.clip, capture.notes, capture.reason) = (Some(clip.name.clone()), notes, reason);
                let mirrored = settings.mirror.then(|| clip.mirror());
                built.library.clips.push(clip);
                built.library.clips.extend(mirrored);
            }
            Err(reason) => capture.reason = Some(reason),
        }
        tell(&capture);
        built.captures.push(capture);
    }
    if built.library.clips.is_empty()
        && let Some(first) = built.captures.first()
    {
        return Err(Error::input(format!(
            "None of the {} motion capture files could be used; {}: {}",
            files.len(),
            first.file.file_name().unwrap_or_default().to_string_lossy(),
            first.reason.as_deref().unwrap_or_default()
        )));
    }
    add_starter(&mut built.library, settings.starter, progress)?;
    progress.check()?;
    Ok(built)
}

/// Writes to the log what is not as the file says.
fn tell(capture: &Capture) {
    let file = capture.file.display();
    for note in &capture.notes {
        log::warn!(target: "oncue", "{file}: {note}");
    }
    let matched = capture.seconds.keys().any(|label| label.is_matched());
    if let Some(reason) = capture.reason.as_ref().filter(|_| !matched) {
        log::warn!(target: "oncue", "{file} is left out: {reason}");
    }
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
        .panic_fuse()
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
    // By where they really lie: what is reached in two ways shows nothing twice.
    let mut files: BTreeMap<PathBuf, PathBuf> = BTreeMap::new();
    for path in paths {
        let meta = std::fs::metadata(path).map_err(|e| Error::io(path, e))?;
        let mut found = BTreeSet::new();
        if meta.is_dir() {
            walk(path, 0, &mut BTreeSet::new(), &mut found)?;
            if found.is_empty() {
                return Err(Error::input(format!("The folder {} holds no .bvh files.", path.display())));
            }
        } else {
            found.insert(path.clone());
        }
        for file in found {
            files.entry(real(&file)).or_insert(file);
        }
    }
    let mut named: Vec<PathBuf> = files.into_values().collect();
    named.sort();
    Ok(named)
}

/// Where a path leads.
fn real(path: &Path) -> PathBuf {
    std::fs::canonicalize(path).unwrap_or_else(|_| path.to_owned())
}

/// `seen`: the folders that were looked into.
fn walk(
    folder: &Path,
    depth: usize,
    seen: &mut BTreeSet<PathBuf>,
    found: &mut BTreeSet<PathBuf>,
) -> Result<()> {
    // A link may lead back up.
    if !seen.insert(real(folder)) {
        return Ok(());
    }
    let entries = std::fs::read_dir(folder).map_err(|e| Error::io(folder, e))?;
    let mut paths = entries
        .map(|entry| Ok(entry?.path()))
        .collect::<std::io::Result<Vec<_>>>()
        .map_err(|e| Error::io(folder, e))?;
    paths.sort();
    for path in paths {
        if path.is_dir() {
            // A few levels are enough for any collection.
            if depth < 8 {
                walk(&path, depth + 1, seen, found)?;
            }
        } else if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("bvh")) {
            found.insert(path);
        }
    }
    Ok(())
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
    let turns = starter == StarterUse::Missing && sufficiency::turn_shortfall(library).is_some();
    if wanted.is_empty() && !turns {
        return Ok(());
    }
    for mut clip in starter::generate(progress)?.clips {
        let turn = if turns { StandingTurn::of(&clip) } else { None };
        let turns = |segment: &mut Segment| turn.as_ref().is_some_and(|turn| turn.cut(segment));
        clip.segments.retain_mut(|segment| wanted.contains(&segment.label) || turns(segment));
        if !clip.segments.is_empty() {
            library.clips.push(clip);
        }
    }
    Ok(())
}

/// What a clip of a file is called.
pub(super) fn name_of(path: &Path) -> String {
    path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default()
}

/// Seconds of `frames` at 30 Hz.
pub(crate) fn seconds(frames: usize) -> f32 {
    frames as f32 / FRAME_RATE
}
