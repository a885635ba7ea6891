//! Whether the captures show enough of an action to work with, or only a scrap of it.
//!
//! One second of a kick that looks like a step must not stand for all walking, nor half a second between two turns
//! for standing. What falls short of these amounts is filled up from the starter library.

use std::ops::Range;

use super::build::seconds;
use super::clip::{Clip, MotionLibrary, Segment, Source};
use crate::action::ActionLabel;
use crate::math::rotation::wrap_angle;

/// Frames of standing in one piece that a motion begins from: the first, and a second of what follows it.
pub(crate) const STANDING_FRAMES: usize = 31;
/// Of standing or sitting still, seconds: shorter ones are seen to repeat while a character waits.
const STILL_SECONDS: f32 = 2.0;
/// A walk that is shorter than a stride cannot be walked on with, frames.
const STRIDE_FRAMES: usize = 30;
/// Metres walked: a room of five metres, crossed and come back from, twice.
const WALKED_METRES: f32 = 20.0;
/// Turned while walking, to the left and to the right: half a turn, degrees.
const TURNED_DEGREES: f32 = 180.0;
/// A pelvis swings by less than this from stride to stride where the way is straight, degrees.
const STRAIGHT_DEGREES: f32 = 15.0;
/// Captured sits, rises and stops, their mirrored copies not counted: seats differ in height and in how one comes to
/// them, and one stops on either foot.
const COMPLETED: usize = 4;

/// Turns from standing, to the left and to the right, mirrored copies counted: who faces away has to turn before he walks, and
/// without such a capture the turn is patched together from those of walks, over feet that stand askew.
const TURNS: usize = COMPLETED;
/// Who turns from standing turns by at least so much, degrees, …
const STANDING_TURN: f32 = 60.0;
/// … in so many frames and within so many metres of where he stood.
const TURN_FRAMES: usize = 90;
const TURN_METRES: f32 = 1.0;
/// So many frames after it belong to it: the last foot comes down.
const TURN_SETTLES: usize = 15;

/// A turn from standing.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct StandingTurn {
    /// Its frames, with what stands before it.
    pub(crate) frames: Range<usize>,
    /// To the left, negative to the right.
    degrees: f32,
}

impl StandingTurn {
    /// The first in a clip.
    pub(crate) fn of(clip: &Clip) -> Option<Self> {
        let follows = |pair: &[Segment]| {
            (pair[0].label, pair[1].label) == (ActionLabel::Idle, ActionLabel::Walk)
                && pair[0].end == pair[1].first
        };
        let of = |pair: &[Segment]| {
            let (stands, walks) = (&pair[0], &pair[1]);
            let at = |frame: usize| clip.motion.postures[frame].planar();
            let from = at(walks.first);
            let (mut turned, mut most) = (0.0f32, (0.0f32, walks.first));
            for frame in walks.first + 1..walks.end.min(walks.first + TURN_FRAMES) {
                if at(frame).position.distance(from.position) > TURN_METRES {
                    break;
                }
                turned += wrap_angle(at(frame).yaw - at(frame - 1).yaw).to_degrees();
                if turned.abs() > most.0.abs() {
                    most = (turned, frame);
                }
            }
            let (degrees, last) = most;
            let end = walks.end.min(last + 1 + TURN_SETTLES);
            (degrees.abs() >= STANDING_TURN).then_some(Self { frames: stands.first..end, degrees })
        };
        clip.segments.windows(2).filter(|pair| follows(pair)).find_map(of)
    }

    /// Cuts a segment to it; false where it is none of it.
    pub(crate) fn cut(&self, segment: &mut Segment) -> bool {
        let Range { start, end } = self.frames;
        if !matches!(segment.label, ActionLabel::Idle | ActionLabel::Walk)
            || segment.first < start
            || segment.first >= end
        {
            return false;
        }
        segment.end = segment.end.min(end);
        segment.complete = segment.end - 1;
        true
    }
}

/// Why the captured turns from standing are too few to work with, or `None` where they are enough.
pub(crate) fn turn_shortfall(library: &MotionLibrary) -> Option<String> {
    let captured = library.clips.iter().filter(|clip| clip.source == Source::Mocap);
    let (left, right): (Vec<_>, Vec<_>) =
        captured.filter_map(StandingTurn::of).partition(|turn| turn.degrees > 0.0);
    (left.len() < TURNS || right.len() < TURNS).then(|| {
        format!(
            "{} turns from standing to the left and {} to the right were captured, {TURNS} each are needed",
            left.len(),
            right.len()
        )
    })
}

/// What of an action was captured. A mirrored copy walks another way, but what it does is seen before.
#[derive(Default)]
struct Captured {
    seconds: f32,
    /// The longest piece, frames.
    longest: usize,
    metres: f32,
    /// To the left and to the right, degrees.
    turned: [f32; 2],
    takes: usize,
}

impl Captured {
    fn of(library: &MotionLibrary, label: ActionLabel) -> Self {
        let mut out = Self::default();
        for clip in library.clips.iter().filter(|c| c.source == Source::Mocap) {
            for segment in clip.segments.iter().filter(|s| s.label == label) {
                out.add(clip, segment);
            }
        }
        out
    }

    fn add(&mut self, clip: &Clip, segment: &Segment) {
        let length = segment.end - segment.first;
        if !clip.mirrored {
            self.seconds += seconds(length);
            self.takes += 1;
        }
        self.longest = self.longest.max(length);
        if length < STRIDE_FRAMES {
            return;
        }
        let at = |frame: usize| clip.motion.postures[frame].planar();
        for first in (segment.first..segment.end - 1).step_by(STRIDE_FRAMES) {
            let end = (first + STRIDE_FRAMES).min(segment.end - 1);
            self.metres += at(first).position.distance(at(end).position);
            let turn = wrap_angle(at(end).yaw - at(first).yaw).to_degrees();
            if turn.abs() > STRAIGHT_DEGREES {
                self.turned[usize::from(turn < 0.0)] += turn.abs();
            }
        }
    }
}

/// Why the captured part of an action is too little to work with, or `None` where it is enough. [`ActionLabel::Other`]
/// is never matched and never lacking.
pub(crate) fn shortfall(library: &MotionLibrary, label: ActionLabel) -> Option<String> {
    let captured = Captured::of(library, label);
    let of = |enough: bool, what: String| (!enough).then_some(what);
    match label {
        ActionLabel::Other => None,
        _ if captured.seconds == 0.0 => Some("none was captured".into()),
        ActionLabel::Walk => {
            let [left, right] = captured.turned;
            of(
                captured.metres >= WALKED_METRES,
                format!(
                    "{:.1} m were walked in pieces of a second and more, {WALKED_METRES} are needed",
                    captured.metres
                ),
            )
            .or_else(|| {
                of(
                    left >= TURNED_DEGREES && right >= TURNED_DEGREES,
                    format!(
                        "{left:.0}° were turned to the left and {right:.0}° to the right, \
                         {TURNED_DEGREES} each are needed"
                    ),
                )
            })
        }
        ActionLabel::Idle => of(
            captured.longest >= STANDING_FRAMES && captured.seconds >= STILL_SECONDS,
            format!(
                "{:.1} s of standing were captured, {} frames in one piece at most; {STILL_SECONDS} s and {STANDING_FRAMES} frames are needed",
                captured.seconds, captured.longest,
            ),
        ),
        ActionLabel::SeatedIdle => of(
            captured.seconds >= STILL_SECONDS,
            format!("{:.1} s were captured, {STILL_SECONDS} are needed", captured.seconds),
        ),
        ActionLabel::Sit | ActionLabel::StandUp | ActionLabel::Stop => of(
            captured.takes >= COMPLETED,
            format!("{} were captured, {COMPLETED} are needed", captured.takes),
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::{Motion, Posture};
    use glam::Quat;

    /// A clip of one label that goes at `speed` metres a second and turns at `turn` degrees a second.
    fn clip(label: ActionLabel, frames: usize, speed: f32, turn: f32) -> Clip {
        let mut motion = Motion::default();
        let mut place = glam::Vec3::ZERO;
        for frame in 0..frames {
            let yaw = (turn * frame as f32 / 30.0).to_radians();
            let mut posture = Posture { root_position: place, ..Default::default() };
            posture.rotations[0] = Quat::from_rotation_z(yaw);
            place += Quat::from_rotation_z(yaw) * glam::Vec3::NEG_Y * speed / 30.0;
            motion.postures.push(posture);
            motion.contacts.push([1.0; 2]);
        }
        let segments = vec![Segment { label, first: 0, end: frames, complete: frames - 1 }];
        Clip { name: "take".into(), source: Source::Mocap, mirrored: false, motion, segments }
    }

    fn lacks(label: ActionLabel, clips: Vec<Clip>) -> Option<String> {
        shortfall(&MotionLibrary { clips }, label)
    }

    #[test]
    fn walking_is_enough_by_metres_and_by_turns_to_both_sides() {
        use ActionLabel::Walk;
        // By hand: 5 s at 1.2 m/s are 6 m; 10 s at 30°/s are 300°, 12 m of way.
        let straight = clip(Walk, 151, 1.2, 0.0);
        assert!(
            lacks(Walk, vec![straight.clone()])
                .unwrap()
                .contains("6.0 m were walked in pieces of a second and more, 20 are needed")
        );
        let turns = lacks(Walk, vec![straight; 4]).unwrap();
        assert!(turns.contains("0° were turned to the left and 0° to the right"), "{turns}");
        let left = clip(Walk, 301, 1.2, 30.0);
        let one_side = lacks(Walk, vec![left.clone(); 2]).unwrap();
        assert!(one_side.contains("600° were turned to the left and 0°"), "{one_side}");
        assert_eq!(lacks(Walk, vec![left.mirror(), left]), None);
        // Pieces shorter than a stride lead nowhere, however many they are.
        assert!(lacks(Walk, vec![clip(Walk, 20, 1.2, 30.0); 200]).unwrap().contains("0.0 m were walked"));
        // Nor does a kick on the spot, however long it takes.
        assert!(lacks(Walk, vec![clip(Walk, 3000, 0.0, 0.0)]).unwrap().contains("0.0 m were walked"));
    }

    #[test]
    fn standing_is_enough_in_one_piece() {
        use ActionLabel::Idle;
        assert!(
            lacks(Idle, vec![clip(Idle, 15, 0.0, 0.0)]).unwrap().contains("15 frames in one piece at most")
        );
        assert!(lacks(Idle, vec![clip(Idle, 30, 0.0, 0.0); 10]).is_some());
        let piece = clip(Idle, 31, 0.0, 0.0);
        assert!(
            lacks(Idle, vec![piece.clone(), piece.mirror()])
                .unwrap()
                .contains("1.0 s of standing were captured")
        );
        assert_eq!(lacks(Idle, vec![piece; 2]), None);
    }

    /// Stands for a second, then turns by `turn` degrees in one, going on at `speed` metres a second.
    fn turning(turn: f32, speed: f32) -> Clip {
        let (stands, turns) =
            (clip(ActionLabel::Idle, 30, 0.0, 0.0), clip(ActionLabel::Walk, 31, speed, turn));
        let mut out = stands.clone();
        out.motion.postures.extend(turns.motion.postures.iter().copied());
        out.motion.contacts.extend(turns.motion.contacts.iter().copied());
        // It goes on for two seconds straight ahead.
        let last = out.motion.postures[60];
        let ahead = Quat::from_rotation_z(last.planar().yaw) * glam::Vec3::NEG_Y * speed / 30.0;
        for frame in 1..=60 {
            let posture = Posture { root_position: last.root_position + frame as f32 * ahead, ..last };
            out.motion.postures.push(posture);
            out.motion.contacts.push([1.0; 2]);
        }
        out.segments.push(Segment { label: ActionLabel::Walk, first: 30, end: 121, complete: 120 });
        out
    }

    #[test]
    fn a_turn_from_standing_ends_soon_after_the_last_of_it() {
        let left = turning(90.0, 0.2);
        let turn = StandingTurn::of(&left).expect("a turn");
        // It turns until frame 60, and settles for 15 more.
        assert_eq!(turn.frames, 0..76);
        assert!((turn.degrees - 90.0).abs() < 0.1, "{turn:?}");
        assert!((StandingTurn::of(&left.mirror()).expect("a turn").degrees + 90.0).abs() < 0.1);
        let mut segments = left.segments.clone();
        segments.retain_mut(|segment| turn.cut(segment));
        assert_eq!(
            segments.iter().map(|s| (s.first, s.end, s.complete)).collect::<Vec<_>>(),
            [(0, 30, 29), (30, 76, 75)]
        );
        // Not who turns by less, who has gone off by then, who does not stand before, nor what is neither standing nor walking.
        assert_eq!(StandingTurn::of(&turning(50.0, 0.2)), None);
        assert_eq!(StandingTurn::of(&turning(90.0, 3.0)), None);
        assert_eq!(StandingTurn::of(&clip(ActionLabel::Walk, 90, 0.2, 90.0)), None);
        assert!(!turn.cut(&mut Segment { label: ActionLabel::Stop, first: 30, end: 60, complete: 50 }));
    }

    #[test]
    fn turns_from_standing_are_counted_to_both_sides() {
        let lacks = |clips| turn_shortfall(&MotionLibrary { clips });
        let left = turning(90.0, 0.2);
        let one_side = lacks(vec![left.clone(); 4]).expect("too few");
        assert!(one_side.contains("4 turns from standing to the left and 0 to the right"), "{one_side}");
        let both = [vec![left.clone(); 4], vec![left.mirror(); 4]].concat();
        assert_eq!(lacks(both.clone()), None);
        let made = both.into_iter().map(|clip| Clip { source: Source::Procedural, ..clip });
        assert!(lacks(made.collect()).is_some());
    }

    #[test]
    fn takes_are_counted_without_their_mirrored_copies_and_without_the_starters() {
        use ActionLabel::Sit;
        let sit = clip(Sit, 60, 0.0, 0.0);
        let three = vec![sit.clone(), sit.mirror(), sit.clone(), sit.mirror(), sit.clone()];
        assert!(lacks(Sit, three.clone()).unwrap().contains("3 were captured, 4 are needed"));
        assert_eq!(lacks(Sit, [three, vec![sit.clone()]].concat()), None);
        let made = Clip { source: Source::Procedural, ..sit };
        assert_eq!(lacks(Sit, vec![made; 9]).unwrap(), "none was captured");
        assert_eq!(lacks(ActionLabel::Other, Vec::new()), None);
    }
}
