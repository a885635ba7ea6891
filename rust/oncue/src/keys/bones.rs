//! Bones that hang on each other, and where they are.

use glam::{DQuat, DVec3};

use super::{Kept, Limb, Poses};
use crate::error::{Error, Result};

/// The rest pose of bones, parents before children.
#[derive(Clone, Debug, PartialEq)]
pub struct Bones {
    pub(super) parents: Vec<Option<usize>>,
    /// Where each bone's head is in its parent's rest frame; without a parent, in space.
    offsets: Vec<DVec3>,
    /// How each bone's rest frame is turned in its parent's.
    rests: Vec<DQuat>,
}

impl Bones {
    /// Bones by their parents, heads and rest rotations, each in its parent's rest frame.
    ///
    /// # Errors
    /// [`Error::Input`] where their numbers differ, a parent comes after its child, or a number is not finite.
    pub fn new(parents: Vec<Option<usize>>, offsets: Vec<DVec3>, rests: Vec<DQuat>) -> Result<Self> {
        let alike = parents.len() == offsets.len() && parents.len() == rests.len();
        let ordered = parents.iter().enumerate().all(|(bone, parent)| parent.is_none_or(|p| p < bone));
        let finite = offsets.iter().all(|o| o.is_finite()) && rests.iter().all(|r| r.is_finite());
        if !(alike && ordered && finite) {
            return Err(Error::input("Bones need a parent before them, a place and a rest rotation each."));
        }
        let rests = rests.into_iter().map(DQuat::normalize).collect();
        Ok(Self { parents, offsets, rests })
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.parents.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.parents.is_empty()
    }

    /// Where a bone is, and how it is turned, upon its parent. `local` has unit length.
    pub(super) fn upon(
        &self,
        bone: usize,
        parent: (DVec3, DQuat),
        local: DQuat,
        location: DVec3,
    ) -> (DVec3, DQuat) {
        let (place, turn) = parent;
        let rest = turn * self.rests[bone];
        (place + turn * self.offsets[bone] + rest * location, rest * local)
    }
}

/// What is wanted of all bones at every half frame.
pub(super) struct Channels {
    pub(super) frames: usize,
    pub(super) bones: usize,
    pub(super) motion: Poses,
    /// The motion, but where curves stay what these play.
    pub(super) wanted: Poses,
    /// Frame by frame, whether each bone's curves stay to the next.
    pub(super) stays: Vec<bool>,
}

impl Channels {
    pub(super) fn new(count: usize, motion: &Poses, kept: Option<&Kept>) -> Self {
        let frames = motion.locations.len();
        let mut wanted =
            Poses { locations: halved(&motion.locations, 1), rotations: halved(&motion.rotations, count) };
        let Some(kept) = kept else {
            let motion = wanted.clone();
            return Self { frames, bones: count, motion, wanted, stays: vec![false; frames * count] };
        };
        let motion = wanted.clone();
        for frame in 0..frames.saturating_sub(1) {
            for bone in (0..count).filter(|bone| kept.stays[frame * count + bone]) {
                for sample in 2 * frame..=2 * frame + 2 {
                    wanted.rotations[sample * count + bone] = kept.played.rotations[sample * count + bone];
                    if bone == 0 {
                        wanted.locations[sample] = kept.played.locations[sample];
                    }
                }
            }
        }
        Self { frames, bones: count, motion, wanted, stays: kept.stays.clone() }
    }

    /// Whether a bone's curves stay from a frame to the next.
    pub(super) fn stays(&self, frame: usize, bone: usize) -> bool {
        self.stays[frame * self.bones + bone]
    }
}

/// The same with what lies between two neighbours in the middle: of the cubic through four of them.
fn halved<T>(values: &[T], width: usize) -> Vec<T>
where
    T: Copy + std::ops::Add<Output = T> + std::ops::Sub<Output = T> + std::ops::Mul<f64, Output = T>,
{
    let rows = values.len() / width.max(1);
    let mut out = Vec::with_capacity((2 * rows).saturating_sub(1) * width);
    for row in 0..rows {
        let at = |row: usize, column: usize| values[row * width + column];
        out.extend_from_slice(&values[row * width..(row + 1) * width]);
        if row + 1 == rows {
            break;
        }
        for column in 0..width {
            let (a, b) = (at(row, column), at(row + 1, column));
            // Beyond an end the motion goes straight on.
            let before = if row > 0 { at(row - 1, column) } else { a * 2.0 - b };
            let after = if row + 2 < rows { at(row + 2, column) } else { b * 2.0 - a };
            out.push((a + b) * (9.0 / 16.0) - (before + after) * (1.0 / 16.0));
        }
    }
    out
}

/// Where all bones are at every half frame.
#[derive(Clone)]
pub(super) struct World {
    bones: usize,
    /// Half frame by half frame each bone's head and turn.
    placed: Vec<(DVec3, DQuat)>,
    /// Each bone's own rotation, of unit length.
    locals: Vec<DQuat>,
}

impl World {
    pub(super) fn new(bones: &Bones, poses: &Poses) -> Self {
        let locals: Vec<DQuat> = poses.rotations.iter().map(|r| r.normalize()).collect();
        let count = bones.len();
        let mut placed: Vec<(DVec3, DQuat)> = Vec::with_capacity(locals.len());
        for (index, &local) in locals.iter().enumerate() {
            let (sample, bone) = (index / count, index % count);
            let parent = bones.parents[bone].map_or(ORIGIN, |p| placed[sample * count + p]);
            let location = if bone == 0 { poses.locations[sample] } else { DVec3::ZERO };
            placed.push(bones.upon(bone, parent, local, location));
        }
        Self { bones: count, placed, locals }
    }

    pub(super) fn placed(&self, sample: usize, bone: usize) -> (DVec3, DQuat) {
        self.placed[sample * self.bones + bone]
    }

    pub(super) fn local(&self, sample: usize, bone: usize) -> DQuat {
        self.locals[sample * self.bones + bone]
    }

    /// Places a limb's bones anew upon their parents, turned as they are wanted.
    pub(super) fn hang(&mut self, bones: &Bones, limb: &Limb, wanted: &Poses) {
        for sample in 0..wanted.locations.len() {
            for &bone in &limb.bones {
                let parent = bones.parents[bone].map_or(ORIGIN, |p| self.placed(sample, p));
                let location = if bone == 0 { wanted.locations[sample] } else { DVec3::ZERO };
                self.placed[sample * self.bones + bone] =
                    bones.upon(bone, parent, self.local(sample, bone), location);
            }
        }
    }

    /// Has a limb be placed so from a half frame on, sample by sample and bone by bone.
    pub(super) fn replace(&mut self, limb: &Limb, first: usize, placed: &[(DVec3, DQuat)]) {
        for (index, &one) in placed.iter().enumerate() {
            let (sample, bone) = (first + index / limb.bones.len(), limb.bones[index % limb.bones.len()]);
            self.placed[sample * self.bones + bone] = one;
        }
    }
}

/// What a bone without a parent hangs on.
pub(super) const ORIGIN: (DVec3, DQuat) = (DVec3::ZERO, DQuat::IDENTITY);
