"""How radiance, depth and normals become the whole numbers of PNG and PLY files."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import png
from numpy.typing import NDArray

from scenegen.camera import intrinsics
from scenegen.common.errors import SpecError
from scenegen.common.srgb import encoded
from scenegen.rooms.reader import Room

Array = NDArray[Any]


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
    depth_unit: float = 1e-4  # as fine as the paper's room allows

    def colors(self, room: Room) -> Array:
        """Return the image as fractions of the brightest value. Raises SpecError."""
        radiance = room.radiance * self.exposure
        brightest = float(radiance.max())
        if brightest > 1 + 1e-6:
            hint = f"use --exposure {0.9 * self.exposure / brightest:.2g}, or --format exr"
            where = f"row {room.index}: radiance"
            raise SpecError(where, f"{brightest:.4g} with this exposure", "at most 1", hint)
        return encoded(radiance) if self.curve == "srgb" else np.asarray(np.clip(radiance, 0, 1))

    def color_bytes(self, room: Room) -> NDArray[np.uint8]:
        """Return the image in 8 bits, (H, W, 3). Raises SpecError."""
        return np.asarray(np.rint(self.colors(room) * 255).astype(np.uint8))

    def depth_steps(self, room: Room) -> Array:
        """Return the depth in steps of `depth_unit`, 0 where nothing is hit. Raises SpecError."""
        steps = np.rint(np.nan_to_num(room.depth.astype(float)) / self.depth_unit)
        if steps.max() > 65535:
            farthest = float(np.nanmax(room.depth))
            hint = f"use --depth-unit {1.1 * farthest / 65535:.2g}, or --format exr"
            expected = f"at most {65535 * self.depth_unit:.5g} {room.unit}s in 16 bits"
            raise SpecError(f"row {room.index}: depth", f"{farthest:.5g}", expected, hint)
        return np.asarray(steps)

    def normal_steps(self, normal: Array) -> Array:
        """Return unit normals as fractions of the largest whole number: -1 is 0, 1 is all."""
        return np.asarray((normal * 0.5 + 0.5) * self.largest)

    @property
    def largest(self) -> int:
        """The largest whole number of images and normals."""
        return int(2**self.bits - 1)

    def pictures(self) -> dict[str, Any]:
        """Return how PNG files of images, depths and normals are decoded."""
        return {
            "image": {"encoding": self.curve, "bits": self.bits, "exposure": self.exposure},
            "depth": {"unit": self.depth_unit, "bits": 16, "nothing": 0, "kind": "planar"},
            "normal": {
                "scale": 2 / self.largest,
                "offset": -1,
                "bits": self.bits,
                "frame": "camera",
            },
        }

    def description(self, room: Room) -> str:
        """Return, as JSON, how the PNG files of a room are decoded, and its camera."""
        about = {
            **self.pictures(),
            "object_id": {"offset": -1, "bits": 8},
            "length_unit": room.unit,
            "world_from_camera": room.world_from_camera.tolist(),
            "fov_y_degrees": room.fov_y_degrees,
        }
        if not room.lens.is_flat:
            about["projection"] = room.lens.projection
            about["depth"] = {**about["depth"], "kind": "distance along the ray"}
        elif not room.lens.is_centred:
            height, width = room.depth.shape
            matrix = intrinsics(height, width, room.lens, pixel_centers="half")
            about["intrinsics"] = matrix.tolist()
        return json.dumps(about, indent=1) + "\n"


def plain(interior: bool) -> Encoding:
    """Return what is used where nothing else is told; depths of closed rooms are millimetres.

    That is what readers of depth in metres take steps for, and reaches beyond any such room.
    """
    return Encoding(depth_unit=1e-3) if interior else Encoding()


def write_png(path: Path, values: Array, bits: int) -> None:
    """Write (H, W) or (H, W, 3) values, from 0 to the largest whole number of so many bits."""
    pixels = np.rint(values).astype(np.uint8 if bits == 8 else np.uint16)
    height, width = pixels.shape[:2]
    writer = png.Writer(width, height, greyscale=pixels.ndim == 2, bitdepth=bits)
    with path.open("wb") as file:
        writer.write(file, pixels.reshape(height, -1))


def write_json(path: Path, content: Any) -> None:
    """Write JSON with one item a line down to the second level."""
    path.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
