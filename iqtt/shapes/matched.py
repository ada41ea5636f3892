"""Shapes that outlines hardly tell apart: alike in bounding box, surface and moments.

An outline shows how long a shape is in each direction, how its cubes are spread about the middle,
and how much surface it has. So shapes are matched in just that: in the sorted edges of the
bounding box and the number of faces where two cubes touch (n cubes with c contacts have a surface
of 6 n - 2 c), which must be equal, and in moments of inertia and of higher order. Inertia alone is
not enough: outlines show lopsided shapes (third order) and stretched ones (fourth order).
What is left is how the cubes follow one another, which takes more than an outline.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from iqtt.shapes.polycube import Cubes

TOLERANCE = 0.05  # cube edges, between the `moments` of two matched shapes
PARTNERS = 4  # most partners of a shape
_APART = 100.0  # cube edges between groups that must not be matched: larger than any moment


def moments(cubes: Cubes) -> NDArray[np.float64]:
    """Return lengths that no rotation or mirror changes, (S, 7), cube edges.

    They are the three principal radii of gyration of the solid cubes, rising; half the cube roots
    of the norm of the third moments of their centres and of its trace, which tell how lopsided a
    shape is; and the fourth roots of the mean fourth power of the distance from the centroid and of
    the norm of the fourth moments. They are rounded to 1e-6, so that every machine finds the same
    matches.
    """
    x = cubes - cubes.mean(axis=1, keepdims=True)
    count = cubes.shape[1]
    pairs = x[..., :, None] * x[..., None, :]
    second = pairs.sum(axis=1) / count + np.eye(3) / 12
    pairs = pairs.reshape(len(cubes), count, 9)
    third = np.swapaxes(pairs, 1, 2) @ x / count
    fourth = np.swapaxes(pairs, 1, 2) @ pairs / count
    trace = third.reshape(-1, 3, 3, 3).trace(axis1=1, axis2=2)
    lengths = (
        np.sqrt(np.linalg.eigvalsh(second)),
        np.cbrt(np.linalg.norm(third, axis=(1, 2)))[:, None] / 2,
        np.cbrt(np.linalg.norm(trace, axis=1))[:, None] / 2,
        ((x**2).sum(axis=2) ** 2).mean(axis=1)[:, None] ** (1 / 4),
        np.linalg.norm(fourth, axis=(1, 2))[:, None] ** (1 / 4),
    )
    return np.concatenate(lengths, axis=1).round(6)


def contacts(cubes: Cubes) -> NDArray[np.intp]:
    """Return how many pairs of cubes of each shape share a face, (S,)."""
    count = np.zeros(len(cubes), np.intp)
    for i in range(1, cubes.shape[1]):
        apart = np.abs(cubes[:, :i].astype(np.int32) - cubes[:, i : i + 1]).sum(axis=2)
        count += np.count_nonzero(apart == 1, axis=1)
    return count


def matched_rows(cubes: Cubes) -> NDArray[np.intp]:
    """Return for each shape that has two or more partners itself and these, (M, 1 + PARTNERS).

    Partners are the nearest matched shapes, the nearest first; -1 fills the end of a row.

    Args:
        cubes: (S, n, 3), one shape of each class.
    """
    if len(cubes) < 3:
        return np.zeros((0, 1 + PARTNERS), np.intp)
    edges = np.sort(cubes.max(axis=1) - cubes.min(axis=1), axis=1)
    exact = np.column_stack([edges, contacts(cubes)])
    _, group = np.unique(exact, axis=0, return_inverse=True)
    places = np.column_stack([moments(cubes), _APART * group.reshape(-1)])
    neighbours = cKDTree(places).query(places, 1 + PARTNERS, distance_upper_bound=TOLERANCE)
    far, rows = map(np.asarray, neighbours)
    # A shape with a twin of equal moments may come second in its own row: it is put first.
    far[rows == np.arange(len(cubes))[:, None]] = -1
    order = np.lexsort((rows, far.round(6)), axis=1)
    rows = np.take_along_axis(np.where(np.isinf(far), -1, rows), order, axis=1)
    return np.asarray(rows[rows[:, 2] >= 0])
