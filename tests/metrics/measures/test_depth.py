"""Errors of depth by hand, and hostile depth; `test_axioms` has what holds for all measures."""

from typing import get_args

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from metrics.measures.alignment import Alignment
from metrics.measures.depth import align, compare_depth, delta, depth_scores, silog

ALIGNMENTS = get_args(Alignment)


def random_pair(seed):
    rng = np.random.default_rng(seed)
    true = rng.uniform(1.0, 3.0, (5, 6))
    return compare_depth(true * rng.uniform(0.5, 2.0) + 0.3 * rng.random((5, 6)), true)


def test_delta_limits_are_strict_and_symmetric():
    pair = compare_depth([1.25, 1.0, 1.24, 1.0, 1.5625, 1.9], [1.0, 1.25, 1.0, 1.24, 1.0, 1.0])
    assert [delta(pair, power) for power in (1, 2, 3)] == [2 / 6, 4 / 6, 6 / 6]


@pytest.mark.parametrize("alignment", ALIGNMENTS)
@pytest.mark.parametrize("value", [0.0, -1.0, 0.1, 2.5, 1e-300, 1e-30, 1e30, 1e100])
def test_constants_have_finite_scores(alignment, value):
    true = np.linspace(1.0, 3.0, 50)
    pair = compare_depth(np.full(50, value), true)
    assert np.isfinite(list(depth_scores(pair, alignment).values())).all()
    if alignment == "scale_shift":
        assert align(pair, alignment).predicted == pytest.approx(np.full(50, 2.0))


@pytest.mark.parametrize("alignment", ["none", "median_scale", "scale"])
def test_a_lost_sign_scores_worse_than_its_positive_twin(alignment):
    true = np.linspace(1.0, 3.0, 50)
    name = "silog" if alignment == "none" else f"silog_after_{alignment}"
    for depth in (np.full(50, 1.5), true):
        good, bad = (depth_scores(compare_depth(s * depth, true), alignment)[name] for s in (1, -1))
        assert bad > 500.0 > 100.0 > good


def test_pixels_behind_the_camera_find_no_scale():
    """The others are aligned without them: half of the pixels at ln 1000 each from a truth of 1."""
    true = np.ones(4)
    expected = 100.0 * np.sqrt(np.log(1000.0) ** 2 / 2.0)
    for scale in (1.0, 7.0):
        pair = compare_depth([scale, scale, -scale, 1e-3], true)
        assert silog(pair) == pytest.approx(expected)


@given(st.integers(0, 2**32 - 1))
def test_silog_of_positive_depth_is_a_standard_deviation(seed):
    """To the bit, so that no score of depth in front of the camera has changed."""
    pair = random_pair(seed)
    assert silog(pair) == 100.0 * np.sqrt(np.var(np.log(pair.predicted) - np.log(pair.true)))


def test_only_the_mask_is_scored():
    true = np.array([[1.0, 2.0], [np.nan, 4.0]])
    predicted = np.array([[1.0, 3.0], [np.nan, np.inf]])
    mask = np.array([[True, True], [False, False]])
    assert depth_scores(compare_depth(predicted, true, mask))["mse_depth"] == 0.5
