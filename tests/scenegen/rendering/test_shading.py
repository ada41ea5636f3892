"""The shading equation against numbers worked out by hand, with and without Phong's lobe."""

import numpy as np
import pytest

from scenegen.rendering.shading import shade

ORIGIN = np.zeros((1, 3))
UP = np.array([[0.0, 1.0, 0.0]])
DARK, WHITE = np.zeros(3), np.ones(3)
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


def shine(light, viewpoint, shininess, normal=UP):
    """Return the radiance of a black surface at the origin with k_s = 1 and light colour 1."""
    lights, black = np.array([light], float), np.zeros(3)
    one = shade(ORIGIN, normal, black, lights, np.ones((1, 3)), DARK, K, 1.0, shininess,
                np.array(viewpoint, float))  # fmt: skip
    assert (one == one[0, 0]).all()
    return float(one[0, 0])


def test_a_mirror_by_hand():
    """3-4-5 triangles on both sides: d = 5, cosine 4/5, k_l d + k_q d^2 = 8.75, lobe 1."""
    light, color = np.array([[3.0, 4.0, 0.0]]), np.array([[8.75, 17.5, 0.0]])
    for shininess in (1.0, 30.0):
        found = shade(ORIGIN, UP, np.array([0.5, 0.25, 1.0]), light, color, np.full(3, 0.1), K,
                      0.3, shininess, np.array([-6.0, 8.0, 0.0]))  # fmt: skip
        np.testing.assert_allclose(found, [[0.45 + 0.3, 0.025 + 0.4 + 0.6, 0.1]])


@pytest.mark.parametrize("degrees", [0.0, 10.0, 30.0, 45.0])
def test_beside_the_mirror_it_falls_with_a_power_of_the_cosine(degrees):
    """Seen from above, a light at distance 2 (k_l d + k_q d^2 = 2)."""
    angle = np.radians(degrees)
    light = 2 * np.array([np.sin(angle), np.cos(angle), 0.0])
    for shininess in (1.0, 7.5, 200.0):
        expected = np.cos(angle) ** shininess / 2
        assert shine(light, (0, 9, 0), shininess) == pytest.approx(expected, rel=1e-12)


def test_a_light_below_the_surface_has_no_highlight_though_the_lobe_reaches_it():
    viewpoint = (-10.0, 0.5, 0.0)  # the mirrored ray all but grazes
    assert shine((10.0, 0.1, 0.0), viewpoint, 5.0) > 0
    assert shine((10.0, -0.1, 0.0), viewpoint, 5.0) == 0
    assert shine((10.0, 0.0, 0.0), viewpoint, 5.0) == 0
    assert shine((-10.0, 0.1, 0.0), viewpoint, 5.0) == 0, "nor one behind the mirrored ray"
