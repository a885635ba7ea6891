//! Which joint of a mocap file is which of ours: by its name, then by its place in the skeleton.
//!
//! Names are compared tolerantly: letter case, name-spaces (`mixamorig:`), prefixes (`CC_Base_`,
//! `Bip01`), separators and digits do not count, and the side may stand before or after (`l_`, `Left`,
//! `.L`). The hips are where the two thighs meet and the chest where the two arms meet, whatever they are
//! called, and the spine is what lies between.

use std::collections::BTreeMap;

use super::mocap_file::MocapFile;
use crate::motion::skeleton::{JOINT_COUNT, Joint};

/// Ours → theirs, as a mapping file gives it: `{"LeftUpLeg": "thigh_stretch.l", …}`.
pub(crate) type JointMapping = BTreeMap<String, String>;

/// Index in the file of each of our joints, and of the whole spine.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct JointTable {
    /// `None` where the file has no such joint (spine, shoulder, neck, hand, toe may be missing).
    pub index: [Option<usize>; JOINT_COUNT],
    /// The joints between hips and chest, the chest included, from below.
    pub spine: Vec<usize>,
}

impl JointTable {
    pub fn get(&self, joint: Joint) -> Option<usize> {
        self.index[joint.index()]
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Side {
    Left,
    Right,
    Middle,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Role {
    Thigh,
    Shin,
    Ankle,
    Foot,
    Toe,
    Clavicle,
    Shoulder,
    UpperArm,
    Forearm,
    Wrist,
    Hand,
    Neck,
    Head,
}

const PREFIXES: [&str; 10] =
    ["mixamorig", "ccbase", "bip", "character", "def", "valvebipedbip", "skel", "rig", "joint", "j"];

/// Joints that help a mesh bend, carry a face or a finger, or end a bone: never one of ours.
const HELPERS: [&str; 24] = [
    "twist",
    "share",
    "finger",
    "thumb",
    "index",
    "middle",
    "ring",
    "pinky",
    "nub",
    "eye",
    "jaw",
    "breast",
    "helper",
    "pole",
    "roll",
    "metacarpal",
    "hipjoint",
    "tongue",
    "teeth",
    "facial",
    "bigtoe",
    "ribs",
    "weapon",
    "prop",
];

/// The words of a name, lower-case, without name-space, digits and known prefixes.
fn words(name: &str) -> Vec<String> {
    let name = name.rsplit([':', '|']).next().unwrap_or(name);
    let mut words: Vec<String> = vec![String::new()];
    let mut last_lower = false;
    let chars: Vec<char> = name.chars().collect();
    for (i, &c) in chars.iter().enumerate() {
        let next_lower = chars.get(i + 1).is_some_and(|n| n.is_lowercase());
        let last_upper = i > 0 && chars[i - 1].is_uppercase();
        if !c.is_alphabetic() {
            words.push(String::new());
        } else {
            // "LeftUpLeg" → left up leg, "LHipJoint" → l hip joint.
            if c.is_uppercase() && (last_lower || (last_upper && next_lower)) {
                words.push(String::new());
            }
            if let Some(word) = words.last_mut() {
                word.extend(c.to_lowercase());
            }
        }
        last_lower = c.is_lowercase();
    }
    words.retain(|w| !w.is_empty());
    words
}

fn classify(name: &str) -> (Side, Option<Role>) {
    let mut words = words(name);
    // Prefixes may be several words ("cc base"): drop leading words while they spell one.
    for count in (1..=2.min(words.len().saturating_sub(1))).rev() {
        if PREFIXES.contains(&words[..count].concat().as_str()) {
            words.drain(..count);
            break;
        }
    }
    let mut side = Side::Middle;
    words.retain(|w| {
        let found = match w.as_str() {
            "left" | "l" | "lft" | "lf" => Side::Left,
            "right" | "r" | "rgt" | "rt" => Side::Right,
            _ => return true,
        };
        side = found;
        false
    });
    let mut joined = words.concat();
    if side == Side::Middle {
        // Run together in lower case: "leftupleg", "lthigh", "rfemur", "thighl".
        for (prefix, found) in
            [("left", Side::Left), ("right", Side::Right), ("l", Side::Left), ("r", Side::Right)]
        {
            let rest = joined.strip_prefix(prefix).or_else(|| joined.strip_suffix(prefix));
            if let Some(rest) = rest
                && role(rest).is_some_and(|r| !matches!(r, Role::Neck | Role::Head))
                && role(&joined).is_none()
            {
                side = found;
                joined = rest.to_owned();
                break;
            }
        }
    }
    (side, role(&joined))
}

fn role(word: &str) -> Option<Role> {
    let neck = matches!(word, "necktwist");
    if !neck && (HELPERS.iter().any(|h| word.contains(h)) || word == "end" || word.ends_with("end")) {
        return None;
    }
    Some(match word {
        "upleg" | "upperleg" | "thigh" | "hip" | "femur" | "legupper" | "thighstretch" | "buttock" => {
            Role::Thigh
        }
        "leg" | "lowleg" | "lowerleg" | "shin" | "calf" | "knee" | "tibia" | "leglower" | "legstretch" => {
            Role::Shin
        }
        "ankle" => Role::Ankle,
        "foot" | "feet" => Role::Foot,
        "toe" | "toes" | "toebase" | "ball" | "toesbase" => Role::Toe,
        "collar" | "clavicle" | "collarbone" | "scapula" => Role::Clavicle,
        "shoulder" => Role::Shoulder,
        "arm" | "uparm" | "upperarm" | "shldr" | "humerus" | "armupper" | "armstretch" => Role::UpperArm,
        "forearm" | "lowarm" | "lowerarm" | "elbow" | "radius" | "armlower" | "forearmstretch" => {
            Role::Forearm
        }
        "wrist" => Role::Wrist,
        "hand" => Role::Hand,
        "neck" | "lowerneck" | "upperneck" | "necktwist" | "neckbase" => Role::Neck,
        "head" | "skull" => Role::Head,
        _ => return None,
    })
}

/// Finds our joints in a file.
///
/// # Errors
/// A sentence naming the joint that is not found, or that the mapping names and the file lacks.
pub fn recognize(file: &MocapFile, mapping: Option<&JointMapping>) -> Result<JointTable, String> {
    let kinds: Vec<_> = file.joints.iter().map(|j| classify(&j.name)).collect();
    let find = |side: Side, role: Role| kinds.iter().position(|&k| k == (side, Some(role)));
    let mut index = [None; JOINT_COUNT];
    let mut set = |joint: Joint, found: Option<usize>| index[joint.index()] = found;
    for (side, leg, arm) in [
        (
            Side::Left,
            [Joint::LeftUpLeg, Joint::LeftLeg, Joint::LeftFoot, Joint::LeftToe],
            [Joint::LeftShoulder, Joint::LeftArm, Joint::LeftForeArm, Joint::LeftHand],
        ),
        (
            Side::Right,
            [Joint::RightUpLeg, Joint::RightLeg, Joint::RightFoot, Joint::RightToe],
            [Joint::RightShoulder, Joint::RightArm, Joint::RightForeArm, Joint::RightHand],
        ),
    ] {
        set(leg[0], find(side, Role::Thigh));
        set(leg[1], find(side, Role::Shin));
        // Ankle and foot: the foot is the ball. One of them alone: it is the ankle.
        match (find(side, Role::Ankle), find(side, Role::Foot), find(side, Role::Toe)) {
            (Some(ankle), Some(foot), None) => {
                set(leg[2], Some(ankle));
                set(leg[3], Some(foot));
            }
            (ankle, foot, toe) => {
                set(leg[2], ankle.or(foot));
                set(leg[3], toe);
            }
        }
        // "Shoulder" is the collar bone where there is an upper arm, and the upper arm where there is a collar.
        let (collar, shoulder, upper) =
            (find(side, Role::Clavicle), find(side, Role::Shoulder), find(side, Role::UpperArm));
        match (collar, shoulder, upper) {
            (collar, shoulder, Some(upper)) => {
                set(arm[0], collar.or(shoulder));
                set(arm[1], Some(upper));
            }
            (collar, shoulder, None) => {
                set(arm[0], collar);
                set(arm[1], shoulder);
            }
        }
        set(arm[2], find(side, Role::Forearm));
        set(arm[3], find(side, Role::Wrist).or(find(side, Role::Hand)));
    }
    set(Joint::Neck, find(Side::Middle, Role::Neck));
    set(Joint::Head, find(Side::Middle, Role::Head));

    for (ours, theirs) in mapping.into_iter().flatten() {
        let joint = Joint::ALL
            .into_iter()
            .find(|j| j.name().eq_ignore_ascii_case(ours.trim()))
            .ok_or_else(|| format!("the mapping names \"{ours}\", which is none of Oncue's joints."))?;
        let plain = |name: &str| name.rsplit(':').next().unwrap_or(name).trim().to_lowercase();
        let found = file
            .joints
            .iter()
            .position(|j| j.name.trim() == theirs.trim())
            .or_else(|| file.joints.iter().position(|j| plain(&j.name) == plain(theirs)))
            .ok_or_else(|| format!("the mapping names \"{theirs}\", which the file does not have."))?;
        index[joint.index()] = Some(found);
    }

    for joint in [
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
    ] {
        if index[joint.index()].is_none() {
            let names: Vec<&str> = file.joints.iter().take(6).map(|j| j.name.as_str()).collect();
            return Err(format!(
                "no joint was recognised as {}; its joints are called {}, … A mapping file can name them.",
                joint.name(),
                names.join(", ")
            ));
        }
    }
    let found = index;
    let at = |joint: Joint| found[joint.index()].unwrap_or_default();
    let hips = match index[Joint::Hips.index()] {
        Some(hips) => hips,
        None => meeting(file, at(Joint::LeftUpLeg), at(Joint::RightUpLeg))
            .ok_or("its legs do not meet in hips.")?,
    };
    index[Joint::Hips.index()] = Some(hips);
    let chest =
        meeting(file, at(Joint::LeftArm), at(Joint::RightArm)).ok_or("its arms do not meet in a chest.")?;
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
    if index[Joint::Head.index()].is_none() {
        index[Joint::Head.index()] = index[Joint::Neck.index()];
    }
    let legs = [
        Joint::LeftUpLeg,
        Joint::LeftLeg,
        Joint::LeftFoot,
        Joint::RightUpLeg,
        Joint::RightLeg,
        Joint::RightFoot,
    ];
    for pair in [[0, 1], [1, 2], [3, 4], [4, 5]] {
        if !ancestors(file, at(legs[pair[1]])).any(|j| j == at(legs[pair[0]])) {
            return Err(format!(
                "\"{}\" does not hang from \"{}\", so its leg was not understood. A mapping file can name the joints.",
                file.joints[at(legs[pair[1]])].name,
                file.joints[at(legs[pair[0]])].name
            ));
        }
    }
    Ok(JointTable { index, spine })
}

/// The joint, its parent, and so on to the root.
fn ancestors(file: &MocapFile, joint: usize) -> impl Iterator<Item = usize> + '_ {
    std::iter::successors(Some(joint), |&j| file.joints[j].parent)
}

/// The lowest joint above both.
fn meeting(file: &MocapFile, a: usize, b: usize) -> Option<usize> {
    ancestors(file, a).find(|&j| ancestors(file, b).any(|k| k == j))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::library::mocap_file::parse;

    /// A `.bvh` of two still frames from (depth, name) rows.
    fn skeleton(rows: &[(usize, &str)]) -> MocapFile {
        let mut text = String::from("HIERARCHY\n");
        let mut depth = 0;
        for (i, (d, name)) in rows.iter().enumerate() {
            for _ in *d..depth {
                text.push_str("}\n");
            }
            depth = d + 1;
            let keyword = if i == 0 { "ROOT" } else { "JOINT" };
            text.push_str(&format!(
                "{keyword} {name}\n{{\nOFFSET 0 1 0\nCHANNELS 3 Zrotation Xrotation Yrotation\n"
            ));
        }
        text.push_str(&"}\n".repeat(depth));
        let row = vec!["0"; rows.len() * 3].join(" ");
        text.push_str(&format!("MOTION\nFrames: 2\nFrame Time: 0.0333\n{row}\n{row}\n"));
        parse(text.as_bytes()).unwrap()
    }

    /// Legs, then spine of two, arms and head, in a system's own names: thigh shin foot toe, collar arm forearm hand.
    fn body(
        hips: &str,
        spine: [&str; 2],
        neck: &str,
        head: &str,
        left: [&str; 8],
        right: [&str; 8],
    ) -> MocapFile {
        let mut rows = vec![(0, hips)];
        for side in [left, right] {
            rows.extend(side[..4].iter().enumerate().map(|(i, n)| (1 + i, *n)));
        }
        rows.extend([(1, spine[0]), (2, spine[1])]);
        for side in [left, right] {
            rows.extend(side[4..].iter().enumerate().map(|(i, n)| (3 + i, *n)));
        }
        rows.extend([(3, neck), (4, head)]);
        skeleton(&rows)
    }

    fn sides(pattern: [&str; 8], left: &str, right: &str) -> ([String; 8], [String; 8]) {
        (pattern.map(|p| p.replace('*', left)), pattern.map(|p| p.replace('*', right)))
    }

    #[test]
    fn the_systems_names_are_recognised() {
        /// System, hips, spine, neck, the limbs' names with `*` for the side, the sides.
        type System = (
            &'static str,
            &'static str,
            [&'static str; 2],
            &'static str,
            [&'static str; 8],
            [&'static str; 2],
        );
        let systems: [System; 12] = [
            (
                "lafan1",
                "Hips",
                ["Spine", "Spine1"],
                "Neck",
                ["*UpLeg", "*Leg", "*Foot", "*Toe", "*Shoulder", "*Arm", "*ForeArm", "*Hand"],
                ["Left", "Right"],
            ),
            (
                "mixamo",
                "mixamorig:Hips",
                ["mixamorig:Spine", "mixamorig:Spine1"],
                "mixamorig:Neck",
                [
                    "mixamorig:*UpLeg",
                    "mixamorig:*Leg",
                    "mixamorig:*Foot",
                    "mixamorig:*ToeBase",
                    "mixamorig:*Shoulder",
                    "mixamorig:*Arm",
                    "mixamorig:*ForeArm",
                    "mixamorig:*Hand",
                ],
                ["Left", "Right"],
            ),
            (
                "mixamo through Blender",
                "mixamorig1_Hips",
                ["mixamorig1_Spine", "mixamorig1_Spine1"],
                "mixamorig1_Neck",
                [
                    "mixamorig1_*UpLeg",
                    "mixamorig1_*Leg",
                    "mixamorig1_*Foot",
                    "mixamorig1_*ToeBase",
                    "mixamorig1_*Shoulder",
                    "mixamorig1_*Arm",
                    "mixamorig1_*ForeArm",
                    "mixamorig1_*Hand",
                ],
                ["Left", "Right"],
            ),
            (
                "xsens",
                "Hips",
                ["Chest", "Chest2"],
                "Neck",
                ["*Hip", "*Knee", "*Ankle", "*Toe", "*Collar", "*Shoulder", "*Elbow", "*Wrist"],
                ["Left", "Right"],
            ),
            (
                "xsens segments",
                "Pelvis",
                ["L5", "T8"],
                "Neck",
                ["*UpperLeg", "*LowerLeg", "*Foot", "*Toe", "*Shoulder", "*UpperArm", "*ForeArm", "*Hand"],
                ["Left", "Right"],
            ),
            (
                "rokoko",
                "Hips",
                ["Spine", "Spine1"],
                "Neck",
                ["*Thigh", "*Shin", "*Foot", "*Toe", "*Shoulder", "*Arm", "*ForeArm", "*Hand"],
                ["Left", "Right"],
            ),
            (
                "bandai",
                "Hips",
                ["Spine", "Chest"],
                "Neck",
                [
                    "UpperLeg_*",
                    "LowerLeg_*",
                    "Foot_*",
                    "Toes_*",
                    "Shoulder_*",
                    "UpperArm_*",
                    "LowerArm_*",
                    "Hand_*",
                ],
                ["L", "R"],
            ),
            (
                "smpl",
                "Pelvis",
                ["Spine1", "Spine2"],
                "Neck",
                ["*_Hip", "*_Knee", "*_Ankle", "*_Foot", "*_Collar", "*_Shoulder", "*_Elbow", "*_Wrist"],
                ["L", "R"],
            ),
            (
                "rigify",
                "hips",
                ["spine.001", "spine.002"],
                "neck",
                ["thigh.*", "shin.*", "foot.*", "toe.*", "shoulder.*", "upper_arm.*", "forearm.*", "hand.*"],
                ["L", "R"],
            ),
            (
                "acclaim",
                "root",
                ["lowerback", "thorax"],
                "upperneck",
                ["*femur", "*tibia", "*foot", "*toes", "*clavicle", "*humerus", "*radius", "*wrist"],
                ["l", "r"],
            ),
            (
                "biped",
                "Bip01 Pelvis",
                ["Bip01 Spine", "Bip01 Spine1"],
                "Bip01 Neck",
                [
                    "Bip01 * Thigh",
                    "Bip01 * Calf",
                    "Bip01 * Foot",
                    "Bip01 * Toe0",
                    "Bip01 * Clavicle",
                    "Bip01 * UpperArm",
                    "Bip01 * Forearm",
                    "Bip01 * Hand",
                ],
                ["L", "R"],
            ),
            (
                "poser",
                "hip",
                ["abdomen", "chest"],
                "neck",
                ["*Thigh", "*Shin", "*Foot", "*Toe", "*Collar", "*Shldr", "*ForeArm", "*Hand"],
                ["l", "r"],
            ),
        ];
        for (system, hips, spine, neck, pattern, [l, r]) in systems {
            let (left, right) = sides(pattern, l, r);
            let head = neck.replace("upperneck", "head").replace("Neck", "Head").replace("neck", "head");
            let file = body(
                hips,
                spine,
                neck,
                &head,
                left.each_ref().map(|s| s.as_str()),
                right.each_ref().map(|s| s.as_str()),
            );
            let table = recognize(&file, None).unwrap_or_else(|e| panic!("{system}: {e}"));
            use Joint::*;
            let expected = [
                (Hips, 0),
                (LeftUpLeg, 1),
                (LeftLeg, 2),
                (LeftFoot, 3),
                (LeftToe, 4),
                (RightUpLeg, 5),
                (RightLeg, 6),
                (RightFoot, 7),
                (RightToe, 8),
                (LeftShoulder, 11),
                (LeftArm, 12),
                (LeftForeArm, 13),
                (LeftHand, 14),
                (RightShoulder, 15),
                (RightArm, 16),
                (RightForeArm, 17),
                (RightHand, 18),
                (Neck, 19),
                (Head, 20),
            ];
            for (joint, index) in expected {
                assert_eq!(table.get(joint), Some(index), "{system} {joint:?}");
            }
            assert_eq!(table.spine, [9, 10], "{system}");
        }
    }

    #[test]
    fn a_mapping_names_the_rest() {
        let left = ["a1", "a2", "a3", "a4", "a5", "a6", "a7", "a8"];
        let right = ["b1", "b2", "b3", "b4", "b5", "b6", "b7", "b8"];
        let file = body("x", ["y", "z"], "n", "h", left, right);
        let reason = recognize(&file, None).unwrap_err();
        assert!(reason.contains("LeftUpLeg") && reason.contains("mapping"), "{reason}");
        let ours = ["UpLeg", "Leg", "Foot", "Toe", "Shoulder", "Arm", "ForeArm", "Hand"];
        let mut mapping = JointMapping::new();
        for (i, name) in ours.iter().enumerate() {
            mapping.insert(format!("Left{name}"), left[i].into());
            mapping.insert(format!("Right{name}"), right[i].into());
        }
        let table = recognize(&file, Some(&mapping)).unwrap();
        assert_eq!(table.get(Joint::RightHand), Some(18));
        assert_eq!(table.get(Joint::Hips), Some(0));
        mapping.insert("LeftHand".into(), "gone".into());
        assert!(recognize(&file, Some(&mapping)).unwrap_err().contains("gone"));
    }
}
