"""Write one row of a file of rooms in the formats of other tools: EXR, PNG, PLY, OBJ."""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.camera import transform_vectors
from scenegen.common.names import check_choice
from scenegen.files.new_file import written_beside
from scenegen.objects.catalogue import Objects, built_in_shape, interior_shape
from scenegen.rooms.export.encoding import Encoding, plain, write_png
from scenegen.rooms.export.formats import PICTURES, ROW_FORMATS
from scenegen.rooms.export.obj import one_word, write_mtl, write_obj
from scenegen.rooms.reader import Room

Array = NDArray[Any]
Writer = Callable[[Room, Path], None]
ShapeOf = Callable[[str], Any]  # from a name to the unit shape of an object


def export_paths(row: int, folder: str | Path, stem: str, form: str) -> list[Path]:
    """Return the paths of the files that one row is written to in one of ROW_FORMATS.

    Their names have no blanks, which would end a name inside other files.

    Raises SpecError for another format.
    """
    check_choice("format", form, ROW_FORMATS)
    name = f"{one_word(stem)}-{row:06d}"
    return [Path(folder) / f"{name}{ending}" for ending in ROW_FORMATS[form].endings]


def export_room(
    room: Room,
    paths: list[Path],
    form: str,
    overwrite: bool = False,
    objects: Objects | None = None,
    encoding: Encoding | None = None,
) -> None:
    """Write one room to its `export_paths`.

    "obj" needs the `objects` of the scene, unless they are built in.

    Raises SpecError for a format that is none of ROW_FORMATS and, before a file is written, where a
    value does not fit into an encoding of fixed range; and OSError as `new_file.written_beside`.
    """
    check_choice("format", form, ROW_FORMATS)
    interior = room.scene.interior is not None
    built_in = interior_shape if interior else built_in_shape
    shape_of = objects.shape if objects else built_in
    encoding = encoding or plain(interior)
    writers: list[Writer] = ROW_FORMATS[form].load_writer()(room, paths, encoding, shape_of)
    for path, write in zip(paths, writers, strict=True):
        with written_beside(path, overwrite) as temporary:
            write(room, temporary)


def exr_writers(_room: Room, _paths: list[Path], _how: Encoding, _of: ShapeOf) -> list[Writer]:
    """Return what writes the one file of a row."""
    return [write_exr]


def ply_writers(room: Room, _paths: list[Path], how: Encoding, _of: ShapeOf) -> list[Writer]:
    """Return what writes the one file of a row. Raises SpecError where a colour does not fit."""
    colors = how.color_bytes(room)
    return [lambda room, path: write_surfels_ply(room, path, colors)]


def obj_writers(_room: Room, paths: list[Path], _how: Encoding, shape_of: ShapeOf) -> list[Writer]:
    """Return what writes the mesh of a row and its materials."""
    return [
        lambda room, path: write_obj(room.scene, path, paths[-1].name, shape_of),
        lambda room, path: write_mtl(room.scene, path),
    ]


def write_exr(room: Room, path: str | Path) -> None:
    """Write linear radiance R G B, depth Z, normal N.X N.Y N.Z and id, all float32.

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
    kind = "planar depth" if room.lens.is_flat else "distance along the ray"
    header = {
        "compression": OpenEXR.ZIP_COMPRESSION,
        "type": OpenEXR.scanlineimage,
        "comments": f"Z {kind} in {room.unit}s; N in the camera frame (x right, y up, -z view)",
    }
    OpenEXR.File(header, channels).write(str(path))


def write_surfels_ply(room: Room, path: str | Path, colors: Array) -> None:
    """Write the surfels in the world frame: position, normal, colour (H, W, 3) uint8, object id."""
    hit = room.object_id >= 0
    comments = [
        f"surfels of room {room.index}: world frame, y up, {room.unit}s",
        "object_id: 0 the room, k the k-th object; pixels without a hit are left out",
    ]
    normals = transform_vectors(room.world_from_camera, room.normal[hit])
    columns = (room.points_world[hit], normals, colors[hit])
    write_points_ply(path, *columns, comments, object_id=room.object_id[hit])


def write_points_ply(
    path: str | Path,
    points: Array,
    normals: Array,
    colors: Array,
    comments: Sequence[str],
    **bytes_of: Array,
) -> None:
    """Write points, normals (n, 3) and colours (n, 3) uint8, and further columns of bytes (n,)."""
    names = ("x", "y", "z", "nx", "ny", "nz", "red", "green", "blue", *bytes_of)
    kinds = 6 * ["float"] + (3 + len(bytes_of)) * ["uchar"]  # Open3D reads no "char"
    types = {"float": "<f4", "uchar": "u1"}
    named = list(zip(names, kinds, strict=True))
    columns = (*points.T, *normals.T, *colors.T, *bytes_of.values())
    vertices = np.rec.fromarrays(columns, [(name, types[kind]) for name, kind in named])
    header = [
        "ply",
        "format binary_little_endian 1.0",
        *(f"comment {comment}" for comment in comments),
        f"element vertex {len(vertices)}",
        *(f"property {kind} {name}" for name, kind in named),
        "end_header",
    ]
    Path(path).write_bytes("\n".join([*header, ""]).encode() + vertices.tobytes())


def png_writers(room: Room, _paths: list[Path], encoding: Encoding, _of: ShapeOf) -> list[Writer]:
    """Return what writes the pictures and their description. Raises SpecError as `encoding`."""
    bits = encoding.bits
    pictures = {
        "image": (encoding.colors(room) * encoding.largest, bits),
        "depth": (encoding.depth_steps(room), 16),
        "normal": (encoding.normal_steps(room.normal), bits),
        "object_id": (room.object_id.astype(float) + 1, 8),
    }
    about = encoding.description(room)
    writers: list[Writer] = [partial(_write_picture, *pictures[name]) for name in PICTURES]
    return [*writers, lambda _room, path: _write_text(path, about)]


def _write_picture(values: Array, bits: int, _room: Room, path: Path) -> None:
    write_png(path, values, bits)


def _write_text(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8")
