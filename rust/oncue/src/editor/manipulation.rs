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
pub(crate) const LONGEST_WAIT: f32 = 120.0;
/// No palm gets farther from the pelvis than this, metres: a trunk, an arm and a hand, stretched.
pub(crate) const FARTHEST_PALM: f32 = 1.33;

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

/// The joints of a hand, or of both.
pub(crate) fn joints(hand: Hand) -> &'static [Joint] {
    match hand {
        Hand::Left => &Joint::HANDS[..1],
        Hand::Right => &Joint::HANDS[1..],
        Hand::Both => &Joint::HANDS,
    }
}

/// What a cue asks of a motion on whose frame `first` its path begins.
pub(crate) fn constraints(motion: &Motion, first: usize, cue: &ManipulationCue) -> Vec<Constraint> {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::manifold::Manifold;
    use crate::math::Planar;
    use crate::test_world::{World, person, still};

    fn cue(first: Option<usize>, path: &[Vec3]) -> ManipulationCue {
        ManipulationCue { name: "Rail".into(), hand: Hand::Left, path: path.to_vec(), first_frame: first }
    }

    /// Before the left shoulder of who stands.
    const HERE: Vec3 = Vec3::new(0.2, -0.3, 1.1);

    fn settings() -> EditorSettings {
        EditorSettings {
            reach_seconds: 0.2,
            reach_seconds_per_metre: 0.0,
            blend_seconds: 0.1,
            manifold: false,
            ..Default::default()
        }
    }

    /// Who walks at 4 cm a frame, in the air all the way.
    fn walking(frames: usize) -> Motion {
        let at = |i: usize| person(Planar::new(glam::Vec2::Y * -0.04 * i as f32, 0.0), 0.93, 0.0);
        Motion { postures: (0..frames).map(at).collect(), contacts: vec![[0.0; 2]; frames] }
    }

    #[test]
    fn who_stands_is_held_for_a_path() {
        let motion = still(40);
        let cues = [cue(Some(10), &[HERE; 5])];
        let placed = place(&motion, &cues, 0.0, &settings()).expect("placed");
        // Five frames more after frame 10, and the way back within the motion.
        assert_eq!((placed.motion.len(), placed.holds.clone()), (45, vec![(10, 5)]));
        assert_eq!(placed.placed[0].0, 10);
        // Without a frame: after the end, with the way there and back.
        let cues = [cue(None, &[HERE; 5])];
        let placed = place(&motion, &cues, 0.0, &settings()).expect("placed");
        assert_eq!((placed.motion.len(), placed.placed[0].0), (40 + 6 + 5 + 6, 39 + 6));
        assert!(placed.holds.is_empty());
        // After the end one waits for it, holds, and has the time to come back.
        let cues = [cue(Some(60), &[HERE; 5])];
        let placed = place(&motion, &cues, 0.0, &settings()).expect("placed");
        assert_eq!((placed.holds.clone(), placed.placed[0].0), (vec![(60, 5)], 60));
        assert_eq!(placed.motion.len(), 65 + 6 + 1);
        // A second path within the first one's hold puts it off by what it is longer.
        let cues = [cue(Some(12), &[HERE; 6]), cue(Some(10), &[HERE; 5])];
        let placed = place(&motion, &cues, 0.0, &settings()).expect("placed");
        assert_eq!(placed.holds, [(10, 5), (14, 3)]);
        assert_eq!((placed.motion.len(), placed.placed[0].0, placed.placed[1].0), (48, 10, 12));
    }

    #[test]
    fn who_walks_goes_on_walking() {
        let motion = walking(40);
        let cues = [cue(Some(10), &[HERE; 5])];
        let placed = place(&motion, &cues, 0.0, &settings()).expect("placed");
        assert_eq!((placed.motion.len(), placed.holds.len()), (40, 0));
        let fits = [cue(Some(35), &[HERE; 5])];
        assert_eq!(place(&motion, &fits, 0.0, &settings()).expect("placed").motion.len(), 40);
        let late = [cue(Some(36), &[HERE; 5])];
        let said = place(&motion, &late, 0.0, &settings()).err().expect("refused").to_string();
        assert!(said.contains("from frame 36 to 40") && said.contains("frames 0 to 39"), "{said}");
        // Who stops is waited for.
        let mut stops = walking(40);
        stops.postures.extend([stops.postures[39]; 10]);
        stops.contacts.extend([[1.0; 2]; 10]);
        let cues = [cue(Some(36), &[HERE; 20])];
        let placed = place(&stops, &cues, 0.0, &settings()).expect("placed");
        assert_eq!((placed.motion.len(), placed.holds.len()), (56 + 6 + 1, 0));
    }

    #[test]
    fn nobody_waits_for_ever() {
        let motion = still(10);
        let at = |first: usize| check_wait(&motion, &cue(Some(first), &[HERE]), first);
        // 120 s after frame 9.
        assert!(at(9 + 3600).is_ok() && at(0).is_ok());
        let said = at(9 + 3630).unwrap_err().to_string();
        assert!(said.contains("121 s after the motion's last, 9") && said.contains("120 s"), "{said}");
        assert!(check_wait(&still(0), &cue(Some(1), &[HERE]), 1).is_err());
    }

    #[test]
    fn stillness_by_hand() {
        assert!(is_still(&still(20), 10, 0.0) && is_still(&still(20), 99, 0.0));
        assert!(!is_still(&walking(20), 10, 0.0));
        let moved = |frame: usize, change: &dyn Fn(&mut Motion, usize)| {
            let mut motion = still(20);
            (frame..20).for_each(|f| change(&mut motion, f));
            motion
        };
        // 4 mm a frame over the six frames around.
        for (step, still) in [(0.023, true), (0.025, false)] {
            let motion = moved(10, &|m, f| m.postures[f].root_position.x += step);
            assert_eq!((is_still(&motion, 9, 0.0), is_still(&motion, 14, 0.0)), (still, true), "{step}");
        }
        // A foot that moves, or one that does not stand.
        let turned = moved(10, &|m, f| {
            m.postures[f].rotations[Joint::LeftUpLeg.index()] = glam::Quat::from_rotation_x(0.9)
        });
        assert!(!is_still(&turned, 10, 0.0));
        let lifted = moved(0, &|m, f| m.contacts[f][1] = 0.5);
        assert!(!is_still(&lifted, 10, 0.0));
        // But who sits needs no foot on the floor.
        let seated = moved(0, &|m, f| {
            (m.postures[f], m.contacts[f]) = (person(Planar::default(), 0.55, 0.3), [0.0; 2])
        });
        assert!(is_still(&seated, 10, 0.0) && !is_still(&seated, 10, -0.5));
    }

    #[test]
    fn hands_hold_with_their_palms() {
        // Facing +X: the left hand is at +Y.
        let mut motion = still(5);
        motion.postures[2] =
            motion.postures[2].moved(Planar::default(), Planar::new(glam::Vec2::ZERO, 1.570_796_4));
        let of = |hand: Hand| constraints(&motion, 2, &ManipulationCue { hand, ..cue(None, &[HERE, HERE]) });
        let left = of(Hand::Left);
        assert_eq!((left.len(), left[0].joint, left[0].frames()), (1, Joint::LeftHand, 2..4));
        assert_eq!((left[0].offset, left[0].positions[1]), (palm(Joint::LeftHand), HERE));
        assert_eq!(of(Hand::Right)[0].joint, Joint::RightHand);
        let both = of(Hand::Both);
        assert!(both[0].positions[0].distance(HERE + Vec3::Y * 0.1) < 1e-6);
        assert!(both[1].positions[0].distance(HERE - Vec3::Y * 0.1) < 1e-6);
        assert_eq!((both[0].joint, both[1].joint), (Joint::LeftHand, Joint::RightHand));
    }

    #[test]
    fn a_hand_follows_its_path() {
        let motion = still(30);
        let path: Vec<Vec3> = (0..6).map(|i| HERE + Vec3::Z * 0.01 * i as f32).collect();
        let cues = [cue(None, &path)];
        let s = settings();
        let done =
            manipulate(None::<&Manifold>, &motion, &cues, None, 0.0, &s, &Progress::new()).expect("done");
        let first = done.cues[0].first_frame;
        assert_eq!((done.cues[0].frames, done.cues[0].name.as_str(), first), (6, "Rail", 35));
        for (i, place) in path.iter().enumerate() {
            let pose = done.motion.postures[first + i].pose();
            assert!(pose.point(Joint::LeftHand, palm(Joint::LeftHand)).distance(*place) < 3e-3);
        }
        assert_eq!(done.motion.postures[..20], motion.postures[..20]);
        let (longer, asked) = lengthened(&motion, &cues[0], 0.0, &s).expect("placed");
        assert_eq!((longer.len(), asked.len(), asked[0].first_frame), (done.motion.len(), 1, 35));
        // Two paths for one hand contradict each other.
        let twice = [cue(Some(10), &[HERE; 3]), cue(Some(11), &[HERE + Vec3::Z * 0.1; 3])];
        assert!(manipulate(None::<&Manifold>, &motion, &twice, None, 0.0, &s, &Progress::new()).is_err());
    }

    #[test]
    fn a_path_that_no_hand_reaches_is_refused_before_there_is_a_motion() {
        let mut world = World::stool();
        let seat = world.task.cue.position;
        let mut at = |first: Option<usize>, away: f32| {
            world.task.manipulations =
                vec![cue(first, &[seat + Vec3::Z * 0.2, seat + Vec3::Z * 0.3, seat + Vec3::X * away])];
            world.task.manipulations[0].path.drain(..2);
            check_manipulations(&world.task)
        };
        assert!(at(None, 1.32).is_ok());
        let error = at(None, 1.43).unwrap_err();
        assert!(
            matches!(error, Error::Unreachable(_)) && error.to_string().contains("0.10 m farther"),
            "{error}"
        );
        // On the way the pelvis is elsewhere.
        assert!(at(Some(4), 1.43).is_ok());
        // Of a stop the pelvis is as high as one stands.
        let mut world = World::stop_ahead(1.0);
        let pelvis = world.task.cue.position.with_z(STANDING_HIPS_HEIGHT);
        for (up, fine) in [(1.32, true), (1.34, false), (-1.34, false)] {
            world.task.manipulations = vec![cue(None, &[pelvis + Vec3::Z * up])];
            assert_eq!(check_manipulations(&world.task).is_ok(), fine, "{up}");
        }
        for (path, part) in [
            (vec![], "no path"),
            (vec![Vec3::NAN], "not a number"),
            (vec![pelvis, pelvis + Vec3::X], "jumps"),
        ] {
            world.task.manipulations = vec![cue(None, &path)];
            let said = check_manipulations(&world.task).unwrap_err().to_string();
            assert!(said.contains(part), "{said}");
        }
    }
}
