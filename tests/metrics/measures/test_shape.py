"""Shape inside objects, and surfaces behind: by hand, and what must win nothing."""

import numpy as np
import pytest

from metrics.measures.behind import behind_scores
from metrics.measures.shape import (
    flat_error,
    inside_objects,
    one_normal_degrees,
    shape_scores,
)
from scenegen.camera import back_project, pixel_directions

SIZE, FOV = 48, 40.0


def ball(centre, radius):
    """Planar depth of a ball before a wall at depth 4, and which pixels show it."""
    rays = pixel_directions(SIZE, SIZE, FOV)
    a, b = (rays**2).sum(axis=-1), rays @ np.asarray(centre)
    root = b**2 - a * (np.dot(centre, centre) - radius**2)
    hit = root > 0.0
    return np.where(hit, (b - np.sqrt(np.maximum(root, 0.0))) / a, 4.0), hit


TRUE, HIT = ball([0.1, 0.1, -2.5], 0.5)
IDS = np.where(HIT, 3, 0)
INSIDE = inside_objects(IDS)


def scores(depth):
    at = INSIDE > 0
    points, true = (back_project(d, FOV)[at] for d in (depth, TRUE))
    return shape_scores((TRUE - depth)[at][:, None], points, true, INSIDE[at])


def test_inside_is_the_mask_without_its_rim_of_objects_that_are_large_enough():
    by_hand = np.zeros_like(IDS)
    for i in range(1, SIZE - 1):
        for j in range(1, SIZE - 1):
            by_hand[i, j] = 3 * (IDS[i - 1 : i + 2, j - 1 : j + 2] == 3).all()
    assert np.array_equal(INSIDE, by_hand)


def test_place_and_distance_of_an_object_have_no_part():
    assert scores(TRUE)["shape_recall_0.02"] == 1.0
    moved = scores(TRUE + 0.7)
    assert moved["shape_error"] == pytest.approx(0.0, abs=1e-12)
    assert moved["shape_correlation"] > 0.99


@pytest.mark.parametrize("distance", [0.5, 2.0, 3.0])
def test_a_flat_cut_out_has_the_error_of_the_floor_and_no_correlation(distance):
    at = INSIDE > 0
    flat = scores(np.full_like(TRUE, distance))
    assert flat["shape_error"] == pytest.approx(flat_error(TRUE[at], INSIDE[at]))
    assert flat["shape_error"] == pytest.approx(np.abs(TRUE[at] - np.median(TRUE[at])).mean())
    assert flat["shape_correlation"] == pytest.approx(0.0, abs=1e-6)


def test_a_slanted_plane_and_noise_have_no_correlation():
    rays = pixel_directions(SIZE, SIZE, FOV)
    plane = 2.0 / (1.0 + 0.4 * rays[..., 0] - 0.3 * rays[..., 1])
    assert scores(plane)["shape_correlation"] == pytest.approx(0.0, abs=1e-6)
    noise = 2.0 + 1e-7 * np.random.default_rng(0).normal(size=TRUE.shape)
    assert abs(scores(noise)["shape_correlation"]) < 1e-3
    assert scores(5.0 - TRUE)["shape_correlation"] < -0.9  # hollow


def test_flat_truth_has_no_correlation_and_no_object_has_no_score():
    at = INSIDE > 0
    true = back_project(np.full_like(TRUE, 2.0), FOV)[at]
    none = np.zeros((len(true), 1))
    found = shape_scores(none, true, true, INSIDE[at])
    assert found["shape_error"] == 0.0
    assert np.isnan(found["shape_correlation"])
    assert np.isnan(list(shape_scores(none[:0], true[:0], true[:0], INSIDE[at][:0]).values())).all()
    assert np.isnan([flat_error(TRUE[:0], IDS[:0]), one_normal_degrees(true[:0], IDS[:0])]).all()


def test_scores_of_what_is_hidden():
    errors, nearest = np.linspace(0.0, 0.3, 16), np.repeat([0.01, 0.06], 8)
    assert behind_scores(errors, nearest) == {
        "behind_depth_error": pytest.approx(0.15),
        "behind_recall_0.05": 0.5,
    }
    assert np.isnan(list(behind_scores(errors[1:], nearest[1:]).values())).all()
