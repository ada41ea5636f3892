"""Flying points: predicted points that hang in the air between two surfaces.

A network that blurs an occlusion edge puts points between the object in front and what is behind,
where nothing is. Errors of depth hardly see them, as they are few.

Near such an edge, a pixel's own surface has the pixel's true depth, and the other one the true
depth of the nearest pixel across the edge. So the truth has no flying point.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from metrics.measures.boundaries import RATIOS

Array = NDArray[Any]
Mask = NDArray[np.bool_]

FREE = 0.05  # of the gap, on either side, that still belongs to the surface
# To pixels within 2 pixels, the nearest last.
_STEPS = sorted(
    ((i, j) for i in range(-2, 3) for j in range(-2, 3) if 0 < i * i + j * j <= 4),
    key=lambda step: (-(step[0] ** 2) - step[1] ** 2, step),
)


def other_surface(depth: Array, object_id: Array, mask: Mask) -> Array:
    """Return the true depth of the surface across the nearest occlusion edge, (H, W).

    That is an edge within 2 pixels between two ids of objects, or of an object and the room, whose
    depths differ by the smallest ratio of `boundaries.RATIOS` at least. NaN without one.

    Args:
        depth, object_id: true ones, (H, W).
        mask: the scored pixels, (H, W); an edge is between two of them.
    """
    height, width = depth.shape
    other = np.full((height, width), np.nan)
    for i, j in _STEPS:
        here = slice(max(-i, 0), height + min(-i, 0)), slice(max(-j, 0), width + min(-j, 0))
        there = slice(max(i, 0), height + min(i, 0)), slice(max(j, 0), width + min(j, 0))
        a, b = (depth[at].astype(np.float64) for at in (here, there))
        edge = mask[here] & mask[there] & (object_id[here] != object_id[there])
        edge[edge] = np.maximum(a[edge], b[edge]) > RATIOS[0] * np.minimum(a[edge], b[edge])
        np.copyto(other[here], b, where=edge)
    return other


def flying_points(depth: Array, true_depth: Array, other: Array) -> float:
    """Return the fraction of the pixels near occlusion edges whose predicted depth is in between.

    In between is where neither surface is nearer than FREE of their gap. NaN without edges.

    Args:
        depth, true_depth: predicted and true planar depth, (H, W).
        other: from `other_surface`.
    """
    near = np.isfinite(other)
    if not near.any():
        return np.nan
    own, far = true_depth[near].astype(np.float64), other[near]
    part = (depth[near] - own) / (far - own)
    return float(np.mean((part > FREE) & (part < 1.0 - FREE)))


def at_half_resolution(depth: Array, mask: Mask) -> Array:
    """Return depth (H, W) halved and doubled again, by means and bilinear; NaN where none is near.

    Pixels outside of the mask have no part in it.
    """
    height, width = depth.shape
    edges = ((0, height % 2), (0, width % 2))
    weight = np.pad(mask.astype(np.float64), edges)
    value = np.pad(np.where(mask, depth, 0.0).astype(np.float64), edges) * weight
    tall, wide = weight.shape[0] // 2, weight.shape[1] // 2
    both = np.stack([value, weight]).reshape(2, tall, 2, wide, 2).sum(axis=(2, 4))
    for axis in (1, 2):
        sides = np.pad(both, [(0, 0) if a != axis else (1, 1) for a in range(3)], mode="edge")
        count = sides.shape[axis]
        low, middle, high = (sides.take(range(k, count - 2 + k), axis) for k in range(3))
        doubled = np.stack([0.25 * low + 0.75 * middle, 0.75 * middle + 0.25 * high], axis + 1)
        both = doubled.reshape(*(2 * n if a == axis else n for a, n in enumerate(both.shape)))
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray((both[0] / both[1])[:height, :width])
