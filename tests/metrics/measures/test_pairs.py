"""Pairs of pixels, points in the air, and confidence, by hand and against published values.

`scoring/test_definitions` has the formulas on whole files.
"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from metrics.measures.boundaries import boundary_scores
from metrics.measures.confidence import REMOVED, confidence_scores, distance_from_edges
from metrics.measures.depth import DepthPair, scale_log2, within_eighth
from metrics.measures.flying import at_half_resolution, flying_points, other_surface
from metrics.measures.pairs import (
    ORDERED,
    ordered_pairs,
    ordinal_scores,
    relative_normal_scores,
    sawa_h,
    spread,
    triangle_pairs,
)
from scenegen.camera import back_project

SIZE, FOV = 96, 50.0
WHOLE = np.ones((SIZE, SIZE), bool)


def ball_before_a_wall():
    y, x = np.mgrid[:SIZE, :SIZE] / SIZE
    apart = np.hypot(x - 0.45, y - 0.55)
    ball = 2.2 - np.sqrt(np.maximum(0.28**2 - apart**2, 0.0))
    true = np.where(apart < 0.28, ball, 3 + 0.8 * x - 0.5 * y)
    waves = true * (1.0 + 0.01 * np.sin(40 * x) * np.sin(33 * y))
    return true, {"waves": waves, "lean": true + 0.3 * (x - 0.5), "scaled": 1.7 * waves}


# What the published code (princeton-vl/EvalMDE, commit 31551d17) gives: order, the two fits,
# relative normals in radians over a million pairs, and SAWA-H over ten million.
PUBLISHED = {
    "waves": (0.01257, 0.0, 0.0, 0.13736, 0.31235),
    "lean": (0.03312, 0.31543, 0.35069, 0.03347, 0.24610),
    "scaled": (0.01257, 0.0, 0.0, 0.13736, 0.31235),
}


@pytest.mark.parametrize("name", PUBLISHED)
@pytest.mark.parametrize("row", [0, 7, 123_456])
def test_the_published_code_agrees_but_for_its_random_pairs(name, row):
    true, predictions = ball_before_a_wall()
    depth, (order, disparity, affine, turned, total) = predictions[name], PUBLISHED[name]
    pair = DepthPair(depth.ravel(), true.ravel())
    fits = [within_eighth(pair, fit) for fit in ("disparity_scale_shift", "scale_shift")]
    assert [1.0 - share for share in fits] == pytest.approx([disparity, affine], abs=5e-5)
    pairs = triangle_pairs(back_project(true, FOV), WHOLE, row)
    normals = relative_normal_scores(back_project(depth, FOV), pairs)["anywhere"]
    unordered = 1.0 - ordinal_scores(depth, ordered_pairs(true, WHOLE, row))["anywhere"]
    f1 = boundary_scores(depth, true, WHOLE)["boundary_f1"]
    assert normals == pytest.approx(turned, rel=0.02)
    assert unordered == pytest.approx(order, abs=3.0 * np.sqrt(order / ORDERED))
    assert sawa_h(unordered, *fits, f1, normals) == pytest.approx(total, abs=0.015)


@given(st.integers(1, 4), st.integers(0, 10**6))
def test_pairs_fill_their_space(axes, row):
    points = spread(4096, axes, row)
    assert ((points >= 0.0) & (points < 1.0)).all()
    counts = np.histogramdd(points, bins=[2] * axes)[0]
    assert np.abs(counts / 4096 - 0.5**axes).max() < 0.02


def test_pairs_stay_on_one_surface():
    """A step between two walls turns nothing; bumps on them turn what lies on one of them."""
    true = np.where(np.arange(SIZE) < SIZE / 2, 2.0, 3.0) * np.ones((SIZE, 1))
    ids = np.where(true == 2.0, 1, 2)
    points = back_project(true, FOV)
    for object_id in (ids, None):
        pairs = triangle_pairs(points, WHOLE, 0, object_id)
        for scale in pairs:
            sides = (scale.corners % SIZE < SIZE / 2)[scale.same].reshape(-1, 6)
            assert (sides.all(axis=1) | ~sides.any(axis=1)).all()
        scores = relative_normal_scores(points, pairs)
        assert scores["relative_normal_degrees"] == pytest.approx(0.0, abs=1e-6)
        lost = relative_normal_scores(np.zeros_like(points), pairs)
        assert lost["relative_normal_degrees"] == 180.0
    holes = WHOLE.copy()
    holes[::2] = False
    for scale in triangle_pairs(np.where(holes[..., None], points, np.nan), holes, 0):
        assert holes.ravel()[scale.corners].all()
    for tiny in ((1, 1), (2, 5)):
        none = np.ones(tiny, bool)
        assert np.isnan(relative_normal_scores(np.ones((*tiny, 3)), triangle_pairs(
            np.ones((*tiny, 3)), none, 0))["relative_normal_degrees"])  # fmt: skip


def test_order_is_strict_and_blind_to_monotone_changes():
    true, _ = ball_before_a_wall()
    ids = (true < 2.3).astype(int)
    order = ordered_pairs(true, WHOLE, 3, ids)
    names = ("ordinal_accuracy", "ordinal_accuracy_within", "ordinal_accuracy_between")
    for depth, right in ((true, 1.0), (true**3 + 5.0, 1.0), (-true, 0.0), (0.0 * true, 0.0)):
        scores = ordinal_scores(depth, order)
        assert [scores[name] for name in names] == [right] * 3
    swapped = np.where(ids == 1, true + 9.0, true)  # objects behind the room, else right
    scores = ordinal_scores(swapped, order)
    assert (scores["ordinal_accuracy_within"], scores["ordinal_accuracy_between"]) == (1.0, 0.0)
    flat = ordinal_scores(true, ordered_pairs(np.ones((SIZE, SIZE)), WHOLE, 0, ids))
    assert all(np.isnan(flat[name]) for name in names)


def test_points_fly_between_two_surfaces():
    true = np.where(np.arange(12) < 6, 2.0, 4.0) * np.ones((12, 1))
    ids = np.where(true == 2.0, 1, 0)
    whole = np.ones((12, 12), bool)
    other = other_surface(true, ids, whole)
    near = np.isfinite(other)
    assert near[:, 4:8].all()
    assert not near[:, [3, 8]].any()
    assert (other[:, :6][near[:, :6]] == 4.0).all()
    cases = ((true, 0.0), (0.0 * true + 3.0, 1.0), (0.0 * true + 2.2, 1.0), (true + 0.11, 0.5),
             (true + 0.09, 0.0), (0.0 * true + 5.0, 0.0))  # fmt: skip
    for depth, share in cases:
        assert flying_points(depth, true, other) == share
    half = at_half_resolution(true[:, 1:], whole[:, 1:])
    assert flying_points(half, true[:, 1:], other[:, 1:]) > 0.4
    assert np.isnan(flying_points(true, true, other_surface(true, 0 * ids, whole)))
    assert np.isnan(flying_points(true, true, other_surface(true / 20.0 + 9.0, ids, whole)))


@given(st.integers(0, 2**32 - 1), st.integers(1, 200))
def test_confidence_counts_by_its_order(seed, count):
    rng = np.random.default_rng(seed)
    errors, sure = rng.exponential(size=count), rng.normal(size=count)
    scores = confidence_scores(errors, sure)
    assert confidence_scores(errors, 3.0 * sure**3 + 1.0) == scores
    assert confidence_scores(errors, -errors)["ause_abs_rel"] == pytest.approx(0.0, abs=1e-12)
    assert confidence_scores(errors, np.ones(count))["aurg_abs_rel"] == pytest.approx(0, abs=1e-12)
    assert scores["ause_abs_rel"] >= -1e-12
    best = confidence_scores(errors, -errors)["aurg_abs_rel"]
    assert scores["ause_abs_rel"] + scores["aurg_abs_rel"] == pytest.approx(best, abs=1e-12)
    assert confidence_scores(errors, errors)["aurg_abs_rel"] <= 1e-12


def test_sparsification_by_hand_and_edges_of_brightness():
    scores = confidence_scores(np.arange(1.0, 21.0), -np.arange(1.0, 21.0))
    assert len(REMOVED) == 20
    assert scores["aurg_abs_rel"] == pytest.approx(
        10.5 - np.mean([(n + 1) / 2 for n in range(1, 21)])
    )
    image = np.zeros((9, 20, 3))
    image[:, 10:] = 1.0
    assert distance_from_edges(image)[4].tolist() == [*range(9, 0, -1), 0, 0, *range(1, 10)]
    assert not distance_from_edges(np.zeros((1, 1, 3))).any()


def test_scale_is_a_bias():
    true = np.array([1.0, 2.0, 3.0])
    for factor, value in ((1.0, 0.0), (2.0, 1.0), (0.5, -1.0), (-1.0, -10.0)):
        assert scale_log2(DepthPair(factor * true, true)) == value
