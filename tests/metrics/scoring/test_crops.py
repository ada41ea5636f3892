"""Scores of rooms whose principal point is off-centre and whose pixels are wide."""

import numpy as np
import pytest

from metrics.in_memory import evaluate_room
from metrics.measures.surfaces.chamfer_hausdorff import nearest_distances
from metrics.measures.surfaces.image_search import nearest_distances_on_image
from scenegen import open_rooms
from scenegen.camera import back_project


@pytest.fixture(scope="module")
def room(make_rooms, tmp_path_factory):
    path = make_rooms(tmp_path_factory.mktemp("crops") / "x.h5", 1, height=40, width=48, seed=1,
                      principal_point=(0.65, 0.4), pixel_aspect=1.25)  # fmt: skip
    with open_rooms(path) as rooms:
        return rooms[0]


def test_the_truth_has_no_error(room):
    depth = np.nan_to_num(room.depth, nan=1.0)
    points = np.nan_to_num(room.points, nan=-1.0)
    for geometry, kind in ((depth, "depth"), (points, "points")):
        scores = evaluate_room(geometry, room, kind=kind, frame="opengl", alignment="none")
        names = ["abs_rel", "chamfer", "points_rel", "derived_normal_mean_degrees"]
        names += ["ray_error_degrees"] if kind == "points" else []
        assert [scores[name] for name in names] == pytest.approx([0] * len(names), abs=1e-4)
        assert scores["relief_iou"] == 1


def test_points_of_a_centred_camera_are_off_the_rays(room):
    points = np.nan_to_num(back_project(room.depth, room.fov_y_degrees), nan=-1.0)
    scores = evaluate_room(points, room, kind="points", frame="opengl", alignment="none")
    assert scores["ray_error_degrees"] > 3


def test_nearest_points_are_those_of_all_pairs(room):
    rng, mask = np.random.default_rng(0), room.object_id >= 0
    wrong = np.where(mask, room.depth * (1 + 0.05 * rng.normal(size=mask.shape)), np.nan)
    found = nearest_distances_on_image(wrong, room.depth, room.lens, mask)
    expected = nearest_distances(back_project(wrong, room.lens)[mask], room.points[mask])
    np.testing.assert_allclose(found.forward, expected.forward, rtol=1e-9)
    np.testing.assert_allclose(found.reverse, expected.reverse, rtol=1e-9)
