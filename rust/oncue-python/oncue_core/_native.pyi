"""Types of the compiled module; import from `oncue_core`."""

from types import GenericAlias
from typing import Any, Generic, TypeVar, final

import numpy as np
from numpy.typing import NDArray

from .types import Point, ProgressSnapshot, Settings, Skeleton, Task

__all__ = [
    "Job",
    "SceneIndex",
    "__version__",
    "check_task",
    "index_scene",
    "skeleton",
]

__version__: str

_T = TypeVar("_T")

@final
class Job(Generic[_T]):
    """Work that runs on a thread of its own. Dropping the handle cancels it."""

    @classmethod
    def __class_getitem__(cls, key: Any) -> GenericAlias: ...
    def progress(self) -> ProgressSnapshot: ...
    def cancel(self) -> None:
        """Asks the work to stop; `result` then raises Cancelled unless the work was done before."""
    def done(self) -> bool: ...
    def wait(self, timeout_s: float) -> bool:
        """Waits at most `timeout_s` seconds; whether the work is done. Other Python threads run meanwhile."""
    def result(self) -> _T:
        """Waits for the work, and gives its result or raises what it raised; the same each time."""

@final
class SceneIndex:
    """A scene's triangles, indexed for collision and for finding ways. Immutable."""

    @property
    def triangle_count(self) -> int:
        """Triangles that have an area."""
    @property
    def bounds(self) -> tuple[Point, Point]:
        """Smallest and largest corner, world, metres."""
    @property
    def floor_height(self) -> float:
        """World z of the dominant walkable level, metres."""

def index_scene(
    positions: NDArray[np.float32], triangles: NDArray[np.uint32], settings: Settings | None = None
) -> Job[SceneIndex]:
    """Indexes a scene: `positions` (n, 3), world, metres, Z up; `triangles` (m, 3), indices of positions.

    The arrays are copied before the call returns. InputError for arrays of another dtype or shape and for unknown
    settings at once; for meshes that cannot be indexed from the job.
    """

def check_task(scene: SceneIndex, task: Task) -> None:
    """Returns where the person can get from the task's start to its cue and do there what it asks.

    InputError with the reason otherwise. The synthesis asks the same first.
    """

def skeleton() -> Skeleton: ...
