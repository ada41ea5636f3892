"""Places and poses: true must be a proof, and every draw uniform where it says so."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from scipy.stats import chisquare, kstest

from scenegen.camera import Camera
from scenegen.common.rotations import rotation_matrix
from scenegen.description.scenes import SHAPE_NAMES
from scenegen.objects.basic_shapes import unit_shape
from scenegen.sampling.placement import (
    GAP,
    SEPARATORS,
    Body,
    are_apart,
    find_place,
    frustum_normals,
)
from scenegen.sampling.poses import random_rotation

Array = NDArray[Any]
CAMERA = Camera((1.2, 1.1, 1.3), (0.3, 0.3, 0.3), 30.0)


def body(name: str, rotation: Array, scale: float, position: Array) -> Body:
    shape = unit_shape(name)
    along = [scale * shape.support(sign * SEPARATORS @ rotation) for sign in (1, -1)]
    return Body(position, np.stack(along))


def test_separators_are_unit_directions_all_around() -> None:
    np.testing.assert_allclose(np.linalg.norm(SEPARATORS, axis=1), 1.0, atol=1e-12)
    upright = SEPARATORS[abs(SEPARATORS[:, 1]) < 1e-12]
    azimuth = np.sort(np.degrees(np.arctan2(upright[:, 2], upright[:, 0])))
    np.testing.assert_allclose(np.diff(azimuth), 7.5, atol=1e-9)
    assert len(upright) == 48


def test_apart_is_a_proof_and_seldom_missed(
    gap_between: Callable[[Array, Array], float], unit_corners: Callable[[str], Array]
) -> None:
    """Random pairs about to touch. The proof: a linear program over all the corners."""
    rng = np.random.default_rng(5)
    names = ("box", "cone", "tetrahedron", "teapot", "cylinder", "pyramid")
    said = {True: 0, False: 0}
    missed = 0
    for _ in range(150):
        bodies, corners = [], []
        for distance in (0.0, rng.uniform(0.5, 2.5)):
            name, scale = rng.choice(names), rng.uniform(0.5, 1.0)
            rotation = Rotation.random(rng=rng).as_matrix()
            position = Rotation.random(rng=rng).apply([distance, 0, 0]) * (1, 0.2, 1)
            bodies.append(body(name, rotation, scale, position))
            corners.append(scale * unit_corners(name) @ rotation.T + position)
        first, other = bodies
        apart = bool(are_apart(first.position[None], first.support, other)[0])
        gap = gap_between(*corners)
        if apart:
            assert gap > 0.0, "said to be apart, but their hulls meet"
        missed += not apart and gap > 0.05
        said[apart] += 1
    assert min(said.values()) > 40, "both answers are tried"
    assert missed <= 15


def test_apart_keeps_the_gap() -> None:
    """Two upright unit cubes face to face along x."""
    cube = body("box", np.eye(3), 3**0.5, np.zeros(3))
    places = np.array([[2 + GAP - 1e-6, 0, 0], [2 + GAP + 1e-6, 0, 0], [-2 - GAP - 1e-6, 0, 0]])
    assert are_apart(places, cube.support, cube).tolist() == [False, True, True]


def test_frustum_normals_hold_exactly_what_the_image_shows() -> None:
    height, width = 30, 50
    normals = frustum_normals(CAMERA, height, width)
    half_y = math.tan(math.radians(CAMERA.fov_y_degrees) / 2)
    rng = np.random.default_rng(1)
    x, y = rng.uniform(-2, 2, (2, 500))
    seen = np.stack([x * half_y * width / height, y * half_y, -np.ones(500)], axis=1)
    points = (seen * rng.uniform(0.1, 3, (500, 1))) @ CAMERA.world_from_camera[:3, :3].T
    inside = (points @ normals.T <= 0).all(axis=1)
    assert (inside == (np.maximum(abs(x), abs(y)) <= 1)).all()
    assert 50 < inside.sum() < 450
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-12)


def test_no_place_where_there_is_none() -> None:
    rng, upright = np.random.default_rng(0), np.eye(3)
    behind = (
        np.array([0.5, 0.5, 5.0]),
        frustum_normals(Camera((0.5, 0.5, 5.0), (0.5, 0.5, 9.0), 20.0), 9, 9),
    )
    assert find_place(unit_shape("box"), upright, 0.95, [], False, [], rng) is None, "too wide"
    assert find_place(unit_shape("box"), upright, 0.1, [behind], True, [], rng) is None
    filling = body("box", upright, 3**0.5 / 2, np.full(3, 0.5))
    assert find_place(unit_shape("box"), upright, 0.1, [], False, [filling], rng) is None
    assert find_place(unit_shape("box"), upright, 0.1, [], False, [], rng) is not None


def test_places_are_uniform_over_the_floor() -> None:
    rng, side = np.random.default_rng(3), 0.1 / 3**0.5
    some = [find_place(unit_shape("box"), np.eye(3), 0.1, [], False, [], rng) for _ in range(2000)]
    places = np.array([place.position for place in some if place is not None])
    assert len(places) == 2000
    np.testing.assert_allclose(places[:, 1], side)
    for axis in (0, 2):
        assert kstest(places[:, axis], "uniform", (side, 1 - 2 * side)).pvalue > 0.01
    assert abs(np.corrcoef(places[:, 0], places[:, 2])[0, 1]) < 0.06


@pytest.mark.parametrize("name", SHAPE_NAMES)
def test_resting_puts_a_resting_side_down(name: str, unit_corners: Callable[[str], Array]) -> None:
    rng, shape = np.random.default_rng(4), unit_shape(name)
    for _ in range(20):
        w, x, y, z = random_rotation(shape, "resting", rng)
        turn = Rotation.from_quat((x, y, z, w)).as_matrix()
        assert math.hypot(w, x, y, z) == pytest.approx(1.0, abs=1e-12)
        if len(shape.resting_directions):
            sides = shape.resting_directions @ turn.T
            assert sides[:, 1].min() == pytest.approx(-1.0, abs=1e-8)
        height = unit_corners(name) @ turn[1]
        lowest = np.count_nonzero(height < height.min() + 1e-6)
        assert lowest >= (1 if name == "sphere" else 2 if name == "capsule" else 3)


def test_resting_sides_come_up_as_often_as_they_are_met_and_turned_evenly() -> None:
    """A dropped cube: each of its faces a sixth of the time, and any heading."""
    rng, box = np.random.default_rng(8), unit_shape("box")
    turns = np.stack([rotation_matrix(random_rotation(box, "resting", rng)) for _ in range(3000)])
    down = -turns[:, 1]
    counts = [np.count_nonzero(down @ side > 0.999) for side in box.resting_directions]
    assert sum(counts) == 3000
    assert chisquare(counts).pvalue > 0.01
    level = np.cross(np.broadcast_to([0.0, 1.0, 0.0], down.shape), turns[:, :, 0])
    lying = turns[np.linalg.norm(level, axis=1) > 0.5][:, :, 0]
    heading = np.arctan2(lying[:, 2], lying[:, 0])
    assert kstest(heading, "uniform", (-np.pi, 2 * np.pi)).pvalue > 0.01


def test_any_pose_is_uniform_over_all_rotations() -> None:
    """Then the angle has density (1 - cos a) / pi, and the axis and all images are uniform."""
    rng, box = np.random.default_rng(7), unit_shape("box")
    wxyz = np.array([random_rotation(box, "any", rng) for _ in range(4000)])
    turns = Rotation.from_quat(wxyz[:, [1, 2, 3, 0]])
    assert kstest(turns.magnitude(), lambda a: (a - np.sin(a)) / np.pi).pvalue > 0.01
    for column in turns.as_matrix().reshape(-1, 9).T:
        assert kstest(column, "uniform", (-1, 2)).pvalue > 0.003
    np.testing.assert_allclose(np.linalg.norm(wxyz, axis=1), 1.0, atol=1e-12)
