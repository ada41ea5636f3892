"""Shapes that differ from another by one moved cube, and what such a move must not break.

A move is one integer: which cube leaves, which of the others it joins, and on which face. So a
caller draws moves from each question's own generator, and `move_cubes` makes the moves of many
questions together without any of them depending on its neighbours.
"""

import numpy as np
from numpy.typing import NDArray

from iqtt.shapes.polycube import MAX_CUBES, Cubes, bounding_radius, canonical, set_ids
from iqtt.shapes.sampling import STEPS, Kind, check_request

_CHUNK = 8192  # shapes at a time: bounds the memory of comparing every cube with every other


def is_connected(cubes: Cubes) -> NDArray[np.bool_]:
    """Whether each shape hangs together by whole faces, (S,) bool.

    :param cubes: (S, n, 3); the cubes of a shape differ from each other.
    """
    parts = [_reaches_all(_touching(part)) for part in _parts(cubes)]
    return np.concatenate([np.zeros(0, dtype=np.bool_), *parts])


def is_chain(cubes: Cubes) -> NDArray[np.bool_]:
    """Whether some order of each shape's cubes makes it a self-avoiding walk, (S,) bool.

    Exact: follows all walks through the cubes at once (a Hamiltonian path, where one exists). The
    rows may come in any order; a disconnected shape is no chain.

    :param cubes: (S, n, 3); the cubes of a shape differ from each other.
    :raises ValueError: there are more than ``MAX_CUBES`` cubes.
    """
    if cubes.shape[1] > MAX_CUBES:
        raise ValueError(f"a shape has 1 to {MAX_CUBES} cubes, not {cubes.shape[1]}")
    parts = [_walkable(_touching(part)) for part in _parts(cubes)]
    return np.concatenate([np.zeros(0, dtype=np.bool_), *parts])


def move_count(cubes: int) -> int:
    """The number of moves of a shape of this many cubes; many come to the same or are invalid."""
    return 6 * cubes * (cubes - 1)


def move_cubes(
    cubes: Cubes, moves: NDArray[np.integer], kind: Kind = "chain", max_radius: float = np.inf
) -> tuple[Cubes, NDArray[np.bool_]]:
    """Take one cube of each shape to a face of another of its cubes.

    A move is valid where the cube comes to a free cell other than its own, and the shape is then
    a chain (``kind="chain"``, checked by `is_chain`) or connected (``"tree"``) and keeps within
    the radius. The moved shape may still be congruent to the old one: compare ids.

    :param cubes: (S, n, 3), n >= 2.
    :param moves: (S,) integers, each from 0 to below ``move_count(n)``.
    :return: the moved shapes, (S, n, 3), in the frame of the old ones and with the moved cube
        in its old row (so rows no longer are in walking order), and which are valid, (S,) bool.
    :raises ValueError: a move is out of range, or as `is_chain` and `check_request`.
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
    # The dearest test last, and only where it can still matter.
    valid[valid] = is_chain(moved[valid]) if kind == "chain" else is_connected(moved[valid])
    return moved, valid


def near_shapes(cubes: Cubes, kind: Kind = "chain", max_radius: float = np.inf) -> Cubes:
    """Every shape that differs from this one by one moved cube, each once, none congruent to it.

    Mirror images of this shape and of each other count as different.

    :param cubes: (n, 3).
    :return: (K, n, 3) as `move_cubes` gives them; K may be 0.
    """
    moves = np.arange(move_count(len(cubes)))
    repeated = np.broadcast_to(cubes, (len(moves), *cubes.shape))
    moved, valid = move_cubes(repeated, moves, kind, max_radius)
    candidates = np.concatenate([cubes[None], moved[valid]])
    _, first = np.unique(set_ids(canonical(candidates)), return_index=True)
    return candidates[np.sort(first)[1:]]  # the first of all is the shape itself


def _parts(cubes: Cubes) -> list[Cubes]:
    return [cubes[start : start + _CHUNK] for start in range(0, len(cubes), _CHUNK)]


def _touching(cubes: Cubes) -> NDArray[np.bool_]:
    """Which cubes of each shape share a face, (S, n, n) bool."""
    x, y, z = np.moveaxis(cubes.astype(np.int32), 2, 0)
    apart = abs(x[:, :, None] - x[:, None])
    apart += abs(y[:, :, None] - y[:, None])
    apart += abs(z[:, :, None] - z[:, None])
    return np.asarray(apart == 1)


def _reaches_all(touching: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Whether every cube can be reached from the first, (S,)."""
    reached = np.zeros(touching.shape[:2], dtype=np.bool_)
    reached[:, 0] = True
    for _ in range(1, touching.shape[1]):
        reached |= (touching & reached[:, None]).any(axis=2)
    return np.asarray(reached.all(axis=1))


def _walkable(touching: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Whether a path along touching cubes visits each of them once, (S,)."""
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
        # Walks that came to the same cube through the same cubes go on alike: keep one.
        walk = ((shape[row] * size + there) << size) | been[row] | bits[there]
        shape_here, been = np.divmod(np.unique(walk), 1 << size)
        shape, here = np.divmod(shape_here, size)
    walkable = np.zeros(count, dtype=np.bool_)
    walkable[shape] = True
    return walkable
