"""Tests of connectedness, of chains, and of shapes one moved cube away."""

import itertools

import numpy as np
import pytest
from polycubes import some_shapes

from iqtt.shapes.chains_and_trees import all_classes
from iqtt.shapes.near import is_chain, is_connected, move_cubes
from iqtt.shapes.polycube import bounding_radius

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


def test_many_shapes_are_judged_as_each_alone():
    trees = some_shapes(np.random.default_rng(0), 9000, 6, "tree")  # more than one chunk
    for judge in (is_chain, is_connected):
        assert (judge(trees)[-900:] == judge(trees[-900:])).all()
        assert judge(trees[:0]).shape == (0,)


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


def test_a_move_is_made_the_same_alone_and_among_others():
    rng = np.random.default_rng(0)
    chains = some_shapes(rng, 40, 8)
    moves = rng.integers(MOVES_OF[8], size=40)
    before = chains.copy()
    moved, valid = move_cubes(chains, moves)
    assert (chains == before).all()
    for i in range(40):
        alone, alone_valid = move_cubes(chains[i : i + 1], moves[i : i + 1])
        assert (alone[0] == moved[i]).all()
        assert alone_valid[0] == valid[i]


def test_moves_keep_within_the_radius():
    shape = some_shapes(np.random.default_rng(0), 1, 7, "tree")
    radius, moves = float(bounding_radius(shape)[0]), np.arange(MOVES_OF[7])
    every = move_cubes(shape.repeat(len(moves), axis=0), moves, "tree")
    moved, valid = move_cubes(shape.repeat(len(moves), axis=0), moves, "tree", radius)
    assert bounding_radius(moved[valid]).max() <= radius
    assert 0 < valid.sum() < every[1].sum()


@pytest.mark.parametrize("move", [-1, 6 * 4 * 3])
def test_a_move_out_of_range_is_refused(move):
    with pytest.raises(ValueError, match="out of bounds"):
        move_cubes(np.array([ROD]), np.array([move]))


def test_too_many_cubes_are_refused():
    with pytest.raises(ValueError, match="16 cubes"):
        is_chain(np.zeros((1, 17, 3), np.int8))
