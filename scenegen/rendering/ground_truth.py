"""What a renderer returns: images with their exact ground truth."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]


@dataclass(frozen=True, eq=False)
class GroundTruth:
    """Pixels of B images. Frames and pixel conventions are those of `camera.py`.

    Attributes:
        image: linear RGB radiance, (B, H, W, 3); as uint8, 255 is radiance 1.
        depth: planar depth, (B, H, W) float32, scene units, NaN where the ray meets nothing.
        normal: (B, H, W, 3) float32, camera frame, unit, facing the viewer; zero where nothing.
        object_id: (B, H, W) int8, -1 nothing, 0 room, k the k-th object counting from 1.
    """

    image: Array
    depth: Array
    normal: Array
    object_id: Array


def encode_image(radiance: Array, dtype: str) -> Array:
    """Store linear radiance: uint8 rounds 255 times it, clipped to 0..1; floats keep it."""
    if dtype == "uint8":
        return np.rint(np.clip(radiance, 0.0, 1.0) * 255.0).astype(np.uint8)
    return np.asarray(radiance).astype(dtype)


def decode_image(image: Array) -> Array:
    """Return stored pixels as linear radiance, float32 (uint8 255 is radiance 1)."""
    if image.dtype == np.uint8:
        return image.astype(np.float32) / np.float32(255.0)
    return image.astype(np.float32)


def visible_pixels(object_id: Array, slots: int) -> NDArray[np.int32]:
    """Count the pixels of each object in each image: (B, H, W) -> (B, slots)."""
    counts = np.empty((len(object_id), slots), np.int32)
    for row, ids in zip(counts, object_id.reshape(len(object_id), -1), strict=True):
        row[:] = np.bincount(ids + np.intp(1), minlength=slots + 2)[2 : slots + 2]
    return counts
