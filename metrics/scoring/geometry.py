"""Planar depth of any kind of predicted geometry, as every score takes it."""

import numpy as np
from numpy.typing import NDArray

from metrics.measures.alignment import Alignment, depth_of_disparity
from metrics.measures.depth import align, compare_depth
from metrics.submissions.reader import PredictedView

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
WIDER: tuple[Alignment, ...] = (
    "scale", "scale_shift", "scale_l1", "scale_shift_l1", "disparity_scale_shift",
)  # fmt: skip


def planar_depth(predicted: PredictedView, true_depth: Array) -> tuple[Array, Alignment]:
    """Return planar depth (H, W) of a prediction, and the alignment that its scores need.

    Depth stays as it is, and that of points is their -z. Disparity is fitted here, over the pixels
    where both are finite, by `measures.alignment.depth_of_disparity`; elsewhere depth is NaN.
    `disparity_scale_shift` is the only alignment that is then made already.
    """
    if predicted.kind == "points":
        return -predicted.geometry[..., 2], predicted.alignment
    if predicted.kind == "depth":
        return predicted.geometry, predicted.alignment
    depth = np.full(predicted.geometry.shape, np.nan)
    both = np.isfinite(predicted.geometry) & np.isfinite(true_depth)
    if both.any():
        true = true_depth[both].astype(np.float64)
        depth[both] = depth_of_disparity(predicted.geometry[both], true)
    return depth, scored_alignment(predicted.kind, predicted.alignment)


def fitted_depth(depth: Array, true_depth: Array, mask: Mask, alignment: Alignment) -> Array:
    """Return depth (H, W) after the alignment that its scores need, NaN outside of the mask.

    Where nothing is left to fit, it is `depth` itself.
    """
    if alignment in ("none", "disparity_scale_shift") or not mask.any():
        return depth
    fitted = np.full(depth.shape, np.nan)
    fitted[mask] = align(compare_depth(depth, true_depth, mask), alignment).predicted
    return fitted


def depth_as_scored(predicted: PredictedView, true_depth: Array) -> Array:
    """Return planar depth (H, W) as scores see it, for pictures; no value needs to be finite."""
    depth, alignment = planar_depth(predicted, true_depth)
    return fitted_depth(depth, true_depth, np.isfinite(depth) & np.isfinite(true_depth), alignment)


def scored_alignment(kind: str, alignment: Alignment) -> Alignment:
    """Return the alignment under which a kind of geometry is scored, from the declared one."""
    return "disparity_scale_shift" if kind == "disparity" else alignment


def alignments_scored(kind: str, alignment: Alignment) -> tuple[Alignment, ...]:
    """Return the alignments after which depth is scored once more.

    They leave at least as much open as the method does: to tell more than it can know would score
    something that it does not predict.
    """
    if kind == "disparity":
        return ("disparity_scale_shift",)
    if alignment == "scale_shift":
        return ("scale_shift", "scale_shift_l1")
    return WIDER if alignment != "median_scale" else (alignment, *WIDER)
