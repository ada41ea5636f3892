"""Exact surfaces in numpy against Embree on their meshes, and from the inside."""

import numpy as np
import pytest
from trimesh import Trimesh
from trimesh.ray.ray_pyembree import RayMeshIntersector

from scenegen.description.shapes import BASIC_SHAPES
from scenegen.objects.basic_shapes import unit_shape
from scenegen.rendering.surfaces.in_numpy import cast_at_surface

EXACT = tuple(shape.name for shape in BASIC_SHAPES if shape.volume)
POLYHEDRA = set(EXACT) - {"sphere", "cone", "torus", "cylinder", "capsule"}
RAYS = 5000  # from outside, and as many from inside
TESSELLATION = 4.5e-5  # how far a mesh may lie off its surface


def rays(distance, seed):
    """Return rays from this distance towards points of the unit ball, directions of any length."""
    rng = np.random.default_rng(seed)
    origins, targets = rng.standard_normal((2, RAYS, 3))
    origins *= distance / np.linalg.norm(origins, axis=1, keepdims=True)
    targets *= rng.random((RAYS, 1)) ** (1 / 3) / np.linalg.norm(targets, axis=1, keepdims=True)
    return origins, (targets - origins) * rng.uniform(0.3, 3.0, (RAYS, 1))


@pytest.mark.parametrize("name", EXACT)
def test_hits_are_those_of_the_mesh_within_its_tessellation(name):
    """Of rays from outside and from inside."""
    shape = unit_shape(name)
    assert shape.surface is not None
    origins, directions = (np.concatenate(x) for x in zip(rays(3.0, 1), rays(0.2, 1), strict=True))
    t, normals = cast_at_surface(shape.surface, origins, directions)
    corners = shape.triangles.reshape(-1, 3)
    mesh = Trimesh(corners, np.arange(len(corners)).reshape(-1, 3), process=False)
    points, which, faces = RayMeshIntersector(mesh).intersects_location(
        origins, directions, multiple_hits=False
    )
    met = np.zeros(len(origins), bool)
    met[which] = True
    assert (np.isfinite(t) != met).sum() <= (0 if name in POLYHEDRA else 6)
    both = np.isfinite(t[which])
    points, which, faces = points[both], which[both], faces[both]
    assert len(which) > RAYS / 2
    found = origins[which] + t[which, None] * directions[which]
    off = np.einsum("ri,ri->r", found - points, mesh.face_normals[faces])
    aligned = np.einsum("ri,ri->r", normals[which], mesh.face_normals[faces])
    some = 1.0 if name in POLYHEDRA else 0.999  # a ray at a rim may hit its other side
    assert np.quantile(abs(off), some) < (1e-14 if name in POLYHEDRA else TESSELLATION)
    assert np.quantile(aligned, 1 - some) > (1 - 1e-14 if name in POLYHEDRA else 0.9999)


def test_nothing_behind_a_ray_is_hit():
    origins, directions = rays(3.0, seed=2)
    for name in EXACT:
        surface = unit_shape(name).surface
        assert surface is not None
        assert np.isinf(cast_at_surface(surface, origins, -directions)[0]).all()
