"""Light of closed rooms and its development, by hand."""

import numpy as np
import pytest

from scenegen.rendering.pictures.development import HIGHLIGHTS, KEY, SHADOWS, evened


def lanes(vectors):
    import mitsuba as mi

    return mi.Vector3f(*(mi.Float(x) for x in np.atleast_2d(vectors).T))


@pytest.mark.parametrize(("stops", "taken"), [(2.0, HIGHLIGHTS), (-2.0, SHADOWS)])
def test_of_an_even_picture_a_share_of_its_stops_from_the_middle_is_taken(stops, taken):
    grey = np.full((24, 24, 3), KEY * 2.0**stops)
    np.testing.assert_allclose(evened(grey), KEY * 2.0 ** (stops * (1.0 - taken)), rtol=1e-6)


@pytest.fixture
def lights(variant):
    """Return lights of a map, and of a lamp of two triangles, the larger nine times the other."""
    from scenegen.rendering.pictures.lights import lights_of
    from scenegen.rendering.pictures.sky import Outside

    radiance = np.random.default_rng(0).uniform(0.1, 1.0, (8, 16, 3)).astype(np.float32)
    outside = Outside(radiance, np.array([0.0, 1.0, 0.0]), np.zeros(3))
    small = np.array([[0.0, 3.0, 0.0], [1.0, 3.0, 0.0], [0.0, 3.0, 1.0]])
    corners = np.stack([3.0 * small - (0, 6, 0), small - (2, 0, 0)])
    return radiance, corners, lights_of(outside, (), corners, np.ones((2, 3)), 1.0)


def test_at_the_middle_of_a_pixel_of_the_map_is_its_radiance(lights):
    from scenegen.rendering.pictures.lights import outside_radiance
    from scenegen.rendering.pictures.sky import directions

    radiance, _, made = lights
    shown = np.asarray(outside_radiance(made, lanes(directions(8, 16).reshape(-1, 3)))).T
    np.testing.assert_allclose(shown, radiance.reshape(-1, 3), atol=1e-4)


def test_points_of_lamps_are_uniform_by_area(lights):
    """The mean of a triangle's points is that of its corners; density is by solid angle."""
    import mitsuba as mi

    from scenegen.rendering.pictures.lights import sample_light

    _, corners, made = lights
    rng = np.random.default_rng(1)
    which, x, y = rng.random((3, 200_000))
    d, distance, _, density = sample_light(
        made, mi.Point3f(0.0), mi.Float(which), mi.Point2f(mi.Float(x), mi.Float(y))
    )
    points = (np.asarray(d) * np.asarray(distance)).T
    own = points[:, 0] < -0.5  # of the smaller one
    assert own.mean() == pytest.approx(0.1, abs=0.01)
    for mask, triangle in ((~own, corners[0]), (own, corners[1])):
        np.testing.assert_allclose(points[mask].mean(axis=0), triangle.mean(axis=0), atol=0.02)
    # By area, density times cos / r^2 is 1 / (4.5 + 0.5).
    cosine = np.asarray(d)[1]
    np.testing.assert_allclose(
        np.asarray(density) * cosine / np.asarray(distance) ** 2, 0.2, rtol=0.02
    )


def test_maps_repeat_end_or_are_mirrored_beyond_their_edges(variant):
    import mitsuba as mi

    from scenegen.rendering.pictures.closed_rooms import _wrapped

    places = [-1.25, -0.25, 0.0, 0.25, 1.0, 1.25, 3.2]
    for wrap, expected in enumerate((
        [0.75, 0.75, 0.0, 0.25, 0.0, 0.25, 0.2],
        [0.0, 0.0, 0.0, 0.25, 1.0, 1.0, 1.0],
        [0.75, 0.25, 0.0, 0.25, 1.0, 0.75, 0.8],
    )):  # fmt: skip
        found = _wrapped(mi.Float(places), mi.Float(wrap))
        np.testing.assert_allclose(np.asarray(found), expected, atol=1e-6)
