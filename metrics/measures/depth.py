"""Errors of planar depth, as given and after alignment to the truth.

The scored pixels are the truth's: `mask`, or where the truth is finite. A prediction that is not
finite there is an error, never a smaller mask. Truth must be positive. `compare_depth` picks and
checks the pixels once; every metric takes its result. p is a predicted depth, t the true one, and
means run over the scored pixels.
"""

from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from metrics.measures.checks import require_depth_pair

Array = NDArray[np.float64]
Alignment = Literal["none", "median_scale", "scale", "scale_shift"]

# Depths below this count as this in logarithms, which have no value at 0 and below. In scene units.
SMALLEST_LOG_DEPTH = 1e-3
DELTA_BASE = 1.25


@dataclass(frozen=True)
class DepthPair:
    """Predicted and true depth (N,) of the scored pixels, checked."""

    predicted: Array
    true: Array


def compare_depth(
    predicted_depth: ArrayLike, true_depth: ArrayLike, mask: NDArray[np.bool_] | None = None
) -> DepthPair:
    """The scored pixels of two depth arrays of one shape, usually (H, W).

    Raises NonFiniteError with the count and the first pixel if either is not finite inside the
    mask, EmptyError on an empty mask, ValueError on a truth that is not positive.
    """
    predicted, true, inside = require_depth_pair(predicted_depth, true_depth, mask)
    pair = DepthPair(predicted[inside], true[inside])
    if not (pair.true > 0.0).all():
        raise ValueError(f"true depth must be positive inside the mask, got {pair.true.min()}")
    return pair


def align(pair: DepthPair, alignment: Alignment) -> DepthPair:
    """The pair with the prediction moved on to the truth, by what the alignment allows.

    - none: p as given.
    - median_scale: s p, s = median(t) / median(p). Source: Zhou et al. 2017 (Unsupervised Learning
      of Depth and Ego-Motion).
    - scale: s p, s = sum(p t) / sum(p p), which minimises sum (s p - t)^2.
    - scale_shift: s p + b, which minimises sum (s p + b - t)^2. Source: Ranftl et al. 2020 (MiDaS),
      here applied to depth where they align disparity.

    A scale is never negative: with s < 0 a prediction that swaps near and far (disparity, say)
    would pass for depth. Where the formula gives s < 0 or none (p is 0 throughout, or constant
    under scale_shift), s = 0, which is the least-squares optimum under s >= 0.
    """
    p, t = pair.predicted, pair.true
    if alignment == "none":
        return pair
    if alignment == "median_scale":
        return replace(pair, predicted=_ratio(float(np.median(t)), float(np.median(p))) * p)
    # Squares of unit-sized numbers do not vanish, and a constant is 1 and centres to 0 exactly.
    size = float(np.abs(p).max()) or 1.0
    unit = p / size
    if alignment == "scale":
        return replace(pair, predicted=_ratio(float(unit @ t), float(unit @ unit)) * unit)
    if alignment == "scale_shift":
        centred, target = unit - unit.mean(), t - t.mean()
        spread = float(centred @ centred)
        return replace(pair, predicted=_ratio(float(centred @ target), spread) * centred + t.mean())
    raise ValueError(f"alignment must be one of {get_args(Alignment)}, got {alignment!r}")


def _ratio(above: float, below: float) -> float:
    return max(above / below, 0.0) if below > 0.0 else 0.0


def mse_depth(pair: DepthPair) -> float:
    """Mean (p - t)^2, in squared depth units. Source: Pix2Shape, section "Scene Reconstruction"."""
    return float(np.square(pair.predicted - pair.true).mean())


def rmse(pair: DepthPair) -> float:
    """sqrt(mean (p - t)^2), in depth units. Source: Eigen et al. 2014, "RMSE (linear)"."""
    return float(np.sqrt(mse_depth(pair)))


def abs_rel(pair: DepthPair) -> float:
    """Mean |p - t| / t, a ratio. Source: Eigen et al. 2014, "Abs Relative difference"."""
    return float((np.abs(pair.predicted - pair.true) / pair.true).mean())


def silog(pair: DepthPair) -> float:
    """100 sqrt(mean d^2 - (mean d)^2) with d = ln p - ln t: scale-invariant log error.

    In hundredths of natural-log units; multiplying the prediction by a constant changes nothing.
    A p below 0.001 scene units counts as 0.001, so that depth at or behind the camera has
    a score, and a bad one. Source: the KITTI depth benchmark (Uhrig et al. 2017), which takes the
    root of the scale-invariant error of Eigen et al. 2014, section 3.2, times 100.
    """
    logs = np.log(np.maximum(pair.predicted, SMALLEST_LOG_DEPTH))
    return float(100.0 * np.sqrt(np.var(logs - np.log(np.maximum(pair.true, SMALLEST_LOG_DEPTH)))))


def delta(pair: DepthPair, power: int) -> float:
    """The fraction of pixels with max(p / t, t / p) < 1.25^power, in [0, 1].

    A p that is not positive never counts. Sources: Ladicky et al. 2014; Eigen et al. 2014,
    "Threshold", with powers 1, 2 and 3.
    """
    p, t, limit = pair.predicted, pair.true, DELTA_BASE**power
    return float(np.mean((p < limit * t) & (t < limit * p)))


def depth_scores(pair: DepthPair, alignment: Alignment = "none") -> dict[str, float]:
    """Every score of this module by name, after alignment.

    The names are `mse_depth`, `rmse`, `abs_rel`, `silog`, `delta_1`, `delta_2` and `delta_3`; with
    an alignment they end in `_after_median_scale`, `_after_scale` or `_after_scale_shift`.
    """
    aligned = align(pair, alignment)
    named = {score.__name__: score(aligned) for score in (mse_depth, rmse, abs_rel, silog)}
    named |= {f"delta_{power}": delta(aligned, power) for power in (1, 2, 3)}
    ending = "" if alignment == "none" else f"_after_{alignment}"
    return {name + ending: value for name, value in named.items()}
