"""Points drawn evenly by area."""

import numpy as np
import pytest

from metrics.measures.surfaces.whole import drawn_points, surface_scores


def test_points_are_drawn_evenly_by_area():
    """Of two triangles, of which one is three times as large."""
    corners = [[[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 0, 5], [3, 0, 5], [0, 1, 5]]]
    points = drawn_points(np.array(corners, float), 0, "truth").astype(float)
    large = points[:, 2] > 2
    assert large.mean() == pytest.approx(0.75, abs=0.03)
    for some, side in ((points[~large], 1.0), (points[large] / [3, 1, 5], 1.0)):
        assert some[:, :2].min() >= 0
        assert some[:, :2].sum(axis=1).max() <= side + 1e-6
        np.testing.assert_allclose(some[:, :2].mean(axis=0), 1 / 3, atol=0.03)
        np.testing.assert_allclose(some[:, :2].var(axis=0), 1 / 18, atol=0.006)
    assert (drawn_points(np.array(corners, float), 0, "prediction") != points).any()


def test_scores_are_of_two_clouds_and_of_two_draws():
    true = [np.zeros((1, 3)), np.full((2, 3), 0.01)]
    scores = surface_scores(np.array([[0, 0, 0.015], [0, 0, 0.03]]), true)
    assert scores["whole_chamfer"] == pytest.approx(0.0225 + 0.015)
    assert scores["whole_chamfer_noise"] == pytest.approx(0.02 * np.sqrt(3))
    assert scores["whole_f_score_0.02"] == pytest.approx(2 * 0.5 / 1.5)
    assert np.isnan([*surface_scores(None, true).values()]).all()
