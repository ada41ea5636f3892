"""Distances of point clouds by hand and against all pairs."""

import sys

import numpy as np
import pytest
from scipy.spatial.distance import cdist

from metrics.measures.surfaces.chamfer_hausdorff import nearest_distances, point_scores


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
