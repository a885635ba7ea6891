//! What a person knows better than the detection: a small JSON file beside the motion capture.
//!
//! `NAME.oncue.json` beside `NAME.bvh`, `oncue.json` for all files of a folder, or one that the settings name for all
//! files. docs/captures.md describes them for who writes them.
//!
//! A file's own goes before the folder's entry for it, that before the folder's common fields, and these before the
//! settings' file.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::clip::Segment;
use super::joint_names::JointMapping;
use super::up_axis::UpAxis;
use crate::action::{ActionLabel, Completion};
use crate::motion::Joint;

/// The fields of `NAME.oncue.json`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct Sidecar {
    pub exclude: Option<bool>,
    pub up: Option<UpAxis>,
    /// Frames a second of the capture.
    pub rate: Option<f64>,
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

/// The fields of a folder's `oncue.json`, and of a mapping file for all files. (serde cannot flatten and refuse
/// unknown fields at once.)
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct FolderSidecar {
    exclude: Option<bool>,
    up: Option<UpAxis>,
    rate: Option<f64>,
    mapping: Option<JointMapping>,
    files: BTreeMap<String, Sidecar>,
}

impl Sidecar {
    /// Takes from another what this one does not say.
    fn fill(&mut self, from: Sidecar) {
        self.exclude = self.exclude.or(from.exclude);
        self.up = self.up.or(from.up);
        self.rate = self.rate.or(from.rate);
        if self.mapping.is_none() {
            self.mapping = from.mapping;
        }
        if self.labels.is_empty() {
            self.labels = from.labels;
        }
    }

    fn fill_from_folder(&mut self, folder: &FolderSidecar, mocap: &Path) {
        let name = mocap.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        if let Some(own) = folder.files.get(&name) {
            self.fill(own.clone());
        }
        self.fill(Sidecar {
            exclude: folder.exclude,
            up: folder.up,
            rate: folder.rate,
            mapping: folder.mapping.clone(),
            labels: Vec::new(),
        });
    }
}

/// What the mapping files say about a motion capture file, `common` last. The error is a sentence.
pub(crate) fn read(mocap: &Path, common: &FolderSidecar) -> Result<Sidecar, String> {
    let mut found = Sidecar::default();
    if let Some(own) = read_json::<Sidecar>(&mocap.with_extension("oncue.json"))? {
        found.fill(own);
    }
    if let Some(folder) = read_json::<FolderSidecar>(&mocap.with_file_name("oncue.json"))? {
        found.fill_from_folder(&folder, mocap);
    }
    found.fill_from_folder(common, mocap);
    Ok(found)
}

/// Reads a mapping file for all files: the fields of a folder's `oncue.json`, or nothing but joints,
/// `{"LeftUpLeg": "thigh.l", …}`. The error is a sentence.
pub(crate) fn read_common(path: &Path) -> Result<FolderSidecar, String> {
    let gone = || format!("The mapping file {} does not exist.", path.display());
    let only_joints = |name: &String| Joint::ALL.iter().any(|j| j.name().eq_ignore_ascii_case(name.trim()));
    let all: BTreeMap<String, serde_json::Value> = read_json(path)?.ok_or_else(gone)?;
    if !all.is_empty() && all.keys().all(only_joints) {
        return Ok(FolderSidecar { mapping: read_json(path)?, ..FolderSidecar::default() });
    }
    read_json(path)?.ok_or_else(gone)
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
        let (file, none) = (dir.join("a.bvh"), FolderSidecar::default());
        assert_eq!(read(&file, &none).unwrap(), Sidecar::default());
        std::fs::write(dir.join("oncue.json"), r#"{"up": "z", "files": {"a.bvh": {"exclude": true}}}"#)
            .unwrap();
        let both = read(&file, &none).unwrap();
        assert_eq!((both.exclude, both.up), (Some(true), Some(UpAxis::Z)));
        std::fs::write(
            dir.join("a.oncue.json"),
            r#"{"exclude": false, "labels": [{"label": "walk", "first": 0, "end": 9}]}"#,
        )
        .unwrap();
        let own = read(&file, &none).unwrap();
        assert_eq!((own.exclude, own.up, own.labels.len()), (Some(false), Some(UpAxis::Z), 1));
        std::fs::write(dir.join("a.oncue.json"), r#"{"lables": []}"#).unwrap();
        assert!(read(&file, &none).unwrap_err().contains("a.oncue.json was not understood"));
        // One for all files goes last, and may hold joints alone.
        std::fs::remove_file(dir.join("a.oncue.json")).unwrap();
        let common = dir.join("common.json");
        std::fs::write(&common, r#"{"up": "-x", "rate": 120, "files": {"a.bvh": {"exclude": false}}}"#)
            .unwrap();
        let all = read(&file, &read_common(&common).unwrap()).unwrap();
        assert_eq!((all.exclude, all.up, all.rate), (Some(true), Some(UpAxis::Z), Some(120.0)));
        std::fs::write(&common, r#"{"LeftUpLeg": "thigh.l"}"#).unwrap();
        let joints = read(&file, &read_common(&common).unwrap()).unwrap().mapping.unwrap();
        assert_eq!(joints["LeftUpLeg"], "thigh.l");
        std::fs::write(&common, r#"{"LeftUpperLeg": "thigh.l"}"#).unwrap();
        assert!(read_common(&common).unwrap_err().contains("LeftUpperLeg"));
        assert!(read_common(&dir.join("gone.json")).unwrap_err().contains("does not exist"));
        std::fs::remove_dir_all(&dir).unwrap();
    }
}
