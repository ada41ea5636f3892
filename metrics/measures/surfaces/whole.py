"""Scores of whole surfaces of objects: points drawn evenly by area, from predicted meshes.

Points are few, so a perfect prediction does not score 0. What it scores is the noise level, a score
of its own.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from metrics.measures.surfaces.chamfer_hausdorff import chamfer, f_score, nearest_distances
from scenegen.common.random.seeding import Purpose, item_rng

Array = NDArray[Any]
POINTS = 4096  # of an image
NEAR = 0.02  # scene units
DRAWS = ("prediction", "truth", "truth again")


def drawn_points(triangles: Array, row: int, draw: str) -> NDArray[np.float32]:
    """Return points (POINTS, 3) evenly by area on triangles (F, 3, 3).

    Args:
        row: of the truth.
        draw: which of DRAWS it is.
    """
    rng = item_rng(DRAWS.index(draw), row, Purpose.SURFACE)
    start, aside, along = triangles[:, 0], *np.diff(triangles, axis=1).swapaxes(0, 1)
    ends = np.cumsum(np.sqrt(np.square(np.cross(aside, along)).sum(axis=1)))
    face = np.searchsorted(ends[:-1], rng.random(POINTS) * ends[-1])
    far, across = np.sqrt(rng.random((POINTS, 1))), rng.random((POINTS, 1))
    points = start[face] + far * (aside[face] + across * along[face])
    return np.asarray(points, np.float32)


def surface_scores(predicted: Array | None, true: list[Array] | None) -> dict[str, float]:
    """Return the scores of predicted points (N, 3); NaN where they or the true ones are None."""
    scores = dict.fromkeys(("whole_chamfer", "whole_f_score_0.02", "whole_chamfer_noise"), np.nan)
    if predicted is None or true is None:
        return scores
    for name, points in (("whole_chamfer", predicted), ("whole_chamfer_noise", true[1])):
        nearest = nearest_distances(points, true[0])
        scores[name] = min(chamfer(nearest), 4.0)
        if points is predicted:
            scores["whole_f_score_0.02"] = f_score(nearest, NEAR)
    return scores
