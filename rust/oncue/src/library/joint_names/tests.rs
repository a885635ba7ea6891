//! Every system's names, and skeletons without any.

use super::*;
use crate::library::mocap_file::parse;

/// A `.bvh` of two still frames from (depth, name) rows; every bone goes up by one.
fn skeleton(rows: &[(usize, &str)]) -> MocapFile {
    let rows: Vec<_> = rows.iter().map(|&(depth, name)| (depth, name, [0.0, 1.0, 0.0])).collect();
    skeleton_of(&rows)
}

/// A `.bvh` of two still frames from (depth, name, offset) rows.
fn skeleton_of(rows: &[(usize, &str, [f32; 3])]) -> MocapFile {
    let mut text = String::from("HIERARCHY\n");
    let mut depth = 0;
    for (i, (d, name, [x, y, z])) in rows.iter().enumerate() {
        for _ in *d..depth {
            text.push_str("}\n");
        }
        depth = d + 1;
        let keyword = if i == 0 { "ROOT" } else { "JOINT" };
        text.push_str(&format!(
            "{keyword} {name}\n{{\nOFFSET {x} {y} {z}\nCHANNELS 3 Zrotation Xrotation Yrotation\n"
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
    let systems: [System; 31] = [
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
        (
            "one more prefix",
            "Model_Hips",
            ["Model_Spine", "Model_Spine1"],
            "Model_Neck",
            [
                "Model_*UpLeg",
                "Model_*Leg",
                "Model_*Foot",
                "Model_*Toe",
                "Model_*Shoulder",
                "Model_*Arm",
                "Model_*ForeArm",
                "Model_*Hand",
            ],
            ["Left", "Right"],
        ),
        (
            "one more suffix",
            "Hips_jnt",
            ["Spine_jnt", "Spine1_jnt"],
            "Neck_jnt",
            [
                "*UpLeg_jnt",
                "*Leg_jnt",
                "*Foot_jnt",
                "*Toe_jnt",
                "*Shoulder_jnt",
                "*Arm_jnt",
                "*ForeArm_jnt",
                "*Hand_jnt",
            ],
            ["Left", "Right"],
        ),
        (
            "a prefix without a separator",
            "herohips",
            ["herospine", "herospine1"],
            "heroneck",
            [
                "hero*upleg",
                "hero*leg",
                "hero*foot",
                "hero*toe",
                "hero*shoulder",
                "hero*arm",
                "hero*forearm",
                "hero*hand",
            ],
            ["left", "right"],
        ),
        (
            "an armature's path",
            "Armature|Hips",
            ["Armature|Spine", "Armature|Spine1"],
            "Armature|Neck",
            [
                "Armature|*UpLeg",
                "Armature|*Leg",
                "Armature|*Foot",
                "Armature|*Toe",
                "Armature|*Shoulder",
                "Armature|*Arm",
                "Armature|*ForeArm",
                "Armature|*Hand",
            ],
            ["Left", "Right"],
        ),
        (
            "numbered characters",
            "Character1_Hips",
            ["Character1_Spine", "Character1_Spine1"],
            "Character1_Neck",
            [
                "Character1_*UpLeg",
                "Character1_*Leg",
                "Character1_*Foot",
                "Character1_*ToeBase",
                "Character1_*Shoulder",
                "Character1_*Arm",
                "Character1_*ForeArm",
                "Character1_*Hand",
            ],
            ["Left", "Right"],
        ),
        (
            "soma",
            "Hips",
            ["Spine1", "Chest"],
            "Neck1",
            ["*Leg", "*Shin", "*Foot", "*ToeBase", "*Shoulder", "*Arm", "*ForeArm", "*Hand"],
            ["Left", "Right"],
        ),
        (
            "motive",
            "Hip",
            ["Ab", "Chest"],
            "Neck",
            ["*Thigh", "*Shin", "*Foot", "*Toe", "*Shoulder", "*UArm", "*FArm", "*Hand"],
            ["L", "R"],
        ),
        (
            "vrm",
            "hips",
            ["spine", "chest"],
            "neck",
            ["*UpperLeg", "*LowerLeg", "*Foot", "*Toes", "*Shoulder", "*UpperArm", "*LowerArm", "*Hand"],
            ["left", "right"],
        ),
        (
            "vroid",
            "J_Bip_C_Hips",
            ["J_Bip_C_Spine", "J_Bip_C_Chest"],
            "J_Bip_C_Neck",
            [
                "J_Bip_*_UpperLeg",
                "J_Bip_*_LowerLeg",
                "J_Bip_*_Foot",
                "J_Bip_*_ToeBase",
                "J_Bip_*_Shoulder",
                "J_Bip_*_UpperArm",
                "J_Bip_*_LowerArm",
                "J_Bip_*_Hand",
            ],
            ["L", "R"],
        ),
        (
            "smpl for maya",
            "m_avg_Pelvis",
            ["m_avg_Spine1", "m_avg_Spine2"],
            "m_avg_Neck",
            [
                "m_avg_*_Hip",
                "m_avg_*_Knee",
                "m_avg_*_Ankle",
                "m_avg_*_Foot",
                "m_avg_*_Collar",
                "m_avg_*_Shoulder",
                "m_avg_*_Elbow",
                "m_avg_*_Wrist",
            ],
            ["L", "R"],
        ),
        (
            "meta",
            "Hips",
            ["SpineLower", "Chest"],
            "Neck",
            [
                "*UpperLeg",
                "*LowerLeg",
                "*FootAnkle",
                "*FootBall",
                "*Scapula",
                "*ArmUpper",
                "*ArmLower",
                "*HandWrist",
            ],
            ["Left", "Right"],
        ),
        (
            "deepmotion",
            "hips_JNT",
            ["spine_JNT", "spine1_JNT"],
            "neck_JNT",
            [
                "*_upleg_JNT",
                "*_leg_JNT",
                "*_foot_JNT",
                "*_toebase_JNT",
                "*_shoulder_JNT",
                "*_arm_JNT",
                "*_forearm_JNT",
                "*_hand_JNT",
            ],
            ["l", "r"],
        ),
        (
            "unreal",
            "pelvis",
            ["spine_01", "spine_02"],
            "neck_01",
            ["thigh_*", "calf_*", "foot_*", "ball_*", "clavicle_*", "upperarm_*", "lowerarm_*", "hand_*"],
            ["l", "r"],
        ),
        (
            "rigify ORG",
            "ORG-spine",
            ["ORG-spine.001", "ORG-spine.002"],
            "ORG-neck",
            [
                "ORG-thigh.*",
                "ORG-shin.*",
                "ORG-foot.*",
                "ORG-toe.*",
                "ORG-shoulder.*",
                "ORG-upper_arm.*",
                "ORG-forearm.*",
                "ORG-hand.*",
            ],
            ["L", "R"],
        ),
        (
            "rigify DEF",
            "DEF-spine",
            ["DEF-spine.001", "DEF-spine.002"],
            "DEF-neck",
            [
                "DEF-thigh.*",
                "DEF-shin.*",
                "DEF-foot.*",
                "DEF-toe.*",
                "DEF-shoulder.*",
                "DEF-upper_arm.*",
                "DEF-forearm.*",
                "DEF-hand.*",
            ],
            ["L", "R"],
        ),
        (
            "daz",
            "hip",
            ["abdomenLower", "chestLower"],
            "neckLower",
            ["*ThighBend", "*Shin", "*Foot", "*Toe", "*Collar", "*ShldrBend", "*ForearmBend", "*Hand"],
            ["l", "r"],
        ),
        (
            "makehuman",
            "root",
            ["spine05", "spine01"],
            "neck01",
            [
                "upperleg01.*",
                "lowerleg01.*",
                "foot.*",
                "toe1-1.*",
                "clavicle.*",
                "upperarm01.*",
                "lowerarm01.*",
                "wrist.*",
            ],
            ["L", "R"],
        ),
        (
            "cascadeur",
            "pelvis",
            ["stomach", "chest"],
            "neck",
            ["thigh_*", "calf_*", "foot_*", "toe_*", "clavicle_*", "arm_*", "forearm_*", "hand_*"],
            ["l", "r"],
        ),
        (
            "iclone",
            "CC_Base_Hip",
            ["CC_Base_Waist", "CC_Base_Spine01"],
            "CC_Base_NeckTwist01",
            [
                "CC_Base_*_Thigh",
                "CC_Base_*_Calf",
                "CC_Base_*_Foot",
                "CC_Base_*_ToeBase",
                "CC_Base_*_Clavicle",
                "CC_Base_*_Upperarm",
                "CC_Base_*_Forearm",
                "CC_Base_*_Hand",
            ],
            ["L", "R"],
        ),
    ];
    for (system, hips, spine, neck, pattern, [l, r]) in systems {
        let (left, right) = sides(pattern, l, r);
        let head = ["upperneck", "NeckTwist01", "neckLower", "Neck", "neck"]
            .iter()
            .find(|word| neck.contains(**word))
            .map(|word| neck.replace(word, if word.starts_with('N') { "Head" } else { "head" }))
            .unwrap();
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

/// A body whose left leg begins with these joints, above the foot; the right leg and the arms are plain.
fn with_left_leg(leg: &[(&str, [f32; 3])]) -> MocapFile {
    let down = [0.0, -0.4, 0.0];
    let mut rows = vec![(0, "Hips", [0.0; 3])];
    rows.extend(leg.iter().enumerate().map(|(i, &(name, offset))| (1 + i, name, offset)));
    rows.push((1 + leg.len(), "LeftFoot", down));
    rows.extend([(1, "RightUpLeg", [-0.1, 0.0, 0.0]), (2, "RightLeg", down), (3, "RightFoot", down)]);
    rows.extend([(1, "Spine", [0.0, 0.2, 0.0]), (2, "Chest", [0.0, 0.2, 0.0])]);
    for side in ["Left", "Right"] {
        let names: [&'static str; 3] = if side == "Left" {
            ["LeftArm", "LeftForeArm", "LeftHand"]
        } else {
            ["RightArm", "RightForeArm", "RightHand"]
        };
        rows.extend(names.into_iter().enumerate().map(|(i, name)| (3 + i, name, [0.3, 0.0, 0.0])));
    }
    skeleton_of(&rows)
}

#[test]
fn the_thigh_is_what_the_knee_hangs_from() {
    let (side, half, whole) = ([0.1, 0.0, 0.0], [0.0, -0.2, 0.0], [0.0, -0.4, 0.0]);
    type Leg<'a> = (&'a [(&'a str, [f32; 3])], &'a str, &'a str);
    let legs: [Leg; 8] = [
        // A buttock, a hip to the side and a short piece above the thigh are none of it.
        (&[("lButtock", side), ("lThigh", [0.02, -0.06, 0.0]), ("lShin", whole)], "lThigh", "lShin"),
        (&[("LeftHip", side), ("LeftUpLeg", [0.0, -0.06, 0.0]), ("LeftLeg", whole)], "LeftUpLeg", "LeftLeg"),
        (
            &[("LeftHip", [0.0; 3]), ("LeftUpLeg", [0.1, -0.1, 0.0]), ("LeftLeg", whole)],
            "LeftUpLeg",
            "LeftLeg",
        ),
        // The halves of a bone begin at its upper end.
        (
            &[("DEF-thigh.L", side), ("DEF-thigh.L.001", half), ("DEF-shin.L", half)],
            "DEF-thigh.L",
            "DEF-shin.L",
        ),
        (
            &[("upperleg01.L", side), ("upperleg02.L", half), ("lowerleg01.L", half), ("lowerleg02.L", half)],
            "upperleg01.L",
            "lowerleg01.L",
        ),
        (&[("lThighBend", side), ("lThighTwist", half), ("lShin", half)], "lThighBend", "lShin"),
        (&[("thigh_l", side), ("thigh_twist_01_l", half), ("calf_l", half)], "thigh_l", "calf_l"),
        (&[("LeftLeg", side), ("LeftShin", whole)], "LeftLeg", "LeftShin"),
    ];
    for (leg, thigh, shin) in legs {
        let file = with_left_leg(leg);
        let table = recognize(&file, None).unwrap();
        let name = |joint| file.joints[table.get(joint).unwrap()].name.as_str();
        assert_eq!((name(Joint::LeftUpLeg), name(Joint::LeftLeg)), (thigh, shin), "{leg:?}");
    }
}

#[test]
fn neck_and_head_are_found_without_their_names() {
    let left = ["thigh.L", "shin.L", "foot.L", "toe.L", "shoulder.L", "upper_arm.L", "forearm.L", "hand.L"];
    let right = left.map(|name| name.replace(".L", ".R"));
    let file = body(
        "spine",
        ["spine.001", "spine.003"],
        "spine.004",
        "spine.006",
        left,
        right.each_ref().map(|s| s.as_str()),
    );
    let table = recognize(&file, None).unwrap();
    assert_eq!((table.get(Joint::Neck), table.get(Joint::Head)), (Some(19), Some(20)));
    assert_eq!(table.spine, [9, 10]);
}
