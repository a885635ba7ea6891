//! The library file: its clips in the container of [`crate::data_file`].
//!
//! Numbers are kept as they are (f32), so a library read back is the library written, bit for bit, and gives
//! the same motion. Mirrored clips that are exactly the mirror of the clip before them are not stored again.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::build::seconds;
use super::clip::{Clip, MotionLibrary, Source};
use super::sufficiency;
use crate::action::ActionLabel;
use crate::data_file::{FileKind, write_whole};
use crate::error::{Error, Result};

const FILE: FileKind = FileKind {
    magic: b"ONCUELIB",
    oldest: 1,
    version: 1,
    name: "motion library",
    remedy: "build the library again",
};

#[derive(Serialize)]
enum StoredRef<'a> {
    Clip(&'a Clip),
    MirrorOfLast,
}

#[derive(Deserialize)]
enum Stored {
    Clip(Clip),
    MirrorOfLast,
}

/// What a library holds: for the user's eyes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Summary {
    /// Clips, mirrored copies included.
    pub clips: usize,
    /// Frames of all clips, 30 Hz.
    pub frames: usize,
    /// One a label.
    pub rows: Vec<SummaryRow>,
    /// Why the captured turns from standing are too few to work with, so that the starter library fills them up; `None` where
    /// they are enough.
    pub turn_shortfall: Option<String>,
}

/// Seconds of one action, by where they come from; mirrored copies are counted apart.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SummaryRow {
    /// The label.
    pub label: ActionLabel,
    /// Seconds that were captured.
    pub mocap_seconds: f32,
    /// Seconds of their mirrored copies.
    pub mirrored_seconds: f32,
    /// Seconds that were made by rule.
    pub procedural_seconds: f32,
    /// How many segments these are.
    pub segments: usize,
    /// Why the captured part is too little to work with, so that the starter library fills it up; `None` where it
    /// is enough.
    pub shortfall: Option<String>,
}

impl MotionLibrary {
    fn payload(&self) -> Vec<u8> {
        let mut stored = Vec::with_capacity(self.clips.len());
        for (i, clip) in self.clips.iter().enumerate() {
            let mirror = i > 0 && clip.mirrored && matches!(stored.last(), Some(StoredRef::Clip(_)));
            if mirror && self.clips[i - 1].mirror() == *clip {
                stored.push(StoredRef::MirrorOfLast);
            } else {
                stored.push(StoredRef::Clip(clip));
            }
        }
        // Plain structs of numbers and strings always serialize.
        postcard::to_stdvec(&stored).unwrap_or_default()
    }

    /// BLAKE3 of the clips in hexadecimal: the same clips have the same checksum, wherever they are kept.
    pub fn checksum(&self) -> String {
        blake3::hash(&self.payload()).to_hex().to_string()
    }

    /// The bytes of the library file.
    pub fn to_bytes(&self) -> Vec<u8> {
        let payload = self.payload();
        let mocap = self.clips.iter().filter(|c| c.source == Source::Mocap && !c.mirrored).count();
        let procedural = self.clips.iter().filter(|c| c.source == Source::Procedural).count();
        let header = format!(
            "Oncue motion library, made by oncue {} from {mocap} motion capture clips and {procedural} procedural clips.",
            env!("CARGO_PKG_VERSION")
        );
        FILE.pack(&header, &payload)
    }

    /// Reads the bytes of a library file; `file` is for the error.
    ///
    /// # Errors
    /// [`Error::DataFile`] where the bytes are foreign, too new, cut off or damaged.
    pub fn from_bytes(bytes: &[u8], file: &Path) -> Result<Self> {
        let damaged = || FILE.damaged(file);
        let stored: Vec<Stored> = match FILE.unpack(bytes, file)? {
            (1, payload) => postcard::from_bytes(payload).map_err(|_| damaged())?,
            _ => return Err(damaged()),
        };
        let mut clips: Vec<Clip> = Vec::with_capacity(stored.len());
        for stored in stored {
            let clip = match (stored, clips.last()) {
                (Stored::Clip(clip), _) => clip,
                (Stored::MirrorOfLast, Some(last)) => last.mirror(),
                (Stored::MirrorOfLast, None) => return Err(damaged()),
            };
            if !is_sound(&clip) {
                return Err(damaged());
            }
            clips.push(clip);
        }
        Ok(Self { clips })
    }

    /// # Errors
    /// [`Error::Io`] where the system refuses the file, and those of [`MotionLibrary::from_bytes`].
    pub fn read(path: &Path) -> Result<Self> {
        let bytes = std::fs::read(path).map_err(|e| Error::io(path, e))?;
        Self::from_bytes(&bytes, path)
    }

    /// Writes the library file.
    ///
    /// # Errors
    /// Those of `write_whole`.
    pub fn write(&self, path: &Path) -> Result<()> {
        write_whole(path, &self.to_bytes())
    }

    /// Adds another library's clips after this one's.
    pub fn merge(&mut self, other: MotionLibrary) {
        self.clips.extend(other.clips);
    }

    /// What the library holds.
    pub fn summary(&self) -> Summary {
        let rows = ActionLabel::ALL.iter().copied().map(|label| {
            let mut row = SummaryRow {
                label,
                mocap_seconds: 0.0,
                mirrored_seconds: 0.0,
                procedural_seconds: 0.0,
                segments: 0,
                shortfall: sufficiency::shortfall(self, label),
            };
            for clip in &self.clips {
                for segment in clip.segments.iter().filter(|s| s.label == label) {
                    row.segments += 1;
                    *match (clip.source, clip.mirrored) {
                        (Source::Procedural, _) => &mut row.procedural_seconds,
                        (Source::Mocap, false) => &mut row.mocap_seconds,
                        (Source::Mocap, true) => &mut row.mirrored_seconds,
                    } += seconds(segment.end - segment.first);
                }
            }
            row
        });
        Summary {
            clips: self.clips.len(),
            frames: self.frame_count(),
            rows: rows.collect(),
            turn_shortfall: sufficiency::turn_shortfall(self),
        }
    }
}

/// Contacts, segments and numbers that later code may rely on.
fn is_sound(clip: &Clip) -> bool {
    let count = clip.motion.len();
    let mut end = 0;
    let segments = clip.segments.iter().all(|s| {
        let sound =
            s.first >= end && s.first < s.end && s.end <= count && (s.first..s.end).contains(&s.complete);
        end = s.end;
        sound
    });
    segments
        && count > 0
        && clip.motion.contacts.len() == count
        && clip.motion.contacts.iter().flatten().all(|c| (0.0..=1.0).contains(c))
        && clip.motion.postures.iter().all(|p| {
            p.root_position.is_finite() && p.rotations.iter().all(|q| (q.length_squared() - 1.0).abs() < 1e-3)
        })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data_file::golden;
    use crate::library::Segment;
    use crate::motion::{Motion, Posture};
    use glam::Quat;
    use proptest::prelude::*;

    fn library() -> MotionLibrary {
        let mut motion = Motion::default();
        for i in 0..20 {
            let mut posture = Posture::default();
            posture.root_position.x = 0.1 * i as f32;
            posture.rotations[3] = Quat::from_rotation_y(0.05 * i as f32);
            motion.postures.push(posture);
            motion.contacts.push([1.0, 0.5]);
        }
        let segments = vec![Segment { label: ActionLabel::Walk, first: 2, end: 18, complete: 17 }];
        let clip = Clip { name: "a walk".into(), source: Source::Mocap, mirrored: false, motion, segments };
        let mirror = clip.mirror();
        MotionLibrary { clips: vec![clip, mirror] }
    }

    #[test]
    fn each_version_is_read() {
        let now = library();
        let first = golden("library-1.oncue", &now.to_bytes());
        assert_eq!(MotionLibrary::from_bytes(&first, Path::new("x")).expect("read"), now);
    }

    #[test]
    fn what_is_written_is_read() {
        let library = library();
        let path = std::env::temp_dir().join(format!("oncue-library-{}.oncuelib", std::process::id()));
        library.write(&path).unwrap();
        let back = MotionLibrary::read(&path).unwrap();
        std::fs::remove_file(&path).unwrap();
        assert_eq!(back, library);
        assert_eq!(back.checksum(), library.checksum());
        // The mirrored copy costs nearly nothing.
        let one = MotionLibrary { clips: library.clips[..1].to_vec() };
        assert!(library.to_bytes().len() < one.to_bytes().len() + 64);
        assert_ne!(one.checksum(), library.checksum());
        assert!(matches!(library.write(Path::new("/nowhere/at/all.oncuelib")), Err(Error::Io { .. })));
        let walk = library.summary().rows[0].clone();
        assert!(
            (walk.mocap_seconds - 16.0 / 30.0).abs() < 1e-6 && walk.mirrored_seconds == walk.mocap_seconds
        );
    }

    #[test]
    fn damage_is_refused() {
        let bytes = library().to_bytes();
        let read = |bytes: &[u8]| MotionLibrary::from_bytes(bytes, Path::new("x.oncuelib")).map(|_| ());
        read(&bytes).unwrap();
        let sentence = |bytes: &[u8]| read(bytes).unwrap_err().to_string();
        assert!(sentence(b"BVH").contains("not an Oncue motion library"));
        assert!(sentence(&[]).contains("not an Oncue motion library"));
        let mut newer = bytes.clone();
        newer[8] = 99;
        assert!(sentence(&newer).contains("newer Oncue (format 99"));
        for cut in [9, 14, 60, bytes.len() / 2, bytes.len() - 1] {
            assert!(sentence(&bytes[..cut]).contains("damaged"), "{cut}");
        }
        // A payload that is well formed and says nonsense.
        let mut wrong = library();
        wrong.clips[0].segments[0].end = 400;
        assert!(sentence(&wrong.to_bytes()).contains("damaged"));
        let mut wrong = library();
        wrong.clips[0].motion.postures[3].root_position.x = f32::NAN;
        assert!(sentence(&wrong.to_bytes()).contains("damaged"));
    }

    proptest! {
        #[test]
        fn one_flipped_bit_is_found(at in 8usize..2000, bit in 0u8..8) {
            let mut bytes = library().to_bytes();
            let at = at.min(bytes.len() - 1);
            // The header's text is for people only.
            let header = 16..16 + u32::from_le_bytes([bytes[12], bytes[13], bytes[14], bytes[15]]) as usize;
            prop_assume!(!header.contains(&at));
            bytes[at] ^= 1 << bit;
            prop_assert!(MotionLibrary::from_bytes(&bytes, Path::new("x")).is_err());
        }
    }
}
