"""The shading equation against numbers worked out by hand, and its symmetries."""

import numpy as np
import pytest

from scenegen.rendering.shading import shade

ORIGIN = np.zeros((1, 3))
UP = np.array([[0.0, 1.0, 0.0]])
WHITE = np.ones(3)
DARK = np.zeros(3)
K = np.array([0.5, 0.25])


def test_light_overhead():
    """At distance 2: k_l d + k_q d^2 = 0.5 * 2 + 0.25 * 4 = 2, cosine 1."""
    light, color = np.array([[0.0, 2.0, 0.0]]), np.array([[4.0, 2.0, 1.0]])
    result = shade(ORIGIN, UP, np.array([1.0, 0.5, 1.0]), light, color, np.full(3, 0.1), K)
    np.testing.assert_allclose(result, [[2.1, 0.5 * 1.1, 0.6]])


def test_cosine_and_distance_of_a_slanted_light():
    """A 3-4-5 triangle: d = 5, cosine 4/5, k_l d + k_q d^2 = 2.5 + 6.25 = 8.75."""
    light = np.array([[3.0, 4.0, 0.0]])
    result = shade(ORIGIN, UP, WHITE, light, np.array([[8.75, 0.0, 0.0]]), DARK, K)
    np.testing.assert_allclose(result, [[0.8, 0.0, 0.0]])


@pytest.mark.parametrize("light", [[0.0, -1.0, 0.0], [1.0, -1e-3, 0.0], [1.0, 0.0, 0.0]])
@pytest.mark.parametrize("normal", [UP, 0 * UP], ids=["up", "zero"])
def test_light_from_behind_takes_nothing_away(normal, light):
    result = shade(ORIGIN, normal, WHITE, np.array([light]), np.ones((1, 3)), np.full(3, 0.1), K)
    np.testing.assert_allclose(result, 0.1)
