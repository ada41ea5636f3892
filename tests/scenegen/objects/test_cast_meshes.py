"""Shapes as they are rendered: triangles, grown for trees alone, and normals."""

import numpy as np
import pytest

from scenegen.objects.cast_meshes import OVERLAP, cast_mesh, overlapping
from scenegen.objects.catalogue import built_in_shape
from scenegen.objects.solids import Mesh

BASIC = ("box", "torus", "teapot", "icosahedron", "cone")
MODELS = ("mug/0001", "chair/0002", "bottle/0003", "bag/0004", "table/0005")


def test_meshes_are_cast_in_single_precision():
    shape = built_in_shape("mug/0001")
    mesh = cast_mesh(shape.mesh)
    assert (mesh.vertices.dtype, mesh.faces.dtype) == (np.float32, np.uint16)
    np.testing.assert_array_equal(mesh.vertices[mesh.faces], np.float32(shape.triangles))
    np.testing.assert_array_equal(mesh.normals[mesh.faces], np.float32(shape.normals))
    flat = cast_mesh(Mesh(np.zeros((2**16 + 1, 3)), np.array([[0, 1, 2**16]]), None))
    assert flat.normals is None
    assert flat.faces.tolist() == [[0, 1, 2**16]]


@pytest.mark.parametrize("name", [*BASIC, *MODELS])
def test_triangles_grow_by_the_overlap_each_in_its_plane(name):
    triangles = built_in_shape(name).triangles
    grown = overlapping(triangles)
    edges = np.roll(triangles, -1, axis=1) - triangles
    normals = np.cross(edges[:, 0], edges[:, 1])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    moved = grown - triangles
    assert abs(np.einsum("fki,fi->fk", moved, normals)).max() < 1e-12
    assert np.linalg.norm(moved, axis=2).max() <= 4.0001 * OVERLAP
    outward = np.cross(edges, normals[:, None])
    outward /= np.linalg.norm(outward, axis=2, keepdims=True)
    start, end = (np.einsum("fki,fki->fk", m, outward) for m in (moved, np.roll(moved, -1, axis=1)))
    assert min(start.min(), end.min()) > -1e-15
    sharp = np.linalg.norm(moved, axis=2) > 3.99 * OVERLAP
    blunt = ~(sharp | np.roll(sharp, -1, axis=1))
    np.testing.assert_allclose(start[blunt], OVERLAP, rtol=1e-6)
    np.testing.assert_allclose(end[blunt], OVERLAP, rtol=1e-6)


def test_degenerate_triangles_stay_finite():
    point, line = np.ones((1, 3, 3)), np.arange(9.0).reshape(1, 3, 3)
    for triangle in (point, line):
        grown = overlapping(triangle)
        assert np.isfinite(grown).all()
        assert np.linalg.norm(grown - triangle, axis=2).max() <= 4.0001 * OVERLAP
