"""Distances between two point clouds, from one pass of nearest neighbours in double precision.

Every score here is a function of `NearestDistances`. Compute these once, with `nearest_distances`
for any two clouds or `image_search.nearest_distances_on_image` for two depth images of one camera;
all scores follow from them. "Forward" means from the prediction to the truth, "reverse" from the
truth to the prediction. In the formulas, a is a predicted point (of the paper's set A) and b a true
one (of B). Distances are in the unit of the points: scene units in this benchmark.
"""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from metrics.measures.checks import as_float64, require, require_finite, require_some

Backend = Literal["auto", "pykdtree", "scipy"]


@dataclass(frozen=True)
class NearestDistances:
    """Distance of each point to the nearest point of the other cloud.

    Attributes:
        forward: from each predicted point to the truth, (N,).
        reverse: from each true point to the prediction, (M,).
    """

    forward: NDArray[np.float64]
    reverse: NDArray[np.float64]


def nearest_distances(
    prediction: ArrayLike, truth: ArrayLike, backend: Backend = "auto"
) -> NearestDistances:
    """Return exact nearest-neighbour distances both ways between clouds (N, 3) and (M, 3).

    The backend "auto" takes pykdtree where it is installed, else scipy. Before a tree is built,
    NaN, infinity and absurd magnitudes raise NonFiniteError, an empty cloud raises EmptyError, and
    other shapes raise MeasureError.
    """
    predicted = _require_cloud(prediction, "prediction")
    true = _require_cloud(truth, "truth")
    return NearestDistances(
        query_nearest(true, predicted, backend), query_nearest(predicted, true, backend)
    )


def query_nearest(
    data: NDArray[np.float64], queries: NDArray[np.float64], backend: Backend = "auto"
) -> NDArray[np.float64]:
    """Return the distance (Q,) from each query (Q, 3) to the nearest point of data (N, 3).

    Both must have been checked.
    """
    if backend != "scipy":
        tree_class = _import_pykdtree(required=backend == "pykdtree")
        if tree_class is not None:
            distances: NDArray[np.float64] = tree_class(data).query(queries)[0]
            return distances
    from scipy.spatial import cKDTree

    return np.asarray(cKDTree(data).query(queries)[0], dtype=np.float64)


def _import_pykdtree(required: bool) -> Any:
    """Return pykdtree's KDTree, bound to one thread, or None when it is not installed.

    Its OpenMP runtime reads the number of threads once, when it is loaded. Scoring runs one process
    per core, so more threads would only compete for cores. A number that the user set is respected.
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
    require(cloud.ndim == 2 and cloud.shape[1] == 3, what, f"shape {cloud.shape}", "(N, 3)")
    require_some(len(cloud), what)
    require_finite(cloud, what)
    return cloud


def accuracy_distance(nearest: NearestDistances) -> float:
    """mean_a min_b |a - b|: how far predicted points are from the truth, on average.

    This is the first term of `chamfer`. Sources: Pix2Shape, section "Scene Reconstruction", the
    equation of CD(A, B); the names of the two terms follow Seitz et al. 2006 (multi-view stereo),
    who use other statistics than the mean.
    """
    return float(nearest.forward.mean())


def completeness_distance(nearest: NearestDistances) -> float:
    """mean_b min_a |b - a|: how far true points are from the prediction, on average.

    This is the second term of `chamfer`. Sources as for `accuracy_distance`.
    """
    return float(nearest.reverse.mean())


def chamfer(nearest: NearestDistances) -> float:
    """mean_a min_b |a - b| + mean_b min_a |b - a|: the sum of both means, distances not squared.

    Source: Pix2Shape, section "Scene Reconstruction", the equation of CD(A, B), and its Tables 1, 2
    and 4. Other work squares the distances (`chamfer_squared`) or halves the sum, so its numbers
    differ.
    """
    return accuracy_distance(nearest) + completeness_distance(nearest)


def chamfer_squared(nearest: NearestDistances) -> float:
    """mean_a min_b |a - b|^2 + mean_b min_a |b - a|^2, in squared units.

    Source: Fan et al. 2017 (A Point Set Generation Network), with means instead of sums.
    """
    return float(np.square(nearest.forward).mean() + np.square(nearest.reverse).mean())


def hausdorff_forward(nearest: NearestDistances) -> float:
    """max_a min_b |a - b|: the distance of the predicted point that is farthest from the truth.

    Source: Pix2Shape, section "Scene Reconstruction", max D_H^+(A, B); Hausdorff-F in its appendix.
    """
    return float(nearest.forward.max())


def hausdorff_reverse(nearest: NearestDistances) -> float:
    """max_b min_a |b - a|: the distance of the true point that is farthest from the prediction.

    Source: Pix2Shape, section "Scene Reconstruction", max D_H^+(B, A); Hausdorff-R in its appendix.
    """
    return float(nearest.reverse.max())


def hausdorff(nearest: NearestDistances) -> float:
    """The larger of `hausdorff_forward` and `hausdorff_reverse`.

    Source: Hausdorff 1914; Pix2Shape, section "Scene Reconstruction", and its Tables 1 and 2.
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
    """2 P R / (P + R), in [0, 1]; 0 where precision P and recall R are both 0.

    P is the fraction of predicted points that are nearer to the truth than `threshold`, R that of
    true points that are nearer to the prediction than it. The threshold has the unit of the points.
    Source: Knapitsch et al. 2017 (Tanks and Temples).
    """
    require(0.0 < threshold < np.inf, "F-score threshold", threshold, "a positive finite number")
    precision = float(np.mean(nearest.forward < threshold))
    recall = float(np.mean(nearest.reverse < threshold))
    total = precision + recall
    return 2.0 * precision * recall / total if total > 0.0 else 0.0


def point_scores(
    nearest: NearestDistances, f_score_thresholds: Sequence[float] = ()
) -> dict[str, float]:
    """Return every score of this module by name; F-scores as `f_score_<threshold>`."""
    scores = (
        *(chamfer, accuracy_distance, completeness_distance, chamfer_squared),
        *(hausdorff, hausdorff_forward, hausdorff_reverse, hausdorff_95),
    )
    named = {score.__name__: score(nearest) for score in scores}
    return named | {f"f_score_{t:g}": f_score(nearest, t) for t in f_score_thresholds}


def paper_scores(nearest: NearestDistances) -> dict[str, float]:
    """Return the paper's own scores, `paper_<name>`, from distances between points of pixels.

    They depend on the number of pixels: the same surface, sampled elsewhere, does not score 0.
    """
    scores = (chamfer, hausdorff, hausdorff_forward, hausdorff_reverse)
    return {f"paper_{score.__name__}": score(nearest) for score in scores}
