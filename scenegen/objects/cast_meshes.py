"""Shapes in the form that is rendered: in single precision; triangles grown for trees."""

from collections.abc import Sequence

import numpy as np

from scenegen.common.rotations import cross
from scenegen.objects.solids import Array, Mesh, UnitShape, face_vectors

OVERLAP = 4e-6  # of neighbouring triangles; rays slip between them if it is below 2e-6


def cast_mesh(mesh: Mesh) -> Mesh:
    """Return a mesh as the rasteriser takes it: float32, and vertices numbered by few bytes."""
    number = np.uint16 if len(mesh.vertices) <= 2**16 else np.uint32
    normals = mesh.normals
    return Mesh(
        mesh.vertices.astype(np.float32, copy=False),
        mesh.faces.astype(number),
        None if normals is None else normals.astype(np.float32),
    )


def normal_table(shape: UnitShape) -> Array:
    """Return face normal and three corner normals of each triangle, (F, 12) float32."""
    face = face_vectors(shape.triangles)
    length = _norm(face)
    table = np.empty((len(shape.triangles), 12), np.float32)
    for i in range(3):
        table[:, i] = face[i] / length
    table[:, 3:] = shape.normals.reshape(-1, 9)
    return table


def corner_table(shape: UnitShape) -> Array:
    """Return three corners of each triangle, and the number of the triangle beyond the side that is
    opposite to each of them, (F, 12) float32. A side at a border has its own triangle beyond it.
    """
    corners = shape.triangles.astype(np.float32)
    count = len(corners)
    vertex = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)[1].reshape(count, 3)
    sides = np.sort(np.stack([np.roll(vertex, -k, axis=1)[:, 1:] for k in range(3)]), axis=2)
    key = (sides[..., 0] * (3 * count) + sides[..., 1]).ravel()
    order = np.argsort(key, kind="stable")
    first = np.flatnonzero(key[order[1:]] == key[order[:-1]])
    beyond = np.tile(np.arange(count), 3)
    one, other = order[first], order[first + 1]
    beyond[one], beyond[other] = other % count, one % count
    return np.concatenate([corners.reshape(-1, 9), beyond.reshape(3, -1).T], axis=1)


def overlapping(triangles: Array) -> Array:
    """Move the edges of triangles, (F, 3, 3), outwards by OVERLAP, within their planes.

    Otherwise a ray that meets a shared edge may slip through, as rounding can put it outside both
    triangles. No corner moves by more than four times OVERLAP.
    """
    corners = [np.ascontiguousarray(triangles[:, k].T) for k in range(3)]  # (3, F) each: faster
    edges = [corners[(k + 1) % 3] - corners[k] for k in range(3)]  # from each corner to the next
    length = [_norm(edge) for edge in edges]
    along = [edges[k] / np.maximum(length[k], 1e-30) for k in range(3)]
    double_area = _norm(cross(edges[0], edges[1]))
    grown = np.empty(triangles.shape)
    for k in range(3):
        # Moving a corner against the sum of its two edges' directions moves both edges outwards.
        outward = along[k - 1] - along[k]
        sine = double_area / np.maximum(length[k] * length[k - 1], 1e-30)
        scale = OVERLAP / np.maximum(np.maximum(sine, _norm(outward) / 4), 1e-30)
        grown[:, k] = (corners[k] + outward * scale).T
    return grown


def _norm(vectors: Sequence[Array]) -> Array:
    """Return the lengths of vectors given by components."""
    x, y, z = vectors
    return np.asarray(np.sqrt(x * x + y * y + z * z))
