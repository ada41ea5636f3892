"""Scores of solids by hand, and by sampling the rays densely."""

import numpy as np
import pytest

from metrics.measures.hidden.solids import (
    back_depth_error,
    entered_spans,
    hidden_object_recall,
    layer_recalls,
    overlap,
    paired_spans,
    round_bodies,
    shortcuts,
    solid_iou,
)

NAN, INF = np.nan, np.inf
STEP = 1e-3


def column(*values):
    return np.array(values, float)[:, None]


def sampled(spans, at):
    """Return which points of rays are inside, (N, P)."""
    start, end = spans
    return ((start[..., None] <= at) & (at < end[..., None])).any(axis=0)


def test_layers_are_paired_and_a_last_one_is_background():
    start, end = paired_spans(np.array([[1, 4], [2, NAN], [5, NAN], [6, NAN], [9, NAN]], float))
    np.testing.assert_array_equal(start, [[1, INF], [5, INF]])
    np.testing.assert_array_equal(end, [[2, INF], [6, INF]])


@pytest.mark.parametrize(
    ("depth", "entering", "spans"),
    [
        ([1, 2, 3, 9], [1, -1, 0, 0], [(1, 2)]),
        ([1, 2, 3, 4], [1, 1, -1, -1], [(1, 4)]),  # two objects that overlap
        ([1, 2, 3, 4], [1, -1, 1, -1], [(1, 2), (3, 4)]),
        ([1, 2, NAN, NAN], [0, 0, 0, 0], []),
        ([1, 2, 3, 4], [1, -1, 1, 0], [(1, 2), (3, 4)]),  # what is not left ends at the last layer
    ],
)
def test_rays_are_inside_while_they_have_entered_more_often(depth, entering, spans):
    start, end = entered_spans(column(*depth), column(*entering).astype(np.int8))
    known = np.isfinite(end[:, 0])
    assert list(zip(start[known, 0], end[known, 0], strict=True)) == spans


def random_layers(rng, rays=40):
    layers = np.sort(rng.uniform(1, 3, (6, rays)), axis=0)
    layers[np.arange(6)[:, None] >= rng.integers(0, 7, rays)] = NAN
    return layers


def test_lengths_are_those_of_dense_samples():
    rng = np.random.default_rng(1)
    a, b = (paired_spans(random_layers(rng)) for _ in range(2))
    at = np.arange(1, 3, STEP)
    inside = [sampled(spans, at) for spans in (a, b)]
    both = (inside[0] & inside[1]).sum(axis=1) * STEP
    np.testing.assert_allclose(overlap(a, b), both, atol=6 * STEP)
    stretch = rng.uniform(1, 2, len(both))
    either = (inside[0] | inside[1]).sum(axis=1) * STEP
    iou = solid_iou(a, b, stretch)
    assert iou == pytest.approx((both @ stretch) / (either @ stretch), abs=0.01)
    assert solid_iou(a, a, stretch) == 1.0
    nothing = np.full((1, 40), INF), np.full((1, 40), INF)
    assert solid_iou(nothing, a, stretch) == 0.0
    assert np.isnan(solid_iou(nothing, nothing, stretch))


def test_the_error_of_a_back_is_the_thickness_where_no_solid_is_predicted():
    true = np.array([[1.0, 1.0, INF]]), np.array([[1.5, 1.2, INF]])
    predicted = np.array([[1.0, INF, 1.0]]), np.array([[1.4, INF, 2.0]])
    assert back_depth_error(predicted, true) == pytest.approx((0.1 + 0.2) / 2)


def test_recall_compares_layers_of_one_number():
    true = np.array([[1, 1], [2, 2], [3, NAN], [4, NAN]], float)
    of_objects = np.array([[1, 1], [1, 0], [1, 0], [1, 0]], bool)
    predicted = np.array([[1, 1], [2.019, 2], [3.021, 5]])
    scores = layer_recalls(predicted, true, of_objects)
    expected = {"layer": 1 / 3, "layer_2": 1.0, "layer_3": 0.0, "layer_4": 0.0}
    assert scores == {f"{name}_recall_0.02": value for name, value in expected.items()}


@pytest.mark.parametrize(
    ("start", "end", "predicted"),
    [
        (4, 5, True),
        (4.4, 5, True),
        (4.6, 5, False),
        (2, 5, False),
        (6, 7, False),
        (INF, INF, False),
    ],
)
def test_hidden_objects_are_predicted_where_half_of_their_rays_are(start, end, predicted):
    """Object 1 shows on all rays but one, and object 2 on that; object 3 is behind, hollow."""
    depth = np.tile(np.array([1.0, 2, 4, 5, 6, 7])[:, None], 101)
    ids = np.tile(np.array([1, 1, 3, 3, 3, 3])[:, None], 101)
    entering = np.tile(np.array([1, -1, 1, -1, 1, -1])[:, None], 101)
    ids[:2, 0], rays = 2, np.arange(101) < 51
    spans = [np.stack([np.ones(101), np.where(rays, x, INF)]) for x in (start, end)]
    spans[1][0] = 2.0
    truth = entered_spans(depth, entering), depth, ids
    assert hidden_object_recall(tuple(spans), *truth) == float(predicted)
    fewer = [np.where(np.arange(101) < 50, x, INF) for x in spans]
    assert hidden_object_recall(tuple(fewer), *truth) == 0.0
    ids[0, 50:52] = 3  # of 101 rays
    depth[0, 50:52] = 3.5
    assert np.isnan(hidden_object_recall(tuple(spans), *truth))


def test_shortcuts_are_perfect_for_what_they_assume():
    ids = np.zeros((9, 9), int)
    ids[2:7, 2:7] = 1
    body = round_bodies(ids)
    assert body[4, 4] == pytest.approx(6.0)  # of a mask whose middle is 3 pixels from its border
    assert body[2, 2] == pytest.approx(2 * np.sqrt(5))
    assert (body[ids == 0] == 0).all()
    ids, body = ids.ravel(), body.ravel()
    at = ids > 0
    front = np.where(at, 2.0 - 0.01 * body, 3.0)
    stretch = np.ones(81)

    def scores(thickness):
        spans = np.where(at, front, INF)[None], np.where(at, front + thickness, INF)[None]
        return shortcuts(front, ids, lambda guess: solid_iou(guess, spans, stretch),
                         np.where(at, thickness, NAN), [np.ones(81), body])  # fmt: skip

    assert scores(np.full(81, 0.3))[0] == pytest.approx(1.0)
    assert scores(0.05 * body)[1] == pytest.approx(1.0)
    assert scores(2 * (front[at].max() - front))[2] == pytest.approx(1.0)
    assert max(scores(np.full(81, 0.3))[1:]) < 0.95
