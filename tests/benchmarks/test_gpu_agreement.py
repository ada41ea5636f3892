"""The comparison of two devices counts what differs; its sets can be made and read back."""

from dataclasses import replace

import numpy as np

from benchmarks.gpu.agreement import NEAR, Made, agreement

DEPTH = np.linspace(1, 2, 3 * 4 * 5).reshape(3, 4, 5).astype(np.float32)
IDS = np.zeros((3, 4, 5), np.int8)
MADE = Made([b"a", b"b", b"c"], DEPTH, IDS)


def test_what_differs_is_counted():
    depth, ids = DEPTH.copy(), IDS.copy()
    depth[0, 0, 0] += 10 * NEAR
    ids[1, :2] = 1
    assert agreement(MADE, MADE) == (3, 1, 1)
    assert agreement(MADE, Made(MADE.items, depth, ids)) == (3, 1 - 10 / 60, 1 - 1 / 60)


def test_another_item_is_not_compared():
    far = DEPTH + np.array([0, 1, 0])[:, None, None]
    assert agreement(MADE, replace(MADE, items=[b"a", b"x", b"c"], depth=far)) == (2, 1, 1)
    assert agreement(MADE, replace(MADE, items=[b"x"] * 3)) == (0, 0, 0)
