//! First steps: where a library's people, who stand, shift their weight and set off.
//!
//! Who is about to step shifts the weight onto the leg that will stay, a third to half a second before the other foot leaves the
//! floor. A search that is asked for a way ahead from standing finds the frame in which the foot leaves, since nothing before it
//! gets anywhere; so a motion that is to begin as people do begins where the shift does, and plays on.

use glam::Vec2;

use super::database::DatabaseFrame;
use crate::action::ActionLabel;
use crate::math::Planar;

/// A first step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Start {
    /// The database frame in which the person stands, about to shift the weight.
    pub first: usize,
    /// That in which the second step is under way.
    pub end: usize,
    /// Where it leads, person-centric as of the first frame; of length 1.
    pub way: Vec2,
}

/// At the most so many frames lie between the beginning of the shift and the foot's leaving.
const LONGEST_SHIFT: usize = 24;
/// A shift is at least so far, metres.
const LEAST_SHIFT: f32 = 0.02;
/// It has begun with this part of it, …
const BEGUN: f32 = 0.1;
/// … so many frames after which the foot leaves at the earliest.
const SHORTEST_SHIFT: usize = 8;
/// A step is under way so many frames after its foot has left.
const UNDER_WAY: usize = 5;
/// The second foot leaves so many frames after the first has left at the latest, or the start ends then, on two feet.
const SECOND_WITHIN: usize = 40;
/// Where the step leads is seen so far ahead, metres: who sets off aside has turned by then; …
pub(crate) const SEEN_AHEAD: f32 = 0.8;
/// … so many frames after the foot has left at the latest, …
const SEEN_AFTER: std::ops::RangeInclusive<usize> = 30..=75;
/// … and it gets at least so far, metres: who turns on the spot sets off nowhere.
const LEAST_WAY: f32 = 0.25;

/// The first steps among the frames of a database. `travel`: where the root is so many frames after another, person-centric.
pub(super) fn starts(frames: &[DatabaseFrame], travel: impl Fn(usize, usize) -> Planar) -> Vec<Start> {
    let sets_off = |at: &usize| {
        let (stands, walks) = (&frames[*at], &frames[at + 1]);
        let labels = (stands.label, walks.label);
        stands.remaining > 0 && labels == (ActionLabel::Idle, ActionLabel::Walk)
    };
    let of = |at: usize| {
        let clip_end = at + usize::from(frames[at].remaining);
        let leaves = (at..clip_end.min(at + SEEN_AFTER.start())).find(|&f| frames[f].stands != [true; 2])?;
        let swings = usize::from(frames[leaves].stands[0]);
        if !frames[leaves].stands[1 - swings] || leaves + SEEN_AFTER.start() > clip_end {
            return None;
        }
        let earliest = (leaves - LONGEST_SHIFT.min(frames[leaves].index as usize)..leaves)
            .rev()
            .take_while(|&f| frames[f].stands == [true; 2])
            .last()?;
        let towards = (frames[earliest].toe[1 - swings] - frames[earliest].toe[swings]).truncate();
        let towards = towards.normalize_or_zero();
        let shift = |frame: usize| travel(earliest, frame - earliest).position.dot(towards);
        let most = shift(leaves);
        let begun = (earliest..leaves).rev().find(|&f| shift(f) < BEGUN * most)?;
        let way = |frame: usize| travel(begun, frame - begun).position;
        let last = (leaves + SEEN_AFTER.end()).min(clip_end);
        let seen = (leaves + SEEN_AFTER.start()..last).find(|&f| way(f).length() > SEEN_AHEAD);
        let way = way(seen.unwrap_or(last));
        // Another clip that goes on from the first step's landing has other feet, and the one that has just come down steps again.
        let second = (leaves..clip_end.min(leaves + SECOND_WITHIN)).find(|&f| !frames[f].stands[1 - swings]);
        let end = second.map_or(leaves + SECOND_WITHIN, |f| f + UNDER_WAY).min(clip_end);
        let is_start = most >= LEAST_SHIFT && leaves - begun >= SHORTEST_SHIFT && way.length() >= LEAST_WAY;
        is_start.then(|| Start { first: begun, end, way: way.normalize() })
    };
    (0..frames.len().saturating_sub(1)).filter(sets_off).filter_map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::library::database::MotionDatabase;
    use crate::library::feature::FeatureWeights;
    use crate::library::{LibrarySettings, StarterUse, build};
    use crate::progress::Progress;
    use crate::test_world::database;

    #[test]
    fn the_starter_sets_off_ahead_aside_and_back_and_always_over_the_leg_that_stays() {
        let settings = LibrarySettings { starter: StarterUse::Missing, ..LibrarySettings::default() };
        let library = build(&[], &settings, &Progress::new()).expect("not cancelled").library;
        let database = MotionDatabase::build(&library, &FeatureWeights::default(), &Progress::new());
        let database = database.expect("a sound library");
        let starts = &database.starts;
        assert!(starts.len() > 100, "{}", starts.len());
        for way in [Vec2::NEG_Y, Vec2::X, Vec2::NEG_X, Vec2::Y] {
            assert!(starts.iter().any(|s| s.way.dot(way) > 0.8), "{way}");
        }
        for start in starts {
            let frames = &database.frames[start.first..=start.end];
            assert!(frames.iter().all(|f| f.clip == frames[0].clip));
            let leaves = start.first + frames.iter().take_while(|f| f.stands == [true; 2]).count();
            assert!((SHORTEST_SHIFT..=LONGEST_SHIFT).contains(&(leaves - start.first)), "{start:?}");
            // Both feet have left once at its end, or it has waited for the second as long as a start does.
            let lifted = [0, 1].map(|side| frames.iter().any(|f| !f.stands[side]));
            assert!(lifted == [true; 2] || start.end - leaves == SECOND_WITHIN, "{start:?}");
        }
    }

    #[test]
    fn who_glides_off_without_a_shift_starts_nowhere() {
        // The test library's people glide over their feet, straight ahead.
        assert_eq!(database().starts, []);
    }
}
