# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures that a person can judge a motion by, drawn without a display by Workbench.

    python blend_fixtures/render.py FILE.blend --picture demo.png [--video demo.mp4] [--sheet sheet.png]
    python blend_fixtures/render.py FILE.blend --strip start.png --moment start
    python blend_fixtures/render.py FILE.blend --strip meets.png --person Ann --at 240
    python blend_fixtures/render.py FILE.blend --story story.jpg
    python blend_fixtures/render.py FILE.blend --frames DIR --size 480x360

The picture shows the room cut open towards the camera, the way on the floor and the figure at several moments,
blue at the start and orange at the end. A sheet is a grid: a column a telling moment (start, walking, the turn before
the seat, half-way down, seated), a row each for the room, the figure, and closely its feet or the seat. A strip is a
row or two of pictures a fifth of a second apart about one moment, or one frame, from one side at a person's height;
frames are the whole motion so, a picture each. A story has a picture of all people whenever one of them is at a cue,
a film is all of their motion so.
"""

from __future__ import annotations

import argparse
import math
import sys
import tempfile
from pathlib import Path

import bpy  # before bmesh: the bpy module brings it

# isort: split
import bmesh
import numpy as np
from mathutils import Vector

sys.path[:0] = [str(Path(__file__).resolve().parent), str(Path(__file__).resolve().parents[1])]

from cameras import APART, BODY, FEET, LEFT_HAND, LENS, RIGHT_HAND, SEAT, Shot, Sight, View  # noqa: E402
from walk import MOMENTS, Walk, read_walk, read_walks, together  # noqa: E402

from addon.bridge import compat  # noqa: E402
from addon.bridge.names import CHARACTER_KEY, CUE_KEY  # noqa: E402

PICTURE_SIZE, SHEET_SIZE, VIDEO_SIZE = (1600, 900), (480, 440), (640, 360)
#: Without a GPU a frame takes 0.2 s; a video is to take less than a minute.
VIDEO_FRAMES = 200
#: A cell of a strip, and how many stand in a row.
STRIP_SIZE, STRIP_COLUMNS = (160, 250), 9
#: Seconds from one picture of a strip to the next, and how many there are.
STRIP_STEP, STRIP_COUNT = 0.2, 18
#: A picture of a story, and how many stand in a row.
STORY_SIZE, STORY_COLUMNS = (400, 300), 4
#: What a picture taken alongside shows from its bottom to its top, metres.
TALL = 2.3
#: Colours from the start of the motion to its end, linear RGB.
GRADE = np.array([(0.06, 0.20, 0.62), (0.05, 0.45, 0.45), (0.55, 0.50, 0.08), (0.85, 0.25, 0.04)])
#: What blocks the view is cut off this high over the floor; nothing is shown above the ceiling's height. Metres.
STUMP, CEILING = 0.25, 2.3


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
    shading.show_shadows, shading.shadow_intensity = size in (PICTURE_SIZE, SHEET_SIZE), 0.25
    shading.show_cavity, shading.cavity_type = size in (PICTURE_SIZE, SHEET_SIZE), "BOTH"
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


def aim(camera: bpy.types.Object, view: View) -> None:
    """Points the camera."""
    camera.location = view.place
    camera.rotation_euler = (view.target - view.place).to_track_quat("-Z", "Y").to_euler()
    camera.data.clip_start, camera.data.clip_end = max(view.see_from, 0.05), 200.0


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


# --- outputs ---------------------------------------------------------------------------------------------------------


def draw(scene: bpy.types.Scene, path: Path) -> None:
    compat.use_png(scene.render.image_settings)
    scene.render.filepath = str(path.resolve())
    bpy.ops.render.render(write_still=True)


def picture(blend: Path, out: Path, moments: int = 8) -> None:
    """One picture: the open room, the way, the figure at `moments` moments."""
    scene, walk, camera = _open(blend, PICTURE_SIZE)
    _overview(scene, walk, camera, PICTURE_SIZE)
    add_ghosts(scene, walk, moments)
    add_way(scene, walk)
    draw(scene, out)


def sheet(blend: Path, out: Path) -> None:
    """A grid of pictures: a column a telling moment; the room, the figure, and its feet or the seat."""
    scene, walk, camera = _open(blend, SHEET_SIZE)
    moments, figures, details = walk.telling(), [], []
    with tempfile.TemporaryDirectory() as folder:
        cell = Path(folder) / "cell.png"

        def shown(index: int, view: View, note: str) -> np.ndarray:
            scene.frame_set(int(walk.frames[index]))
            aim(camera, view)
            stamp(scene, note)
            draw(scene, cell)
            return read_pixels(cell)

        for what, index in moments:
            scene.frame_set(int(walk.frames[index]))
            sight, frame = Sight(walk), f"frame {walk.frames[index]}"
            figures.append(shown(index, sight.best(BODY, index), f"{what}, {frame}"))
            detail, shot = _detail(walk, what)
            details.append(shown(index, sight.best(shot, index), f"{detail}, {frame}"))
        # What needs the whole room comes before the room is opened, which nothing moves in any more.
        if walk.hands:
            view = Sight(walk).overview(SHEET_SIZE[0] / SHEET_SIZE[1])
        else:
            view = _overview(scene, walk, camera, SHEET_SIZE)
        add_way(scene, walk)
        rooms = [shown(index, view, f"{what}, frame {walk.frames[index]}") for what, index in moments]
    # Blender's pictures begin at the bottom.
    rows = [np.concatenate(row, axis=1) for row in (details, figures, rooms)]
    write_pixels(out, np.concatenate(rows, axis=0))


def _detail(walk: Walk, what: str) -> tuple[str, Shot]:
    """What is worth a close look at a moment."""
    if what in {"taking hold", "half-way", "letting go"}:
        return "hand", LEFT_HAND if walk.hands[0][0] == "left" else RIGHT_HAND
    sits = any(moment == "half-way down" for moment, _ in walk.telling())
    return ("seat", SEAT) if sits and what in {"half-way down", "end"} else ("feet", FEET)


def video(blend: Path, out: Path) -> None:
    """The motion from the overview camera in its own time, H264; long motions at half or a third of the frames."""
    scene, walk, camera = _open(blend, VIDEO_SIZE)
    _overview(scene, walk, camera, VIDEO_SIZE)
    add_way(scene, walk)
    scene.frame_start, scene.frame_end = int(walk.frames[0]), int(walk.frames[-1])
    step = math.ceil(len(walk.frames) / VIDEO_FRAMES)
    scene.frame_step, scene.render.fps = step, max(1, round(scene.render.fps / step))
    compat.use_video(scene.render)
    scene.render.filepath = str(out.resolve())
    bpy.ops.render.render(animation=True)


def strip(blend: Path, out: Path, moment: str | int, person: str | None = None) -> None:
    """Pictures a fifth of a second apart about `moment`, row by row, the camera at a person's height going along."""
    scene, walk, camera = _open(blend, STRIP_SIZE, person)
    step = STRIP_STEP * walk.frame_rate
    first, last = walk.about(moment, STRIP_COUNT * STRIP_STEP)
    indices = [round(index) for index in np.arange(first, last + 0.5, step)][:STRIP_COUNT]
    cells = []
    with tempfile.TemporaryDirectory() as folder:
        cell = Path(folder) / "cell.png"
        for index, view in zip(indices, _alongside(walk, indices, STRIP_SIZE), strict=True):
            scene.frame_set(int(walk.frames[index]))
            aim(camera, view)
            stamp(scene, f"{index / walk.frame_rate:.1f} s")
            draw(scene, cell)
            cells.append(read_pixels(cell))
    write_grid(out, cells, STRIP_COLUMNS)


def story(blend: Path, out: Path) -> None:
    """A picture of everybody, from one place that sees all ways, on each frame on which one of them is at a cue."""
    scene, first, camera = _open(blend, STORY_SIZE)
    walks = read_walks(scene)
    _overview(scene, together(walks), camera, STORY_SIZE)
    for walk in walks:
        add_way(scene, walk)
    markers = [mark for walk in walks for mark in walk.character.animation_data.action.pose_markers]
    told = [("start", int(first.frames[0])), *sorted(((m.name, m.frame) for m in markers), key=lambda mark: mark[1])]
    cells = []
    with tempfile.TemporaryDirectory() as folder:
        cell = Path(folder) / "cell.png"
        for name, frame in told:
            scene.frame_set(frame)
            stamp(scene, f"{name}, frame {frame}")
            draw(scene, cell)
            cells.append(read_pixels(cell))
    write_grid(out, cells, STORY_COLUMNS)


def film(blend: Path, folder: Path, size: tuple[int, int], step: int) -> None:
    """Every `step`th frame of everybody's motion as FOLDER/0000.png …, from one place that sees all ways."""
    scene, _, camera = _open(blend, size)
    walks = read_walks(scene)
    _overview(scene, together(walks), camera, size)
    for walk in walks:
        add_way(scene, walk)
    folder.mkdir(parents=True, exist_ok=True)
    first, last = min(walk.frames[0] for walk in walks), max(walk.frames[-1] for walk in walks)
    for number, frame in enumerate(range(int(first), int(last) + 1, step)):
        scene.frame_set(frame)
        draw(scene, folder / f"{number:04d}.png")


def write_grid(out: Path, cells: list[np.ndarray], columns: int) -> None:
    """Pictures of one size row by row, the first at the top left."""
    while len(cells) % columns and len(cells) > columns:
        cells.append(np.ones_like(cells[0]))
    rows = [np.concatenate(cells[k : k + columns], axis=1) for k in range(0, len(cells), columns)]
    # Blender's pictures begin at the bottom.
    write_pixels(out, np.concatenate(rows[::-1], axis=0))


def every_frame(blend: Path, folder: Path, size: tuple[int, int], step: int) -> None:
    """Every `step`th frame of the motion as FOLDER/0000.png …, the camera at a person's height going along."""
    scene, walk, camera = _open(blend, size)
    indices = list(range(0, len(walk.frames), step))
    folder.mkdir(parents=True, exist_ok=True)
    for number, (index, view) in enumerate(zip(indices, _alongside(walk, indices, size), strict=True)):
        scene.frame_set(int(walk.frames[index]))
        aim(camera, view)
        draw(scene, folder / f"{number:04d}.png")


def _alongside(walk: Walk, indices: list[int], size: tuple[int, int]) -> list[View]:
    """A view a frame, all from one side, so far off that a standing person fits."""
    # The lens sees 36 mm over the longer side of a picture.
    tall = 36.0 / LENS * min(1.0, size[1] / size[0])
    return Sight(walk).alongside(indices, TALL / tall)


def _overview(scene: bpy.types.Scene, walk: Walk, camera: bpy.types.Object, size: tuple[int, int]) -> View:
    """Opens the room towards a camera that sees the whole way."""
    view = Sight(walk).overview(size[0] / size[1])
    aim(camera, view)
    open_room(scene, walk, view.place)
    return view


def _open(
    blend: Path, size: tuple[int, int], person: str | None = None
) -> tuple[bpy.types.Scene, Walk, bpy.types.Object]:
    bpy.ops.wm.open_mainfile(filepath=str(blend.resolve()))
    scene = bpy.context.scene
    return scene, read_walk(scene, person), prepare(scene, size)


def stamp(scene: bpy.types.Scene, note: str) -> None:
    render = scene.render
    render.use_stamp = True
    for name in dir(render):
        if name.startswith("use_stamp_"):
            setattr(render, name, name == "use_stamp_note")
    render.stamp_note_text, render.stamp_font_size = note, 16
    render.stamp_background = (0.0, 0.0, 0.0, 0.4)


def read_pixels(path: Path) -> np.ndarray:
    image = bpy.data.images.load(str(path), check_existing=False)
    pixels = np.empty(len(image.pixels), dtype=np.float32)
    image.pixels.foreach_get(pixels)
    pixels = pixels.reshape(image.size[1], image.size[0], 4)
    bpy.data.images.remove(image)
    return pixels


def write_pixels(path: Path, pixels: np.ndarray) -> None:
    height, width = pixels.shape[:2]
    image = bpy.data.images.new("Sheet", width, height, alpha=False)
    image.pixels.foreach_set(np.ascontiguousarray(pixels, dtype=np.float32).ravel())
    image.filepath_raw = str(path.resolve())
    image.file_format = "JPEG" if path.suffix == ".jpg" else "PNG"
    image.save(quality=85)


def _size(text: str) -> tuple[int, int]:
    width, height = text.split("x")
    return int(width), int(height)


def main(arguments: list[str]) -> None:
    parser = argparse.ArgumentParser(prog="render", description=__doc__.splitlines()[0])
    parser.add_argument("blend", type=Path, help="a file with a character and its action")
    parser.add_argument("--picture", type=Path)
    parser.add_argument("--sheet", type=Path)
    parser.add_argument("--video", type=Path)
    parser.add_argument("--strip", type=Path)
    parser.add_argument("--moment", choices=MOMENTS, default="start", help="what a strip is about")
    parser.add_argument("--person", help="whom a strip is about, by the start's name")
    parser.add_argument("--at", type=int, help="the scene's frame that a strip is about, in place of the moment")
    parser.add_argument("--story", type=Path)
    parser.add_argument("--frames", type=Path, help="a folder")
    parser.add_argument("--film", type=Path, help="a folder")
    parser.add_argument("--size", type=_size, default=VIDEO_SIZE, help="of the frames, as 480x360")
    parser.add_argument("--step", type=int, default=1, help="draw every so many frames")
    options = parser.parse_args(arguments)
    named = ("picture", "sheet", "video", "strip", "story", "frames", "film")
    if not any(getattr(options, name) for name in named):
        parser.error("say what to draw: --picture, --sheet, --video, --strip, --story, --frames or --film")
    about = options.moment if options.at is None else options.at
    for out, make in (
        (options.picture, lambda: picture(options.blend, options.picture)),
        (options.sheet, lambda: sheet(options.blend, options.sheet)),
        (options.video, lambda: video(options.blend, options.video)),
        (options.strip, lambda: strip(options.blend, options.strip, about, options.person)),
        (options.story, lambda: story(options.blend, options.story)),
        (options.film, lambda: film(options.blend, options.film, options.size, options.step)),
        (options.frames, lambda: every_frame(options.blend, options.frames, options.size, options.step)),
    ):
        if out:
            out.parent.mkdir(parents=True, exist_ok=True)
            make()
            print(f"wrote {out}")


if __name__ == "__main__":
    main(sys.argv[1:])
