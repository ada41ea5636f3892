"""Comparing two methods on the same items: intervals and tests for paired differences."""

import math
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np
from numpy.typing import ArrayLike, NDArray

from metrics.measures.checks import EmptyError, as_float64, require_finite
from metrics.measures.statistics import RESAMPLES, Estimate, cluster_bootstrap, normal_quantile

Array = NDArray[np.float64]

SIGN_FLIPS = 9999
# With so few clusters all sign patterns are tried: 2^13 = 8192.
_ALL_PATTERNS_UP_TO = 13
_SIGNS = 1 << 22


@dataclass(frozen=True)
class McNemar:
    """Questions that only one of two methods answers rightly, and the exact two-sided p-value."""

    only_first: int
    only_second: int
    p_value: float


def paired_bootstrap(
    first: ArrayLike,
    second: ArrayLike,
    clusters: ArrayLike,
    seed: int,
    resamples: int = RESAMPLES,
    confidence: float = 0.95,
) -> Estimate:
    """The mean of first - second, over items within clusters, then over clusters; with interval.

    Values (N,) of the same items in the same order, in the unit of the score. The differences are
    resampled by whole clusters (`statistics.cluster_bootstrap`), which keeps the pairs together.
    Source: Efron and Tibshirani 1993.
    """
    a, b = as_float64(first, "first"), as_float64(second, "second")
    if a.shape != b.shape:
        raise ValueError(f"paired values must have one shape, got {a.shape} and {b.shape}")
    require_finite(a, "first")
    require_finite(b, "second")
    return cluster_bootstrap(a - b, clusters, seed, resamples, confidence)


def sign_flip_test(differences: ArrayLike, seed: int, flips: int = SIGN_FLIPS) -> float:
    """Two-sided p-value of "the paired differences (S,) are symmetric about 0", by their mean.

    The fraction of sign patterns whose |mean| reaches the observed one: of all 2^S for S up to 13,
    else (1 + hits) / (1 + flips) over random patterns, which is valid at any number of flips. Give
    one difference per scene. Sources: Fisher 1935, section 21; Phipson and Smyth 2010 for the 1.
    """
    values = _require_differences(differences)
    largest = float(np.abs(values).max())
    if largest == 0.0:
        return 1.0
    unit = values / largest
    # Equal sums differ by rounding, according to the order of their terms.
    observed = abs(float(unit.sum())) - 1e-12 * len(unit)
    if len(unit) <= _ALL_PATTERNS_UP_TO:
        patterns = np.arange(2 ** len(unit))[:, None] >> np.arange(len(unit)) & 1
        return _count_reaching(patterns, unit, observed) / len(patterns)
    rng = np.random.default_rng(seed)
    step = max(1, _SIGNS // len(unit))
    hits = 0
    for start in range(0, flips, step):
        rows = min(step, flips - start)
        patterns = rng.integers(0, 2, (rows, len(unit)), dtype=np.uint8)
        hits += _count_reaching(patterns, unit, observed)
    return (1 + hits) / (1 + flips)


def _count_reaching(patterns: NDArray[np.integer], values: Array, observed: float) -> int:
    signs = 1.0 - 2.0 * patterns
    sums = np.einsum("ps,s->p", signs, values)
    return int(np.count_nonzero(np.abs(sums) >= observed))


def mcnemar_exact(first_right: ArrayLike, second_right: ArrayLike) -> McNemar:
    """Exact test that two methods are right equally often on the same questions (Q,), booleans.

    p = min(1, 2 P(X <= min(b, c))), X binomial with b + c trials at 1/2, where b and c count the
    questions that only one of them gets right; summed in whole numbers, hence exact. Source:
    McNemar 1947, in its exact form.
    """
    a, b = np.asarray(first_right), np.asarray(second_right)
    if a.dtype != np.bool_ or b.dtype != np.bool_ or a.ndim != 1 or a.shape != b.shape:
        raise ValueError(
            f"expected two boolean arrays (Q,), got {a.dtype} {a.shape} and {b.dtype} {b.shape}"
        )
    if len(a) == 0:
        raise EmptyError("there are no questions")
    only_a, only_b = int(np.count_nonzero(a & ~b)), int(np.count_nonzero(b & ~a))
    trials = only_a + only_b
    ways = tail = 1
    for k in range(min(only_a, only_b)):
        ways = ways * (trials - k) // (k + 1)
        tail += ways
    return McNemar(only_a, only_b, min(1.0, 2 * tail / 2**trials))


def holm(p_values: ArrayLike) -> Array:
    """Adjusted p-values (K,), in the given order: reject where they are at most alpha.

    The i-th smallest becomes the running maximum of (K - i + 1) p_(i), at most 1; this bounds the
    chance of any false rejection in the family by alpha. Source: Holm 1979.
    """
    p = as_float64(p_values, "p-values")
    if p.ndim != 1 or not ((p >= 0.0) & (p <= 1.0)).all():
        raise ValueError("p-values must be of shape (K,) and lie between 0 and 1")
    order = np.argsort(p, kind="stable")
    raised = np.maximum.accumulate(p[order] * np.arange(len(p), 0, -1))
    adjusted = np.empty_like(p)
    adjusted[order] = np.minimum(raised, 1.0)
    return adjusted


def smallest_detectable_difference(
    differences: ArrayLike, alpha: float = 0.05, power: float = 0.8
) -> float:
    """The mean difference that a two-sided test at alpha would find with this power.

    (z_(1 - alpha/2) + z_power) s / sqrt(S), with s the standard deviation of the paired differences
    (S,), one per scene; in their unit. Source: the normal approximation of the power of the paired
    t-test, Cohen 1988. Values of -1, 0 and 1 (right by one method only) give that of
    McNemar's test (Connor 1987); see also `smallest_significant_fraction`.
    """
    values = _require_differences(differences)
    if len(values) < 2:
        raise ValueError("the spread of differences needs at least 2 of them")
    if not 0.5 <= power < 1.0:
        raise ValueError(f"power must be at least 0.5 and below 1, got {power}")
    reach = normal_quantile(1.0 - alpha) + NormalDist().inv_cdf(power)
    return float(reach * values.std(ddof=1) / math.sqrt(len(values)))


def smallest_significant_fraction(questions: int, alpha: float = 0.05) -> float:
    """The smallest difference in accuracy that the exact McNemar test could call significant.

    d / questions, where d is the least number of discordant questions, all won by one method, with
    2^(1 - d) <= alpha: 6 at 0.05. This many questions can show no smaller difference, however alike
    the methods are; above 1, they can show none.
    """
    if questions < 1:
        raise EmptyError("there are no questions")
    if not 0.0 < alpha < 1.0:
        raise ValueError(f"alpha must lie between 0 and 1, got {alpha}")
    discordant = 1
    while 2.0 ** (1 - discordant) > alpha:
        discordant += 1
    return discordant / questions


def _require_differences(differences: ArrayLike) -> Array:
    values = as_float64(differences, "differences")
    if values.ndim != 1:
        raise ValueError(f"expected differences of shape (S,), got {values.shape}")
    if len(values) == 0:
        raise EmptyError("there are no differences")
    require_finite(values, "differences")
    return values
