//! Which joint is which by the skeleton's shape alone: two legs alike, above them two arms alike.
//!
//! A limb is a chain of joints that has a twin of the same bones at the joint where both begin. Legs begin at the
//! hips, arms further up; of a limb's bones the two longest in a row are thigh and shin, or upper arm and forearm.
//! Which side is left is told by the knees, which bend backwards, and the toes, which point forward.

use super::{ARM_PAIRS, Index, LEG_PAIRS, ancestors, complete};
use crate::library::body;
use crate::library::mocap_file::{MocapFile, MocapPose};
use crate::motion::skeleton::JOINT_COUNT;

/// Below this a guess is not used, per cent.
const SURE_ENOUGH: u8 = 60;
/// Limbs of which a bone differs by more than this share from its twin are no pair.
const UNLIKE: f32 = 0.25;

/// What the shape says, and how sure it is.
pub(super) struct Found {
    pub index: Index,
    pub percent: u8,
}

/// Two limbs alike.
struct Pair {
    /// Where both begin.
    at: usize,
    /// The joints of each, from `at` outward, as long as both have them.
    limbs: [Vec<usize>; 2],
    /// How alike their bones are, 0 to 1.
    likeness: f32,
    /// From where they begin to their ends, in the file's unit.
    reach: f32,
}

struct Bones {
    children: Vec<Vec<usize>>,
    /// From the parent's joint, in the file's unit.
    length: Vec<f32>,
    /// From the joint to the furthest end below it, along the bones.
    reach: Vec<f32>,
}

impl Bones {
    fn new(file: &MocapFile) -> Self {
        let count = file.joints.len();
        let mut pose = MocapPose::default();
        file.pose_at(0.0, &mut pose);
        let mut children = vec![Vec::new(); count];
        let mut length = vec![0.0; count];
        for (j, joint) in file.joints.iter().enumerate() {
            if let Some(parent) = joint.parent {
                children[parent].push(j);
                length[j] = pose.positions[j].distance(pose.positions[parent]);
            }
        }
        let mut reach: Vec<f32> =
            file.joints.iter().map(|j| j.end_site.map_or(0.0, |end| end.length())).collect();
        for j in (0..count).rev() {
            if let Some(parent) = file.joints[j].parent {
                reach[parent] = reach[parent].max(length[j] + reach[j]);
            }
        }
        Self { children, length, reach }
    }

    /// The joint and those below it on the way to the furthest end.
    fn limb(&self, joint: usize) -> Vec<usize> {
        let furthest = |&j: &usize| {
            let far = |c: &usize| self.length[*c] + self.reach[*c];
            self.children[j].iter().copied().max_by(|a, b| far(a).total_cmp(&far(b)))
        };
        std::iter::successors(Some(joint), furthest).collect()
    }

    /// The pairs of limbs of three joints at least that begin at a joint.
    fn pairs_at(&self, at: usize) -> Vec<Pair> {
        let children = &self.children[at];
        let mut out = Vec::new();
        for (i, &a) in children.iter().enumerate() {
            for &b in &children[i + 1..] {
                let mut limbs = [self.limb(a), self.limb(b)];
                let count = limbs[0].len().min(limbs[1].len());
                if count < 3 || limbs[0].len() != limbs[1].len() {
                    continue;
                }
                limbs.iter_mut().for_each(|limb| limb.truncate(count));
                let bones = |limb: &[usize]| limb.iter().map(|&j| self.length[j]).collect::<Vec<f32>>();
                let (ours, theirs) = (bones(&limbs[0]), bones(&limbs[1]));
                let total: f32 = ours.iter().chain(&theirs).sum();
                let off: f32 = ours.iter().zip(&theirs).map(|(a, b)| (a - b).abs()).sum();
                let unlike =
                    ours.iter().zip(&theirs).any(|(a, b)| (a - b).abs() > UNLIKE * a.max(*b) + 0.01 * total);
                if total <= 0.0 || unlike {
                    continue;
                }
                out.push(Pair { at, limbs, likeness: 1.0 - 2.0 * off / total, reach: total / 2.0 });
            }
        }
        out
    }

    /// Where in a limb the two longest bones in a row begin, and how alike these are, 0 to 1.
    fn upper_bone(&self, limb: &[usize]) -> Option<(usize, f32)> {
        let two = |i: usize| self.length[limb[i + 1]].min(self.length[limb[i + 2]]);
        let i = (0..limb.len().checked_sub(2)?).max_by(|&a, &b| two(a).total_cmp(&two(b)))?;
        let (upper, lower) = (self.length[limb[i + 1]], self.length[limb[i + 2]]);
        (upper.min(lower) > 0.0).then(|| (i, upper.min(lower) / upper.max(lower)))
    }
}

pub(super) fn recognize(file: &MocapFile) -> Option<Found> {
    let bones = Bones::new(file);
    let pairs: Vec<Pair> = (0..file.joints.len()).flat_map(|j| bones.pairs_at(j)).collect();
    let over = |a: &Pair, b: &Pair| a.at != b.at && ancestors(file, b.at).any(|j| j == a.at);
    let apart =
        |a: &Pair, b: &Pair| !a.limbs.iter().flatten().any(|&j| ancestors(file, b.at).any(|k| k == j));
    // The longest legs with the longest arms above them.
    let (legs, arms) = pairs
        .iter()
        .flat_map(|legs| pairs.iter().map(move |arms| (legs, arms)))
        .filter(|(legs, arms)| over(legs, arms) && apart(legs, arms))
        .max_by(|a, b| (a.0.reach + a.1.reach).total_cmp(&(b.0.reach + b.1.reach)))?;

    let mut index: Index = [None; JOINT_COUNT];
    let mut sure = legs.likeness * arms.likeness;
    for (pair, joints) in [(legs, LEG_PAIRS), (arms, ARM_PAIRS)] {
        for (side, limb) in pair.limbs.iter().enumerate() {
            let (upper, alike) = bones.upper_bone(limb)?;
            // Thigh and shin of a person are as long as each other, within a quarter.
            sure *= (alike / 0.75).min(1.0);
            let leg = joints == LEG_PAIRS;
            // A leg's first joint is its thigh; what stands before an upper arm is the collar bone.
            let from = if leg { Some(upper) } else { upper.checked_sub(1) };
            let first = if leg { 0 } else { 1 };
            if !leg {
                index[joints[0][side].index()] = from.map(|i| limb[i]);
            }
            for (k, joint) in joints.iter().skip(first).enumerate() {
                index[joint[side].index()] = limb.get(upper + k).copied();
            }
        }
    }
    let mut table = complete(file, index).ok()?;
    let votes = body::side_votes(file, &table);
    if votes.sum() < 0.0 {
        table.exchange_legs();
    }
    // The better of the two says it: a stiff walk shows its toes, a foot without toes its knees.
    sure *= (votes.knees.abs().max(votes.toes.abs()) / 0.5).min(1.0);
    if votes.knees * votes.toes < 0.0 {
        sure *= 0.5;
    }
    if body::arms_against_legs(file, &table) < 0.0 {
        table.exchange_arms();
    }
    let percent = (100.0 * sure).round() as u8;
    (percent >= SURE_ENOUGH).then_some(Found { index: table.index, percent })
}
