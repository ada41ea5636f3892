"""Which pixels hints look at."""

import numpy as np
import pytest

from metrics.submissions.hints.samples import mirrored_grid


@pytest.mark.parametrize("count", [1, 2, 63, 64, 65, 127, 128, 129, 1000, 4096])
def test_the_grid_is_its_own_mirror_image(count):
    grid = mirrored_grid(count, 32)
    assert np.array_equal(np.sort(count - 1 - grid), grid)
    assert len(grid) <= 64
    assert len(grid) >= min(count, 32)
    assert (grid[0], grid[-1]) == (0, count - 1)
