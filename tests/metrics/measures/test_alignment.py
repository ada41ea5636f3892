"""Least absolute errors against all lines through two points; `test_definitions` has the others."""

import itertools

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from metrics.measures import alignment
from metrics.measures.alignment import align_points, depth_of_disparity, l1_scale, l1_scale_shift
from metrics.measures.checks import MeasureError

DEPTHS = st.lists(
    st.tuples(
        st.one_of(st.integers(-3, 9), st.floats(-4.0, 9.0)).map(lambda x: round(float(x), 9)),
        st.floats(0.25, 9.0),
    ),
    min_size=1,
    max_size=9,
)


def cost(p, t, scale, shift):
    return float((np.abs(scale * p + shift - t) / t).sum())


def columns(pairs):
    return np.array(pairs, float).T


@given(DEPTHS)
@example([(0.0, 1.0), (0.0, 2.0)])
@example([(-1.0, 1.0), (-2.0, 2.0)])
@example([(1.0, 2.0)] * 3)
def test_l1_fits_are_the_best_of_all_break_points(pairs):
    p, t = columns(pairs)
    scales = [0.0, *(b / a for a, b in pairs if a > 0.0)]
    found = cost(p, t, l1_scale(p, t, 1.0 / t), 0.0)
    assert found == pytest.approx(min(cost(p, t, s, 0.0) for s in scales), rel=1e-9, abs=1e-9)
    lines = [(0.0, b) for b in t]
    for (a, b), (c, d) in itertools.combinations(pairs, 2):
        if abs(a - c) > 1e-9 and (b - d) / (a - c) > 0.0:
            scale = (b - d) / (a - c)
            lines.append((scale, b - scale * a))
    scale, shift = l1_scale_shift(p, t, 1.0 / t)
    assert scale >= 0.0
    best = min(cost(p, t, *line) for line in lines)
    assert cost(p, t, scale, shift) == pytest.approx(best, rel=1e-8, abs=1e-8)


def test_points_are_aligned_in_least_squares_only():
    points = np.ones((2, 3))
    with pytest.raises(MeasureError):
        align_points(points, points, "scale_l1")


@pytest.mark.parametrize("noise", [0.0, 0.05, 1.0])
def test_a_line_through_many_points_is_found_from_few(noise, monkeypatch):
    """It is the optimum of all: the sum of errors is that of the search over all points."""
    rng = np.random.default_rng(0)
    t = rng.uniform(0.5, 8.0, 20_000)
    p = 0.4 * t * (1.0 + noise * rng.standard_normal(len(t))) + 0.3
    sums, scales = [], []
    for many in (len(t), 10_000):
        monkeypatch.setattr(alignment, "MANY", many)
        scales.append(alignment.l1_scale(p, t, 1.0 / t))
        scale, shift = alignment.l1_scale_shift(p, t, 1.0 / t)
        sums.append(np.abs(scale * p + shift - t) @ (1.0 / t))
    assert scales[0] == scales[1]
    assert sums[1] == pytest.approx(sums[0], rel=1e-13, abs=1e-9)
    assert noise == 0.0 or alignment._l1_of_many(p, t, 1.0 / t) is not None


def test_where_few_points_mislead_the_line_is_that_of_all(monkeypatch):
    """Every 20th point, and so all that are looked at first, lies on another line."""
    rng = np.random.default_rng(1)
    p = rng.uniform(1.0, 5.0, 20_000)
    t = np.where(np.arange(len(p)) % 20, 2.0 * p + 1.0 + rng.normal(0.0, 0.5, len(p)), p)
    best = l1_scale_shift(p, t, 1.0 / t)
    monkeypatch.setattr(alignment, "MANY", 10_000)
    monkeypatch.setattr(alignment, "SOME", 1000)
    assert l1_scale_shift(p, t, 1.0 / t) == pytest.approx(best, rel=1e-9)


def test_no_depth_of_disparity_exceeds_its_cap():
    true = np.array([1.0, 2.0, 4.0])
    for cap, expected in ((None, [1, 2, 4]), (3.0, [1, 2, 3]), (9.0, [1, 2, 4])):
        assert depth_of_disparity(5.0 / true + 1.0, true, cap) == pytest.approx(expected)
    assert depth_of_disparity(np.array([4.0, 2.0, 0.0]), true).max() == pytest.approx(4.0)
