//! Limbs in the own body: which parts can run into each other, and how deep they are.

use std::sync::LazyLock;

use glam::Vec3;

use super::body_part::{BodyPart, SHAPE_COUNT, SHAPES, body_capsules};
use crate::math::capsule::{Capsule, nearest_parts};
use crate::motion::Pose;

/// Whether two parts can be seen to run into each other: neither joined nor held apart by the joints' limits.
fn may_touch(one: BodyPart, other: BodyPart) -> bool {
    use BodyPart::*;
    let (one, other) = if one <= other { (one, other) } else { (other, one) };
    let is_core = |part| matches!(part, Head | Pelvis | Trunk);
    let is_leg = |part| part >= LeftThigh;
    let sides_differ = one.side() != other.side();
    match (one, other) {
        (a, b) if is_core(a) && is_core(b) => false,
        // A thigh is joined to the pelvis and may be drawn up to the chest.
        (a, b) if is_core(a) && is_leg(b) => a == Trunk && matches!(b, LeftThigh | RightThigh),
        (a, _) if is_core(a) => true,
        (LeftUpperArm | RightUpperArm, b) if is_leg(b) => matches!(b, LeftThigh | RightThigh),
        (a, b) if is_leg(a) == is_leg(b) => sides_differ,
        _ => true,
    }
}

/// The pairs of capsules that are looked at.
static PAIRS: LazyLock<Vec<(usize, usize)>> = LazyLock::new(|| {
    let all = (0..SHAPE_COUNT).flat_map(|i| (0..i).map(move |j| (j, i)));
    all.filter(|&(i, j)| may_touch(SHAPES[i].part, SHAPES[j].part)).collect()
});

/// Of these the pairs with an arm, by side: upper arm, forearm, hand in whatever else they may touch.
static ARM_PAIRS: LazyLock<[Vec<(usize, usize)>; 2]> = LazyLock::new(|| {
    [-1, 1].map(|side| {
        let is_arm = |i: usize| SHAPES[i].part.is_arm() && SHAPES[i].part.side() == side;
        PAIRS.iter().copied().filter(|&(i, j)| is_arm(i) || is_arm(j)).collect()
    })
});

/// Of these the pairs of both legs, and of a thigh and the trunk.
static LEG_PAIRS: LazyLock<Vec<(usize, usize)>> = LazyLock::new(|| {
    let is_arm = |i: usize| SHAPES[i].part.is_arm();
    let is_leg = |i: usize| SHAPES[i].part >= BodyPart::LeftThigh;
    PAIRS.iter().copied().filter(|&(i, j)| (is_leg(i) || is_leg(j)) && !is_arm(i) && !is_arm(j)).collect()
});

/// How deep the arm of a side is in the own body, beyond what flesh gives, metres; 0 where it is free.
pub(crate) fn arm_depth(pose: &Pose, side: usize) -> f32 {
    in_one_another(pose, &ARM_PAIRS[side], 0.0).map(|touch| touch.depth).fold(0.0, f32::max)
}

/// How deep any part is in another, beyond what flesh gives, metres; 0 where none is.
pub(crate) fn own_depth(pose: &Pose) -> f32 {
    in_one_another(pose, &PAIRS, 0.0).map(|touch| touch.depth).fold(0.0, f32::max)
}

/// Two capsules in one another.
#[derive(Debug, Clone, Copy)]
pub(crate) struct OwnContact {
    /// Which two of [`SHAPES`].
    pub shapes: [usize; 2],
    /// The parts that they belong to.
    pub parts: [BodyPart; 2],
    /// Beyond what flesh gives, metres.
    pub depth: f32,
    capsules: [Capsule; 2],
}

impl OwnContact {
    /// Where the axes of the two are nearest, world.
    pub(crate) fn places(&self) -> [Vec3; 2] {
        let [one, other] = self.capsules.map(|c| c.ends);
        let (s, t) = nearest_parts(one, other);
        [one[0].lerp(one[1], s), other[0].lerp(other[1], t)]
    }
}

/// The pairs with an arm that are deeper than `deep` metres in one another, beyond what flesh gives; less than nothing is a gap.
pub(crate) fn arm_contacts(pose: &Pose, deep: f32) -> impl Iterator<Item = OwnContact> {
    ARM_PAIRS.iter().enumerate().flat_map(move |(side, pairs)| {
        // A pair of both arms is in both lists.
        in_one_another(pose, pairs, deep).filter(move |touch| {
            side == 0 || !touch.parts.iter().any(|part| part.is_arm() && part.side() < 0)
        })
    })
}

/// The pairs with a leg and without an arm that are deeper than `deep` metres in one another, as in [`arm_contacts`].
pub(crate) fn leg_contacts(pose: &Pose, deep: f32) -> impl Iterator<Item = OwnContact> {
    in_one_another(pose, &LEG_PAIRS, deep)
}

/// The parts of a posed body that are deeper than `deep` metres in one another, beyond what flesh gives, and how deep.
pub(crate) fn touching(pose: &Pose, deep: f32) -> impl Iterator<Item = ([BodyPart; 2], f32)> {
    in_one_another(pose, &PAIRS, deep).map(|touch| (touch.parts, touch.depth))
}

fn in_one_another(
    pose: &Pose,
    pairs: &'static [(usize, usize)],
    deep: f32,
) -> impl Iterator<Item = OwnContact> {
    let capsules = body_capsules(pose);
    // A limb's axis in a box: most limbs hang beside the others, and their boxes are apart.
    let boxes = capsules.map(|(part, c)| {
        let reach = c.radii[0].max(c.radii[1]) - part.gives();
        (c.ends[0].min(c.ends[1]), c.ends[0].max(c.ends[1]), reach)
    });
    pairs.iter().filter_map(move |&(i, j)| {
        let ((low, high, reach), (other_low, other_high, other_reach)) = (boxes[i], boxes[j]);
        let apart = (low - other_high).max(other_low - high).max_element();
        if apart > reach + other_reach - deep {
            return None;
        }
        let ((one, first), (other, second)) = (capsules[i], capsules[j]);
        let depth = first.depth_in(&second) - one.gives() - other.gives();
        let touch = OwnContact { shapes: [i, j], parts: [one, other], depth, capsules: [first, second] };
        (depth > deep).then_some(touch)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_joined_is_not_looked_at() {
        use BodyPart::*;
        for (one, other) in [
            (LeftForearm, LeftUpperArm),
            (LeftThigh, Pelvis),
            (RightHand, RightForearm),
            (LeftFoot, LeftShin),
            (Trunk, Head),
        ] {
            assert!(!may_touch(one, other) && !may_touch(other, one), "{one:?} {other:?}");
        }
        for (one, other) in [
            (LeftForearm, Trunk),
            (LeftHand, RightForearm),
            (LeftHand, LeftThigh),
            (LeftShin, RightShin),
            (LeftUpperArm, Head),
        ] {
            assert!(may_touch(one, other) && may_touch(other, one), "{one:?} {other:?}");
        }
    }
}
