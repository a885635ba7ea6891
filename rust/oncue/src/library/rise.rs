//! Getting up: where a library's people, who sit, draw their feet back and rise.

use super::database::DatabaseFrame;
use crate::action::ActionLabel;

/// One getting up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rise {
    /// The database frame in which the person still sits, about to draw the feet back.
    pub first: usize,
    /// That in which the person stands.
    pub end: usize,
    /// Whether it ends walking on.
    pub walks_on: bool,
}

/// Feet are drawn back at the most so many frames before the trunk leans.
const LONGEST_DRAW: usize = 15;
/// Who stands less than this many frames after walks on.
const STANDS_STILL: usize = 20;

/// The risings among the frames of a database.
pub(super) fn rises(frames: &[DatabaseFrame]) -> Vec<Rise> {
    let rises = |f: &DatabaseFrame| f.label == ActionLabel::StandUp;
    let begins = |at: &usize| rises(&frames[*at]) && (frames[*at].index == 0 || !rises(&frames[*at - 1]));
    let of = |at: usize| {
        let complete = usize::from(frames[at].until_complete);
        if complete == 0 || complete > usize::from(frames[at].remaining) {
            return None;
        }
        let end = at + complete;
        let drawn = LONGEST_DRAW.min(frames[at].index as usize);
        let sits = |f: &usize| frames[*f].label == ActionLabel::SeatedIdle;
        let first = (at - drawn..at).rev().take_while(sits).last().unwrap_or(at);
        let after = end + STANDS_STILL.min(usize::from(frames[end].remaining));
        let walks_on = frames[end..=after].iter().any(|f| f.label == ActionLabel::Walk);
        Some(Rise { first, end, walks_on })
    };
    (0..frames.len()).filter(begins).filter_map(of).collect()
}
