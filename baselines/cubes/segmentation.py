"""Face directions of pixels: flat colours joined, then merged to three by Ward's rule."""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[Any]
JOIN = 2  # of 255: neighbours that differ by at most this are of one surface
LEAST = 4  # pixels of a region that takes part in merging


def face_labels(image: Array, background: Array) -> Array:
    """Return for each pixel 0 (background) or its face direction 1..3, (H, W) int8.

    Args:
        image: (H, W, 3), 0..255.
        background: its background's colour, (3,).
    """
    colors = image.astype(np.float64)
    shown = np.abs(colors - background).max(axis=2) > JOIN
    if not shown.any():
        return np.zeros(shown.shape, np.int8)
    regions = _regions(colors, shown)
    count = np.bincount(regions[shown])
    sums = [np.bincount(regions[shown], colors[..., c][shown]) for c in range(3)]
    means = np.stack(sums, axis=1) / np.maximum(count, 1)[:, None]
    big = np.flatnonzero(count >= LEAST)
    if not len(big):
        big = np.flatnonzero(count)
    big = big[np.argsort(-count[big], kind="stable")[:64]]
    centres, weights = means[big], count[big].astype(np.float64)
    while len(centres) > 3:
        squared = ((centres[:, None] - centres) ** 2).sum(axis=2)
        cost = squared * weights[:, None] * weights / (weights[:, None] + weights)
        np.fill_diagonal(cost, np.inf)
        a, b = sorted(divmod(int(cost.argmin()), len(cost)))
        share = weights[b] / (weights[a] + weights[b])
        centres[a] += share * (centres[b] - centres[a])
        weights[a] += weights[b]
        centres, weights = np.delete(centres, b, axis=0), np.delete(weights, b)
    nearest = ((means[:, None] - centres) ** 2).sum(axis=2).argmin(axis=1)
    return np.where(shown, 1 + nearest[regions], 0).astype(np.int8)


@njit(cache=True)
def _regions(colors: Array, shown: Array) -> Array:
    """Return the number of each pixel's connected region of like colours, (H, W)."""
    height, width = shown.shape
    regions = np.full((height, width), -1, np.int64)
    stack = np.empty((height * width, 2), np.int64)
    count = 0
    for i in range(height):
        for j in range(width):
            if not shown[i, j] or regions[i, j] >= 0:
                continue
            regions[i, j] = count
            stack[0, 0], stack[0, 1] = i, j
            size = 1
            while size:
                size -= 1
                y, x = stack[size, 0], stack[size, 1]
                for k in range(4):
                    v, u = y + (k == 0) - (k == 1), x + (k == 2) - (k == 3)
                    if v < 0 or u < 0 or v >= height or u >= width:
                        continue
                    if not shown[v, u] or regions[v, u] >= 0:
                        continue
                    far = 0.0
                    for c in range(3):
                        far = max(far, abs(colors[v, u, c] - colors[y, x, c]))
                    if far <= JOIN:
                        regions[v, u] = count
                        stack[size, 0], stack[size, 1] = v, u
                        size += 1
            count += 1
    return np.where(regions < 0, 0, regions)
