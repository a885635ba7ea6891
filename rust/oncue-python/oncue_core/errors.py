"""What can go wrong in the core. Files that the system refuses raise OSError and its subclasses.

A bug in the core is a RuntimeError with the message of the panic; it never takes the interpreter with it.
"""


class OncueError(Exception):
    """The base of everything that an artist can act on; the text is a sentence for the artist."""


class InputError(OncueError, ValueError):
    """A cue, a start, a setting or an array that cannot be met as given, or a task that nothing can fulfil."""


class EdgeError(InputError):
    """A cue that lies too far from the edge of its seat to be sat down on.

    `place`, world, metres, and `yaw`, radians: where and how it could be.
    """

    def __init__(self, sentence: str, place: tuple[float, float, float], yaw: float) -> None:
        super().__init__(sentence)
        self.place, self.yaw = place, yaw


class DataFileError(OncueError):
    """A motion capture or Oncue file that is damaged, too new or of another kind."""


class DamagedFileError(DataFileError):
    """A file that no Oncue can read: damaged, cut off or of another kind. One of a newer or an older Oncue is none."""


class NewerFileError(DataFileError):
    """A file that a newer Oncue made."""


class Cancelled(OncueError):
    """The job was cancelled."""
