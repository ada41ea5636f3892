"""Coarser bodies in place of those with very many corners, whose supports take long."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.common.rotations import cos_sin

Array = NDArray[Any]
POINT_STEP = 2.0**-26  # of which corners are multiples; see `sampling.bodies`
MOST_CORNERS = 500  # of a body before its supports along many directions are those of a coarser one
COARSE_CORNERS = 128
_TRIED = 6000  # directions along which a coarse body is compared with its original


def coarse_hull(corners: Array) -> tuple[Array, float]:
    """Return COARSE_CORNERS of a body's corners, and by how much they must grow to contain all.

    Corners are the centres and radii of discs, (V, 4). One after another, that corner is taken
    which reaches farthest beyond those taken before.
    """
    height = 1 - (2 * np.arange(_TRIED) + 1) / _TRIED
    cosine, sine = cos_sin(np.arange(_TRIED) * ((5**0.5 - 1) / 2))
    radius = np.sqrt(1 - height * height)
    # Rounded as in `sampling.bodies`, so that the sums of products are exact.
    directions = rounded(np.stack([radius * cosine, height, radius * sine]), POINT_STEP)
    reach = corners[:, :3] @ directions + corners[:, 3:] * radius
    farthest, best, chosen = reach.max(axis=0), np.full(_TRIED, -1.0), []
    for _ in range(COARSE_CORNERS):
        chosen.append(int(reach[:, (farthest - best).argmax()].argmax()))
        best = np.maximum(best, reach[chosen[-1]])
    # Twice, since the directions that were not tried may need a little more than those that were.
    growth = 2 * float((farthest - best).max())
    return rounded(corners[chosen], POINT_STEP), float(rounded(np.array(growth), POINT_STEP))


def rounded(values: Array, step: float) -> Array:
    """Return the nearest multiples of a power of two; no zero is negative."""
    return np.asarray(np.rint(values * (1 / step)) * step + 0.0)
