//! What a person knows better than the detection: a small JSON file beside the motion capture.
//!
//! `NAME.oncue.json` beside `NAME.bvh`:
//!
//! ```json
//! {
//!   "exclude": false,
//!   "up": "z",
//!   "mapping": {"LeftUpLeg": "thigh.l", "LeftLeg": "shin.l"},
//!   "labels": [
//!     {"label": "walk", "first": 0, "end": 120},
//!     {"label": "stop", "first": 120, "end": 180, "complete": 165}
//!   ]
//! }
//! ```
//!
//! Every field may be left out. Labels are `walk`, `idle`, `sit`, `seated_idle`, `stand_up`, `stop`, `other`;
//! their frames are the file's own, from 0, `end` not included; `complete` is the frame in which the action is
//! done (seated, risen, standing still) and is `end - 1` where it is left out. Frames that no range covers
//! keep what was detected. `mapping` names joints: ours → the file's.
//!
//! One file for a whole folder is called `oncue.json`; it holds the same fields for all files, and those of
//! single files under their names:
//!
//! ```json
//! {"up": "z", "files": {"NAME.bvh": {"exclude": true}}}
//! ```
//!
//! A file's own sidecar goes before the folder's entry for it, and that before the folder's common fields.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::calibration::UpAxis;
use super::clip::Segment;
use super::joint_names::JointMapping;
use crate::action::{ActionLabel, Completion};

/// The fields of `NAME.oncue.json`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct Sidecar {
    pub exclude: Option<bool>,
    pub up: Option<UpAxis>,
    pub mapping: Option<JointMapping>,
    pub labels: Vec<LabelRange>,
}

/// Frames of the file that have a label.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct LabelRange {
    pub label: ActionLabel,
    pub first: usize,
    pub end: usize,
    #[serde(default)]
    pub complete: Option<usize>,
}

/// The fields of a folder's `oncue.json`. (serde cannot flatten and refuse unknown fields at once.)
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct FolderSidecar {
    exclude: Option<bool>,
    up: Option<UpAxis>,
    mapping: Option<JointMapping>,
    files: BTreeMap<String, Sidecar>,
}

/// What the sidecars say about a motion capture file. The error is a sentence.
pub(crate) fn read(mocap: &Path) -> Result<Sidecar, String> {
    let mut found = Sidecar::default();
    let mut fill = |from: Sidecar| {
        found.exclude = found.exclude.or(from.exclude);
        found.up = found.up.or(from.up);
        if found.mapping.is_none() {
            found.mapping = from.mapping;
        }
        if found.labels.is_empty() {
            found.labels = from.labels;
        }
    };
    if let Some(own) = read_json::<Sidecar>(&mocap.with_extension("oncue.json"))? {
        fill(own);
    }
    if let Some(folder) = read_json::<FolderSidecar>(&mocap.with_file_name("oncue.json"))? {
        let name = mocap.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        if let Some(own) = folder.files.get(&name) {
            fill(own.clone());
        }
        fill(Sidecar { exclude: folder.exclude, up: folder.up, mapping: folder.mapping, labels: Vec::new() });
    }
    Ok(found)
}

/// Reads a mapping file: `{"LeftUpLeg": "thigh.l", …}`. The error is a sentence.
pub(crate) fn read_mapping(path: &Path) -> Result<JointMapping, String> {
    read_json(path)?.ok_or_else(|| format!("The mapping file {} does not exist.", path.display()))
}

fn read_json<T: serde::de::DeserializeOwned>(path: &Path) -> Result<Option<T>, String> {
    let text = match std::fs::read(path) {
        Ok(text) => text,
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(None),
        Err(e) => return Err(format!("{}: {e}", path.display())),
    };
    let text = text.strip_prefix(&[0xef, 0xbb, 0xbf]).unwrap_or(&text);
    serde_json::from_slice(text).map(Some).map_err(|e| {
        format!("{} was not understood: {e}.", path.file_name().unwrap_or_default().to_string_lossy())
    })
}

/// Puts the ranges (in frames of ours) over the detected segments.
pub(crate) fn override_labels(segments: &[Segment], ranges: &[Segment], count: usize) -> Vec<Segment> {
    let mut out: Vec<Segment> = Vec::new();
    let ranges: Vec<Segment> =
        ranges.iter().copied().filter(|r| r.first < r.end && r.first < count).collect();
    for segment in segments {
        // What is left of a detected segment between the ranges.
        let mut pieces = vec![(segment.first, segment.end)];
        for range in &ranges {
            pieces = pieces
                .into_iter()
                .flat_map(|(first, end)| [(first, end.min(range.first)), (first.max(range.end), end)])
                .filter(|(first, end)| first < end)
                .collect();
        }
        for (first, end) in pieces {
            // A piece that lost the frame in which its action completes is that action no more.
            let whole = (first..end).contains(&segment.complete) || !completes(segment.label);
            let label = if whole { segment.label } else { ActionLabel::Other };
            let complete = if completes(label) { segment.complete } else { end - 1 };
            out.push(Segment { label, first, end, complete });
        }
    }
    for range in ranges {
        let end = range.end.min(count);
        out.push(Segment { end, complete: range.complete.clamp(range.first, end - 1), ..range });
    }
    out.sort_by_key(|s| s.first);
    out
}

fn completes(label: ActionLabel) -> bool {
    label.completion() != Completion::Never
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_go_over_segments() {
        let segment = |label, first, end, complete| Segment { label, first, end, complete };
        use ActionLabel::*;
        let detected = [segment(Walk, 0, 50, 49), segment(Stop, 50, 90, 80), segment(Idle, 90, 120, 119)];
        let out = override_labels(&detected, &[segment(Sit, 40, 60, 55), segment(Other, 100, 500, 499)], 120);
        let expected = [
            segment(Walk, 0, 40, 39),
            segment(Sit, 40, 60, 55),
            segment(Stop, 60, 90, 80),
            segment(Idle, 90, 100, 99),
            segment(Other, 100, 120, 119),
        ];
        assert_eq!(out, expected);
    }

    #[test]
    fn sidecars_are_read_in_order() {
        let dir = std::env::temp_dir().join(format!("oncue-sidecar-{}", std::process::id()));
        std::fs::create_dir_all(&dir).unwrap();
        let file = dir.join("a.bvh");
        assert_eq!(read(&file).unwrap(), Sidecar::default());
        std::fs::write(dir.join("oncue.json"), r#"{"up": "z", "files": {"a.bvh": {"exclude": true}}}"#)
            .unwrap();
        let both = read(&file).unwrap();
        assert_eq!((both.exclude, both.up), (Some(true), Some(UpAxis::Z)));
        std::fs::write(
            dir.join("a.oncue.json"),
            r#"{"exclude": false, "labels": [{"label": "walk", "first": 0, "end": 9}]}"#,
        )
        .unwrap();
        let own = read(&file).unwrap();
        assert_eq!((own.exclude, own.up, own.labels.len()), (Some(false), Some(UpAxis::Z), 1));
        std::fs::write(dir.join("a.oncue.json"), r#"{"lables": []}"#).unwrap();
        assert!(read(&file).unwrap_err().contains("a.oncue.json was not understood"));
        std::fs::remove_dir_all(&dir).unwrap();
    }
}
