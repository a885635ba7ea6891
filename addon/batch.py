# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs Oncue without a window:

    blender -b scene.blend --python-exit-code 1 -P addon/batch.py -- --out out.blend --report out.json --seed 1
    python addon/batch.py scene.blend --out out.blend --report out.json --seed 1        (with the bpy module)

Uses the installed extension where it is enabled, else the folder that this file lies in (oncue_core must then be
importable). Exits with 0; with 1 and a sentence where there is no result, with 2 where the command line cannot be read,
with 3 where a cue was not met.
"""

import importlib
import os
import sys
from pathlib import Path

import bpy


def package():
    """The extension's package: enabled in this Blender, or this file's own folder."""
    for entry in bpy.context.preferences.addons:
        if entry.module.rsplit(".", 1)[-1] == "oncue" and entry.module in sys.modules:
            return sys.modules[entry.module]
    folder = Path(__file__).resolve().parent
    sys.path.insert(0, str(folder.parent))
    source = importlib.import_module(folder.name)
    source.register()
    return source


def arguments() -> list[str]:
    """What stands behind `--`; everything where there is no Blender before it."""
    if "--" in sys.argv:
        return sys.argv[sys.argv.index("--") + 1 :]
    return [] if bpy.app.binary_path else sys.argv[1:]


if __name__ == "__main__":
    found = package()
    status = importlib.import_module(f"{found.__name__}.command_line").main(arguments())
    if bpy.app.binary_path:
        sys.exit(status)
    # Blender's module can crash or hang while Python takes it down; what was asked for is written.
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status)
