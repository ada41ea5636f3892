"""Paired tests against scipy, by hand, and by simulation where no difference exists."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import permutation_test

from metrics.measures.checks import EmptyError, MeasureError, NonFiniteError
from metrics.views.compare.paired_tests import (
    holm,
    mcnemar_exact,
    sign_flip_test,
    smallest_detectable_difference,
    smallest_significant_fraction,
)


def detectable(differences, _):
    return smallest_detectable_difference(differences)


def test_sign_flips_by_hand():
    # Of the 8 sign patterns of 1, 2, 3 only +++ and --- reach a sum of 6.
    assert sign_flip_test([1.0, 2.0, 3.0], seed=0) == 0.25
    # The sums are +-6, +-4, +-2 and twice 0; half of them reach the observed 4.
    assert sign_flip_test([-1.0, 2.0, 3.0], seed=0) == 0.5
    assert sign_flip_test([5.0], seed=0) == sign_flip_test([0.0] * 30, seed=0) == 1.0
    assert sign_flip_test([0.1] * 3, seed=0) == sign_flip_test([1e90] * 3, seed=0) == 0.25


def test_sign_flips_agree_with_scipy():
    for count in (9, 30):
        differences = np.random.default_rng(count).standard_normal(count) + 0.5
        pair, settings = (differences, np.zeros(count)), {"n_resamples": 9999, "rng": 1}
        expected = permutation_test(
            pair, lambda x, y: np.mean(x - y), permutation_type="samples", **settings
        ).pvalue
        found = sign_flip_test(differences, seed=0)
        assert found == pytest.approx(expected, abs=1e-12 if count == 9 else 0.006)
        assert found == sign_flip_test(differences, seed=0)
        assert found == sign_flip_test(-differences, seed=0)


@given(st.lists(st.floats(0.0, 1.0), min_size=1, max_size=20))
def test_holm_rejects_step_by_step(p_values):
    adjusted = holm(p_values)
    order = np.argsort(p_values, kind="stable")
    rejecting = True
    for rank, index in enumerate(order):
        rejecting = rejecting and p_values[index] * (len(p_values) - rank) <= 0.05
        assert (adjusted[index] <= 0.05) == rejecting
    assert ((adjusted >= p_values) & (adjusted <= 1.0)).all()


def test_the_detectable_difference_is_detected_with_its_power():
    rng = np.random.default_rng(2)
    differences = rng.standard_normal((2000, 100))
    effect = 2.8015852 / 10.0  # (1.9599640 + 0.8416212) / sqrt(100)
    found = [smallest_detectable_difference(row) for row in differences]
    assert np.mean(found) == pytest.approx(effect, rel=0.01)
    means, errors = differences.mean(axis=1) + effect, differences.std(axis=1, ddof=1) / 10.0
    assert (np.abs(means / errors) > 1.9599640).mean() == pytest.approx(0.8, abs=0.03)


NAN = np.nan
NONE = np.zeros(0, dtype=bool)
WRONG_DIFFERENCES = ((EmptyError, []), (NonFiniteError, [1.0, NAN]), (MeasureError, [[1.0, 2.0]]))


@pytest.mark.parametrize(
    ("kind", "where", "test", "arguments"),
    [
        *(
            (kind, "differences", test, [values, 0])
            for test in (sign_flip_test, detectable)
            for kind, values in WRONG_DIFFERENCES
        ),
        (MeasureError, "differences", detectable, [[1.0], 0]),
        (MeasureError, "power", smallest_detectable_difference, [[1.0, 2.0], 0.05, 1.0]),
        (MeasureError, "answers", mcnemar_exact, [[0, 1], [True, False]]),
        (MeasureError, "answers", mcnemar_exact, [[True], [True, False]]),
        (EmptyError, "answers", mcnemar_exact, [NONE, NONE]),
        *((MeasureError, "p-values", holm, [bad]) for bad in ([1.1], [-0.1], [NAN], [[0.5]])),
        (EmptyError, "questions", smallest_significant_fraction, [0]),
        (MeasureError, "alpha", smallest_significant_fraction, [10, 0.0]),
    ],
)
def test_wrong_input_is_named(kind, where, test, arguments):
    with pytest.raises(MeasureError) as caught:
        test(*arguments)
    assert (type(caught.value), caught.value.where) == (kind, where)
