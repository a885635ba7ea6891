//! Which bone of any rig is which of our joints, seen in its rest pose.

use std::collections::BTreeMap;

use glam::Vec3;

use super::body;
use super::joint_names::{self, REMEDY};
use super::mocap_file::MocapFile;
use crate::error::{Error, Result};
use crate::motion::{JOINT_COUNT, Joint};

/// A bone of a rig in its rest pose.
#[derive(Debug, Clone, PartialEq)]
pub struct RestBone {
    /// As the rig spells it.
    pub name: String,
    /// Its parent's place in the list, which comes before it.
    pub parent: Option<usize>,
    /// Where it begins and where it ends: metres, +Z up.
    pub head: Vec3,
    /// Its other end.
    pub tail: Vec3,
}

/// Which bones of a rig are our joints.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RestMapping {
    /// The bone of each joint; `None` where the rig has none (spine, collar bones, neck, head, hands, toes may lack).
    pub bones: [Option<usize>; JOINT_COUNT],
    /// The bones between hips and chest, the chest included, from below.
    pub spine: Vec<usize>,
    /// How sure the rig's shape is, per cent, where its names said nothing.
    pub shape_percent: Option<u8>,
    /// What was put right, a sentence without the rig's name.
    pub note: Option<String>,
}

/// Finds our joints among the bones of a rig: by their names, else by the rig's shape; what `mapping` names (ours →
/// theirs) is taken from it.
///
/// # Errors
/// [`Error::Input`] with a sentence that begins with what follows a name ("no bone …", "its legs …").
pub fn map_rest_skeleton(bones: &[RestBone], mapping: &BTreeMap<String, String>) -> Result<RestMapping> {
    let said = |reason: String| {
        let plain = reason.strip_suffix(REMEDY).unwrap_or(&reason).trim_end().to_owned();
        Error::Input(plain)
    };
    for (index, bone) in bones.iter().enumerate() {
        if bone.parent.is_some_and(|parent| parent >= index) {
            return Err(Error::Input(format!("the bone {} comes before its parent.", bone.name)));
        }
        if !(bone.head.is_finite() && bone.tail.is_finite()) {
            return Err(Error::Input(format!(
                "the bone {} lies at a place that is not a number.",
                bone.name
            )));
        }
    }
    if bones.is_empty() {
        return Err(Error::Input("it has no bones.".into()));
    }
    let file = MocapFile::at_rest(bones);
    let mut table = joint_names::recognize(&file, (!mapping.is_empty()).then_some(mapping)).map_err(said)?;
    check_apart(&file, &table.index).map_err(Error::Input)?;
    let note = body::mend_sides(&file, &mut table).map_err(said)?;
    Ok(RestMapping { bones: table.index, spine: table.spine, shape_percent: table.shape_percent, note })
}

/// One bone cannot be two joints; neck and head of a rig that has but one of them are.
fn check_apart(file: &MocapFile, index: &[Option<usize>; JOINT_COUNT]) -> std::result::Result<(), String> {
    for a in Joint::ALL {
        for b in Joint::ALL.into_iter().skip(a.index() + 1) {
            let same = index[a.index()].is_some() && index[a.index()] == index[b.index()];
            if same && !matches!((a, b), (Joint::Neck, Joint::Head)) {
                let bone = index[a.index()].map_or("", |i| file.joints[i].name.as_str());
                return Err(format!("the bone {bone} is named as both {} and {}.", a.name(), b.name()));
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::skeleton::{JOINT_OFFSET, NAMES, PARENT};

    /// Our own skeleton at rest under other names.
    fn rig(names: impl Fn(&str) -> String) -> Vec<RestBone> {
        let mut heads = JOINT_OFFSET;
        for joint in 1..JOINT_COUNT {
            heads[joint] += heads[PARENT[joint]];
        }
        (0..JOINT_COUNT)
            .map(|joint| {
                let child = (0..JOINT_COUNT).find(|&child| PARENT[child] == joint);
                let end = Vec3::new(0.0, if NAMES[joint].ends_with("Toe") { -0.07 } else { 0.0 }, 0.0);
                RestBone {
                    name: names(NAMES[joint]),
                    parent: (joint > 0).then_some(PARENT[joint]),
                    head: heads[joint],
                    tail: child.map_or(heads[joint] + end, |child| heads[child]),
                }
            })
            .collect()
    }

    #[test]
    fn names_and_shape_say_the_same() {
        let named = map_rest_skeleton(&rig(|name| format!("mixamorig:{name}")), &BTreeMap::new()).unwrap();
        assert_eq!(named.shape_percent, None);
        for joint in Joint::ALL {
            // The spine is what lies between hips and chest; its joints have no names of their own.
            if !matches!(joint, Joint::Spine | Joint::Spine1 | Joint::Spine2) {
                assert_eq!(named.bones[joint.index()], Some(joint.index()), "{joint:?}");
            }
        }
        assert_eq!(named.spine, [1, 2, 3]);
        let mut count = 0;
        let counter = std::cell::RefCell::new(&mut count);
        let nameless = rig(|_| {
            **counter.borrow_mut() += 1;
            format!("Bone.{:03}", counter.borrow())
        });
        let shaped = map_rest_skeleton(&nameless, &BTreeMap::new()).unwrap();
        assert!(shaped.shape_percent.is_some());
        assert_eq!(shaped.bones, named.bones);
    }

    #[test]
    fn what_is_no_person_is_said() {
        let of = |bones: &[RestBone], mapping: &[(&str, &str)]| {
            let mapping =
                mapping.iter().map(|&(ours, theirs)| (ours.to_owned(), theirs.to_owned())).collect();
            map_rest_skeleton(bones, &mapping).unwrap_err().to_string()
        };
        assert!(of(&[], &[]).contains("no bones"));
        let one_armed: Vec<RestBone> = rig(str::to_owned).into_iter().take(10).collect();
        assert!(of(&one_armed, &[]).contains("UpLeg"), "{}", of(&one_armed, &[]));
        let twice = of(&rig(str::to_owned), &[("LeftHand", "LeftForeArm")]);
        assert!(twice.contains("both LeftForeArm and LeftHand"), "{twice}");
        assert!(!of(&one_armed, &[]).contains("mapping file"));
    }
}
