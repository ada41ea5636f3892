"""Write one row of a file of rooms in the formats of other tools: EXR, PNG, PLY, OBJ."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import png
from numpy.typing import NDArray

from scenegen.camera import transform_vectors
from scenegen.files.new_file import written_beside
from scenegen.objects.catalogue import Objects, built_in_shape
from scenegen.rooms.obj_file import write_mtl, write_obj
from scenegen.rooms.preview import srgb_bytes
from scenegen.rooms.reader import Room

Array = NDArray[Any]
Writer = Callable[[Room, Path], None]
FORMATS = ("exr", "png", "ply", "obj")
PNG_DEPTH_UNIT = 1e-4  # scene units for each step of a 16-bit depth: it reaches 6.5535


def export_paths(row: int, folder: str | Path, stem: str, form: str) -> list[Path]:
    """Return the paths of the files that one row is written to in a format (one of FORMATS)."""
    endings = {"png": [f"-{kind}.png" for kind in _PNG], "obj": [".obj", ".mtl"]}
    return [Path(folder) / f"{stem}-{row:06d}{end}" for end in endings.get(form, [f".{form}"])]


def export_room(
    room: Room,
    paths: list[Path],
    form: str,
    overwrite: bool = False,
    objects: Objects | None = None,
) -> None:
    """Write one room to its `export_paths`. Raises OSError as `new_file.written_beside`.

    "obj" needs the `objects` of the scene, unless they are built in.
    """
    shape_of = objects.shape if objects else built_in_shape
    writers: dict[str, list[Writer]] = {
        "exr": [write_exr],
        "png": list(_PNG.values()),
        "ply": [write_surfels_ply],
        "obj": [
            lambda room, path: write_obj(room.scene, path, paths[-1].name, shape_of),
            lambda room, path: write_mtl(room.scene, path),
        ],
    }
    for path, write in zip(paths, writers[form], strict=True):
        with written_beside(path, overwrite) as temporary:
            write(room, temporary)


def write_exr(room: Room, path: str | Path) -> None:
    """Write linear radiance R G B, planar depth Z, normal N.X N.Y N.Z and id, all float32.

    Z is infinite where nothing is hit, as compositing tools expect; id is -1 there.
    """
    import OpenEXR

    depth = np.where(np.isfinite(room.depth), room.depth, np.inf)
    planes = (*np.moveaxis(room.radiance, -1, 0), depth, *np.moveaxis(room.normal, -1, 0))
    names = ("R", "G", "B", "Z", "N.X", "N.Y", "N.Z", "id")
    channels = {
        name: OpenEXR.Channel(name, np.ascontiguousarray(plane, np.float32))
        for name, plane in zip(names, (*planes, room.object_id), strict=True)
    }
    header = {
        "compression": OpenEXR.ZIP_COMPRESSION,
        "type": OpenEXR.scanlineimage,
        "comments": "Z planar depth in scene units; N in the camera frame (x right, y up, -z view)",
    }
    OpenEXR.File(header, channels).write(str(path))


def write_surfels_ply(room: Room, path: str | Path) -> None:
    """Write the surfels in the world frame: position, normal, colour (sRGB), object id."""
    hit = room.object_id >= 0
    names = ("x", "y", "z", "nx", "ny", "nz", "red", "green", "blue", "object_id")
    kinds = 6 * ["float"] + 4 * ["uchar"]  # Open3D reads no "char"
    types = {"float": "<f4", "uchar": "u1"}
    points = room.points_world[hit]
    normals = transform_vectors(room.world_from_camera, room.normal[hit])
    columns = (*points.T, *normals.T, *srgb_bytes(room.radiance)[hit].T, room.object_id[hit])
    named = list(zip(names, kinds, strict=True))
    vertices = np.rec.fromarrays(columns, [(name, types[kind]) for name, kind in named])
    header = [
        "ply",
        "format binary_little_endian 1.0",
        f"comment surfels of room {room.index}: world frame, y up, scene units",
        "comment object_id: 0 the room, k the k-th object; pixels without a hit are left out",
        f"element vertex {len(vertices)}",
        *(f"property {kind} {name}" for name, kind in named),
        "end_header",
    ]
    Path(path).write_bytes("\n".join([*header, ""]).encode() + vertices.tobytes())


def _write_png16(path: Path, values: Array) -> None:
    """Write (H, W) or (H, W, 3) values, already scaled to 0..65535, as a 16-bit PNG."""
    pixels = np.rint(np.clip(values, 0, 65535)).astype(np.uint16)
    height, width = pixels.shape[:2]
    writer = png.Writer(width, height, greyscale=pixels.ndim == 2, bitdepth=16)
    with path.open("wb") as file:
        writer.write(file, pixels.reshape(height, -1))


_PNG: dict[str, Writer] = {
    "image": lambda room, path: _write_png16(path, np.clip(room.radiance, 0, 1) * 65535),
    "depth": lambda room, path: _write_png16(path, np.nan_to_num(room.depth) / PNG_DEPTH_UNIT),
    "normal": lambda room, path: _write_png16(path, (room.normal * 0.5 + 0.5) * 65535),
    "object_id": lambda room, path: _write_png16(path, room.object_id.astype(float) + 1),
}
