"""Matched shapes: alike in what outlines show, by other ways to reckon it, and never the same."""

import numpy as np
import pytest
import trimesh

from iqtt.shapes import matched as module
from iqtt.shapes.matched import TOLERANCE, contacts, gyration_radii, matched_rows
from iqtt.shapes.polycube import ROTATIONS, mirror
from iqtt.shapes.splits import known_classes


def solid(cubes: np.ndarray) -> trimesh.Trimesh:
    """The cubes as boxes of one mesh."""
    boxes = [trimesh.creation.box(bounds=[c, c + 1]) for c in cubes.astype(float)]
    return trimesh.util.concatenate(boxes)


@pytest.mark.parametrize("cubes", [1, 3, 8])
def test_radii_and_contacts_are_those_of_the_solid(cubes: int) -> None:
    """Against trimesh's moments of inertia, and free faces counted cell by cell."""
    for shape in known_classes(cubes)[:20]:
        inertia = np.sort(solid(shape).principal_inertia_components)
        second = (inertia.sum() / 2 - inertia)[::-1] / cubes
        assert gyration_radii(shape[None])[0] == pytest.approx(np.sqrt(second), abs=2e-6)
        cells = {tuple(c) for c in shape.tolist()}
        steps = np.concatenate([np.eye(3, dtype=int), -np.eye(3, dtype=int)])
        free = sum(tuple(c + s) not in cells for c in shape for s in steps)
        assert free == 6 * cubes - 2 * contacts(shape[None])[0]


def test_turned_and_mirrored_shapes_have_the_same_radii() -> None:
    shapes = known_classes(8)[::9]
    for other in (mirror(shapes), shapes @ ROTATIONS[7].T):
        np.testing.assert_allclose(gyration_radii(other), gyration_radii(shapes), atol=2e-6)
        assert (contacts(other) == contacts(shapes)).all()


def test_matched_shapes_are_all_that_are_alike_the_nearest_first() -> None:
    """Against every pair."""
    shapes = known_classes(8, max_radius=3.5)
    rows = matched_rows(shapes)
    edges = np.sort(np.ptp(shapes, axis=1), axis=1)
    radii, touching = gyration_radii(shapes), contacts(shapes)
    apart = np.linalg.norm(radii[:, None] - radii, axis=2)
    apart[(edges[:, None] != edges).any(axis=2) | (touching[:, None] != touching)] = np.inf
    np.fill_diagonal(apart, np.inf)
    apart[apart > TOLERANCE] = np.inf
    enough = np.flatnonzero(np.isfinite(apart).sum(axis=1) >= 2)
    assert rows[:, 0].tolist() == enough.tolist()
    assert len(enough) > 0.1 * len(shapes)
    for row in rows:
        used = row[1:][row[1:] >= 0]
        nearest = np.sort(apart[row[0]])[: module.PARTNERS]
        assert len(set(used.tolist())) == len(used) == np.isfinite(nearest).sum()
        np.testing.assert_allclose(apart[row[0], used], nearest[: len(used)], atol=2e-6)


def test_few_shapes_have_no_matched_ones() -> None:
    for count in (0, 1, 2):
        assert matched_rows(known_classes(8)[:count]).shape == (0, 1 + module.PARTNERS)
