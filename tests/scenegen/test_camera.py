"""Frames, pixel conventions and back-projection, against their definitions."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from scenegen.camera import Camera, back_project, intrinsics, pixel_directions, pixels_of
from scenegen.common.errors import SpecError

COORDINATE = st.floats(-9.0, 9.0)
POINT = st.tuples(COORDINATE, COORDINATE, COORDINATE)
FOV = st.floats(5.0, 120.0)
SIDE = st.integers(1, 40)


def a_camera(position: tuple[float, float, float], target: tuple[float, float, float]) -> Camera:
    level = math.hypot(position[0] - target[0], position[2] - target[2])
    assume(level > 1e-3)
    return Camera(position, target, 30.0)


@settings(deadline=None)
@given(position=POINT, target=POINT)
def test_world_from_camera_is_rigid_and_looks_at_its_target(
    position: tuple[float, float, float], target: tuple[float, float, float]
) -> None:
    matrix = a_camera(position, target).world_from_camera
    rotation = matrix[:3, :3]
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(rotation) == pytest.approx(1.0, abs=1e-12)
    np.testing.assert_array_equal(matrix[3], [0, 0, 0, 1])
    np.testing.assert_array_equal(matrix[:3, 3], position)
    distance = math.dist(position, target)
    np.testing.assert_allclose(matrix @ [0, 0, -distance, 1], [*target, 1], atol=1e-11)
    assert rotation[1, 0] == 0.0, "x axis is level: no roll"
    assert rotation[1, 1] > 0.0, "y axis is up"


@pytest.mark.parametrize("height", [2.0, -2.0])
def test_looking_straight_up_or_down_is_refused(height: float) -> None:
    with pytest.raises(SpecError, match="along y"):
        _ = Camera((0.3, height, 0.3), (0.3, 0.3, 0.3), 30.0).world_from_camera


def test_looking_nearly_straight_down_is_rigid() -> None:
    rotation = Camera((0.3, 2.0, 0.3 + 1e-5), (0.3,) * 3, 30.0).world_from_camera[:3, :3]
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(rotation[:, 0], [1, 0, 0], atol=1e-12)


def test_pixel_directions_by_hand() -> None:
    """90 degrees over 2 rows: the image plane at depth 1 spans -1 .. 1, a pixel's side is 1."""
    directions = pixel_directions(2, 4, 90.0)
    assert directions.shape == (2, 4, 3)
    np.testing.assert_allclose(directions[0, :, 0], [-1.5, -0.5, 0.5, 1.5])
    np.testing.assert_allclose(directions[:, 0, 1], [0.5, -0.5])
    assert (directions[..., 2] == -1.0).all()
    assert (directions[0, :, 1] == directions[0, 0, 1]).all()
    assert (directions[:, 0, 0] == directions[0, 0, 0]).all()


@settings(deadline=None)
@given(height=SIDE, width=SIDE, fov=FOV)
def test_outer_pixels_lie_half_a_pixel_inside_the_field_of_view(
    height: int, width: int, fov: float
) -> None:
    directions = pixel_directions(height, width, fov)
    half = math.tan(math.radians(fov) / 2)
    pixel = 2 * half / height
    assert directions[0, 0, 1] + pixel / 2 == pytest.approx(half, rel=1e-9)
    assert directions[-1, 0, 1] - pixel / 2 == pytest.approx(-half, rel=1e-9)
    assert directions[0, -1, 0] + pixel / 2 == pytest.approx(half * width / height, rel=1e-9)
    assert directions[0, 0, 0] == pytest.approx(-directions[0, -1, 0], abs=1e-12)


@settings(deadline=None)
@given(
    height=SIDE,
    width=SIDE,
    fov=FOV,
    seed=st.integers(0, 99),
    centers=st.sampled_from([("half", 0.5), ("integer", 0.0)]),
)
def test_projection_takes_back_projected_points_to_their_pixels(
    height: int, width: int, fov: float, seed: int, centers: tuple[str, float]
) -> None:
    """Projection is written out here: y down and z forward, first centre at 0.5 or at 0."""
    name, first = centers
    depth = np.random.default_rng(seed).uniform(0.1, 5.0, (height, width))
    points = back_project(depth, fov)
    np.testing.assert_array_equal(points[..., 2], -depth)
    seen = points * (1, -1, -1) @ intrinsics(height, width, fov, pixel_centers=name).T
    columns, rows = seen[..., 0] / seen[..., 2], seen[..., 1] / seen[..., 2]
    np.testing.assert_allclose(columns, np.tile(np.arange(width) + first, (height, 1)), atol=1e-9)
    expected_rows = np.tile(np.arange(height)[:, None] + first, (1, width))
    np.testing.assert_allclose(rows, expected_rows, atol=1e-9)


def test_back_projection_keeps_misses_as_nan() -> None:
    points = back_project(np.array([[1.0, np.nan]], np.float32), 40.0)
    assert np.isfinite(points[0, 0]).all()
    assert np.isnan(points[0, 1]).all()


@settings(deadline=None)
@given(height=SIDE, width=SIDE, fov=FOV)
def test_every_image_has_the_diagonal_of_a_square_one(height: int, width: int, fov: float) -> None:
    diagonal = math.tan(math.radians(fov) / 2) * math.sqrt(2)
    half = diagonal / math.hypot(1, width / height)
    fov_y = Camera.fov_y_from_square(fov, height, width)
    # Fields of view have 9 decimals.
    assert fov_y == pytest.approx(math.degrees(2 * math.atan(half)), rel=0, abs=6e-10)


@given(height=SIDE, width=SIDE, fov=FOV)
def test_pixels_of_points_are_those_that_show_them(height: int, width: int, fov: float) -> None:
    points = back_project(np.full((height, width), 2.0), fov).reshape(-1, 3)
    row, column, inside = pixels_of(points, (height, width), fov)
    np.testing.assert_array_equal(row * width + column, np.arange(height * width))
    assert inside.all()
    for others in (-points, points + np.array([1000, 0, 0])):
        assert not np.any(pixels_of(others, (height, width), fov))
