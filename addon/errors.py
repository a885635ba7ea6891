# SPDX-License-Identifier: GPL-3.0-or-later
"""What the extension itself can say no to. Each message is one sentence for an artist."""

from __future__ import annotations


class SceneError(Exception):
    """Something in the scene, the cues or the chosen files keeps the run from starting."""


class ScaleError(SceneError):
    """The scene's size says that it was not modelled in metres: another scene scale is the remedy."""


class CharacterError(SceneError):
    """The character is in a state in which it would not play the motion as it is made; it can be reset."""


class EdgeError(SceneError):
    """A cue lies too far from the edge of its seat to be sat down on.

    `place`, world, metres, and `yaw`, radians: where and how it could be.
    """

    def __init__(self, sentence: str, place: tuple[float, float, float], yaw: float) -> None:
        super().__init__(sentence)
        self.place, self.yaw = place, yaw


class FollowingEnded(Exception):
    """The cues cannot be followed any further; the message says why."""
