"""The grid of rotations: proper ones, which cover all others."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from baselines.training.rotations import rotation_grid


@pytest.mark.parametrize(("count", "farthest", "mean"), [(512, 30, 17), (1200, 25, 13)])
def test_rotations_are_proper_and_cover_all_others(count, farthest, mean):
    found = rotation_grid(count).astype(float)
    np.testing.assert_allclose(
        found @ found.swapaxes(1, 2), np.tile(np.eye(3), (count, 1, 1)), atol=1e-6
    )
    np.testing.assert_allclose(np.linalg.det(found), 1, atol=1e-6)
    others = Rotation.random(500, random_state=0).as_matrix()
    trace = np.einsum("aij,bij->ab", others, found).max(axis=1)
    angle = np.degrees(np.arccos(((trace - 1) / 2).clip(-1, 1)))
    assert angle.max() < farthest
    assert angle.mean() < mean
