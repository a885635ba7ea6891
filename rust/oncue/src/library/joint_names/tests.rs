//! Every system's names, and skeletons without any.

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
    type System =
        (&'static str, &'static str, [&'static str; 2], &'static str, [&'static str; 8], [&'static str; 2]);
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
