# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures that a person can judge a motion by, drawn without a display by Workbench.

    python blend_fixtures/render.py FILE.blend --picture demo.png [--video demo.mp4]
    python blend_fixtures/render.py FILE.blend --sheet sheet.png [--views overview follow seat] [--frames 10]

The picture shows the room cut open towards the camera, the way on the floor and the figure at several moments,
blue at the start and orange at the end. A sheet is a grid: a row a view, the same frames in each.
"""

from __future__ import annotations

import argparse
import math
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import bpy  # before bmesh: the bpy module brings it

# isort: split
import bmesh
import numpy as np
from mathutils import Vector

sys.path[:0] = [str(Path(__file__).resolve().parent), str(Path(__file__).resolve().parents[1])]

from addon.bridge import compat  # noqa: E402
from addon.bridge.names import CHARACTER_KEY, CUE_KEY  # noqa: E402

PICTURE_SIZE, SHEET_SIZE, VIDEO_SIZE = (1600, 900), (480, 400), (640, 360)
#: Without a GPU a frame takes 0.2 s; a video is to take less than a minute.
VIDEO_FRAMES = 200
#: Colours from the start of the motion to its end, linear RGB.
GRADE = np.array([(0.06, 0.20, 0.62), (0.05, 0.45, 0.45), (0.55, 0.50, 0.08), (0.85, 0.25, 0.04)])
#: What blocks the view is cut off this high over the floor; nothing is shown above the ceiling's height. Metres.
STUMP, CEILING = 0.25, 2.3
LENS = 40.0
#: Nearer to the end than this the picture shows the last posture only, metres.
APART = 0.7


@dataclass
class Walk:
    """The keyed motion, as the pictures need it."""

    character: bpy.types.Object
    bodies: list[bpy.types.Object]
    frames: np.ndarray
    #: Root joint and head joint in the world at each frame, shape (frames, 3).
    roots: np.ndarray
    heads: np.ndarray
    #: Where the pelvis faces on the floor at each frame, unit vectors (frames, 2).
    facings: np.ndarray
    floor: float

    def moments(self, count: int, apart: float = 0.0) -> np.ndarray:
        """Frames that share the motion evenly between them, first and last included.

        With `apart`, none but the last shows the figure within that many metres of where it ends.
        """
        step = np.linalg.norm(np.diff(self.roots, axis=0), axis=1) + np.linalg.norm(np.diff(self.heads, axis=0), axis=1)
        way = np.concatenate([[0.0], np.cumsum(step + 1e-5)])
        away = np.linalg.norm(self.roots[:, :2] - self.roots[-1, :2], axis=1) >= apart
        last = int(np.flatnonzero(away)[-1]) if apart and away.any() else len(way) - 1
        parts = np.linspace(0.0, way[last], count - 1 if apart else count)
        chosen = [int(np.abs(way - part).argmin()) for part in parts]
        return self.frames[sorted({*chosen, len(way) - 1})]


def read_walk(scene: bpy.types.Scene) -> Walk:
    """The motion of the scene's character. Raises SystemExit when there is none."""
    found = [o for o in scene.objects if o.type == "ARMATURE" and o.get(CHARACTER_KEY)]
    found = [o for o in found if o.animation_data and o.animation_data.action]
    if not found:
        raise SystemExit("The file has no character with an action: run a synthesis first.")
    character = found[0]
    first, last = character.animation_data.action.frame_range
    frames = np.arange(int(first), int(last) + 1)
    roots, heads, facings, lowest = [], [], [], math.inf
    for frame in frames:
        scene.frame_set(int(frame))
        posed = character.evaluated_get(bpy.context.evaluated_depsgraph_get())
        world, bones = posed.matrix_world, posed.pose.bones
        roots.append(world @ bones["Hips"].head)
        heads.append(world @ bones["Head"].head)
        across = world.to_3x3() @ (bones["LeftUpLeg"].head - bones["RightUpLeg"].head)
        facings.append(Vector((across.y, -across.x)).normalized())
        lowest = min(lowest, (world @ bones["LeftToe"].head).z, (world @ bones["RightToe"].head).z)
    bodies = [o for o in scene.objects if o.type == "MESH" and o.get(CHARACTER_KEY)]
    starts = [o.matrix_world.translation.z for o in scene.objects if o.get(CUE_KEY) == "start"]
    floor = starts[0] if starts else lowest - 0.025
    return Walk(character, bodies, frames, np.array(roots), np.array(heads), np.array(facings), floor)


# --- the stage -------------------------------------------------------------------------------------------------------


def prepare(scene: bpy.types.Scene, size: tuple[int, int]) -> bpy.types.Object:
    """Workbench with soft shading, shadows and cavities, and a camera."""
    render, shading = scene.render, scene.display.shading
    render.engine = "BLENDER_WORKBENCH"
    render.resolution_x, render.resolution_y = size
    render.resolution_percentage = 100
    render.use_stamp = False
    shading.light, shading.color_type = "STUDIO", "MATERIAL"
    # Shadows and cavities take most of a frame's time without a GPU.
    shading.show_shadows, shading.shadow_intensity = size != VIDEO_SIZE, 0.25
    shading.show_cavity, shading.cavity_type = size != VIDEO_SIZE, "BOTH"
    shading.show_object_outline = True
    shading.object_outline_color = (0.05, 0.05, 0.06)
    scene.display.light_direction = (0.25, 0.15, 0.95)
    # Without a GPU each sample costs a frame's whole time: smooth edges for the one picture only.
    scene.display.render_aa = "8" if size == PICTURE_SIZE else "FXAA"
    scene.view_settings.view_transform = "Standard"
    scene.view_settings.exposure = 0.7
    scene.world = scene.world or bpy.data.worlds.new("Backdrop")
    scene.world.color = (0.45, 0.47, 0.49)
    camera = bpy.data.objects.new("Picture Camera", bpy.data.cameras.new("Picture Camera"))
    camera.data.lens = LENS
    scene.collection.objects.link(camera)
    scene.camera = camera
    return camera


def aim(camera: bpy.types.Object, place: Vector, target: Vector, *, see_from: float = 0.05) -> None:
    """Points the camera; what is nearer than `see_from` metres is not drawn."""
    camera.location = place
    camera.rotation_euler = (target - place).to_track_quat("-Z", "Y").to_euler()
    camera.data.clip_start, camera.data.clip_end = max(see_from, 0.05), 200.0


def open_room(scene: bpy.types.Scene, walk: Walk, camera_place: Vector) -> None:
    """Replaces the scene's meshes by copies that are cut where they stand between the camera and the figure."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    copies = []
    for instance in depsgraph.object_instances:
        thing = instance.object
        if thing.type != "MESH" or thing.original.get(CHARACTER_KEY) or thing.original.get(CUE_KEY):
            continue
        mesh = bpy.data.meshes.new_from_object(thing)
        mesh.transform(instance.matrix_world)
        copies.append((thing.original.name, mesh))
    for thing in list(scene.objects):
        if thing.type not in {"CAMERA", "ARMATURE"} and thing not in walk.bodies:
            thing.hide_render = thing.hide_viewport = True
    objects = []
    for name, mesh in copies:
        made = bpy.data.objects.new(f"Shown {name}", mesh)
        scene.collection.objects.link(made)
        objects.append(made)
        _cut(made, Vector((0, 0, walk.floor + CEILING)), Vector((0, 0, 1)))
    for body in walk.bodies:
        body.hide_viewport = True
    for _ in range(8):
        bpy.context.view_layer.update()
        blockers = _blockers(scene, walk, camera_place)
        if not blockers:
            break
        for blocker in blockers:
            _lower(blocker, walk, camera_place)
    for body in walk.bodies:
        body.hide_viewport = False


def _blockers(scene, walk: Walk, camera_place: Vector) -> set[bpy.types.Object]:
    """Tall things that hide the figure from the camera at some moment."""
    depsgraph, blockers = bpy.context.evaluated_depsgraph_get(), set()
    for index in range(0, len(walk.frames), 4):
        for point in (
            Vector(walk.heads[index]),
            Vector(walk.roots[index]),
            Vector((*walk.roots[index][:2], walk.floor + 0.3)),
        ):
            way = camera_place - point
            hit, _, _, _, thing, _ = scene.ray_cast(
                depsgraph, point + way.normalized() * 0.25, way.normalized(), distance=way.length
            )
            if hit and _height(thing) - walk.floor > 1.2 and not thing.get("lowered"):
                blockers.add(thing)
    return blockers


def _height(thing: bpy.types.Object) -> float:
    return max((thing.matrix_world @ Vector(corner)).z for corner in thing.bound_box)


def _lower(thing: bpy.types.Object, walk: Walk, camera_place: Vector) -> None:
    """Cuts a blocker down to a stump; of a mesh that surrounds the way only what lies on the camera's side."""
    thing["lowered"] = True
    stump = Vector((0, 0, walk.floor + STUMP))
    corners = np.array([thing.matrix_world @ Vector(corner) for corner in thing.bound_box])
    low, high = corners.min(axis=0)[:2], corners.max(axis=0)[:2]
    way_low, way_high = walk.roots[:, :2].min(axis=0), walk.roots[:, :2].max(axis=0)
    if (low > way_low).any() or (high < way_high).any():
        _cut(thing, stump, Vector((0, 0, 1)))
        return
    towards = Vector((camera_place - Vector(walk.roots.mean(axis=0))).xy).normalized()
    reach = max(np.dot(root[:2], towards) for root in walk.roots) + 0.45
    _cut(thing, stump, Vector((0, 0, 1)), only=lambda p: p.xy.dot(towards) > reach)


def _cut(thing: bpy.types.Object, point: Vector, normal: Vector, only=None) -> None:
    """Removes what lies beyond a plane; with `only`, faces whose middle does not satisfy it stay."""
    mesh = bmesh.new()
    mesh.from_mesh(thing.data)
    faces = [face for face in mesh.faces if only is None or only(face.calc_center_median())]
    geometry = list({item for face in faces for item in (*face.verts, *face.edges)}) + faces
    if geometry:
        bmesh.ops.bisect_plane(mesh, geom=geometry, plane_co=point, plane_no=normal, clear_outer=only is None)
    if only:
        beyond = [
            f for f in mesh.faces if only(f.calc_center_median()) and (f.calc_center_median() - point).dot(normal) > 0
        ]
        bmesh.ops.delete(mesh, geom=beyond, context="FACES")
    mesh.to_mesh(thing.data)
    mesh.free()


# --- what is drawn into the room -------------------------------------------------------------------------------------


def grade(part: float) -> np.ndarray:
    """The colour of a moment, 0 at the start and 1 at the end."""
    where = part * (len(GRADE) - 1)
    k = min(int(where), len(GRADE) - 2)
    return GRADE[k] + (GRADE[k + 1] - GRADE[k]) * (where - k)


def add_ghosts(scene: bpy.types.Scene, walk: Walk, count: int) -> None:
    """Copies of the figure at `count` moments, coloured by time; the figure itself is hidden."""
    for frame in walk.moments(count, apart=APART):
        scene.frame_set(int(frame))
        depsgraph = bpy.context.evaluated_depsgraph_get()
        color = grade((frame - walk.frames[0]) / max(walk.frames[-1] - walk.frames[0], 1))
        for body in walk.bodies:
            evaluated = body.evaluated_get(depsgraph)
            mesh = bpy.data.meshes.new_from_object(evaluated)
            mesh.transform(evaluated.matrix_world)
            for slot in range(len(mesh.materials)):
                mesh.materials[slot] = _plain(f"Moment {frame} {slot}", color if slot == 0 else color * 0.25)
            scene.collection.objects.link(bpy.data.objects.new(f"Moment {frame}", mesh))
    for body in walk.bodies:
        body.hide_render = True


def add_way(scene: bpy.types.Scene, walk: Walk, width: float = 0.05) -> None:
    """A ribbon on the floor under the pelvis, coloured by time."""
    points = walk.roots.copy()
    points[:, 2] = walk.floor + 0.014
    keep = [0]
    for k in range(1, len(points)):
        if np.linalg.norm(points[k, :2] - points[keep[-1], :2]) > 0.04:
            keep.append(k)
    if len(keep) < 2:
        return
    line = points[keep]
    along = np.gradient(line[:, :2], axis=0)
    side = np.stack([-along[:, 1], along[:, 0]], axis=1)
    side /= np.maximum(np.linalg.norm(side, axis=1, keepdims=True), 1e-9)
    left, right = line.copy(), line.copy()
    left[:, :2] += side * width / 2
    right[:, :2] -= side * width / 2
    bands = 24
    mesh = bpy.data.meshes.new("Way")
    mesh.from_pydata(
        np.concatenate([left, right]).tolist(),
        [],
        [(k, k + len(line), k + 1 + len(line), k + 1) for k in range(len(line) - 1)],
    )
    for band in range(bands):
        mesh.materials.append(_plain(f"Way {band}", grade(band / (bands - 1))))
    times = (np.array(keep[:-1]) / max(len(points) - 1, 1) * (bands - 1)).astype(np.int32)
    mesh.polygons.foreach_set("material_index", times)
    scene.collection.objects.link(bpy.data.objects.new("Way", mesh))


def _plain(name: str, color) -> bpy.types.Material:
    material = bpy.data.materials.new(name)
    material.diffuse_color = (*color, 1.0)
    return material


# --- cameras ---------------------------------------------------------------------------------------------------------


def overview(walk: Walk, aspect: float) -> tuple[Vector, Vector]:
    """Camera place and target from which the whole way shows, the last posture from the front or side."""
    low = np.append(walk.roots[:, :2].min(axis=0) - 0.55, walk.floor)
    high = np.append(walk.roots[:, :2].max(axis=0) + 0.55, walk.floor + 1.75)
    corners = np.array([(x, y, z) for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
    target = Vector((low + high) / 2)
    facing = math.atan2(walk.facings[-1][1], walk.facings[-1][0])
    depsgraph, scene = bpy.context.evaluated_depsgraph_get(), bpy.context.scene
    best = None
    for turn in (35, -35, 55, -55, 15, -15, 80, -80):
        azimuth, height = facing + math.radians(turn), math.radians(40)
        towards = Vector((math.cos(azimuth) * math.cos(height), math.sin(azimuth) * math.cos(height), math.sin(height)))
        place = target + towards * _distance(corners, target, towards, aspect)
        hidden = sum(_hidden(scene, depsgraph, Vector(p), towards) for p in (*walk.roots[::6], *(walk.heads[::6])))
        cost = hidden + 4 * _in_front_of_the_end(walk, azimuth) + 2 * _lined_up(walk, azimuth) + abs(turn) * 0.02
        if best is None or cost < best[0]:
            best = (cost, place)
    return best[1], target


def _in_front_of_the_end(walk: Walk, azimuth: float) -> int:
    """How many postures on the way would cover the last one, seen from this azimuth."""
    towards = np.array([math.cos(azimuth), math.sin(azimuth)])
    away = walk.roots[::8, :2] - walk.roots[-1, :2]
    ahead, aside = away @ towards, np.abs(away @ np.array([-towards[1], towards[0]]))
    return int(((np.linalg.norm(away, axis=1) > APART) & (ahead > 0.0) & (ahead < 2.2) & (aside < 0.5)).sum())


def _lined_up(walk: Walk, azimuth: float) -> int:
    """How many of the shown postures stand one behind the other, seen from this azimuth."""
    places = walk.roots[walk.moments(8, apart=APART) - walk.frames[0], :2]
    aside = places @ np.array([-math.sin(azimuth), math.cos(azimuth)])
    return int((np.abs(np.diff(aside)) < 0.3).sum())


def _distance(corners: np.ndarray, target: Vector, towards: Vector, aspect: float) -> float:
    """How far the camera must stand for all corners to be in the picture."""
    half = math.atan(18.0 / LENS)
    tan_x, tan_y = math.tan(half), math.tan(half) / aspect
    back = np.array(towards)
    right = np.cross([0, 0, 1], back)
    right /= np.linalg.norm(right)
    up = np.cross(back, right)
    local = corners - np.array(target)
    depth = local @ back
    return 1.04 * float(max((np.abs(local @ right) / tan_x + depth).max(), (np.abs(local @ up) / tan_y + depth).max()))


def _hidden(scene, depsgraph, point: Vector, towards: Vector) -> bool:
    """Whether furniture (what is lower than a wall) hides a point; walls are cut away anyway."""
    hit, place, _, _, thing, _ = scene.ray_cast(depsgraph, point + towards * 0.3, towards, distance=8.0)
    return bool(hit and not thing.get(CHARACTER_KEY) and place.z < 1.4)


def follow(walk: Walk, index: int, distance: float = 3.4) -> tuple[Vector, Vector]:
    """A camera at chest height beside the figure that goes along with it, on the same side throughout."""
    near = slice(max(index - 20, 0), index + 20)
    facing = walk.facings[near].mean(axis=0)
    heading = math.atan2(facing[1], facing[0]) - math.radians(65)
    target = Vector((*walk.roots[index][:2], walk.floor + 0.85))
    return target + Vector((math.cos(heading), math.sin(heading), 0.12)) * distance, target


def seat(walk: Walk, distance: float = 2.6) -> tuple[Vector, Vector]:
    """A still camera on the last posture, from the side and a little from the front."""
    heading = math.atan2(walk.facings[-1][1], walk.facings[-1][0]) - math.radians(62)
    target = Vector((*(walk.roots[-1][:2] + walk.facings[-1] * 0.15), walk.floor + 0.62))
    return target + Vector((math.cos(heading), math.sin(heading), 0.22)) * distance, target


# --- outputs ---------------------------------------------------------------------------------------------------------


def draw(scene: bpy.types.Scene, path: Path) -> None:
    compat.use_png(scene.render.image_settings)
    scene.render.filepath = str(path.resolve())
    bpy.ops.render.render(write_still=True)


def picture(blend: Path, out: Path, moments: int = 8) -> None:
    """One picture: the open room, the way, the figure at `moments` moments."""
    scene, walk, camera = _open(blend, PICTURE_SIZE)
    place, target = overview(walk, PICTURE_SIZE[0] / PICTURE_SIZE[1])
    aim(camera, place, target)
    open_room(scene, walk, place)
    add_ghosts(scene, walk, moments)
    add_way(scene, walk)
    draw(scene, out)


def sheet(blend: Path, out: Path, views: list[str], count: int = 10) -> None:
    """A grid of pictures: a row a view, `count` columns; the seat's row shows the end of the motion more closely."""
    scene, walk, camera = _open(blend, SHEET_SIZE)
    place, target = overview(walk, SHEET_SIZE[0] / SHEET_SIZE[1])
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        # What needs the whole room comes before the room is opened.
        for view in sorted(views, key=lambda v: v == "overview"):
            if view == "overview":
                open_room(scene, walk, place)
            frames = walk.frames[-min(len(walk.frames), 120) :] if view == "seat" else walk.frames
            chosen = np.unique(np.linspace(0, len(frames) - 1, count).astype(int)) if view == "seat" else None
            shown = frames[chosen] if chosen is not None else walk.moments(count)
            row = []
            for frame in shown:
                scene.frame_set(int(frame))
                index = int(frame - walk.frames[0])
                if view == "overview":
                    aim(camera, place, target)
                elif view == "follow":
                    aim(camera, *follow(walk, index), see_from=3.4 - 0.9)
                else:
                    aim(camera, *seat(walk), see_from=2.6 - 1.0)
                _stamp(scene, f"{view}  frame {frame}")
                draw(scene, Path(folder) / "cell.png")
                row.append(_pixels(Path(folder) / "cell.png"))
            row += [np.ones_like(row[0])] * (count - len(row))
            rows.append((views.index(view), np.concatenate(row, axis=1)))
    # Blender's pictures begin at the bottom.
    _write_pixels(out, np.concatenate([row for _, row in sorted(rows, key=lambda r: -r[0])], axis=0))


def video(blend: Path, out: Path) -> None:
    """The motion from the overview camera in its own time, H264; long motions at half or a third of the frames."""
    scene, walk, camera = _open(blend, VIDEO_SIZE)
    place, target = overview(walk, VIDEO_SIZE[0] / VIDEO_SIZE[1])
    aim(camera, place, target)
    open_room(scene, walk, place)
    add_way(scene, walk)
    scene.frame_start, scene.frame_end = int(walk.frames[0]), int(walk.frames[-1])
    step = math.ceil(len(walk.frames) / VIDEO_FRAMES)
    scene.frame_step, scene.render.fps = step, max(1, round(scene.render.fps / step))
    compat.use_video(scene.render)
    scene.render.filepath = str(out.resolve())
    bpy.ops.render.render(animation=True)


def _open(blend: Path, size: tuple[int, int]) -> tuple[bpy.types.Scene, Walk, bpy.types.Object]:
    bpy.ops.wm.open_mainfile(filepath=str(blend.resolve()))
    scene = bpy.context.scene
    return scene, read_walk(scene), prepare(scene, size)


def _stamp(scene: bpy.types.Scene, note: str) -> None:
    render = scene.render
    render.use_stamp = True
    for name in dir(render):
        if name.startswith("use_stamp_"):
            setattr(render, name, name == "use_stamp_note")
    render.stamp_note_text, render.stamp_font_size = note, 16
    render.stamp_background = (0.0, 0.0, 0.0, 0.4)


def _pixels(path: Path) -> np.ndarray:
    image = bpy.data.images.load(str(path), check_existing=False)
    pixels = np.empty(len(image.pixels), dtype=np.float32)
    image.pixels.foreach_get(pixels)
    pixels = pixels.reshape(image.size[1], image.size[0], 4)
    bpy.data.images.remove(image)
    return pixels


def _write_pixels(path: Path, pixels: np.ndarray) -> None:
    height, width = pixels.shape[:2]
    image = bpy.data.images.new("Sheet", width, height, alpha=False)
    image.pixels.foreach_set(np.ascontiguousarray(pixels, dtype=np.float32).ravel())
    image.filepath_raw, image.file_format = str(path.resolve()), "PNG"
    image.save()


def main(arguments: list[str]) -> None:
    parser = argparse.ArgumentParser(prog="render", description=__doc__.splitlines()[0])
    parser.add_argument("blend", type=Path, help="a file with a character and its action")
    parser.add_argument("--picture", type=Path)
    parser.add_argument("--sheet", type=Path)
    parser.add_argument("--video", type=Path)
    parser.add_argument(
        "--views", nargs="+", default=["overview", "follow", "seat"], choices=["overview", "follow", "seat"]
    )
    parser.add_argument("--frames", type=int, default=10, help="columns of the sheet")
    options = parser.parse_args(arguments)
    if not (options.picture or options.sheet or options.video):
        parser.error("say what to draw: --picture, --sheet or --video")
    for out, make in (
        (options.picture, lambda: picture(options.blend, options.picture)),
        (options.sheet, lambda: sheet(options.blend, options.sheet, options.views, options.frames)),
        (options.video, lambda: video(options.blend, options.video)),
    ):
        if out:
            out.parent.mkdir(parents=True, exist_ok=True)
            make()
            print(f"wrote {out}")


if __name__ == "__main__":
    main(sys.argv[1:])
