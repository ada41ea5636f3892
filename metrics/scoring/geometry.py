"""Planar depth of any kind of predicted geometry, as every score takes it."""

import numpy as np
from numpy.typing import NDArray

from metrics.measures.alignment import Alignment, depth_of_disparity
from metrics.submissions.reader import PredictedView

Array = NDArray[np.float64]
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
