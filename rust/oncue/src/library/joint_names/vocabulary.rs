//! What part of a body the words of a name stand for.

use super::words::{self, Side};

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Role {
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

/// Words before a name that say whose skeleton or what layer of a rig it is.
const PREFIXES: [&str; 12] = [
    "mixamorig",
    "ccbase",
    "bip",
    "character",
    "def",
    "org",
    "valvebipedbip",
    "skel",
    "rig",
    "joint",
    "j",
    "jbip",
];
/// Words after a name that say that it is a joint.
const SUFFIXES: [&str; 6] = ["jnt", "joint", "bone", "bind", "skin", "bend"];

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

/// Side and role of each joint, by its name.
pub(super) fn classify(names: &[&str]) -> Vec<(Side, Option<Role>)> {
    words::of_joints(names).into_iter().map(of_words).collect()
}

fn of_words(mut words: Vec<String>) -> (Side, Option<Role>) {
    // Prefixes may be several words ("cc base"), and follow one another ("Character1 DEF").
    while let Some(count) = (1..=2.min(words.len().saturating_sub(1)))
        .rev()
        .find(|&count| PREFIXES.contains(&words[..count].concat().as_str()))
    {
        words.drain(..count);
    }
    let mut side = Side::Middle;
    words.retain(|word| match words::side(word) {
        Some(found) => {
            side = found;
            false
        }
        None => true,
    });
    // "LHipJoint" is no joint of the leg; "l_hip_jnt" is.
    if role(&words.concat()).is_none() && !words.concat().ends_with("hipjoint") {
        while words.len() > 1 && words.last().is_some_and(|word| SUFFIXES.contains(&word.as_str())) {
            words.pop();
        }
    }
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
        "ankle" | "footankle" => Role::Ankle,
        "foot" | "feet" => Role::Foot,
        "toe" | "toes" | "toebase" | "ball" | "toesbase" | "football" => Role::Toe,
        "collar" | "clavicle" | "collarbone" | "scapula" => Role::Clavicle,
        "shoulder" => Role::Shoulder,
        "arm" | "uparm" | "upperarm" | "uarm" | "shldr" | "humerus" | "armupper" | "armstretch" => {
            Role::UpperArm
        }
        "forearm" | "lowarm" | "lowerarm" | "farm" | "elbow" | "radius" | "armlower" | "forearmstretch" => {
            Role::Forearm
        }
        "wrist" | "handwrist" => Role::Wrist,
        "hand" => Role::Hand,
        "neck" | "lowerneck" | "necklower" | "upperneck" | "necktwist" | "neckbase" => Role::Neck,
        "head" | "skull" => Role::Head,
        _ => return None,
    })
}
