"""Face directions of pixels: flat colours joined, then merged to three or two by Ward's rule."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[Any]
JOIN = 2.0  # of 255: neighbours that differ by at most this are of one surface
CLEAN = 0.02  # share of pixels in tiny regions above which a picture is smoothed
TINY, TINY_SMOOTHED = 4, 12  # pixels below which a region is part of those about it
ALIKE = 12.0  # of 255: neighbours of a pixel that smooth it
PASSES = 6  # of smoothing
BACKGROUND = 6.0  # of 255: a region this near the background's colour is of it


def labelings(image: Array, background: Array) -> Iterator[Array]:
    """Yield ways to give each pixel 0 (background) or its face direction 1..3, (H, W) int8.

    The likeliest comes first. Regions are merged to three colours or to two, weighted by their
    pixels and not: light makes one direction darker from face to face, and few pixels may show of
    another. Pictures with noise are smoothed first.

    Args:
        image: (H, W, 3), 0..255.
        background: its background's colour, (3,).
    """
    colors = image.astype(np.float64)
    regions, means, loose = _regions(colors, TINY)
    shown = (np.abs(means - background).max(axis=1) > JOIN)[regions]
    if shown.any() and loose[shown].mean() > CLEAN:
        for _ in range(PASSES):
            colors = _smoothed(colors)
        regions, means, _ = _regions(colors, TINY_SMOOTHED)
        shown = (np.abs(means - background).max(axis=1) > BACKGROUND)[regions]
    count = np.bincount(regions[shown], minlength=len(means))
    big = np.argsort(-count, kind="stable")[: min(64, np.count_nonzero(count))]
    earlier: list[Array] = []
    for number in (3, 2):
        for weights in (count[big].astype(np.float64), np.ones(len(big))):
            centres = _merged(means[big], weights, number)
            if not len(centres):
                return
            nearest = ((means[:, None] - centres) ** 2).sum(axis=2).argmin(axis=1)
            labels = np.where(shown, 1 + nearest[regions], 0).astype(np.int8)
            if not any(np.array_equal(labels, other) for other in earlier):
                earlier.append(labels)
                yield labels


def _merged(colors: Array, weights: Array, number: int) -> Array:
    """Return so many colours, merged by Ward's rule."""
    centres = colors.copy()
    while len(centres) > number:
        squared = ((centres[:, None] - centres) ** 2).sum(axis=2)
        cost = squared * weights[:, None] * weights / (weights[:, None] + weights)
        np.fill_diagonal(cost, np.inf)
        a, b = sorted(divmod(int(cost.argmin()), len(cost)))
        share = weights[b] / (weights[a] + weights[b])
        centres[a] += share * (centres[b] - centres[a])
        weights[a] += weights[b]
        centres, weights = np.delete(centres, b, axis=0), np.delete(weights, b)
    return centres


def _regions(colors: Array, tiny: int) -> tuple[Array, Array, Array]:
    """Return each pixel's region of like colours, the regions' mean colours, and which pixels were
    of a tiny region: they belong to the region beside them that is most like them.
    """
    regions = _connected(colors)
    count = np.bincount(regions.ravel())
    big = count >= min(tiny, count.max())
    number = np.where(big, np.cumsum(big) - 1, -1)[regions]
    rest = number >= 0
    means = (
        np.stack([np.bincount(number[rest], colors[..., c][rest]) for c in range(3)], axis=1)
        / count[big][:, None]
    )
    return _spread(number, colors, means), means, ~rest


@njit(cache=True)
def _smoothed(colors: Array) -> Array:
    """Return each pixel's mean with the neighbours within two pixels whose colours are alike."""
    height, width = colors.shape[:2]
    result = np.empty_like(colors)
    total = np.empty(3)
    for i in range(height):
        for j in range(width):
            total[:] = 0
            count = 0
            for v in range(max(0, i - 2), min(height, i + 3)):
                for u in range(max(0, j - 2), min(width, j + 3)):
                    if _difference(colors, i, j, v, u) <= ALIKE:
                        count += 1
                        for c in range(3):
                            total[c] += colors[v, u, c]
            result[i, j] = total / count
    return result


@njit(cache=True)
def _difference(colors: Array, i: int, j: int, v: int, u: int) -> float:
    far = 0.0
    for c in range(3):
        far = max(far, abs(colors[v, u, c] - colors[i, j, c]))
    return far


@njit(cache=True)
def _connected(colors: Array) -> Array:
    """Return the number of each pixel's connected region of like colours, (H, W)."""
    height, width = colors.shape[:2]
    regions = np.full((height, width), -1, np.int64)
    stack = np.empty((height * width, 2), np.int64)
    count = 0
    for i in range(height):
        for j in range(width):
            if regions[i, j] >= 0:
                continue
            regions[i, j] = count
            stack[0, 0], stack[0, 1] = i, j
            size = 1
            while size:
                size -= 1
                y, x = stack[size, 0], stack[size, 1]
                for k in range(4):
                    v, u = y + (k == 0) - (k == 1), x + (k == 2) - (k == 3)
                    if v < 0 or u < 0 or v >= height or u >= width or regions[v, u] >= 0:
                        continue
                    if _difference(colors, y, x, v, u) <= JOIN:
                        regions[v, u] = count
                        stack[size, 0], stack[size, 1] = v, u
                        size += 1
            count += 1
    return regions


@njit(cache=True)
def _spread(regions: Array, colors: Array, means: Array) -> Array:
    """Return regions where pixels with -1 have that of a neighbour, ring by ring."""
    height, width = regions.shape
    while (regions < 0).any():
        earlier = regions.copy()
        for i in range(height):
            for j in range(width):
                if earlier[i, j] >= 0:
                    continue
                least = np.inf
                for v in range(max(0, i - 1), min(height, i + 2)):
                    for u in range(max(0, j - 1), min(width, j + 2)):
                        if earlier[v, u] < 0:
                            continue
                        squared = ((colors[i, j] - means[earlier[v, u]]) ** 2).sum()
                        if squared < least:
                            least, regions[i, j] = squared, earlier[v, u]
    return regions
