"""Which of many shapes are the same? Names for them, found without the generator's canonical form.

Shapes are first told apart by a number that no rotation or mirror changes, then compared one by
one with `iqtt.shapes.congruence`. Nothing here is shared with `iqtt.shapes.polycube`.
"""

import itertools
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iqtt.shapes.congruence import congruent_rows

Array = NDArray[Any]
_CHUNK = 4096  # shapes at a time: memory stays flat however many are asked about
_MIRROR = np.array([-1, 1, 1], np.int8)


def whole_turns() -> NDArray[np.int64]:
    """Return the 24 rotations of the cube, (24, 3, 3): all proper integer ones, by search."""
    numbers = np.array(list(itertools.product((-1, 0, 1), repeat=9))).reshape(-1, 3, 3)
    unit = (numbers @ numbers.swapaxes(1, 2) == np.eye(3)).all(axis=(1, 2))
    proper = np.cross(numbers[:, 0], numbers[:, 1]) == numbers[:, 2]
    return np.asarray(numbers[unit & proper.all(axis=1)])


def cube_codes(cubes: Array) -> NDArray[np.int64]:
    """Return a sorted list of numbers for each shape, (S, n): equal where a shift joins the shapes.

    Args:
        cubes: (S, n, 3) integers; shapes span less than 1000 cubes.
    """
    low = (cubes - cubes.min(axis=1, keepdims=True)).astype(np.int64)
    return np.sort(low @ np.array([1_000_000, 1_000, 1]), axis=1)


def row_keys(rows: Array) -> NDArray[np.void]:
    """Return each row of an (N, K) array as one value, (N,): fast to sort, equal for equal rows."""
    return np.ascontiguousarray(rows).view(f"V{rows.shape[1] * rows.itemsize}").reshape(-1)


def name_shapes(cubes: Array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return two numbers for each shape: equal for the same shape; equal for it and its mirror.

    Args:
        cubes: (S, n, 3) int8, cubes of a shape all different.

    Raises ValueError as `congruent_rows`.
    """
    keys = row_keys(cube_codes(cubes))
    _, first, copy = np.unique(keys, return_index=True, return_inverse=True)
    distinct = cubes[first]
    invariant = _invariants(distinct)
    leader = np.full(len(distinct), -1)
    is_mirror = np.zeros(len(distinct), np.bool_)
    while (rest := np.flatnonzero(leader < 0)).size:
        # The first of each invariant leads; those with its invariant but not its shape wait.
        _, lead, group = np.unique(invariant[rest], return_index=True, return_inverse=True)
        leads = rest[lead[group]]
        same = rest == leads
        same[~same] = congruent_rows(distinct[rest[~same]], distinct[leads[~same]])
        mirrored = np.zeros(len(rest), np.bool_)
        others = np.flatnonzero(~same)
        mirrored[others] = congruent_rows(distinct[rest[others]] * _MIRROR, distinct[leads[others]])
        found = same | mirrored
        leader[rest[found]] = leads[found]
        is_mirror[rest[found]] = mirrored[found]
    return (2 * leader + is_mirror)[copy], leader[copy]


def _invariants(cubes: Array) -> NDArray[np.uint64]:
    """Return a number for each shape that rotating, mirroring, moving and re-ordering keep, (S,).

    Each cube's distances to the others are mixed into one number, and those into one.
    """
    parts = [np.zeros(0, np.uint64)]
    for start in range(0, len(cubes), _CHUNK):
        wide = cubes[start : start + _CHUNK].astype(np.int64)
        squared = ((wide[:, :, None] - wide[:, None]) ** 2).sum(axis=3)
        parts.append(_mix(_mix(squared).sum(axis=2)).sum(axis=1))
    return np.concatenate(parts)


def _mix(numbers: Array) -> NDArray[np.uint64]:
    """Return well-scattered 64-bit numbers, one for each (the finaliser of SplitMix64)."""
    z = numbers.astype(np.uint64) + np.uint64(0x9E3779B97F4A7C15)
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return z ^ (z >> np.uint64(31))
