//! The action types of the controller and the labels of the library: all that the rest of the core knows of each.
//!
//! Whoever must tell action types apart asks [`ActionType::spec`], and matches on the kinds named there.

use serde::{Deserialize, Serialize};
use strum::VariantArray;

/// The action types of the controller (LAMA, a^type; section 3.2).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, VariantArray)]
#[serde(rename_all = "snake_case")]
pub enum ActionType {
    /// Locomotion on the feet; no cue asks for it.
    Walk,
    /// Sits down on a seat.
    Sit,
    /// Comes to stand.
    Stop,
}

/// What happens in a stretch of captured motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, VariantArray)]
#[serde(rename_all = "snake_case")]
pub enum ActionLabel {
    /// Locomotion on the feet: any direction, turns included, on the spot too.
    Walk,
    /// Standing, feet planted.
    Idle,
    /// From standing or the last steps down to the seat.
    Sit,
    /// Sitting still.
    SeatedIdle,
    /// From the seat to standing.
    StandUp,
    /// From walking to standing still.
    Stop,
    /// Anything else (run, crouch, lie, carry, jump): kept in the file, not matched.
    Other,
}

/// All that an action type is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ActionSpec {
    /// As it stands in sentences and in the sidebar.
    pub name: &'static str,
    /// Segments of the library whose frames may be entered for it.
    pub entered_in: &'static [ActionLabel],
    /// What o_future tells of a frame (LAMA, section 3.3), and so how the action goes on.
    pub future: FutureKind,
    /// Whether a cue may ask for it.
    pub has_cue: bool,
    /// Where the way to its cue ends.
    pub approach: Approach,
    /// What the height of its cue says: to the search, to the alignment, and where the cue's residual is measured.
    pub height: CueHeight,
    /// What the editor fits once the action is complete.
    pub fit: Fit,
    /// Where an artist moves a cue that was come near to but not met: "move it …".
    pub remedy: &'static str,
}

/// What o_future tells of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FutureKind {
    /// Where the root is 10, 20 and 30 frames later. The action goes on for as long as it is chosen.
    Path,
    /// Where the root is when the action is complete. Once entered, the action is played to its end.
    Completion,
}

/// Where the way to a cue ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Approach {
    /// At the cue's place on the floor.
    Place,
    /// On free floor around the seat under the cue.
    Seat,
}

/// What the height of a cue says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CueHeight {
    /// Nothing: the pelvis ends as high over the floor as a standing person's.
    Standing,
    /// How high the pelvis ends.
    Pelvis,
}

/// What the editor fits once an action is complete.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fit {
    /// Nothing.
    Nothing,
    /// Pelvis, thighs and back to the seat, feet to the floor or their cues.
    Seat,
}

/// How a labelled segment completes its action.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Completion {
    /// It completes nothing.
    Never,
    /// On the segment's frame of completion.
    AtItsFrame,
    /// The same, but the pelvis rests before: from there on a person may still turn on the seat.
    OnceSeated,
}

impl ActionType {
    /// Every action type, in the order of a^type.
    pub const ALL: &'static [ActionType] = Self::VARIANTS;
    /// How many there are.
    pub const COUNT: usize = Self::ALL.len();
    /// How many of them a cue may ask for.
    pub const CUE_COUNT: usize = {
        let (mut count, mut i) = (0, 0);
        while i < Self::COUNT {
            count += Self::ALL[i].spec().has_cue as usize;
            i += 1;
        }
        count
    };
    /// What is played where no other action is entered.
    pub const LOCOMOTION: ActionType = ActionType::Walk;

    /// All that this action type is.
    pub const fn spec(self) -> &'static ActionSpec {
        match self {
            ActionType::Walk => &ActionSpec {
                name: "Walk",
                entered_in: &[ActionLabel::Walk, ActionLabel::Idle, ActionLabel::Stop],
                future: FutureKind::Path,
                has_cue: false,
                approach: Approach::Place,
                height: CueHeight::Standing,
                fit: Fit::Nothing,
                remedy: "a little",
            },
            ActionType::Sit => &ActionSpec {
                name: "Sit",
                entered_in: &[ActionLabel::Sit],
                future: FutureKind::Completion,
                has_cue: true,
                approach: Approach::Seat,
                height: CueHeight::Pelvis,
                fit: Fit::Seat,
                remedy: "nearer the front of the seat",
            },
            ActionType::Stop => &ActionSpec {
                name: "Stop",
                entered_in: &[ActionLabel::Stop],
                future: FutureKind::Completion,
                has_cue: true,
                approach: Approach::Place,
                height: CueHeight::Standing,
                fit: Fit::Nothing,
                remedy: "a little",
            },
        }
    }

    /// Its place in [`ActionType::ALL`] and in a^type.
    pub const fn index(self) -> usize {
        self as usize
    }

    /// Those that a cue may ask for, in the order of a^type.
    pub fn of_cues() -> impl Iterator<Item = ActionType> {
        Self::ALL.iter().copied().filter(|a| a.spec().has_cue)
    }
}

impl ActionLabel {
    /// Every label.
    pub const ALL: &'static [ActionLabel] = Self::VARIANTS;

    /// How a segment of this label completes its action.
    pub const fn completion(self) -> Completion {
        match self {
            ActionLabel::Walk | ActionLabel::Idle | ActionLabel::SeatedIdle | ActionLabel::Other => {
                Completion::Never
            }
            ActionLabel::StandUp | ActionLabel::Stop => Completion::AtItsFrame,
            ActionLabel::Sit => Completion::OnceSeated,
        }
    }

    /// Whether its motion is matched; else the library only keeps it.
    pub const fn is_matched(self) -> bool {
        !matches!(self, ActionLabel::Other)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_order_of_the_types_is_that_of_their_indices() {
        for (index, action_type) in ActionType::ALL.iter().enumerate() {
            assert_eq!(action_type.index(), index);
        }
        assert_eq!(ActionType::of_cues().count(), ActionType::CUE_COUNT);
        assert!(!ActionType::LOCOMOTION.spec().has_cue);
    }

    #[test]
    fn what_is_played_to_its_end_is_entered_in_segments_that_end() {
        for action_type in ActionType::ALL {
            let spec = action_type.spec();
            let ends = |label: &ActionLabel| label.completion() != Completion::Never;
            match spec.future {
                FutureKind::Completion => assert!(spec.entered_in.iter().all(ends), "{}", spec.name),
                FutureKind::Path => assert!(!spec.has_cue, "a cue waits for an end"),
            }
            assert!(spec.entered_in.iter().all(|label| label.is_matched()), "{}", spec.name);
        }
    }
}
