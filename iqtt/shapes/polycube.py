"""Polycubes on the integer grid: the rotations of the cube, canonical form, chirality, size.

A shape is an array of cubes, (n, 3) integers: cube c fills [c, c + 1] along each axis. The
functions here take many shapes of one number of cubes at once, (S, n, 3), and count in integers,
so their results are exact and the same on every machine.

Shepard & Metzler, "Mental rotation of three-dimensional objects", Science 171 (1971), drew their
objects as chains of such cubes and paired each with a rotated or a mirrored copy of itself. Two
shapes are the same here if one of the 24 rotations and a translation take one to the other; they
are of the same class if a mirror is allowed as well.
"""

import itertools
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

MAX_CUBES = 16
"""Most cubes a shape may have: a coordinate of a connected shape then fits in four bits."""

Cubes: TypeAlias = NDArray[np.signedinteger[Any]]
"""Cube coordinates, (S, n, 3) unless said otherwise, any signed integer type."""

_CHUNK = 1024  # shapes at a time: the working arrays stay in cache, and memory stays flat
_NO_CUBE = 0xFFFF  # above every packed cube, so it also fills the end of an id


def _signed_permutations(determinant: int) -> NDArray[np.int8]:
    """Return the 24 matrices of this determinant with one +-1 in each row and column.

    The identity comes first.
    """
    matrices = [
        np.array(signs)[:, None] * np.eye(3, dtype=int)[list(axes)]
        for axes in itertools.permutations(range(3))
        for signs in itertools.product((1, -1), repeat=3)
    ]
    kept = [matrix for matrix in matrices if round(np.linalg.det(matrix)) == determinant]
    group = np.array(kept, dtype=np.int8)
    group.flags.writeable = False
    return group


ROTATIONS = _signed_permutations(1)
"""The 24 rotations of the cube, (24, 3, 3) int8, identity first: `rotated = cubes @ R.T`."""

_REFLECTIONS = _signed_permutations(-1)


def mirror(cubes: Cubes) -> Cubes:
    """Return the mirror image of each shape, (..., n, 3), reflected along x within its own box.

    Mirroring twice gives the same array back. The row order of the cubes is kept.
    """
    x = cubes[..., 0]
    low, high = x.min(axis=-1, keepdims=True), x.max(axis=-1, keepdims=True)
    mirrored = cubes.copy()
    mirrored[..., 0] = low + (high - x)
    return mirrored


def canonical(cubes: Cubes) -> NDArray[np.int8]:
    """Return one form for all translated, rotated and re-ordered copies of each shape.

    Of the orientations whose box is longest along x and shortest along z, it is the one whose
    sorted list of cubes comes first. The mirror images of a chiral shape have different forms.

    Args:
        cubes: (S, n, 3); the cubes of a shape differ from each other.

    Returns (S, n, 3) int8, cubes sorted, smallest coordinate 0 along each axis.

    Raises ValueError where the array is not (S, n, 3) signed integers, has more than MAX_CUBES
    cubes, or a shape spans more than MAX_CUBES along an axis (it is then not connected).
    """
    return _unpacked(_least_keys(cubes, ROTATIONS))


def canonical_class(cubes: Cubes) -> NDArray[np.int8]:
    """Return one form for all copies of each shape, mirrored ones too; as `canonical` otherwise."""
    group = np.concatenate([ROTATIONS, _REFLECTIONS])
    return _unpacked(_least_keys(cubes, group))


def set_ids(cubes: Cubes) -> NDArray[np.void]:
    """Return an id of each set of cubes, the same whatever its place and row order.

    The id is the sorted cubes themselves (no hash, so no collisions), two bytes a cube, high byte
    first, filled up to MAX_CUBES; so ids of shapes with different numbers of cubes can be mixed,
    sorted and compared. Use canonical forms: `set_ids(canonical(cubes))` names the shapes and
    `set_ids(canonical_class(cubes))` the classes.

    Returns (S,) void of 32 bytes; `ids.view(np.uint8).reshape(-1, 32)` shows the bytes.

    Raises ValueError as `canonical`.
    """
    low, extent = _boxed(cubes)
    keys = _oriented_keys(low, extent, ROTATIONS[0])
    padded = np.full((len(keys), MAX_CUBES), _NO_CUBE, dtype=">u2")
    padded[:, : keys.shape[1]] = keys
    return padded.view(f"V{2 * MAX_CUBES}")[:, 0]


def is_chiral(cubes: Cubes) -> NDArray[np.bool_]:
    """Return whether no rotation takes a shape's mirror image back to it, (S,) bool.

    Raises ValueError as `canonical`.
    """
    turned, mirrored = _least_keys(cubes, ROTATIONS), _least_keys(cubes, _REFLECTIONS)
    return np.asarray((turned != mirrored).any(axis=1))


def symmetries(cubes: Cubes) -> NDArray[np.bool_]:
    """Return which of `ROTATIONS` take each shape to a translation of itself, (S, 24) bool.

    Raises ValueError as `canonical`.
    """
    low, extent = _boxed(cubes)
    keys = [_oriented_keys(low, extent, rotation) for rotation in ROTATIONS]
    return np.stack([(keys[0] == turned).all(axis=1) for turned in keys], axis=1)


def box_centre(cubes: Cubes) -> NDArray[np.float64]:
    """Return the centre of each shape's bounding box, (S, 3) float64, in cube edges."""
    wide = cubes.astype(np.int64)
    return np.asarray((wide.min(axis=1) + wide.max(axis=1) + 1) / 2)


def bounding_radius(cubes: Cubes) -> NDArray[np.float64]:
    """Return the distance from `box_centre` to the farthest corner, (S,) float64, in cube edges.

    A shape that turns about its box centre stays within a sphere of this radius, so a limit on it
    sets the one camera distance that frames every shape of a split. The centroid would be a worse
    centre: its sphere is larger for four chains in five, so cubes would be drawn smaller. And the
    square of this radius is a quarter of an integer, so rounding never decides a comparison.
    """
    wide = cubes.astype(np.int64)
    low, high = wide.min(axis=1, keepdims=True), wide.max(axis=1, keepdims=True)
    twice_offset = np.abs(2 * wide - low - high) + 1
    return np.asarray(np.sqrt((twice_offset**2).sum(axis=2).max(axis=1)) / 2)


def _boxed(cubes: Cubes) -> tuple[NDArray[np.uint16], NDArray[np.uint16]]:
    """Return each shape moved to the origin, (3, S, n), and its largest coordinates, (3, S)."""
    if cubes.ndim != 3 or cubes.shape[2] != 3 or not np.issubdtype(cubes.dtype, np.signedinteger):
        found = f"{cubes.dtype} {cubes.shape}"
        raise ValueError(f"cubes must be signed integers of shape (S, n, 3), not {found}")
    if not 1 <= cubes.shape[1] <= MAX_CUBES:
        raise ValueError(f"a shape has 1 to {MAX_CUBES} cubes, not {cubes.shape[1]}")
    wide = cubes.transpose(2, 0, 1).astype(np.int64)
    # Unsigned, a difference too big for int64 stays big instead of wrapping below zero.
    low = (wide - wide.min(axis=2, keepdims=True)).view(np.uint64)
    extent = low.max(axis=2)
    if (extent >= MAX_CUBES).any():
        row = int(np.flatnonzero((extent >= MAX_CUBES).any(axis=0))[0])
        raise ValueError(f"shape {row} spans more than {MAX_CUBES} cubes: it is not connected")
    return low.astype(np.uint16), extent.astype(np.uint16)


def _oriented_keys(
    low: NDArray[np.uint16], extent: NDArray[np.uint16], matrix: NDArray[np.int8]
) -> NDArray[np.uint16]:
    """Return the cubes after a signed permutation, each packed into 12 bits, sorted: (S, n)."""
    keys = np.zeros(low.shape[1:], dtype=np.uint16)
    for row in matrix:
        axis = int(np.flatnonzero(row)[0])
        along = low[axis] if row[axis] > 0 else extent[axis, :, None] - low[axis]
        keys = (keys << 4) | along
    keys.sort(axis=1)
    return keys


def _least_keys(cubes: Cubes, matrices: NDArray[np.int8]) -> NDArray[np.uint16]:
    """Return the first of the key lists of each shape under these matrices, (S, n)."""
    low, extent = _boxed(cubes)
    best = np.empty((low.shape[1], low.shape[2]), dtype=np.uint16)
    axes, flipped = np.abs(matrices).argmax(axis=2), matrices.sum(axis=2) < 0
    for start in range(0, len(best), _CHUNK):
        part = slice(start, start + _CHUNK)
        box = extent[:, part][axes]
        # Only orientations with a descending box compete: for most a sixth of the sorting.
        shape, matrix = np.nonzero(((box[:, 0] >= box[:, 1]) & (box[:, 1] >= box[:, 2])).T)
        keys = np.zeros((len(shape), best.shape[1]), dtype=np.uint16)
        for k in range(3):
            axis = axes[matrix, k]
            along = low[axis, start + shape]
            back = flipped[matrix, k]
            along[back] = extent[axis[back], start + shape[back], None] - along[back]
            keys = (keys << 4) | along
        keys.sort(axis=1)
        best[part] = keys[_first_of_each(keys, shape)]
    return best


def _first_of_each(keys: NDArray[np.uint16], group: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return the row of `keys`, lists of 12-bit numbers, that comes first in each group.

    Args:
        group: the group of each row, 0 to G - 1, rising; none is empty.
    """
    starts = np.searchsorted(group, np.arange(group[-1] + 1))
    leads = np.ones(len(keys), np.bool_)
    for column in range(0, keys.shape[1], 5):  # five numbers fit in a word
        word = np.zeros(len(keys), np.uint64)
        for part in keys[:, column : column + 5].T:
            word = (word << np.uint64(12)) | part
        word[~leads] = ~np.uint64(0)
        leads &= word == np.minimum.reduceat(word, starts)[group]
    leading = np.flatnonzero(leads)
    return np.asarray(leading[np.searchsorted(leading, starts)])


def _unpacked(keys: NDArray[np.uint16]) -> NDArray[np.int8]:
    """Return the cubes of packed keys, (S, n) to (S, n, 3)."""
    return np.stack([keys >> 8, (keys >> 4) & 15, keys & 15], axis=2).astype(np.int8)
