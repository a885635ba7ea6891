//! Hands along their cues φ_M (LAMA, section 3.6; supplementary, "Further Implementation Details for Manipulation").
//!
//! Where a cue's range lies in a part in which the person stands or sits still, the motion is lengthened by holding the
//! target frame for the τ frames of the path, as the paper has it. On the way (a rail, a wall) the motion keeps its
//! length. The reach and the return take longer the farther the hand has to go.
//!
//! The paper has the hand's joint, the wrist, follow φ_M, and the hand stick through what it holds. **Oncue** carries the
//! palm along it: the hand stays as it is turned to its forearm, so that the path leads the point where it grips.
//!
//! What a cue asks for after the motion's end the paper leaves open. Someone who ends standing or sitting still waits
//! there: for a range that begins later, through one that ends later, and until the hand is back and the body upright.

use std::ops::Range;

use glam::Vec3;
use serde::{Deserialize, Serialize};

use super::constraint::{Constraint, check_numbers, check_path};
use super::edit::{EditFigures, reach_frames, whole_span};
use super::latent::Decoder;
use super::resolve::{Wishes, resolve};
use crate::body_solver::is_supported;
use crate::cue::{Hand, ManipulationCue, Task};
use crate::error::{Error, Result};
use crate::math::planar::rotate;
use crate::motion::skeleton::{STANDING_HIPS_HEIGHT, palm};
use crate::motion::{FRAME_RATE, Joint, Motion};
use crate::progress::Progress;
use crate::scene::SceneIndex;
use crate::settings::EditorSettings;

/// Two hands keep this far apart, metres.
const APART: f32 = 0.20;
/// The root of a person who stands or sits still moves less than this a frame, metres.
const STILL: f32 = 0.004;
/// For a cue nobody waits longer than this, seconds: a range so late is a slip of the keyboard.
const LONGEST_WAIT: f32 = 120.0;
/// No palm gets farther from the pelvis than this, metres: a trunk, an arm and a hand, stretched.
const FARTHEST_PALM: f32 = 1.33;

/// Where a cue's path came to lie in the motion.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ManipulationFigures {
    /// The cue's name.
    pub name: String,
    /// Frame (30 Hz) on which the hand is at the path's first place, and how many the path has.
    pub first_frame: usize,
    /// Frames of the cue's path.
    pub frames: usize,
}

/// A motion whose hands follow their cues.
#[derive(Debug, Clone, PartialEq)]
pub struct Manipulated {
    /// The motion with the hands on their paths.
    pub motion: Motion,
    /// Where each cue came to lie.
    pub cues: Vec<ManipulationFigures>,
    /// Where the motion was held on its way: a frame of the motion so far, and how many frames were put in after it.
    pub holds: Vec<(usize, usize)>,
    /// What the edit did.
    pub figures: EditFigures,
}

/// What can be said of a task's manipulation cues before there is a motion.
///
/// # Errors
/// `Input` for a path that is empty, jumps or is no place; `Unreachable` for one that no hand can reach from where
/// the action ends, by how much.
pub fn check_manipulations(task: &Task) -> Result<()> {
    for cue in &task.manipulations {
        check_cue(cue)?;
        if cue.first_frame.is_some() {
            continue;
        }
        let standing = task.start.position.z + STANDING_HIPS_HEIGHT;
        let pelvis = task.cue.position.with_z(task.cue.pelvis_height().unwrap_or(standing));
        // Of a stop only the place on the floor is sure: who stands bends to what lies low.
        let far = cue.path.iter().map(|p| p.distance(pelvis)).fold(0.0, f32::max);
        if far > FARTHEST_PALM {
            return Err(Error::Unreachable(format!(
                "‘{}’ lies up to {far:.2} m from where ‘{}’ puts the pelvis, {:.2} m farther than a hand gets; move one \
                 towards the other.",
                cue.name,
                task.cue.name,
                far - FARTHEST_PALM
            )));
        }
    }
    Ok(())
}

fn check_cue(cue: &ManipulationCue) -> Result<()> {
    if cue.path.is_empty() {
        return Err(Error::input(format!("‘{}’ has no path: give it at least one frame.", cue.name)));
    }
    if !cue.path.iter().all(|p| p.is_finite()) {
        return Err(Error::input(format!("‘{}’ has a place that is not a number.", cue.name)));
    }
    check_path(&cue.name, cue.first_frame.unwrap_or_default(), &cue.path)
}

/// Carries the hands of `motion` along `cues`.
///
/// # Errors
/// `Input` for a path that is empty or jumps, a range after the end of a motion that ends on the way or long after any,
/// or two paths for one hand; `Unreachable`, by how much and which way; `Cancelled`.
pub fn manipulate<D: Decoder>(
    decoder: Option<&D>,
    motion: &Motion,
    cues: &[ManipulationCue],
    scene: Option<&SceneIndex>,
    floor: f32,
    settings: &EditorSettings,
    progress: &Progress,
) -> Result<Manipulated> {
    settings.validate()?;
    check_numbers(motion, floor)?;
    let Placed { motion, placed, holds } = place(motion, cues, floor, settings)?;
    let constraints: Vec<Constraint> =
        placed.iter().flat_map(|&(first, cue)| constraints(&motion, first, cue)).collect();
    let wishes = Wishes { constraints: &constraints, keys: &[], scene, floor };
    let edited = resolve(decoder, &motion, &wishes, settings, progress)?;
    let cues = placed
        .iter()
        .map(|(first, cue)| ManipulationFigures {
            name: cue.name.clone(),
            first_frame: *first,
            frames: cue.path.len(),
        })
        .collect();
    Ok(Manipulated { motion: edited.motion, cues, holds, figures: edited.figures })
}

/// The motion as long as its cue needs it, and what the cue asks of it: what another editor would begin with.
///
/// # Errors
/// As [`manipulate`].
pub fn lengthened(
    motion: &Motion,
    cue: &ManipulationCue,
    floor: f32,
    settings: &EditorSettings,
) -> Result<(Motion, Vec<Constraint>)> {
    settings.validate()?;
    check_numbers(motion, floor)?;
    let Placed { motion, placed, .. } = place(motion, std::slice::from_ref(cue), floor, settings)?;
    let constraints = placed.iter().flat_map(|&(first, cue)| constraints(&motion, first, cue)).collect();
    Ok((motion, constraints))
}

/// A motion as long as its cues need it.
struct Placed<'a> {
    motion: Motion,
    placed: Vec<(usize, &'a ManipulationCue)>,
    /// See [`Manipulated::holds`].
    holds: Vec<(usize, usize)>,
}

/// Lengthens the motion and gives each cue its first frame.
fn place<'a>(
    motion: &Motion,
    cues: &'a [ManipulationCue],
    floor: f32,
    settings: &EditorSettings,
) -> Result<Placed<'a>> {
    cues.iter().try_for_each(check_cue)?;
    let mut motion = motion.clone();
    let mut placed: Vec<(usize, &ManipulationCue)> = Vec::new();
    let mut held: Range<usize> = 0..0;
    let mut holds = Vec::new();
    let mut timed: Vec<&ManipulationCue> = cues.iter().filter(|c| c.first_frame.is_some()).collect();
    timed.sort_by_key(|c| c.first_frame);
    for cue in timed {
        let first = cue.first_frame.unwrap_or_default();
        check_wait(&motion, cue, first)?;
        let end = first + cue.path.len();
        if held.contains(&first) {
            // Within a hold already: that goes on for as long as this path needs it.
            let more = end.saturating_sub(held.end);
            hold(&mut motion, held.end - 1, more);
            holds.push((held.end - 1, more));
            held.end += more;
        } else if is_still(&motion, first, floor) {
            wait(&mut motion, first + 1);
            hold(&mut motion, first, cue.path.len());
            holds.push((first, cue.path.len()));
            held = first..end;
        } else if end <= motion.len() || is_still(&motion, end, floor) {
            wait(&mut motion, end);
        } else {
            return Err(Error::input(format!(
                "‘{}’ runs from frame {first} to {}, and the motion has frames 0 to {} and ends on the way, where nobody \
                 can wait; move its range.",
                cue.name,
                end - 1,
                motion.len() - 1
            )));
        }
        placed.push((first, cue));
    }
    // The whole way back, and a frame on which everything is as it was.
    let asked: Vec<Constraint> =
        placed.iter().flat_map(|&(first, cue)| constraints(&motion, first, cue)).collect();
    let back = whole_span(&motion, &asked, settings).end;
    if !placed.is_empty() && is_still(&motion, back, floor) {
        wait(&mut motion, back + 1);
    }
    for cue in cues.iter().filter(|c| c.first_frame.is_none()) {
        let Some(last) = motion.len().checked_sub(1) else { continue };
        let pose = motion.postures[last].pose();
        let away = |p: Vec3| {
            joints(cue.hand).iter().map(|&j| pose.point(j, palm(j)).distance(p)).fold(0.0, f32::max)
        };
        let reach = reach_frames(away(cue.path[0]), settings);
        let back = reach_frames(away(cue.path[cue.path.len() - 1]), settings);
        hold(&mut motion, last, reach + cue.path.len() + back);
        placed.push((last + reach, cue));
    }
    Ok(Placed { motion, placed, holds })
}

/// Refuses a range that nobody waits for.
fn check_wait(motion: &Motion, cue: &ManipulationCue, first: usize) -> Result<()> {
    let Some(last) = motion.len().checked_sub(1) else {
        return Err(Error::input(format!("There is no motion that could follow ‘{}’.", cue.name)));
    };
    let seconds = first.saturating_sub(last) as f32 / FRAME_RATE;
    if seconds > LONGEST_WAIT {
        return Err(Error::input(format!(
            "‘{}’ begins on frame {first}, {seconds:.0} s after the motion's last, {last}; the person waits for at most \
             {LONGEST_WAIT:.0} s, so move its range.",
            cue.name
        )));
    }
    Ok(())
}

fn joints(hand: Hand) -> &'static [Joint] {
    match hand {
        Hand::Left => &Joint::HANDS[..1],
        Hand::Right => &Joint::HANDS[1..],
        Hand::Both => &Joint::HANDS,
    }
}

fn constraints(motion: &Motion, first: usize, cue: &ManipulationCue) -> Vec<Constraint> {
    let to_left = rotate(motion.postures[first].planar().yaw, glam::Vec2::X).extend(0.0);
    joints(cue.hand)
        .iter()
        .map(|&joint| {
            let side = match (cue.hand, joint) {
                (Hand::Both, Joint::LeftHand) => 0.5 * APART,
                (Hand::Both, _) => -0.5 * APART,
                _ => 0.0,
            };
            let path = cue.path.iter().map(|p| *p + to_left * side).collect();
            Constraint { offset: palm(joint), ..Constraint::positions(&cue.name, joint, first, path) }
        })
        .collect()
}

/// Whether the person stands or sits still around `frame`; after its end a motion is as on its last frame.
fn is_still(motion: &Motion, frame: usize, floor: f32) -> bool {
    let last = motion.len() - 1;
    let root = |f: usize| motion.postures[f].root_position;
    let frame = frame.min(last);
    let (first, end) = (frame.saturating_sub(3), (frame + 3).min(last));
    let (before, after) = (root(first), root(end));
    let stands = motion.contacts[frame].iter().all(|&c| c >= 1.0);
    // Who sits and turns on the seat has a pelvis at rest, but not the feet.
    let (start, stop) = (motion.postures[first].pose(), motion.postures[end].pose());
    let feet = Joint::TOES.map(|j| start.position(j).distance(stop.position(j)));
    let still = (end - first).max(1) as f32 * STILL;
    let carried = stands || is_supported(&motion.postures[frame].pose(), floor);
    carried && before.distance(after) < still && feet.iter().all(|&moved| moved < still)
}

/// Repeats the last frame until there are `frames`.
fn wait(motion: &mut Motion, frames: usize) {
    let count = frames.saturating_sub(motion.len());
    hold(motion, motion.len() - 1, count);
}

/// Repeats `frame` `count` times after itself.
fn hold(motion: &mut Motion, frame: usize, count: usize) {
    let (posture, contact) = (motion.postures[frame], motion.contacts[frame]);
    motion.postures.splice(frame..frame, std::iter::repeat_n(posture, count));
    motion.contacts.splice(frame..frame, std::iter::repeat_n(contact, count));
}
