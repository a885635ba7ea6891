//! The second pass over a file: its motion on our skeleton, cleaned and labelled.

use std::path::Path;

use glam::Vec2;

use super::build::{name_of, seconds};
use super::calibration::{self, Calibration};
use super::clip::{Clip, Segment, Source};
use super::sampler::Sampler;
use super::sidecar::{self, Sidecar};
use super::survey::{Group, Survey};
use super::{contact, foot, label, retarget, travel};
use crate::motion::Motion;

/// Shorter clips show no action.
const SHORTEST_CLIP: usize = 15;

/// A clip, and what is to be said about it.
pub(super) struct Take {
    pub clip: Clip,
    /// What was taken otherwise than the file says it.
    pub notes: Vec<String>,
    /// Why a part of it is not matched.
    pub reason: Option<String>,
}

/// Makes a file's clip. The error is a sentence.
///
/// `raised_arms`: see [`super::LibrarySettings`].
pub(super) fn make(path: &Path, survey: &Survey, group: &Group, raised_arms: bool) -> Result<Take, String> {
    let file = survey.file(path)?;
    let up = group.up();
    let mut sampler = Sampler::new(&file, &survey.table, up)?;
    let turned;
    let sums = if up == survey.up_scores.axis() {
        sampler.set_way(survey.way.clone());
        &survey.sums
    } else {
        let travel = travel::travel(&mut sampler).ok().flatten();
        sampler.set_way(travel.map(|travel| travel.way).unwrap_or_default());
        turned = calibration::measure(&mut sampler);
        &turned
    };
    // Each take has its own floor, but one capture room tends to tilt alike.
    sampler.set_floor(sums.floor.slope(group.sums.floor.slope(Vec2::ZERO)));
    let mut motion =
        retarget::retarget(&mut sampler, &Calibration::from_sums(&sums.with_group(&group.sums))?);
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
    let detected = if raised_arms { label::label(&motion) } else { label::label_for_use(&motion) };
    let segments = labelled(&motion, &detected, &sampler, &survey.sidecar, file.frame_count())?;
    let reason = why_unmatched(&motion, &segments);
    let clip = Clip { name: name_of(path), source: Source::Mocap, mirrored: false, motion, segments };
    Ok(Take { clip, notes: survey.notes.clone(), reason })
}

/// The detected segments, with the mapping file's ranges over them.
fn labelled(
    motion: &Motion,
    detected: &[Segment],
    sampler: &Sampler,
    sidecar: &Sidecar,
    file_frames: usize,
) -> Result<Vec<Segment>, String> {
    let ours = |frame: usize| {
        let start = sampler.file_frame(0);
        let step = sampler.file_frame(1) - start;
        (((frame as f64 - start) / step).round().max(0.0) as usize).min(motion.len())
    };
    let mut ranges: Vec<Segment> = Vec::new();
    for range in &sidecar.labels {
        if range.first >= range.end || range.first >= file_frames {
            return Err(format!(
                "its mapping file labels the frames {} to {}, but it has {file_frames}.",
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
        return Err("the label ranges of its mapping file overlap.".into());
    }
    Ok(sidecar::override_labels(detected, &ranges, motion.len()))
}

/// A sentence about what is not matched, or `None` where all is.
fn why_unmatched(motion: &Motion, segments: &[Segment]) -> Option<String> {
    let frames: usize = segments.iter().filter(|s| !s.label.is_matched()).map(|s| s.end - s.first).sum();
    if frames == 0 {
        return None;
    }
    let mut parts: Vec<String> = label::unmatched(motion, segments)
        .into_iter()
        .map(|(what, count)| format!("{:.1} s of {what}", seconds(count)))
        .collect();
    if parts.is_empty() {
        parts.push("its mapping file says so".into());
    }
    let parts = parts.join(", ");
    Some(match frames == motion.len() {
        true => format!("none of it is walking, standing or sitting: {parts}."),
        false => format!("{:.1} s of it are not walking, standing or sitting: {parts}.", seconds(frames)),
    })
}
