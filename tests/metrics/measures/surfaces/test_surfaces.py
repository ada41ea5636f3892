"""Normals from depth on known surfaces, their angles, and distances of point clouds."""

import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.distance import cdist
from scipy.spatial.transform import Rotation

from metrics.measures.surfaces.chamfer_hausdorff import nearest_distances, point_scores
from metrics.measures.surfaces.normals import angular_errors_degrees, normals_from_depth
from scenegen.camera import back_project, pixel_directions

FOV = 20.0


def plane_depth(normal, distance, shape=(24, 32), fov=FOV):
    """Planar depth of the plane normal . point = -distance."""
    return -distance / (pixel_directions(*shape, fov) @ np.asarray(normal))


@pytest.mark.parametrize("degrees", [0.0, 1e-9, 1e-5, 10.0, 90.0, 179.999999, 180.0])
def test_a_tilt_scores_its_angle(degrees):
    rng = np.random.default_rng(0)
    true = rng.standard_normal((50, 3))
    axis = np.cross(true, rng.standard_normal((50, 3)))
    axis *= np.radians(degrees) / np.linalg.norm(axis, axis=1, keepdims=True)
    tilted = Rotation.from_rotvec(axis).apply(true)
    angles = angular_errors_degrees(tilted, true)
    assert angles == pytest.approx(np.full(50, degrees), rel=1e-6, abs=5e-14)


@given(st.integers(0, 2**32 - 1))
def test_angles_ignore_length_order_and_rotation(seed):
    rng = np.random.default_rng(seed)
    a, b = rng.standard_normal((2, 4, 5, 3))
    turn = Rotation.random(rng=rng).as_matrix()
    angles = angular_errors_degrees(a, b)
    assert angular_errors_degrees(b * 1e-200, a * 1e90) == pytest.approx(angles, abs=1e-10)
    assert angular_errors_degrees(a @ turn, b @ turn) == pytest.approx(angles, abs=1e-10)
    assert angular_errors_degrees(-a, b) == pytest.approx(180.0 - angles, abs=1e-10)
    assert angular_errors_degrees(a, a) == pytest.approx(np.zeros(20), abs=1e-13)


def test_only_pixels_with_a_finite_true_direction_are_scored():
    good = np.ones((3, 3))
    true = np.array([[1.0, 1.0, np.nan], [0.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    assert len(angular_errors_degrees(good, true)) == 1


@given(st.floats(0.0, 70.0), st.floats(0.0, 360.0), st.floats(0.1, 100.0))
def test_a_plane_has_its_normal_everywhere(tilt, turn, distance):
    normal = Rotation.from_euler("xz", [tilt, turn], degrees=True).apply([0.0, 0.0, 1.0])
    normals, on_surface = normals_from_depth(plane_depth(normal, distance), FOV)
    # Beyond the threshold of grazing at the image's edge the second rule takes over.
    angles = angular_errors_degrees(normals, np.broadcast_to(normal, normals.shape))
    assert angles.max() < 1e-8
    assert on_surface.all() or tilt > 60.0


def test_a_step_in_depth_leaves_both_sides_flat():
    depth = np.full((10, 10), 2.0)
    depth[:, 5:] = 3.0
    normals, on_surface = normals_from_depth(depth, FOV)
    assert on_surface.all()
    assert normals == pytest.approx(np.broadcast_to([0.0, 0.0, 1.0], normals.shape))


def test_every_pixel_of_the_mask_has_a_normal():
    lone = np.zeros((5, 5), dtype=bool)
    lone[2, 2] = True
    line = np.zeros((5, 5), dtype=bool)
    line[2] = True
    for mask in (lone, line):
        normals, on_surface = normals_from_depth(np.full((5, 5), 2.0), 90.0, mask)
        assert not on_surface.any()
        assert (normals[~mask] == 0.0).all()
        towards = -back_project(np.ones((5, 5)), 90.0)[mask]
        assert angular_errors_degrees(normals[mask], towards) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("value", [0.0, -2.0, 1e-300, 1e100])
def test_odd_depth_has_normals_too(value):
    depth = np.full((4, 4), 2.0)
    depth[1:3, 1:3] = value
    for odd in (depth, np.full((4, 4), value), value * np.random.default_rng(0).random((4, 4))):
        normals, _ = normals_from_depth(odd, FOV)
        assert np.linalg.norm(normals, axis=-1) == pytest.approx(np.ones((4, 4)))


def test_equal_eigenvalues_leave_no_empty_normal():
    # Noise as thick as it is wide: some patches have no least axis, all must have a normal.
    rng = np.random.default_rng(0)
    for _ in range(20):
        normals, _ = normals_from_depth(rng.uniform(0.1, 3.0, (16, 16)), FOV)
        assert np.linalg.norm(normals, axis=-1) == pytest.approx(np.ones((16, 16)))


def test_by_hand():
    # Predicted points at 0 and 3 on a line, true points at 1 and 10.
    line = np.array([[1.0, 0.0, 0.0]])
    nearest = nearest_distances(np.array([[0.0], [3.0]]) * line, np.array([[1.0], [10.0]]) * line)
    assert nearest.forward.tolist() == [1.0, 2.0]
    assert nearest.reverse.tolist() == [1.0, 7.0]
    assert point_scores(nearest, [1.5, 2.5]) == {
        "accuracy_distance": 1.5,
        "completeness_distance": 4.0,
        "chamfer": 5.5,
        "chamfer_squared": 27.5,
        "hausdorff": 7.0,
        "hausdorff_forward": 2.0,
        "hausdorff_reverse": 7.0,
        "hausdorff_95": pytest.approx(6.7),
        "f_score_1.5": 0.5,
        "f_score_2.5": pytest.approx(2 * 1.0 * 0.5 / 1.5),
    }


@pytest.mark.parametrize("backend", ["auto", "scipy"])
def test_degenerate_clouds(backend):
    same = np.ones((500, 3))
    line = np.linspace(0, 1, 500)[:, None] * [1.0, 0.0, 0.0]
    large = np.array([[1e99, 0.0, 0.0], [0.0, 0.0, 0.0]])
    for a, b in ((same, same[:1]), (line, same), (large, same[:2]), (line, line + 1e-300)):
        found = nearest_distances(a, b, backend)
        for one_way, matrix in ((found.forward, cdist(a, b)), (found.reverse, cdist(b, a))):
            assert one_way == pytest.approx(matrix.min(axis=1), rel=1e-12)


def test_without_pykdtree_scipy_takes_over(monkeypatch):
    a, b = np.random.default_rng(3).standard_normal((2, 40, 3))
    expected = nearest_distances(a, b)
    monkeypatch.setitem(sys.modules, "pykdtree.kdtree", None)
    assert nearest_distances(a, b).forward == pytest.approx(expected.forward, rel=1e-12)
    with pytest.raises(ImportError):
        nearest_distances(a, b, "pykdtree")


def test_rooms_face_the_viewer_and_edges_do_not_smear(room_depth):
    depth = room_depth(1, 64)
    normals, on_surface = normals_from_depth(depth, FOV)
    assert ((normals * back_project(depth, FOV)).sum(axis=-1) < 0.0).all()
    assert np.linalg.norm(normals, axis=-1) == pytest.approx(np.ones(depth.shape))
    assert on_surface.mean() > 0.99
