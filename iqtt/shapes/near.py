"""Shapes with one cube moved, and the tests that a moved shape must pass: connected, a chain.

A move is one integer: which cube leaves, which of the others it joins, and on which face. So each
question's own generator draws its moves, and `move_cubes` makes the moves of many questions at
once without any of them depending on another.
"""

import numpy as np
from numpy.typing import NDArray

from iqtt.shapes.chains_and_trees import STEPS, Kind, check_request
from iqtt.shapes.polycube import MAX_CUBES, Cubes, bounding_radius

_CHUNK = 8192  # shapes at a time: bounds the memory of comparing every cube with every other


def is_connected(cubes: Cubes) -> NDArray[np.bool_]:
    """Return whether each shape is connected by whole faces, (S,) bool.

    Args:
        cubes: (S, n, 3); the cubes of a shape differ from each other.
    """
    parts = [_reaches_all(_touching(part)) for part in _parts(cubes)]
    return np.concatenate([np.zeros(0, dtype=np.bool_), *parts])


def is_chain(cubes: Cubes) -> NDArray[np.bool_]:
    """Return whether some order of each shape's cubes makes it a self-avoiding walk, (S,) bool.

    The answer is exact: all walks through the cubes are followed at once (a chain is a shape with
    a Hamiltonian path). Rows may come in any order; a disconnected shape is no chain.

    Args:
        cubes: (S, n, 3); the cubes of a shape differ from each other.

    Raises ValueError for more than MAX_CUBES cubes.
    """
    if cubes.shape[1] > MAX_CUBES:
        raise ValueError(f"a shape has 1 to {MAX_CUBES} cubes, not {cubes.shape[1]}")
    parts = [_walkable(_touching(part)) for part in _parts(cubes)]
    return np.concatenate([np.zeros(0, dtype=np.bool_), *parts])


def move_cubes(
    cubes: Cubes, moves: NDArray[np.integer], kind: Kind = "chain", max_radius: float = np.inf
) -> tuple[Cubes, NDArray[np.bool_]]:
    """Move one cube of each shape to a face of another of its cubes.

    A move is valid where the cube comes to a free cell other than its own, the shape is then a
    chain (kind "chain") or connected (kind "tree"), and it keeps within the radius. The moved shape
    may still be congruent to the old one: compare ids.

    Args:
        cubes: (S, n, 3), n >= 2.
        moves: (S,) integers, each from 0 to 6 n (n - 1) - 1.

    Returns the moved shapes, (S, n, 3), in the frame of the old ones, the moved cube in its old row
    (so rows are no longer in walking order); and which are valid, (S,) bool.

    Raises ValueError for a move out of range, and as `is_chain` and `check_request`.
    """
    size = cubes.shape[1]
    check_request(size, kind)
    rows = np.arange(len(cubes))
    leaving, joined, face = np.unravel_index(moves, (size, size - 1, 6))
    joined = joined + (joined >= leaving)  # a cube cannot join itself
    cell = cubes[rows, joined] + STEPS[face]
    free = ~(cubes == cell[:, None]).all(axis=2).any(axis=1)
    moved = cubes.copy()
    moved[rows, leaving] = cell
    valid = free & (bounding_radius(moved) <= max_radius)
    # The most expensive test comes last, and only where it can still matter.
    valid[valid] = is_chain(moved[valid]) if kind == "chain" else is_connected(moved[valid])
    return moved, valid


def _parts(cubes: Cubes) -> list[Cubes]:
    return [cubes[start : start + _CHUNK] for start in range(0, len(cubes), _CHUNK)]


def _touching(cubes: Cubes) -> NDArray[np.bool_]:
    """Return which cubes of each shape share a face, (S, n, n) bool."""
    x, y, z = np.moveaxis(cubes.astype(np.int32), 2, 0)
    apart = abs(x[:, :, None] - x[:, None])
    apart += abs(y[:, :, None] - y[:, None])
    apart += abs(z[:, :, None] - z[:, None])
    return np.asarray(apart == 1)


def _reaches_all(touching: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return whether every cube can be reached from the first, (S,)."""
    reached = np.zeros(touching.shape[:2], dtype=np.bool_)
    reached[:, 0] = True
    for _ in range(1, touching.shape[1]):
        reached |= (touching & reached[:, None]).any(axis=2)
    return np.asarray(reached.all(axis=1))


def _walkable(touching: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return whether a path along touching cubes visits each of them once, (S,)."""
    count, size = touching.shape[:2]
    bits = 1 << np.arange(size)
    neighbours = touching @ bits  # (S, n) sets of cubes as bits of an integer
    leaf = touching.sum(axis=2) == 1
    # A cube with one neighbour is an end of any path, so walks may begin there alone.
    start = np.where(leaf.any(axis=1, keepdims=True), leaf & (leaf.cumsum(axis=1) == 1), True)
    start &= leaf.sum(axis=1, keepdims=True) <= 2
    shape, here = np.nonzero(start)
    been = bits[here]
    for _ in range(1, size):
        ahead = neighbours[shape, here] & ~been
        row, there = np.nonzero(ahead[:, None] & bits)
        # Walks that came to the same cube through the same cubes continue alike: keep one.
        walk = ((shape[row] * size + there) << size) | been[row] | bits[there]
        shape_here, been = np.divmod(np.unique(walk), 1 << size)
        shape, here = np.divmod(shape_here, size)
    walkable = np.zeros(count, dtype=np.bool_)
    walkable[shape] = True
    return walkable
