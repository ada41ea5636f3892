"""Surfaces behind: those that a scene's first view does not see, and another view does."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.camera import Lens, pixels_of

Array = NDArray[Any]

LEAST_PIXELS = 16
RECALL_WITHIN = 0.05  # scene units
# Scene units: a point so far behind all surfaces around its pixel in the first view is hidden.
MARGIN = 0.01


def hidden_from(
    points: Array,
    normals: Array,
    first_depth: Array,
    first_world_from_camera: Array,
    lens: Lens | float,
) -> Array:
    """Return which surface points the first view does not see, (N,) bool.

    Those outside of its picture, those that turn away from it, and those that lie by more than
    MARGIN behind every surface at their pixel there and its 8 neighbours.

    Args:
        points, normals: world, (N, 3) each; normals face the view that sees them.
        first_depth: planar depth of the first view, (H, W), scene units; NaN where no surface is.
        first_world_from_camera, lens: its camera.
    """
    height, width = first_depth.shape
    rotation, origin = first_world_from_camera[:3, :3], first_world_from_camera[:3, 3]
    seen = (points - origin) @ rotation
    row, column, inside = pixels_of(seen, first_depth.shape, lens)
    away = ((origin - points) * normals).sum(axis=1) <= 0.0
    seen_depth = np.where(np.isfinite(first_depth), first_depth, np.inf).astype(np.float64)
    padded = np.pad(seen_depth, 1, mode="edge")
    farthest = np.maximum.reduce(
        [padded[i : i + height, j : j + width] for i, j in np.ndindex(3, 3)]
    )
    return np.asarray(~inside | away | (-seen[:, 2] > farthest[row, column] + MARGIN))


def behind_scores(errors: Array, nearest: Array | None = None) -> dict[str, float]:
    """Return the scores of hidden surfaces, NaN where fewer than LEAST_PIXELS show them.

    - behind_depth_error: mean of the errors.
    - behind_recall_0.05: fraction of the points nearer than RECALL_WITHIN to a predicted one.

    Args:
        errors: lengths of `points.departures` at the M hidden pixels, (M,).
        nearest: distance of the true surface there to the prediction, (M,); None for no recall.
    """
    few = len(errors) < LEAST_PIXELS
    scores = {"behind_depth_error": np.nan if few else float(errors.mean())}
    if nearest is not None:
        recall = np.nan if few else float(np.mean(nearest < RECALL_WITHIN))
        scores[f"behind_recall_{RECALL_WITHIN:g}"] = recall
    return scores
