"""Types of the compiled module; import from `oncue_core`."""

from types import GenericAlias
from typing import Any, Generic, TypeVar, final

from .types import ProgressSnapshot, Skeleton

__all__ = ["Job", "__version__", "skeleton"]

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

def skeleton() -> Skeleton: ...
