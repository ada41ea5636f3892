"""Matching finds the surfaces of rendered rooms, and each of its steps what a slow one finds."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
import torch
from pix2shape_models import in_memory

from baselines.pix2shape.matching import (
    LARGE,
    SMALL,
    STEP,
    STEPS,
    best_relief,
    pairs_of,
    relief_of_row,
    semi_global,
)
from baselines.pix2shape.network.empty_rooms import empty_rooms
from scenegen.rooms.reader import RoomsFile


@pytest.mark.parametrize("bits", [16, 8])
def test_objects_are_found_without_depth(bits, many_near_path):
    """Relief within two steps on most object pixels, and none on most of floor and walls."""
    rooms = in_memory(many_near_path, 64, depth=True)
    assert not rooms.rounded
    if bits == 8:
        image = (rooms.image.float() * 255).round() / 255
        rooms = replace(rooms, image=image, rounded=True)
    walls, _, _ = empty_rooms(rooms.world_from_camera, rooms.fov_y_degrees, 64)
    true = walls - rooms.depth
    with RoomsFile(many_near_path) as file:
        objects = torch.tensor(file.read("object_id", slice(None)) > 0)
    pairs = pairs_of(rooms)
    rows = [row for row, (one, other) in enumerate(pairs) if one or other]
    assert rows == [row for row in range(48) if row % 4 < 3]
    found = torch.stack([relief_of_row(rooms, row, pairs[row]) for row in rows])
    wrong, within = (found - true[rows]).abs(), objects[rows]
    assert wrong[within].median() < STEP
    assert (wrong[within] < 2 * STEP).float().mean() > 0.6
    assert (found[~within] < 0.05).float().mean() > 0.9
    raised, truly = found > 0.05, true[rows] > 0.05
    assert (raised & truly).sum() / (raised | truly).sum() > 0.6


def way_cost(cost: np.ndarray, x: int, last: int) -> float:
    """Return the least cost of all ways from column 0 to column x of a row that end at `last`."""
    best = np.inf
    for way in itertools.product(range(cost.shape[0]), repeat=x):
        steps = np.abs(np.diff([*way, last]))
        changes = np.where(steps == 0, 0, np.where(steps == 1, SMALL, LARGE)).sum()
        best = min(best, changes + sum(cost[d, i] for i, d in enumerate([*way, last])))
    return best


def test_semi_global_costs_are_those_of_the_best_ways():
    cost = torch.rand(2, 3, 4, 4, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    found = semi_global(cost)
    for b, y, x in ((0, 0, 0), (0, 1, 3), (1, 2, 1), (1, 3, 2)):
        rows = cost[b, :, y].numpy(), cost[b, :, y].flip(1).numpy()
        columns = cost[b, :, :, x].numpy(), cost[b, :, :, x].flip(1).numpy()
        ends = (x, 3 - x), (y, 3 - y)
        expected = np.array([
            sum(way_cost(line, at, d) for lines, at2 in zip((rows, columns), ends, strict=True)
                for line, at in zip(lines, at2, strict=True))
            for d in range(3)
        ])  # fmt: skip
        seen = found[b, :, y, x].numpy()
        np.testing.assert_allclose(seen - seen[0], expected - expected[0], atol=1e-9)


def test_the_least_cost_is_found_between_the_steps():
    steps = torch.arange(STEPS, dtype=torch.float64)
    for at in (0.0, 0.3, 5.0, 7.4, STEPS - 1.0):
        cost = (steps - at).square()[None, :, None, None]
        expected = 0 if at < 0.5 else at
        assert float(best_relief(cost)) == pytest.approx(STEP * expected, abs=STEP * 1e-5)
    flat = torch.zeros(1, STEPS, 2, 2)
    assert (best_relief(flat) == 0).all()
