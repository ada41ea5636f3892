"""Places and poses: true must be a proof, and every draw uniform where it says so."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chisquare, kstest

from scenegen.camera import Camera
from scenegen.common.random.seeding import Purpose, item_numbers
from scenegen.common.rotations import rotation_matrix
from scenegen.description.names import SHAPE_NAMES
from scenegen.objects.basic_shapes import unit_shape
from scenegen.objects.coarse_hulls import POINT_STEP, rounded
from scenegen.sampling.bodies import Bodies
from scenegen.sampling.placement import (
    CANDIDATES,
    GAP,
    SEPARATORS,
    Frustums,
    are_apart,
    border_normals,
    find_places,
)
from scenegen.sampling.poses import random_rotations

CAMERA = Camera((1.2, 1.1, 1.3), (0.3, 0.3, 0.3), 30.0)


def supports(name, rotation, scale):
    """Along SEPARATORS, (1, 80)."""
    bodies = Bodies([unit_shape(name)])
    return scale * bodies.reach(np.zeros(1, int), rotation[None], SEPARATORS, coarse=True)


def numbers(count, each, seed=0):
    return item_numbers(seed, np.arange(count), Purpose.POSES, count=each)


def frustums(cameras, height=9, width=9):
    poses = np.array([camera.world_from_camera for camera in cameras]).reshape(1, -1, 4, 4)
    fov = cameras[0].fov_y_degrees if cameras else 30.0
    turns = poses[..., :3, :3].swapaxes(-1, -2)
    normals = np.tile(border_normals(fov, height, width), (len(poses), 1, 1))
    return Frustums(poses[..., :3, 3], turns, normals)


def places_of_boxes(count, scale, cameras, placed, seed=0):
    """Look for places of upright boxes, with their centres in the image."""
    reach = np.repeat(supports("box", np.eye(3), scale), count, axis=0)
    border = np.zeros((count, len(cameras), 4))
    others = np.array(placed).reshape(1, -1, len(SEPARATORS))
    draws = numbers(count, 2 * CANDIDATES, seed).reshape(count, CANDIDATES, 2)
    rows = np.zeros(count, int)
    down = np.full(count, scale / 3**0.5)
    return find_places(rows, reach, down, border, frustums(cameras), others, draws)


@pytest.mark.parametrize("half", [(0.6, 0.1, 0.1), (0.1, 0.1, 0.6), (0.45, 0.1, 0.45)])
def test_a_body_longer_than_the_room_has_no_place(half):
    """Along either wall: boxes with these half sides."""
    reach = (abs(SEPARATORS) @ np.array(half))[None]
    draws = numbers(1, 2 * CANDIDATES).reshape(1, CANDIDATES, 2)
    nothing = np.zeros((1, 0, 4)), frustums([]), np.zeros((1, 0, len(SEPARATORS)))
    free, _ = find_places(np.zeros(1, int), reach, np.full(1, 0.1), *nothing, draws)
    assert free.item() == (max(half) < 0.5)


def test_separators_are_unit_directions_all_around():
    np.testing.assert_allclose(np.linalg.norm(SEPARATORS, axis=1), 1.0, atol=1e-7)
    upright = SEPARATORS[abs(SEPARATORS[:, 1]) < 1e-12]
    azimuth = np.sort(np.degrees(np.arctan2(upright[:, 2], upright[:, 0])))
    np.testing.assert_allclose(np.diff(azimuth), 7.5, atol=1e-5)
    assert len(upright) == 48


def test_apart_is_a_proof_and_seldom_missed(gap_between, unit_corners):
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
            position = rounded(position, POINT_STEP)
            bodies.append((position, supports(name, rotation, scale)))
            corners.append(scale * unit_corners(name) @ rotation.T + position)
        (place, reach), (other, others) = bodies
        apart = bool(are_apart(place[None], reach, (other @ SEPARATORS.T + others)[:, None])[0])
        gap = gap_between(*corners)
        if apart:
            assert gap > 0.0, "said to be apart, but their hulls meet"
        missed += not apart and gap > 0.05
        said[apart] += 1
    assert min(said.values()) > 40, "both answers are tried"
    assert missed <= 15


def test_apart_keeps_the_gap():
    """Two upright unit cubes face to face along x."""
    cube = supports("box", np.eye(3), 3**0.5)
    for x, apart in ((2 + GAP - 1e-6, False), (2 + GAP + 1e-6, True), (-2 - GAP - 1e-6, True)):
        place = rounded(np.array([[x, 0, 0]]), POINT_STEP)
        assert are_apart(place, cube, cube[:, None]).tolist() == [apart]


def test_frustum_normals_hold_exactly_what_the_image_shows():
    height, width = 30, 50
    normals = border_normals(CAMERA.fov_y_degrees, height, width)
    half_y = math.tan(math.radians(CAMERA.fov_y_degrees) / 2)
    rng = np.random.default_rng(1)
    x, y = rng.uniform(-2, 2, (2, 500))
    seen = np.stack([x * half_y * width / height, y * half_y, -np.ones(500)], axis=1)
    points = (seen * rng.uniform(0.1, 3, (500, 1))) @ CAMERA.world_from_camera[:3, :3].T
    points += CAMERA.position
    view, none = frustums([CAMERA], height, width), np.zeros((1, 1, 4))
    inside = view.hold(np.zeros(1, int), points[None], none)[0]
    assert (inside == (np.maximum(abs(x), abs(y)) <= 1)).all()
    assert 50 < inside.sum() < 450
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-7)


def test_no_place_where_there_is_none():
    behind = Camera((0.5, 0.5, 5.0), (0.5, 0.5, 9.0), 20.0)
    filling = 0.5 * SEPARATORS.sum(axis=1) + supports("box", np.eye(3), 3**0.5 / 2)[0]
    for scale, cameras, placed, found in (
        (0.95, [], [], False),  # too wide
        (0.1, [behind], [], False),
        (0.1, [], [filling], False),
        (0.1, [], [], True),
    ):
        assert places_of_boxes(1, scale, cameras, placed)[0].tolist() == [found]


def test_places_are_uniform_over_the_floor():
    """Over 100 seeds the 200 p-values are uniform themselves: the least is 0.0025."""
    side = 0.1 / 3**0.5
    found, places = places_of_boxes(2000, 0.1, [], [])
    assert found.all()
    np.testing.assert_allclose(places[:, 1], side, atol=1e-7)
    for axis in (0, 2):
        assert kstest(places[:, axis], "uniform", (side, 1 - 2 * side)).pvalue > 0.01
    assert abs(np.corrcoef(places[:, 0], places[:, 2])[0, 1]) < 0.06


def test_the_first_free_candidate_is_taken():
    """Its other side of the room being full, a box stands where the first draw in the free one."""
    full = SEPARATORS @ [0.25, 0.1, 0.5] + supports("box", np.eye(3), 0.5)[0]
    found, places = places_of_boxes(200, 0.1, [], [full], seed=2)
    draws = numbers(200, 2 * CANDIDATES, 2).reshape(200, CANDIDATES, 2)
    side, wall = 0.1 / 3**0.5, 0.25 + 0.5 / 3**0.5
    x = side + (1 - 2 * side) * draws[..., 0]
    z = side + (1 - 2 * side) * draws[..., 1]
    free = (x - side > wall + GAP) | (abs(z - 0.5) > side + 0.5 / 3**0.5 + GAP)
    assert found.all()
    np.testing.assert_allclose(places[:, 0], x[np.arange(200), free.argmax(axis=1)], atol=1e-6)
    assert 20 < (free.argmax(axis=1) > 0).sum() < 180


@pytest.mark.parametrize("name", SHAPE_NAMES)
def test_resting_puts_a_resting_side_down(name, unit_corners):
    shape = unit_shape(name)
    turns = random_rotations(Bodies([shape]), np.zeros(20, int), "resting", numbers(20, 4))
    for w, x, y, z in turns.tolist():
        turn = Rotation.from_quat((x, y, z, w)).as_matrix()
        assert math.hypot(w, x, y, z) == pytest.approx(1.0, abs=1e-12)
        if len(shape.resting_directions):
            sides = shape.resting_directions @ turn.T
            assert sides[:, 1].min() == pytest.approx(-1.0, abs=1e-8)
        height = unit_corners(name) @ turn[1]
        lowest = np.count_nonzero(height < height.min() + 1e-6)
        assert lowest >= (1 if name == "sphere" else 2 if name == "capsule" else 3)


def test_resting_sides_come_up_as_often_as_they_are_met_and_turned_evenly():
    """A dropped cube: each of its faces a sixth of the time, and any heading."""
    box, none = unit_shape("box"), np.zeros(3000, int)
    turns = rotation_matrix(random_rotations(Bodies([box]), none, "resting", numbers(3000, 4)).T)
    down = -turns[:, 1]
    counts = [np.count_nonzero(down @ side > 0.999) for side in box.resting_directions]
    assert sum(counts) == 3000
    assert chisquare(counts).pvalue > 0.01
    level = np.cross(np.broadcast_to([0.0, 1.0, 0.0], down.shape), turns[:, :, 0])
    lying = turns[np.linalg.norm(level, axis=1) > 0.5][:, :, 0]
    heading = np.arctan2(lying[:, 2], lying[:, 0])
    assert kstest(heading, "uniform", (-np.pi, 2 * np.pi)).pvalue > 0.01


def test_any_pose_is_uniform_over_all_rotations():
    """Then the angle has density (1 - cos a) / pi, and the axis and all images are uniform."""
    box, none = unit_shape("box"), np.zeros(4000, int)
    wxyz = random_rotations(Bodies([box]), none, "any", numbers(4000, 4))
    turns = Rotation.from_quat(wxyz[:, [1, 2, 3, 0]])
    assert kstest(turns.magnitude(), lambda a: (a - np.sin(a)) / np.pi).pvalue > 0.01
    for column in turns.as_matrix().reshape(-1, 9).T:
        assert kstest(column, "uniform", (-1, 2)).pvalue > 0.003
    np.testing.assert_allclose(np.linalg.norm(wxyz, axis=1), 1.0, atol=1e-12)
