"""Scores of panoramas: of distances along rays, and of points in all directions."""

import numpy as np
import pytest

from metrics.scoring.images.panoramas import baselines_of, score_panorama
from metrics.submissions.problems import PredictionError
from metrics.submissions.reader import PredictedView
from metrics.submissions.truths import TrueView
from scenegen.camera import Lens, back_project

LENS = Lens(180.0, projection="equirectangular")
DEPTH = np.random.default_rng(0).uniform(1, 4, (8, 16))
DEPTH[2, 3] = np.nan
POINTS = back_project(DEPTH, LENS)
TRUTH = TrueView(
    DEPTH, np.nan_to_num(-POINTS / DEPTH[..., None]), np.where(np.isnan(DEPTH), -1, 1), LENS,
    np.eye(4),
)  # fmt: skip


def predicted(kind, values, alignment="none", normal=None):
    return PredictedView(kind, alignment, values, normal)


def test_distances_and_points_are_scored():
    for factor, alignment, expected in ((1.0, "none", 0), (1.25, "none", 0.25), (3.0, "scale", 0)):
        for kind, values in (("depth", DEPTH), ("points", POINTS)):
            scores = score_panorama(predicted(kind, factor * values, alignment), TRUTH)
            found = [scores[name] for name in ("abs_rel", "points_rel")]
            assert found == pytest.approx([expected, expected], abs=1e-9)
            assert "chamfer" not in scores
    assert scores["ray_error_degrees"] == pytest.approx(0, abs=1e-5)


def test_points_of_a_plane_are_off_the_rays():
    ahead = np.abs(POINTS) * (1, 1, -1)
    scores = score_panorama(predicted("points", ahead), TRUTH)
    assert scores["abs_rel"] == pytest.approx(0, abs=1e-9)
    assert scores["ray_error_degrees"] > 30


def test_normals_are_those_of_the_camera_frame():
    turned = TRUTH.normal * (1, 1, -1)
    scores = score_panorama(predicted("depth", DEPTH, normal=turned), TRUTH)
    assert scores["normal_mean_degrees"] > 30
    same = score_panorama(predicted("depth", DEPTH, normal=TRUTH.normal), TRUTH)
    assert same["normal_mean_degrees"] == pytest.approx(0, abs=1e-5)


def test_broken_values_are_refused_or_worst():
    broken = predicted("depth", np.where(DEPTH > 3, np.inf, DEPTH))
    with pytest.raises(PredictionError):
        score_panorama(broken, TRUTH)
    assert score_panorama(broken, TRUTH, True)["delta_1"] == 0


def test_a_constant_is_the_baseline():
    true = DEPTH[np.isfinite(DEPTH)]
    expected = np.mean(np.abs(true.mean() - true) / true)
    assert baselines_of(TRUTH)["flat_abs_rel"] == pytest.approx(expected)
