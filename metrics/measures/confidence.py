"""Whether a method knows where it is wrong: sparsification of the errors of depth.

The pixels of which a method is least sure are left out, more and more of them. If its confidence is
worth something, the mean error of the others falls, at best as fast as if the largest errors went
first. Only the order of confidences counts, so any increasing scale of them scores the same.

Source: Ilg et al. 2018 (uncertainty of optical flow) for AUSE; Poggi et al. 2020 (uncertainty of
self-supervised depth) for AURG and for abs_rel.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]

STEPS = 20
REMOVED = np.arange(STEPS) / STEPS  # fractions of the pixels that are left out
EDGES = 0.1  # fraction of the pixels with the steepest brightness


def sparsification(errors: Array, confidence: Array) -> Array:
    """Return the mean error, (20,), of the pixels that are left when REMOVED of them are out.

    Equal confidences leave together: each of their pixels has the mean error of all of them.

    Args:
        errors, confidence: (N,), N at least 1; the least sure pixels go first.
    """
    _, group, count = np.unique(confidence, return_inverse=True, return_counts=True)
    mean = np.bincount(group, errors) / count
    kept = np.sort(group)[::-1]  # the surest first
    total = np.concatenate([[0.0], np.cumsum(mean[kept])])
    left = -(-len(errors) * np.arange(STEPS, 0, -1) // STEPS)
    return np.asarray(total[left] / left)


def confidence_scores(errors: Array, confidence: Array) -> dict[str, float]:
    """Return `ause_abs_rel` and `aurg_abs_rel`: areas between curves of `sparsification`.

    AUSE lies between the curve and that of the oracle, in which the largest errors go first; 0 is
    perfect. AURG lies between the mean error and the curve; 0 is no better than a random order.

    Args:
        errors: |p - t| / t of the N scored pixels.
        confidence: of each; larger is surer.
    """
    curve, best = sparsification(errors, confidence), sparsification(errors, -errors)
    return {
        "ause_abs_rel": float((curve - best).mean()),
        "aurg_abs_rel": float((errors.mean() - curve).mean()),
    }


def distance_from_edges(image: Array) -> Array:
    """Return how far each pixel is from the nearest edge of brightness, (H, W), pixels.

    As a confidence it is a guess without any network: depth is worst at edges. Edges are the
    EDGES of the pixels where the brightness of the image (H, W, 3) is steepest.
    """
    from scipy.ndimage import distance_transform_edt

    brightness = image.astype(np.float64).mean(axis=-1)
    steep = np.hypot(*np.gradient(brightness)) if min(brightness.shape) > 1 else brightness * 0.0
    edge = steep > np.quantile(steep, 1.0 - EDGES)
    return np.asarray(distance_transform_edt(~edge) if edge.any() else np.zeros(edge.shape))
