"""Write one row of a file of rooms in the formats of other tools: EXR, PNG, PLY, OBJ."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import png
from numpy.typing import NDArray

from scenegen.camera import transform_vectors
from scenegen.common.errors import SpecError
from scenegen.files.new_file import written_beside
from scenegen.objects.catalogue import Objects, built_in_shape
from scenegen.rooms.obj_file import one_word, write_mtl, write_obj
from scenegen.rooms.preview import srgb
from scenegen.rooms.reader import Room

Array = NDArray[Any]
Writer = Callable[[Room, Path], None]
FORMATS = ("exr", "png", "ply", "obj")
PICTURES = ("image", "depth", "normal", "object_id")  # a PNG file of each


@dataclass(frozen=True)
class Encoding:
    """How values become the whole numbers of PNG and PLY files.

    Attributes:
        curve: of images, "srgb" for eyes and networks, or "linear".
        bits: of images and normals in PNG files, 8 or 16.
        exposure: factor of radiance; 1 is the brightest that can be encoded.
        depth_unit: scene units for each step of a 16-bit depth.
    """

    curve: str = "srgb"
    bits: int = 8
    exposure: float = 1.0
    depth_unit: float = 1e-4

    def colors(self, room: Room) -> Array:
        """Return the image as fractions of the brightest value. Raises SpecError."""
        radiance = room.radiance * self.exposure
        brightest = float(radiance.max())
        if brightest > 1 + 1e-6:
            hint = f"use --exposure {0.9 * self.exposure / brightest:.2g}, or --format exr"
            where = f"row {room.index}: radiance"
            raise SpecError(where, f"{brightest:.4g} with this exposure", "at most 1", hint)
        return (
            np.asarray(srgb(radiance))
            if self.curve == "srgb"
            else np.asarray(np.clip(radiance, 0, 1))
        )

    def depth_steps(self, room: Room) -> Array:
        """Return the depth in steps of `depth_unit`, 0 where nothing is hit. Raises SpecError."""
        steps = np.rint(np.nan_to_num(room.depth.astype(float)) / self.depth_unit)
        if steps.max() > 65535:
            farthest = float(np.nanmax(room.depth))
            hint = f"use --depth-unit {1.1 * farthest / 65535:.2g}, or --format exr"
            expected = f"at most {65535 * self.depth_unit:.5g} scene units in 16 bits"
            raise SpecError(f"row {room.index}: depth", f"{farthest:.5g}", expected, hint)
        return np.asarray(steps)

    def description(self, room: Room) -> str:
        """Return, as JSON, how the PNG files of a room are decoded, and its camera."""
        most = 2**self.bits - 1
        about = {
            "image": {"encoding": self.curve, "bits": self.bits, "exposure": self.exposure},
            "depth": {"unit": self.depth_unit, "bits": 16, "nothing": 0, "kind": "planar"},
            "normal": {"scale": 2 / most, "offset": -1, "bits": self.bits, "frame": "camera"},
            "object_id": {"offset": -1, "bits": 8},
            "world_from_camera": room.world_from_camera.tolist(),
            "fov_y_degrees": room.fov_y_degrees,
        }
        return json.dumps(about, indent=1) + "\n"


PLAIN = Encoding()


def export_paths(row: int, folder: str | Path, stem: str, form: str) -> list[Path]:
    """Return the paths of the files that one row is written to in a format (one of FORMATS).

    Their names have no blanks, which would end a name inside other files.
    """
    endings = {"png": [*(f"-{name}.png" for name in PICTURES), ".json"], "obj": [".obj", ".mtl"]}
    name = f"{one_word(stem)}-{row:06d}"
    return [Path(folder) / f"{name}{ending}" for ending in endings.get(form, [f".{form}"])]


def export_room(
    room: Room,
    paths: list[Path],
    form: str,
    overwrite: bool = False,
    objects: Objects | None = None,
    encoding: Encoding = PLAIN,
) -> None:
    """Write one room to its `export_paths`.

    "obj" needs the `objects` of the scene, unless they are built in.

    Raises SpecError where a value does not fit into an encoding of fixed range, before a file is
    written, and OSError as `new_file.written_beside`.
    """
    shape_of = objects.shape if objects else built_in_shape
    if form == "png":
        writers = _png_writers(room, encoding)
    elif form == "ply":
        colors = np.rint(encoding.colors(room) * 255).astype(np.uint8)
        writers = [lambda room, path: write_surfels_ply(room, path, colors)]
    elif form == "obj":
        writers = [
            lambda room, path: write_obj(room.scene, path, paths[-1].name, shape_of),
            lambda room, path: write_mtl(room.scene, path),
        ]
    else:
        writers = [write_exr]
    for path, write in zip(paths, writers, strict=True):
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


def write_surfels_ply(room: Room, path: str | Path, colors: Array) -> None:
    """Write the surfels in the world frame: position, normal, colour (H, W, 3) uint8, object id."""
    hit = room.object_id >= 0
    names = ("x", "y", "z", "nx", "ny", "nz", "red", "green", "blue", "object_id")
    kinds = 6 * ["float"] + 4 * ["uchar"]  # Open3D reads no "char"
    types = {"float": "<f4", "uchar": "u1"}
    points = room.points_world[hit]
    normals = transform_vectors(room.world_from_camera, room.normal[hit])
    columns = (*points.T, *normals.T, *colors[hit].T, room.object_id[hit])
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


def _png_writers(room: Room, encoding: Encoding) -> list[Writer]:
    most = 2**encoding.bits - 1
    pictures = {
        "image": (encoding.colors(room) * most, encoding.bits),
        "depth": (encoding.depth_steps(room), 16),
        "normal": ((room.normal * 0.5 + 0.5) * most, encoding.bits),
        "object_id": (room.object_id.astype(float) + 1, 8),
    }
    writers: list[Writer] = [partial(_write_png, *pictures[name]) for name in PICTURES]
    return [*writers, lambda room, path: _write_text(path, encoding.description(room))]


def _write_png(values: Array, bits: int, _room: Room, path: Path) -> None:
    """Write (H, W) or (H, W, 3) values, from 0 to the largest whole number of so many bits."""
    pixels = np.rint(values).astype(np.uint8 if bits == 8 else np.uint16)
    height, width = pixels.shape[:2]
    writer = png.Writer(width, height, greyscale=pixels.ndim == 2, bitdepth=bits)
    with path.open("wb") as file:
        writer.write(file, pixels.reshape(height, -1))


def _write_text(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8")
