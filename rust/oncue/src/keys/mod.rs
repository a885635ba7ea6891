//! Few keys for a motion: Bézier curves that an artist can edit, no further from it than a tolerance.
//!
//! A key is the motion's own value at a frame. Between two keys a curve is the cubic whose handles lie at a third of the
//! span, so that time runs evenly along it. The bones of a limb share their keys. Errors add up along a chain, so they
//! are told in the world by forward kinematics, limb after limb from the root on, each upon its parents as they play.
//!
//! Nothing here knows a person's skeleton: bones, limbs and tolerances are the caller's, and so is the unit of length.

mod bones;
mod path;
mod refine;
mod segment;
#[cfg(test)]
mod tests;

use glam::{DQuat, DVec3};

pub use bones::Bones;
use bones::{Channels, World};
use path::fewest;
use segment::Segments;

use crate::error::{Error, Result};

/// How often what carries limbs is fitted nearer to the motion, and how much nearer each time.
const ROUNDS: usize = 5;
const NEARER: f64 = 0.6;
/// A quaternion that is shorter turns nothing.
const SHORTEST: f64 = 1e-6;

/// How far a bone may be from the motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tolerance {
    /// Of the bone's head in the world; infinite where only turns count.
    pub place: f64,
    /// Of the bone's own rotation, radians.
    pub turn: f64,
}

/// Bones that share their keys.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Limb {
    /// Parents before children.
    pub bones: Vec<usize>,
    /// Frames that are keyed in any case.
    pub keyed: Vec<usize>,
}

/// The channels of all bones at equal steps of time.
#[derive(Clone, Debug, PartialEq)]
pub struct Poses {
    /// The first bone's location in its rest frame.
    pub locations: Vec<DVec3>,
    /// Pose by pose each bone's rotation; not normalized, with signs that do not jump.
    pub rotations: Vec<DQuat>,
}

/// Curves that are there already, parts of which stay.
#[derive(Clone, Debug, PartialEq)]
pub struct Kept {
    /// What they play at every half frame, the first and the last included.
    pub played: Poses,
    /// Frame by frame, whether each bone's curves stay from there to the next.
    pub stays: Vec<bool>,
}

/// What the keys are held to.
#[derive(Clone, Debug, PartialEq)]
pub struct Limits {
    /// Of each bone.
    pub tolerances: Vec<Tolerance>,
    /// Frame by frame, whether each bone stands; empty for none.
    pub planted: Vec<bool>,
    /// By how much a bone that stands may drift from a frame to the next, beyond what it does in the motion.
    pub drift: f64,
}

/// The new keys of a bone, ascending.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BoneKeys {
    /// At which frame each is.
    pub frames: Vec<usize>,
    /// Key by key the channels: w, x, y, z, and of the first bone its location after them.
    pub values: Vec<f64>,
    /// How fast these change before the key, a frame; NaN where the curve on that side stays, or there is none.
    pub before: Vec<f64>,
    /// The same after it.
    pub after: Vec<f64>,
}

/// Fits few keys to a motion of one pose a frame: those of each bone where its curves do not stay.
///
/// # Errors
/// [`Error::Input`] where the arrays do not belong together.
pub fn fit_keys(
    bones: &Bones,
    limbs: &[Limb],
    limits: &Limits,
    motion: &Poses,
    kept: Option<&Kept>,
) -> Result<Vec<BoneKeys>> {
    check(bones, limbs, limits, motion, kept)?;
    let keys = vec![BoneKeys::default(); bones.len()];
    if motion.locations.is_empty() {
        return Ok(keys);
    }
    let channels = Channels::new(bones.len(), motion, kept);
    let truth = World::new(bones, &channels.motion);
    let mut limits = limits.clone();
    for _ in 0..ROUNDS {
        match fit_limbs(bones, limbs, &limits, &channels, &truth, true) {
            Ok(keys) => return Ok(keys),
            // Not even a key on every frame makes up for what this limb hangs on: that comes nearer to the motion.
            Err(limb) => {
                for bone in over(bones, limbs, limb) {
                    limits.tolerances[bone].place *= NEARER;
                    limits.tolerances[bone].turn *= NEARER;
                }
            }
        }
    }
    Ok(fit_limbs(bones, limbs, &limits, &channels, &truth, false).unwrap_or(keys))
}

/// The keys of all bones; if they `must` be within the limits, else the first limb that is not.
fn fit_limbs(
    bones: &Bones,
    limbs: &[Limb],
    limits: &Limits,
    channels: &Channels,
    truth: &World,
    must: bool,
) -> std::result::Result<Vec<BoneKeys>, usize> {
    let mut keys = vec![BoneKeys::default(); bones.len()];
    let mut played = World::new(bones, &channels.wanted);
    for (index, limb) in limbs.iter().enumerate() {
        let before = played.clone();
        let segments = Segments::new(bones, limb, limits, channels, truth, &before);
        // What stays is placed anew too where what it hangs on does not.
        played.hang(bones, limb, &channels.wanted);
        for (from, to) in segments.runs() {
            let path = fewest(&segments, from, to);
            let spans = segments.spans(&path);
            if must && !spans.holds && bones.parents[limb.bones[0]].is_some() {
                return Err(index);
            }
            for (&bone, new) in limb.bones.iter().zip(segments.keys(&path, &spans.slopes)) {
                keys[bone].append(new);
            }
            played.replace(limb, 2 * from, &segments.play(&path, &spans.slopes));
        }
    }
    Ok(keys)
}

/// The bones of the limbs that a limb hangs on.
fn over(bones: &Bones, limbs: &[Limb], limb: usize) -> Vec<usize> {
    let parent = |bone: &usize| bones.parents[*bone];
    let above: Vec<usize> =
        limbs[limb].bones.iter().flat_map(|&bone| std::iter::successors(parent(&bone), parent)).collect();
    let carries =
        |other: &&Limb| **other != limbs[limb] && other.bones.iter().any(|bone| above.contains(bone));
    limbs.iter().filter(carries).flat_map(|other| other.bones.clone()).collect()
}

fn check(bones: &Bones, limbs: &[Limb], limits: &Limits, motion: &Poses, kept: Option<&Kept>) -> Result<()> {
    let (frames, count) = (motion.locations.len(), bones.len());
    let halves = (2 * frames).saturating_sub(1);
    let fits = motion.rotations.len() == frames * count
        && limits.tolerances.len() == count
        && (limits.planted.is_empty() || limits.planted.len() == frames * count)
        && limbs.iter().flat_map(|limb| &limb.bones).all(|&bone| bone < count)
        && kept.is_none_or(|kept| {
            kept.played.locations.len() == halves
                && kept.played.rotations.len() == halves * count
                && kept.stays.len() == frames * count
        });
    if !fits {
        return Err(Error::input("The arrays that keys are fitted to are not those of one motion."));
    }
    let all = std::iter::once(motion).chain(kept.map(|kept| &kept.played));
    let sound = |poses: &Poses| {
        poses.locations.iter().all(|place| place.is_finite())
            && poses.rotations.iter().all(|turn| turn.is_finite() && turn.length() > SHORTEST)
    };
    if !all.into_iter().all(sound) {
        return Err(Error::input("A pose that keys are fitted to has a place or a rotation that is none."));
    }
    Ok(())
}

impl BoneKeys {
    /// Adds what comes after.
    fn append(&mut self, later: Self) {
        self.frames.extend(later.frames);
        self.values.extend(later.values);
        self.before.extend(later.before);
        self.after.extend(later.after);
    }
}
