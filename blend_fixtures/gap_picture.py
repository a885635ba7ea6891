# SPDX-License-Identifier: GPL-3.0-or-later
"""The figure between the cupboards of the fixture `gap_room`, from the front; the cupboards are of glass.

python blend_fixtures/gap_picture.py WALK.blend --out gap.png
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector

sys.path.insert(0, str(Path(__file__).resolve().parent))

from cameras import View
from render import aim, draw, prepare
from walk import read_walk

#: The middle of the cupboards in depth, and from where the figure is seen, metres.
MIDDLE, PLACE, TARGET = -0.65, Vector((0, 2.6, 1.5)), Vector((0, -0.65, 0.98))
SIZE, GLASS = (800, 900), (0.75, 0.55, 0.30, 0.28)


def main(arguments: list[str]) -> None:
    parser = argparse.ArgumentParser(prog="gap_picture", description=__doc__.splitlines()[0])
    parser.add_argument("blend", type=Path, help="gap_room with a motion")
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args(arguments)
    bpy.ops.wm.open_mainfile(filepath=str(options.blend.resolve()))
    scene = bpy.context.scene
    walk = read_walk(scene)
    aim(prepare(scene, SIZE), View(PLACE, TARGET))
    glass = bpy.data.materials.new("Glass")
    glass.diffuse_color = GLASS
    for thing in scene.objects:
        if thing.name.startswith("Cupboards"):
            thing.data.materials.clear()
            thing.data.materials.append(glass)
        elif thing.type == "EMPTY":
            thing.hide_render = True
    # Shadows would darken the glass.
    scene.display.shading.show_shadows = False
    scene.frame_set(int(walk.frames[np.abs(walk.roots[:, 1] - MIDDLE).argmin()]))
    draw(scene, options.out)
    print(f"wrote {options.out}")


if __name__ == "__main__":
    main(sys.argv[1:])
