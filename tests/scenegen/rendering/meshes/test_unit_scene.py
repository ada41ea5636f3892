"""Tables of triangles: their rows are counted, up to what a float counts."""

import importlib

import numpy as np
import pytest

from scenegen.common.errors import SpecError


def test_rows_of_triangles_are_counted_up_to_what_a_float_counts(variant):
    stacked = importlib.import_module("scenegen.rendering.meshes.unit_scene").stacked
    row = np.ones((1, 12), np.float32)
    first, _ = stacked([np.repeat(row, 3, 0), row[:0], np.repeat(row, 2, 0)])
    assert first[[0, 2]].tolist() == [1, 4]
    with pytest.raises(SpecError) as error:
        stacked([np.broadcast_to(row, (2**24 - 1, 12)), row])
    assert "16,777,216" in error.value.found
