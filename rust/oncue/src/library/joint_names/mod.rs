//! Which joint of a mocap file is which of ours: by its name, then by its place in the skeleton.
//!
//! Names are compared tolerantly: letter case, name-spaces (`mixamorig:`), prefixes (`CC_Base_`,
//! `Bip01`) and whatever else most of the names share, separators and digits do not count, and the side may stand
//! before or after (`l_`, `Left`, `.L`). Of several joints whose names fit, the thigh is the one from which the knee
//! hangs. The hips are where the two thighs meet and the chest where the two arms meet, whatever they are
//! called, and the spine is what lies between. Where names fail, the skeleton's shape decides ([`shape`]).

mod limb;
mod shape;
#[cfg(test)]
mod tests;
mod vocabulary;
mod words;

use std::collections::BTreeMap;

use self::limb::Names;
use self::vocabulary::Role;
use self::words::Side;
use super::mocap_file::MocapFile;
use crate::motion::skeleton::{JOINT_COUNT, Joint};

/// Ours → theirs, as a mapping file gives it: `{"LeftUpLeg": "thigh_stretch.l", …}`.
pub(crate) type JointMapping = BTreeMap<String, String>;

/// Index in the file of each of our joints.
type Index = [Option<usize>; JOINT_COUNT];

/// Index in the file of each of our joints, and of the whole spine.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct JointTable {
    /// `None` where the file has no such joint (spine, shoulder, neck, hand, toe may be missing).
    pub index: [Option<usize>; JOINT_COUNT],
    /// The joints between hips and chest, the chest included, from below.
    pub spine: Vec<usize>,
    /// Where the names said nothing: how sure the skeleton's shape is, per cent.
    pub shape_percent: Option<u8>,
}

/// Left and right joint of each pair of the legs, then of the arms.
const LEG_PAIRS: [[Joint; 2]; 4] = [
    [Joint::LeftUpLeg, Joint::RightUpLeg],
    [Joint::LeftLeg, Joint::RightLeg],
    [Joint::LeftFoot, Joint::RightFoot],
    [Joint::LeftToe, Joint::RightToe],
];
const ARM_PAIRS: [[Joint; 2]; 4] = [
    [Joint::LeftShoulder, Joint::RightShoulder],
    [Joint::LeftArm, Joint::RightArm],
    [Joint::LeftForeArm, Joint::RightForeArm],
    [Joint::LeftHand, Joint::RightHand],
];

impl JointTable {
    pub fn get(&self, joint: Joint) -> Option<usize> {
        self.index[joint.index()]
    }

    /// Takes the left leg for the right one.
    pub(crate) fn exchange_legs(&mut self) {
        self.exchange(LEG_PAIRS);
    }

    /// Takes the left arm for the right one.
    pub(crate) fn exchange_arms(&mut self) {
        self.exchange(ARM_PAIRS);
    }

    fn exchange(&mut self, pairs: [[Joint; 2]; 4]) {
        for [left, right] in pairs {
            self.index.swap(left.index(), right.index());
        }
    }
}

/// Without these no motion can be put on our skeleton.
const NEEDED: [Joint; 10] = [
    Joint::LeftUpLeg,
    Joint::LeftLeg,
    Joint::LeftFoot,
    Joint::RightUpLeg,
    Joint::RightLeg,
    Joint::RightFoot,
    Joint::LeftArm,
    Joint::LeftForeArm,
    Joint::RightArm,
    Joint::RightForeArm,
];

/// What one can do about a skeleton that is not understood.
pub(crate) const REMEDY: &str =
    "A mapping file can name them: NAME.oncue.json beside NAME.bvh, see docs/captures.md.";

/// Finds our joints in a file.
///
/// # Errors
/// A sentence naming the joint that is not found, or that the mapping names and the file lacks.
pub fn recognize(file: &MocapFile, mapping: Option<&JointMapping>) -> Result<JointTable, String> {
    let mut index = by_names(file);
    for (ours, theirs) in mapping.into_iter().flatten() {
        index[named(ours)?.index()] = Some(theirs_named(file, theirs)?);
    }
    let told = check_needed(file, &index).and_then(|()| complete(file, index));
    if mapping.is_some() || told.is_ok() {
        return told;
    }
    match shape::recognize(file) {
        Some(found) => complete(file, found.index)
            .map(|table| JointTable { shape_percent: Some(found.percent), ..table }),
        None => told,
    }
}

fn by_names(file: &MocapFile) -> Index {
    let names = Names::new(file);
    let mut index = [None; JOINT_COUNT];
    for (side, column) in [(Side::Left, 0), (Side::Right, 1)] {
        for (pairs, found) in [(LEG_PAIRS, names.leg(side)), (ARM_PAIRS, names.arm(side))] {
            for (pair, found) in pairs.into_iter().zip(found) {
                index[pair[column].index()] = found;
            }
        }
    }
    index[Joint::Neck.index()] = names.find(Side::Middle, Role::Neck);
    index[Joint::Head.index()] = names.find(Side::Middle, Role::Head);
    index
}

/// The joint of ours that a mapping means.
fn named(ours: &str) -> Result<Joint, String> {
    Joint::ALL
        .into_iter()
        .find(|j| j.name().eq_ignore_ascii_case(ours.trim()))
        .ok_or_else(|| format!("the mapping names \"{ours}\", which is none of Oncue's joints."))
}

/// The file's joint that a mapping means.
fn theirs_named(file: &MocapFile, theirs: &str) -> Result<usize, String> {
    let plain = |name: &str| name.rsplit(':').next().unwrap_or(name).trim().to_lowercase();
    file.joints
        .iter()
        .position(|j| j.name.trim() == theirs.trim())
        .or_else(|| file.joints.iter().position(|j| plain(&j.name) == plain(theirs)))
        .ok_or_else(|| format!("the mapping names \"{theirs}\", which the file does not have."))
}

fn check_needed(file: &MocapFile, index: &Index) -> Result<(), String> {
    let Some(joint) = NEEDED.into_iter().find(|joint| index[joint.index()].is_none()) else { return Ok(()) };
    let names: Vec<&str> = file.joints.iter().take(6).map(|j| j.name.as_str()).collect();
    Err(format!(
        "no joint was recognised as {}; its joints are called {}, … {REMEDY}",
        joint.name(),
        names.join(", ")
    ))
}

/// Finds hips, spine and, where they are not named, neck and head; and tests that the legs hang together.
fn complete(file: &MocapFile, mut index: Index) -> Result<JointTable, String> {
    let found = index;
    let at = |joint: Joint| found[joint.index()].unwrap_or_default();
    let hips = match index[Joint::Hips.index()] {
        Some(hips) => hips,
        None => meeting(file, at(Joint::LeftUpLeg), at(Joint::RightUpLeg))
            .ok_or("its legs do not meet in hips.")?,
    };
    index[Joint::Hips.index()] = Some(hips);
    let arms = [at(Joint::LeftArm), at(Joint::RightArm)];
    let chest = meeting(file, arms[0], arms[1]).ok_or("its arms do not meet in a chest.")?;
    // From the chest down to where it meets the hips (which need not be an ancestor of the chest).
    let waist = meeting(file, hips, chest).unwrap_or(hips);
    let mut spine: Vec<usize> = ancestors(file, chest).take_while(|&j| j != waist).collect();
    spine.reverse();
    if spine.is_empty() && chest != hips {
        spine.push(chest);
    }
    // Names such as Spine2 in a mapping stand for the chest.
    for joint in [Joint::Spine, Joint::Spine1, Joint::Spine2] {
        if let Some(named) = index[joint.index()]
            && !spine.contains(&named)
        {
            spine.push(named);
            spine.sort_unstable();
        }
    }
    if index[Joint::Neck.index()].is_none() && index[Joint::Head.index()].is_none() {
        let [neck, head] = limb::neck_and_head(file, chest, arms);
        index[Joint::Neck.index()] = neck;
        index[Joint::Head.index()] = head;
    }
    if index[Joint::Head.index()].is_none() {
        index[Joint::Head.index()] = index[Joint::Neck.index()];
    }
    let table = JointTable { index, spine, shape_percent: None };
    limb::legs_hang_together(file, &table).map_err(|reason| format!("{reason} {REMEDY}"))?;
    Ok(table)
}

/// The joint, its parent, and so on to the root.
fn ancestors(file: &MocapFile, joint: usize) -> impl Iterator<Item = usize> + '_ {
    std::iter::successors(Some(joint), |&j| file.joints[j].parent)
}

/// The lowest joint above both.
fn meeting(file: &MocapFile, a: usize, b: usize) -> Option<usize> {
    ancestors(file, a).find(|&j| ancestors(file, b).any(|k| k == j))
}
