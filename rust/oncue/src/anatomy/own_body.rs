//! Limbs in the own body: which parts can run into each other, and how deep they are.

use std::sync::LazyLock;

use glam::Vec3;

use super::body_part::{BodyCapsules, BodyPart, SHAPE_COUNT, SHAPES, body_capsules};
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
    in_one_another(body_capsules(pose), &ARM_PAIRS[side], 0.0).map(|touch| touch.depth).fold(0.0, f32::max)
}

/// How deep any part is in another, beyond what flesh gives, metres; 0 where none is.
pub(crate) fn own_depth(pose: &Pose) -> f32 {
    in_one_another(body_capsules(pose), &PAIRS, 0.0).map(|touch| touch.depth).fold(0.0, f32::max)
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
    /// Where the axes of the two are nearest: parts (0..=1) of their lengths, and places, world.
    pub(crate) fn nearest(&self) -> [(f32, Vec3); 2] {
        nearest(self.capsules)
    }

    /// Which way the first of the two goes round the second where it goes through it between two frames: across its way, on the side
    /// on which it passes the middle; or, if that is near, on the one where the arm is that has to follow. `None` where it stays on one
    /// side, and nothing but the way back out is asked for.
    pub(crate) fn way_round(&self, before: &BodyCapsules, after: &BodyCapsules) -> Option<Vec3> {
        let from = self.apart_in(before);
        let way = self.apart_in(after) - from;
        if from.dot(from + way) >= 0.0 {
            return None;
        }
        let passes = from - way * (from.dot(way) / way.length_squared());
        let axis = before[self.shapes[1]].1.ends;
        let across = way.cross(axis[1] - axis[0]).normalize_or(Vec3::Z);
        let round = passes.try_normalize().filter(|_| passes.length() > NO_SIDE).unwrap_or(across);
        let leaves_the_arm = passes.length() < MIDDLE && self.side_of_the_arm(before).dot(round) < 0.0;
        Some(if leaves_the_arm { -round } else { round })
    }

    /// From the second to the joint that the first hangs from, if that is of an arm; else from what the second hangs from to the first.
    /// Nothing of trunk, pelvis and head.
    fn side_of_the_arm(&self, body: &BodyCapsules) -> Vec3 {
        let [(_, one), (_, other)] = nearest(self.shapes.map(|shape| body[shape].1));
        let hangs_from = |shape: usize| {
            let before = SHAPES.iter().position(|s| Some(s.part) == SHAPES[shape].part.hangs_from());
            body[before.unwrap_or(shape)].1.ends[0]
        };
        // No arm comes to lie behind what it went into in front.
        if self.parts.into_iter().any(|part| part.side() == 0) {
            return Vec3::ZERO;
        }
        match self.parts.map(BodyPart::is_arm) {
            [true, _] => hangs_from(self.shapes[0]) - other,
            [false, true] => one - hangs_from(self.shapes[1]),
            [false, false] => Vec3::ZERO,
        }
    }

    /// From the axis of the second to that of the first where they are nearest in another frame.
    pub(crate) fn apart_in(&self, body: &BodyCapsules) -> Vec3 {
        let [(_, one), (_, other)] = nearest(self.shapes.map(|shape| body[shape].1));
        one - other
    }
}

/// Nearer than this to the middle of what it goes through a limb may as well pass on the other side, metres, and nearer than that it
/// passes on none.
const MIDDLE: f32 = 0.025;
const NO_SIDE: f32 = 1e-3;

fn nearest([one, other]: [Capsule; 2]) -> [(f32, Vec3); 2] {
    let (one, other) = (one.ends, other.ends);
    let (s, t) = nearest_parts(one, other);
    [(s, one[0].lerp(one[1], s)), (t, other[0].lerp(other[1], t))]
}

/// The pairs with an arm that are deeper than `deep` metres in one another, beyond what flesh gives; less than nothing is a gap.
pub(crate) fn arm_contacts(capsules: BodyCapsules, deep: f32) -> impl Iterator<Item = OwnContact> {
    ARM_PAIRS.iter().enumerate().flat_map(move |(side, pairs)| {
        // A pair of both arms is in both lists.
        in_one_another(capsules, pairs, deep).filter(move |touch| {
            side == 0 || !touch.parts.iter().any(|part| part.is_arm() && part.side() < 0)
        })
    })
}

/// The pairs with a leg and without an arm that are deeper than `deep` metres in one another, as in [`arm_contacts`].
pub(crate) fn leg_contacts(capsules: BodyCapsules, deep: f32) -> impl Iterator<Item = OwnContact> {
    in_one_another(capsules, &LEG_PAIRS, deep)
}

/// The parts of a posed body that are deeper than `deep` metres in one another, beyond what flesh gives, and how deep.
pub(crate) fn touching(pose: &Pose, deep: f32) -> impl Iterator<Item = ([BodyPart; 2], f32)> {
    in_one_another(body_capsules(pose), &PAIRS, deep).map(|touch| (touch.parts, touch.depth))
}

fn in_one_another(
    capsules: BodyCapsules,
    pairs: &'static [(usize, usize)],
    deep: f32,
) -> impl Iterator<Item = OwnContact> {
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
    fn a_limb_goes_round_what_it_goes_through() {
        let rest = body_capsules(&crate::motion::Posture::default().pose());
        let of = |part: BodyPart| SHAPES.iter().position(|shape| shape.part == part).expect("a shape");
        let shapes = [of(BodyPart::LeftHand), of(BodyPart::LeftThigh)];
        // A thigh along Y, and a hand along X beyond it, at `x` and `z` over its axis.
        let body = |x: f32, z: f32| {
            let mut body = rest;
            body[shapes[0]].1.ends = [Vec3::new(x, 0.0, z), Vec3::new(x, 0.01, z)];
            body[shapes[1]].1.ends = [Vec3::Y, Vec3::NEG_Y];
            body[of(BodyPart::LeftForearm)].1.ends[0] = Vec3::Z;
            body
        };
        let round = |from: (f32, f32), to: (f32, f32)| {
            let (before, after) = (body(from.0, from.1), body(to.0, to.1));
            let contact = OwnContact {
                shapes,
                parts: [BodyPart::LeftHand, BodyPart::LeftThigh],
                depth: 0.0,
                capsules: shapes.map(|shape| before[shape].1),
            };
            assert!(contact.apart_in(&after).distance(Vec3::new(to.0, 0.0, to.1)) < 1e-6);
            contact.way_round(&before, &after)
        };
        let over = round((-0.05, 0.03), (0.04, 0.03)).expect("it goes through");
        assert!(over.distance(Vec3::Z) < 1e-4, "{over}");
        let under = round((-0.05, -0.03), (0.04, -0.03)).expect("it goes through");
        assert!(under.distance(Vec3::NEG_Z) < 1e-4, "{under}");
        // Near the middle it goes where its elbow is: above.
        for z in [0.01, 0.0, -0.01] {
            let over = round((-0.05, z), (0.04, z)).expect("it goes through");
            assert!(over.distance(Vec3::Z) < 1e-4, "{z}: {over}");
        }
        // Who lands on a thigh, or passes well over it, goes through nothing.
        assert_eq!(round((0.0, 0.09), (0.0, 0.05)), None);
        assert_eq!(round((-0.05, 0.09), (0.05, 0.09)), None);
    }

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
