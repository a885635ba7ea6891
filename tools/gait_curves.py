"""Mean curves of straight walking from .bvh files, by twentieths of the stride (heel strike to heel strike).

Printed per band of speed: joint angles in degrees, heights and distances in centimetres. The tables in
`rust/oncue/src/library/starter/foot.rs` and the gains in `body.rs` were read off its output for `Male1_B*` of the
Open Motion Project by ACCAD / The Ohio State University (CC BY 3.0).

    python tools/gait_curves.py FILE.bvh ...        (needs numpy)
"""

import sys
from itertools import pairwise
from pathlib import Path

import numpy as np

PARTS = 20
BANDS = ((0.4, 0.7), (0.7, 1.0), (1.0, 1.3), (1.3, 1.7))
# Strides that turn further than this are left out, degrees.
STRAIGHT = 18.0


def axis_rotation(axis: str, angle: np.ndarray) -> np.ndarray:
    """Rotation matrices (frames, 3, 3) about a coordinate axis, radians."""
    c, s, zero, one = np.cos(angle), np.sin(angle), np.zeros_like(angle), np.ones_like(angle)
    rows = {
        "X": [[one, zero, zero], [zero, c, -s], [zero, s, c]],
        "Y": [[c, zero, s], [zero, one, zero], [-s, zero, c]],
        "Z": [[c, -s, zero], [s, c, zero], [zero, zero, one]],
    }[axis]
    return np.moveaxis(np.array(rows), -1, 0)


def joint_positions(path: Path) -> tuple[dict[str, np.ndarray], float]:
    """Joint positions (frames, 3) by name, metres, Z up, and frames a second. The file has centimetres, Y up."""
    words = path.read_text(errors="replace").split()
    joints: list[list] = []
    stack: list[int] = []
    i = 0
    while words[i] != "MOTION":
        word = words[i]
        if word in ("ROOT", "JOINT", "End"):
            parent = stack[-1] if stack else -1
            name = words[i + 1] if word != "End" else f"{joints[parent][0]} end"
            joints.append([name, parent, np.zeros(3), []])
            i += 1
        elif word == "{":
            stack.append(len(joints) - 1)
        elif word == "}":
            stack.pop()
        elif word == "OFFSET":
            joints[stack[-1]][2] = np.array([float(w) for w in words[i + 1 : i + 4]])
            i += 3
        elif word == "CHANNELS":
            count = int(words[i + 1])
            joints[stack[-1]][3] = words[i + 2 : i + 2 + count]
            i += 1 + count
        i += 1
    frames, seconds = int(words[i + 2]), float(words[i + 5])
    values = np.array(words[i + 6 :], float).reshape(frames, -1)
    place, turn, column = [], [], 0
    for _, parent, offset, channels in joints:
        rotation = np.broadcast_to(np.eye(3), (frames, 3, 3))
        position = np.broadcast_to(offset, (frames, 3))
        moved = np.zeros((frames, 3))
        for channel in channels:
            value = values[:, column]
            column += 1
            if channel.endswith("position"):
                moved[:, "XYZ".index(channel[0])] = value
                position = moved
            else:
                rotation = rotation @ axis_rotation(channel[0], np.radians(value))
        if parent >= 0:
            position = place[parent] + np.einsum("fij,fj->fi", turn[parent], position)
            rotation = turn[parent] @ rotation
        place.append(position)
        turn.append(rotation)
    z_up = [np.stack([p[:, 0], -p[:, 2], p[:, 1]], 1) / 100.0 for p in place]
    return {joint[0]: p for joint, p in zip(joints, z_up, strict=True)}, 1.0 / seconds


#: A limb's joints, by what they are called here.
LIMB = {
    "hip": "UpLeg",
    "knee": "Leg",
    "ankle": "Foot",
    "ball": "ToeBase",
    "shoulder": "Arm",
    "elbow": "ForeArm",
    "wrist": "Hand",
}


def dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Scalar products of rows, (frames,)."""
    return (a * b).sum(1)


def strides(path: Path) -> list[tuple[float, dict[str, np.ndarray]]]:
    """(speed in m/s, curves of PARTS values) of each straight stride of either leg."""
    joints, rate = joint_positions(path)
    legs = [{ours: joints[side + theirs] for ours, theirs in LIMB.items()} for side in ("Left", "Right")]
    pelvis = 0.5 * (legs[0]["hip"] + legs[1]["hip"])
    frames = len(pelvis)
    window = int(0.5 * rate)
    at = np.arange(frames)
    first, last = np.maximum(at - window, 0), np.minimum(at + window, frames - 1)
    velocity = (pelvis[last] - pelvis[first]) / (last - first)[:, None] * rate
    velocity[:, 2] = 0.0
    speed = np.linalg.norm(velocity, axis=1)
    ahead = velocity / (speed[:, None] + 1e-9)
    left = np.stack([-ahead[:, 1], ahead[:, 0], 0 * speed], 1)

    def swing(v: np.ndarray) -> np.ndarray:
        return np.degrees(np.arctan2(dot(v, ahead), -v[:, 2]))

    def turn(v: np.ndarray) -> np.ndarray:
        return np.degrees(np.arctan2(-dot(v, ahead), dot(v, left)))

    def beside(at: np.ndarray, side: np.ndarray) -> np.ndarray:
        """How far a joint is from its own way over two seconds."""
        kernel = np.ones(int(2 * rate) | 1)
        weight = np.convolve(np.ones(frames), kernel, "same")
        smooth = np.stack([np.convolve(at[:, k], kernel, "same") / weight for k in range(3)], 1)
        return dot(at - smooth, side)

    neck = joints["Neck"]
    out = []
    for me, other, sign in ((legs[0], legs[1], 1), (legs[1], legs[0], -1)):
        reach = dot(me["ankle"] - pelvis, ahead)
        near = int(0.3 * rate)
        inside = range(near // 2, frames - near // 2)
        farthest = [i for i in inside if reach[i] == reach[max(0, i - near) : i + near].max()]
        strikes = [i for i in farthest if reach[i] > 0.15]
        across = (me["hip"] - other["hip"]) * sign
        shoulders = (me["shoulder"] - other["shoulder"]) * sign
        foot = me["ball"] - me["ankle"]
        curves = {
            "thigh": swing(me["knee"] - me["hip"]),
            "knee": swing(me["knee"] - me["hip"]) - swing(me["ankle"] - me["knee"]),
            "foot pitch": np.degrees(np.arctan2(foot[:, 2], dot(foot, ahead))),
            "ball height": 100 * me["ball"][:, 2],
            "ball ahead": 100 * dot(me["ball"] - pelvis, ahead),
            "ankle ahead": 100 * reach,
            "ankle aside": 100 * sign * dot(me["ankle"] - pelvis, left),
            "pelvis height": 100 * pelvis[:, 2],
            "pelvis turn": sign * turn(across),
            "pelvis list": np.degrees(np.arctan2(sign * across[:, 2], np.linalg.norm(across[:, :2], axis=1))),
            "shoulder turn": sign * turn(shoulders),
            "shoulder list": np.degrees(np.arctan2(sign * shoulders[:, 2], np.linalg.norm(shoulders[:, :2], axis=1))),
            "upper arm": swing(me["elbow"] - me["shoulder"]),
            "forearm": swing(me["wrist"] - me["elbow"]),
            "wrist ahead": 100 * dot(me["wrist"] - pelvis, ahead),
            "wrist aside": 100 * sign * dot(me["wrist"] - pelvis, left),
            "elbow aside": 100 * sign * dot(me["elbow"] - pelvis, left),
            "pelvis speed": 100 * rate * dot(np.gradient(pelvis, axis=0), ahead),
            "pelvis aside": 100 * sign * beside(pelvis, left),
            "neck beside": 100 * sign * beside(neck, left),
            "neck ahead": 100 * dot(neck - pelvis, ahead),
            "neck aside": 100 * sign * dot(neck - pelvis, left),
            "neck up": 100 * (neck - pelvis)[:, 2],
            "head height": 100 * joints["Head"][:, 2],
            "head ahead": 100 * dot(joints["Head"] - pelvis, ahead),
            "head aside": 100 * sign * dot(joints["Head"] - pelvis, left),
        }
        for a, b in pairwise(strikes):
            if not 0.8 < (b - a) / rate < 1.7:
                continue
            if np.degrees(np.ptp(np.unwrap(np.arctan2(ahead[a:b, 1], ahead[a:b, 0])))) > STRAIGHT:
                continue
            grid = np.linspace(a, b, PARTS, endpoint=False)
            stride = {name: np.interp(grid, at, curve) for name, curve in curves.items()}
            stride["seconds"] = np.array([(b - a) / rate])
            out.append((float(speed[a:b].mean()), stride))
    return out


def main() -> None:
    np.set_printoptions(precision=1, suppress=True, linewidth=200)
    found = []
    for name in sys.argv[1:]:
        try:
            found += strides(Path(name))
        except (KeyError, ValueError, IndexError) as error:
            print(f"{name}: left out ({error!r})", file=sys.stderr)
    for low, high in BANDS:
        band = [(v, s) for v, s in found if low <= v < high]
        if not band:
            continue
        print(f"\n{low}-{high} m/s: {len(band)} strides, mean {np.mean([v for v, _ in band]):.2f} m/s")
        for curve in band[0][1]:
            print(f"{curve:14s}", np.mean([s[curve] for _, s in band], axis=0))


if __name__ == "__main__":
    main()
