"""Rows in another order than the truth's are told of, scaled and wavy or not."""

import numpy as np
import pytest
from hint_noise import smooth

COUNT = 16  # rooms that `hints` knows

ORDERS = {
    "reversed": np.arange(COUNT)[::-1],
    "one late": np.roll(np.arange(COUNT), 1),
    "sorted as texts": np.array(sorted(range(COUNT), key=str)),
    "at random": np.random.default_rng(3).permutation(COUNT),
}


@pytest.mark.parametrize("kind", ORDERS)
@pytest.mark.parametrize("scale", [1.0, 0.001])
def test_shuffled_rows(hints, room_arrays, kind, scale):
    depth = scale * (room_arrays[0] + smooth(9, room_arrays[0].shape, 8, 0.03))
    alignment = "none" if scale == 1.0 else "scale"
    (line,) = hints(depth[ORDERS[kind]], alignment=alignment)
    assert line.startswith("row: rows look shuffled")


def test_rows_in_another_order_but_rightly_named(hints, room_arrays):
    order = ORDERS["at random"]
    assert hints(room_arrays[0][order], room_arrays[1][order], rows=order) == []


def test_a_few_rows_swapped_are_no_pattern(hints, room_arrays):
    order = np.r_[1, 0, 3, 2, 4:COUNT]
    assert hints(room_arrays[0][order]) == []


def test_shuffled_rows_that_are_not_all_there(hints, room_arrays):
    rows = np.arange(2, 15)
    (line,) = hints(room_arrays[0][rows], rows=rows[::-1])
    assert "that of row 14 fits row 2" in line
