"""Tests for paired differences: are two methods different on the same scenes or questions?"""

import math
from statistics import NormalDist

import numpy as np
from numpy.typing import ArrayLike, NDArray

from metrics.measures.checks import as_float64, require, require_finite, require_some
from metrics.measures.statistics import normal_quantile

Array = NDArray[np.float64]

SIGN_FLIPS = 9999
# Up to so many differences, all sign patterns are tried: 2^13 = 8192.
_ALL_PATTERNS_UP_TO = 13
_SIGNS = 1 << 22  # tried at a time


def sign_flip_test(differences: ArrayLike, seed: int, flips: int = SIGN_FLIPS) -> float:
    """Return the two-sided p-value of "the paired differences (S,) are symmetric about 0".

    It is the fraction of sign patterns whose |mean| reaches the observed one: among all 2^S
    patterns for S up to 13, else (1 + hits) / (1 + flips) among random ones, which is valid for any
    number of flips. Give one difference for each scene. Sources: Fisher 1935, section 21; Phipson
    and Smyth 2010 for the added 1.

    `scipy.stats.permutation_test` agrees where all patterns are tried. It draws other random ones
    and doubles a one-sided p-value, so published p-values would change.
    """
    values = _require_differences(differences)
    largest = float(np.abs(values).max())
    if largest == 0.0:
        return 1.0
    unit = values / largest
    # Sums of the same terms in another order may differ by rounding.
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


def mcnemar_exact(first_right: ArrayLike, second_right: ArrayLike) -> float:
    """Two-sided p-value of "two methods are right equally often" on the same questions (Q,).

    It is that of the binomial test of the questions that only one of the methods answers rightly.
    Source: McNemar 1947, in its exact form. The answers are booleans: right or not.
    """
    a, b = np.asarray(first_right), np.asarray(second_right)
    ok = a.dtype == b.dtype == np.bool_ and a.ndim == 1 and a.shape == b.shape
    found = f"{a.dtype} {a.shape} and {b.dtype} {b.shape}"
    require(ok, "answers", found, "two boolean arrays (Q,)")
    require_some(len(a), "answers")
    only_a, only_b = int(np.count_nonzero(a & ~b)), int(np.count_nonzero(b & ~a))
    trials = only_a + only_b
    if trials == 0:
        return 1.0
    from scipy.stats import binomtest  # slow to import, and rankings need no test

    return float(binomtest(only_a, trials).pvalue)


def holm(p_values: ArrayLike) -> Array:
    """Return adjusted p-values (K,), in the given order: reject where they are at most alpha.

    The i-th smallest becomes the running maximum of (K - i + 1) p_(i), at most 1. This bounds the
    chance of any false rejection among the K tests by alpha. Source: Holm 1979. (scipy.stats 1.17
    adjusts for the false discovery rate only.)
    """
    p = as_float64(p_values, "p-values")
    ok = p.ndim == 1 and bool(((p >= 0.0) & (p <= 1.0)).all())
    require(ok, "p-values", p, "numbers from 0 to 1, (K,)")
    order = np.argsort(p, kind="stable")
    raised = np.maximum.accumulate(p[order] * np.arange(len(p), 0, -1))
    adjusted = np.empty_like(p)
    adjusted[order] = np.minimum(raised, 1.0)
    return adjusted


def smallest_detectable_difference(
    differences: ArrayLike, alpha: float = 0.05, power: float = 0.8
) -> float:
    """Return the mean difference that a two-sided test at alpha would find with this power.

    (z_(1 - alpha/2) + z_power) s / sqrt(S), with s the standard deviation of the paired differences
    (S,), one for each scene. Source: the normal approximation of the power of the paired t-test,
    Cohen 1988. For differences of -1, 0 and 1 (right by one method only) it is that of McNemar's
    test (Connor 1987); see also `smallest_significant_fraction`.
    """
    values = _require_differences(differences)
    require(len(values) >= 2, "differences", len(values), "at least 2, to know their spread")
    require(0.5 <= power < 1.0, "power", power, "at least 0.5 and below 1")
    reach = normal_quantile(1.0 - alpha) + NormalDist().inv_cdf(power)
    return float(reach * values.std(ddof=1) / math.sqrt(len(values)))


def smallest_significant_fraction(questions: int, alpha: float = 0.05) -> float:
    """Return the smallest difference in accuracy that the exact McNemar test can call significant.

    It is d / questions, where d is the least number of discordant questions, all won by one method,
    with 2^(1 - d) <= alpha: 6 at 0.05. Above 1, so few questions can show no difference.
    """
    require_some(questions, "questions")
    require(0.0 < alpha < 1.0, "alpha", alpha, "between 0 and 1")
    return max(1, math.ceil(1.0 - math.log2(alpha))) / questions


def _require_differences(differences: ArrayLike) -> Array:
    values = as_float64(differences, "differences")
    require(values.ndim == 1, "differences", f"shape {values.shape}", "(S,)")
    require_some(len(values), "differences")
    require_finite(values, "differences")
    return values
