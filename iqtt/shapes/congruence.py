"""Are two sets of cubes the same shape? Asked again, in a way of its own, to check the generator.

Nothing here is shared with `polycube.py`: the rotations come from Euler angles instead of signed
permutations, and two shapes are matched cube by cube under each of them instead of through a
canonical form. The question is that of Shepard & Metzler (1971): congruent by a rotation and a
translation; a mirror image is another shape unless a rotation gives it too.
"""

import itertools
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

_Integers: TypeAlias = NDArray[np.integer[Any]]

_CHUNK = 4096  # rows at a time: memory stays flat however many are asked about
_FARTHEST = 1000  # far beyond any polycube, and keeps every difference and square small


def are_congruent(cubes_a: _Integers, cubes_b: _Integers) -> bool:
    """Whether a rotation and a translation take one shape, (n, 3), to the other, (m, 3).

    :raises ValueError: as `congruent_rows`.
    """
    if len(cubes_a) != len(cubes_b):
        return False
    return bool(congruent_rows(cubes_a[None], cubes_b[None])[0])


def congruent_rows(cubes_a: _Integers, cubes_b: _Integers) -> NDArray[np.bool_]:
    """Whether shape i of one array is congruent to shape i of the other, for every i.

    :param cubes_a: (Q, n, 3) integers, in any place, orientation and row order.
    :param cubes_b: integers of the same shape.
    :return: (Q,) bool.
    :raises ValueError: the arrays are not integers of one shape (Q, n, 3) with n >= 1, a
        coordinate is beyond +-1000, or a shape names a cube twice.
    """
    if cubes_a.shape != cubes_b.shape:
        raise ValueError(f"cannot pair shapes of {cubes_a.shape} with {cubes_b.shape}")
    verdict = np.zeros(len(cubes_a), dtype=np.bool_)
    for start in range(0, len(cubes_a), _CHUNK):
        part = slice(start, start + _CHUNK)
        a, b = _at_origin(cubes_a[part], start), _at_origin(cubes_b[part], start)
        # A cheap test that congruent shapes always pass, though mirror images do too.
        alike = np.flatnonzero((_distances(a, start) == _distances(b, start)).all(axis=1))
        verdict[start + alike] = _some_turn_fits(a[alike], b[alike])
    return verdict


def _at_origin(cubes: _Integers, start: int) -> NDArray[np.int32]:
    """The shapes with their lowest corners at the origin; ``start`` is their first row's number."""
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
    """Squared distances between the cubes of each shape, sorted, (Q, n (n - 1) / 2)."""
    i, j = np.triu_indices(cubes.shape[1], k=1)
    squared = ((cubes[:, i] - cubes[:, j]) ** 2).sum(axis=2, dtype=np.int32)
    repeated = (squared == 0).any(axis=1)
    if repeated.any():
        raise ValueError(f"shape {start + int(repeated.argmax())} names a cube twice")
    return np.sort(squared, axis=1)


def _some_turn_fits(a: NDArray[np.int32], b: NDArray[np.int32]) -> NDArray[np.bool_]:
    """Whether one of the 24 turns lays the cubes of ``a`` on those of ``b``, (Q,)."""
    fits = np.zeros(len(a), dtype=np.bool_)
    for turn in _quarter_turns():
        turned = a @ turn
        turned -= turned.min(axis=1, keepdims=True)
        same_box = (turned.max(axis=1) == b.max(axis=1)).all(axis=1)
        rows = np.flatnonzero(same_box & ~fits)
        # Each cube of one lies on a cube of the other; as none repeats, that makes the sets equal.
        meets = (turned[rows, :, None] == b[rows, None, :]).all(axis=3)
        fits[rows] = meets.any(axis=2).all(axis=1)
    return fits


def _quarter_turns() -> NDArray[np.int32]:
    """The 24 rotations that Euler angles of whole right angles reach, (24, 3, 3)."""
    about_x = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])
    about_z = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    power = np.linalg.matrix_power
    reached = [
        power(about_z, i) @ power(about_x, j) @ power(about_z, k)
        for i, j, k in itertools.product(range(4), repeat=3)
    ]
    return np.unique(np.array(reached, dtype=np.int32), axis=0)
