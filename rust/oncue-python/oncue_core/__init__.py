"""Oncue's core without Blender: motion libraries, scenes, and the synthesis of a motion from cues.

Everything long runs as a :class:`Job`. One space everywhere, Blender's: right-handed, Z up, metres,
quaternions w first; a character at rest faces -Y, and `yaw` (radians) turns it about +Z.
"""

from ._native import (
    Job,
    __version__,
    skeleton,
)
from .errors import Cancelled, DataFileError, InputError, OncueError
from .types import BoxNode, ProgressSnapshot, Skeleton

__all__ = [
    "BoxNode",
    "Cancelled",
    "DataFileError",
    "InputError",
    "Job",
    "OncueError",
    "ProgressSnapshot",
    "Skeleton",
    "__version__",
    "skeleton",
]
