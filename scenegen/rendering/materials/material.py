"""A material: what a surface does with light, as maps that repeat over its texture coordinates."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]


SLOPE_STEPS = 16384.0  # of a slope, metres per repeat, kept in 16 bits: up to 2


@dataclass(frozen=True, eq=False)
class Material:
    """What a surface reflects, constant or as maps.

    Row 0 of a map is at v = 0, column 0 at u = 0; maps repeat without seams, except those that
    cover a piece once (`furnishing.WHOLE`).

    Attributes:
        base_color: linear RGB, 0 to 1, (H, W, 3) float32 or (3,); with an index, (L, 3).
        roughness: 0 to 1, (H, W) float32 or a number; with an index, (L,) or a number.
        index: rows of the colours that the pixels of a map have, (H, W) uint16; None for none.
        slopes: of bumps, as from `slopes_of`, (h, w) uint32; None if smooth.
        bumps: factor of the slopes.
        metallic, specular: 0 to 1.
        metres: length of one repeat, in metres of texture coordinates.
        wrap: how maps go on along u and v: `furnishing.REPEAT`, CLAMP or MIRROR.
        radiance: linear RGB that its front shines with; such a material reflects nothing.
    """

    base_color: Array
    roughness: Array | float
    index: Array | None = None
    slopes: Array | None = None
    bumps: float = 1.0
    metallic: float = 0.0
    specular: float = 0.5
    metres: float = 1.0
    wrap: tuple[int, ...] = (0, 0)
    radiance: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def texels(self) -> Array:
        """Return square roots of linear RGB, and roughness, in 8 bits each, (H, W) uint32."""
        color, rough = np.asarray(self.base_color, np.float32), np.asarray(self.roughness)
        shape = np.broadcast_shapes(color.shape[:-1], rough.shape)
        bytes_ = np.empty((*shape, 4), np.uint8)
        bytes_[..., :3] = np.rint(np.sqrt(np.clip(color, 0, 1)) * np.float32(255))
        bytes_[..., 3] = np.rint(np.clip(rough, 0, 1) * 255)
        packed: Array = bytes_.view("<u4")[..., 0]
        return packed.reshape(1, 1) if not shape else packed if self.index is None else (
            packed.take(self.index))  # fmt: skip


def slopes_of(height: Array) -> Array:
    """Return the slopes of heights, (H, W), in metres per repeat, along u and v, in 16 bits each.

    Slopes beyond 2 are cut. The result is (H, W) uint32.
    """
    found = np.empty((*height.shape, 2), np.int16)
    for axis, size in ((1, height.shape[1]), (0, height.shape[0])):
        step = np.roll(height, -1, axis) - np.roll(height, 1, axis)
        scaled = np.rint(step * (0.5 * size * SLOPE_STEPS))
        found[..., 1 - axis] = np.clip(scaled, -32767, 32767)
    slopes: Array = found.view("<u4")[..., 0]
    return slopes


def lerp(low: Any, high: Any, share: Array) -> Array:
    """Return colours between two, by a field of shares, (...,) -> (..., 3) float32."""
    first, last = np.asarray(low, np.float32), np.asarray(high, np.float32)
    return np.asarray(first + (last - first) * share[..., None].astype(np.float32))
