"""Guesses that must not win relief; `test_definitions` has the formulas."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from metrics.measures.checks import EmptyError, MeasureError, NonFiniteError
from metrics.measures.relief import relief_scores

RNG = np.random.default_rng(3)
TRUE = np.maximum(RNG.normal(0.0, 0.15, 4000), 0.0)
SPOT = np.where(np.arange(4000) == 9, 0.06, 0.0)  # an object of one pixel


@pytest.mark.parametrize("true", [SPOT, np.full(9, 0.3)], ids=["one", "all alike"])
def test_the_truth_is_perfect_and_the_empty_room_has_nothing(true):
    varied = float(np.ptp(true) > 0.0)
    assert relief_scores(true, true) == {
        "relief_correlation": pytest.approx(varied, abs=1e-12),
        "relief_iou": 1.0,
    }
    assert set(relief_scores(np.zeros_like(true), true).values()) == {0.0}


@given(st.floats(-2.0, 2.0), st.floats(1e-12, 1e-6), st.booleans())
def test_noise_and_a_constant_win_and_lose_nothing(lift, size, along):
    """Even noise that is the true relief itself, made too small to see."""
    noise = TRUE if along else RNG.normal(0.0, 1.0, 4000)
    found = relief_scores(lift + size * noise, TRUE)["relief_correlation"]
    assert abs(found) <= 2e-3 if not along else 0.0 <= found <= 1e-3


def test_correlation_turns_with_the_sign_of_relief_and_never_overflows():
    turned = {"relief_correlation": pytest.approx(-1.0), "relief_iou": 0.0}
    assert relief_scores(-TRUE, TRUE) == turned
    largest = np.where(TRUE > 0.1, 3e38, -3e38)
    assert 0.0 < relief_scores(largest, TRUE)["relief_correlation"] <= 1.0


def test_where_nothing_stands_out_there_is_no_score():
    assert all(np.isnan(list(relief_scores(TRUE, np.full(4000, 0.05)).values())))
    for error, arrays in (
        (EmptyError, ([], [])),
        (MeasureError, ([0.1], [0.1, 0.2])),
        (NonFiniteError, ([np.nan], [0.1])),
        (NonFiniteError, ([0.1], [np.inf])),
    ):
        with pytest.raises(error):
            relief_scores(*map(np.asarray, arrays))
