"""Folders of COLMAP: one for each scene, with images and a text model of the true cameras.

COLMAP's cameras are x right, y down, looking along +z; pixel centres lie at +0.5, as here. The
world is ours: y up, scene units. The points of a model are surfels, seen in all views that show
them.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from scenegen.camera import intrinsics
from scenegen.derived import project, seen_from
from scenegen.rooms.export.encoding import Encoding, write_png
from scenegen.rooms.reader import Room

Array = NDArray[Any]
FLIP = np.diag([1.0, -1.0, -1.0])  # from y up, looking along -z, to y down, looking along z
MOST_POINTS = 10_000  # of one view
HEADER = "# pix2shape-bench: the world has y up, conventions.json names the unit"


def write(source: Any, folder: Path) -> dict[str, Any]:
    """Write a `folder.Source`; return its conventions. Raises SpecError as `Encoding`."""
    for scene, views in source.views():
        _write_scene(views, folder / f"scene-{scene:06d}", source.encoding)
    return {
        "world": "right-handed, y up",
        "unit": source.unit,
        "camera": "images.txt is camera from world; x right, y down, looks along +z",
        "pixel_centers": "+0.5",
        "pictures": {"image": source.encoding.pictures()["image"]},
    }


def _write_scene(views: Sequence[Room], folder: Path, encoding: Encoding) -> None:
    images, model = folder / "images", folder / "sparse" / "0"
    for made in (images, model):
        made.mkdir(parents=True)
    for room in views:
        colors = encoding.colors(room) * encoding.largest
        write_png(images / f"{room.index:06d}.png", colors, encoding.bits)
    _write_text(model / "cameras.txt", (_camera_line(k, room) for k, room in enumerate(views, 1)))
    observations: list[list[str]] = [[] for _ in views]  # "x y point" of each image
    points: list[str] = []
    for number in range(len(views)):
        _add_points(number, views, encoding, observations, points)
    lines = []
    for k, room in enumerate(views, 1):
        lines += [_image_line(k, room), " ".join(observations[k - 1])]
    _write_text(model / "images.txt", lines)
    _write_text(model / "points3D.txt", points)


def _camera_line(number: int, room: Room) -> str:
    height, width = room.depth.shape
    matrix = intrinsics(height, width, room.lens, pixel_centers="half")
    values = (matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2])
    return f"{number} PINHOLE {width} {height} " + " ".join(map(repr, map(float, values)))


def _image_line(number: int, room: Room) -> str:
    rotation = FLIP @ room.world_from_camera[:3, :3].T
    translation = -rotation @ room.world_from_camera[:3, 3]
    x, y, z, w = Rotation.from_matrix(rotation).as_quat(canonical=True).tolist()
    numbers = " ".join(map(repr, (w, x, y, z, *translation.tolist())))
    return f"{number} {numbers} {number} {room.index:06d}.png"


def _add_points(
    number: int,
    views: Sequence[Room],
    encoding: Encoding,
    observations: list[list[str]],
    points: list[str],
) -> None:
    """Add surfels of one view, with the views that show them, to the lines of a model."""
    room = views[number]
    rows, columns = np.nonzero(room.object_id >= 0)
    step = -(-len(rows) // MOST_POINTS)
    rows, columns = rows[::step], columns[::step]
    world, ids = room.points_world[rows, columns], room.object_id[rows, columns]
    colors = encoding.color_bytes(room)[rows, columns]
    tracks: list[list[str]] = [[] for _ in rows]
    for k, other in enumerate(views):
        height, width = other.depth.shape
        pixels, _ = project(world, other.world_from_camera, height, width, other.lens)
        maps = (other.depth, other.normal, other.object_id, other.world_from_camera)
        seen = np.ones(len(rows), bool)
        if k != number:
            seen = seen_from(world, ids, *maps, other.lens)
        for i in np.flatnonzero(seen).tolist():
            tracks[i].append(f"{k + 1} {len(observations[k])}")
            x, y = pixels[i].tolist()
            observations[k].append(f"{x:.6f} {y:.6f} {len(points) + 1 + i}")
    first = len(points) + 1
    for i, (point, color) in enumerate(zip(world.tolist(), colors.tolist(), strict=True)):
        place, rgb = " ".join(f"{v:.9g}" for v in point), " ".join(map(str, color))
        points.append(f"{first + i} {place} {rgb} 0 {' '.join(tracks[i])}")


def _write_text(path: Path, lines: Any) -> None:
    path.write_text("\n".join([HEADER, *lines, ""]), encoding="utf-8")
