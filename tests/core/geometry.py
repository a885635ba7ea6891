"""Small scenes made in code."""

import numpy as np
from numpy.typing import NDArray

Mesh = tuple[NDArray[np.float32], NDArray[np.uint32]]

_BOX = np.array(
    [
        *([0, 2, 1], [1, 2, 3], [4, 5, 6], [5, 7, 6], [0, 1, 4], [1, 5, 4]),
        *([2, 6, 3], [3, 6, 7], [0, 4, 2], [2, 4, 6], [1, 3, 5], [3, 7, 5]),
    ],
    dtype=np.uint32,
)


def box(low: tuple[float, float, float], high: tuple[float, float, float]) -> Mesh:
    """A closed box between two corners, metres."""
    corners = [[(low, high)[i >> axis & 1][axis] for axis in range(3)] for i in range(8)]
    return np.array(corners, dtype=np.float32), _BOX.copy()


def joined(*meshes: Mesh) -> Mesh:
    """All meshes as one."""
    starts = np.cumsum([0, *(len(positions) for positions, _ in meshes[:-1])])
    triangles = [t + np.uint32(start) for start, (_, t) in zip(starts, meshes, strict=True)]
    return np.concatenate([p for p, _ in meshes]), np.concatenate(triangles).astype(np.uint32)


def room_with_a_bench() -> Mesh:
    """A floor of 6 × 6 m about the origin with its top at z = 0, and a bench 0.45 m high at y = 2."""
    return joined(box((-3, -3, -0.1), (3, 3, 0)), box((-0.8, 1.8, 0), (0.8, 2.3, 0.45)))


def sit_on_the_bench() -> dict:
    """From the middle of `room_with_a_bench` round to the bench, to sit facing away from it."""
    return {
        "start": {"name": "Start", "position": [0.0, -1.5, 0.0], "yaw": 3.0},
        "cue": {"name": "Sit", "action_type": "sit", "position": [0.0, 1.95, 0.53], "yaw": 0.0},
    }


def terrain(quads: int) -> Mesh:
    """A waved floor of `quads` × `quads` squares over 20 × 20 m: two triangles each."""
    side = np.linspace(-10, 10, quads + 1, dtype=np.float32)
    x, y = np.meshgrid(side, side, indexing="ij")
    z = 0.02 * np.sin(3 * x) * np.cos(2 * y)
    corner = (np.arange(quads)[:, None] * (quads + 1) + np.arange(quads)).ravel()
    a, b, c, d = corner, corner + 1, corner + quads + 1, corner + quads + 2
    triangles = np.concatenate([np.stack([a, c, b], 1), np.stack([b, c, d], 1)]).astype(np.uint32)
    return np.stack([x, y, z], -1).reshape(-1, 3).astype(np.float32), triangles
