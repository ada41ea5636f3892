"""Intervals against SciPy, against plain loops, and by simulation."""

import numpy as np
import pytest
from scipy import stats

from metrics.views.people.intervals import (
    crossed_estimate,
    line_within_people,
    mean_estimate,
    within,
)

RNG = np.random.default_rng(3)


def test_student_s_interval_is_scipy_s():
    values = RNG.normal(0.7, 0.1, 15)
    estimate = mean_estimate(values)
    expected = stats.ttest_1samp(values, 0).confidence_interval()
    assert (estimate.low, estimate.high) == pytest.approx(tuple(expected))
    assert mean_estimate([0.5]).low is None
    assert mean_estimate([0.5, 0.6]).low is None
    assert within(mean_estimate([0.0, 1.0, 0.0])).low == 0.0


def test_crossed_variance_by_plain_loops():
    values, people = RNG.random(60), np.repeat(np.arange(6), 10)
    questions = RNG.integers(0, 20, 60)
    mean = values.mean()

    def variance(labels):
        groups = sorted(set(labels))
        total = sum(sum(values[i] - mean for i in range(60) if labels[i] == g) ** 2 for g in groups)
        return len(groups) / (len(groups) - 1) * total / 60**2

    parts = variance(people.tolist()), variance(questions.tolist())
    error = max(*parts, sum(parts) - variance(list(range(60)))) ** 0.5
    estimate = crossed_estimate(values, people, questions)
    assert estimate.high - estimate.value == pytest.approx(stats.t.ppf(0.975, 5) * error)


def test_the_line_is_least_squares_with_a_height_for_each_person():
    people = np.repeat(np.arange(8), 12)
    angles = RNG.uniform(30, 180, 96)
    seconds = 1 + 0.02 * angles + RNG.normal(0, 2, 8)[people] + RNG.normal(0, 0.3, 96)
    line = line_within_people(angles, seconds, people)
    dummies = (people[:, None] == np.arange(8)).astype(float)
    expected = np.linalg.lstsq(np.column_stack([angles, dummies]), seconds, rcond=None)[0][0]
    assert line.slope.value == pytest.approx(expected)
    assert line.slope.low < 0.02 < line.slope.high
    assert line.intercept + line.slope.value * angles.mean() == pytest.approx(seconds.mean())
    residuals = seconds - dummies @ (dummies.T @ seconds / 12)
    x = angles - dummies @ (dummies.T @ angles / 12)
    residuals -= line.slope.value * x
    scores = [(x[people == g] @ residuals[people == g]) ** 2 for g in range(8)]
    error = (8 / 7 * sum(scores)) ** 0.5 / (x @ x)
    assert line.slope.high - line.slope.value == pytest.approx(stats.t.ppf(0.975, 7) * error)


def test_lines_that_cannot_be_drawn():
    assert line_within_people([], [], []) is None
    assert line_within_people([50.0, 50.0], [1, 2], ["a", "a"]) is None
    assert line_within_people([50.0, 60.0], [1, 2], ["a", "b"]) is None
    assert line_within_people([50.0, 60.0], [1, 2], ["a", "a"]).slope.low is None
