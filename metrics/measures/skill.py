"""Skill: a score on the scale where 0 is a floor and 1 is perfect; and its paired interval.

Source: the skill scores of weather forecasts, Murphy 1988, (score - reference) / (perfect -
reference).
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from metrics.measures.checks import as_float64, require, require_finite, require_some
from metrics.measures.statistics import RESAMPLES, bca_ends, normal_quantile, resampled_means


def skill(score: float, floor: float, higher_is_better: bool) -> float | None:
    """Return (score - floor) / (perfect - floor); None where the floor itself is perfect.

    A perfect score is 1 where higher is better, as of fractions, which makes it (score - floor) /
    (1 - floor). It is 0 where lower is better, which makes it 1 - score / floor.
    """
    room = 1.0 - floor if higher_is_better else floor
    gain = score - floor if higher_is_better else floor - score
    # Of an error of 0, this is 1 to the bit.
    return gain / room if room > 0.0 and math.isfinite(gain) else None


def skill_interval(
    scores: ArrayLike,
    floors: ArrayLike,
    seed: int,
    resamples: int = RESAMPLES,
    confidence: float = 0.95,
) -> tuple[float, float]:
    """Return the BCa interval of 1 - mean(scores) / mean(floors), of S clusters.

    It is paired: each resample draws clusters with both of their values. Its acceleration comes
    from the ratio's empirical influence values (Efron and Tibshirani 1993, equation 22.28). Both
    ends are NaN for a single cluster, and where a resample has floors of 0 only.

    Args:
        scores, floors: means of the clusters, (S,) each, at least 0, lower is better.
        seed, resamples, confidence: as in `statistics.bootstrap_interval`.
    """
    table = np.stack([as_float64(scores, "scores"), as_float64(floors, "floors")], axis=-1)
    require(table.ndim == 2, "scores", f"shape {table.shape[:-1]}", "(S,)")
    require_some(len(table), "scores")
    require_finite(table, "scores and floors")
    score, floor = table.mean(axis=0)
    require(floor > 0.0, "mean of the floors", floor, "above 0")
    value = float((floor - score) / floor)
    if len(table) == 1:
        return math.nan, math.nan
    ratio = score / floor
    apart: NDArray[np.float64] = table[:, 0] - ratio * table[:, 1]
    # Of scores that are all the same multiple of the floor, such as the floor itself, exactly 0.
    apart[np.abs(apart) <= 1e-15 * np.abs(table[:, 0])] = 0.0
    means = resampled_means(np.stack([apart, table[:, 1]], axis=-1), seed, resamples)
    if not means[:, 1].all():
        return math.nan, math.nan
    low, high = bca_ends(apart / floor, means[:, 0] / means[:, 1], normal_quantile(confidence))
    return value - max(high, 0.0), value - min(low, 0.0)
