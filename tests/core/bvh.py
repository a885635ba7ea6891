"""Small .bvh files made in code."""

import math

#: Name, parent, offset in centimetres, Y up: a T-pose that faces +Z.
JOINTS = [
    ("Hips", None, (0, 95, 0)),
    *[("Spine", "Hips", (0, 10, 0)), ("Spine1", "Spine", (0, 13, 0)), ("Spine2", "Spine1", (0, 13, 0))],
    *[("Neck", "Spine2", (0, 17, 0)), ("Head", "Neck", (0, 10, 0))],
    *[("LeftShoulder", "Spine2", (3, 12, 0)), ("LeftArm", "LeftShoulder", (14, 0, 0))],
    *[("LeftForeArm", "LeftArm", (28, 0, 0)), ("LeftHand", "LeftForeArm", (27, 0, 0))],
    *[("RightShoulder", "Spine2", (-3, 12, 0)), ("RightArm", "RightShoulder", (-14, 0, 0))],
    *[("RightForeArm", "RightArm", (-28, 0, 0)), ("RightHand", "RightForeArm", (-27, 0, 0))],
    *[("LeftUpLeg", "Hips", (9, -2, 0)), ("LeftLeg", "LeftUpLeg", (0, -43, 0)), ("LeftFoot", "LeftLeg", (0, -42, 0))],
    ("LeftToeBase", "LeftFoot", (0, -6, 13)),
    *[("RightUpLeg", "Hips", (-9, -2, 0)), ("RightLeg", "RightUpLeg", (0, -43, 0))],
    *[("RightFoot", "RightLeg", (0, -42, 0)), ("RightToeBase", "RightFoot", (0, -6, 13))],
]


def hips_over_feet(time: float, speed: float) -> float:
    """How high the hips are over the ankle of the leg that stands, centimetres: it is straight, of 85 cm."""
    return math.sqrt(85**2 - (25 * speed - 100 * speed * (time % 0.5)) ** 2)


def leg(time: float, speed: float) -> tuple[float, float]:
    """Thigh (forward) and knee, degrees, of a leg that stands through the first half of each second and then steps."""
    phase, height = time % 1.0, hips_over_feet(time, speed)
    share = 2 * phase - 1
    ahead = 25 * speed - 100 * speed * phase if phase < 0.5 else -25 * speed * math.cos(math.pi * share)
    down = height - (8 * math.sin(math.pi * share) if phase >= 0.5 else 0)
    length = min(math.hypot(ahead, down), 85.0)
    knee = math.acos((length**2 - 43**2 - 42**2) / (2 * 43 * 42)) if length < 85.0 else 0.0
    return math.degrees(
        math.atan2(ahead, down) + math.atan2(42 * math.sin(knee), 43 + 42 * math.cos(knee))
    ), math.degrees(knee)


def stepping(frames: int = 90, *, speed: float = 1.0) -> str:
    """A person who walks along +Z at `speed` m/s, each foot standing for half a second; 30 frames a second."""
    lines = ["HIERARCHY"]

    def emit(name: str, depth: int) -> None:
        offset = next(offset for joint, _, offset in JOINTS if joint == name)
        children = [joint for joint, parent, _ in JOINTS if parent == name]
        indent = "\t" * depth
        lines.append(f"{indent}{'JOINT' if depth else 'ROOT'} {name}")
        lines.append(f"{indent}{{")
        lines.append(f"{indent}\tOFFSET {' '.join(map(str, (0, 0, 0) if not depth else offset))}")
        places = "6 Xposition Yposition Zposition" if not depth else "3"
        lines.append(f"{indent}\tCHANNELS {places} Zrotation Xrotation Yrotation")
        for child in children:
            emit(child, depth + 1)
        if not children:
            lines.extend([f"{indent}\tEnd Site", f"{indent}\t{{", f"{indent}\t\tOFFSET 0 0 5", f"{indent}\t}}"])
        lines.append(f"{indent}}}")

    emit("Hips", 0)
    lines += ["MOTION", f"Frames: {frames}", "Frame Time: 0.0333333"]
    order = [line.split()[1] for line in lines if line.strip().startswith(("ROOT", "JOINT"))]
    for frame in range(frames):
        time = frame / 30
        turned = {"Left": leg(time, speed), "Right": leg(time + 0.5, speed)}
        height = 7 + hips_over_feet(time, speed)
        row = [0.0, height, 100 * speed * time]
        for name in order:
            side = "Left" if name.startswith("Left") else "Right"
            thigh, knee = turned[side]
            bends = {"UpLeg": -thigh, "Leg": knee, "Foot": thigh - knee}
            bend = bends.get(name.removeprefix(side), 0)
            if name.endswith("Arm") and "Fore" not in name:
                row += [-75 if name.startswith("Left") else 75, 0, 0]
            else:
                row += [0, bend, 0]
        lines.append(" ".join(f"{value:.4f}" for value in row))
    return "\n".join(lines) + "\n"
