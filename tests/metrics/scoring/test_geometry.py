"""Pictures show depth as scores see it: after the declared alignment."""

import numpy as np
import pytest

from metrics.scoring.geometry import depth_as_scored
from metrics.submissions.reader import PredictedView
from scenegen.camera import back_project

TRUE = np.random.default_rng(0).uniform(1, 2, (6, 7))
POINTS = back_project(TRUE, 40.0)


@pytest.mark.parametrize(
    ("kind", "alignment", "geometry"),
    [
        ("depth", "none", TRUE),
        ("depth", "scale", 3 * TRUE),
        ("depth", "scale_shift", 3 * TRUE - 1),
        ("points", "scale_shift", 3 * POINTS - 1),
        ("disparity", "scale_shift", 5 / TRUE - 2),
    ],
)
def test_depth_is_fitted_where_both_are_known(kind, alignment, geometry):
    hole = np.array(geometry)
    hole[2, 3] = np.nan
    true = np.where(np.eye(6, 7), np.nan, TRUE)
    seen = depth_as_scored(PredictedView(kind, alignment, hole, None), true, 40.0)
    known = np.isfinite(true)
    known[2, 3] = False
    np.testing.assert_allclose(seen[known], TRUE[known], rtol=1e-9)
    assert np.isnan(seen[2, 3])


def test_nothing_to_fit():
    nothing = np.full((2, 2), np.nan)
    view = PredictedView("depth", "scale", nothing, None)
    assert np.isnan(depth_as_scored(view, np.ones((2, 2)), 40.0)).all()
