"""The mesh that the method deforms: an icosphere, and the smoothing of offsets over its edges."""

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
SMOOTHING = 6.0  # weight of the Laplacian; offsets that change from vertex to vertex are damped


@cache
def icosphere(subdivisions: int = 2) -> tuple[Array, Array]:
    """Return vertices on the unit sphere, (V, 3), and triangles, (F, 3), outside on the left.

    Two subdivisions give 162 vertices and 320 triangles. The vertices of a coarser icosphere are
    the first ones of a finer one.
    """
    golden = (1 + 5**0.5) / 2
    signs = [(a, b * golden) for a in (1.0, -1.0) for b in (1.0, -1.0)]
    corners = np.array([np.roll((0.0, a, b), turn) for turn in range(3) for a, b in signs])
    corners /= np.linalg.norm(corners, axis=1, keepdims=True)
    near = np.linalg.norm(corners[:, None] - corners, axis=2) < 1.1  # an edge is 1.051 long
    triples = [(i, j, k) for i in range(12) for j in range(i) for k in range(j)]
    faces = np.array(
        [t for t in triples if near[t[0], t[1]] and near[t[1], t[2]] and near[t[0], t[2]]]
    )
    inward = np.linalg.det(corners[faces]) < 0
    faces[inward] = faces[inward][:, ::-1]
    for _ in range(subdivisions):
        corners, faces = _subdivided(corners, faces)
    return corners, faces


def _subdivided(corners: Array, faces: Array) -> tuple[Array, Array]:
    """Return the mesh with each triangle cut into four, the new vertices pushed to the sphere."""
    edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]], axis=2).reshape(-1, 2)
    unique, number = np.unique(edges, axis=0, return_inverse=True)
    middles = corners[unique].sum(axis=1)
    middles /= np.linalg.norm(middles, axis=1, keepdims=True)
    a, b, c = faces.T
    ab, bc, ca = (len(corners) + number.reshape(-1, 3)).T
    four = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    return np.concatenate([corners, middles]), np.concatenate([np.stack(t, axis=1) for t in four])


@cache
def smoothing() -> Array:
    """Return the matrix that smooths values of the vertices, (V, V): (1 + SMOOTHING L)^-1.

    L is the Laplacian of the mesh's graph, divided by the number of neighbours. A constant stays
    as it is; what differs from one vertex to the next is damped.
    """
    corners, faces = icosphere()
    linked = np.zeros((len(corners), len(corners)))
    linked[faces, np.roll(faces, 1, axis=1)] = 1.0
    linked = np.maximum(linked, linked.T)
    laplacian = np.eye(len(corners)) - linked / linked.sum(axis=1, keepdims=True)
    return np.linalg.inv(np.eye(len(corners)) + SMOOTHING * laplacian)
