"""Find out which shapes are congruent, with code that is independent of the generator.

Here the rotations are found by a search instead of as signed permutations, and two shapes are
matched cube by cube under each of them instead of by a canonical form. The question is
that of Shepard & Metzler (1971): two shapes are congruent if a rotation and a translation take one
to the other; a mirror image is another shape unless a rotation gives it too.
"""

import functools
import itertools
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
_Integers: TypeAlias = NDArray[np.integer[Any]]

_CHUNK = 4096  # shapes at a time: bounds the memory
_FARTHEST = 1000  # far beyond any polycube, and keeps every difference and square small
MIRROR_X = np.array([-1, 1, 1], np.int8)


def congruent_rows(cubes_a: _Integers, cubes_b: _Integers) -> NDArray[np.bool_]:
    """Return whether shape i of one array is congruent to shape i of the other, (Q,) bool.

    Args:
        cubes_a, cubes_b: (Q, n, 3) integers, in any place, orientation and row order.

    Raises ValueError where the arrays are not integers of one shape (Q, n, 3) with n >= 1, a
    coordinate is beyond +-1000, or a shape names a cube twice.
    """
    if cubes_a.shape != cubes_b.shape:
        raise ValueError(f"cannot pair shapes of {cubes_a.shape} with {cubes_b.shape}")
    verdict = np.zeros(len(cubes_a), dtype=np.bool_)
    for start in range(0, len(cubes_a), _CHUNK):
        part = slice(start, start + _CHUNK)
        a, b = _at_origin(cubes_a[part], start), _at_origin(cubes_b[part], start)
        # A cheap test that congruent shapes always pass; mirror images pass it too.
        alike = np.flatnonzero((_distances(a, start) == _distances(b, start)).all(axis=1))
        verdict[start + alike] = _some_turn_fits(a[alike], b[alike])
    return verdict


def _at_origin(cubes: _Integers, start: int) -> NDArray[np.int32]:
    """Return the shapes with their lowest corners at the origin; `start` numbers the first row."""
    if cubes.ndim != 3 or cubes.shape[1] < 1 or cubes.shape[2] != 3 or cubes.dtype.kind not in "iu":
        found = f"{cubes.dtype} {cubes.shape}"
        raise ValueError(f"cubes must be integers of shape (Q, n, 3), n >= 1, not {found}")
    far = ((cubes > _FARTHEST) | (cubes < -_FARTHEST)).any(axis=(1, 2))
    if far.any():
        row = start + int(far.argmax())
        raise ValueError(f"shape {row} has a coordinate beyond +-{_FARTHEST}")
    near = cubes.astype(np.int32)
    near -= near.min(axis=1, keepdims=True)
    return near


def _distances(cubes: NDArray[np.int32], start: int) -> NDArray[np.int32]:
    """Return the squared distances between each shape's cubes, sorted, (Q, n (n - 1) / 2)."""
    i, j = np.triu_indices(cubes.shape[1], k=1)
    squared = ((cubes[:, i] - cubes[:, j]) ** 2).sum(axis=2, dtype=np.int32)
    repeated = (squared == 0).any(axis=1)
    if repeated.any():
        raise ValueError(f"shape {start + int(repeated.argmax())} names a cube twice")
    return np.sort(squared, axis=1)


def _some_turn_fits(a: NDArray[np.int32], b: NDArray[np.int32]) -> NDArray[np.bool_]:
    """Return whether one of the 24 rotations lays the cubes of a on those of b, (Q,)."""
    fits = np.zeros(len(a), dtype=np.bool_)
    for turn in cube_rotations():
        turned = a @ turn
        turned -= turned.min(axis=1, keepdims=True)
        same_box = (turned.max(axis=1) == b.max(axis=1)).all(axis=1)
        rows = np.flatnonzero(same_box & ~fits)
        # If each cube of a lies on a cube of b, the sets are equal, as no cube repeats.
        meets = (turned[rows, :, None] == b[rows, None, :]).all(axis=3)
        fits[rows] = meets.any(axis=2).all(axis=1)
    return fits


@functools.cache
def cube_rotations() -> NDArray[np.int32]:
    """Return the 24 rotations of the cube, (24, 3, 3), found as all proper integer rotations."""
    numbers = np.array(list(itertools.product((-1, 0, 1), repeat=9)), np.int32).reshape(-1, 3, 3)
    unit = (numbers @ numbers.swapaxes(1, 2) == np.eye(3)).all(axis=(1, 2))
    proper = np.cross(numbers[:, 0], numbers[:, 1]) == numbers[:, 2]
    return np.asarray(numbers[unit & proper.all(axis=1)])


def cube_codes(cubes: Array) -> NDArray[np.int64]:
    """Return a sorted list of numbers for each shape, (S, n), equal for translated copies.

    Args:
        cubes: (S, n, 3) integers; shapes span less than 1000 cubes.
    """
    low = (cubes - cubes.min(axis=1, keepdims=True)).astype(np.int64)
    return np.sort(low @ np.array([1_000_000, 1_000, 1]), axis=1)


def row_keys(rows: Array) -> NDArray[np.void]:
    """Return each row of an (N, K) array as one value, (N,), equal for equal rows."""
    return np.ascontiguousarray(rows).view(f"V{rows.shape[1] * rows.itemsize}").reshape(-1)


def name_shapes(cubes: Array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return two numbers for each shape, (S,) each.

    The first is equal for congruent shapes, the second for congruent shapes and mirror images.
    Shapes are first told apart by a number that no rotation or mirror changes, then compared one
    by one.

    Args:
        cubes: (S, n, 3) int8; the cubes of a shape differ from each other.

    Raises ValueError as `congruent_rows`.
    """
    keys = row_keys(cube_codes(cubes))
    _, first, copy = np.unique(keys, return_index=True, return_inverse=True)
    distinct = cubes[first]
    invariant = shape_invariants(distinct)
    leader = np.full(len(distinct), -1)
    is_mirror = np.zeros(len(distinct), np.bool_)
    while (rest := np.flatnonzero(leader < 0)).size:
        # The first shape of each invariant leads. Others with its invariant wait for the next round
        # unless they are congruent to it or to its mirror image.
        _, lead, group = np.unique(invariant[rest], return_index=True, return_inverse=True)
        leads = rest[lead[group]]
        same = rest == leads
        same[~same] = congruent_rows(distinct[rest[~same]], distinct[leads[~same]])
        mirrored = np.zeros(len(rest), np.bool_)
        others = np.flatnonzero(~same)
        mirrored[others] = congruent_rows(
            distinct[rest[others]] * MIRROR_X, distinct[leads[others]]
        )
        joined = same | mirrored
        leader[rest[joined]] = leads[joined]
        is_mirror[rest[joined]] = mirrored[joined]
    return (2 * leader + is_mirror)[copy], leader[copy]


def shape_invariants(cubes: Array) -> NDArray[np.uint64]:
    """Return a number for each shape that rotating, mirroring, moving and re-ordering keep, (S,).

    It mixes, for each cube, its distances to the others, and then the numbers of all cubes.
    """
    parts = [np.zeros(0, np.uint64)]
    for start in range(0, len(cubes), _CHUNK):
        wide = cubes[start : start + _CHUNK].astype(np.int64)
        squared = ((wide[:, :, None] - wide[:, None]) ** 2).sum(axis=3)
        parts.append(_mix(_mix(squared).sum(axis=2)).sum(axis=1))
    return np.concatenate(parts)


def _mix(numbers: Array) -> NDArray[np.uint64]:
    """Return well-scattered 64-bit numbers, one for each (the last steps of SplitMix64)."""
    z = numbers.astype(np.uint64) + np.uint64(0x9E3779B97F4A7C15)
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return z ^ (z >> np.uint64(31))
