"""Point-cloud distances against brute force, scipy, point-cloud-utils and hand-made cases."""

import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.distance import cdist

from metrics.measures.surfaces.chamfer_hausdorff import (
    NearestDistances,
    f_score,
    nearest_distances,
    point_scores,
)
from scenegen.camera import back_project

SEEDS = st.integers(0, 2**32 - 1)


def random_clouds(seed):
    rng = np.random.default_rng(seed)
    counts, scale = rng.integers(1, 60, 2), 10.0 ** rng.integers(-3, 4)
    return tuple(scale * rng.standard_normal((count, 3)) for count in counts)


def room_clouds(room_depth, size=48):
    truth = room_depth(1, size)
    noise = np.random.default_rng(2).standard_normal(truth.shape)
    return tuple(back_project(d, 20.0)[truth > 0.0] for d in (truth + 0.05 * noise, truth))


def expected_scores(a, b):
    """By the definitions, from the full matrix of distances."""
    matrix = cdist(a, b)
    forward, reverse = matrix.min(axis=1), matrix.min(axis=0)
    return {
        "accuracy_distance": forward.mean(),
        "completeness_distance": reverse.mean(),
        "chamfer": forward.mean() + reverse.mean(),
        "chamfer_squared": (forward**2).mean() + (reverse**2).mean(),
        "hausdorff": max(forward.max(), reverse.max()),
        "hausdorff_forward": forward.max(),
        "hausdorff_reverse": reverse.max(),
        "hausdorff_95": max(np.quantile(forward, 0.95), np.quantile(reverse, 0.95)),
    }


@given(SEEDS)
def test_scores_follow_their_definitions(seed):
    a, b = random_clouds(seed)
    assert point_scores(nearest_distances(a, b)) == pytest.approx(expected_scores(a, b), rel=1e-9)


def test_agrees_with_point_cloud_utils(room_depth):
    pcu = pytest.importorskip("point_cloud_utils")
    for a, b in (room_clouds(room_depth), random_clouds(5)):
        scores = point_scores(nearest_distances(a, b))
        assert scores["chamfer"] == pytest.approx(pcu.chamfer_distance(a, b), rel=1e-9)
        assert scores["hausdorff"] == pytest.approx(pcu.hausdorff_distance(a, b), rel=1e-9)
        forward = pcu.one_sided_hausdorff_distance(a, b)[0]
        assert scores["hausdorff_forward"] == pytest.approx(forward, rel=1e-9)


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


@given(SEEDS)
def test_identical_clouds_are_perfect_in_any_order(seed):
    a, _ = random_clouds(seed)
    scores = point_scores(nearest_distances(a[::-1], a), [1e-9])
    assert scores.pop("f_score_1e-09") == 1.0
    assert set(scores.values()) == {0.0}


def test_f_score_counts_strictly_and_survives_nothing_near():
    nearest = NearestDistances(np.array([0.1, 0.2]), np.array([0.1, 0.3]))
    assert f_score(nearest, 0.1) == 0.0
    assert f_score(nearest, 0.2) == 0.5


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
    monkeypatch.setitem(sys.modules, "pykdtree.kdtree", None)
    a, b = random_clouds(3)
    assert point_scores(nearest_distances(a, b)) == pytest.approx(expected_scores(a, b))
    with pytest.raises(ImportError):
        nearest_distances(a, b, "pykdtree")
