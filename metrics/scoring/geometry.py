"""Planar depth of any kind of predicted geometry, as every score takes it."""

import numpy as np
from numpy.typing import NDArray

from metrics.measures.depth import Alignment
from metrics.submissions.reader import PredictedView

Array = NDArray[np.float64]


def planar_depth(predicted: PredictedView, true_depth: Array) -> tuple[Array, Alignment]:
    """Return planar depth (H, W) of a prediction, and the alignment that is still to be made.

    Depth stays as it is, and that of points is their -z. Disparity is fitted here: a d + b with the
    a >= 0 and b that bring it nearest to 1 / t in least squares, over the pixels where both are
    finite; depth is 1 / max(a d + b, 1 / max t). Source: Ranftl et al. 2020 (MiDaS), section 5;
    the limit is that of its published evaluation. Values that are not finite stay NaN.
    """
    if predicted.kind == "points":
        return -predicted.geometry[..., 2], predicted.alignment
    if predicted.kind == "depth":
        return predicted.geometry, predicted.alignment
    d = np.where(np.isfinite(predicted.geometry), predicted.geometry, np.nan)
    both = np.isfinite(d) & np.isfinite(true_depth)
    if not both.any():
        return np.full(d.shape, np.nan), "none"
    target = 1.0 / true_depth[both].astype(np.float64)
    d = d / (float(np.abs(d[both]).max()) or 1.0)
    centred = d[both] - d[both].mean()
    spread = float(centred @ centred)
    slope = max(float(centred @ target) / spread, 0.0) if spread > 0.0 else 0.0
    fitted = slope * (d - d[both].mean()) + target.mean()
    return 1.0 / np.maximum(fitted, target.min()), "none"
