"""What is refused, and how it is named."""

import numpy as np
import pytest

from metrics.measures.checks import (
    EmptyError,
    NonFiniteError,
    as_float64,
    require_depth_pair,
    require_finite,
    require_mask,
)


def test_the_message_counts_and_names_the_first_index():
    values = np.zeros((2, 3, 3))
    values[1, 0, 2] = np.nan
    values[1, 2, 0] = -np.inf
    with pytest.raises(NonFiniteError, match=r"it: 2 of 18 .* is nan at index \(1, 0, 2\)"):
        require_finite(values, "it")


def test_what_lies_outside_the_mask_is_not_looked_at():
    values = np.zeros((2, 3))
    values[0, 1] = np.nan
    mask = np.ones((2, 3), dtype=bool)
    mask[0, 1] = False
    require_finite(values, "it", mask)
    require_finite(np.stack([values] * 3, axis=-1), "it", mask)
    with pytest.raises(NonFiniteError):
        require_finite(values, "it", ~mask)


def test_the_largest_magnitude_is_allowed_and_more_is_not():
    require_finite(np.array([1e100, -1e100]), "it")
    with pytest.raises(NonFiniteError):
        require_finite(np.array([-1.1e100]), "it")


@pytest.mark.parametrize("bad", [["x"], [1j], [True], [[1], [1, 2]], [None], b"12", {}])
def test_only_real_numbers_pass(bad):
    with pytest.raises(ValueError, match="it: "):
        as_float64(bad, "it")


def test_shapes_must_agree():
    with pytest.raises(ValueError, match=r"predicted depth has shape \(3,\), the truth \(2, 3\)"):
        require_depth_pair(np.ones(3), np.ones((2, 3)), None)


def test_masks():
    with pytest.raises(EmptyError):
        require_mask(np.zeros((2, 2), dtype=bool), (2, 2))
    for bad in (np.ones((2, 2)), np.ones(2, dtype=bool), np.ones((2, 2), dtype=np.uint8)):
        with pytest.raises(ValueError, match="boolean mask"):
            require_mask(bad, (2, 2))


def test_a_prediction_cannot_shrink_the_mask():
    true = np.array([[1.0, np.nan], [2.0, 3.0]])
    predicted = np.array([[1.0, 5.0], [np.nan, 3.0]])
    with pytest.raises(NonFiniteError, match=r"predicted depth: 1 of 4 .* at index \(1, 0\)"):
        require_depth_pair(predicted, true, None)
    _, _, inside = require_depth_pair(np.ones((2, 2)), true, None)
    assert np.array_equal(inside, np.isfinite(true))
