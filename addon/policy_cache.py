# SPDX-License-Identifier: GPL-3.0-or-later
"""Policies kept from run to run: one file for each scene and motion library, the oldest thrown away first.

Where the prior fails, the policy that an earlier task in the scene left is played, or fine-tuned, instead of beginning
anew. A file whose scene or library has changed is never found again: both are in its name, and in the file.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

from . import native
from .native import core

SUFFIX = ".oncuepolicy"


@dataclass(frozen=True)
class Entry:
    """One kept policy."""

    path: Path
    bytes: int
    #: What it was optimized for; None for a file that cannot be read.
    origin: core.PolicyOrigin | None

    def describe(self) -> str:
        """In a line what it serves."""
        if self.origin is None:
            return f"{self.path.name}: damaged"
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
            path.touch()
        except FileNotFoundError:
            return None
        except native.expected_errors():
            path.unlink(missing_ok=True)
            return None
        return policy if policy.belongs_to(scene, library.checksum) else None

    def keep(self, scene: core.SceneIndex, library: core.Library, policy: core.Policy) -> bool:
        """Keeps it in place of an earlier one; whether it could."""
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            policy.write(self._path(scene, library))
            self._shrink()
        except OSError:
            return False
        return True

    def entries(self) -> list[Entry]:
        """Newest first."""
        return [Entry(path, path.stat().st_size, _origin(path)) for path in reversed(self._files())]

    def clear(self, name: str = "") -> int:
        """Throws the file `name` away, or all; how many there were."""
        files = [path for path in self._files() if name in ("", path.name)]
        for path in files:
            path.unlink(missing_ok=True)
        return len(files)

    def _path(self, scene: core.SceneIndex, library: core.Library) -> Path:
        name = hashlib.sha256(f"{scene.fingerprint} {library.checksum}".encode()).hexdigest()[:24]
        return self._folder / f"{name}{SUFFIX}"

    def _files(self) -> list[Path]:
        """Oldest first."""
        try:
            found = [path for path in self._folder.iterdir() if path.suffix == SUFFIX]
        except OSError:
            return []
        return sorted(found, key=lambda path: (path.stat().st_mtime_ns, path.name))

    def _shrink(self) -> None:
        files = self._files()
        total = sum(path.stat().st_size for path in files)
        # The newest stays, however small the limit.
        for path in files[:-1]:
            if total <= self._limit:
                return
            total -= path.stat().st_size
            path.unlink(missing_ok=True)


def _origin(path: Path) -> core.PolicyOrigin | None:
    try:
        return core.Policy.read(path).origin
    except native.expected_errors():
        return None
