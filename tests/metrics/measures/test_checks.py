"""What the measures refuse, and how the error names it."""

import numpy as np
import pytest

from metrics.measures.answers import answers_from_scores
from metrics.measures.checks import (
    LARGEST_MAGNITUDE,
    EmptyError,
    MeasureError,
    NoDirectionError,
    NonFiniteError,
    as_float64,
    require_depth_pair,
    require_finite,
    require_mask,
)
from metrics.measures.depth import compare_depth, depth_scores
from metrics.measures.statistics import (
    bootstrap_interval,
    cluster_means,
    normal_quantile,
    wilson_interval,
)
from metrics.measures.surfaces.chamfer_hausdorff import NearestDistances, f_score, nearest_distances
from metrics.measures.surfaces.image_search import nearest_distances_on_image
from metrics.measures.surfaces.normals import angular_errors_degrees, normals_from_depth

NAN, INF = np.nan, np.inf
ONES, CLOUD = np.ones((4, 5)), np.zeros((2, 3))
EVERY = np.ones((4, 5), dtype=bool)


def on_image(predicted, true, fov=20.0, mask=None):
    return nearest_distances_on_image(predicted, true, fov, mask)


WRONG_KINDS = [["a"], [1j], [True], [[1], [1, 2]], [None], b"12", {}]
WRONG_CLOUDS = [np.zeros(3), np.zeros((2, 2)), np.zeros((2, 3, 1)), 1.0, [["a"] * 3], None]
WRONG_SCORES = [[[1.0, 2.0, 3.0, 4.0]], [1.0, 2.0, 3.0], np.zeros((2, 3, 1)), [["a", "b", "c"]]]
WRONG_MASKS = [np.ones((4, 5)), np.ones(5, dtype=bool), np.ones((4, 5), dtype=np.uint8)]
CASES = [
    *((MeasureError, "it", as_float64, bad, "it") for bad in WRONG_KINDS),
    (NonFiniteError, "it", require_finite, np.array([-1.1e100]), "it"),
    *((MeasureError, "mask", require_mask, bad, (4, 5)) for bad in WRONG_MASKS),
    (EmptyError, "mask", require_mask, ~EVERY, (4, 5)),
    (MeasureError, "predicted depth", require_depth_pair, np.ones(3), ONES, None),
    *((MeasureError, "truth", nearest_distances, CLOUD, bad) for bad in WRONG_CLOUDS),
    (EmptyError, "prediction", nearest_distances, CLOUD[:0], CLOUD),
    (EmptyError, "truth", nearest_distances, CLOUD, CLOUD[:0]),
    *(
        (MeasureError, "F-score threshold", f_score, NearestDistances(CLOUD, CLOUD), bad)
        for bad in (0.0, -1.0, NAN, INF)
    ),
    (EmptyError, "mask", compare_depth, [1.0], [NAN]),
    (MeasureError, "true depth", compare_depth, [1.0, 1.0], [1.0, 0.0]),
    (NonFiniteError, "true depth", compare_depth, ONES, ONES * NAN, EVERY),
    (MeasureError, "alignment", depth_scores, compare_depth([1.0], [1.0]), "affine"),
    (EmptyError, "mask", on_image, ONES, ONES * NAN),
    (MeasureError, "predicted depth", on_image, ONES.T, ONES),
    (MeasureError, "depth", on_image, ONES[None], ONES[None]),
    (MeasureError, "mask", on_image, ONES, ONES, 20.0, ONES),
    (MeasureError, "fov_y_degrees", on_image, ONES, ONES, 180.0),
    (NonFiniteError, "true depth", on_image, ONES, ONES * NAN, 20.0, EVERY),
    (NoDirectionError, "predicted normals", angular_errors_degrees, CLOUD, CLOUD + 1.0),
    (NoDirectionError, "true normals", angular_errors_degrees, CLOUD + 1.0, CLOUD, [True, True]),
    (EmptyError, "mask", angular_errors_degrees, CLOUD + 1.0, CLOUD),
    (EmptyError, "mask", angular_errors_degrees, CLOUD + 1.0, CLOUD * NAN),
    (MeasureError, "normals", angular_errors_degrees, CLOUD[:1], CLOUD),
    (MeasureError, "mask", angular_errors_degrees, CLOUD, CLOUD, np.ones(2)),
    (MeasureError, "depth", normals_from_depth, np.ones(4), 20.0),
    *((MeasureError, "scores", answers_from_scores, bad) for bad in WRONG_SCORES),
    (EmptyError, "scores", answers_from_scores, CLOUD[:0]),
    (EmptyError, "values", cluster_means, [], []),
    (MeasureError, "cluster labels", cluster_means, [1.0, 2.0], [0]),
    (MeasureError, "cluster means", bootstrap_interval, [1.0, 2.0], 0),
    (MeasureError, "resamples", bootstrap_interval, [[1.0], [2.0]], 0, 99),
    (MeasureError, "cluster means", bootstrap_interval, np.zeros((0, 2)), 0),
    (EmptyError, "trials", wilson_interval, 0, 0),
    (MeasureError, "successes", wilson_interval, 3, 2),
    *((MeasureError, "confidence", normal_quantile, bad) for bad in (0.0, 1.0, NAN, 95.0)),
]


@pytest.mark.parametrize(
    ("kind", "where", "measure", "arguments"), [(*c[:3], c[3:]) for c in CASES]
)
def test_wrong_input_is_named(kind, where, measure, arguments):
    with pytest.raises(MeasureError) as caught:
        measure(*arguments)
    assert (type(caught.value), caught.value.where) == (kind, where)
    assert caught.value.expected


PLACES = [
    ("predicted depth", (4, 5), lambda bad: compare_depth(bad, ONES)),
    ("predicted depth", (4, 5), lambda bad: on_image(bad, ONES)),
    ("depth", (4, 5), lambda bad: normals_from_depth(bad, 20.0, EVERY)),
    ("predicted normals", (2, 3), lambda bad: angular_errors_degrees(bad, CLOUD + 1.0)),
    ("prediction", (2, 3), lambda bad: nearest_distances(bad, CLOUD)),
    ("truth", (2, 3), lambda bad: nearest_distances(CLOUD, bad)),
    ("scores", (2, 3), answers_from_scores),
    ("values", (3,), lambda bad: cluster_means(bad, [0, 1, 2])),
    ("cluster means", (3, 1), lambda bad: bootstrap_interval(bad, 0)),
    ("it", (2, 3, 3), lambda bad: require_finite(bad, "it")),
]


@pytest.mark.parametrize("value", [NAN, INF, -INF, 1e101])
@pytest.mark.parametrize(("where", "shape", "measure"), PLACES)
def test_values_that_are_not_finite_are_counted_and_the_first_is_named(
    where, shape, measure, value
):
    bad = np.ones(shape)
    bad.flat[[1, -1]] = value
    with pytest.raises(NonFiniteError) as caught:
        measure(bad)
    index = tuple(int(i) for i in np.unravel_index(1, shape))
    assert caught.value.where == where
    assert caught.value.found.startswith(f"2 of {bad.size} values")
    assert caught.value.found.endswith(f"{value} at index {index}")


def test_what_lies_outside_the_mask_is_not_looked_at():
    values = np.zeros((2, 3))
    values[0, 1] = NAN
    mask = np.ones((2, 3), dtype=bool)
    mask[0, 1] = False
    require_finite(values, "it", mask)
    require_finite(np.stack([values] * 3, axis=-1), "it", mask)
    require_finite(np.array([LARGEST_MAGNITUDE, -LARGEST_MAGNITUDE]), "it")
    with pytest.raises(NonFiniteError):
        require_finite(values, "it", ~mask)


def test_a_prediction_cannot_shrink_the_mask():
    true = np.array([[1.0, NAN], [2.0, 3.0]])
    with pytest.raises(NonFiniteError):
        require_depth_pair(np.array([[1.0, 5.0], [NAN, 3.0]]), true, None)
    _, _, inside = require_depth_pair(np.ones((2, 2)), true, None)
    assert np.array_equal(inside, np.isfinite(true))
