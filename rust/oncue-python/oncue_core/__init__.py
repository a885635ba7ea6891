"""Oncue's core without Blender: motion libraries, scenes, and the synthesis of a motion from cues.

Everything long runs as a :class:`Job`. One space everywhere, Blender's: right-handed, Z up, metres,
quaternions w first; a character at rest faces -Y, and `yaw` (radians) turns it about +Z.
"""

from ._native import (
    Job,
    Library,
    SceneIndex,
    Synthesis,
    __version__,
    build_library,
    check_task,
    default_settings,
    index_scene,
    presets,
    skeleton,
    synthesize,
)
from .errors import Cancelled, DataFileError, InputError, OncueError
from .types import (
    ActionCue,
    BoxNode,
    InitialState,
    Point,
    ProgressSnapshot,
    Report,
    Settings,
    Skeleton,
    Summary,
    SummaryRow,
    Task,
)

__all__ = [
    "ActionCue",
    "BoxNode",
    "Cancelled",
    "DataFileError",
    "InitialState",
    "InputError",
    "Job",
    "Library",
    "OncueError",
    "Point",
    "ProgressSnapshot",
    "Report",
    "SceneIndex",
    "Settings",
    "Skeleton",
    "Summary",
    "SummaryRow",
    "Synthesis",
    "Task",
    "__version__",
    "build_library",
    "check_task",
    "default_settings",
    "index_scene",
    "presets",
    "skeleton",
    "synthesize",
]
