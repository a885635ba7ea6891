# SPDX-License-Identifier: GPL-3.0-or-later
"""Actions of the open file on their way to the second Blender, which makes captures of them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import bpy

from ..errors import SceneError
from ..foreign_captures import convert_steps
from ..pipeline import Steps
from .armature_motion import armature_actions
from .scene_time import frame_rate
from .second_blender import second_blender


@dataclass(frozen=True)
class Taken:
    """The text of a .bvh, and the action that it shows."""

    action: str
    text: str


def own_action_steps(context: bpy.types.Context, armature: bpy.types.Object, *, every: bool) -> Steps[list[Taken]]:
    """Makes captures of the action that an armature plays, or of every action of the file that moves its bones.

    Reads the file at once, and changes nothing in it. Raises SceneError where there is no action.
    """
    data = armature.animation_data
    playing = data.action if data is not None else None
    if every:
        actions = list(dict.fromkeys(take.action for take in armature_actions(armature)))
    else:
        actions = [playing] if playing is not None else []
    if not actions:
        what = "no action moves its bones" if every else "it plays no action"
        raise SceneError(f"‘{armature.name}’ cannot be captured: {what}.")
    scratch = TemporaryDirectory(prefix="oncue-")
    path = Path(scratch.name) / f"{bpy.path.clean_name(armature.name)}.blend"
    # The armature as the artist left it, with all that it hangs on; not the scene.
    bpy.data.libraries.write(str(path), {armature, *actions}, path_remap="ABSOLUTE", fake_user=True)
    entry = {
        "armature": armature.name,
        "actions": [action.name for action in actions],
        "rate": frame_rate(context.scene),
    }
    return _steps(scratch, path, entry)


def _steps(scratch: TemporaryDirectory, path: Path, entry: dict) -> Steps[list[Taken]]:
    with scratch:
        blender = replace(second_blender(), folder=Path(scratch.name) / "captures")
        converted = yield from convert_steps([path], blender, entry)
        if not converted.sources:
            first = converted.left_out[0]
            raise SceneError(f"‘{entry['armature']}’ cannot be captured: {first['reason']}")
        return [
            Taken(source["action"], Path(file).read_text(encoding="utf-8"))
            for file, source in converted.sources.items()
        ]
