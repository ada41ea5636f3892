"""Intervals for scores: Wilson's for fractions, the bootstrap over scenes for everything else."""

import math
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np
from numpy.typing import ArrayLike, NDArray

from metrics.measures.checks import EmptyError, as_float64, require_finite

Array = NDArray[np.float64]

RESAMPLES = 2000
# Draws held at a time: bounds the memory, whatever the number of scenes, and stays in the cache.
_DRAWS = 1 << 16


@dataclass(frozen=True)
class Estimate:
    """A mean over `n` clusters with its interval; low and high are NaN for n = 1."""

    value: float
    low: float
    high: float
    n: int


def wilson_interval(successes: int, n: int, confidence: float = 0.95) -> tuple[float, float]:
    """Wilson's score interval for a fraction, within [0, 1]; n independent trials.

    (k + z^2/2 -+ z sqrt(k (n - k) / n + z^2/4)) / (n + z^2), with k successes and z the normal
    quantile at (1 + confidence) / 2. Source: Wilson 1927, Probable Inference.
    """
    if n <= 0:
        raise EmptyError("a fraction needs at least one trial")
    if not 0 <= successes <= n:
        raise ValueError(f"successes must lie between 0 and {n}, got {successes}")
    z = normal_quantile(confidence)
    middle, total = successes + z * z / 2.0, n + z * z
    half = z * math.sqrt(successes * (n - successes) / n + z * z / 4.0)
    # At 0 and n successes an end is the fraction itself, which rounding may miss.
    share = successes / n
    return max(0.0, min(share, (middle - half) / total)), min(
        1.0, max(share, (middle + half) / total)
    )


def normal_quantile(confidence: float) -> float:
    """Z with P(-z < Z < z) = confidence, for Z standard normal."""
    if not 0.0 < confidence < 1.0:
        raise ValueError(f"confidence must lie between 0 and 1, got {confidence}")
    return NormalDist().inv_cdf((1.0 + confidence) / 2.0)


def cluster_means(values: ArrayLike, clusters: ArrayLike) -> Array:
    """The mean of the values of each cluster (S,), by sorted label; usually items within scenes.

    Values (N,) or (N, K) for K scores at once, which gives (S, K). Clusters (N,) are labels.
    """
    table, labels = as_float64(values, "values"), np.asarray(clusters)
    if table.ndim not in (1, 2) or labels.shape != table.shape[:1]:
        raise ValueError(f"got values {table.shape} with cluster labels {labels.shape}")
    if len(table) == 0:
        raise EmptyError("there are no values")
    require_finite(table, "values")
    names, index = np.unique(labels, return_inverse=True)
    sums = np.zeros((len(names), *table.shape[1:]))
    np.add.at(sums, index, table)
    counts = np.bincount(index).reshape(-1, *(1,) * (table.ndim - 1))
    return sums / counts


def cluster_bootstrap(
    values: ArrayLike,
    clusters: ArrayLike,
    seed: int,
    resamples: int = RESAMPLES,
    confidence: float = 0.95,
) -> Estimate:
    """The mean over clusters of their means, with the interval of `bootstrap_interval`.

    Values (N,), clusters (N,) labels. Whole clusters are resampled, as views of one scene err
    together (Davison and Hinkley 1997, section 3.8): with items resampled instead, intervals come
    out too short.
    """
    means = cluster_means(values, clusters)
    if means.ndim != 1:
        raise ValueError("cluster_bootstrap takes one score (N,); see bootstrap_interval for more")
    low, high = bootstrap_interval(means[:, None], seed, resamples, confidence)
    return Estimate(float(means.mean()), float(low[0]), float(high[0]), len(means))


def bootstrap_interval(
    means: Array, seed: int, resamples: int = RESAMPLES, confidence: float = 0.95
) -> tuple[Array, Array]:
    """BCa intervals, low (K,) and high (K,), for the column means of cluster means (S, K).

    Bias-corrected and accelerated percentiles of the bootstrapped mean. Sources: Efron 1987; Efron
    and Tibshirani 1993, equations 14.9 to 14.15. Columns share their resamples, and a column's
    interval does not depend on the others. The same seed gives the same interval. Both ends are
    NaN for one cluster, which says nothing about the spread.

    Chosen by simulation with 200 clusters: coverage is 93 to 95% on skewed scores, as that of plain
    percentiles, and nearer to 95% where most clusters score 0. It falls to about 90% where the mean
    hangs on a few clusters (one in fifty fails), as it does with any interval from so little.
    """
    table = as_float64(means, "cluster means")
    if table.ndim != 2 or table.size == 0:
        raise ValueError(f"expected cluster means (S, K), got {table.shape}")
    if not isinstance(resamples, int) or resamples < 100:
        raise ValueError(f"a bootstrap needs at least 100 resamples, got {resamples}")
    require_finite(table, "cluster means")
    z = normal_quantile(confidence)
    if len(table) == 1:
        return np.full(table.shape[1], np.nan), np.full(table.shape[1], np.nan)
    # Distances from the mean: a constant column is then exactly 0 in every resample.
    centre = table.mean(axis=0)
    deviations = table - centre
    deviations[:, (table == table[0]).all(axis=0)] = 0.0
    resampled = _resampled_means(deviations, seed, resamples)
    ends = [_bca_ends(d, r, z) for d, r in zip(deviations.T, resampled.T, strict=True)]
    low, high = np.array(ends).T
    return centre + low, centre + high


def _resampled_means(values: Array, seed: int, resamples: int) -> Array:
    """Means (B, K) of `resamples` draws, with replacement, of the rows of values (S, K)."""
    rng = np.random.default_rng(seed)
    count = len(values)
    step = max(1, _DRAWS // count)
    means = []
    for start in range(0, resamples, step):
        rows = min(step, resamples - start)
        drawn = rng.integers(0, count, (rows, count)) + count * np.arange(rows)[:, None]
        times = np.bincount(drawn.ravel(), minlength=rows * count).reshape(rows, count)
        # Not a matrix product: BLAS may add in another order on another number of threads.
        means.append(np.einsum("bs,sk->bk", times.astype(np.float64), values) / count)
    return np.concatenate(means)


def _bca_ends(deviations: Array, resampled: Array, z: float) -> tuple[float, float]:
    """The two BCa percentiles of the resampled means of deviations from the mean."""
    squares = float(np.square(deviations).sum())
    if squares == 0.0:
        return 0.0, 0.0
    # Skewness of the jackknife values, which for a mean are the deviations times a constant.
    unit = deviations / math.sqrt(squares)
    acceleration = float((unit**3).sum()) / 6.0
    # Resamples that equal the mean miss 0 by rounding, either way.
    equal = 1e-12 * math.sqrt(squares)
    below = np.count_nonzero(resampled < -equal) + 0.5 * np.count_nonzero(
        np.abs(resampled) <= equal
    )
    normal = NormalDist()
    share = min(max(below / len(resampled), 1.0 / len(resampled)), 1.0 - 1.0 / len(resampled))
    bias = normal.inv_cdf(share)

    def level(quantile: float) -> float:
        shifted = bias + quantile
        return normal.cdf(bias + shifted / (1.0 - acceleration * shifted))

    low, high = np.quantile(resampled, [level(-z), level(z)])
    return float(low), float(high)
