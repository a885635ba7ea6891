//! Which of the joints whose names fit are the limb: those from which the next one hangs.

use super::vocabulary::Role;
use super::words::Side;
use super::{JointTable, ancestors};
use crate::library::mocap_file::{MocapFile, MocapPose};

/// A joint above the thigh is a half of it (`ThighBend` over `ThighTwist`), not a buttock, where it is in line with
/// what follows, within this many radians …
const IN_LINE: f32 = 0.35;
/// … and makes up at least this share of the way to the knee.
const HALF: f32 = 0.25;
/// A joint that is this much nearer to its parent than that to its own begins where its parent does.
const NO_BONE: f32 = 0.02;

pub(super) struct Names<'a> {
    pub file: &'a MocapFile,
    pub kinds: Vec<(Side, Option<Role>)>,
    /// Where the joints are in the first frame, in the file's axes.
    pose: MocapPose,
}

impl<'a> Names<'a> {
    pub(super) fn new(file: &'a MocapFile) -> Self {
        let names: Vec<&str> = file.joints.iter().map(|j| j.name.as_str()).collect();
        let mut pose = MocapPose::default();
        file.pose_at(0.0, &mut pose);
        Self { file, kinds: super::vocabulary::classify(&names), pose }
    }

    fn all(&self, side: Side, role: Role) -> impl Iterator<Item = usize> + '_ {
        (0..self.kinds.len()).filter(move |&j| self.kinds[j] == (side, Some(role)))
    }

    pub(super) fn find(&self, side: Side, role: Role) -> Option<usize> {
        self.all(side, role).next()
    }

    /// The first joint of a role from which `below` hangs; the first of all where it hangs from none.
    fn above(&self, side: Side, role: Role, below: Option<usize>) -> Option<usize> {
        let over = below.and_then(|below| {
            self.all(side, role).find(|&j| j != below && ancestors(self.file, below).any(|a| a == j))
        });
        over.or_else(|| self.find(side, role))
    }

    /// Thigh, shin, foot and toe.
    pub(super) fn leg(&self, side: Side) -> [Option<usize>; 4] {
        // Ankle and foot: the foot is the ball. One of them alone: it is the ankle.
        let (ankle, toe) =
            match (self.find(side, Role::Ankle), self.find(side, Role::Foot), self.find(side, Role::Toe)) {
                (Some(ankle), Some(foot), None) => (Some(ankle), Some(foot)),
                (ankle, foot, toe) => (ankle.or(foot), toe),
            };
        let [thigh, shin] = self.thigh_and_shin(side, ankle);
        [thigh, shin, ankle, toe]
    }

    fn thigh_and_shin(&self, side: Side, ankle: Option<usize>) -> [Option<usize>; 2] {
        let role = |j: usize| match self.kinds[j] {
            (s, Some(role)) if s == side => Some(role),
            _ => None,
        };
        let mut above: Vec<usize> =
            ankle.map(|ankle| ancestors(self.file, ankle).skip(1).collect()).unwrap_or_default();
        above.reverse();
        above.retain(|&j| matches!(role(j), Some(Role::Thigh | Role::Shin)));
        let Some(first) = above.iter().position(|&j| role(j) == Some(Role::Thigh)) else {
            return match above[..] {
                // "LeftLeg" over "LeftShin": what the knee hangs from is the thigh.
                [thigh, shin, ..] if self.find(side, Role::Thigh).is_none() => [Some(thigh), Some(shin)],
                _ => [self.find(side, Role::Thigh), self.find(side, Role::Shin)],
            };
        };
        match (first..above.len()).find(|&i| role(above[i]) == Some(Role::Shin)) {
            Some(shin) => {
                let mut thighs = above[first..=shin].to_vec();
                while let [thigh, next, .., knee] = thighs[..]
                    && !self.is_half(thigh, next, knee)
                {
                    thighs.remove(0);
                }
                [thighs.first().copied(), Some(above[shin])]
            }
            None => [Some(above[first]), self.find(side, Role::Shin)],
        }
    }

    /// Whether `joint` is the upper part of the bone that ends at `end`, and `next` the lower.
    fn is_half(&self, joint: usize, next: usize, end: usize) -> bool {
        let at = |j: usize| self.pose.positions[j];
        let (upper, lower) = (at(next) - at(joint), at(end) - at(next));
        upper.length() >= HALF * (upper.length() + lower.length())
            && lower.length() > 0.0
            && upper.angle_between(lower) < IN_LINE
    }

    /// Collar bone, upper arm, forearm and hand.
    pub(super) fn arm(&self, side: Side) -> [Option<usize>; 4] {
        let hand = self.find(side, Role::Wrist).or(self.find(side, Role::Hand));
        let forearm = self.above(side, Role::Forearm, hand);
        // "Shoulder" is the collar bone where there is an upper arm, and the upper arm where there is a collar.
        let upper = self.all(side, Role::UpperArm).next().and(self.above(side, Role::UpperArm, forearm));
        let shoulder = self.above(side, Role::Shoulder, upper.or(forearm));
        let collar = self.above(side, Role::Clavicle, upper.or(forearm));
        match upper {
            Some(upper) => [collar.or(shoulder), Some(upper), forearm, hand],
            None => [collar, shoulder, forearm, hand],
        }
    }
}

/// Neck and head of a skeleton that names neither: the longest straight line of joints that rises from where the arms
/// meet, and carries none.
pub(super) fn neck_and_head(file: &MocapFile, chest: usize, arms: [usize; 2]) -> [Option<usize>; 2] {
    let children =
        |joint: usize| (0..file.joints.len()).filter(move |&j| file.joints[j].parent == Some(joint));
    let line = |joint: usize| {
        let only = |&j: &usize| {
            let mut below = children(j);
            below.next().filter(|_| below.next().is_none())
        };
        let mut line = std::iter::successors(Some(joint), only).collect::<Vec<usize>>();
        // What begins where its parent does is no further part of the neck but something in the head, a face.
        let length = |j: usize| file.joints[j].offset.length();
        while let [.., before, last] = line[..]
            && length(last) <= NO_BONE * length(before)
        {
            line.pop();
        }
        line
    };
    let carries = |joint: usize| arms.iter().any(|&arm| ancestors(file, arm).any(|j| j == joint));
    let longest =
        children(chest).filter(|&j| !carries(j)).map(line).max_by_key(|l| (l.len(), usize::MAX - l[0]));
    match longest.as_deref() {
        Some([neck, .., head]) => [Some(*neck), Some(*head)],
        Some([head]) => [Some(*head), Some(*head)],
        _ => [None, None],
    }
}

/// Whether a table's legs hang together, with a sentence where they do not.
pub(super) fn legs_hang_together(file: &MocapFile, table: &JointTable) -> Result<(), String> {
    use crate::motion::Joint::*;
    for [upper, lower] in
        [[LeftUpLeg, LeftLeg], [LeftLeg, LeftFoot], [RightUpLeg, RightLeg], [RightLeg, RightFoot]]
    {
        let at = |joint| table.get(joint).unwrap_or_default();
        if at(lower) == at(upper) || !ancestors(file, at(lower)).any(|j| j == at(upper)) {
            return Err(format!(
                "\"{}\" does not hang from \"{}\", so its leg was not understood.",
                file.joints[at(lower)].name,
                file.joints[at(upper)].name
            ));
        }
    }
    Ok(())
}
