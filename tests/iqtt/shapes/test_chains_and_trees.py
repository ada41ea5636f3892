"""Random shapes, lists of all against published counts, moved cubes, and matched shapes."""

import itertools

import numpy as np
import pytest
import trimesh
from polycubes import some_shapes

from iqtt.shapes import matched as module
from iqtt.shapes.chains_and_trees import all_classes, all_walks, random_shapes
from iqtt.shapes.matched import TOLERANCE, contacts, matched_rows, moments
from iqtt.shapes.near import is_chain, is_connected, move_cubes
from iqtt.shapes.polycube import bounding_radius, is_chiral, symmetries
from iqtt.shapes.splits import known_classes

# Self-avoiding walks of 1, 2, ... steps on the cubic lattice, OEIS A001412.
WALKS = [6, 30, 150, 726, 3534, 16926, 81390, 387966, 1853886]
# Polycubes of 1, 2, ... cubes: in fixed orientation (A001931), modulo rotations (A000162), and
# modulo rotations and mirrors (A038119).
FIXED = [1, 3, 15, 86, 534, 3481, 23502, 162913]
ONE_SIDED = [1, 1, 2, 8, 29, 166, 1023, 6922]
TWO_SIDED = [1, 1, 2, 7, 23, 112, 607, 3811]
KINDS = pytest.mark.parametrize("kind", ["chain", "tree"])


@pytest.mark.parametrize(("steps", "count"), list(enumerate(WALKS, start=1)))
def test_as_many_walks_as_published(steps, count):
    walks = all_walks(steps + 1)
    axes_used = (np.ptp(walks, axis=1) > 0).sum(axis=1)
    assert np.array([0, 6, 24, 48])[axes_used].sum() == count


@pytest.mark.parametrize("cubes", range(1, 9))
def test_as_many_polycubes_as_published(cubes):
    classes = all_classes(cubes, "tree")
    hands = 1 + is_chiral(classes)
    assert len(classes) == TWO_SIDED[cubes - 1]
    assert hands.sum() == ONE_SIDED[cubes - 1]
    assert (hands * 24 // symmetries(classes).sum(axis=1)).sum() == FIXED[cubes - 1]


@KINDS
@pytest.mark.parametrize("cubes", [1, 2, 5, 16])
def test_random_shapes_are_connected_and_do_not_overlap(kind, cubes):
    first, found, other = (
        some_shapes(np.random.default_rng(seed), 300, cubes, kind) for seed in (0, 0, 1)
    )
    assert (first == found).all()
    assert (first != other).any() == (cubes > 1)
    assert (found.shape, found.dtype) == ((300, cubes, 3), np.int8)
    assert (found[:, 0] == 0).all()
    apart = np.abs(found[:, :, None].astype(int) - found[:, None]).sum(axis=3)
    assert ((apart == 0).sum(axis=(1, 2)) == cubes).all()
    for i in range(1, cubes):
        earlier = apart[:, i, i - 1 : i] if kind == "chain" else apart[:, i, :i]
        assert (earlier == 1).any(axis=1).all()


def test_random_chains_are_uniform_over_walks():
    # Five cubes: the shortest walks of which some meet themselves. 6 * 5**3 walks of four steps
    # never turn straight back; 726 of those avoid themselves, and only they are kept.
    walks = random_shapes(np.random.default_rng(0), 75_000, 5)
    share = 726 / 750
    assert abs(len(walks) - 75_000 * share) < 5 * np.sqrt(75_000 * share * (1 - share))
    _, counts = np.unique(walks.reshape(len(walks), -1), axis=0, return_counts=True)
    assert len(counts) == 726
    chi_squared = ((counts - counts.mean()) ** 2 / counts.mean()).sum()
    assert abs(chi_squared - 725) < 5 * np.sqrt(2 * 725)


def test_trees_grow_on_every_free_face_alike():
    # A domino shows ten faces, two of which make a rod of three.
    found = random_shapes(np.random.default_rng(0), 50_000, 3, "tree")
    rods = (np.ptp(found, axis=1) == 2).any(axis=1).sum()
    assert abs(rods - 10_000) < 5 * np.sqrt(50_000 * 0.2 * 0.8)


ROD = [[0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]]
TEE = [[0, 0, 0], [1, 0, 0], [2, 0, 0], [1, 1, 0]]
RING = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
EDGE_ON = [[0, 0, 0], [1, 0, 0], [2, 1, 0], [3, 1, 0]]
MOVES_OF = {n: 6 * n * (n - 1) for n in range(2, 9)}  # moves by the number of cubes
TORN = [[0, 0, 0], [1, 0, 0], [5, 0, 0], [6, 0, 0]]


def test_connected_shapes_and_chains_are_known():
    cubes = np.array([ROD, TEE, RING, EDGE_ON, TORN])
    assert is_connected(cubes).tolist() == [True, True, True, False, False]
    assert is_chain(cubes).tolist() == [True, False, True, False, False]


@pytest.mark.parametrize("cubes", range(1, 9))
def test_the_trees_that_are_chains_are_all_the_chains(cubes):
    trees = all_classes(cubes, "tree")
    assert is_connected(trees).all()
    assert (trees[is_chain(trees)] == all_classes(cubes, "chain")).all()


def sets_one_move_away(cubes, kind):
    """All valid sets of cubes that share all but one with these, found the slow way."""
    own = {tuple(cube) for cube in cubes.tolist()}
    low, high = cubes.min(axis=0) - 1, cubes.max(axis=0) + 2
    cells = itertools.product(*(range(a, b) for a, b in zip(low, high, strict=True)))
    candidates = [frozenset(own - {old} | {new}) for new in cells if new not in own for old in own]
    valid = is_chain if kind == "chain" else is_connected
    return {c for c in candidates if valid(np.array([sorted(c)]))[0]}


@pytest.mark.parametrize("kind", ["chain", "tree"])
@pytest.mark.parametrize("size", [2, 3, 6])
def test_the_valid_moves_are_all_there_are(kind, size):
    shape = some_shapes(np.random.default_rng(size), 1, size, kind)[0] + np.int8(20)
    moves = np.arange(MOVES_OF[size])
    moved, valid = move_cubes(np.stack([shape] * len(moves)), moves, kind)
    found = {frozenset(map(tuple, cubes.tolist())) for cubes in moved[valid]}
    assert found == sets_one_move_away(shape, kind)
    assert ((moved != shape).any(axis=2).sum(axis=1) == 1)[valid].all()


def test_moves_keep_within_the_radius():
    shape = some_shapes(np.random.default_rng(0), 1, 7, "tree")
    radius, moves = float(bounding_radius(shape)[0]), np.arange(MOVES_OF[7])
    every = move_cubes(shape.repeat(len(moves), axis=0), moves, "tree")
    moved, valid = move_cubes(shape.repeat(len(moves), axis=0), moves, "tree", radius)
    assert bounding_radius(moved[valid]).max() <= radius
    assert 0 < valid.sum() < every[1].sum()


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
