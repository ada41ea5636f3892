"""The pixels that a renderer returns, and what they mean: radiance, depth, normal, object id."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.common.srgb import decoded

Array = NDArray[Any]
KEPT = "on the device: "  # before the names of fields that stay there


@dataclass(frozen=True, eq=False)
class GroundTruth:
    """The pixels of B images. Frames and pixel conventions are those of `scenegen.camera`.

    All but the image come from one ray through the centre of each pixel, without filtering.

    Attributes:
        image: linear RGB radiance, (B, H, W, 3); as uint8, 255 is radiance 1.
        depth: planar depth, the distance along the viewing axis (-z of the camera frame), in scene
            units, (B, H, W) float32; NaN where the ray hits nothing.
        normal: unit normal in the camera frame, facing the viewer, (B, H, W, 3) float32; zero
            where the ray hits nothing.
        object_id: (B, H, W) int8; -1 nothing, 0 the room, k the k-th object, counting from 1.
        albedo: linear RGB reflectance, (B, H, W, 3) float32, NaN where the ray hits nothing; None
            unless objects have colours of their own, as it then follows from object ids.
        exposure: how pictures of closed rooms were developed, (B, 5) as
            `pictures.development.EXPOSURE`; None for other images.
    """

    image: Array
    depth: Array
    normal: Array
    object_id: Array
    albedo: Array | None = None
    exposure: Array | None = None

    def pixels(self) -> dict[str, Array]:
        """Return the fields that there are, by name."""
        return {name: values for name, values in vars(self).items() if values is not None}


def encode_image(radiance: Array, dtype: str) -> Array:
    """Return linear radiance as stored: uint8 clips it to 0..1 and rounds 255 times the value."""
    if dtype == "uint8":
        return np.rint(np.clip(radiance, 0.0, 1.0) * 255.0).astype(np.uint8)
    return np.asarray(radiance).astype(dtype)


def decode_image(image: Array) -> Array:
    """Return stored pixels as linear radiance, float32 (uint8 255 is radiance 1)."""
    if image.dtype == np.uint8:
        return image.astype(np.float32) / np.float32(255.0)
    return image.astype(np.float32)


def undeveloped(image: Array) -> Array:
    """Return the linear light, 0 to 1 float32, of an sRGB picture in 8 bits (IEC 61966-2-1)."""
    return np.asarray(decoded(np.arange(256) / 255).astype(np.float32)[image])


def visible_pixels(object_id: Array, slots: int) -> NDArray[np.int32]:
    """Count the pixels of each object in each image, (B, H, W) -> (B, slots)."""
    counts = np.empty((len(object_id), slots), np.int32)
    for row, ids in zip(counts, object_id, strict=True):
        row[:] = [np.count_nonzero(ids == k + 1) for k in range(slots)]
    return counts
