"""Tests of connectedness, of chains, and of shapes one moved cube away."""

import itertools

import numpy as np
import pytest

from iqtt.shapes.congruence import are_congruent
from iqtt.shapes.near import is_chain, is_connected, move_count, move_cubes, near_shapes
from iqtt.shapes.polycube import Cubes, bounding_radius
from iqtt.shapes.sampling import Kind, all_classes, random_shapes

ROD = [[0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]]
TEE = [[0, 0, 0], [1, 0, 0], [2, 0, 0], [1, 1, 0]]
RING = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
EDGE_ON = [[0, 0, 0], [1, 0, 0], [2, 1, 0], [3, 1, 0]]
TORN = [[0, 0, 0], [1, 0, 0], [5, 0, 0], [6, 0, 0]]


def test_connected_shapes_and_chains_are_known() -> None:
    cubes = np.array([ROD, TEE, RING, EDGE_ON, TORN])
    assert is_connected(cubes).tolist() == [True, True, True, False, False]
    assert is_chain(cubes).tolist() == [True, False, True, False, False]


@pytest.mark.parametrize("cubes", range(1, 9))
def test_the_trees_that_are_chains_are_all_the_chains(cubes: int) -> None:
    trees = all_classes(cubes, "tree")
    assert is_connected(trees).all()
    assert (trees[is_chain(trees)] == all_classes(cubes, "chain")).all()


def test_a_compact_block_is_a_chain_in_any_row_order() -> None:
    block = np.array(list(itertools.product(range(2), range(2), range(4))), dtype=np.int8)
    orders = [np.random.default_rng(seed).permutation(16) for seed in range(3)]
    assert is_chain(np.stack([block[order] for order in orders])).all()


def test_many_shapes_are_judged_as_each_alone() -> None:
    trees = random_shapes(np.random.default_rng(0), 9000, 6, "tree")  # more than one chunk
    for judge in (is_chain, is_connected):
        assert (judge(trees)[-900:] == judge(trees[-900:])).all()
        assert judge(trees[:0]).shape == (0,)


def test_too_many_cubes_are_refused() -> None:
    with pytest.raises(ValueError, match="1 to 16 cubes, not 17"):
        is_chain(np.zeros((1, 17, 3), np.int8))


def sets_one_move_away(cubes: Cubes, kind: Kind) -> set[frozenset[tuple[int, ...]]]:
    """All valid sets of cubes that share all but one with these, found the slow way."""
    own = {tuple(cube) for cube in cubes.tolist()}
    low, high = cubes.min(axis=0) - 1, cubes.max(axis=0) + 2
    cells = itertools.product(*(range(a, b) for a, b in zip(low, high, strict=True)))
    candidates = [frozenset(own - {old} | {new}) for new in cells if new not in own for old in own]
    valid = is_chain if kind == "chain" else is_connected
    return {c for c in candidates if valid(np.array([sorted(c)]))[0]}


@pytest.mark.parametrize("kind", ["chain", "tree"])
@pytest.mark.parametrize("size", [2, 3, 6])
def test_the_valid_moves_are_all_there_are(kind: Kind, size: int) -> None:
    shape = random_shapes(np.random.default_rng(size), 1, size, kind)[0] + np.int8(20)
    moves = np.arange(move_count(size))
    moved, valid = move_cubes(np.stack([shape] * len(moves)), moves, kind)
    found = {frozenset(map(tuple, cubes.tolist())) for cubes in moved[valid]}
    assert found == sets_one_move_away(shape, kind)
    assert ((moved != shape).any(axis=2).sum(axis=1) == 1)[valid].all()


def test_a_move_is_made_the_same_alone_and_among_others() -> None:
    rng = np.random.default_rng(0)
    chains = random_shapes(rng, 40, 8)
    moves = rng.integers(move_count(8), size=40)
    before = chains.copy()
    moved, valid = move_cubes(chains, moves)
    assert (chains == before).all()
    for i in range(40):
        alone, alone_valid = move_cubes(chains[i : i + 1], moves[i : i + 1])
        assert (alone[0] == moved[i]).all()
        assert alone_valid[0] == valid[i]


def test_moves_keep_within_the_radius() -> None:
    shape = random_shapes(np.random.default_rng(0), 1, 7, "tree")[0]
    radius = float(bounding_radius(shape[None])[0])
    within = near_shapes(shape, "tree", radius)
    assert bounding_radius(within).max() <= radius
    assert 0 < len(within) < len(near_shapes(shape, "tree"))


@pytest.mark.parametrize("move", [-1, 6 * 4 * 3])
def test_a_move_out_of_range_is_refused(move: int) -> None:
    with pytest.raises(ValueError, match="out of bounds"):
        move_cubes(np.array([ROD]), np.array([move]))


def test_an_unknown_kind_is_refused() -> None:
    with pytest.raises(ValueError, match="kind is"):
        near_shapes(np.array(ROD), "ring")  # type: ignore[arg-type]


@pytest.mark.parametrize("kind", ["chain", "tree"])
@pytest.mark.parametrize("size", [4, 5])
def test_near_shapes_are_each_one_cube_away_once_and_none_is_the_shape(
    kind: Kind, size: int
) -> None:
    shape = random_shapes(np.random.default_rng(size), 1, size, kind)[0]
    near = near_shapes(shape, kind)
    own = {tuple(cube) for cube in shape.tolist()}
    for cubes in near:
        assert len(own & {tuple(cube) for cube in cubes.tolist()}) == size - 1
    family = [shape, *near]
    assert not any(are_congruent(a, b) for a, b in itertools.combinations(family, 2))
    for cells in sets_one_move_away(shape, kind):
        assert any(are_congruent(np.array(sorted(cells)), member) for member in family)


def test_shapes_with_nothing_near_have_none() -> None:
    assert near_shapes(np.zeros((1, 3), dtype=np.int8)).shape == (0, 1, 3)
    assert near_shapes(np.array(ROD[:2], dtype=np.int8)).shape == (0, 2, 3)


def test_both_mirror_images_may_be_near() -> None:
    # A flat L can fold one end up or down: the two hands of the twisted tetracube.
    flat = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [2, 1, 0]], dtype=np.int8)
    spatial = [cubes for cubes in near_shapes(flat) if np.ptp(cubes, axis=0).min() > 0]
    assert len(spatial) == 2
    assert not are_congruent(*spatial)
