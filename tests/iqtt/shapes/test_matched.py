"""Matched shapes: alike in what outlines show, by other ways to reckon it, and never the same."""

import itertools
import math

import numpy as np
import pytest
import trimesh

from iqtt.shapes import matched as module
from iqtt.shapes.matched import TOLERANCE, contacts, matched_rows, moments
from iqtt.shapes.splits import known_classes


def solid(cubes):
    """The cubes as boxes of one mesh."""
    boxes = [trimesh.creation.box(bounds=[c, c + 1]) for c in cubes.astype(float)]
    return trimesh.util.concatenate(boxes)


@pytest.mark.parametrize("cubes", [1, 3, 8])
def test_radii_and_contacts_are_those_of_the_solid(cubes):
    """Against trimesh's moments of inertia, and free faces counted cell by cell."""
    for shape in known_classes(cubes)[:20]:
        inertia = np.sort(solid(shape).principal_inertia_components)
        second = (inertia.sum() / 2 - inertia)[::-1] / cubes
        assert moments(shape[None])[0, :3] == pytest.approx(np.sqrt(second), abs=2e-6)
        cells = {tuple(c) for c in shape.tolist()}
        steps = np.concatenate([np.eye(3, dtype=int), -np.eye(3, dtype=int)])
        free = sum(tuple(c + s) not in cells for c in shape for s in steps)
        assert free == 6 * cubes - 2 * contacts(shape[None])[0]


def test_higher_moments_are_sums_over_cubes():
    """Entry by entry, in plain Python."""
    shape = known_classes(7)[100]
    x, axes = shape - shape.mean(axis=0), range(3)
    third = {t: np.prod(x[:, t], axis=1).mean() for t in itertools.product(axes, repeat=3)}
    fourth = [np.prod(x[:, t], axis=1).mean() for t in itertools.product(axes, repeat=4)]
    trace = [sum(third[i, j, j] for j in axes) for i in axes]
    expected = (
        math.hypot(*third.values()) ** (1 / 3) / 2,
        math.hypot(*trace) ** (1 / 3) / 2,
        np.mean([math.hypot(*row) ** 4 for row in x]) ** (1 / 4),
        math.hypot(*fourth) ** (1 / 4),
    )
    assert moments(shape[None])[0, 3:] == pytest.approx(expected, abs=2e-6)


def test_matched_shapes_are_all_that_are_alike_the_nearest_first():
    """Against every pair."""
    shapes = known_classes(9, max_radius=3.5)[:1500]
    rows = matched_rows(shapes)
    edges = np.sort(np.ptp(shapes, axis=1), axis=1)
    radii, touching = moments(shapes), contacts(shapes)
    apart = np.linalg.norm(radii[:, None] - radii, axis=2)
    apart[(edges[:, None] != edges).any(axis=2) | (touching[:, None] != touching)] = np.inf
    np.fill_diagonal(apart, np.inf)
    apart[apart > TOLERANCE] = np.inf
    enough = np.flatnonzero(np.isfinite(apart).sum(axis=1) >= 2)
    assert rows[:, 0].tolist() == enough.tolist()
    assert len(enough) > 0.05 * len(shapes)
    for row in rows:
        used = row[1:][row[1:] >= 0]
        nearest = np.sort(apart[row[0]])[: module.PARTNERS]
        assert len(set(used.tolist())) == len(used) == np.isfinite(nearest).sum()
        np.testing.assert_allclose(apart[row[0], used], nearest[: len(used)], atol=2e-6)


def test_few_shapes_have_no_matched_ones():
    for count in (0, 1, 2):
        assert matched_rows(known_classes(8)[:count]).shape == (0, 1 + module.PARTNERS)
