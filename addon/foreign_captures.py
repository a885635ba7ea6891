# SPDX-License-Identifier: GPL-3.0-or-later
"""Captures in formats that Blender reads and the core does not: a second Blender makes .bvh files of them.

What was made of a file is kept until the file changes.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import subprocess
import tempfile
import time
import urllib.parse
from collections.abc import Generator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .errors import SceneError

if TYPE_CHECKING:
    from .native import core

#: Endings of the files.
SUFFIXES = (".fbx", ".glb", ".gltf")
#: Raised when the same file gives other takes.
FORMAT = 1
#: A Blender that gets no further with a file for so long hangs, seconds.
PATIENCE = 600.0
#: What was made is thrown away where all of it takes up more, bytes, what was used last, last.
KEPT_BYTES = 1_000_000_000
#: Folders are searched as deep as the core does.
DEPTH = 8

#: What there is of a file, in its folder.
TAKES = "takes.json"
#: Windows would open a console.
NO_WINDOW = getattr(subprocess, "CREATE_NO_WINDOW", 0)


@dataclass(frozen=True)
class SecondBlender:
    """How a Blender is started that reads captures, and where is kept what it makes of them."""

    #: To which the path of a request is added.
    command: tuple[str, ...]
    #: "4.2.23": another one may read a file that this one cannot.
    version: str
    folder: Path


@dataclass(frozen=True)
class Converted:
    """What was made of files."""

    #: Each .bvh, with the file and the action that it shows.
    sources: dict[str, dict[str, str]] = field(default_factory=dict)
    #: What gave none.
    left_out: list[core.Capture] = field(default_factory=list)


class BlenderJob:
    """A second Blender at work, to be waited for as for a job of the core."""

    def __init__(self, command: Sequence[str], request: Path, log: Path, folders: Sequence[Path]) -> None:
        self._folders = folders
        self._looked, self._counted = time.monotonic(), 0
        with log.open("wb") as out:
            self._process = subprocess.Popen(
                [*command, str(request)],
                stdin=subprocess.DEVNULL,
                stdout=out,
                stderr=subprocess.STDOUT,
                creationflags=NO_WINDOW,
            )

    def done(self) -> bool:
        count = self._finished()
        if count != self._counted:
            self._looked, self._counted = time.monotonic(), count
        elif time.monotonic() - self._looked > PATIENCE:
            self.cancel()
        return self._process.poll() is not None

    def wait(self, timeout_s: float) -> bool:
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(timeout_s)
        return self.done()

    def cancel(self) -> None:
        if self._process.poll() is None:
            self._process.kill()

    def progress(self) -> core.ProgressSnapshot:
        return {
            "stage": "Reading captures in Blender",
            "fraction": self._finished() / max(len(self._folders), 1),
            "update": 0,
            "reward": 0.0,
            "success_rate": 0.0,
        }

    def ended(self) -> str:
        """Why it gave no more, as the end of a sentence."""
        self._process.wait()
        if time.monotonic() - self._looked > PATIENCE:
            return f"took longer than {PATIENCE / 60:.0f} minutes over it"
        return f"ended while it read it (status {self._process.returncode})"

    def _finished(self) -> int:
        return sum((folder / TAKES).is_file() for folder in self._folders)


def is_foreign(path: Path) -> bool:
    return path.suffix.lower() in SUFFIXES


def foreign_files(paths: Sequence[str]) -> list[Path]:
    """The files among paths and in their folders that a second Blender reads, each once."""
    # By where they really lie, as the core does.
    found: dict[Path, Path] = {}
    for path in map(Path, paths):
        inside = [path]
        if path.is_dir():
            inside = sorted(p for p in path.rglob("*") if len(p.relative_to(path).parts) <= DEPTH + 1 and p.is_file())
        for file in filter(is_foreign, inside):
            found.setdefault(file.resolve(), file)
    return list(found.values())


def convert_steps(
    files: Sequence[Path], blender: SecondBlender | None, entry: dict[str, Any] | None = None
) -> Generator[BlenderJob, None, Converted]:
    """Makes .bvh files of captures, where that was not done before. Raises SceneError where there is no Blender.

    `entry` is added to what is asked of each file.
    """
    if not files:
        return Converted()
    if blender is None:
        raise SceneError(f"{files[0].name} can only be read within Blender.")
    converted, whole = Converted(), []
    buffers: dict[Path, list[Path]] = {}
    for file in files:
        try:
            buffers[file] = gltf_buffers(file)
        except SceneError as error:
            converted.left_out.append(_left_out(file, None, str(error)))
        else:
            whole.append(file)
    folders = {file: blender.folder / _key([file, *buffers[file]], blender, entry) for file in whole}
    crashed: dict[Path, str] = {}
    pending = [file for file in whole if _takes(folders[file]) is None]
    while pending:
        yield from _read(pending, folders, blender, entry or {}, crashed)
        pending = [file for file in pending if file not in crashed and _takes(folders[file]) is None]
    for file in whole:
        said = _takes(folders[file])
        if said is None:
            converted.left_out.append(_left_out(file, None, f"Blender {crashed[file]}."))
            continue
        with suppress(OSError):
            (folders[file] / TAKES).touch()
        for take in said["takes"]:
            converted.sources[str(folders[file] / take["file"])] = {"file": str(file), "action": take["action"]}
        converted.left_out.extend(_left_out(file, one["action"], one["reason"]) for one in said["left_out"])
    _shrink(blender.folder, set(folders.values()))
    return converted


def gltf_buffers(file: Path) -> list[Path]:
    """The files beside a .gltf that hold its numbers, each there and whole. Raises SceneError where one is not.

    Blender's importer names such a file only where it needs it, and its pictures nobody needs for a motion.
    """
    if file.suffix.lower() != ".gltf":
        return []
    try:
        text = file.read_bytes()
        if text.startswith(b"glTF"):
            return []  # a .glb by another name, which Blender knows by this
        said = json.loads(text)
        buffers = [(str(one["uri"]), int(one["byteLength"])) for one in said.get("buffers", []) if "uri" in one]
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise SceneError(f"it is no glTF file, or damaged ({type(error).__name__}: {error}).") from None
    found = []
    for uri, size in buffers:
        if uri.startswith("data:"):
            continue
        path = file.parent / urllib.parse.unquote(uri)
        try:
            held = path.stat().st_size if path.is_file() else None
        except (OSError, ValueError):
            held = None
        if held is None:
            raise SceneError(f"its file {uri}, which holds its numbers, is not beside it: put it there.")
        if held < size:
            raise SceneError(f"its file {uri} is cut off: it has {held} of {size} bytes.")
        found.append(path)
    return found


def belongs_to(file: Path) -> list[Path]:
    """The files beside a capture by which it may be read otherwise: those that it names, and mapping files."""
    try:
        named = gltf_buffers(file)
    except (SceneError, OSError):
        named = []
    mappings = (file.with_suffix(".oncue.json"), file.with_name("oncue.json"))
    return [*named, *(mapping for mapping in mappings if mapping.is_file())]


def _read(
    pending: list[Path],
    folders: dict[Path, Path],
    blender: SecondBlender,
    entry: dict[str, Any],
    crashed: dict[Path, str],
) -> Generator[BlenderJob, None, None]:
    """Has one Blender read as many files as it gets through; the one that it ends over is added to `crashed`."""
    # Two processes may read the same file at once: each in folders of its own, which are renamed when they are whole.
    parts = {file: folders[file].with_name(f"{folders[file].name}.{os.getpid()}.part") for file in pending}
    for part in parts.values():
        shutil.rmtree(part, ignore_errors=True)
        part.mkdir(parents=True)
    with tempfile.TemporaryDirectory(prefix="oncue-") as scratch:
        request, log = Path(scratch) / "request.json", Path(scratch) / "log.txt"
        asked = [{**entry, "file": str(file), "folder": str(part)} for file, part in parts.items()]
        request.write_text(json.dumps(asked), encoding="utf-8")
        try:
            job = BlenderJob(blender.command, request, log, list(parts.values()))
        except OSError as error:
            raise SceneError(f"A second Blender, which reads {pending[0].name}, does not start: {error}.") from error
        try:
            while not job.done():
                yield job
        finally:
            job.cancel()
            why = job.ended()
            for file, part in parts.items():
                _settle(part, folders[file])
    unread = next((file for file in pending if _takes(folders[file]) is None), None)
    if unread is not None:
        crashed[unread] = why


def _settle(part: Path, folder: Path) -> None:
    """Puts what was made of a file in its place, where it is whole; a whole one that is there stays."""
    if _takes(part) is not None and _takes(folder) is None:
        shutil.rmtree(folder, ignore_errors=True)
        with suppress(OSError):
            part.rename(folder)
    shutil.rmtree(part, ignore_errors=True)


def _key(files: Sequence[Path], blender: SecondBlender, entry: dict[str, Any] | None) -> str:
    """The same while a file, and those that belong to it, are as they are. Raises OSError for one that is gone."""
    told: list[Any] = [FORMAT, blender.version]
    for file in files:
        state = file.stat()
        told += [str(file.resolve()), state.st_mtime_ns, state.st_size]
    told.append(entry)
    return hashlib.sha256(json.dumps(told).encode()).hexdigest()[:24]


def _takes(folder: Path) -> dict[str, Any] | None:
    """What a Blender said of a file, or None where it has not, or what it wrote is gone or damaged."""
    try:
        said = json.loads((folder / TAKES).read_text(encoding="utf-8"))
        whole = all((folder / take["file"]).is_file() and isinstance(take["action"], str) for take in said["takes"])
        whole = whole and all(isinstance(one["reason"], str) and "action" in one for one in said["left_out"])
    except (OSError, ValueError, KeyError, TypeError):
        return None
    return said if whole else None


def _left_out(file: Path, action: str | None, reason: str) -> core.Capture:
    return {"file": str(file), "action": action, "clip": None, "seconds": {}, "notes": [], "reason": reason}


def _shrink(folder: Path, used: set[Path]) -> None:
    """Throws away what was used longest ago where there is too much."""
    sizes: list[tuple[float, int, Path]] = []
    for kept in folder.iterdir():
        with suppress(OSError):
            size = sum(file.stat().st_size for file in kept.iterdir())
            used_last = kept / TAKES if (kept / TAKES).is_file() else kept
            sizes.append((used_last.stat().st_mtime, size, kept))
    total = sum(size for _, size, _ in sizes)
    for _, size, kept in sorted(sizes):
        if total <= KEPT_BYTES:
            break
        if kept not in used:
            total -= size
            shutil.rmtree(kept, ignore_errors=True)
