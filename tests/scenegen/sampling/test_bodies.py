"""Convex bodies of many shapes at once, against the body of each alone."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from shape_checks import support

from scenegen.description.names import SHAPE_NAMES
from scenegen.objects.basic_shapes import unit_shape
from scenegen.objects.coarse_hulls import COARSE_CORNERS, rounded
from scenegen.sampling.bodies import DIRECTION_STEP, Bodies

SHAPES = [unit_shape(name) for name in SHAPE_NAMES]
BODIES = Bodies(SHAPES)
RNG = np.random.default_rng(0)
KIND = RNG.integers(len(SHAPES), size=200)
TURN = Rotation.random(200, rng=RNG).as_matrix()
DIRECTIONS = RNG.normal(size=(300, 3))
DIRECTIONS = rounded(DIRECTIONS / np.linalg.norm(DIRECTIONS, axis=1)[:, None], DIRECTION_STEP)


@pytest.mark.parametrize("coarse", [False, True])
def test_reach_is_the_support_of_each_shape(coarse):
    found = BODIES.reach(KIND, TURN, DIRECTIONS, coarse)
    expected = [support(SHAPES[k], DIRECTIONS @ turn) for k, turn in zip(KIND, TURN, strict=True)]
    more = found - np.array(expected)
    teapots = (SHAPE_NAMES.index("teapot") == KIND)[:, None] & coarse
    assert abs(more[~teapots[:, 0]]).max() < 1e-7
    assert more.min() > -1e-7, "a coarse body contains the exact one"
    assert more.max() < (4e-3 if coarse else 1e-7)
    assert len(SHAPES[SHAPE_NAMES.index("teapot")].hull_points) > 4 * COARSE_CORNERS


def test_sums_of_rounded_products_are_exact_in_any_order():
    """So that libraries which add in other orders, or fuse, find the same bits."""
    points = rounded(RNG.uniform(-1, 1, (3, 5000)), 2.0**-26)
    some = points * DIRECTIONS[:50].T[:, :, None].repeat(100, axis=1).reshape(3, 5000)
    a, b, c = some
    assert ((a + b) + c == a + (b + c)).all()
    assert ((a + b) + c == b + (c + a)).all()
    loose = RNG.uniform(-1, 1, (3, 5000)) * RNG.uniform(-1, 1, (3, 5000))
    assert ((loose[0] + loose[1]) + loose[2] != loose[0] + (loose[1] + loose[2])).any()
