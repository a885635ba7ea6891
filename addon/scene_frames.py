# SPDX-License-Identifier: GPL-3.0-or-later
"""The core's sentences for an artist: frames as the scene counts them."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager

from . import native
from .body_size import sentence_in_scene
from .errors import EdgeError, SceneError

#: The core's frames a second.
CORE_RATE = 30.0
#: “frame 274”, “frames 12 to 80”, “between frames 4 and 5”, “from frame 3 to 9”, “the motion's last, 60”; a name in
#: quotes may look the same, and is let be.
_FRAMES = re.compile(
    r"(?P<name>‘[^’]*’)|(?P<words>\bframes? |\bthe motion's last, )"
    r"(?P<first>\d+)(?:(?P<between> (?:to|and) )(?P<last>\d+))?"
)


def in_scene_frames(sentence: str, start_frame: int, scene_rate: float) -> str:
    """A sentence of the core, which counts frames from 0 at 30 a second, with the frames of the scene.

    `start_frame` is the scene's frame of the core's frame 0, `scene_rate` its frames a second.
    """

    def scene_frame(core_frame: str) -> str:
        return str(round(start_frame + int(core_frame) * scene_rate / CORE_RATE))

    def told(match: re.Match[str]) -> str:
        if match["name"]:
            return match["name"]
        last = f"{match['between']}{scene_frame(match['last'])}" if match["last"] else ""
        return f"{match['words']}{scene_frame(match['first'])}{last}"

    return _FRAMES.sub(told, sentence)


@contextmanager
def told_in_scene_frames(start_frame: int, scene_rate: float, size: float = 1.0) -> Iterator[None]:
    """What the core refuses in the block is a SceneError that names the scene's frames, and its metres where the body
    is `size` times as large as the core's."""
    try:
        yield
    except native.core.EdgeError as error:
        x, y, z = error.place
        raise EdgeError(sentence_in_scene(str(error), size), (x * size, y * size, z * size), error.yaw) from error
    except native.core.InputError as error:
        told = in_scene_frames(str(error), start_frame, scene_rate)
        raise SceneError(sentence_in_scene(told, size)) from error
