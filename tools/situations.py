# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes and captures as artists really have them, each with what comes of it: writes docs/situations.md.

    python tools/situations.py [--out docs/situations.md]

Runs on the bpy module with oncue_core beside it. Ends with an exit status of 1 where an outcome is another than is
written here.
"""

from __future__ import annotations

import argparse
import functools
import math
import os
import re
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

os.environ.setdefault("BLENDER_USER_RESOURCES", tempfile.mkdtemp(prefix="oncue-situations-"))

import bpy

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))


import addon  # noqa: E402
from addon import native  # noqa: E402
from addon.bridge import cue_objects, session  # noqa: E402
from addon.bridge.second_blender import second_blender  # noqa: E402
from addon.errors import SceneError  # noqa: E402
from addon.pipeline import LibraryCache, LibraryChoice, library_steps, run_blocking  # noqa: E402

FINE = "can be done"


class Situation(NamedTuple):
    """One row: what it is, how it is made, and the one thing that must come of it: a pattern, or `FINE` and no more."""

    what: str
    make: Callable[[], object]
    outcome: str = FINE


# --- scenes -----------------------------------------------------------------------------------------------------------


def box(name: str, size, place, parent=None) -> bpy.types.Object:
    import bmesh  # Blender's module makes it known.

    mesh = bpy.data.meshes.new(name)
    bm = bmesh.new()
    bmesh.ops.create_cube(bm, size=1.0)
    for vertex in bm.verts:
        vertex.co = [vertex.co[axis] * size[axis] for axis in range(3)]
    bm.to_mesh(mesh)
    bm.free()
    made = bpy.data.objects.new(name, mesh)
    made.location, made.parent = place, parent
    bpy.context.scene.collection.objects.link(made)
    bpy.context.view_layer.update()
    return made


def room(z: float = 0.0) -> None:
    """A floor of 7 × 6 m, a stool, a table, a start at (-2, 0) and a sit cue on the stool."""
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    box("Floor", (7, 6, 0.1), (0, 0, z - 0.05))
    box("Stool", (0.45, 0.45, 0.45), (1.5, 0, z + 0.225))
    box("Table", (0.6, 0.6, 0.75), (0, 1.2, z + 0.375))
    cue_objects.make_cue(bpy.context, "start", (-2, 0, z), math.radians(90))
    cue_objects.make_cue(bpy.context, "sit", (1.5, -0.02, z + 0.55), 0.0)


def thing(name: str) -> bpy.types.Object:
    return bpy.data.objects[name]


def cue(kind: str) -> bpy.types.Object:
    return next(found for found in bpy.data.objects if found.get("oncue_cue") == kind)


def moved(kind: str, place) -> None:
    cue(kind).location = place


def sky(radius: float) -> None:
    import bmesh  # Blender's module makes it known.

    mesh = bpy.data.meshes.new("Sky")
    bm = bmesh.new()
    bmesh.ops.create_uvsphere(bm, u_segments=32, v_segments=16, radius=radius)
    bm.to_mesh(mesh)
    bm.free()
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("Sky", mesh))


def walls(gap: float) -> None:
    """Across the room, with a gap in the middle."""
    side = (6 - gap) / 2
    for sign in (-1, 1):
        box("Wall", (0.1, side, 2.2), (-0.2, sign * (gap + side) / 2, 1.1))


def keyed(name: str, channel: str, *keys) -> None:
    for frame, value in keys:
        setattr(thing(name), channel, value)
        thing(name).keyframe_insert(channel, frame=frame)
    bpy.context.scene.frame_set(1)


def in_hidden_collection(name: str, how: str) -> None:
    collection = bpy.data.collections.new("Hidden")
    scene = bpy.context.scene
    scene.collection.children.link(collection)
    scene.collection.objects.unlink(thing(name))
    collection.objects.link(thing(name))
    layer = bpy.context.view_layer.layer_collection.children["Hidden"]
    if how == "eye":
        layer.hide_viewport = True
    elif how == "monitor":
        collection.hide_viewport = True
    else:
        layer.exclude = True


def barrier() -> bpy.types.Object:
    """A wall from side to side, which shuts the way."""
    return box("Barrier", (0.1, 6, 2), (-0.2, 0, 1))


def shown_as_wire() -> None:
    barrier().display_type = "WIRE"


def hidden(how: str) -> None:
    barrier()
    in_hidden_collection("Barrier", how)


def in_edit_mode() -> None:
    barrier()
    bpy.context.view_layer.objects.active = thing("Barrier")
    bpy.ops.object.mode_set(mode="EDIT")


def scaled(factor: float) -> None:
    """As a scene that was modelled in other units."""
    for found in bpy.data.objects:
        found.location *= factor
        if found.type == "MESH":
            found.scale *= factor


def bed(x: float) -> None:
    bpy.data.objects.remove(thing("Stool"))
    box("Bed", (2.0, 2.2, 0.5), (1.5, 0, 0.25))
    moved("sit", (x, 0, 0.6))
    cue("sit").rotation_euler.z = math.radians(-90)


def sill(back: float) -> None:
    """A sill of 2 × 1.6 m at seat height before a window, with a cue so far behind the middle of it."""
    bpy.data.objects.remove(thing("Stool"))
    box("Sill", (1.6, 2.0, 0.5), (2.2, 0, 0.25))
    box("Window", (0.1, 6.0, 2.4), (3.05, 0, 1.2))
    moved("sit", (1.8 + back, 0, 0.6))
    cue("sit").rotation_euler.z = math.radians(-90)


def grows() -> None:
    keyed("Table", "scale", (1, (1, 1, 1)), (50, (1, 1, 1.5)))


def cloth() -> None:
    box("Sheet", (0.5, 0.5, 0.02), (1.5, 2, 1.8)).modifiers.new("Cloth", "CLOTH")


def no_meshes() -> None:
    for found in [found for found in bpy.data.objects if found.type == "MESH"]:
        bpy.data.objects.remove(found)


def mirrored() -> None:
    thing("Table").scale.x = -1


def broken_mesh() -> None:
    thing("Table").data.vertices[0].co.x = math.nan


def instances() -> None:
    """A wall that a collection instance stands for."""
    collection = bpy.data.collections.new("Parts")
    barrier()
    bpy.context.scene.collection.objects.unlink(thing("Barrier"))
    collection.objects.link(thing("Barrier"))
    empty = bpy.data.objects.new("Instance", None)
    empty.instance_type, empty.instance_collection = "COLLECTION", collection
    bpy.context.scene.collection.objects.link(empty)


def array_modifier() -> None:
    """A post that a modifier repeats across the way."""
    post = box("Post", (0.1, 0.2, 2), (-0.2, -2.9, 1))
    modifier = post.modifiers.new("Array", "ARRAY")
    modifier.count, modifier.use_relative_offset, modifier.use_constant_offset = 30, False, True
    modifier.constant_offset_displace = (0, 0.2, 0)


def metaballs() -> None:
    """Two that flow into one, one of which moves."""
    for name, x in (("Goo", 0.0), ("Goo.001", 0.5)):
        made = bpy.data.objects.new(name, bpy.data.metaballs.new(name))
        made.data.elements.new().radius = 0.8
        made.data.resolution = 0.2
        made.location = (x, 2.2, 0.4)
        bpy.context.scene.collection.objects.link(made)
    keyed("Goo.001", "location", (1, (0.5, 2.2, 0.4)), (50, (1.2, 2.2, 0.4)))


def door(*keys) -> None:
    walls(0.9)
    leaf = box("Door", (0.06, 0.9, 2.1), (-0.2, -0.45, 1.05))
    for vertex in leaf.data.vertices:
        vertex.co.y += 0.45
    keyed("Door", "rotation_euler", *((frame, (0, 0, math.radians(-angle))) for frame, angle in keys))


def another(kind: str) -> None:
    cue_objects.make_cue(bpy.context, kind, (-1, -2, 0.0), 0.0)


def start_frame(frame: int) -> None:
    bpy.context.scene.oncue.start_frame = frame


def frame_rate(rate: int) -> None:
    bpy.context.scene.render.fps = rate


def overrides(text: str) -> None:
    bpy.context.scene.oncue.overrides = text


def storeys(start_z: float) -> None:
    box("Below", (12, 12, 0.1), (0, 0, -3.05))
    moved("start", (-2, 0, start_z))


def up(kind: str, z: float) -> None:
    cue(kind).location.z += z


SCENES = [
    Situation("a room with a stool and a table", lambda: None),
    Situation("a garden 12 m wide, 0.3 m lower", lambda: box("Garden", (12, 12, 0.02), (0, 0, -0.31))),
    Situation("a garden 12 m wide, 0.15 m lower", lambda: box("Garden", (12, 12, 0.02), (0, 0, -0.16))),
    Situation("a ground 100 m wide, 0.1 m lower", lambda: box("Ground", (100, 100, 0.02), (0, 0, -0.11))),
    Situation("a ground 1 km wide, 0.1 m lower", lambda: box("Ground", (1000, 1000, 0.02), (0, 0, -0.11))),
    Situation("a ground box under the house", lambda: box("Ground", (20, 20, 4), (0, 0, -2.1))),
    Situation("a storey below", lambda: box("Below", (10, 8, 0.1), (0, 0, -3.05))),
    Situation("a flat roof", lambda: box("Roof", (12, 12, 0.2), (0, 0, 3.0))),
    Situation("a sky sphere of 8 m", lambda: sky(8)),
    Situation("a sky sphere of 25 m", lambda: sky(25)),
    Situation("a sky sphere of 500 m", lambda: sky(500)),
    Situation("a rug under the start", lambda: box("Rug", (2, 2, 0.02), (-2, 0, 0.01))),
    Situation("a podium of one step beside the way", lambda: box("Podium", (7, 1.2, 0.16), (0, -2.3, 0.08))),
    Situation("the start a storey below the cue", lambda: storeys(-3.0), "on another level than start"),
    Situation("the start on the table", lambda: moved("start", (0, 1.2, 0.75)), "stands on another level than start"),
    Situation("the start 0.6 m in the air", lambda: up("start", 0.6), "0.60 m over the nearest surface"),
    Situation("the start outside the scene", lambda: moved("start", (-9, 0, 0)), "lies outside the scene"),
    Situation("the start in the table", lambda: moved("start", (0, 1.2, 0)), "inside furniture or a wall"),
    Situation("no start", lambda: bpy.data.objects.remove(cue("start")), "There is no Start"),
    Situation("no end cue", lambda: bpy.data.objects.remove(cue("sit")), "There is no"),
    Situation("two starts", lambda: another("start"), "is a cue of nobody"),
    Situation("a sit cue and a stop cue", lambda: another("stop")),
    Situation("a sit cue 1 m over the stool", lambda: up("sit", 1.0), "floats"),
    Situation("a sit cue under the floor", lambda: up("sit", -1.2), "below the floor"),
    Situation("a sit cue in the stool", lambda: up("sit", -0.25), "inside furniture"),
    Situation("a cue on the near edge of a bed", lambda: bed(0.72)),
    Situation("a cue in the middle of a bed", lambda: bed(1.5), "The nearest edge to sit on is"),
    Situation("a cue on the edge of a wide window-sill", lambda: sill(-0.12)),
    Situation("a cue at the back of a wide window-sill", lambda: sill(0.6), "The nearest edge to sit on is"),
    Situation("a wall from side to side", barrier, "cannot be reached"),
    Situation("the same wall shown as wire", shown_as_wire),
    Situation("the same wall hidden by its collection's eye", lambda: hidden("eye")),
    Situation("the same wall hidden by its collection's monitor", lambda: hidden("monitor")),
    Situation("the same wall in a collection that the view layer excludes", lambda: hidden("exclude")),
    Situation("the same wall in edit mode", in_edit_mode, "cannot be reached"),
    Situation("the same wall by a collection instance", instances, "cannot be reached"),
    Situation("a fence by an array modifier", array_modifier, "cannot be reached"),
    Situation("a gap of 0.9 m in a wall", lambda: walls(0.9)),
    Situation("a gap of 0.15 m in a wall", lambda: walls(0.15), "cannot be reached"),
    Situation("a door that is open and shuts later", lambda: door((1, 90), (30, 0)), "^can be done; moves: Door$"),
    Situation("a table that grows", grows, "^can be done; moves: Table$"),
    Situation("a cloth that is not baked", cloth, "^can be done; .*Sheet is simulated and not baked"),
    Situation("metaballs of which one moves", metaballs, "^can be done; Goo has another number of corners"),
    Situation("a mirrored table", mirrored),
    Situation(
        "a table with a vertex that is no number", broken_mesh, "^can be done; Table has vertices that are not numbers"
    ),
    Situation("a scene with no mesh", no_meshes, "no visible mesh"),
    Situation("a scene in centimetres", lambda: scaled(100), "modelled in centimetres"),
    Situation("a scene in millimetres", lambda: scaled(1000), "modelled in millimetres"),
    Situation("a shot that begins at frame 1001", lambda: start_frame(1001)),
    Situation("1 frame a second", lambda: frame_rate(1), "1 frames a second"),
    Situation("120 frames a second", lambda: frame_rate(120)),
    Situation("overrides that are no JSON", lambda: overrides("{ppo"), "not JSON"),
    Situation("overrides with a name that there is not", lambda: overrides('{"pop": 1}'), "no setting pop"),
    Situation("the floor's height overruled", lambda: overrides('{"scene": {"floor_height": -3}}'), "3.00 m over"),
    Situation("a storey 4.37 m up, all of it", lambda: (room(4.37), box("Street", (30, 30, 0.1), (0, 0, -0.05)))),
]


def scene_outcome(situation: Situation) -> tuple[str, bool]:
    room()
    situation.make()
    bpy.context.view_layer.update()
    core = native.core
    try:
        request, notes = session.read_request(bpy.context)
        settings = session_settings(request)
        scene = core.index_scene(request.positions, request.triangles, settings["scene"], request.task).result()
        core.check_task(scene, request.task)
    except (SceneError, core.OncueError) as error:
        said = str(error)
        return said, bool(re.search(situation.outcome, said))
    finally:
        if bpy.context.mode != "OBJECT":
            bpy.ops.object.mode_set(mode="OBJECT")
    told = [f"moves: {', '.join(moving.name for moving in request.moving)}"] if request.moving else []
    said = "; ".join([FINE, *told, *(sentence for _, sentence in notes)])
    return said, said == FINE if situation.outcome == FINE else bool(re.search(situation.outcome, said))


def session_settings(request) -> dict:
    from addon.pipeline import merged

    return merged(native.core.default_settings(request.preset), request.overrides)


# --- captures ---------------------------------------------------------------------------------------------------------


@functools.cache
def walk() -> str:
    """A walk of nine seconds, from the starter library, in centimetres with Y up."""
    starter = native.core.Library.starter()
    number = next(k for k, name in enumerate(starter.clip_names) if name == "walk 1.00 m/s")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "walk.bvh"
        starter.write_bvh(number, str(path))
        return path.read_text(encoding="utf-8")


def joints() -> list[str]:
    return re.findall(r"(?:ROOT|JOINT) (\w+)\n", walk())


def renamed(rule: Callable[[str], str]) -> str:
    return re.sub(r"(ROOT|JOINT) (\w+)\n", lambda match: f"{match[1]} {rule(match[2])}\n", walk())


def exchanged(name: str) -> str:
    pairs = {"Left": "Right", "Right": "Left"}
    side = next((side for side in pairs if name.startswith(side)), "")
    return pairs[side] + name.removeprefix(side) if side else name


def timed(frame_time: str) -> str:
    return re.sub(r"Frame Time: \S+", f"Frame Time: {frame_time}", walk())


def rows(change: Callable[[list[float], int], list[float]], frames: int | None = None) -> str:
    """The walk with each frame's numbers changed; of the first `frames` alone."""
    head, _, tail = walk().partition("Frame Time:")
    time, *lines = tail.strip().split("\n")
    kept = lines[:frames]
    head = re.sub(r"Frames: \d+", f"Frames: {len(kept)}", head)
    changed = (change([float(word) for word in line.split()], k) for k, line in enumerate(kept))
    return "\n".join([f"{head}Frame Time:{time}", *(" ".join(f"{v:.6f}" for v in row) for row in changed)]) + "\n"


def in_place() -> str:
    return rows(lambda row, _: [0.0, row[1], 0.0, *row[3:]])


def way_times(factor: float) -> str:
    """The root counts otherwise than the bones."""
    return rows(lambda row, _: [factor * row[0], row[1], factor * row[2], *row[3:]])


def on_skates() -> str:
    """The first posture, which goes a metre a second."""
    first: list[float] = []

    def held(row: list[float], k: int) -> list[float]:
        first.extend(() if first else row)
        return [first[0] + 100 * k / 30, *first[1:]]

    return rows(held)


def sunk(amount: float) -> str:
    return rows(lambda row, _: [row[0], row[1] - amount, *row[2:]])


def with_a_jump() -> str:
    return rows(lambda row, k: [row[0] + (300.0 if k > 120 else 0.0), *row[1:]])


def frozen() -> str:
    first: list[float] = []
    return rows(lambda row, _: first or first.extend(row) or first)


def without_motion() -> str:
    return walk().partition("MOTION")[0]


def cut_off() -> str:
    return walk()[: int(0.7 * len(walk()))]


def in_metres() -> str:
    def smaller(match: re.Match[str]) -> str:
        return "OFFSET " + " ".join(f"{float(match[k]) / 100:.6f}" for k in (1, 2, 3))

    head, motion, tail = rows(lambda row, _: [v / 100 for v in row[:3]] + row[3:]).partition("MOTION")
    return re.sub(r"OFFSET (\S+) (\S+) (\S+)", smaller, head) + motion + tail


def toy() -> str:
    """The walk with thighs and shins of a third of their length."""
    shorter, lines = False, []
    for line in walk().splitlines():
        words = line.split()
        if words[:1] == ["JOINT"]:
            shorter = words[1] in ("LeftLeg", "RightLeg", "LeftFoot", "RightFoot")
        elif words[:1] == ["OFFSET"] and shorter:
            line, shorter = "OFFSET " + " ".join(f"{0.33 * float(word):.6f}" for word in words[1:]), False
        lines.append(line + "\n")
    return "".join(lines)


def exported(suffix: str) -> Path:
    """The walk as an armature, as Blender exports it."""
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    folder = Path(tempfile.mkdtemp(prefix="oncue-situations-"))
    source = folder / "walk.bvh"
    source.write_text(walk(), encoding="utf-8")
    bpy.ops.import_anim.bvh(filepath=str(source), global_scale=0.01)
    path = folder / f"capture{suffix}"
    if suffix == ".fbx":
        bpy.ops.export_scene.fbx(filepath=str(path))
    else:
        kind = {".glb": "GLB", ".gltf": "GLTF_SEPARATE"}[suffix]
        bpy.ops.export_scene.gltf(filepath=str(path), export_format=kind)
    return path


def without_numbers() -> Path:
    """A .gltf that somebody sent without the file beside it."""
    path = exported(".gltf")
    path.with_suffix(".bin").unlink()
    return path


def without_armature() -> Path:
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    box("Box", (1, 1, 1), (0, 0, 0))
    path = Path(tempfile.mkdtemp(prefix="oncue-situations-")) / "capture.glb"
    bpy.ops.export_scene.gltf(filepath=str(path))
    return path


USED, LEFT_OUT = "is used", "is left out"

CAPTURES = [
    Situation("a walk of nine seconds", walk, r"is used \(walk"),
    Situation(
        "joints with a prefix (mixamorig:)", lambda: renamed(lambda name: f"mixamorig:{name}"), r"is used \(walk"
    ),
    Situation("joints with an unknown prefix", lambda: renamed(lambda name: f"Actor07_{name}"), r"is used \(walk"),
    Situation("joints with a suffix", lambda: renamed(lambda name: f"{name}_jnt"), r"is used \(walk"),
    Situation("joints in lower case", lambda: renamed(str.lower), r"is used \(walk"),
    Situation("joints that are numbered", lambda: renamed(lambda name: f"b{joints().index(name)}"), r"is used \(walk"),
    Situation("left and right exchanged by name", lambda: renamed(exchanged), r"is used \(walk"),
    Situation("a frame time of 0", lambda: timed("0"), LEFT_OUT),
    Situation("a frame time of 1 s", lambda: timed("1"), "30 was taken"),
    Situation("a frame time that is no number", lambda: timed("fast"), LEFT_OUT),
    Situation("walking in place", in_place, "walks on the spot.*given back from its planted feet"),
    Situation("a way twice as long as its steps", lambda: way_times(2.0), r"is used \(walk .*were taken as"),
    Situation("a way half as long as its steps", lambda: way_times(0.5), r"is used \(walk .*were taken as"),
    Situation("somebody on skates", on_skates, "left out.*its feet glide"),
    Situation("a floor 1.2 m higher than the feet", lambda: sunk(120.0), r"is used \(walk"),
    Situation("a jump of 3 m in the middle", with_a_jump, r"is used \(walk .*are not walking, standing or sitting"),
    Situation("one posture all the time", frozen, r"is used \(idle [\d.]+ s\)$"),
    Situation("ten frames", lambda: rows(lambda row, _: row, 10), LEFT_OUT),
    Situation("a hierarchy without motion", without_motion, LEFT_OUT),
    Situation("a file that is cut off", cut_off, r"is used \(walk"),
    Situation("an empty file", lambda: "", LEFT_OUT),
    Situation("a picture with another name", lambda: "\x89PNG\r\n\x1a\n" + "\0" * 64, LEFT_OUT),
    Situation("line ends of another system", lambda: walk().replace("\n", "\r\n"), r"is used \(walk"),
    Situation("decimal commas", lambda: walk().replace(".", ","), r"is used \(walk"),
    Situation("places in metres", in_metres, r"is used \(walk"),
    Situation("a toy's legs", toy, "left out.*times as long as its trunk"),
    Situation("the walk as .fbx", lambda: exported(".fbx"), r"is used \(walk"),
    Situation("the walk as .glb", lambda: exported(".glb"), r"is used \(walk"),
    Situation("a .gltf without the .bin that belongs to it", without_numbers, "capture.bin.*is not beside it"),
    Situation("a .glb without an armature", without_armature, "it holds no armature"),
]


def capture_outcome(situation: Situation, folder: Path) -> tuple[str, bool]:
    made = situation.make()
    path = made if isinstance(made, Path) else folder / "capture.bvh"
    if path is not made:
        path.write_text(str(made), encoding="latin-1", newline="")
    choice = LibraryChoice((str(path),), "all", "", second_blender())
    try:
        _, captures = run_blocking(library_steps(choice, LibraryCache()))
    except native.expected_errors() as error:
        said = f"{LEFT_OUT}: {str(error).replace(str(path.parent) + '/', '')}"
    else:
        (capture,) = captures
        gave = ", ".join(f"{label} {seconds:.1f} s" for label, seconds in capture["seconds"].items() if seconds >= 0.1)
        told = [USED + (f" ({gave})" if gave else "")] if capture["clip"] else [LEFT_OUT]
        said = ": ".join(filter(None, [told[0], " ".join([*capture["notes"], capture["reason"] or ""]).strip()]))
    return said, bool(re.search(situation.outcome, said))


# --- the table --------------------------------------------------------------------------------------------------------

HEAD = """# Situations

Scenes and captures as artists really have them, and what Oncue says of each. `nox -s situations` makes this page, and
fails where an outcome is another than it is meant to be.

## Scenes

A floor of 7 × 6 m, a stool, a table, a start and a sit cue on the stool, and then:

| situation | outcome |
|---|---|
"""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "situations.md")
    options = parser.parse_args()
    addon.register()
    wrong, lines = [], [HEAD]
    with tempfile.TemporaryDirectory() as folder:
        for situations, outcome in (
            (SCENES, scene_outcome),
            (CAPTURES, lambda situation: capture_outcome(situation, Path(folder))),
        ):
            if situations is CAPTURES:
                lines.append("\n## Captures\n\n| situation | outcome |\n|---|---|\n")
            for situation in situations:
                said, right = outcome(situation)
                lines.append(f"| {situation.what} | {said.replace('|', '/').replace(chr(10), ' ')} |\n")
                if not right:
                    wrong.append(f"{situation.what}: {said} (not “{situation.outcome}”)")
    options.out.write_text("".join(lines), encoding="utf-8")
    print(f"{len(SCENES) + len(CAPTURES)} situations, {len(wrong)} not as they are meant to be")
    print("\n".join(wrong), flush=True)
    return 1 if wrong else 0


if __name__ == "__main__":
    status = main()
    sys.stdout.flush()
    # Some Blenders crash at exit while classes are registered.
    os._exit(status)
