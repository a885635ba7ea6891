//! Clips, their labelled segments, and the library that holds them.

use serde::{Deserialize, Serialize};

use crate::action::ActionLabel;
use crate::error::{Error, Result};
use crate::motion::Motion;

/// Frames `first..end` of a clip, with what happens in them. Segments of a clip do not overlap.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Segment {
    /// What happens.
    pub label: ActionLabel,
    /// Its first frame in the clip.
    pub first: usize,
    /// The first frame after it.
    pub end: usize,
    /// The frame (in the clip) where the action is complete: seated, risen, or standing still.
    /// For labels that complete nothing, `end - 1`.
    pub complete: usize,
}

/// Where a clip came from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Source {
    /// Made by [`super::starter`]; shown as "procedural".
    Procedural,
    /// Read from a motion capture file.
    Mocap,
}

/// One clip: motion on the unified skeleton, floor at z = 0.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Clip {
    /// File stem or procedural name; mirrored copies end in " (mirrored)".
    pub name: String,
    /// Where it came from.
    pub source: Source,
    /// Whether left and right are exchanged.
    pub mirrored: bool,
    /// The motion, 30 Hz.
    pub motion: Motion,
    /// What happens in it.
    pub segments: Vec<Segment>,
}

impl Clip {
    /// The copy with left and right exchanged.
    pub fn mirror(&self) -> Clip {
        Clip {
            name: format!("{} (mirrored)", self.name),
            source: self.source,
            mirrored: !self.mirrored,
            motion: Motion {
                postures: self.motion.postures.iter().map(|p| p.mirrored()).collect(),
                contacts: self.motion.contacts.iter().map(|&[l, r]| [r, l]).collect(),
            },
            segments: self.segments.clone(),
        }
    }
}

/// A set of clips to match against.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct MotionLibrary {
    /// The clips, mirrored copies among them.
    pub clips: Vec<Clip>,
}

impl MotionLibrary {
    /// Clip number `clip`.
    ///
    /// # Errors
    /// [`Error::Input`] where there is no such clip.
    pub fn clip(&self, clip: usize) -> Result<&Clip> {
        self.clips.get(clip).ok_or_else(|| {
            Error::input(format!("The library has {} clips; none has the number {clip}.", self.clips.len()))
        })
    }

    /// Total frames over all clips.
    pub fn frame_count(&self) -> usize {
        self.clips.iter().map(|c| c.motion.len()).sum()
    }
}
