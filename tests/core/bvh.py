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


def stepping(frames: int = 90, *, speed: float = 1.0) -> str:
    """A person who walks along +Z at `speed` m/s by swinging thighs and shins; 30 frames a second."""
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
        row = [0.0, 92.0, 100 * speed * time]
        for name in order:
            phase = 2 * math.pi * time + (math.pi if name.startswith("Right") else 0)
            bends = {"UpLeg": -25 * math.sin(phase), "Leg": 20 + 20 * math.cos(phase)}
            bend = bends.get(name.removeprefix("Left").removeprefix("Right"), 0)
            if name.endswith("Arm") and "Fore" not in name:
                row += [-75 if name.startswith("Left") else 75, 0, 0]
            else:
                row += [0, bend, 0]
        lines.append(" ".join(f"{value:.4f}" for value in row))
    return "\n".join(lines) + "\n"
