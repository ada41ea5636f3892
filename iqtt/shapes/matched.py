"""Shapes that outlines hardly tell apart: alike in bounding box, inertia and surface.

An outline shows how long a shape is in each direction, how its cubes are spread about the middle,
and how much surface it has. So shapes are matched in just that: in the sorted edges of the
bounding box and the number of faces where two cubes touch (6 n - 2 contacts are the surface),
which must be equal, and in the principal radii of gyration, which may differ by `TOLERANCE`.
What is left is how the cubes follow one another, which takes more than an outline.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from iqtt.shapes.polycube import Cubes

TOLERANCE = 0.05  # cube edges, between the principal radii of gyration of two matched shapes
PARTNERS = 6  # most partners of a shape
_APART = 100.0  # cube edges between groups that must not be matched: larger than any radius


def gyration_radii(cubes: Cubes) -> NDArray[np.float64]:
    """Return the principal radii of gyration of each shape, (S, 3), rising, cube edges.

    They are the roots of the eigenvalues of the covariance of the points in its solid cubes. They
    are rounded to 1e-6, so that every machine finds the same matches.
    """
    offset = cubes - cubes.mean(axis=1, keepdims=True)
    covariance = np.swapaxes(offset, 1, 2) @ offset / cubes.shape[1] + np.eye(3) / 12
    return np.asarray(np.sqrt(np.linalg.eigvalsh(covariance)).round(6))


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
    edges = np.sort(cubes.max(axis=1) - cubes.min(axis=1), axis=1)
    exact = np.column_stack([edges, contacts(cubes)])
    _, group = np.unique(exact, axis=0, return_inverse=True)
    places = np.column_stack([gyration_radii(cubes), _APART * group.reshape(-1)])
    if len(cubes) < 3:
        return np.zeros((0, 1 + PARTNERS), np.intp)
    far, rows = cKDTree(places).query(places, 1 + PARTNERS, distance_upper_bound=TOLERANCE)
    # A shape with a twin of equal radii may come second in its own row: it is put first.
    far[rows == np.arange(len(cubes))[:, None]] = -1
    order = np.lexsort((rows, far.round(6)), axis=1)
    rows = np.take_along_axis(np.where(np.isinf(far), -1, rows), order, axis=1)
    return np.asarray(rows[rows[:, 2] >= 0])
