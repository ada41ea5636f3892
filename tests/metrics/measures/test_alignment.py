"""Alignments against brute force: all lines through two points, and general solvers."""

import itertools

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.optimize import minimize, nnls

from metrics.measures.alignment import (
    align,
    align_points,
    depth_of_disparity,
    l1_scale,
    l1_scale_shift,
)
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


@given(DEPTHS)
def test_least_squares_in_disparity_are_those_of_a_general_solver(pairs):
    p, t = columns(pairs)
    d = np.abs(p) + 0.5
    matrix = np.stack([d, np.ones_like(d), -np.ones_like(d)], axis=1)  # scale >= 0, any shift
    scale, more, less = nnls(matrix, 1.0 / t)[0]
    expected = 1.0 / np.maximum(scale * d + more - less, 1.0 / t.max())
    assert depth_of_disparity(d, t) == pytest.approx(expected, rel=1e-6)
    assert align(1.0 / d, t, "disparity_scale_shift") == pytest.approx(expected, rel=1e-6)


@given(st.integers(0, 2**32 - 1))
def test_points_are_fitted_as_a_general_solver_fits_them(seed):
    rng = np.random.default_rng(seed)
    p, t = rng.normal(size=(2, 7, 3))
    p += rng.uniform(0.0, 3.0) * t

    def squares(x, shifted):
        return np.square(x[0] ** 2 * p + shifted * x[1:] - t).sum()  # a square is no negative scale

    for alignment, shifted in (("scale", 0.0), ("scale_shift", 1.0)):
        best = min(
            minimize(squares, [start, 0.0, 0.0, 0.0], (shifted,)).fun for start in (0.0, 0.3, 1.0)
        )
        found = np.square(align_points(p, t, alignment) - t).sum()
        assert found == pytest.approx(best, rel=1e-5)
        moved = 3.0 * t + shifted * np.array([1.0, -2.0, 5.0])
        assert align_points(moved, t, alignment) == pytest.approx(t)
    with pytest.raises(MeasureError):
        align_points(p, t, "scale_l1")
