"""Pictures without objects, and ranges of sizes; `test_definitions` has the scores."""

import numpy as np
import pytest

from metrics.measures.objects import (
    LEAST_PIXELS,
    object_means,
    single_objects,
    size_range,
)


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
