"""Scores of single objects against plain loops."""

import numpy as np
import pytest

from metrics.measures.objects import (
    LEAST_PIXELS,
    counted_objects,
    object_means,
    single_objects,
    size_range,
)

RNG = np.random.default_rng(2)
# Of the room, two objects that count, one a pixel short of it, one of a single pixel, and nothing.
SIZES = {0: 200, 3: 60, 1: LEAST_PIXELS, 2: LEAST_PIXELS - 1, 7: 1, -1: 5}
IDS = RNG.permutation(np.repeat(list(SIZES), list(SIZES.values()))).astype(np.int8)
ERROR = RNG.random(len(IDS))
NEAREST = np.where(IDS == 3, 0.03, 0.01) * RNG.uniform(0.9, 1.1, len(IDS))


def test_each_object_that_counts_is_scored_by_its_own_pixels():
    found = single_objects(IDS, ERROR, NEAREST)
    assert found["object"].tolist() == [1, 3]
    assert found["pixels"].tolist() == [LEAST_PIXELS, 60]
    for i, one in enumerate((1, 3)):
        errors = [e for e, k in zip(ERROR, IDS, strict=True) if k == one]
        near = [d for d, k in zip(NEAREST, IDS, strict=True) if k == one]
        assert found["object_depth_error"][i] == pytest.approx(sum(errors) / len(errors))
        assert found["object_completeness"][i] == pytest.approx(sum(near) / len(near))
    assert found["object_recall_0.02"].tolist() == [1.0, 0.0]
    assert found["object_recall_0.05"].tolist() == [1.0, 1.0]
    assert np.array_equal(counted_objects(IDS), (IDS == 1) | (IDS == 3))


def test_a_picture_is_the_mean_over_pixels_and_its_recall_over_objects():
    found = object_means(single_objects(IDS, ERROR, NEAREST))
    chosen = (IDS == 1) | (IDS == 3)
    assert found["object_depth_error"] == pytest.approx(ERROR[chosen].mean())
    assert found["object_completeness"] == pytest.approx(NEAREST[chosen].mean())
    assert (found["object_recall_0.02"], found["object_recall_0.05"]) == (0.5, 1.0)


@pytest.mark.parametrize("ids", [[0] * 20, [], [5] * (LEAST_PIXELS - 1)])
def test_without_objects_there_is_no_score(ids):
    none = np.array(ids, np.int8)
    found = single_objects(none, np.ones(len(none)), np.ones(len(none)))
    assert not any(map(len, found.values()))
    assert len(object_means(found)) == 4
    assert all(np.isnan(list(object_means(found).values())))


def test_sizes_are_ranges_of_percent():
    shares = (0.0, 0.0099, 0.01, 0.05, 0.08, 1.0)
    assert list(map(size_range, shares)) == ["0-1", "0-1", "1-2", "4-8", "8-100", "8-100"]
