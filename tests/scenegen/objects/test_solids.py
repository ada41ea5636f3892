"""Winding and resting directions of bodies with known answers."""

import numpy as np
import pytest

from scenegen.objects.solids import resting_directions

CUBE = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)


def leaning_prism(lean):
    """A unit square base, two high; the top is moved sideways by `lean`."""
    return CUBE * (1, 2, 1) + np.outer(CUBE[:, 1], [lean, 0, 0])


@pytest.mark.parametrize(("lean", "stays"), [(0.0, True), (0.9, True), (1.1, False)])
def test_a_prism_falls_over_once_its_middle_leaves_its_base(lean, stays):
    """The centre of mass stands `lean` / 2 off the base's centre, 1/2 from its edge."""
    found = resting_directions(leaning_prism(lean))
    assert (found == [0, -1, 0]).all(axis=1).any() == stays


def test_rest_is_about_the_centre_of_mass_not_of_the_corners():
    """Many corners at one end move their mean but not the centre of mass."""
    crowd = np.array([(0.5 + 1e-3 * np.cos(a), 2.0, 0.5 + 1e-3 * np.sin(a)) for a in range(60)])
    crowd += [1.1, 0, 0]
    body = np.concatenate([CUBE, crowd])  # a cube under a thin leaning spire
    assert (resting_directions(body) == [0, -1, 0]).all(axis=1).any()
    assert abs(body.mean(axis=0)[0] - 0.5) > 0.5, "the corners' mean is off the base"
