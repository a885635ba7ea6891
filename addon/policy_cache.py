# SPDX-License-Identifier: GPL-3.0-or-later
"""Policies kept from run to run: one file for each scene and motion library, the oldest thrown away first.

Where the prior fails, the policy that an earlier task in the scene left is played, or fine-tuned, instead of beginning
anew. A file whose scene or library has changed is never found again: both are in its name, and in the file.
"""

from __future__ import annotations

import hashlib
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from . import native
from .native import core

SUFFIX = ".oncuepolicy"
#: Half a file older than this is nobody's any more, nanoseconds: a day.
STALE_NS = 86_400 * 10**9


@dataclass(frozen=True)
class Entry:
    """One kept policy."""

    path: Path
    bytes: int
    #: What it was optimized for; None for a file that cannot be read, and then why.
    origin: core.PolicyOrigin | None
    fault: str = ""

    def describe(self) -> str:
        """In a line what it serves."""
        if self.origin is None:
            return f"{self.path.name}: {self.fault}"
        cues = self.origin["cues"]
        named = ", ".join(dict.fromkeys(cue["name"] for cue in cues[-3:]))
        more = f" and {len(cues) - 3} more" if len(cues) > 3 else ""
        return f"{named}{more}: {self.origin['updates']} updates, {100 * self.origin['success_rate']:.0f} % met"


class PolicyCache:
    """The folder of kept policies. Nothing here fails a run: a folder that cannot be written keeps nothing."""

    def __init__(self, folder: Path, limit_bytes: int) -> None:
        self._folder, self._limit = folder, limit_bytes

    def find(self, scene: core.SceneIndex, library: core.Library) -> core.Policy | None:
        """The policy of this scene and library, or None."""
        path = self._path(scene, library)
        try:
            policy = core.Policy.read(path)
        except core.DamagedFileError:
            with suppress(OSError):
                path.unlink(missing_ok=True)
            return None
        except native.expected_errors():
            return None
        # A folder that cannot be written forgets by what was made last, not by what was used last.
        with suppress(OSError):
            path.touch()
        return policy if policy.belongs_to(scene, library.checksum) else None

    def keep(self, scene: core.SceneIndex, library: core.Library, policy: core.Policy) -> bool:
        """Keeps it in place of an earlier one; whether it could. That of a newer Oncue stays."""
        path = self._path(scene, library)
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            if path.exists() and _is_newer(path):
                return False
            policy.write(path)
            self._shrink()
        except OSError:
            return False
        return True

    def entries(self) -> list[Entry]:
        """Newest first."""
        return [Entry(path, size, *_read(path)) for path, _, size in reversed(self._files())]

    def clear(self, name: str = "") -> int:
        """Throws the file `name` away, or all; how many there were."""
        gone = 0
        for path, _, _ in self._files():
            if name in ("", path.name):
                with suppress(OSError):
                    path.unlink()
                    gone += 1
        return gone

    def _path(self, scene: core.SceneIndex, library: core.Library) -> Path:
        name = hashlib.sha256(f"{scene.fingerprint} {library.checksum}".encode()).hexdigest()[:24]
        return self._folder / f"{name}{SUFFIX}"

    def _files(self, suffix: str = SUFFIX) -> list[tuple[Path, int, int]]:
        """(file, time of its last use in ns, bytes), oldest first; without what is taken away meanwhile."""
        found = []
        try:
            for path in self._folder.iterdir():
                with suppress(FileNotFoundError):
                    state = path.stat()
                    if path.suffix == suffix and path.is_file():
                        found.append((path, state.st_mtime_ns, state.st_size))
        except OSError:
            return []
        return sorted(found, key=lambda file: (file[1], file[0].name))

    def _shrink(self) -> None:
        files = self._files()
        total = sum(size for _, _, size in files)
        # The newest stays, however small the limit.
        for path, _, size in files[:-1]:
            if total <= self._limit:
                break
            total -= size
            path.unlink(missing_ok=True)
        # What a Blender left that was killed while it wrote.
        for path, used, _ in self._files(".part"):
            if time.time_ns() - used > STALE_NS:
                path.unlink(missing_ok=True)


def _read(path: Path) -> tuple[core.PolicyOrigin | None, str]:
    """What it was optimized for, or None and what is amiss with it."""
    try:
        return core.Policy.read(path).origin, ""
    except core.DamagedFileError:
        return None, "damaged"
    except core.NewerFileError:
        return None, "made by a newer Oncue"
    except core.DataFileError:
        return None, "made by an older Oncue"
    except native.expected_errors():
        return None, "cannot be read"


def _is_newer(path: Path) -> bool:
    """Whether a newer Oncue made it, which will want it again."""
    try:
        core.Policy.read(path)
    except core.NewerFileError:
        return True
    except native.expected_errors():
        return False
    return False
