"""Rows come back as they were, from any alignment of numpy's memory."""

import importlib

import numpy as np
import pytest


@pytest.mark.parametrize("width", [1, 3, 4, 5, 12, 29])
def test_rows_are_gathered_as_they_were_uploaded(width, variant):
    import mitsuba as mi

    tables = importlib.import_module("scenegen.rendering.tables")
    rows = np.random.default_rng(0).random((2, 7, width)).astype(np.float32)
    table = tables.upload_table(rows)
    assert np.asarray(table).ctypes.data % 16 == 0
    order = [13, 0, 5, 5, 8]
    found = tables.gather_row(table, mi.UInt32(order), width)
    np.testing.assert_array_equal(np.stack(found, axis=1), rows.reshape(14, width)[order])
