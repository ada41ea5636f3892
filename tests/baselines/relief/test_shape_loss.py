"""The loss of shape sees what is left inside each object after its own shift."""

import pytest
import torch

from baselines.relief.shape_loss import SLOPE, shape_loss

INSIDE = torch.tensor([[[1, 1, 0, 2], [1, 1, 0, 2]], [[1, 1, 0, 0], [0, 0, 0, 0]]])


def test_a_shift_of_each_object_costs_nothing():
    """Object 1 of the second image is another one than that of the first."""
    errors = torch.tensor([[[3.0, 3, 9, 5], [3, 3, 7, 5]], [[-1, -1, 8, 2], [6, 4, 0, 0]]])
    assert float(shape_loss(errors, INSIDE)) == 0
    assert float(shape_loss(errors, torch.zeros_like(INSIDE))) == 0


def test_the_rest_and_the_slopes_are_counted():
    errors = torch.zeros(2, 2, 4)
    errors[0, 0, 0] = 4  # mean 1; two of the six pairs of neighbours differ by 4
    expected = (3 + 3 * 1) / 8 + SLOPE * 2 * 4 / 6
    assert float(shape_loss(errors, INSIDE)) == pytest.approx(expected)
