"""Scores of objects alone: the room's floor and walls, most of a picture, have no part in them.

Which pixels show an object is told by the truth; a prediction needs no masks. Predicted points
count wherever they lie, also those of pixels that truly show the room.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]

LEAST_PIXELS = 16  # an object counts where so many pixels show it
RECALL_WITHIN = (0.02, 0.05)  # scene units
SIZE_EDGES = (0, 1, 2, 4, 8, 100)  # percent of the picture


def counted_objects(object_id: Array) -> Array:
    """Return at which pixels an object is that counts, the shape of `object_id`, bool."""
    ids, pixels = np.unique(object_id[object_id > 0], return_counts=True)
    return np.isin(object_id, ids[pixels >= LEAST_PIXELS])


def single_objects(object_id: Array, depth_error: Array, nearest: Array) -> dict[str, Array]:
    """Return the scores of each object that counts, columns of (K,), in the order of their ids.

    The columns are `object` (its id), `pixels` (how many show it), `object_depth_error` and
    `object_completeness` (means over these), and `object_recall_<limit>`: 1 where its completeness
    is below the limit, else 0.

    Args:
        object_id: of the scored pixels, (N,); 0 is the room.
        depth_error: absolute difference of predicted and true planar depth there, (N,).
        nearest: distance of the true point there to the nearest predicted point, (N,).
    """
    ids, pixels = np.unique(object_id[object_id > 0], return_counts=True)
    ids, pixels = ids[pixels >= LEAST_PIXELS].astype(np.int64), pixels[pixels >= LEAST_PIXELS]
    masks = [object_id == number for number in ids.tolist()]
    completeness = np.array([float(nearest[mask].mean()) for mask in masks])
    return {
        "object": ids,
        "pixels": pixels.astype(np.int64),
        "object_depth_error": np.array([float(depth_error[mask].mean()) for mask in masks]),
        "object_completeness": completeness,
        **{f"object_recall_{w:g}": (completeness < w).astype(np.float64) for w in RECALL_WITHIN},
    }


def object_means(objects: Mapping[str, Array]) -> dict[str, float]:
    """Return the scores of a picture from those of its single objects, columns of (K,).

    `object_depth_error` and `object_completeness` are means over the pixels of all of them, recalls
    over the objects. All are NaN where there is none.
    """
    pixels = objects["pixels"]
    means = {}
    for name, column in objects.items():
        if name.startswith("object_"):
            weights = None if name.startswith("object_recall_") else pixels
            mean = float(np.average(column, weights=weights)) if len(pixels) else np.nan
            means[name] = mean
    return means


def size_range(share: float) -> str:
    """Return between which percentages of the picture's pixels a share lies, such as "1-2"."""
    last = len(SIZE_EDGES) - 2
    i = min(int(np.searchsorted(SIZE_EDGES, 100.0 * share, side="right")) - 1, last)
    return f"{SIZE_EDGES[i]}-{SIZE_EDGES[i + 1]}"
