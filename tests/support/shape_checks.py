"""Checks and rays that the tests of all kinds of objects share."""

import numpy as np
import pytest
import trimesh
from trimesh.ray.ray_pyembree import RayMeshIntersector

from scenegen.objects.solids import Array, UnitShape

DOWN = np.array([[0.0, -1.0, 0.0]])


def unit_vectors(count: int) -> Array:
    vectors = np.random.default_rng(0).standard_normal((count, 3))
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))


def support(shape: UnitShape, directions: Array) -> Array:
    """Return how far the convex body reaches along unit directions, (M, 3) -> (M,)."""
    flat = np.hypot(directions[:, 0], directions[:, 2])
    reach = shape.hull_points @ directions.T + shape.hull_discs[:, None] * flat
    return np.asarray(reach.max(axis=0) + shape.rounding)


def check_size(shape: UnitShape, tolerance: float = 1e-12) -> None:
    """Check that the bounding radius and the lengths of all normals are 1."""
    assert np.linalg.norm(shape.triangles, axis=-1).max() == pytest.approx(1.0, abs=tolerance)
    np.testing.assert_allclose(np.linalg.norm(shape.normals, axis=-1), 1.0, atol=1e-12)


def check_centred(corners: Array, tolerance: float) -> None:
    np.testing.assert_allclose(corners.min(axis=0) + corners.max(axis=0), 0.0, atol=tolerance)


def check_body(
    shape: UnitShape, corners: Array, most: float, directions: Array, slack: float = 1e-12
) -> None:
    """Check that the convex body contains the corners and reaches at most `most` beyond them."""
    corners = corners.reshape(-1, 3)
    excess = support(shape, directions) - [(corners @ one).max() for one in directions]
    assert excess.min() > -slack, f"{shape.name}: the body must contain the mesh"
    assert excess.max() < most, shape.name


def unit_triangles(mesh: trimesh.Trimesh) -> Array:
    """Return a mesh brought to unit size by trimesh's own numbers, in double precision."""
    centered = mesh.triangles - mesh.bounds.mean(axis=0)
    return np.asarray(centered / np.linalg.norm(centered, axis=2).max())


def first_hits(triangles: Array, origins: Array, directions: Array) -> tuple[Array, Array]:
    """Return Embree's distances along rays, inf where nothing is hit, and the triangles hit."""
    corners = np.asarray(triangles, float).reshape(-1, 3)
    mesh = trimesh.Trimesh(corners, np.arange(len(corners)).reshape(-1, 3), process=False)
    points, rays, faces = RayMeshIntersector(mesh).intersects_location(
        origins, directions, multiple_hits=False
    )
    distance, face = np.full(len(origins), np.inf), np.full(len(origins), -1)
    distance[rays], face[rays] = np.linalg.norm(points - origins[rays], axis=1), faces
    return distance, face


def rays_inwards(count: int) -> tuple[Array, Array]:
    """Return origins at distance 2 and directions of rays towards the middle of the unit sphere."""
    origins, targets = np.random.default_rng(0).standard_normal((2, count, 3))
    origins *= 2 / np.linalg.norm(origins, axis=1, keepdims=True)
    directions = 0.3 * targets - origins
    return origins, directions / np.linalg.norm(directions, axis=1, keepdims=True)
