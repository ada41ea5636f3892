"""Silhouettes of a room's objects, from its image or, for the oracle variant, from the truth's ids.

The image's way uses what the model is told and no ids: the empty room is shaded with the known
camera, lights and reflectance of the walls, and a pixel that differs shows an object. This is exact
up to rounding, as the paper's shading equation knows no shadows and no light from other surfaces.
"""

import numpy as np

from baselines.training.images import Array
from scenegen.common.errors import SpecError
from scenegen.rendering.ground_truth import decode_image
from scenegen.rendering.shading import shade
from scenegen.rooms.reader import RoomsFile

ROUNDING = {"uint8": 0.75 / 255, "float16": 2e-3, "float32": 1e-4}  # of the stored radiance
LIGHTS = ("count", "position", "color", "ambient", "attenuation")


class Silhouettes:
    """The silhouettes of a rooms file, at those pixels that are asked for."""

    def __init__(self, rooms: RoomsFile, source: str = "image") -> None:
        """Read the lights.

        Args:
            source: "image" for the difference from the empty room, "ids" for the truth.

        Raises SpecError where objects change the light on the walls, or pixels blend samples.
        """
        spec = rooms.spec
        if source == "image" and (spec.shading != "paper" or spec.shadows or spec.spp > 1):
            raise SpecError(
                rooms.path,
                "images with shadows, indirect light or several samples per pixel",
                "the paper's shading, in which a pixel unlike the empty room's shows an object",
                "take silhouettes from ids, which is the oracle variant",
            )
        self._rooms, self._source = rooms, source
        self._light = {name: rooms.read(f"light/{name}", slice(None)) for name in LIGHTS}
        self._walls: Array = rooms.read("material/reflectance", slice(None))[:, 0]

    def at(self, row: int, pixels: Array, origin: Array, direction: Array) -> Array:
        """Return whether pixels show an object, (R,) booleans.

        Args:
            pixels: numbers of pixels, counted row by row, (R,).
            origin, direction: of their rays, (R, 3), world.
        """
        if self._source == "ids":
            return np.asarray(self._rooms.read("object_id", row).reshape(-1)[pixels] > 0)
        stored = decode_image(self._rooms.read("image", row).reshape(-1, 3)[pixels])
        empty = self.empty_radiance(row, origin, direction)
        kind = self._rooms.spec.image_dtype
        empty = np.clip(empty, 0.0, 1.0) if kind == "uint8" else empty
        return np.asarray((np.abs(stored - empty) > ROUNDING[kind]).any(axis=-1))

    def empty_radiance(self, row: int, origin: Array, direction: Array) -> Array:
        """Return the linear radiance that rays see in the room without its objects, (R, 3)."""
        toward = np.where(direction < 0, direction, -1e-12)  # the planes lie at 0 of each axis
        reach = -origin / toward
        light, count = self._light, int(self._light["count"][row])
        return shade(
            origin + reach.min(axis=-1, keepdims=True) * direction,
            np.eye(3)[reach.argmin(axis=-1)],
            self._walls[row],
            *(light[name][row, :count] for name in ("position", "color")),
            *(light[name][row] for name in ("ambient", "attenuation")),
        )
