"""A material: what a surface does with light, as maps that repeat over its texture coordinates."""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]


@dataclass(frozen=True, eq=False)
class Material:
    """Parameters of Mitsuba's `principled` BSDF, constant or as maps.

    Row 0 of a map is at v = 0, column 0 at u = 0; maps repeat without seams, except those that
    cover a piece once (`furnishing.WHOLE`).

    Attributes:
        base_color: linear RGB, 0 to 1, (H, W, 3) float32 or (3,).
        roughness: 0 to 1, (H, W) float32 or a number.
        height: of the bumps, in metres, (H, W) float32, as from `uneven`; None if smooth.
        metallic, specular: 0 to 1.
        metres: length of one repeat, in metres of texture coordinates.
    """

    base_color: Array
    roughness: Array | float
    height: Array | None = None
    metallic: float = 0.0
    specular: float = 0.5
    metres: float = 1.0


def uneven(height: Array) -> Array:
    """Return heights whose slope is nowhere exactly 0, changed by 0.1 micrometres at most.

    Mitsuba 3.9's `bumpmap` mixes the surface's local and world frames: where the slope is exactly 0
    and u runs along the world's z axis, it normalises a zero vector and returns NaN.
    """
    return np.asarray(height + _dither(height.shape), np.float32)


@lru_cache(maxsize=8)
def _dither(shape: tuple[int, ...]) -> Array:
    return np.random.default_rng(0).uniform(-1e-7, 1e-7, shape).astype(np.float32)


def lerp(low: Any, high: Any, share: Array) -> Array:
    """Return colours between two, by a field of shares, (H, W) -> (H, W, 3) float32."""
    first, last = np.asarray(low, np.float32), np.asarray(high, np.float32)
    return np.asarray(first + (last - first) * share[..., None].astype(np.float32))
