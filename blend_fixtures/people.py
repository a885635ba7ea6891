"""Armatures of people as other programs name and build them, with a skin, made by rule; and Rigify's own."""

import importlib
import itertools

import bpy
import numpy as np
from mathutils import Matrix, Vector

#: Where joints lie in a person of 1.8 m in a T-pose, metres: left side, facing -Y, +Z up; from the core's skeleton.
LEFT = {
    "Shoulder": (0.03, 0.02, 1.478),
    "Arm": (0.175, 0.02, 1.478),
    "ForeArm": (0.458, 0.02, 1.478),
    "Hand": (0.736, 0.02, 1.478),
    "Fingers": (0.90, 0.02, 1.478),
    "UpLeg": (0.095, 0.0, 0.973),
    "Leg": (0.095, 0.0, 0.529),
    "Foot": (0.095, 0.0, 0.085),
    "Toe": (0.095, -0.13, 0.025),
    "Tip": (0.095, -0.20, 0.025),
}
MIDDLE = {"Hips": (0.0, 0.0, 0.993), "Neck": (0.0, 0.02, 1.523), "Head": (0.0, 0.0, 1.623), "Crown": (0.0, 0.0, 1.82)}
#: The spine runs from above the hips to the chest.
WAIST, CHEST = np.array((0.0, 0.01, 1.093)), np.array((0.0, 0.02, 1.353))

#: Bones of a rig: joint of ours → its name, with {side} for one of `sides`; "Spine" is a list from below.
RIGS = {
    "mixamo": {
        "sides": ("Left", "Right"),
        "Hips": "mixamorig:Hips",
        "Spine": ["mixamorig:Spine", "mixamorig:Spine1", "mixamorig:Spine2"],
        "Neck": "mixamorig:Neck",
        "Head": "mixamorig:Head",
        "Shoulder": "mixamorig:{side}Shoulder",
        "Arm": "mixamorig:{side}Arm",
        "ForeArm": "mixamorig:{side}ForeArm",
        "Hand": "mixamorig:{side}Hand",
        "UpLeg": "mixamorig:{side}UpLeg",
        "Leg": "mixamorig:{side}Leg",
        "Foot": "mixamorig:{side}Foot",
        "Toe": "mixamorig:{side}ToeBase",
        "droop": 0.0,
        "y_up": True,
        "units": 0.01,
    },
    "unreal": {
        "sides": ("l", "r"),
        "Root": "root",
        "Hips": "pelvis",
        "Spine": ["spine_01", "spine_02", "spine_03", "spine_04", "spine_05"],
        "Neck": "neck_01",
        "Head": "head",
        "Shoulder": "clavicle_{side}",
        "Arm": "upperarm_{side}",
        "ForeArm": "lowerarm_{side}",
        "Hand": "hand_{side}",
        "UpLeg": "thigh_{side}",
        "Leg": "calf_{side}",
        "Foot": "foot_{side}",
        "Toe": "ball_{side}",
        "twists": ("upperarm_twist_01_{side}", "thigh_twist_01_{side}"),
        "droop": 40.0,
        "bend": 12.0,
    },
    "vrm": {
        "sides": ("L", "R"),
        "Root": "Root",
        "Hips": "J_Bip_C_Hips",
        "Spine": ["J_Bip_C_Spine", "J_Bip_C_Chest", "J_Bip_C_UpperChest"],
        "Neck": "J_Bip_C_Neck",
        "Head": "J_Bip_C_Head",
        "Shoulder": "J_Bip_{side}_Shoulder",
        "Arm": "J_Bip_{side}_UpperArm",
        "ForeArm": "J_Bip_{side}_LowerArm",
        "Hand": "J_Bip_{side}_Hand",
        "UpLeg": "J_Bip_{side}_UpperLeg",
        "Leg": "J_Bip_{side}_LowerLeg",
        "Foot": "J_Bip_{side}_Foot",
        "Toe": "J_Bip_{side}_ToeBase",
        "droop": 0.0,
        "rolls": True,
    },
    "daz": {
        "sides": ("l", "r"),
        "Hips": "hip",
        "Pelvis": "pelvis",
        "Spine": ["abdomenLower", "abdomenUpper", "chestLower", "chestUpper"],
        "Neck": "neckLower",
        "Head": "head",
        "Shoulder": "{side}Collar",
        "Arm": "{side}ShldrBend",
        "ForeArm": "{side}ForearmBend",
        "Hand": "{side}Hand",
        "UpLeg": "{side}ThighBend",
        "Leg": "{side}Shin",
        "Foot": "{side}Foot",
        "Toe": "{side}Toe",
        "halves": {"Arm": "{side}ShldrTwist", "UpLeg": "{side}ThighTwist"},
        "droop": 45.0,
        "spread": 6.0,
    },
    "smpl": {
        "sides": ("L", "R"),
        "Hips": "Pelvis",
        "Spine": ["Spine1", "Spine2", "Spine3"],
        "Neck": "Neck",
        "Head": "Head",
        "Shoulder": "{side}_Collar",
        "Arm": "{side}_Shoulder",
        "ForeArm": "{side}_Elbow",
        "Hand": "{side}_Wrist",
        "UpLeg": "{side}_Hip",
        "Leg": "{side}_Knee",
        "Foot": "{side}_Ankle",
        "Toe": "{side}_Foot",
        "droop": 0.0,
        "origin": 0.97,
    },
    "cc": {
        "sides": ("L", "R"),
        "Root": "CC_Base_BoneRoot",
        "Hips": "CC_Base_Hip",
        "Pelvis": "CC_Base_Pelvis",
        "Spine": ["CC_Base_Waist", "CC_Base_Spine01", "CC_Base_Spine02"],
        "Neck": "CC_Base_NeckTwist01",
        "Head": "CC_Base_Head",
        "Shoulder": "CC_Base_{side}_Clavicle",
        "Arm": "CC_Base_{side}_Upperarm",
        "ForeArm": "CC_Base_{side}_Forearm",
        "Hand": "CC_Base_{side}_Hand",
        "UpLeg": "CC_Base_{side}_Thigh",
        "Leg": "CC_Base_{side}_Calf",
        "Foot": "CC_Base_{side}_Foot",
        "Toe": "CC_Base_{side}_ToeBase",
        "droop": 35.0,
        "units": 0.01,
    },
    "arp": {
        "sides": ("l", "r"),
        "Hips": "root.x",
        "Spine": ["spine_01.x", "spine_02.x"],
        "Neck": "neck.x",
        "Head": "head.x",
        "Shoulder": "shoulder.{side}",
        "Arm": "arm_stretch.{side}",
        "ForeArm": "forearm_stretch.{side}",
        "Hand": "hand.{side}",
        "UpLeg": "thigh_stretch.{side}",
        "Leg": "leg_stretch.{side}",
        "Foot": "foot.{side}",
        "Toe": "toes_01.{side}",
        "droop": 30.0,
    },
    "mmd": {
        "sides": ("左", "右"),
        "Hips": "センター",
        "Spine": ["上半身", "上半身2"],
        "Neck": "首",
        "Head": "頭",
        "Shoulder": "{side}肩",
        "Arm": "{side}腕",
        "ForeArm": "{side}ひじ",
        "Hand": "{side}手首",
        "UpLeg": "{side}足",
        "Leg": "{side}ひざ",
        "Foot": "{side}足首",
        "Toe": "{side}つま先",
        "droop": 38.0,
        "turned": 180.0,
    },
    "plain": {
        "sides": ("L", "R"),
        "Hips": "hips",
        "Spine": ["spine", "chest"],
        "Head": "head",
        "Arm": "upper_arm.{side}",
        "ForeArm": "forearm.{side}",
        "Hand": "hand.{side}",
        "UpLeg": "thigh.{side}",
        "Leg": "shin.{side}",
        "Foot": "foot.{side}",
        "droop": 60.0,
    },
}
ARM, LEG = ("Shoulder", "Arm", "ForeArm", "Hand", "Fingers"), ("UpLeg", "Leg", "Foot", "Toe", "Tip")


def make_person(kind, height=1.8, legs=1.0, arms=1.0, trunk=1.0, skin=True):
    """An armature object named `kind`; `legs`, `arms` and `trunk` stretch what 1.8 m has of them."""
    spec = RIGS[kind]
    joints = _joints(spec, legs, arms, trunk)
    top = max(place[2] for place in joints.values())
    unit = float(height / top / spec.get("units", 1.0))
    turn = Matrix.Rotation(np.radians(spec.get("turned", 0.0)), 3, "Z")
    if spec.get("y_up"):
        turn = Matrix.Rotation(-np.pi / 2, 3, "X") @ turn
    drop = Vector((0.0, 0.0, spec.get("origin", 0.0) * height / 1.8 / spec.get("units", 1.0)))
    at = {name: turn @ (Vector(place) * unit - drop) for name, place in joints.items()}
    data = bpy.data.armatures.new(kind)
    person = bpy.data.objects.new(kind, data)
    bpy.context.scene.collection.objects.link(person)
    bpy.context.view_layer.objects.active = person
    bpy.ops.object.mode_set(mode="EDIT")
    _bones(data, spec, at)
    bpy.ops.object.mode_set(mode="OBJECT")
    person.scale = (spec.get("units", 1.0),) * 3
    if spec.get("y_up"):
        person.rotation_euler = (np.pi / 2, 0.0, 0.0)
    person.location.z = spec.get("origin", 0.0) * height / 1.8
    bpy.context.view_layer.update()
    if skin:
        _skin(person, spec, at, turn, unit)
    return person


def _joints(spec, legs, arms, trunk):
    at = {name: np.array(place, dtype=float) for name, place in MIDDLE.items()}
    spine = spec["Spine"]
    for k in range(len(spine)):
        share = k / max(len(spine) - 1, 1)
        at[f"Spine{k}"] = WAIST + (CHEST - WAIST) * share
    for side, sign in (("L", 1.0), ("R", -1.0)):
        for name, place in LEFT.items():
            at[side + name] = np.array(place) * (sign, 1.0, 1.0)
        _turn_limb(at, side, ARM[1:], spec.get("droop", 0.0), arms, sign)
        if spec.get("bend"):
            elbow, angle = at[side + "ForeArm"], np.radians(spec["bend"])
            for name in ("Hand", "Fingers"):
                at[side + name] = elbow + _about(_arm_hinge(spec, sign), angle) @ (at[side + name] - elbow)
        hip = at[side + "UpLeg"].copy()
        for name in LEG[1:]:
            at[side + name] = hip + (at[side + name] - hip) * (1.0, 1.0, legs if name != "Tip" else 1.0)
        for name in ("Toe", "Tip"):
            at[side + name][2] = at[side + "Foot"][2] + LEFT[name][2] - LEFT["Foot"][2]
        for name in LEG[1:]:
            at[side + name][0] += sign * np.tan(np.radians(spec.get("spread", 0.0))) * (hip[2] - at[side + name][2])
    low = at["LTip"][2] - 0.025
    hips = at["Hips"].copy()
    for name, place in at.items():
        if name[0] not in "LR" or name[1:] in ARM:
            place[2] = hips[2] + (place[2] - hips[2]) * trunk
        place[2] -= low
    return at


def _arm_hinge(spec, sign):
    droop = np.radians(spec.get("droop", 0.0))
    return _about(np.array((0.0, 1.0, 0.0)), sign * droop) @ np.array((0.0, 0.0, -sign))


def _turn_limb(at, side, names, droop, stretch, sign):
    begin = at[side + names[0]].copy()
    turn = _about(np.array((0.0, 1.0, 0.0)), sign * np.radians(droop))
    for name in names[1:]:
        at[side + name] = begin + turn @ (at[side + name] - begin) * stretch


def _about(axis, angle):
    return np.array(Matrix.Rotation(angle, 3, Vector(axis)))


def _bones(data, spec, at):
    random = np.random.default_rng(1)

    def add(name, head, tail, parent, connect=False):
        bone = data.edit_bones.new(name)
        bone.head, bone.tail = at[head] if isinstance(head, str) else head, at[tail] if isinstance(tail, str) else tail
        if spec.get("rolls"):
            bone.roll = random.uniform(-3.0, 3.0)
        bone.parent = data.edit_bones.get(parent) if parent else None
        bone.use_connect = connect
        return name

    low = at["LTip"] + (at["RTip"] - at["LTip"]) / 2.0
    parent = add(spec["Root"], low, low + (at["Hips"] - low) * 0.1, None) if "Root" in spec else None
    hips = add(spec["Hips"], "Hips", "Spine0", parent)
    pelvis = (
        add(spec["Pelvis"], "Hips", at["Hips"] + (at["Hips"] - at["Spine0"]) * 0.5, hips) if "Pelvis" in spec else hips
    )
    over, count = hips, len(spec["Spine"])
    for k, name in enumerate(spec["Spine"]):
        end = f"Spine{k + 1}" if k + 1 < count else "Neck" if "Neck" in spec else "Head"
        over = add(name, f"Spine{k}", end, over)
    chest = over
    if "Neck" in spec:
        over = add(spec["Neck"], "Neck", "Head", over, connect=True)
    add(spec["Head"], "Head", "Crown", over)
    for side, word in zip("LR", spec["sides"], strict=True):
        for limb, begin in ((ARM, chest), (LEG, pelvis)):
            over = begin
            for name, end in itertools.pairwise(limb):
                if name not in spec:
                    continue
                half = spec.get("halves", {}).get(name)
                bone, tail = spec[name].format(side=word), at[side + end]
                middle = at[side + name] + (tail - at[side + name]) / 2.0
                over = add(bone, side + name, middle if half else tail, over, connect=False)
                if half:
                    over = add(half.format(side=word), middle, tail, over, connect=True)
        for twist, joint, end in zip(spec.get("twists", ()), ("Arm", "UpLeg"), ("ForeArm", "Leg"), strict=False):
            middle = at[side + joint] + (at[side + end] - at[side + joint]) / 2.0
            add(twist.format(side=word), middle, at[side + end], spec[joint].format(side=word))


#: Faces of a block of eight corners, x slowest.
BLOCK = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
#: Half widths of the skin's bars, metres of a person of 1.8 m.
GIRTH = {"Arm": 0.045, "ForeArm": 0.036, "Hand": 0.03, "UpLeg": 0.07, "Leg": 0.05, "Shoulder": 0.04}


def _skin(person, spec, at, turn, unit):
    """Bars about the bones and blocks for the feet, soles on the floor, each rigid on its bone."""
    corners, faces, groups = [], [], {}

    def block(bone, places):
        base = len(corners)
        corners.extend(places)
        faces.extend(tuple(base + k for k in face) for face in BLOCK)
        groups.setdefault(bone, []).extend(range(base, base + 8))

    def bar(bone, head, tail, width, depth=None):
        way = (tail - head).normalized()
        aside = way.cross(turn @ Vector((0.0, 1.0, 0.0)))
        aside = (aside if aside.length > 0.1 else way.cross(turn @ Vector((1.0, 0.0, 0.0)))).normalized()
        other = way.cross(aside)
        half, thick = width * unit, (depth or width) * unit
        block(
            bone, [end + a * half * aside + b * thick * other for end in (head, tail) for a in (-1, 1) for b in (-1, 1)]
        )

    def box(bone, low, high):
        block(
            bone,
            [turn @ Vector((x, y, z)) for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])],
        )

    count = len(spec["Spine"])
    bar(spec["Hips"], at["Hips"] + (at["Hips"] - at["Spine0"]) * 0.6, at["Spine0"], 0.15, 0.1)
    for k, name in enumerate(spec["Spine"]):
        bar(name, at[f"Spine{k}"], at[f"Spine{k + 1}"] if k + 1 < count else at["Neck"], 0.15, 0.1)
    bar(spec.get("Neck", spec["Head"]), at["Neck"], at["Head"], 0.05)
    bar(spec["Head"], at["Head"], at["Crown"], 0.075, 0.09)
    back = turn.transposed()
    for side, word in zip("LR", spec["sides"], strict=True):
        for limb in (ARM, (*LEG[:2], "Foot")):
            for name, end in itertools.pairwise(limb):
                if name in spec:
                    bar(spec[name].format(side=word), at[side + name], at[side + end], GIRTH[name])
        ankle, toe, tip = (back @ at[side + name] for name in ("Foot", "Toe", "Tip"))
        low = tip.z - 0.025 * unit
        wide = 0.045 * unit
        foot = spec["Foot"].format(side=word)
        ball = spec["Toe"].format(side=word) if "Toe" in spec else foot
        box(foot, (ankle.x - wide, toe.y, low), (ankle.x + wide, ankle.y + 0.06 * unit, ankle.z))
        box(ball, (toe.x - wide, tip.y, low), (toe.x + wide, toe.y, toe.z + 0.02 * unit))
    return _bind(person, corners, faces, groups)


def _bind(person, corners, faces, groups):
    """A mesh on a person, each part rigid on its bone."""
    mesh = bpy.data.meshes.new(person.name)
    mesh.from_pydata([tuple(corner) for corner in corners], [], faces)
    body = bpy.data.objects.new(f"{person.name} body", mesh)
    for bone, indices in groups.items():
        body.vertex_groups.new(name=bone).add(indices, 1.0, "REPLACE")
    bpy.context.scene.collection.objects.link(body)
    body.parent = person
    body.modifiers.new("Armature", "ARMATURE").object = person
    bpy.context.view_layer.update()
    return body


#: How tall Rigify's human is, metres.
METARIG_HEIGHT = 1.98


def make_rigify(height=1.8):
    """What Rigify generates from its human, without the face, and blocks for its feet, soles on the floor. Leaves the
    add-on enabled."""
    addon_utils = importlib.import_module("addon_utils")
    addon_utils.enable("rigify", default_set=True)
    bpy.ops.object.armature_human_metarig_add()
    metarig = bpy.context.object
    metarig.data.transform(Matrix.Scale(height / METARIG_HEIGHT, 4))
    bpy.ops.object.mode_set(mode="EDIT")
    bones = metarig.data.edit_bones

    def remove(bone):
        for child in list(bone.children):
            remove(child)
        bones.remove(bone)

    remove(bones["face"])
    bpy.ops.object.mode_set(mode="OBJECT")
    bpy.ops.pose.rigify_generate()
    rig = bpy.context.object
    bpy.ops.object.mode_set(mode="OBJECT")
    metarig.hide_set(True)
    _rigify_feet(rig, height / 1.8)
    return rig


def _rigify_feet(rig, unit):
    corners, faces, groups = [], [], {}
    for side in "LR":
        foot, toe = rig.data.bones[f"DEF-foot.{side}"], rig.data.bones[f"DEF-toe.{side}"]
        ankle, ball, tip, wide = foot.head_local, toe.head_local, toe.tail_local, 0.045 * unit
        for bone, low, high in (
            (foot, (ankle.x - wide, ball.y, 0.0), (ankle.x + wide, ankle.y + 0.06 * unit, ankle.z)),
            (toe, (ball.x - wide, tip.y, 0.0), (ball.x + wide, ball.y, ball.z + 0.02 * unit)),
        ):
            base = len(corners)
            corners += [(x, y, z) for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])]
            faces += [tuple(base + k for k in face) for face in BLOCK]
            groups.setdefault(bone.name, []).extend(range(base, base + 8))
    _bind(rig, corners, faces, groups)
