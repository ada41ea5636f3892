"""Means, lines and their 95% intervals where people, or people and questions, are the sample."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats

Array = NDArray[np.float64]
CONFIDENCE = 0.95


@dataclass(frozen=True)
class Estimate:
    """A number and its 95% interval.

    Attributes:
        low, high: None for fewer than three participants, or where none differ.
        n: how many of the sample it is from, participants unless it is said otherwise.
    """

    value: float
    low: float | None
    high: float | None
    n: int


def _around(value: float, error: float | None, degrees: int, n: int) -> Estimate:
    if error is None or degrees < 2 or not math.isfinite(error):
        return Estimate(value, None, None, n)
    half = float(stats.t.ppf((1 + CONFIDENCE) / 2, degrees)) * error
    return Estimate(value, value - half, value + half, n)


def mean_estimate(values: ArrayLike) -> Estimate:
    """Return the mean of one value of each of n participants, with Student's interval."""
    table = np.asarray(values, np.float64)
    count = len(table)
    error = float(table.std(ddof=1)) / math.sqrt(count) if count > 1 else None
    return _around(float(table.mean()), error, count - 1, count)


def within(estimate: Estimate, low: float = 0.0, high: float = 1.0) -> Estimate:
    """Return an estimate whose interval keeps to what is possible."""
    if estimate.low is None or estimate.high is None:
        return estimate
    ends = max(low, estimate.low), min(high, estimate.high)
    return Estimate(estimate.value, *ends, estimate.n)


def crossed_estimate(values: ArrayLike, people: ArrayLike, questions: ArrayLike) -> Estimate:
    """Return the mean of N values with an interval in which people and questions are both samples.

    The variance of the mean is that between people, plus that between questions, less that of
    single values, which both hold (Cameron, Gelbach and Miller 2011, Robust inference with
    multiway clustering), and at least the larger of the two. Student's quantile has the degrees of
    freedom of the smaller sample.

    Args:
        values, people, questions: the values, and who gave them to which question, (N,) each.
    """
    table = np.asarray(values, np.float64)
    count, mean = len(table), float(table.mean())
    variances, sizes = [], []
    for labels in (people, questions):
        index = np.unique(np.asarray(labels), return_inverse=True)[1].reshape(-1)
        sums = np.bincount(index, table - mean)
        sizes.append(len(sums))
        if len(sums) < 2:
            return Estimate(mean, None, None, sizes[0])
        variances.append(len(sums) / (len(sums) - 1) * float(np.square(sums).sum()) / count**2)
    single = float(np.square(table - mean).sum()) / (count - 1) / count
    error = math.sqrt(max(*variances, sum(variances) - single))
    return within(_around(mean, error, min(sizes) - 1, sizes[0]))


def mean_of_people(values: ArrayLike, people: ArrayLike) -> Estimate:
    """Return the mean of participants' means of (N,) values, with Student's interval."""
    index = np.unique(np.asarray(people), return_inverse=True)[1].reshape(-1)
    return mean_estimate(np.bincount(index, np.asarray(values, np.float64)) / np.bincount(index))


@dataclass(frozen=True)
class Line:
    """y = intercept + slope x, with the interval of the slope; `answers` is how many it fits."""

    slope: Estimate
    intercept: float
    answers: int


def line_within_people(x: ArrayLike, y: ArrayLike, people: ArrayLike) -> Line | None:
    """Return the least-squares line of (N,) values whose height differs from person to person.

    Both x and y are taken as differences from the person's own mean, so that who is slow in
    everything does not tilt the line. The slope's interval is robust to whatever the answers of a
    person share (CR1: G / (G - 1) sum_g (sum_i x_i u_i)^2 / (sum x^2)^2 for G persons, u being
    what the line leaves), with Student's quantile of G - 1 degrees of freedom. The intercept makes
    the line pass through the means of all.

    None where nobody has answers at two different x.
    """
    table = [np.asarray(values, np.float64) for values in (x, y)]
    if not len(table[0]):
        return None
    index = np.unique(np.asarray(people), return_inverse=True)[1].reshape(-1)
    sizes = np.bincount(index)
    dx, dy = (values - (np.bincount(index, values) / sizes)[index] for values in table)
    spread = float(np.square(dx).sum())
    if spread <= 1e-9 * max(1.0, float(np.square(table[0]).sum())):
        return None
    slope = float((dx * dy).sum()) / spread
    groups = len(sizes)
    error = None
    if groups > 1:
        scores = np.bincount(index, dx * (dy - slope * dx))
        error = math.sqrt(groups / (groups - 1) * float(np.square(scores).sum())) / spread
    intercept = float(table[1].mean()) - slope * float(table[0].mean())
    return Line(_around(slope, error, groups - 1, groups), intercept, len(index))
