"""Rules on masks, by hand: which option each prefers, and what a map of other objects predicts."""

import numpy as np
import pytest

from iqtt.audit.probes.masks import RULES, mask_costs

FIXED = {2: (8, 8), 3: (8, 52), 4: (52, 8), 5: (50, 50), 6: (30, 20)}  # row and column


def image(places, change=lambda row, column: (row, column), size=4):
    """Draw objects as squares, their middles moved by `change`."""
    drawn = np.full((64, 64), -2)
    for number, place in places.items():
        row, column = (round(x) for x in change(*place))
        drawn[row - size // 2 : row + size // 2, column - size // 2 : column + size // 2] = number
    return drawn


def best(change, options, size=4):
    """Return which option each rule prefers where a map moves all objects but the first."""
    reference = image({1: (40, 30), **FIXED})
    seen = [image({1: place, **{n: change(*p) for n, p in FIXED.items()}}, size=size)
            for place in options]  # fmt: skip
    costs = mask_costs(np.stack([reference, *seen]), 1, [1])
    return dict(zip(RULES, costs.argmin(axis=0), strict=True)), costs


@pytest.mark.parametrize("rule", ["affine map of centres", "affine map of feet",
                                  "homography of feet"])  # fmt: skip
def test_maps_of_other_objects_predict_the_place(rule):
    def turned(row, column):
        return 0.6 * row + 0.3 * column + 2, 0.8 * column - 0.2 * row + 12

    chosen, costs = best(turned, [(20, 20), turned(40, 30), (40, 30)])
    assert chosen[rule] == 1
    assert costs[1, RULES.index(rule)] < 2  # pixels
    assert chosen["same place"] == 2


def test_a_homography_is_found_where_no_affine_map_is():
    def seen(row, column):
        depth = 1 + row / 64
        return row / depth + 5, column / depth + 5

    _, costs = best(seen, [seen(40, 30)] * 3)
    assert costs[0, RULES.index("homography of feet")] < 1.5
    assert costs[0, RULES.index("affine map of feet")] > costs[0, RULES.index("homography of feet")]


def test_order_and_neighbours_are_those_of_the_reference():
    chosen, costs = best(lambda row, column: (row, column), [(14, 4), (58, 58), (41, 31)])
    for rule in ("same place", "IoU of masks", "order from left to right", "order of distances",
                 "order from top to bottom", "map of the two nearest", "equal ids"):  # fmt: skip
        assert chosen[rule] == 2, rule
    assert costs[2, RULES.index("order from left to right")] == 0
    assert np.ptp(costs[:, RULES.index("size")]) == 0


def test_images_without_other_objects_have_finite_costs():
    alone = np.stack([image({1: place}) for place in ((20, 20), (40, 20), (20, 21), (50, 50))])
    costs = mask_costs(alone, 1, [1, 9])  # what it carries is hidden
    assert np.isfinite(costs).all()
    assert costs[:, RULES.index("same place")].argmin() == 1
