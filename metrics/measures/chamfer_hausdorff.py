"""Distances between two point clouds, from one pass of nearest neighbours in double precision.

Every score here is a function of `NearestDistances`: find it once with `nearest_distances` (any two
clouds) or `image_search.nearest_distances_on_image` (two depth images of one camera), then read
all scores from it. "Forward" runs from the prediction to the truth, "reverse" from the truth to the
prediction. Distances are in the unit of the points (scene units in this benchmark).
"""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from metrics.measures.checks import EmptyError, as_float64, require_finite

Backend = Literal["auto", "pykdtree", "scipy"]


@dataclass(frozen=True)
class NearestDistances:
    """Distance of each point to the nearest point of the other cloud.

    forward: (N,) predicted points to the truth. reverse: (M,) true points to the prediction.
    """

    forward: NDArray[np.float64]
    reverse: NDArray[np.float64]


def nearest_distances(
    prediction: ArrayLike, truth: ArrayLike, backend: Backend = "auto"
) -> NearestDistances:
    """Exact nearest-neighbour distances both ways between clouds (N, 3) and (M, 3).

    Raises NonFiniteError on NaN, infinity or absurd magnitudes and EmptyError on an empty cloud,
    before any tree sees them. "auto" takes pykdtree when it is installed, else scipy.
    """
    predicted = _require_cloud(prediction, "prediction")
    true = _require_cloud(truth, "truth")
    return NearestDistances(
        query_nearest(true, predicted, backend), query_nearest(predicted, true, backend)
    )


def query_nearest(
    data: NDArray[np.float64], queries: NDArray[np.float64], backend: Backend = "auto"
) -> NDArray[np.float64]:
    """Distance (Q,) from each query (Q, 3) to the nearest of data (N, 3), both already checked."""
    if backend != "scipy":
        tree_class = _import_pykdtree(required=backend == "pykdtree")
        if tree_class is not None:
            found: NDArray[np.float64] = tree_class(data).query(queries)[0]
            return found
    from scipy.spatial import cKDTree

    return np.asarray(cKDTree(data).query(queries)[0], dtype=np.float64)


def _import_pykdtree(required: bool) -> Any:
    """Pykdtree's KDTree bound to one thread, or None when it is not installed.

    Its OpenMP runtime reads the thread count once, when it is loaded. Scoring runs one process per
    core, where more threads only get in each other's way; a count set by the user is respected.
    """
    unset = "OMP_NUM_THREADS" not in os.environ
    if unset:
        os.environ["OMP_NUM_THREADS"] = "1"
    try:
        from pykdtree.kdtree import KDTree
    except ImportError:
        if required:
            raise
        return None
    finally:
        if unset:
            del os.environ["OMP_NUM_THREADS"]
    return KDTree


def _require_cloud(points: ArrayLike, what: str) -> NDArray[np.float64]:
    cloud = np.ascontiguousarray(as_float64(points, what))
    if cloud.ndim != 2 or cloud.shape[1] != 3:
        raise ValueError(f"{what}: expected points of shape (N, 3), got {cloud.shape}")
    if len(cloud) == 0:
        raise EmptyError(f"{what}: the cloud has no points")
    require_finite(cloud, what)
    return cloud


def accuracy_distance(nearest: NearestDistances) -> float:
    """Mean over predicted points a of min_b |a - b|: how far off is what was predicted.

    The first half of `chamfer`. Sources: Pix2Shape, section "Scene Reconstruction"; the names of
    the halves follow Seitz et al. 2006 (multi-view stereo), who summarise by other statistics.
    """
    return float(nearest.forward.mean())


def completeness_distance(nearest: NearestDistances) -> float:
    """Mean over true points b of min_a |b - a|: how far off is what should have been predicted.

    The second half of `chamfer`. Sources as for `accuracy_distance`.
    """
    return float(nearest.reverse.mean())


def chamfer(nearest: NearestDistances) -> float:
    """mean_a min_b |a - b| + mean_b min_a |b - a|: distances unsquared, halves added.

    Source: Pix2Shape, section "Scene Reconstruction", the equation for CD(A, B). Other work
    squares the distances (`chamfer_squared`) or halves the sum; such numbers do not compare.
    """
    return accuracy_distance(nearest) + completeness_distance(nearest)


def chamfer_squared(nearest: NearestDistances) -> float:
    """mean_a min_b |a - b|^2 + mean_b min_a |b - a|^2, in squared units.

    Source: Fan et al. 2017 (A Point Set Generation Network), with means for sums.
    """
    return float(np.square(nearest.forward).mean() + np.square(nearest.reverse).mean())


def hausdorff_forward(nearest: NearestDistances) -> float:
    """max_a min_b |a - b|: the predicted point farthest from the truth.

    Source: Pix2Shape, section "Scene Reconstruction", max D_H^+(A, B) with A the prediction.
    """
    return float(nearest.forward.max())


def hausdorff_reverse(nearest: NearestDistances) -> float:
    """max_b min_a |b - a|: the true point farthest from the prediction.

    Source: Pix2Shape, section "Scene Reconstruction", max D_H^+(B, A) with A the prediction.
    """
    return float(nearest.reverse.max())


def hausdorff(nearest: NearestDistances) -> float:
    """The larger of `hausdorff_forward` and `hausdorff_reverse`.

    Source: Hausdorff 1914; Pix2Shape, section "Scene Reconstruction".
    """
    return max(hausdorff_forward(nearest), hausdorff_reverse(nearest))


def hausdorff_95(nearest: NearestDistances) -> float:
    """The larger of the two directions' 95th percentiles of the nearest distances.

    Each percentile is taken over its own direction (not over the pooled distances) and
    interpolates linearly between order statistics: type 7 of Hyndman and Fan 1996. Source: the
    ranked Hausdorff distance of Huttenlocher et al. 1993 in its usual 95% form.
    """
    return float(max(np.percentile(nearest.forward, 95.0), np.percentile(nearest.reverse, 95.0)))


def f_score(nearest: NearestDistances, threshold: float) -> float:
    """2 P R / (P + R) in [0, 1], 0 when both are 0.

    Precision P is the fraction of predicted points nearer than `threshold` to the truth, recall R
    that of true points nearer than it to the prediction; both strict. The threshold has the unit of
    the points. Source: Knapitsch et al. 2017 (Tanks and Temples).
    """
    if not 0.0 < threshold < np.inf:
        raise ValueError(f"an F-score threshold must be positive and finite, got {threshold}")
    precision = float(np.mean(nearest.forward < threshold))
    recall = float(np.mean(nearest.reverse < threshold))
    total = precision + recall
    return 2.0 * precision * recall / total if total > 0.0 else 0.0


def point_scores(
    nearest: NearestDistances, f_score_thresholds: Sequence[float] = ()
) -> dict[str, float]:
    """Every score of this module by name; F-scores as `f_score_<threshold>`."""
    named = {
        "chamfer": chamfer(nearest),
        "accuracy_distance": accuracy_distance(nearest),
        "completeness_distance": completeness_distance(nearest),
        "chamfer_squared": chamfer_squared(nearest),
        "hausdorff": hausdorff(nearest),
        "hausdorff_forward": hausdorff_forward(nearest),
        "hausdorff_reverse": hausdorff_reverse(nearest),
        "hausdorff_95": hausdorff_95(nearest),
    }
    return named | {f"f_score_{t:g}": f_score(nearest, t) for t in f_score_thresholds}
