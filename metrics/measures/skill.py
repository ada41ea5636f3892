"""Skill: a score on the scale where 0 is a floor and 1 is perfect; and paired intervals.

Source: the skill scores of weather forecasts, Murphy 1988, (score - reference) / (perfect -
reference).
"""

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from metrics.measures.checks import as_float64, require, require_finite, require_some
from metrics.measures.statistics import RESAMPLES, resampled_means, studentised_ends

Array = NDArray[Any]


def skill(score: float, floor: float, higher_is_better: bool) -> float | None:
    """Return (score - floor) / (perfect - floor); None where the floor itself is perfect.

    A perfect score is 1 where higher is better, as of fractions, which makes it (score - floor) /
    (1 - floor). It is 0 where lower is better, which makes it 1 - score / floor.
    """
    room = 1.0 - floor if higher_is_better else floor
    gain = score - floor if higher_is_better else floor - score
    # Of an error of 0, this is 1 to the bit.
    return gain / room if room > 0.0 and math.isfinite(gain) else None


def skill_intervals(
    scores: ArrayLike,
    floors: ArrayLike,
    seed: int,
    resamples: int = RESAMPLES,
    confidence: float = 0.95,
) -> tuple[Array, Array]:
    """Return intervals, low (K,) and high (K,), of 1 - mean(scores) / mean(floors).

    Of scores of which 1 is perfect, give what they lack: 1 - score.

    They are those of the studentised bootstrap, as `statistics.bootstrap_interval` has it, and
    paired: each resample draws clusters with all of their values. The standard error comes from the
    ratio's empirical influence values (Davison and Hinkley 1997, section 2.7.2). Both ends are NaN
    for a single cluster, and where a resample has floors of 0 only. The K skills share their
    resamples.

    Args:
        scores, floors: means of S clusters, (S, K) each, at least 0, lower is better.
        seed, resamples, confidence: as in `statistics.bootstrap_interval`.
    """
    errors, lines = as_float64(scores, "scores"), as_float64(floors, "floors")
    ok = errors.ndim == 2 and errors.shape == lines.shape
    require(ok, "scores", f"shapes {errors.shape} and {lines.shape}", "(S, K) each")
    require_some(errors.size, "scores")
    require_finite(errors, "scores")
    require_finite(lines, "floors")
    score, floor = errors.mean(axis=0), lines.mean(axis=0)
    require((floor > 0.0).all(), "mean of the baselines", floor.min(), "above 0")
    if len(errors) == 1:
        return np.full(len(score), np.nan), np.full(len(score), np.nan)
    apart = errors - score / floor * lines
    # Of scores that are all the same multiple of the floor, such as the floor itself, exactly 0.
    apart[np.abs(apart) <= 1e-15 * np.abs(errors)] = 0.0
    apart, lines = apart / floor, lines / floor
    products = [apart, lines, apart * apart, apart * lines, lines * lines]
    means = resampled_means(np.concatenate(products, axis=-1), seed, resamples)
    moved, base, *squares = np.split(means, len(products), axis=-1)
    ends = np.full((2, len(score)), np.nan)
    k = (base > 0.0).all(axis=0)
    moved, base, squares = moved[:, k], base[:, k], [square[:, k] for square in squares]
    ratio = moved / base
    variances = (squares[0] - 2.0 * ratio * squares[1] + ratio * ratio * squares[2]) / base**2
    low, high = studentised_ends(apart[:, k], ratio, variances, confidence)
    value = ((floor - score) / floor)[k]
    # Of 1 minus the ratio, what lies above is below.
    ends[:, k] = value - np.maximum(high, 0.0), value - np.minimum(low, 0.0)
    return ends[0], ends[1]
