"""The comparison of two devices counts what differs; its sets can be made and read back."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.gpu import NEAR, Made, agreement, read, sets

DEPTH = np.linspace(1, 2, 3 * 4 * 5).reshape(3, 4, 5).astype(np.float32)
IDS = np.zeros((3, 4, 5), np.int8)
ONE = Made([b"a", b"b", b"c"], DEPTH, IDS)


def test_equal_files_agree():
    assert agreement(ONE, ONE) == (3, 1, 1)


def test_what_differs_is_counted():
    depth, ids = DEPTH.copy(), IDS.copy()
    depth[0, 0, 0] += 10 * NEAR
    ids[1, :2] = 1
    assert agreement(ONE, Made(ONE.items, depth, ids)) == (3, 1 - 10 / 60, 1 - 1 / 60)


def test_another_item_is_not_compared():
    other = replace(ONE, items=[b"a", b"x", b"c"], depth=DEPTH + np.array([0, 1, 0])[:, None, None])
    assert agreement(ONE, other) == (2, 1, 1)
    assert agreement(ONE, replace(ONE, items=[b"x"] * 3)) == (0, 0, 0)


def test_a_depth_that_one_device_lacks_is_no_near_depth():
    depth = DEPTH.copy()
    depth[2] = np.nan
    ids = np.isfinite(depth)
    assert agreement(replace(ONE, ids=ids | True), replace(ONE, depth=depth, ids=ids))[1] == 2 / 3


@pytest.mark.parametrize("name", ["rooms, `shapes`", "questions, `mirror-pair-2`"])
def test_sets_can_be_made_and_read(name, tmp_path):
    one = next(one for one in sets(6) if one.name == name)
    one.make(tmp_path / "made.h5", "cpu")
    made = read(tmp_path / "made.h5", one)
    assert len(made.items) == len(set(made.items)) > 0
    assert made.depth.size == made.ids.size == one.images * 128 * 128
    assert agreement(made, made) == (len(made.items), 1, 1)
