"""The pinhole camera by hand."""

import numpy as np
import pytest

from metrics.geometry import back_project, image_plane, pixel_pitch


def test_two_by_two_image_at_ninety_degrees():
    # The image plane spans -1 to 1 both ways; pixel centres lie at -0.5 and 0.5.
    points = back_project(np.array([[2.0, 4.0], [6.0, np.nan]]), 90.0)
    assert points[0, 0] == pytest.approx([-1.0, 1.0, -2.0])
    assert points[0, 1] == pytest.approx([2.0, 2.0, -4.0])
    assert points[1, 0] == pytest.approx([-3.0, -3.0, -6.0])
    assert np.isnan(points[1, 1]).all()


def test_infinite_depth_is_no_point_even_on_the_axis():
    assert np.isnan(back_project(np.full((3, 3), np.inf), 20.0)).all()


def test_the_vertical_field_of_view_rules_and_pixels_are_square():
    x, y = image_plane(4, 8, 60.0)
    pitch = 2.0 * np.tan(np.pi / 6.0) / 4.0
    assert pixel_pitch(4, 60.0) == pytest.approx(pitch)
    assert np.diff(x) == pytest.approx(pitch)
    assert np.diff(y) == pytest.approx(-pitch)
    assert x.sum() == pytest.approx(0.0)
    assert y.sum() == pytest.approx(0.0)


def test_batches_are_images_each(room_depth):
    depths = np.stack([room_depth(seed, 16) for seed in (1, 2)])
    assert np.array_equal(back_project(depths, 20.0)[1], back_project(depths[1], 20.0))


def test_a_room_back_projects_on_to_its_walls(room_depth):
    # Two neighbours on one wall and the camera span a plane that holds the points between.
    points = back_project(room_depth(1, 32), 20.0)
    corner = points[:4, :4].reshape(-1, 3)
    assert np.linalg.svd(corner - corner.mean(axis=0), compute_uv=False)[-1] < 1e-12


@pytest.mark.parametrize("fov", [0.0, -1.0, 180.0, np.nan])
def test_impossible_fields_of_view_are_refused(fov):
    with pytest.raises(ValueError, match="fov_y_degrees"):
        back_project(np.ones((2, 2)), fov)


def test_depth_needs_rows_and_columns():
    with pytest.raises(ValueError, match="shape"):
        back_project(np.ones(3), 20.0)
