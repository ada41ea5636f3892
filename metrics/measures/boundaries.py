"""Occluding boundaries: where depth jumps between neighbours, by the ratio of their depths.

Source: Bochkovskii et al. 2024 (Depth Pro), section 3.3 and its published evaluation: ten ratios
from 1.05 to 1.25, and a mean in which each weighs as much as it is large. A scale of the depth
changes nothing.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]

RATIOS = np.linspace(1.05, 1.25, 10)
WEIGHTS = RATIOS / RATIOS.sum()
NEAREST = 1e-6  # smaller depths are raised to this


def boundary_scores(depth: Array, true_depth: Array, mask: Array) -> dict[str, float]:
    """Return `boundary_f1` and `boundary_recall` of planar depth, (H, W) each.

    At each ratio, a pixel and a neighbour whose depth is larger by more than that are a boundary,
    in each of four directions.

    - boundary_f1: the published score. Precision and recall are means over the directions, F1 is
      their harmonic mean, and all are 0 where nothing can be counted. So the truth scores below 1
      where it has no boundary in a direction, or at a ratio.
    - boundary_recall: the fraction of the true boundaries, of all directions together, that are
      predicted as well; the mean over the ratios at which the truth has any, with the same weights.
      NaN where it has none. (The published recall is of boundaries of masks.)

    Args:
        mask: the scored pixels, (H, W); pairs of two of them count.
    """
    said, true = (
        np.where(mask, np.maximum(d.astype(np.float64), NEAREST), 1.0) for d in (depth, true_depth)
    )
    counts = np.zeros((4, 3, len(RATIOS)))
    pairs = zip(*map(_pairs, (said, true, mask)), strict=True)
    for i, (near, truly, both) in enumerate(pairs):
        p, t = (np.where(both[0] & both[1], d[1] / d[0], 0.0) for d in (near, truly))
        counts[i] = [_above(d) for d in (p, t, np.minimum(p, t))]
    predicted, true_count, common = counts.transpose(1, 0, 2)
    precision = (common / np.maximum(predicted, 1.0)).mean(axis=0)
    recall = (common / np.maximum(true_count, 1.0)).mean(axis=0)
    f1 = 2.0 * precision * recall / np.maximum(precision + recall, np.finfo(float).tiny)
    in_all = true_count.sum(axis=0)
    found = common.sum(axis=0) / np.maximum(in_all, 1.0)
    weights = WEIGHTS * (in_all > 0)
    return {
        "boundary_f1": float(f1 @ WEIGHTS),
        "boundary_recall": float(found @ weights / weights.sum()) if in_all[0] else np.nan,
    }


def _pairs(image: Array) -> Iterator[tuple[Array, Array]]:
    """Yield pixels and their neighbours on the right, on the left, below and above."""
    sides = (image[:, :-1], image[:, 1:]), (image[:-1], image[1:])
    for first, second in sides:
        yield first, second
        yield second, first


def _above(ratios: Array) -> Array:
    """Return how many ratios exceed each of RATIOS."""
    large = ratios[ratios > RATIOS[0]]
    exceeded = np.searchsorted(RATIOS, large)  # each exceeds so many of them
    return np.bincount(exceeded, minlength=len(RATIOS) + 1)[::-1].cumsum()[::-1][1:]
