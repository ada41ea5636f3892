"""The image search must find what a tree finds, whatever the prediction."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from metrics.measures.surfaces import image_search
from metrics.measures.surfaces.chamfer_hausdorff import nearest_distances
from metrics.measures.surfaces.image_search import nearest_distances_on_image
from scenegen.camera import back_project


def assert_exact(predicted, true, fov=20.0, mask=None):
    """Equal to scipy's tree, to rounding of the coordinates."""
    inside = np.isfinite(true) if mask is None else mask
    a, b = (back_project(np.asarray(d), fov)[inside] for d in (predicted, true))
    expected = nearest_distances(a, b, "scipy")
    found = nearest_distances_on_image(predicted, true, fov, mask)
    size = max(np.abs(a).max(), np.abs(b).max())
    np.testing.assert_allclose(found.forward, expected.forward, rtol=1e-12, atol=1e-15 * size)
    np.testing.assert_allclose(found.reverse, expected.reverse, rtol=1e-12, atol=1e-15 * size)


def predictions(truth):
    rng = np.random.default_rng(7)
    row, column = np.mgrid[: truth.shape[0], : truth.shape[1]] / truth.shape[0]
    smooth = truth * (1.0 + 0.01 * np.sin(5.0 * column) * np.cos(4.0 * row))
    return {
        "perfect": truth,
        "tiny": truth * (1.0 + 1e-12),
        "smooth": smooth,
        "noise": smooth * (1.0 + 0.01 * rng.standard_normal(truth.shape)),
        "wild": np.where(rng.random(truth.shape) < 0.02, 2.0 * truth, smooth),
        "shifted": np.roll(truth, 3, axis=1),
        "flat": np.full_like(truth, 2.5),
        "scaled": 1.1 * truth,
        "millimetres": 1000.0 * truth,
        "random": rng.uniform(0.1, 5.0, truth.shape),
        "disparity": 1.0 / truth,
        "negative": -truth,
        "behind and before": truth * rng.choice([-1.0, 1.0], truth.shape),
        "zero": np.zeros_like(truth),
        "zeros": np.where(rng.random(truth.shape) < 0.5, 0.0, truth),
        "huge": np.full_like(truth, 1e99),
    }


@pytest.mark.parametrize("name", predictions(np.ones((2, 2))))
def test_rooms_agree_with_scipy(room_depth, name):
    truth = room_depth(3, 48)
    holes = np.random.default_rng(0).random(truth.shape) < 0.1
    for true in (truth, np.where(holes, np.nan, truth)):
        assert_exact(np.where(np.isnan(true), np.nan, predictions(truth)[name]), true)


ALWAYS, NEVER = -1e12, 1e12  # overheads of a ring that make the search take all or none of them


@pytest.mark.parametrize("overhead", [ALWAYS, NEVER])
@pytest.mark.parametrize("name", ["smooth", "noise", "wild", "random", "shifted", "negative"])
def test_costs_decide_on_time_only(room_depth, monkeypatch, overhead, name):
    monkeypatch.setattr(image_search, "CALL_LOOKS", overhead)
    truth = room_depth(4, 40)
    assert_exact(predictions(truth)[name], truth)


@given(st.integers(0, 2**32 - 1), st.sampled_from([image_search.CALL_LOOKS, ALWAYS]))
def test_any_shape_field_of_view_and_mask(seed, overhead):
    rng = np.random.default_rng(seed)
    shape = tuple(rng.integers(1, 24, 2))
    true = rng.uniform(1.0, 3.0) + rng.choice([0.0, 0.01, 1.0]) * rng.random(shape)
    predicted = true * (1.0 + 10.0 ** rng.uniform(-6, 0) * rng.standard_normal(shape))
    mask = rng.random(shape) < rng.uniform(0.2, 1.0)
    mask[0, 0] = True
    predicted[~mask] = rng.choice([np.nan, np.inf, 0.0])
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(image_search, "CALL_LOOKS", overhead)
        assert_exact(predicted, true, rng.uniform(1.0, 170.0), mask)


def test_good_predictions_need_no_tree(room_depth, monkeypatch):
    truth = room_depth(5, 64)
    monkeypatch.setattr(image_search, "query_nearest", lambda *_: pytest.fail("asked a tree"))
    for name in ("perfect", "smooth"):
        nearest_distances_on_image(predictions(truth)[name], truth, 20.0)


def test_order_is_that_of_the_mask():
    true = np.full((4, 5), 2.0)
    predicted = true.copy()
    predicted[2, 3] = 2.001
    forward = nearest_distances_on_image(predicted, true, 20.0).forward
    assert np.flatnonzero(forward).tolist() == [2 * 5 + 3]
