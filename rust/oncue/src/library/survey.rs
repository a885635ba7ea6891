//! The first pass over a file: which joints it has, how it stands, how fast it goes, and what it measures.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::Path;

use glam::Vec2;

use super::calibration::{self, Sums};
use super::frame_rate::FEWEST_STEPS;
use super::gait::Gait;
use super::joint_names::{self, JointTable};
use super::mocap_file::{self, MocapFile};
use super::sampler::Sampler;
use super::sidecar::{self, FolderSidecar, Sidecar};
use super::up_axis::{UpAxis, UpScores};
use super::{body, frame_rate, retarget, travel};
use crate::error::Error;

/// What the first pass learns about a file.
pub(super) struct Survey {
    /// `None` where it is to be read again.
    file: Option<MocapFile>,
    pub table: JointTable,
    pub sidecar: Sidecar,
    /// The same for files of one skeleton, read alike.
    pub key: String,
    pub up_scores: UpScores,
    /// Frames a second of the capture, whatever the file says.
    frame_rate: f64,
    /// What is added to its way, as this file alone shows it; empty for nothing.
    pub way: Vec<Vec2>,
    pub sums: Sums,
    /// What was taken otherwise than the file says it.
    pub notes: Vec<String>,
}

impl Survey {
    /// The file with its true frame rate; read once more where it was not kept.
    pub(super) fn file(&self, path: &Path) -> Result<Cow<'_, MocapFile>, String> {
        Ok(match &self.file {
            Some(file) => Cow::Borrowed(file),
            None => {
                let mut again = read(path)?;
                again.frame_rate = self.frame_rate;
                Cow::Owned(again)
            }
        })
    }
}

/// What files of one skeleton show together.
#[derive(Default)]
pub(super) struct Group {
    pub sums: Sums,
    up_scores: UpScores,
}

impl Group {
    pub(super) fn up(&self) -> UpAxis {
        self.up_scores.axis()
    }
}

/// Files with one skeleton are calibrated together, in the order of the files. Their up axis is the one that most of
/// their motion shows; a take of lying alone would show another.
pub(super) fn groups<'a>(surveys: impl Iterator<Item = &'a Survey> + Clone) -> BTreeMap<&'a str, Group> {
    let mut groups: BTreeMap<&str, Group> = BTreeMap::new();
    for survey in surveys.clone() {
        groups.entry(&survey.key).or_default().up_scores.add(&survey.up_scores);
    }
    for survey in surveys {
        if let Some(group) = groups.get_mut(survey.key.as_str())
            && survey.up_scores.axis() == group.up()
        {
            group.sums.add(&survey.sums);
        }
    }
    groups
}

fn read(path: &Path) -> Result<MocapFile, String> {
    mocap_file::read(path).map_err(|e| match e {
        Error::MocapFile { reason, .. } => reason,
        Error::Io { source, .. } => format!("it could not be read ({source})."),
        other => other.to_string(),
    })
}

/// Surveys a file that stands for the capture `source`, beside which its mapping files lie; `common` is what one for all
/// files says. The error is a sentence.
pub(super) fn survey(
    path: &Path,
    source: &Path,
    common: &FolderSidecar,
    keep: bool,
) -> Result<Survey, String> {
    let sidecar = sidecar::read(source, common)?;
    if sidecar.exclude == Some(true) {
        return Err("its mapping file excludes it.".into());
    }
    let mut file = read(path)?;
    let mut notes = Vec::new();
    let mut table = joint_names::recognize(&file, sidecar.mapping.as_ref())?;
    if let Some(percent) = table.shape_percent {
        notes.push(format!(
            "its joints' names say nothing; the skeleton's shape tells which is which, {percent} % sure."
        ));
    }
    let exchanged = body::mend_sides(&file, &mut table)?;
    body::check_legs(&file, &table)?;
    let up_scores = match sidecar.up {
        Some(up) => UpScores::told(up),
        None => up_scores(&file, &table, &mut notes),
    };
    let up = up_scores.axis();
    match sidecar.rate {
        Some(rate) => file.frame_rate = frame_rate::told(rate)?,
        None => {
            let (rate, note) = frame_rate::frame_rate(file.frame_rate, &Gait::new(&file, &table, up))?;
            file.frame_rate = rate;
            notes.extend(note);
        }
    }
    let key = format!("{:?};{};{}", sidecar.up, exchanged.is_some(), retarget::skeleton_key(&file));
    notes.extend(exchanged);
    let mut sampler = Sampler::new(&file, &table, up)?;
    let travel = match travel::travel(&mut sampler) {
        // Whoever says what a file shows has seen it.
        Err(_) if !sidecar.labels.is_empty() => None,
        found => found?,
    };
    if let Some(travel) = &travel {
        notes.push(travel.note.clone());
        sampler.set_way(travel.way.clone());
    }
    let sums = calibration::measure(&mut sampler);
    let frame_rate = file.frame_rate;
    let way = travel.map(|travel| travel.way).unwrap_or_default();
    Ok(Survey { file: keep.then_some(file), table, sidecar, key, up_scores, frame_rate, way, sums, notes })
}

/// Along another axis than Y and Z one also lies and crawls: only who walks stands along it.
fn up_scores(file: &MocapFile, table: &JointTable, notes: &mut Vec<String>) -> UpScores {
    let scores = UpScores::of(file, table);
    let up = scores.axis();
    if matches!(up, UpAxis::Y | UpAxis::Z) {
        return scores;
    }
    let gait = Gait::new(file, table, up);
    if gait.steps(FEWEST_STEPS).is_none() || !gait.is_level() {
        return scores.usual();
    }
    notes.push(format!("its {} axis points up, by where the head is over the feet.", up.name()));
    scores
}
