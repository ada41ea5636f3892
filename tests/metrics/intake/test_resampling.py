"""Predictions of another size: exact on planes, and nothing between the sides of an edge."""

import numpy as np
import pytest

from metrics.intake.resampling import filled, nearest, resampled
from scenegen.camera import pixel_directions

FOV = 50.0


def plane(height, width):
    """Planar depth (h, w) of a slanted plane: n.p = -1 with p = depth * ray."""
    rays = pixel_directions(height, width, FOV)
    return -1.0 / (rays @ np.array([0.2, -0.3, 0.5]))


def of_kind(kind, height, width):
    depth = plane(height, width)
    rays = pixel_directions(height, width, FOV)
    return {"depth": depth, "disparity": 3.0 / depth + 1.0, "points": rays * depth[..., None]}[kind]


@pytest.mark.parametrize("kind", ["depth", "disparity", "points"])
@pytest.mark.parametrize("size", [(96, 128), (60, 80), (300, 400)])
def test_a_plane_is_exact(kind, size):
    """But for a border that a coarser image does not reach."""
    inside = np.s_[2:-2, 2:-2]
    got = resampled(kind, of_kind(kind, *size), 72, 96)
    assert np.allclose(got[inside], of_kind(kind, 72, 96)[inside], rtol=0, atol=1e-9)


@pytest.mark.parametrize("kind", ["depth", "disparity"])
def test_no_value_lies_between_the_sides_of_an_edge(kind):
    step = np.where(np.arange(40) < 17, 1.0, 2.0) * np.ones((30, 1))
    for size in ((64, 64), (11, 13)):
        assert set(np.unique(resampled(kind, step, *size).round(12))) == {1.0, 2.0}


def test_the_same_size_is_the_same_array():
    values = np.random.default_rng(0).random((5, 7))
    assert resampled("depth", values, 5, 7) is values


def test_pixels_without_a_value_spread_to_no_other():
    values = np.full((20, 20), 2.0)
    values[4:9, 4:9] = np.nan
    got = resampled("depth", values, 40, 40)
    assert np.array_equal(np.isnan(got), np.kron(np.isnan(values), np.ones((2, 2), bool)))
    assert np.array_equal(got, nearest(values, 40, 40), equal_nan=True)


def test_depth_that_is_shifted_behind_the_camera_stays_finite():
    values = np.linspace(-1.0, 1.0, 64).reshape(8, 8)
    assert np.isfinite(resampled("depth", values, 13, 11)).all()


def test_filled_from_the_nearest():
    values = np.array([[1.0, np.nan, np.nan, np.nan, 2.0]])
    assert filled(values, np.isfinite(values)).tolist() == [[1.0, 1.0, 1.0, 2.0, 2.0]] or (
        filled(values, np.isfinite(values)).tolist() == [[1.0, 1.0, 2.0, 2.0, 2.0]]
    )
