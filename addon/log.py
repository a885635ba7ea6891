# SPDX-License-Identifier: GPL-3.0-or-later
"""The log: what the core and the extension do, in a file that an artist can send along with a question."""

from __future__ import annotations

import logging
import os
import platform
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from . import native

#: The core logs under it too.
logger = logging.getLogger("oncue")
LINE = logging.Formatter("%(asctime)s.%(msecs)03d %(levelname)-7s %(message)s", "%Y-%m-%d %H:%M:%S")


class LogFile:
    """The file that the log goes to, if any."""

    def __init__(self) -> None:
        self._handler: logging.Handler | None = None
        #: Why nothing is written although a file was named; empty while all is well.
        self.fault = ""

    def open(self, path: str, *, blender: str, append: bool = True) -> None:
        """Writes everything to the file `path` from now on, its first line about the machine; "" closes it.

        `blender`: its version. A file that cannot be opened is told in `fault`.
        """
        self.close()
        if not path:
            return
        try:
            handler = logging.FileHandler(Path(path), mode="a" if append else "w", encoding="utf-8")
        except OSError as error:
            self.fault = f"The log cannot be written: {native.sentence(error)}"
            return
        self._handler = handler
        listen(handler)
        logger.info(about(blender))

    def close(self) -> None:
        self.fault = ""
        if self._handler is not None:
            logger.removeHandler(self._handler)
            self._handler.close()
            self._handler = None
            logger.setLevel(logging.NOTSET)


def listen(handler: logging.Handler) -> None:
    """Sends everything to `handler`."""
    handler.setFormatter(LINE)
    logger.addHandler(handler)
    logger.setLevel(logging.DEBUG)


@contextmanager
def bugs() -> Iterator[None]:
    """Logs an error of its block that is a bug, with its traceback; raises it like any other."""
    try:
        yield
    except Exception as error:
        if not isinstance(error, native.expected_errors()):
            logger.exception("Oncue ran into a bug of its own.")
        raise


def about(blender: str) -> str:
    """In a line what runs where."""
    core = native.MISSING or f"core {native.core.__version__}"
    machine = f"{platform.platform()}, {os.cpu_count()} processors"
    return f"Oncue: {core}, Blender {blender}, Python {platform.python_version()}, {machine}"


def to_stderr() -> None:
    """Shows everything on stderr as well."""
    listen(logging.StreamHandler(sys.stderr))


log_file = LogFile()
