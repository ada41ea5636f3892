"""Errors of planar depth, as given and after alignment to the truth.

The truth decides which pixels are scored: those of `mask`, or those where the truth is finite. A
prediction that is not finite there is an error; it never makes the mask smaller. True depth must be
positive. `compare_depth` selects and checks the pixels once, and every score takes its result. In
the formulas, p is a predicted depth, t the true one, and means are over the scored pixels.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from metrics.measures import alignment as alignments
from metrics.measures.alignment import Alignment
from metrics.measures.checks import MeasureError, require_depth_pair

Array = NDArray[np.float64]

# Scene units. Smaller depths are raised to this before a logarithm or an inverse is taken.
SMALLEST_LOG_DEPTH = 1e-3
DELTA_BASE = 1.25
NEAR = 1.03
SMALLEST_RATIO = 2.0**-10


@dataclass(frozen=True)
class DepthPair:
    """Predicted and true depth (N,) of the scored pixels, checked.

    `known` is what was computed of the truth; a pair that is aligned shares it.
    """

    predicted: Array
    true: Array
    known: dict[str, Array] = field(default_factory=dict, repr=False, compare=False)

    @property
    def true_log(self) -> Array:
        """The true ln t, t at least SMALLEST_LOG_DEPTH, (N,)."""
        if "log" not in self.known:
            self.known["log"] = np.log(np.maximum(self.true, SMALLEST_LOG_DEPTH))
        return self.known["log"]


def compare_depth(
    predicted_depth: ArrayLike, true_depth: ArrayLike, mask: NDArray[np.bool_] | None = None
) -> DepthPair:
    """Return the scored pixels of two depth arrays of one shape, usually (H, W).

    Raises NonFiniteError, with the count and the first pixel, where either is not finite inside the
    mask, EmptyError on an empty mask, MeasureError on other shapes or a truth that is not positive.
    """
    predicted, true, inside = require_depth_pair(predicted_depth, true_depth, mask)
    pair = DepthPair(predicted[inside], true[inside])
    if not (pair.true > 0.0).all():
        raise MeasureError("true depth", pair.true.min(), "positive depth inside the mask")
    return pair


def align(pair: DepthPair, alignment: Alignment) -> DepthPair:
    """Return the pair with the prediction fitted to the truth, as `measures.alignment` says."""
    return replace(pair, predicted=alignments.align(pair.predicted, pair.true, alignment))


def mse_depth(pair: DepthPair) -> float:
    """Return mean (p - t)^2, in squared units of depth.

    Source: Pix2Shape, section "Scene Reconstruction"; MSE-depth in its Table 1, MSE in its Table 2.
    """
    return float(np.square(pair.predicted - pair.true).mean())


def rmse(pair: DepthPair) -> float:
    """Return sqrt(mean (p - t)^2), in units of depth. Source: Eigen et al. 2014, RMSE (linear)."""
    return float(np.sqrt(mse_depth(pair)))


def abs_rel(pair: DepthPair) -> float:
    """Return mean |p - t| / t, a ratio. Source: Eigen et al. 2014, "Abs Relative difference"."""
    return float((np.abs(pair.predicted - pair.true) / pair.true).mean())


def sq_rel(pair: DepthPair) -> float:
    """Return mean (p - t)^2 / t, in units of depth.

    Source: Eigen et al. 2014, "Squared Relative difference".
    """
    return float((np.square(pair.predicted - pair.true) / pair.true).mean())


def rmse_log(pair: DepthPair) -> float:
    """Return sqrt(mean (ln p - ln t)^2). Source: Eigen et al. 2014, "RMSE (log)"."""
    predicted = np.maximum(pair.predicted, SMALLEST_LOG_DEPTH)
    return float(np.sqrt(np.square(np.log(predicted) - np.log(pair.true)).mean()))


def log10(pair: DepthPair) -> float:
    """Return mean |log10 p - log10 t|. Source: Saxena et al. 2009 (Make3D)."""
    predicted = np.maximum(pair.predicted, SMALLEST_LOG_DEPTH)
    return float(np.abs(np.log10(predicted) - np.log10(pair.true)).mean())


def irmse(pair: DepthPair) -> float:
    """Return sqrt(mean (1/p - 1/t)^2), in inverse units. Source: Uhrig et al. 2017 (KITTI)."""
    predicted = np.maximum(pair.predicted, SMALLEST_LOG_DEPTH)
    return float(np.sqrt(np.square(1.0 / predicted - 1.0 / pair.true).mean()))


def silog(pair: DepthPair) -> float:
    """Return the scale-invariant logarithmic error 100 sqrt(var d), with d = ln p - ln t.

    Multiplying a prediction above 0.001 scene units by a constant does not change it. Other depths
    count as 0.001, and at its full difference from the truth: the mean that the variance leaves out
    is that of the others, or 0 without any, so that no scale is found for depth at or behind the
    camera. Source: the KITTI depth benchmark (Uhrig et al. 2017): the root of the scale-invariant
    error of Eigen et al. 2014, section 3.2, times 100.
    """
    difference = np.log(np.maximum(pair.predicted, SMALLEST_LOG_DEPTH)) - pair.true_log
    seen = pair.predicted > SMALLEST_LOG_DEPTH
    if seen.all():
        difference -= difference.mean()
    elif seen.any():
        difference = np.where(seen, difference - difference[seen].mean(), difference)
    return float(100.0 * np.sqrt(np.square(difference).mean()))


def delta(pair: DepthPair, limit: float) -> float:
    """Return the fraction of pixels with max(p / t, t / p) < limit, in [0, 1].

    Pixels with p <= 0 never count. Sources: Ladicky et al. 2014; Eigen et al. 2014,
    "Threshold", with the limits 1.25, 1.25^2 and 1.25^3.
    """
    p, t = pair.predicted, pair.true
    return float(np.count_nonzero((p < limit * t) & (t < limit * p)) / len(p))


def within_eighth(pair: DepthPair, alignment: Alignment) -> float:
    """Return the fraction of pixels within a factor 1.25^(1/8) after an alignment.

    Depth after it is at least 1e-4. Source: Wu et al. 2025 (SAWA-H), as published.
    """
    cap = 1e4 if alignment == "disparity_scale_shift" else None
    p = np.maximum(alignments.align(pair.predicted, pair.true, alignment, cap), 1e-4)
    return delta(replace(pair, predicted=p), DELTA_BASE**0.125)


def scale_log2(pair: DepthPair) -> float:
    """Return log2 of the median of p / t: 0 is the true scale, 1 twice as far, -1 half as far.

    Ratios up to SMALLEST_RATIO, such as those of depth behind the camera, count as that.
    """
    return float(np.log2(max(float(np.median(pair.predicted / pair.true)), SMALLEST_RATIO)))


def depth_scores(
    pair: DepthPair, alignment: Alignment = "none", aligned: bool = False
) -> dict[str, float]:
    """Return every score of this module by name, after alignment.

    The names are `mse_depth`, `rmse`, `abs_rel`, `silog`, `delta_1`, `delta_1.03`, `delta_2` and
    `delta_3`, and without alignment `sq_rel`, `rmse_log`, `log10` and `irmse`; with one they end in
    `_after_` and its name. `aligned` says that the alignment was made already.
    """
    fitted = pair if aligned else align(pair, alignment)
    squared = mse_depth(fitted)
    named = {"mse_depth": squared, "rmse": float(np.sqrt(squared))}
    named |= {score.__name__: score(fitted) for score in (abs_rel, silog)}
    named |= {f"delta_{power}": delta(fitted, DELTA_BASE**power) for power in (1, 2, 3)}
    named["delta_1.03"] = delta(fitted, NEAR)
    if alignment == "none":
        return named | {score.__name__: score(pair) for score in (sq_rel, rmse_log, log10, irmse)}
    return {f"{name}_after_{alignment}": value for name, value in named.items()}
